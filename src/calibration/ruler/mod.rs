//! A calibration from marks in a frame: two ends of a ruler and a length, or the ball, or the fall; floor and launch edge; a
//! line along the floor.

mod marks;
mod snap;

pub use marks::{MARKS_SCHEMA, MarksError, MarksFile, PageMarks};
pub use snap::{Snapped, snap};

use super::{Ball, Calibration, CalibrationError, FloorLine, Launch, Rectification, Ruler, SCHEMA, Scale};
use crate::frames::Luma;
use crate::geometry::{PixelPoint, PlanePoint};
use serde::Deserialize;
use thiserror::Error;

/// How the ruler stood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RulerOrientation {
    /// Along a plumb line.
    Upright,
    /// Along the floor.
    Level,
}

/// What is marked in the frame, and what else is known.
#[derive(Debug, Clone, PartialEq)]
pub struct RulerRequest {
    /// Where metres come from; the ends of a ruler may be moved to edges.
    pub scale: Scale,
    /// How the ruler stood, where that tells "up".
    pub held: Option<RulerOrientation>,
    /// Direction of "up" in the picture.
    pub up_px: [f64; 2],
    /// Whether the user said so; else the fall tells.
    pub up_given: bool,
    /// Standard uncertainty of "up" or of how the ruler stood, rad.
    pub up_std_rad: Option<f64>,
    /// x = 0 at the floor.
    pub origin: Option<PixelPoint>,
    /// A point at the height of the floor.
    pub floor: Option<PixelPoint>,
    /// A point at the x of the launch edge.
    pub edge: Option<PixelPoint>,
    /// Two points on a line along the floor, in the plane of motion.
    pub floor_line: Option<[PixelPoint; 2]>,
    /// Standard uncertainty of a mark that was read off by eye, each coordinate, px.
    pub point_std_px: f64,
    /// How far a mark may be moved to the nearest edge, px; `None`: not at all.
    pub snap_px: Option<f64>,
    /// The calibration with what marks do not tell: lens, frame rate, gravity, ball, spin.
    pub known: Calibration,
}

/// What a mark stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkRole {
    /// An end of the ruler.
    From,
    /// The other end.
    To,
    /// A point of the floor.
    Floor,
    /// A point at the launch edge's x.
    Edge,
    /// The world's origin.
    Origin,
    /// An end of a line along the floor.
    LineFrom,
    /// The other end.
    LineTo,
}

impl MarkRole {
    /// The option that gives it.
    #[must_use]
    pub const fn option(self) -> &'static str {
        match self {
            Self::From => "--from",
            Self::To => "--to",
            Self::Floor => "--floor",
            Self::Edge => "--edge",
            Self::Origin => "--origin",
            Self::LineFrom | Self::LineTo => "--floor-line",
        }
    }
}

/// A mark as it was used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureMark {
    /// What it stands for.
    pub role: MarkRole,
    /// As given.
    pub given: PixelPoint,
    /// As used.
    pub at: PixelPoint,
    /// The edge it was moved to.
    pub snapped: Option<Snapped>,
}

/// A calibration from marks.
#[derive(Debug, Clone, PartialEq)]
pub struct RulerCalibration {
    /// The calibration.
    pub calibration: Calibration,
    /// The marks, as given and as used.
    pub marks: Vec<PictureMark>,
}

/// Why marks make no calibration.
#[derive(Debug, Error)]
pub enum RulerError {
    /// The ends of the ruler are one point.
    #[error(
        "--from and --to are the same point, [{}, {}]{}: accepted are two ends at least 2 px apart; read both off a \
         frame, as far apart as the picture allows",
        .0.u_px, .0.v_px,
        if *.1 { " once moved to the nearest edge" } else { "" }
    )]
    SamePoint(PixelPoint, bool),
    /// A mark outside the picture.
    #[error(
        "{}: [{}, {}] is outside the picture of {}x{} px; accepted are u from 0 to {} (right) and v from 0 to {} (down); \
         give the column first, then the row", .role.option(), .at.u_px, .at.v_px, .size.0, .size.1, .size.0 - 1,
        .size.1 - 1
    )]
    Outside {
        /// The mark.
        role: MarkRole,
        /// Where.
        at: PixelPoint,
        /// The picture's.
        size: (usize, usize),
    },
    /// Nothing to snap to.
    #[error(
        "{}: there is no edge within {reach_px} px of [{}, {}] that stands out; mark nearer to one, allow more (--snap={}), \
         or leave out --snap", .role.option(), .at.u_px, .at.v_px, (2.0 * .reach_px).ceil()
    )]
    NoEdge {
        /// The mark.
        role: MarkRole,
        /// Where.
        at: PixelPoint,
        /// How far was searched, px.
        reach_px: f64,
    },
    /// The ends of a line along the floor are too near to each other.
    #[error(
        "--floor-line: its ends are {:.1} px apart{}: accepted are two points at least {} px apart; read both off a \
         frame, as far apart as the picture shows the floor in the plane of motion",
        .0, if *.1 { " once moved to the nearest edge" } else { "" }, FloorLine::LEAST_PX
    )]
    ShortLine(f64, bool),
    /// An edge without a floor.
    #[error(
        "--edge says where x = 0 is, but not at what height: give --floor too, a point at the height of the floor"
    )]
    EdgeWithoutFloor,
    /// A mark that the lens has no place for.
    #[error(
        "{}: the lens has no place for [{}, {}]; mark a point nearer to the picture's middle, or calibrate the lens again \
         with the board in the corners of the picture", .role.option(), .at.u_px, .at.v_px
    )]
    BeyondLens {
        /// The mark.
        role: MarkRole,
        /// Where.
        at: PixelPoint,
    },
    /// The parts do not make a calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Ends of a ruler nearer than this are one point, px.
const LEAST_LENGTH_PX: f64 = 2.0;

/// The calibration that `request` describes, on the frame `picture`.
///
/// # Errors
/// See [`RulerError`].
pub fn calibrate(request: &RulerRequest, picture: &Luma) -> Result<RulerCalibration, RulerError> {
    let marker = MarkPlacer { request, picture };
    let mut calibration = request.known.clone();
    calibration.image_size_px = Some((picture.width, picture.height));
    calibration.up_px = request.up_px;
    calibration.up_given = request.up_given;
    calibration.up_std_rad = request.up_std_rad;
    let mut marks = Vec::new();
    calibration.scale = request.scale.clone();
    if let Scale::Ruler(ruler) = &request.scale {
        let ends = marker.ends(ruler)?;
        marks.extend(ends);
        let placed = marker.placed(ruler, &ends);
        calibration.scale = Scale::Ruler(placed);
        if let Some(orientation) = request.held {
            marker.up_from_ruler(&mut calibration, &placed, orientation)?;
        }
    }
    marker.origin(&mut calibration, &mut marks)?;
    marker.floor_line(&mut calibration, &mut marks)?;
    // The checks of a file find whatever is still wrong with it.
    let checked = Calibration::parse(&calibration.to_json().to_string(), "the marks")?;
    Ok(RulerCalibration {
        calibration: checked,
        marks,
    })
}

struct MarkPlacer<'a> {
    request: &'a RulerRequest,
    picture: &'a Luma,
}

impl MarkPlacer<'_> {
    fn ends(&self, &Ruler { from, to, .. }: &Ruler) -> Result<[PictureMark; 2], RulerError> {
        let apart = |a: PixelPoint, b: PixelPoint| a.distance_px(b) >= LEAST_LENGTH_PX;
        self.inside(MarkRole::From, from)?;
        self.inside(MarkRole::To, to)?;
        if !apart(from, to) {
            return Err(RulerError::SamePoint(to, false));
        }
        let along = [to.u_px - from.u_px, to.v_px - from.v_px];
        let ends = [
            self.mark(MarkRole::From, from, along)?,
            self.mark(MarkRole::To, to, along)?,
        ];
        if !apart(ends[0].at, ends[1].at) {
            return Err(RulerError::SamePoint(ends[1].at, true));
        }
        Ok(ends)
    }

    /// The ruler between its ends as they were used.
    fn placed(&self, ruler: &Ruler, [from, to]: &[PictureMark; 2]) -> Ruler {
        Ruler {
            from: from.at,
            to: to.at,
            point_std_px: Some(self.std_of_both_px(from, to)),
            ..*ruler
        }
    }

    /// One number for both ends: their mean square.
    fn std_of_both_px(&self, from: &PictureMark, to: &PictureMark) -> f64 {
        (0.5 * (self.std_px(from).powi(2) + self.std_px(to).powi(2))).sqrt()
    }

    fn std_px(&self, mark: &PictureMark) -> f64 {
        mark.snapped.map_or(self.request.point_std_px, |s| s.std_px)
    }

    fn inside(&self, role: MarkRole, at: PixelPoint) -> Result<(), RulerError> {
        let (width, height) = (self.picture.width, self.picture.height);
        let within = |x: f64, size: usize| x >= -0.5 && x <= size as f64 - 0.5;
        if within(at.u_px, width) && within(at.v_px, height) {
            return Ok(());
        }
        Err(RulerError::Outside {
            role,
            at,
            size: (width, height),
        })
    }

    fn mark(
        &self,
        role: MarkRole,
        given: PixelPoint,
        direction: [f64; 2],
    ) -> Result<PictureMark, RulerError> {
        self.inside(role, given)?;
        let snapped = match self.request.snap_px {
            Some(reach_px) => Some(snap(self.picture, given, direction, reach_px).ok_or(
                RulerError::NoEdge {
                    role,
                    at: given,
                    reach_px,
                },
            )?),
            None => None,
        };
        Ok(PictureMark {
            role,
            given,
            at: snapped.map_or(given, |s| s.at),
            snapped,
        })
    }

    /// "Up" from the ruler's direction in the undistorted picture, the one nearer to the given "up".
    fn up_from_ruler(
        &self,
        calibration: &mut Calibration,
        ruler: &Ruler,
        held: RulerOrientation,
    ) -> Result<(), RulerError> {
        let ideal = |role: MarkRole, at: PixelPoint| {
            let beyond = RulerError::BeyondLens { role, at };
            calibration
                .lens
                .as_ref()
                .map_or(Some(at), |l| l.undistort(at))
                .ok_or(beyond)
        };
        let (a, b) = (ideal(MarkRole::From, ruler.from)?, ideal(MarkRole::To, ruler.to)?);
        let (du, dv) = (b.u_px - a.u_px, b.v_px - a.v_px);
        let length = du.hypot(dv);
        let axis = match held {
            RulerOrientation::Upright => [du / length, dv / length],
            RulerOrientation::Level => [-dv / length, du / length],
        };
        let given = self.request.up_px;
        let sign = (axis[0] * given[0] + axis[1] * given[1]).signum();
        // Adding 0 turns −0 into 0.
        calibration.up_px = axis.map(|x| x * sign + 0.0);
        calibration.up_given = true;
        let read = ruler
            .point_std_px
            .map_or(0.0, |s| std::f64::consts::SQRT_2 * s / length);
        calibration.up_std_rad =
            Some(read.hypot(self.request.up_std_rad.unwrap_or(0.0))).filter(|s| *s > 0.0);
        Ok(())
    }

    fn origin(&self, calibration: &mut Calibration, marks: &mut Vec<PictureMark>) -> Result<(), RulerError> {
        let [a, b] = calibration.up_px;
        if let Some(origin) = self.request.origin {
            self.inside(MarkRole::Origin, origin)?;
            marks.push(PictureMark {
                role: MarkRole::Origin,
                given: origin,
                at: origin,
                snapped: None,
            });
            place_origin(calibration, origin, self.request.point_std_px, true);
            return Ok(());
        }
        let (floor, edge) = match (self.request.floor, self.request.edge) {
            (None, None) => return Ok(()),
            (None, Some(_)) => return Err(RulerError::EdgeWithoutFloor),
            (Some(floor), edge) => (floor, edge),
        };
        let floor = self.mark(MarkRole::Floor, floor, [a, b])?;
        let edge = edge.map(|e| self.mark(MarkRole::Edge, e, [-b, a])).transpose()?;
        marks.push(floor);
        marks.extend(edge);
        let std = edge.map_or(self.std_px(&floor), |e| self.std_px(&floor).max(self.std_px(&e)));
        if calibration.scale.has_axes() {
            let x_mark = edge.unwrap_or(floor);
            *calibration =
                calibration
                    .with_world_origin(floor.at, x_mark.at)
                    .ok_or(RulerError::BeyondLens {
                        role: x_mark.role,
                        at: x_mark.at,
                    })?;
            place_edge(calibration, std, edge.is_some());
            return Ok(());
        }
        let origin = match edge {
            Some(edge) => crossing(&calibration.rectification()?, &floor, &edge)?,
            None => floor.at,
        };
        place_origin(calibration, origin, std, edge.is_some());
        Ok(())
    }

    /// A line along the floor; its ends are moved square to it, as only that tells its direction.
    fn floor_line(
        &self,
        calibration: &mut Calibration,
        marks: &mut Vec<PictureMark>,
    ) -> Result<(), RulerError> {
        let Some([from, to]) = self.request.floor_line else {
            return Ok(());
        };
        self.inside(MarkRole::LineFrom, from)?;
        self.inside(MarkRole::LineTo, to)?;
        let long_enough = |a: PixelPoint, b: PixelPoint, snapped: bool| {
            let length_px = a.distance_px(b);
            if length_px < FloorLine::LEAST_PX {
                return Err(RulerError::ShortLine(length_px, snapped));
            }
            Ok(())
        };
        long_enough(from, to, false)?;
        let square = [from.v_px - to.v_px, to.u_px - from.u_px];
        let ends = [
            self.mark(MarkRole::LineFrom, from, square)?,
            self.mark(MarkRole::LineTo, to, square)?,
        ];
        long_enough(ends[0].at, ends[1].at, true)?;
        if let Some(lens) = &calibration.lens {
            for mark in &ends {
                let beyond = RulerError::BeyondLens {
                    role: mark.role,
                    at: mark.at,
                };
                lens.undistort(mark.at).ok_or(beyond)?;
            }
        }
        calibration.floor.line = Some(FloorLine {
            from: ends[0].at,
            to: ends[1].at,
            std_px: self.std_of_both_px(&ends[0], &ends[1]),
        });
        marks.extend(ends);
        Ok(())
    }
}

/// The pixel at the height of one mark and the x of the other.
fn crossing(map: &Rectification, floor: &PictureMark, edge: &PictureMark) -> Result<PixelPoint, RulerError> {
    let plane = |mark: &PictureMark| {
        map.plane_from_pixel(mark.at).ok_or(RulerError::BeyondLens {
            role: mark.role,
            at: mark.at,
        })
    };
    let (low, left) = (plane(floor)?, plane(edge)?);
    map.pixel_from_plane(PlanePoint::new(left.right, low.up))
        .ok_or(RulerError::BeyondLens {
            role: edge.role,
            at: edge.at,
        })
}

fn place_origin(calibration: &mut Calibration, origin: PixelPoint, std_px: f64, edge_known: bool) {
    calibration.origin_px = Some(origin);
    place_edge(calibration, std_px, edge_known);
}

fn place_edge(calibration: &mut Calibration, std_px: f64, edge_known: bool) {
    calibration.origin_std_px = Some(std_px);
    calibration.launch = Launch {
        edge_x_m: edge_known.then_some(calibration.launch.edge_x_m.unwrap_or(0.0)),
        ..calibration.launch
    };
}

/// A calibration that knows nothing but the ball's radius (m) and the true capture rate (Hz), where given.
#[must_use]
pub fn known(radius_m: Option<f64>, frame_rate_hz: Option<f64>) -> Calibration {
    Calibration {
        ball: Ball {
            radius_m,
            ..Ball::default()
        },
        frame_rate_hz,
        ..Calibration::new(Scale::Gravity)
    }
}

#[cfg(test)]
mod tests;
