//! Balls that differ from what is behind them in colour: rendered with known truth, stored as cameras store colour (chroma at half the
//! resolution), measured.

use crate::rendered::{self, Rendered};
use base64::Engine as _;
use opencv::core::{Mat, MatTraitConst as _, MatTraitConstManual as _, Vec3b, Vector};
use opencv::imgcodecs;
use serde_json::{Value, json};
use track::calibration::Calibration;
use track::frames::{self, ChromaSiting, Coding, ColourMix, Luma, VideoOptions, VideoWriter, Yuv420, recode};
use track::pipeline::{Measurement, Outcome, PointUse};
use track::quantity::Quantity;
use track::report::overlay::Overlay;
use track::report::strobe::strobe_picture;
use track::simulate::{Scene, SimulatedRecording};

/// A green ball before a grey wall of its luma; where it begins and how fast it goes differs from seed to seed.
fn scene(seed: u32, camera: &Value, look: &Value) -> Value {
    let n = f64::from(seed);
    let mut scene = json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": 0.0125, "mass_kg": 0.0639, "inertia_factor": 0.4},
        "contact": {"model": "mu_e", "restitution": 0.78 - 0.01 * n, "friction": 0.07},
        "launch": {"drop_height_m": 0.08, "speed_m_s": 1.0 + 0.013 * n},
        "camera": {"image_size_px": [640, 360], "frame_rate_hz": 240, "exposure_s": 0.0005,
                   "metres_per_pixel": 0.0012, "origin_px": [60.0 + 0.37 * n, 330.0 + 0.23 * n],
                   "noise_grey": 2.0, "codec": "lossless"},
        "look": {"background_grey": 110, "floor_grey": 90, "ball_grey": 110, "shading": 0,
                 "ball_colour": [-40, -45]},
        "stop": {"bounces": 2, "tail_s": 0.1}
    });
    for (key, changes) in [("camera", camera), ("look", look)] {
        let section = scene[key].as_object_mut().unwrap();
        section.extend(changes.as_object().unwrap().clone());
    }
    scene
}

fn by_colour(m: &Measurement) -> bool {
    m.warnings.iter().any(|w| w.code == "measured_by_colour")
}

/// How the used centres of a recording lie against the truth.
struct CentreErrors {
    /// Mean along u and v, px.
    bias: [f64; 2],
    /// Standard deviation about that, root mean square of both, px.
    scatter: f64,
    /// Root mean square of the standard uncertainties stated, px.
    claimed: f64,
}

fn centre_errors(m: &Measurement, truth: &Value) -> CentreErrors {
    let used = || {
        m.track
            .points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)))
    };
    let off: Vec<[f64; 2]> = used()
        .map(|p| {
            let t = &truth["centres"][p.frame];
            [
                p.pixel.u_px - t["u_px"].as_f64().unwrap(),
                p.pixel.v_px - t["v_px"].as_f64().unwrap(),
            ]
        })
        .collect();
    let n = off.len() as f64;
    assert!(n > 60.0, "{n} centres");
    let bias = [0, 1].map(|k| off.iter().map(|o| o[k]).sum::<f64>() / n);
    let square: f64 = off
        .iter()
        .map(|o| (o[0] - bias[0]).powi(2) + (o[1] - bias[1]).powi(2))
        .sum();
    let claimed: f64 = used().map(|p| p.std_px.unwrap().powi(2)).sum();
    CentreErrors {
        bias,
        scatter: (0.5 * square / n).sqrt(),
        claimed: (claimed / n).sqrt(),
    }
}

/// Errors of e, the angles, x0 and x in standard uncertainties.
fn pulls(m: &Measurement, truth: &Value) -> Vec<(&'static str, f64)> {
    let pull = |q: Option<Quantity>, t: &Value| {
        let q = q.unwrap();
        (q.value - t.as_f64().unwrap()) / q.std_uncertainty.unwrap()
    };
    let degrees = |q: Option<Quantity>| q.map(|q| q.scaled(180.0 / std::f64::consts::PI));
    let (b, t) = (&m.bounces[0], &truth["bounces"][0]);
    vec![
        ("e", pull(b.restitution, &t["restitution"])),
        (
            "incident angle",
            pull(degrees(b.incident.angle_rad), &t["incident"]["angle_deg"]),
        ),
        (
            "rebound angle",
            pull(degrees(b.rebound.angle_rad), &t["rebound"]["angle_deg"]),
        ),
        ("x0", pull(m.distances.x0_m, &truth["x0_m"])),
        ("x", pull(m.distances.x_m, &truth["x_m"])),
    ]
}

/// Measures each scene by colour: centres off by no more than `most_bias` px, their scatter as claimed, the truth inside the 95 % intervals as
/// often as chance allows.
fn check(scenes: &[Value], most_bias: f64) {
    let (mut inside, mut all) = (0, 0);
    let (mut scatter, mut claimed) = (0.0, 0.0);
    for (i, scene) in scenes.iter().enumerate() {
        let r = Rendered::new(scene);
        let m = rendered::standard(&r.video, &r.calibration);
        assert_eq!(m.outcome, Outcome::Measured, "scene {i}");
        assert!(by_colour(&m), "scene {i}: {:?}", m.warnings);
        let found = centre_errors(&m, &r.truth);
        println!(
            "scene {i}: bias {:+.4} {:+.4}, scatter {:.4}, claimed {:.4} px",
            found.bias[0], found.bias[1], found.scatter, found.claimed
        );
        assert!(
            found.bias.iter().all(|b| b.abs() < most_bias),
            "scene {i}: {:?}",
            found.bias
        );
        scatter += found.scatter.powi(2);
        claimed += found.claimed.powi(2);
        for (name, pull) in pulls(&m, &r.truth) {
            println!("scene {i} {name}: {pull:.2} standard uncertainties");
            assert!(pull.abs() < 4.0, "scene {i} {name}: {pull:.1}");
            inside += usize::from(pull.abs() < 1.96);
            all += 1;
        }
    }
    let ratio = (scatter / claimed).sqrt();
    assert!((0.8..1.25).contains(&ratio), "scatter over claimed: {ratio:.2}");
    assert!(inside * 100 >= all * 85, "{inside} of {all} inside");
}

#[test]
fn a_ball_of_the_wall_s_luma_is_measured_wherever_its_chroma_lies() {
    let scenes: Vec<Value> = (1..=6)
        .map(|seed| {
            let siting = ["left", "centre"][seed as usize % 2];
            scene(seed, &json!({"chroma_siting": siting}), &json!({}))
        })
        .collect();
    // A sample taken half a pixel from where it lies would shift all centres by 0.5 px.
    check(&scenes, 0.01);
}

#[test]
fn so_is_a_shaded_one_whose_light_side_is_lighter_than_the_wall() {
    let look = json!({"ball_grey": 150, "shading": 0.5, "highlight_grey": 40});
    let scenes: Vec<Value> = (1..=4).map(|seed| scene(seed, &json!({}), &look)).collect();
    // The dark side's edge is fainter in chroma, too, and soft: the whole is a little off towards it, well within what x0 has for it.
    check(&scenes, 0.12);
}

#[test]
fn so_is_one_in_h_264() {
    let scenes: Vec<Value> = (1..=5)
        .map(|seed| {
            let siting = ["left", "centre"][seed as usize % 2];
            let camera = json!({"codec": "h264", "crf": 16, "chroma_siting": siting});
            scene(seed, &camera, &json!({"ball_colour": [-70, -60]}))
        })
        .collect();
    // Encoders spend little on chroma.
    check(&scenes, 0.3);
}

#[test]
fn colour_helps_a_ball_that_luma_hardly_shows() {
    let std_px = |colour: [i32; 2]| {
        let r = Rendered::new(&scene(
            1,
            &json!({}),
            &json!({"ball_grey": 119, "ball_colour": colour}),
        ));
        let m = rendered::standard(&r.video, &r.calibration);
        assert_eq!(m.outcome, Outcome::Measured);
        assert_eq!(by_colour(&m), colour != [0, 0]);
        centre_errors(&m, &r.truth).scatter
    };
    let (with, without) = (std_px([-40, -45]), std_px([0, 0]));
    assert!(with < 0.6 * without, "{with:.4} px against {without:.4}");
}

/// The frames of a scene in colour.
fn frames_of(scene: &Value) -> Vec<Yuv420> {
    let recording = SimulatedRecording::new(&Scene::from_json(&scene.to_string()).unwrap()).unwrap();
    (0..recording.frame_count())
        .map(|i| recording.colour_frame(i).unwrap())
        .collect()
}

#[test]
fn where_luma_is_enough_chroma_changes_no_bit() {
    let s = scene(1, &json!({}), &json!({"ball_grey": 200}));
    let r = Rendered::new(&s);
    let grey = r.dir.path().join("grey.mkv");
    let mut writer = VideoWriter::create(&grey, 640, 360, 240.0, Coding::Lossless).unwrap();
    for yuv in frames_of(&s) {
        let (width, height) = (yuv.width, yuv.height);
        let luma = Luma {
            width,
            height,
            data: yuv.y,
        };
        writer.write(&luma).unwrap();
    }
    writer.finish().unwrap();
    let (coloured, grey) = (
        rendered::standard(&r.video, &r.calibration),
        rendered::standard(&grey, &r.calibration),
    );
    assert!(!by_colour(&coloured));
    assert_eq!(coloured.track.points.len(), grey.track.points.len());
    for (a, b) in coloured.track.points.iter().zip(&grey.track.points) {
        assert_eq!((a.pixel, a.std_px, &a.use_), (b.pixel, b.std_px, &b.use_));
    }
    assert_eq!(coloured.bounces[0].restitution, grey.bounces[0].restitution);
    // The picture of the page has colours all the same.
    assert!(coloured.strobe.unwrap().chroma.is_some());
    assert!(grey.strobe.unwrap().chroma.is_none());
}

/// Red, green, blue of a pixel by BT.601, full range.
fn rgb(yuv: &Yuv420, x: usize, y: usize) -> [f64; 3] {
    let luma = f64::from(yuv.y[y * yuv.width + x]);
    let at = (y / 2) * yuv.chroma_width() + x / 2;
    let (u, v) = (f64::from(yuv.u[at]) - 128.0, f64::from(yuv.v[at]) - 128.0);
    [luma + 1.402 * v, luma - 0.344 * u - 0.714 * v, luma + 1.772 * u]
}

#[test]
fn a_folder_of_coloured_pictures_is_measured() {
    // Samples between two pixels, given to both of them: their middle stays where it is.
    let s = scene(3, &json!({"chroma_siting": "centre"}), &json!({}));
    let r = Rendered::new(&s);
    let folder = r.dir.path().join("pictures");
    std::fs::create_dir(&folder).unwrap();
    for (i, yuv) in frames_of(&s).iter().enumerate() {
        let code = |x: f64| x.round().clamp(0.0, 255.0) as u8;
        let pixels: Vec<Vec3b> = (0..yuv.height)
            .flat_map(|y| (0..yuv.width).map(move |x| (x, y)))
            .map(|(x, y)| {
                let [red, green, blue] = rgb(yuv, x, y).map(code);
                Vec3b::from([blue, green, red])
            })
            .collect();
        let flat = Mat::from_slice(&pixels).unwrap();
        let picture = flat.reshape(3, yuv.height as i32).unwrap();
        let mut png = Vector::<u8>::new();
        imgcodecs::imencode(".png", &picture, &mut png, &Vector::new()).unwrap();
        std::fs::write(folder.join(format!("{i:04}.png")), png.as_slice()).unwrap();
    }
    let mut calibration: Calibration = r.calibration.clone();
    calibration.frame_rate_hz = Some(240.0);
    let m = rendered::standard(&folder, &calibration);
    assert!(by_colour(&m));
    let found = centre_errors(&m, &r.truth);
    assert!(found.bias.iter().all(|b| b.abs() < 0.02), "{:?}", found.bias);
    // Samples given to four pixels each, rounded in red, green and blue.
    assert!(found.scatter < 0.05, "{}", found.scatter);
    assert!(found.scatter < 1.3 * found.claimed, "{}", found.claimed);
}

/// A picture whose U is a ramp along its columns: the value that each sample has at the place where it lies.
fn ramp(siting: ChromaSiting) -> Yuv420 {
    let mut picture = Yuv420::black(64, 32);
    let place = if siting == ChromaSiting::Left { 0.0 } else { 0.5 };
    for (i, u) in picture.u.iter_mut().enumerate() {
        *u = (40.0 + 2.0 * (2.0 * (i % 32) as f64 + place)) as u8;
    }
    picture
}

#[test]
fn each_sample_of_chroma_stands_where_the_file_says_however_the_picture_is_turned() {
    let mix = ColourMix {
        luma: 0.0,
        u: 1.0,
        v: 0.0,
        offset: 128.0,
    };
    let dir = tempfile::tempdir().unwrap();
    let lossless = Coding::H264 {
        crf: 0,
        gop: 1,
        b_frames: 0,
    };
    for siting in [ChromaSiting::Left, ChromaSiting::Centre] {
        for (rotation_deg, coding, name) in [
            (0.0, Coding::LosslessColour, "a.mkv"),
            (0.0, lossless, "a.mp4"),
            (90.0, lossless, "b.mp4"),
            (180.0, lossless, "c.mp4"),
            (270.0, lossless, "d.mp4"),
        ] {
            let path = dir.path().join(name);
            let options = VideoOptions {
                rotation_deg,
                chroma_siting: Some(siting),
                ..VideoOptions::new(30.0, coding)
            };
            let mut writer = VideoWriter::create_with(&path, 64, 32, &options).unwrap();
            writer.write_yuv(&ramp(siting)).unwrap();
            writer.finish().unwrap();
            let mut source = frames::open_mixed(&path, Some(mix)).unwrap();
            let plane = source.next_frame().unwrap().unwrap().luma;
            // Away from the border, where there is nothing to interpolate with.
            for stored in 4..60_usize {
                let shown = match rotation_deg as i32 {
                    0 => plane.row(16)[stored],
                    90 => plane.row(stored)[16],
                    180 => plane.row(16)[63 - stored],
                    _ => plane.row(63 - stored)[16],
                };
                let wanted = 40 + 2 * stored as u8;
                assert!(
                    shown.abs_diff(wanted) <= 1,
                    "{siting:?} {rotation_deg} {name}, column {stored}: {shown}, not {wanted}"
                );
            }
        }
    }
}

/// The greenest pixel of a picture: by how much green exceeds the mean of red and blue.
fn greenest(picture: &Mat) -> i32 {
    let pixels = picture.data_typed::<Vec3b>().unwrap();
    let green = |p: &Vec3b| i32::from(p[1]) - (i32::from(p[0]) + i32::from(p[2])) / 2;
    pixels.iter().map(green).max().unwrap()
}

#[test]
fn page_and_overlay_show_the_colours_of_the_recording() {
    let r = Rendered::new(&scene(2, &json!({}), &json!({})));
    let m = rendered::standard(&r.video, &r.calibration);
    let svg = strobe_picture(&m, 1).unwrap().unwrap().svg;
    let coded = svg.split("base64,").nth(1).unwrap().split('"').next().unwrap();
    let jpeg = base64::engine::general_purpose::STANDARD.decode(coded).unwrap();
    let jpeg = imgcodecs::imdecode(&Vector::from_slice(&jpeg), imgcodecs::IMREAD_COLOR).unwrap();
    // Chroma [-40, -45] is 80 levels of green over the others.
    assert!(greenest(&jpeg) > 50, "{}", greenest(&jpeg));

    let overlay = r.dir.path().join("overlay.mp4");
    let drawing = Overlay::new(&m);
    recode(&r.video, &overlay, &mut |frame, picture| {
        drawing.draw(frame, picture)
    })
    .unwrap();
    let frame = frames::open(&overlay).unwrap().next_frame().unwrap().unwrap();
    let chroma = frame.colour.unwrap().chroma();
    let truth = &r.truth["centres"][0];
    // Beside the drawn cross, inside the outline.
    let at = |key: &str| (truth[key].as_f64().unwrap() - 5.0).round() as usize;
    let [u, v] = chroma.at(at("u_px"), at("v_px"));
    assert!(u < 100 && v < 100, "{u} {v}");
    let [u, v] = chroma.at(500, 60);
    assert!(u.abs_diff(128) < 4 && v.abs_diff(128) < 4, "{u} {v}: the wall");
}

#[test]
fn a_scene_without_colours_is_rendered_as_ever() {
    let grey = scene(1, &json!({}), &json!({"ball_colour": [0, 0]}));
    let recording = SimulatedRecording::new(&Scene::from_json(&grey.to_string()).unwrap()).unwrap();
    assert!(recording.colour_frame(0).is_none());
    let coloured = frames_of(&scene(1, &json!({}), &json!({})));
    assert_eq!(coloured[3].y, recording.frame(3).data);
    let wrong = scene(1, &json!({}), &json!({"ball_colour": [200, 0]})).to_string();
    let error = Scene::from_json(&wrong).unwrap_err().to_string();
    assert!(error.contains("look.ball_colour"), "{error}");
}
