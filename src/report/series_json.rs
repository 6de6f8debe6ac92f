//! `fit.json` and what `track fit --json` prints: schema `track.fit/1`.
//!
//! A parameter that the data do not determine is `null`, and `not_determined` says why. Angles are degrees here.

use super::json::quantity;
use crate::Build;
use crate::rebound::fit::{
    CourtPace, Estimate, Fitted, GroupFit, ModelFit, Note, Parameter, SeriesFit, Weights,
};
use crate::rebound::itf::Pace;
use serde_json::{Map, Value, json};

/// The schema that [`fit_json`] follows.
pub const SCHEMA: &str = "track.fit/1";

/// The fit of a series, keys in the order of the contract.
#[must_use]
pub fn fit_json(fit: &SeriesFit) -> Value {
    json!({
        "schema": SCHEMA,
        "version": Build::THIS.version,
        "commit": Build::THIS.commit,
        "series": fit.name,
        "columns": fit.set.name(),
        "weights": match fit.weights {
            Weights::Stated => "stated",
            Weights::Unit => "unit",
        },
        "groups": fit.groups.iter().map(group).collect::<Vec<_>>(),
        "warnings": notes(&fit.notes),
    })
}

fn group(group: &GroupFit) -> Value {
    let set_aside: Vec<Value> = group
        .rows_set_aside
        .iter()
        .map(|aside| json!({"row": aside.row, "reason": aside.reason}))
        .collect();
    json!({
        "name": group.name,
        "rows": group.rows,
        "models": group.models.iter().map(model).collect::<Vec<_>>(),
        "preferred": group.preferred.name(),
        "reason": group.reason,
        "rows_used": group.rows_used,
        "rows_set_aside": set_aside,
        "warnings": notes(&group.notes),
        "court_pace": group.court_pace.as_ref().map(court_pace),
    })
}

fn model(fit: &ModelFit) -> Value {
    let mut parameters = Map::new();
    let mut not_determined = Map::new();
    for parameter in Parameter::ALL {
        let fitted = fit.parameter(parameter);
        parameters.insert(parameter.name().to_owned(), estimate(fitted, 1.0));
        if let Some(reason) = fitted.reason() {
            not_determined.insert(parameter.name().to_owned(), json!(reason));
        }
    }
    let transition = &fit.transition;
    if let Some(reason) = transition.angle_rad.reason() {
        not_determined.insert("transition_angle_deg".to_owned(), json!(reason));
    }
    let degrees = 1_f64.to_degrees();
    json!({
        "name": fit.name.name(),
        "converged": fit.converged,
        "parameters": parameters,
        "transition_angle_deg": estimate(&transition.angle_rad, degrees),
        "transition_spin_ratio": finite(transition.spin_ratio),
        "transition_without_jump_deg": quantity(transition.without_jump_rad.map(|q| q.scaled(degrees))),
        "not_determined": not_determined,
        "chi2": finite(fit.chi2),
        "degrees_of_freedom": fit.degrees_of_freedom,
        "parameter_count": fit.parameter_count,
        "p_value": fit.p_value.and_then(finite),
        "scatter": finite(fit.scatter),
        "log_likelihood": fit.log_likelihood.and_then(finite),
        "aicc": fit.aicc.and_then(finite),
        "bic": fit.bic.and_then(finite),
        "impossible": fit.impossible,
        "rows_sliding": fit.sliding,
        "rows_gripping": fit.gripping,
    })
}

/// A quantity with its interval, times `factor`; `null` where it is not determined.
fn estimate(fitted: &Fitted, factor: f64) -> Value {
    let Some(Estimate {
        quantity: q,
        interval_95: (low, high),
    }) = fitted.estimate()
    else {
        return Value::Null;
    };
    let mut value = quantity(Some(q.scaled(factor)));
    if let Some(object) = value.as_object_mut() {
        let end = |end: &Option<f64>| end.and_then(|x| finite(factor * x));
        object.insert("interval_95".to_owned(), json!([end(low), end(high)]));
    }
    value
}

fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

fn notes(notes: &[Note]) -> Vec<Value> {
    notes
        .iter()
        .map(|note| json!({"code": note.code, "message": note.message}))
        .collect()
}

fn court_pace(pace: &CourtPace) -> Value {
    json!({
        "temperature_c": pace.temperature_c,
        "rating": estimate(&pace.rating, 1.0),
        "reason": pace.rating.reason(),
        "class": pace.class.map(pace_name),
        "class_interval_95": pace.class_interval_95.map(|(low, high)| [pace_name(low), pace_name(high)]),
        "restitution": quantity(pace.restitution),
        "friction": quantity(pace.friction),
    })
}

/// A class by the name that the standard gives it.
pub(super) fn pace_name(pace: Pace) -> &'static str {
    match pace {
        Pace::Slow => "slow",
        Pace::MediumSlow => "medium-slow",
        Pace::Medium => "medium",
        Pace::MediumFast => "medium-fast",
        Pace::Fast => "fast",
    }
}
