//! A model at its best with what the numbers of all its parameters are made from: covariance, other local minima of χ²,
//! region of confidence.

use crate::numeric::robust::{commonest, median};
use crate::quantity::Quantity;
use crate::rebound::fit::coordinates::SAME_SPIN;
use crate::rebound::fit::criteria;
use crate::rebound::fit::group_data::{GroupData, friction_demand};
use crate::rebound::fit::observation::Observation;
use crate::rebound::fit::result::{Estimate, Fitted, RowFit, RowRegime};
use crate::rebound::fit::row_law::{E, E_X, NearestMotion, PARAMETERS, RATIO, Theta};
use crate::rebound::fit::variants::Solution;
use crate::rebound::parameter::SEARCHED;
use crate::rebound::{Parameter, SOLID_SPHERE, slip_share};
use nalgebra::SMatrix;

/// Why a ball that rolls already tells nothing.
pub(super) const NO_SLIP: &str = "no row is seen to slip before the bounce";

/// What is worked out once for all numbers of a model.
pub(super) struct ModelEstimation<'a> {
    pub data: &'a GroupData,
    pub solution: &'a Solution,
    pub theta: Theta,
    /// Scaled by the scatter.
    pub covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
    /// Other ways to part the rows that are not out of question.
    pub local_minima: Vec<LocalMinimum>,
    /// Where χ² stays within reach, where that is not as the covariance has it.
    pub region: ConfidenceRegion,
    /// `None`: the rows leave no scatter to tell uncertainties from.
    pub scatter: Option<f64>,
    /// Standard uncertainties to a side that hold 95 %.
    pub factor: f64,
    /// In the order of the data.
    pub rows: Vec<RowFit>,
    /// Median over the rows.
    pub spin_ratio: f64,
    pub slip_share: f64,
    pub sliding: usize,
    pub gripping: usize,
}

/// Where χ² stays within reach, where that is not as the covariance has it.
#[derive(Debug, Default)]
pub(super) struct ConfidenceRegion {
    /// Parameters at its ends.
    pub ends: Vec<Theta>,
    /// For each parameter, whether it goes on downwards and upwards to where nothing is known of it.
    pub open: [(bool, bool); PARAMETERS],
}

impl ConfidenceRegion {
    /// Whether any parameter goes on to where nothing is known of it.
    pub fn is_open(&self) -> bool {
        self.open.iter().any(|(low, high)| *low || *high)
    }
}

/// Another local minimum of χ².
pub(super) struct LocalMinimum {
    pub theta: Theta,
    /// Scaled by the scatter.
    pub covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
    /// What the rows do not determine there, though they do at the lowest.
    pub undetermined: [bool; PARAMETERS],
    /// Part of the coverage factor that is left at its lowest.
    pub room: f64,
}

impl LocalMinimum {
    /// Whether a function depends on what the rows do not determine there.
    fn leaves_open(&self, function: &impl Fn(&Theta) -> f64) -> bool {
        (0..PARAMETERS).filter(|&j| self.undetermined[j]).any(|j| {
            let mut moved = self.theta;
            moved[j] += 0.01 * (1.0 + moved[j].abs());
            function(&moved) != function(&self.theta)
        })
    }
}

impl<'a> ModelEstimation<'a> {
    pub fn new(data: &'a GroupData, solution: &'a Solution) -> Self {
        let theta = solution.best.theta;
        let task = solution.task(data);
        // The search ended where every row has one.
        let rows = task
            .of_nearest(&theta, |_, near| row_fit(Some(near)))
            .unwrap_or_else(|| vec![row_fit(None); data.rows.len()]);
        let sliding = rows.iter().filter(|row| row.regime == RowRegime::Sliding).count();
        let freedom = solution.freedom();
        let scatter = solution.scatter(data);
        let covariance =
            solution
                .best
                .r_factor
                .covariance(&solution.determined, &solution.variant.free, solution.rank)
                * scatter.unwrap_or(0.0).powi(2);
        let factor = criteria::coverage_factor(data.weights, freedom);
        let local_minima = local_minima(data, solution, scatter.unwrap_or(0.0), factor);
        Self {
            data,
            solution,
            theta,
            covariance,
            local_minima,
            region: ConfidenceRegion::default(),
            scatter,
            factor,
            spin_ratio: commonest_spin_ratio(data, &theta),
            slip_share: median_slip_share(data),
            sliding,
            gripping: rows.len() - sliding,
            rows,
        }
    }

    /// Standard uncertainty of a function of the parameters, to first order.
    pub fn std(&self, function: impl Fn(&Theta) -> f64) -> f64 {
        std_of(&function, &self.theta, &self.covariance)
    }

    /// A function of the parameters, with what it may be at every local minimum and at every end of their region; `open` tells
    /// whether it has no end downwards and upwards.
    pub fn estimate(&self, function: impl Fn(&Theta) -> f64, open: (bool, bool)) -> Fitted {
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
        for minimum in &self.local_minima {
            if minimum.leaves_open(&function) {
                ends = (None, None);
                break;
            }
            let there = function(&minimum.theta);
            let reach = minimum.room * std_of(&function, &minimum.theta, &minimum.covariance);
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
    pub fn bounded(&self, value: f64, low: Option<f64>, high: Option<f64>) -> Fitted {
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
    pub fn searched(&self, j: usize, why_not: impl FnOnce() -> String) -> Fitted {
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
            (false, false) => {
                let std = estimate.estimate().and_then(|e| e.quantity.std_uncertainty);
                if std.is_some_and(|std| std <= SEARCHED[j].vague_std()) || self.local_minima.is_empty() {
                    return estimate;
                }
                let others = self.local_minima.iter().map(|minimum| minimum.theta[j]);
                let mut values: Vec<f64> = std::iter::once(self.theta[j]).chain(others).collect();
                values.sort_by(f64::total_cmp);
                let mut values: Vec<String> = values.into_iter().map(three_digits).collect();
                values.dedup();
                Fitted::NotDetermined(format!(
                    "several values suit the rows about as well: {}",
                    values.join(", ")
                ))
            }
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
    pub fn all_open(&self) -> (bool, bool) {
        (self.region.is_open(), self.region.is_open())
    }

    /// Why the model does not have a parameter.
    pub fn lacks(&self, parameter: Parameter) -> Option<&'static str> {
        self.solution.name().model().lacks(parameter)
    }

    /// What the row that needs most friction needs, in words; nothing where that is not determined.
    pub fn least_friction(&self) -> String {
        if (0..PARAMETERS).any(|j| self.solution.is_free(j) && !self.solution.determined[j]) {
            return String::new();
        }
        let share = (1.0 + self.theta[E_X]) / (1.0 + self.theta[E]);
        let rows = self.data.rows.iter();
        let most = rows
            .map(|row| friction_demand(row, &self.theta) * share)
            .fold(0.0, f64::max);
        format!(": at least {}", three_digits(most))
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

/// The other local minima that reach below what the coverage factor allows.
fn local_minima(data: &GroupData, solution: &Solution, scatter: f64, factor: f64) -> Vec<LocalMinimum> {
    let lowest = solution.best.chi2;
    let task = solution.task(data);
    solution
        .local_minima
        .iter()
        .filter_map(|found| {
            let room = factor * factor - (found.chi2 - lowest) / (scatter * scatter);
            let (determined, rank) = (room > 0.0).then(|| {
                task.unit_r_factor(&found.theta)
                    .determined(&solution.variant.free)
            })?;
            let covariance = found
                .r_factor
                .covariance(&determined, &solution.variant.free, rank);
            Some(LocalMinimum {
                theta: found.theta,
                covariance: covariance * (scatter * scatter),
                undetermined: std::array::from_fn(|j| solution.determined[j] && !determined[j]),
                room: room.sqrt(),
            })
        })
        .collect()
}

fn row_fit(near: Option<&NearestMotion>) -> RowFit {
    RowFit {
        chi2: near.map_or(f64::NAN, |n| n.chi2),
        regime: if near.is_some_and(|n| n.slides) {
            RowRegime::Sliding
        } else {
            RowRegime::Gripping
        },
    }
}

/// The spin ratio that most rows have.
fn commonest_spin_ratio(data: &GroupData, theta: &Theta) -> f64 {
    let ratios = data.rows.iter().map(|row| spin_ratio(row, theta));
    let mut ratios: Vec<f64> = ratios.filter(|r| r.is_finite()).collect();
    commonest(&mut ratios, SAME_SPIN).unwrap_or(0.0)
}

fn median_slip_share(data: &GroupData) -> f64 {
    let mut shares: Vec<f64> = data.rows.iter().map(|row| row.slip_share).collect();
    median(&mut shares).unwrap_or_else(|| slip_share(SOLID_SPHERE))
}

fn spin_ratio(row: &Observation, theta: &Theta) -> f64 {
    let k = row.kinematics(&row.z, theta[RATIO]);
    k.w / k.a
}

/// For reasons: three significant digits.
pub(in crate::rebound::fit) fn three_digits(x: f64) -> String {
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
