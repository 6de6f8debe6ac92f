//! The court pace rating of a group (CS 01/02), see [`crate::rebound::itf`].
//!
//! The rating takes every bounce as sliding: e and μ are those of the μ-e model with all rows in that regime.

use super::estimate;
use super::group_data::GroupData;
use super::result::{CourtPace, Estimate, Fitted, GroupFit, RowRegime};
use super::row_law::{E, MU};
use super::series::Note;
use crate::quantity::Quantity;
use crate::rebound::itf;

/// The rating at `temperature_c`, and a warning where bounces did not slide.
pub(super) fn rate(data: &GroupData, group: &GroupFit, temperature_c: f64) -> (CourtPace, Option<Note>) {
    let mut pace = CourtPace {
        temperature_c,
        rating: Fitted::NotDetermined("restitution and friction are not determined by these rows".to_owned()),
        class: None,
        class_interval_95: None,
        restitution: None,
        friction: None,
    };
    if let Some((theta, covariance, determined, factor)) = estimate::all_sliding(data) {
        let known = |j: usize| {
            let std = if determined {
                covariance[(j, j)].sqrt()
            } else {
                f64::NAN
            };
            Quantity::new(theta[j], std)
        };
        (pace.restitution, pace.friction) = (known(E), known(MU));
        let value = itf::court_pace_rating(theta[E], theta[MU], temperature_c);
        // The rating is linear: its slopes are differences of unit steps.
        let by_e = itf::court_pace_rating(theta[E] + 1.0, theta[MU], temperature_c) - value;
        let by_mu = itf::court_pace_rating(theta[E], theta[MU] + 1.0, temperature_c) - value;
        let variance = by_e * by_e * covariance[(E, E)]
            + by_mu * by_mu * covariance[(MU, MU)]
            + 2.0 * by_e * by_mu * covariance[(E, MU)];
        let std = if determined { variance.sqrt() } else { f64::NAN };
        if let Some(quantity) = Quantity::new(value, std) {
            let reach = quantity.std_uncertainty.map(|s| factor * s);
            pace.rating = Fitted::Determined(Estimate {
                quantity,
                interval_95: (reach.map(|r| value - r), reach.map(|r| value + r)),
            });
            pace.class = Some(itf::pace(value));
            pace.class_interval_95 = reach.map(|r| (itf::pace(value - r), itf::pace(value + r)));
        }
    }
    let note = gripped(group);
    (pace, note)
}

fn gripped(group: &GroupFit) -> Option<Note> {
    let shown = group.shown()?;
    let rows: Vec<String> = shown
        .rows
        .iter()
        .zip(&group.rows_used)
        .filter(|(row, _)| row.regime == RowRegime::Gripping)
        .map(|(_, number)| number.to_string())
        .collect();
    if rows.is_empty() {
        return None;
    }
    let many = rows.len();
    let listed = if many > 20 {
        format!("{} and more", rows[..20].join(", "))
    } else {
        rows.join(", ")
    };
    Some(Note {
        code: "rating_assumes_sliding",
        message: format!(
            "the court pace rating takes every bounce as sliding, but the ball gripped in {many} of {} rows ({listed}, by \
             {}): friction is underrated there, and the court would rate slower than it says. Use faster or flatter \
             bounces.",
            shown.rows.len(),
            shown.name.name()
        ),
    })
}
