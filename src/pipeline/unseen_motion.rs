//! The share of a result's uncertainty that comes from a camera's motion beyond what its frames are registered by.
//!
//! Before a plain wall with a floor line a camera that is held by hand is followed across the line, and along it nothing tells where it looks. It moves
//! there about as far as it is seen to move across, smoothly, from where it looked in the first frame, whose pixels are those of the calibration:
//!
//! ```text
//! d(t) = s Σ_k z_k sin((k − ½) π t/T) / (c (k − ½)^1.5),   c² = Σ_k (k − ½)⁻³,   z_k of variance 1
//! ```
//!
//! The first of these motions is a pan that dies away. Those of a random walk fall off as 1/(k − ½), those of a mass that is pushed at random as
//! 1/(k − ½)²; a hand is taken to lie between. At the flight's end, after T, d has the standard deviation s ([`UnseenMotion`]). In directions in which the
//! camera is followed, s is what the parts of the scene differ by in their shifts: which of them moves as the ball's plane does is not known.
//!
//! Each motion puts every point of the flight elsewhere. How the arcs follow is, to first order, the same least squares as their fit; the outer
//! products of what the parameters change by add to their covariance.
//!
//! Assumed: that a hand moves alike in all directions. Where it pans along the line alone, and nothing is seen to move, nothing is added; the result
//! says along which direction that may be ([`ShownMotion`](crate::detect::ShownMotion)).

use super::camera::CalibratedCamera;
use crate::calibration::Rectification;
use crate::detect::background::UnseenMotion;
use crate::flight::Flight;
use crate::flight::motion_model::FitPoint;
use crate::geometry::{PixelPoint, PlanePoint};
use nalgebra::Vector2;
use std::f64::consts::PI;

/// Motions that are told apart.
const MOTIONS: u32 = 8;

/// `flight` with what the `camera` may have moved by unseen since `first_s`, the time of the first frame, in its covariance.
pub fn widened(mut flight: Flight, camera: &CalibratedCamera<'_>, first_s: f64) -> Flight {
    let points = flight.fit_points();
    for shifts in motions(&points, camera, first_s) {
        flight.fit.widen(&points, &shifts);
    }
    flight
}

/// By how much each point moves in the plane where the `camera` moves unseen, since `first_s`, by one standard deviation of each of its motions.
pub fn motions(points: &[FitPoint], camera: &CalibratedCamera<'_>, first_s: f64) -> Vec<Vec<(f64, f64)>> {
    let last_s = points.iter().map(|p| p.sample.t).fold(first_s, f64::max);
    if last_s <= first_s {
        return Vec::new();
    }
    let numbers = (0..MOTIONS).map(|k| f64::from(k) + 0.5);
    let size = numbers.clone().map(|n| n.powi(-3)).sum::<f64>().sqrt();
    let shifts = |(unseen, number): (&UnseenMotion, f64)| {
        let moved_px = |t: f64| {
            let part = (t - first_s) / (last_s - first_s);
            unseen.std_px / (size * number.powf(1.5)) * (number * PI * part).sin() * unseen.along
        };
        let each = points.iter().map(|p| shift(p, moved_px(p.sample.t), &camera.map));
        each.collect::<Option<Vec<(f64, f64)>>>()
    };
    let unseen = camera.unseen_motions.iter();
    unseen
        .flat_map(|unseen| numbers.clone().map(move |number| (unseen, number)))
        .filter_map(shifts)
        .collect()
}

/// By how much a point moves in the plane where the picture moves by `moved_px`; `None` where it has no place.
fn shift(point: &FitPoint, moved_px: Vector2<f64>, map: &Rectification) -> Option<(f64, f64)> {
    let at = map.pixel_from_plane(PlanePoint::new(point.sample.r, point.sample.h))?;
    let moved = map.plane_from_pixel(PixelPoint::new(at.u_px + moved_px.x, at.v_px + moved_px.y))?;
    Some((moved.right - point.sample.r, moved.up - point.sample.h))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Calibration, MetresPerPixel, Scale};
    use crate::flight::linking::{LinkedSpots, Spot};
    use crate::flight::motion_model::VerticalPrior;
    use crate::flight::planar::ARCS;
    use crate::flight::side_view::SideView;
    use crate::frames::{Coded, RowOrder};
    use crate::test_noise::TestNoise;

    /// Of the arc, s.
    const LASTS_S: f64 = 0.4;

    fn calibration() -> Calibration {
        Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: 1e-3,
            std: None,
        }))
    }

    /// An arc seen by a camera that moves along the columns by `moved_px`.
    fn arc(map: &Rectification, moved_px: impl Fn(f64) -> f64) -> Flight {
        let mut random = TestNoise(5);
        let spots = (0..41).map(|i| {
            let t = 0.01 * f64::from(i);
            let at = map.pixel_from_plane(PlanePoint::new(
                100.0 + 400.0 * t,
                300.0 - 4900.0 * (t - 0.2).powi(2),
            ));
            let at = at.unwrap();
            let noise = 0.02 * random.normal();
            let seen = PixelPoint::new(at.u_px + moved_px(t) + noise, at.v_px);
            Spot {
                id: i as usize,
                frame: i as usize,
                time_s: t,
                place: map.plane_from_pixel(seen).unwrap(),
                std: 0.02,
                coded: Coded::Whole,
                radius: 10.0,
                contrast_grey: 80.0,
            }
        });
        let spots = LinkedSpots::new(spots.collect());
        crate::flight::find(&spots, &SideView::new(VerticalPrior::UNKNOWN)).expect("a ball flies")
    }

    #[test]
    fn a_pan_that_nothing_shows_is_in_what_it_moves_and_in_nothing_else() {
        let calibration = calibration();
        let mut camera = CalibratedCamera::new(&calibration, (640, 480), RowOrder::Down, false).unwrap();
        let still = arc(&camera.map, |_| 0.0);
        let panned = arc(&camera.map, |t| 3.0 * t / LASTS_S);
        camera.unseen_motions = vec![UnseenMotion {
            along: Vector2::x(),
            std_px: 3.0,
        }];
        let wide = widened(panned.clone(), &camera, 0.0);
        let std = |flight: &Flight, k: usize| flight.fit.covariance[(ARCS + k, ARCS + k)].sqrt();
        // Place and velocity to the right, then upward.
        for k in [0, 1] {
            let off = (panned.fit.parameters[ARCS + k] - still.fit.parameters[ARCS + k]).abs();
            assert!(off > 10.0 * std(&panned, k), "{k}: {off} {}", std(&panned, k));
            assert!(off < 2.0 * std(&wide, k), "{k}: {off} {}", std(&wide, k));
        }
        for k in [2, 3] {
            assert!((std(&wide, k) / std(&panned, k) - 1.0).abs() < 0.05, "{k}");
        }
    }
}
