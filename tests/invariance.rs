//! What must not change the physics: mirror, units, order, the clock's zero, the picture's zero and its turn. On flights made
//! of formulas; through rendered recordings the same is asked in `invariance_video.rs`.
//!
//! The tolerances follow from rounding. A place in the picture is up to 1e4 px, so that it is rounded to 1e-12 px (ulp/2), a
//! part of 5e-11 of a centre's deviation of 0.02 px; a result that is a function of some hundred centres, and its
//! uncertainty, move by no more than a few hundred such parts of their own standard uncertainty: ROUNDED. The search for the
//! arcs asks yes-or-no questions, but none of them to the last digit.

use crate::flown::{self, Film, Measured, quantities};
use crate::noise::Noise;
use crate::series::{self, TRACK, Truth, angles, distances, spread, velocities};
use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use track::calibration::{MetresPerPixel, Scale};
use track::flight::linking::Spot;
use track::geometry::PlanePoint;
use track::quantity::Quantity;
use track::rebound::fit::{self, Column, GroupFit, Options, Parameter, Row, Series};
use track::rebound::{ModelName, RigidMotion, SOLID_SPHERE, mu_e};

/// Part of its standard uncertainty by which rounding of places may move a result; see above.
const ROUNDED: f64 = 1e-7;

prop_compose! {
    fn any_film()(
        angle_deg in 5.0..70.0_f64, spin in -0.5..0.6_f64, e in 0.55..0.95_f64, mu in 0.03..0.3_f64,
        metres_per_px in 4e-4..2e-3_f64, phase in 0.0..1.0_f64, seed in any::<u64>(),
    ) -> Film {
        let vx = 1.5 * angle_deg.to_radians().tan();
        let before = RigidMotion {
            velocity_m_s: Vector3::new(vx, 0.0, -1.5),
            surface_spin_m_s: Vector3::new(0.0, spin * vx, 0.0),
        };
        let p = mu_e::Parameters { restitution: e, friction: mu, static_friction: mu };
        let film = Film::new(before, mu_e::impact(&before, &p, SOLID_SPHERE).0, Some(spin));
        Film { metres_per_px, fall_s: film.fall_s + phase / film.rate_hz, seed, ..film }
    }
}

/// Compares bounce by bounce, quantity by quantity; `expected` makes of a name and a quantity what it has to become.
fn same(
    a: &Measured,
    b: &Measured,
    part: f64,
    expected: impl Fn(&str, f64) -> f64,
) -> Result<(), TestCaseError> {
    prop_assert_eq!(a.bounces.len(), b.bounces.len());
    for (x, y) in a.bounces.iter().zip(&b.bounces) {
        for ((name, x), (_, y)) in quantities(x).into_iter().zip(quantities(y)) {
            prop_assert_eq!(x.is_some(), y.is_some(), "{}", name);
            let (Some(x), Some(y)) = (x, y) else { continue };
            compare(name, x, y, part, &expected)?;
        }
    }
    for (name, x, y) in [
        ("gravity", a.gravity_m_s2, b.gravity_m_s2),
        ("distance x", a.distances.x_m, b.distances.x_m),
    ] {
        prop_assert_eq!(x.is_some(), y.is_some(), "{}", name);
        if let (Some(x), Some(y)) = (x, y) {
            compare(name, x, y, part, &expected)?;
        }
    }
    let regimes = |m: &Measured| {
        m.readings.as_ref().map(|r| {
            (
                r.models
                    .iter()
                    .map(|(name, m)| (*name, m.regime))
                    .collect::<Vec<_>>(),
                r.preferred,
            )
        })
    };
    prop_assert_eq!(regimes(a), regimes(b));
    Ok(())
}

fn compare(
    name: &str,
    x: Quantity,
    y: Quantity,
    part: f64,
    expected: &impl Fn(&str, f64) -> f64,
) -> Result<(), TestCaseError> {
    let want = expected(name, x.value);
    prop_assert_eq!(
        x.std_uncertainty.is_some(),
        y.std_uncertainty.is_some(),
        "{}",
        name
    );
    // Without an uncertainty (a spin of 0 times a speed) what is left is the rounding of the number itself.
    let std = y.std_uncertainty.unwrap_or(1e-6 * y.value.abs());
    let allowed = part * std + 1e-13 * want.abs();
    prop_assert!((y.value - want).abs() <= allowed, "{}: {:?} {:?}", name, x, y);
    if let (Some(u), Some(v)) = (x.std_uncertainty, y.std_uncertainty) {
        let want = (expected(name, x.value + u) - expected(name, x.value)).abs();
        // Uncertainties are by differences over a tenth of each deviation, which costs them six digits.
        prop_assert!(
            (v / want - 1.0).abs() <= 1e-5_f64.max(100.0 * part),
            "{}: {:?} {:?}",
            name,
            x,
            y
        );
    }
    Ok(())
}

fn unchanged(_: &str, x: f64) -> f64 {
    x
}

fn with_places(film: &Film, move_: impl Fn(PlanePoint) -> PlanePoint) -> Vec<Spot> {
    let mut spots = film.spots();
    for s in &mut spots {
        s.place = move_(s.place);
    }
    spots
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_mirror_shows_the_same_launch(film in any_film()) {
        let mirrored = with_places(&film, |p| PlanePoint::new(-p.right, p.up));
        let b = flown::measured(&mirrored, &film.calibration(), film.metres_per_px).unwrap();
        // x counts along the launch on both sides.
        same(&film.measured().unwrap(), &b, ROUNDED, unchanged)?;
    }

    #[test]
    fn millimetres_are_metres_times_a_thousand(film in any_film()) {
        let mut c = film.calibration();
        c.scale = Scale::MetresPerPixel(MetresPerPixel { value: 1e3 * film.metres_per_px, std: Some(1e-6 * film.metres_per_px) });
        c.gravity_m_s2 *= 1e3;
        let b = flown::measured(&film.spots(), &c, 1e3 * film.metres_per_px).unwrap();
        let lengths = ["x", "vx before", "vz before", "vx after", "vz after", "spin before", "spin after", "gravity", "distance x"];
        same(&film.measured().unwrap(), &b, ROUNDED, |name, x| if lengths.contains(&name) { 1e3 * x } else { x })?;
    }

    #[test]
    fn the_clock_may_start_anywhere(film in any_film(), start_s in prop::sample::select(vec![-7.25, 1.0, 3600.0, 1e6])) {
        let later = Film { start_s, ..film };
        // A time of 1e6 s is rounded to 6e-11 s, in which a ball of 5 m/s goes 3e-10 m, 4e-7 px at 0.8 mm: a part of 2e-5 of a
        // centre's deviation, and at most that of the result's; and the time of impact is rounded to that itself.
        let part = if start_s.abs() > 1e4 { 1e-3 } else { 1e-4 };
        same(&film.measured().unwrap(), &later.measured().unwrap(), part, |name, x| {
            if name == "time" { x + start_s } else { x }
        })?;
    }

    #[test]
    fn the_picture_may_be_shifted(film in any_film(), u in -3000.0..3000.0_f64, v in -3000.0..3000.0_f64) {
        let shifted = Film {
            hit_px: [film.hit_px[0] + u, film.hit_px[1] + v],
            origin_px: [film.origin_px[0] + u, film.origin_px[1] + v],
            ..film
        };
        same(&film.measured().unwrap(), &shifted.measured().unwrap(), ROUNDED, unchanged)?;
    }

    #[test]
    fn the_picture_may_be_turned_with_its_up(film in any_film(), tilt_rad in -3.1..3.1_f64) {
        // The same errors of the centres, turned too: noise on the places in the plane, not on pixels.
        let turned = Film { tilt_rad, noise_px: 0.0, ..film };
        let level = Film { noise_px: 0.0, ..film };
        let noisy = |film: &Film| {
            let mut noise = Noise(film.seed);
            let mut spots = film.spots();
            for s in &mut spots {
                s.place.right += 0.02 * noise.normal();
                s.place.up += 0.02 * noise.normal();
                s.std = 0.02;
            }
            flown::measured(&spots, &film.calibration(), film.metres_per_px).unwrap()
        };
        same(&noisy(&level), &noisy(&turned), ROUNDED, unchanged)?;
    }
}

// ------------------------------------------------------------------------------------------------------------ fits

fn truth_of(kind: u8) -> Truth {
    match kind {
        0 => series::mu_e(0.78, 0.07, 0.07),
        1 => series::e_e(0.9, 0.4),
        _ => series::grip_slide(0.96, 0.5, 0.2),
    }
}

fn any_series() -> impl Strategy<Value = Series> {
    (0..3_u8, 0..3_u8, 5..14_usize, any::<u64>()).prop_map(|(kind, set, count, seed)| {
        let make = [velocities as series::Maker, angles, distances][set as usize];
        series::series(
            &truth_of(kind),
            &spread(12.0, 65.0, count),
            0.0,
            make,
            TRACK,
            &mut Noise(seed),
        )
    })
}

fn fitted(rows: Vec<Row>) -> GroupFit {
    let series = Series::new("made", rows, Vec::new()).unwrap();
    fit::fit(&series, &Options::default()).groups.remove(0)
}

/// The search ends where no step would move χ² by a part of 1e-6 squared (`fit::search::SETTLED`), so that coefficients are
/// settled to 1e-6 of their uncertainty from any side: two searches may differ by some of that.
const SETTLED: f64 = 2e-5;

/// The same for the compliant model, whose χ² has valleys that lie close together: the search may end in another that suits the rows
/// nearly as well, about once in a thousand series.
const NEXT_VALLEY: f64 = 0.5;

/// χ² over its freedom from which a model is refuted: its least χ² may lie where a row changes sides, at which no method settles so
/// closely.
const REFUTED: f64 = 10.0;

fn same_fit(a: &GroupFit, b: &GroupFit) -> Result<(), TestCaseError> {
    prop_assert_eq!(a.preferred, b.preferred);
    for (x, y) in a.models.iter().zip(&b.models) {
        prop_assert_eq!(x.name, y.name);
        if x.chi2 > REFUTED * x.degrees_of_freedom as f64 {
            prop_assert!(
                (x.chi2 - y.chi2).abs() <= 0.25 * x.chi2,
                "{:?}: {} {}",
                x.name,
                x.chi2,
                y.chi2
            );
            continue;
        }
        let several = x.name == ModelName::Compliant;
        let settled = if several { NEXT_VALLEY } else { SETTLED };
        for parameter in Parameter::ALL {
            let (p, q) = (
                x.parameter(parameter).quantity(),
                y.parameter(parameter).quantity(),
            );
            prop_assert!(
                several || p.is_some() == q.is_some(),
                "{:?} of {:?}: {:?} {:?}, χ² {} and {}",
                parameter,
                x.name,
                x.parameter(parameter),
                y.parameter(parameter),
                x.chi2,
                y.chi2
            );
            let (Some(p), Some(q)) = (p, q) else { continue };
            let std = p.std_uncertainty.unwrap_or(1e-9);
            prop_assert!(
                (p.value - q.value).abs() <= settled * std,
                "{:?} of {:?}: {:?} {:?}, χ² {} and {}",
                parameter,
                x.name,
                p,
                q,
                x.chi2,
                y.chi2
            );
        }
        prop_assert!(
            (x.chi2 - y.chi2).abs() <= if several { 0.5 } else { 1e-6 } * (1.0 + x.chi2),
            "{:?}: {} {}",
            x.name,
            x.chi2,
            y.chi2
        );
    }
    Ok(())
}

proptest! {
    // The same series in every run: about once in a thousand the compliant model's search ends in another valley by more than [`NEXT_VALLEY`].
    #![proptest_config(ProptestConfig {
        cases: 12,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(2005),
        ..ProptestConfig::default()
    })]

    #[test]
    fn the_order_of_rows_does_not_matter(made in any_series(), by in 0..9_usize) {
        let mut rows = made.rows.clone();
        rows.reverse();
        let middle = by % rows.len();
        rows.rotate_left(middle);
        same_fit(&fitted(made.rows), &fitted(rows))?;
    }

    #[test]
    fn a_series_in_millimetres_or_mirrored_has_the_same_coefficients(made in any_series(), factor in prop::sample::select(vec![1e3, 1e-3, -1.0])) {
        const LENGTHS: [Column; 9] = [
            Column::IncidentVx, Column::IncidentVz, Column::ReboundVx, Column::ReboundVz, Column::SpinIn,
            Column::X0, Column::X, Column::LaunchSpeed, Column::Gravity,
        ];
        const SIDEWAYS: [Column; 5] =
            [Column::IncidentVx, Column::ReboundVx, Column::SpinIn, Column::IncidentAngle, Column::ReboundAngle];
        // Distances have no sides.
        prop_assume!(factor > 0.0 || made.rows[0].value(Column::X0).is_none());
        let rows: Vec<Row> = made.rows.iter().map(|row| {
            let mut row = row.clone();
            if row.value(Column::X0).is_some() && row.value(Column::Gravity).is_none() {
                row = row.with(Column::Gravity, fit::series::GRAVITY_M_S2, None);
            }
            for column in Column::ALL {
                let changes = if factor > 0.0 { LENGTHS.contains(&column) } else { SIDEWAYS.contains(&column) };
                if let Some(mut reading) = row.reading(column).filter(|_| changes) {
                    reading.value *= factor;
                    reading.std = reading.std.map(|s| s * factor.abs());
                    row.set(column, Some(reading));
                }
            }
            row
        }).collect();
        same_fit(&fitted(made.rows), &fitted(rows))?;
    }
}
