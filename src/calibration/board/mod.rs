//! A lens, and the plane of motion, from pictures of a chessboard.
//!
//! `pattern` and `views` (the board, its pictures), `finder` (where the board is) → `corner` (each corner, to a hundredth of a pixel) → `outliers` (which views and corners
//! serve) with `lens_fit` (camera, poses, covariance; `bundle` has the equations) → `coverage` (how sure the lens is where in
//! the picture) → `plane_fit` (the plane of motion, its "up" and origin; `known_lens` where the lens is given) → `principal_deviations`
//! (the calibration's [`Deviation`](super::Deviation)s).
//!
//! [`BoardViews`] takes the pictures one by one; those that cannot serve are set aside with their reason.

mod board_lens;
mod bundle;
mod corner;
mod coverage;
mod error;
mod finder;
mod known_lens;
mod lens_fit;
mod outliers;
mod pattern;
mod plane_fit;
mod principal_deviations;
mod projection;
mod views;

pub use board_lens::BoardLens;
pub use coverage::{CELLS as COVERAGE_CELLS, Coverage};
pub use error::BoardError;
pub use finder::Corners;
pub use known_lens::plane_with_lens;
pub use lens_fit::{LensFit, LensTerms};
pub use pattern::{BoardSearch, Pattern};
pub use plane_fit::{MotionPlane, PlaneMarks};
pub use projection::Pose;
pub use views::{BoardView, BoardViews, ViewUse};
