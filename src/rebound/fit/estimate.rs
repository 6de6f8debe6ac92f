//! From a model at its best to the numbers that are reported: parameters with uncertainties and intervals, or why there are
//! none.

mod estimation;
mod profile;
mod sliding;

use super::criteria;
use super::group_data::GroupData;
use super::result::{Estimate, Fitted, ModelFit};
use super::row_law::{E, E_X, KAPPA, MU, PARAMETERS, RATIO, Theta};
use super::series::{ColumnSet, Weights};
use super::transition::LimitInterval;
use super::variants::{Solution, sliding_throughout};
use crate::quantity::Quantity;
use crate::rebound::model::FittedCoefficients;
use crate::rebound::parameter::{Bounds, SEARCHED};
use crate::rebound::{Contact, ModelName, Parameter};
pub(super) use estimation::three_digits;
use estimation::{ModelEstimation, NO_SLIP};
use nalgebra::SMatrix;

/// Standard uncertainties by which a coefficient has to lie beyond what a bounce can have, to be impossible.
const IMPOSSIBLE: f64 = 3.0;

/// κ from which on nothing is left to give way.
const STIFFEST: f64 = 25.0;

/// With the intervals by profile, where χ² is no parabola.
fn estimation<'a>(data: &'a GroupData, solution: &'a Solution) -> ModelEstimation<'a> {
    let mut estimation = ModelEstimation::new(data, solution);
    estimation.region = profile::region(&estimation);
    estimation
}

/// The numbers of a model. `rows_order` are indices into the data in the order of the file.
pub(super) fn model_fit(data: &GroupData, solution: &Solution, rows_order: &[usize]) -> ModelFit {
    let estimation = estimation(data, solution);
    let freedom = solution.freedom();
    let limits = estimation.limits();
    ModelFit {
        name: solution.name(),
        converged: solution.best.converged,
        parameters: Parameter::ALL.map(|parameter| estimation.fitted(parameter, limits)),
        transition: estimation.transition(limits),
        chi2: solution.best.chi2,
        degrees_of_freedom: freedom,
        parameter_count: solution.criteria.parameters,
        p_value: (data.weights == Weights::Stated)
            .then(|| criteria::chi2_tail(solution.best.chi2, freedom))
            .flatten(),
        scatter: estimation.scatter.unwrap_or(1.0),
        log_likelihood: solution.criteria.log_likelihood,
        aicc: solution.criteria.aicc,
        bic: solution.criteria.bic,
        impossible: estimation.impossible(),
        sliding: estimation.sliding,
        gripping: estimation.gripping,
        curve: estimation.contact(limits),
        shared_spin_ratio: data.shared_spin.then_some(estimation.theta[RATIO]),
        rows: rows_order.iter().map(|&i| estimation.rows[i]).collect(),
    }
}

/// e and μ with their covariance, every row taken as sliding: what a court pace rating is made of.
pub(super) fn all_sliding(
    data: &GroupData,
) -> Option<(Theta, SMatrix<f64, PARAMETERS, PARAMETERS>, bool, f64)> {
    let solution = sliding_throughout(data, ModelName::MuE)?;
    let determined = solution.determined[E] && solution.determined[MU];
    let estimation = estimation(data, &solution);
    Some((
        estimation.theta,
        estimation.covariance,
        determined && estimation.scatter.is_some(),
        estimation.factor,
    ))
}

/// Whether every coefficient of a model is one that a bounce can have.
pub(super) fn is_possible(data: &GroupData, solution: &Solution) -> bool {
    let spread = solution.scatter(data).unwrap_or(0.0).powi(2);
    let (determined, free) = (&solution.determined, &solution.variant.free);
    let covariance = solution.best.r_factor.covariance(determined, free, solution.rank);
    impossible(solution, &(covariance * spread)).is_none()
}

/// A coefficient beyond what a bounce can have.
fn impossible(solution: &Solution, covariance: &SMatrix<f64, PARAMETERS, PARAMETERS>) -> Option<String> {
    SEARCHED.iter().enumerate().find_map(|(j, parameter)| {
        if !(solution.is_free(j) && solution.determined[j]) {
            return None;
        }
        let Bounds { least, most, why } = parameter.bounds()?;
        let std = covariance[(j, j)].sqrt().max(1e-9);
        let value = solution.best.theta[j];
        let off = (value - most).max(least - value);
        (off > IMPOSSIBLE * std).then(|| {
            let (symbol, std) = (parameter.symbol(), three_digits(std));
            format!("it needs {symbol} = {value:.3} ± {std}, and {why}")
        })
    })
}

impl ModelEstimation<'_> {
    /// A parameter, or why there is no number.
    fn fitted(&self, parameter: Parameter, limits: Option<LimitInterval>) -> Fitted {
        if let Some(why) = self.lacks(parameter) {
            return Fitted::NotDetermined(why.to_owned());
        }
        match parameter {
            Parameter::Restitution => self.restitution(),
            Parameter::Friction => self.friction(),
            Parameter::StaticFriction => self.static_friction(limits),
            Parameter::TangentialRestitution => self.tangential_restitution(),
            Parameter::StiffnessRatio => self.stiffness_ratio(),
            Parameter::SpinRatio => self.shared_ratio(),
        }
    }

    fn restitution(&self) -> Fitted {
        if self.solution.one_incidence {
            return Fitted::NotDetermined(format!(
                "{} at one incidence hold e only together with what friction did: they may all have slid. Rows at other \
                 angles would tell, or velocities",
                self.data.rows.first().map_or("rows", |row| row.set.name())
            ));
        }
        self.searched(E, || match self.data.rows.first().map(|row| row.set) {
            Some(ColumnSet::Velocities) | None => "no row tells it".to_owned(),
            Some(set) => self.only_together(set),
        })
    }

    /// Angles and distances hold e and e_x (or the spin) only in one number, where every row grips.
    fn only_together(&self, set: ColumnSet) -> String {
        let s = self.slip_share;
        let combination = |theta: &Theta| {
            let ratio = if self.data.shared_spin {
                theta[RATIO]
            } else {
                self.spin_ratio
            };
            let kept = (1.0 - s) - s * theta[E_X] + s * (1.0 + theta[E_X]) * ratio;
            if set == ColumnSet::Angles {
                kept / theta[E]
            } else {
                2.0 * kept * theta[E]
            }
        };
        let (what, with) = match (set, self.solution.is_free(E_X)) {
            (ColumnSet::Angles, true) => ("tan φ / tan θ", "e_x"),
            (ColumnSet::Angles, false) => ("tan φ / tan θ", "the spin before"),
            (_, true) => ("x / x0", "e_x"),
            (_, false) => ("x / x0", "the spin before"),
        };
        format!(
            "{} of rows that all grip hold e only together with {with}, in {what} = {:.4}; velocities, rows with another \
             known spin, or rows that slide would part them",
            set.name(),
            combination(&self.theta)
        )
    }

    fn friction(&self) -> Fitted {
        if !self.solution.slips {
            return Fitted::NotDetermined(NO_SLIP.to_owned());
        }
        if !self.solution.is_free(MU) {
            return Fitted::NotDetermined(format!(
                "no row is seen to slide, so friction is only known to be enough{}",
                self.least_friction()
            ));
        }
        self.searched(MU, || "no row that slides tells it".to_owned())
    }

    fn tangential_restitution(&self) -> Fitted {
        if !self.solution.slips {
            return Fitted::NotDetermined(NO_SLIP.to_owned());
        }
        if self.solution.is_free(MU) && (self.gripping == 0 || !self.solution.is_free(E_X)) {
            return Fitted::NotDetermined("no row is seen to grip".to_owned());
        }
        self.searched(E_X, || {
            if self.data.shared_spin {
                "the spin before the bounce is not known, and e_x cannot be told from it".to_owned()
            } else if self.solution.determined[E] {
                "no row slips before the bounce".to_owned()
            } else {
                self.data
                    .rows
                    .first()
                    .map_or_else(String::new, |row| self.only_together(row.set))
            }
        })
    }

    fn stiffness_ratio(&self) -> Fitted {
        let given = || self.data.rows.iter().filter_map(|row| row.stiffness_ratio);
        if !self.data.fitted_stiffness {
            let (least, most) =
                given().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), x| (l.min(x), m.max(x)));
            return match Quantity::new(least, f64::NAN).filter(|_| least == most) {
                Some(quantity) => Fitted::Determined(Estimate {
                    quantity,
                    interval_95: (None, None),
                }),
                None => Fitted::NotDetermined(format!("the rows give it, from {least} to {most}")),
            };
        }
        if !self.solution.slips {
            return Fitted::NotDetermined(NO_SLIP.to_owned());
        }
        if self.sliding > 0 && self.gripping == 0 {
            return Fitted::NotDetermined(
                "every row slides throughout, however stiff the contact is".to_owned(),
            );
        }
        if self.theta[KAPPA] >= STIFFEST {
            return Fitted::NotDetermined(
                "the rows do not tell the contact from one that is rigid sideways, as mu_e has it".to_owned(),
            );
        }
        self.searched(KAPPA, || {
            "it cannot be told from the other parameters: rows at other angles would part them".to_owned()
        })
    }

    fn shared_ratio(&self) -> Fitted {
        if !self.data.shared_spin {
            return Fitted::NotDetermined("the rows give the spin before the bounce".to_owned());
        }
        self.searched(RATIO, || {
            if self.gripping == 0 {
                "every row slides, whatever its spin".to_owned()
            } else if self.lacks(Parameter::TangentialRestitution).is_some() {
                "it cannot be told from restitution".to_owned()
            } else {
                "it cannot be told from e_x".to_owned()
            }
        })
    }

    /// A coefficient beyond what a bounce can have.
    fn impossible(&self) -> Option<String> {
        impossible(self.solution, &self.covariance)
    }

    /// The coefficients for curves.
    fn contact(&self, limits: Option<LimitInterval>) -> Contact {
        let slides = self.solution.is_free(MU);
        self.solution.name().with_fitted(&FittedCoefficients {
            theta: self.theta,
            friction: slides.then_some(self.theta[MU]),
            static_friction: slides.then(|| self.limit(limits) / (1.0 + self.theta[E])),
        })
    }
}
