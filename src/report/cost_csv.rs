//! `cost.csv`: every run with its errors, its work and its counts.

use crate::cost::stats::{ErrorStatistics, Quartiles};
use crate::cost::{CostReport, Metric, Run, Subject};

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
