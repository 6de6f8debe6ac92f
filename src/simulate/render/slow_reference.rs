//! The same pictures by the slow way: the whole picture on the fine grid, all things painted cell by cell at every node, and
//! each pixel the sum of all cells around it. What is saved beside that (regions, runs of cells, passes along rows and columns)
//! must not show.

use super::exposed_region::{CellWeights, ExposedRegion, PictureBox};
use super::*;
use crate::simulate::SimulatedRecording;
use nalgebra::Vector2;

/// A ball, its shadows and its image in the floor, in a small picture.
fn recording(camera: &str) -> SimulatedRecording {
    let text = format!(
        r#"{{"schema": "track.scene/1", "contact": {{"model": "mu_e", "restitution": 0.8, "friction": 0.1}},
            "camera": {{"image_size_px": [200, 160], "origin_px": [30, 110], "exposure_s": 0.002, {camera}}},
            "look": {{"reflection": 0.3, "shadow": 0.4, "shading": 0.6,
                      "wall_shadow": {{"depth_grey": 20, "offset_px": [60, 12], "blur_px": 3}}}}}}"#
    );
    SimulatedRecording::new(&Scene::from_json(&text).unwrap()).unwrap()
}

/// The light of a frame; as the camera stands still, the backdrop is the one at rest.
fn slow_light(recording: &SimulatedRecording, index: usize) -> Vec<f32> {
    let (renderer, trajectory) = (recording.renderer(), recording.trajectory());
    let camera = &renderer.scene.camera;
    let backdrop = Backdrop::new(renderer, Vector2::zeros());
    let blur_px = *renderer.blur_px.as_ref().unwrap().apply();
    let time_s = index as f64 / camera.frame_rate_hz;
    let exposure_s = *renderer.exposure_s.as_ref().unwrap().apply();
    let weights = CellWeights::new(renderer.cells, blur_px);
    let whole = Some(PictureBox {
        low: Vector2::repeat(-20.0),
        high: Vector2::new(camera.width_px as f64, camera.height_px as f64) + Vector2::repeat(20.0),
    });
    let region = ExposedRegion::all([whole].into_iter(), blur_px, Vector2::zeros(), &backdrop);
    let empty = region[0].patch(&backdrop, &weights, Vector2::zeros());
    let mut change = vec![0.0_f64; empty.grey.len()];
    for (node_s, weight) in renderer.exposure_nodes(trajectory, time_s, exposure_s, blur_px, Vector2::zeros())
    {
        let mut patch = region[0].patch(&backdrop, &weights, Vector2::zeros());
        let moment = renderer.moment(trajectory, node_s, node_s);
        let rows = 0..patch.cells.rows;
        for layer in &renderer.layers {
            layer.apply().paint(&moment, &backdrop, &mut patch, rows.clone());
        }
        patch.paint(&moment.outline.ellipse, rows, |unit, _, _| {
            moment.surface.grey(&normal(unit)) as f32
        });
        for ((c, now), before) in change.iter_mut().zip(&patch.grey).zip(&empty.grey) {
            *c += weight * f64::from(now - before);
        }
    }
    let mut grey = backdrop.grey.clone();
    for (g, i) in grey.iter_mut().zip(0..) {
        *g += weights.around([i % camera.width_px, i / camera.width_px], &change, &empty.cells) as f32;
    }
    grey
}

#[test]
fn the_fast_way_makes_the_pictures_of_the_slow_way() {
    for camera in [
        r#""blur_px": 0.7"#,
        r#""blur_px": 1.6, "roll_deg": 5, "distance_m": 1"#,
    ] {
        let recording = recording(camera);
        // High above the floor, where its things are apart; near the impact, where they overlap; cut by the picture's edge.
        for index in [2, 20, 34, 60] {
            let fast = recording.renderer().light(recording.trajectory(), index);
            let slow = slow_light(&recording, index);
            let off = fast.iter().zip(&slow).map(|(a, b)| (a - b).abs());
            let worst = off.fold(0.0, f32::max);
            // What 32 bits leave of sums of a thousand greys; half a grey level would be 0.5.
            assert!(worst < 1e-3, "{camera}, frame {index}: {worst}");
        }
    }
}

#[test]
fn a_code_value_is_a_grey_rounded_half_up() {
    for i in -4000..=70_000 {
        for grey in [i as f32 / 256.0, i as f32 / 255.9, (i as f32 / 2.0).next_down()] {
            assert_eq!(code(grey), (grey + 0.5) as u8, "{grey}");
        }
    }
}
