//! The camera above, and what it sees of a ball with a place and a velocity in three dimensions.

use crate::flight::drag::Drag;
use crate::flight::planar::Motion;
use crate::geometry::PlanePoint;

/// What is known of the camera above and of the ball: the motion model of its arcs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearTopView {
    /// A: the floor's point straight below the camera, plane units.
    pub nadir: PlanePoint,
    /// Standard uncertainty of each of its coordinates, plane units.
    pub nadir_std: f64,
    /// γ = g/D, 1/s².
    pub fall_per_s2: f64,
    /// Relative standard uncertainty of γ.
    pub fall_relative_std: f64,
    /// D, plane units; `None` where the ball is the scale and has not been seen yet.
    pub height: Option<f64>,
    /// R/D; `None` where only the picture tells R.
    pub contact: Option<f64>,
    /// Drag, where the ball's mass and size are known.
    pub drag: Option<Drag>,
    /// I/(m R²).
    pub inertia_factor: f64,
}

impl NearTopView {
    /// The same with what a ball of `radius` plane units (seen on the floor) fills in.
    #[must_use]
    pub fn for_ball(self, radius: f64) -> Self {
        Self {
            height: self.height.or(self.contact.map(|c| radius / c)),
            contact: self.contact.or(self.height.map(|h| radius / h)),
            ..self
        }
    }

    /// D, plane units; 1 where nothing tells it.
    pub(super) fn camera_height(&self) -> f64 {
        self.height.unwrap_or(1.0)
    }

    /// Speed, plane units a second.
    #[must_use]
    pub fn speed(&self, flying: &SpatialMotion) -> f64 {
        flying.speed(self.camera_height())
    }

    /// R, plane units.
    pub(super) fn radius(&self) -> f64 {
        self.touching() * self.camera_height()
    }

    /// ζ of the ball's centre when it touches the floor.
    pub(super) fn touching(&self) -> f64 {
        self.contact.unwrap_or(0.0)
    }

    /// No fall from below the camera reaches the floor faster: √(2γ), camera heights a second.
    pub(super) fn fastest_per_s(&self) -> f64 {
        (2.0 * self.fall_per_s2).sqrt()
    }
}

/// Place and velocity in three dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpatialMotion {
    /// Over the floor: plane units, plane units a second.
    pub ground: Motion,
    /// ζ, camera heights.
    pub zeta: f64,
    /// Its rate, camera heights a second.
    pub rate: f64,
}

impl SpatialMotion {
    /// The motion of what the floor shows: the ball seen against it.
    #[must_use]
    pub fn seen(&self, nadir: PlanePoint) -> Motion {
        let m = 1.0 / (1.0 - self.zeta);
        let g = &self.ground;
        let (dr, dh) = (g.r - nadir.right, g.h - nadir.up);
        Motion {
            r: nadir.right + dr * m,
            h: nadir.up + dh * m,
            vr: (g.vr + dr * m * self.rate) * m,
            vh: (g.vh + dh * m * self.rate) * m,
        }
    }

    /// Speed in plane units a second, D being `height` of them.
    #[must_use]
    pub fn speed(&self, height: f64) -> f64 {
        // Not `hypot`: this is the inner loop, and speeds neither over- nor underflow.
        let (vr, vh, vz) = (self.ground.vr, self.ground.vh, self.rate * height);
        (vr * vr + vh * vh + vz * vz).sqrt()
    }
}
