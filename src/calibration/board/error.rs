//! Why no lens or plane came of pictures of a board, and what to do.

use super::finder::Corners;
use thiserror::Error;

/// Why the pictures of a board do not give a calibration.
#[derive(Debug, Error)]
pub enum BoardError {
    /// A pattern that is none.
    #[error(
        "the pattern {columns}x{rows} is no board: accepted are 3 to 100 inner corners a side, such as 9x6; count the \
         points where four squares meet, not the squares"
    )]
    Pattern {
        /// Corners a row.
        columns: usize,
        /// Rows.
        rows: usize,
    },
    /// No picture shows the board.
    #[error("no board of {}x{} inner corners was found in any of {pictures}; {hint}", wanted.0, wanted.1)]
    NoBoard {
        /// What was looked for.
        wanted: Corners,
        /// How many pictures there were, in words.
        pictures: String,
        /// What was found in its place, and what to try.
        hint: String,
    },
    /// Too few different views.
    #[error(
        "the lens is not determined: {usable} ({aside}); it takes at least {least} pictures with the board in different \
         places, better 10 to 20: turn the board by 20 to 40 degrees to each side, up and down, and bring it into \
         every corner of the picture"
    )]
    TooFewViews {
        /// How many, in words.
        usable: String,
        /// What became of the others, in words.
        aside: String,
        /// How many it takes.
        least: usize,
    },
    /// The views do not fix the lens.
    #[error(
        "the lens is not determined by these {views} views ({found}): they are too much alike. A board that is only seen \
         square, or always from the same side, does not tell a long lens from a large distance. Take pictures with the \
         board turned by 20 to 40 degrees to the left, right, up and down, some near and some far"
    )]
    NotDetermined {
        /// How many.
        views: usize,
        /// What the fit says, in words.
        found: String,
    },
    /// No board in the picture of the plane.
    #[error("{name} (--plane): no board of {}x{} inner corners was found; {hint}", wanted.0, wanted.1)]
    NoBoardInPlane {
        /// The picture.
        name: String,
        /// What was looked for.
        wanted: Corners,
        /// What was found in its place, and what to try.
        hint: String,
    },
    /// The picture of the plane is of another size.
    #[error(
        "{name} (--plane) is {}x{} px, the pictures for the lens are {}x{} px: take all of them with the same camera in \
         the same mode, that of the recording", found.0, found.1, expected.0, expected.1
    )]
    PlaneSize {
        /// The picture.
        name: String,
        /// Its size.
        found: (usize, usize),
        /// The others'.
        expected: (usize, usize),
    },
    /// A calibration without a lens, where one is needed.
    #[error(
        "{name} (--lens) holds no lens: accepted is a calib.json as track calibrate board writes it; give the pictures of the board in its place"
    )]
    NoLens {
        /// The file.
        name: String,
    },
    /// The board leans so that no edge is the upright one.
    #[error(
        "{name} (--plane): the board leans by {lean_deg:.0} degrees, so that it is not clear which edge is upright; stand \
         it on its edge with a spirit level, or give the direction of \"up\" in the picture (--up 0,-1 is up, --up \
         1,0 is to the right)"
    )]
    Askew {
        /// The picture.
        name: String,
        /// From the nearest direction, degrees.
        lean_deg: f64,
    },
    /// A mark in the picture that the plane does not reach.
    #[error("{mark}: [{u}, {v}] is not on the plane of the board: {why}")]
    Mark {
        /// The option.
        mark: &'static str,
        /// Column.
        u: f64,
        /// Row.
        v: f64,
        /// Why.
        why: &'static str,
    },
    /// Trouble of OpenCV.
    #[error("OpenCV failed on the pictures of the board; this is a fault of track, please report it")]
    OpenCv(#[from] opencv::Error),
}

impl BoardError {
    pub(super) fn not_determined(relative_std: Option<f64>, views: usize) -> Self {
        let found = relative_std.map_or_else(
            || "the fit has no solution".to_owned(),
            |s| {
                if s < 1.0 {
                    format!("the focal length is uncertain by {:.0} %", 100.0 * s)
                } else {
                    "the focal length may be anything".to_owned()
                }
            },
        );
        Self::NotDetermined { views, found }
    }
}
