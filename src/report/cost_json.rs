//! `cost.json` and `cost.csv`: every run with its errors, its work and its counts; schema `track.cost/1`.

use crate::Build;
use crate::cost::recordings::Check;
use crate::cost::stats::{ErrorStatistics, Quartiles};
use crate::cost::{CostReport, Diagram, Metric, Run, Subject};
use serde_json::{Map, Value, json};

/// The schema that [`cost_json`] follows.
pub const SCHEMA: &str = "track.cost/1";

/// Everything. `check` is the recommendation run again, if it was.
#[must_use]
pub fn cost_json(report: &CostReport, check: Option<&Check>) -> Value {
    let recommendation = &report.recommendation;
    let requirements: Map<String, Value> = recommendation
        .requirements
        .iter()
        .map(|w| (w.quantity.name.to_owned(), json!(w.at_most)))
        .collect();
    let set_aside: Vec<Value> = recommendation
        .set_aside
        .iter()
        .filter_map(|(i, why)| {
            let whole = report.section("whole")?;
            Some(json!({"run": run(&whole.runs[*i]), "reason": why}))
        })
        .collect();
    let chosen = recommendation.chosen.zip(report.section("whole"));
    json!({
        "schema": SCHEMA,
        "version": Build::THIS.version,
        "commit": Build::THIS.commit,
        "quick": report.quick,
        "took_s": report.took_s,
        "machine": {
            "processor": report.machine.processor,
            "cores": report.machine.cores,
            "system": report.machine.system,
            "debug_build": report.machine.debug_build,
        },
        "recommendation": {
            "wanted": requirements,
            "words": recommendation.words,
            "run": chosen.map(|(i, whole)| run(&whole.runs[i])),
            "set_aside": set_aside,
            "check": check.map(|c| json!({
                "recordings": c.recordings, "inside": c.inside, "first_miss": c.first_miss
            })),
        },
        "sections": report.sections.iter().map(section).collect::<Vec<_>>(),
    })
}

fn section(section: &Subject) -> Value {
    json!({
        "name": section.name,
        "title": section.title,
        "words": section.words,
        "errors": section.errors.iter().map(measure).collect::<Vec<_>>(),
        "work": section.works.iter().map(measure).collect::<Vec<_>>(),
        "runs": section.runs.iter().map(run).collect::<Vec<_>>(),
        "diagrams": section.diagrams.iter().map(|d| diagram(d, &section.runs)).collect::<Vec<_>>(),
    })
}

fn measure(measure: &Metric) -> Value {
    json!({"name": measure.name, "words": measure.words, "unit": measure.unit})
}

fn run(run: &Run) -> Value {
    let map = |pairs: Vec<(&str, Value)>| -> Map<String, Value> {
        pairs.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    };
    json!({
        "settings": map(run.settings.iter().map(|(k, v)| (*k, json!(v))).collect()),
        "default": run.is_default,
        "errors": map(run.errors.iter().map(|(k, e)| (*k, errors(e))).collect()),
        "work": map(run.work.iter().map(|(k, s)| (*k, spread(s))).collect()),
        "counts": map(run.counts.iter().map(|(k, c)| (*k, json!(c))).collect()),
        "failed": run.failed,
    })
}

fn errors(e: &ErrorStatistics) -> Value {
    json!({"count": e.count, "rms": e.rms, "bias": e.bias, "scatter": e.scatter, "p95": e.p95, "bound_95": e.bound_95})
}

fn spread(s: &Quartiles) -> Value {
    json!({"min": s.min, "q1": s.q1, "median": s.median, "q3": s.q3, "repeats": s.repeats})
}

fn diagram(diagram: &Diagram, runs: &[Run]) -> Value {
    let floors: Vec<Value> = diagram
        .floors
        .iter()
        .map(|f| json!({"name": f.name, "error": f.error}))
        .collect();
    let curves: Vec<Value> = diagram
        .curves
        .iter()
        .map(|c| json!({"name": c.name, "runs": c.runs}))
        .collect();
    json!({
        "title": diagram.title,
        "error": diagram.error.name,
        "work": diagram.work.name,
        "floors": floors,
        "curves": curves,
        "fronts": diagram.fronts(runs),
    })
}

/// A row for each run and error: a run without any has one with empty errors.
///
/// # Errors
/// None in memory; `csv` says so where its own writer fails.
pub fn cost_csv(report: &CostReport) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record([
        "section",
        "settings",
        "default",
        "error",
        "unit",
        "count",
        "rms",
        "bias",
        "scatter",
        "p95",
        "bound_95",
        "work",
        "work_min",
        "work_q1",
        "work_median",
        "work_q3",
        "counts",
        "failed",
    ])?;
    for section in &report.sections {
        for run in &section.runs {
            let quantities: Vec<Option<&Metric>> = if run.errors.is_empty() {
                vec![None]
            } else {
                section
                    .errors
                    .iter()
                    .filter(|m| run.error(m.name).is_some())
                    .map(Some)
                    .collect()
            };
            for quantity in quantities {
                for work in &run.work {
                    writer.write_record(row(section, run, quantity, *work))?;
                }
            }
        }
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

fn row(
    section: &Subject,
    run: &Run,
    quantity: Option<&Metric>,
    (work, spread): (&'static str, Quartiles),
) -> Vec<String> {
    let listed = |pairs: Vec<(&str, String)>| {
        pairs
            .iter()
            .map(|(k, v)| format!("{k}={v}"))
            .collect::<Vec<_>>()
            .join("; ")
    };
    let error = quantity.and_then(|q| run.error(q.name));
    let number = |of: fn(&ErrorStatistics) -> f64| error.map_or(String::new(), |e| of(e).to_string());
    vec![
        section.name.to_owned(),
        listed(run.settings.iter().map(|(k, v)| (*k, v.clone())).collect()),
        run.is_default.to_string(),
        quantity.map_or("", |q| q.name).to_owned(),
        quantity.map_or("", |q| q.unit).to_owned(),
        error.map_or(String::new(), |e| e.count.to_string()),
        number(|e| e.rms),
        number(|e| e.bias),
        number(|e| e.scatter),
        number(|e| e.p95),
        number(|e| e.bound_95),
        work.to_owned(),
        spread.min.to_string(),
        spread.q1.to_string(),
        spread.median.to_string(),
        spread.q3.to_string(),
        listed(run.counts.iter().map(|(k, c)| (*k, c.to_string())).collect()),
        run.failed.clone().unwrap_or_default(),
    ]
}
