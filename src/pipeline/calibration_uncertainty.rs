//! The share of a result's uncertainty that comes from the lens and the plane.
//!
//! The calibration may be off by each of its [deviations](Calibration::deviated), one standard deviation along a principal
//! axis. Each of them puts every point of the flight elsewhere; how the arcs follow is, to first order, the same least
//! squares as their fit. The outer products of what the parameters change by add to their covariance, and so reach every
//! result with the right correlations: a lens that makes all lengths longer does nothing to e.

use crate::calibration::{Calibration, Rectification};
use crate::flight::Flight;
use crate::flight::motion_model::FitPoint;
use crate::geometry::{PixelPoint, PlanePoint};

/// `flight` with the uncertainty of `calibration`'s lens and plane in its covariance; `map` is the calibration's own.
pub fn widened(flight: &Flight, calibration: &Calibration, map: &Rectification) -> Flight {
    let mut wide = flight.clone();
    let points = flight.fit_points();
    for off in calibration.deviated() {
        let there = off.rectification().ok();
        if let Some(shifts) = there.and_then(|there| shifts(&points, (calibration, map), (&off, &there))) {
            wide.fit.widen(&points, &shifts);
        }
    }
    wide
}

/// By how much each point moves in the plane, in units of the calibration's own scale; `None` where one has no place.
fn shifts(
    points: &[FitPoint],
    (calibration, map): (&Calibration, &Rectification),
    (off, there): (&Calibration, &Rectification),
) -> Option<Vec<(f64, f64)>> {
    let pixels: Vec<PixelPoint> = points
        .iter()
        .map(|p| map.pixel_from_plane(PlanePoint::new(p.sample.r, p.sample.h)))
        .collect::<Option<_>>()?;
    let middle = *pixels.get(pixels.len() / 2)?;
    let stretch = calibration.metres_ratio(map, (off, there), middle)?;
    points
        .iter()
        .zip(&pixels)
        .map(|(p, pixel)| {
            let moved = there.plane_from_pixel(*pixel)?;
            Some((
                stretch * moved.right - p.sample.r,
                stretch * moved.up - p.sample.h,
            ))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::{Deviation, Lens, Ruler, Scale};
    use crate::flight::linking::{LinkedSpots, Spot};
    use crate::flight::motion_model::VerticalPrior;
    use crate::flight::planar::{ARCS, GRAVITY};
    use crate::flight::side_view::SideView;
    use crate::flight::{self, Flight};
    use nalgebra::Matrix3;

    fn find(spots: Vec<Spot>) -> Flight {
        flight::find(&LinkedSpots::new(spots), &SideView::new(VerticalPrior::UNKNOWN)).unwrap()
    }

    fn lens(k1: f64) -> Lens {
        let camera = Matrix3::new(1000.0, 0.0, 640.0, 0.0, 1000.0, 360.0, 0.0, 0.0, 1.0);
        Lens::new(camera, [k1, 0.0, 0.0, 0.0, 0.0]).unwrap()
    }

    fn calibration(k1: f64, k1_std: f64) -> Calibration {
        let mut c = Calibration::new(Scale::Ruler(Ruler {
            from: PixelPoint::new(100.0, 650.0),
            to: PixelPoint::new(1100.0, 650.0),
            length_m: 1.0,
            length_std_m: None,
            point_std_px: Some(0.5),
        }));
        c.lens = Some(lens(k1));
        c.deviations = vec![Deviation {
            lens: [0.0, 0.0, 0.0, 0.0, k1_std, 0.0, 0.0, 0.0, 0.0],
            world_from_pixel: None,
        }];
        c
    }

    /// A bounce as the picture shows it through a lens of k1 = −0.2, mapped by `map`.
    fn spots(map: &Rectification) -> Vec<Spot> {
        let truth = calibration(-0.2, 0.0).rectification().unwrap();
        // Between two frames, so that each point has one arc.
        let (g, hit) = (9800.0, 0.2025);
        (0..100)
            .map(|i| {
                let t = i as f64 * 0.005;
                let s = t - hit;
                let (right, up) = if s < 0.0 {
                    (100.0 + 1200.0 * t, -600.0 - 1960.0 * s - 0.5 * g * s * s)
                } else {
                    (343.0 + 900.0 * s, -600.0 + 1500.0 * s - 0.5 * g * s * s)
                };
                let seen = truth.pixel_from_plane(PlanePoint::new(right, up)).unwrap();
                Spot {
                    id: i,
                    frame: i,
                    coded: crate::frames::Coded::Whole,
                    time_s: t,
                    place: map.plane_from_pixel(seen).unwrap(),
                    std: 0.05,
                    radius: 15.0,
                    contrast_grey: 100.0,
                }
            })
            .collect()
    }

    #[test]
    fn the_uncertainty_of_a_lens_is_what_a_lens_so_far_off_does() {
        let step = 0.001;
        let c = calibration(-0.2, step);
        let map = c.rectification().unwrap();
        let flight = find(spots(&map));
        let wide = widened(&flight, &c, &map);
        // The same flight measured with the other lens, in its own units, brought to the first one's metres.
        let other = calibration(-0.2 + step, step);
        let there = other.rectification().unwrap();
        let again = find(spots(&there));
        let ratio = c
            .metres_ratio(&map, (&other, &there), PixelPoint::new(400.0, 400.0))
            .unwrap();
        for i in [GRAVITY, ARCS + 1, ARCS + 3, ARCS + 5, ARCS + 7] {
            let added = (wide.fit.covariance[(i, i)] - flight.fit.covariance[(i, i)]).sqrt();
            let change = (ratio * again.fit.parameters[i] - flight.fit.parameters[i]).abs();
            assert!(
                (added - change).abs() < 0.05 * change + 1e-3,
                "{i}: {added} {change}"
            );
            assert!(added > 0.0);
        }
    }

    #[test]
    fn a_calibration_without_deviations_adds_nothing() {
        let mut c = calibration(-0.2, 0.01);
        c.deviations.clear();
        let map = c.rectification().unwrap();
        let flight = find(spots(&map));
        assert_eq!(widened(&flight, &c, &map).fit.covariance, flight.fit.covariance);
    }
}
