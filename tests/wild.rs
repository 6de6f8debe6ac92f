//! Do the intervals hold the truth outside of the laboratory? The recordings of `tests/coverage.rs`, each with one or two things that
//! nobody told the program: clocks of files that are not the camera's, motion out of the calibrated plane, slanted and panned
//! cameras, shadows on walls, second balls, rolling shutters.
//!
//! `TRACK_WILD=1000 cargo test --release --test all wild::no_number -- --nocapture` prints the tables of `docs/accuracy.md`; without the variable
//! 100 are made. The seeds are fixed. To look at some of them:
//!
//! * `TRACK_WILD_SEED=220017` makes only that one, and says all that is compared;
//! * `TRACK_WILD_KIND=slant` makes only those that have it (the first so many of `TRACK_WILD`);
//! * `TRACK_WILD_TABLE=file` writes every error over its standard uncertainty there, a row for each recording;
//! * `TRACK_WILD_KEEP=folder` keeps scene, clip, calibration, truth of each there (with many recordings: large).
//!
//! A refusal is no lie, and a number that is far out under a warning that names its cause is none: both are counted apart. Warnings
//! that say that something was put right (`frames_skipped`, `repeated_frames`, `camera_moved`, `several_things_fly`) name no cause of a
//! number that is wrong all the same.

use crate::drawn::{
    CAUSES, Dice, Drawn, FAR_OUT, QUANTITIES, Tried, TruthOfFirst, compared, described, drawn, faults_of,
    known, print_table,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::pipeline::{Measurement, Outcome, PointUse, TrackPoint, measure};
use track::simulate::truth::{BounceTruth, CentreTruth, Truth};
use track::simulate::{Scene, SimulatedRecording, write};

/// Recordings where none are asked for.
const RECORDINGS: usize = 100;

/// The first seed; those of the other tests are elsewhere.
const FIRST_SEED: u64 = 220_000;

/// Warnings that name what makes numbers wrong, besides those of the lab.
const WILD_CAUSES: [&str; 2] = ["scale_changes", "rolling_shutter"];

/// The most that may be refused, and the most of all numbers that may be wrong without a word that names a cause.
const MOST_REFUSED: f64 = 0.08;
const MOST_SILENT: f64 = 0.003;

/// A bounce found within this part of the shortest flight between bounces (where there is one, and up to so long) of a true one is that.
const SAME_BOUNCE: f64 = 0.25;
const LONG_FLIGHT_S: f64 = 0.5;

/// Standard uncertainties of an interval of 95 %.
const WITHIN_95: f64 = 1.96;

/// The chance of a second thing.
const SECOND: f64 = 0.35;

/// What a recording may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    RegularGaps,
    SingleGaps,
    Pulldown,
    SingleRepeats,
    CutStamps,
    OutOfPlane,
    Slant,
    Pan,
    WallShadow,
    SecondBall,
    Readout,
}

impl Kind {
    const ALL: [Self; 11] = [
        Self::RegularGaps,
        Self::SingleGaps,
        Self::Pulldown,
        Self::SingleRepeats,
        Self::CutStamps,
        Self::OutOfPlane,
        Self::Slant,
        Self::Pan,
        Self::WallShadow,
        Self::SecondBall,
        Self::Readout,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::RegularGaps => "regular_gaps",
            Self::SingleGaps => "single_gaps",
            Self::Pulldown => "pulldown",
            Self::SingleRepeats => "single_repeats",
            Self::CutStamps => "cut_stamps",
            Self::OutOfPlane => "out_of_plane",
            Self::Slant => "slant",
            Self::Pan => "pan",
            Self::WallShadow => "wall_shadow",
            Self::SecondBall => "second_ball",
            Self::Readout => "readout",
        }
    }

    /// Warnings that say that a recording has it, or may have: stricter than [`CAUSES`], where the fall may be blamed on the scale.
    fn told_by(self) -> &'static [&'static str] {
        match self {
            Self::RegularGaps | Self::SingleGaps => &["frames_skipped", "dropped_frames"],
            Self::Pulldown | Self::SingleRepeats => &["repeated_frames"],
            Self::CutStamps => &[],
            Self::OutOfPlane | Self::Slant => &["scale_changes"],
            Self::Pan => &["camera_moved", "camera_shaken"],
            Self::WallShadow | Self::SecondBall => &["several_things_fly"],
            Self::Readout => &["rolling_shutter"],
        }
    }

    fn is_clock(self) -> bool {
        use Kind::{CutStamps, Pulldown, RegularGaps, SingleGaps, SingleRepeats};
        matches!(
            self,
            RegularGaps | SingleGaps | Pulldown | SingleRepeats | CutStamps
        )
    }

    fn goes_with(self, other: Self) -> bool {
        self != other && !(self.is_clock() && other.is_clock())
    }
}

/// A recording to be made.
struct Wild {
    drawn: Drawn,
    kinds: Vec<Kind>,
    /// What the calibration does not say though the simulator writes it.
    untold: Vec<&'static str>,
    /// What it says besides.
    readout_s: Option<f64>,
    /// What it has, in words.
    words: Vec<String>,
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap()
}

/// The recording of `seed`.
fn wild(seed: u64) -> Wild {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed ^ 0x57_1d00_0000));
    let first = dice.one_of(&Kind::ALL);
    let mut kinds = vec![first];
    if dice.is(SECOND) {
        let others: Vec<Kind> = Kind::ALL.into_iter().filter(|k| first.goes_with(*k)).collect();
        kinds.push(dice.one_of(&others));
    }
    kinds.sort_unstable();
    let mut wild = Wild {
        drawn: drawn(seed),
        kinds: kinds.clone(),
        untold: Vec::new(),
        readout_s: None,
        words: Vec::new(),
    };
    for kind in kinds {
        wild.add(kind, &mut dice);
    }
    wild
}

/// Camera and file, Hz: frames left out in regular places.
const GAPS_HZ: [(f64, f64); 7] = [
    (24.0, 20.0),
    (30.0, 25.0),
    (60.0, 50.0),
    (60.0, 48.0),
    (120.0, 100.0),
    (240.0, 200.0),
    (240.0, 180.0),
];
/// Camera and file, Hz: frames repeated in regular places.
const PULLDOWNS_HZ: [(f64, f64); 8] = [
    (24.0, 30.0),
    (25.0, 30.0),
    (48.0, 60.0),
    (50.0, 60.0),
    (100.0, 120.0),
    (120.0, 150.0),
    (240.0, 300.0),
    (240.0, 274.0),
];
/// Cameras that are no faster look at a large ball that falls far.
const SLOW_HZ: f64 = 60.0;

impl Wild {
    fn add(&mut self, kind: Kind, dice: &mut Dice) {
        let words = match kind {
            Kind::RegularGaps => self.resampled(dice, &GAPS_HZ),
            Kind::Pulldown => self.resampled(dice, &PULLDOWNS_HZ),
            Kind::SingleGaps => self.single_places(dice, "left_out_places"),
            Kind::SingleRepeats => self.single_places(dice, "filled_places"),
            Kind::CutStamps => {
                self.camera()["clock"] = json!({"stamp_step_s": 0.001});
                String::new()
            }
            Kind::OutOfPlane => {
                let azimuth_deg = dice.one_of(&[-1.0, 1.0]) * dice.between(1.0, 10.0);
                self.drawn.scene["launch"]["azimuth_deg"] = json!(azimuth_deg);
                format!("{azimuth_deg:.1} degrees {}", self.seen_from_near(dice))
            }
            Kind::Slant => {
                let pitch_deg = dice.one_of(&[-1.0, 1.0]) * dice.between(3.0, 20.0);
                self.camera()["pitch_deg"] = json!(pitch_deg);
                format!("{pitch_deg:.1} degrees {}", self.seen_from_near(dice))
            }
            Kind::Pan => self.panned(dice),
            Kind::WallShadow => self.shadowed(dice),
            Kind::SecondBall => self.joined(dice),
            Kind::Readout => {
                let frame_s = 1.0 / number(&self.camera()["frame_rate_hz"]);
                let readout_s = dice.between(0.3, 1.0) * frame_s.min(0.02);
                self.camera()["readout_s"] = json!(readout_s);
                self.readout_s = dice.is(0.5).then_some(readout_s);
                let known = if self.readout_s.is_some() { " known" } else { "" };
                format!("{:.1} ms{known}", 1e3 * readout_s)
            }
        };
        self.words.push(format!("{} {words}", kind.name()));
    }

    fn camera(&mut self) -> &mut Value {
        &mut self.drawn.scene["camera"]
    }

    /// About how long the recording lasts, s.
    fn duration_s(&self) -> f64 {
        let (launch, contact) = (&self.drawn.scene["launch"], &self.drawn.scene["contact"]);
        let fall_s = (2.0 * number(&launch["drop_height_m"]) / 9.81).sqrt();
        launch["bench"]["seen_s"].as_f64().unwrap_or(0.0)
            + fall_s * (1.0 + 2.0 * number(&contact["restitution"]))
    }

    /// More picture on each side, px.
    fn with_margin(&mut self, right_px: f64, down_px: f64) {
        let camera = self.camera();
        for (i, margin_px) in [right_px, down_px].into_iter().enumerate() {
            let margin_px = margin_px.ceil();
            camera["image_size_px"][i] = json!(number(&camera["image_size_px"][i]) + 2.0 * margin_px);
            camera["origin_px"][i] = json!(number(&camera["origin_px"][i]) + margin_px);
        }
    }

    fn resampled(&mut self, dice: &mut Dice, rates_hz: &[(f64, f64)]) -> String {
        let (camera_hz, stored_hz) = dice.one_of(rates_hz);
        if camera_hz <= SLOW_HZ {
            self.large_and_high(dice, camera_hz);
        }
        let camera = self.camera();
        camera["frame_rate_hz"] = json!(camera_hz);
        camera["clock"] = json!({"stored_hz": stored_hz, "phase": dice.between(0.0, 0.99)});
        format!("{camera_hz} to {stored_hz} Hz")
    }

    fn single_places(&mut self, dice: &mut Dice, key: &str) -> String {
        let frames = 0.9 * self.duration_s() * number(&self.camera()["frame_rate_hz"]);
        let count = dice.one_of(&[1, 1, 2, 3, 5]);
        let places: Vec<usize> = (0..count).map(|_| dice.between(2.0, frames) as usize).collect();
        self.camera()["clock"] = json!({key: places});
        format!("{places:?}")
    }

    /// A ball of the size of a tennis ball that falls so far that a slow camera sees its arcs.
    fn large_and_high(&mut self, dice: &mut Dice, rate_hz: f64) {
        let (radius_m, radius_px) = (dice.between(0.02, 0.035), dice.between(6.0, 10.0));
        let drop_m = if rate_hz > 40.0 {
            dice.between(0.4, 1.2)
        } else {
            dice.between(0.7, 1.5)
        };
        let (speed_m_s, e) = (dice.between(0.2, 0.7), dice.between(0.6, 0.9));
        let m_per_px = radius_m / radius_px;
        let fall_s = (2.0 * drop_m / 9.81).sqrt();
        let way_m = speed_m_s * fall_s * (1.0 + 2.0 * e + 2.0 * e * e) + 6.0 * radius_m;
        let even = |px: f64| (px / 2.0).floor() * 2.0;
        let (width, height) = (
            even((way_m / m_per_px).min(640.0)),
            even((drop_m + 5.5 * radius_m) / m_per_px),
        );
        let density_kg_m3 = 1150.0;
        let scene = &mut self.drawn.scene;
        scene["ball"]["radius_m"] = json!(radius_m);
        scene["ball"]["mass_kg"] = json!(density_kg_m3 * 4.19 * radius_m.powi(3));
        scene["contact"]["restitution"] = json!(e);
        scene["launch"] = json!({"drop_height_m": drop_m, "speed_m_s": speed_m_s, "spin_ratio": [0, 0, 0]});
        scene["stop"] = json!({"bounces": 3, "tail_s": 0.2});
        let camera = self.camera();
        camera["image_size_px"] = json!([width.max(160.0), height]);
        camera["origin_px"] = json!([3.0 * radius_px, height - 2.3 * radius_px]);
        camera["metres_per_pixel"] = json!(m_per_px);
        camera["exposure_s"] = json!(dice.one_of(&[0.0005, 0.001, 0.002]));
        camera["bump"] = json!(null);
    }

    /// A camera so near that perspective shows; in words.
    fn seen_from_near(&mut self, dice: &mut Dice) -> String {
        let (w, h) = (
            number(&self.camera()["image_size_px"][0]),
            number(&self.camera()["image_size_px"][1]),
        );
        if self.camera()["distance_m"].is_null() {
            let width_m = w.max(h) * number(&self.camera()["metres_per_pixel"]);
            let distance_m = dice.between(1.2, 4.0) * width_m;
            self.camera()["distance_m"] = json!(distance_m);
            self.drawn.scene["effects"]["perspective"] = json!("on");
            self.with_margin(0.08 * w, 0.12 * h);
            if dice.is(0.5) {
                self.untold.push("distance_m");
            }
        }
        let known = if self.untold.is_empty() { " known" } else { "" };
        format!("from {:.2} m{known}", number(&self.camera()["distance_m"]))
    }

    fn panned(&mut self, dice: &mut Dice) -> String {
        let way = dice.between(0.0, std::f64::consts::TAU);
        let speed_px_s = dice.one_of(&[0.0, 1.0, 1.0]) * dice.between(3.0, 60.0);
        let wander_px = if speed_px_s == 0.0 || dice.is(0.5) {
            dice.between(1.0, 5.0)
        } else {
            0.0
        };
        let margin_px = 1.2 * speed_px_s * self.duration_s() + 2.5 * wander_px;
        self.with_margin(way.cos().abs() * margin_px, way.sin().abs() * margin_px);
        self.camera()["pan"] = json!({"velocity_px_s": [speed_px_s * way.cos(), speed_px_s * way.sin()],
                                      "wander_px": wander_px});
        let texture_grey = dice.one_of(&[3, 5, 8]);
        let look = &mut self.drawn.scene["look"];
        look["texture_grey"] = json!(texture_grey);
        format!("{speed_px_s:.0} px/s, wander {wander_px:.1} px, texture {texture_grey}")
    }

    fn shadowed(&mut self, dice: &mut Dice) -> String {
        let radius_px =
            number(&self.drawn.scene["ball"]["radius_m"]) / number(&self.camera()["metres_per_pixel"]);
        let offset_px = [
            dice.one_of(&[-1.0, 1.0]) * dice.between(0.6, 3.0) * radius_px,
            dice.between(-1.0, 2.0) * radius_px,
        ];
        let (depth_grey, blur_px) = (dice.between(5.0, 40.0), dice.between(0.5, 4.0));
        let look = &mut self.drawn.scene["look"];
        let wall = dice.one_of(&[90, 110, 130]);
        look["background_grey"] = json!(wall);
        look["floor_grey"] = json!(wall - dice.one_of(&[0, 25]));
        look["wall_shadow"] = json!({"offset_px": offset_px, "depth_grey": depth_grey, "blur_px": blur_px});
        format!(
            "{depth_grey:.0} grey at {:.1}, {:.1} R, blur {blur_px:.1}",
            offset_px[0] / radius_px,
            offset_px[1] / radius_px
        )
    }

    fn joined(&mut self, dice: &mut Dice) -> String {
        let width_m = number(&self.camera()["image_size_px"][0]) * number(&self.camera()["metres_per_pixel"]);
        let duration_s = self.duration_s();
        let scene = &mut self.drawn.scene;
        let size = if dice.is(0.5) { 1.0 } else { dice.between(0.6, 1.6) };
        let start_s = dice.between(-0.5, 0.4) * duration_s;
        let x_m = dice.between(0.05, 0.8) * width_m;
        let speed_m_s =
            dice.one_of(&[-1.0, 1.0]) * dice.between(0.0, 1.2) * number(&scene["launch"]["speed_m_s"]);
        let drop_m = dice.between(0.6, 1.1) * number(&scene["launch"]["drop_height_m"]);
        scene["second_ball"] = json!({
            "start_s": start_s, "x_m": x_m, "drop_height_m": drop_m, "speed_m_s": speed_m_s,
            "radius_m": size * number(&scene["ball"]["radius_m"])
        });
        format!("of {size:.2} R at {start_s:.2} s, {x_m:.2} m, {speed_m_s:.2} m/s")
    }

    /// The calibration that the measurement is given.
    fn calibration(&self, recording: &SimulatedRecording) -> Value {
        let mut file = known(recording, self.drawn.up_given);
        let keys = file.as_object_mut().unwrap();
        for key in &self.untold {
            keys.remove(*key);
        }
        if let Some(readout_s) = self.readout_s {
            let mut with = file.clone();
            with["camera"] = json!({"readout_s": readout_s});
            // A program that does not know the key cannot be told.
            if Calibration::parse(&with.to_string(), "calib.json").is_ok() {
                return with;
            }
        }
        file
    }

    fn described(&self) -> String {
        format!("{}; {}", self.words.join(" + "), described(&self.drawn))
    }
}

/// What was made of a recording.
struct Made {
    tried: Tried,
    /// No bounce was where its first is.
    is_invented: bool,
}

/// What became of the recording of `seed`, or why it was not measured.
fn try_one(seed: u64) -> Result<Made, String> {
    let wild = wild(seed);
    let kept = std::env::var_os("TRACK_WILD_KEEP");
    let temporary = tempfile::tempdir().unwrap();
    let dir = kept.as_ref().map_or(temporary.path(), Path::new);
    let stem = format!("wild{seed}");
    let recording = SimulatedRecording::new(&Scene::from_json(&wild.drawn.scene.to_string()).unwrap());
    let recording = recording.unwrap_or_else(|e| panic!("{seed}: {e}"));
    let written = write(&recording, &stem, dir, |_| {}).unwrap();
    let calibration = wild.calibration(&recording).to_string();
    if kept.is_some() {
        std::fs::write(&written.calib, &calibration).unwrap();
        std::fs::write(
            dir.join(format!("{stem}.scene.json")),
            wild.drawn.scene.to_string(),
        )
        .unwrap();
    }
    let calibration = Calibration::parse(&calibration, "calib.json").unwrap();
    let m = measure(
        &written.video,
        &calibration,
        "calib.json",
        Accuracy::Standard,
        &mut |_| {},
    );
    let m = m.map_err(|e| format!("error: {e}"))?;
    if let Outcome::Rejected { reason, .. } = &m.outcome {
        return Err(reason.to_string());
    }
    let truth = recording.truth();
    let interval_s = 1.0 / recording.scene().camera.frame_rate_hz;
    judged(&m, &truth, interval_s).ok_or_else(|| "no bounce".to_owned())
}

/// The measurement against the ball that it followed.
fn judged(m: &Measurement, truth: &Truth, interval_s: f64) -> Option<Made> {
    let other = truth
        .second_ball
        .as_ref()
        .filter(|other| off_px(m, &other.centres) < off_px(m, &truth.centres));
    let (bounces, x0_m, x_m): (&[BounceTruth], _, _) = match other {
        // Nothing is known of what was before its first impact.
        Some(other) => (&other.bounces, None, None),
        None => (&truth.bounces, truth.x0_m, truth.x_m),
    };
    let found_s = m.bounces.first()?.time_s?;
    // Which bounce it is a clock that lost some frames before it tells as well: bounces are further apart. How far off the time is counts all the same.
    let between = bounces.windows(2).map(|w| w[1].time_s - w[0].time_s);
    let near_s = (1.5 * interval_s + 5.0 * found_s.std_uncertainty.unwrap_or(0.0))
        .max(SAME_BOUNCE * between.fold(f64::INFINITY, f64::min).min(LONG_FLIGHT_S));
    let off_s = |b: &BounceTruth| (b.time_s - found_s.value).abs();
    let nearest = (0..bounces.len()).min_by(|&a, &b| off_s(&bounces[a]).total_cmp(&off_s(&bounces[b])));
    let seen = nearest.filter(|&k| off_s(&bounces[k]) < near_s);
    let k = seen.unwrap_or(0);
    let mut m = m.clone();
    if other.is_some() {
        // The calibration speaks of the first ball: its origin, its launch's spin. Of another, which may go the other way, the sizes are compared.
        m.distances.x0_m = None;
        for b in &mut m.bounces {
            (b.x_m, b.tangential_restitution, b.spin_out_m_s) = (None, None, None);
        }
    }
    // A measured place is one along the ball's own plane.
    let along = |b: &BounceTruth| BounceTruth {
        x_m: b.x_m.hypot(b.y_m).copysign(b.x_m),
        ..*b
    };
    let bounces: Vec<BounceTruth> = bounces.iter().map(along).collect();
    let next = bounces.get(k + 1);
    let goes_left = next.is_some_and(|next| other.is_some() && next.x_m < bounces[k].x_m);
    if let Some(x_m) = m.distances.x_m.filter(|_| goes_left) {
        m.distances.x_m = Some(x_m.scaled(-1.0));
    }
    let m = &m;
    let between = next.map(|next| next.x_m - bounces[k].x_m);
    let truth_of_first = TruthOfFirst {
        bounce: bounces.get(k)?,
        next,
        x0_m,
        x_m: if k == 0 { x_m.or(between) } else { between },
    };
    Some(Made {
        tried: Tried {
            errors: compared(m, &truth_of_first)?,
            warnings: m.warnings.iter().map(|w| w.code).collect(),
            is_another: k > 0,
        },
        is_invented: seen.is_none(),
    })
}

/// How far the points used are from a ball's true centres, px: the median.
fn off_px(m: &Measurement, centres: &[CentreTruth]) -> f64 {
    let by_frame: BTreeMap<usize, &CentreTruth> = centres
        .iter()
        .filter_map(|c| Some((c.stored_frame?, c)))
        .collect();
    let off = |p: &TrackPoint| {
        let c = by_frame.get(&p.frame)?;
        Some((p.pixel.u_px - c.u_px).hypot(p.pixel.v_px - c.v_px))
    };
    let mut off: Vec<f64> = m
        .track
        .points
        .iter()
        .filter(|p| matches!(p.use_, PointUse::Used(_)))
        .filter_map(off)
        .collect();
    off.sort_by(f64::total_cmp);
    off.get(off.len() / 2).copied().unwrap_or(f64::INFINITY)
}

/// What became of the recordings of a kind.
#[derive(Default)]
struct Row {
    recordings: usize,
    refused: usize,
    invented: usize,
    numbers: usize,
    far_out: usize,
    silent: usize,
    /// Far out, and no warning speaks of any of the wild things that the recording has.
    untold: usize,
    /// Within their intervals of 95 %.
    inside: usize,
}

/// The numbers of a recording that are far out, and whether a warning names a cause.
fn far_out(made: &Made) -> (Vec<String>, bool) {
    let off = QUANTITIES.iter().zip(made.tried.errors);
    let off = off.filter_map(|((name, _), error)| {
        let (error, std) = error.filter(|(error, std)| !(error.abs() <= FAR_OUT * std))?;
        Some(format!("{name} {error:.2e} ({:.1} σ)", error / std))
    });
    let said = |w: &&str| CAUSES.contains(w) || WILD_CAUSES.contains(w);
    (off.collect(), made.tried.warnings.iter().any(said))
}

/// Every error over its standard uncertainty, as CSV.
fn pulls_of(measured: &[(u64, Tried)]) -> String {
    let names: Vec<&str> = QUANTITIES.iter().map(|(name, _)| *name).collect();
    let mut csv = format!("seed,kinds,{},warnings,what\n", names.join(","));
    for (seed, tried) in measured {
        let kinds: Vec<&str> = wild(*seed).kinds.iter().map(|k| k.name()).collect();
        let pulls = tried.errors.iter().map(|error| match error {
            Some((error, std)) => format!("{:.3}", error / std),
            None => String::new(),
        });
        let pulls: Vec<String> = pulls.collect();
        csv += &format!(
            "{seed},{},{},{},\"{}\"\n",
            kinds.join(" "),
            pulls.join(","),
            tried.warnings.join(" "),
            wild(*seed).described()
        );
    }
    csv
}

fn print_kinds(rows: &BTreeMap<String, Row>) {
    println!(
        "\n| kind | recordings | refused | first bounce where none was | numbers | in 95 % | beyond {FAR_OUT} std | of those silently \
         | of those not told what it has |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, row) in rows {
        println!(
            "| {name} | {} | {} | {} | {} | {:.1} % | {} | {} | {} |",
            row.recordings,
            row.refused,
            row.invented,
            row.numbers,
            100.0 * row.inside as f64 / row.numbers.max(1) as f64,
            row.far_out,
            row.silent,
            row.untold
        );
    }
}

/// How often a warning speaks of what a recording has not.
fn print_false_alarms(measured: &[(u64, Tried)]) {
    println!("\n| warned of | of recordings without that | which |\n|---|---|---|");
    let mut told: Vec<&str> = Kind::ALL.iter().flat_map(|k| k.told_by()).copied().collect();
    told.sort_unstable();
    told.dedup();
    for code in told {
        let has = |seed: u64| wild(seed).kinds.iter().any(|k| k.told_by().contains(&code));
        let without: Vec<&(u64, Tried)> = measured.iter().filter(|(seed, _)| !has(*seed)).collect();
        let warned = without.iter().filter(|(_, tried)| tried.warnings.contains(&code));
        let seeds: Vec<String> = warned.map(|(seed, _)| seed.to_string()).collect();
        println!(
            "| {code} | {} of {} | {} |",
            seeds.len(),
            without.len(),
            seeds.join(" ")
        );
    }
}

/// All that is compared of one recording.
fn print_one(seed: u64, made: &Result<Made, String>) {
    println!("{seed}: {}", wild(seed).described());
    match made {
        Err(why) => println!("refused: {why}"),
        Ok(made) => {
            for ((name, _), error) in QUANTITIES.iter().zip(made.tried.errors) {
                match error {
                    Some((error, std)) => println!("  {name}: off by {error:.3e}, {:.2} σ", error / std),
                    None => println!("  {name}: not compared"),
                }
            }
            println!(
                "  warnings: {}{}{}",
                made.tried.warnings.join(", "),
                if made.is_invented {
                    "; its first bounce is where none was"
                } else {
                    ""
                },
                if made.tried.is_another {
                    "; its first bounce is not the first that was"
                } else {
                    ""
                }
            );
        }
    }
}

#[test]
fn no_number_is_wrong_in_silence() {
    let of = |name: &str| std::env::var(name).ok();
    if let Some(seed) = of("TRACK_WILD_SEED").and_then(|s| s.parse().ok()) {
        print_one(seed, &try_one(seed));
        return;
    }
    let recordings = of("TRACK_WILD")
        .and_then(|n| n.parse().ok())
        .unwrap_or(RECORDINGS);
    let kind = of("TRACK_WILD_KIND");
    let is_asked = |seed: &u64| {
        let has = |name: &String| wild(*seed).kinds.iter().any(|k| k.name() == name);
        kind.as_ref().is_none_or(has)
    };
    let seeds: Vec<u64> = (FIRST_SEED..FIRST_SEED + 100_000)
        .filter(is_asked)
        .take(recordings)
        .collect();
    let made: Vec<_> = seeds.par_iter().map(|&seed| (seed, try_one(seed))).collect();
    let mut rows: BTreeMap<String, Row> = BTreeMap::new();
    let mut worst: Vec<(Vec<Kind>, u64, u64, bool, String)> = Vec::new();
    let mut measured = Vec::new();
    let mut all = Row::default();
    let mut refused = Vec::new();
    for (seed, made) in made {
        let wild = wild(seed);
        let names = wild.kinds.iter().map(|k| k.name().to_owned());
        let alone = (wild.kinds.len() == 1).then(|| format!("{} alone", wild.kinds[0].name()));
        let mut count = |add: &dyn Fn(&mut Row)| {
            for name in names.clone().chain(alone.clone()) {
                add(rows.entry(name).or_default());
            }
            add(&mut all);
        };
        count(&|row| row.recordings += 1);
        match made {
            Err(why) => {
                count(&|row| row.refused += 1);
                refused.push(format!("* {seed}: {}: {why}", wild.described()));
            }
            Ok(made) => {
                let (off, said) = far_out(&made);
                let numbers = made.tried.errors.iter().flatten().count();
                let told_by = |w: &&str| wild.kinds.iter().any(|k| k.told_by().contains(w));
                let told = made.tried.warnings.iter().any(told_by);
                let pulls = made.tried.errors.iter().flatten();
                let inside = pulls
                    .clone()
                    .filter(|(e, std)| e.abs() <= WITHIN_95 * std)
                    .count();
                let largest = pulls.map(|(e, std)| (e / std).abs()).fold(0.0, f64::max);
                count(&|row| {
                    row.numbers += numbers;
                    row.inside += inside;
                    row.invented += usize::from(made.is_invented);
                    row.far_out += off.len();
                    row.silent += if said { 0 } else { off.len() };
                    row.untold += if told { 0 } else { off.len() };
                });
                if !off.is_empty() {
                    let never = if made.is_invented {
                        " (its first bounce is where none was)"
                    } else {
                        ""
                    };
                    let warned = made.tried.warnings.join(", ");
                    let words = wild.described();
                    // Of each kind the worst first.
                    worst.push((
                        wild.kinds.clone(),
                        u64::MAX - (10.0 * largest) as u64,
                        seed,
                        said,
                        format!("{}{never}; {words}; warned of {warned}", off.join(", ")),
                    ));
                }
                measured.push((seed, made.tried));
            }
        }
    }
    if let Some(path) = std::env::var_os("TRACK_WILD_TABLE") {
        std::fs::write(path, pulls_of(&measured)).unwrap();
    }
    print_table("All", &measured);
    print_kinds(&rows);
    print_false_alarms(&measured);
    worst.sort();
    for (said, title) in [
        (false, "Far out in silence"),
        (true, "Far out under a warning that names a cause"),
    ] {
        println!("\n{title}:\n");
        for (_, _, seed, _, what) in worst.iter().filter(|w| w.3 == said) {
            println!("* {seed}: {what}");
        }
    }
    println!("\nRefused:\n\n{}", refused.join("\n"));
    let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    println!(
        "\nRefused {} of {} ({:.1} %); {} of {} numbers beyond {FAR_OUT} std ({:.2} %), {} of them without a warning that names a \
         cause ({:.2} %), {} without one that speaks of what the recording has; {} recordings with a first bounce where none was",
        all.refused,
        all.recordings,
        share(all.refused, all.recordings),
        all.far_out,
        all.numbers,
        share(all.far_out, all.numbers),
        all.silent,
        share(all.silent, all.numbers),
        all.untold,
        all.invented
    );
    if recordings >= RECORDINGS && kind.is_none() {
        let (refused, silent) = (all.refused as f64, all.silent as f64);
        assert!(refused <= MOST_REFUSED * all.recordings as f64);
        assert!(silent <= MOST_SILENT * all.numbers as f64);
        let faults = faults_of(&measured);
        assert!(faults.is_empty(), "{faults:?}");
    }
}
