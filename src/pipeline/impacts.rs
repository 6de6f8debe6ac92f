//! From the flight to metres: bounces, distances, gravity, "up", the floor, the bench, with what the models make of them.

use super::ball_rotation::{self, ArcRotation};
use super::calibration_uncertainty;
use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::in_metres::{Impacts, WorldFrame};
use super::measurement::{UpSource, UpTilt};
use super::refine::Refined;
use super::scaled::{self, Scaled};
use super::unseen_fall;
use super::unseen_motion;
use super::untold_camera::{Untold, UntoldCamera};
use super::warnings::of_impacts::{WarningContext, of_impacts};
use crate::calibration::{Calibration, CalibrationError};
use crate::flight::planar::DRAG;
use crate::flight::{Flight, shake};
use crate::impact::compliant_reading::KnownContact;
use crate::impact::motion::{ImpactKind, MeasuredMotion};
use crate::impact::{BenchLaunch, Bounce, BounceSurface, reading};
use crate::quantity::Quantity;

/// The impacts of `refined`, whose arcs show the `rotations`.
///
/// # Errors
/// Where the calibration's scale rests on what was not measured.
pub fn impacts(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    refined: &Refined,
    rotations: &[ArcRotation],
) -> Result<Impacts, CalibrationError> {
    let calibration = camera.calibration;
    let flight = refined
        .tracked
        .flight
        .with_all_unknowns(calibration.upright_std_rad());
    let shake = shake::find(&scaled::without_lift(camera, refined, rotations, &flight)?);
    let shaken = shake.as_ref().and_then(|shake| flight.shaken_by(shake));
    let flight = shaken.unwrap_or(flight);
    let flight = flight.without_touching_points().unwrap_or(flight);
    let flight = flight.without_held_points().unwrap_or(flight);
    let scaled = |flight: &Flight| Scaled::new(camera, refined, flight);

    // The bounces tell the spins, these the lift, which bends the arcs, too; those without it are the ones that bounce.
    let plain = scaled(&flight)?.with_spins(refined, rotations);
    let (free, lift) = plain.without_lift(&flight);
    let (first_look, facts) = (&refined.tracked.first_look, camera.facts(plain.metres_per_unit));
    let departure = free.likeliest_departure(first_look, &facts);
    let departed = flight.departing(departure, first_look, &facts);
    let (scaled, free, lift, mut flight) = match departed {
        Some(departed) => {
            let scaled = scaled(&departed)?.with_spins(refined, rotations);
            let (free, lift) = scaled.without_lift(&departed);
            (scaled, free, lift, departed)
        }
        None => (plain, free, lift, flight),
    };
    let metres_per_unit = scaled.metres_per_unit;
    // Lift is no scatter, nor an error that lasts.
    flight.extra = free.extra;
    flight.fit.autocorrelation_inflation = free.fit.autocorrelation_inflation;
    let told = calibration_uncertainty::widened(&free, calibration, &camera.map);
    let with_the_rest = |flight: Flight| {
        let mut flight = flight.with_slow_errors();
        if let Some(&first_s) = clocked.base.times_s.first() {
            flight = unseen_motion::widened(flight, camera, first_s);
        }
        unseen_fall::widened(flight, camera, metres_per_unit.value)
    };
    let untold = UntoldCamera::of(camera, refined, &clocked.base, departure.slant_std());
    let free = with_the_rest(untold.widened(&told, None));
    let with_a_known_readout = untold
        .has(Untold::Readout)
        .then(|| with_the_rest(untold.widened(&told, Some(Untold::Readout))));
    let mut motion = scaled.motion(&free, lift.clone());
    let first_restitution_std = |motion: &MeasuredMotion<'_>| {
        let mut restitutions = motion.bounces().into_iter().filter_map(|(_, b)| b.restitution);
        restitutions.next()?.std_uncertainty
    };
    let gravity_m_s2 = motion.gravity_m_s2();
    if let Some(part) = gravity_m_s2.and_then(|g| calibration.gravity_mismatch(g)) {
        motion = motion.with_doubted_scale(part);
    }
    let since_first_frame = |time: Option<Quantity>| {
        let unseen_s = |t: &Quantity| clocked.unseen_gaps_std_s(&flight.spans, t.value);
        time.map(|t| t.with_more_std(unseen_s(&t)))
    };
    let mut bounces = motion.bounces();
    for (_, bounce) in &mut bounces {
        bounce.time_s = since_first_frame(bounce.time_s);
    }
    let radius_m = scaled.radius_m();
    let on_floor = bounces.iter().filter(|(_, b)| b.surface == BounceSurface::Floor);
    let on_floor: Vec<Bounce> = on_floor.map(|(_, b)| b.clone()).collect();
    let walls = (0..flight.impacts.len()).filter(|&k| motion.kind(k) == Some(ImpactKind::Wall));
    let drag = Quantity::new(free.fit.drag(), free.fit.covariance[(DRAG, DRAG)].max(0.0).sqrt());
    let frame = WorldFrame::new(&motion, &bounces, radius_m, calibration);
    let spin = |k: usize| {
        let (from, to) = flight.spans[k];
        let here = |r: &&ArcRotation| (r.span_s.0..=r.span_s.1).contains(&(0.5 * (from + to)));
        let rotation = rotations.iter().find(here)?;
        ball_rotation::arc_spin(camera, refined, &frame, rotation, motion.seen_spin(k))
    };
    let impacts = Impacts {
        spins: (0..flight.fit.arcs()).map(spin).collect(),
        metres_per_px: Some(metres_per_unit.scaled(camera.units_per_px())),
        drag_per_m: drag.map(|beta| beta.scaled(1.0 / metres_per_unit.value)),
        frame,
        radius_px: scaled.radius_px,
        radius_m,
        shake,
        gravity_m_s2,
        up: up(&motion, calibration.upright_std_rad()),
        floor: motion.floor(),
        launch: motion.bench_launch().map(|launch| BenchLaunch {
            time_s: since_first_frame(launch.time_s),
            ..launch
        }),
        readings: camera
            .falls()
            .then(|| reading::read(&on_floor, known_contact(calibration)))
            .flatten(),
        walls: walls.count(),
        distances: motion.distances(&bounces),
        bounces,
        flight,
        warnings: Vec::new(),
    };
    let context = WarningContext {
        restitution_stds: [
            first_restitution_std(&motion),
            with_a_known_readout.and_then(|free| first_restitution_std(&scaled.motion(&free, lift))),
        ],
        lens_part: untold.lens_part(),
        calibration,
        camera,
        motion: &motion,
        departure: departure.is_likely().then_some(departure),
        first_look,
        interval_s: clocked.base.interval_s.unwrap_or(impacts.flight.interval_s),
        impacts: &impacts,
    };
    let warnings = of_impacts(&context);
    Ok(Impacts { warnings, ..impacts })
}

/// What the materials of ball and floor say of their contact.
fn known_contact(calibration: &Calibration) -> Option<KnownContact> {
    Some(KnownContact {
        stiffness_ratio: calibration.stiffness_ratio()?,
        inertia_factor: calibration.ball.inertia_factor,
    })
}

/// How far the fall and the calibration together have "up" from where the calibration alone has it, to `prior_std_rad`.
fn up(motion: &MeasuredMotion<'_>, prior_std_rad: f64) -> Option<UpTilt> {
    let tilt_rad = motion.tilt_rad()?;
    let by_fall = tilt_rad
        .std_uncertainty
        .is_none_or(|std| std * std < 0.5 * prior_std_rad * prior_std_rad);
    let source = if by_fall {
        UpSource::Fall
    } else {
        UpSource::Calibration
    };
    Some(UpTilt { tilt_rad, source })
}
