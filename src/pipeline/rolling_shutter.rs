//! A rolling shutter that the calibration does not tell of: found by the flight, put right, and said.
//!
//! The readout time is one more number of the fit ([`row_delays`]), known beforehand to be 0 give or take the time from frame to
//! frame, which no camera's readout exceeds. It is taken for real where the points say so by more than that number's price, as
//! the odds of the two readings tell: exp(z²/2)·σ/τ for a value z standard uncertainties σ off 0, τ the width of what is known
//! beforehand; a scale that changes across the picture bends arcs in much the same way, and must be less likely. Lift does, too, and is taken out first. Then the times
//! of all points are those of their rows, the ball is looked for once more with them, and the number's uncertainty is carried through to all results. What a camera moves by unseen
//! ([`unseen_motion`]) is free beside it, since that, too, moves points on smooth ways that arcs do not follow. Where a flight was refused for its times, a few readouts are tried first.
//!
//! Where it is not taken for real, as in a recording of one short arc beside each impact, it may be there all the same: see [`super::untold_camera`].
//!
//! Assumed: a side view. Of a top view nothing is said of rows.

use super::camera::CalibratedCamera;
use super::refine::Refined;
use super::scaled::{self, Scaled};
use super::spots::with_id;
use super::{unseen_motion, untold_lens};
use crate::flight::linking::Spot;
use crate::flight::shown_shifts::{self, Shifts};
use crate::flight::{Flight, NoFlight, row_delays};
use crate::frames::timebase::TimeBase;
use crate::quantity::Quantity;
use rayon::prelude::*;

/// Odds, as a logarithm, from which a readout is taken for real: what else bends all arcs alike (drag that is not quite its
/// law, a lens) may look a little like it.
const LEAST_LN_ODDS: f64 = 12.0;

/// Readouts tried where no flight is found without one, as parts of the time from frame to frame.
const TRIED_PARTS: [f64; 6] = [0.4, 0.7, 0.2, 0.95, -0.4, -0.8];

/// A readout is no longer than from frame to frame, but for what a rate is off by.
const LONGEST_PART: f64 = 1.05;

/// Rounds of readout and flight, at most.
const MOST_ROUNDS: usize = 3;

/// A readout that changes by less than this part of its standard uncertainty is found.
const SETTLED_PART: f64 = 0.2;

/// Part of the points used without a readout that must be used with it.
const KEPT_PART: f64 = 0.9;

/// The camera with the readout that the flight of a recording shows; `None` where it shows none. `follow` finds the flight by a camera;
/// `first` is what was found without a readout, if anything; `base` are the times of the frames.
pub fn found<'a>(
    camera: &CalibratedCamera<'a>,
    first: Option<&Refined>,
    base: &TimeBase,
    follow: impl Fn(&CalibratedCamera<'a>) -> Result<Refined, NoFlight> + Sync,
) -> Option<CalibratedCamera<'a>> {
    let interval_s = base.interval_s?;
    if camera.calibration.readout_s.is_some() || !camera.falls() {
        return None;
    }
    match first {
        Some(refined) => {
            let readout = shown(camera, refined, base)?;
            let odds = ln_odds(readout, interval_s);
            let rival = || odds_of_scale_change(camera, refined).unwrap_or(0.0);
            let stands = odds > LEAST_LN_ODDS && odds > rival();
            stands
                .then(|| settled(camera, readout, base, &follow))?
                .filter(|(_, again)| {
                    again.tracked.flight.used() as f64 >= KEPT_PART * refined.tracked.flight.used() as f64
                })
                .map(|(rolling, _)| rolling)
        }
        None => {
            // What they settle at is the same, from wherever they find the flight.
            TRIED_PARTS.par_iter().find_map_first(|part| {
                let start = Quantity::undetermined(part * interval_s)?;
                settled(camera, start, base, &follow).map(|(rolling, _)| rolling)
            })
        }
    }
}

/// The camera with the readout that the flight settles at from `start`, and that flight; `None` where it comes to none.
fn settled<'a>(
    camera: &CalibratedCamera<'a>,
    start: Quantity,
    base: &TimeBase,
    follow: &impl Fn(&CalibratedCamera<'a>) -> Result<Refined, NoFlight>,
) -> Option<(CalibratedCamera<'a>, Refined)> {
    let interval_s = base.interval_s?;
    let mut readout = start;
    let mut last = None;
    for _ in 0..MOST_ROUNDS {
        if readout.value.abs() > LONGEST_PART * interval_s {
            return None;
        }
        let std_s = readout.std_uncertainty.unwrap_or(0.0);
        let rolling = camera.with_readout(readout.value, std_s);
        let refined = follow(&rolling).ok()?;
        let more = shown(&rolling, &refined, base)?;
        last = Some((rolling, refined));
        let std_s = more.std_uncertainty?;
        readout = Quantity::new(readout.value + more.value, std_s)?;
        if more.value.abs() < SETTLED_PART * std_s {
            break;
        }
    }
    let (rolling, refined) = last?;
    let rolling = rolling.with_readout(rolling.readout.whole_s, readout.std_uncertainty?);
    (ln_odds(readout, interval_s) > LEAST_LN_ODDS).then_some((rolling, refined))
}

/// By how much the readout is more than the camera's, as the flight shows it, s.
fn shown(camera: &CalibratedCamera<'_>, refined: &Refined, base: &TimeBase) -> Option<Quantity> {
    let open = opened(camera, refined);
    let points = open.fit_points();
    let mut known = unseen_motion::motions(&points, camera, *base.times_s.first()?);
    known.extend(untold_lens::shifts(&points, camera));
    let readout = shown_shifts::estimate(&open, shifts(&open, camera, refined, 1.0), known)?;
    readout.std_uncertainty.filter(|s| *s > 0.0).map(|_| readout)
}

/// Odds of a scale that changes against one that does not, as a logarithm: it bends arcs much as a readout does.
fn odds_of_scale_change(camera: &CalibratedCamera<'_>, refined: &Refined) -> Option<f64> {
    let open = opened(camera, refined);
    let scaled = Scaled::new(camera, refined, &open).ok()?;
    open.ln_odds_of_scale_change(&refined.tracked.first_look, &camera.facts(scaled.metres_per_unit))
}

/// The flight with all that its fit may leave open, and without lift.
pub fn opened(camera: &CalibratedCamera<'_>, refined: &Refined) -> Flight {
    let upright_std_rad = camera.calibration.upright_std_rad();
    let open = refined.tracked.flight.with_all_unknowns(upright_std_rad);
    scaled::without_lift(camera, refined, &[], &open).unwrap_or(open)
}

/// By how much the points of a `flight` are moved by a readout of `whole_s`.
pub fn shifts(flight: &Flight, camera: &CalibratedCamera<'_>, refined: &Refined, whole_s: f64) -> Shifts {
    let delay_s = |spot: &Spot| {
        let centre = with_id(&refined.tracked.centres, spot.id);
        centre.map_or(0.0, |c| whole_s * camera.readout.share(c.centre.disc.centre))
    };
    row_delays::ahead(flight, delay_s)
}

/// Odds of a readout against none, as a logarithm.
fn ln_odds(readout: Quantity, interval_s: f64) -> f64 {
    let std_s = readout.std_uncertainty.unwrap_or(f64::INFINITY);
    let width = interval_s.hypot(std_s);
    let square = |x: f64| x * x;
    0.5 * (square(readout.value / std_s) - square(readout.value / width)) + (std_s / width).ln()
}
