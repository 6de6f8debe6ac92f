//! Whole recordings: accuracy level, frame rate, picture size, exposure and codec quality, against the time, the light and the
//! storage that they take; and what today's tools reach on the same recordings ([`super::todays_tools`]).
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

use super::centres::ComparedMethod;
use super::recommendation::Requirement;
use super::recording_diagrams::diagrams;
use super::recording_metrics::{CRF, DECODING, LIGHT, PICTURE, QUANTITIES, SECONDS, STORAGE};
use super::recording_plan::FULL_PX;
pub use super::recording_plan::{Design, RecordingPlan, RecordingSetting};
use super::rendering::{Rendered, decode, folder, render};
use super::stats::{ErrorStatistics, Quartiles};
use super::study::{CostError, Run, Stopwatch, Subject};
use super::todays_tools::{self, ToolCentre};
use crate::pipeline::{Measurement, Outcome, PointUse, measure, measure_points};
use crate::simulate::Scene;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

/// C N² / S at f/2 and ISO 800, lx s.
const LIGHT_LX_S: f64 = 250.0 * 4.0 / 800.0;

/// A recording whose first impact is found further off than this was measured at another one, s.
const SAME_IMPACT_S: f64 = 0.02;

/// Recordings for checking a recommendation begin here, far from those it was made of.
const NEW_SEEDS: u64 = 1_000_000;

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
                "metres_per_pixel": {}, "origin_px": [{}, {}], "blur_px": {}, "noise_grey": {}, "crf": {}}},
            "stop": {{"bounces": 2, "tail_s": 0.1}}}}"#,
        setting.frame_rate_hz,
        setting.exposure_s,
        0.0008 * k,
        reduced(u),
        reduced(v),
        0.7 / k,
        2.0 / k,
        setting.crf
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

/// What is found once in a recording for all that measure it.
struct Opened<'a> {
    recording: &'a Rendered,
    /// Time of decoding alone.
    decode_s: f64,
    /// The centres of today's tools with the time that they took, where any is asked for.
    tools: Option<(Result<Vec<ToolCentre>, String>, f64)>,
}

/// Measures a recording and compares it with its truth.
fn try_one(method: ComparedMethod, opened: &Opened<'_>, stopwatch: &Stopwatch<'_>) -> MeasuredRecording {
    let (recording, decode_s) = (opened.recording, opened.decode_s);
    let (measured, seconds) = match (method, &opened.tools) {
        (ComparedMethod::Level(accuracy), _) => stopwatch.timed(|| {
            let found = measure(
                &recording.video,
                &recording.calibration,
                "truth",
                accuracy,
                &mut |_| {},
            );
            found.map_err(|e| e.to_string())
        }),
        (ComparedMethod::Tool(tool), Some((Ok(centres), found_s))) => {
            let given = todays_tools::given(centres, tool);
            let (measured, evaluated_s) =
                stopwatch.timed(|| measure_points(&recording.video, &given, &recording.calibration, "truth"));
            (measured.map_err(|e| e.to_string()), found_s + evaluated_s)
        }
        (ComparedMethod::Tool(_), Some((Err(why), found_s))) => (Err(why.clone()), *found_s),
        (ComparedMethod::Tool(_), None) => (Err("no centres were looked for".to_owned()), 0.0),
    };
    judged(measured, recording, seconds, decode_s)
}

/// What was measured of a recording, beside its truth.
fn judged(
    measured: Result<Measurement, String>,
    recording: &Rendered,
    seconds: f64,
    decode_s: f64,
) -> MeasuredRecording {
    let (errors, centres, failed) = match &measured {
        Err(e) => ([None; 6], 0, Some(e.clone())),
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
        (CRF.name, Some(Quartiles::exact(f64::from(setting.crf)))),
        (PICTURE.name, Some(Quartiles::exact(setting.width_px() as f64))),
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

/// Renders and measures `seeds` with the camera of `camera` by each of `methods`: the trials by method.
fn measure_all(
    camera: &RecordingSetting,
    methods: &[ComparedMethod],
    seeds: impl Iterator<Item = u64>,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Vec<Vec<MeasuredRecording>>, CostError> {
    let dir = folder()?;
    let scenes = seeds
        .map(|seed| scene(camera, seed))
        .collect::<Result<Vec<_>, _>>()?;
    let recordings = render(&scenes, dir.path())?;
    stopwatch.advance(2.0 * camera.units() * scenes.len() as f64);
    let any_tool = methods.iter().any(|m| matches!(m, ComparedMethod::Tool(_)));
    let mut trials: Vec<Vec<MeasuredRecording>> = methods.iter().map(|_| Vec::new()).collect();
    for recording in &recordings {
        let (decoded, decode_s) = stopwatch.timed(|| decode(&recording.video));
        decoded?;
        let find = || todays_tools::centres(&recording.video).map_err(|e| e.to_string());
        let opened = Opened {
            recording,
            decode_s,
            tools: any_tool.then(|| stopwatch.timed(find)),
        };
        for (method, trials) in methods.iter().zip(&mut trials) {
            trials.push(try_one(*method, &opened, stopwatch));
            stopwatch.advance(camera.units());
        }
    }
    Ok(trials)
}

/// Renders and measures `seeds` at `setting`, as many at once as there are cores: for trials whose time does not count.
fn measure_untimed(
    setting: &RecordingSetting,
    seeds: impl Iterator<Item = u64>,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Vec<MeasuredRecording>, CostError> {
    let dir = folder()?;
    let scenes = seeds
        .map(|seed| scene(setting, seed))
        .collect::<Result<Vec<_>, _>>()?;
    let recordings = render(&scenes, dir.path())?;
    let Some(accuracy) = setting.level() else {
        return Ok(Vec::new());
    };
    let trials = recordings.par_iter().map(|recording| {
        let measured = measure(
            &recording.video,
            &recording.calibration,
            "truth",
            accuracy,
            &mut |_| {},
        );
        judged(measured.map_err(|e| e.to_string()), recording, 0.0, 0.0)
    });
    let trials = trials.collect();
    stopwatch.advance(3.0 * setting.units() * scenes.len() as f64);
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
    for (camera, methods) in plan.cameras() {
        let trials = measure_all(&camera, &methods, 1..=plan.recordings, stopwatch)?;
        for (method, trials) in methods.iter().zip(&trials) {
            let setting = camera.with(*method);
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
                 noise: {} × {} in full, 0.8 mm a pixel, a shaded ball of radius 15.6 px, noise of 2 grey, H.264, \
                 two bounces. A half or quarter picture holds the same scene, its pixels the means of 2 × 2 or 4 × 4. \
                 Errors are those of the first bounce and of the distances; scale and origin are the true ones.",
                plan.recordings, FULL_PX[0], FULL_PX[1]
            ),
            "Light is what the exposure needs for the same grey levels at f/2 and ISO 800, E = C N² / (t S) with C = 250 lx s \
             (ISO 2720). Time is that of a whole measurement, decoding included; error bars are quartiles over the \
             recordings. A cross at the upper edge is a setting at which some recording could not be measured."
                .to_owned(),
            "What today's tools reach is measured in the same run on the same files: difference to the empty scene, threshold, \
             largest contour, and its centroid (moments) or its smallest enclosing circle, by plain OpenCV calls. These \
             centres are given to the same evaluation as those of the accuracy levels, so that the centres alone differ. A \
             recommendation takes accuracy levels only."
                .to_owned(),
        ],
        errors: QUANTITIES.to_vec(),
        works: vec![SECONDS, DECODING, LIGHT, STORAGE, CRF, PICTURE],
        diagrams: diagrams(plan, &settings),
        runs,
    };
    Ok((section, settings))
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
    stopwatch.start_more("trying the recommendation", setting.units() * TRIALS as f64 * 3.0);
    for first in (0..TRIALS).step_by(AT_ONCE as usize) {
        let seeds = (first..first + AT_ONCE).map(|i| TRIAL_SEEDS + i);
        let trials = measure_untimed(setting, seeds, stopwatch)?;
        if let Some(why) = trials.iter().find_map(|trial| miss(trial, requirements)) {
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
        setting.units() * recordings as f64 * 3.0,
    );
    let (mut inside, mut first_miss) = (0, None);
    for first in (0..recordings).step_by(AT_ONCE as usize) {
        let seeds = (first..(first + AT_ONCE).min(recordings)).map(|i| NEW_SEEDS + i);
        for trial in measure_untimed(setting, seeds, stopwatch)? {
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
}
