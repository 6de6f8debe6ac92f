//! An impact takes time, and the ball is flattened meanwhile: Hertz (Johnson, Contact Mechanics, 1985, 11.1).
//!
//! ```text
//! T = 2.87 [m² / (R E*² v)]^(1/5)        contact time of an elastic impact at speed v
//! ```
//!
//! The centre dips by v T/π · sin(π t/T) (within 7 % of Hertz's greatest compression, 0.340 v T, and with the right
//! speed at the touch). It returns as a quarter of a sine that ends with e v, which takes T/(2 e): rebounds that lose
//! energy last longer. Below e = 1/2 that would go on without end; there the return takes T and is the cubic with the
//! same ends, a shape without a claim of its own. Where the contact model is the compliant one, compression, return and slip are those that
//! its springs give, which is Hertz's motion with a return slowed by e. Else friction acts in proportion to the normal force, so that the horizontal velocity changes with
//! the vertical one.

use super::deviation::{Disturbance, Jump};
use super::{Action, ContactLaw, Effect, EffectEstimate, Ideal, Plane};
use crate::rebound::model::ContactMoment;
use crate::rebound::{Contact, RigidMotion};
use crate::simulate::flight::Impact;
use crate::simulate::scene::Scene;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// The return takes at most so many times as long as the compression.
const LONGEST_RELEASE: f64 = 2.0;

/// Contact time and compression.
pub(super) struct ContactTime;

impl Effect for ContactTime {
    fn name(&self) -> &'static str {
        "contact_time"
    }

    fn estimate(&self, scene: &Scene, ideal: &Ideal) -> EffectEstimate {
        let law = Hertz::new(scene);
        let longest_s = ideal
            .trajectory
            .impacts()
            .iter()
            .map(|i| {
                let along = ideal.trajectory.floor().along_normal(&i.incident.velocity_m_s);
                law.elastic_time_s(along.abs())
            })
            .filter(|s| s.is_finite())
            .fold(0.0, f64::max);
        EffectEstimate::path(
            scene,
            ideal,
            &law,
            format!(
                "delay and dip by T = 2.87 (m²/(R E*² v))^(1/5), Johnson 1985; T up to {:.0} µs",
                longest_s * 1e6
            ),
        )
    }

    fn disturbance(&self, scene: &Scene) -> Option<Box<dyn Disturbance>> {
        Some(Box::new(Hertz::new(scene)))
    }

    fn action(&self, scene: &Scene) -> Action {
        Action::Contact(Box::new(Hertz::new(scene)))
    }
}

struct Hertz {
    mass_kg: f64,
    radius_m: f64,
    modulus_pa: f64,
    inertia_factor: f64,
    contact: Contact,
}

impl Hertz {
    fn new(scene: &Scene) -> Self {
        Self {
            mass_kg: scene.ball.mass_kg,
            radius_m: scene.ball.radius_m,
            modulus_pa: scene.ball.contact_modulus_pa,
            inertia_factor: scene.ball.inertia_factor,
            contact: scene.contact,
        }
    }

    /// d = [15 m v² / (16 E* √R)]^(2/5), m.
    fn compression_m(&self, speed_m_s: f64) -> f64 {
        let stiffness = 16.0 * self.modulus_pa * self.radius_m.sqrt();
        (15.0 * self.mass_kg * speed_m_s.powi(2) / stiffness).powf(0.4)
    }

    fn elastic_time_s(&self, speed_m_s: f64) -> f64 {
        2.87 * (self.mass_kg.powi(2) / (self.radius_m * self.modulus_pa.powi(2) * speed_m_s)).powf(0.2)
    }
}

impl ContactLaw for Hertz {
    fn dip(&self, incident: &RigidMotion, rebound: &RigidMotion) -> Option<Dip> {
        let (down, up) = (incident.velocity_m_s.z.abs(), rebound.velocity_m_s.z);
        // Without a rebound there is no end of contact; the ball stays down.
        (down > 0.0 && up > 0.0).then(|| {
            let path = self.contact.contact_path(incident, self.inertia_factor);
            if let Some(moments) = path {
                let path = SpringPath::new(&moments, self.compression_m(down), down);
                return Dip {
                    incident: incident.velocity_m_s,
                    rebound: rebound.velocity_m_s,
                    press_s: path.press_s(),
                    release_s: path.duration_s() - path.press_s(),
                    springs: Some(Arc::new(path)),
                };
            }
            let half_s = 0.5 * self.elastic_time_s(down);
            Dip {
                incident: incident.velocity_m_s,
                rebound: rebound.velocity_m_s,
                press_s: half_s,
                release_s: half_s * (down / up).min(LONGEST_RELEASE),
                springs: None,
            }
        })
    }
}

impl Disturbance for Hertz {
    fn jump(&self, impact: &Impact, floor: &Plane) -> Jump {
        let framed = |motion| floor.motion_in_frame(motion);
        self.dip(&framed(&impact.incident), &framed(&impact.rebound))
            .map_or_else(Jump::default, |dip| {
                let delay_s = dip.duration_s();
                let rebound_m = dip.rebound.norm() * delay_s;
                Jump {
                    delay_s,
                    shift_m: floor.out_of_frame(&dip.at(delay_s).0),
                    // During the contact a rigid ball would have flown off already.
                    transient_m: rebound_m + dip.incident.norm() * dip.press_s,
                }
            })
    }
}

/// How the centre moves while ball and floor touch, in the floor's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Dip {
    incident: Vector3<f64>,
    rebound: Vector3<f64>,
    press_s: f64,
    release_s: f64,
    /// Where the contact model says how the contact goes on.
    springs: Option<Arc<SpringPath>>,
}

/// A contact as its model has it, in metres and seconds.
#[derive(Debug, Clone, PartialEq)]
struct SpringPath(Vec<ContactNode>);

#[derive(Debug, Clone, Copy, PartialEq)]
struct ContactNode {
    time_s: f64,
    /// Of the centre against the touch, and its rate.
    height_m: f64,
    rate_m_s: f64,
    /// Share of the tangential impulse so far, and its integral over time.
    share: f64,
    shared_s: f64,
}

impl SpringPath {
    fn new(moments: &[ContactMoment], compression_m: f64, speed_m_s: f64) -> Self {
        let mut nodes: Vec<ContactNode> = Vec::with_capacity(moments.len());
        for moment in moments {
            let mut node = ContactNode {
                time_s: moment.time * compression_m / speed_m_s,
                height_m: -moment.compression * compression_m,
                rate_m_s: -moment.rate * speed_m_s,
                share: moment.tangential_share,
                shared_s: 0.0,
            };
            if let Some(last) = nodes.last() {
                let step_s = node.time_s - last.time_s;
                node.shared_s = last.shared_s + 0.5 * step_s * (node.share + last.share);
            }
            nodes.push(node);
        }
        Self(nodes)
    }

    fn duration_s(&self) -> f64 {
        self.0.last().map_or(0.0, |node| node.time_s)
    }

    /// Until it is deepest.
    fn press_s(&self) -> f64 {
        let deepest = self.0.iter().min_by(|a, b| a.height_m.total_cmp(&b.height_m));
        deepest.map_or(0.0, |node| node.time_s)
    }

    fn at(&self, t: f64) -> ContactNode {
        let after = self
            .0
            .partition_point(|node| node.time_s <= t)
            .clamp(1, self.0.len() - 1);
        let (a, b) = (self.0[after - 1], self.0[after]);
        let step_s = b.time_s - a.time_s;
        let s = ((t - a.time_s) / step_s).clamp(0.0, 1.0);
        // Hermite's cubic, whose rate is not quite the straight line between theirs.
        let hermite = |from: (f64, f64), to: (f64, f64)| {
            let rise = s * s * (3.0 - 2.0 * s);
            let (out, into) = (s * (1.0 - s).powi(2), s * s * (s - 1.0));
            let value = from.0 + rise * (to.0 - from.0) + step_s * (out * from.1 + into * to.1);
            let rate = 6.0 * s * (1.0 - s) * (to.0 - from.0) / step_s
                + (1.0 - s) * (1.0 - 3.0 * s) * from.1
                + s * (3.0 * s - 2.0) * to.1;
            (value, rate)
        };
        let (height_m, rate_m_s) = hermite((a.height_m, a.rate_m_s), (b.height_m, b.rate_m_s));
        let (shared_s, share) = hermite((a.shared_s, a.share), (b.shared_s, b.share));
        ContactNode {
            time_s: t,
            height_m,
            rate_m_s,
            share,
            shared_s,
        }
    }
}

impl Dip {
    /// From touch to parting, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.press_s + self.release_s
    }

    /// The deepest dip, m.
    fn depth_m(&self) -> f64 {
        self.incident.z.abs() * self.press_s * 2.0 / PI
    }

    /// Height (m) and its rate (m/s) at `t` seconds into the return.
    fn release(&self, t: f64) -> (f64, f64) {
        let (depth_m, up, s) = (self.depth_m(), self.rebound.z, t / self.release_s);
        if self.release_s < LONGEST_RELEASE * self.press_s {
            let phase = FRAC_PI_2 * s;
            return (-depth_m * phase.cos(), up * phase.sin());
        }
        // Hermite's cubic from (−depth, 0) to (0, up).
        let end = up * self.release_s;
        let z = -depth_m * (1.0 + s * s * (2.0 * s - 3.0)) + end * s * s * (s - 1.0);
        let rate = (depth_m * 6.0 * s * (1.0 - s) + end * s * (3.0 * s - 2.0)) / self.release_s;
        (z, rate)
    }

    /// Offset from the place of the touch (m) and velocity (m/s) at `t` seconds after it.
    #[must_use]
    pub fn at(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        if let Some(path) = &self.springs {
            let change = self.rebound - self.incident;
            let node = path.at(t);
            let mut offset = self.incident * t + change * node.shared_s;
            let mut velocity = self.incident + change * node.share;
            (offset.z, velocity.z) = (node.height_m, node.rate_m_s);
            return (offset, velocity);
        }
        let (down, up) = (self.incident.z.abs(), self.rebound.z);
        let (z, vz) = if t < self.press_s {
            let phase = FRAC_PI_2 * t / self.press_s;
            (-self.depth_m() * phase.sin(), -down * phase.cos())
        } else {
            self.release(t - self.press_s)
        };
        // Share of the normal impulse given so far, and its integral over time.
        let share = (vz + down) / (down + up);
        let shared_s = (z + down * t) / (down + up);
        let change = self.rebound - self.incident;
        let mut offset = self.incident * t + change * shared_s;
        let mut velocity = self.incident + change * share;
        offset.z = z;
        velocity.z = vz;
        (offset, velocity)
    }
}
