//! When each frame was taken. Clocks compete by one likelihood ([`crate::flight::clock`]), each with a price for its free numbers:
//!
//! | clock | its free numbers |
//! |---|---|
//! | the stamps, or the calibration's rate, as they are | none |
//! | an even clock that the stamps jitter about | none, but a margin |
//! | frames that show the one before left out, the others as stamped | which |
//! | frames chosen from pictures of another rate ([`EvenStamps::resampled`]): repeats or gaps that come regularly | ratio, phase |
//! | the first and the likeliest of the others, each with frames missing in single places | where, how many |
//! | the stamps, with frames between two others (B frames) drawn late or early by a codec | by how much, for each place in a row of them |
//!
//! The last is asked where another beats the stamps: what a coarse codec draws in B frames is short of the ball's way by a part that comes back every third frame,
//! as that of pictures chosen from another rate does. Where it is the likeliest the stamps stand.
//! Where the first leaves no room for a better one other rates are not tried, and gaps only where a step shows one. Assumed: one clock for the whole recording. A piece that is
//! cut out at an impact shows in its arcs alone, after they are fitted ([`Clocked::with_frames_missing_at_impacts`]).
//!
//! First centres may stand still and leap where a codec draws a ball that hardly moves, and a leap looks like a gap. So where the stamps do not stand they,
//! the likeliest clock and each of its gaps compete once more by the best centres, when those are found ([`Clocked::by_best_centres`]).

use super::camera::CalibratedCamera;
use super::decode::Decoded;
use super::measurement::Warning;
use super::spots::{BallCentre, first_spots};
use super::warnings::of_clock;
use crate::calibration::Optics;
use crate::flight::clock::{Explained, FrameTimes, MovingTracks};
use crate::flight::dropped_frames::DroppedFrames;
use crate::flight::flight_search::FlightSearch;
use crate::flight::linking::{LinkedSpots, Spot};
use crate::flight::{self, Flight, dropped_frames};
use crate::frames::Coded;
use crate::frames::timebase::{EvenStamps, Resampling, TimeBase};
use rayon::prelude::*;

/// The recording with its clock.
#[derive(Debug, Clone)]
pub struct Clocked {
    /// Times of all frames.
    pub base: TimeBase,
    /// Frames that show the one before once more.
    pub duplicates: Vec<bool>,
    /// What is odd about the clock.
    pub warnings: Vec<Warning>,
    /// Those that stood against each other; none where the stamps stand.
    rivals: Vec<GappedClock>,
}

/// The clock of `decoded`, whose things have the `centres`: the likeliest of those that are tried.
pub fn clocked(
    camera: &CalibratedCamera<'_>,
    decoded: &Decoded,
    centres: &[BallCentre],
    optics: Option<Optics>,
) -> Clocked {
    let (stamps_s, rate_hz) = (&decoded.stamps_s[..], camera.calibration.frame_rate_hz);
    let none = vec![false; stamps_s.len()];
    let as_stamped = TimeBase::new(stamps_s, &[], rate_hz);
    let frames = FrameTimes {
        times_s: &as_stamped.times_s,
        duplicates: &none,
    };
    // Linked once, whatever the clock: all compete by the same tracks.
    let linked = LinkedSpots::new(first_spots(camera, centres, frames, optics));
    let model = camera.motion_model(None, None);
    let mut trials = ClockTrials::new(&linked, (stamps_s, rate_hz), frames, &*model);
    let mut rivals = Vec::new();
    let repeats = flight::duplicate_frames::find(&linked, &decoded.changes, camera.units_per_px()).frames;
    if repeats.contains(&true) {
        let base = TimeBase::new(stamps_s, &repeats, rate_hz);
        let price = trials.price_of_places(&repeats);
        // They stand for frames that were lost, or were put in beside the others.
        rivals.push(ClockTrial {
            base: base.clone().with_put_in(&repeats),
            repeats: repeats.clone(),
            price: price + PRICE_OF_PUT_IN,
        });
        rivals.push(ClockTrial { base, repeats, price });
    }
    // What jitters by less than this nobody sees.
    let even = TimeBase::even(stamps_s).filter(|(base, jitter_s)| {
        rate_hz.is_none() && *jitter_s > LEAST_JITTER * base.interval_s.unwrap_or(0.0)
    });
    let even_times = even
        .as_ref()
        .map(|(base, jitter_s)| (base.times_s.clone(), *jitter_s));
    if let Some((base, _)) = even {
        rivals.push(ClockTrial {
            base,
            repeats: none.clone(),
            price: MARGIN,
        });
    }
    let as_stamped = trials.stamped(as_stamped);
    let leaves_room = trials.explained(&as_stamped).room > WORTH_TRYING;
    if leaves_room || !trials.falling.contains(&true) {
        rivals.extend(trials.resampled());
    }
    for rival in &rivals {
        trials.ask_what_falls_under(rival.frames(), &*model);
    }
    let stamped = trials.tried(as_stamped);
    let likelier = rivals
        .into_iter()
        .map(|rival| trials.tried(rival))
        .filter(|rival| rival.score() > stamped.score())
        .max_by(|a, b| a.score().total_cmp(&b.score()));
    // A gap in a single place looks like frames chosen from another rate, whose other gaps fall where nothing tells: each has its gaps before they
    // are compared.
    let mut best = trials.with_single_gaps(stamped, &linked.spots);
    let mut rivals = vec![best.gapped.clone()];
    let mut jittered = None;
    if let Some(rival) = likelier {
        let even = even_times.filter(|(times_s, _)| *times_s == rival.clock.base.times_s);
        let rival = trials.with_single_gaps(trials.numbered_anew(rival, camera), &linked.spots);
        if rival.score() > best.score() {
            rivals.push(rival.gapped.clone());
            (best, jittered) = (rival, even);
        }
    }
    let other = best.is_another();
    if let Some(late) = other.then(|| trials.drawn_late(&linked.spots)).flatten() {
        let late = trials.with_single_gaps(trials.tried(late), &linked.spots);
        if late.score() + MARGIN > best.score() {
            let stamps = GappedClock {
                clock: trials.stamped(TimeBase::new(stamps_s, &[], rate_hz)),
                gaps: late.gapped.gaps,
            };
            best = trials.tried_with_gaps(stamps, |_| true);
            // The others were likelier only as no frame was late.
            rivals = vec![best.gapped.clone()];
            jittered = None;
        }
    }
    if !best.is_another() {
        rivals.clear();
    }
    let mut clocked = Clocked::new(best.clock.base, best.clock.repeats, camera, decoded);
    clocked.rivals = rivals;
    clocked
        .warnings
        .extend(jittered.map(|(_, jitter_s)| of_clock::jitter(&clocked.base, jitter_s)));
    clocked
}

/// Stamps that stand within this part of a step of an even clock are taken as they are.
const LEAST_JITTER: f64 = 0.05;

/// A clock with this much room, in squared standard deviations, may have a better one: a jump between two arcs leaves more. (What the arcs
/// themselves cost, of which a better clock has fewer, is not in it.)
const WORTH_TRYING: f64 = 30.0;

/// What a clock must gain beyond the price of its numbers: first centres scatter more than they say here and there, and a false
/// clock costs more than a missed one in a recording that is plain.
const MARGIN: f64 = 12.0;

/// That of one choice of two, which of the two repeats are.
const PRICE_OF_PUT_IN: f64 = 2.0 * std::f64::consts::LN_2;

/// The same for a gap in a single place, where the path must break just so.
const GAP_MARGIN: f64 = 4.0;

/// Ratios of two whole numbers up to this are tried: 24 Hz in a file of 25 Hz is one.
const MOST_PATTERN: u32 = 25;

/// Frames may be chosen from pictures at up to so many times their rate, or stored so many times each.
const MOST_RATIO: f64 = 2.0;
const MOST_TIMES: u32 = 5;

/// Resampled clocks that are tried in earnest.
const MOST_TRIED: usize = 3;

/// Gaps in single places, at most.
const MOST_GAPS: usize = 24;

/// A frame stored in another place is not further from it than this.
const MOST_MISPLACED: usize = 30;

/// Places in a row of B frames that are told apart; those behind are as the last.
const MOST_PLACES: usize = 3;

/// A B frame is not later or earlier than this part of an interval, in so many steps to each side, and rounds over all places.
const MOST_LATE: f64 = 0.45;
const LATE_STEPS: i32 = 9;
const LATE_ROUNDS: usize = 3;

/// What clocks are tried on.
struct ClockTrials<'a> {
    moving: MovingTracks<'a>,
    /// Of what moves, what falls.
    falling: Vec<bool>,
    stamps_s: &'a [f64],
    rate_hz: Option<f64>,
}

/// A clock that may be the recording's.
#[derive(Debug, Clone)]
struct ClockTrial {
    base: TimeBase,
    repeats: Vec<bool>,
    /// For its free numbers, squared standard deviations.
    price: f64,
}

impl ClockTrial {
    fn frames(&self) -> FrameTimes<'_> {
        FrameTimes {
            times_s: &self.base.times_s,
            duplicates: &self.repeats,
        }
    }
}

/// A clock, and the gaps in single places that make it likelier.
#[derive(Debug, Clone)]
struct GappedClock {
    clock: ClockTrial,
    gaps: Vec<DroppedFrames>,
}

/// A clock and what it explains.
struct Tried {
    clock: ClockTrial,
    explained: Explained,
    /// The same as it was before gaps in single places were put into it, and those.
    gapped: GappedClock,
}

impl Tried {
    fn score(&self) -> f64 {
        self.explained.gain - self.clock.price
    }

    /// Whether it is another clock than the stamps.
    fn is_another(&self) -> bool {
        let base = &self.clock.base;
        base.skipped > 0 || base.evened || self.clock.repeats.contains(&true)
    }
}

impl<'a> ClockTrials<'a> {
    /// Trials on what of `linked` falls under these `frames`, of a file with these stamps and the rate that its calibration tells.
    fn new(
        linked: &'a LinkedSpots,
        (stamps_s, rate_hz): (&'a [f64], Option<f64>),
        frames: FrameTimes<'_>,
        model: &dyn FlightSearch,
    ) -> Self {
        let moving = MovingTracks::new(linked);
        let falling = moving.falling(frames, model);
        Self {
            moving,
            falling,
            stamps_s,
            rate_hz,
        }
    }

    /// What falls under these `frames` is asked under all clocks.
    fn ask_what_falls_under(&mut self, frames: FrameTimes<'_>, model: &dyn FlightSearch) {
        let falling = self.moving.falling(frames, model);
        self.falling.iter_mut().zip(falling).for_each(|(a, b)| *a |= b);
    }

    fn explained(&self, clock: &ClockTrial) -> Explained {
        self.moving.explained(clock.frames(), &self.falling)
    }

    fn tried(&self, clock: ClockTrial) -> Tried {
        let explained = self.explained(&clock);
        let gapped = GappedClock {
            clock: clock.clone(),
            gaps: Vec::new(),
        };
        Tried {
            clock,
            explained,
            gapped,
        }
    }

    /// `best` with one more gap.
    fn with_gap(&self, best: &Tried, gap: DroppedFrames) -> Tried {
        let mut more = self.tried(ClockTrial {
            base: best.clock.base.clone().with_skips(&pairs(&[gap])),
            repeats: best.clock.repeats.clone(),
            price: best.clock.price + self.price_of_a_gap(),
        });
        more.gapped = best.gapped.clone();
        more.gapped.gaps.push(gap);
        more
    }

    /// The clock with those of its gaps that make it likelier, and with those that `must` be whatever they do.
    fn tried_with_gaps(&self, gapped: GappedClock, must: impl Fn(&DroppedFrames) -> bool) -> Tried {
        let mut best = self.tried(gapped.clock);
        for gap in gapped.gaps {
            let more = self.with_gap(&best, gap);
            if must(&gap) || more.score() > best.score() {
                best = more;
            }
        }
        best
    }

    /// A clock without free numbers.
    fn stamped(&self, base: TimeBase) -> ClockTrial {
        ClockTrial {
            base,
            repeats: vec![false; self.stamps_s.len()],
            price: 0.0,
        }
    }

    /// The stamps, with the frames at each place in a row of B frames late or early by the part of an interval that suits the steps of what moves best; `None`
    /// where there are no such frames.
    fn drawn_late(&self, spots: &[Spot]) -> Option<ClockTrial> {
        let base = TimeBase::new(self.stamps_s, &[], self.rate_hz);
        let interval_s = base.interval_s?;
        let mut between = vec![false; self.stamps_s.len()];
        for s in spots {
            between[s.frame] = s.coded == Coded::Interpolated;
        }
        // Which in a row of B frames, from 1; 0 of the others.
        let mut row = 0;
        let places = between.iter().map(|&between| {
            row = if between { (row + 1).min(MOST_PLACES) } else { 0 };
            row
        });
        let places: Vec<usize> = places.collect();
        let most = places.iter().copied().max().filter(|&most| most > 0)?;
        let duplicates = vec![false; places.len()];
        let late = |parts: &[f64]| -> Vec<f64> {
            let times = base.times_s.iter().zip(&places);
            times.map(|(t, &place)| t + parts[place] * interval_s).collect()
        };
        let misfit = |parts: &[f64]| {
            let times_s = &late(parts);
            let duplicates = &duplicates;
            self.moving.step_misfit(FrameTimes { times_s, duplicates })
        };
        let mut parts = vec![0.0; most + 1];
        for _ in 0..LATE_ROUNDS {
            for place in 1..=most {
                let trial = |k: i32| {
                    let mut with = parts.clone();
                    with[place] = MOST_LATE * f64::from(k) / f64::from(LATE_STEPS);
                    (misfit(&with), with)
                };
                let steps = (-LATE_STEPS..=LATE_STEPS).map(trial);
                parts = steps.min_by(|a, b| a.0.total_cmp(&b.0))?.1;
            }
        }
        let times_s = late(&parts);
        let price = 2.0 * most as f64 * f64::from(2 * LATE_STEPS + 1).ln();
        Some(ClockTrial {
            base: TimeBase { times_s, ..base },
            repeats: duplicates,
            price,
        })
    }

    /// The price of naming these frames among all: twice the logarithm of the number of such choices.
    fn price_of_places(&self, chosen: &[bool]) -> f64 {
        let (all, some) = (chosen.len(), chosen.iter().filter(|c| **c).count());
        let choices = |(k, left): (usize, usize)| (left as f64 / (k + 1) as f64).ln();
        let few = some.min(all - some);
        2.0 * (0..few).map(|k| choices((k, all - k))).sum::<f64>() + MARGIN
    }

    /// The clocks of another rate that suit the steps of what moves best.
    fn resampled(&self) -> Vec<ClockTrial> {
        let Some(stamps) = EvenStamps::of(self.stamps_s) else {
            return Vec::new();
        };
        let clock = |by: Resampling| stamps.resampled(self.rate_hz, by);
        let misfit = |by: Resampling| {
            let (base, repeats) = clock(by);
            self.moving.step_misfit(FrameTimes {
                times_s: &base.times_s,
                duplicates: &repeats,
            })
        };
        let best_of = |(above, below): (u32, u32)| {
            let ratio = f64::from(above) / f64::from(below);
            let phases = (0..below).map(|k| f64::from(k) / f64::from(below));
            let fits = phases.map(|phase| {
                let by = Resampling { ratio, phase };
                (misfit(by), by)
            });
            fits.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let ratios = ratios();
        let looked: u32 = ratios.iter().map(|(_, below)| below).sum();
        let mut seen: Vec<(f64, Resampling)> = ratios.into_par_iter().filter_map(best_of).collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        let price = 2.0 * f64::from(looked.max(1)).ln() + 2.0 * MARGIN;
        seen.truncate(MOST_TRIED);
        let stored_s = TimeBase::new(self.stamps_s, &[], None).interval_s;
        let finer = seen.into_par_iter().map(|(fit, by)| {
            let by = refined(fit, by, self.stamps_s.len(), misfit);
            let usual = stored_s.and_then(|s| of_usual_rate(by, 1.0 / s, self.stamps_s.len(), misfit));
            usual.unwrap_or(by)
        });
        finer
            .map(|by| {
                let (base, repeats) = clock(by);
                ClockTrial { base, repeats, price }
            })
            .collect()
    }

    /// `best`, or where its frames were chosen from more pictures and numbered anew, that: the fall tells, where the scale does not rest
    /// on it.
    fn numbered_anew(&self, mut best: Tried, camera: &CalibratedCamera<'_>) -> Tried {
        let base = &best.clock.base;
        if !(base.evened && base.skipped > 0) {
            return best;
        }
        let stored_s = TimeBase::new(self.stamps_s, &[], None).interval_s;
        let (Some((fall, radius)), Some(stored_s), Some(interval_s)) =
            (best.explained.fall, stored_s, base.interval_s)
        else {
            return best;
        };
        let Some(metres) = camera.metres_per_unit_by_radius(radius) else {
            return best;
        };
        let slower = stored_s / interval_s;
        let off = |fall: f64| (fall * metres / camera.calibration.gravity_m_s2).ln().abs();
        if off(fall / (slower * slower)) < off(fall) {
            best.clock.base = base.clone().stretched(slower);
            best.gapped.clock.base = best.clock.base.clone();
        }
        best
    }

    /// `best` with the gaps in single places that make it likelier.
    fn with_single_gaps(&self, mut best: Tried, spots: &[Spot]) -> Tried {
        let Some(interval_s) = best.clock.base.interval_s else {
            return best;
        };
        let linked = LinkedSpots::new(best.clock.frames().distinct(spots));
        for gap in dropped_frames::proposed(&linked, interval_s)
            .into_iter()
            .take(MOST_GAPS)
        {
            let more = self.with_gap(&best, gap);
            if more.score() > best.score() && more.score() > self.score_of_misplaced(&best, gap) {
                best = more;
            }
        }
        best
    }

    /// The score of `best` where what is missing at a `gap` is one frame that is stored near it in another place: no time is lost, and between the
    /// two places frames are numbered one too high or too low.
    fn score_of_misplaced(&self, best: &Tried, gap: DroppedFrames) -> f64 {
        let (Some(interval_s), 1) = (best.clock.base.interval_s, gap.missing) else {
            return f64::NEG_INFINITY;
        };
        let stored_at = |place: usize| {
            let mut times_s = best.clock.base.times_s.clone();
            let mut left_out = best.clock.repeats.clone();
            if place < gap.frame {
                times_s[place + 1..gap.frame]
                    .iter_mut()
                    .for_each(|t| *t -= interval_s);
            } else {
                times_s[gap.frame..place]
                    .iter_mut()
                    .for_each(|t| *t += interval_s);
            }
            left_out[place] = true;
            times_s[place] = times_s[place - 1];
            (times_s, left_out)
        };
        let misfit = |place: usize| {
            let (times_s, duplicates) = &stored_at(place);
            self.moving.step_misfit(FrameTimes { times_s, duplicates })
        };
        let from = gap.frame.saturating_sub(MOST_MISPLACED).max(1);
        let places = from..(gap.frame + MOST_MISPLACED).min(self.stamps_s.len());
        let likeliest = places
            .map(|place| (misfit(place), place))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        likeliest.map_or(f64::NEG_INFINITY, |(_, place)| {
            let (times_s, duplicates) = &stored_at(place);
            let frames = FrameTimes { times_s, duplicates };
            let price = self.price_of_a_gap() + 2.0 * (2.0 * MOST_MISPLACED as f64).ln();
            self.moving.explained(frames, &self.falling).gain - best.clock.price - price
        })
    }

    /// The price of naming one frame among all.
    fn price_of_a_gap(&self) -> f64 {
        2.0 * (self.stamps_s.len().max(1) as f64).ln() + GAP_MARGIN
    }
}

/// Pictures a stored frame that are tried, as quotients in lowest terms: 1 is none of them.
fn ratios() -> Vec<(u32, u32)> {
    let mut all = Vec::new();
    for below in 1..=MOST_PATTERN {
        for above in 1..=MOST_PATTERN {
            let ratio = f64::from(above) / f64::from(below);
            let fits = ratio <= MOST_RATIO && ratio * f64::from(MOST_TIMES) >= 1.0 && above != below;
            if fits && greatest_divisor(above, below) == 1 {
                all.push((above, below));
            }
        }
    }
    all
}

fn greatest_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { greatest_divisor(b, a % b) }
}

/// The resampling near `by` with the least misfit: other rates than quotients of small numbers drift by a picture over a recording of `frames`.
fn refined(fit: f64, by: Resampling, frames: usize, misfit: impl Fn(Resampling) -> f64) -> Resampling {
    let (mut best, mut least) = (by, fit - REFINED_GAIN);
    for i in -REFINED_STEPS..=REFINED_STEPS {
        for k in -REFINED_STEPS..=REFINED_STEPS {
            let ratio = by.ratio + f64::from(i) / (f64::from(REFINED_STEPS) * frames as f64);
            let phase = (by.phase + 0.1 * f64::from(k)).rem_euclid(1.0);
            let trial = Resampling { ratio, phase };
            let found = misfit(trial);
            if found < least {
                (best, least) = (trial, found);
            }
        }
    }
    best
}

/// The choice of pictures of a usual camera that suits as well as `by` does, for `frames` stored at `stored_hz`: of a camera in whole Hz, or else one of the
/// countries of NTSC, the nearest first. Where nothing moves, pictures may be chosen otherwise.
fn of_usual_rate(
    by: Resampling,
    stored_hz: f64,
    frames: usize,
    misfit: impl Fn(Resampling) -> f64,
) -> Option<Resampling> {
    let most = misfit(by) + USUAL_RATE_COST;
    let nearest = |ratios: Vec<f64>| {
        let suits = ratios.into_iter().filter_map(|ratio| {
            let phases = (0..USUAL_RATE_PHASES).map(|k| f64::from(k) / f64::from(USUAL_RATE_PHASES));
            let fits = phases.map(|phase| {
                let by = Resampling { ratio, phase };
                (misfit(by), by)
            });
            fits.min_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|(fit, _)| *fit <= most)
        });
        let off = |other: &Resampling| (other.ratio - by.ratio).abs();
        suits.map(|(_, by)| by).min_by(|a, b| off(a).total_cmp(&off(b)))
    };
    let near = |ratio: &f64| (ratio - by.ratio).abs() * frames as f64 <= USUAL_RATE_PICTURES;
    let [whole, ntsc] =
        Resampling::of_usual_cameras(stored_hz).map(|ratios| ratios.into_iter().filter(near).collect());
    nearest(whole).or_else(|| nearest(ntsc))
}

/// A usual rate may suit worse by this, in squared standard deviations: less than one picture that is taken for the next.
const USUAL_RATE_COST: f64 = 4.0;

/// And its pictures end so many off over the recording, at most.
const USUAL_RATE_PICTURES: f64 = 1.5;

/// Phases that are tried.
const USUAL_RATE_PHASES: u32 = 40;

/// A rate that is no quotient of small numbers costs its digits, squared standard deviations.
const REFINED_GAIN: f64 = 16.0;

/// Steps of the search on each side: a picture over the recording in all.
const REFINED_STEPS: i32 = 4;

impl Clocked {
    fn new(base: TimeBase, duplicates: Vec<bool>, camera: &CalibratedCamera<'_>, decoded: &Decoded) -> Self {
        let warnings = of_clock::of_clock(decoded, &base, &duplicates, camera.calibration);
        Self {
            base,
            duplicates,
            warnings,
            rivals: Vec::new(),
        }
    }

    /// The clock of frames whose times are told.
    pub fn given(times_s: &[f64]) -> Self {
        Self {
            duplicates: vec![false; times_s.len()],
            base: TimeBase::new(times_s, &[], None),
            warnings: Vec::new(),
            rivals: Vec::new(),
        }
    }

    /// The likeliest of the clocks that stood against each other by the `best` centres of the ball, and by the `first` ones in frames that this clock
    /// takes for repeats, which have no others; `None` where it is this one. Gaps in frames that these centres do not reach stay.
    pub fn by_best_centres(
        &self,
        camera: &CalibratedCamera<'_>,
        decoded: &Decoded,
        (best, first): (&[BallCentre], &[BallCentre]),
        optics: Option<Optics>,
    ) -> Option<Self> {
        if self.rivals.is_empty() {
            return None;
        }
        let seen = || best.iter().map(|c| c.frame);
        let (from, to) = (seen().min()?, seen().max()?);
        let repeats = first.iter().filter(|c| self.duplicates[c.frame]);
        let mut centres: Vec<&BallCentre> = best.iter().chain(repeats).collect();
        centres.sort_by_key(|c| c.frame);
        let spots = centres
            .into_iter()
            .filter_map(|c| c.spot(camera, optics, &self.base.times_s));
        let linked = LinkedSpots::new(spots.collect());
        let stamps = (&decoded.stamps_s[..], camera.calibration.frame_rate_hz);
        let model = camera.motion_model(None, None);
        let mut trials = ClockTrials::new(&linked, stamps, self.frames(), &*model);
        for rival in &self.rivals {
            trials.ask_what_falls_under(rival.clock.frames(), &*model);
        }
        let unseen = |gap: &DroppedFrames| !(from + 1..=to).contains(&gap.frame);
        let rivals = self.rivals.iter().cloned();
        let best = rivals
            .map(|rival| trials.tried_with_gaps(rival, unseen))
            .max_by(|a, b| a.score().total_cmp(&b.score()))?;
        let other = best.clock.base.times_s != self.base.times_s || best.clock.repeats != self.duplicates;
        other.then(|| Self::new(best.clock.base, best.clock.repeats, camera, decoded))
    }

    /// Times and duplicates.
    pub fn frames(&self) -> FrameTimes<'_> {
        FrameTimes {
            times_s: &self.base.times_s,
            duplicates: &self.duplicates,
        }
    }

    /// Standard uncertainty of the time since the first frame at `until_s`, s, by frames that are missing where nothing shows it.
    ///
    /// A recording that lost k frames out of the n of its arcs, which lie in these `spans_s`, lost others among the m frames before `until_s` that are in none:
    /// a ball that is held, rolls or turns at a floor. By Poisson's statistics with a rate that is known from the k alone their number has the mean
    /// μ = m k/n and the variance μ (1 + m/n). The time is not moved by μ, so that μ² is part of its variance. Steps between two times
    /// within arcs are as sure as they were.
    pub fn unseen_gaps_std_s(&self, spans_s: &[(f64, f64)], until_s: f64) -> f64 {
        let (Some(interval_s), false) = (self.base.interval_s, self.base.evened) else {
            return 0.0;
        };
        let shows = |t: &&f64| spans_s.iter().any(|(from, to)| (*from..=*to).contains(*t));
        let times = || self.base.times_s.iter();
        let shown = times().filter(shows).count();
        let unseen = times().filter(|t| **t < until_s && !shows(t)).count();
        if self.base.skipped == 0 || shown == 0 {
            return 0.0;
        }
        let part = unseen as f64 / shown as f64;
        let mean = part * self.base.skipped as f64;
        interval_s * (mean * mean + mean * (1.0 + part)).sqrt()
    }

    /// The clock with the time of the frames that are missing at the impacts of `flight`; `None` where none are.
    pub fn with_frames_missing_at_impacts(
        &self,
        flight: &Flight,
        camera: &CalibratedCamera<'_>,
        decoded: &Decoded,
    ) -> Option<Self> {
        let missing = dropped_frames::at_impacts(flight);
        let base = || self.base.clone().with_skips(&pairs(&missing));
        (!missing.is_empty()).then(|| Self::new(base(), self.duplicates.clone(), camera, decoded))
    }
}

/// The first frame after each gap, and the frames missing in it.
fn pairs(skips: &[DroppedFrames]) -> Vec<(usize, isize)> {
    skips.iter().map(|s| (s.frame, s.missing)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_that_nothing_shows_widen_times_since_the_first_frame() {
        // 60 frames, the last 40 of them of arcs in which two are missing.
        let stamps_s: Vec<f64> = (0..60).map(|i| 0.01 * f64::from(i)).collect();
        let clocked = |skips: &[(usize, isize)]| Clocked {
            base: TimeBase::new(&stamps_s, &[], None).with_skips(skips),
            duplicates: vec![false; 60],
            warnings: Vec::new(),
            rivals: Vec::new(),
        };
        let arcs_s = [(0.195, 0.395), (0.405, 0.8)];
        assert_eq!(clocked(&[]).unseen_gaps_std_s(&arcs_s, 0.4), 0.0);
        let lost = clocked(&[(30, 1), (50, 1)]);
        // One more is expected among the first 20, give or take 1.22.
        let std_s = lost.unseen_gaps_std_s(&arcs_s, 0.4);
        assert!(
            (std_s - 0.01 * 1.0_f64.hypot(1.5_f64.sqrt())).abs() < 4e-4,
            "{std_s}"
        );
        assert_eq!(lost.unseen_gaps_std_s(&[(-0.1, 0.8)], 0.4), 0.0);
    }

    /// 240 Hz stored at 274 Hz looks over a short while as every eighth frame twice; a frame before the flight may look otherwise.
    #[test]
    fn a_pattern_of_repeats_is_that_of_a_usual_camera_where_it_suits() {
        let truth = Resampling {
            ratio: 240.0 / 274.0,
            phase: 0.3,
        };
        let frames = 150;
        let picture = |r: Resampling, k: usize| (r.ratio * k as f64 + r.phase).floor();
        // Of each frame of the flight that shows another picture.
        let misfit = |r: Resampling| {
            let steps = (30..frames).filter(|&k| {
                let step = |r| picture(r, k) - picture(r, k - 1);
                step(r) != step(truth)
            });
            10.0 * steps.count() as f64
        };
        let near = Resampling {
            ratio: 0.8755,
            phase: 0.37,
        };
        let by = [near, truth]
            .into_iter()
            .min_by(|a, b| misfit(*a).total_cmp(&misfit(*b)))
            .unwrap();
        let usual = of_usual_rate(by, 274.0, frames, misfit).unwrap();
        assert!((usual.ratio * 274.0 - 240.0).abs() < 1e-9, "{usual:?}");
        let other = Resampling {
            ratio: 0.7,
            phase: 0.0,
        };
        assert!(of_usual_rate(other, 274.0, frames, |r| (r.ratio - 0.7).abs() * 1e6).is_none());
    }
}
