//! What a centre method offers, and the one that rests on the ball's appearance.

use super::appearance::AppearanceSettings;
use super::disc::{Centre, Disc};
use super::edge_likelihood::{self, Appearance};
use super::patch::Patch;

/// A way to find the centre of the ball in one frame.
pub trait CentreMethod: std::fmt::Debug + Sync {
    /// What it is called.
    fn words(&self) -> MethodWords;

    /// How the ball's appearance is estimated beforehand; `None` where the method does without.
    fn appearance(&self) -> Option<&AppearanceSettings> {
        None
    }

    /// The centre; `None` where the pixels do not hold it.
    fn centre(&self, input: &CentreInput<'_>) -> Option<Centre>;
}

/// What a centre method is called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MethodWords {
    /// On the command line and in files.
    pub name: &'static str,
    /// In the help of the command line.
    pub help: &'static str,
    /// In results; it begins with the name.
    pub description: &'static str,
}

/// What is known of the ball in a frame before its centre is found. Places and lengths are those of the affine patch where
/// there is one.
#[derive(Debug, Clone, Copy)]
pub struct CentreInput<'a> {
    /// The pixels around it.
    pub patch: &'a Patch<'a>,
    /// Roughly where it is, its radius, and its path during the exposure.
    pub start: Disc,
    /// What it looks like.
    pub appearance: Option<&'a Appearance>,
    /// How many times larger than usual it is.
    pub magnification: f64,
    /// The frame's brightness over the reference's.
    pub gain: f64,
    /// By how much it is brighter than what is behind it, grey levels.
    pub contrast_grey: f64,
}

/// The likelihood of the pixels around the edge, the ball's appearance being known ([`edge_likelihood`]).
#[derive(Debug)]
pub struct EdgeLikelihood {
    /// What it is called.
    pub words: MethodWords,
    /// How the appearance is estimated; the `fit` of its frames is that of all.
    pub appearance: AppearanceSettings,
}

impl CentreMethod for EdgeLikelihood {
    fn words(&self) -> MethodWords {
        self.words
    }

    fn appearance(&self) -> Option<&AppearanceSettings> {
        Some(&self.appearance)
    }

    fn centre(&self, input: &CentreInput<'_>) -> Option<Centre> {
        let settings = &self.appearance.fit;
        let ball = input.appearance?.magnified(input.magnification, settings);
        edge_likelihood::fit(input.patch, &ball, &input.start, input.gain, settings).map(|found| found.centre)
    }
}
