//! The fast formulas against a slow evaluation in 1000 bits, over usual, extreme and nearly cancelling input.
//!
//! For every relation of the paper and of the readings: the error is below 1e-12 of the value, or below four units in the last
//! place of every input, whichever is larger (`exactly::Relation::compare`). What a relation is, is written here once more
//! from the paper, not taken from the code.

use crate::exactly::{N, Relation, n};
use crate::noise::Noise;
use nalgebra::{Matrix3, Vector2, Vector3};
use track::calibration::{Calibration, MetresPerPixel, Ruler, Scale, ScaleEvidence};
use track::flight::drag::DragLaw;
use track::flight::planar::{ARCS, DRAG, GRAVITY, PlanarArcs};
use track::geometry::PixelPoint;
use track::impact::relations::ImpactVelocities;
use track::rebound::{Regime, RigidMotion, apply_impulse, azimuth_rad, e_e, grip_slide, itf, launch, mu_e};

/// Evaluations a relation; more with TRACK_EXACT.
fn times() -> usize {
    let more = std::env::var("TRACK_EXACT").ok().and_then(|n| n.parse().ok());
    more.unwrap_or(300)
}

/// Usual, extreme and nearly cancelling numbers.
struct Dice(Noise);

impl Dice {
    fn new(seed: u64) -> Self {
        Self(Noise(seed))
    }

    fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.uniform()
    }

    fn one_in(&mut self, sides: usize) -> bool {
        self.uniform() * (sides as f64) < 1.0
    }

    /// A positive size: of a laboratory mostly, one time in four of anything between 1e-100 and 1e100.
    fn size(&mut self) -> f64 {
        let most = if self.one_in(4) { 100.0 } else { 3.0 };
        10.0_f64.powf(self.between(-most, most))
    }

    fn signed(&mut self) -> f64 {
        if self.one_in(2) { self.size() } else { -self.size() }
    }

    /// A number that differs from `x` by a part of 1e-1 to 1e-16, or not at all; one time in two just any.
    fn near(&mut self, x: f64) -> f64 {
        if self.one_in(2) {
            return self.signed();
        }
        let part = 10.0_f64.powf(self.between(-17.0, -1.0));
        x * (1.0 + if self.one_in(2) { part } else { -part })
    }

    /// A coefficient between `from` and `to`, one time in five at an end or within 1e-15 of it.
    fn coefficient(&mut self, from: f64, to: f64) -> f64 {
        if !self.one_in(5) {
            return self.between(from, to);
        }
        let end = if self.one_in(2) { from } else { to };
        let inwards = if end == from { to - from } else { from - to };
        if self.one_in(2) {
            end
        } else {
            end + inwards * 1e-15
        }
    }

    /// k.
    fn inertia(&mut self) -> f64 {
        match (self.uniform() * 5.0) as u32 {
            0 => 10.0_f64.powf(self.between(-12.0, -2.0)),
            1 => 2.0 / 3.0,
            _ => self.between(0.05, 0.67),
        }
    }
}

fn report(relations: &[Relation]) {
    for r in relations {
        println!(
            "{:45} {:6} compared, worst {:.2} of the allowed",
            r.name, r.count, r.worst
        );
        assert!(r.count > times() / 3, "{}: only {}", r.name, r.count);
    }
}

fn one() -> N {
    n(1.0)
}

/// s = k / (1 + k).
fn share(k: &N) -> N {
    k / &(one() + k)
}

/// A plane motion: v_ox, v_oy, v_oz, then R ω_x, R ω_y; with slips that nearly vanish among them.
fn any_motion(dice: &mut Dice) -> [f64; 5] {
    let (vx, vy) = (dice.signed(), dice.signed());
    [vx, vy, -dice.size(), -dice.near(vy), dice.near(vx)]
}

fn to_motion(m: &[f64]) -> RigidMotion {
    RigidMotion {
        velocity_m_s: Vector3::new(m[0], m[1], m[2]),
        surface_spin_m_s: Vector3::new(m[3], m[4], 0.0),
    }
}

/// c = (v_x − R ω_y, v_y + R ω_x) [5].
fn slip(x: &[N]) -> (N, N) {
    (&x[0] - &x[4], &x[1] + &x[3])
}

/// [1–7] with the impulse P: v_x, v_y, R ω_x, R ω_y.
fn balance(x: &[N], (px, py): (N, N), k: &N) -> [N; 4] {
    [&x[0] + &px, &x[1] + &py, &x[3] + &(py / k), &x[4] - &(px / k)]
}

fn outcome(m: &RigidMotion) -> [f64; 4] {
    let (v, w) = (m.velocity_m_s, m.surface_spin_m_s);
    [v.x, v.y, w.x, w.y]
}

const OUTCOME: [&str; 4] = ["v_x", "v_y", "R w_x", "R w_y"];

#[test]
fn slip_and_impulse_balance() {
    let mut dice = Dice::new(1);
    let mut slips = Relation::new("slip [5]");
    let mut all = OUTCOME.map(Relation::new);
    let mut energy = Relation::new("energy");
    for _ in 0..times() {
        let m = any_motion(&mut dice);
        let motion = to_motion(&m);
        let c = motion.slip_m_s();
        slips.compare(&m, c.x, |x| slip(x).0);
        slips.compare(&m, c.y, |x| slip(x).1);
        let (px, py, k) = (-dice.near(m[0]), -dice.near(m[1]), dice.inertia());
        let after = apply_impulse(&motion, 0.5, Vector2::new(px, py), k);
        let inputs = [&m[..], &[px, py, k]].concat();
        for (i, (found, relation)) in outcome(&after).into_iter().zip(&mut all).enumerate() {
            relation.compare(&inputs, found, |x| {
                balance(x, (x[5].clone(), x[6].clone()), &x[7])[i].clone()
            });
        }
        let inputs = [&m[..], &[k]].concat();
        energy.compare(&inputs, motion.energy_j_kg(k), |x| {
            let square = |i: usize| &x[i] * &x[i];
            (square(0) + square(1) + square(2) + &x[5] * &(square(3) + square(4))) / n(2.0)
        });
    }
    report(&[slips, energy]);
    report(&all);
}

/// Whether `regime` is that of s (1 + e_x) |c| against μ (1 + e) |v_oz|, but for a tie to 8 ulp.
fn regime_is_right(slides: bool, demand: &N, limit: &N, what: &str) {
    let gap = (demand - limit).rounded();
    let tie = gap.abs() <= 8.0 * f64::EPSILON * limit.rounded().max(demand.rounded());
    assert!(
        tie || slides == (gap > 0.0),
        "{what}: slides {slides}, by {gap:e}"
    );
}

#[test]
fn mu_e_and_grip_slide_impacts() {
    let mut dice = Dice::new(2);
    for name in ["mu_e", "grip_slide"] {
        let mut all = OUTCOME.map(Relation::new);
        let mut bounce = Relation::new("v_z");
        for _ in 0..times() {
            let m = any_motion(&mut dice);
            let (e, mu, k) = (
                dice.coefficient(0.0, 1.0),
                dice.coefficient(0.0, 1.5),
                dice.inertia(),
            );
            let e_x = if name == "mu_e" {
                0.0
            } else {
                dice.coefficient(-1.0, 1.0)
            };
            let (after, regime) = if name == "mu_e" {
                let p = mu_e::Parameters {
                    restitution: e,
                    friction: mu,
                    static_friction: mu,
                };
                mu_e::impact(&to_motion(&m), &p, k)
            } else {
                let p = grip_slide::Parameters {
                    restitution: e,
                    tangential_restitution_x: e_x,
                    friction: mu,
                };
                grip_slide::impact(&to_motion(&m), &p, k)
            };
            let slides = regime == Regime::Sliding;
            let inputs = [&m[..], &[e, mu, k, e_x]].concat();
            let at: Vec<N> = inputs.iter().map(|&x| n(x)).collect();
            let (cx, cy) = slip(&at);
            let limit = &at[6] * &(one() + &at[5]) * at[2].abs();
            regime_is_right(
                slides,
                &(share(&at[7]) * (one() + &at[8]) * cx.hypot(&cy)),
                &limit,
                name,
            );
            let exact = |x: &[N]| {
                let (cx, cy) = slip(x);
                let length = cx.hypot(&cy);
                let part = if !slides {
                    share(&x[7]) * (one() + &x[8])
                } else if length.is_zero() {
                    n(0.0)
                } else {
                    &x[6] * &(one() + &x[5]) * x[2].abs() / &length
                };
                balance(x, (-(&part * &cx), -(&part * &cy)), &x[7])
            };
            for (i, (found, relation)) in outcome(&after).into_iter().zip(&mut all).enumerate() {
                relation.compare(&inputs, found, |x| exact(x)[i].clone());
            }
            bounce.compare(&inputs, after.velocity_m_s.z, |x| &x[5] * &x[2].abs());
        }
        println!("{name}");
        report(&all);
        report(&[bounce]);
    }
}

#[test]
fn e_e_impacts_and_the_azimuth() {
    let mut dice = Dice::new(3);
    let mut all = OUTCOME.map(Relation::new);
    let mut azimuth = Relation::new("azimuth [23]");
    for _ in 0..times() {
        let m = any_motion(&mut dice);
        let (e, k) = (dice.coefficient(0.0, 1.0), dice.inertia());
        let (e_x, e_y) = (dice.coefficient(-1.0, 1.0), dice.coefficient(-1.0, 1.0));
        let p = e_e::Parameters {
            restitution: e,
            tangential_restitution_x: e_x,
            tangential_restitution_y: e_y,
        };
        let incoming = to_motion(&m);
        let after = e_e::impact(&incoming, &p, k).0;
        let inputs = [&m[..], &[e, e_x, e_y, k]].concat();
        let exact = |x: &[N]| {
            let (cx, cy) = slip(x);
            let speed = x[0].hypot(&x[1]);
            let (ax, ay) = (&x[0] / &speed, &x[1] / &speed);
            let along = share(&x[8]) * (one() + &x[6]) * (&cx * &ax + &cy * &ay);
            let across = share(&x[8]) * (one() + &x[7]) * (&cy * &ax - &cx * &ay);
            let p = (-(&along * &ax - &across * &ay), -(&along * &ay + &across * &ax));
            balance(x, p, &x[8])
        };
        for (i, (found, relation)) in outcome(&after).into_iter().zip(&mut all).enumerate() {
            relation.compare(&inputs, found, |x| exact(x)[i].clone());
        }
        let directions = [m[0], m[1], dice.near(m[0]), dice.near(m[1])];
        let turned = to_motion(&[directions[2], directions[3], 1.0, 0.0, 0.0]);
        azimuth.compare(&directions, azimuth_rad(&incoming, &turned).unwrap(), |x| {
            (&x[0] * &x[3] - &x[1] * &x[2]).atan2(&(&x[0] * &x[2] + &x[1] * &x[3]))
        });
    }
    report(&all);
    report(&[azimuth]);
}

#[test]
fn tangents_and_limiting_angles() {
    let mut dice = Dice::new(4);
    let [mut sliding, mut rolling, mut grip] = [
        "tan phi sliding [14]",
        "tan phi nonsliding [15]",
        "tan phi e-e [24]",
    ]
    .map(Relation::new);
    let [mut begins, mut ends] = ["transition angle [16]", "end of grip"].map(Relation::new);
    for _ in 0..times() {
        let (tangent, ratio, k) = (dice.signed(), dice.near(1.0), dice.inertia());
        let (e, mu, e_x) = (
            dice.coefficient(1e-9, 1.0),
            dice.coefficient(0.0, 1.5),
            dice.coefficient(-1.0, 1.0),
        );
        let p = mu_e::Parameters {
            restitution: e,
            friction: mu,
            static_friction: mu,
        };
        let inputs = [tangent, ratio, e, mu, k, e_x];
        let forwards = tangent * (1.0 - ratio);
        if let Some(found) = mu_e::sliding_rebound_tangent(&p, tangent, ratio) {
            let sign = if forwards == 0.0 { 0.0 } else { forwards.signum() };
            sliding.compare(&inputs, found, |x| {
                (&x[0] - &(n(sign) * &x[3] * (one() + &x[2]))) / &x[2]
            });
        }
        if let Some(found) = mu_e::nonsliding_rebound_tangent(e, tangent, ratio, k) {
            rolling.compare(&inputs, found, |x| {
                let s = share(&x[4]);
                (one() - &s + &s * &x[1]) * &x[0] / &x[2]
            });
        }
        let q = e_e::Parameters {
            restitution: e,
            tangential_restitution_x: e_x,
            tangential_restitution_y: 0.0,
        };
        if let Some(found) = e_e::rebound_tangent(&q, tangent, ratio, k) {
            grip.compare(&inputs, found, |x| {
                let s = share(&x[4]);
                (one() - &s - &s * &x[5] + &s * &(one() + &x[5]) * &x[1]) * &x[0] / &x[2]
            });
        }
        if ratio != 1.0 {
            begins.compare(&inputs, mu_e::transition_angle_rad(&p, ratio, k), |x| {
                (&x[3] * &(one() + &x[2])).atan2(&(share(&x[4]) * (one() - &x[1]).abs()))
            });
            ends.compare(&inputs, e_e::grip_limit_angle_rad(e, e_x, mu, ratio, k), |x| {
                let needed = share(&x[4]) * (one() + &x[5]) * (one() - &x[1]).abs();
                if needed.is_zero() {
                    return n(std::f64::consts::FRAC_PI_2);
                }
                (&x[3] * &(one() + &x[2])).atan2(&needed)
            });
        }
    }
    report(&[sliding, rolling, grip, begins, ends]);
}

#[test]
fn the_horizontal_launch() {
    let mut dice = Dice::new(5);
    let [mut sliding, mut e_e, mut nonsliding, mut track] = [
        "x sliding [25]",
        "x e-e [26]",
        "x nonsliding [27]",
        "spin of a track",
    ]
    .map(Relation::new);
    let [mut vx, mut vz, mut spin, mut impulse] =
        ["v_x [28]", "v_z [29]", "R w_y [30]", "impulse [31]"].map(Relation::new);
    for _ in 0..times() {
        let (x0, u, g, k) = (dice.size(), dice.size(), dice.size(), dice.inertia());
        let (e, mu, e_x) = (
            dice.coefficient(0.0, 1.0),
            dice.coefficient(0.0, 1.5),
            dice.coefficient(-1.0, 1.0),
        );
        let ratio = dice.near(1.0);
        let inputs = [x0, u, e, mu, g];
        let slip = launch::Slip::of_spin_ratio(ratio);
        let found = launch::sliding_distance_m(x0, u, e, mu, slip, g);
        if found.is_finite() {
            sliding.compare(&inputs, found, |x| {
                let loss = &x[3] * &(one() + &x[2]) * &x[4] * &x[0] / &(&x[1] * &x[1]);
                n(2.0) * &x[2] * &x[0] * (one() - n(slip.sign()) * loss)
            });
        }
        let gripping = |x: &[N]| {
            let s = share(&x[3]);
            n(2.0) * &x[1] * &x[0] * (one() - &s - &s * &x[4] + &s * &(one() + &x[4]) * &x[2])
        };
        e_e.compare(
            &[x0, e, ratio, k, e_x],
            launch::e_e_distance_m(x0, e, e_x, ratio, k),
            gripping,
        );
        let found = launch::nonsliding_distance_m(x0, e, ratio, k);
        nonsliding.compare(&[x0, e, ratio, k, 0.0], found, gripping);
        let (radius, width) = (x0, 2.0 * dice.near(x0).abs());
        if let Some(found) = launch::track_spin_ratio(radius, width) {
            track.compare(&[radius, width], found, |x| {
                &x[0] / &(&x[0] * &x[0] - &x[1] * &x[1] / n(4.0)).sqrt()
            });
        }
        let d = launch::DistancePair {
            x0_m: x0,
            x_m: dice.near(x0).abs(),
            rolling_x0_m: dice.size(),
            rolling_x_m: dice.size(),
        };
        let inputs = [d.x0_m, d.x_m, d.rolling_x0_m, d.rolling_x_m, u, ratio, k, g];
        let kept = |x: &[N]| &x[4] * &(&x[1] / &x[0]) * (&x[2] / &x[3]);
        if let Some(r) = launch::friction_free_reading(&d, u, ratio, k, g) {
            vx.compare(&inputs, r.vx_m_s, kept);
            vz.compare(&inputs, r.vz_m_s, |x| {
                &x[7] * &x[0] / &(n(2.0) * &x[4]) * (&x[3] / &x[2])
            });
            spin.compare(&inputs, r.surface_spin_m_s, |x| {
                &x[5] * &x[4] + (&x[4] - &kept(x)) / &x[6]
            });
            impulse.compare(&inputs, r.tangential_impulse_m_s, |x| kept(x) - &x[4]);
        }
    }
    report(&[sliding, e_e, nonsliding, vx, vz, spin, impulse]);
    assert!(track.count > times() / 20);
}

#[test]
fn readings_of_a_recording() {
    let mut dice = Dice::new(6);
    let [mut theta, mut phi, mut e, mut ratio] = ["theta", "phi", "e", "v_x / v_ox"].map(Relation::new);
    let [mut mu, mut spin, mut slip, mut e_x] = ["mu", "R w_y [7]", "slip", "e_x [17]"].map(Relation::new);
    let mut pace = Relation::new("court pace rating");
    for _ in 0..times() {
        let (a, c) = (dice.signed(), -dice.size());
        let (b, d, w, k) = (
            dice.near(a),
            -c * dice.coefficient(0.0, 1.0),
            dice.near(a),
            dice.inertia(),
        );
        let crossing = ImpactVelocities {
            before_m_s: (a, c),
            after_m_s: (b, d),
            spin_in_m_s: w,
            measured_spin_out_m_s: f64::NAN,
            inertia_factor: k,
        };
        let inputs = [a, c, b, d, w, k];
        theta.compare(&inputs, crossing.incident_angle_rad(1.0), |x| {
            x[0].atan2(&-x[1].clone())
        });
        phi.compare(&inputs, crossing.rebound_angle_rad(-1.0), |x| {
            (-x[2].clone()).atan2(&x[3])
        });
        e.compare(&inputs, crossing.restitution(), |x| -(&x[3] / &x[1]));
        ratio.compare(&inputs, crossing.tangential_ratio(), |x| &x[2] / &x[0]);
        // |v_oz| (1 + e) with e = v_z / |v_oz|.
        mu.compare(&inputs, crossing.friction(), |x| {
            (&x[0] - &x[2]) / (x[1].abs() * (one() + &x[3] / &x[1].abs()))
        });
        let after = |x: &[N]| &x[4] + &((&x[0] - &x[2]) / &x[5]);
        spin.compare(&inputs, crossing.spin_out_m_s(), after);
        slip.compare(&inputs, crossing.slip_in_m_s(), |x| &x[0] - &x[4]);
        if a != w {
            e_x.compare(&inputs, crossing.tangential_restitution(), |x| {
                -((&x[2] - &after(x)) / (&x[0] - &x[4]))
            });
        }
        let (e, mu, t) = (
            dice.between(0.0, 1.0),
            dice.between(0.0, 1.5),
            dice.between(-20.0, 60.0),
        );
        pace.compare(&[e, mu, t], itf::court_pace_rating(e, mu, t), |x| {
            let corrected = &x[0] + &(n(0.003) * (n(23.0) - &x[2]));
            n(100.0) * (one() - &x[1]) + n(150.0) * (n(0.81) - &corrected)
        });
    }
    report(&[theta, phi, e, ratio, mu, spin, slip, e_x, pace]);
}

#[test]
fn parabolas_their_meeting_and_their_return() {
    let mut dice = Dice::new(7);
    let [mut right, mut height, mut rise] = ["r(t)", "h(t)", "h'(t)"].map(Relation::new);
    let [mut meets, mut returns] = ["time of impact", "time of return"].map(Relation::new);
    for i in 0..times() {
        // Usual times, and those of a clock that has run for 12 days; an origin in the picture, and far outside.
        let late = if i % 3 == 0 { 1e6 } else { 0.0 };
        let far = if i % 5 == 0 { 1e9 } else { 0.0 };
        let g = dice.between(1e3, 2e4);
        let hit = late + dice.between(0.1, 1.0);
        let times = [hit - dice.between(0.02, 0.1), hit + dice.between(0.02, 0.1)];
        // Arcs through one place at the impact, but for a little.
        let (r0, h0) = (far + dice.between(-500.0, 500.0), dice.between(-500.0, 500.0));
        let mut p = vec![0.0; ARCS + 8];
        p[GRAVITY] = g;
        p[DRAG] = 0.0;
        for (arc, up) in [(0, -dice.between(50.0, 3000.0)), (1, dice.between(20.0, 2500.0))] {
            let (dt, vr) = (times[arc] - hit, dice.between(-2000.0, 2000.0));
            p[ARCS + 4 * arc] = r0 + vr * dt + dice.between(-0.01, 0.01);
            p[ARCS + 4 * arc + 1] = vr;
            p[ARCS + 4 * arc + 2] = h0 + up * dt - 0.5 * g * dt * dt;
            p[ARCS + 4 * arc + 3] = up - g * dt;
        }
        let t = times[0] + dice.between(-0.2, 0.2);
        let inputs = [&p[..], &times[..], &[t]].concat();
        let from = |x: &[N], arc: usize, t: &N| {
            let (a, dt) = (&x[ARCS + 4 * arc..], t - &x[ARCS + 8 + arc]);
            let g = &x[GRAVITY];
            (
                &a[0] + &(&a[1] * &dt),
                &a[2] + &(&a[3] * &dt) - g * &(&dt * &dt) / n(2.0),
                &a[3] - &(g * &dt),
            )
        };
        let planar = PlanarArcs {
            parameters: &p,
            times: &times,
            law: DragLaw::default(),
            bent: false,
        };
        let m = planar.motion(0, t);
        let at = |x: &[N]| from(x, 0, &x[ARCS + 10]);
        right.compare(&inputs, m.r, |x| at(x).0);
        height.compare(&inputs, m.h, |x| at(x).1);
        rise.compare(&inputs, m.vh, |x| at(x).2);
        // Least distance of the two: −(D · V)/V² from any time on.
        meets.compare(&inputs, planar.intersection(0, 1).unwrap().0, |x| {
            let zero = x[ARCS + 8].clone();
            let ((r, h, v), (s, k, w)) = (from(x, 0, &zero), from(x, 1, &zero));
            let (dr, dh, dvr, dvh) = (s - r, k - h, &x[ARCS + 5] - &x[ARCS + 1], w - v);
            let square = &dvr * &dvr + &dvh * &dvh;
            zero - (dr * &dvr + dh * &dvh) / square
        });
        let up = planar.motion(1, hit).vh;
        if up > 0.0 {
            let inputs = [&p[..], &times[..], &[hit]].concat();
            returns.compare(&inputs, planar.return_time(1, hit), |x| {
                n(2.0) * from(x, 1, &x[ARCS + 10]).2 / &x[GRAVITY]
            });
        }
    }
    report(&[right, height, rise, meets, returns]);
}

#[test]
fn from_the_picture_to_the_plane_and_to_metres() {
    let mut dice = Dice::new(8);
    let [mut right, mut up, mut x, mut y, mut ruler] = [
        "right",
        "up",
        "homography x",
        "homography y",
        "metres of a ruler's pixel",
    ]
    .map(Relation::new);
    for i in 0..times() {
        let far = if i % 4 == 0 { 1e8 } else { 1e3 };
        let (u, v) = (dice.between(0.0, 4000.0), dice.between(0.0, 2000.0));
        let (ou, ov, a, b) = (
            dice.between(-far, far),
            dice.between(-far, far),
            dice.between(-1.0, 1.0),
            dice.between(-1.0, 1.0),
        );
        let mut c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 1.0,
            std: None,
        }));
        c.origin_px = Some(PixelPoint::new(ou, ov));
        c.up_px = [a, b];
        let found = c
            .rectification()
            .unwrap()
            .plane_from_pixel(PixelPoint::new(u, v))
            .unwrap();
        let inputs = [u, v, ou, ov, a, b];
        let along = |x: &[N], right: bool| {
            let (du, dv, length) = (&x[0] - &x[2], &x[1] - &x[3], x[4].hypot(&x[5]));
            (if right {
                du * -x[5].clone() + dv * &x[4]
            } else {
                du * &x[4] + dv * &x[5]
            }) / length
        };
        right.compare(&inputs, found.right, |x| along(x, true));
        up.compare(&inputs, found.up, |x| along(x, false));

        let mut h = [0.0; 9].map(|_: f64| dice.between(-1e-3, 1e-3));
        (h[2], h[5], h[8]) = (dice.between(-1.0, 1.0), dice.between(-1.0, 1.0), 1.0);
        (h[6], h[7]) = (h[6] * 0.1, h[7] * 0.1);
        let mut c = Calibration::new(Scale::Homography(Matrix3::from_row_slice(&h).into()));
        c.image_size_px = Some((1280, 720));
        let inputs = [&h[..], &[u, v]].concat();
        if let Ok(map) = c.rectification()
            && let Some(found) = map.plane_from_pixel(PixelPoint::new(u, v))
        {
            let row = |x: &[N], i: usize| &x[3 * i] * &x[9] + &x[3 * i + 1] * &x[10] + &x[3 * i + 2];
            x.compare(&inputs, found.right, |x| row(x, 0) / row(x, 2));
            y.compare(&inputs, found.up, |x| row(x, 1) / row(x, 2));
        }
        let (fu, fv, length) = (dice.between(0.0, 4000.0), dice.between(0.0, 2000.0), dice.size());
        let scale = Scale::Ruler(Ruler {
            from: PixelPoint::new(u, v),
            to: PixelPoint::new(fu, fv),
            length_m: length,
            length_std_m: None,
            point_std_px: None,
        });
        let metres = Calibration::new(scale).metres_per_unit(&ScaleEvidence::default());
        if let Ok(metres) = metres {
            ruler.compare(&[u, v, fu, fv, length], metres.value, |x| {
                &x[4] / &(&x[2] - &x[0]).hypot(&(&x[3] - &x[1]))
            });
        }
    }
    report(&[right, up, x, y, ruler]);
}
