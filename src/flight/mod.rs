//! The freely falling path among all that moves; its arcs, and the impacts between them.
//!
//! 1. [`linking`]: round things of successive frames become tracks.
//! 2. [`segment`]: each track is cut into arcs with free parabolas. The arcs of a flight share one fall; a hand, a
//!    person, a swinging cloth do not. The track with the most evidence of one common fall is the ball's.
//! 3. With that fall the track is cut again, and arcs that are one flight are joined.
//! 4. [`fit`]: all arcs together, with one gravity. Points that do not fit are set aside with the reason.
//! 5. Two arcs that meet between the last point of one and the first of the next are an impact.
//!
//! In a top view from far away nothing falls: arcs are straight lines, and the longest track of such lines is the
//! ball's. From a camera whose height is known they bend; that is [`overhead`].

pub mod clock;
pub mod drag;
pub mod fit;
pub mod linking;
pub mod overhead;
pub mod planar;
pub mod repeats;
pub mod scatter;
pub mod segment;
pub mod skips;

use crate::quantity;
use fit::{ArcFit, FitPoint, Forces};
use linking::{Spot, Track};
use scatter::{Distance, Extra};
use segment::{Fall, Sample, own_fall};

/// The flight found.
#[derive(Debug, Clone)]
pub struct Flight {
    /// The spots of the ball's track in time order, each with its use.
    pub points: Vec<FlightPoint>,
    /// The fitted arcs.
    pub fit: ArcFit,
    /// What centres scatter by beyond their own uncertainty.
    pub extra: Extra,
    /// First and last time of a used point of each arc, s.
    pub spans: Vec<(f64, f64)>,
    /// Between arcs k and k + 1: the impact, or `None` where they do not meet (a catch, a gap too long).
    pub impacts: Vec<Option<f64>>,
    /// Frame interval, s.
    pub interval_s: f64,
}

/// A spot of the track and what became of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightPoint {
    /// The spot.
    pub spot: Spot,
    /// The arc it serves, or why it serves none.
    pub use_: SpotUse,
}

/// Whether a spot serves the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpotUse {
    /// For this arc.
    Used(usize),
    /// Before the first or after the last free arc, or between arcs that are not free flight.
    NotFree,
    /// At the time of an impact: the ball touches the floor.
    Contact,
    /// Off its arc by this many plane units.
    Off(f64),
}

/// Why there is no flight.
#[derive(Debug, Clone, PartialEq)]
pub enum NoFlight {
    /// Nothing round moved in enough frames: how many round things there were.
    NothingRound {
        /// Spots in all.
        spots: usize,
    },
    /// Round things moved, but none fell freely.
    NothingFalls {
        /// Length of the longest track, frames.
        longest: usize,
    },
}

/// Segmentation asks for impacts, not for precision: residuals below this part of the radius are not worth a cut
/// (drag over a long arc, a drifting hand-held camera).
const SEGMENT_PART_OF_RADIUS: f64 = 0.04;

/// The same in a top view from a distance not known, where a ball that rises towards the camera bends the straight path.
const TOP_PART_OF_RADIUS: f64 = 0.2;

/// An arc counts as falling when its sagitta is this many standard deviations (of segmentation).
const SAGITTA_SIGMAS: f64 = 6.0;

/// Where centres scatter by less than segmentation asks for, a curve may be lower by this part, too.
const FINE_PART: f64 = 0.25;

/// Points further off than this many (robust) standard deviations are set aside.
const OFF_SIGMAS: f64 = 4.5;

/// Finds the flight among `spots` (in time order) under `forces`.
///
/// # Errors
///
/// [`NoFlight`] with what was found instead.
pub fn find(spots: &[Spot], forces: Forces) -> Result<Flight, NoFlight> {
    let tracks = linking::link(spots);
    let longest = tracks.first().map_or(0, Vec::len);
    if longest < 4 {
        return Err(NoFlight::NothingRound { spots: spots.len() });
    }
    let best = tracks
        .iter()
        .filter(|t| t.len() >= 4)
        .filter_map(|t| Candidate::new(spots, t, forces))
        .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
        .ok_or(NoFlight::NothingFalls { longest })?;
    let interval_s = interval(&best.track.iter().map(|&i| spots[i].time_s).collect::<Vec<_>>());
    let whole = with_continuations(spots, &tracks, &best, forces);
    build(spots, &whole, best.gravity, forces, interval_s).ok_or(NoFlight::NothingFalls { longest })
}

/// Fits again the same spots' flight with better places: `points` as [`Flight::points`] with refined spots and any
/// that were found since; arcs are found anew with the fall known.
#[must_use]
pub fn again(spots: &[Spot], flight: &Flight, forces: Forces) -> Option<Flight> {
    let track: Track = (0..spots.len()).collect();
    build(spots, &track, flight.fit.gravity(), forces, flight.interval_s)
}

/// Median time between successive frames.
fn interval(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 0.0)
        .collect();
    quantity::median(&mut steps).unwrap_or(f64::INFINITY)
}

/// A track that may be the ball's.
struct Candidate {
    track: Track,
    gravity: f64,
    evidence: f64,
    /// First and last time of the arcs that fall, s.
    span: (f64, f64),
}

impl Candidate {
    fn new(spots: &[Spot], track: &Track, forces: Forces) -> Option<Self> {
        let sigma = segment_sigma(spots, track, forces);
        let samples = samples_of(spots, track, sigma);
        if let Forces::Overhead(known) = forces {
            return Some(Self {
                track: track.clone(),
                gravity: 0.0,
                evidence: overhead::find::evidence(spots, track, sigma, known)?,
                span: (samples.first()?.t, samples.last()?.t),
            });
        }
        if !forces.falls() {
            let found = segment::arcs(&samples, Fall::Known(0.0));
            let covered: usize = found.iter().map(ExactSizeIterator::len).sum();
            let (first, last) = (samples.first()?, samples.last()?);
            let path = (last.r - first.r).hypot(last.h - first.h);
            let moves = path > 10.0 * sigma && covered >= 6;
            let evidence = covered as f64 * path / sigma;
            return moves.then(|| Self {
                track: track.clone(),
                gravity: 0.0,
                evidence,
                span: (first.t, last.t),
            });
        }
        let found = segment::arcs(&samples, Fall::Free);
        let falling_beyond = |sigma: f64| -> Vec<(f64, f64, usize, f64)> {
            let curved = found.iter().filter(|a| a.len() >= 5).filter_map(|a| {
                let part = &samples[a.clone()];
                let (g, std) = own_fall(part)?;
                let duration = part[part.len() - 1].t - part[0].t;
                let sagitta = g * duration * duration / 8.0;
                (sagitta > SAGITTA_SIGMAS * sigma).then_some((g, std, a.len(), sagitta))
            });
            curved.collect()
        };
        let mut least = sigma;
        let mut falling = falling_beyond(sigma);
        if falling.is_empty() {
            least = fine_sigma(spots, track, sigma);
            falling = falling_beyond(least);
        }
        // The common fall: the arc that most of the weight agrees with.
        let agreeing = |g: f64| {
            falling
                .iter()
                .filter(move |a| (a.0 - g).abs() < 4.0 * a.1 + 0.12 * g)
                .collect::<Vec<_>>()
        };
        let weight = |g: f64| agreeing(g).iter().map(|a| a.2 as f64).sum::<f64>();
        let centre = falling
            .iter()
            .max_by(|a, b| weight(a.0).total_cmp(&weight(b.0)))?
            .0;
        let agree = agreeing(centre);
        let (mut sum, mut information) = (0.0, 0.0);
        for a in &agree {
            sum += a.0 / (a.1 * a.1);
            information += 1.0 / (a.1 * a.1);
        }
        let gravity = sum / information;
        // Much of the track must be in that fall, or it is a hand that happened to swing like it.
        let falls_for: usize = agree.iter().map(|a| a.2).sum();
        let sagittas: f64 = agree.iter().map(|a| a.3 / sigma).sum();
        let known = segment::arcs(&samples, Fall::Known(gravity));
        let covered: usize = known
            .iter()
            .filter(|a| a.len() >= 4)
            .map(ExactSizeIterator::len)
            .sum();
        let enough = falls_for >= 6 && covered >= 6;
        let curved: Vec<_> = known
            .iter()
            .filter(|a| shows_fall(&samples, a, gravity, least))
            .collect();
        let span = (
            samples[curved.first()?.start].t,
            samples[curved.last()?.end - 1].t,
        );
        enough.then(|| Self {
            track: track.clone(),
            gravity,
            evidence: covered as f64 * sagittas.sqrt(),
            span,
        })
    }
}

/// Standard deviation for segmentation: the largest of the stated uncertainty, the scatter that third differences
/// show (they vanish on a parabola) and a small part of the radius.
fn segment_sigma(spots: &[Spot], track: &Track, forces: Forces) -> f64 {
    let mut stds: Vec<f64> = track.iter().map(|&i| spots[i].std).collect();
    let mut radii: Vec<f64> = track.iter().map(|&i| spots[i].radius).collect();
    let stated = median(&mut stds);
    let of_radius = if forces == Forces::None {
        TOP_PART_OF_RADIUS
    } else {
        SEGMENT_PART_OF_RADIUS
    };
    let part = of_radius * median(&mut radii);
    let seen = scatter_seen(spots, track).unwrap_or(0.0);
    stated.max(seen.min(5.0 * part)).max(part)
}

/// The standard deviation that a curve has to stand out from where all are low (a bounce of a large ball by less than its
/// radius): that of the centres, not what segmentation overlooks.
fn fine_sigma(spots: &[Spot], track: &Track, sigma: f64) -> f64 {
    scatter_seen(spots, track).map_or(sigma, |seen| seen.clamp(FINE_PART * sigma, sigma))
}

/// What a track's centres scatter by as third differences show it, plane units; `None` where there are too few.
fn scatter_seen(spots: &[Spot], track: &Track) -> Option<f64> {
    let mut thirds = Vec::new();
    for w in track.windows(4) {
        let s: Vec<&Spot> = w.iter().map(|&i| &spots[i]).collect();
        let even = s[3].frame - s[0].frame == 3 && s.windows(2).all(|p| p[1].time_s > p[0].time_s);
        if even {
            let third = |y: fn(&Spot) -> f64| y(s[3]) - 3.0 * y(s[2]) + 3.0 * y(s[1]) - y(s[0]);
            thirds.push(third(|s| s.place.right).abs());
            thirds.push(third(|s| s.place.up).abs());
        }
    }
    // Variance of a third difference: 1 + 9 + 9 + 1.
    (thirds.len() >= 8).then(|| 1.4826 * median(&mut thirds) / 20.0_f64.sqrt())
}

fn median(values: &mut [f64]) -> f64 {
    quantity::median(values).unwrap_or(0.0)
}

fn samples_of(spots: &[Spot], track: &Track, sigma: f64) -> Vec<Sample> {
    let weight = 1.0 / (sigma * sigma);
    track
        .iter()
        .map(|&i| Sample {
            t: spots[i].time_s,
            r: spots[i].place.right,
            h: spots[i].place.up,
            weight,
            near: 0.0,
            near_weight: 0.0,
        })
        .collect()
}

/// The best track with others that are the same ball before or after it (it left the picture, or was hidden): of the
/// same size, not at the same time, with arcs of the same fall that lead to it.
fn with_continuations(spots: &[Spot], tracks: &[Track], best: &Candidate, forces: Forces) -> Track {
    let mut whole = best.track.clone();
    match forces {
        Forces::Fall | Forces::FallWithDrag(_) => {}
        Forces::Overhead(_) => return overhead::find::with_continuations(spots, tracks, whole),
        Forces::None => return whole,
    }
    let radius = {
        let mut radii: Vec<f64> = whole.iter().map(|&i| spots[i].radius).collect();
        median(&mut radii)
    };
    let mut spans = vec![best.span];
    for track in tracks.iter().filter(|t| t.len() >= 5 && **t != best.track) {
        let mut radii: Vec<f64> = track.iter().map(|&i| spots[i].radius).collect();
        let alike = (median(&mut radii) / radius - 1.0).abs() < 0.25;
        let Some(other) = Candidate::new(spots, track, forces).filter(|_| alike) else {
            continue;
        };
        let (from, to) = other.span;
        let apart = spans.iter().all(|s| to < s.0 || from > s.1);
        let same_fall = (other.gravity / best.gravity - 1.0).abs() < 0.15;
        if apart && same_fall {
            // Where both have points (two things met, and each track went on with the other) the falling one's count.
            let within = |i: usize| spots[i].time_s >= from && spots[i].time_s <= to;
            whole.retain(|&i| !within(i));
            whole.extend(track.iter().copied().filter(|&i| within(i)));
            whole.sort_unstable();
            spans.push(other.span);
        }
    }
    whole
}

/// The flight along the track, from a first idea of the fall: where the arcs then show another fall, they are cut again
/// with that.
fn build(spots: &[Spot], track: &Track, gravity: f64, forces: Forces, interval_s: f64) -> Option<Flight> {
    let mut flight = cut_and_fit(spots, track, gravity, forces, interval_s)?;
    let mut known = gravity;
    for _ in 0..FALL_ROUNDS {
        let shown = flight.fit.gravity();
        if (shown - known).abs() <= SAME_FALL * known.abs() {
            break;
        }
        known = shown;
        match cut_and_fit(spots, track, known, forces, interval_s) {
            Some(again) if again.used() >= flight.used() => flight = again,
            _ => break,
        }
    }
    Some(flight)
}

/// Falls that differ by less than this part cut a track alike: half a second of fall, 1.2 m, then ends within 2 mm.
const SAME_FALL: f64 = 0.002;

/// Times that a track is cut again.
const FALL_ROUNDS: usize = 4;

/// Cuts the track with the fall known, joins arcs that are one flight, fits, sets points aside, finds impacts.
fn cut_and_fit(
    spots: &[Spot],
    track: &Track,
    gravity: f64,
    forces: Forces,
    interval_s: f64,
) -> Option<Flight> {
    let falls = forces.falls();
    let sigma = segment_sigma(spots, track, forces);
    if let Forces::Overhead(known) = forces {
        return overhead::find::build(spots, track, sigma, known, interval_s);
    }
    let samples = samples_of(spots, track, sigma);
    let fall = Fall::Known(gravity);
    let mut ranges = segment::arcs(&samples, fall);
    ranges.retain(|r| is_free_flight(&samples[r.clone()], gravity, falls));
    let ranges = join(&samples, ranges, fall);
    let ranges = richest_run(longest_chain(&samples, ranges, interval_s));
    let shows = |least: f64| ranges.iter().any(|r| shows_fall(&samples, r, gravity, least));
    let least = if shows(sigma) {
        sigma
    } else {
        fine_sigma(spots, track, sigma)
    };
    let mut ranges = without_straight_ends(&samples, ranges, gravity, least, falls);
    let mut untrimmed: Option<Flight> = None;
    // Arcs that do not meet as a ball's do are two flights, or none: the longer part is tried again.
    while !ranges.is_empty() {
        let mut uses = vec![SpotUse::NotFree; track.len()];
        for (k, r) in ranges.iter().enumerate() {
            uses[r.clone()].fill(SpotUse::Used(k));
        }
        let Some(fit) = fit_and_set_aside(spots, track, &mut uses, ranges.len(), forces) else {
            // An arc that loses its points one by one was none: bounces too small for the frames, a ball that stays down.
            ranges.remove(emptied_arc(&uses, ranges.len())?);
            continue;
        };
        if let Some(no_arc) = mostly_set_aside(&uses, &ranges) {
            ranges.remove(no_arc);
            continue;
        }
        let flight = finish(spots, track, uses, fit, interval_s);
        let shows = |k: usize| shows_fall(&samples, &ranges[k], gravity, sigma);
        if let Some(chance) = (1..ranges.len().saturating_sub(1)).find(|&k| flight.is_detour(k)) {
            ranges.remove(chance);
            continue;
        }
        let last = ranges.len() - 1;
        if last > 0 && !shows(last) && flight.is_carried(last, ranges[last].len()) {
            ranges.pop();
            continue;
        }
        let Some(cut) = flight.impacts.iter().position(Option::is_none) else {
            let mut sure = ranges.clone();
            if flight.trim_unsure_ends(&mut sure) {
                if sure.last().is_some_and(|r| r.len() < LEAST_END_POINTS) {
                    sure.pop();
                }
                if !sure.is_empty() && sure.iter().all(|r| r.len() >= LEAST_FIT_POINTS) {
                    ranges = sure;
                    untrimmed = Some(flight);
                    continue;
                }
            }
            return flight.is_convincing(&samples, &ranges, sigma).then_some(flight);
        };
        // A flight that falls apart without its unsure points is better off with them.
        if let Some(whole) = untrimmed {
            return whole.is_convincing(&samples, &ranges, sigma).then_some(whole);
        }
        ranges = without_weak_arc(&samples, ranges, cut, gravity, sigma);
    }
    None
}

/// The first arc most of whose points do not lie on it, once it is fitted to the last digit: a few points on the floor, behind
/// an impact that left the ball there, pass for a short rebound as long as only their cut is asked for.
fn mostly_set_aside(uses: &[SpotUse], ranges: &[std::ops::Range<usize>]) -> Option<usize> {
    let off = |range: &std::ops::Range<usize>| {
        let used = uses[range.clone()]
            .iter()
            .filter(|u| matches!(u, SpotUse::Used(_)));
        2 * used.count() < range.len()
    };
    ranges.iter().position(off)
}

/// Whether an arc is long enough to show the common fall.
fn shows_fall(samples: &[Sample], range: &std::ops::Range<usize>, gravity: f64, sigma: f64) -> bool {
    let duration = samples[range.end - 1].t - samples[range.start].t;
    range.len() >= 4 && gravity * duration * duration / 8.0 > SAGITTA_SIGMAS * sigma
}

/// Points of the first and of the last arc, at least.
const LEAST_END_POINTS: usize = 4;

/// The arcs from the first to the last that shows the fall, and one more at each end: a short stretch after the last
/// impact is a rebound, a row of them is a ball that rolls or shivers.
fn without_straight_ends(
    samples: &[Sample],
    ranges: Vec<std::ops::Range<usize>>,
    gravity: f64,
    sigma: f64,
    falls: bool,
) -> Vec<std::ops::Range<usize>> {
    let shows = |r: &std::ops::Range<usize>| shows_fall(samples, r, gravity, sigma);
    if !falls {
        return ranges;
    }
    let (Some(first), Some(last)) = (ranges.iter().position(shows), ranges.iter().rposition(shows)) else {
        return Vec::new();
    };
    let end = (last + 2).min(ranges.len());
    let mut kept = ranges[first.saturating_sub(1)..end].to_vec();
    // An arc at the end, which only one impact holds, needs a point to spare.
    if kept.first().is_some_and(|r| r.len() < LEAST_END_POINTS) {
        kept.remove(0);
    }
    if kept.last().is_some_and(|r| r.len() < LEAST_END_POINTS) {
        kept.pop();
    }
    kept
}

/// Arcs `cut` and `cut + 1` do not meet: the weaker goes, if it is a short stretch that may be anything (points on
/// both sides of an impact that happen to lie on a parabola); else the flight ends there, and the larger part stays.
fn without_weak_arc(
    samples: &[Sample],
    mut ranges: Vec<std::ops::Range<usize>>,
    cut: usize,
    gravity: f64,
    sigma: f64,
) -> Vec<std::ops::Range<usize>> {
    let weaker = if ranges[cut].len() < ranges[cut + 1].len() {
        cut
    } else {
        cut + 1
    };
    let range = &ranges[weaker];
    if range.len() <= WEAK_POINTS || !shows_fall(samples, range, gravity, sigma) {
        ranges.remove(weaker);
        return ranges;
    }
    larger_part(ranges, cut + 1)
}

/// An arc of this many points or fewer may be chance.
const WEAK_POINTS: usize = 5;

/// The part before or from `cut`, whichever holds more points.
fn larger_part(mut ranges: Vec<std::ops::Range<usize>>, cut: usize) -> Vec<std::ops::Range<usize>> {
    let count = |part: &[std::ops::Range<usize>]| part.iter().map(ExactSizeIterator::len).sum::<usize>();
    let tail = ranges.split_off(cut);
    if count(&tail) > count(&ranges) {
        tail
    } else {
        ranges
    }
}

/// A bounce may turn spin into speed, but not make much: kinetic energy after over before, at most.
const MOST_ENERGY_GAIN: f64 = 1.15;

/// Least part of a flight's points on arcs whose own curve shows the common fall.
const LEAST_CURVED_PART: f64 = 0.6;

/// Least part of the points between a flight's first and last that lie on its arcs. A swinging hand follows a
/// parabola now and then; a ball does nothing else.
const LEAST_FREE_PART: f64 = 0.6;

/// Half of a flight's points are closer to their arcs than this, in the segmentation's standard deviations, ...
const MOST_SCATTER: f64 = 2.0;

/// ... or than this part of the arc's sagitta: a ball of few pixels far away, a little nearer to the camera at one end.
const SAGITTA_PART: f64 = 0.01;

/// An arc whose own fall differs from the common one by this many standard uncertainties, and this part of it (drag), is
/// none. Fewer than for arcs found by their curve: three of a hundred are wrongly let go, which costs a bounce.
const CARRIED_SIGMAS: f64 = 3.0;
const CARRIED_PART: f64 = 0.1;

/// Beyond this, scatter that lasts from frame to frame is a path bent by perspective, a moving camera or air.
const MOST_EXCESS: f64 = 4.0;
const MOST_PERSISTENCE: f64 = 3.0;

/// Points behind an arc that tell whether the ball stays down, and squared deviations from one height, in variances, that
/// are level.
const LEVEL_POINTS: usize = 6;
const LEVEL_EXCESS: f64 = 4.0;

/// So many standard deviations from its arc a point of it may be without being set aside.
const UNTOLD_SIGMAS: f64 = OFF_SIGMAS * std::f64::consts::SQRT_2;

/// Rough centres make no point unsure that is further from an impact than this part of the frame interval.
const NEAR_PART: f64 = 0.25;

/// Points at the end of an arc that may be behind the next impact without being told.
const UNTOLD_POINTS: usize = 2;

/// A floor is level to this part of the ball's radius from one impact to the next.
const LEVEL_PART: f64 = 0.1;

/// A flight without an impact must show its curve over this many points.
const LEAST_LONE_POINTS: usize = 20;

impl Flight {
    /// Time of the first and the last point in use, s.
    #[must_use]
    pub fn time_span(&self) -> (f64, f64) {
        let from = self.spans.iter().map(|s| s.0).fold(f64::INFINITY, f64::min);
        let to = self.spans.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        (from, to)
    }

    /// Standard uncertainty of a spot's coordinates with what such frames scatter by, plane units.
    #[must_use]
    pub fn std(&self, spot: &Spot) -> f64 {
        variance(spot, &self.extra).sqrt()
    }

    /// What the used centres scatter by beyond what their own pixels tell, plane units: how far a codec or a shaking camera
    /// displaces the ball.
    #[must_use]
    pub fn displaced_std(&self) -> f64 {
        let used = self.points.iter().filter(|p| matches!(p.use_, SpotUse::Used(_)));
        let mut beyond: Vec<f64> = used.map(|p| self.extra.more(p.spot.coded).sqrt()).collect();
        median(&mut beyond)
    }

    /// How many times more the used centres scatter than their own pixels tell.
    #[must_use]
    pub fn excess(&self) -> f64 {
        let mut ratios: Vec<f64> = self
            .points
            .iter()
            .filter(|p| matches!(p.use_, SpotUse::Used(_)))
            .map(|p| self.std(&p.spot) / p.spot.std)
            .collect();
        median(&mut ratios).max(1.0)
    }

    /// Mean speed over the ends and middles of the arcs, plane units/s.
    #[must_use]
    pub fn usual_speed(&self) -> f64 {
        let speeds: Vec<f64> = self
            .spans
            .iter()
            .enumerate()
            .flat_map(|(k, s)| [s.0, 0.5 * (s.0 + s.1), s.1].map(|t| (k, t)))
            .map(|(k, t)| self.fit.speed(k, t))
            .collect();
        speeds.iter().sum::<f64>() / speeds.len() as f64
    }

    /// The points in use as the fit had them.
    #[must_use]
    pub fn fit_points(&self) -> Vec<FitPoint> {
        let used = self.points.iter().filter_map(|p| match p.use_ {
            SpotUse::Used(arc) => Some((arc, &p.spot)),
            _ => None,
        });
        used.map(|(arc, spot)| fit_point(spot, arc, &self.extra))
            .collect()
    }

    /// The same points, each in use moved by what `shift` says of it and its arc (along right and up, plane units), with the
    /// arcs and the centres' scatter found anew. `None` where the points do not determine them.
    #[must_use]
    pub fn moved(&self, shift: impl Fn(&Spot, usize) -> (f64, f64)) -> Option<Self> {
        let mut points = self.points.clone();
        for p in &mut points {
            if let SpotUse::Used(arc) = p.use_ {
                let (right, up) = shift(&p.spot, arc);
                p.spot.place.right += right;
                p.spot.place.up += up;
            }
        }
        let spots: Vec<Spot> = points.iter().map(|p| p.spot).collect();
        let uses: Vec<SpotUse> = points.iter().map(|p| p.use_).collect();
        let track: Track = (0..spots.len()).collect();
        let (arcs, forces) = (self.fit.arcs(), self.fit.forces);
        let (fit, extra) = settled(&spots, &track, &uses, arcs, forces, self.extra)?;
        Some(Self {
            points,
            fit,
            extra,
            ..self.clone()
        })
    }

    /// Number of points in use.
    #[must_use]
    pub fn used(&self) -> usize {
        self.points
            .iter()
            .filter(|p| matches!(p.use_, SpotUse::Used(_)))
            .count()
    }

    /// Whether the points of the last arc `k`, cut from `cut` of the track, contradict its fall as precisely as their centres are
    /// known: a ball that stays down after an impact, or a row of bounces that frames do not resolve, lies close to a
    /// short parabola.
    fn is_carried(&self, k: usize, cut: usize) -> bool {
        // Where the whole flight is no parabola to the precision of the centres, no arc of it is.
        let precise = self.excess() < MOST_EXCESS || self.fit.persistence < MOST_PERSISTENCE;
        if !self.fit.forces.falls() || !precise {
            return false;
        }
        let weight = |spot: &Spot| 1.0 / variance(spot, &self.extra);
        let sample = |p: &FlightPoint| Sample {
            t: p.spot.time_s,
            r: p.spot.place.right,
            h: p.spot.place.up,
            weight: weight(&p.spot),
            near: 0.0,
            near_weight: 0.0,
        };
        let used = |p: &&FlightPoint| p.use_ == SpotUse::Used(k);
        let arc: Vec<Sample> = self.points.iter().filter(used).map(sample).collect();
        let (lasting, g) = (self.fit.persistence.max(1.0).sqrt(), self.fit.gravity());
        let own = own_fall(&arc)
            .is_some_and(|(own, std)| (own - g).abs() > CARRIED_SIGMAS * lasting * std + CARRIED_PART * g);
        let few = (arc.len() as f64) < LEAST_FREE_PART * cut as f64;
        few || own || self.stays_level(k, &arc)
    }

    /// Takes from `ranges` the ends of arcs that may be of the other side of an impact, or in contact, and would not be told
    /// by their distance: such a point draws a short arc along. Whether there were any.
    fn trim_unsure_ends(&self, ranges: &mut [std::ops::Range<usize>]) -> bool {
        if !self.fit.forces.falls() {
            return false;
        }
        let before = ranges.to_vec();
        let near = |i: usize, jump: f64| {
            let std = variance(&self.points[i].spot, &self.extra).sqrt();
            (UNTOLD_SIGMAS * std / jump).min(NEAR_PART * self.interval_s)
        };
        let time = |i: usize| self.points[i].spot.time_s;
        for (k, t) in self.impacts.iter().enumerate() {
            let Some(t) = *t else { continue };
            let (m, n) = (self.fit.motion(k, t), self.fit.motion(k + 1, t));
            let jump = (n.vr - m.vr).hypot(n.vh - m.vh);
            // A short arc that would be lost by it keeps its point.
            let end = ranges[k].clone().find(|&i| time(i) > t - near(i, jump));
            if let Some(end) = end.filter(|&end| end >= ranges[k].start + LEAST_END_POINTS) {
                ranges[k].end = end;
            }
            let after = &mut ranges[k + 1];
            let start = after.clone().rev().find(|&i| time(i) < t + near(i, jump));
            if let Some(last) = start.filter(|&last| last + 1 + LEAST_END_POINTS <= after.end) {
                after.start = last + 1;
            }
        }
        if let (Some(last), Some((t, floor, speed))) = (ranges.last_mut(), self.lands_again()) {
            // Where the ball is clearly below, there is no floor as high as the last.
            let untold = |i: usize| {
                let spot = &self.points[i].spot;
                let lowest = UNTOLD_SIGMAS * variance(spot, &self.extra).sqrt() + LEVEL_PART * spot.radius;
                time(i) > t - near(i, speed) && spot.place.up > floor - lowest
            };
            // More of them than this would have been told: then it is another floor, or none.
            let end = last.clone().find(|&i| untold(i));
            if let Some(end) = end.filter(|end| last.end - end <= UNTOLD_POINTS) {
                last.end = end;
            }
        }
        ranges != before
    }

    /// When the last arc is back at the height of the impact before it, that height and the speed then: there is the next
    /// impact, of which nothing was found. `None` where the ball did not rise.
    fn lands_again(&self) -> Option<(f64, f64, f64)> {
        let last = self.fit.arcs() - 1;
        let t = (*self.impacts.last()?)?;
        let up = self
            .fit
            .planar(self.fit.parameters.as_slice())
            .return_time(last, t);
        let speed = self.fit.motion(last, t + up).vh.abs();
        (speed > 0.0).then(|| (t + up, self.fit.motion(last, t).h, speed))
    }

    /// Whether arc `k` is a few points that make impacts on something upright of what is one impact without them: the rest
    /// of a ball that something hides.
    fn is_detour(&self, k: usize) -> bool {
        let points = self.points.iter().filter(|p| p.use_ == SpotUse::Used(k)).count();
        let on_floor = |a: usize| {
            self.impacts[a].is_none_or(|t| {
                let (m, n) = (self.fit.motion(a, t), self.fit.motion(a + 1, t));
                n.vh - m.vh > (n.vr - m.vr).abs()
            })
        };
        let direct = || impact_between(&self.fit, &self.spans, k - 1, k + 1, self.interval_s);
        let falls = self.fit.forces.falls() && points <= WEAK_POINTS;
        falls && !(on_floor(k - 1) && on_floor(k)) && direct().is_some()
    }

    /// Whether the ball stays at one height on arc `k` and on after it.
    fn stays_level(&self, k: usize, arc: &[Sample]) -> bool {
        let end = self.spans[k].1;
        let behind = self.points.iter().filter(|p| p.spot.time_s > end);
        let heights: Vec<(f64, f64)> = behind
            .take(LEVEL_POINTS)
            .map(|p| (p.spot.place.up, 1.0 / variance(&p.spot, &self.extra)))
            .chain(arc.iter().map(|s| (s.h, s.weight)))
            .collect();
        if heights.len() < arc.len() + LEVEL_POINTS {
            return false;
        }
        let weights: f64 = heights.iter().map(|h| h.1).sum();
        let mean = heights.iter().map(|h| h.0 * h.1).sum::<f64>() / weights;
        let chi2: f64 = heights.iter().map(|h| (h.0 - mean).powi(2) * h.1).sum();
        chi2 < LEVEL_EXCESS * heights.len() as f64
    }

    /// How far arc `k` bends from the straight line between its ends, plane units.
    fn sagitta(&self, k: usize) -> f64 {
        let (from, to) = self.spans[k];
        self.fit.gravity() * (to - from).powi(2) / 8.0
    }

    fn is_convincing(&self, samples: &[Sample], ranges: &[std::ops::Range<usize>], sigma: f64) -> bool {
        let (from, to) = self.time_span();
        let within = self
            .points
            .iter()
            .filter(|p| p.spot.time_s >= from && p.spot.time_s <= to)
            .count();
        let free = self.used() as f64 >= LEAST_FREE_PART * within as f64;
        let met = self.impacts.iter().any(Option::is_some);
        let mut offs: Vec<f64> = Vec::new();
        let mut near = 0;
        for p in &self.points {
            let SpotUse::Used(k) = p.use_ else { continue };
            let m = self.fit.motion(k, p.spot.time_s);
            let off = (p.spot.place.right - m.r).hypot(p.spot.place.up - m.h);
            near += usize::from(off < (MOST_SCATTER * sigma).max(SAGITTA_PART * self.sagitta(k)));
            offs.push(off);
        }
        // A hand's swing is a parabola only roughly.
        let close = 2 * near > offs.len();
        let off = median(&mut offs);
        // The closer the points lie to the arcs, the lower a curve shows.
        let scatter = (2.0 * off).clamp(FINE_PART * sigma, sigma);
        let curved: usize = ranges
            .iter()
            .filter(|r| shows_fall(samples, r, self.fit.gravity(), scatter))
            .map(ExactSizeIterator::len)
            .sum();
        let all: usize = ranges.iter().map(ExactSizeIterator::len).sum();
        let curved = !self.fit.forces.falls() || curved as f64 >= LEAST_CURVED_PART * all as f64;
        free && close && curved && (met || self.used() >= LEAST_LONE_POINTS)
    }
}

/// An arc whose own curvature contradicts the common fall is carried, not thrown.
fn is_free_flight(samples: &[Sample], gravity: f64, falls: bool) -> bool {
    if samples.len() < 5 || !falls {
        return true;
    }
    own_fall(samples).is_none_or(|(g, std)| Fall::Known(gravity).agrees(g, std))
}

/// Joins neighbouring arcs that are one flight: their points lie on one arc, or no impact stands between them (an
/// outlier, a gap, air drag or an error that lasts for some frames had cut them).
fn join(samples: &[Sample], ranges: Vec<std::ops::Range<usize>>, fall: Fall) -> Vec<std::ops::Range<usize>> {
    let mut joined: Vec<std::ops::Range<usize>> = Vec::new();
    for r in ranges {
        if let Some(last) = joined.last_mut() {
            let (a, b) = (&samples[last.clone()], &samples[r.clone()]);
            let both: Vec<Sample> = a.iter().chain(b).copied().collect();
            let apart = segment::misfit(a, fall) + segment::misfit(b, fall);
            let whole = segment::misfit(&both, fall);
            // 36: what segmentation charges for a cut, and a margin.
            if whole - apart < 36.0 || !impact_stands_between(a, b, fall) {
                *last = last.start..r.end;
                continue;
            }
        }
        joined.push(r);
    }
    joined
}

/// An impact changes the velocity by more than this part of it, or turns a fall into a rise.
const LEAST_JUMP: f64 = 0.25;

/// Parts of one flight miss each other by no more than this many standard deviations, and a part of their way (drag).
const MOST_APART_SIGMAS: f64 = 6.0;

/// Points on each side of a seam that tell what happens there.
const SEAM_POINTS: usize = 12;

/// Way covered by the shorter of two stretches.
fn shorter_way(a: &[Sample], b: &[Sample]) -> f64 {
    let way = |s: &[Sample]| (s[s.len() - 1].h - s[0].h).hypot(s[s.len() - 1].r - s[0].r);
    way(a).min(way(b))
}

/// Whether the velocities of two neighbouring stretches differ as by an impact where they meet.
fn impact_stands_between(a: &[Sample], b: &[Sample], fall: Fall) -> bool {
    // Near the seam: over a long stretch drag or perspective would pass for a jump.
    let (a, b) = (
        &a[a.len().saturating_sub(SEAM_POINTS)..],
        &b[..b.len().min(SEAM_POINTS)],
    );
    let (Some(end), Some(start)) = (a.last(), b.first()) else {
        return false;
    };
    let t = 0.5 * (end.t + start.t);
    let (Some(before), Some(after)) = (segment::velocity(a, fall, t), segment::velocity(b, fall, t)) else {
        return true;
    };
    let jump = (after.0 - before.0).hypot(after.1 - before.1);
    // One flight is in one place where its parts meet; else they are two things.
    if let (Some(p), Some(q)) = (segment::place(a, fall, t), segment::place(b, fall, t)) {
        let sigma = 1.0 / end.weight.sqrt();
        if (p.0 - q.0).hypot(p.1 - q.1) > MOST_APART_SIGMAS * sigma + 0.02 * shorter_way(a, b) {
            return true;
        }
    }
    // Against the fastest that either is: at an apex every jump is large against the speed there.
    let fast = |part: &[Sample], t: f64| segment::velocity(part, fall, t).map_or(0.0, |v| v.0.hypot(v.1));
    let speed = [
        fast(a, a[0].t),
        fast(a, end.t),
        fast(b, start.t),
        fast(b, b[b.len() - 1].t),
    ]
    .into_iter()
    .fold(0.0, f64::max);
    // Near an apex cut in two the sign of the rise is noise: the turn must be worth the gap's fall at least.
    let turn = match fall {
        Fall::Known(g) if g > 0.0 => {
            let least = 2.0 * g * (start.t - end.t) + 0.5 * LEAST_JUMP * speed;
            before.1 < 0.0 && after.1 > 0.0 && after.1 - before.1 > least
        }
        // Where nothing falls, nothing bends a path but an impact.
        Fall::Known(g) => g == 0.0,
        Fall::Free | Fall::Overhead(_) => true,
    };
    jump > LEAST_JUMP * speed || turn
}

/// Arcs are fitted together, which takes memory and time as the square of their number; a ball that bounces more often
/// is measured on this many successive arcs.
const MOST_ARCS: usize = 40;

/// The successive arcs, at most [`MOST_ARCS`], that hold the most points.
fn richest_run(ranges: Vec<std::ops::Range<usize>>) -> Vec<std::ops::Range<usize>> {
    let points = |run: &[std::ops::Range<usize>]| run.iter().map(ExactSizeIterator::len).sum::<usize>();
    match ranges.windows(MOST_ARCS).max_by_key(|run| points(run)) {
        Some(run) => run.to_vec(),
        None => ranges,
    }
}

/// The run of arcs with the most points in which each follows the last within a second or ten frames.
fn longest_chain(
    samples: &[Sample],
    ranges: Vec<std::ops::Range<usize>>,
    interval_s: f64,
) -> Vec<std::ops::Range<usize>> {
    let patience_s = (10.0 * interval_s).max(1.0);
    let mut chains: Vec<Vec<std::ops::Range<usize>>> = Vec::new();
    for r in ranges {
        match chains.last_mut() {
            Some(chain)
                if chain
                    .last()
                    .is_some_and(|l| samples[r.start].t - samples[l.end - 1].t < patience_s) =>
            {
                chain.push(r);
            }
            _ => chains.push(vec![r]),
        }
    }
    chains
        .into_iter()
        .max_by_key(|c| c.iter().map(ExactSizeIterator::len).sum::<usize>())
        .unwrap_or_default()
}

/// Fits, sets aside what does not fit, and fits again until nothing changes; with what centres scatter by beyond their
/// own uncertainty.
fn fit_and_set_aside(
    spots: &[Spot],
    track: &Track,
    uses: &mut [SpotUse],
    arcs: usize,
    forces: Forces,
) -> Option<(ArcFit, Extra)> {
    let mut extra = Extra::default();
    for _ in 0..12 {
        let now = ArcFit::new(&fit_points(spots, track, uses, &extra), arcs, forces)?;
        extra = Extra::robust(&distances(spots, track, uses, &now, &extra));
        let looks: Vec<Option<Look>> = looks(spots, track, uses, &now, &extra);
        // Of few points one that is off draws its arc along, and the others seem to be: the worst goes first.
        let mut counts = vec![0_usize; arcs];
        let mut worst = vec![0.0_f64; arcs];
        for look in looks.iter().flatten().filter(|l| l.used) {
            counts[look.arc] += 1;
            worst[look.arc] = worst[look.arc].max(look.sigmas);
        }
        let mut changed = false;
        for (use_, look) in uses.iter_mut().zip(&looks) {
            let Some(look) = look else { continue };
            let spared = look.used && counts[look.arc] < FEW_POINTS && look.sigmas < worst[look.arc];
            let off = look.sigmas > OFF_SIGMAS && !spared;
            changed |= off == look.used;
            *use_ = if off {
                SpotUse::Off(look.distance)
            } else {
                SpotUse::Used(look.arc)
            };
        }
        if !changed {
            break;
        }
    }
    // The last verdicts enter.
    settled(spots, track, uses, arcs, forces, extra)
}

/// The fit to the points in use, which tell their own scatter.
fn settled(
    spots: &[Spot],
    track: &Track,
    uses: &[SpotUse],
    arcs: usize,
    forces: Forces,
    mut extra: Extra,
) -> Option<(ArcFit, Extra)> {
    let mut fit = ArcFit::new(&fit_points(spots, track, uses, &extra), arcs, forces)?;
    for _ in 0..4 {
        extra = Extra::efficient(&distances(spots, track, uses, &fit, &extra));
        fit = ArcFit::new(&fit_points(spots, track, uses, &extra), arcs, forces)?;
    }
    Some((fit, extra))
}

/// On an arc of fewer points than this, those that are off are set aside one by one.
const FEW_POINTS: usize = 12;

/// A spot against its arc.
struct Look {
    arc: usize,
    used: bool,
    /// Distance to the arc, plane units.
    distance: f64,
    /// The same in standard deviations of what such a distance should be: less for a point that the arc follows, more for
    /// one that it was not fitted to.
    sigmas: f64,
}

/// Every spot that is or may be used, against its arc.
fn looks(spots: &[Spot], track: &Track, uses: &[SpotUse], fit: &ArcFit, extra: &Extra) -> Vec<Option<Look>> {
    // Σw, Σw t, Σw t² of each arc, times from its mean one.
    let mut sums = vec![[0.0_f64; 3]; fit.arcs()];
    for (&i, u) in track.iter().zip(uses) {
        if let SpotUse::Used(k) = *u {
            let (w, t) = (1.0 / variance(&spots[i], extra), spots[i].time_s - fit.times[k]);
            for (sum, power) in sums[k].iter_mut().zip([1.0, t, t * t]) {
                *sum += w * power;
            }
        }
    }
    let look = |i: usize| -> Option<Look> {
        let (arc, used) = match uses[i] {
            SpotUse::Used(k) => (k, true),
            SpotUse::Off(_) => (nearest_arc(uses, i)?, false),
            _ => return None,
        };
        let spot = &spots[track[i]];
        let (m, own) = (fit.motion(arc, spot.time_s), variance(spot, extra));
        let distance = (spot.place.right - m.r).hypot(spot.place.up - m.h);
        let [s0, s1, s2] = sums[arc];
        let t = spot.time_s - fit.times[arc];
        // Variance of a straight line's place at t, over the point's own.
        let line = (s2 - 2.0 * t * s1 + t * t * s0) / (s0 * s2 - s1 * s1) / own;
        let line = if line.is_finite() { line } else { 0.0 };
        let share = if used {
            1.0 - line.clamp(0.0, MOST_FOLLOWED)
        } else {
            1.0 + line
        };
        Some(Look {
            arc,
            used,
            distance,
            sigmas: distance / (2.0 * own * share).sqrt(),
        })
    };
    (0..track.len()).map(look).collect()
}

/// Part of a point's error that its arc follows, at most: of three points, 5/6 at the ends.
const MOST_FOLLOWED: f64 = 0.85;

/// The arc that too few points are left on to be fitted, `None` where each has enough.
fn emptied_arc(uses: &[SpotUse], arcs: usize) -> Option<usize> {
    let left = |k: usize| uses.iter().filter(|u| **u == SpotUse::Used(k)).count();
    (0..arcs)
        .min_by_key(|&k| left(k))
        .filter(|&k| left(k) < LEAST_FIT_POINTS)
}

/// Fewer points than this have no arc: two coordinates with a place and a velocity each, and a point that checks them.
const LEAST_FIT_POINTS: usize = 3;

/// Variance of a coordinate of a spot, plane units².
fn variance(spot: &Spot, extra: &Extra) -> f64 {
    extra.variance(spot.std * spot.std, spot.coded)
}

/// The used points' distances to their arcs. An arc of n points with weights w follows each by about 2 w/Σw (two
/// unknowns a coordinate).
fn distances(spots: &[Spot], track: &Track, uses: &[SpotUse], fit: &ArcFit, extra: &Extra) -> Vec<Distance> {
    let used = || {
        track.iter().zip(uses).filter_map(|(&i, u)| match u {
            SpotUse::Used(k) => Some((&spots[i], *k)),
            _ => None,
        })
    };
    let mut weights = vec![0.0; fit.arcs()];
    for (s, k) in used() {
        weights[k] += 1.0 / variance(s, extra);
    }
    used()
        .map(|(s, k)| {
            let m = fit.motion(k, s.time_s);
            Distance {
                square: (s.place.right - m.r).powi(2) + (s.place.up - m.h).powi(2),
                own: s.std * s.std,
                coded: s.coded,
                leverage: (2.0 / (variance(s, extra) * weights[k])).min(0.9),
            }
        })
        .collect()
}

/// The arc of the nearest used point before or after.
fn nearest_arc(uses: &[SpotUse], i: usize) -> Option<usize> {
    let arc = |u: &SpotUse| match u {
        SpotUse::Used(k) => Some(*k),
        _ => None,
    };
    let before = uses[..i].iter().rev().find_map(arc);
    let after = uses[i + 1..].iter().find_map(arc);
    match (before, after) {
        (Some(a), Some(b)) if a == b => Some(a),
        _ => None,
    }
}

fn fit_points(spots: &[Spot], track: &Track, uses: &[SpotUse], extra: &Extra) -> Vec<FitPoint> {
    track
        .iter()
        .zip(uses)
        .filter_map(|(&i, u)| match u {
            SpotUse::Used(arc) => Some(fit_point(&spots[i], *arc, extra)),
            _ => None,
        })
        .collect()
}

fn fit_point(spot: &Spot, arc: usize, extra: &Extra) -> FitPoint {
    FitPoint {
        arc,
        sample: Sample {
            t: spot.time_s,
            r: spot.place.right,
            h: spot.place.up,
            weight: 1.0 / variance(spot, extra),
            near: 0.0,
            near_weight: 0.0,
        },
    }
}

fn finish(
    spots: &[Spot],
    track: &Track,
    mut uses: Vec<SpotUse>,
    (fit, extra): (ArcFit, Extra),
    interval_s: f64,
) -> Flight {
    let mut spans = vec![(f64::INFINITY, f64::NEG_INFINITY); fit.arcs()];
    for (&i, u) in track.iter().zip(&uses) {
        if let SpotUse::Used(k) = u {
            spans[*k].0 = spans[*k].0.min(spots[i].time_s);
            spans[*k].1 = spans[*k].1.max(spots[i].time_s);
        }
    }
    let impacts: Vec<Option<f64>> = (1..fit.arcs())
        .map(|k| impact_between(&fit, &spans, k - 1, k, interval_s))
        .collect();
    for (&i, u) in track.iter().zip(&mut uses) {
        let near = |t: &f64| (spots[i].time_s - t).abs() < 1.5 * interval_s;
        if matches!(u, SpotUse::Off(_) | SpotUse::NotFree) && impacts.iter().flatten().any(near) {
            *u = SpotUse::Contact;
        }
    }
    let points = track
        .iter()
        .zip(uses)
        .map(|(&i, use_)| FlightPoint { spot: spots[i], use_ })
        .collect();
    Flight {
        points,
        fit,
        extra,
        spans,
        impacts,
        interval_s,
    }
}

/// Two arcs meet in an impact when they come together between their points, within what is known of them.
fn impact_between(fit: &ArcFit, spans: &[(f64, f64)], a: usize, b: usize, interval_s: f64) -> Option<f64> {
    if let Forces::Overhead(known) = &fit.forces {
        return overhead::find::impact_between(fit, known, spans, a, interval_s);
    }
    let (t, gap) = fit.planar(fit.parameters.as_slice()).meeting(a, b)?;
    let slack = 1.5 * interval_s;
    let in_between = t > spans[a].1 - slack && t < spans[b].0 + slack;
    let m = fit.motion(a, t);
    let n = fit.motion(b, t);
    let jump = (n.vr - m.vr).hypot(n.vh - m.vh);
    // Within a frame's motion the arcs may miss each other (a soft contact, a hand-held camera), not by more.
    let close = gap < 1.5 * jump * interval_s;
    // Measured as speed at one height: the two arcs are compared at the same place.
    let (before, after) = (m.vr.hypot(m.vh), n.vr.hypot(n.vh));
    let noise = gap / interval_s;
    let loses = after * after <= MOST_ENERGY_GAIN * (before + noise) * (before + noise);
    // A floor gives back no more of the fall than there was: what rises faster is another thing (a shadow, a reflection)
    // that met the ball there.
    let falls = m.vh < 0.0 && n.vh > 0.0 && n.vh - m.vh > (n.vr - m.vr).abs();
    let rises_less = !falls || n.vh * n.vh <= MOST_ENERGY_GAIN * (m.vh.abs() + noise).powi(2);
    (in_between && close && loses && rises_less).then_some(t)
}

#[cfg(test)]
mod tests;
