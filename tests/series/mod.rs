//! Series made from the models' own relations, with noise, for the tests of `fit`.

use crate::noise::Noise;
use nalgebra::Vector3;
use track::rebound::fit::{
    self, Column, Fitted, GroupFit, ModelFit, ModelName, Options, Parameter, Row, Series,
};
use track::rebound::{RigidMotion, SOLID_SPHERE, compliant, e_e, grip_slide, mu_e};

pub const G: f64 = 9.81;

/// What a ball follows.
#[derive(Debug, Clone, Copy)]
pub enum Truth {
    MuE(mu_e::Parameters),
    EE(e_e::Parameters),
    GripSlide(grip_slide::Parameters),
    Compliant(compliant::Parameters),
}

pub fn mu_e(restitution: f64, friction: f64, static_friction: f64) -> Truth {
    Truth::MuE(mu_e::Parameters {
        restitution,
        friction,
        static_friction,
    })
}

pub fn e_e(restitution: f64, e_x: f64) -> Truth {
    Truth::EE(e_e::Parameters {
        restitution,
        tangential_restitution_x: e_x,
        tangential_restitution_y: e_x,
    })
}

pub fn grip_slide(restitution: f64, e_x: f64, friction: f64) -> Truth {
    Truth::GripSlide(grip_slide::Parameters {
        restitution,
        tangential_restitution_x: e_x,
        friction,
    })
}

pub fn compliant(restitution: f64, friction: f64, stiffness_ratio: f64) -> Truth {
    Truth::Compliant(compliant::Parameters {
        restitution,
        friction,
        stiffness_ratio,
    })
}

impl Truth {
    pub fn impact(&self, incoming: &RigidMotion, k: f64) -> RigidMotion {
        match self {
            Self::MuE(p) => mu_e::impact(incoming, p, k).0,
            Self::EE(p) => e_e::impact(incoming, p, k).0,
            Self::GripSlide(p) => grip_slide::impact(incoming, p, k).0,
            Self::Compliant(p) => compliant::impact(incoming, p, k).0,
        }
    }
}

/// A bounce in truth.
#[derive(Debug, Clone, Copy)]
pub struct Bounce {
    pub before: RigidMotion,
    pub after: RigidMotion,
}

/// A launch at `speed_m_s` that lands at `angle_deg` from the vertical.
pub fn bounce(truth: &Truth, speed_m_s: f64, angle_deg: f64, spin_ratio: f64) -> Bounce {
    let before = RigidMotion {
        velocity_m_s: Vector3::new(speed_m_s, 0.0, -speed_m_s / angle_deg.to_radians().tan()),
        surface_spin_m_s: Vector3::new(0.0, spin_ratio * speed_m_s, 0.0),
    };
    Bounce {
        before,
        after: truth.impact(&before, SOLID_SPHERE),
    }
}

/// Deviations of the noise; 0 for none.
#[derive(Debug, Clone, Copy)]
pub struct Deviations {
    /// Of a velocity, relative to the speed.
    pub velocity: f64,
    pub angle_deg: f64,
    /// Of a distance, m.
    pub distance_m: f64,
}

/// What `track` gives.
pub const TRACK: Deviations = Deviations {
    velocity: 1e-3,
    angle_deg: 0.05,
    distance_m: 2e-4,
};

pub const EXACT: Deviations = Deviations {
    velocity: 0.0,
    angle_deg: 0.0,
    distance_m: 0.0,
};

/// A row of velocities; with `stated` their deviations beside them.
pub fn velocities(number: usize, b: &Bounce, d: Deviations, stated: bool, noise: &mut Noise) -> Row {
    let std_in = d.velocity * b.before.velocity_m_s.norm();
    let std_out = d.velocity * b.after.velocity_m_s.norm();
    let mut row = Row::new(number, "all");
    for (column, value, std) in [
        (Column::IncidentVx, b.before.velocity_m_s.x, std_in),
        (Column::IncidentVz, b.before.velocity_m_s.z, std_in),
        (Column::ReboundVx, b.after.velocity_m_s.x, std_out),
        (Column::ReboundVz, b.after.velocity_m_s.z, std_out),
    ] {
        row = row.with(column, value + std * noise.normal(), stated.then_some(std));
    }
    row.with(Column::SpinIn, b.before.surface_spin_m_s.y, None)
}

/// A row of angles.
pub fn angles(number: usize, b: &Bounce, d: Deviations, stated: bool, noise: &mut Noise) -> Row {
    let mut row = Row::new(number, "all");
    for (column, angle) in [
        (Column::IncidentAngle, b.before.angle_rad()),
        (Column::ReboundAngle, b.after.angle_rad()),
    ] {
        let value = angle.to_degrees() + d.angle_deg * noise.normal();
        row = row.with(column, value, stated.then_some(d.angle_deg));
    }
    row.with(
        Column::SpinRatio,
        b.before.surface_spin_m_s.y / b.before.velocity_m_s.x,
        None,
    )
}

/// A row of distances, as the horizontal launch gives them.
pub fn distances(number: usize, b: &Bounce, d: Deviations, stated: bool, noise: &mut Noise) -> Row {
    let speed = b.before.velocity_m_s.x;
    let x0 = speed * b.before.velocity_m_s.z.abs() / G;
    let x = b.after.velocity_m_s.x * 2.0 * b.after.velocity_m_s.z / G;
    let std = stated.then_some(d.distance_m);
    Row::new(number, "all")
        .with(Column::X0, x0 + d.distance_m * noise.normal(), std)
        .with(Column::X, x + d.distance_m * noise.normal(), std)
        .with(
            Column::LaunchSpeed,
            speed * (1.0 + d.velocity * noise.normal()),
            stated.then_some(d.velocity * speed),
        )
        .with(Column::SpinRatio, b.before.surface_spin_m_s.y / speed, None)
}

pub type Maker = fn(usize, &Bounce, Deviations, bool, &mut Noise) -> Row;

/// A series of launches at 1 m/s over `angles_deg`.
pub fn series(
    truth: &Truth,
    angles_deg: &[f64],
    spin_ratio: f64,
    make: Maker,
    d: Deviations,
    noise: &mut Noise,
) -> Series {
    let rows: Vec<Row> = angles_deg
        .iter()
        .enumerate()
        .map(|(i, &angle)| {
            make(
                i + 1,
                &bounce(truth, 1.0, angle, spin_ratio),
                d,
                d.velocity > 0.0,
                noise,
            )
        })
        .collect();
    Series::new("made", rows, Vec::new()).unwrap()
}

/// `count` angles from `from` to `to`.
pub fn spread(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count)
        .map(|i| from + (to - from) * i as f64 / (count - 1) as f64)
        .collect()
}

/// The only group of a series, fitted.
pub fn fitted(series: &Series) -> GroupFit {
    let mut fit = fit::fit(series, &Options::default());
    assert_eq!(fit.groups.len(), 1);
    fit.groups.remove(0)
}

pub fn model(group: &GroupFit, name: ModelName) -> &ModelFit {
    group.model(name).unwrap()
}

pub fn value(fit: &ModelFit, parameter: Parameter) -> f64 {
    fit.parameter(parameter)
        .quantity()
        .unwrap_or_else(|| panic!("{parameter:?} of {:?}: {:?}", fit.name, fit.parameter(parameter)))
        .value
}

pub fn is_null(fit: &ModelFit, parameter: Parameter) {
    let fitted = fit.parameter(parameter);
    assert!(
        fitted.reason().is_some_and(|reason| !reason.is_empty()),
        "{parameter:?} of {:?} should be null with a reason: {fitted:?}",
        fit.name
    );
}

pub fn near(found: f64, truth: f64, within: f64, what: &str) {
    assert!(
        (found - truth).abs() <= within,
        "{what}: {found}, not within {within} of {truth}"
    );
}

/// No number anywhere is NaN or infinite, and no uncertainty is 0.
pub fn sound(group: &GroupFit) {
    for fit in &group.models {
        let all = fit.parameters.iter().chain([&fit.transition.angle_rad]);
        for estimate in all.filter_map(Fitted::estimate) {
            let q = estimate.quantity;
            assert!(q.value.is_finite(), "{:?}", fit.name);
            assert!(
                q.std_uncertainty.is_none_or(|s| s.is_finite() && s > 0.0),
                "{:?} {q:?}",
                fit.name
            );
            let (low, high) = estimate.interval_95;
            assert!(
                low.is_none_or(|l| l <= q.value) && high.is_none_or(|h| h >= q.value),
                "{estimate:?}"
            );
        }
        assert!(fit.chi2.is_finite() && fit.rows.iter().all(|row| row.chi2.is_finite()));
    }
}
