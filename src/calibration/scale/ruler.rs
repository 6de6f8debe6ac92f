//! A ruler: two marks in the plane of motion and the length between them.

use super::kind::{NoScale, ScaleContext, ScaleEvidence, ScaleKeys, ScaleKind, quantity};
use crate::calibration::error::CalibrationError;
use crate::calibration::finding::Finding;
use crate::calibration::json::{object, point};
use crate::calibration::rectification::Rectification;
use crate::config::{PAIR, POSITIVE, Section};
use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use nalgebra::Vector2;
use serde_json::Value;

/// Standard deviation of a coordinate rounded to whole pixels, px: 1/√12.
pub const ROUNDED_PIXEL_STD_PX: f64 = 0.288_675_134_594_812_9;

/// `{"from_px": [u, v], "to_px": [u, v], "length_m": ..., "length_std_m": ..., "point_std_px": ...}`: two marks in the plane
/// of motion, in pixels of the picture, and the length between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ruler {
    /// One end, as the picture shows it.
    pub from: PixelPoint,
    /// The other end.
    pub to: PixelPoint,
    /// Length between them, m.
    pub length_m: f64,
    /// Standard uncertainty of the length, m; `None`: taken as exact.
    pub length_std_m: Option<f64>,
    /// Standard uncertainty of each coordinate of each end, px; `None`: [`ROUNDED_PIXEL_STD_PX`].
    pub point_std_px: Option<f64>,
}

pub(super) static KEYS: ScaleKeys = ScaleKeys {
    name: "ruler (from_px, to_px, length_m)",
    marks: &["from_px", "to_px", "length_m"],
    beside: &["length_std_m", "point_std_px"],
    example: "{\"from_px\": [u, v], \"to_px\": [u, v], \"length_m\": m}",
};

impl Ruler {
    pub(super) fn read(section: &Section<'_>) -> Option<Self> {
        let end = |name: &str| {
            if section.get(name).is_none() {
                section.refuse(
                    section.key(name),
                    "nothing",
                    PAIR,
                    "a ruler has two ends: give from_px and to_px",
                );
            }
            section.pixel(name)
        };
        let (from, to) = (end("from_px"), end("to_px"));
        let length_m = section.required_number(
            "length_m",
            POSITIVE.or_try("the length between the two ends, in metres"),
        );
        let length_std_m = section.std_uncertainty("length_std_m", length_m);
        let point_std_px = section.number(
            "point_std_px",
            POSITIVE.or_try("leave it out for the rounding to whole pixels"),
        );
        let (from, to) = (from?, to?);
        let apart = from.distance_px(to) >= 1.0;
        if !apart {
            section.refuse(
                section.key("to_px"),
                format!("[{}, {}], less than 1 px from from_px", to.u_px, to.v_px),
                "two ends at least 1 px apart",
                "choose marks as far apart as the picture allows",
            );
            return None;
        }
        Some(Self {
            from,
            to,
            length_m: length_m?,
            length_std_m,
            point_std_px,
        })
    }

    /// The same ruler in a picture shifted by (`du_px`, `dv_px`).
    pub(super) fn shifted(&self, du_px: f64, dv_px: f64) -> Self {
        Self {
            from: self.from.shifted(du_px, dv_px),
            to: self.to.shifted(du_px, dv_px),
            ..*self
        }
    }

    /// Distance of the ends in undistorted pixels and its relative standard uncertainty.
    fn distance_px(&self, plane: &Rectification) -> Result<(f64, f64), CalibrationError> {
        let end = |key: &str, p: PixelPoint| {
            plane
                .plane_from_pixel(p)
                .zip(plane.jacobian(p))
                .ok_or_else(|| CalibrationError::of(Rectification::beyond_lens(&format!("scale.{key}"), p)))
        };
        let (a, at_a) = end("from_px", self.from)?;
        let (b, at_b) = end("to_px", self.to)?;
        let along = Vector2::new(b.right - a.right, b.up - a.up);
        let distance = along.norm();
        let direction = along / distance;
        // Uncorrelated coordinates with one standard deviation: the distance changes by Jᵀ·direction per px of either end.
        let magnification = (at_a.transpose() * direction)
            .norm()
            .hypot((at_b.transpose() * direction).norm());
        let std = self.point_std_px.unwrap_or(ROUNDED_PIXEL_STD_PX) * magnification;
        Ok((distance, std / distance))
    }
}

impl ScaleKind for Ruler {
    fn keys(&self) -> &'static ScaleKeys {
        &KEYS
    }

    fn metres_per_unit(
        &self,
        context: &ScaleContext<'_>,
        _evidence: &ScaleEvidence,
    ) -> Result<Option<Quantity>, NoScale> {
        let (distance, relative) = self.distance_px(&(context.plane)()?)?;
        let of_length = self.length_std_m.map(|s| s / self.length_m);
        Ok(quantity(self.length_m / distance, &[of_length, Some(relative)]))
    }

    fn to_json(&self) -> Value {
        object([
            ("from_px", Some(point(self.from))),
            ("to_px", Some(point(self.to))),
            ("length_m", Some(self.length_m.into())),
            ("length_std_m", self.length_std_m.map(Value::from)),
            ("point_std_px", self.point_std_px.map(Value::from)),
        ])
    }

    fn known_length_m(&self) -> Option<f64> {
        Some(self.length_m)
    }

    fn marks(&self) -> Vec<(&'static str, PixelPoint)> {
        vec![("scale.from_px", self.from), ("scale.to_px", self.to)]
    }

    fn findings(&self, context: &ScaleContext<'_>) -> Vec<Finding> {
        let mut out = Vec::new();
        if self.length_std_m.is_none() {
            out.push(Finding::remark(
                "scale.length_std_m",
                "not given, so that the ruler's length counts as exact; a tape measure is good to about 0.5 mm",
            ));
        }
        if self.point_std_px.is_none() {
            out.push(Finding::remark(
                "scale.point_std_px",
                "not given, so that its ends count as read to the pixel (0.29 px); by eye 1 px is usual",
            ));
        }
        let relative = self
            .metres_per_unit(context, &ScaleEvidence::default())
            .ok()
            .flatten()
            .and_then(|q| Some(q.std_uncertainty? / q.value));
        if let Some(relative) = relative.filter(|r| *r > 0.01) {
            out.push(Finding::remark(
                "scale",
                format!(
                    "the ruler is {:.0} px long, which makes every length and speed uncertain by {:.1} %: use marks farther apart",
                    self.from.distance_px(self.to),
                    100.0 * relative
                ),
            ));
        }
        out
    }
}
