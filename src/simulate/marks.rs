//! What is drawn on a ball: the albedo of its surface, as a factor on the ball's own, direction by direction.
//!
//! Directions are of length 1, from the ball's centre, in axes that are fixed to the ball: at the launch those of its plane of
//! motion (x along the launch, y away from a camera at the side, z up), unless `at_launch` says otherwise.
//!
//! Every edge of a mark is where a function of the direction n changes its sign. That of a dot or a line is linear, c·n − cos α,
//! so that over a small square of the picture the share beyond the edge follows from the function's values in the corners: exact for a
//! straight edge, like what the ball's outline covers of a cell.

use crate::frames::Luma;
use nalgebra::{UnitQuaternion, Vector3};
use std::borrow::Cow;
use std::f64::consts::{PI, TAU};
use std::sync::{Arc, LazyLock};

/// Marks on a ball.
#[derive(Debug, Clone, PartialEq)]
pub struct BallMarks {
    /// Where they are.
    pub pattern: MarkPattern,
    /// Their albedo over that of the ball; a picture has its own.
    pub albedo: f64,
    /// World from ball at the launch, in the axes of the ball's plane of motion.
    pub at_launch: UnitQuaternion<f64>,
}

/// Where the marks are. Directions have the length 1.
#[derive(Debug, Clone, PartialEq)]
pub enum MarkPattern {
    /// Round dots.
    Dots {
        /// Their middles.
        directions: Vec<Vector3<f64>>,
        /// Half the angle that a dot covers, seen from the ball's centre, rad.
        radius_rad: f64,
    },
    /// Lines round the ball.
    Lines {
        /// The poles of their great circles.
        poles: Vec<Vector3<f64>>,
        /// Angle across a line, rad.
        width_rad: f64,
    },
    /// The half of the ball around a pole.
    Half {
        /// The pole.
        pole: Vector3<f64>,
    },
    /// The seam of a tennis ball.
    Seam {
        /// Angle across it, rad.
        width_rad: f64,
    },
    /// A picture that is wrapped round the ball.
    Picture(BallMap),
}

/// A picture round a ball: its columns are equal steps of longitude, its rows of latitude from the top (+z) down. Its middle is the
/// direction −y, which faces a camera at the side; right of it is +x.
#[derive(Clone, PartialEq)]
pub struct BallMap {
    width: usize,
    height: usize,
    albedo: Arc<Vec<f32>>,
}

impl std::fmt::Debug for BallMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "BallMap({} x {})", self.width, self.height)
    }
}

impl BallMap {
    /// Of a grey picture, white where the ball is as bright as without it; `None` of one without pixels.
    #[must_use]
    pub fn new(picture: &Luma) -> Option<Self> {
        let albedo = picture.data.iter().map(|grey| f32::from(*grey) / 255.0);
        (picture.width > 0 && picture.height > 0).then(|| Self {
            width: picture.width,
            height: picture.height,
            albedo: Arc::new(albedo.collect()),
        })
    }

    /// The angle from one row to the next, rad.
    fn pixel_rad(&self) -> f64 {
        PI / self.height as f64
    }

    /// Linear between the middles of the four pixels around a direction, of any length.
    fn albedo(&self, n: &Vector3<f64>) -> f64 {
        let column = (0.5 + n.x.atan2(-n.y) / TAU) * self.width as f64 - 0.5;
        let row = (0.5 - n.z.atan2(n.x.hypot(n.y)) / PI) * self.height as f64 - 0.5;
        let (left, top) = (column.floor(), row.floor());
        let (right_share, below_share) = (column - left, row - top);
        // Around the ball columns go on at the other side; beyond a pole its row goes on.
        let column = |i: f64| i.rem_euclid(self.width as f64) as usize % self.width;
        let row = |i: f64| i.clamp(0.0, self.height as f64 - 1.0) as usize;
        let at = |u: f64, v: f64| f64::from(self.albedo[row(v) * self.width + column(u)]);
        let across = |v: f64| at(left, v) + right_share * (at(left + 1.0, v) - at(left, v));
        across(top) + below_share * (across(top + 1.0) - across(top))
    }
}

/// Directions in the four corners of a small square of the picture: top left, top right, bottom left, bottom right.
pub(super) type SquareCorners = [Vector3<f64>; 4];

impl BallMarks {
    /// Those of which a camera in the direction `towards` may see something: it sees half of the ball at most.
    pub(super) fn seen_from(&self, towards: &Vector3<f64>) -> Cow<'_, Self> {
        let MarkPattern::Dots {
            directions,
            radius_rad,
        } = &self.pattern
        else {
            return Cow::Borrowed(self);
        };
        let behind = -radius_rad.sin();
        let seen = directions.iter().filter(|d| d.dot(towards) > behind).copied();
        Cow::Owned(Self {
            pattern: MarkPattern::Dots {
                directions: seen.collect(),
                radius_rad: *radius_rad,
            },
            ..*self
        })
    }

    /// Whether it has no edges of its own, only what a picture has.
    pub(super) fn is_picture(&self) -> bool {
        matches!(self.pattern, MarkPattern::Picture(_))
    }

    /// What a direction's product with a dot's middle, a pole or the nearest point of the seam is at the edge of a mark.
    pub(super) fn edge_level(&self) -> f64 {
        match &self.pattern {
            MarkPattern::Dots { radius_rad, .. } => radius_rad.cos(),
            MarkPattern::Lines { width_rad, .. } => (0.5 * width_rad).sin(),
            MarkPattern::Seam { width_rad } => (0.5 * width_rad).cos(),
            MarkPattern::Half { .. } | MarkPattern::Picture(_) => 0.0,
        }
    }

    /// The albedo in the direction `n`; `None` where an edge, or anything that is not plain, may be within `reach` of it (the length of
    /// the difference of two directions). `limit` is its [`edge_level`](Self::edge_level).
    pub(super) fn plain_albedo(&self, n: &Vector3<f64>, reach: f64, limit: f64) -> Option<f64> {
        let mark = |is_marked: bool| if is_marked { self.albedo } else { 1.0 };
        let edge = CircleEdge::new(limit, reach);
        match &self.pattern {
            MarkPattern::Dots { directions, .. } => {
                let mut marked = false;
                for direction in directions {
                    marked |= edge.is_above(direction.dot(n))?;
                }
                Some(mark(marked))
            }
            MarkPattern::Lines { poles, .. } => {
                let mut marked = false;
                for pole in poles {
                    marked |= !edge.is_above(pole.dot(n).abs())?;
                }
                Some(mark(marked))
            }
            MarkPattern::Half { pole } => edge.is_above(pole.dot(n)).map(mark),
            MarkPattern::Seam { .. } => edge.is_above(nearest_of_seam(n)).map(mark),
            // A cell that is smaller than the picture's pixels is as good as its middle.
            MarkPattern::Picture(map) => (reach <= 2.0 * map.pixel_rad()).then(|| map.albedo(n)),
        }
    }

    /// The mean albedo over the square with these corners.
    pub(super) fn mean_albedo(&self, corners: &SquareCorners, limit: f64) -> f64 {
        let first = corners[0];
        let reach = corners.iter().map(|n| (n - first).norm()).fold(0.0, f64::max);
        let edge = CircleEdge::new(limit, reach);
        // The share of the square in which a direction's cosine is above the limit.
        let share = |cosine: &dyn Fn(&Vector3<f64>) -> f64| {
            let at_first = cosine(&first);
            match edge.is_above(at_first) {
                Some(is_above) => f64::from(u8::from(is_above)),
                None => {
                    let [_, b, c, d] = corners;
                    let levels = [at_first, cosine(b), cosine(c), cosine(d)];
                    share_above_zero(levels.map(|cosine| cosine - limit))
                }
            }
        };
        let above = |c: &Vector3<f64>| share(&|n| c.dot(n));
        let marked = match &self.pattern {
            MarkPattern::Dots { directions, .. } => {
                1.0 - directions.iter().map(|c| 1.0 - above(c)).product::<f64>()
            }
            MarkPattern::Lines { poles, .. } => {
                let free = |pole: &Vector3<f64>| above(pole) + above(&-pole);
                1.0 - poles.iter().map(free).product::<f64>()
            }
            MarkPattern::Half { pole } => above(pole),
            MarkPattern::Seam { .. } => share(&nearest_of_seam),
            MarkPattern::Picture(map) => return map.albedo(&corners.iter().sum()),
        };
        1.0 + marked * (self.albedo - 1.0)
    }

    /// By how much the marks change the ball's brightness at most, as a share.
    #[must_use]
    pub fn contrast(&self) -> f64 {
        match &self.pattern {
            MarkPattern::Picture(map) => {
                let darkest = map.albedo.iter().fold(1.0_f32, |least, a| least.min(*a));
                f64::from(1.0 - darkest)
            }
            _ => (1.0 - self.albedo).abs(),
        }
    }
}

/// An edge at one angle from a point (the middle of a dot, a pole, the nearest of the seam), for directions that stand for all within some
/// reach of theirs: the cosines at which those are on one side of it.
struct CircleEdge {
    /// With a larger cosine all are nearer to the point than the edge is.
    above: f64,
    /// With a smaller one all are further from it.
    below: f64,
}

impl CircleEdge {
    /// An edge at the angle with this cosine; `reach` is the length of the difference of two directions.
    fn new(cosine: f64, reach: f64) -> Self {
        // Of the angle between two directions with that difference.
        let half = 0.5 * reach.min(2.0);
        let reach_cosine = 1.0 - 2.0 * half * half;
        let sines = 2.0 * half * (1.0 - half * half).sqrt() * (1.0 - cosine * cosine).max(0.0).sqrt();
        Self {
            above: if reach_cosine > cosine {
                cosine * reach_cosine + sines
            } else {
                f64::INFINITY
            },
            below: if reach_cosine > -cosine {
                cosine * reach_cosine - sines
            } else {
                f64::NEG_INFINITY
            },
        }
    }

    /// Whether the cosine of a direction, and of all within the reach of it, is above that of the edge; `None` where some are and some are
    /// not.
    fn is_above(&self, cosine: f64) -> Option<bool> {
        (cosine > self.above || cosine < self.below).then_some(cosine > self.above)
    }
}

/// The share of a square in which a function is above 0, by its values in the corners (in the order of [`SquareCorners`]): exact where
/// it is linear.
fn share_above_zero([a, b, c, d]: [f64; 4]) -> f64 {
    let middle = 0.25 * (a + b + c + d);
    let (along, down) = (0.5 * (b + d - a - c).abs(), 0.5 * (c + d - a - b).abs());
    // The values are spread as the sum of two even distributions of these widths.
    let (wide, narrow) = (along.max(down), along.min(down));
    let from_middle = middle.abs();
    let above = if from_middle >= 0.5 * (wide + narrow) {
        1.0
    } else if from_middle <= 0.5 * (wide - narrow) {
        0.5 + from_middle / wide
    } else {
        1.0 - (0.5 * (wide + narrow) - from_middle).powi(2) / (2.0 * wide * narrow)
    };
    if middle > 0.0 { above } else { 1.0 - above }
}

/// How far the seam leaves the great circles of which it is bent, as a share.
const SEAM_BEND: f64 = 0.25;

/// Points along a quarter of the seam: so many that between two of them the cosine to a direction is a parabola. A power of two.
const QUARTER: usize = 64;

/// A point of the seam, and which way it goes on there (of any length).
#[derive(Clone, Copy)]
struct SeamPoint {
    at: Vector3<f64>,
    onward: Vector3<f64>,
}

/// The curve (a cos t + b cos 3t, a sin t − b sin 3t, 2 √(ab) sin 2t) with a + b = 1 lies on the sphere and has the symmetry of a
/// tennis ball's seam: it is the same after half a turn about x, y or z, and mirrored where x and y change places.
fn seam_point(t: f64) -> SeamPoint {
    let (a, b) = (1.0 - SEAM_BEND, SEAM_BEND);
    let across = 2.0 * (a * b).sqrt();
    let ((s, c), (s3, c3), (s2, c2)) = (t.sin_cos(), (3.0 * t).sin_cos(), (2.0 * t).sin_cos());
    SeamPoint {
        at: Vector3::new(a * c + b * c3, a * s - b * s3, across * s2),
        onward: Vector3::new(-a * s - 3.0 * b * s3, a * c - 3.0 * b * c3, 2.0 * across * c2),
    }
}

/// The points of the quarter around t = 0, and one more at each end.
static SEAM: LazyLock<[SeamPoint; QUARTER + 3]> = LazyLock::new(|| {
    let half = 0.5 * QUARTER as f64;
    std::array::from_fn(|i| seam_point((i as f64 - 1.0 - half) * 0.25 * TAU / QUARTER as f64))
});

/// Cosine of the angle between a direction and the nearest point of the seam.
fn nearest_of_seam(n: &Vector3<f64>) -> f64 {
    // Of the directions that are alike by the seam's symmetry, that with x ≥ y ≥ 0 is nearest to the quarter around t = 0, and all along
    // that there is one point from which the seam leads away both ways.
    let z = if n.x.is_sign_negative() == n.y.is_sign_negative() {
        n.z
    } else {
        -n.z
    };
    let (x, y) = (n.x.abs(), n.y.abs());
    let alike = Vector3::new(x.max(y), x.min(y), z);
    let seam = &*SEAM;
    let mut before = 1;
    let mut step = QUARTER / 2;
    while step > 0 {
        if seam[before + step].onward.dot(&alike) > 0.0 {
            before += step;
        }
        step /= 2;
    }
    let cosine = |i: usize| seam[i].at.dot(&alike);
    let (one, other) = (cosine(before), cosine(before + 1));
    // The top of the parabola through the nearest of the points and its neighbours.
    let (largest, smaller, beyond) = if one > other {
        (one, other, cosine(before - 1))
    } else {
        (other, one, cosine(before + 2))
    };
    let bend = 2.0 * largest - smaller - beyond;
    if bend > 0.0 {
        (largest + (smaller - beyond).powi(2) / (8.0 * bend)).min(1.0)
    } else {
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts points of a fine grid.
    fn counted([a, b, c, d]: [f64; 4]) -> f64 {
        let at = |i: u32| (f64::from(i) + 0.5) / 400.0;
        let (along, down) = (0.5 * (b + d - a - c), 0.5 * (c + d - a - b));
        let middle = 0.25 * (a + b + c + d);
        let above = (0..400)
            .flat_map(|i| (0..400).map(move |j| (at(i) - 0.5, at(j) - 0.5)))
            .filter(|(x, y)| middle + along * x + down * y > 0.0);
        above.count() as f64 / 160_000.0
    }

    #[test]
    fn the_share_beyond_a_straight_edge_is_exact() {
        for (middle, along, down) in [
            (0.0, 1.0, 0.0),
            (0.3, 1.0, 0.2),
            (-0.1, 0.5, 0.7),
            (0.45, -0.6, 0.5),
            (-0.2, 0.0, -1.0),
            (0.9, 0.3, 0.2),
        ] {
            let corner = |x: f64, y: f64| middle + along * x + down * y;
            let corners = [
                corner(-0.5, -0.5),
                corner(0.5, -0.5),
                corner(-0.5, 0.5),
                corner(0.5, 0.5),
            ];
            let (found, expected) = (share_above_zero(corners), counted(corners));
            assert!(
                (found - expected).abs() < 3e-3,
                "{middle} {along} {down}: {found} {expected}"
            );
        }
        assert_eq!(share_above_zero([1.0; 4]), 1.0);
        assert_eq!(share_above_zero([-1.0; 4]), 0.0);
    }

    #[test]
    fn what_is_within_reach_of_an_edge_is_on_neither_side_of_it() {
        for edge_deg in [4.0_f64, 20.0, 90.0, 120.0] {
            for reach_deg in [0.5_f64, 10.0, 70.0] {
                let reach = 2.0 * (0.5 * reach_deg.to_radians()).sin();
                let edge = CircleEdge::new(edge_deg.to_radians().cos(), reach);
                for tenth in 0..=1800 {
                    let from_edge_deg = f64::from(tenth) / 10.0 - edge_deg;
                    // (At the reach itself rounding decides.)
                    if (from_edge_deg.abs() - reach_deg).abs() < 1e-6 {
                        continue;
                    }
                    let found = edge.is_above((f64::from(tenth) / 10.0).to_radians().cos());
                    let expected = (from_edge_deg.abs() > reach_deg).then_some(from_edge_deg < 0.0);
                    assert_eq!(found, expected, "{edge_deg} {reach_deg} {tenth}");
                }
            }
        }
    }

    #[test]
    fn the_seam_lies_on_the_ball_and_is_near_to_itself() {
        // Of a seam 10 degrees wide that moves an edge by 0.0001 rad at most.
        for place in 0..1000 {
            let on_seam = seam_point(TAU * f64::from(place) / 1000.0).at;
            assert!((on_seam.norm() - 1.0).abs() < 1e-14);
            assert!(nearest_of_seam(&on_seam) > 1.0 - 8e-6, "{place}");
        }
        assert!(nearest_of_seam(&Vector3::z()) < 0.9);
    }

    #[test]
    fn the_nearest_point_of_the_seam_is_that_of_all() {
        let seam: Vec<_> = (0..4000)
            .map(|i| seam_point(TAU * f64::from(i) / 4000.0).at)
            .collect();
        // Directions spread evenly over the sphere.
        for i in 0..2000 {
            let z = (f64::from(i) + 0.5) / 1000.0 - 1.0;
            let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
            let around = (1.0 - z * z).sqrt();
            let n = Vector3::new(around * cos, around * sin, z);
            let nearest = seam.iter().map(|at| at.dot(&n)).fold(-1.0, f64::max);
            let found = nearest_of_seam(&n);
            assert!((found - nearest).abs() < 8e-6, "{n:?}: {found} {nearest}");
        }
    }

    #[test]
    fn the_middle_of_a_picture_is_the_side_that_faces_a_camera_at_the_side() {
        // Brighter to the right, in four columns and two rows.
        let grey = [0, 51, 102, 153, 0, 51, 102, 153];
        let map = BallMap::new(&Luma {
            width: 4,
            height: 2,
            data: grey.to_vec(),
        });
        let map = map.unwrap();
        let at = |x: f64, y: f64| map.albedo(&Vector3::new(x, y, 0.0));
        assert!((at(0.0, -1.0) - 0.3).abs() < 1e-6);
        assert!((at(0.5_f64.sqrt(), -0.5_f64.sqrt()) - 0.4).abs() < 1e-6);
        assert!((at(-0.5_f64.sqrt(), -0.5_f64.sqrt()) - 0.2).abs() < 1e-6);
        // Half way round between the last column and the first.
        assert!((at(0.0, 1.0) - 0.3).abs() < 1e-6);
    }
}
