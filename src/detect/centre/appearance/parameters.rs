//! What the appearance is estimated from, and the parameters: those of each frame, and those that all frames share.

use super::tone_curve::ToneCurve;
use crate::detect::centre::ball::{DIPOLE, Edge, norm};
use crate::detect::centre::disc::{Disc, bent_px};
use crate::detect::centre::edge_likelihood::{FitSettings, NUISANCES, SIZE};
use crate::detect::centre::patch::Patch;

/// A frame to estimate from.
#[derive(Debug, Clone)]
pub struct AppearanceFrame<'a> {
    /// The pixels around the ball.
    pub patch: Patch<'a>,
    /// The ball, roughly.
    pub disc: Disc,
    /// Its velocity, px/s.
    pub velocity_px_s: [f64; 2],
    /// And its acceleration, px/s².
    pub acceleration_px_s2: [f64; 2],
    /// The frame's brightness over the usual one.
    pub gain: f64,
    /// How many times larger than usual the ball is seen, as it is nearer to the camera; 1 where that does not change.
    pub magnification: f64,
}

/// How much work an estimate may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AppearanceSettings {
    /// Frames to estimate from, about.
    pub frames: usize,
    /// Pixels of each, at most.
    pub most_pixels: usize,
    /// Rounds of appearance and centres in turn.
    pub rounds: usize,
    /// Whether it is estimated again once all centres of the recording are known.
    pub again: bool,
    /// How centres are fitted, those of these frames and of all.
    pub fit: FitSettings,
}

/// Fewer frames tell too little.
pub const LEAST_FRAMES: usize = 3;

/// An outline is at half of the edge's height, which shading and blur put up to this far from the rim, px.
pub const OUTLINE_STD_PX: f64 = 0.2;

/// A frame with its own parameters as far as they are known.
pub struct FrameEstimate<'a> {
    pub input: &'a AppearanceFrame<'a>,
    pub disc: Disc,
    pub nuisance: [f64; NUISANCES],
    /// Whether the last round could fit it.
    pub fitted: bool,
}

impl<'a> FrameEstimate<'a> {
    pub fn new(input: &'a AppearanceFrame<'a>) -> Self {
        Self {
            input,
            disc: input.disc,
            nuisance: [0.0; NUISANCES],
            fitted: true,
        }
    }

    pub fn disc_with(&self, shared: &SharedParameters) -> Disc {
        Disc {
            centre: self.disc.centre,
            radius_px: shared.radius_px * self.input.magnification + self.nuisance[SIZE],
            swept_px: self.input.velocity_px_s.map(|v| v * shared.exposure_s),
            bent_px: bent_px(self.input.acceleration_px_s2, shared.exposure_s),
        }
    }

    pub fn speed_px_s(&self) -> f64 {
        norm(self.input.velocity_px_s[0], self.input.velocity_px_s[1])
    }
}

/// The parameters that all frames share.
#[derive(Debug, Clone)]
pub struct SharedParameters {
    pub radius_px: f64,
    /// The radius is not fitted.
    pub radius_held: bool,
    pub blur_px: f64,
    /// What the camera sharpens by, of [`Edge`]; it is not fitted.
    pub sharpening: f64,
    pub exposure_s: f64,
    /// No shutter is open longer.
    pub longest_exposure_s: f64,
    /// Of the ball's light, see [`super::super::ball`]: grey levels, or light where there is a tone curve.
    pub terms: Vec<f64>,
    /// The curve that light is stored by: ball and wall are mixed as light then, else as grey levels.
    pub tone: Option<ToneCurve>,
}

impl SharedParameters {
    /// The ball's edge.
    pub fn edge(&self) -> Edge {
        Edge {
            blur_px: self.blur_px,
            sharpening: self.sharpening,
        }
    }

    /// Moves what all frames have in `common` from their nuisance parameters into the shared ones: the usual ball is the
    /// median one, and a light that all frames have belongs to the ball.
    pub fn absorb(&mut self, frames: &mut [FrameEstimate<'_>], mut common: [f64; NUISANCES]) {
        if self.radius_held {
            common[SIZE] = 0.0;
        }
        self.radius_px += common[SIZE];
        self.terms.resize(self.terms.len().max(DIPOLE.end), 0.0);
        for t in &mut self.terms {
            *t *= 1.0 + common[0];
        }
        for (t, m) in self.terms[DIPOLE].iter_mut().zip(&common[1..]) {
            *t += m;
        }
        for f in frames {
            for (d, m) in f.nuisance.iter_mut().zip(&common) {
                *d -= m;
            }
        }
    }
}
