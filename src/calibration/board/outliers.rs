//! Which views and corners serve, and for how much: fit, weigh, set aside what does not belong, fit again.
//!
//! How far the corners of a sound picture miss is not the same for all (a board farther away, turned further, less light): one that
//! misses by several times the middle one's is weighed by its own scatter, which costs nothing of what it tells. Only where that would
//! leave it next to no weight it is no picture of the same flat board, and is set aside with its reason.

use super::error::BoardError;
use super::lens_fit::{self, LensFit};
use super::projection::CornerObservation;
use super::views::{BoardViews, ViewUse};
use crate::numeric::robust::median;

/// Fewer views than this do not fix a lens.
const LEAST_VIEWS: usize = 3;
/// A view that misses by this many times the middle one's is weighed by its own scatter.
const UNEVEN: f64 = 3.0;
/// One that misses by this many times the middle one's would count for a hundredth of it: it is no view of the same flat board.
const OUTLYING: f64 = 10.0;
/// A corner that misses by this many times all corners' is a speck of dust or a reflection: 5 standard deviations of a
/// coordinate, over √2.
const STRAY: f64 = 3.5;
/// Rounds of setting aside.
const ROUNDS: usize = 4;

/// Fits, sets aside what does not belong, and fits again.
pub(super) fn fit_without_outliers(
    views: &mut BoardViews,
    used: &mut Vec<usize>,
    size: (usize, usize),
) -> Result<LensFit, BoardError> {
    for _ in 0..ROUNDS {
        let fit = fit_of(views, used, size)?;
        let changed = drop_strays(views, used, &fit)
            | (drop_views(views, used, &fit) || weigh_views(views, used, &fit));
        if !changed {
            return Ok(fit);
        }
    }
    fit_of(views, used, size)
}

/// Drops corners that miss by far more than the others; whether there were any.
fn drop_strays(views: &mut BoardViews, used: &[usize], fit: &LensFit) -> bool {
    let mut any = false;
    for (k, &i) in used.iter().enumerate() {
        // Of a view that misses as a whole no corner is to blame.
        let limit = STRAY * fit.view_reduced_chi[k].max(1.0);
        let residuals = fit.residuals(k, &views.views[i].seen);
        let mut at = residuals.iter();
        let before = views.views[i].seen.len();
        views.views[i]
            .seen
            .retain(|_| at.next().is_some_and(|(_, r)| *r <= limit));
        any |= views.views[i].seen.len() < before;
    }
    any
}

/// Sets aside the worst view where it misses by far more than the middle one; whether there was one.
fn drop_views(views: &mut BoardViews, used: &mut Vec<usize>, fit: &LensFit) -> bool {
    let middle_of = |values: &[f64]| median(&mut values.to_vec()).unwrap_or(f64::NAN);
    let middle = middle_of(&fit.view_reduced_chi);
    let worst = (0..used.len())
        .filter(|&k| views.plane != Some(used[k]))
        .max_by(|&a, &b| fit.view_reduced_chi[a].total_cmp(&fit.view_reduced_chi[b]));
    match worst.filter(|&k| fit.view_reduced_chi[k] > OUTLYING * middle && used.len() > LEAST_VIEWS) {
        Some(k) => {
            let reason = format!(
                "its corners miss by {:.2} px, those of the others by {:.2}: blurred by motion, or the board bent",
                fit.view_rms_px[k],
                middle_of(&fit.view_rms_px)
            );
            views.views[used[k]].use_ = ViewUse::Aside(reason);
            used.remove(k);
            true
        }
        None => false,
    }
}

/// Gives the corners of uneven views the scatter that they have; whether there were any.
fn weigh_views(views: &mut BoardViews, used: &[usize], fit: &LensFit) -> bool {
    let middle = median(&mut fit.view_reduced_chi.clone()).unwrap_or(f64::NAN);
    let mut any = false;
    for (&i, &reduced) in used.iter().zip(&fit.view_reduced_chi) {
        if reduced > UNEVEN * middle {
            for seen in &mut views.views[i].seen {
                seen.std_px = fit.scattered_std_px(seen.std_px, reduced);
            }
            any = true;
        }
    }
    any
}

/// One fit of the views `used`.
fn fit_of(views: &BoardViews, used: &[usize], size: (usize, usize)) -> Result<LensFit, BoardError> {
    if used.len() < LEAST_VIEWS {
        let aside = views.views.len() - used.len();
        return Err(BoardError::TooFewViews {
            usable: match used.len() {
                1 => "one usable picture".to_owned(),
                n => format!("{n} usable pictures"),
            },
            aside: match views.views.iter().find_map(|v| match &v.use_ {
                ViewUse::Aside(reason) => Some((&v.name, reason)),
                _ => None,
            }) {
                Some((name, reason)) => format!("{aside} set aside, such as {name}, which {reason}"),
                None => "none set aside".to_owned(),
            },
            least: LEAST_VIEWS,
        });
    }
    let seen: Vec<Vec<CornerObservation>> = used.iter().map(|&i| views.views[i].seen.clone()).collect();
    lens_fit::fit(size, &seen)
}
