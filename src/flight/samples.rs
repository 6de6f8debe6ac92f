//! A track's spots as samples for segmentation: what they scatter by there, and which stretches of them are long enough to
//! show a fall.

use super::fit::Forces;
use super::linking::{Spot, Track};
use super::median;
use super::segment::TrackSample;

/// Segmentation asks for impacts, not for precision: residuals below this part of the radius are not worth a cut
/// (drag over a long arc, a drifting hand-held camera).
const SEGMENT_PART_OF_RADIUS: f64 = 0.04;

/// The same in a top view from a distance not known, where a ball that rises towards the camera bends the straight path.
const TOP_PART_OF_RADIUS: f64 = 0.2;

/// An arc counts as falling when its sagitta is this many standard deviations (of segmentation).
pub(super) const SAGITTA_SIGMAS: f64 = 6.0;

/// Where centres scatter by less than segmentation asks for, a curve may be lower by this part, too.
pub(super) const FINE_PART: f64 = 0.25;

pub(super) fn samples_of(spots: &[Spot], track: &Track, sigma: f64) -> Vec<TrackSample> {
    let weight = 1.0 / (sigma * sigma);
    track
        .iter()
        .map(|&i| TrackSample::of_spot(&spots[i], weight))
        .collect()
}

/// Standard deviation for segmentation: the largest of the stated uncertainty, the scatter that third differences
/// show (they vanish on a parabola) and a small part of the radius.
pub(super) fn segment_sigma(spots: &[Spot], track: &Track, forces: Forces) -> f64 {
    let mut stds: Vec<f64> = track.iter().map(|&i| spots[i].std).collect();
    let mut radii: Vec<f64> = track.iter().map(|&i| spots[i].radius).collect();
    let stated = median(&mut stds);
    let of_radius = if forces == Forces::None {
        TOP_PART_OF_RADIUS
    } else {
        SEGMENT_PART_OF_RADIUS
    };
    let part = of_radius * median(&mut radii);
    let seen = scatter_seen(spots, track).unwrap_or(0.0);
    stated.max(seen.min(5.0 * part)).max(part)
}

/// The standard deviation that a curve has to stand out from where all are low (a bounce of a large ball by less than its
/// radius): that of the centres, not what segmentation overlooks.
pub(super) fn fine_sigma(spots: &[Spot], track: &Track, sigma: f64) -> f64 {
    scatter_seen(spots, track).map_or(sigma, |seen| seen.clamp(FINE_PART * sigma, sigma))
}

/// What a track's centres scatter by as third differences show it, plane units; `None` where there are too few.
fn scatter_seen(spots: &[Spot], track: &Track) -> Option<f64> {
    let mut thirds = Vec::new();
    for w in track.windows(4) {
        let s: Vec<&Spot> = w.iter().map(|&i| &spots[i]).collect();
        let even = s[3].frame - s[0].frame == 3 && s.windows(2).all(|p| p[1].time_s > p[0].time_s);
        if even {
            let third = |y: fn(&Spot) -> f64| y(s[3]) - 3.0 * y(s[2]) + 3.0 * y(s[1]) - y(s[0]);
            thirds.push(third(|s| s.place.right).abs());
            thirds.push(third(|s| s.place.up).abs());
        }
    }
    // Variance of a third difference: 1 + 9 + 9 + 1.
    (thirds.len() >= 8).then(|| 1.4826 * median(&mut thirds) / 20.0_f64.sqrt())
}

/// Whether an arc is long enough to show the common fall.
pub(super) fn shows_fall(
    samples: &[TrackSample],
    range: &std::ops::Range<usize>,
    gravity: f64,
    sigma: f64,
) -> bool {
    let duration = samples[range.end - 1].t - samples[range.start].t;
    range.len() >= 4 && gravity * duration * duration / 8.0 > SAGITTA_SIGMAS * sigma
}
