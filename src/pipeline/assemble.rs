//! The measurement put together: what the flight says in metres, with what is doubtful about it, and the words for a
//! recording that shows none.

use super::camera::in_plane;
use super::world_frame::WorldFrame;
use super::{
    Measurement, Outcome, PointUse, Recording, TimeSource, Track, TrackPoint, UpSource, UpTilt, VideoFacts,
    Warning, calibration_uncertainty, drawing, is_used, refine, warnings,
};
use crate::calibration::{CalibrationError, Scale};
use crate::detect::centre::{Accuracy, Centre};
use crate::flight::fit::Forces;
use crate::flight::{Flight, shake};
use crate::impact::motion::{ImagingErrors, ImpactKind, MeasuredMotion};
use crate::impact::spin_lift::SpinLift;
use crate::impact::{Distances, reading};
use crate::quantity::{Quantity, median};

impl Recording<'_> {
    pub(super) fn measured(mut self, mut flight: Flight) -> Result<Measurement, CalibrationError> {
        flight = self.with_all_unknowns(flight);
        let shake = shake::find(&flight);
        if let Some(unsure) = shake.as_ref().and_then(|shake| flight.shaken_by(shake)) {
            flight = unsure;
        }
        let metres_per_unit = self.metres_per_unit(&flight, self.radius_px())?;
        let (free, lift) = self
            .motion(&flight, metres_per_unit, SpinLift::default())
            .without_lift();
        flight.extra = free.extra;
        let flight = &flight;
        let free = calibration_uncertainty::widened(&free, self.calibration, &self.map);
        let motion = self.motion(&free, metres_per_unit, lift);
        let bounces = motion.bounces();
        let distances = motion.distances(&bounces);
        let gravity = motion.gravity_m_s2();
        let (floor, launch) = (motion.floor(), motion.bench_launch());
        let up = self.up(&motion);
        let radius_m = self.radius_m(metres_per_unit);
        let frame = WorldFrame::new(&motion, &bounces, metres_per_unit, radius_m, self.calibration);
        let walls = (0..flight.impacts.len())
            .filter(|&k| motion.kind(k) == Some(ImpactKind::Wall))
            .count();
        let judged = warnings::WarningContext {
            calibration: self.calibration,
            flight,
            motion: &motion,
            bounces: &bounces,
            gravity,
            radius_m,
            radius_units: self.radius_px().map(|r| r.value * self.ball_units_per_px()),
            walls,
            shake,
            impossible: motion.impossible(&bounces),
            x0_missing: distances.x0_m.is_none(),
            up,
            floor,
            launch,
            units_per_px: self.units_per_px(),
            interval_s: self.base.interval_s.unwrap_or(flight.interval_s),
        };
        let mut found = warnings::measured(&judged);
        found.retain(|new| self.warnings.iter().all(|w| w.code != new.code));
        self.warnings.extend(found);
        self.warnings
            .extend(warnings::unlearned(self.accuracy, self.method()));
        self.warnings.extend(self.light(flight));
        self.warnings
            .extend(warnings::lingering(flight, self.seen.stamps_s.len()));
        let outcome = if bounces.is_empty() {
            Outcome::Rejected {
                reason: warnings::no_bounce(flight, walls, self.calibration),
            }
        } else {
            Outcome::Measured
        };
        let bounces: Vec<_> = bounces.into_iter().map(|(_, b)| b).collect();
        Ok(Measurement {
            video: self.video_facts(),
            view: self.calibration.view,
            outcome,
            track: self.track(flight, &frame),
            gravity_m_s2: gravity,
            up,
            floor,
            launch,
            distances,
            readings: self.falls().then(|| reading::read(&bounces)).flatten(),
            bounces,
            arcs: drawing::arcs(flight, &self.map, &frame),
            strobe: Some(drawing::strobe(&self.seen, &self.found, flight)),
            warnings: self.warnings,
        })
    }

    /// The flight in metres; `lift` is what its points were taken from.
    fn motion<'f>(
        &'f self,
        flight: &'f Flight,
        metres_per_unit: Quantity,
        lift: SpinLift,
    ) -> MeasuredMotion<'f> {
        let first = match flight.fit.forces {
            Forces::Overhead(_) => flight.points.iter().find(|p| is_used(p.use_)),
            _ => flight.points.first(),
        };
        let first = first.and_then(|p| in_plane(flight, p)).unwrap_or_default();
        let units_per_px = self.units_per_px();
        let displaced_px = flight.displaced_std() / units_per_px;
        let picture = ImagingErrors {
            units_per_px,
            common_std_px: refine::common_std_px(self.shared.as_ref(), displaced_px)
                .hypot(self.misfit_of_size_px(metres_per_unit)),
            places_std_px: refine::places_std_px(displaced_px),
            steady: self.seen.detector.background.registrar.fixed,
        };
        MeasuredMotion::new(flight, self.calibration, metres_per_unit, picture, first, lift)
    }

    /// What a ball that is seen too large or too small says of its centres, px: where a side of it fades into what is behind, what
    /// the radius is off by is missing on that side.
    fn misfit_of_size_px(&self, metres_per_unit: Quantity) -> f64 {
        let known = self
            .calibration
            .ball
            .radius_m
            .filter(|_| self.calibration.scale != Scale::Ball);
        let (Some(known_m), Some(seen)) = (known, self.radius_px()) else {
            return 0.0;
        };
        let known_px = known_m / (metres_per_unit.value * self.ball_units_per_px());
        let scale = metres_per_unit.std_uncertainty.unwrap_or(0.0) / metres_per_unit.value;
        let expected = seen.std_uncertainty.unwrap_or(0.0).hypot(scale * known_px);
        0.5 * ((seen.value - known_px).abs() - 2.0 * expected).max(0.0)
    }

    /// How far the fall and the calibration together have "up" from where the calibration alone has it.
    fn up(&self, motion: &MeasuredMotion<'_>) -> Option<UpTilt> {
        let tilt_rad = motion.tilt_rad()?;
        let prior = self.calibration.upright_std_rad();
        let by_fall = tilt_rad
            .std_uncertainty
            .is_none_or(|std| std * std < 0.5 * prior * prior);
        let source = if by_fall {
            UpSource::Fall
        } else {
            UpSource::Calibration
        };
        Some(UpTilt { tilt_rad, source })
    }

    /// That the light changes during the flight.
    fn light(&self, flight: &Flight) -> Option<Warning> {
        let used = flight.points.iter().filter(|p| is_used(p.use_));
        let flown: Vec<usize> = used.map(|p| p.spot.frame).collect();
        warnings::light(&self.seen, &flown)
    }

    pub(super) fn rejected(&self, reason: String) -> Measurement {
        Measurement {
            video: self.video_facts(),
            view: self.calibration.view,
            outcome: Outcome::Rejected { reason },
            track: Track {
                method: method_name(self.accuracy).to_owned(),
                detected: 0,
                centre_std_px: None,
                radius_px: None,
                points: Vec::new(),
            },
            gravity_m_s2: None,
            up: None,
            floor: None,
            launch: None,
            bounces: Vec::new(),
            distances: Distances::default(),
            readings: None,
            warnings: self.warnings.clone(),
            arcs: Vec::new(),
            strobe: Some(drawing::empty_strobe(&self.seen)),
        }
    }

    /// The method that the centres are by: where the ball's appearance could not be learned, its outline had to do.
    fn method(&self) -> Accuracy {
        let learned = self.shared.as_ref().is_some_and(|s| s.appearance.is_some());
        if learned { self.accuracy } else { Accuracy::Fast }
    }

    /// The ball's radius: as given, or as seen.
    fn radius_m(&self, metres_per_unit: Quantity) -> Option<f64> {
        self.calibration
            .ball
            .radius_m
            .or_else(|| Some(self.radius_px()?.value * self.ball_units_per_px() * metres_per_unit.value))
    }

    fn video_facts(&self) -> VideoFacts {
        let times = &self.base.times_s;
        VideoFacts {
            path: self.video.to_owned(),
            width_px: self.seen.info.width_px,
            height_px: self.seen.info.height_px,
            frames: self.seen.health.frames_read,
            frame_rate_hz: self.base.interval_s.map(|i| 1.0 / i),
            duration_s: times.last().copied().unwrap_or(0.0),
            time_source: if self.calibration.frame_rate_hz.is_some() {
                TimeSource::Calibration
            } else {
                TimeSource::Stamps
            },
        }
    }

    fn track(&self, flight: &Flight, frame: &WorldFrame) -> Track {
        let centre =
            |id: usize| -> Option<&Centre> { refine::of_sighting(&self.found, id).map(|f| &f.centre) };
        let points: Vec<TrackPoint> = flight
            .points
            .iter()
            .filter_map(|p| {
                let c = centre(p.spot.id)?;
                Some(TrackPoint {
                    frame: p.spot.frame,
                    time_s: p.spot.time_s,
                    pixel: self.centre_px(p).unwrap_or(c.disc.centre),
                    std_px: Some(c.std_px() * flight.std(&p.spot) / p.spot.std),
                    world: in_plane(flight, p).map(|place| frame.world(place.right, place.up)),
                    use_: drawing::use_of(p, frame),
                    residual_m: drawing::residual(flight, p, frame),
                })
            })
            .collect();
        let mut stds: Vec<f64> = points
            .iter()
            .filter(|p| matches!(p.use_, PointUse::Used(_)))
            .filter_map(|p| p.std_px)
            .collect();
        Track {
            method: method_name(self.method()).to_owned(),
            detected: points.len(),
            centre_std_px: median(&mut stds),
            radius_px: self.radius_px(),
            points,
        }
    }
}

/// Name of the centre method.
fn method_name(accuracy: Accuracy) -> &'static str {
    match accuracy {
        Accuracy::Fast => "fast: circle through edge points",
        Accuracy::Standard => "standard: likelihood of the edge, learned appearance",
        Accuracy::Fine => "fine: likelihood of every edge pixel, learned appearance",
    }
}
