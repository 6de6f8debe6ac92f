//! What a person said of a recording ([`Edits`]), worked into what was seen of it, before anything is linked.
//!
//! | said | what becomes of it |
//! |---|---|
//! | `region_px`, `time_range_s` | what was seen elsewhere, or at other times, is forgotten |
//! | `exclude_frames` | what was seen in these frames is forgotten; the ball's place stays in the table of points with the reason |
//! | `points` | a centre of that place and uncertainty stands in place of what was seen in its frame |
//! | `ball` | the track through that thing is the ball's, whatever else flies |
//! | `not_impacts_s` | arcs that part at about that time do not meet: no bounce is read there |
//!
//! A centre that a person gives is not fitted again, and goes through the flight as the others do: one far off its arc is set aside with
//! that reason. Times are compared with those of the clock that all things together show, since that is what the person saw.

use super::decode::Decoded;
use super::error::MeasureError;
use super::measurement::{Measurement, PointUse, TrackPoint, UnusedReason, Warning};
use super::spots::BallCentre;
use crate::detect::Sighting;
use crate::detect::blobs::Blob;
use crate::detect::centre::{Centre, Disc};
use crate::detect::crop::Crop;
use crate::edits::{ChosenBall, EDITED_POINT_STD_PX, EditedPoint, Edits};
use crate::frames::Coded;
use crate::geometry::PixelPoint;
use crate::numeric::robust::median;
use std::path::Path;

/// A ball whose size nobody told and nothing shows, px.
const UNKNOWN_RADIUS_PX: f64 = 5.0;

/// A thing within so many of its radii of the point that a person set is meant.
const MEANT_RADII: f64 = 1.5;

/// A frame that repeats another shows nothing new: the thing is looked for in those so many frames before and after it.
const MEANT_FRAMES: usize = 3;

/// What was seen in the frames that a person excluded.
#[derive(Debug, Default)]
pub struct Excluded(Vec<Sighting>);

/// Works `edits` of the recording `video` into what was seen of it, but for times, which are not known yet.
///
/// # Errors
/// [`MeasureError::Edits`] where they name what is not there.
pub fn apply(decoded: &mut Decoded, edits: &Edits, video: &Path) -> Result<Excluded, MeasureError> {
    let frames = decoded.stamps_s.len();
    if let Some(frame) = edits.last_frame().filter(|frame| *frame >= frames) {
        let found = format!(
            "frame {frame}; the recording has frames 0 to {}",
            frames.saturating_sub(1)
        );
        return Err(misfit(video, found));
    }
    let excluded = |frame: usize| edits.exclude_frames.contains(&frame);
    let (out, mut kept): (Vec<_>, Vec<_>) = std::mem::take(&mut decoded.sightings)
        .into_iter()
        .partition(|s| excluded(s.frame));
    if let Some([left, top, right, bottom]) = edits.region_px {
        kept.retain(|s| {
            let p = place(s);
            (left..=right).contains(&p.u_px) && (top..=bottom).contains(&p.v_px)
        });
    }
    decoded.sightings = kept;
    for point in edits.points.iter().filter(|p| !excluded(p.frame)) {
        give(decoded, point, None);
    }
    if let Some(ball) = &edits.ball {
        give_chosen(decoded, ball, video)?;
    }
    Ok(Excluded(out))
}

fn misfit(video: &Path, found: String) -> MeasureError {
    MeasureError::Edits {
        video: video.to_owned(),
        found,
    }
}

/// Forgets what was seen before and after `range_s`, by the times of each frame.
pub fn keep_times(decoded: &mut Decoded, range_s: [f64; 2], times_s: &[f64]) {
    let within = |s: &Sighting| (range_s[0]..=range_s[1]).contains(&times_s[s.frame]);
    decoded.sightings.retain(within);
}

/// Marks the one of `centres` that the person says is the ball; `repeats` are the frames that show nothing new.
pub fn mark_chosen(centres: &mut [BallCentre], edits: &Edits, repeats: &[bool]) {
    let Some(ball) = &edits.ball else { return };
    let near = |c: &&mut BallCentre| {
        let apart = c.frame.abs_diff(ball.frame);
        apart <= MEANT_FRAMES && !repeats[c.frame] && is_meant(ball, c.centre.disc)
    };
    let distance = |c: &BallCentre| {
        (
            c.frame.abs_diff(ball.frame),
            c.centre.disc.centre.distance_px(point(ball.centre_px)),
        )
    };
    let nearest = centres.iter_mut().filter(near).min_by(|a, b| {
        let (a, b) = (distance(a), distance(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    if let Some(chosen) = nearest {
        chosen.is_chosen = true;
    }
}

fn point([u_px, v_px]: [f64; 2]) -> PixelPoint {
    PixelPoint::new(u_px, v_px)
}

fn is_meant(ball: &ChosenBall, disc: Disc) -> bool {
    let reach = MEANT_RADII * disc.radius_px.max(ball.radius_px.unwrap_or(0.0));
    disc.centre.distance_px(point(ball.centre_px)) <= reach
}

fn place(s: &Sighting) -> PixelPoint {
    s.centre.map_or(s.blob.centroid, |c| c.disc.centre)
}

/// A centre where the person chose the ball, if nothing round was seen there and its radius is told.
fn give_chosen(decoded: &mut Decoded, ball: &ChosenBall, video: &Path) -> Result<(), MeasureError> {
    let round = |s: &&Sighting| s.frame.abs_diff(ball.frame) <= MEANT_FRAMES;
    let discs: Vec<(usize, Disc)> = decoded
        .sightings
        .iter()
        .filter(round)
        .filter_map(|s| Some((s.frame, s.centre?.disc)))
        .collect();
    if discs.iter().any(|(_, disc)| is_meant(ball, *disc)) {
        return Ok(());
    }
    if ball.radius_px.is_some() {
        let [u_px, v_px] = ball.centre_px;
        let point = EditedPoint {
            frame: ball.frame,
            u_px,
            v_px,
            std_px: None,
        };
        give(decoded, &point, ball.radius_px);
        return Ok(());
    }
    let [u, v] = ball.centre_px;
    let nearest = discs.iter().filter(|(frame, _)| *frame == ball.frame);
    let nearest = nearest.min_by(|a, b| {
        let distance = |d: &Disc| d.centre.distance_px(point(ball.centre_px));
        distance(&a.1).total_cmp(&distance(&b.1))
    });
    let nearest = nearest.map_or("there is nothing round in that frame".to_owned(), |(_, d)| {
        let c = d.centre;
        format!(
            "the nearest round thing is at ({:.0}, {:.0}), radius {:.0} px",
            c.u_px, c.v_px, d.radius_px
        )
    });
    let found = format!(
        "the ball at ({u:.0}, {v:.0}) of frame {}, where nothing round was seen to move ({nearest}); give its radius_px to have it taken \
         as it is, or choose it in another frame",
        ball.frame
    );
    Err(misfit(video, found))
}

/// Puts a centre that a person gives in place of what was seen in its frame. What is not told of it is as in the frames around it.
fn give(decoded: &mut Decoded, point: &EditedPoint, radius_px: Option<f64>) {
    let frame = point.frame;
    let centre = PixelPoint::new(point.u_px, point.v_px);
    let like = likeness(&decoded.sightings, frame, centre);
    let first = decoded.sightings.partition_point(|s| s.frame < frame);
    let end = decoded.sightings.partition_point(|s| s.frame <= frame);
    let std_px = point.std_px.unwrap_or(EDITED_POINT_STD_PX);
    let radius_px = radius_px.or(like.radius_px).unwrap_or(UNKNOWN_RADIUS_PX);
    let given = Sighting {
        frame,
        coded: Coded::Whole,
        registration: decoded.registrations[frame],
        colours: None,
        blob: Blob {
            centroid: centre,
            area_px: std::f64::consts::PI * radius_px * radius_px,
            brighter_px: 0.0,
            spread_px: (0.5 * radius_px, 0.5 * radius_px),
            direction_rad: 0.0,
            contrast_grey: like.contrast_grey,
            // Without pixels it is not fitted again.
            crop: Crop::without_pixels(centre.u_px.max(0.0) as usize, centre.v_px.max(0.0) as usize),
            at_border: false,
        },
        centre: Some(Centre::told(centre, std_px, radius_px, like.contrast_grey)),
    };
    decoded.sightings.splice(first..end, [given]);
}

/// How the ball looks at about a place.
struct Likeness {
    radius_px: Option<f64>,
    contrast_grey: f64,
}

/// Frames around one whose things are asked how the ball looks, and how many of the nearest.
const LIKE_FRAMES: usize = 6;
const LIKE_THINGS: usize = 5;

/// Looks of the round things nearest to `centre` around `frame`.
fn likeness(sightings: &[Sighting], frame: usize, centre: PixelPoint) -> Likeness {
    let from = sightings.partition_point(|s| s.frame + LIKE_FRAMES < frame);
    let near = sightings[from..]
        .iter()
        .take_while(|s| s.frame <= frame + LIKE_FRAMES);
    let mut things: Vec<(f64, Centre)> = near
        .filter_map(|s| Some((s.centre?.disc.centre.distance_px(centre), s.centre?)))
        .collect();
    things.sort_by(|a, b| a.0.total_cmp(&b.0));
    things.truncate(LIKE_THINGS);
    let mut radii: Vec<f64> = things.iter().map(|(_, c)| c.disc.radius_px).collect();
    let mut contrasts: Vec<f64> = things.iter().map(|(_, c)| c.contrast_grey).collect();
    Likeness {
        radius_px: median(&mut radii),
        contrast_grey: median(&mut contrasts).unwrap_or(0.0),
    }
}

/// Puts what a person said into the `measurement` that was made by it: the edits, their warning, and rows for the frames `excluded`.
pub fn note(measurement: &mut Measurement, edits: &Edits, excluded: &Excluded, times_s: &[f64]) {
    if edits.is_empty() {
        return;
    }
    measurement.edits = Some(edits.clone());
    let said = Warning {
        code: "edited",
        message: format!(
            "measured with what a person said of the recording: {}",
            edits.words()
        ),
    };
    measurement.warnings.insert(0, said);
    for launch in &mut measurement.launches {
        add_excluded(launch, excluded, times_s);
    }
    add_excluded(measurement, excluded, times_s);
}

/// Rows for what was seen on the arcs in the frames that were `excluded`.
fn add_excluded(measurement: &mut Measurement, excluded: &Excluded, times_s: &[f64]) {
    let radius_px = measurement.track.radius_px.map_or(UNKNOWN_RADIUS_PX, |r| r.value);
    let is_ball = |s: &Sighting, at: PixelPoint| {
        let time_s = times_s[s.frame];
        let seen = s.registration.reference_from_frame(at);
        let arcs = measurement
            .arcs
            .iter()
            .filter_map(|a| Some((a.samples.first()?, a.samples.last()?, &a.samples)));
        let mut here = arcs.filter(|(from, to, _)| (from.time_s..=to.time_s).contains(&time_s));
        here.any(|(_, _, samples)| {
            let after = samples
                .partition_point(|p| p.time_s < time_s)
                .clamp(1, samples.len() - 1);
            let (a, b) = (&samples[after - 1], &samples[after]);
            let part = (time_s - a.time_s) / (b.time_s - a.time_s);
            let du = (b.pixel.u_px - a.pixel.u_px) * part;
            let dv = (b.pixel.v_px - a.pixel.v_px) * part;
            a.pixel.shifted(du, dv).distance_px(seen) < radius_px
        })
    };
    let mut rows: Vec<TrackPoint> = Vec::new();
    for s in &excluded.0 {
        let Some(centre) = s.centre else { continue };
        let pixel = centre.disc.centre;
        if rows.last().is_none_or(|row| row.frame != s.frame) && is_ball(s, pixel) {
            rows.push(TrackPoint {
                frame: s.frame,
                time_s: times_s[s.frame],
                pixel,
                std_px: Some(centre.std_px()),
                world: None,
                use_: PointUse::Unused(UnusedReason::Excluded),
                residual_m: None,
            });
        }
    }
    let track = &mut measurement.track;
    track.detected += rows.len();
    track.points.extend(rows);
    track.points.sort_by_key(|p| p.frame);
}
