//! A floor that is not level: it goes through x = 0, z = 0 and rises by the angle s along +x.
//!
//! ```text
//! normal n = (−sin s, 0, cos s)        tangent t = (cos s, 0, sin s)
//! ```
//!
//! The ball touches where its centre is R from the floor along n, and the rebound model acts in the floor's frame (t, y, n);
//! gravity stays along −z. Everything that knows of a floor asks the [`Plane`]: flight, rebound, contact, floor line, shadow,
//! reflection.

use super::{Action, Effect, EffectEstimate, Ideal};
use crate::rebound::{Contact, Regime, RigidMotion};
use crate::simulate::camera::picture_shift_px;
use crate::simulate::flight::Trajectory;
use crate::simulate::frame_times_s;
use crate::simulate::scene::Scene;
use nalgebra::Vector3;

/// Floor slope.
pub(super) struct SlopingFloor;

impl Effect for SlopingFloor {
    fn name(&self) -> &'static str {
        "floor_slope"
    }

    fn is_of_the_ideal(&self) -> bool {
        true
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let formula =
            "largest distance between the rigid flights over the sloping floor and over a level one";
        let slope_rad = scene.floor.slope_rad;
        if slope_rad == 0.0 {
            return EffectEstimate::px(0.0, formula);
        }
        let (Ok(level), Ok(sloping)) = (
            ideal.rigid_over(scene, Plane::LEVEL),
            ideal.rigid_over(scene, Plane::sloping(slope_rad)),
        ) else {
            // One of them never lands: nothing that could be left out.
            return EffectEstimate::px(f64::INFINITY, formula);
        };
        let late_s = (level.impacts().iter().zip(sloping.impacts()))
            .map(|(a, b)| (b.time_s - a.time_s).abs())
            .fold(0.0, f64::max);
        let (shift_px, speed_share) = apart(scene, ideal, &level, &sloping);
        EffectEstimate {
            coupling: ideal.coupling_px(scene, speed_share, late_s),
            ..EffectEstimate::px(shift_px, formula)
        }
    }

    fn action(&self, scene: &Scene) -> Action {
        if scene.floor.slope_rad == 0.0 {
            Action::Nothing
        } else {
            Action::SceneFloor(Plane::sloping(scene.floor.slope_rad))
        }
    }
}

/// The largest distance of two paths in the picture, px, and of their velocities, as a share of the largest speed; in frames
/// that may show the ball.
fn apart(scene: &Scene, ideal: &Ideal, one: &Trajectory, other: &Trajectory) -> (f64, f64) {
    let top_speed = ideal.top_speed_m_s();
    let (mut shift_px, mut speed_share) = (0.0_f64, 0.0_f64);
    for time_s in frame_times_s(scene, one).take_while(|t| *t <= other.end_s()) {
        let (a, b) = (one.state(time_s), other.state(time_s));
        if ideal.may_show(&a.position_m) || ideal.may_show(&b.position_m) {
            let along_m = b.position_m - a.position_m;
            shift_px = shift_px.max(picture_shift_px(&scene.camera, &a.position_m, &along_m));
            speed_share = speed_share.max((b.velocity_m_s - a.velocity_m_s).norm() / top_speed);
        }
    }
    (shift_px, speed_share)
}

/// The floor, a plane through x = 0, z = 0. Its frame has the axes t, y and n: a vector's components along them stand where
/// those along x, y and z do. In the frame of a level floor every vector is as it was, to the last bit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    slope_rad: f64,
    sin: f64,
    cos: f64,
}

impl Plane {
    /// z = 0.
    pub const LEVEL: Self = Self {
        slope_rad: 0.0,
        sin: 0.0,
        cos: 1.0,
    };

    /// Rising by `slope_rad` along +x.
    #[must_use]
    pub fn sloping(slope_rad: f64) -> Self {
        let (sin, cos) = slope_rad.sin_cos();
        Self { slope_rad, sin, cos }
    }

    /// s, rad.
    #[must_use]
    pub fn slope_rad(&self) -> f64 {
        self.slope_rad
    }

    /// Whether it is z = 0.
    #[must_use]
    pub fn is_level(&self) -> bool {
        self.slope_rad == 0.0
    }

    /// A vector or place of the world in the floor's frame.
    #[must_use]
    pub fn into_frame(&self, v: &Vector3<f64>) -> Vector3<f64> {
        if self.is_level() {
            return *v;
        }
        Vector3::new(
            v.x * self.cos + v.z * self.sin,
            v.y,
            v.z * self.cos - v.x * self.sin,
        )
    }

    /// A vector or place in the floor's frame, in the world.
    #[must_use]
    pub fn out_of_frame(&self, v: &Vector3<f64>) -> Vector3<f64> {
        if self.is_level() {
            return *v;
        }
        Vector3::new(
            v.x * self.cos - v.z * self.sin,
            v.y,
            v.z * self.cos + v.x * self.sin,
        )
    }

    /// How far a place is from the floor, m, and of a velocity the part away from it, m/s.
    #[must_use]
    pub fn along_normal(&self, v: &Vector3<f64>) -> f64 {
        self.into_frame(v).z
    }

    /// `v` with another component along the normal.
    #[must_use]
    pub fn with_normal(&self, v: &Vector3<f64>, along_normal: f64) -> Vector3<f64> {
        let mut framed = self.into_frame(v);
        framed.z = along_normal;
        self.out_of_frame(&framed)
    }

    /// g cos s: what pulls towards the floor, m/s².
    #[must_use]
    pub fn gravity_towards(&self, gravity_m_s2: f64) -> f64 {
        gravity_m_s2 * self.cos
    }

    /// How far the lowest point of a ball at `x_m` is from the floor along the normal when it is `height_m` above z = 0, m.
    #[must_use]
    pub fn clearance_m(&self, x_m: f64, height_m: f64, radius_m: f64) -> f64 {
        height_m * self.cos - radius_m * (1.0 - self.cos) - x_m * self.sin
    }

    /// A motion in the floor's frame.
    #[must_use]
    pub fn motion_in_frame(&self, motion: &RigidMotion) -> RigidMotion {
        RigidMotion {
            velocity_m_s: self.into_frame(&motion.velocity_m_s),
            surface_spin_m_s: self.into_frame(&motion.surface_spin_m_s),
        }
    }

    /// The motion after an impact on this floor, and its regime.
    #[must_use]
    pub fn impact(
        &self,
        contact: &Contact,
        incoming: &RigidMotion,
        inertia_factor: f64,
    ) -> (RigidMotion, Regime) {
        let (rebound, regime) = contact.impact(&self.motion_in_frame(incoming), inertia_factor);
        let rebound = RigidMotion {
            velocity_m_s: self.out_of_frame(&rebound.velocity_m_s),
            surface_spin_m_s: self.out_of_frame(&rebound.surface_spin_m_s),
        };
        (rebound, regime)
    }

    /// The acceleration of a ball that rolls on it without slipping and without loss, m/s²: g sin s / (1 + k) downhill.
    #[must_use]
    pub fn rolling_acceleration(&self, gravity_m_s2: f64, inertia_factor: f64) -> Vector3<f64> {
        let downhill = Vector3::new(-gravity_m_s2 * self.sin / (1.0 + inertia_factor), 0.0, 0.0);
        if self.is_level() {
            Vector3::zeros()
        } else {
            self.out_of_frame(&downhill)
        }
    }

    /// The mirror image of a place.
    #[must_use]
    pub fn mirrored(&self, place_m: &Vector3<f64>) -> Vector3<f64> {
        self.with_normal(place_m, -self.along_normal(place_m))
    }
}
