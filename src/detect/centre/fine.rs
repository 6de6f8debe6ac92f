//! `--accuracy fine`: the likelihood fit with every pixel of the edge, converged to 1e-5 px, with the ball's appearance
//! learned from 48 frames and learned again once all centres are known.
//!
//! Error: within 1.15 times the Cramér-Rao bound; bias of a shaded ball below 0.01 px. Cost: two to five times that of
//! `standard`, more for balls above R 20 px.

use super::appearance::AppearanceSettings;
use super::known_ball::FitSettings;

/// How much work the centre of a frame is worth.
pub const FIT: FitSettings = FitSettings {
    inside: 0.25,
    most_lookups: 30_000,
    steps: 15,
    converged_px: 1e-5,
    rounds: 2,
};

/// How much is learned beforehand.
pub const APPEARANCE: AppearanceSettings = AppearanceSettings {
    frames: 48,
    most_pixels: 600,
    rounds: 3,
    fit: FIT,
};
