//! Whole recordings: accuracy level × frame rate × picture size × exposure, against the time, the light and the storage
//! that they take.
//!
//! Each setting is measured on several recordings that differ in all that a user does not choose: height, speed,
//! restitution, friction, sub-pixel place, noise. Scale and origin are those of the truth, so that these are errors of the
//! measurement and not of a ruler.
//!
//! # Picture size
//!
//! A half (quarter) picture holds the same scene: each of its pixels is the mean of 2 × 2 (4 × 4), so that the ball has
//! half (a quarter) of the radius, and blur and noise are less by the same factor.
//!
//! # Light
//!
//! The illuminance that a recording needs for the same grey levels, by the incident-light equation of ISO 2720,
//! E = C N² / (t S) with C = 250 lx s: at f/2 and ISO 800, 1.25 lx s over the exposure.

use super::recommendation::Requirement;
use super::recording_metrics::{DECODING, LIGHT, QUANTITIES, SECONDS, STORAGE};
use super::rendering::{Rendered, decode, folder, render};
use super::stats::{ErrorStatistics, Quartiles};
use super::study::{CostError, Diagram, Metric, Run, SettingCurve, Stopwatch, Subject};
use crate::detect::centre::Accuracy;
use crate::pipeline::{Measurement, Outcome, PointUse, measure};
use crate::simulate::Scene;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use schemars::JsonSchema;
use serde::Serialize;

/// C N² / S at f/2 and ISO 800, lx s.
const LIGHT_LX_S: f64 = 250.0 * 4.0 / 800.0;

/// The full picture.
const FULL_PX: [usize; 2] = [1280, 720];

/// A recording whose first impact is found further off than this was measured at another one, s.
const SAME_IMPACT_S: f64 = 0.02;

/// Recordings for checking a recommendation begin here, far from those it was made of.
const NEW_SEEDS: u64 = 1_000_000;

/// What a user chooses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordingSetting {
    /// How centres are found.
    pub accuracy: Accuracy,
    /// Frames a second.
    pub frame_rate_hz: f64,
    /// How many pixels of the full picture make one, along each side.
    pub reduction: usize,
    /// Of a frame, s.
    pub exposure_s: f64,
}

impl RecordingSetting {
    /// What the program and its scenes take by themselves.
    pub const DEFAULT: Self = Self {
        accuracy: Accuracy::Standard,
        frame_rate_hz: 240.0,
        reduction: 1,
        exposure_s: 0.0005,
    };

    /// Size of the picture in a word.
    #[must_use]
    pub fn picture(&self) -> &'static str {
        picture_name(self.reduction)
    }

    fn named(&self) -> Vec<(&'static str, String)> {
        vec![
            ("accuracy", self.accuracy.to_string()),
            ("frame_rate_hz", self.frame_rate_hz.to_string()),
            ("picture", self.picture().to_owned()),
            ("exposure_s", self.exposure_s.to_string()),
        ]
    }

    /// The same camera with another accuracy.
    fn with(self, accuracy: Accuracy) -> Self {
        Self { accuracy, ..self }
    }
}

/// Size of a picture in a word, by how many pixels of the full one make one of its own.
fn picture_name(reduction: usize) -> &'static str {
    match reduction {
        1 => "full",
        2 => "half",
        _ => "quarter",
    }
}

/// What is run.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingPlan {
    /// Levels of accuracy.
    pub accuracies: Vec<Accuracy>,
    /// Frames a second.
    pub frame_rates_hz: Vec<f64>,
    /// Pixels of the full picture that make one, along each side: 1, 2 or 4.
    pub reductions: Vec<usize>,
    /// Exposures, s; those longer than a frame's time are left out.
    pub exposures_s: Vec<f64>,
    /// Recordings of each setting.
    pub recordings: u64,
}

impl RecordingPlan {
    /// Minutes.
    #[must_use]
    pub fn full() -> Self {
        Self {
            accuracies: Accuracy::ALL.to_vec(),
            frame_rates_hz: vec![30.0, 60.0, 120.0, 240.0, 480.0, 960.0],
            reductions: vec![1, 2, 4],
            exposures_s: vec![0.0001, 0.0005, 0.0025],
            recordings: 4,
        }
    }

    /// Seconds.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            frame_rates_hz: vec![60.0, 240.0],
            reductions: vec![1, 2],
            exposures_s: vec![0.0005],
            recordings: 3,
            ..Self::full()
        }
    }

    /// The cameras, in an order of their own; the accuracies come on top.
    fn cameras(&self) -> Vec<RecordingSetting> {
        let mut cameras = Vec::new();
        for &exposure_s in &self.exposures_s {
            for &reduction in &self.reductions {
                for &frame_rate_hz in &self.frame_rates_hz {
                    if exposure_s * frame_rate_hz <= 1.0 {
                        cameras.push(RecordingSetting {
                            accuracy: Accuracy::Standard,
                            frame_rate_hz,
                            reduction,
                            exposure_s,
                        });
                    }
                }
            }
        }
        cameras
    }

    /// Work of one recording, rendering included: a full picture at 240 Hz is 40 passes over a small one.
    pub(super) fn units(&self) -> f64 {
        let each: f64 = self.cameras().iter().map(cost).sum();
        each * self.recordings as f64 * (2 + self.accuracies.len()) as f64
    }
}

/// Of one pass over a recording of the camera, in the units of [`super::centres`].
fn cost(camera: &RecordingSetting) -> f64 {
    let pixels = 1.0 / (camera.reduction * camera.reduction) as f64;
    (0.1 + 0.9 * pixels) * (1.0 + 6.0 * camera.frame_rate_hz / 240.0)
}

/// A scene with all that a user does not choose drawn from `seed`, seen by the camera of `setting`.
///
/// # Errors
/// None for the settings of a [`RecordingPlan`]; see [`crate::simulate::SceneError`].
pub fn scene(setting: &RecordingSetting, seed: u64) -> Result<Scene, CostError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * (random.next_u64() as f64 / u64::MAX as f64);
    let (drop_m, speed_m_s) = (between(0.08, 0.14), between(0.7, 1.2));
    // So little friction that the ball slides in every one of them, and so tells it.
    let (restitution, friction) = (between(0.70, 0.90), between(0.03, 0.06));
    let (u, v) = (between(119.0, 121.0), between(659.0, 661.0));
    let k = setting.reduction as f64;
    // The pixel with number n of a reduced picture covers those from k n on.
    let reduced = |px: f64| (px + 0.5) / k - 0.5;
    let [width, height] = FULL_PX.map(|n| n / setting.reduction);
    Ok(Scene::from_json(&format!(
        r#"{{"schema": "track.scene/1", "seed": {seed}, "ball": {{"radius_m": 0.0125, "mass_kg": 0.0639}},
            "contact": {{"model": "mu_e", "restitution": {restitution}, "friction": {friction}}},
            "launch": {{"drop_height_m": {drop_m}, "speed_m_s": {speed_m_s}}},
            "camera": {{"image_size_px": [{width}, {height}], "frame_rate_hz": {}, "exposure_s": {},
                "metres_per_pixel": {}, "origin_px": [{}, {}], "blur_px": {}, "noise_grey": {}}},
            "stop": {{"bounces": 2, "tail_s": 0.1}}}}"#,
        setting.frame_rate_hz,
        setting.exposure_s,
        0.0008 * k,
        reduced(u),
        reduced(v),
        0.7 / k,
        2.0 / k
    ))?)
}

/// A recording measured once.
struct MeasuredRecording {
    seconds: f64,
    decode_s: f64,
    megabytes: f64,
    frames: f64,
    centres: f64,
    /// In the order of [`QUANTITIES`].
    errors: [Option<f64>; 6],
    failed: Option<String>,
}

/// Measures a recording and compares it with its truth.
fn try_one(
    accuracy: Accuracy,
    recording: &Rendered,
    decode_s: f64,
    stopwatch: &Stopwatch<'_>,
) -> MeasuredRecording {
    let (measured, seconds) = stopwatch.timed(|| {
        measure(
            &recording.video,
            &recording.calibration,
            "truth",
            accuracy,
            &mut |_| {},
        )
    });
    let (errors, centres, failed) = match &measured {
        Err(e) => ([None; 6], 0, Some(e.to_string())),
        Ok(m) => {
            let used = m
                .track
                .points
                .iter()
                .filter(|p| matches!(p.use_, PointUse::Used(_)));
            let (errors, failed) = match compare(m, recording) {
                Ok(errors) => (errors, missing(&errors)),
                Err(reason) => ([None; 6], Some(reason)),
            };
            (errors, used.count(), failed)
        }
    };
    MeasuredRecording {
        seconds,
        decode_s,
        megabytes: recording.bytes as f64 / 1e6,
        frames: recording.frames as f64,
        centres: centres as f64,
        errors,
        failed,
    }
}

/// Which quantities were not measured.
fn missing(errors: &[Option<f64>; 6]) -> Option<String> {
    let names: Vec<&str> = QUANTITIES
        .iter()
        .zip(errors)
        .filter(|(_, e)| e.is_none())
        .map(|(q, _)| q.name)
        .collect();
    (!names.is_empty()).then(|| format!("not measured: {}", names.join(", ")))
}

/// Measured − true.
fn compare(m: &Measurement, recording: &Rendered) -> Result<[Option<f64>; 6], String> {
    if let Outcome::Rejected { reason } = &m.outcome {
        return Err(format!("rejected: {reason}"));
    }
    let truth = recording
        .truth
        .bounces
        .first()
        .ok_or("the truth holds no bounce")?;
    let bounce = m
        .bounces
        .iter()
        .find(|b| {
            b.time_s
                .is_some_and(|t| (t.value - truth.arcs_meet_s).abs() < SAME_IMPACT_S)
        })
        .ok_or("the first impact was not found")?;
    let minus = |found: Option<crate::quantity::Quantity>, truth: Option<f64>| Some(found?.value - truth?);
    let degrees = |q: Option<crate::quantity::Quantity>| q.map(|q| q.scaled(1_f64.to_degrees()));
    Ok([
        minus(bounce.restitution, truth.restitution),
        minus(bounce.friction, truth.friction),
        minus(degrees(bounce.incident.angle_rad), Some(truth.incident.angle_deg)),
        minus(degrees(bounce.rebound.angle_rad), Some(truth.rebound.angle_deg)),
        minus(m.distances.x0_m, recording.truth.x0_m),
        minus(m.distances.x_m, recording.truth.x_m),
    ])
}

/// All recordings of a setting in one run.
fn summed(setting: &RecordingSetting, trials: &[MeasuredRecording]) -> Run {
    let errors = QUANTITIES.iter().enumerate().filter_map(|(i, q)| {
        let of: Vec<f64> = trials.iter().filter_map(|t| t.errors[i]).collect();
        Some((q.name, ErrorStatistics::of(&of)?))
    });
    let spread =
        |of: fn(&MeasuredRecording) -> f64| Quartiles::of(&trials.iter().map(of).collect::<Vec<_>>());
    let work = [
        (SECONDS.name, spread(|t| t.seconds)),
        (DECODING.name, spread(|t| t.decode_s)),
        (
            LIGHT.name,
            Some(Quartiles::exact(LIGHT_LX_S / setting.exposure_s)),
        ),
        (STORAGE.name, spread(|t| t.megabytes)),
    ];
    let mean =
        |of: fn(&MeasuredRecording) -> f64| trials.iter().map(of).sum::<f64>() / trials.len().max(1) as f64;
    let failures: Vec<&str> = trials.iter().filter_map(|t| t.failed.as_deref()).collect();
    Run {
        settings: setting.named(),
        errors: errors.collect(),
        work: work.into_iter().filter_map(|(n, w)| Some((n, w?))).collect(),
        counts: vec![
            ("recordings", trials.len() as f64),
            ("frames", mean(|t| t.frames)),
            ("centres", mean(|t| t.centres)),
        ],
        failed: failures.first().map(|first| {
            format!(
                "{} of {} recordings, the first: {first}",
                failures.len(),
                trials.len()
            )
        }),
        is_default: *setting == RecordingSetting::DEFAULT,
    }
}

/// Renders and measures `seeds` with the camera of `camera` at each accuracy: the trials by accuracy.
fn measure_all(
    camera: &RecordingSetting,
    accuracies: &[Accuracy],
    seeds: impl Iterator<Item = u64>,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Vec<Vec<MeasuredRecording>>, CostError> {
    let dir = folder()?;
    let scenes = seeds
        .map(|seed| scene(camera, seed))
        .collect::<Result<Vec<_>, _>>()?;
    let recordings = render(&scenes, dir.path())?;
    stopwatch.advance(2.0 * cost(camera) * scenes.len() as f64);
    let mut trials: Vec<Vec<MeasuredRecording>> = accuracies.iter().map(|_| Vec::new()).collect();
    for recording in &recordings {
        let (decoded, decode_s) = stopwatch.timed(|| decode(&recording.video));
        decoded?;
        for (accuracy, trials) in accuracies.iter().zip(&mut trials) {
            trials.push(try_one(*accuracy, recording, decode_s, stopwatch));
            stopwatch.advance(cost(camera));
        }
    }
    Ok(trials)
}

/// Runs `plan`; the settings are those of the section's runs.
///
/// # Errors
/// See [`CostError`].
pub fn run(
    plan: &RecordingPlan,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<(Subject, Vec<RecordingSetting>), CostError> {
    stopwatch.start("whole recordings");
    let (mut runs, mut settings) = (Vec::new(), Vec::new());
    for camera in plan.cameras() {
        let trials = measure_all(&camera, &plan.accuracies, 1..=plan.recordings, stopwatch)?;
        for (accuracy, trials) in plan.accuracies.iter().zip(&trials) {
            let setting = camera.with(*accuracy);
            runs.push(summed(&setting, trials));
            settings.push(setting);
        }
    }
    let section = Subject {
        name: "whole",
        title: "Whole recordings",
        words: vec![
            format!(
                "{} recordings of each setting, which differ in height, speed, restitution, friction, sub-pixel place and \
                 noise: {} × {} in full, 0.8 mm a pixel, a shaded ball of radius 15.6 px, noise of 2 grey, H.264 at crf 14, \
                 two bounces. A half or quarter picture holds the same scene, its pixels the means of 2 × 2 or 4 × 4. \
                 Errors are those of the first bounce and of the distances; scale and origin are the true ones.",
                plan.recordings, FULL_PX[0], FULL_PX[1]
            ),
            "Light is what the exposure needs for the same grey levels at f/2 and ISO 800, E = C N² / (t S) with C = 250 lx s \
             (ISO 2720). Time is that of a whole measurement, decoding included; error bars are quartiles over the \
             recordings. A cross at the upper edge is a setting at which some recording could not be measured."
                .to_owned(),
        ],
        errors: QUANTITIES.to_vec(),
        works: vec![SECONDS, DECODING, LIGHT, STORAGE],
        diagrams: diagrams(plan, &settings),
        runs,
    };
    Ok((section, settings))
}

/// For each quantity: against time, light and storage.
fn diagrams(plan: &RecordingPlan, settings: &[RecordingSetting]) -> Vec<Diagram> {
    let exposure_s = middle(&plan.exposures_s, RecordingSetting::DEFAULT.exposure_s);
    // The largest picture there is.
    let largest = plan.reductions.iter().copied().min().unwrap_or(1);
    let rates: Vec<String> = plan.frame_rates_hz.iter().map(f64::to_string).collect();
    let rates = rates.join(", ");
    let kinds = [
        (
            SECONDS,
            format!(
                "against time; exposure {}, along a curve {rates} Hz",
                milliseconds(exposure_s)
            ),
            curves_against_time(plan, settings, exposure_s),
        ),
        (
            LIGHT,
            format!(
                "against light; standard, {} picture, along a curve the exposure",
                picture_name(largest)
            ),
            curves_against_light(plan, settings, largest),
        ),
        (
            STORAGE,
            format!("against storage; standard, along a curve {rates} Hz"),
            curves_against_storage(plan, settings),
        ),
    ];
    let of_quantity = |error: Metric| {
        kinds.iter().map(move |(work, how, curves)| Diagram {
            title: format!("{} {how}", error.name),
            error,
            work: *work,
            floors: Vec::new(),
            curves: curves.clone(),
            alternatives: true,
            overview: error == QUANTITIES[0] && *work != STORAGE,
        })
    };
    QUANTITIES.into_iter().flat_map(of_quantity).collect()
}

/// A curve a picture size and accuracy, along which the frame rate grows.
fn curves_against_time(
    plan: &RecordingPlan,
    settings: &[RecordingSetting],
    exposure_s: f64,
) -> Vec<SettingCurve> {
    let each = plan.reductions.iter().flat_map(|&reduction| {
        plan.accuracies.iter().map(move |&accuracy| {
            let name = format!("{}, {}", picture_name(reduction), accuracy);
            curve(name, settings, |s| {
                s.accuracy == accuracy && s.reduction == reduction && s.exposure_s == exposure_s
            })
        })
    });
    each.flatten().collect()
}

/// A curve a frame rate, along which the exposure grows.
fn curves_against_light(
    plan: &RecordingPlan,
    settings: &[RecordingSetting],
    reduction: usize,
) -> Vec<SettingCurve> {
    let each = plan.frame_rates_hz.iter().map(|&rate| {
        curve(format!("{rate} Hz"), settings, |s| {
            s.accuracy == Accuracy::Standard && s.reduction == reduction && s.frame_rate_hz == rate
        })
    });
    each.flatten().collect()
}

/// A curve an exposure and picture size, along which the frame rate grows.
fn curves_against_storage(plan: &RecordingPlan, settings: &[RecordingSetting]) -> Vec<SettingCurve> {
    let each = plan.exposures_s.iter().flat_map(|&exposure_s| {
        plan.reductions.iter().map(move |&reduction| {
            let name = format!("{}, {}", picture_name(reduction), milliseconds(exposure_s));
            curve(name, settings, |s| {
                s.accuracy == Accuracy::Standard && s.reduction == reduction && s.exposure_s == exposure_s
            })
        })
    });
    each.flatten().collect()
}

/// The settings that `belongs` holds of; `None` without any.
fn curve(
    name: String,
    settings: &[RecordingSetting],
    belongs: impl Fn(&RecordingSetting) -> bool,
) -> Option<SettingCurve> {
    let runs: Vec<usize> = (0..settings.len()).filter(|&i| belongs(&settings[i])).collect();
    (!runs.is_empty()).then_some(SettingCurve { name, runs })
}

fn milliseconds(seconds: f64) -> String {
    format!("{} ms", (1e4 * seconds).round() / 10.0)
}

/// `wanted` where it is among `values`, or the first of them.
fn middle(values: &[f64], wanted: f64) -> f64 {
    if values.contains(&wanted) {
        wanted
    } else {
        values.first().copied().unwrap_or(wanted)
    }
}

/// How a setting did on recordings that it was not chosen by.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Check {
    /// Recordings.
    pub recordings: usize,
    /// Those with every wanted error within what was wanted.
    pub inside: usize,
    /// Why the first of the others was not.
    pub first_miss: Option<String>,
}

/// Candidates for a recommendation are tried on recordings that begin here.
const TRIAL_SEEDS: u64 = 500_000;

/// And on so many: what holds on all of them fails on more than one in twenty only with a luck of one in five.
const TRIALS: u64 = 30;

/// Why `setting` does not reach all of `requirements` on every one of some new recordings; `None` if it does.
///
/// # Errors
/// See [`CostError`].
pub fn refusal(
    setting: &RecordingSetting,
    requirements: &[Requirement],
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Option<String>, CostError> {
    /// Rendered at a time: the first miss ends it.
    const AT_ONCE: u64 = 6;
    stopwatch.start_more("trying the recommendation", cost(setting) * TRIALS as f64 * 3.0);
    for first in (0..TRIALS).step_by(AT_ONCE as usize) {
        let seeds = (first..first + AT_ONCE).map(|i| TRIAL_SEEDS + i);
        let trials = measure_all(setting, &[setting.accuracy], seeds, stopwatch)?;
        if let Some(why) = trials
            .iter()
            .flatten()
            .find_map(|trial| miss(trial, requirements))
        {
            return Ok(Some(why));
        }
    }
    Ok(None)
}

/// Measures `recordings` new ones at `setting` and counts how many reach all of `requirements`.
///
/// # Errors
/// See [`CostError`].
pub fn check(
    setting: &RecordingSetting,
    requirements: &[Requirement],
    recordings: u64,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Check, CostError> {
    /// Rendered at a time: what a temporary folder has to hold.
    const AT_ONCE: u64 = 8;
    stopwatch.restart(
        "checking the recommendation",
        cost(setting) * recordings as f64 * 3.0,
    );
    let (mut inside, mut first_miss) = (0, None);
    for first in (0..recordings).step_by(AT_ONCE as usize) {
        let seeds = (first..(first + AT_ONCE).min(recordings)).map(|i| NEW_SEEDS + i);
        for trial in measure_all(setting, &[setting.accuracy], seeds, stopwatch)?
            .into_iter()
            .flatten()
        {
            match miss(&trial, requirements) {
                None => inside += 1,
                Some(why) => {
                    first_miss.get_or_insert(why);
                }
            }
        }
    }
    Ok(Check {
        // It came from a count of scenes that were all rendered.
        recordings: recordings as usize,
        inside,
        first_miss,
    })
}

/// Why a trial does not reach what was wanted.
fn miss(trial: &MeasuredRecording, requirements: &[Requirement]) -> Option<String> {
    requirements.iter().find_map(|want| {
        let i = QUANTITIES.iter().position(|q| *q == want.quantity)?;
        match trial.errors[i] {
            None => Some(trial.failed.clone().unwrap_or_default()),
            Some(e) if e.abs() > want.at_most => Some(format!("{} off by {e:.2e}", want.quantity.name)),
            Some(_) => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_longer_than_a_frame_is_left_out() {
        let cameras = RecordingPlan::full().cameras();
        assert!(cameras.iter().all(|c| c.exposure_s * c.frame_rate_hz <= 1.0));
        assert!(cameras.contains(&RecordingSetting::DEFAULT));
        // 6 rates with two exposures, 4 with the longest, at three sizes.
        assert_eq!(cameras.len(), (6 + 6 + 4) * 3);
    }

    #[test]
    fn scenes_differ_by_seed_and_are_the_same_at_every_size() {
        let full = RecordingSetting::DEFAULT;
        let half = RecordingSetting { reduction: 2, ..full };
        let (a, b, c) = (
            scene(&full, 1).unwrap(),
            scene(&full, 2).unwrap(),
            scene(&half, 1).unwrap(),
        );
        assert_ne!(a.launch, b.launch);
        assert_eq!((a.launch, a.contact), (c.launch, c.contact));
        // The launch edge is the same place of the picture: edges of pixels are at half numbers.
        for i in 0..2 {
            assert!(((a.camera.origin_px[i] + 0.5) / 2.0 - (c.camera.origin_px[i] + 0.5)).abs() < 1e-12);
        }
        assert_eq!((c.camera.width_px, c.camera.height_px), (640, 360));
    }

    #[test]
    fn every_run_of_a_plan_is_in_a_diagram_of_each_kind_or_in_the_table_only() {
        let plan = RecordingPlan::full();
        let settings: Vec<RecordingSetting> = plan
            .cameras()
            .into_iter()
            .flat_map(|c| plan.accuracies.iter().map(move |a| c.with(*a)))
            .collect();
        let diagrams = diagrams(&plan, &settings);
        assert_eq!(diagrams.len(), 18);
        let default = settings
            .iter()
            .position(|s| *s == RecordingSetting::DEFAULT)
            .unwrap();
        for d in &diagrams {
            let holds = |curve: &SettingCurve| curve.runs.contains(&default);
            assert_eq!(d.curves.iter().filter(|c| holds(c)).count(), 1, "{}", d.title);
            assert!(d.curves.iter().all(|c| !c.runs.is_empty()));
        }
    }
}
