//! What turns a flight into metres: the scale, the ball's radius, and what centres and their places are off by.

use super::ball_model::{self, BallModel};
use super::ball_rotation::{self, ArcRotation};
use super::camera::CalibratedCamera;
use super::refine::Refined;
use crate::calibration::CalibrationError;
use crate::flight::Flight;
use crate::impact::error_budget::{CHROMA_COMMON_PART, CHROMA_PLACES_PART, LASTING_PART, PLACES_STD_PX};
use crate::impact::from_flight::ImagingErrors;
use crate::impact::motion::MeasuredMotion;
use crate::impact::seen_spin::SeenSpin;
use crate::impact::spin_lift::SpinLift;
use crate::quantity::Quantity;

/// A camera and a ball that turn flights into metres.
pub struct Scaled<'a> {
    camera: &'a CalibratedCamera<'a>,
    ball: Option<&'a BallModel>,
    /// The ball's radius as it is seen, px; `None` where it is not.
    pub radius_px: Option<Quantity>,
    /// Metres in a plane unit.
    pub metres_per_unit: Quantity,
    /// What pictures show of the arcs' spins.
    seen_spins: Vec<SeenSpin>,
}

/// `flight` without the lift that its bounces tell, and the `rotations` of its arcs. It bends arcs of a light ball that spins fast by more than what a
/// readout or a swing of the camera does can be told from: so it goes before those are looked for.
///
/// # Errors
/// Where the calibration's scale rests on what was not measured.
pub fn without_lift(
    camera: &CalibratedCamera<'_>,
    refined: &Refined,
    rotations: &[ArcRotation],
    flight: &Flight,
) -> Result<Flight, CalibrationError> {
    let scaled = Scaled::new(camera, refined, flight)?.with_spins(refined, rotations);
    Ok(scaled.without_lift(flight).0)
}

impl<'a> Scaled<'a> {
    /// By the ball of `refined`, with the scale that `flight` has.
    ///
    /// # Errors
    /// Where the calibration's scale rests on what was not measured.
    pub fn new(
        camera: &'a CalibratedCamera<'a>,
        refined: &'a Refined,
        flight: &Flight,
    ) -> Result<Self, CalibrationError> {
        let ball = refined.ball.as_ref();
        let radius_px = refined
            .radius_is_seen
            .then(|| ball_model::radius_px(camera, &refined.tracked, ball))
            .flatten();
        Ok(Scaled {
            camera,
            ball,
            radius_px,
            metres_per_unit: camera.metres_per_unit(flight, radius_px)?,
            seen_spins: Vec::new(),
        })
    }

    /// The flight in metres; `lift` is what its points were taken from.
    pub fn motion<'f>(&'f self, flight: &'f Flight, lift: SpinLift) -> MeasuredMotion<'f> {
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

    /// `flight` without the lift that its bounces and the spins that are seen tell, and that lift.
    pub fn without_lift(&self, flight: &Flight) -> (Flight, SpinLift) {
        self.motion(flight, SpinLift::default()).without_lift()
    }

    /// The same with the spins that the `rotations` of the arcs show.
    pub fn with_spins(mut self, refined: &Refined, rotations: &[ArcRotation]) -> Self {
        let seen = |radius_m| ball_rotation::seen_spins(self.camera, refined, rotations, radius_m);
        self.seen_spins = self.radius_m().map(seen).unwrap_or_default();
        self
    }

    /// The ball's radius as given or as seen, m.
    pub fn radius_m(&self) -> Option<f64> {
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
        // (Where ball or wall are white the edge is off on that side, too: what that hides is no excuse.)
        let own = self.ball.map_or(seen, |ball| ball.radius_px);
        let expected = own.std_uncertainty.unwrap_or(0.0).hypot(scale * known_px);
        0.5 * ((seen.value - known_px).abs() - 2.0 * expected).max(0.0)
    }
}
