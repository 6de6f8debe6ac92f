//! A homography from undistorted pixels to the world's x and up, in metres: then a plane unit is a metre already.

use super::kind::{Homography, NoScale, ScaleContext, ScaleEvidence, ScaleKeys, ScaleKind, quantity};
use crate::calibration::finding::Finding;
use crate::calibration::json::{object, rows};
use crate::config::Section;
use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use nalgebra::Matrix3;
use serde_json::Value;

pub(super) static KEYS: ScaleKeys = ScaleKeys {
    name: "world_from_pixel",
    marks: &["world_from_pixel"],
    beside: &["relative_std", "origin_unknown"],
    example: "{\"world_from_pixel\": [[..], [..], [..]]}",
};

impl Homography {
    pub(super) fn read(section: &Section<'_>) -> Option<Self> {
        let form = "three rows of three numbers [[..], [..], [..]], from undistorted pixels to metres";
        let matrix = section.required_matrix("world_from_pixel", form, "write the matrix row by row");
        let relative_std = section.std_uncertainty("relative_std", Some(1.0));
        let unknown = section.get("origin_unknown").is_some();
        if unknown {
            let hint = "leave it out where the matrix's origin is the launch edge at the floor";
            section.flag("origin_unknown", hint);
        }
        Some(Self {
            world_from_pixel: matrix?,
            relative_std,
            origin_known: !unknown,
        })
    }

    /// The same plane in a picture shifted by (`du_px`, `dv_px`).
    pub(super) fn shifted(&self, du_px: f64, dv_px: f64) -> Self {
        Self {
            world_from_pixel: self.world_from_pixel * shift_back(du_px, dv_px),
            ..*self
        }
    }
}

/// Takes pixels of a picture shifted by (`du_px`, `dv_px`) back to where they were.
pub(in crate::calibration) fn shift_back(du_px: f64, dv_px: f64) -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, -du_px, 0.0, 1.0, -dv_px, 0.0, 0.0, 1.0)
}

impl ScaleKind for Homography {
    fn keys(&self) -> &'static ScaleKeys {
        &KEYS
    }

    fn metres_per_unit(
        &self,
        _context: &ScaleContext<'_>,
        _evidence: &ScaleEvidence,
    ) -> Result<Option<Quantity>, NoScale> {
        Ok(quantity(1.0, &[self.relative_std]))
    }

    fn to_json(&self) -> Value {
        object([
            ("world_from_pixel", Some(rows(&self.world_from_pixel))),
            ("relative_std", self.relative_std.map(Value::from)),
            ("origin_unknown", (!self.origin_known).then(|| true.into())),
        ])
    }

    fn homography(&self) -> Option<&Homography> {
        Some(self)
    }

    fn uncertainty_key(&self) -> &'static str {
        "scale.relative_std"
    }

    fn findings(&self, context: &ScaleContext<'_>) -> Vec<Finding> {
        let key = "scale.world_from_pixel";
        let mut out = Vec::new();
        if self.relative_std.is_none() {
            out.push(Finding::remark(
                "scale.relative_std",
                "not given, so that the board's (or the points') size counts as exact; 0.001 is 0.1 %",
            ));
        }
        if !self.origin_known {
            out.push(Finding::remark(
                "scale.origin_unknown",
                "the origin is not that of the experiment: the floor is found from the impacts, and x0 needs the launch edge (calibrate with --floor and --edge)",
            ));
        }
        let (Some(size), Ok(map)) = (context.image_size_px, (context.plane)()) else {
            return out;
        };
        let middle = PixelPoint::new(size.0 as f64 / 2.0, size.1 as f64 / 2.0);
        if map.jacobian(middle).is_some_and(|j| j.determinant() > 0.0) {
            out.push(Finding::problem(
                key,
                "it mirrors the picture: with x to the right, its second coordinate runs down; the world's z is up",
            ));
        }
        let (right, bottom) = (size.0 as f64 - 1.0, size.1 as f64 - 1.0);
        let corners = [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)];
        if corners
            .iter()
            .any(|&(u, v)| map.plane_from_pixel(PixelPoint::new(u, v)).is_none())
        {
            out.push(Finding::remark(key, "a corner of the picture is beyond the plane's horizon (or the lens's reach): a ball there is not measured"));
        }
        out
    }
}
