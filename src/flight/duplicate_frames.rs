//! Duplicate frames, which show the picture of the one before: a clip stored at twice its true rate, or padded by a phone.
//!
//! A duplicate shows in what moves: things stand still for one step between steps in which they move. A slow thing that
//! hardly moves is no evidence, so such frames are judged by the change of the picture as a whole, and only where the moving
//! things have shown that this change is a reliable sign; or where the picture is the same to the last bit, between pictures that are not.

use super::linking::{LinkedSpots, Spot};

/// The duplicates among a recording's frames.
#[derive(Debug, Clone, PartialEq)]
pub struct DuplicateFrames {
    /// For every frame, whether it is a duplicate of the one before.
    pub frames: Vec<bool>,
    /// How many.
    pub count: usize,
}

/// A step this much shorter than its longer neighbour is a stand-still.
const STILL_PART: f64 = 0.15;

/// A picture that changes this much less than its neighbours changes not at all.
const SAME_PICTURE_PART: f64 = 0.3;

/// Least step, in standard uncertainties and in plane units' worth of a pixel, that a stand-still stands out against.
const LEAST_STEP_SIGMAS: f64 = 6.0;

/// Finds duplicates from the `linked` spots of all frames (times not needed, in frame order) and each frame's mean change
/// against the one before, grey levels. `pixel` is the length of a pixel in the spots' unit.
#[must_use]
pub fn find(linked: &LinkedSpots, changes: &[Option<f32>], pixel: f64) -> DuplicateFrames {
    let total = changes.len();
    let same_picture: Vec<bool> = (0..total).map(|i| hardly_changes(changes, i)).collect();
    // Per frame: how many things stood still in a step where they should have moved, and how many moved.
    let (mut still, mut moved) = (vec![0_usize; total], vec![0_usize; total]);
    for track in &linked.tracks {
        for w in track.windows(4) {
            let s = [0, 1, 2, 3].map(|k| &linked.spots[w[k]]);
            if s[3].frame - s[0].frame != 3 || s[3].frame >= total {
                continue;
            }
            let step = |a: &Spot, b: &Spot| (b.place.right - a.place.right).hypot(b.place.up - a.place.up);
            let (before, here, after) = (step(s[0], s[1]), step(s[1], s[2]), step(s[2], s[3]));
            let longest = before.max(after);
            if longest < (LEAST_STEP_SIGMAS * s[1].std).max(1.0 * pixel) {
                continue;
            }
            if here < STILL_PART * longest {
                still[s[2].frame] += 1;
            } else if here > 2.0 * STILL_PART * longest {
                moved[s[2].frame] += 1;
            }
        }
    }
    // Things that stand still in a picture that changes are something else: an impact, noise of a rough centre.
    let seen_still = |i: usize| still[i] > moved[i] && same_picture[i];
    let tested: Vec<usize> = (0..total).filter(|&i| still[i] + moved[i] > 0).collect();
    let stills = tested.iter().filter(|&&i| seen_still(i)).count();
    // Where things move, pictures that hardly change are stand-stills nine times in ten: then the picture may judge
    // where nothing moves much, too.
    let same = tested.iter().filter(|&&i| same_picture[i]).count();
    let picture_tells = stills >= 6 && stills * 10 >= tested.len() && stills * 10 >= same * 9;
    let frames: Vec<bool> = (0..total)
        .map(|i| {
            if still[i] + moved[i] > 0 {
                seen_still(i)
            } else {
                let is_copy = changes[i].is_some_and(|change| change <= 0.0);
                (picture_tells || is_copy) && same_picture[i]
            }
        })
        .collect();
    DuplicateFrames {
        count: frames.iter().filter(|&&r| r).count(),
        frames,
    }
}

/// Whether frame `i` changes far less than the livelier half of the frames around it.
fn hardly_changes(changes: &[Option<f32>], i: usize) -> bool {
    let Some(here) = changes[i] else { return false };
    let from = i.saturating_sub(6);
    let to = (i + 7).min(changes.len());
    let mut around: Vec<f32> = (from..to)
        .filter(|&k| k != i)
        .filter_map(|k| changes[k])
        .collect();
    around.sort_by(f32::total_cmp);
    let lively = around.get(around.len() * 3 / 4).copied().unwrap_or(0.0);
    f64::from(here) < SAME_PICTURE_PART * f64::from(lively)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::PlanePoint;

    /// A bouncing thing, every `fold` frames the same picture.
    fn clip(fold: usize, frames: usize) -> (Vec<Spot>, Vec<Option<f32>>) {
        let mut spots = Vec::new();
        let mut changes = Vec::new();
        for frame in 0..frames {
            let t = (frame / fold) as f64 / 30.0;
            let up = (400.0 - 3000.0 * (t % 0.8 - 0.4).powi(2)).max(0.0);
            spots.push(Spot {
                coded: crate::frames::Coded::Whole,
                id: frame,
                frame,
                time_s: frame as f64 / 30.0 / fold as f64,
                place: PlanePoint::new(100.0 * t, up),
                std: 0.1,
                radius: 12.0,
                contrast_grey: 50.0,
            });
            let new = frame % fold == 0;
            changes.push((frame > 0).then_some(if new { 0.8 } else { 0.05 }));
        }
        (spots, changes)
    }

    #[test]
    fn a_doubled_clip_is_recognised_frame_by_frame() {
        let (spots, changes) = clip(2, 120);
        let duplicates = find(&LinkedSpots::new(spots), &changes, 1.0);
        for (i, r) in duplicates.frames.iter().enumerate() {
            assert_eq!(*r, i % 2 == 1, "frame {i}");
        }
    }

    #[test]
    fn a_copy_is_recognised_where_things_hardly_move() {
        let (mut spots, mut changes) = clip(1, 120);
        for s in &mut spots {
            s.place = PlanePoint::new(0.01 * s.place.right, 0.01 * s.place.up);
        }
        changes[50] = Some(0.0);
        changes[70] = Some(0.01);
        let duplicates = find(&LinkedSpots::new(spots), &changes, 1.0);
        assert!(duplicates.frames[50] && duplicates.count == 1);
    }

    #[test]
    fn an_honest_clip_has_none() {
        let (spots, changes) = clip(1, 120);
        assert_eq!(find(&LinkedSpots::new(spots), &changes, 1.0).count, 0);
    }

    #[test]
    fn a_codec_that_skips_still_pictures_is_not_taken_for_duplicates() {
        let (spots, mut changes) = clip(1, 120);
        for (i, c) in changes.iter_mut().enumerate() {
            *c = Some(if i % 2 == 1 { 0.01 } else { 0.5 });
        }
        assert_eq!(find(&LinkedSpots::new(spots), &changes, 1.0).count, 0);
    }
}
