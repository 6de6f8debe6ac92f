//! The fits: search tolerance against the error of the parameters.
//!
//! Series with errors in all velocities, searched from the starts that the fits use; the reference is the least χ² found to
//! the last digits. What a search leaves is compared with what the data leave: the standard uncertainty of a parameter.

use super::stats::{ErrorStatistics, Quartiles};
use super::study::{CostError, Diagram, ErrorFloor, Metric, Run, SettingCurve, Stopwatch, Subject};
use crate::rebound::fit::single_search::{DEFAULT_TOLERANCE, SearchOutcome, SingleSearch};
use crate::rebound::fit::{Column, Row, Series};
use crate::rebound::{ModelName, RigidMotion, SOLID_SPHERE, grip_slide};
use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use std::f64::consts::TAU;

/// Of whatever parameter is off most.
pub const PARAMETER: Metric = Metric {
    name: "parameter_std",
    words: "rms error of a parameter",
    unit: "σ",
};
/// Of e.
pub const RESTITUTION: Metric = Metric {
    name: "restitution",
    words: "rms error of e",
    unit: "",
};
/// Of μ.
pub const FRICTION: Metric = Metric {
    name: "friction",
    words: "rms error of μ",
    unit: "",
};
/// Time of a search.
pub const SEARCH: Metric = Metric {
    name: "search_ms",
    words: "time a search",
    unit: "ms",
};

/// Tolerance of the reference.
const REFERENCE: f64 = 1e-13;

/// Standard deviation of every velocity, m/s.
const STD_M_S: f64 = 0.01;

/// What is run.
#[derive(Debug, Clone, PartialEq)]
pub struct FitPlan {
    /// Search tolerances.
    pub tolerances: Vec<f64>,
    /// Rows of the series.
    pub rows: Vec<usize>,
    /// Series of each kind.
    pub series: u64,
}

impl FitPlan {
    /// Half a minute.
    #[must_use]
    pub fn full() -> Self {
        Self {
            tolerances: (0..=12).map(|n| 10_f64.powi(-n)).collect(),
            rows: vec![20, 200],
            series: 12,
        }
    }

    /// A second.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            tolerances: vec![1.0, 1e-1, 1e-2, 1e-4, DEFAULT_TOLERANCE, 1e-9],
            rows: vec![20],
            series: 6,
        }
    }

    pub(super) fn units(&self) -> f64 {
        let rows: f64 = self.rows.iter().map(|n| *n as f64).sum();
        2.0 * rows * self.series as f64 * (self.tolerances.len() + 2) as f64 * 2e-3
    }
}

/// Model, its parameters, and the e_x of its series.
const VARIANTS: [(ModelName, &str, f64); 2] = [
    (ModelName::MuE, "e, μ", 0.0),
    (ModelName::GripSlide, "e, e_x, μ", 0.4),
];

/// Bounces of a ball at angles from 5 to 70°, half of which slide, each velocity off by a normal error.
fn series(e_x: f64, rows: usize, seed: u64) -> Result<Series, CostError> {
    let law = grip_slide::Parameters {
        restitution: 0.8,
        tangential_restitution_x: e_x,
        friction: 0.1,
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut even = || (random.next_u64() as f64 + 1.0) / (u64::MAX as f64 + 2.0);
    let mut off = || STD_M_S * (-2.0 * even().ln()).sqrt() * (TAU * even()).cos();
    let all = (0..rows).map(|i| {
        let angle = (5.0 + 65.0 * i as f64 / (rows - 1).max(1) as f64).to_radians();
        let before = RigidMotion {
            velocity_m_s: Vector3::new(2.0 * angle.sin(), 0.0, -2.0 * angle.cos()),
            surface_spin_m_s: Vector3::zeros(),
        };
        let after = grip_slide::impact(&before, &law, SOLID_SPHERE).0;
        let columns = [
            (Column::IncidentVx, before.velocity_m_s.x),
            (Column::IncidentVz, before.velocity_m_s.z),
            (Column::ReboundVx, after.velocity_m_s.x),
            (Column::ReboundVz, after.velocity_m_s.z),
        ];
        columns.into_iter().fold(
            Row::new(i + 1, "all").with(Column::SpinIn, 0.0, Some(0.0)),
            |row, (column, value)| row.with(column, value + off(), Some(STD_M_S)),
        )
    });
    Ok(Series::new("cost", all.collect(), Vec::new())?)
}

/// A series with its reference.
struct ReferenceSeries {
    study: SingleSearch,
    reference: SearchOutcome,
    /// The reference against a search from a start that is off by a tenth of each standard uncertainty.
    own: [f64; 3],
}

impl ReferenceSeries {
    fn new(model: ModelName, e_x: f64, rows: usize, seed: u64) -> Result<Option<Self>, CostError> {
        let study = SingleSearch::new(&series(e_x, rows, seed)?, model);
        let found = study.search(REFERENCE).and_then(|reference| {
            let aside = std::array::from_fn(|j| reference.values[j] + 0.1 * reference.stds[j]);
            Some((reference, study.search_near(aside, REFERENCE)?))
        });
        Ok(found.map(|(reference, again)| Self {
            own: std::array::from_fn(|j| again.values[j] - reference.values[j]),
            study,
            reference,
        }))
    }

    /// The largest of `differences`, each in its standard uncertainty.
    fn in_stds(&self, differences: &[f64; 3]) -> f64 {
        differences
            .iter()
            .zip(&self.reference.stds)
            .filter(|(_, std)| **std > 0.0)
            .map(|(d, std)| (d / std).abs())
            .fold(0.0, f64::max)
    }
}

/// Runs `plan`.
///
/// # Errors
/// See [`CostError`].
pub fn run(plan: &FitPlan, stopwatch: &mut Stopwatch<'_>) -> Result<Subject, CostError> {
    stopwatch.start("fits");
    let (mut runs, mut curves) = (Vec::new(), Vec::new());
    let mut own = Vec::new();
    let mut stds: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for &rows in &plan.rows {
        for (model, name, e_x) in VARIANTS {
            let mut cases = Vec::new();
            for seed in 1..=plan.series {
                cases.extend(ReferenceSeries::new(model, e_x, rows, seed)?);
                stopwatch.advance(rows as f64 * 4e-3);
            }
            own.extend(cases.iter().map(|c| c.in_stds(&c.own)));
            stds[0].extend(cases.iter().map(|c| c.reference.stds[0]));
            stds[1].extend(cases.iter().map(|c| c.reference.stds[2]));
            let from = runs.len();
            for &tolerance in &plan.tolerances {
                let run = at_tolerance(&cases, plan.series, tolerance, stopwatch);
                let mut settings = vec![("parameters", name.to_owned()), ("rows", rows.to_string())];
                settings.extend(run.settings);
                runs.push(Run { settings, ..run });
                stopwatch.advance(rows as f64 * plan.series as f64 * 2e-3);
            }
            curves.push(SettingCurve {
                name: format!("{name}; {rows} rows"),
                runs: (from..runs.len()).collect(),
            });
        }
    }
    Ok(subject(plan, runs, &curves, &own, &stds))
}

/// The subject of these runs. `own` are the references' own errors in standard uncertainties, `stds` the standard
/// uncertainties that the data leave to e and μ.
fn subject(
    plan: &FitPlan,
    runs: Vec<Run>,
    curves: &[SettingCurve],
    own: &[f64],
    stds: &[Vec<f64>; 2],
) -> Subject {
    let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
    let diagram = |error: Metric, data: f64, more: Vec<ErrorFloor>| Diagram {
        title: format!("Fits: {}; along a curve the search tolerance", error.name),
        error,
        work: SEARCH,
        floors: std::iter::once(ErrorFloor {
            name: "the data's own".to_owned(),
            error: data,
        })
        .chain(more)
        .filter(|floor| floor.error.is_finite())
        .collect(),
        curves: curves.to_vec(),
        alternatives: false,
        overview: false,
        less_is_better: true,
    };
    let reference = vec![ErrorFloor {
        name: "the reference's own".to_owned(),
        error: own.iter().copied().fold(f64::EPSILON, f64::max),
    }];
    Subject {
        name: "fits",
        title: "The fits",
        words: vec![format!(
            "Series of bounces at 5 to 70° with errors of {STD_M_S} m/s in every velocity, {} of each kind, searched from the \
             starts that track fit uses. Errors are distances to the least χ² found to the last digits, in the standard \
             uncertainty that the data themselves leave to the parameter (1 in the first diagram; the smallest in the \
             others).",
            plan.series
        )],
        errors: vec![PARAMETER, RESTITUTION, FRICTION],
        works: vec![SEARCH],
        diagrams: vec![
            diagram(PARAMETER, 1.0, reference),
            diagram(RESTITUTION, least(&stds[0]), Vec::new()),
            diagram(FRICTION, least(&stds[1]), Vec::new()),
        ],
        runs,
    }
}

fn at_tolerance(cases: &[ReferenceSeries], wanted: u64, tolerance: f64, stopwatch: &Stopwatch<'_>) -> Run {
    let (mut all, mut e, mut mu, mut times_ms) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut steps, mut unsettled) = (0, 0);
    for case in cases {
        let (found, took_s) = stopwatch.timed(|| case.study.search(tolerance));
        times_ms.push(1e3 * took_s);
        let Some(found) = found.filter(|f| f.converged) else {
            unsettled += 1;
            continue;
        };
        let off: [f64; 3] = std::array::from_fn(|j| found.values[j] - case.reference.values[j]);
        // A difference of nothing is one that rounding hides.
        let seen = |x: f64| x.abs().max(f64::EPSILON);
        all.push(seen(case.in_stds(&off)));
        e.push(seen(off[0]));
        mu.push(seen(off[2]));
        steps += found.steps;
    }
    let errors = [
        (PARAMETER.name, ErrorStatistics::of(&all)),
        (RESTITUTION.name, ErrorStatistics::of(&e)),
        (FRICTION.name, ErrorStatistics::of(&mu)),
    ];
    let failures = unsettled + wanted as usize - cases.len();
    Run {
        settings: vec![("tolerance", format!("{tolerance:e}"))],
        errors: errors.into_iter().filter_map(|(n, e)| Some((n, e?))).collect(),
        work: Quartiles::of(&times_ms)
            .map(|s| (SEARCH.name, s))
            .into_iter()
            .collect(),
        counts: vec![
            ("series", wanted as f64),
            ("steps", steps as f64 / cases.len().max(1) as f64),
        ],
        failed: (failures > 0).then(|| format!("{failures} of {wanted} searches did not settle")),
        is_default: tolerance == DEFAULT_TOLERANCE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tighter_search_is_nearer_and_the_default_is_far_below_the_data() {
        let clock = || 0.0;
        let mut progress = |_| {};
        let plan = FitPlan {
            series: 3,
            ..FitPlan::quick()
        };
        let section = run(&plan, &mut Stopwatch::new(1.0, &clock, &mut progress)).unwrap();
        for curve in &section.diagrams[0].curves {
            let rms: Vec<f64> = curve
                .runs
                .iter()
                .map(|&i| section.runs[i].error(PARAMETER.name).unwrap().rms)
                .collect();
            println!("{}: {rms:?}", curve.name);
            assert!(rms[0] > rms[rms.len() - 1], "{rms:?}");
            let default = curve.runs.iter().find(|&&i| section.runs[i].is_default).unwrap();
            let default = &section.runs[*default];
            assert!(default.failed.is_none(), "{:?}", default.failed);
            assert!(default.error(PARAMETER.name).unwrap().rms < 1e-3);
        }
    }
}
