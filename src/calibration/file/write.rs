//! A calibration in the file's form.

use crate::calibration::experiment::ROLLING;
use crate::calibration::json::{object, point, rows};
use crate::calibration::{Calibration, Deviation, SCHEMA, View};
use crate::rebound::compliant::stiffness::Material;
use serde_json::{Value, json};

/// The keys in the order of the contract; what is not known is left out, but for the nulls that mean something.
pub(super) fn to_json(c: &Calibration) -> Value {
    let view = match c.view {
        View::Side => "side",
        View::Top => "top",
    };
    let given = |std: &[Option<f64>]| {
        let short: Vec<Option<f64>> = std.iter().map(|s| s.map(short)).collect();
        short.iter().any(Option::is_some).then(|| json!(short))
    };
    let lens = c.lens.as_ref().map(|l| {
        object([
            ("camera_matrix", Some(rows(l.camera_matrix()))),
            ("distortion", Some(json!(l.distortion()))),
            ("camera_std_px", given(&c.lens_std[..4])),
            ("distortion_std", given(&c.lens_std[4..])),
        ])
    });
    let modulus = |of: Option<Material>| of.map(|m| m.youngs_modulus_pa.into());
    let poisson = |of: Option<Material>| of.map(|m| m.poisson_ratio.into());
    let ball = object([
        ("radius_m", c.ball.radius_m.map(Value::from)),
        ("radius_std_m", c.ball.radius_std_m.map(Value::from)),
        ("mass_kg", c.ball.mass_kg.map(Value::from)),
        ("inertia_factor", Some(c.ball.inertia_factor.into())),
        ("youngs_modulus_pa", modulus(c.ball.material)),
        ("poisson_ratio", poisson(c.ball.material)),
    ]);
    let launch = object([
        (
            "edge_x_m",
            (c.launch.edge_x_m.is_some() || c.has_origin()).then(|| c.launch.edge_x_m.into()),
        ),
        (
            "spin_ratio",
            Some(if c.launch.rolling {
                ROLLING.into()
            } else {
                c.launch.spin_ratio.into()
            }),
        ),
        ("track_width_m", c.launch.track_width_m.map(Value::from)),
    ]);
    let floor = &c.floor;
    let floor = object([
        (
            "slope_deg",
            floor.given.then(|| floor.slope_rad.to_degrees().into()),
        ),
        ("std_deg", floor.given.then(|| floor.std_rad.to_degrees().into())),
        (
            "line_px",
            floor.line.map(|line| json!([point(line.from), point(line.to)])),
        ),
        ("line_std_px", floor.line.map(|line| line.std_px.into())),
        ("youngs_modulus_pa", modulus(floor.material)),
        ("poisson_ratio", poisson(floor.material)),
    ]);
    let says_floor = c.floor.given || c.floor.line.is_some() || c.floor.material.is_some();
    object([
        ("schema", Some(SCHEMA.into())),
        ("view", Some(view.into())),
        (
            "image_size_px",
            c.image_size_px.map(|(width, height)| json!([width, height])),
        ),
        ("scale", Some(c.scale.to_json())),
        ("origin_px", c.origin_px.map(point)),
        ("origin_std_px", c.origin_std_px.map(Value::from)),
        (
            "up_px",
            (c.up_given && !c.scale.has_axes()).then(|| json!(c.up_px)),
        ),
        ("up_std_deg", c.up_std_rad.map(|s| s.to_degrees().into())),
        ("distance_m", c.distance_m.map(Value::from)),
        ("distance_std_m", c.distance_std_m.map(Value::from)),
        ("lens", lens),
        ("deviations", deviations(c)),
        ("frame_rate_hz", c.frame_rate_hz.map(Value::from)),
        ("camera", c.readout_s.map(|s| json!({"readout_s": s}))),
        ("gravity_m_s2", c.gravity_given.then(|| c.gravity_m_s2.into())),
        ("gravity_std_m_s2", c.gravity_std_m_s2.map(Value::from)),
        ("ball", Some(ball)),
        ("launch", Some(launch)),
        ("floor", says_floor.then_some(floor)),
    ])
}

fn deviations(c: &Calibration) -> Option<Value> {
    let entry = |d: &Deviation| {
        object([
            ("lens", c.lens.is_some().then(|| json!(d.lens.map(short)))),
            (
                "world_from_pixel",
                d.world_from_pixel.as_ref().map(|m| rows(&m.map(short))),
            ),
        ])
    };
    (!c.deviations.is_empty()).then(|| c.deviations.iter().map(entry).collect())
}

/// Five significant digits: an uncertainty of an uncertainty.
fn short(x: f64) -> f64 {
    format!("{x:.4e}").parse().unwrap_or(x)
}
