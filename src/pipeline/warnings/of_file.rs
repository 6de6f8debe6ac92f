//! What is odd about the file.

use super::warning;
use crate::detect::colour::ColourChoice;
use crate::frames::StreamHealth;
use crate::pipeline::measurement::Warning;

/// What is odd about a file in which the decoder found `health`.
pub fn of_file(health: &StreamHealth) -> Vec<Warning> {
    let mut out: Vec<Warning> = health
        .notes
        .iter()
        .map(|n| Warning {
            code: n.code,
            message: n.message.clone(),
        })
        .collect();
    let read = health.frames_read;
    if let Some(why) = &health.ended_early {
        let of = health
            .frames_expected
            .map_or(String::new(), |n| format!(" of {n}"));
        out.push(warning!(
            "file_cut_short",
            "the file ends early: {read}{of} frames were read, then: {why}. What is there was measured; copy the file from the camera again to have the rest."
        ));
    } else if let Some(expected) = health.frames_expected.filter(|&n| n > read) {
        out.push(warning!(
            "frames_missing",
            "the file announces {expected} frames, {read} could be read."
        ));
    }
    if health.damaged > 0 {
        out.push(warning!(
            "damaged_frames",
            "{} of {read} frames are damaged; centres in them are less sure or missing.",
            health.damaged
        ));
    }
    if health.interlaced > 0 {
        out.push(warning!(
            "interlaced",
            "{} of {read} frames are interlaced: odd and even rows show different moments, which blurs a moving ball. Record progressively, or deinterlace to double rate first (ffmpeg -vf bwdif).",
            health.interlaced
        ));
    }
    if health.stamps_repaired > 0 {
        out.push(warning!(
            "time_stamps_repaired",
            "{} frames had no usable time stamp; their times were interpolated.",
            health.stamps_repaired
        ));
    }
    out
}

/// That the ball is seen by its colour, and what that costs.
pub fn by_colour(choice: &ColourChoice) -> Warning {
    let [luma, u, v] = choice.difference;
    let (mix, std_px) = (&choice.mix, choice.place_std_px.0.max(choice.place_std_px.1));
    let places = if std_px > 0.0 {
        format!(
            " Where the file's chroma lies is known to {std_px:.2} px, which x_0 and points along the picture have in their uncertainty."
        )
    } else {
        String::new()
    };
    warning!(
        "measured_by_colour",
        "the ball has nearly the brightness of what is behind it (it differs by {luma:.0} in luma, {u:.0} and {v:.0} in chroma U and V), so it is measured on {:.2} Y {:+.2} U {:+.2} V. Chroma is stored more coarsely than luma: centres are less sure than those of a ball that is lighter or darker than what is behind it.{places}",
        mix.luma,
        mix.u,
        mix.v,
    )
}
