//! A lens, and the plane of motion, from pictures of a chessboard.
//!
//! `finder` (where the board is) → `corner` (each corner, to a hundredth of a pixel) → `outliers` (which views and corners
//! serve) with `lens_fit` (camera, poses, covariance; `bundle` has the equations) → `coverage` (how sure the lens is where in
//! the picture) → `plane_fit` (the plane of motion, its "up" and origin; `known_lens` where the lens is given) → `principal_deviations`
//! (the calibration's [`Deviation`](super::Deviation)s).
//!
//! [`BoardViews`] takes the pictures one by one; those that cannot serve are set aside with their reason.

mod bundle;
mod corner;
mod coverage;
mod error;
mod finder;
mod known_lens;
mod lens_fit;
mod outliers;
mod plane_fit;
mod principal_deviations;
mod projection;

pub use coverage::{CELLS as COVERAGE_CELLS, Coverage};
pub use error::BoardError;
pub use finder::Corners;
pub use known_lens::plane_with_lens;
pub use lens_fit::{LensFit, LensTerms};
pub use plane_fit::{MotionPlane, PlaneMarks};
pub use projection::Pose;

use super::{Calibration, Lens, Scale};
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use nalgebra::Vector2;
use plane_fit::PosedBoard;
use projection::CornerObservation;

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

    fn place_m(&self, index: usize) -> Vector2<f64> {
        let (column, row) = (index % self.corners.0, index / self.corners.0);
        Vector2::new(column as f64, row as f64) * self.square_m
    }
}

/// A picture in which the board was looked for.
#[derive(Debug, Clone)]
pub struct BoardSearch {
    size: (usize, usize),
    /// The corners, or why the picture cannot serve.
    outcome: Result<Vec<CornerObservation>, String>,
    /// The picture, where there is no board in it.
    without: Option<Luma>,
}

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
    seen: Vec<CornerObservation>,
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

/// Views whose corners are all within this part of the picture's diagonal of another view's say nothing new.
const ALIKE_PART: f64 = 0.01;
/// Part of the corners that may be missing.
const MISSING_PART: f64 = 0.25;
/// A focal length less certain than this part of itself is not determined.
const VAGUE_PART: f64 = 0.02;
/// Pictures without a board that are kept for the message.
const KEPT: usize = 3;
/// Pictures of one board by one camera.
#[derive(Debug)]
pub struct BoardViews {
    pattern: Pattern,
    size: Option<(usize, usize)>,
    views: Vec<BoardView>,
    plane: Option<usize>,
    without: Vec<Luma>,
}

/// A lens with what it rests on.
#[derive(Debug)]
pub struct BoardLens {
    /// The fit.
    pub fit: LensFit,
    /// The lens.
    pub lens: Lens,
    /// Where in the picture it is how sure.
    pub coverage: Coverage,
    /// Width and height of the pictures.
    pub size_px: (usize, usize),
    /// Corners in use.
    pub corners: usize,
    /// Which of the fit's views is that of the plane.
    plane: Option<usize>,
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

    /// The lens from all pictures that can serve.
    ///
    /// # Errors
    /// [`BoardError`]: no board anywhere, too few views, views that do not fix the lens.
    pub fn lens(&mut self) -> Result<BoardLens, BoardError> {
        let mut used: Vec<usize> = (0..self.views.len())
            .filter(|&i| self.views[i].use_ == ViewUse::Found)
            .collect();
        let size = match self.size {
            Some(size) if !used.is_empty() => size,
            _ => return Err(self.no_board()?),
        };
        let fit = outliers::fit_without_outliers(self, &mut used, size)?;
        let relative = fit.covariance[(0, 0)].sqrt() / fit.camera[0];
        let determined = relative < VAGUE_PART;
        if !determined {
            return Err(BoardError::not_determined(Some(relative), used.len()));
        }
        let lens = fit
            .lens()
            .ok_or_else(|| BoardError::not_determined(None, used.len()))?;
        for (k, &i) in used.iter().enumerate() {
            self.views[i].use_ = ViewUse::Used {
                rms_px: fit.view_rms_px[k],
                tilt_rad: fit.poses[k].tilt_rad(),
            };
        }
        let places = used.iter().flat_map(|&i| self.views[i].seen.iter().map(|s| s.at));
        let coverage = Coverage::new(size, places, &fit);
        Ok(BoardLens {
            coverage,
            lens,
            size_px: size,
            corners: used.iter().map(|&i| self.views[i].seen.len()).sum(),
            plane: self.plane.and_then(|p| used.iter().position(|&i| i == p)),
            fit,
        })
    }

    /// The error of pictures that all lack the board.
    fn no_board(&self) -> Result<BoardError, BoardError> {
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

/// The error of a picture of the plane that cannot serve for `reason`.
fn no_board_in_plane(
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

fn other_board((columns, rows): Corners) -> String {
    format!(
        "there is one of {columns}x{rows} inner corners ({} by {} squares): --pattern counts the points where four \
         squares meet, so try --pattern {columns}x{rows}",
        columns + 1,
        rows + 1
    )
}

impl BoardLens {
    /// The calibration of lens and plane. Without a plane the scale is the fall until another is given.
    #[must_use]
    pub fn calibration(&self, plane: Option<&MotionPlane>) -> Calibration {
        let scale = plane.map_or(Scale::Gravity, |p| Scale::Homography(p.homography.clone()));
        let deviations = match plane {
            Some(plane) => plane.deviations.clone(),
            None => plane_fit::lens_deviations(&self.fit, self.size_px),
        };
        Calibration {
            image_size_px: Some(self.size_px),
            lens: Some(self.lens.clone()),
            lens_std: lens_fit::deviations(&self.fit),
            deviations,
            ..Calibration::new(scale)
        }
    }

    /// The plane of the board in the picture given to [`BoardViews::add_plane`], with `marks`; `None` where none was given.
    ///
    /// # Errors
    /// [`BoardError::Askew`], [`BoardError::Mark`].
    pub fn plane(&self, views: &BoardViews, marks: &PlaneMarks) -> Result<Option<MotionPlane>, BoardError> {
        let (Some(index), Some(view)) = (self.plane, views.plane) else {
            return Ok(None);
        };
        let name = &views.views[view].name;
        let joint = self
            .fit
            .joint_covariance(index)
            .ok_or_else(|| BoardError::not_determined(None, self.fit.poses.len()))?;
        let seen = PosedBoard {
            camera: self.fit.camera,
            lens: &self.lens,
            size_px: self.size_px,
            pose: self.fit.poses[index],
            joint,
        };
        MotionPlane::new(name, &seen, &views.pattern, marks).map(Some)
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

fn same_corners(a: Corners, b: Corners) -> bool {
    a == b || a == (b.1, b.0)
}
