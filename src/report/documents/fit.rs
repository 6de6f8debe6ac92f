//! `fit.json` and what `track fit --json` prints: schema `track.fit/1`.
//!
//! A parameter that the data do not determine is `null`, and `not_determined` says why.

use super::{OrderedObject, WarningDocument, quantity};
use crate::Build;
use crate::quantity::Quantity;
use crate::rebound::fit::{CourtPace, Estimate, Fitted, GroupFit, ModelFit, Note, SeriesFit, Weights};
use crate::rebound::itf::Pace;
use schemars::JsonSchema;
use serde::Serialize;

/// The schema that [`FitDocument`] follows.
pub const SCHEMA: &str = "track.fit/1";

/// The fit of a series.
#[derive(Debug, Serialize, JsonSchema)]
pub struct FitDocument<'a> {
    /// `track.fit/1`.
    pub schema: &'static str,
    /// The program that wrote it.
    #[serde(flatten)]
    pub build: Build,
    /// What the series is called.
    pub series: &'a str,
    /// The set of columns that the fit is made of.
    pub columns: &'static str,
    /// `stated` (by the rows' standard deviations) or `unit` (all rows the same).
    pub weights: &'static str,
    /// Group by group, in the order of the file.
    pub groups: Vec<GroupDocument<'a>>,
    /// What to know of the whole.
    pub warnings: Vec<WarningDocument<'a>>,
}

/// The fit of one group.
#[derive(Debug, Serialize, JsonSchema)]
pub struct GroupDocument<'a> {
    /// Its name.
    pub name: &'a str,
    /// Rows of the file in it.
    pub rows: usize,
    /// The models; none where no row could be used.
    pub models: Vec<ModelDocument<'a>>,
    /// The preferred model's name, or `undetermined`.
    pub preferred: &'static str,
    /// Why.
    pub reason: &'a str,
    /// Numbers of the rows in use.
    pub rows_used: &'a [usize],
    /// Rows that are not.
    pub rows_set_aside: Vec<SetAsideDocument<'a>>,
    /// What to know of the group.
    pub warnings: Vec<WarningDocument<'a>>,
    /// Where it was asked for.
    pub court_pace: Option<CourtPaceDocument<'a>>,
}

/// A row that is not in the fit.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SetAsideDocument<'a> {
    /// Its number.
    pub row: usize,
    /// Why.
    pub reason: &'a str,
}

/// A model fitted to the rows of a group.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ModelDocument<'a> {
    /// `mu_e`, `e_e` or `grip_slide`.
    pub name: &'static str,
    /// Whether the search came to its end.
    pub converged: bool,
    /// Restitution, friction, static friction, tangential restitution, spin ratio; `null` what is not determined.
    pub parameters: OrderedObject<&'static str, Option<EstimateDocument>>,
    /// The incident angle at which sliding begins.
    pub transition_angle_deg: Option<EstimateDocument>,
    /// The spin ratio before the bounce for which it holds.
    #[schemars(with = "Option<f64>")]
    pub transition_spin_ratio: f64,
    /// The same angle if static friction equals friction.
    pub transition_without_jump_deg: Option<Quantity>,
    /// Why a parameter or the angle is `null`, by its name.
    pub not_determined: OrderedObject<&'static str, &'a str>,
    /// Sum of squared residuals over their variances (of residuals in SI units where the weights are `unit`).
    #[schemars(with = "Option<f64>")]
    pub chi2: f64,
    /// Equations less parameters.
    pub degrees_of_freedom: usize,
    /// Parameters that the data determine, the scatter's scale among them where it is fitted.
    pub parameter_count: usize,
    /// Probability of a χ² as large as this if the model is right.
    pub p_value: Option<f64>,
    /// What standard uncertainties were multiplied by, as the scatter asks for.
    #[schemars(with = "Option<f64>")]
    pub scatter: f64,
    /// Logarithm of the likelihood at its highest.
    pub log_likelihood: Option<f64>,
    /// Akaike's criterion for small samples.
    pub aicc: Option<f64>,
    /// Bayes' criterion.
    pub bic: Option<f64>,
    /// Why the model cannot be, whatever its fit.
    pub impossible: Option<&'a str>,
    /// Rows that slide.
    pub rows_sliding: usize,
    /// Rows that leave rolling, or grip.
    pub rows_gripping: usize,
}

/// A fitted number.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EstimateDocument {
    /// The best estimate.
    pub value: f64,
    /// Its standard uncertainty, of the longer side where the interval is not symmetric.
    pub std_uncertainty: Option<f64>,
    /// From, to: holds the truth in 95 of 100 series; `null` where the data set no bound.
    pub interval_95: [Option<f64>; 2],
}

/// A court pace rating (ITF CS 01/02).
#[derive(Debug, Serialize, JsonSchema)]
pub struct CourtPaceDocument<'a> {
    /// Temperature of the rating.
    pub temperature_c: f64,
    /// CPR.
    pub rating: Option<EstimateDocument>,
    /// Why there is none.
    pub reason: Option<&'a str>,
    /// The class of the rating.
    pub class: Option<&'static str>,
    /// The classes at the ends of its interval.
    pub class_interval_95: Option<[&'static str; 2]>,
    /// e that it was made of, every bounce taken as sliding.
    pub restitution: Option<Quantity>,
    /// μ that it was made of.
    pub friction: Option<Quantity>,
}

impl<'a> FitDocument<'a> {
    /// The document of a fit.
    #[must_use]
    pub fn new(fit: &'a SeriesFit) -> Self {
        Self {
            schema: SCHEMA,
            build: Build::THIS,
            series: &fit.name,
            columns: fit.set.name(),
            weights: match fit.weights {
                Weights::Stated => "stated",
                Weights::Unit => "unit",
            },
            groups: fit.groups.iter().map(group).collect(),
            warnings: warnings(&fit.notes),
        }
    }
}

fn warnings(notes: &[Note]) -> Vec<WarningDocument<'_>> {
    let each = notes.iter().map(|note| WarningDocument {
        code: note.code,
        message: &note.message,
    });
    each.collect()
}

fn group(group: &GroupFit) -> GroupDocument<'_> {
    let set_aside = group.rows_set_aside.iter().map(|aside| SetAsideDocument {
        row: aside.row,
        reason: &aside.reason,
    });
    GroupDocument {
        name: &group.name,
        rows: group.rows,
        models: group.models.iter().map(model).collect(),
        preferred: group.preferred.name(),
        reason: &group.reason,
        rows_used: &group.rows_used,
        rows_set_aside: set_aside.collect(),
        warnings: warnings(&group.notes),
        court_pace: group.court_pace.as_ref().map(court_pace),
    }
}

fn model(fit: &ModelFit) -> ModelDocument<'_> {
    let transition = &fit.transition;
    let reported = fit.name.model().reported();
    let parameters = || reported.iter().map(|&p| (p.name(), fit.parameter(p)));
    let not_determined = parameters()
        .chain([("transition_angle_deg", &transition.angle_rad)])
        .filter_map(|(name, fitted)| Some((name, fitted.reason()?)));
    let degrees = 1_f64.to_degrees();
    ModelDocument {
        name: fit.name.name(),
        converged: fit.converged,
        parameters: parameters()
            .map(|(name, fitted)| (name, estimate(fitted, 1.0)))
            .collect(),
        transition_angle_deg: estimate(&transition.angle_rad, degrees),
        transition_spin_ratio: transition.spin_ratio,
        transition_without_jump_deg: quantity(transition.without_jump_rad.map(|q| q.scaled(degrees))),
        not_determined: not_determined.collect(),
        chi2: fit.chi2,
        degrees_of_freedom: fit.degrees_of_freedom,
        parameter_count: fit.parameter_count,
        p_value: fit.p_value,
        scatter: fit.scatter,
        log_likelihood: fit.log_likelihood,
        aicc: fit.aicc,
        bic: fit.bic,
        impossible: fit.impossible.as_deref(),
        rows_sliding: fit.sliding,
        rows_gripping: fit.gripping,
    }
}

/// A quantity with its interval, times `factor`; `None` where it is not determined.
fn estimate(fitted: &Fitted, factor: f64) -> Option<EstimateDocument> {
    let Estimate {
        quantity: q,
        interval_95: (low, high),
    } = fitted.estimate()?;
    let Quantity {
        value,
        std_uncertainty,
    } = quantity(Some(q.scaled(factor)))?;
    Some(EstimateDocument {
        value,
        std_uncertainty,
        interval_95: [*low, *high].map(|end| end.map(|x| factor * x)),
    })
}

fn court_pace(pace: &CourtPace) -> CourtPaceDocument<'_> {
    CourtPaceDocument {
        temperature_c: pace.temperature_c,
        rating: estimate(&pace.rating, 1.0),
        reason: pace.rating.reason(),
        class: pace.class.map(pace_name),
        class_interval_95: pace
            .class_interval_95
            .map(|(low, high)| [pace_name(low), pace_name(high)]),
        restitution: quantity(pace.restitution),
        friction: quantity(pace.friction),
    }
}

/// A class by the name that the standard gives it.
pub(in crate::report) fn pace_name(pace: Pace) -> &'static str {
    match pace {
        Pace::Slow => "slow",
        Pace::MediumSlow => "medium-slow",
        Pace::Medium => "medium",
        Pace::MediumFast => "medium-fast",
        Pace::Fast => "fast",
    }
}
