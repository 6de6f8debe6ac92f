//! What makes the centres of a flight less sure than their own pixels say.

use super::warning;
use crate::detect::centre::Accuracy;
use crate::flight::{Flight, OtherFlight};
use crate::geometry::PlanePoint;
use crate::pipeline::ball_model::BallModel;
use crate::pipeline::camera::CalibratedCamera;
use crate::pipeline::decode::Decoded;
use crate::pipeline::measurement::Warning;

/// A lamp whose light changes by this factor makes a ball look different enough to move its centre.
const LIGHT_CHANGES: f64 = 1.3;

/// Light that changes while the ball flies, in the frames `flown`, for longer than a tenth of them.
pub fn light(seen: &Decoded, flown: &[usize]) -> Option<Warning> {
    let scene = &seen.detector.background.luma.data;
    let grey = scene.iter().map(|&p| f64::from(p)).sum::<f64>() / scene.len().max(1) as f64;
    let mut brightness: Vec<f64> = flown
        .iter()
        .map(|&frame| seen.registrations[frame].brightness(grey))
        .collect();
    brightness.sort_by(f64::total_cmp);
    let tenth = brightness.len() / 10;
    let least = *brightness.get(tenth)?;
    let most = *brightness.get(brightness.len() - 1 - tenth)?;
    (least > 0.0 && most > LIGHT_CHANGES * least).then(|| {
        warning!(
            "light_changed",
            "the light changes by a factor of {:.2} while the ball flies: where a side of it is saturated or dark in one light and not in the other, its centre is displaced by some hundredths of its radius, which is not in the uncertainties. Use a steady light.",
            most / least
        )
    })
}

/// That other things fly while the ball does: how many, when and where.
pub fn others(others: &[OtherFlight], camera: &CalibratedCamera<'_>) -> Option<Warning> {
    let one = |o: &OtherFlight| {
        let place = camera.map.pixel_from_plane(o.place);
        let place = place.map_or(String::new(), |p| {
            format!(" near ({:.0}, {:.0}) px", p.u_px, p.v_px)
        });
        let with = if o.moves_along {
            ", which keeps its place beside the ball: a shadow, a reflection or a ball launched with it"
        } else {
            ""
        };
        format!(
            "one from {:.2} to {:.2} s, first seen{place}{with}",
            o.from_s, o.to_s
        )
    };
    let all: Vec<String> = others.iter().map(one).collect();
    (!all.is_empty()).then(|| {
        warning!(
            "several_things_fly",
            "{} other thing(s) fly while the ball does: {}. Measured is the one with the most evidence of a bouncing ball; no bounce joins two of them. If another is meant, choose it on the page of track review.",
            all.len(),
            all.join("; ")
        )
    })
}

/// A pixel that the ball covers in more than this part of the frames: the median of some of them, the empty scene, may be
/// the ball there.
const LINGERS_PART: f64 = 0.4;

/// Places of a flight that are looked at for that.
const LINGERS_PLACES: usize = 300;

/// That the ball covers one place of its flight for too much of the recording's `frames`.
pub fn lingering(flight: &Flight, frames: usize) -> Option<Warning> {
    let spots = || flight.points.iter().map(|p| p.spot);
    let covers = |place: PlanePoint| {
        spots()
            .filter(|s| (s.place.right - place.right).hypot(s.place.up - place.up) < s.radius)
            .count()
    };
    // Some places along the way tell; all of them would take the square of their number.
    let step = flight.points.len().div_ceil(LINGERS_PLACES).max(1);
    let most = spots().step_by(step).map(|s| covers(s.place)).max()?;
    let part = most as f64 / frames.max(1) as f64;
    (part > LINGERS_PART).then(|| {
        warning!(
            "ball_lingers",
            "the ball covers one place in {:.0} % of the frames, so the empty scene behind it is not known for sure there: centres may be off by more than their uncertainties. Record the scene without the ball for as long as the flight lasts, before or after it.",
            100.0 * part
        )
    })
}

/// That a ball's radius is unsure because pixels next to its outline are white, more than for all other reasons.
pub fn overexposed(ball: &BallModel) -> Option<Warning> {
    let white = &ball.appearance.as_ref()?.overexposure;
    let hidden_px = ball.hidden_std_px();
    let otherwise_px = ball.radius_px.std_uncertainty.unwrap_or(0.0);
    (hidden_px > otherwise_px).then(|| {
        warning!(
            "overexposed",
            "{:.0} % of the pixels next to the ball's outline, within it or beyond it, are white: how bright ball or wall are there cannot be seen, and so the edge may be elsewhere. The radius is unsure by {hidden_px:.2} px, places (x0) by {:.2} px, and so is what is taken from them; restitution and angles hardly are. Less light, a shorter exposure or another wall.",
            100.0 * white.white_part,
            white.shift_std_px()
        )
    })
}

/// That another method had to be used than was asked for.
pub fn not_learned(asked: Accuracy, used: Accuracy) -> Option<Warning> {
    (asked != used).then(|| {
        warning!(
            "appearance_not_learned",
            "the ball looks too different from frame to frame (noise, smear, light) to learn its appearance: centres are circles through edge points, which shading pulls by up to a tenth of a pixel. More light, a shorter exposure or a plainer background helps."
        )
    })
}
