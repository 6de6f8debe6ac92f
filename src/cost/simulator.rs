//! The simulator: what its integrator's tolerance costs and gives, and what its effects do.
//!
//! # The integrator
//!
//! A ball that falls with drag −c v |v| from rest has a closed form. With terminal speed w = sqrt(m g / c):
//!
//! ```text
//! fallen after t:  (w²/g) ln cosh(g t / w)          lands from height h at t = (w/g) acosh(exp(g h / w²))
//! ```
//!
//! Dormand-Prince 8(5,3) is of order 8 (Hairer, Nørsett, Wanner, Solving ODEs I, II.5): with steps of one length its error
//! goes with the eighth power of that length.
//!
//! # The effects
//!
//! Reference: every effect, integrated more tightly than usual.

use super::stats::{ErrorStatistics, Quartiles, logarithmic_slope};
use super::study::{CostError, Diagram, ErrorFloor, Metric, Run, SettingCurve, Stopwatch, Subject};
use crate::simulate::effects::{self, Acting, Force, Ideal, Loads};
use crate::simulate::flight::{BallState, Integration, Perturbations, RELATIVE_TOLERANCE, Trajectory};
use crate::simulate::scene::{EffectsChoice, Switch};
use crate::simulate::truth::Truth;
use crate::simulate::{Scene, SceneError, SimulatedRecording};
use nalgebra::Vector3;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Of the height on the way down.
pub const HEIGHT: Metric = Metric {
    name: "height_m",
    words: "rms error of the height",
    unit: "m",
};
/// Of the impact.
pub const TIME: Metric = Metric {
    name: "impact_time_s",
    words: "rms error of the impact's time",
    unit: "s",
};
/// Of the image of the ball's centre.
pub const CENTRE: Metric = Metric {
    name: "centre_px",
    words: "rms error of the ball's place",
    unit: "px",
};
/// Of the rebound.
pub const ANGLE: Metric = Metric {
    name: "rebound_angle_deg",
    words: "rms error of the rebound angle",
    unit: "°",
};
/// Time of a flight.
pub const FLIGHT: Metric = Metric {
    name: "flight_ms",
    words: "time a flight",
    unit: "ms",
};
/// Steps of the integrator from launch to impact.
pub const STEPS: Metric = Metric {
    name: "steps",
    words: "steps from launch to impact",
    unit: "",
};
/// Time of a frame.
pub const FRAME: Metric = Metric {
    name: "frame_ms",
    words: "flight and rendering, a frame",
    unit: "ms",
};

/// Order of the integrator.
pub const ORDER: f64 = 8.0;

/// Integration of the reference.
const REFERENCE: Integration = Integration {
    relative_tolerance: 1e-14,
    fixed_step_s: None,
};

/// What is run.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatorPlan {
    /// Relative tolerances of the integrator.
    pub tolerances: Vec<f64>,
    /// Lengths of fixed steps, s.
    pub steps_s: Vec<f64>,
    /// How often each flight is timed.
    pub repeats: usize,
    /// How many of the balls.
    pub balls: usize,
    /// Tolerances of `auto`, px, from coarse to fine.
    pub tolerances_px: Vec<f64>,
    /// Frames that are rendered for timing.
    pub frames: usize,
}

impl SimulatorPlan {
    /// Minutes.
    #[must_use]
    pub fn full() -> Self {
        Self {
            tolerances: (2..=13).map(|n| 10_f64.powi(-n)).collect(),
            steps_s: vec![0.4, 0.28, 0.2, 0.14, 0.1],
            repeats: 15,
            balls: BALLS.len(),
            tolerances_px: vec![1.0, 0.1, 0.02, 0.004],
            frames: 16,
        }
    }

    /// Seconds.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            tolerances: vec![1e-2, 1e-5, 1e-8, RELATIVE_TOLERANCE],
            steps_s: vec![0.4, 0.28, 0.2, 0.14],
            repeats: 7,
            balls: 2,
            tolerances_px: vec![0.1, 0.02],
            frames: 6,
        }
    }

    pub(super) fn units(&self) -> f64 {
        let flights = (self.tolerances.len() + self.steps_s.len()) as f64 * 0.05 * self.repeats as f64;
        flights + (self.balls * (self.tolerances_px.len() + 2) * self.frames) as f64 * 0.5
    }
}

/// The ball of the closed form: as light as a table tennis ball, from 10 m, so that drag matters.
const MASS_KG: f64 = 0.0027;
const DRAG_N_S2_M2: f64 = 3.4e-4;
const HEIGHT_M: f64 = 10.0;
const G_M_S2: f64 = 9.81;

/// −c v |v|, with a count of how often it was asked for.
struct CountedDrag(Arc<AtomicU64>);

impl Force for CountedDrag {
    fn act(&self, state: &BallState, _: &Vector3<f64>, loads: &mut Loads) {
        self.0.fetch_add(1, Ordering::Relaxed);
        loads.force_n -= state.velocity_m_s * (DRAG_N_S2_M2 * state.velocity_m_s.norm());
    }
}

/// A flight of the closed form's ball.
struct Flown {
    heights_m: Vec<f64>,
    time_s: f64,
    evaluations: u64,
}

fn fly(scene: &Scene, integration: Integration) -> Result<Flown, SceneError> {
    let count = Arc::new(AtomicU64::new(0));
    let acts = Perturbations {
        forces: vec![Acting::of(Box::new(CountedDrag(Arc::clone(&count))))],
        ..Perturbations::default()
    };
    let flight = Trajectory::integrated(scene, &acts, integration)?;
    let (landed_s, _) = landing();
    Ok(Flown {
        heights_m: instants(landed_s)
            .map(|t| flight.state(t).position_m.z - scene.ball.radius_m)
            .collect(),
        time_s: flight.impacts()[0].time_s,
        evaluations: count.load(Ordering::Relaxed),
    })
}

/// Time of the impact, s, and terminal speed, m/s.
fn landing() -> (f64, f64) {
    let terminal = (MASS_KG * G_M_S2 / DRAG_N_S2_M2).sqrt();
    let time_s = terminal / G_M_S2 * (G_M_S2 * HEIGHT_M / (terminal * terminal)).exp().acosh();
    (time_s, terminal)
}

/// Instants at which heights are compared.
fn instants(landed_s: f64) -> impl Iterator<Item = f64> {
    (1..=20).map(move |i| landed_s * f64::from(i) / 20.5)
}

fn falling_scene() -> Result<Scene, SceneError> {
    Scene::from_json(&format!(
        r#"{{"schema": "track.scene/1", "gravity_m_s2": {G_M_S2}, "ball": {{"radius_m": 0.02, "mass_kg": {MASS_KG}}},
            "contact": {{"model": "mu_e", "restitution": 0.2, "friction": 0.1}},
            "launch": {{"drop_height_m": {HEIGHT_M}, "speed_m_s": 0}}, "stop": {{"bounces": 1, "tail_s": 0}}}}"#
    ))
}

/// Runs `plan`: the integrator, the effects.
///
/// # Errors
/// See [`CostError`].
pub fn run(plan: &SimulatorPlan, stopwatch: &mut Stopwatch<'_>) -> Result<Vec<Subject>, CostError> {
    stopwatch.start("simulator");
    Ok(vec![
        integrator(plan, stopwatch)?,
        effects_section(plan, stopwatch)?,
    ])
}

fn integrator(plan: &SimulatorPlan, stopwatch: &mut Stopwatch<'_>) -> Result<Subject, CostError> {
    let scene = falling_scene()?;
    let mut runs = Vec::new();
    let fixed = plan.steps_s.iter().map(|&step_s| Integration {
        relative_tolerance: RELATIVE_TOLERANCE,
        fixed_step_s: Some(step_s),
    });
    let adaptive = plan.tolerances.iter().map(|&relative_tolerance| Integration {
        relative_tolerance,
        fixed_step_s: None,
    });
    for integration in fixed.chain(adaptive) {
        runs.push(one_flight(&scene, integration, plan.repeats, stopwatch)?);
        stopwatch.advance(0.05 * plan.repeats as f64);
    }
    let by_step = SettingCurve {
        name: "steps of one length".to_owned(),
        runs: (0..plan.steps_s.len()).collect(),
    };
    let by_tolerance = SettingCurve {
        name: "by tolerance".to_owned(),
        runs: (plan.steps_s.len()..runs.len()).collect(),
    };
    let order = observed_order(&by_step, &runs);
    let diagram = |error: Metric, work: Metric, curves: &[&SettingCurve]| Diagram {
        title: format!("Integrator: {} against {}", error.name, work.name),
        error,
        work,
        floors: vec![ErrorFloor {
            name: "rounding".to_owned(),
            error: f64::EPSILON * if error == HEIGHT { HEIGHT_M } else { landing().0 },
        }],
        curves: curves.iter().map(|c| (*c).clone()).collect(),
        alternatives: true,
        overview: false,
        less_is_better: true,
    };
    Ok(Subject {
        name: "integrator",
        title: "The simulator's integrator",
        words: vec![
            format!(
                "A ball of {MASS_KG} kg that falls {HEIGHT_M} m with drag, against the closed form. Dormand-Prince 8(5,3) is \
                 of order {ORDER}; the order observed with steps of one length is {}.",
                order.map_or_else(|| "not to be told from so few".to_owned(), |o| format!("{o:.2}"))
            ),
            "A flight's time hardly depends on the tolerance: most of it goes into the places from which frames are \
             interpolated. So the default is tight."
                .to_owned(),
        ],
        errors: vec![HEIGHT, TIME],
        works: vec![FLIGHT, STEPS],
        diagrams: vec![
            diagram(HEIGHT, STEPS, &[&by_step]),
            diagram(HEIGHT, FLIGHT, &[&by_tolerance, &by_step]),
            diagram(TIME, FLIGHT, &[&by_tolerance, &by_step]),
        ],
        runs,
    })
}

/// Errors below this are rounding, m.
const ROUNDING_M: f64 = 1e-12;

/// The power of the step's length that the error goes with, as far as it is not rounding.
fn observed_order(curve: &SettingCurve, runs: &[Run]) -> Option<f64> {
    let places: Vec<(f64, f64)> = curve
        .runs
        .iter()
        .filter_map(|&i| runs[i].place(&HEIGHT, &STEPS))
        .filter(|(_, error)| *error > ROUNDING_M)
        .collect();
    logarithmic_slope(&places).map(|slope| -slope)
}

fn one_flight(
    scene: &Scene,
    integration: Integration,
    repeats: usize,
    stopwatch: &Stopwatch<'_>,
) -> Result<Run, CostError> {
    /// Flights timed together, so that the clock's own grain does not matter.
    const TOGETHER: u32 = 10;
    let flown = fly(scene, integration)?;
    let mut times_ms = Vec::new();
    for _ in 0..repeats {
        let (outcome, took_s) =
            stopwatch.timed(|| (0..TOGETHER).try_for_each(|_| fly(scene, integration).map(drop)));
        outcome?;
        times_ms.push(1e3 * took_s / f64::from(TOGETHER));
    }
    let (landed_s, terminal) = landing();
    let heights: Vec<f64> = instants(landed_s)
        .zip(&flown.heights_m)
        .map(|(t, z)| {
            let fallen = terminal * terminal / G_M_S2 * (G_M_S2 * t / terminal).cosh().ln();
            z - (HEIGHT_M - fallen)
        })
        .collect();
    let errors = [
        (HEIGHT.name, ErrorStatistics::of(&heights)),
        (TIME.name, ErrorStatistics::of(&[flown.time_s - landed_s])),
    ];
    let mut work: Vec<(&'static str, Quartiles)> = Quartiles::of(&times_ms)
        .map(|s| (FLIGHT.name, s))
        .into_iter()
        .collect();
    let mut settings = vec![(
        "relative_tolerance",
        format!("{:e}", integration.relative_tolerance),
    )];
    if let Some(step_s) = integration.fixed_step_s {
        settings = vec![("step_s", step_s.to_string())];
        work.push((STEPS.name, Quartiles::exact(landed_s / step_s)));
    }
    Ok(Run {
        settings,
        errors: errors.into_iter().filter_map(|(n, e)| Some((n, e?))).collect(),
        work,
        counts: vec![("force_evaluations", flown.evaluations as f64)],
        failed: None,
        is_default: integration == Integration::default(),
    })
}

/// Name, ball and contact.
const BALLS: [(&str, &str, &str); 3] = [
    (
        "steel, 25 mm",
        r#"{"radius_m": 0.0125, "mass_kg": 0.0639}"#,
        r#"{"model": "mu_e", "restitution": 0.78, "friction": 0.07}"#,
    ),
    (
        "table tennis",
        r#"{"radius_m": 0.02, "mass_kg": 0.0027, "inertia_factor": 0.667, "contact_modulus_pa": 3e7}"#,
        r#"{"model": "grip_slide", "restitution": 0.90, "tangential_restitution_x": 0.1, "friction": 0.25}"#,
    ),
    (
        "tennis",
        r#"{"radius_m": 0.033, "mass_kg": 0.0577, "inertia_factor": 0.55, "contact_modulus_pa": 2e6}"#,
        r#"{"model": "grip_slide", "restitution": 0.75, "tangential_restitution_x": 0.2, "friction": 0.6}"#,
    ),
];

/// A good camera on a good day: every effect is there, many of them too small to matter.
const REST: &str = r#""camera": {"distance_m": 5.0, "readout_s": 2e-6, "electrons_per_grey": 2000,
        "lens": {"camera_matrix": [[6250, 0, 639.5], [0, 6250, 359.5], [0, 0, 1]], "distortion": [-0.001, 0, 0, 0, 0]}},
    "look": {"texture_grey": 0.3, "reflection": 0.001, "shadow": 0.005, "flicker": 0.001, "unevenness": 0.001}"#;

fn ball_scene(ball: usize) -> Result<Scene, SceneError> {
    let (_, body, contact) = BALLS[ball];
    Scene::from_json(&format!(
        r#"{{"schema": "track.scene/1", "ball": {body}, "contact": {contact}, {REST}}}"#
    ))
}

fn effects_section(plan: &SimulatorPlan, stopwatch: &mut Stopwatch<'_>) -> Result<Subject, CostError> {
    let (mut runs, mut curves) = (Vec::new(), Vec::new());
    let mut own_px = 0.0_f64;
    for (ball, (name, ..)) in BALLS.iter().enumerate().take(plan.balls) {
        let scene = ball_scene(ball)?;
        let reference = Reference::new(&scene)?;
        own_px = own_px.max(reference.own.centre_px.rms);
        let from = runs.len();
        for (word, choice, tolerance_px) in choices(plan, scene.tolerance_px) {
            let scene = Scene {
                effects: EffectsChoice::all(choice),
                tolerance_px,
                ..scene.clone()
            };
            let run = one_choice(&scene, &reference, choice, plan.frames, stopwatch)?;
            runs.push(Run {
                settings: vec![("ball", (*name).to_owned()), ("effects", word)],
                ..run
            });
            stopwatch.advance(plan.frames as f64 * 0.5);
        }
        curves.push(SettingCurve {
            name: (*name).to_owned(),
            runs: (from..runs.len()).collect(),
        });
    }
    let diagram = |error: Metric, floors: Vec<ErrorFloor>| Diagram {
        title: format!(
            "Effects: {}; along a curve none, auto ever finer, all",
            error.name
        ),
        error,
        work: FRAME,
        floors,
        curves: curves.clone(),
        alternatives: false,
        overview: false,
        less_is_better: true,
    };
    let diagrams = vec![
        diagram(
            CENTRE,
            vec![ErrorFloor {
                name: "the reference's own".to_owned(),
                error: own_px,
            }],
        ),
        diagram(TIME, Vec::new()),
        diagram(ANGLE, Vec::new()),
    ];
    Ok(Subject {
        name: "effects",
        title: "The simulator's effects",
        words: vec![
            "Scenes of 1280 × 720 px at 240 Hz with every effect in them, rendered with none, with those that auto finds \
             necessary for a tolerance in px, and with all; against all. The error of all is the reference's own: what a \
             tighter integration changes. A place is that of the ball's centre in the picture, by geometry; what an \
             effect does to the picture around it (blur, light, noise) is in the time only."
                .to_owned(),
        ],
        errors: vec![CENTRE, TIME, ANGLE],
        works: vec![FRAME],
        runs,
        diagrams,
    })
}

/// None, auto from coarse to fine, all.
fn choices(plan: &SimulatorPlan, usual_px: f64) -> Vec<(String, Switch, f64)> {
    let auto = plan
        .tolerances_px
        .iter()
        .map(|&px| (format!("auto, {px} px"), Switch::Auto, px));
    std::iter::once(("none".to_owned(), Switch::Off, usual_px))
        .chain(auto)
        .chain(std::iter::once(("all".to_owned(), Switch::On, usual_px)))
        .collect()
}

/// Errors of place, time and angle.
#[derive(Debug, Clone, Copy)]
struct Deviations {
    centre_px: ErrorStatistics,
    time_s: Option<ErrorStatistics>,
    angle_deg: Option<ErrorStatistics>,
}

/// The scene with every effect.
struct Reference {
    truth: Truth,
    /// What a tighter integration changes.
    own: Deviations,
}

impl Reference {
    fn new(scene: &Scene) -> Result<Self, SceneError> {
        let scene = Scene {
            effects: EffectsChoice::all(Switch::On),
            ..scene.clone()
        };
        let recording = SimulatedRecording::new(&scene)?;
        let truth = recording.truth();
        let (_, chosen) = effects::decide(&scene, &scene.effects, &Ideal::new(&scene)?);
        let tight = Trajectory::integrated(&scene, &chosen.acts, REFERENCE)?;
        let usual = recording.trajectory();
        let seen = truth.centres.iter().filter(|c| c.visible);
        let px: Vec<f64> = seen
            .map(|c| {
                let apart = tight.state(c.time_s).position_m - usual.state(c.time_s).position_m;
                apart.norm() / scene.camera.metres_per_pixel
            })
            .collect();
        let both = || tight.impacts().iter().zip(usual.impacts());
        let times: Vec<f64> = both().map(|(a, b)| a.time_s - b.time_s).collect();
        let angles: Vec<f64> = both()
            .map(|(a, b)| (a.rebound.angle_rad() - b.rebound.angle_rad()).to_degrees())
            .collect();
        Ok(Self {
            own: Deviations {
                centre_px: ErrorStatistics::of(&px).unwrap_or(NOTHING),
                time_s: ErrorStatistics::of(&times),
                angle_deg: ErrorStatistics::of(&angles),
            },
            truth,
        })
    }

    /// How far `other` is from it, over frames in which both show the ball and impacts that both have.
    fn off(&self, other: &Truth) -> Deviations {
        let (mut along, mut down) = (Vec::new(), Vec::new());
        for (a, b) in other.centres.iter().zip(&self.truth.centres) {
            if a.visible && b.visible {
                along.push(a.u_px - b.u_px);
                down.push(a.v_px - b.v_px);
            }
        }
        let both = || other.bounces.iter().zip(&self.truth.bounces);
        let times: Vec<f64> = both().map(|(a, b)| a.time_s - b.time_s).collect();
        let angles: Vec<f64> = both()
            .map(|(a, b)| a.rebound.angle_deg - b.rebound.angle_deg)
            .collect();
        Deviations {
            centre_px: ErrorStatistics::of_groups(&[&along, &down]).unwrap_or(NOTHING),
            time_s: ErrorStatistics::of(&times),
            angle_deg: ErrorStatistics::of(&angles),
        }
    }
}

/// Nothing to compare.
const NOTHING: ErrorStatistics = ErrorStatistics {
    count: 0,
    rms: 0.0,
    bias: 0.0,
    scatter: 0.0,
    p95: 0.0,
    bound_95: 0.0,
};

fn one_choice(
    scene: &Scene,
    reference: &Reference,
    choice: Switch,
    frames: usize,
    stopwatch: &Stopwatch<'_>,
) -> Result<Run, CostError> {
    let (recording, flight_s) = stopwatch.timed(|| SimulatedRecording::new(scene));
    let recording = recording?;
    let count = recording.frame_count();
    let flight_ms = 1e3 * flight_s / count as f64;
    let times_ms: Vec<f64> = (0..frames.min(count))
        .map(|i| {
            let (_, took_s) = stopwatch.timed(|| recording.frame(i * count / frames.min(count)));
            1e3 * took_s + flight_ms
        })
        .collect();
    let off = if choice == Switch::On {
        reference.own
    } else {
        reference.off(&recording.truth())
    };
    let errors = [
        (CENTRE.name, Some(off.centre_px)),
        (TIME.name, off.time_s),
        (ANGLE.name, off.angle_deg),
    ];
    let used = recording.decisions().iter().filter(|d| d.used).count();
    Ok(Run {
        settings: Vec::new(),
        errors: errors.into_iter().filter_map(|(n, e)| Some((n, e?))).collect(),
        work: Quartiles::of(&times_ms)
            .map(|s| (FRAME.name, s))
            .into_iter()
            .collect(),
        counts: vec![("effects_used", used as f64), ("frames", count as f64)],
        failed: None,
        is_default: choice == Switch::Auto && scene.tolerance_px == 0.02,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_observed_order_of_the_integrator_is_its_theory() {
        let plan = SimulatorPlan {
            repeats: 1,
            ..SimulatorPlan::full()
        };
        let clock = || 0.0;
        let mut progress = |_| {};
        let section = integrator(&plan, &mut Stopwatch::new(1.0, &clock, &mut progress)).unwrap();
        let order = observed_order(&section.diagrams[0].curves[0], &section.runs).unwrap();
        println!("observed order {order:.3}");
        assert!((order - ORDER).abs() < 0.5, "{order}");
        for run in &section.runs {
            println!(
                "{:?} {:.3e} m {:.3e} s",
                run.settings,
                run.error(HEIGHT.name).unwrap().rms,
                run.error(TIME.name).unwrap().rms
            );
        }
        // By tolerance: from coarse to tight the error falls in proportion, to rounding.
        let tight = section.runs.last().unwrap().error(HEIGHT.name).unwrap().rms;
        assert!(tight < 1e-11, "{tight}");
    }

    #[test]
    fn auto_keeps_places_within_its_tolerance_and_none_does_not() {
        let scene = ball_scene(1).unwrap();
        let reference = Reference::new(&scene).unwrap();
        assert!(
            reference.own.centre_px.bound_95 < 1e-6,
            "{}",
            reference.own.centre_px.rms
        );
        let clock = || 0.0;
        let mut progress = |_| {};
        let stopwatch = Stopwatch::new(1.0, &clock, &mut progress);
        for tolerance_px in [0.5, 0.02] {
            let scene = Scene {
                tolerance_px,
                effects: EffectsChoice::all(Switch::Auto),
                ..scene.clone()
            };
            let run = one_choice(&scene, &reference, Switch::Auto, 1, &stopwatch).unwrap();
            let off = run.error(CENTRE.name).unwrap();
            assert!(off.rms <= tolerance_px, "{} at {tolerance_px}", off.rms);
        }
        let none = Scene {
            effects: EffectsChoice::all(Switch::Off),
            ..scene
        };
        let run = one_choice(&none, &reference, Switch::Off, 1, &stopwatch).unwrap();
        assert!(run.error(CENTRE.name).unwrap().rms > 0.5);
    }
}
