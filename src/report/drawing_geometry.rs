//! Where things are, for drawing: impacts in the picture, the scale, a value on an arc between its samples.

use crate::geometry::PixelPoint;
use crate::pipeline::{ArcSample, ArcTrace, Measurement, TrackPoint};

/// An impact in time and in the reference picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ImpactMark {
    /// From 1, as the tables number the bounces.
    pub number: usize,
    /// Time, s.
    pub time_s: f64,
    /// The ball's centre then; `None` without arcs.
    pub centre: Option<PixelPoint>,
}

/// The impacts whose time is known. Each lies where the arcs beside it end: at the sample nearest in time.
pub(super) fn impacts(measurement: &Measurement) -> Vec<ImpactMark> {
    measurement
        .bounces
        .iter()
        .enumerate()
        .filter_map(|(index, bounce)| {
            let time_s = bounce.time_s.map(|time| time.value).filter(|t| t.is_finite())?;
            let centre = measurement
                .arcs
                .iter()
                .flat_map(|arc| &arc.samples)
                .min_by(|a, b| (a.time_s - time_s).abs().total_cmp(&(b.time_s - time_s).abs()))
                .map(|sample| sample.pixel);
            Some(ImpactMark {
                number: index + 1,
                time_s,
                centre,
            })
        })
        .collect()
}

/// Metres a pixel over the track as a whole: the spread of its points in the world over their spread in the picture.
/// Exact where the scale is the same everywhere; an average under a homography, good enough for an error band.
pub(super) fn metres_per_pixel(points: &[TrackPoint]) -> Option<f64> {
    let pairs: Vec<[f64; 4]> = points
        .iter()
        .filter_map(|p| p.world.map(|w| [p.pixel.u_px, p.pixel.v_px, w.x_m, w.up_m]))
        .collect();
    let count = pairs.len() as f64;
    let mut spread = [0.0; 4];
    for (axis, sum) in spread.iter_mut().enumerate() {
        let mean = pairs.iter().map(|pair| pair[axis]).sum::<f64>() / count;
        *sum = pairs.iter().map(|pair| (pair[axis] - mean).powi(2)).sum::<f64>();
    }
    let scale = ((spread[2] + spread[3]) / (spread[0] + spread[1])).sqrt();
    (scale.is_finite() && scale > 0.0).then_some(scale)
}

/// Metres a pixel along the arcs where it is the same everywhere within 3 %, so that a scale bar tells the truth.
pub(super) fn uniform_scale(arcs: &[ArcTrace]) -> Option<f64> {
    let (mut least, mut most, mut sum, mut count) = (f64::INFINITY, 0.0_f64, 0.0, 0.0);
    for pair in arcs.iter().flat_map(|arc| arc.samples.windows(2)) {
        let (Some(a), Some(b)) = (pair[0].world, pair[1].world) else {
            continue;
        };
        let scale = (a.x_m - b.x_m).hypot(a.up_m - b.up_m) / pair[0].pixel.distance_px(pair[1].pixel);
        if scale.is_finite() && scale > 0.0 {
            (least, most) = (least.min(scale), most.max(scale));
            (sum, count) = (sum + scale, count + 1.0);
        }
    }
    (most > 0.0 && most <= 1.03 * least).then(|| sum / count)
}

/// What `of` is at `time_s` on an arc: the cubic through the four samples around it, which follows a parabola exactly
/// where straight lines between samples would be off by a good part of a pixel. `None` outside the arc.
pub(super) fn on_arc(arc: &ArcTrace, time_s: f64, of: impl Fn(&ArcSample) -> f64) -> Option<f64> {
    let samples = &arc.samples;
    let (first, last) = (samples.first()?, samples.last()?);
    if !(first.time_s..=last.time_s).contains(&time_s) {
        return None;
    }
    let after = samples.partition_point(|sample| sample.time_s < time_s);
    let start = after.saturating_sub(2).min(samples.len().saturating_sub(4));
    let near = &samples[start..samples.len().min(start + 4)];
    let value: f64 = near
        .iter()
        .enumerate()
        .map(|(i, sample)| {
            let weight: f64 = near
                .iter()
                .enumerate()
                .filter(|&(j, _)| j != i)
                .map(|(_, other)| (time_s - other.time_s) / (sample.time_s - other.time_s))
                .product();
            weight * of(sample)
        })
        .sum();
    value.is_finite().then_some(value)
}

/// The largest of 1, 2, 5 times a power of ten that is not above `limit`; `limit` has to be positive.
pub(super) fn round_below(limit: f64) -> f64 {
    let decade = 10_f64.powf(limit.log10().floor());
    // A hair of tolerance, so that 0.5 stays 0.5.
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|digit| digit * decade)
        .find(|step| *step <= limit * (1.0 + 1e-9))
        .unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    #[test]
    fn impacts_lie_where_the_arcs_meet() {
        let measurement = test_measurements::two_bounces();
        let marks = impacts(&measurement);
        assert_eq!(marks.iter().map(|mark| mark.number).collect::<Vec<_>>(), [1, 2]);
        let joint = measurement.arcs[1].samples[0].pixel;
        assert!(marks[0].centre.unwrap().distance_px(joint) < 1e-9);
    }

    #[test]
    fn the_scale_is_found_from_the_points() {
        let measurement = test_measurements::two_bounces();
        let scale = metres_per_pixel(&measurement.track.points).unwrap();
        assert!((scale / 0.0009 - 1.0).abs() < 1e-6, "{scale}");
        assert!((uniform_scale(&measurement.arcs).unwrap() / 0.0009 - 1.0).abs() < 1e-9);
        assert_eq!(
            metres_per_pixel(&test_measurements::no_scale().track.points),
            None
        );
        assert_eq!(metres_per_pixel(&[]), None);
        assert_eq!(uniform_scale(&test_measurements::no_scale().arcs), None);
    }

    #[test]
    fn a_value_between_samples_follows_the_parabola() {
        let arc = &test_measurements::two_bounces().arcs[1];
        let (first, last) = (arc.samples[0], arc.samples[32]);
        let time_s = first.time_s + 0.377 * (last.time_s - first.time_s);
        let t = time_s - first.time_s;
        let launch = 0.5 * 9.81 * (last.time_s - first.time_s);
        let expected = first.pixel.v_px - (launch * t - 0.5 * 9.81 * t * t) / 0.0009;
        let found = on_arc(arc, time_s, |sample| sample.pixel.v_px).unwrap();
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        assert_eq!(on_arc(arc, first.time_s - 1e-6, |sample| sample.pixel.v_px), None);
    }

    #[test]
    fn round_numbers() {
        for (limit, round) in [(0.5, 0.5), (0.499, 0.2), (1.0, 1.0), (37.0, 20.0), (0.011, 0.01)] {
            assert!((round_below(limit) / round - 1.0).abs() < 1e-12);
        }
    }
}
