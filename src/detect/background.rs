//! The empty scene and its noise, from frames spread over the recording.
//!
//! The background is the per-pixel median of the survey's frames: whatever covers a pixel in less than half of them
//! is not part of it. The median runs as an odd-even merge network on whole rows, so that the compiler turns it into
//! byte-wise minimum and maximum instructions: 15 frames of 1080p take a few milliseconds.
//!
//! A camera moves where the scene does so as one: where the shift is clear of what its parts differ by, or where each place tells it for itself
//! (`faint_scene`). A codec at a low rate draws the parts of a faint texture elsewhere, each by itself, and most of them together may
//! seem to go somewhere.
//!
//! A hand that holds a camera also turns it about its axis. Where the parts of the scene agree better with that, frames are aligned and
//! followed so; the reference is turned as the survey's first frame is, whose pixels are the calibration's (a later frame's turn is known as well as any).
//!
//! Assumed: each pixel is uncovered in more than half of the survey's frames, and the scene itself does not change but for a
//! motion of the camera and the light. Where a thing stays longer, it is background, and what it covered shows as a change.

use super::camera_swing::SceneEdges;
use super::faint_scene::{CorrelatedShifts, FaintScene};
use super::noise::{ROUNDING_STD_GREY, frame_noise_grey, interpolated_median, spatial_noise_grey};
use super::registrar::{Registrar, ShownMotion};
use super::registration::Registration;
use super::scene_grey::SceneGrey;
use crate::frames::{Luma, has_room_for_several};
use crate::numeric::robust::{MEDIAN_STD_OVER_MEAN_STD, STD_OF_MEDIAN, lower_median, median};
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use std::borrow::Cow;
use std::cell::LazyCell;
use std::sync::Arc;

/// Side of the square blocks on which motion is first looked for, px, for a picture of this size.
///
/// Averaging over a block lowers white noise by its side; a block must stay below the smallest ball's diameter
/// (R 2-3 px), so small pictures, in which balls are small, get small blocks.
#[must_use]
pub fn block_side_px(width: usize, height: usize) -> usize {
    if width * height > 500_000 { 4 } else { 2 }
}

/// The scene without what moves, and what a frame is compared with.
#[derive(Debug, Clone)]
pub struct Background {
    /// Median of the survey, in the reference frame's picture.
    pub luma: Arc<Luma>,
    /// The same to fractions of a grey level, row by row: where the camera is fixed, the mean of the frames in which nothing
    /// covers the pixel, since the median is biased towards the ball where that covers it often.
    pub scene_grey: SceneGrey,
    /// Standard deviation of a single pixel's noise, grey levels.
    pub noise_grey: f64,
    /// Side of a block, px.
    pub block_px: usize,
    /// Blocks a row, blocks a column.
    pub blocks: (usize, usize),
    /// Sum of the background over each block.
    pub block_sums: Vec<u16>,
    /// Least change of a block's mean that counts as motion, grey levels, a block.
    pub block_threshold_grey: Vec<f32>,
    /// Follows the camera's drift and the light's flicker.
    pub registrar: Registrar,
    /// Where the survey's first frame looks.
    pub first_registration: Registration,
    /// Where each of the survey's frames looks.
    pub survey_registrations: Vec<Registration>,
    /// Standard uncertainty of where a frame looks, px; 0 where the camera is fixed.
    pub shift_std_px: f64,
    /// Which motions of the camera the scene shows.
    pub shown_motion: ShownMotion,
    /// How a camera that moves may move beyond what its frames were registered by; none where it stands still.
    pub unseen_motions: Vec<UnseenMotion>,
    /// The edges of the scene, by which swings of a camera that stands still are seen; `None` where it moves.
    pub edges: Option<SceneEdges>,
}

/// How a camera that moves may move along one direction, beyond what its frames were registered by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnseenMotion {
    /// The direction, columns and rows.
    pub along: Vector2<f64>,
    /// How far by the end of the flight, px.
    pub std_px: f64,
}

/// The 95 % quantile of Student's distribution with two degrees of freedom over that of the normal one.
const ONE_PATH: f64 = 4.303 / 1.960;

impl UnseenMotion {
    /// Of a camera whose frames of the `survey` look where `found` says, as far as `registrar` tells.
    ///
    /// Where nothing shows a motion it is about as far as the camera is seen to move otherwise; one path in one direction tells that badly, as a variance
    /// of two degrees of freedom does: the standard deviation is by so much larger that 95 % of the paths in another direction lie within 1.96 of it.
    /// Where the scene shows it, it is what the parts of the scene differ by.
    fn each(registrar: &Registrar, survey: &[&Luma], found: &[Registration]) -> Vec<Self> {
        let unseen_px = ONE_PATH * drift_px(found);
        let motion = |along, std_px| Self { along, std_px };
        let axes = [Vector2::x(), Vector2::y()];
        if !registrar.follows_shifts() {
            return axes.map(|along| motion(along, unseen_px)).to_vec();
        }
        let seen_px = registrar.parts_differ_px(survey, found);
        match registrar.held() {
            Some(held) => {
                let across = Vector2::new(-held.y, held.x);
                vec![motion(held, unseen_px), motion(across, seen_px)]
            }
            None => axes.map(|along| motion(along, seen_px)).to_vec(),
        }
    }
}

/// A block is moving where its mean differs by this many standard deviations. 5 keeps false alarms of white noise
/// below one block in a million.
const BLOCK_SIGMAS: f64 = 5.0;

/// A change below this is invisible, whatever the noise, grey levels.
const LEAST_CHANGE_GREY: f64 = 1.5;

/// Displacements in the survey below this are the estimator's own noise, and the camera counts as fixed, px.
const FIXED_CAMERA_PX: f64 = 0.35;

/// It also counts as fixed below so many times the standard uncertainty of a shift, which is large in a faint scene: the
/// largest of fifteen shifts is 2.3 times their median.
const DRIFT_SIGMAS: f64 = 4.0;

/// A pan shows by shifts that follow each other steadily: they go further than they scatter from frame to frame by so many times as often as
/// two halves of the scene that see the same shift need.
const CLEAR_OF_SCATTER: f64 = 2.5;

/// A camera that moves turns, too, where the parts of the scene differ by less than this part of what they do without.
const AGREE_BETTER: f64 = 0.8;

/// One in so many frames of a survey, and one in so many of the places compared, tells a camera that stands from one that may turn.
const QUICK_LOOK: usize = 3;

/// A shift that is so far from where the scene's edges are is none, px.
const REFUTED_PX: f64 = 2.0;

impl Background {
    /// The background of `survey` (frames of one size, spread over the recording, in time order). `None` when empty.
    #[must_use]
    pub fn from_survey(survey: &[&Luma]) -> Option<Self> {
        let reference = *survey.get(survey.len() / 2)?;
        let mut noise_grey = frame_noise_grey(survey);
        let mut first = Registrar::at_full_size(reference, noise_grey);
        if !first.sees_shift() {
            // A camera that moves changes every pixel from frame to frame, which looks like noise; within one frame it does not.
            noise_grey = noise_grey.min(spatial_noise_grey(reference));
            first = Registrar::new(reference, noise_grey);
        }
        let median = median_of(survey);
        let (mut registrations, mut fixed) = camera_shifts(&first, survey, &median);
        let turned = camera_turns(&first, survey, &registrations, fixed);
        drop(first);
        let turns = turned.is_some();
        if let Some(turned) = turned {
            (registrations, fixed) = (turned, false);
        }
        let scene = |followed: &mut [Registration]| {
            let registrar = if fixed {
                Registrar::of_fixed(&median, noise_grey)
            } else {
                // The calibration is that of the first frame, and so is how the reference is turned.
                let first_frame = followed[0];
                followed
                    .iter_mut()
                    .for_each(|r| *r = r.against_turn_of(&first_frame));
                let aligned = survey.par_iter().zip(&*followed).map(|(f, r)| r.aligned(f));
                let aligned: Vec<Luma> = aligned.collect();
                let noise_part = MEDIAN_STD_OVER_MEAN_STD / (survey.len() as f64).sqrt();
                let registrar = Registrar::of_mean(
                    &median_of(&aligned.iter().collect::<Vec<_>>()),
                    noise_grey,
                    noise_part.min(1.0),
                );
                if turns { registrar.turning() } else { registrar }
            };
            let each = survey.par_iter().zip(followed);
            each.for_each(|(frame, r)| *r = registrar.follow(frame, r));
            registrar
        };
        let mut registrar = scene(&mut registrations);
        if !fixed {
            // By a reference that has the noise of one frame a faint scene is not well aligned, and smeared; what follows it is sharper.
            registrar = scene(&mut registrations);
        }
        let luma = Arc::clone(registrar.reference());
        let shift_std_px = if fixed {
            0.0
        } else {
            let by_halves = registrar.shift_std_px(survey, &registrations);
            let stds_px = [by_halves, registrar.expected_std_px()];
            // Where both are infinite its motion is not seen.
            stds_px
                .into_iter()
                .find(|std_px| std_px.is_finite())
                .unwrap_or(0.0)
        };
        let unseen_motions = if fixed {
            Vec::new()
        } else {
            UnseenMotion::each(&registrar, survey, &registrations)
        };
        let shown_motion = registrar.clone().holding_unseen().shown_motion();
        let block_px = block_side_px(luma.width, luma.height);
        let blocks = (luma.width / block_px, luma.height / block_px);
        let block_sums = sum_blocks(&luma, block_px);
        let noise_grey = pixel_noise_grey(&luma, survey, &registrations);
        let scene_grey = if !fixed {
            // A hand also turns the camera: edges far from the middle do not quite meet, and a mean would smear them.
            SceneGrey::Whole(Arc::clone(&luma))
        } else if has_room_for_several((luma.width, luma.height)) {
            SceneGrey::Exact(uncovered_mean(&luma, survey, &registrations, noise_grey))
        } else {
            SceneGrey::Fine(uncovered_mean(&luma, survey, &registrations, noise_grey))
        };
        let mut background = Self {
            noise_grey,
            edges: fixed.then(|| {
                let edges = scene_grey.edges(luma.width, noise_grey);
                edges.with_rest_shift_of(survey, &registrations)
            }),
            scene_grey,
            luma,
            block_px,
            blocks,
            block_sums,
            block_threshold_grey: Vec::new(),
            registrar,
            first_registration: registrations.first().copied()?,
            shift_std_px,
            shown_motion,
            unseen_motions,
            survey_registrations: Vec::new(),
        };
        background.block_threshold_grey = background.thresholds(survey, &registrations);
        background.survey_registrations = registrations;
        Some(background)
    }

    /// How far the camera drifts over the survey's frames, px.
    #[must_use]
    pub fn drift_px(&self) -> f64 {
        drift_px(&self.survey_registrations)
    }

    /// The same in which less than `least_grey` of a change is none.
    #[must_use]
    pub fn with_least_change(mut self, least_grey: f64) -> Self {
        for threshold in &mut self.block_threshold_grey {
            *threshold = threshold.max(least_grey as f32);
        }
        self
    }

    /// How the blocks of a frame, of which these are the `sums` (see [`sum_blocks`]), differ from the background shifted and
    /// lit as `registration` says.
    #[must_use]
    pub fn block_changes<'a>(&'a self, sums: &'a [u16], registration: &Registration) -> BlockChanges<'a> {
        let scene = if registration.is_still() {
            Cow::Borrowed(self.block_sums.as_slice())
        } else {
            Cow::Owned(sum_blocks(&registration.seen(&self.luma), self.block_px))
        };
        BlockChanges {
            sums,
            scene,
            gain: registration.gain as f32,
            offset_grey: registration.offset_grey as f32,
            a_pixel: 1.0 / (self.block_px * self.block_px) as f32,
        }
    }

    fn thresholds(&self, survey: &[&Luma], registrations: &[Registration]) -> Vec<f32> {
        let changes: Vec<Vec<f32>> = survey
            .par_iter()
            .zip(registrations)
            .map(|(f, r)| {
                self.block_changes(&sum_blocks(f, self.block_px), r)
                    .grey()
                    .collect()
            })
            .collect();
        let own = |column: &mut Vec<f32>, block: usize| {
            column.clear();
            column.extend(changes.iter().map(|frame| frame[block].abs()));
            STD_OF_MEDIAN as f32 * lower_median(column)
        };
        let blocks = (0..self.block_sums.len()).into_par_iter();
        let local: Vec<f32> = blocks.map_init(Vec::new, own).collect();
        let mut sorted = local.clone();
        let typical = lower_median(&mut sorted).max(tail_sigma(&changes) as f32);
        // A block's own scatter counts where it is larger (a flickering screen, leaves); the typical one elsewhere,
        // since a median of a dozen values is itself uncertain.
        local
            .iter()
            .map(|&s| {
                let sigma = f64::from(s.max(typical)).hypot(ROUNDING_STD_GREY / self.block_px as f64);
                (BLOCK_SIGMAS * sigma).max(LEAST_CHANGE_GREY) as f32
            })
            .collect()
    }
}

/// Block means of a frame against those of the background.
#[derive(Debug, Clone)]
pub struct BlockChanges<'a> {
    sums: &'a [u16],
    scene: Cow<'a, [u16]>,
    gain: f32,
    offset_grey: f32,
    a_pixel: f32,
}

impl BlockChanges<'_> {
    /// The change of every block, grey levels, row by row.
    pub fn grey(&self) -> impl Iterator<Item = f32> {
        let blocks = self.sums.iter().zip(&*self.scene);
        blocks.map(|(&now, &scene)| self.of(now, scene))
    }

    /// The change of one block, grey levels.
    #[must_use]
    pub fn grey_of(&self, block: usize) -> f32 {
        self.of(self.sums[block], self.scene[block])
    }

    fn of(&self, now: u16, scene: u16) -> f32 {
        (f32::from(now) - self.gain * f32::from(scene)) * self.a_pixel - self.offset_grey
    }
}

/// Where the frames of a survey with this median look, and whether the camera stands still.
fn camera_shifts(first: &Registrar, survey: &[&Luma], median: &Luma) -> (Vec<Registration>, bool) {
    let found = first.locate(survey);
    // A floor's edge, say, shows nothing along it.
    let first = first.clone().holding_unseen();
    let located = if first.held().is_some() {
        &first.locate(survey)
    } else {
        &found
    };
    let by_gradients = || by_gradients(&first, survey, located);
    let by_gradients = first.sees_shift().then(by_gradients).flatten();
    let in_all_directions = first.expected_std_px().is_finite();
    let (in_all, across_one) = if in_all_directions {
        (by_gradients, None)
    } else {
        (None, by_gradients)
    };
    // Where no place of a frame shows a shift, or a codec holds those that would, all of it together may.
    let scene = LazyCell::new(|| FaintScene::new(survey, median));
    let by_places = |moved: &Vec<Registration>| scene.as_ref().is_some_and(|s| s.moves_everywhere(moved));
    let as_one = |moved: &Vec<Registration>| {
        drift_px(moved) >= still_px(first.parts_differ_px(survey, moved)) || by_places(moved)
    };
    let moves = |shifts: &CorrelatedShifts| drift_px(&shifts.registrations) >= still_px(shifts.std_px);
    let by_whole = || {
        let shifts = scene.as_ref().and_then(FaintScene::shifts).filter(moves)?;
        Some(shifts.registrations).filter(by_places)
    };
    match in_all.filter(as_one).or_else(by_whole).or(across_one) {
        Some(moved) => (moved, false),
        None => (found, true),
    }
}

/// Where the frames look, with how they turn, that by shifts alone look as `shifted` says; `None` where they do not turn. The parts of the scene have
/// to agree better with the turn than without. Of a camera that moves (`fixed` is not said of it) the turns have to be clear of what two halves of the
/// scene differ by, which is little where frames are found at all; of one that seems to stand, all of its motion has to be so, and to be that of the scene
/// as one, and of its edges alone.
fn camera_turns(
    first: &Registrar,
    survey: &[&Luma],
    shifted: &[Registration],
    fixed: bool,
) -> Option<Vec<Registration>> {
    if !first.sees_shift() {
        return None;
    }
    let turning = first.clone().holding_unseen().turning();
    let turned = if fixed {
        let frames: Vec<&Luma> = survey.iter().copied().step_by(QUICK_LOOK).collect();
        let known: Vec<Registration> = shifted.iter().copied().step_by(QUICK_LOOK).collect();
        if drift_px(&turning.thinned(QUICK_LOOK).locate_near(&frames, &known)) < 0.5 * FIXED_CAMERA_PX {
            return None;
        }
        turning.locate(survey)
    } else {
        turning.locate_near(survey, shifted)
    };
    let halves_agree_on = |drift_px: f64| {
        let std_px = turning.shift_std_px(survey, &turned);
        std_px < FIXED_CAMERA_PX && drift_px >= DRIFT_SIGMAS * std_px
    };
    let parts_differ_px = || turning.parts_differ_px(survey, &turned);
    let agrees_better = |differ_px: f64| differ_px < AGREE_BETTER * turning.parts_differ_px(survey, shifted);
    let turns = if fixed {
        let drift = drift_px(&turned);
        let moves_as_one = || {
            let differ_px = parts_differ_px();
            agrees_better(differ_px) && drift >= still_px(differ_px)
        };
        drift >= FIXED_CAMERA_PX
            && halves_agree_on(drift)
            && moves_as_one()
            && drift_px(&turning.by_edges(survey, &turned)) >= FIXED_CAMERA_PX
    } else {
        let turns: Vec<Registration> = turned.iter().map(Registration::unshifted).collect();
        halves_agree_on(drift_px(&turns)) && agrees_better(parts_differ_px())
    };
    turns.then_some(turned)
}

/// Where the frames look, by what `first` found of them; `None` where the camera stands still.
fn by_gradients(first: &Registrar, survey: &[&Luma], found: &[Registration]) -> Option<Vec<Registration>> {
    let drift = drift_px(found);
    if drift < FIXED_CAMERA_PX {
        return None;
    }
    let by_halves = first.shift_std_px(survey, found);
    let still_px = still_px(by_halves.min(CLEAR_OF_SCATTER * scatter_px(found)));
    if drift < still_px {
        return None;
    }
    // A soft shadow or a lamp may pass for a shift; it moves no edges.
    let by_edges = first.by_edges(survey, found);
    if drift_px(&by_edges) < still_px {
        return None;
    }
    let each = found.iter().zip(by_edges);
    let choose = |(r, edges): (&Registration, Registration)| {
        let (du, dv) = (edges.shift_u_px - r.shift_u_px, edges.shift_v_px - r.shift_v_px);
        if du.hypot(dv) > REFUTED_PX { edges } else { *r }
    };
    Some(each.map(choose).collect())
}

/// A drift below this is none, px, where shifts have this standard uncertainty.
fn still_px(shift_std_px: f64) -> f64 {
    FIXED_CAMERA_PX.max(DRIFT_SIGMAS * shift_std_px)
}

/// How far the camera drifts, px: the largest distance of a motion from the median one, swings left out, after which the camera
/// looks where it did. (Distances from the reference frame would all have the error of that one frame: a codec that draws a
/// faint scene differently in each key frame moves it by half a pixel.)
fn drift_px(registrations: &[Registration]) -> f64 {
    let median = |k: usize| {
        let mut motions: Vec<f64> = registrations.iter().map(|r| r.motion_px()[k]).collect();
        median(&mut motions).unwrap_or(0.0)
    };
    let middle: Vector3<f64> = Vector3::from_fn(|k, _| median(k));
    let off = |r: &Registration| (r.motion_px() - middle).norm();
    let all: Vec<f64> = registrations.iter().map(off).collect();
    // A swing dies away: a camera that looks elsewhere at the beginning, at the end or often, drifts.
    let rests = |o: &f64| *o < FIXED_CAMERA_PX;
    let elsewhere = all.iter().filter(|o| !rests(o)).count();
    let (Some(first), Some(last)) = (all.iter().position(rests), all.iter().rposition(rests)) else {
        return all.iter().copied().fold(0.0, f64::max);
    };
    let at_ends = first > 1 || all.len() - last > 2;
    if at_ends || elsewhere as f64 > MOST_SWINGING * all.len() as f64 {
        all.iter().copied().fold(0.0, f64::max)
    } else {
        all.iter().copied().filter(rests).fold(0.0, f64::max)
    }
}

/// What the shifts of successive frames scatter by, px: their second differences, which a steady pan has none of, over √6. Infinite for fewer
/// than four.
fn scatter_px(registrations: &[Registration]) -> f64 {
    let second = |w: &[Registration], of: fn(&Registration) -> f64| of(&w[2]) - 2.0 * of(&w[1]) + of(&w[0]);
    let mut off: Vec<f64> = registrations
        .windows(3)
        .map(|w| second(w, |r| r.shift_u_px).hypot(second(w, |r| r.shift_v_px)))
        .collect();
    let enough = off.len() >= 2;
    let typical = median(&mut off).filter(|_| enough);
    typical.map_or(f64::INFINITY, |m| m / 6.0_f64.sqrt())
}

/// Part of the survey's frames in which a camera that stands still may swing.
const MOST_SWINGING: f64 = 0.35;

/// Standard deviation by the tail of all block changes. A codec at a low rate leaves patches that are off by a few
/// grey levels for many frames: rare in any one block, but many in all. Capped, since what moves is in the tail, too.
fn tail_sigma(changes: &[Vec<f32>]) -> f64 {
    /// 5 of these are 6 grey levels: no codec that is worth measuring on is worse.
    const MOST_GREY: f64 = 1.2;
    /// A normal variable stays within 1.645 standard deviations nine times in ten.
    const NINE_TENTHS: f64 = 1.645;
    let mut all: Vec<f32> = changes.iter().flatten().step_by(7).map(|c| c.abs()).collect();
    if all.is_empty() {
        return 0.0;
    }
    let index = all.len() * 9 / 10;
    let tail = f64::from(*all.select_nth_unstable_by(index, f32::total_cmp).1);
    (tail / NINE_TENTHS).min(MOST_GREY)
}

/// Sums of `luma` over blocks of `side` × `side` pixels (see [`block_side_px`]), row by row; rows and columns that do not
/// fill a block are left out.
#[must_use]
pub fn sum_blocks(luma: &Luma, side: usize) -> Vec<u16> {
    let (columns, rows) = (luma.width / side, luma.height / side);
    let mut sums = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        let line = |v: usize| &luma.row(row * side + v)[..columns * side];
        match side {
            4 => {
                let [a, b, c, d] = [0, 1, 2, 3].map(|v| line(v).as_chunks::<4>().0);
                let blocks = a.iter().zip(b).zip(c).zip(d);
                sums.extend(
                    blocks.map(|(((a, b), c), d)| sum_of_lanes([a, b, c, d].map(|p| u32::from_le_bytes(*p)))),
                );
            }
            2 => {
                let [a, b] = [0, 1].map(|v| line(v).as_chunks::<2>().0);
                let pair = |bytes: &[u8; 2]| u16::from_le_bytes(*bytes);
                // As above, of a lane for each pair.
                let sum = |pair: u16| (pair & 0xff) + (pair >> 8);
                sums.extend(a.iter().zip(b).map(|(a, b)| sum(pair(a)) + sum(pair(b))));
            }
            _ => sums.extend((0..columns).map(|u| {
                let pixels = (0..side).flat_map(|v| &line(v)[u * side..(u + 1) * side]);
                pixels.map(|&p| u16::from(p)).sum::<u16>()
            })),
        }
    }
    sums
}

/// The sum of sixteen bytes, two lanes of 16 bits at a time: the compiler takes four blocks at once.
fn sum_of_lanes(rows: [u32; 4]) -> u16 {
    let pairs = rows.map(|r| (r & 0x00ff_00ff) + (r >> 8 & 0x00ff_00ff));
    let lanes: u32 = pairs.iter().sum();
    ((lanes & 0xffff) + (lanes >> 16)) as u16
}

/// Robust standard deviation of one pixel about the background: 1.4826 × median absolute difference, corrected for
/// the median's own share and for rounding.
fn pixel_noise_grey(background: &Luma, survey: &[&Luma], registrations: &[Registration]) -> f64 {
    let mut histogram = [0_u64; 256];
    let step = (background.data.len() / 40_000).max(1);
    for (frame, r) in survey.iter().zip(registrations) {
        let seen = if r.is_still() {
            Cow::Borrowed(background)
        } else {
            Cow::Owned(r.seen(background))
        };
        for i in (0..frame.data.len()).step_by(step) {
            let expected = (r.gain * f64::from(seen.data[i]) + r.offset_grey).round();
            let change = (f64::from(frame.data[i]) - expected).abs();
            histogram[(change as usize).min(255)] += 1;
        }
    }
    let share = if survey.len() > 2 {
        1.0 - 1.0 / survey.len() as f64
    } else {
        1.0
    };
    (STD_OF_MEDIAN * interpolated_median(&histogram) / share.sqrt()).max(ROUNDING_STD_GREY)
}

/// Per-pixel median of frames of one size, of which there is at least one; the lower of two for an even number.
#[must_use]
pub fn median_of(frames: &[&Luma]) -> Luma {
    let (width, height) = (frames[0].width, frames[0].height);
    let n = frames.len();
    let network = sorting_network(n);
    let middle = (n - 1) / 2;
    let mut data = vec![0; width * height];
    let lines = data.par_chunks_mut(width.max(1)).enumerate();
    lines.for_each_init(
        || vec![vec![0; width]; n],
        |rows: &mut Vec<Vec<u8>>, (v, line)| {
            for (row, frame) in rows.iter_mut().zip(frames) {
                row.copy_from_slice(frame.row(v));
            }
            for &(low, high) in &network {
                let (head, tail) = rows.split_at_mut(high);
                for (a, b) in head[low].iter_mut().zip(tail[0].iter_mut()) {
                    let (x, y) = (*a, *b);
                    *a = x.min(y);
                    *b = x.max(y);
                }
            }
            line.copy_from_slice(&rows[middle]);
        },
    );
    Luma { width, height, data }
}

/// Per-pixel mean of `frames`, in the light and at the place of their `median`, without those that differ from it by more
/// than noise: in them a thing covers the pixel.
fn uncovered_mean<T: Copy + Default + Send + From<f32>>(
    median: &Luma,
    frames: &[&Luma],
    registrations: &[Registration],
    noise_grey: f64,
) -> Vec<T> {
    /// Where half of the frames are covered, the median is the outermost of the others: 1.5 standard deviations of the
    /// noise from their mean, whose other side must still be within reach.
    const REACH_SIGMAS: f64 = 4.0;
    let reach = (REACH_SIGMAS * noise_grey) as f32;
    let width = median.width;
    let mut scene = vec![T::default(); median.data.len()];
    let rows = scene.par_chunks_mut(width.max(1)).enumerate();
    rows.for_each(|(v, row)| {
        let (mut sums, mut counts) = (vec![0.0_f32; width], vec![0.0_f32; width]);
        for (frame, r) in frames.iter().zip(registrations) {
            let (scale, offset) = ((1.0 / r.gain) as f32, r.offset_grey as f32);
            let pixels = frame.row(v).iter().zip(median.row(v));
            for ((&p, &m), (sum, count)) in pixels.zip(sums.iter_mut().zip(&mut counts)) {
                let change = (f32::from(p) - offset) * scale - f32::from(m);
                let shows = if change.abs() <= reach { 1.0 } else { 0.0 };
                *sum += shows * change;
                *count += shows;
            }
        }
        let means = sums.iter().zip(counts).map(|(sum, count)| sum / count.max(1.0));
        for ((grey, change), &m) in row.iter_mut().zip(means).zip(median.row(v)) {
            *grey = T::from(f32::from(m) + change);
        }
    });
    scene
}

/// Batcher's odd-even merge sort for any `n`: pairs (low, high) to compare and swap, in order.
/// Source: Knuth, The Art of Computer Programming 3, 5.2.2, algorithm M.
fn sorting_network(n: usize) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let mut p = 1;
    while p < n {
        let mut k = p;
        while k >= 1 {
            let mut j = k % p;
            while j + k < n {
                for i in 0..k.min(n - j - k) {
                    if (i + j) / (p * 2) == (i + j + k) / (p * 2) {
                        pairs.push((i + j, i + j + k));
                    }
                }
                j += 2 * k;
            }
            k /= 2;
        }
        p *= 2;
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::registration::middle_of;

    #[test]
    fn the_network_sorts_every_small_input_of_zeros_and_ones() {
        // The 0-1 principle: a network that sorts all 0-1 inputs sorts everything.
        for n in 1..=13_usize {
            let network = sorting_network(n);
            for bits in 0..1_u32 << n {
                let mut values: Vec<u32> = (0..n).map(|i| bits >> i & 1).collect();
                for &(a, b) in &network {
                    if values[a] > values[b] {
                        values.swap(a, b);
                    }
                }
                assert!(values.is_sorted(), "n {n}, bits {bits:b}");
            }
        }
    }

    #[test]
    fn the_error_of_the_reference_is_not_the_camera_s_motion() {
        let shifted = |&(shift_u_px, shift_v_px): &(f64, f64)| Registration {
            shift_u_px,
            shift_v_px,
            ..Registration::IDENTITY
        };
        // Key frames of a fixed camera before a faint texture, coded at a low rate; the eighth is the reference.
        let seen = [
            (0.52, 0.28),
            (0.55, 0.25),
            (0.51, 0.16),
            (0.38, 0.10),
            (0.41, 0.22),
            (0.44, 0.06),
            (0.30, 0.45),
            (0.0, 0.0),
            (0.71, 0.25),
            (0.42, 0.22),
            (0.25, 0.38),
            (0.72, 0.32),
            (0.64, 0.44),
            (0.55, 0.25),
            (0.52, 0.03),
        ];
        let registrations: Vec<Registration> = seen.iter().map(shifted).collect();
        let farthest = registrations
            .iter()
            .map(Registration::shift_px)
            .fold(0.0, f64::max);
        assert!(farthest > 0.75);
        assert!(drift_px(&registrations) < 0.6);
        // A camera that was pushed once.
        let pushed: Vec<Registration> = (0..15)
            .map(|i| shifted(&(if i < 7 { 0.0 } else { 3.0 }, 0.0)))
            .collect();
        assert!((drift_px(&pushed) - 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_thing_that_covers_a_pixel_in_few_frames_is_not_background() {
        let frame = |x: usize| {
            Luma::from_fn(64, 48, |u, v| {
                if (10..20).contains(&v) && (x..x + 8).contains(&u) {
                    200
                } else {
                    50
                }
            })
        };
        let survey: Vec<Luma> = (0..9).map(|i| frame(i * 6)).collect();
        let background = Background::from_survey(&survey.iter().collect::<Vec<_>>()).unwrap();
        assert!(background.luma.data.iter().all(|&p| p == 50));
        assert!(background.registrar.fixed);
    }

    #[test]
    fn a_thing_that_lingers_pulls_the_median_but_not_the_scene() {
        const SIZE: (usize, usize) = (64, 48);
        // Noise of standard deviation 2.2 grey levels; a light thing covers 16 by 16 px in 7 of 15 frames.
        let reached = |u: usize, v: usize| u < 16 && v < 16;
        // Its own stream is kept: the gain of the light is fitted some 0.3 % too low here, and with others the mean is 0.13 off.
        let mut seed = 7_u32;
        let mut throw = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 30) as u8
        };
        let mut frame = |i: usize| {
            Luma::from_fn(SIZE.0, SIZE.1, |u, v| {
                let noise: u8 = (0..4).map(|_| throw()).sum();
                if i % 2 == 1 && reached(u, v) {
                    200
                } else {
                    50 + noise
                }
            })
        };
        let survey: Vec<Luma> = (0..15).map(&mut frame).collect();
        let background = Background::from_survey(&survey.iter().collect::<Vec<_>>()).unwrap();
        let mean = |grey: &dyn Fn(usize) -> f64, covered: bool| {
            let chosen: Vec<f64> = (0..SIZE.0 * SIZE.1)
                .filter(|&k| reached(k % SIZE.0, k / SIZE.0) == covered)
                .map(grey)
                .collect();
            chosen.iter().sum::<f64>() / chosen.len() as f64
        };
        let SceneGrey::Exact(scene_grey) = &background.scene_grey else {
            panic!("a small picture's scene is exact");
        };
        let scene = |k: usize| f64::from(scene_grey[k]);
        let median = |k: usize| f64::from(background.luma.data[k]);
        // Four throws of 0 to 3 have the mean 6.
        assert!((mean(&scene, false) - 56.0).abs() < 0.1);
        assert!((mean(&scene, true) - 56.0).abs() < 0.3, "{}", mean(&scene, true));
        assert!(mean(&median, true) > 58.0, "{}", mean(&median, true));
    }

    /// What a wall's texture is at a place, of standard deviation 2.4.
    fn waves(u: f64, v: f64) -> f64 {
        let wave = |k: f64| {
            let (number, (sin, cos)) = (0.03 + 0.05 * k, (2.4 * k).sin_cos());
            (number * (u * cos + v * sin) + k * k).sin()
        };
        (1..=12).map(|k| wave(f64::from(k))).sum()
    }

    /// A wall with texture of `texture_grey` in noise of 2, over which a soft shadow of half-width `width` moves that takes `depth`.
    fn shaded(
        texture_grey: f64,
        depth: f64,
        width: f64,
        step_px: f64,
        shift_px: impl Fn(usize) -> usize,
    ) -> Vec<Luma> {
        const FRAMES: usize = 15;
        const SIZE: (usize, usize) = (480, 360);
        let mut random = crate::test_noise::TestNoise(11);
        let spare = (0..FRAMES).map(&shift_px).max().unwrap();
        let columns = || (0..SIZE.0 + spare).map(|u| u as f64 - spare as f64);
        let wall: Vec<f64> = (0..SIZE.1)
            .flat_map(|v| columns().map(move |u| waves(u, v as f64)))
            .collect();
        (0..FRAMES)
            .map(|i| {
                let (middle, left) = (60.0 + step_px * i as f64, spare - shift_px(i));
                Luma::from_fn(SIZE.0, SIZE.1, |u, v| {
                    let waves = wall[v * (SIZE.0 + spare) + left + u];
                    let (u, v) = (u as f64, v as f64);
                    let away = ((u - middle) * 0.9 + (v - 180.0) * 0.4) / width;
                    let light = 1.0 - depth * (-0.5 * away * away).exp();
                    let grey = light * (90.0 + texture_grey * waves / 2.4) + 2.0 * random.normal();
                    grey.round().clamp(0.0, 255.0) as u8
                })
            })
            .collect()
    }

    #[test]
    fn soft_shadows_move_no_camera() {
        for texture_grey in [3.0, 6.0, 25.0] {
            for (depth, width, step_px) in [
                (0.3, 60.0, 25.0),
                (0.6, 90.0, 25.0),
                (0.5, 150.0, 40.0),
                (0.7, 60.0, 8.0),
            ] {
                let survey = shaded(texture_grey, depth, width, step_px, |_| 0);
                let background = Background::from_survey(&survey.iter().collect::<Vec<_>>()).unwrap();
                assert!(
                    background.registrar.fixed,
                    "{texture_grey} {depth} {width} {step_px}"
                );
            }
            // A camera that drifts by 14 px, with and without one.
            for depth in [0.0, 0.4] {
                let survey = shaded(texture_grey, depth, 90.0, 25.0, |i| i);
                let background = Background::from_survey(&survey.iter().collect::<Vec<_>>()).unwrap();
                assert!(!background.registrar.fixed, "{texture_grey} {depth}: drifts");
            }
        }
    }

    /// The `wall` as a camera sees it that turns steadily by `turn_rad` in all, in noise.
    fn turning(wall: &Luma, turn_rad: f64) -> Vec<Luma> {
        let mut random = crate::test_noise::TestNoise(12);
        (0..15)
            .map(|i| {
                let registration = Registration {
                    middle: middle_of(wall),
                    turn_rad: turn_rad * f64::from(i) / 14.0,
                    ..Registration::IDENTITY
                };
                let mut seen = registration.seen(wall);
                for p in &mut seen.data {
                    let grey = f64::from(*p) + 2.0 * random.normal();
                    *p = grey.round().clamp(0.0, 255.0) as u8;
                }
                seen
            })
            .collect()
    }

    #[test]
    fn a_camera_that_turns_is_followed_from_the_first_frame_on() {
        let of = |turn_rad: f64| {
            let wall = Luma::from_fn(480, 360, |u, v| {
                (90.0 + 5.0 * waves(u as f64, v as f64)).round().clamp(0.0, 255.0) as u8
            });
            let survey = turning(&wall, turn_rad);
            Background::from_survey(&survey.iter().collect::<Vec<_>>()).unwrap()
        };
        for turn_rad in [0.006, -0.02] {
            let background = of(turn_rad);
            assert!(!background.registrar.fixed, "{turn_rad}");
            let registrations = &background.survey_registrations;
            for (i, r) in registrations.iter().enumerate() {
                let truth = turn_rad * i as f64 / 14.0;
                assert!((r.turn_rad - truth).abs() < 2e-4, "{i}: {r:?}, not {truth}");
            }
        }
        assert!(of(0.0).registrar.fixed);
    }

    /// As a codec at a low rate draws a faint texture anew: each part of it elsewhere from one moment on.
    #[test]
    fn parts_that_are_drawn_elsewhere_each_by_itself_move_no_camera() {
        const PART_PX: usize = 120;
        let drawn = |seed: u64, alike: bool| -> Vec<Luma> {
            let mut random = crate::test_noise::TestNoise(seed);
            let shifts = [(); 4 * 3].map(|()| [(); 2].map(|()| random.between(-3.0, 3.0)));
            let [before, after] = [0.0, 1.0].map(|moved| -> Vec<f64> {
                let places = (0..360).flat_map(|v| (0..480).map(move |u| (u, v)));
                let grey = |(u, v): (usize, usize)| {
                    let part = if alike { 0 } else { v / PART_PX * 4 + u / PART_PX };
                    let [du, dv] = shifts[part];
                    90.0 + 3.0 * waves(u as f64 - moved * du, v as f64 - moved * dv)
                };
                places.map(grey).collect()
            });
            let frame = |i: usize| {
                let wall = if i < 7 { &before } else { &after };
                Luma::from_fn(480, 360, |u, v| {
                    (wall[v * 480 + u] + random.normal()).round() as u8
                })
            };
            (0..15).map(frame).collect()
        };
        for seed in 1..=3 {
            let moved = |alike: bool| {
                let survey = drawn(seed, alike);
                let survey: Vec<&Luma> = survey.iter().collect();
                let first = Registrar::at_full_size(survey[7], 1.0).holding_unseen();
                let seems = by_gradients(&first, &survey, &first.locate(&survey)).is_some();
                let moves = !Background::from_survey(&survey).unwrap().registrar.fixed;
                (seems, moves)
            };
            assert_eq!(moved(true), (true, true), "{seed}");
            // The gradients alone would follow what most of them do.
            assert_eq!(moved(false), (true, false), "{seed}");
        }
    }

    #[test]
    fn block_sums_are_sums() {
        let luma = Luma::from_fn(10, 6, |u, v| (v * 10 + u) as u8);
        let sums = sum_blocks(&luma, 4);
        assert_eq!(sums.len(), 2);
        let expected: u16 = (0..4).flat_map(|v| (0..4).map(move |u| v * 10 + u)).sum();
        assert_eq!(sums[0], expected);
    }
}
