//! From frames to sightings: what moves in each frame, and where its centre is if it is a ball.
//!
//! ```text
//! survey frames -> Background (median, noise, thresholds)
//! each frame    -> Registration (drift, swings, flicker) -> block changes -> blobs -> outline -> Sighting
//! ```
//!
//! Nothing here knows which of the moving things is the ball in flight; that is [`crate::flight`]'s question.

pub mod background;
pub mod blobs;
pub mod camera_swing;
pub mod centre;
pub mod colour;
pub mod crop;
mod faint_scene;
mod local_light;
mod noise;
mod registrar;
pub mod registration;
mod resample;
mod scene_grey;

pub use registrar::ShownMotion;

use crate::frames::{Coded, ColourCut, Frame, Luma};
use background::Background;
use blobs::Blob;
use camera_swing::ShiftThreshold;
use centre::{Centre, Disc, Patch, outline};
use crop::Crop;
use rayon::prelude::*;
use registrar::Followed;
use registration::Registration;
use std::sync::Arc;

/// A moving thing in one frame.
#[derive(Debug, Clone)]
pub struct Sighting {
    /// The frame in presentation order.
    pub frame: usize,
    /// How the frame is stored.
    pub coded: Coded,
    /// How the frame lies against the reference picture.
    pub registration: Registration,
    /// The region that differs from the background.
    pub blob: Blob,
    /// The centre, where the region has the outline of a ball.
    pub centre: Option<Centre>,
    /// The region's colours, for pictures.
    pub colours: Option<ColourCut>,
}

/// What one frame holds.
#[derive(Debug, Clone)]
pub struct FrameReading {
    /// Moving things, the strongest first.
    pub sightings: Vec<Sighting>,
    /// Mean absolute change of the block means against the frame before, grey levels; `None` for the first.
    pub change_grey: Option<f32>,
    /// Against the reference picture.
    pub registration: Registration,
}

/// Least part of the rays that agree on a circle before its edge is worth refining.
pub const LEAST_AGREEMENT: f64 = 0.45;

/// A frame that was compared with those before it.
#[derive(Debug)]
struct FollowedFrame {
    registration: Registration,
    change_grey: Option<f32>,
    /// See [`background::sum_blocks`].
    sums: Arc<Vec<u16>>,
}

/// What moves in a frame if the camera stands still, and if it swings as the frame says.
#[derive(Debug)]
struct SeenFrame {
    at_rest: Vec<Sighting>,
    swung: Option<SwungFrame>,
}

/// What moves in a frame in which the camera swings.
#[derive(Debug)]
struct SwungFrame {
    swing: ShownSwing,
    sightings: Vec<Sighting>,
}

/// A swing of a camera that otherwise stands still, as one frame shows it.
#[derive(Debug)]
struct ShownSwing {
    /// Whether it need not have swung before.
    is_onset: bool,
    registration: Registration,
}

/// Looks at one frame after the other.
#[derive(Debug)]
pub struct Detector {
    /// The empty scene.
    pub background: Background,
    /// Where the frame before looked.
    last: Followed,
    last_sums: Option<Arc<Vec<u16>>>,
    /// When the camera last surely swung, s.
    swung_s: Option<f64>,
}

/// A thing lies outside of a circle where less of it than this part is within, to what its edge is blurred over, px.
const MOST_WITHIN: f64 = 0.4;
const BLURRED_PX: f64 = 1.5;

/// A swing dies away within this, s.
const SWING_LASTS_S: f64 = 0.12;

impl Detector {
    /// A detector against `background`.
    #[must_use]
    pub fn new(background: Background) -> Self {
        Self {
            background,
            last: Followed::not_compared(Registration::IDENTITY),
            last_sums: None,
            swung_s: None,
        }
    }

    /// Everything that moves in each of these frames, the next ones in presentation order. What a frame shows whatever those before it did is looked
    /// for in several at a time.
    #[must_use]
    pub fn look(&mut self, frames: &[Frame]) -> Vec<FrameReading> {
        let followed: Vec<FollowedFrame> = frames.iter().map(|f| self.follow(f)).collect();
        let swings: Vec<bool> = frames.iter().map(|f| self.swings_at(f.time_s)).collect();
        let seen = |i: usize| self.seen(&frames[i], &followed[i], swings[i]);
        let seen: Vec<SeenFrame> = match frames.len() {
            1 => vec![seen(0)],
            count => (0..count).into_par_iter().map(seen).collect(),
        };
        let each = frames.iter().zip(followed).zip(seen);
        each.map(|((frame, followed), seen)| self.reading(frame, &followed, seen))
            .collect()
    }

    /// Where `frame` looks and how it is lit, and how it differs from the one before.
    fn follow(&mut self, frame: &Frame) -> FollowedFrame {
        let registrar = &self.background.registrar;
        // The first frame has none before it, and where the camera drifts it may be far from the reference.
        let first = self.last_sums.is_none() && !registrar.fixed;
        let found = if first {
            registrar.locate_one(&frame.luma, &self.background.first_registration)
        } else {
            registrar.follow_from(&frame.luma, &self.last)
        };
        let sums = Arc::new(background::sum_blocks(&frame.luma, self.background.block_px));
        let last_sums = self.last_sums.replace(Arc::clone(&sums));
        self.last = found;
        FollowedFrame {
            registration: found.registration,
            change_grey: last_sums.map(|last| self.frame_change_grey(&last, &sums)),
            sums,
        }
    }

    /// What `frame` shows, where the camera `swings` already or not.
    fn seen(&self, frame: &Frame, followed: &FollowedFrame, swings: bool) -> SeenFrame {
        let at_rest = self.sightings(frame, &followed.sums, followed.registration);
        let swung = self.swing(frame, &followed.registration, &at_rest, swings);
        let swung = swung.map(|swing| SwungFrame {
            sightings: self.sightings(frame, &followed.sums, swing.registration),
            swing,
        });
        SeenFrame { at_rest, swung }
    }

    /// What is read off `frame`, by what it shows and what the frames before it did.
    fn reading(&mut self, frame: &Frame, followed: &FollowedFrame, seen: SeenFrame) -> FrameReading {
        let swings = self.swings_at(frame.time_s);
        let seen = match seen.swung {
            // It began to swing in one of the frames that were looked at together.
            None if swings => self.seen(frame, followed, swings),
            _ => seen,
        };
        let change_grey = followed.change_grey;
        match seen.swung.filter(|s| s.swing.is_onset || swings) {
            Some(SwungFrame { swing, sightings }) => {
                if swing.is_onset {
                    self.swung_s = Some(frame.time_s);
                }
                FrameReading {
                    sightings,
                    change_grey,
                    registration: swing.registration,
                }
            }
            None => FrameReading {
                sightings: seen.at_rest,
                change_grey,
                registration: followed.registration,
            },
        }
    }

    /// Whether a swing that was seen may still go on.
    fn swings_at(&self, time_s: f64) -> bool {
        self.swung_s
            .is_some_and(|swung_s| (0.0..SWING_LASTS_S).contains(&(time_s - swung_s)))
    }

    /// What moves in `frame`, which is shown as `registration` says.
    fn sightings(&self, frame: &Frame, sums: &[u16], registration: Registration) -> Vec<Sighting> {
        let changes = self.background.block_changes(sums, &registration);
        let sighting = |(blob, centre)| Sighting {
            frame: frame.index,
            coded: frame.coded,
            registration,
            blob,
            centre,
            colours: None,
        };
        let things = blobs::find(&self.background, &frame.luma, &registration, &changes);
        // A ball alone is sooner looked at than handed to another core.
        let parted: Vec<Vec<_>> = if things.len() < 2 {
            things
                .into_iter()
                .map(|blob| self.parted(blob, &registration))
                .collect()
        } else {
            let each = things.into_par_iter();
            each.map(|blob| self.parted(blob, &registration)).collect()
        };
        parted.into_iter().flatten().map(sighting).collect()
    }

    /// A blob with its first centre; or where a ball and its shadow beside it are one region, both: what is brighter than the scene and what
    /// is darker are two things where one at least is a full disc, and the other lies beside it. (The dark side of a ball lies within, and so
    /// do its marks; half a ball fills no disc.)
    fn parted(&self, blob: Blob, registration: &Registration) -> Vec<(Blob, Option<Centre>)> {
        let whole = self.first_centre(&blob, registration);
        let Some(parts) = blob.bright_and_dark(&self.background, registration) else {
            return vec![(blob, whole)];
        };
        let centres = parts.each_ref().map(|p| self.first_centre(&p.blob, registration));
        // (An oval may be half a ball.)
        let circles = centres.map(|c| c.filter(|c| c.disc.swept_px == [0.0; 2]));
        let disc = |k: usize| circles[k].as_ref().map(|c| c.disc);
        let full = |k: &usize| disc(*k).is_some_and(|d| parts[*k].fills(&d));
        let beside = |k: usize| disc(k).is_some_and(|d| parts[1 - k].within(&d, BLURRED_PX) < MOST_WITHIN);
        let mut whole_discs = (0..2).filter(full).peekable();
        if whole_discs.peek().is_none() || !whole_discs.all(beside) {
            return vec![(blob, whole)];
        }
        let [bright, dark] = parts.map(|p| p.blob);
        let [of_bright, of_dark] = centres;
        vec![(bright, of_bright), (dark, of_dark)]
    }

    /// The swing that `frame` shows, where the camera `swings` already or not; `None` where it stands.
    fn swing(
        &self,
        frame: &Frame,
        registration: &Registration,
        sightings: &[Sighting],
        swings: bool,
    ) -> Option<ShownSwing> {
        let balls: Vec<camera_swing::PixelRegion> = sightings
            .iter()
            .filter(|s| s.centre.is_some())
            .map(|s| {
                let crop = &s.blob.crop;
                (
                    crop.u..crop.u + crop.luma.width,
                    crop.v..crop.v + crop.luma.height,
                )
            })
            .collect();
        let edges = self.background.edges.as_ref()?;
        let thresholds = if swings {
            &[ShiftThreshold::ONSET, ShiftThreshold::DECAY][..]
        } else {
            &[ShiftThreshold::ONSET]
        };
        let (exceeded, [shift_u_px, shift_v_px]) =
            edges.shift_above(&frame.luma, registration, &balls, thresholds)?;
        Some(ShownSwing {
            is_onset: exceeded == ShiftThreshold::ONSET,
            registration: Registration {
                shift_u_px,
                shift_v_px,
                ..*registration
            },
        })
    }

    fn frame_change_grey(&self, last: &[u16], now: &[u16]) -> f32 {
        /// The differences of so many blocks add up to no more than 32 bits hold.
        const PART: usize = 1 << 16;
        let area = (self.background.block_px * self.background.block_px) as f32;
        let part = |(a, b): (&[u16], &[u16])| {
            let differences = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b)));
            u64::from(differences.sum::<u32>())
        };
        let sum: u64 = last.chunks(PART).zip(now.chunks(PART)).map(part).sum();
        sum as f32 / last.len().max(1) as f32 / area
    }

    /// The patch of a blob, ready for a centre method.
    #[must_use]
    pub fn patch<'a>(&self, crop: &'a Crop, registration: &Registration) -> Patch<'a> {
        let background = &self.background;
        let behind = background
            .scene_grey
            .behind(background.luma.width, registration, crop);
        self.patch_before(behind, crop)
    }

    /// The same before this, grey levels, row by row.
    fn patch_before<'a>(&self, behind: Vec<f32>, crop: &'a Crop) -> Patch<'a> {
        Patch {
            crop,
            background: behind,
            noise_grey: self.background.noise_grey,
            affine: None,
        }
    }

    /// Where `scene`, another picture of the same scene, lies and how it is lit against the background, and what it shows that the
    /// background does not.
    #[must_use]
    pub fn compare(&self, scene: &Luma) -> (Registration, Vec<Blob>) {
        let background = &self.background;
        let light = background.registrar.follow(scene, &Registration::IDENTITY);
        let sums = background::sum_blocks(scene, background.block_px);
        let shown = blobs::find(
            background,
            scene,
            &light,
            &background.block_changes(&sums, &light),
        );
        (light, shown)
    }

    /// A first centre, good to a few hundredths of the radius, where nothing is known of the ball yet: the circle
    /// through its outline; or, where the region is a full oval that no circle fits (a ball smeared by its motion),
    /// the middle of the oval.
    fn first_centre(&self, blob: &Blob, registration: &Registration) -> Option<Centre> {
        // The median is the rougher picture of the scene, but that of one light where the light changes.
        let median = &self.background.luma;
        let behind = scene_grey::behind(&median.data, median.width, registration, &blob.crop);
        let patch = self.patch_before(behind, &blob.crop);
        let round = outline::find(&patch, blob.centroid, None)
            .filter(|o| o.agreement >= LEAST_AGREEMENT)
            .map(|o| rough(blob, o.disc, o.agreement));
        let Some(oval) = blob.oval() else { return round };
        let alike = |c: &Centre| {
            c.disc.centre.distance_px(oval.centre) < 0.1 * oval.radius_px + 0.5
                && (c.disc.radius_px / oval.radius_px - 1.0).abs() < 0.15
        };
        round
            .filter(alike)
            .or_else(|| Some(rough(blob, oval, LEAST_AGREEMENT)))
    }
}

/// A first centre is known to about this part of the radius, and not better than to some tenths of a pixel.
const ROUGH_STD: (f64, f64) = (0.03, 0.3);

/// The centre of an outline that was not refined.
fn rough(blob: &Blob, disc: Disc, agreement: f64) -> Centre {
    let std_px = ROUGH_STD.1.max(ROUGH_STD.0 * disc.radius_px);
    Centre {
        disc,
        covariance_px2: [[std_px * std_px, 0.0], [0.0, std_px * std_px]],
        outline_used: agreement,
        residual_grey: 0.0,
        contrast_grey: blob.contrast_grey,
    }
}

#[cfg(test)]
mod tests;
