//! What a study is made of: metrics, the runs of many settings, the diagrams that compare them, and the clock they are
//! timed by.

use super::stats::{ErrorStatistics, Quartiles};
use crate::calibration::CalibrationError;
use crate::frames::FrameError;
use crate::simulate::{SceneError, SimulationWriteError};
use schemars::JsonSchema;
use serde::Serialize;

/// A number that is drawn or listed: an error or a kind of work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Metric {
    /// Its name in files.
    pub name: &'static str,
    /// Its name on axes, without the unit.
    pub words: &'static str,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
}

impl Metric {
    /// Name and unit, as an axis says it.
    #[must_use]
    pub fn axis(&self) -> String {
        if self.unit.is_empty() {
            self.words.to_owned()
        } else {
            format!("{} / {}", self.words, self.unit)
        }
    }
}

/// A setting that was run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// What was set, by name.
    pub settings: Vec<(&'static str, String)>,
    /// Errors by the name of their quantity; what was never measured is not here.
    pub errors: Vec<(&'static str, ErrorStatistics)>,
    /// Work by name: seconds over the repeats, or exact amounts.
    pub work: Vec<(&'static str, Quartiles)>,
    /// Counts of work beside the seconds: frames, centres, evaluations.
    pub counts: Vec<(&'static str, f64)>,
    /// Why it failed, in all of its repeats or in some.
    pub failed: Option<String>,
    /// Whether these are the settings that the program takes by itself.
    pub is_default: bool,
}

impl Run {
    /// The errors of a quantity.
    #[must_use]
    pub fn error(&self, quantity: &str) -> Option<&ErrorStatistics> {
        self.errors
            .iter()
            .find(|(name, _)| *name == quantity)
            .map(|(_, e)| e)
    }

    /// Work by its name.
    #[must_use]
    pub fn work(&self, name: &str) -> Option<&Quartiles> {
        self.work.iter().find(|(n, _)| *n == name).map(|(_, w)| w)
    }

    /// A setting by its name.
    #[must_use]
    pub fn setting(&self, name: &str) -> Option<&str> {
        self.settings
            .iter()
            .find(|(n, _)| *n == name)
            .map(|(_, value)| value.as_str())
    }

    /// Error and work, where both were measured and are above 0, as logarithms need it.
    #[must_use]
    pub fn place(&self, quantity: &Metric, work: &Metric) -> Option<(f64, f64)> {
        let error = self.error(quantity.name)?.rms;
        let work = self.work(work.name)?.median;
        (error > 0.0 && work > 0.0 && error.is_finite() && work.is_finite()).then_some((work, error))
    }
}

/// A line below which no setting can get: a bound, or the error of what it is compared with.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ErrorFloor {
    /// What it is.
    pub name: String,
    /// In the unit of the error.
    pub error: f64,
}

/// Settings of one kind, in their order.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct SettingCurve {
    /// What they have in common.
    pub name: String,
    /// Indices into the section's runs.
    pub runs: Vec<usize>,
}

/// Error against work, both logarithmic.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagram {
    /// What is drawn.
    pub title: String,
    /// Upwards.
    pub error: Metric,
    /// To the right.
    pub work: Metric,
    /// Lines below which nothing can get.
    pub floors: Vec<ErrorFloor>,
    /// What is connected.
    pub curves: Vec<SettingCurve>,
    /// Whether the curves are choices for one and the same task: then they have one front together, else one each.
    pub alternatives: bool,
    /// Whether it is one of the few for an overview.
    pub overview: bool,
    /// Whether less of the work is better; else there is no front.
    pub less_is_better: bool,
}

impl Diagram {
    /// The runs that no other for the same task beats in both error and work, from the least work on. A run that failed in
    /// part is not among them: what it reached, it did not reach reliably.
    #[must_use]
    pub fn fronts(&self, runs: &[Run]) -> Vec<Vec<usize>> {
        if !self.less_is_better {
            return Vec::new();
        }
        if self.alternatives {
            vec![self.front(runs, self.curves.iter().flat_map(|c| &c.runs))]
        } else {
            self.curves.iter().map(|c| self.front(runs, &c.runs)).collect()
        }
    }

    fn front<'a>(&self, runs: &[Run], among: impl IntoIterator<Item = &'a usize>) -> Vec<usize> {
        let mut placed: Vec<(f64, f64, usize)> = among
            .into_iter()
            .filter(|&&i| runs[i].failed.is_none())
            .filter_map(|&i| runs[i].place(&self.error, &self.work).map(|(w, e)| (w, e, i)))
            .collect();
        placed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut least = f64::INFINITY;
        placed.retain(|&(_, error, _)| {
            let better = error < least;
            least = least.min(error);
            better
        });
        placed.into_iter().map(|(_, _, i)| i).collect()
    }
}

/// One subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    /// Its name in files.
    pub name: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// What was run, and what was found: a paragraph each.
    pub words: Vec<String>,
    /// The errors that its runs hold.
    pub errors: Vec<Metric>,
    /// The work that its runs hold.
    pub works: Vec<Metric>,
    /// What was run.
    pub runs: Vec<Run>,
    /// What is drawn of it.
    pub diagrams: Vec<Diagram>,
}

/// How far the work has come.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CostProgress {
    /// What is being run.
    pub what: &'static str,
    /// From 0 to 1.
    pub done: f64,
}

/// The clock (seconds from any moment on), and whoever requirements to know how far the work has come.
pub struct Stopwatch<'a> {
    clock: &'a dyn Fn() -> f64,
    progress: &'a mut dyn FnMut(CostProgress),
    done: f64,
    total: f64,
    what: &'static str,
}

impl<'a> Stopwatch<'a> {
    /// For work of so many units.
    pub fn new(units: f64, clock: &'a dyn Fn() -> f64, progress: &'a mut dyn FnMut(CostProgress)) -> Self {
        Self {
            clock,
            progress,
            done: 0.0,
            total: units,
            what: "",
        }
    }

    /// What `work` gives, and the seconds it took.
    pub fn timed<T>(&self, work: impl FnOnce() -> T) -> (T, f64) {
        let start_s = (self.clock)();
        let given = work();
        (given, (self.clock)() - start_s)
    }

    pub(super) fn start(&mut self, what: &'static str) {
        self.what = what;
        self.advance(0.0);
    }

    /// Begins anew, with `units` of work.
    pub(super) fn restart(&mut self, what: &'static str, units: f64) {
        (self.done, self.total) = (0.0, units);
        self.start(what);
    }

    /// Begins work that was not among the total, `units` of it: it fills half of what is left.
    pub(super) fn start_more(&mut self, what: &'static str, units: f64) {
        let part = (self.done / self.total).clamp(0.0, 0.99);
        self.total = 2.0 * units / (1.0 - part);
        self.done = part * self.total;
        self.start(what);
    }

    pub(super) fn advance(&mut self, units: f64) {
        self.done += units;
        (self.progress)(CostProgress {
            what: self.what,
            done: (self.done / self.total).clamp(0.0, 1.0),
        });
    }
}

/// What can keep it from running. A setting at which nothing can be measured is no error but a [`Run`] that failed.
#[derive(Debug, thiserror::Error)]
pub enum CostError {
    /// A scene of its own that cannot be flown.
    #[error("a scene of the cost study cannot be simulated")]
    Scene(#[from] SceneError),
    /// A recording could not be rendered.
    #[error("a recording of the cost study could not be written to the temporary folder (TMPDIR)")]
    Render(#[from] SimulationWriteError),
    /// A rendered recording could not be read.
    #[error("a rendered recording of the cost study could not be read again")]
    Frames(#[from] FrameError),
    /// Nor its calibration.
    #[error("the calibration of a rendered recording could not be read again")]
    Calibration(#[from] CalibrationError),
    /// No temporary folder.
    #[error(
        "no temporary folder for the recordings could be made; set TMPDIR to a folder with 100 MB of space"
    )]
    Folder(#[source] std::io::Error),
    /// A series of its own that cannot be fitted.
    #[error("a series of the cost study cannot be fitted")]
    Fit(#[from] crate::rebound::fit::FitError),
}

#[cfg(test)]
mod tests {
    use super::*;

    const ERROR: Metric = Metric {
        name: "error",
        words: "error",
        unit: "px",
    };
    const WORK: Metric = Metric {
        name: "work_s",
        words: "time",
        unit: "s",
    };

    fn run_at(work: f64, error: f64, failed: bool) -> Run {
        Run {
            settings: Vec::new(),
            errors: vec![("error", ErrorStatistics::of(&[error]).unwrap())],
            work: vec![("work_s", Quartiles::exact(work))],
            counts: Vec::new(),
            failed: failed.then(|| "no".to_owned()),
            is_default: false,
        }
    }

    #[test]
    fn the_front_holds_what_nothing_beats_in_both() {
        let runs = [
            run_at(1.0, 0.5, false),
            run_at(2.0, 0.6, false),
            run_at(2.0, 0.1, false),
            run_at(3.0, 0.1, false),
            run_at(4.0, 0.01, true),
            run_at(5.0, 0.05, false),
            run_at(6.0, 0.0, false),
        ];
        let diagram = Diagram {
            title: String::new(),
            error: ERROR,
            work: WORK,
            floors: Vec::new(),
            curves: vec![
                SettingCurve {
                    name: String::new(),
                    runs: vec![5, 3, 1],
                },
                SettingCurve {
                    name: String::new(),
                    runs: vec![0, 2, 4, 6],
                },
            ],
            alternatives: true,
            overview: false,
            less_is_better: true,
        };
        assert_eq!(diagram.fronts(&runs), [[0, 2, 5]]);
        let apart = Diagram {
            alternatives: false,
            ..diagram
        };
        assert_eq!(apart.fronts(&runs), [vec![1, 3, 5], vec![0, 2]]);
    }
}
