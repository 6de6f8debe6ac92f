//! Marks against a picture that is drawn another way: rays through a grid far finer than the renderer's, each asking whether the point of
//! the ball that it meets is marked; and orientations found from the rendered pixels by fitting such pictures.

use super::*;
use crate::simulate::SimulatedRecording;
use crate::simulate::marks::MarkPattern;
use crate::simulate::scene::{SceneError, View};
use nalgebra::{Matrix3, UnitQuaternion};

/// Pixels to either side of the ball's centre that are compared.
const HALF: i64 = 26;

fn scene(more_camera: &str, launch: &str, marks: &str) -> Scene {
    let text = format!(
        r#"{{"schema": "track.scene/1", "contact": {{"model": "mu_e", "restitution": 0.8, "friction": 0.1}},
            "effects": {{"drag": "off", "magnus": "off", "buoyancy": "off", "contact_time": "off"}},
            "launch": {{{launch}}},
            "camera": {{"image_size_px": [320, 200], "origin_px": [60, 180], "metres_per_pixel": 0.0008, {more_camera}}},
            "look": {{"shading": 0, "marks": {marks}}}}}"#
    );
    Scene::from_json(&text).unwrap()
}

/// What the picture of a flat ball is drawn of.
struct Drawing<'a> {
    recording: &'a SimulatedRecording,
    time_s: f64,
    /// Rays a pixel along each axis.
    rays: usize,
    /// Middle of the window, px.
    middle: (i64, i64),
}

impl<'a> Drawing<'a> {
    fn new(recording: &'a SimulatedRecording, index: usize, rays: usize) -> Self {
        let centre = recording.truth().centres[index];
        Self {
            recording,
            time_s: centre.time_s,
            rays,
            middle: (centre.u_px.round() as i64, centre.v_px.round() as i64),
        }
    }

    /// The rendered pixels of the window, before noise and rounding.
    fn rendered(&self, index: usize) -> Vec<f64> {
        let light = self
            .recording
            .renderer()
            .light(self.recording.trajectory(), index);
        let width = self.recording.scene().camera.width_px as i64;
        let pixel = |u: i64, v: i64| f64::from(light[(v * width + u) as usize]);
        (-HALF..=HALF)
            .flat_map(|dv| (-HALF..=HALF).map(move |du| (du, dv)))
            .map(|(du, dv)| pixel(self.middle.0 + du, self.middle.1 + dv))
            .collect()
    }

    /// The same drawn by rays: a camera of its own, by the scene's keys alone (a side view, turned neither by tilt nor roll).
    fn drawn(&self, world_from_ball: &UnitQuaternion<f64>) -> Vec<f64> {
        let scene = self.recording.scene();
        let camera = &scene.camera;
        assert!(camera.view == View::Side && camera.tilt_rad == 0.0 && camera.roll_rad == 0.0);
        let ball = self.recording.trajectory().state(self.time_s).position_m;
        let (q, radius) = (camera.metres_per_pixel, scene.ball.radius_m);
        let axis = Vector2::new(camera.width_px as f64 - 1.0, camera.height_px as f64 - 1.0) * 0.5;
        let origin = Vector2::from(camera.origin_px);
        let pinhole = camera.distance_m.map(|distance_m| {
            let at = (axis - origin) * q;
            // Pitched about the picture's middle, from which it is so far away.
            let (sin, cos) = camera.pitch_rad.sin_cos();
            let away = Vector3::new(0.0, -cos, sin) * distance_m;
            (
                Vector3::new(at.x, 0.0, -at.y) + away,
                Vector3::new(0.0, sin, cos),
                away.normalize(),
            )
        });
        let back = world_from_ball.inverse();
        let grey = |u: f64, v: f64| {
            let direction = match &pinhole {
                None => {
                    let (x, z) = ((u - origin.x) * q - ball.x, (origin.y - v) * q - ball.z);
                    let squared = radius * radius - x * x - z * z;
                    (squared > 0.0).then(|| Vector3::new(x, -squared.sqrt(), z))
                }
                Some((eye, up, towards)) => {
                    let (right, down) = ((u - axis.x) * q, (v - axis.y) * q);
                    let ray = Vector3::x() * right - up * down - towards * camera.distance_m.unwrap();
                    let to_eye = eye - ball;
                    let (a, b) = (ray.norm_squared(), ray.dot(&to_eye));
                    let root = b * b - a * (to_eye.norm_squared() - radius * radius);
                    (root > 0.0).then(|| to_eye + ray * ((-b - root.sqrt()) / a))
                }
            };
            direction.map_or(60.0, |n| {
                200.0
                    * if is_marked(scene, &(back * n.normalize())) {
                        0.3
                    } else {
                        1.0
                    }
            })
        };
        self.blurred(grey)
    }

    /// Blurred by σ = 0.7 px and summed over pixels.
    fn blurred(&self, grey: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let (margin, rays) = (5, self.rays);
        let side = (2 * (HALF + margin) + 1) as usize * rays;
        let step = 1.0 / rays as f64;
        let first = |middle: i64| (middle - HALF - margin) as f64 - 0.5 + 0.5 * step;
        let (u0, v0) = (first(self.middle.0), first(self.middle.1));
        let fine: Vec<f64> = (0..side * side)
            .map(|k| grey(u0 + (k % side) as f64 * step, v0 + (k / side) as f64 * step))
            .collect();
        // A pixel's share of a ray's light, along one axis.
        let reach = margin as usize * rays + rays / 2;
        let taps: Vec<f64> = (0..2 * reach)
            .map(|k| {
                let d = (k as f64 + 0.5) * step - reach as f64 * step;
                gaussian_below((d + 0.5) / 0.7) - gaussian_below((d - 0.5) / 0.7)
            })
            .collect();
        let total: f64 = taps.iter().sum();
        let pixels = (2 * HALF + 1) as usize;
        let across: Vec<f64> = fine
            .chunks_exact(side)
            .flat_map(|row| {
                let taps = &taps;
                (0..pixels).map(move |i| {
                    let from = (i + margin as usize) * rays + rays / 2 - reach;
                    row[from..].iter().zip(taps).map(|(g, w)| g * w).sum::<f64>() / total
                })
            })
            .collect();
        (0..pixels * pixels)
            .map(|k| {
                let (i, j) = (k % pixels, k / pixels);
                let from = (j + margin as usize) * rays + rays / 2 - reach;
                let column = (0..2 * reach).map(|r| taps[r] * across[(from + r) * pixels + i]);
                column.sum::<f64>() / total
            })
            .collect()
    }
}

/// Whether a direction of the ball is marked, by the words of the patterns.
fn is_marked(scene: &Scene, n: &Vector3<f64>) -> bool {
    match &scene.look.marks.as_ref().unwrap().pattern {
        MarkPattern::Dots {
            directions,
            radius_rad,
        } => directions.iter().any(|d| d.angle(n) < *radius_rad),
        MarkPattern::Lines { poles, width_rad } => poles
            .iter()
            .any(|p| (p.angle(n) - std::f64::consts::FRAC_PI_2).abs() < 0.5 * width_rad),
        MarkPattern::Half { pole } => pole.dot(n) > 0.0,
        other => panic!("{other:?} is not drawn here"),
    }
}

/// World from ball by the truth.
fn orientation(recording: &SimulatedRecording, index: usize) -> UnitQuaternion<f64> {
    let [w, x, y, z] = recording.truth().centres[index].orientation.unwrap();
    UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
}

/// The rotation vector (rad, axes of the world) by which the rendered ball is turned from the truth: Gauss and Newton's method on the
/// differences of pixels.
fn found_turn(recording: &SimulatedRecording, index: usize) -> Vector3<f64> {
    let drawing = Drawing::new(recording, index, 12);
    let (rendered, truth) = (drawing.rendered(index), orientation(recording, index));
    let drawn = |turn: &Vector3<f64>| drawing.drawn(&(UnitQuaternion::from_scaled_axis(*turn) * truth));
    const STEP_RAD: f64 = 0.01;
    let mut turn = Vector3::zeros();
    for _ in 0..2 {
        let base = drawn(&turn);
        let slopes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
            let (ahead, behind) = (drawn(&(turn + axis * STEP_RAD)), drawn(&(turn - axis * STEP_RAD)));
            ahead
                .iter()
                .zip(&behind)
                .map(|(a, b)| (a - b) / (2.0 * STEP_RAD))
                .collect::<Vec<f64>>()
        });
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let off: Vec<f64> = rendered.iter().zip(&base).map(|(r, b)| r - b).collect();
        let normal = Matrix3::from_fn(|i, j| dot(&slopes[i], &slopes[j]));
        let right = Vector3::from_fn(|i, _| dot(&slopes[i], &off));
        turn += normal.try_inverse().unwrap() * right;
    }
    turn
}

const SPINNING: &str = r#""speed_m_s": 0.8, "spin_ratio": [0.6, -1.1, 0.8]"#;
const DOTS: &str = r#"{"pattern": "dots", "count": 9, "radius_deg": 14, "turned_deg": [10, 20, 30]}"#;

#[test]
fn marked_balls_look_as_if_drawn_by_rays() {
    for (camera, marks) in [
        ("", DOTS),
        (
            "",
            r#"{"pattern": "line", "directions": [[1, 0.4, 0.2], [0, 1, 3]], "width_deg": 9}"#,
        ),
        ("", r#"{"pattern": "halves", "directions": [[0.3, 0.5, 1]]}"#),
        (r#""distance_m": 0.12, "#, DOTS),
        (r#""distance_m": 0.2, "pitch_deg": 25, "#, DOTS),
    ] {
        let still = format!(r#"{camera}"exposure_s": 0"#);
        let recording = SimulatedRecording::new(&scene(&still, SPINNING, marks)).unwrap();
        for index in [12, 21] {
            let drawing = Drawing::new(&recording, index, 48);
            let drawn = drawing.drawn(&orientation(&recording, index));
            let rendered = drawing.rendered(index);
            let differences = rendered.iter().zip(&drawn).map(|(r, d)| (r - d).abs());
            let worst = differences.fold(0.0, f64::max);
            // Contrast of 140 grey levels; what is left is of the rays' grid, most at the rim.
            assert!(worst < 0.4, "{camera} {marks}, frame {index}: {worst}");
        }
    }
}

#[test]
fn the_orientation_found_in_the_pixels_is_that_of_the_truth() {
    for (camera, marks) in [
        ("", DOTS),
        (
            "",
            r#"{"pattern": "line", "directions": [[1, 0.4, 0.2], [0, 1, 3]], "width_deg": 9}"#,
        ),
        (r#""distance_m": 0.12, "#, DOTS),
        (r#""distance_m": 0.2, "pitch_deg": 25, "#, DOTS),
    ] {
        let still = format!(r#"{camera}"exposure_s": 0"#);
        let recording = SimulatedRecording::new(&scene(&still, SPINNING, marks)).unwrap();
        for index in [12, 21] {
            let off_deg = found_turn(&recording, index).norm().to_degrees();
            assert!(
                off_deg < 0.02,
                "{camera} {marks}, frame {index}: {off_deg} degrees"
            );
        }
    }
}

#[test]
fn a_blur_by_rotation_is_the_mean_over_the_exposure() -> Result<(), SceneError> {
    // 40 rev/s turn the ball by 29 degrees in 2 ms, 8 px at its middle.
    let launch = r#""speed_m_s": 0.4, "spin_ratio": [0, 7.85, 0]"#;
    let blurred = SimulatedRecording::new(&scene(r#""exposure_s": 0.002"#, launch, DOTS))?;
    let renderer = blurred.renderer();
    let index = 9;
    let time_s = index as f64 / 240.0;
    let found = renderer.light(blurred.trajectory(), index);
    let empty = renderer.backdrop.get().unwrap();
    let mut mean = empty.clone();
    let nodes = (0..300).map(|i| (time_s + 0.002 * ((f64::from(i) + 0.5) / 300.0 - 0.5), 1.0 / 300.0));
    let fine = Exposure {
        nodes: nodes.collect(),
        shift_px: Vector2::zeros(),
        time_s,
        moves: true,
        turns: true,
    };
    for change in renderer.ball_light(blurred.trajectory(), &fine, 0.7, empty) {
        change.add_to(&mut mean);
    }
    let mean = mean.grey;
    let worst = found
        .iter()
        .zip(&mean)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(worst < 0.1, "{worst}");
    // Without it marks stand as they are at the frame's time, and what is left of the picture is as before.
    let mut plain = scene(r#""exposure_s": 0.002"#, launch, DOTS);
    plain
        .effects
        .named
        .insert("rotation_blur".into(), crate::simulate::scene::Switch::Off);
    let still = SimulatedRecording::new(&plain)?;
    let other = still.renderer().light(still.trajectory(), index);
    let moved = found
        .iter()
        .zip(&other)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(moved > 20.0, "{moved}");
    Ok(())
}
