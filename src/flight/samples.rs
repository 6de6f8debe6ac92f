//! A track's spots as samples for segmentation: what they scatter by there, and which stretches of them are long enough to
//! show a fall.

use super::linking::{Spot, median_radius};
use super::segment::TrackSample;
use crate::numeric::robust::{median, std_from_magnitudes};
use std::ops::Range;

/// An arc counts as falling when its sagitta is this many standard deviations (of segmentation).
pub(super) const SAGITTA_SIGMAS: f64 = 6.0;

/// Where centres scatter by less than segmentation asks for, a curve may be lower by this part, too.
pub(super) const FINE_PART: f64 = 0.25;

/// Middle and extent of some values.
pub(super) fn middle_and_extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    (0.5 * (low + high), high - low)
}

/// A track's spots, each with the standard deviation `sigma`.
pub(super) fn samples_of(spots: &[Spot], sigma: f64) -> Vec<TrackSample> {
    let weight = 1.0 / (sigma * sigma);
    spots.iter().map(|s| TrackSample::of_spot(s, weight)).collect()
}

/// Standard deviation for segmentation, which asks for impacts and not for precision: the largest of the stated uncertainty,
/// the scatter that third differences show (they vanish on a parabola) and a small part of the radius.
pub(super) fn segment_sigma(spots: &[Spot], part_of_radius: f64) -> f64 {
    let mut stds: Vec<f64> = spots.iter().map(|s| s.std).collect();
    let stated = median(&mut stds).unwrap_or(0.0);
    let part = part_of_radius * median_radius(spots);
    let seen = scatter_seen(spots).unwrap_or(0.0);
    stated.max(seen.min(5.0 * part)).max(part)
}

/// The standard deviation that a curve has to stand out from where all are low (a bounce of a large ball by less than its
/// radius): that of the centres, not what segmentation overlooks.
pub(super) fn fine_sigma(spots: &[Spot], sigma: f64) -> f64 {
    scatter_seen(spots).map_or(sigma, |seen| seen.clamp(FINE_PART * sigma, sigma))
}

/// What a track's centres scatter by as third differences show it, plane units; `None` where there are too few.
pub(super) fn scatter_seen(spots: &[Spot]) -> Option<f64> {
    let mut thirds = Vec::new();
    for s in spots.windows(4) {
        let even = s[3].frame - s[0].frame == 3 && s.windows(2).all(|p| p[1].time_s > p[0].time_s);
        if even {
            let third = |y: fn(&Spot) -> f64| y(&s[3]) - 3.0 * y(&s[2]) + 3.0 * y(&s[1]) - y(&s[0]);
            thirds.push(third(|s| s.place.right).abs());
            thirds.push(third(|s| s.place.up).abs());
        }
    }
    // Variance of a third difference: 1 + 9 + 9 + 1.
    let std = std_from_magnitudes(&mut thirds).filter(|_| thirds.len() >= 8)?;
    Some(std / 20.0_f64.sqrt())
}

/// Whether an arc is long enough to show the common fall.
pub(super) fn shows_fall(samples: &[TrackSample], range: &Range<usize>, gravity: f64, sigma: f64) -> bool {
    let duration = samples[range.end - 1].t - samples[range.start].t;
    range.len() >= 4 && gravity * duration * duration / 8.0 > SAGITTA_SIGMAS * sigma
}
