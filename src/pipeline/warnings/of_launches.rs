//! What is odd about a recording of several launches, and about one that pieces were cut out of.

use super::warning;
use crate::flight::Flight;
use crate::frames::timebase::TimeBase;
use crate::geometry::PlanePoint;
use crate::pipeline::camera::CalibratedCamera;
use crate::pipeline::decode::Decoded;
use crate::pipeline::launch::MeasuredLaunch;
use crate::pipeline::measurement::{Measurement, Warning};

/// Stamps further apart than this leave out a piece, not single frames, s; ...
const PIECE_S: f64 = 1.0;

/// ... and by this many frames.
const PIECE_FRAMES: f64 = 10.0;

/// Nobody brings a ball back sooner than this, s.
const BROUGHT_BACK_S: f64 = 0.3;

/// The warnings of `launches` (two or more), each code once, and that there are several. `left_out`: flights beside them that
/// are none.
pub fn of_several(launches: &[Measurement], left_out: usize) -> Vec<Warning> {
    let starts = launches.iter().filter_map(Measurement::time_span);
    let starts: Vec<String> = starts.map(|(from, _)| format!("{from:.3}")).collect();
    let others = match left_out {
        0 => String::new(),
        n => format!(
            " {n} more flight(s) of the ball show no bounce, or none that could be measured, and are left out."
        ),
    };
    let several = warning!(
        "several_launches",
        "the recording holds {} launches, first seen flying at {} s: each is measured and stands under \"launches\"; what stands outside of it (bounces, x0, x, models) is the first launch's.{others}",
        launches.len(),
        starts.join(", ")
    );
    let mut all = vec![several];
    let warned = || launches.iter().flat_map(|l| &l.warnings);
    for w in warned() {
        if all.iter().any(|told| told.code == w.code) {
            continue;
        }
        let of = |launch: &Measurement| launch.warnings.iter().find(|x| x.code == w.code).cloned();
        let told: Vec<(usize, Warning)> = launches
            .iter()
            .enumerate()
            .filter_map(|(i, l)| Some((i + 1, of(l)?)))
            .collect();
        all.push(together(w.code, &told, launches.len()));
    }
    all
}

/// A warning of several launches, with their numbers, as one.
fn together(code: &'static str, told: &[(usize, Warning)], launches: usize) -> Warning {
    let message = &told[0].1.message;
    let alike = told.iter().all(|(_, w)| w.message == *message);
    let numbers: Vec<String> = told.iter().map(|(n, _)| n.to_string()).collect();
    let message = if alike && told.len() == launches {
        message.clone()
    } else if alike || told.len() == 1 {
        let plural = if told.len() > 1 { "es" } else { "" };
        format!("launch{plural} {}: {message}", numbers.join(", "))
    } else {
        format!(
            "launch {}: {message} The same, with numbers of its own, holds of launch {} (\"launches\").",
            numbers[0],
            numbers[1..].join(", ")
        )
    };
    Warning { code, message }
}

/// That a piece was cut out of the recording: by its stamps, or because a ball in flight vanishes and the next launch
/// begins at once.
pub fn cut_out(
    first: &MeasuredLaunch,
    later: &[MeasuredLaunch],
    (decoded, base): (&Decoded, &TimeBase),
    camera: &CalibratedCamera<'_>,
) -> Option<Warning> {
    let interval_s = base.interval_s.unwrap_or(0.0);
    // The file's own seconds tell, too: those of a slow-motion file are shorter in truth.
    let stamps = decoded.stamps_s.windows(2).filter(|_| decoded.info.has_time_base);
    let by_stamps = stamps.map(|w| w[1] - w[0]).chain(std::iter::repeat(0.0));
    let jumps = base.times_s.windows(2).zip(by_stamps).filter_map(|(w, stamped)| {
        let step = w[1] - w[0];
        let piece = step.max(stamped) > PIECE_S && step > PIECE_FRAMES * interval_s;
        piece.then(|| format!("{step:.2} s after {:.3} s, by the time stamps", w[0]))
    });
    let launches: Vec<&Flight> = std::iter::once(first)
        .chain(later)
        .map(|l| &l.refined.tracked.flight)
        .collect();
    let joins = launches.windows(2).filter_map(|w| {
        let end_s = vanishes(w[0], camera)?;
        let next_s = w[1].points.first()?.spot.time_s;
        let at_once = next_s - end_s < BROUGHT_BACK_S;
        at_once.then(|| {
            format!("after {end_s:.3} s, where the ball vanishes in flight and the next launch begins {:.3} s later", next_s - end_s)
        })
    });
    let pieces: Vec<String> = jumps.chain(joins).collect();
    (!pieces.is_empty()).then(|| {
        warning!(
            "piece_cut_out",
            "a piece is missing from the recording, or clips were joined: {}. What lies between is not measured, and no impact is joined across it. For one launch a file copy the camera's own.",
            pieces.join("; ")
        )
    })
}

/// The last time at which the ball of `flight` was seen, where that was in flight and it was still in the picture after it.
fn vanishes(flight: &Flight, camera: &CalibratedCamera<'_>) -> Option<f64> {
    let last = flight.points.last().filter(|p| p.arc().is_some())?.spot;
    let arc = flight.arc_at(last.time_s);
    let next = flight.fit.motion(arc, last.time_s + 2.0 * flight.interval_s);
    let pixel = camera.map.pixel_from_plane(PlanePoint::new(next.r, next.h))?;
    let radius_px = last.radius / camera.units_per_px();
    let (width, height) = camera.size_px;
    let inside = |x: f64, size: usize| x > 2.0 * radius_px && x < size as f64 - 2.0 * radius_px;
    (inside(pixel.u_px, width) && inside(pixel.v_px, height)).then_some(last.time_s)
}
