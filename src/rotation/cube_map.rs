//! A function on the sphere: values at the nodes of a grid on each face of a cube around it, linear between them.

use nalgebra::Vector3;

/// The four nodes around a direction, with the weights that a linear function has there.
pub type NodeWeights = [(u32, f32); 4];

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
    /// steps along the middles of a face.)
    fn place(self, d: &Vector3<f64>) -> (usize, f64, f64) {
        let (x, y, z) = (d.x, d.y, d.z);
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let (face, major, p, q) = if ax >= ay && ax >= az {
            (usize::from(x < 0.0), ax, y, z)
        } else if ay >= az {
            (2 + usize::from(y < 0.0), ay, z, x)
        } else {
            (4 + usize::from(z < 0.0), az, x, y)
        };
        let steps = (self.side - 1) as f64;
        let along =
            |t: f64| steps * (0.5 + (t / major).clamp(-1.0, 1.0).atan() * std::f64::consts::FRAC_2_PI);
        (face, along(p), along(q))
    }

    /// The node nearest to `d`.
    #[must_use]
    pub fn nearest(self, d: &Vector3<f64>) -> usize {
        let (face, p, q) = self.place(d);
        (face * self.side + (p + 0.5) as usize) * self.side + (q + 0.5) as usize
    }

    /// The nodes around `d`.
    #[must_use]
    pub fn corners(self, d: &Vector3<f64>) -> NodeWeights {
        let (face, p, q) = self.place(d);
        let last = self.side - 2;
        let (i, j) = ((p as usize).min(last), (q as usize).min(last));
        let (fp, fq) = ((p - i as f64) as f32, (q - j as f64) as f32);
        let at = ((face * self.side + i) * self.side + j) as u32;
        let next = self.side as u32;
        [
            (at, (1.0 - fp) * (1.0 - fq)),
            (at + 1, (1.0 - fp) * fq),
            (at + next, fp * (1.0 - fq)),
            (at + next + 1, fp * fq),
        ]
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
pub fn value_at(map: &[f64], corners: &[(u32, f32)]) -> f64 {
    corners.iter().map(|&(k, w)| f64::from(w) * map[k as usize]).sum()
}
