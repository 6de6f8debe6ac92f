//! From the flight to metres: bounces, distances, gravity, "up", the floor, the bench, with what the models make of them.

use super::ball_model::{self, BallModel};
use super::ball_rotation::{self, ArcRotation};
use super::calibration_uncertainty;
use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::in_metres::{Impacts, WorldFrame};
use super::measurement::{UpSource, UpTilt};
use super::refine::Refined;
use super::rolling_shutter;
use super::unseen_motion;
use super::warnings::of_impacts::{WarningContext, of_impacts};
use crate::calibration::{Calibration, CalibrationError};
use crate::flight::planar::DRAG;
use crate::flight::{Flight, shake};
use crate::impact::compliant_reading::KnownContact;
use crate::impact::error_budget::{CHROMA_COMMON_PART, CHROMA_PLACES_PART, LASTING_PART, PLACES_STD_PX};
use crate::impact::from_flight::ImagingErrors;
use crate::impact::motion::{ImpactKind, MeasuredMotion};
use crate::impact::seen_spin::SeenSpin;
use crate::impact::spin_lift::SpinLift;
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
    let ball = refined.ball.as_ref();
    let radius_px = refined
        .radius_is_seen
        .then(|| ball_model::radius_px(camera, &refined.tracked, ball))
        .flatten();
    let flight = refined
        .tracked
        .flight
        .with_all_unknowns(calibration.upright_std_rad());
    let shake = shake::find(&flight);
    let shaken = shake.as_ref().and_then(|shake| flight.shaken_by(shake));
    let flight = shaken.unwrap_or(flight);
    let flight = flight.without_touching_points().unwrap_or(flight);
    let flight = flight.without_held_points().unwrap_or(flight);
    let scaled = |flight: &Flight| -> Result<Scaled<'_>, CalibrationError> {
        Ok(Scaled {
            camera,
            ball,
            radius_px,
            metres_per_unit: camera.metres_per_unit(flight, radius_px)?,
            seen_spins: Vec::new(),
        })
    };

    // The bounces tell the spins, these the lift, which bends the arcs, too; those without it are the ones that bounce.
    let plain = scaled(&flight)?.with_spins(refined, rotations);
    let (free, lift) = plain.motion(&flight, SpinLift::default()).without_lift();
    let (first_look, facts) = (&refined.tracked.first_look, camera.facts(plain.metres_per_unit));
    let departure = free.likeliest_departure(first_look, &facts);
    let departed = flight.departing(departure, first_look, &facts);
    let (scaled, free, lift, mut flight) = match departed {
        Some(departed) => {
            let scaled = scaled(&departed)?.with_spins(refined, rotations);
            let (free, lift) = scaled.motion(&departed, SpinLift::default()).without_lift();
            (scaled, free, lift, departed)
        }
        None => (plain, free, lift, flight),
    };
    let metres_per_unit = scaled.metres_per_unit;
    flight.extra = free.extra;
    let free = calibration_uncertainty::widened(&free, calibration, &camera.map);
    let mut free = rolling_shutter::widened(free, camera, &refined.tracked).with_slow_errors();
    if let Some(&first_s) = clocked.base.times_s.first() {
        free = unseen_motion::widened(free, camera, first_s);
    }
    let mut motion = scaled.motion(&free, lift);
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
        radius_px,
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

/// What turns a flight into metres.
struct Scaled<'a> {
    camera: &'a CalibratedCamera<'a>,
    ball: Option<&'a BallModel>,
    radius_px: Option<Quantity>,
    metres_per_unit: Quantity,
    /// What pictures show of the arcs' spins.
    seen_spins: Vec<SeenSpin>,
}

impl Scaled<'_> {
    /// The flight in metres; `lift` is what its points were taken from.
    fn motion<'f>(&'f self, flight: &'f Flight, lift: SpinLift) -> MeasuredMotion<'f> {
        let units_per_px = self.camera.units_per_px();
        let displaced_px = flight.displaced_std() / units_per_px;
        let by_chroma_px = self.camera.chroma_share * displaced_px;
        // The calibration's pixels are those of the first frame: where a moving camera looked then is known no better than where it looks in any other.
        let first_frame_px = if self.camera.stands_still {
            0.0
        } else {
            self.camera.shift_std_px.max(displaced_px)
        };
        let errors = ImagingErrors {
            units_per_px,
            common_std_px: ball_model::common_std_px(self.ball, displaced_px)
                .hypot(self.misfit_of_size_px())
                .hypot(first_frame_px)
                .hypot(self.camera.chroma_std_px)
                .hypot(CHROMA_COMMON_PART * by_chroma_px),
            places_std_px: PLACES_STD_PX
                .hypot(LASTING_PART * displaced_px)
                .hypot(CHROMA_PLACES_PART * by_chroma_px)
                .hypot(self.camera.shift_std_px),
            steady: self.camera.stands_still,
        };
        let calibration = self.camera.calibration;
        MeasuredMotion::new(flight, calibration, self.metres_per_unit, errors, lift)
            .with_seen_spins(&self.seen_spins)
    }

    /// The same with the spins that the `rotations` of the arcs show.
    fn with_spins(mut self, refined: &Refined, rotations: &[ArcRotation]) -> Self {
        let seen = |radius_m| ball_rotation::seen_spins(self.camera, refined, rotations, radius_m);
        self.seen_spins = self.radius_m().map(seen).unwrap_or_default();
        self
    }

    /// The ball's radius as given or as seen, m.
    fn radius_m(&self) -> Option<f64> {
        let seen_m =
            || Some(self.radius_px?.value * self.camera.ball_units_per_px() * self.metres_per_unit.value);
        self.camera.calibration.ball.radius_m.or_else(seen_m)
    }

    /// What a ball that is seen too large or too small says of its centres, px: where a side of it fades into what is behind, what
    /// the radius is off by is missing on that side.
    fn misfit_of_size_px(&self) -> f64 {
        let calibration = self.camera.calibration;
        let known_m = calibration
            .ball
            .radius_m
            .filter(|_| !calibration.scale.rests_on_ball());
        let (Some(known_m), Some(seen)) = (known_m, self.radius_px) else {
            return 0.0;
        };
        let known_px = known_m / (self.metres_per_unit.value * self.camera.ball_units_per_px());
        let scale = self.metres_per_unit.std_uncertainty.unwrap_or(0.0) / self.metres_per_unit.value;
        let expected = seen.std_uncertainty.unwrap_or(0.0).hypot(scale * known_px);
        0.5 * ((seen.value - known_px).abs() - 2.0 * expected).max(0.0)
    }
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
