//! What a fit gives: for each group the models with their parameters, which of them is preferred and why, and what became
//! of every row.

use super::series::{ColumnSet, Note, SetAside, Weights};
use crate::quantity::Quantity;
use crate::rebound::itf::Pace;
use crate::rebound::{Contact, ModelName, Parameter, Preferred};

/// A fitted number with the interval that holds the truth in 95 of 100 series. The interval need not be symmetric, and
/// where it is not, the standard uncertainty is that of its longer side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value and standard uncertainty.
    pub quantity: Quantity,
    /// From, to; an end is `None` where the data set no bound, both where the uncertainty was not determined.
    pub interval_95: (Option<f64>, Option<f64>),
}

/// A parameter: its estimate, or why there is none.
#[derive(Debug, Clone, PartialEq)]
pub enum Fitted {
    /// The data determine it.
    Determined(Estimate),
    /// They do not, for this reason.
    NotDetermined(String),
}

impl Fitted {
    /// The estimate, where there is one.
    #[must_use]
    pub fn estimate(&self) -> Option<&Estimate> {
        match self {
            Self::Determined(estimate) => Some(estimate),
            Self::NotDetermined(_) => None,
        }
    }

    /// The quantity, where there is one.
    #[must_use]
    pub fn quantity(&self) -> Option<Quantity> {
        self.estimate().map(|estimate| estimate.quantity)
    }

    /// Why there is none.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Determined(_) => None,
            Self::NotDetermined(reason) => Some(reason),
        }
    }
}

/// The incident angle at which a ball begins to slide.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    /// The angle, rad.
    pub angle_rad: Fitted,
    /// The spin ratio before the bounce for which it holds.
    pub spin_ratio: f64,
    /// The same if static friction equals friction, which is much better known; the μ-e model only, and only where the
    /// data do not contradict it.
    pub without_jump_rad: Option<Quantity>,
}

/// What a row does in a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowRegime {
    /// Friction at its limit.
    Sliding,
    /// Leaves rolling, or grips with the model's e_x.
    Gripping,
}

/// A model fitted to the rows of a group.
#[derive(Debug, Clone)]
pub struct ModelFit {
    /// Which.
    pub name: ModelName,
    /// Whether the search came to its end.
    pub converged: bool,
    /// As [`Parameter::ALL`].
    pub parameters: [Fitted; Parameter::ALL.len()],
    /// Where sliding begins.
    pub transition: Transition,
    /// Sum of squared residuals over their variances; without deviations, of residuals in SI units.
    pub chi2: f64,
    /// Equations less parameters.
    pub degrees_of_freedom: usize,
    /// Parameters that the data determine, the scale of the scatter among them where it is fitted.
    pub parameter_count: usize,
    /// Probability of a χ² as large as this if the model is right; `None` where the scale comes from the scatter.
    pub p_value: Option<f64>,
    /// What standard uncertainties were multiplied by, as the scatter asks for; 1 where it does not.
    pub scatter: f64,
    /// Logarithm of the likelihood at its highest.
    pub log_likelihood: Option<f64>,
    /// Akaike's criterion for small samples.
    pub aicc: Option<f64>,
    /// Bayes' criterion.
    pub bic: Option<f64>,
    /// Why the model cannot be, whatever its fit: a coefficient that no bounce has.
    pub impossible: Option<String>,
    /// Rows that slide, and rows that do not.
    pub sliding: usize,
    /// See `sliding`.
    pub gripping: usize,
    /// Coefficients for curves, also those that are not determined (then any that fit).
    pub curve: Contact,
    /// Spin ratio of the rows whose spin is not known, for curves.
    pub shared_spin_ratio: Option<f64>,
    /// For each row in use, in the order of [`GroupFit::rows_used`].
    pub rows: Vec<RowFit>,
}

impl ModelFit {
    /// A parameter.
    #[must_use]
    pub fn parameter(&self, parameter: Parameter) -> &Fitted {
        &self.parameters[parameter as usize]
    }
}

/// A row against a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowFit {
    /// Its share of χ².
    pub chi2: f64,
    /// What it does.
    pub regime: RowRegime,
}

/// A court pace rating.
#[derive(Debug, Clone, PartialEq)]
pub struct CourtPace {
    /// Temperature, °C.
    pub temperature_c: f64,
    /// CPR.
    pub rating: Fitted,
    /// The class of the rating.
    pub class: Option<Pace>,
    /// The classes at the ends of its interval of 95 %.
    pub class_interval_95: Option<(Pace, Pace)>,
    /// e and μ that it was made of, every bounce taken as sliding.
    pub restitution: Option<Quantity>,
    /// See `restitution`.
    pub friction: Option<Quantity>,
}

/// The fit of one group.
#[derive(Debug, Clone)]
pub struct GroupFit {
    /// Its name.
    pub name: String,
    /// Rows of the file in it.
    pub rows: usize,
    /// The models; none where no row could be used.
    pub models: Vec<ModelFit>,
    /// The preferred one.
    pub preferred: Preferred,
    /// Why.
    pub reason: String,
    /// Numbers of the rows in use.
    pub rows_used: Vec<usize>,
    /// Where the rows in use stand in [`super::Series::rows`].
    pub row_indices: Vec<usize>,
    /// Rows that are not, and why.
    pub rows_set_aside: Vec<SetAside>,
    /// What to know.
    pub notes: Vec<Note>,
    /// Where it was asked for.
    pub court_pace: Option<CourtPace>,
}

impl GroupFit {
    /// A model's fit.
    #[must_use]
    pub fn model(&self, name: ModelName) -> Option<&ModelFit> {
        self.models.iter().find(|model| model.name == name)
    }

    /// The preferred model's fit; where none is preferred, of those about as good as the best (within 2 of its AICc) the one
    /// that determines most of its parameters.
    #[must_use]
    pub fn shown(&self) -> Option<&ModelFit> {
        if let Preferred::Model(name) = self.preferred {
            return self.model(name);
        }
        let possible = self.models.iter().any(|m| m.impossible.is_none());
        let candidates = || self.models.iter().filter(|m| m.impossible.is_none() || !possible);
        let mark = |m: &ModelFit| m.aicc.unwrap_or(m.chi2);
        let least = candidates().map(mark).fold(f64::INFINITY, f64::min);
        // Of equals the first, which is the simplest.
        candidates()
            .filter(|m| mark(m) <= least + 2.0)
            .rev()
            .max_by_key(|m| m.parameters.iter().filter(|p| p.estimate().is_some()).count())
    }
}

/// The fit of a series.
#[derive(Debug, Clone)]
pub struct SeriesFit {
    /// What the series is called.
    pub name: String,
    /// The columns of the fit.
    pub set: ColumnSet,
    /// Where the weights come from.
    pub weights: Weights,
    /// Group by group, in the order of the file.
    pub groups: Vec<GroupFit>,
    /// What to know of the whole.
    pub notes: Vec<Note>,
}
