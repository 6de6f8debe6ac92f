//! A ball seen from the side: parabolas in the calibrated plane, bent by drag, with one fall for all arcs.
//!
//! Gravity is fitted. What is known of "up" is a prior of the fall's lean unless the fall contradicts it; drag comes with a
//! prior, and with the way it changes with the speed, where the ball's mass and size are known, and is else believed where it
//! shows. Among the tracks of a recording the ball's is the one whose arcs show most of one common fall: those of a hand, a
//! person, a swinging cloth have each their own.

use super::drag::{Drag, DragLaw, USUAL_LIGHT_DRAG};
use super::flight_search::{FlightSearch, TrackCandidate};
use super::free_flight::Flight;
use super::linking::{LinkedSpots, Spot, Track, median_radius};
use super::motion_model::{ArcFit, FitPoint, MotionModel, VerticalPrior};
use super::parabola::{self, Fall, Gravity, own_gravity};
use super::planar::{DRAG, GRAVITY, Motion};
use super::planar_fit::{self, PlanarPriors};
use super::samples::{SAGITTA_SIGMAS, fine_sigma, samples_of, segment_sigma, shows_fall};
use super::scale_change::ScaleChange;
use super::segment::TrackSample;
use super::{arc_search, impact_test, path};
use crate::geometry::PlanePoint;
use crate::quantity::Quantity;
use nalgebra::DVector;
use std::ops::Range;
use std::sync::Arc;

/// What is known of the forces on a ball seen from the side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideView {
    /// Of "up".
    pub vertical: VerticalPrior,
    /// Of drag; `None`: drag is fitted where the flight shows it.
    pub drag: Option<Drag>,
    /// How far arcs may be bent by what nothing here knows, a part of their way; see `flight::bend`.
    pub bend: Option<f64>,
    /// How the scale changes over the picture or in time, where it does.
    pub scale_change: Option<ScaleChange>,
    /// The ball's radius as the calibration has it, plane units; `None` where it does not tell.
    pub ball_radius: Option<f64>,
}

/// A ball is seen as large as its calibration has it to so much in the logarithm: an outline is blurred, a plane seen at a slant.
const LN_SIZE_STD: f64 = 0.2;

/// In this part of calibrations the radius is wrong (it is the diameter, or another ball's).
const WRONG_SIZE_PART: f64 = 0.1;

/// Drag without a prior is believed when it stands out by this many standard uncertainties.
const DRAG_SIGMAS: f64 = 4.0;

/// What is known of "up" is contradicted by a fall that leans by more than this many standard uncertainties.
const CONTRADICTS_SIGMAS: f64 = 4.0;

/// And whatever is tolerated, by one that leans by more than this many.
const CERTAIN_SIGMAS: f64 = 8.0;

impl SideView {
    /// Nothing known of drag.
    #[must_use]
    pub const fn new(vertical: VerticalPrior) -> Self {
        Self {
            vertical,
            drag: None,
            bend: None,
            scale_change: None,
            ball_radius: None,
        }
    }

    /// How likely the ball is to be seen with this radius, from 0 to 1.
    fn likelihood_of_size(&self, radius: f64) -> f64 {
        self.ball_radius.map_or(1.0, |known| {
            let off = (radius / known).ln() / LN_SIZE_STD;
            WRONG_SIZE_PART + (1.0 - WRONG_SIZE_PART) * (-0.5 * off * off).exp()
        })
    }

    fn priors(&self) -> PlanarPriors {
        PlanarPriors {
            vertical: Some(self.vertical),
            drag: self.drag,
            bend: self.bend,
            scale_change: self.scale_change,
        }
    }

    /// The fit with what is known of "up" as it stands.
    fn fit_with_prior(&self, points: &[FitPoint], arcs: usize) -> Option<ArcFit> {
        let fit = |drag_is_fitted: bool| {
            planar_fit::fit(points, arcs, &self.priors(), drag_is_fitted, Arc::new(*self))
        };
        let dragged = fit(true);
        match self.drag {
            // No ball is driven by the air: where nothing is known of its drag and the points show less than none, it has none.
            Some(prior) => match dragged {
                Some(f) if prior.beta == 0.0 && !(f.drag() > 0.0) => fit(false),
                other => other,
            },
            None => {
                let plain = fit(false)?;
                let shows = |f: &ArcFit| {
                    let std = f.covariance[(DRAG, DRAG)].max(0.0).sqrt();
                    f.drag() > DRAG_SIGMAS * std && f.reduced_chi < plain.reduced_chi
                };
                Some(dragged.filter(shows).unwrap_or(plain))
            }
        }
    }

    /// Whether the lean of a fit that knows nothing of "up" contradicts what is known of it.
    fn is_contradicted_by(&self, fit: &ArcFit) -> bool {
        let std = fit.lean_std_rad().hypot(self.vertical.std_rad);
        // What stands out as much as that is no chance, however small it is.
        let tolerated = self.vertical.tolerated_rad.min(CERTAIN_SIGMAS * std);
        fit.lean_rad().abs() > (CONTRADICTS_SIGMAS * std).max(tolerated)
    }
}

impl MotionModel for SideView {
    fn fit(&self, points: &[FitPoint], arcs: usize) -> Option<ArcFit> {
        let with_prior = || self.fit_with_prior(points, arcs);
        if !self.vertical.std_rad.is_finite() {
            return with_prior();
        }
        let vertical = VerticalPrior::UNKNOWN;
        let free = || Self { vertical, ..*self }.fit_with_prior(points, arcs);
        let (free, with_prior) = rayon::join(free, with_prior);
        free.filter(|f| self.is_contradicted_by(f)).or(with_prior)
    }

    fn response(&self, fit: &ArcFit, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        planar_fit::response(fit, points, shifts, &self.priors())
    }

    fn impact_between(&self, fit: &ArcFit, spans: &[(f64, f64)], k: usize, interval_s: f64) -> Option<f64> {
        impact_test::impact_between(fit, spans, k, k + 1, interval_s)
    }

    fn falls_in_plane(&self) -> bool {
        true
    }

    fn vertical_prior(&self) -> Option<VerticalPrior> {
        Some(self.vertical)
    }

    fn with_unknowns(&self, vertical: VerticalPrior, ball_radius: f64) -> Option<Arc<dyn MotionModel>> {
        // Without a drag that is not known, a lean of the fall would take the place of what drag does along the path.
        let light = || (ball_radius > 0.0).then(|| Drag::unknown(USUAL_LIGHT_DRAG / ball_radius));
        let drag = self.drag.or_else(light);
        let open = Self {
            vertical,
            drag,
            ..*self
        };
        (open != *self).then(|| Arc::new(open) as Arc<dyn MotionModel>)
    }

    fn motion_in_picture(&self, parameters: &[f64], times: &[f64], k: usize, t: f64) -> Motion {
        let m = self.motion_in_plane(parameters, times, k, t);
        self.scale_change
            .map_or(m, |change| change.seen(ScaleChange::of(parameters), t, &m))
    }

    fn magnification(&self, fit: &ArcFit, k: usize, t: f64) -> f64 {
        let m = fit.in_plane(fit.parameters.as_slice(), k, t);
        self.scale_change.map_or(1.0, |change| {
            change.magnification(ScaleChange::of(fit.parameters.as_slice()), t, &m)
        })
    }

    fn place_in_plane(&self, fit: &ArcFit, place: PlanePoint, _k: usize, t: f64) -> PlanePoint {
        self.mark_in_plane(fit.parameters.as_slice(), place, t)
    }

    fn mark_in_plane(&self, parameters: &[f64], place: PlanePoint, t: f64) -> PlanePoint {
        self.scale_change.map_or(place, |change| {
            let now = ScaleChange::of(parameters);
            let (right, up) = change.place_in_plane(now, t, (place.right, place.up));
            PlanePoint::new(right, up)
        })
    }

    fn fall_ratio(&self, points: &[FitPoint], arcs: usize) -> Option<Quantity> {
        let change = self.scale_change?;
        let (given, _) = change.fall?;
        let open = Self {
            scale_change: Some(ScaleChange { fall: None, ..change }),
            ..*self
        };
        let fit = open.fit(points, arcs)?;
        let std = fit.covariance[(GRAVITY, GRAVITY)].max(0.0).sqrt();
        Quantity::new(fit.gravity() / given, std / given)
    }

    fn with_scale_change(&self, change: ScaleChange) -> Option<Arc<dyn MotionModel>> {
        let scale_change = Some(change);
        Some(Arc::new(Self {
            scale_change,
            ..*self
        }))
    }

    fn bend(&self) -> Option<f64> {
        self.bend
    }

    fn with_bend(&self, part: f64) -> Option<Arc<dyn MotionModel>> {
        let bend = Some(part);
        Some(Arc::new(Self { bend, ..*self }))
    }

    fn drag_law(&self) -> DragLaw {
        self.drag.map_or_else(DragLaw::default, |d| d.law)
    }
}

impl FlightSearch for SideView {
    fn candidate(&self, spots: &[Spot], leaning: bool) -> Option<TrackCandidate> {
        let sigma = segment_sigma(spots, self.segmentation_part_of_radius());
        let samples = samples_of(spots, sigma);
        let arcs = parabola::arcs(&samples, Fall::Free { leaning });
        let mut least = sigma;
        let mut falling = falling_arcs(&samples, &arcs, sigma);
        if falling.is_empty() {
            least = fine_sigma(spots, sigma);
            falling = falling_arcs(&samples, &arcs, least);
        }
        let (agree, gravity) = common_fall(&falling, leaning)?;
        // Much of the track must be in that fall, or it is a hand that happened to swing like it.
        let falls_for: usize = agree.iter().map(|a| a.points).sum();
        let sagittas: f64 = agree.iter().map(|a| a.sagitta / sigma).sum();
        let known = parabola::arcs(&samples, Fall::Known(gravity));
        let long = known.iter().filter(|a| a.len() >= 4);
        let covered: usize = long.map(ExactSizeIterator::len).sum();
        let mut curved = known
            .iter()
            .filter(|a| shows_fall(&samples, a, gravity.down, least));
        let first = curved.next()?;
        let last = curved.next_back().unwrap_or(first);
        let enough = falls_for >= 6 && covered >= 6;
        enough.then(|| TrackCandidate {
            gravity,
            evidence: covered as f64 * sagittas.sqrt() * self.likelihood_of_size(median_radius(spots)),
            span: (samples[first.start].t, samples[last.end - 1].t),
        })
    }

    /// Others that are the same ball before or after it: of the same size, never seen beside it where it falls, and the path of both is
    /// likelier than that of one, with its fall.
    fn with_continuations(
        &self,
        linked: &LinkedSpots,
        track: &Track,
        best: &TrackCandidate,
        leaning: bool,
    ) -> Vec<Track> {
        let radius = median_radius(&linked.of(track));
        let time_s = |i: &usize| linked.spots[*i].time_s;
        let alike = |t: &&Track| {
            let spots = linked.of(t);
            *t != track
                && t.len() >= LEAST_JOINED
                && (median_radius(&spots) / radius - 1.0).abs() < ALIKE_PART
        };
        let mut others: Vec<&Track> = linked.tracks.iter().filter(alike).collect();
        // The nearest in time first.
        let away = |t: &Track| -> f64 {
            let (from, to) = (time_s(&t[0]), time_s(&t[t.len() - 1]));
            (from - best.span.1).max(best.span.0 - to).max(0.0)
        };
        others.sort_by(|a, b| away(a).total_cmp(&away(b)));
        let mut whole = track.clone();
        let mut stages = vec![whole.clone()];
        let likelihood = |t: &Track| path::divided(&linked.of(t), Some(best.gravity), &path::SCATTERS).gain;
        let mut gain = likelihood(&whole);
        let mut joined_so_far = 0;
        for other in others {
            // Where both were seen (two things met, and each track went on with the other) either may be right.
            let (from, to) = (time_s(&other[0]), time_s(&other[other.len() - 1]));
            let within = |i: &&usize| (from..=to).contains(&time_s(i));
            let seen = |i: &&usize| {
                !whole
                    .iter()
                    .any(|k| linked.spots[*k].frame == linked.spots[**i].frame)
            };
            let outside: Track = whole.iter().filter(|i| !within(i)).copied().collect();
            let beside: Track = other.iter().filter(seen).copied().collect();
            if beside.len() < LEAST_JOINED && self.candidate(&linked.of(other), leaning).is_none() {
                continue;
            }
            if joined_so_far == MOST_JOINED {
                break;
            }
            joined_so_far += 1;
            let joined = [(&whole, &beside), (&outside, other)].map(|(ours, theirs)| {
                let mut joined = [&ours[..], &theirs[..]].concat();
                joined.sort_unstable();
                (likelihood(&joined), joined)
            });
            let best = joined.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((more, joined)) = best.filter(|(more, _)| *more > gain + JOINED_GAIN) {
                (whole, gain) = (joined, more);
                stages.push(whole.clone());
            }
        }
        stages
    }

    fn flight_along(&self, spots: &[Spot], gravity: Gravity, interval_s: f64) -> Option<Flight> {
        arc_search::flight_along(spots, gravity, self, interval_s)
    }
}

/// Fewer sightings than this are not joined to a track, nor are more others tried than this.
const LEAST_JOINED: usize = 4;
const MOST_JOINED: usize = 40;

/// What joining two tracks must gain, squared standard deviations.
const JOINED_GAIN: f64 = 16.0;

/// Tracks of one ball have radii that differ by less than this part.
const ALIKE_PART: f64 = 0.25;

/// An arc whose own curve shows a fall.
struct CurvedArc {
    own: Gravity,
    /// Of both components.
    std: f64,
    points: usize,
    sagitta: f64,
}

/// Those of `arcs` whose sagitta stands out from `sigma`.
fn falling_arcs(samples: &[TrackSample], arcs: &[Range<usize>], sigma: f64) -> Vec<CurvedArc> {
    let curved = arcs.iter().filter(|a| a.len() >= 5).filter_map(|a| {
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
}

/// The fall that most of the arcs' weight agrees with, and the arcs that do; `None` of no arcs.
fn common_fall(falling: &[CurvedArc], leaning: bool) -> Option<(Vec<&CurvedArc>, Gravity)> {
    let agreeing = |g: f64| {
        falling
            .iter()
            .filter(move |a| (a.own.down - g).abs() < 4.0 * a.std + 0.12 * g)
    };
    let weight = |g: f64| agreeing(g).map(|a| a.points as f64).sum::<f64>();
    let centre = falling
        .iter()
        .max_by(|a, b| weight(a.own.down).total_cmp(&weight(b.own.down)))?;
    let agree: Vec<&CurvedArc> = agreeing(centre.own.down).collect();
    let information: f64 = agree.iter().map(|a| 1.0 / (a.std * a.std)).sum();
    let mean =
        |of: fn(&CurvedArc) -> f64| agree.iter().map(|a| of(a) / (a.std * a.std)).sum::<f64>() / information;
    let gravity = Gravity {
        down: mean(|a| a.own.down),
        across: if leaning { mean(|a| a.own.across) } else { 0.0 },
    };
    Some((agree, gravity))
}
