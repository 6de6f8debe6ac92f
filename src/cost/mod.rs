//! What accuracy costs in time: scenes with known truth, measured at many settings, error beside work.
//!
//! | file | what it runs |
//! |---|---|
//! | [`centres`] | centre methods × noise × radius |
//! | [`recordings`] | whole recordings: accuracy level, frame rate, picture size, exposure, codec quality |
//! | `recording_plan`, `recording_diagrams` | at which settings those are run, and what is drawn of them |
//! | [`todays_tools`] | what a script of a few lines reaches on the same recordings |
//! | [`simulator`] | the integrator's tolerance and order; `none`, `auto` and `all` effects |
//! | [`fits`] | the search tolerance of a series' fit |
//! | [`recommendation`] | the cheapest setting that was measured to reach a wanted error |
//! | [`study`] | what a study is made of: metrics, runs, diagrams, the stopwatch |
//! | [`stats`] | rms, bias, scatter and bounds of errors; quartiles of repeats |
//!
//! A [`Run`] is a setting that was run: its errors, its work, its counts. A [`Diagram`] draws one error of a section's
//! runs against one kind of work. Nothing here reads the clock: it is given ([`Stopwatch`]).

pub mod centres;
pub mod fits;
pub mod recommendation;
mod recording_diagrams;
pub mod recording_metrics;
mod recording_plan;
pub mod recordings;
mod rendering;
pub mod simulator;
pub mod stats;
pub mod study;
pub mod todays_tools;

use recommendation::{Recommendation, Requirement};
use schemars::JsonSchema;
use serde::Serialize;
pub use study::{
    CostError, CostProgress, Diagram, ErrorFloor, Metric, Run, SettingCurve, Stopwatch, Subject,
};

/// What it ran on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Machine {
    /// Processor by its own name, where the system tells.
    pub processor: Option<String>,
    /// Cores in use.
    pub cores: usize,
    /// Operating system.
    pub system: &'static str,
    /// Whether the program was built with debug assertions, which `make` does; a release build has none.
    pub debug_build: bool,
}

impl Machine {
    /// This one.
    #[must_use]
    pub fn this() -> Self {
        let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let named = |line: &str| {
            let (key, value) = line.split_once(':')?;
            (key.trim() == "model name").then(|| value.split_whitespace().collect::<Vec<_>>().join(" "))
        };
        Self {
            processor: cpuinfo.lines().find_map(named).filter(|name| !name.is_empty()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            system: std::env::consts::OS,
            debug_build: cfg!(debug_assertions),
        }
    }

    /// As a line for people.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "{}, {} core{}, {}, {} build",
            self.processor.as_deref().unwrap_or("processor unknown"),
            self.cores,
            if self.cores == 1 { "" } else { "s" },
            self.system,
            if self.debug_build { "dev" } else { "release" }
        )
    }
}

/// Everything that was run.
#[derive(Debug, Clone)]
pub struct CostReport {
    /// On what.
    pub machine: Machine,
    /// Whether it is the coarse version.
    pub quick: bool,
    /// How long all of it took, s.
    pub took_s: f64,
    /// The subjects.
    pub sections: Vec<Subject>,
    /// The settings of the runs of the section `whole`, in its order.
    pub whole_settings: Vec<recordings::RecordingSetting>,
    /// What to take for what was wanted.
    pub recommendation: Recommendation,
}

impl CostReport {
    /// The section of that name.
    #[must_use]
    pub fn section(&self, name: &str) -> Option<&Subject> {
        self.sections.iter().find(|s| s.name == name)
    }
}

/// What is run.
#[derive(Debug, Clone, PartialEq)]
pub struct CostPlan {
    /// Whether it is the coarse version.
    pub quick: bool,
    /// Centres.
    pub centres: centres::CentrePlan,
    /// Whole recordings.
    pub whole: recordings::RecordingPlan,
    /// The simulator.
    pub simulator: simulator::SimulatorPlan,
    /// The fits.
    pub fits: fits::FitPlan,
}

impl CostPlan {
    /// All of it: minutes.
    #[must_use]
    pub fn full() -> Self {
        Self {
            quick: false,
            centres: centres::CentrePlan::full(),
            whole: recordings::RecordingPlan::full(),
            simulator: simulator::SimulatorPlan::full(),
            fits: fits::FitPlan::full(),
        }
    }

    /// A coarse version: half a minute.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            quick: true,
            centres: centres::CentrePlan::quick(),
            whole: recordings::RecordingPlan::quick(),
            simulator: simulator::SimulatorPlan::quick(),
            fits: fits::FitPlan::quick(),
        }
    }

    fn units(&self) -> f64 {
        self.centres.units() + self.whole.units() + self.simulator.units() + self.fits.units()
    }
}

/// The plan's part of the work; how many settings are tried again is not known beforehand.
const PLANNED_PART: f64 = 0.9;

/// Runs `plan`, and says what to take for `requirements`.
///
/// # Errors
/// See [`CostError`].
pub fn run(
    plan: &CostPlan,
    requirements: &[Requirement],
    clock: &dyn Fn() -> f64,
    progress: &mut dyn FnMut(CostProgress),
) -> Result<CostReport, CostError> {
    let mut stopwatch = Stopwatch::new(plan.units() / PLANNED_PART, clock, progress);
    let start_s = clock();
    let centres = centres::run(&plan.centres, &mut stopwatch)?;
    let (whole, whole_settings) = recordings::run(&plan.whole, &mut stopwatch)?;
    let simulator = simulator::run(&plan.simulator, &mut stopwatch)?;
    let fits = fits::run(&plan.fits, &mut stopwatch)?;
    let is_choice = |i: usize| whole_settings[i].level().is_some();
    let recommendation = recommendation::recommend(&whole, requirements, is_choice, |i| {
        recordings::refusal(&whole_settings[i], requirements, &mut stopwatch)
    })?;
    let mut sections = vec![centres, whole];
    sections.extend(simulator);
    sections.push(fits);
    Ok(CostReport {
        machine: Machine::this(),
        quick: plan.quick,
        took_s: clock() - start_s,
        sections,
        whole_settings,
        recommendation,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_has_a_core_and_a_line() {
        let machine = Machine::this();
        assert!(machine.cores >= 1);
        assert!(machine.words().contains("core"));
    }
}
