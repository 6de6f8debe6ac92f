//! From a model at its best to the numbers that are reported: parameters with uncertainties and intervals, or why there are
//! none.

mod profile;
mod sliding;

use super::coordinates::SAME_SPIN;
use super::criteria;
use super::data::{Data, demand};
use super::law::{E, E_X, MU, Nearest, PARAMETERS, RATIO, Theta};
use super::models::Solution;
use super::observation::Observation;
use super::result::{Estimate, Fitted, ModelFit, RowFit, RowRegime};
use super::series::{ColumnSet, Weights};
use super::transition::Limits;
use crate::numeric::robust::{commonest, median};
use crate::quantity::Quantity;
use crate::rebound::model::FittedCoefficients;
use crate::rebound::parameter::{Bounds, SEARCHED};
use crate::rebound::{Contact, ModelName, Parameter, slip_share};
use nalgebra::SMatrix;
use profile::Region;

/// Why a ball that rolls already tells nothing.
const NO_SLIP: &str = "no row is seen to slip before the bounce";

/// Standard uncertainties by which a coefficient has to lie beyond what a bounce can have, to be impossible.
const IMPOSSIBLE: f64 = 3.0;

/// What is worked out once for all numbers of a model.
struct Work<'a> {
    data: &'a Data,
    solution: &'a Solution,
    theta: Theta,
    /// Scaled by the scatter.
    covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
    /// Other ways to part the rows that are not out of question.
    valleys: Vec<Valley>,
    /// Where χ² stays within reach, where that is not as the covariance has it.
    region: Region,
    /// `None`: the rows leave no scatter to tell uncertainties from.
    scatter: Option<f64>,
    /// Standard uncertainties to a side that hold 95 %.
    factor: f64,
    nearest: Vec<Nearest>,
    /// Median over the rows.
    spin_ratio: f64,
    slip_share: f64,
    sliding: usize,
    gripping: usize,
}

/// The numbers of a model. `rows_order` are indices into the data in the order of the file.
pub(super) fn model_fit(data: &Data, solution: &Solution, rows_order: &[usize]) -> ModelFit {
    let work = Work::new(data, solution);
    let freedom = solution.freedom();
    let limits = work.limits();
    ModelFit {
        name: solution.name(),
        converged: solution.found.converged,
        parameters: Parameter::ALL.map(|parameter| work.fitted(parameter, limits)),
        transition: work.transition(limits),
        chi2: solution.found.chi2,
        degrees_of_freedom: freedom,
        parameter_count: solution.marks.parameters,
        p_value: (data.weights == Weights::Stated)
            .then(|| criteria::chi2_tail(solution.found.chi2, freedom))
            .flatten(),
        scatter: work.scatter.unwrap_or(1.0),
        log_likelihood: solution.marks.log_likelihood,
        aicc: solution.marks.aicc,
        bic: solution.marks.bic,
        impossible: work.impossible(),
        sliding: work.sliding,
        gripping: work.gripping,
        curve: work.contact(limits),
        shared_spin_ratio: data.shared_spin.then_some(work.theta[RATIO]),
        rows: rows_order.iter().map(|&i| work.row_fit(i)).collect(),
    }
}

/// e and μ with their covariance, every row taken as sliding: what a court pace rating is made of.
pub(super) fn all_sliding(data: &Data) -> Option<(Theta, SMatrix<f64, PARAMETERS, PARAMETERS>, bool, f64)> {
    let solution = super::models::sliding_throughout(data, ModelName::MuE)?;
    let determined = solution.determined[E] && solution.determined[MU];
    let work = Work::new(data, &solution);
    Some((
        work.theta,
        work.covariance,
        determined && work.scatter.is_some(),
        work.factor,
    ))
}

/// Another valley of χ².
struct Valley {
    theta: Theta,
    /// Scaled by the scatter; `None` where the rows so parted do not determine all that they did.
    covariance: Option<SMatrix<f64, PARAMETERS, PARAMETERS>>,
    /// Part of the coverage factor that is left at its lowest.
    room: f64,
}

impl<'a> Work<'a> {
    fn new(data: &'a Data, solution: &'a Solution) -> Self {
        let theta = solution.found.theta;
        let task = solution.task(data);
        // The search ended where every row has one.
        let nearest = task.all_nearest(&theta).unwrap_or_default();
        let sliding = nearest.iter().filter(|n| n.state.slides()).count();
        let freedom = solution.freedom();
        let scatter = solution.scatter(data);
        let covariance =
            solution
                .found
                .r_factor
                .covariance(&solution.determined, &solution.variant.free, solution.rank)
                * scatter.unwrap_or(0.0).powi(2);
        let factor = criteria::coverage_factor(data.weights, freedom);
        let valleys = valleys(data, solution, scatter.unwrap_or(0.0), factor);
        let mut ratios: Vec<f64> = data
            .rows
            .iter()
            .map(|row| spin_ratio(row, &theta))
            .filter(|r| r.is_finite())
            .collect();
        let mut shares: Vec<f64> = data.rows.iter().map(|row| row.slip_share).collect();
        let mut work = Self {
            data,
            solution,
            theta,
            covariance,
            valleys,
            region: Region::default(),
            scatter,
            factor,
            spin_ratio: commonest(&mut ratios, SAME_SPIN).unwrap_or(0.0),
            slip_share: median(&mut shares).unwrap_or_else(|| slip_share(crate::rebound::SOLID_SPHERE)),
            sliding,
            gripping: nearest.len() - sliding,
            nearest,
        };
        work.region = Region::around(&work);
        work
    }

    /// Standard uncertainty of a function of the parameters, to first order.
    fn std(&self, function: impl Fn(&Theta) -> f64) -> f64 {
        std_of(&function, &self.theta, &self.covariance)
    }

    /// A function of the parameters, with what it may be in every valley and at every end of their region; `open` tells
    /// whether it has no end downwards and upwards.
    fn estimate(&self, function: impl Fn(&Theta) -> f64, open: (bool, bool)) -> Fitted {
        let value = function(&self.theta);
        let std = self.std(&function);
        let Some(mut quantity) = Quantity::new(value, std) else {
            return Fitted::NotDetermined("the search did not come to a number".to_owned());
        };
        let Some(std) = quantity.std_uncertainty else {
            return Fitted::Determined(Estimate {
                quantity,
                interval_95: (None, None),
            });
        };
        let reach = self.factor * std;
        let mut ends = (Some(value - reach), Some(value + reach));
        for valley in &self.valleys {
            let Some(covariance) = &valley.covariance else {
                ends = (None, None);
                break;
            };
            let there = function(&valley.theta);
            let reach = valley.room * std_of(&function, &valley.theta, covariance);
            ends.0 = ends.0.map(|low| low.min(there - reach));
            ends.1 = ends.1.map(|high| high.max(there + reach));
        }
        for theta in &self.region.ends {
            let there = function(theta);
            ends.0 = ends.0.map(|low| low.min(there));
            ends.1 = ends.1.map(|high| high.max(there));
        }
        ends.0 = ends.0.filter(|_| !open.0);
        ends.1 = ends.1.filter(|_| !open.1);
        let longer = ends
            .0
            .zip(ends.1)
            .map(|(low, high)| (value - low).max(high - value));
        quantity.std_uncertainty = longer.map(|longer| longer / self.factor);
        Fitted::Determined(Estimate {
            quantity,
            interval_95: ends,
        })
    }

    /// A value with an interval of its own; its standard uncertainty is that of the longer side.
    fn bounded(&self, value: f64, low: Option<f64>, high: Option<f64>) -> Fitted {
        let std = low
            .zip(high)
            .filter(|_| self.scatter.is_some())
            .map_or(f64::NAN, |(l, h)| (h - value).max(value - l) / self.factor);
        match Quantity::new(value, std) {
            Some(quantity) => Fitted::Determined(Estimate {
                quantity,
                interval_95: (low, high),
            }),
            None => Fitted::NotDetermined("the search did not come to a number".to_owned()),
        }
    }

    /// A parameter that the search moved, unless the rows say nothing, or next to nothing, of it.
    fn searched(&self, j: usize, why_not: impl FnOnce() -> String) -> Fitted {
        if !self.solution.determined[j] {
            return Fitted::NotDetermined(why_not());
        }
        let vague = |how: &str| {
            let reason =
                format!("the rows give it only to {how}, which is no more than is known of any bounce");
            Fitted::NotDetermined(reason)
        };
        let std = self.covariance[(j, j)].sqrt();
        if std > SEARCHED[j].vague_std() {
            return vague(&format!("± {std:.2}"));
        }
        let estimate = self.estimate(|theta| theta[j], self.region.open[j]);
        match self.region.open[j] {
            (false, false) => estimate,
            (low, high) => {
                let ends = estimate.estimate().map_or((None, None), |e| e.interval_95);
                match (low, ends.0, high, ends.1) {
                    (true, _, false, Some(end)) => vague(&format!("below {}", three_digits(end))),
                    (false, Some(end), true, _) => vague(&format!("above {}", three_digits(end))),
                    _ => vague("anything"),
                }
            }
        }
    }

    /// Whether a function of all parameters has no end, as some of them have none.
    fn all_open(&self) -> (bool, bool) {
        (self.region.is_open(), self.region.is_open())
    }

    /// Why the model does not have a parameter.
    fn lacks(&self, parameter: Parameter) -> Option<&'static str> {
        self.solution.name().model().lacks(parameter)
    }

    /// A parameter, or why there is no number.
    fn fitted(&self, parameter: Parameter, limits: Option<Limits>) -> Fitted {
        if let Some(why) = self.lacks(parameter) {
            return Fitted::NotDetermined(why.to_owned());
        }
        match parameter {
            Parameter::Restitution => self.restitution(),
            Parameter::Friction => self.friction(),
            Parameter::StaticFriction => self.static_friction(limits),
            Parameter::TangentialRestitution => self.tangential_restitution(),
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

    /// What the row that needs most friction needs, in words; nothing where that is not determined.
    fn least_friction(&self) -> String {
        if (0..PARAMETERS).any(|j| self.solution.is_free(j) && !self.solution.determined[j]) {
            return String::new();
        }
        let share = (1.0 + self.theta[E_X]) / (1.0 + self.theta[E]);
        let rows = self.data.rows.iter();
        let most = rows
            .map(|row| demand(row, &self.theta) * share)
            .fold(0.0, f64::max);
        format!(": at least {}", three_digits(most))
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
        SEARCHED.iter().enumerate().find_map(|(j, parameter)| {
            if !(self.solution.is_free(j) && self.solution.determined[j]) {
                return None;
            }
            let Bounds { least, most, why } = parameter.bounds()?;
            let std = self.covariance[(j, j)].sqrt().max(1e-9);
            let value = self.theta[j];
            let off = (value - most).max(least - value);
            (off > IMPOSSIBLE * std).then(|| {
                let (symbol, std) = (parameter.symbol(), three_digits(std));
                format!("it needs {symbol} = {value:.3} ± {std}, and {why}")
            })
        })
    }

    /// The coefficients for curves.
    fn contact(&self, limits: Option<Limits>) -> Contact {
        let slides = self.solution.is_free(MU);
        self.solution.name().with_fitted(&FittedCoefficients {
            theta: self.theta,
            friction: slides.then_some(self.theta[MU]),
            static_friction: slides.then(|| self.limit(limits) / (1.0 + self.theta[E])),
        })
    }

    fn row_fit(&self, index: usize) -> RowFit {
        let row = &self.data.rows[index];
        let near = self.nearest.get(index);
        let k = row.kinematics(near.map_or(&row.z, |n| &n.z), self.theta[RATIO]);
        RowFit {
            chi2: near.map_or(f64::NAN, |n| n.chi2),
            regime: if near.is_some_and(|n| n.state.slides()) {
                RowRegime::Sliding
            } else {
                RowRegime::Gripping
            },
            incident_rad: k.a.atan2(k.b),
        }
    }
}

/// Standard uncertainty of a function of the parameters, to first order.
fn std_of(
    function: &impl Fn(&Theta) -> f64,
    theta: &Theta,
    covariance: &SMatrix<f64, PARAMETERS, PARAMETERS>,
) -> f64 {
    let mut slope = [0.0; PARAMETERS];
    for (j, s) in slope.iter_mut().enumerate() {
        let step = 0.01 * covariance[(j, j)].sqrt();
        if step > 0.0 {
            let at = |sign: f64| {
                let mut theta = *theta;
                theta[j] += sign * step;
                function(&theta)
            };
            *s = (at(1.0) - at(-1.0)) / (2.0 * step);
        }
    }
    let mut variance = 0.0;
    for i in 0..PARAMETERS {
        for j in 0..PARAMETERS {
            variance += slope[i] * covariance[(i, j)] * slope[j];
        }
    }
    variance.max(0.0).sqrt()
}

/// The other valleys that reach below what the coverage factor allows.
fn valleys(data: &Data, solution: &Solution, scatter: f64, factor: f64) -> Vec<Valley> {
    let lowest = solution.found.chi2;
    let task = solution.task(data);
    solution
        .valleys
        .iter()
        .filter_map(|found| {
            let room = factor * factor - (found.chi2 - lowest) / (scatter * scatter);
            let (determined, rank) = (room > 0.0).then(|| {
                task.unit_r_factor(&found.theta)
                    .determined(&solution.variant.free)
            })?;
            let same = determined == solution.determined;
            Some(Valley {
                theta: found.theta,
                covariance: same.then(|| {
                    found
                        .r_factor
                        .covariance(&determined, &solution.variant.free, rank)
                        * (scatter * scatter)
                }),
                room: room.sqrt(),
            })
        })
        .collect()
}

fn spin_ratio(row: &Observation, theta: &Theta) -> f64 {
    let k = row.kinematics(&row.z, theta[RATIO]);
    k.w / k.a
}

/// For reasons: three significant digits.
pub(super) fn three_digits(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let places = 2.0 - x.abs().log10().floor();
    if (-4.0..=8.0).contains(&places) {
        format!("{x:.*}", places.max(0.0) as usize)
    } else {
        format!("{x:.2e}")
    }
}
