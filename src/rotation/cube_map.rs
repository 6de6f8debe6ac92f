//! A function on the sphere: values at the nodes of a grid on each face of a cube around it, linear between them.

use super::map_value::MapValue;
use nalgebra::{Matrix3, Vector3};

/// Directions, or cells, that are looked up together.
pub const AT_ONCE: usize = 16;

/// The four nodes around a direction, with the weights that a linear function has there.
pub type NodeWeights = [(u32, f32); 4];

/// Where a place lies between four nodes of a grid: the first of them, and the weights that a linear function has there of it, the next in the list, and
/// those a row further.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridCell {
    at: u32,
    weights: [f32; 4],
}

impl GridCell {
    /// In a list of nodes: how far from the first, each way from 0 to 1, towards the node a row further (`across`) and towards the next (`along`).
    #[inline]
    #[must_use]
    pub fn new(at: u32, across: f32, along: f32) -> Self {
        let (p, q) = (across, along);
        Self {
            at,
            weights: [(1.0 - p) * (1.0 - q), (1.0 - p) * q, p * (1.0 - q), p * q],
        }
    }

    /// The nodes of a grid whose rows are `next` nodes long, with the weights that a linear function has there.
    #[must_use]
    pub fn corners(self, next: usize) -> NodeWeights {
        let (at, next, w) = (self.at, next as u32, self.weights);
        [
            (at, w[0]),
            (at + 1, w[1]),
            (at + next, w[2]),
            (at + next + 1, w[3]),
        ]
    }

    /// The value that a linear function has there.
    #[inline]
    #[must_use]
    pub fn value<T: MapValue>(self, map: &[T], next: usize) -> T {
        let (at, w) = (self.at as usize, self.weights);
        let (here, there) = (&map[at..at + 2], &map[at + next..at + next + 2]);
        // (Two and two, which a processor adds side by side.)
        (here[0] * w[0] + there[0] * w[2]) + (here[1] * w[1] + there[1] * w[3])
    }

    /// Adds `part` to the four nodes of `sums` by their weights.
    #[inline(always)]
    pub fn add<T: MapValue>(self, sums: &mut [T], next: usize, part: T) {
        let (at, w) = (self.at as usize, self.weights);
        let near = &mut sums[at..at + 2];
        near[0] += part * w[0];
        near[1] += part * w[1];
        let far = &mut sums[at + next..at + next + 2];
        far[0] += part * w[2];
        far[1] += part * w[3];
    }
}

/// A grid on the sphere.
#[derive(Debug, Clone, Copy)]
pub struct CubeGrid {
    /// Nodes along each edge of a face.
    side: usize,
}

impl CubeGrid {
    /// With nodes about `spacing_rad` apart.
    #[must_use]
    pub fn with_spacing(spacing_rad: f64) -> Self {
        let steps = (std::f64::consts::FRAC_PI_2 / spacing_rad)
            .ceil()
            .clamp(4.0, 64.0);
        Self {
            side: steps as usize + 1,
        }
    }

    /// Nodes in all.
    #[must_use]
    pub fn nodes(self) -> usize {
        6 * self.side * self.side
    }

    /// The face that `d` goes through, and where in it: each coordinate from 0 to `nodes` − 1. (Equal angles are equal
    /// steps along the middles of a face.) Without branches, so that a row of directions is worked out side by side.
    #[inline(always)]
    fn place(self, [x, y, z]: [f32; 3]) -> (f32, f32, f32) {
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let by_x = (ax >= ay) & (ax >= az);
        let by_y = !by_x & (ay >= az);
        let pick = |x: f32, y: f32, z: f32| {
            if by_x {
                x
            } else if by_y {
                y
            } else {
                z
            }
        };
        let (major, p, q) = (pick(x, y, z), pick(y, z, x), pick(z, x, y));
        let face = pick(0.0, 2.0, 4.0) + if major < 0.0 { 1.0 } else { 0.0 };
        let steps = (self.side - 1) as f32;
        let inverse = 1.0 / major.abs();
        let along = |t: f32| steps * (0.5 + arc_tangent(t * inverse) * std::f32::consts::FRAC_2_PI);
        (face, along(p), along(q))
    }

    /// The first of the four nodes around a place on a face, and how far from it the place is, each way.
    #[inline(always)]
    fn within(self, (face, p, q): (f32, f32, f32)) -> (f32, f32, f32) {
        let (side, last) = (self.side as f32, (self.side - 2) as f32);
        let floor = |t: f32| (t as i32 as f32).min(last);
        let (i, j) = (floor(p), floor(q));
        ((face * side + i) * side + j, p - i, q - j)
    }

    /// The node nearest to `d`.
    #[must_use]
    pub fn nearest(self, d: &Vector3<f64>) -> usize {
        let (face, p, q) = self.place((*d).cast().into());
        (face as usize * self.side + (p + 0.5) as usize) * self.side + (q + 0.5) as usize
    }

    /// The nodes around `d`.
    #[must_use]
    pub fn corners(self, d: &Vector3<f64>) -> NodeWeights {
        self.cell(d).corners(self.side)
    }

    /// The place of `d` between them.
    #[inline]
    #[must_use]
    pub fn cell(self, d: &Vector3<f64>) -> GridCell {
        let (at, across, along) = self.within(self.place((*d).cast().into()));
        GridCell::new(at as u32, across, along)
    }

    /// The places of [`AT_ONCE`] directions between the nodes, each turned by `turn` first: components x, y, z of all.
    #[inline]
    #[must_use]
    pub fn cells(self, turn: &Matrix3<f32>, [x, y, z]: [&[f32; AT_ONCE]; 3]) -> [GridCell; AT_ONCE] {
        let (mut at, mut across, mut along) = ([0i32; AT_ONCE], [0.0f32; AT_ONCE], [0.0f32; AT_ONCE]);
        for k in 0..AT_ONCE {
            let by = |row: usize| turn[(row, 0)] * x[k] + turn[(row, 1)] * y[k] + turn[(row, 2)] * z[k];
            let (first, p, q) = self.within(self.place([by(0), by(1), by(2)]));
            at[k] = first as i32;
            across[k] = p;
            along[k] = q;
        }
        std::array::from_fn(|k| GridCell::new(at[k] as u32, across[k], along[k]))
    }

    /// Nodes along each edge of a face.
    #[must_use]
    pub fn side(self) -> usize {
        self.side
    }

    /// The direction of node `index`.
    #[must_use]
    pub fn direction(self, index: usize) -> Vector3<f64> {
        let (face, rest) = (index / (self.side * self.side), index % (self.side * self.side));
        let steps = (self.side - 1) as f64;
        let tangent = |k: usize| ((k as f64 / steps - 0.5) * std::f64::consts::FRAC_PI_2).tan();
        let (p, q) = (tangent(rest / self.side), tangent(rest % self.side));
        let sign = if face % 2 == 0 { 1.0 } else { -1.0 };
        let d = match face / 2 {
            0 => Vector3::new(sign, p, q),
            1 => Vector3::new(q, sign, p),
            _ => Vector3::new(p, q, sign),
        };
        d.normalize()
    }

    /// Angle between neighbouring nodes in the middle of a face, rad.
    #[must_use]
    pub fn spacing_rad(self) -> f64 {
        std::f64::consts::FRAC_PI_2 / (self.side - 1) as f64
    }
}

/// The value at a place with `corners`.
#[must_use]
pub fn value_at(map: &[f32], corners: &[(u32, f32)]) -> f32 {
    corners.iter().map(|&(k, w)| w * map[k as usize]).sum()
}

/// A direction across `axis`.
#[must_use]
pub fn across(axis: &Vector3<f64>) -> Vector3<f64> {
    let other = if axis.x.abs() < 0.7 * axis.norm() {
        Vector3::x()
    } else {
        Vector3::y()
    };
    axis.cross(&other).normalize()
}

/// arctan of a number from −1 to 1, to 1e-5 (Abramowitz and Stegun 1964, 4.4.47), which is how far nodes may lie from their places: every pixel asks
/// for it four times at every step of a fit.
#[inline(always)]
fn arc_tangent(t: f32) -> f32 {
    const TERMS: [f32; 5] = [0.020_835_1, -0.085_133, 0.180_141, -0.330_299_5, 0.999_866];
    let square = t * t;
    let [e, d, c, b, a] = TERMS;
    t * ((((e * square + d) * square + c) * square + b) * square + a)
}
