//! A chessboard, and a picture in which it was looked for.

use super::error::BoardError;
use super::finder::{self, Corners};
use super::projection::CornerObservation;
use crate::frames::Luma;
use nalgebra::Vector2;

/// Part of the corners that may be missing.
const MISSING_PART: f64 = 0.25;

/// A chessboard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pattern {
    /// Inner corners: a row, and rows.
    pub corners: Corners,
    /// Side of a square, m.
    pub square_m: f64,
    /// Its standard uncertainty, m; `None` where it is not known.
    pub square_std_m: Option<f64>,
}

impl Pattern {
    /// A board of `corners` inner corners with squares of `square_m`.
    ///
    /// # Errors
    /// [`BoardError::Pattern`].
    pub fn new(corners: Corners, square_m: f64, square_std_m: Option<f64>) -> Result<Self, BoardError> {
        let fine = |n: usize| (3..=100).contains(&n);
        if fine(corners.0) && fine(corners.1) {
            return Ok(Self {
                corners,
                square_m,
                square_std_m,
            });
        }
        Err(BoardError::Pattern {
            columns: corners.0,
            rows: corners.1,
        })
    }

    /// Looks for the board in a picture: the slow step, which pictures can take side by side.
    ///
    /// # Errors
    /// [`BoardError::OpenCv`].
    pub fn search(&self, picture: &Luma) -> Result<BoardSearch, BoardError> {
        let size = (picture.width, picture.height);
        let Some(corners) = finder::find(picture, self.corners)? else {
            return Ok(BoardSearch {
                size,
                outcome: Err("no board found".to_owned()),
                without: Some(picture.clone()),
            });
        };
        let all = corners.len();
        let seen: Vec<CornerObservation> = corners
            .into_iter()
            .enumerate()
            .filter_map(|(i, corner)| {
                let corner = corner?;
                Some(CornerObservation {
                    board_m: self.place_m(i),
                    at: corner.at,
                    std_px: corner.std_px,
                })
            })
            .collect();
        let missing = all - seen.len();
        let outcome = if missing as f64 > MISSING_PART * all as f64 {
            Err(format!(
                "{missing} of {all} corners are covered, smeared, overexposed or at the picture's border"
            ))
        } else {
            Ok(seen)
        };
        Ok(BoardSearch {
            size,
            outcome,
            without: None,
        })
    }

    pub(super) fn place_m(&self, index: usize) -> Vector2<f64> {
        let (column, row) = (index % self.corners.0, index / self.corners.0);
        Vector2::new(column as f64, row as f64) * self.square_m
    }
}

/// A picture in which the board was looked for.
#[derive(Debug, Clone)]
pub struct BoardSearch {
    pub(super) size: (usize, usize),
    /// The corners, or why the picture cannot serve.
    pub(super) outcome: Result<Vec<CornerObservation>, String>,
    /// The picture, where there is no board in it.
    pub(super) without: Option<Luma>,
}

/// The error of a picture of the plane that cannot serve for `reason`.
pub(super) fn no_board_in_plane(
    pattern: &Pattern,
    name: String,
    picture: &Luma,
    reason: &str,
) -> Result<BoardError, BoardError> {
    Ok(BoardError::NoBoardInPlane {
        name,
        wanted: pattern.corners,
        hint: match finder::any_board(picture)? {
            Some(found) if !same_corners(found, pattern.corners) => other_board(found),
            _ => format!("{reason}: show the whole board with its white rim, sharp and evenly lit"),
        },
    })
}

pub(super) fn other_board((columns, rows): Corners) -> String {
    format!(
        "there is one of {columns}x{rows} inner corners ({} by {} squares): --pattern counts the points where four \
         squares meet, so try --pattern {columns}x{rows}",
        columns + 1,
        rows + 1
    )
}

pub(super) fn same_corners(a: Corners, b: Corners) -> bool {
    a == b || a == (b.1, b.0)
}
