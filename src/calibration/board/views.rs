//! Pictures of one board by one camera, and what became of each.

use super::error::BoardError;
use super::finder;
use super::pattern::{BoardSearch, Pattern, no_board_in_plane, other_board, same_corners};
use super::projection::CornerObservation;
use crate::frames::Luma;
use crate::geometry::PixelPoint;

/// Views whose corners are all within this part of the picture's diagonal of another view's say nothing new.
const ALIKE_PART: f64 = 0.01;
/// Pictures without a board that are kept for the message.
const KEPT: usize = 3;

/// What became of a picture.
#[derive(Debug, Clone, PartialEq)]
pub enum ViewUse {
    /// The board was found; whether it serves shows in the fit.
    Found,
    /// It serves.
    Used {
        /// Root mean square distance of its corners from where the lens puts them, px.
        rms_px: f64,
        /// Angle between board and picture, rad.
        tilt_rad: f64,
    },
    /// It does not.
    Aside(String),
}

/// A picture of the board.
#[derive(Debug, Clone)]
pub struct BoardView {
    /// The picture's name.
    pub name: String,
    /// What became of it.
    pub use_: ViewUse,
    pub(super) seen: Vec<CornerObservation>,
}

impl BoardView {
    /// Corners in use.
    #[must_use]
    pub fn corners(&self) -> usize {
        self.seen.len()
    }

    /// Where they are in the picture.
    pub fn places(&self) -> impl Iterator<Item = PixelPoint> + '_ {
        self.seen.iter().map(|s| s.at)
    }
}

/// Pictures of one board by one camera.
#[derive(Debug)]
pub struct BoardViews {
    pub(super) pattern: Pattern,
    pub(super) size: Option<(usize, usize)>,
    pub(super) views: Vec<BoardView>,
    pub(super) plane: Option<usize>,
    pub(super) without: Vec<Luma>,
}

impl BoardViews {
    /// No pictures yet.
    #[must_use]
    pub fn new(pattern: Pattern) -> Self {
        Self {
            pattern,
            size: None,
            views: Vec::new(),
            plane: None,
            without: Vec::new(),
        }
    }

    /// The pictures so far.
    #[must_use]
    pub fn views(&self) -> &[BoardView] {
        &self.views
    }

    /// Notes a picture that could not be read.
    pub fn add_unreadable(&mut self, name: String, reason: String) {
        self.views.push(BoardView {
            name,
            use_: ViewUse::Aside(reason),
            seen: Vec::new(),
        });
    }

    /// Adds a picture in which the board was [looked for](Pattern::search).
    pub fn add(&mut self, name: String, search: BoardSearch) {
        let size = search.size;
        let expected = *self.size.get_or_insert(size);
        let mut seen = Vec::new();
        let use_ = if size == expected {
            self.keep(&search);
            match search.outcome {
                Ok(found) => {
                    seen = found;
                    self.alike(&seen).map_or(ViewUse::Found, |other| {
                        ViewUse::Aside(format!("shows the board in the same place as {other}"))
                    })
                }
                Err(reason) => ViewUse::Aside(reason),
            }
        } else {
            ViewUse::Aside(format!(
                "is {}x{} px, the first picture {}x{} px",
                size.0, size.1, expected.0, expected.1
            ))
        };
        self.views.push(BoardView { name, use_, seen });
    }

    /// Keeps one of the pictures without a board, for the message.
    fn keep(&mut self, search: &BoardSearch) {
        if self.without.len() < KEPT {
            self.without.extend(search.without.clone());
        }
    }

    /// Adds the picture of the board standing in the plane of motion, which serves for the lens as well.
    ///
    /// # Errors
    /// [`BoardError::PlaneSize`], [`BoardError::NoBoardInPlane`], [`BoardError::OpenCv`].
    pub fn add_plane(&mut self, name: String, picture: &Luma) -> Result<(), BoardError> {
        let search = self.pattern.search(picture)?;
        let size = search.size;
        let expected = *self.size.get_or_insert(size);
        if size != expected {
            return Err(BoardError::PlaneSize {
                name,
                found: size,
                expected,
            });
        }
        match search.outcome {
            Ok(seen) => {
                self.plane = Some(self.views.len());
                // What it repeats goes: the plane needs its own.
                for view in self.views.iter_mut().filter(|v| v.use_ == ViewUse::Found) {
                    if same_place(&view.seen, &seen, diagonal(size)) {
                        view.use_ = ViewUse::Aside(format!("shows the board in the same place as {name}"));
                    }
                }
                self.views.push(BoardView {
                    name,
                    use_: ViewUse::Found,
                    seen,
                });
                Ok(())
            }
            Err(reason) => Err(no_board_in_plane(&self.pattern, name, picture, &reason)?),
        }
    }

    /// The name of an earlier view with the board in the same place.
    fn alike(&self, seen: &[CornerObservation]) -> Option<String> {
        let size = self.size?;
        self.views
            .iter()
            .find(|v| v.use_ == ViewUse::Found && same_place(&v.seen, seen, diagonal(size)))
            .map(|v| v.name.clone())
    }

    /// The error of pictures that all lack the board.
    pub(super) fn no_board(&self) -> Result<BoardError, BoardError> {
        let mut others = Vec::new();
        for picture in &self.without {
            others.extend(finder::any_board(picture)?);
        }
        let hint = match others.first() {
            Some(&found) if !same_corners(found, self.pattern.corners) => other_board(found),
            Some(_) => "a part of it was found, but not the whole: show all of it with its white rim, sharp and \
                        evenly lit"
                .to_owned(),
            None => "the pictures must show the whole board with its white rim, sharp, evenly lit, without glare; \
                     --pattern counts the points where four squares meet (a board of 10 by 7 squares is 9x6)"
                .to_owned(),
        };
        Ok(BoardError::NoBoard {
            wanted: self.pattern.corners,
            pictures: match self.views.len() {
                1 => "the picture".to_owned(),
                n => format!("{n} pictures"),
            },
            hint,
        })
    }
}

fn diagonal((width, height): (usize, usize)) -> f64 {
    (width as f64).hypot(height as f64)
}

/// Whether two views have the board in the same place, whichever corner is the first.
fn same_place(a: &[CornerObservation], b: &[CornerObservation], diagonal_px: f64) -> bool {
    let near = |s: &CornerObservation, others: &[CornerObservation]| {
        others
            .iter()
            .map(|o| s.at.distance_px(o.at))
            .fold(f64::INFINITY, f64::min)
            < ALIKE_PART * diagonal_px
    };
    // Corners lie closer than that only on boards too small to use; then the ends decide nothing, all must agree.
    a.iter().all(|s| near(s, b)) && b.iter().all(|s| near(s, a))
}
