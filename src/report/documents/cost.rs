//! `cost.json`: every run with its errors, its work and its counts; schema `track.cost/1`.

use super::OrderedObject;
use crate::Build;
use crate::cost::recordings::Check;
use crate::cost::stats::{ErrorStatistics, Quartiles};
use crate::cost::{CostReport, Diagram, ErrorFloor, Machine, Metric, Run, SettingCurve, Subject};
use schemars::JsonSchema;
use serde::Serialize;

/// The schema that [`CostDocument`] follows.
pub const SCHEMA: &str = "track.cost/1";

/// A study of what accuracy costs.
#[derive(Debug, Serialize, JsonSchema)]
pub struct CostDocument<'a> {
    /// `track.cost/1`.
    pub schema: &'static str,
    /// The program that wrote it.
    #[serde(flatten)]
    pub build: Build,
    /// Whether it is the coarse version.
    pub quick: bool,
    /// How long all of it took.
    pub took_s: f64,
    /// What it ran on.
    pub machine: &'a Machine,
    /// What to take for what was wanted.
    pub recommendation: RecommendationDocument<'a>,
    /// The subjects.
    pub sections: Vec<SubjectDocument<'a>>,
}

/// What to take.
#[derive(Debug, Serialize, JsonSchema)]
pub struct RecommendationDocument<'a> {
    /// How large an error may be, by the name of its quantity.
    pub wanted: OrderedObject<&'static str, f64>,
    /// The recommendation for people.
    pub words: &'a str,
    /// The run that is recommended.
    pub run: Option<RunDocument<'a>>,
    /// Cheaper runs that new recordings did not bear out.
    pub set_aside: Vec<SetAsideRunDocument<'a>>,
    /// The recommended setting on new recordings.
    pub check: Option<&'a Check>,
}

/// A run that was not recommended, though it reached what was wanted.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SetAsideRunDocument<'a> {
    /// Which.
    pub run: RunDocument<'a>,
    /// Why.
    pub reason: &'a str,
}

/// A subject of the study.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SubjectDocument<'a> {
    /// Its name.
    pub name: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// What was run, and what was found.
    pub words: &'a [String],
    /// The errors that its runs hold.
    pub errors: &'a [Metric],
    /// The work that its runs hold.
    pub work: &'a [Metric],
    /// What was run.
    pub runs: Vec<RunDocument<'a>>,
    /// What is drawn of it.
    pub diagrams: Vec<DiagramDocument<'a>>,
}

/// A setting that was run.
#[derive(Debug, Serialize, JsonSchema)]
pub struct RunDocument<'a> {
    /// What was set.
    pub settings: OrderedObject<&'static str, &'a str>,
    /// Whether the program takes this by itself.
    pub default: bool,
    /// Errors by the name of their quantity.
    pub errors: OrderedObject<&'static str, ErrorStatistics>,
    /// Work by its name.
    pub work: OrderedObject<&'static str, Quartiles>,
    /// Counts beside the work.
    pub counts: OrderedObject<&'static str, f64>,
    /// Why it failed, in all of its repeats or in some.
    pub failed: Option<&'a str>,
}

/// Error against work.
#[derive(Debug, Serialize, JsonSchema)]
pub struct DiagramDocument<'a> {
    /// What is drawn.
    pub title: &'a str,
    /// Upwards: the name of an error.
    pub error: &'static str,
    /// To the right: the name of a kind of work.
    pub work: &'static str,
    /// Errors below which no setting can get.
    pub floors: &'a [ErrorFloor],
    /// What is connected.
    pub curves: &'a [SettingCurve],
    /// The Pareto fronts: indices of runs.
    pub fronts: Vec<Vec<usize>>,
}

impl<'a> CostDocument<'a> {
    /// Everything. `check` is the recommendation run again, if it was.
    #[must_use]
    pub fn new(report: &'a CostReport, check: Option<&'a Check>) -> Self {
        let recommendation = &report.recommendation;
        let whole = report.section("whole");
        let set_aside = recommendation.set_aside.iter().filter_map(|(i, why)| {
            Some(SetAsideRunDocument {
                run: run(&whole?.runs[*i]),
                reason: why,
            })
        });
        let wanted = recommendation.requirements.iter();
        Self {
            schema: SCHEMA,
            build: Build::THIS,
            quick: report.quick,
            took_s: report.took_s,
            machine: &report.machine,
            recommendation: RecommendationDocument {
                wanted: wanted.map(|w| (w.quantity.name, w.at_most)).collect(),
                words: &recommendation.words,
                run: recommendation
                    .chosen
                    .zip(whole)
                    .map(|(i, whole)| run(&whole.runs[i])),
                set_aside: set_aside.collect(),
                check,
            },
            sections: report.sections.iter().map(subject).collect(),
        }
    }
}

fn subject(subject: &Subject) -> SubjectDocument<'_> {
    SubjectDocument {
        name: subject.name,
        title: subject.title,
        words: &subject.words,
        errors: &subject.errors,
        work: &subject.works,
        runs: subject.runs.iter().map(run).collect(),
        diagrams: subject
            .diagrams
            .iter()
            .map(|d| diagram(d, &subject.runs))
            .collect(),
    }
}

fn run(run: &Run) -> RunDocument<'_> {
    RunDocument {
        settings: run.settings.iter().map(|(k, v)| (*k, v.as_str())).collect(),
        default: run.is_default,
        errors: OrderedObject(run.errors.clone()),
        work: OrderedObject(run.work.clone()),
        counts: OrderedObject(run.counts.clone()),
        failed: run.failed.as_deref(),
    }
}

fn diagram<'a>(diagram: &'a Diagram, runs: &[Run]) -> DiagramDocument<'a> {
    DiagramDocument {
        title: &diagram.title,
        error: diagram.error.name,
        work: diagram.work.name,
        floors: &diagram.floors,
        curves: &diagram.curves,
        fronts: diagram.fronts(runs),
    }
}
