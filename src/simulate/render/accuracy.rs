//! Rendering against closed forms and against itself on finer grids, in grey levels before noise and rounding.

use super::*;
use crate::calibration::Calibration;
use crate::simulate::SimulatedRecording;
use crate::simulate::truth::CentreTruth;
use std::f64::consts::PI;

fn recording(more: &str) -> SimulatedRecording {
    let text = format!(
        r#"{{"schema": "track.scene/1", "contact": {{"model": "mu_e", "restitution": 0.8, "friction": 0.1}},
            "effects": {{"drag": "off", "magnus": "off", "buoyancy": "off", "contact_time": "off"}}, {more}}}"#
    );
    SimulatedRecording::new(&Scene::from_json(&text).unwrap()).unwrap()
}

/// A small picture, fast to render; a flat ball unless `look` says otherwise.
fn small(camera: &str, look: &str) -> SimulatedRecording {
    recording(&format!(
        r#""camera": {{"image_size_px": [320, 200], "origin_px": [60, 180], {camera}}},
           "look": {{"background_grey": 60, "ball_grey": 200, {look}}}"#
    ))
}

fn light(recording: &SimulatedRecording, index: usize) -> Vec<f32> {
    recording.renderer().light(recording.trajectory(), index)
}

fn with_cells(mut recording: SimulatedRecording, cells: usize) -> SimulatedRecording {
    recording.renderer.cells = cells;
    recording
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

/// Sum of what differs from the background, and its centroid, px.
fn moments(light: &[f32], background: f64, width: usize) -> (f64, Vector2<f64>) {
    let mut sum = 0.0;
    let mut first = Vector2::zeros();
    for (g, i) in light.iter().zip(0..) {
        let w = f64::from(*g) - background;
        sum += w;
        first += Vector2::new((i % width) as f64, (i / width) as f64) * w;
    }
    (sum, first / sum)
}

#[test]
fn a_flat_ball_has_the_light_of_its_area_and_its_centroid() {
    for blur in [0.0, 0.35, 0.7, 2.5] {
        let camera = format!(r#""blur_px": {blur}, "exposure_s": 0, "metres_per_pixel": 0.0007"#);
        let recording = small(&camera, r#""shading": 0"#);
        let radius_px = 0.0125 / 0.0007;
        let centres = recording.truth().centres;
        let whole = centres
            .iter()
            .filter(|c| (35.0..165.0).contains(&c.v_px) && (35.0..285.0).contains(&c.u_px));
        for centre in whole.step_by(3) {
            let (sum, at) = moments(&light(&recording, centre.frame), 60.0, 320);
            let expected = 140.0 * PI * radius_px * radius_px;
            assert!(
                (sum / expected - 1.0).abs() < 2e-5,
                "blur {blur}: {sum} {expected}"
            );
            let error = (at - Vector2::new(centre.u_px, centre.v_px)).norm();
            // Without blur the binning into pixels itself moves the centroid a little.
            let allowed = if blur == 0.0 { 2e-3 } else { 2e-4 };
            assert!(error < allowed, "blur {blur}: {error} px");
        }
    }
}

#[test]
fn an_edge_has_the_profile_of_box_and_gaussian() {
    // A ball 700 px across: along the row through its centre the edge is all but straight.
    let blur = 0.7;
    let recording = recording(&format!(
        r#""launch": {{"speed_m_s": 0, "drop_height_m": 0.001}}, "look": {{"shading": 0}},
           "camera": {{"image_size_px": [320, 200], "blur_px": {blur}, "exposure_s": 0, "metres_per_pixel": 3.6e-5,
                       "origin_px": [-140, 450]}}"#
    ));
    let Some(centre) = recording
        .truth()
        .centres
        .iter()
        .rev()
        .find(|c| c.v_px > 30.0 && c.v_px < 170.0)
        .copied()
    else {
        panic!("no frame with the ball's middle row");
    };
    let light = light(&recording, centre.frame);
    let radius_px = 0.0125 / 3.6e-5;
    let v = centre.v_px.round();
    let edge = centre.u_px + (radius_px * radius_px - (v - centre.v_px).powi(2)).sqrt();
    // ∫Φ(t) dt = t Φ(t) + φ(t): the mean of Φ over a pixel.
    let primitive = |t: f64| t * gaussian_below(t) + (-0.5 * t * t).exp() / (2.0 * PI).sqrt();
    let mut checked = 0;
    for u in 0..320_u16 {
        let d = edge - f64::from(u);
        if d.abs() < 5.0 {
            let share = blur * (primitive((d + 0.5) / blur) - primitive((d - 0.5) / blur));
            let found = f64::from(light[v as usize * 320 + usize::from(u)]);
            assert!(
                (found - (60.0 + 140.0 * share)).abs() < 0.1,
                "{d}: {found} {share}"
            );
            checked += 1;
        }
    }
    assert!(checked >= 9, "{checked}");
}

#[test]
fn a_finer_grid_changes_nothing_that_shows() {
    for (blur, radius) in [(0.4, 0.004), (0.7, 0.0125), (1.5, 0.0125)] {
        let make = || {
            let camera = format!(r#""blur_px": {blur}, "exposure_s": 0.002"#);
            recording(&format!(
                r#""ball": {{"radius_m": {radius}}}, "look": {{"reflection": 0.3, "shading": 0.7}},
                   "camera": {{"image_size_px": [320, 200], "origin_px": [60, 180], {camera}}}"#
            ))
        };
        let (coarse, fine) = (make(), with_cells(make(), MOST_CELLS));
        for index in [0, 17, 30] {
            let worst = largest_difference(&light(&coarse, index), &light(&fine, index));
            assert!(
                worst < 0.1,
                "blur {blur}, radius {radius}, frame {index}: {worst}"
            );
        }
    }
}

#[test]
fn an_exposure_is_the_mean_over_its_time() {
    // 4 ms smear the ball by some 7 px; frame 34 contains the impact.
    let recording = small(r#""exposure_s": 0.004"#, r#""shading": 0.5"#);
    let renderer = recording.renderer();
    let backdrop = light(&recording, recording.frame_count() - 1).len();
    for index in [3, 33, 34, 35] {
        let time_s = index as f64 / 240.0;
        let fine: Vec<(f64, f64)> = (0..400)
            .map(|i| (time_s + 0.004 * ((f64::from(i) + 0.5) / 400.0 - 0.5), 1.0 / 400.0))
            .collect();
        let found = light(&recording, index);
        let empty = renderer.backdrop.get().unwrap();
        let mut mean = empty.clone();
        let fine = Exposure {
            nodes: fine,
            shift_px: Vector2::zeros(),
            time_s,
            moves: true,
            turns: true,
        };
        for change in renderer.ball_light(recording.trajectory(), &fine, 0.7, empty) {
            change.add_to(&mut mean);
        }
        let worst = largest_difference(&found, &mean.grey);
        assert!(worst < 0.1, "frame {index}: {worst}");
        assert_eq!(found.len(), backdrop);
    }
}

#[test]
fn a_rolling_shutter_puts_the_ball_where_the_truth_says() {
    // 3 ms of readout: 6 px off the middle row's time at the edge of the picture.
    let camera = r#""readout_s": 0.003, "exposure_s": 0.0, "metres_per_pixel": 0.0007"#;
    let recording = small(camera, r#""shading": 0"#);
    let still = small(
        r#""exposure_s": 0.0, "metres_per_pixel": 0.0007"#,
        r#""shading": 0"#,
    );
    let mut moved: f64 = 0.0;
    for (centre, other) in recording
        .truth()
        .centres
        .iter()
        .zip(&still.truth().centres)
        .take(30)
        .step_by(4)
    {
        let (_, at) = moments(&light(&recording, centre.frame), 60.0, 320);
        let error = (at - Vector2::new(centre.u_px, centre.v_px)).norm();
        // The ball is also sheared; its centroid moves by second order in v × readout only.
        assert!(error < 0.03, "frame {}: {error}", centre.frame);
        moved = moved.max((centre.v_px - other.v_px).abs());
    }
    assert!(moved > 0.5, "{moved}");
}

#[test]
fn lens_and_perspective_put_the_ball_where_the_truth_says() {
    let lens = r#""lens": {"camera_matrix": [[400, 0, 159.5], [0, 400, 99.5], [0, 0, 1]], "distortion": [-0.2, 0.05, 0.001, 0.002, 0]}"#;
    let distance = r#""distance_m": 0.5, "plane_offset_m": 0.05"#;
    // A lens of 400 px that sees 0.7 mm a pixel is 0.28 m away.
    for (camera, depth_m, allowed) in [(lens, 0.28, 0.004), (distance, 0.45, 0.002)] {
        let recording = small(
            &format!(r#"{camera}, "exposure_s": 0, "metres_per_pixel": 0.0007"#),
            r#""shading": 0"#,
        );
        // Whole balls only.
        let inside = |u: f64, v: f64| (25.0..295.0).contains(&u) && (25.0..175.0).contains(&v);
        let centres = recording.truth().centres;
        let whole: Vec<_> = centres.iter().filter(|c| inside(c.u_px, c.v_px)).collect();
        assert!(whole.len() > 12);
        for centre in whole.into_iter().step_by(4) {
            let (_, at) = moments(&light(&recording, centre.frame), 60.0, 320);
            let error = (at - middle_of_outline(&recording, centre, depth_m)).norm();
            assert!(error < allowed, "{camera}: {error} px");
        }
    }
}

#[test]
fn roll_slope_and_bump_put_the_ball_where_the_truth_says() {
    let recording = recording(
        r#""camera": {"image_size_px": [320, 200], "origin_px": [70, 170], "exposure_s": 0, "metres_per_pixel": 0.0007,
                      "roll_deg": 9, "bump": {"amplitude_px": [3.3, 4.7], "frequency_hz": 11, "decay_s": 0.1}},
           "look": {"background_grey": 60, "ball_grey": 200, "shading": 0}, "floor": {"slope_deg": 6},
           "launch": {"drop_height_m": 0.07, "speed_m_s": 0.6, "bench": {"seen_s": 0.02}}"#,
    );
    let inside = |u: f64, v: f64| (25.0..295.0).contains(&u) && (25.0..175.0).contains(&v);
    let centres = recording.truth().centres;
    let impact_s = recording.trajectory().impacts()[0].time_s;
    let whole = || centres.iter().filter(|c| inside(c.u_px, c.v_px));
    assert!(whole().filter(|c| c.time_s > impact_s).count() > 12);
    for centre in whole().step_by(3) {
        let (_, at) = moments(&light(&recording, centre.frame), 60.0, 320);
        let error = (at - Vector2::new(centre.u_px, centre.v_px)).norm();
        assert!(error < 2e-4, "frame {}: {error} px", centre.frame);
    }
}

/// Middle of the area that a sphere at `depth_m` covers of the picture: its outline as many points, each through the
/// calibration's lens.
fn middle_of_outline(recording: &SimulatedRecording, centre: &CentreTruth, depth_m: f64) -> Vector2<f64> {
    let calibration =
        Calibration::parse(&crate::simulate::calibration(recording).to_string(), "truth").unwrap();
    let lens = calibration.lens;
    let seen = PixelPoint::new(centre.u_px, centre.v_px);
    let ideal = lens.as_ref().map_or(seen, |l| l.undistort(seen).unwrap());
    // Pixels of 0.7 mm at the plane, whose distance is that of the ball where it is not nearer.
    let focal_px = if lens.is_some() { 400.0 } else { 0.5 / 0.0007 };
    let axis = Vector2::new(159.5, 99.5);
    let ray = (Vector2::new(ideal.u_px, ideal.v_px) - axis) / focal_px;
    let ball = Vector3::new(ray.x, ray.y, 1.0) * depth_m;
    // The tangents from the pinhole touch the sphere on a circle.
    let touch = 1.0 - (0.0125 / ball.norm()).powi(2);
    let across = ball.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
    let other = ball.cross(&across).normalize();
    let rim: Vec<Vector2<f64>> = (0..2000)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 2000.0).sin_cos();
            let p = touch * ball + 0.0125 * touch.sqrt() * (cos * across + sin * other);
            let ideal = axis + p.xy() * (focal_px / p.z);
            let ideal = PixelPoint::new(ideal.x, ideal.y);
            let seen = lens.as_ref().map_or(ideal, |l| l.distort(ideal).unwrap());
            Vector2::new(seen.u_px, seen.v_px)
        })
        .collect();
    let origin = rim[0];
    let (mut area, mut moment) = (0.0, Vector2::<f64>::zeros());
    for pair in rim.windows(2) {
        let (a, b) = (pair[0] - origin, pair[1] - origin);
        let triangle = 0.5 * (a.x * b.y - a.y * b.x);
        area += triangle;
        moment += triangle / 3.0 * (a + b);
    }
    origin + moment / area
}
