//! What is odd about the clock of a recording, and what moves its whole picture.

use super::warning;
use crate::calibration::Calibration;
use crate::detect::background::Background;
use crate::detect::registration::Registration;
use crate::frames::timebase::TimeBase;
use crate::pipeline::decode::Decoded;
use crate::pipeline::measurement::Warning;

/// What is odd about the clock `base` of the recording, and what moves its whole picture.
pub fn of_clock(
    seen: &Decoded,
    base: &TimeBase,
    duplicates: &[bool],
    calibration: &Calibration,
) -> Vec<Warning> {
    let mut out = Vec::new();
    out.extend(duplicated(seen, base, duplicates, calibration));
    out.extend(rounded_stamps(seen, calibration));
    if base.gaps > 0 {
        out.push(warning!(
            "dropped_frames",
            "the time stamps leave out {} frame(s) in {} place(s): the camera or an editor dropped them. The stamps of the others were used as they are.",
            base.missing, base.gaps
        ));
    }
    if base.skipped > 0 {
        out.push(warning!(
            "frames_skipped",
            "{} frame(s) are missing without a trace in the time stamps: there things move a whole number of times as far as from frame to frame before and after. Later times were moved by as many frame intervals. Where the ball is held or hardly moves more may be missing unseen, which the uncertainty of times since the first frame allows for; at an impact restitution would be wrong, too: record again, or copy the camera's own file without an editor.",
            base.skipped
        ));
    }
    out.extend(moved_camera(&seen.registrations, &seen.detector.background));
    out.extend(shaken_camera(seen, base));
    out
}
/// Stamps that are rounded so coarsely that it shows.
fn rounded_stamps(seen: &Decoded, calibration: &Calibration) -> Option<Warning> {
    let clock = seen.even_clock.filter(|_| calibration.frame_rate_hz.is_none())?;
    (clock.moved_s > WORTH_SAYING_PART * clock.interval_s).then(|| warning!(
        "stamps_rounded",
        "the file stores times to {:.3} ms only. All of its stamps are those of an even clock of {:.4} Hz to within that, which is what was used; as they stand they would be off by up to {:.3} ms. If the camera took pictures at another rate, set \"frame_rate_hz\" to it.",
        1e3 * clock.tick_s, 1.0 / clock.interval_s, 1e3 * clock.moved_s
    ))
}

/// Stamps that jitter about the even clock `base`.
pub fn jitter(base: &TimeBase, jitter_s: f64) -> Warning {
    warning!(
        "stamps_jitter",
        "the file's time stamps jitter by up to {:.2} ms about an even clock of {:.3} Hz, and the ball's path shows that the frames were taken evenly: that clock was used. A recording app that stamps frames as they arrive does this; the camera's own file has better times.",
        1e3 * jitter_s,
        1.0 / base.interval_s.unwrap_or(f64::NAN)
    )
}

/// A stamp that is moved by less than this part of an interval is not worth a word.
const WORTH_SAYING_PART: f64 = 0.01;

/// Frames that show the one before once more.
fn duplicated(
    seen: &Decoded,
    base: &TimeBase,
    duplicates: &[bool],
    calibration: &Calibration,
) -> Option<Warning> {
    let count = duplicates.iter().filter(|&&r| r).count();
    if count == 0 {
        return None;
    }
    let stored = seen
        .info
        .nominal_rate_hz
        .map_or(String::new(), |r| format!(" of a {r:.4} Hz file"));
    let rate = base.interval_s.map_or(String::new(), |i| {
        let clock = if calibration.frame_rate_hz.is_some() {
            "by the calibration"
        } else if base.evened {
            "evenly, as the ball's motion shows, not by the stamps"
        } else {
            "by the stamps"
        };
        format!(" Distinct pictures come at {:.4} Hz {clock}.", 1.0 / i)
    });
    let put_in = if base.put_in > 0 {
        " By the motion no time passed at them: they were put in, and later frames are that much earlier than their numbers or stamps say."
    } else {
        ""
    };
    Some(warning!(
        "repeated_frames",
        "{count} of {} frames{stored} repeat the frame before and were left out.{put_in}{rate} If the camera took pictures at another rate, set \"frame_rate_hz\" to it.",
        duplicates.len()
    ))
}

/// Shifts beyond this are worth a word, px: smaller ones are followed without one, and a codec makes some of up to 0.3.
const WORTH_SAYING_PX: f64 = 0.5;

/// Swings of a camera that otherwise stands still.
fn shaken_camera(seen: &Decoded, base: &TimeBase) -> Option<Warning> {
    let swings = |r: &&Registration| !r.is_still();
    let shaken: Vec<(f64, f64)> = seen
        .registrations
        .iter()
        .zip(&base.times_s)
        .filter(|(r, _)| swings(r))
        .map(|(r, &t)| (t, r.shift_px()))
        .collect();
    let (first, _) = shaken
        .first()
        .filter(|_| seen.detector.background.registrar.fixed)?;
    let most = shaken.iter().map(|s| s.1).fold(0.0, f64::max);
    (most > WORTH_SAYING_PX).then(|| warning!(
        "camera_shaken",
        "the whole picture swings by up to {most:.2} px in {} of {} frames, first at {first:.3} s: the table, or what the camera stands on, is bumped. It was followed by the edges of the scene (floor line, bench), along the directions that these tell; along others it is not seen. Put the camera on a stand of its own.",
        shaken.len(), seen.registrations.len()
    ))
}

fn moved_camera(registrations: &[Registration], background: &Background) -> Option<Warning> {
    let motions = registrations.iter().map(|r| r.motion_px().norm());
    let most = motions.fold(background.drift_px(), f64::max);
    let most_turned = registrations.iter().map(|r| r.turn_rad.abs()).fold(0.0, f64::max);
    let turned = if most_turned > 0.0 {
        format!(", and turned by up to {:.2}°", most_turned.to_degrees())
    } else {
        String::new()
    };
    let followed = if background.registrar.follows_all_shifts() {
        "centres were corrected by the scene behind the ball, but nearer and farther things move differently"
    } else {
        "centres were corrected by the scene behind the ball as far as that shows the motion; in at least one direction nothing does (a plain wall with a floor line shows none along the line), and places may be off by as much there, which the uncertainties hold"
    };
    (!background.registrar.fixed && most > WORTH_SAYING_PX).then(|| {
        warning!(
            "camera_moved",
            "the camera moved by up to {most:.1} px{turned}; {followed}. The calibration's pixels (\"origin_px\", ruler) are taken as those of the first frame. Put the camera on a tripod."
        )
    })
}
