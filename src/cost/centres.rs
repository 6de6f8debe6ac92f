//! Centre methods × noise × radius: the distance of every centre to the truth, against the time a frame takes.
//!
//! The methods are run as users run them, by [`measure()`]: the time is that of a whole measurement without the decoding,
//! which is timed alone on the same file. The floor is the Cramér-Rao bound of a flat disc's centre, each coordinate:
//!
//! ```text
//! σ_u ≥ (σ_n / A) sqrt(2 σ_b / (sqrt(π) R))
//! ```
//!
//! with noise σ_n (rounding to whole grey levels included), contrast A, edge blur σ_b (the pixel's own square included) and
//! radius R.

use super::rendering::{Rendered, decode, folder, render};
use super::stats::{ErrorStatistics, Quartiles};
use super::study::{CostError, Diagram, ErrorFloor, Metric, Run, SettingCurve, Stopwatch, Subject};
use super::todays_tools::{self, Tool};
use crate::detect::centre::Accuracy;
use crate::pipeline::{Outcome, PointUse, measure};
use crate::simulate::Scene;
use std::f64::consts::PI;

/// Grey levels of the ball over its background.
const CONTRAST_GREY: f64 = 140.0;
const OPTICS_BLUR_PX: f64 = 0.7;
/// Standard deviation of what is spread evenly over 1: a pixel's width, a grey level's rounding.
const EVEN: f64 = 0.288_675_134_594_812_9;

/// The distance to the truth.
pub const CENTRE: Metric = Metric {
    name: "centre_px",
    words: "rms error of a centre",
    unit: "px",
};

/// Time that a frame takes, decoding subtracted.
pub const ANALYSIS: Metric = Metric {
    name: "analysis_us_per_frame",
    words: "analysis of a frame, decoding subtracted",
    unit: "µs",
};

/// Time that decoding a frame takes.
pub const DECODING: Metric = Metric {
    name: "decoding_us_per_frame",
    words: "decoding of a frame",
    unit: "µs",
};

/// How a centre is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ComparedMethod {
    /// One of today's tools.
    Tool(Tool),
    /// A level of accuracy of `track`.
    Level(Accuracy),
}

impl ComparedMethod {
    /// All of them.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let levels = Accuracy::ALL.into_iter().map(Self::Level);
        Tool::ALL.into_iter().map(Self::Tool).chain(levels).collect()
    }

    /// For people and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tool(tool) => tool.name(),
            Self::Level(level) => level.name(),
        }
    }
}

/// The ball's light and how the recording is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightAndCodec {
    /// An even disc, stored without loss: what the bound is for.
    Flat,
    /// Shaded with a highlight, H.264 at crf 14.
    Coded,
}

impl LightAndCodec {
    /// For people and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Flat => "flat, lossless",
            Self::Coded => "shaded, H.264",
        }
    }

    fn json(self) -> (&'static str, &'static str) {
        match self {
            Self::Flat => (r#"{"shading": 0}"#, r#""codec": "lossless""#),
            Self::Coded => (
                r#"{"shading": 0.5, "highlight_grey": 40}"#,
                r#""codec": "h264", "crf": 14"#,
            ),
        }
    }
}

/// What is run.
#[derive(Debug, Clone, PartialEq)]
pub struct CentrePlan {
    /// Lights and codecs.
    pub lights: Vec<LightAndCodec>,
    /// Standard deviations of the noise, grey.
    pub noises_grey: Vec<f64>,
    /// Radii of the ball, px.
    pub radii_px: Vec<f64>,
    /// How often each is timed.
    pub repeats: usize,
}

impl CentrePlan {
    /// Minutes.
    #[must_use]
    pub fn full() -> Self {
        Self {
            lights: vec![LightAndCodec::Flat, LightAndCodec::Coded],
            noises_grey: vec![2.0, 8.0],
            radii_px: vec![4.0, 8.0, 16.0],
            repeats: 2,
        }
    }

    /// Seconds.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            lights: vec![LightAndCodec::Flat, LightAndCodec::Coded],
            noises_grey: vec![2.0],
            radii_px: vec![4.0, 8.0],
            repeats: 1,
        }
    }

    /// What a frame costs grows with the picture, which grows with the ball.
    pub(super) fn units(&self) -> f64 {
        let pictures: f64 = self.radii_px.iter().map(|r| cost(*r)).sum();
        (self.lights.len() * self.noises_grey.len()) as f64
            * pictures
            * (2 + ComparedMethod::all().len() * self.repeats) as f64
    }
}

/// Of one pass over a recording, in units of a small one.
fn cost(radius_px: f64) -> f64 {
    1.0 + (radius_px / 8.0).powi(2)
}

/// The Cramér-Rao bound of each coordinate of a flat disc's centre, px.
#[must_use]
pub fn bound_px(radius_px: f64, noise_grey: f64) -> f64 {
    let blur_px = OPTICS_BLUR_PX.hypot(EVEN);
    noise_grey.hypot(EVEN) / CONTRAST_GREY * (2.0 * blur_px / (PI.sqrt() * radius_px)).sqrt()
}

/// A ball launched into free fall and one bounce, in a picture that just holds it.
pub(super) fn scene(light: LightAndCodec, radius_px: f64, noise_grey: f64) -> Result<Scene, CostError> {
    let q = 0.0125 / radius_px;
    let even = |m: f64| (m / q / 2.0).round() * 2.0;
    let (width, height) = (even(0.46), even(0.30));
    let (light, codec) = light.json();
    Ok(Scene::from_json(&format!(
        r#"{{"schema": "track.scene/1", "seed": 11, "ball": {{"radius_m": 0.0125, "mass_kg": 0.0639}},
            "contact": {{"model": "mu_e", "restitution": 0.8, "friction": 0.07}},
            "launch": {{"drop_height_m": 0.2, "speed_m_s": 0.7}},
            "camera": {{"image_size_px": [{width}, {height}], "frame_rate_hz": 240, "exposure_s": 0,
                "metres_per_pixel": {q}, "origin_px": [{}, {}], "blur_px": {OPTICS_BLUR_PX},
                "noise_grey": {noise_grey}, {codec}}},
            "look": {light}, "stop": {{"bounces": 2, "tail_s": 0.02}}}}"#,
        0.03 / q,
        height - 0.035 / q,
    ))?)
}

/// Centres by frame, or why there are none.
type FoundCentres = Result<Vec<(usize, [f64; 2])>, String>;

/// Finds the centres of a recording.
fn find(method: ComparedMethod, recording: &Rendered) -> FoundCentres {
    match method {
        ComparedMethod::Tool(tool) => {
            let found = todays_tools::centres(&recording.video).map_err(|e| e.to_string())?;
            Ok(found.iter().map(|c| (c.frame, c.place(tool))).collect())
        }
        ComparedMethod::Level(level) => {
            let m = measure(
                &recording.video,
                &recording.calibration,
                "truth",
                level,
                &mut |_| {},
            )
            .map_err(|e| e.to_string())?;
            if let Outcome::Rejected { reason } = m.outcome {
                return Err(reason);
            }
            if !m.track.method.starts_with(level.name()) {
                return Err(format!("had to be left for {}", m.track.method));
            }
            let used = m
                .track
                .points
                .iter()
                .filter(|p| matches!(p.use_, PointUse::Used(_)));
            Ok(used.map(|p| (p.frame, [p.pixel.u_px, p.pixel.v_px])).collect())
        }
    }
}

/// Errors of the centres against the truth.
fn errors(recording: &Rendered, centres: &[(usize, [f64; 2])]) -> Option<ErrorStatistics> {
    let (mut along, mut down) = (Vec::new(), Vec::new());
    for (frame, [u, v]) in centres {
        // One truth a frame, in order.
        if let Some(truth) = recording.truth.centres.get(*frame) {
            along.push(u - truth.u_px);
            down.push(v - truth.v_px);
        }
    }
    ErrorStatistics::of_groups(&[&along, &down])
}

/// Runs `plan`.
///
/// # Errors
/// See [`CostError`].
pub fn run(plan: &CentrePlan, stopwatch: &mut Stopwatch<'_>) -> Result<Subject, CostError> {
    stopwatch.start("centres");
    let mut section = Subject {
        name: "centres",
        title: "Centres",
        words: vec![
            format!(
                "One flight with a bounce at 240 Hz, contrast {CONTRAST_GREY} grey, optical blur {OPTICS_BLUR_PX} px, in a \
                 picture that just holds it (0.46 m × 0.30 m, ball of 12.5 mm radius): the larger the ball, the larger the \
                 picture. Error: rms over both coordinates of all centres in use. Time: a whole measurement as \
                 users run it, divided by the frames, minus decoding alone on the same file; what decoding hides \
                 by running in a thread of its own is not counted twice."
            ),
            "Floor: the Cramér-Rao bound of a flat disc. With H.264 no centre gets there: the codec itself moves the edge."
                .to_owned(),
        ],
        errors: vec![CENTRE],
        works: vec![ANALYSIS, DECODING],
        runs: Vec::new(),
        diagrams: Vec::new(),
    };
    for &light in &plan.lights {
        for &noise_grey in &plan.noises_grey {
            diagram(plan, light, noise_grey, &mut section, stopwatch)?;
        }
    }
    Ok(section)
}

fn diagram(
    plan: &CentrePlan,
    light: LightAndCodec,
    noise_grey: f64,
    section: &mut Subject,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<(), CostError> {
    let mut curves: Vec<SettingCurve> = ComparedMethod::all()
        .iter()
        .map(|m| SettingCurve {
            name: m.name().to_owned(),
            runs: Vec::new(),
        })
        .collect();
    for &radius_px in &plan.radii_px {
        let dir = folder()?;
        let scenes = [scene(light, radius_px, noise_grey)?];
        let Some(recording) = render(&scenes, dir.path())?.pop() else {
            continue;
        };
        stopwatch.advance(2.0 * cost(radius_px));
        for (curve, run) in curves
            .iter_mut()
            .zip(timed_methods(plan, radius_px, &recording, stopwatch)?)
        {
            curve.runs.push(section.runs.len());
            let mut settings = vec![
                ("light_and_codec", light.name().to_owned()),
                ("noise_grey", noise_grey.to_string()),
                ("radius_px", radius_px.to_string()),
            ];
            settings.extend(run.settings);
            section.runs.push(Run { settings, ..run });
        }
    }
    section.diagrams.push(Diagram {
        title: format!(
            "Centres: {}, noise {noise_grey} grey; along a curve R = {} px",
            light.name(),
            plan.radii_px
                .iter()
                .map(f64::to_string)
                .collect::<Vec<_>>()
                .join(", ")
        ),
        error: CENTRE,
        work: ANALYSIS,
        floors: plan
            .radii_px
            .iter()
            .map(|&r| ErrorFloor {
                name: format!("bound, R {r}"),
                error: bound_px(r, noise_grey),
            })
            .collect(),
        curves,
        alternatives: true,
        overview: plan.noises_grey.first() == Some(&noise_grey),
        less_is_better: true,
    });
    Ok(())
}

/// A run of every method on `recording`, timed turn by turn so that what else the machine does falls on all alike.
fn timed_methods(
    plan: &CentrePlan,
    radius_px: f64,
    recording: &Rendered,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Vec<Run>, CostError> {
    let mut decoding_s = Vec::new();
    let mut totals_s = vec![Vec::new(); ComparedMethod::all().len()];
    let mut found: Vec<FoundCentres> = Vec::new();
    for repeat in 0..plan.repeats {
        let (decoded, took_s) = stopwatch.timed(|| decode(&recording.video));
        decoded?;
        decoding_s.push(took_s);
        for (method, totals_s) in ComparedMethod::all().into_iter().zip(&mut totals_s) {
            let (centres, took_s) = stopwatch.timed(|| find(method, recording));
            totals_s.push(took_s);
            if repeat == 0 {
                found.push(centres);
            }
            stopwatch.advance(cost(radius_px));
        }
    }
    let runs = ComparedMethod::all()
        .into_iter()
        .zip(&totals_s)
        .zip(found)
        .map(|((method, totals_s), found)| run_of(method, recording, totals_s, &decoding_s, found));
    Ok(runs.collect())
}

/// The run of a method: what it found, and how long the whole and decoding alone took each time.
fn run_of(
    method: ComparedMethod,
    recording: &Rendered,
    totals_s: &[f64],
    decoding_s: &[f64],
    found: FoundCentres,
) -> Run {
    let frames = recording.frames as f64;
    let us = 1e6 / frames;
    let decode_s = Quartiles::of(decoding_s).map_or(0.0, |s| s.median);
    // Where decoding in its own thread hides all of it, a hundredth of the whole stands for "next to nothing".
    let analysis = totals_s.iter().map(|t| us * (t - decode_s).max(0.01 * t));
    let decoding = decoding_s.iter().map(|t| us * t);
    let work = [
        (ANALYSIS.name, analysis.collect::<Vec<_>>()),
        (DECODING.name, decoding.collect()),
    ];
    let counted = found.as_ref().map_or(0, Vec::len);
    let errors = found.as_ref().ok().and_then(|c| errors(recording, c));
    let nothing = || {
        errors
            .is_none()
            .then(|| "no centre was found in any frame".to_owned())
    };
    Run {
        settings: vec![("method", method.name().to_owned())],
        errors: errors.map(|e| (CENTRE.name, e)).into_iter().collect(),
        work: work
            .iter()
            .filter_map(|(name, values)| Some((*name, Quartiles::of(values)?)))
            .collect(),
        counts: vec![
            ("frames", frames),
            ("centres", counted as f64),
            ("bytes", recording.bytes as f64),
        ],
        failed: found.err().or_else(nothing),
        is_default: method == ComparedMethod::Level(Accuracy::Standard),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_the_bound_of_the_textbook_case() {
        // R 20 px, blur 0.7 px, A/σ = 50: 0.0040 px; here the pixel's own width and rounding add to blur and noise.
        let expected = 0.0040 * (OPTICS_BLUR_PX.hypot(EVEN) / 0.7).sqrt() * 2.8_f64.hypot(EVEN) / 2.8;
        assert!((bound_px(20.0, 2.8) / expected - 1.0).abs() < 0.01);
    }

    /// Of a flat disc without loss, which is what the bound is for. Scatter and bound are those of single centres; what all
    /// centres of a recording share (its learned radius and light) is in the bias.
    #[test]
    fn fine_lies_at_the_bound() {
        const RECORDINGS: u64 = 3;
        let dir = folder().unwrap();
        let ratios = [(8.0, 2.0), (16.0, 2.0), (16.0, 8.0)].map(|(radius_px, noise_grey)| {
            let scenes: Vec<Scene> = (1..=RECORDINGS)
                .map(|seed| Scene {
                    seed,
                    ..scene(LightAndCodec::Flat, radius_px, noise_grey).unwrap()
                })
                .collect();
            let mut square = 0.0;
            for recording in render(&scenes, dir.path()).unwrap() {
                let centres = find(ComparedMethod::Level(Accuracy::Fine), &recording).unwrap();
                assert!(centres.len() > 100, "{}", centres.len());
                let e = errors(&recording, &centres).unwrap();
                println!("bias {:.5}, scatter {:.5}", e.bias, e.scatter);
                square += e.scatter.powi(2) / RECORDINGS as f64;
            }
            let ratio = square.sqrt() / bound_px(radius_px, noise_grey);
            println!("R {radius_px} px, noise {noise_grey} grey: scatter is {ratio:.3} of the bound");
            ratio
        });
        // Each ratio is known to 2.5 % (some 800 coordinates); all three are the same up to that.
        let mean = ratios.iter().sum::<f64>() / 3.0;
        assert!(mean < 1.15, "{ratios:?}");
        assert!(
            ratios.iter().all(|r| (0.95..1.2).contains(r)),
            "{ratios:?}: below 1 the bound or the truth is wrong"
        );
    }
}
