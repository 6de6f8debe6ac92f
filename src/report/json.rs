//! `<stem>.result.json` and what `--json` prints: schema `track.result/1`.
//!
//! Angles are degrees here and radians everywhere else. What is unknown is `null`; a number that is not finite becomes
//! `null` too, as JSON has no word for it.

use super::words;
use crate::Build;
use crate::impact::{
    AlongFloor, BenchLaunch, Bounce, CentreVelocity, Correlation, FloorSource, Readings, XSource,
};
use crate::pipeline::{
    Measurement, Outcome, PointUse, TimeSource, Track, TrackPoint, UpSource, VideoFacts, View,
};
use crate::quantity::Quantity;
use serde_json::{Map, Value, json};

/// The schema that [`result_json`] follows.
pub const SCHEMA: &str = "track.result/1";

/// The result of one recording, keys in the order of the contract.
#[must_use]
pub fn result_json(measurement: &Measurement) -> Value {
    let (status, reason) = match &measurement.outcome {
        Outcome::Measured => ("measured", Value::Null),
        Outcome::Rejected { reason } => ("rejected", json!(reason)),
    };
    let warnings: Vec<Value> = measurement
        .warnings
        .iter()
        .map(|warning| json!({"code": warning.code, "message": warning.message}))
        .collect();
    json!({
        "schema": SCHEMA,
        "version": Build::THIS.version,
        "commit": Build::THIS.commit,
        "status": status,
        "reason": reason,
        "video": video(&measurement.video),
        "track": track(&measurement.track, measurement.view),
        "gravity_m_s2": quantity(measurement.gravity_m_s2),
        "up": measurement.up.map(|up| json!({
            "tilt_deg": angle(Some(up.tilt_rad)),
            "source": match up.source {
                UpSource::Calibration => "calibration",
                UpSource::Fall => "fall",
            },
        })),
        "floor": measurement.floor.map(|floor| json!({
            "slope_deg": angle(Some(floor.slope_rad)),
            "source": match floor.source {
                FloorSource::Impacts => "impacts",
                FloorSource::Calibration => "calibration",
                FloorSource::Level => "assumed_level",
            },
        })),
        "launch": measurement.launch.as_ref().map(launch),
        "bounces": measurement.bounces.iter().map(bounce).collect::<Vec<_>>(),
        "x0_m": quantity(measurement.distances.x0_m),
        "x_m": quantity(measurement.distances.x_m),
        "x_source": measurement.distances.x_source.map(|source| match source {
            XSource::Observed => "observed",
            XSource::Extrapolated => "extrapolated",
        }),
        "models": measurement.readings.as_ref().map(models),
        "warnings": warnings,
    })
}

/// A quantity, or `null` where there is none. Both numbers are checked again, as the fields of [`Quantity`] are public:
/// the contract allows neither NaN nor an uncertainty of 0.
pub(super) fn quantity(quantity: Option<Quantity>) -> Value {
    match quantity {
        Some(Quantity {
            value,
            std_uncertainty,
        }) if value.is_finite() => json!({
            "value": value,
            "std_uncertainty": std_uncertainty.filter(|std| std.is_finite() && *std > 0.0),
        }),
        _ => Value::Null,
    }
}

/// An angle in radians as a quantity in degrees.
fn angle(radians: Option<Quantity>) -> Value {
    quantity(radians.map(|angle| angle.scaled(1_f64.to_degrees())))
}

fn video(video: &VideoFacts) -> Value {
    json!({
        "path": video.path.to_string_lossy(),
        "width_px": video.width_px,
        "height_px": video.height_px,
        "frames": video.frames,
        "frame_rate_hz": video.frame_rate_hz,
        "duration_s": video.duration_s,
        "time_source": match video.time_source {
            TimeSource::Stamps => "stamps",
            TimeSource::Calibration => "calibration",
        },
    })
}

fn track(track: &Track, view: View) -> Value {
    json!({
        "method": track.method,
        "detected": track.detected,
        "centre_std_px": track.centre_std_px,
        "radius_px": quantity(track.radius_px),
        "points": track.points.iter().map(|p| point(p, view)).collect::<Vec<_>>(),
    })
}

fn point(point: &TrackPoint, view: View) -> Value {
    let up_m = point.world.map(|world| world.up_m);
    let (arc, reason) = match &point.use_ {
        PointUse::Used(arc) => (Some(*arc), None),
        PointUse::Unused(reason) => (None, Some(reason)),
    };
    let mut row = json!({
        "frame": point.frame,
        "time_s": point.time_s,
        "u_px": point.pixel.u_px,
        "v_px": point.pixel.v_px,
        "x_m": point.world.map(|world| world.x_m),
        "z_m": match view { View::Side => up_m, View::Top => None },
        "used": arc.is_some(),
        "std_px": point.std_px,
        "arc": arc,
        "reason": reason,
    });
    if view == View::Top {
        row["y_m"] = json!(up_m);
    }
    row
}

fn launch(launch: &BenchLaunch) -> Value {
    json!({
        "edge_x_m": quantity(launch.edge_x_m),
        "time_s": quantity(launch.time_s),
        "speed_m_s": quantity(launch.speed_m_s),
        "rolled_s": launch.rolled_s,
        "drop_height_m": quantity(launch.drop_height_m),
    })
}

fn bounce(bounce: &Bounce) -> Value {
    json!({
        "time_s": quantity(bounce.time_s),
        "x_m": quantity(bounce.x_m),
        "incident": leg(&bounce.incident),
        "rebound": leg(&bounce.rebound),
        "restitution": quantity(bounce.restitution),
        "tangential_ratio": quantity(bounce.tangential_ratio),
        "regime": words::slip(bounce.slip),
        "friction": quantity(bounce.friction),
        "friction_at_least": quantity(bounce.friction_at_least),
        "tangential_restitution": quantity(bounce.tangential_restitution),
        "spin_in_m_s": quantity(bounce.spin_in_m_s),
        "spin_out_m_s": quantity(bounce.spin_out_m_s),
        "azimuth_deg": angle(bounce.azimuth_rad),
        "correlations": correlations(&bounce.correlations),
        "along_floor": bounce.along_floor.as_ref().map(along_floor),
    })
}

fn along_floor(v: &AlongFloor) -> Value {
    json!({
        "incident_tangential_m_s": quantity(v.incident_m_s.0),
        "incident_normal_m_s": quantity(v.incident_m_s.1),
        "rebound_tangential_m_s": quantity(v.rebound_m_s.0),
        "rebound_normal_m_s": quantity(v.rebound_m_s.1),
        "correlations": correlations(&v.correlations),
    })
}

/// An entry a pair of velocities, by the name that it has in a series.
fn correlations(all: &[Correlation]) -> Value {
    let entry = |c: &Correlation| {
        let (a, b) = c.of;
        (format!("{}__{}", a.name(), b.name()), json!(c.value))
    };
    Value::Object(all.iter().map(entry).collect())
}

fn leg(leg: &CentreVelocity) -> Value {
    json!({
        "vx_m_s": quantity(leg.vx_m_s),
        "vz_m_s": quantity(leg.vz_m_s),
        "angle_deg": angle(leg.angle_rad),
    })
}

fn models(readings: &Readings) -> Value {
    let mut models = Map::new();
    for (name, reading) in &readings.models {
        let model = json!({
            "restitution": quantity(readings.restitution),
            reading.parameter.name(): quantity(reading.quantity),
            "regime": words::regime_name(reading.regime),
        });
        models.insert(name.name().to_owned(), model);
    }
    models.insert("preferred".to_owned(), json!(readings.preferred.name()));
    Value::Object(models)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn keys(value: &Value) -> Vec<&str> {
        value.as_object().unwrap().keys().map(String::as_str).collect()
    }

    #[test]
    fn every_key_of_the_contract_is_there_in_its_order() {
        let result = result_json(&test_measurements::two_bounces());
        assert_eq!(
            keys(&result),
            [
                "schema",
                "version",
                "commit",
                "status",
                "reason",
                "video",
                "track",
                "gravity_m_s2",
                "up",
                "floor",
                "launch",
                "bounces",
                "x0_m",
                "x_m",
                "x_source",
                "models",
                "warnings"
            ]
        );
        assert_eq!(
            keys(&result["video"]),
            [
                "path",
                "width_px",
                "height_px",
                "frames",
                "frame_rate_hz",
                "duration_s",
                "time_source"
            ]
        );
        assert_eq!(
            keys(&result["track"]),
            ["method", "detected", "centre_std_px", "radius_px", "points"]
        );
        assert_eq!(
            keys(&result["track"]["points"][0])[..7],
            ["frame", "time_s", "u_px", "v_px", "x_m", "z_m", "used"]
        );
        assert_eq!(
            keys(&result["bounces"][0]),
            [
                "time_s",
                "x_m",
                "incident",
                "rebound",
                "restitution",
                "tangential_ratio",
                "regime",
                "friction",
                "friction_at_least",
                "tangential_restitution",
                "spin_in_m_s",
                "spin_out_m_s",
                "azimuth_deg",
                "correlations",
                "along_floor"
            ]
        );
        assert_eq!(keys(&result["floor"]), ["slope_deg", "source"]);
        assert_eq!(keys(&result["up"]), ["tilt_deg", "source"]);
        assert_eq!(
            keys(&result["launch"]),
            ["edge_x_m", "time_s", "speed_m_s", "rolled_s", "drop_height_m"]
        );
        for leg in ["incident", "rebound"] {
            assert_eq!(
                keys(&result["bounces"][0][leg]),
                ["vx_m_s", "vz_m_s", "angle_deg"]
            );
        }
        assert_eq!(keys(&result["models"]), ["mu_e", "e_e", "preferred"]);
        assert_eq!(
            keys(&result["models"]["mu_e"]),
            ["restitution", "friction", "regime"]
        );
        assert_eq!(
            keys(&result["models"]["e_e"]),
            ["restitution", "tangential_restitution", "regime"]
        );
        assert_eq!(keys(&result["warnings"][0]), ["code", "message"]);
        assert_eq!(keys(&result["x0_m"]), ["value", "std_uncertainty"]);
        assert_eq!(result["schema"], "track.result/1");
        assert_eq!(result["version"], Build::THIS.version);
        assert_eq!(result["commit"], Build::THIS.commit);
    }

    #[test]
    fn angles_are_degrees_and_points_are_all_there() {
        let measurement = test_measurements::two_bounces();
        let result = result_json(&measurement);
        let radians = measurement.bounces[0].incident.angle_rad.unwrap();
        let degrees = &result["bounces"][0]["incident"]["angle_deg"];
        assert!((degrees["value"].as_f64().unwrap() - radians.value * 57.295_779_513).abs() < 1e-9);
        let points = result["track"]["points"].as_array().unwrap();
        assert_eq!(points.len(), measurement.track.points.len());
        for (row, point) in points.iter().zip(&measurement.track.points) {
            let used = matches!(point.use_, PointUse::Used(_));
            assert_eq!(row["used"], used);
            assert_eq!(row["reason"].is_null(), used);
            assert_eq!(row["arc"].is_null(), !used);
        }
    }

    #[test]
    fn a_rejected_recording_says_why_and_has_no_models() {
        let result = result_json(&test_measurements::rejected());
        assert_eq!(result["status"], "rejected");
        assert!(result["reason"].as_str().unwrap().contains("no free flight"));
        assert!(result["models"].is_null());
        assert!(result["x_source"].is_null());
        assert_eq!(result["bounces"], json!([]));
    }

    #[test]
    fn a_top_view_has_y_and_no_z() {
        let measurement = test_measurements::top_view();
        let result = result_json(&measurement);
        let row = &result["track"]["points"][0];
        assert!(row["z_m"].is_null());
        assert_eq!(row["y_m"], measurement.track.points[0].world.unwrap().up_m);
        assert!(result["bounces"][0]["incident"]["vz_m_s"].is_null());
        assert!(result["bounces"][0]["azimuth_deg"]["value"].is_number());
        assert!(
            result_json(&test_measurements::two_bounces())["track"]["points"][0]
                .get("y_m")
                .is_none()
        );
    }

    #[test]
    fn what_is_not_finite_is_null_and_no_uncertainty_is_zero() {
        let mut measurement = test_measurements::two_bounces();
        measurement.gravity_m_s2 = Some(Quantity {
            value: f64::NAN,
            std_uncertainty: Some(0.1),
        });
        measurement.distances.x0_m = Some(Quantity {
            value: 0.2,
            std_uncertainty: Some(0.0),
        });
        measurement.track.points[3].std_px = Some(f64::INFINITY);
        let result = result_json(&measurement);
        assert!(result["gravity_m_s2"].is_null());
        assert!(result["x0_m"]["std_uncertainty"].is_null());
        assert!(result["track"]["points"][3]["std_px"].is_null());
        let text = serde_json::to_string_pretty(&result).unwrap();
        assert!(!text.contains("NaN") && !text.contains("inf"));
        let back: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["bounces"].as_array().unwrap().len(), 2);
    }
}
