//! Which of the tracks is the ball's: the one with the most evidence of one common fall, and those of the same ball before
//! and after it.

use super::fit::Forces;
use super::linking::{Spot, Track};
use super::samples::{SAGITTA_SIGMAS, fine_sigma, samples_of, segment_sigma, shows_fall};
use super::segment::{self, Fall, Gravity, own_gravity};
use super::{median, overhead};

/// A track that may be the ball's.
pub(super) struct TrackCandidate {
    pub(super) track: Track,
    pub(super) gravity: Gravity,
    pub(super) evidence: f64,
    /// First and last time of the arcs that fall, s.
    span: (f64, f64),
}

impl TrackCandidate {
    pub(super) fn new(spots: &[Spot], track: &Track, forces: Forces, leaning: bool) -> Option<Self> {
        let sigma = segment_sigma(spots, track, forces);
        let samples = samples_of(spots, track, sigma);
        if let Forces::Overhead(known) = forces {
            return Some(Self {
                track: track.clone(),
                gravity: Gravity::NONE,
                evidence: overhead::search::evidence(spots, track, sigma, known)?,
                span: (samples.first()?.t, samples.last()?.t),
            });
        }
        if !forces.falls() {
            let found = segment::arcs(&samples, Fall::Known(Gravity::NONE));
            let covered: usize = found.iter().map(ExactSizeIterator::len).sum();
            let (first, last) = (samples.first()?, samples.last()?);
            let path = (last.r - first.r).hypot(last.h - first.h);
            let moves = path > 10.0 * sigma && covered >= 6;
            let evidence = covered as f64 * path / sigma;
            return moves.then(|| Self {
                track: track.clone(),
                gravity: Gravity::NONE,
                evidence,
                span: (first.t, last.t),
            });
        }
        let found = segment::arcs(&samples, Fall::Free { leaning });
        let falling_beyond = |sigma: f64| -> Vec<CurvedArc> {
            let curved = found.iter().filter(|a| a.len() >= 5).filter_map(|a| {
                let part = &samples[a.clone()];
                let (own, std) = own_gravity(part)?;
                let duration = part[part.len() - 1].t - part[0].t;
                let sagitta = own.down * duration * duration / 8.0;
                (sagitta > SAGITTA_SIGMAS * sigma).then_some(CurvedArc {
                    own,
                    std,
                    points: a.len(),
                    sagitta,
                })
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
                .filter(move |a| (a.own.down - g).abs() < 4.0 * a.std + 0.12 * g)
                .collect::<Vec<_>>()
        };
        let weight = |g: f64| agreeing(g).iter().map(|a| a.points as f64).sum::<f64>();
        let centre = falling
            .iter()
            .max_by(|a, b| weight(a.own.down).total_cmp(&weight(b.own.down)))?
            .own
            .down;
        let agree = agreeing(centre);
        let information: f64 = agree.iter().map(|a| 1.0 / (a.std * a.std)).sum();
        let mean = |of: fn(&CurvedArc) -> f64| {
            agree.iter().map(|a| of(a) / (a.std * a.std)).sum::<f64>() / information
        };
        let gravity = Gravity {
            down: mean(|a| a.own.down),
            across: if leaning { mean(|a| a.own.across) } else { 0.0 },
        };
        // Much of the track must be in that fall, or it is a hand that happened to swing like it.
        let falls_for: usize = agree.iter().map(|a| a.points).sum();
        let sagittas: f64 = agree.iter().map(|a| a.sagitta / sigma).sum();
        let known = segment::arcs(&samples, Fall::Known(gravity));
        let covered: usize = known
            .iter()
            .filter(|a| a.len() >= 4)
            .map(ExactSizeIterator::len)
            .sum();
        let enough = falls_for >= 6 && covered >= 6;
        let curved: Vec<_> = known
            .iter()
            .filter(|a| shows_fall(&samples, a, gravity.down, least))
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

/// An arc whose own curve shows a fall.
struct CurvedArc {
    own: Gravity,
    /// Of both components.
    std: f64,
    points: usize,
    sagitta: f64,
}

/// The best track with others that are the same ball before or after it (it left the picture, or was hidden): of the
/// same size, not at the same time, with arcs of the same fall that lead to it.
pub(super) fn with_continuations(
    spots: &[Spot],
    tracks: &[Track],
    best: &TrackCandidate,
    forces: Forces,
    leaning: bool,
) -> Track {
    let mut whole = best.track.clone();
    match forces {
        Forces::Fall(_) | Forces::FallWithDrag(..) => {}
        Forces::Overhead(_) => return overhead::search::with_continuations(spots, tracks, whole),
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
        let Some(other) = TrackCandidate::new(spots, track, forces, leaning).filter(|_| alike) else {
            continue;
        };
        let (from, to) = other.span;
        let apart = spans.iter().all(|s| to < s.0 || from > s.1);
        let same_fall = (other.gravity.down / best.gravity.down - 1.0).abs() < 0.15;
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
