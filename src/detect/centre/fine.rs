//! `--accuracy fine`: the likelihood fit with every pixel of the edge, converged to 1e-5 px, with the ball's appearance
//! estimated from 48 frames, and once more when all centres are known.
//!
//! Error: within 1.15 times the Cramér-Rao bound; bias of a shaded ball below 0.01 px. Cost: two to five times that of
//! `standard`, more for balls above R 20 px.

use super::appearance::AppearanceSettings;
use super::edge_likelihood::FitSettings;
use super::method::{EdgeLikelihood, MethodWords};

/// The method.
pub const METHOD: EdgeLikelihood = EdgeLikelihood {
    words: MethodWords {
        name: "fine",
        help: "The same of every pixel, learned twice",
        description: "fine: likelihood of every edge pixel, learned appearance",
    },
    appearance: AppearanceSettings {
        frames: 48,
        most_pixels: 600,
        rounds: 3,
        again: true,
        fit: FitSettings {
            inside: 0.25,
            most_lookups: 30_000,
            steps: 15,
            converged_px: 1e-5,
            rounds: 2,
        },
    },
};
