//! The ball's centre in one frame.
//!
//! | file | what it holds |
//! |---|---|
//! | [`disc`] | the outline of a ball, and a centre with its covariance |
//! | [`patch`], [`affine_patch`] | the pixels around a ball; the ellipse that perspective and lens make of it, as a circle |
//! | [`outline`] | a first circle where nothing is known of the ball yet |
//! | [`ball`] | the model of a ball's pixels that the likelihood fits share |
//! | [`appearance`] | what this recording's ball looks like, estimated from many frames |
//! | [`edge_likelihood`] | the likelihood fit of a centre once that is known |
//! | [`method`] | what a centre method has to offer |
//! | [`fast`], [`standard`], [`fine`] | the methods behind `--accuracy`, each with its cost and error |
//!
//! To add a method: a file with a [`CentreMethod`], and its lines in [`Accuracy`]. The command line, its help, the batch, the
//! comparison of costs and the results take names and words from there.

pub mod affine_patch;
pub mod appearance;
pub mod attached_shadow;
pub mod ball;
pub mod disc;
pub mod edge_likelihood;
pub mod fast;
pub mod fine;
pub mod method;
pub mod outline;
pub mod overexposure;
pub mod patch;
mod shadow_disc;
pub mod standard;

pub use disc::{Centre, Disc};
pub use method::{CentreInput, CentreMethod, MethodWords};
pub use patch::Patch;

/// How much time to spend on accuracy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Accuracy {
    /// For screening: see [`fast`].
    Fast,
    /// What most need: see [`standard`].
    #[default]
    Standard,
    /// The most exact: see [`fine`].
    Fine,
}

impl Accuracy {
    /// All levels, the quickest first.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Standard, Self::Fine];

    /// The method that works where the ball's appearance is not known.
    pub const WITHOUT_APPEARANCE: Self = Self::Fast;

    /// The method behind it: the only place that tells the levels apart.
    #[must_use]
    pub fn method(self) -> &'static dyn CentreMethod {
        match self {
            Self::Fast => &fast::EdgeCircle,
            Self::Standard => &standard::METHOD,
            Self::Fine => &fine::METHOD,
        }
    }

    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.method().words().name
    }

    /// The level that can be had: without the appearance that its method needs, another has to do.
    #[must_use]
    pub fn possible(self, appearance_known: bool) -> Self {
        if appearance_known || self.method().appearance().is_none() {
            self
        } else {
            Self::WITHOUT_APPEARANCE
        }
    }
}

impl std::fmt::Display for Accuracy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
