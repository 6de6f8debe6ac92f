//! Where sliding begins: static friction and the angle of the transition, with the intervals that the order of the rows
//! allows.

use super::estimation::{ModelEstimation, NO_SLIP, three_digits};
use crate::quantity::Quantity;
use crate::rebound::fit::group_data::friction_demand;
use crate::rebound::fit::result::{Fitted, Transition};
use crate::rebound::fit::row_law::{E, E_X, MU, PARAMETERS, RATIO, Regimes, Theta, friction_share};
use crate::rebound::fit::transition::{LimitInterval, Profile};
use crate::rebound::model::FrictionLimit;
use crate::rebound::parameter::SEARCHED;

/// Static friction is given where its bounds are closer than this ratio; the paper's own best is 0.15 ± 0.02.
const CLOSE: f64 = 1.5;

impl ModelEstimation<'_> {
    /// How friction ends grip in the model.
    fn friction_limit(&self) -> FrictionLimit {
        self.solution.name().facts().friction_limit
    }

    /// Λ of a model that may jump: where it may lie, whether or not static friction equals friction.
    pub(super) fn limits(&self) -> Option<LimitInterval> {
        let solution = self.solution;
        let both = self.sliding > 0 && self.gripping > 0;
        if self.friction_limit() != FrictionLimit::AtStaticFriction || !solution.is_free(MU) || !both {
            return None;
        }
        let scatter = self.scatter?;
        let level = (self.factor * scatter).powi(2);
        let mut profile = Profile::new(self.data, solution.variant, self.theta, scatter * scatter);
        match solution.variant.regimes {
            Regimes::Jump(limit) => Some(profile.limits(limit, level)),
            _ => {
                let share = friction_share(&self.theta);
                let (low, high) = self
                    .estimate(friction_share, self.all_open())
                    .estimate()?
                    .interval_95;
                let limits = profile.limits(share, level);
                Some(LimitInterval {
                    low,
                    high: limits.high.zip(high).map(|(a, b)| a.max(b)),
                })
            }
        }
    }

    /// Λ as it is reported: that of friction where nothing contradicts it, else the middle of where it may lie.
    pub(super) fn limit(&self, limits: Option<LimitInterval>) -> f64 {
        match (self.solution.jump(), limits) {
            (
                Some(_),
                Some(LimitInterval {
                    low: Some(low),
                    high: Some(high),
                }),
            ) => 0.5 * (low + high),
            (Some(limit), _) => limit,
            (None, _) => friction_share(&self.theta),
        }
    }

    pub(super) fn static_friction(&self, limits: Option<LimitInterval>) -> Fitted {
        let solution = self.solution;
        if !solution.slips {
            return Fitted::NotDetermined(NO_SLIP.to_owned());
        }
        if !solution.is_free(MU) {
            return Fitted::NotDetermined(format!(
                "no row is seen to slide, so static friction is only known to be enough{}",
                self.least_friction()
            ));
        }
        if !(solution.determined[E] && solution.determined[MU]) {
            return Fitted::NotDetermined("friction is not determined".to_owned());
        }
        let over = 1.0 + self.theta[E];
        if self.gripping == 0 {
            let rows = self.data.rows.iter();
            let least = rows
                .map(|row| friction_demand(row, &self.theta) / over)
                .fold(f64::INFINITY, f64::min);
            return Fitted::NotDetermined(format!(
                "every row slides: static friction is at most {}",
                three_digits(least)
            ));
        }
        let Some(limits) = limits else {
            return Fitted::NotDetermined("the rows leave no scatter to tell its bounds from".to_owned());
        };
        let (low, high) = (limits.low.map(|l| l / over), limits.high.map(|h| h / over));
        match (low, high) {
            (Some(l), Some(h)) if h <= CLOSE * l => self.bounded(self.limit(Some(limits)) / over, low, high),
            (l, h) => Fitted::NotDetermined(format!(
                "no row near the transition: static friction lies {}",
                between(l, h)
            )),
        }
    }

    /// tan of the angle beyond which a ball slides is `limit` over this.
    fn angle_rad(&self, limit: f64, theta: &Theta) -> f64 {
        limit.atan2(self.slip_share * (1.0 + theta[E_X]) * (1.0 - self.ratio(theta)).abs())
    }

    /// R ω_oy / v_ox that the angle is for.
    fn ratio(&self, theta: &Theta) -> f64 {
        if self.data.shared_spin {
            theta[RATIO]
        } else {
            self.spin_ratio
        }
    }

    pub(super) fn transition(&self, limits: Option<LimitInterval>) -> Transition {
        let of = |angle_rad: Fitted, without_jump_rad| Transition {
            angle_rad,
            spin_ratio: if self.data.shared_spin {
                self.theta[RATIO]
            } else {
                self.spin_ratio
            },
            without_jump_rad,
        };
        let none = |reason: &str| of(Fitted::NotDetermined(reason.to_owned()), None);
        let solution = self.solution;
        let model = solution.name().model();
        let curved = model.sliding_tangent(&self.theta, self.slip_share).is_some();
        if !solution.name().has_friction_limit() && !curved {
            return none(&format!("the {} model never slides", solution.name().name()));
        }
        if self.sliding == 0 || !solution.is_free(MU) {
            return none("no row is seen to slide");
        }
        if self.gripping == 0 {
            return none("every row slides");
        }
        let known =
            |j: usize| solution.determined[j] && self.covariance[(j, j)].sqrt() <= SEARCHED[j].vague_std();
        if (0..PARAMETERS).any(|j| solution.is_free(j) && !known(j)) {
            return none("it depends on parameters that are not determined");
        }
        if curved {
            let angle = |theta: &Theta| {
                let tangent = model.sliding_tangent(theta, self.slip_share).unwrap_or(f64::NAN);
                tangent.atan2((1.0 - self.ratio(theta)).abs())
            };
            return of(self.estimate(angle, self.all_open()), None);
        }
        let continuous = |theta: &Theta| self.angle_rad(friction_share(theta), theta);
        let value = continuous(&self.theta);
        if self.friction_limit() == FrictionLimit::AtFriction {
            return of(self.estimate(continuous, self.all_open()), None);
        }
        let ends = limits.map_or((None, None), |l| {
            let angle = |limit: Option<f64>| limit.map(|l| self.angle_rad(l, &self.theta));
            (angle(l.low), angle(l.high))
        });
        let at = self.angle_rad(self.limit(limits), &self.theta);
        // What the other parameters add where they are not well known (a fitted spin).
        let held = self.std(|theta| self.angle_rad(self.limit(limits), theta));
        let wider = |end: Option<f64>, sign: f64| {
            end.map(|end| at + sign * (end - at).abs().hypot(self.factor * held))
        };
        let angle = self.bounded(at, wider(ends.0, -1.0), wider(ends.1, 1.0));
        let without = solution
            .jump()
            .is_none()
            .then(|| Quantity::new(value, self.std(continuous)));
        of(angle, without.flatten())
    }
}

fn between(low: Option<f64>, high: Option<f64>) -> String {
    match (low, high) {
        (Some(low), Some(high)) => format!("between {} and {}", three_digits(low), three_digits(high)),
        (Some(low), None) => format!("above {}", three_digits(low)),
        (None, Some(high)) => format!("below {}", three_digits(high)),
        (None, None) => "anywhere".to_owned(),
    }
}
