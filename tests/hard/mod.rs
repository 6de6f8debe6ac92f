//! Hard recordings: rendered clips, spoilt on purpose, written, measured and judged against the truth.
//!
//! A measurement passes where each number that it gives holds the truth within its own uncertainty, and what it cannot
//! give is left out or said in a warning. What is never allowed: a number that is not finite, a bounce that did not
//! happen, a wrong number without a word.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::frames::{Coding, Luma, Timing, VideoOptions, VideoWriter};
use track::pipeline::{MeasureError, Measurement, Outcome, measure};
use track::quantity::Quantity;
use track::rebound::Regime;
use track::simulate::truth::{BounceTruth, CentreTruth, LaunchTruth, LegTruth, Truth};
use track::simulate::{Scene, SimulatedRecording, calibration};

/// A ball of R 8 px that bounces twice in a picture of 320 × 240 at 240 Hz, stored without loss.
pub fn scene(seed: u64) -> Value {
    json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": 0.012, "mass_kg": 0.0567, "inertia_factor": 0.4},
        "contact": {"model": "mu_e", "restitution": 0.78, "friction": 0.07},
        "launch": {"drop_height_m": 0.2, "speed_m_s": 0.6, "spin_ratio": [0, 0, 0]},
        "camera": {"image_size_px": [320, 240], "frame_rate_hz": 240, "exposure_s": 0.0005,
                   "metres_per_pixel": 0.0015, "origin_px": [24, 220], "blur_px": 0.7, "noise_grey": 2.0,
                   "codec": "lossless"},
        "look": {"background_grey": 60, "ball_grey": 200, "shading": 0.3},
        "stop": {"bounces": 2, "tail_s": 0.06}
    })
}

/// `scene` with some keys of a section changed.
pub fn with(mut scene: Value, section: &str, changes: Value) -> Value {
    if !scene[section].is_object() {
        scene[section] = json!({});
    }
    let into = scene[section].as_object_mut().unwrap();
    into.extend(changes.as_object().unwrap().clone());
    scene
}

/// Frames with their times, the calibration and the truth that belong to them.
#[derive(Clone)]
pub struct Clip {
    pub frames: Vec<Luma>,
    /// By the truth's clock, in which the launch is at 0, s.
    pub times_s: Vec<f64>,
    pub rate_hz: f64,
    pub calibration: Calibration,
    /// The file that `calibration` was read from.
    pub calibration_json: Value,
    pub truth: Truth,
}

/// Fastest frames that a .mkv holds, Hz.
const MKV_MOST_HZ: f64 = 1000.0;

impl Clip {
    pub fn of(scene: &Value) -> Self {
        Self::opened(scene, |_, _, _| {})
    }

    /// A rendered clip whose frames are changed by `change` (frame, its picture, the ball's true place).
    pub fn opened(scene: &Value, change: impl Fn(usize, &mut Luma, &CentreTruth)) -> Self {
        let recording = SimulatedRecording::new(&Scene::from_json(&scene.to_string()).unwrap()).unwrap();
        let mut truth = recording.truth();
        // What the file holds of what the camera took.
        let stored = recording.stored_frames();
        truth.centres = stored.iter().map(|s| truth.centres[s.shows]).collect();
        let mut frames: Vec<Luma> = stored.iter().map(|s| recording.frame(s.shows)).collect();
        for (i, frame) in frames.iter_mut().enumerate() {
            change(i, frame, &truth.centres[i]);
        }
        let calibration_json = calibration(&recording);
        Self {
            times_s: truth.centres.iter().map(|c| c.time_s).collect(),
            rate_hz: stored_hz(scene),
            frames,
            calibration: parsed(&calibration_json),
            calibration_json,
            truth,
        }
    }

    /// What is known of it alone.
    pub fn without_pictures(mut self) -> Self {
        self.frames = Vec::new();
        self
    }

    /// The same with a calibration file that `change` has changed.
    pub fn calibrated(mut self, change: impl Fn(&mut Value)) -> Self {
        change(&mut self.calibration_json);
        self.calibration = parsed(&self.calibration_json);
        self
    }

    /// The same with a key of the calibration file left out.
    pub fn untold(self, key: &str) -> Self {
        self.calibrated(|c| {
            c.as_object_mut().unwrap().remove(key);
        })
    }

    /// The same launched to the left: pictures, calibration and true pixels mirrored. x runs along the launch in both.
    pub fn mirrored(mut self) -> Self {
        let last = (self.frames[0].width - 1) as f64;
        for frame in &mut self.frames {
            let width = frame.width;
            frame.data.chunks_exact_mut(width).for_each(<[u8]>::reverse);
        }
        for centre in &mut self.truth.centres {
            centre.u_px = last - centre.u_px;
        }
        self.calibrated(|c| {
            if let Some(u) = c.pointer_mut("/origin_px/0") {
                *u = json!(last - u.as_f64().unwrap());
            }
            if let Some(u) = c.pointer_mut("/up_px/0") {
                *u = json!(-u.as_f64().unwrap());
            }
        })
    }

    /// The same after the ball was held for `frames` where the clip begins. Of `scene`, whose ball begins at rest.
    pub fn held(mut self, scene: &Value, frames: usize) -> Self {
        let first = self.truth.centres[0];
        for i in 1..=frames {
            // Each with noise of its own: frames that are the same to the bit are repeats of one.
            let mut again = scene.clone();
            again["seed"] = json!(scene["seed"].as_u64().unwrap() + 10_000 + i as u64);
            let again = SimulatedRecording::new(&Scene::from_json(&again.to_string()).unwrap()).unwrap();
            self.frames.insert(0, again.frame(0));
            let time_s = self.times_s[0] - 1.0 / self.rate_hz;
            self.times_s.insert(0, time_s);
            self.truth.centres.insert(0, CentreTruth { time_s, ..first });
        }
        self
    }

    /// The same with every picture changed by `change` (frame, picture, the ball's true place).
    pub fn changed(mut self, change: impl Fn(usize, &mut Luma, &CentreTruth)) -> Self {
        for (i, frame) in self.frames.iter_mut().enumerate() {
            change(i, frame, &self.truth.centres[i]);
        }
        self
    }

    /// Only the frames for which `keep` (number, time) holds.
    pub fn only(mut self, keep: impl Fn(usize, f64) -> bool) -> Self {
        let kept: Vec<bool> = self
            .times_s
            .iter()
            .enumerate()
            .map(|(i, &t)| keep(i, t))
            .collect();
        let mut it = kept.iter();
        self.frames.retain(|_| *it.next().unwrap());
        let mut it = kept.iter();
        self.times_s.retain(|_| *it.next().unwrap());
        let mut it = kept.iter();
        self.truth.centres.retain(|_| *it.next().unwrap());
        self
    }

    /// Stored without loss at a constant rate, and measured.
    pub fn measured(&self) -> Judged {
        let dir = tempfile::tempdir().unwrap();
        let name = if self.rate_hz > MKV_MOST_HZ {
            "clip.mp4"
        } else {
            "clip.mkv"
        };
        let video = self.write(&dir.path().join(name));
        self.judged(&video)
    }

    /// Stored as phones and cameras do, with loss, and measured.
    pub fn coded(&self) -> Judged {
        self.coded_to(14)
    }

    /// The same with this constant rate factor.
    pub fn coded_to(&self, crf: u8) -> Judged {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("clip.mp4");
        let coding = Coding::H264 {
            crf,
            gop: 48,
            b_frames: 2,
        };
        self.write_as(&path, coding);
        self.judged(&path)
    }

    /// [`Self::coded`] or [`Self::measured`].
    pub fn stored(&self, codec: &str) -> Judged {
        match codec {
            "h264" => self.coded(),
            "lossless" => self.measured(),
            other => panic!("no codec {other}"),
        }
    }

    pub fn write(&self, path: &Path) -> PathBuf {
        let coding = if path.extension().is_some_and(|e| e == "mp4") {
            Coding::H264 {
                crf: 0,
                gop: 12,
                b_frames: 0,
            }
        } else {
            Coding::Lossless
        };
        self.write_as(path, coding)
    }

    fn write_as(&self, path: &Path, coding: Coding) -> PathBuf {
        let first = &self.frames[0];
        let mut writer = VideoWriter::create(path, first.width, first.height, self.rate_hz, coding).unwrap();
        self.frames.iter().for_each(|f| writer.write(f).unwrap());
        writer.finish().unwrap();
        path.to_owned()
    }

    /// Stored as H.264 without loss, each frame with the stamp `stamps_s`, and measured.
    pub fn stamped(&self, stamps_s: &[f64]) -> Judged {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("clip.mp4");
        let first = &self.frames[0];
        let coding = Coding::H264 {
            crf: 0,
            gop: 12,
            b_frames: 0,
        };
        let options = VideoOptions {
            timing: Timing::Stamped,
            ..VideoOptions::new(self.rate_hz, coding)
        };
        let mut writer = VideoWriter::create_with(&path, first.width, first.height, &options).unwrap();
        for (f, &t) in self.frames.iter().zip(stamps_s) {
            writer.write_at(f, t).unwrap();
        }
        writer.finish().unwrap();
        self.judged(&path)
    }

    /// Stored as images with `numbers`, and measured with the rate in the calibration.
    pub fn numbered(&self, numbers: &[usize]) -> Judged {
        let dir = tempfile::tempdir().unwrap();
        for (f, n) in self.frames.iter().zip(numbers) {
            let mut bytes = format!("P5\n{} {}\n255\n", f.width, f.height).into_bytes();
            bytes.extend_from_slice(&f.data);
            std::fs::write(dir.path().join(format!("frame_{n:05}.pgm")), bytes).unwrap();
        }
        let mut with_rate = self.clone();
        with_rate.calibration.frame_rate_hz = Some(self.rate_hz);
        with_rate.judged(dir.path())
    }

    pub fn judged(&self, video: &Path) -> Judged {
        let found = measure(
            video,
            &self.calibration,
            "calib.json",
            Accuracy::Standard,
            &mut |_| {},
        );
        Judged::new(found, self)
    }
}

/// A number against its truth.
#[derive(Debug, Clone)]
pub struct Compared {
    pub what: String,
    pub value: f64,
    pub truth: f64,
    pub std: Option<f64>,
}

impl Compared {
    /// Error in standard uncertainties; `None` where none is stated.
    pub fn pull(&self) -> Option<f64> {
        self.std.map(|s| (self.value - self.truth) / s)
    }
}

/// A measurement and what is wrong with it.
pub struct Judged {
    pub found: Result<Measurement, MeasureError>,
    pub compared: Vec<Compared>,
    /// Regimes that are not the truth's.
    pub misnamed: Vec<String>,
    /// Numbers that no number should be, and bounces and launches that never were.
    pub broken: Vec<String>,
}

/// Errors that stand for an honest number, standard uncertainties: one of 15 000 normal errors is larger.
pub const HONEST_SIGMAS: f64 = 4.0;

impl Judged {
    pub fn new(found: Result<Measurement, MeasureError>, clip: &Clip) -> Self {
        let mut judged = Self {
            found,
            compared: Vec::new(),
            misnamed: Vec::new(),
            broken: Vec::new(),
        };
        if let Ok(m) = &judged.found {
            (judged.compared, judged.misnamed, judged.broken) = against(m, clip);
        }
        judged
    }

    pub fn is_measured(&self) -> bool {
        matches!(&self.found, Ok(m) if m.outcome == Outcome::Measured)
    }

    /// Why there is no measurement.
    pub fn reason(&self) -> Option<String> {
        match &self.found {
            Err(e) => Some(format!("error: {e}")),
            Ok(m) => match &m.outcome {
                Outcome::Rejected { reason } => Some(reason.clone()),
                Outcome::Measured => None,
            },
        }
    }

    pub fn warnings(&self) -> Vec<&'static str> {
        let told = |m: &Measurement| m.warnings.iter().map(|w| w.code).collect();
        self.found.as_ref().map(told).unwrap_or_default()
    }

    pub fn warns(&self, code: &str) -> bool {
        self.warnings().contains(&code)
    }

    pub fn bounces(&self) -> usize {
        self.found.as_ref().map_or(0, |m| m.bounces.len())
    }

    /// Errors above `sigmas` standard uncertainties, and what is broken.
    pub fn lies(&self, sigmas: f64) -> Vec<String> {
        let off = self.compared.iter().filter_map(|c| {
            let pull = c.pull()?;
            let lie = !(pull.abs() <= sigmas);
            lie.then(|| {
                format!(
                    "{} {} ± {} against {}: {pull:.1} σ",
                    c.what,
                    c.value,
                    c.std.unwrap_or(f64::NAN),
                    c.truth
                )
            })
        });
        off.chain(self.misnamed.iter().cloned())
            .chain(self.broken.iter().cloned())
            .collect()
    }

    /// The words of the warning `code`.
    pub fn message(&self, code: &str) -> Option<&str> {
        let found = self.found.as_ref().ok()?;
        let warning = found.warnings.iter().find(|w| w.code == code)?;
        Some(&warning.message)
    }

    /// The number called `what`.
    pub fn number(&self, what: &str) -> Option<&Compared> {
        self.compared.iter().find(|c| c.what == what)
    }
}

fn degrees(q: Option<Quantity>) -> Option<Quantity> {
    q.map(|q| q.scaled(180.0 / std::f64::consts::PI))
}

/// Everything that `m` says against the truth: numbers, regimes, and what is broken.
fn against(m: &Measurement, clip: &Clip) -> (Vec<Compared>, Vec<String>, Vec<String>) {
    let (mut compared, mut misnamed, mut broken) = (Vec::new(), Vec::new(), Vec::new());
    let start_s = clip.times_s[0];
    let mut compare = |what: String, q: Option<Quantity>, truth: Option<f64>| {
        let Some(q) = q else { return };
        let fine = q.value.is_finite() && q.std_uncertainty.is_none_or(|s| s.is_finite() && s > 0.0);
        if !fine {
            compared_broken(&mut broken, &what, q);
            return;
        }
        if let Some(truth) = truth {
            compared.push(Compared {
                what,
                value: q.value,
                truth,
                std: q.std_uncertainty,
            });
        }
    };
    let g = Some(9.81);
    compare("gravity".into(), m.gravity_m_s2, g);
    let slope = degrees(m.floor.map(|f| f.slope_rad));
    compare("floor slope".into(), slope, Some(clip.truth.floor_slope_deg));
    let mut invented = Vec::new();
    match (m.launch, clip.truth.launch) {
        (Some(_), None) => invented.push("a launch from a bench never was".to_owned()),
        (Some(found), Some(truth)) => {
            compare("launch edge".into(), found.edge_x_m, Some(truth.edge_x_m));
            compare("launch time".into(), found.time_s, Some(truth.time_s - start_s));
            compare("launch speed".into(), found.speed_m_s, Some(truth.speed_m_s));
            compare(
                "drop height".into(),
                found.drop_height_m,
                drop_height_m(clip, truth),
            );
        }
        (None, _) => {}
    }
    // Without an origin x = 0 is the edge, where that is seen.
    let has_places = clip.calibration.has_origin() || m.launch.is_some_and(|l| l.edge_x_m.is_some());
    let mut first = None;
    for (i, b) in m.bounces.iter().enumerate() {
        let Some(time) = b.time_s else { continue };
        let near = nearest(&clip.truth.bounces, time.value + start_s);
        let Some(k) = near.filter(|&k| {
            let off = (clip.truth.bounces[k].time_s - start_s - time.value).abs();
            off < 1.0 / clip.rate_hz + 5.0 * time.std_uncertainty.unwrap_or(0.0)
        }) else {
            invented.push(format!("bounce {i} at {} s never was", time.value + start_s));
            continue;
        };
        if first.is_none() {
            first = Some(k);
        }
        let t: &BounceTruth = &clip.truth.bounces[k];
        let n = i + 1;
        compare(format!("time {n}"), Some(time), Some(t.time_s - start_s));
        compare(format!("place {n}"), b.x_m.filter(|_| has_places), Some(t.x_m));
        compare(format!("e {n}"), b.restitution, t.restitution);
        compare(format!("ratio {n}"), b.tangential_ratio, t.tangential_ratio);
        compare(format!("mu {n}"), b.friction, t.friction);
        let at_least = b.friction_at_least.filter(|_| b.friction.is_none());
        compare(format!("mu at least {n}"), at_least, t.friction);
        let rolls = t.tangential_restitution.is_some_and(|e_x| e_x.abs() <= ROLLS);
        if named(b.slip).is_some_and(|name| !is_called(name, t.regime, rolls)) {
            misnamed.push(format!(
                "regime {n} {:?} for e_x {:?} against {} with {:?}",
                b.slip, b.tangential_restitution, t.regime, t.tangential_restitution
            ));
        }
        compare(
            format!("e_x {n}"),
            b.tangential_restitution,
            t.tangential_restitution,
        );
        compare(format!("spin in {n}"), b.spin_in_m_s, Some(t.spin_in_m_s));
        compare(format!("spin out {n}"), b.spin_out_m_s, Some(t.spin_out_m_s));
        for (leg, truth, name) in [
            (b.incident, t.incident, "incident"),
            (b.rebound, t.rebound, "rebound"),
        ] {
            let LegTruth {
                vx_m_s,
                vz_m_s,
                angle_deg,
                ..
            } = truth;
            compare(format!("{name} vx {n}"), leg.vx_m_s, Some(vx_m_s));
            compare(format!("{name} vz {n}"), leg.vz_m_s, Some(vz_m_s));
            compare(
                format!("{name} angle {n}"),
                degrees(leg.angle_rad),
                Some(angle_deg),
            );
        }
    }
    compare("x0".into(), m.distances.x0_m, clip.truth.x0_m);
    let x = first.and_then(|k| {
        let next = clip
            .truth
            .bounces
            .get(k + 1)
            .map(|b| b.x_m - clip.truth.bounces[k].x_m);
        if k == 0 { clip.truth.x_m } else { next }
    });
    compare("x".into(), m.distances.x_m, x);
    for p in &m.track.points {
        let fine = p.pixel.u_px.is_finite() && p.pixel.v_px.is_finite() && p.time_s.is_finite();
        if !fine {
            broken.push(format!("point of frame {} is no number", p.frame));
        }
    }
    broken.extend(invented);
    (compared, misnamed, broken)
}

/// Frames a second of the file.
fn stored_hz(scene: &Value) -> f64 {
    let camera = &scene["camera"];
    let stored_hz = camera["clock"]["stored_hz"].as_f64();
    stored_hz.or(camera["frame_rate_hz"].as_f64()).unwrap_or(240.0)
}

fn parsed(calibration: &Value) -> Calibration {
    Calibration::parse(&calibration.to_string(), "calib.json").unwrap()
}

/// How far the ball falls from the edge to its first impact: over a sloping floor that is not its height above the origin.
fn drop_height_m(clip: &Clip, truth: LaunchTruth) -> Option<f64> {
    let slope_rad = clip.truth.floor_slope_deg.to_radians();
    let radius_m = clip.calibration.ball.radius_m?;
    let touch_m = clip.truth.x0_m? * slope_rad.tan() + radius_m * (1.0 / slope_rad.cos() - 1.0);
    Some(truth.drop_height_m - touch_m)
}

/// The regime as results name it; `None` where it is left open.
fn named(slip: Option<Regime>) -> Option<&'static str> {
    match slip {
        Some(Regime::Ordinary | Regime::Sliding) => Some("sliding"),
        Some(Regime::Nonsliding) => Some("nonsliding"),
        Some(Regime::Grip) => Some("grip"),
        Some(Regime::SlipStickSlip | Regime::StickSlip) | None => None,
    }
}

/// A ball whose e_x is no more than this from 0 may be said to leave rolling, as results define it.
const ROLLS: f64 = 0.02;

/// Whether a result's regime is the truth's, in which a ball that slides by the e-e model is "ordinary"; `rolls`: to [`ROLLS`].
fn is_called(name: &str, truth: &str, rolls: bool) -> bool {
    let truth = if truth == "ordinary" { "sliding" } else { truth };
    name == truth || (name == "nonsliding" && rolls)
}

fn compared_broken(broken: &mut Vec<String>, what: &str, q: Quantity) {
    broken.push(format!("{what} is {} ± {:?}", q.value, q.std_uncertainty));
}

fn nearest(bounces: &[BounceTruth], time_s: f64) -> Option<usize> {
    (0..bounces.len()).min_by(|&a, &b| {
        let off = |k: usize| (bounces[k].time_s - time_s).abs();
        off(a).total_cmp(&off(b))
    })
}

/// `test` with each of `variants`: all that fail are told, not the first alone.
pub fn each<T>(variants: impl IntoIterator<Item = T>, test: impl Fn(T)) {
    let (mut tried, mut failed) = (0, Vec::new());
    for variant in variants {
        tried += 1;
        let tested = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| test(variant)));
        if let Err(why) = tested {
            let why = why.downcast_ref::<String>();
            failed.push(why.map_or_else(|| "it panicked".to_owned(), String::clone));
        }
    }
    let count = failed.len();
    assert!(failed.is_empty(), "{count} of {tried}:\n{}", failed.join("\n"));
}

/// That no number is wrong without a word that names the cause: `codes` are words that do.
pub fn assert_honest(found: &Judged, codes: &[&str], what: &str) {
    assert!(found.broken.is_empty(), "{what}: {:?}", found.broken);
    let lies = found.lies(HONEST_SIGMAS);
    let told = codes.iter().any(|c| found.warns(c));
    assert!(
        lies.is_empty() || told,
        "{what}: {lies:#?}, warned of {:?}",
        found.warnings()
    );
}

/// That all numbers hold the truth, of so many bounces.
pub fn assert_true(found: &Judged, bounces: usize, what: &str) {
    assert!(found.is_measured(), "{what}: {:?}", found.reason());
    let lies = found.lies(HONEST_SIGMAS);
    assert!(
        lies.is_empty(),
        "{what}: {lies:#?}, warned of {:?}",
        found.warnings()
    );
    assert_eq!(found.bounces(), bounces, "{what}");
}

/// Paints a filled disc of `grey`, with an edge softened over a pixel.
pub fn paint_disc(luma: &mut Luma, u: f64, v: f64, radius: f64, grey: f64) {
    for row in 0..luma.height {
        for column in 0..luma.width {
            let r = (column as f64 - u).hypot(row as f64 - v);
            let cover = (radius - r + 0.5).clamp(0.0, 1.0);
            if cover > 0.0 {
                let p = &mut luma.data[row * luma.width + column];
                *p = (f64::from(*p) * (1.0 - cover) + grey * cover)
                    .round()
                    .clamp(0.0, 255.0) as u8;
            }
        }
    }
}

/// Fills a rectangle with `grey`.
pub fn paint_box(luma: &mut Luma, us: std::ops::Range<usize>, vs: std::ops::Range<usize>, grey: u8) {
    for v in vs.start..vs.end.min(luma.height) {
        let end = us.end.min(luma.width);
        luma.data[v * luma.width + us.start.min(end)..v * luma.width + end].fill(grey);
    }
}

/// Grey at (u, v) between four pixels; `None` outside.
pub fn bilinear(luma: &Luma, u: f64, v: f64) -> Option<f64> {
    let inside = u >= 0.0 && v >= 0.0 && u <= (luma.width - 1) as f64 && v <= (luma.height - 1) as f64;
    if !inside {
        return None;
    }
    let (i, j) = (
        (u as usize).min(luma.width - 2),
        (v as usize).min(luma.height - 2),
    );
    let (x, y) = (u - i as f64, v - j as f64);
    let at = |i: usize, j: usize| f64::from(luma.data[j * luma.width + i]);
    let top = at(i, j) * (1.0 - x) + at(i + 1, j) * x;
    let bottom = at(i, j + 1) * (1.0 - x) + at(i + 1, j + 1) * x;
    Some(top * (1.0 - y) + bottom * y)
}

/// The picture of a camera that looks (du, dv) px aside: what was at p is at p + (du, dv), the edges repeated.
pub fn moved(luma: &Luma, du: f64, dv: f64) -> Luma {
    taken(luma, |u, v| (u - du, v - dv))
}

/// The picture of a camera that is turned about its axis: what was at p is clockwise of it by `by_rad` about the middle.
pub fn turned(luma: &Luma, by_rad: f64) -> Luma {
    let (u0, v0) = ((luma.width as f64 - 1.0) / 2.0, (luma.height as f64 - 1.0) / 2.0);
    let (sin, cos) = by_rad.sin_cos();
    taken(luma, |u, v| {
        let (x, y) = (u - u0, v - v0);
        (u0 + cos * x + sin * y, v0 + cos * y - sin * x)
    })
}

/// At each place what was at another, the edges repeated.
fn taken(luma: &Luma, from: impl Fn(f64, f64) -> (f64, f64)) -> Luma {
    let (width, height) = (luma.width, luma.height);
    Luma::from_fn(width, height, |u, v| {
        let (u, v) = from(u as f64, v as f64);
        let u = u.clamp(0.0, (width - 1) as f64);
        let v = v.clamp(0.0, (height - 1) as f64);
        bilinear(luma, u, v).unwrap_or(0.0).round() as u8
    })
}

/// Numbers that are the same every time, in 0..1.
pub struct Chance(pub u64);

impl Chance {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// Standard normal, by twelve uniform ones.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}
