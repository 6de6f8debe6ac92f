//! Metres per plane unit, with its standard uncertainty, from whichever scale the file names.
//!
//! | kind | metres per unit | standard uncertainty from | file |
//! |---|---|---|---|
//! | metres per pixel | as given | `std_uncertainty` | [`metres_per_pixel`] |
//! | ruler | length / distance of its ends in undistorted pixels | `length_std_m`, `point_std_px` | [`ruler`] |
//! | ball | radius in metres / measured radius | the measured radius, `ball.radius_std_m` | [`ball`] |
//! | gravity | g / measured fall | the measured fall, `gravity_std_m_s2` | [`gravity`] |
//! | homography | 1 | `relative_std` | [`homography`] |
//!
//! Relative variances add. What the file gives without an uncertainty counts as exact beside what has one; where
//! nothing has one, the result is "not determined". The exception is a ruler's ends: whoever reads a point off a
//! picture knows it to a pixel at best, so without `point_std_px` each coordinate has 1/√12 px, the standard deviation of
//! rounding to whole pixels. (That is a floor. A mark that is 3 px wide wants `point_std_px` of about 1.)
//!
//! **A new kind** is a file beside this one that implements [`ScaleKind`], and a line in each of [`Scale`], its `kind`, its
//! `shifted` and [`KINDS`]. Nothing else in the program asks which kind it is.

mod ball;
mod gravity;
mod homography;
mod kind;
mod metres_per_pixel;
mod ruler;

pub(super) use homography::shift_back;
pub(super) use kind::ScaleContext;
pub use kind::{Homography, ScaleEvidence};
pub use metres_per_pixel::MetresPerPixel;
pub use ruler::{ROUNDED_PIXEL_STD_PX, Ruler};

use super::error::CalibrationError;
use super::finding::Finding;
use crate::config::FileProblem;
use crate::config::Section;
use crate::geometry::PixelPoint;
use crate::quantity::Quantity;
use ball::BallScale;
use gravity::GravityScale;
use kind::{NoScale, ScaleKeys, ScaleKind};
use serde_json::Value;

/// Where metres come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// Metres per pixel as given.
    MetresPerPixel(MetresPerPixel),
    /// Two marks and the length between them.
    Ruler(Ruler),
    /// `{"ball": true}`: `ball.radius_m` against the radius measured on the recording.
    Ball,
    /// `{"gravity": true}`: `gravity_m_s2` against the fall measured on the recording.
    Gravity,
    /// A homography to metres.
    Homography(Homography),
}

/// How a kind is read from the object under `scale`.
type Read = fn(&Section<'_>) -> Option<Scale>;

/// Every kind: its keys, and its reader.
static KINDS: [(&ScaleKeys, Read); 5] = [
    (&metres_per_pixel::KEYS, |s| {
        MetresPerPixel::read(s).map(Scale::MetresPerPixel)
    }),
    (&ruler::KEYS, |s| Ruler::read(s).map(Scale::Ruler)),
    (&ball::KEYS, |s| BallScale::read(s).map(|_| Scale::Ball)),
    (&gravity::KEYS, |s| GravityScale::read(s).map(|_| Scale::Gravity)),
    (&homography::KEYS, |s| Homography::read(s).map(Scale::Homography)),
];

impl Scale {
    /// The one place that tells the kinds apart.
    fn kind(&self) -> &dyn ScaleKind {
        match self {
            Self::MetresPerPixel(scale) => scale,
            Self::Ruler(scale) => scale,
            Self::Ball => &BallScale,
            Self::Gravity => &GravityScale,
            Self::Homography(scale) => scale,
        }
    }

    /// The same for a picture shifted by (`du_px`, `dv_px`).
    pub(super) fn shifted(&self, du_px: f64, dv_px: f64) -> Self {
        match self {
            Self::Ruler(ruler) => Self::Ruler(ruler.shifted(du_px, dv_px)),
            Self::Homography(homography) => Self::Homography(homography.shifted(du_px, dv_px)),
            Self::MetresPerPixel(_) | Self::Ball | Self::Gravity => self.clone(),
        }
    }

    /// Metres per plane unit; see the module's head.
    pub(super) fn metres_per_unit(
        &self,
        context: &ScaleContext<'_>,
        evidence: &ScaleEvidence,
    ) -> Result<Quantity, CalibrationError> {
        let kind = self.kind();
        let quantity = kind.metres_per_unit(context, evidence).map_err(|why| match why {
            NoScale::NoEvidence(missing) => CalibrationError::NoEvidence {
                missing,
                others: others(kind.keys()),
            },
            NoScale::Calibration(error) => error,
        })?;
        quantity.filter(|q| q.value > 0.0).ok_or_else(|| {
            CalibrationError::of(FileProblem::new(
                "scale",
                format!("{kind:?}"),
                "a scale that gives a finite number of metres per unit above 0",
                "check the numbers of the scale",
            ))
        })
    }

    /// The homography to metres, where the scale is one.
    #[must_use]
    pub fn homography(&self) -> Option<&Homography> {
        self.kind().homography()
    }

    /// The same, to change it.
    pub(super) const fn homography_mut(&mut self) -> Option<&mut Homography> {
        match self {
            Self::Homography(homography) => Some(homography),
            _ => None,
        }
    }

    /// Whether the scale itself says where the world's origin is.
    pub(super) fn has_origin(&self) -> bool {
        self.homography().is_some_and(|h| h.origin_known)
    }

    /// Whether the scale comes with the world's axes.
    #[must_use]
    pub fn has_axes(&self) -> bool {
        self.homography().is_some()
    }

    /// Whether metres come from the ball as the recording shows it.
    #[must_use]
    pub fn rests_on_ball(&self) -> bool {
        self.kind().rests_on_ball()
    }

    /// Whether metres come from the fall as the recording shows it.
    #[must_use]
    pub fn rests_on_fall(&self) -> bool {
        self.kind().rests_on_fall()
    }

    /// Where metres come from, in words, for a scale that has no number of its own before the recording is measured.
    #[must_use]
    pub fn in_words(&self) -> Option<&'static str> {
        self.kind().in_words()
    }

    /// A length between two marks, m.
    #[must_use]
    pub fn known_length_m(&self) -> Option<f64> {
        self.kind().known_length_m()
    }

    /// The key of the file that holds its uncertainty.
    #[must_use]
    pub fn uncertainty_key(&self) -> &'static str {
        self.kind().uncertainty_key()
    }

    /// Points read off the picture, with their keys.
    pub(super) fn marks(&self) -> Vec<(&'static str, PixelPoint)> {
        self.kind().marks()
    }

    /// What is odd about it.
    pub(super) fn findings(&self, context: &ScaleContext<'_>) -> Vec<Finding> {
        self.kind().findings(context)
    }

    /// The object under `scale` in the file.
    pub(super) fn to_json(&self) -> Value {
        self.kind().to_json()
    }

    /// Every key that may stand under `scale`.
    pub(super) fn keys() -> Vec<&'static str> {
        let of = |keys: &ScaleKeys| [keys.marks, keys.beside].concat();
        KINDS.iter().flat_map(|(keys, _)| of(keys)).collect()
    }

    /// The scale of the file: exactly one kind, and what may stand beside it; `None` where it is missing or wrong.
    pub(super) fn read(top: &Section<'_>) -> Option<Self> {
        let examples: Vec<&str> = KINDS.iter().map(|(keys, _)| keys.example).collect();
        let one_scale = format!("exactly one of {}", examples.join(", "));
        if top.get("scale").is_none() {
            let hint = "measure a known length in the picture, or let the fall be the scale: \"scale\": {\"gravity\": true}";
            top.refuse("scale", "nothing", one_scale, hint);
            return None;
        }
        let section = top.section("scale", &Self::keys())?;
        let given = |keys: &[&str]| keys.iter().any(|key| section.get(key).is_some());
        let named: Vec<&(&ScaleKeys, Read)> = KINDS.iter().filter(|(keys, _)| given(keys.marks)).collect();
        let [(keys, read)] = named[..] else {
            let names: Vec<&str> = named.iter().map(|(keys, _)| keys.name).collect();
            let (found, hint) = match names.len() {
                0 => ("none of the scales".to_owned(), "name one of them"),
                _ => (
                    format!("{} scales: {}", names.len(), names.join(" and ")),
                    "keep the one you trust most",
                ),
            };
            section.refuse("scale", found, one_scale, hint);
            return None;
        };
        let strays = KINDS
            .iter()
            .flat_map(|(other, _)| other.beside)
            .filter(|key| !keys.beside.contains(key) && given(&[key]));
        for stray in strays {
            let accepted = match keys.beside {
                [] => format!("nothing beside {}", keys.name),
                beside => format!("beside {}: {}", keys.name, beside.join(", ")),
            };
            section.refuse(
                section.key(stray),
                "a key of another scale",
                accepted,
                "remove or replace it",
            );
        }
        read(&section)
    }
}

/// The kinds that remain where that of `keys` does not serve, by their keys.
fn others(keys: &ScaleKeys) -> String {
    let others = KINDS.iter().filter(|(other, _)| other.name != keys.name);
    let marks: Vec<String> = others.map(|(other, _)| other.marks.join("/")).collect();
    marks.join(", ")
}

#[cfg(test)]
mod tests;
