//! From the flight to metres: bounces, distances, gravity, "up", the floor, the bench, with what both models make of them.

use super::ball_model::{self, BallModel};
use super::calibration_uncertainty;
use super::camera::CalibratedCamera;
use super::clock::Clocked;
use super::measurement::{UpSource, UpTilt, Warning};
use super::refine::Refined;
use super::warnings::of_impacts::{WarningContext, of_impacts};
use super::world_frame::WorldFrame;
use crate::calibration::CalibrationError;
use crate::flight::motion_model::VerticalPrior;
use crate::flight::{Flight, shake};
use crate::impact::error_budget::{LASTING_PART, PLACES_STD_PX};
use crate::impact::from_flight::ImagingErrors;
use crate::impact::motion::{ImpactKind, MeasuredMotion};
use crate::impact::spin_lift::SpinLift;
use crate::impact::{BenchLaunch, Bounce, Distances, FloorSlope, Readings, reading};
use crate::quantity::Quantity;

/// What the flight says in metres.
#[derive(Debug)]
pub struct Impacts {
    /// The flight under everything that is not known of it.
    pub flight: Flight,
    /// From the plane to the world.
    pub frame: WorldFrame,
    /// The ball's radius, px.
    pub radius_px: Option<Quantity>,
    /// Magnitude of the acceleration, where it can be checked.
    pub gravity_m_s2: Option<Quantity>,
    /// How far "up" is from where the calibration has it.
    pub up: Option<UpTilt>,
    /// The floor's slope.
    pub floor: Option<FloorSlope>,
    /// Where the ball left a bench.
    pub launch: Option<BenchLaunch>,
    /// Impacts on the floor, in time order.
    pub bounces: Vec<Bounce>,
    /// Impacts on something upright.
    pub walls: usize,
    /// x0 and x.
    pub distances: Distances,
    /// Both models' readings of the first bounce.
    pub readings: Option<Readings>,
    /// What does not fit the calibration, or is doubtful.
    pub warnings: Vec<Warning>,
}

/// The impacts of `refined`.
///
/// # Errors
/// Where the calibration's scale rests on what was not measured.
pub fn impacts(
    camera: &CalibratedCamera<'_>,
    clocked: &Clocked,
    refined: &Refined,
) -> Result<Impacts, CalibrationError> {
    let calibration = camera.calibration;
    let ball = refined.ball.as_ref();
    let radius_px = ball_model::radius_px(camera, &refined.tracked, ball);
    let flight = with_all_unknowns(&refined.tracked.flight, calibration.upright_std_rad());
    let shake = shake::find(&flight);
    let shaken = shake.as_ref().and_then(|shake| flight.shaken_by(shake));
    let mut flight = shaken.unwrap_or(flight);
    let metres_per_unit = camera.metres_per_unit(&flight, radius_px)?;
    let scaled = Scaled {
        camera,
        ball,
        radius_px,
        metres_per_unit,
    };
    // The bounces tell the spins, these the lift; the arcs without it are those that bounce.
    let (free, lift) = scaled.motion(&flight, SpinLift::default()).without_lift();
    flight.extra = free.extra;
    let free = calibration_uncertainty::widened(&free, calibration, &camera.map);
    let motion = scaled.motion(&free, lift);
    let indexed = motion.bounces();
    let distances = motion.distances(&indexed);
    let (floor, launch) = (motion.floor(), motion.bench_launch());
    let up = up(&motion, calibration.upright_std_rad());
    let gravity_m_s2 = motion.gravity_m_s2();
    let radius_units = radius_px.map(|r| r.value * camera.ball_units_per_px());
    let radius_seen_m = || Some(radius_units? * metres_per_unit.value);
    let radius_m = calibration.ball.radius_m.or_else(radius_seen_m);
    let walls = (0..flight.impacts.len())
        .filter(|&k| motion.kind(k) == Some(ImpactKind::Wall))
        .count();
    let warnings = of_impacts(&WarningContext {
        calibration,
        flight: &flight,
        motion: &motion,
        bounces: &indexed,
        gravity: gravity_m_s2,
        radius_m,
        radius_units,
        walls,
        shake,
        impossible: motion.impossible(&indexed),
        x0_missing: distances.x0_m.is_none(),
        up,
        floor,
        launch,
        units_per_px: camera.units_per_px(),
        interval_s: clocked.base.interval_s.unwrap_or(flight.interval_s),
    });
    let frame = WorldFrame::new(&motion, &indexed, metres_per_unit, radius_m, calibration);
    let bounces: Vec<Bounce> = indexed.into_iter().map(|(_, b)| b).collect();
    Ok(Impacts {
        frame,
        radius_px,
        gravity_m_s2,
        up,
        floor,
        launch,
        readings: camera.falls().then(|| reading::read(&bounces)).flatten(),
        bounces,
        walls,
        distances,
        warnings,
        flight,
    })
}

/// The flight under everything that is not known of it: how "up" leans by what the calibration knows alone, and the drag of a
/// ball of which nothing is said. (While arcs are looked for in rough centres, so much freedom would let them follow what is
/// no ball's.)
fn with_all_unknowns(flight: &Flight, upright_std_rad: f64) -> Flight {
    let upright = VerticalPrior::known_to(upright_std_rad);
    let open = flight.fit.model.with_unknowns(upright, flight.radius());
    let fitted = open.and_then(|open| flight.under(&*open));
    fitted.unwrap_or_else(|| flight.clone())
}

/// What turns a flight into metres.
struct Scaled<'a> {
    camera: &'a CalibratedCamera<'a>,
    ball: Option<&'a BallModel>,
    radius_px: Option<Quantity>,
    metres_per_unit: Quantity,
}

impl Scaled<'_> {
    /// The flight in metres; `lift` is what its points were taken from.
    fn motion<'f>(&'f self, flight: &'f Flight, lift: SpinLift) -> MeasuredMotion<'f> {
        let units_per_px = self.camera.units_per_px();
        let displaced_px = flight.displaced_std() / units_per_px;
        let errors = ImagingErrors {
            units_per_px,
            common_std_px: ball_model::common_std_px(self.ball, displaced_px).hypot(self.misfit_of_size_px()),
            places_std_px: PLACES_STD_PX.hypot(LASTING_PART * displaced_px),
            steady: self.camera.stands_still,
        };
        let first = flight.first_place().unwrap_or_default();
        MeasuredMotion::new(
            flight,
            self.camera.calibration,
            self.metres_per_unit,
            errors,
            first,
            lift,
        )
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
