//! The floor's slope, and velocities along it.
//!
//! | source | the slope | known in |
//! |---|---|---|
//! | impacts | rise over run of the ball's places at two or more touches | the picture |
//! | a line | direction of the calibration's line along the floor | the picture |
//! | calibration, or custom | a number, or level as a lab's bench is (0.1 degrees) | the lab: against gravity |
//!
//! They are combined by their variances, so far as they agree; what the picture shows goes before what is usual. The models
//! speak of velocities along the floor and its normal, as the picture shows both: so what is unsure of "up" is in the last
//! source alone, and impacts make e and μ free of it.
//!
//! Assumed: one plane floor, and a camera that stands still: one in a hand turns from impact to impact, and its impacts are
//! not asked. Touches whose places do not lie on one line (two floors, a step) tell no slope.

use super::inputs::InputValues;
use super::motion::MeasuredMotion;
use super::{BounceSurface, FloorSlope, FloorSource};
use crate::calibration::View;
use crate::flight::planar::Motion;

/// Two floors, or a step, where touches are off one line by more than this part of the ball's radius.
const STEP_PART: f64 = 0.3;

/// And by this many standard uncertainties.
const STEP_SIGMAS: f64 = 5.0;

/// Touches that enter: more tell hardly more, and every number of every bounce is worked out through them.
const MOST_TOUCHES: usize = 5;

/// Impacts that tell the slope no better than this are not asked: a ball that is dropped, whose places are next to each other,
/// rad.
const VAGUE_RAD: f64 = 0.006;

/// Steeper than this is no floor of a lab, rad.
const STEEPEST_RAD: f64 = 0.35;

/// Sources that differ by more than this many standard uncertainties contradict each other.
const AGREE_SIGMAS: f64 = 3.0;

/// A velocity in axes turned by `slope`: along the floor, and its normal. Places stay.
pub(super) fn turned(m: &Motion, slope: f64) -> Motion {
    let (sin, cos) = slope.sin_cos();
    Motion {
        vr: m.vr * cos + m.vh * sin,
        vh: m.vh * cos - m.vr * sin,
        ..*m
    }
}

/// An angle between −π/2 and π/2 of the same line.
fn folded(angle: f64) -> f64 {
    angle - std::f64::consts::PI * (angle / std::f64::consts::PI).round()
}

impl MeasuredMotion<'_> {
    /// The floor's slope for any parameters, rad, along x.
    pub(super) fn slope(&self, p: &InputValues<'_>) -> f64 {
        let s = &self.slope_sources;
        let mut sum = 0.0;
        if s.by_touches != 0.0 {
            sum += s.by_touches * self.slope_of(p, &s.touches);
        }
        if s.line.1 != 0.0 {
            sum += s.line.1 * self.slope_of_line(p, s.line.0);
        }
        if s.level.1 != 0.0 {
            sum += s.level.1 * (s.level.0 + p.errors.floor_level_rad);
        }
        sum
    }

    /// Of the line through touches, against the world's horizontal.
    fn slope_of(&self, p: &InputValues<'_>, touches: &[(usize, f64)]) -> f64 {
        let places: Vec<(f64, f64, f64)> = touches
            .iter()
            .map(|&(k, weight)| {
                let touch = self.impact(p, k).1;
                (weight, touch.r, touch.h)
            })
            .collect();
        let all: f64 = places.iter().map(|q| q.0).sum();
        let mean = |of: fn(&(f64, f64, f64)) -> f64| places.iter().map(|q| q.0 * of(q)).sum::<f64>() / all;
        let (x, z) = (mean(|q| q.1), mean(|q| q.2));
        let run: f64 = places.iter().map(|q| q.0 * (q.1 - x) * (q.1 - x)).sum();
        let rise: f64 = places.iter().map(|q| q.0 * (q.1 - x) * (q.2 - z)).sum();
        // What differs between the centres' errors at two places, over the run.
        let apart = p.errors.place_up * self.scale(p) * (all / run).sqrt();
        (rise / run + apart).atan()
    }

    fn slope_of_line(&self, p: &InputValues<'_>, direction: f64) -> f64 {
        folded(self.x_sign * (direction + p.errors.floor_line_rad - self.lean(p)))
    }

    /// The same with what is known of the floor.
    pub(super) fn on_floor(mut self) -> Self {
        if self.calibration.view == View::Top || !self.flight.fit.falls_in_plane() {
            return self;
        }
        let known = self.calibration.floor;
        // How well the picture's horizontal is known: only a slope given against gravity needs it.
        let lean_std = self.inputs.outputs(|p| vec![self.lean(p)]).std(0);
        let level = (known.slope_rad, known.std_rad.hypot(lean_std));
        let line = self.line_in_plane().map(|(direction, std)| {
            let slope = self.slope_of_line(&self.inputs.best(), direction);
            (direction, slope, std)
        });
        self.inputs.set(|_, stds| {
            stds.floor_level_rad = known.std_rad;
            stds.floor_line_rad = line.map_or(0.0, |l| l.2);
        });
        let touches = self.touches_of_one_floor();
        let seen = touches.as_ref().map(|touches| {
            let shown = self.inputs.outputs(|p| {
                let slope = self.slope_of(p, touches);
                vec![slope, slope + self.x_sign * self.lean(p)]
            });
            (shown.value(0), shown.std(1).hypot(self.soft_slope_std(touches)))
        });
        let seen = seen.filter(|s| s.1 < VAGUE_RAD);
        // What the picture shows first; a number against gravity as far as it does not contradict that.
        let mut sources: Vec<(f64, f64)> = seen.into_iter().chain(line.map(|l| (l.1, l.2))).collect();
        let of_picture = combined(&sources);
        let agrees =
            of_picture.is_none_or(|(slope, std)| (slope - level.0).abs() < AGREE_SIGMAS * std.hypot(level.1));
        self.slope_sources.contradicted = of_picture.filter(|_| !agrees).map(|_| level);
        if agrees {
            sources.push(level);
        }
        let information: f64 = sources.iter().map(|s| 1.0 / (s.1 * s.1)).sum();
        let part = |std: f64| 1.0 / (std * std) / information;
        self.slope_sources.given = known.given;
        self.slope_sources.by_touches = seen.map_or(0.0, |s| part(s.1));
        self.slope_sources.line = line.map_or((0.0, 0.0), |l| (l.0, part(l.2)));
        self.slope_sources.level = (level.0, if agrees { part(level.1) } else { 0.0 });
        self.slope_sources.touches = touches.unwrap_or_default();
        self
    }

    /// Direction of the calibration's line along the floor in the plane, rad, with its standard uncertainty.
    fn line_in_plane(&self) -> Option<(f64, f64)> {
        let line = self.calibration.floor.line?;
        let map = self.calibration.rectification().ok()?;
        let (a, b) = (map.plane_from_pixel(line.from)?, map.plane_from_pixel(line.to)?);
        let length_px = line.from.distance_px(line.to);
        let std = std::f64::consts::SQRT_2 * line.std_px / length_px;
        Some((folded((b.up - a.up).atan2(b.right - a.right)), std))
    }

    /// The touches that tell the floor's slope, each with its weight: those on the floor in a row, as far as their places lie on
    /// one line; `None` where they do not, or are fewer than two.
    fn touches_of_one_floor(&self) -> Option<Vec<(usize, f64)>> {
        if !self.steady {
            return None;
        }
        let in_a_row = (0..self.arcs().saturating_sub(1)).map_while(|k| Some((k, self.surface(k)?)));
        let all = in_a_row
            .filter(|(_, surface)| *surface == BounceSurface::Floor)
            .map(|(k, _)| k);
        let floors = crate::frames::evenly_of(all.collect::<Vec<_>>().into_iter(), MOST_TOUCHES);
        let heights = self
            .inputs
            .outputs(|p| floors.iter().map(|&k| self.impact(p, k).1.h).collect());
        let touches: Vec<(usize, f64)> = floors
            .iter()
            .enumerate()
            .map(|(i, &k)| (k, 1.0 / heights.std(i).powi(2)))
            .filter(|(_, weight)| weight.is_finite())
            .collect();
        if touches.len() < 2 {
            return None;
        }
        let off_line = self.inputs.outputs(|p| {
            let slope = self.slope_of(p, &touches).tan();
            let places: Vec<Motion> = touches.iter().map(|t| self.impact(p, t.0).1).collect();
            let first = places[0];
            let mut off: Vec<f64> = places
                .iter()
                .map(|m| m.h - first.h - slope * (m.r - first.r))
                .collect();
            off.push(slope);
            off
        });
        let radius_m = self
            .calibration
            .ball
            .radius_m
            .unwrap_or_else(|| self.flight.points[0].spot.radius * self.metres_per_unit.value);
        let last = touches.len();
        let steps =
            (0..last).any(|i| off_line.value(i).abs() > STEP_PART * radius_m + STEP_SIGMAS * off_line.std(i));
        // Of two touches any step looks like a slope: one by more than the ball's radius is one.
        let rise = heights.value(0) - heights.value(last - 1);
        let two_floors = last == 2 && rise.abs() > radius_m + STEP_SIGMAS * heights.std(0);
        let plane = off_line.value(last).abs() < STEEPEST_RAD.tan() + off_line.std(last);
        let is_known = off_line.value(last).is_finite() && off_line.std(last).is_finite();
        (is_known && plane && !steps && !two_floors).then_some(touches)
    }

    /// What a ball that may be soft does to the slope: it touches earlier than said, and so higher, by more the faster it comes.
    fn soft_slope_std(&self, touches: &[(usize, f64)]) -> f64 {
        let (Some(soft), Some(first), Some(last)) = (self.may_be_soft(), touches.first(), touches.last())
        else {
            return 0.0;
        };
        let p = &self.inputs.best();
        let (a, b) = (self.impact(p, first.0).1, self.impact(p, last.0).1);
        0.5 * soft.earlier_s * (a.vh - b.vh).abs() / (a.r - b.r).abs()
    }

    /// The floor's slope with its source; `None` in a top view.
    #[must_use]
    pub fn floor(&self) -> Option<FloorSlope> {
        if self.calibration.view == View::Top || !self.flight.fit.falls_in_plane() {
            return None;
        }
        let s = &self.slope_sources;
        let (by_level, by_line) = (s.level.1, s.line.1);
        let source = if s.by_touches >= by_level.max(by_line) {
            FloorSource::Impacts
        } else if by_line >= by_level || s.given {
            FloorSource::Calibration
        } else {
            FloorSource::Level
        };
        let slope_rad = self.inputs.quantity(|p| self.slope(p))?;
        Some(FloorSlope { slope_rad, source })
    }

    /// A slope that is given, or usual, and contradicted by what the picture shows: with its standard uncertainty, rad.
    #[must_use]
    pub fn floor_contradicts(&self) -> Option<(f64, f64)> {
        self.slope_sources.contradicted
    }
}

/// Mean and standard deviation of independent numbers with their standard deviations; `None` of none.
fn combined(sources: &[(f64, f64)]) -> Option<(f64, f64)> {
    let information: f64 = sources.iter().map(|s| 1.0 / (s.1 * s.1)).sum();
    let mean = sources.iter().map(|s| s.0 / (s.1 * s.1)).sum::<f64>() / information;
    (!sources.is_empty()).then(|| (mean, 1.0 / information.sqrt()))
}
