//! What a camera may do that nobody tells of, and the share of the results' uncertainties that comes from it: a shutter that exposes one row after the other
//! ([`rolling_shutter`]), a lens that bends lines ([`untold_lens`]).
//!
//! Each is as likely not to be there at all as to be of about its usual size: a readout as long as from frame to frame, a lens that moves the picture's
//! corners by a hundredth. What a flight's points leave of that is in all results, with a slanted plane beside it as far as the flight makes one
//! likely; points of long arcs leave little, those of short ones nearly all. `"camera": {"readout_s": 0}` and a `lens` whose distortion is 0 say that there is none.
//!
//! Assumed: a side view. A lens is not taken out of the places; a readout is where it is sure ([`rolling_shutter::found`]).

use super::camera::CalibratedCamera;
use super::refine::Refined;
use super::{rolling_shutter, unseen_motion, untold_lens};
use crate::flight::Flight;
use crate::flight::shown_shifts::{self, Likely, Shifts};
use crate::frames::timebase::TimeBase;

/// A lens is worth a word where it is there with at least this probability.
const LIKELY: f64 = 0.99;

/// What nobody tells of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Untold {
    /// How long the camera takes from its first row to its last.
    Readout,
    /// How it bends lines.
    Lens,
}

/// What is likely of it by a flight.
#[derive(Debug)]
pub struct UntoldCamera<'a> {
    seen_by: SeenFlight<'a>,
    /// What is not told, and what is likely of each, in its usual sizes.
    causes: Vec<Untold>,
    likely: Likely,
}

impl<'a> UntoldCamera<'a> {
    /// By the flight of `refined`. The scale may change over the path by a part of `slant_std`.
    pub fn of(
        camera: &'a CalibratedCamera<'a>,
        refined: &'a Refined,
        base: &'a TimeBase,
        slant_std: f64,
    ) -> Self {
        let seen_by = SeenFlight {
            camera,
            refined,
            base,
        };
        let open = rolling_shutter::opened(camera, refined);
        let of_causes = [Untold::Readout, Untold::Lens].map(|cause| (cause, seen_by.shifts(cause, &open)));
        let of_causes = of_causes
            .into_iter()
            .filter_map(|(cause, shifts)| Some((cause, shifts?)));
        let (causes, units): (Vec<Untold>, Vec<Shifts>) = of_causes.unzip();
        let points = open.fit_points();
        let first_s = base.times_s.first();
        let mut known = first_s.map_or_else(Vec::new, |&s| unseen_motion::motions(&points, camera, s));
        known.extend(seen_by.unsure_readout(&open));
        Self {
            likely: shown_shifts::likely(&open, &units, slant_std, known),
            seen_by,
            causes,
        }
    }

    /// Whether `cause` is one of what nobody tells of.
    pub fn has(&self, cause: Untold) -> bool {
        self.causes.contains(&cause)
    }

    /// By what part of their way from the middle a lens moves the corners of the picture, about; `None` where none is likely.
    pub fn lens_part(&self) -> Option<f64> {
        let k = self.causes.iter().position(|cause| *cause == Untold::Lens)?;
        let is_likely = self.likely.probabilities[k] > LIKELY;
        is_likely.then(|| untold_lens::USUAL_CORNER_PART * self.likely.products[(k, k)].sqrt())
    }

    /// `flight` with what is likely in its covariance, as if `known` were told, beside what is unsure of a readout that is.
    pub fn widened(&self, flight: &Flight, known: Option<Untold>) -> Flight {
        let points = flight.fit_points();
        let mut flight = flight.clone();
        if let Some(shifts) = self.seen_by.unsure_readout(&flight) {
            flight.fit.widen(&points, &shifts);
        }
        let kept: Vec<usize> = (0..self.causes.len())
            .filter(|&k| Some(self.causes[k]) != known)
            .collect();
        let units: Option<Vec<Shifts>> = kept
            .iter()
            .map(|&k| self.seen_by.shifts(self.causes[k], &flight))
            .collect();
        let Some(units) = units.filter(|units| !units.is_empty()) else {
            return flight;
        };
        let products = self.likely.products.select_rows(&kept).select_columns(&kept);
        let eigen = products.symmetric_eigen();
        for (square, parts) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let size = square.max(0.0).sqrt();
            let sum = |i: usize| {
                let parts = parts.iter().zip(&units);
                parts.fold((0.0, 0.0), |(r, h), (part, unit)| {
                    (r + size * part * unit[i].0, h + size * part * unit[i].1)
                })
            };
            flight
                .fit
                .widen(&points, &(0..points.len()).map(sum).collect::<Shifts>());
        }
        flight
    }
}

/// A flight with the camera and the clock that it was seen by.
#[derive(Debug)]
struct SeenFlight<'a> {
    camera: &'a CalibratedCamera<'a>,
    refined: &'a Refined,
    base: &'a TimeBase,
}

impl SeenFlight<'_> {
    /// By how much the points of a `flight` are moved by a `cause` of its usual size; `None` where it is told, or was found.
    fn shifts(&self, cause: Untold, flight: &Flight) -> Option<Shifts> {
        let camera = self.camera;
        match cause {
            Untold::Readout => {
                let untold = camera.calibration.readout_s.is_none() && camera.readout.whole_s == 0.0;
                let interval_s = self.base.interval_s;
                let interval_s = interval_s.unwrap_or(self.refined.tracked.flight.interval_s);
                let shifts = || rolling_shutter::shifts(flight, camera, self.refined, interval_s);
                (untold && camera.falls()).then(shifts)
            }
            Untold::Lens => untold_lens::shifts(&flight.fit_points(), camera),
        }
    }

    /// By how much they are moved by a readout that is known, by one standard uncertainty of it.
    fn unsure_readout(&self, flight: &Flight) -> Option<Shifts> {
        let std_s = self.camera.readout.std_s;
        (std_s > 0.0).then(|| rolling_shutter::shifts(flight, self.camera, self.refined, std_s))
    }
}
