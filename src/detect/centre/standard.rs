//! `--accuracy standard`: the likelihood fit with the ball's appearance estimated from 40 frames, on at most 1600 pixels of
//! the edge.
//!
//! Error: within 1.15 times the Cramér-Rao bound up to R 40 px; bias of a shaded ball below 0.01 px. Cost: 0.1 to 0.3 ms a
//! frame for a ball of R 15 to 20 px, and some 0.3 s a recording for its appearance (two cores).

use super::appearance::AppearanceSettings;
use super::edge_likelihood::FitSettings;
use super::method::{EdgeLikelihood, MethodWords};

/// The method.
pub const METHOD: EdgeLikelihood = EdgeLikelihood {
    words: MethodWords {
        name: "standard",
        help: "A likelihood fit of the edge",
        description: "standard: likelihood of the edge, learned appearance",
    },
    appearance: AppearanceSettings {
        frames: 40,
        most_pixels: 300,
        rounds: 3,
        again: false,
        fit: FitSettings {
            inside: 0.25,
            most_lookups: 1600,
            steps: 15,
            converged_px: 2e-3,
            rounds: 2,
        },
    },
};
