//! Round things of successive frames, joined into tracks: the same thing seen again.
//!
//! Frame by frame, the likeliest pair of a track and a sighting first: by a constant-velocity prediction, which an impact breaks
//! and a missing frame misplaces, and by the looks. Whether a track flies freely is not asked here.

use crate::frames::Coded;
use crate::geometry::PlanePoint;
use crate::numeric::robust::median;
use std::f64::consts::{PI, SQRT_2};

/// A round thing in one frame, in the plane of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// The caller's number for it.
    pub id: usize,
    /// Frame in presentation order.
    pub frame: usize,
    /// Time, s.
    pub time_s: f64,
    /// Centre, plane units.
    pub place: PlanePoint,
    /// Standard uncertainty of each coordinate by the frame's own pixels, plane units.
    pub std: f64,
    /// How the frame is stored: what the codec adds to the uncertainty differs.
    pub coded: Coded,
    /// Radius, plane units.
    pub radius: f64,
    /// Brightness over the background, grey levels.
    pub contrast_grey: f64,
}

/// Spots of one thing in time order: indices into the list of spots.
pub type Track = Vec<usize>;

/// A track ends after this long without a match: a ball hidden behind a pole, or frames in which the hand spoils its
/// outline.
const PATIENCE_S: f64 = 0.2;

/// A track survives at least this many missing frames at low frame rates.
const PATIENCE_FRAMES: usize = 4;

/// What moves less than this from where it was first seen, in its radii, stays there.
const LEAST_WAY_RADII: f64 = 2.0;

/// Spots of a recording with their tracks: linked once, for all who ask what moves.
#[derive(Debug, Clone)]
pub struct LinkedSpots {
    /// In time order; any number a frame.
    pub spots: Vec<Spot>,
    /// The longest first.
    pub tracks: Vec<Track>,
}

impl LinkedSpots {
    /// Joins `spots` (in time order; any number a frame) into tracks.
    #[must_use]
    pub fn new(spots: Vec<Spot>) -> Self {
        let tracks = link(&spots);
        Self { spots, tracks }
    }

    /// The spots of a track.
    #[must_use]
    pub fn of(&self, track: &Track) -> Vec<Spot> {
        track.iter().map(|&i| self.spots[i]).collect()
    }

    /// The spots of at most so many tracks, of at least so many spots, whose thing leaves its place: those first that sweep the largest area, which
    /// noise that is linked at random does not.
    #[must_use]
    pub fn sweeping(&self, least_spots: usize, most_tracks: usize) -> Vec<Vec<Spot>> {
        let mut swept: Vec<(f64, Vec<Spot>)> = Vec::new();
        for t in self.tracks.iter().filter(|t| t.len() >= least_spots) {
            let track = self.of(t);
            let way = |s: &Spot| (s.place.right - track[0].place.right).hypot(s.place.up - track[0].place.up);
            let farthest = track.iter().map(way).fold(0.0, f64::max);
            let radius = median_radius(&track);
            if farthest > LEAST_WAY_RADII * radius {
                swept.push((farthest * radius, track));
            }
        }
        swept.sort_by(|a, b| b.0.total_cmp(&a.0));
        swept.truncate(most_tracks);
        swept.into_iter().map(|(_, track)| track).collect()
    }
}

/// Median time between successive spots, s; infinite where there is none.
pub(super) fn interval_s(spots: &[Spot]) -> f64 {
    let steps = spots.windows(2).map(|w| w[1].time_s - w[0].time_s);
    let mut steps: Vec<f64> = steps.filter(|d| *d > 0.0).collect();
    median(&mut steps).unwrap_or(f64::INFINITY)
}

/// Median radius of a track, plane units.
pub(super) fn median_radius(spots: &[Spot]) -> f64 {
    let mut radii: Vec<f64> = spots.iter().map(|s| s.radius).collect();
    median(&mut radii).unwrap_or(0.0)
}

/// Median brightness over the background, grey levels.
pub(super) fn median_contrast(spots: &[&Spot]) -> f64 {
    let mut contrasts: Vec<f64> = spots.iter().map(|s| s.contrast_grey).collect();
    median(&mut contrasts).unwrap_or(0.0)
}

fn link(spots: &[Spot]) -> Vec<Track> {
    let mut open: Vec<Track> = Vec::new();
    let mut done: Vec<Track> = Vec::new();
    let mut start = 0;
    while start < spots.len() {
        let frame = spots[start].frame;
        let end = start + spots[start..].iter().take_while(|s| s.frame == frame).count();
        let time_s = spots[start].time_s;
        let (stay, ended): (Vec<Track>, Vec<Track>) = open.into_iter().partition(|t| {
            t.last().is_some_and(|&i| {
                time_s - spots[i].time_s <= PATIENCE_S || frame - spots[i].frame <= PATIENCE_FRAMES
            })
        });
        open = stay;
        done.extend(ended);
        extend_by_frame(spots, start..end, &mut open);
        start = end;
    }
    done.extend(open);
    done.sort_by_key(|t| std::cmp::Reverse(t.len()));
    done
}

fn extend_by_frame(spots: &[Spot], now: std::ops::Range<usize>, open: &mut Vec<Track>) {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (t, track) in open.iter().enumerate() {
        for s in now.clone() {
            if let Some(cost) = mismatch(spots, track, &spots[s]) {
                pairs.push((cost, t, s));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut taken = vec![false; open.len()];
    let mut placed = vec![false; now.len()];
    for (_, t, s) in pairs {
        if !taken[t] && !placed[s - now.start] {
            taken[t] = true;
            placed[s - now.start] = true;
            open[t].push(s);
        }
    }
    for s in now.clone() {
        if !placed[s - now.start] {
            open.push(vec![s]);
        }
    }
}

/// Frames show the same picture where things are within this part of a radius, and no more of them in a row than this.
const SAME_PLACE_PART: f64 = 0.05;
const MOST_TIMES_SHOWN: usize = 5;

/// How likely between two frames a thing turns as by an impact, a frame is missing without a trace, or a ball changes sides of
/// brightness with what is behind it.
const TURNS: f64 = 0.05;
const MISSES: f64 = 0.02;
const CHANGES_SIGN: f64 = 0.02;

/// From one frame to the next radius and brightness change by about this, in logarithms; brightness is known to so many grey levels.
const RADIUS_STD: f64 = 0.1;
const BRIGHTNESS_STD: f64 = 0.3;
const BRIGHTNESS_NOISE_GREY: f64 = 5.0;

/// −2 ln of the likelihood that `spot` continues `track`: where it is against the prediction (normal), or anywhere near after a turn
/// (uniform), and how like the last it looks (Cauchy: looks change at once now and then). `None` where it is too far.
fn mismatch(spots: &[Spot], track: &Track, spot: &Spot) -> Option<f64> {
    let last = &spots[*track.last()?];
    let radius = last.radius.max(spot.radius);
    let ratio = spot.radius / last.radius;
    if !(0.5..2.0).contains(&ratio) {
        return None;
    }
    let unlike = unlikeness(last, spot);
    let dt = spot.time_s - last.time_s;
    let distance = |r: f64, u: f64| (spot.place.right - r).hypot(spot.place.up - u);
    let from_last = distance(last.place.right, last.place.up);
    // A frame that is shown twice has its ball at rest: the place before tells where it goes.
    let moved = |b: &&Spot| {
        let (r, u) = (b.place.right - last.place.right, b.place.up - last.place.up);
        r.hypot(u) > SAME_PLACE_PART * radius
    };
    let earlier = track
        .iter()
        .rev()
        .skip(1)
        .take(MOST_TIMES_SHOWN)
        .map(|&i| &spots[i]);
    let before = earlier.clone().find(moved).or_else(|| earlier.clone().next());
    let Some(before) = before.filter(|b| last.time_s > b.time_s) else {
        // A first step: up to ten radii, most things move less.
        let (usual, allowed) = (2.0 * radius, 10.0 * radius);
        let slow = (from_last / usual).powi(2) + uniform(usual * SQRT_2);
        let cost = slow.min(uniform(allowed) - 2.0 * TURNS.ln());
        return (from_last < allowed).then_some(cost + unlike);
    };
    let span = last.time_s - before.time_s;
    let (vr, vu) = (
        (last.place.right - before.place.right) / span,
        (last.place.up - before.place.up) / span,
    );
    let step = vr.hypot(vu) * dt;
    let ahead = |times: f64| {
        distance(
            last.place.right + times * vr * dt,
            last.place.up + times * vu * dt,
        )
    };
    let allowed = 0.35 * step + 1.5 * radius;
    let wide = 1.3 * step + 2.5 * radius;
    let normal =
        |off: f64| (off < allowed).then(|| (3.0 * off / allowed).powi(2) + uniform(allowed / 3.0 * SQRT_2));
    let next_frame = spot.frame == last.frame + 1;
    let ways = [
        normal(ahead(1.0)),
        (from_last < wide).then(|| uniform(wide) - 2.0 * TURNS.ln()),
        normal(ahead(2.0))
            .filter(|_| next_frame)
            .map(|cost| cost - 2.0 * MISSES.ln()),
    ];
    let best = ways.into_iter().flatten().min_by(f64::total_cmp)?;
    Some(best + unlike)
}

/// −2 ln of the density of what is anywhere within `radius`.
fn uniform(radius: f64) -> f64 {
    2.0 * (PI * radius * radius).ln()
}

/// −2 ln of the likelihood that two sightings in a row are of one thing, by their looks alone.
fn unlikeness(last: &Spot, spot: &Spot) -> f64 {
    let cauchy = |off: f64| 3.0 * (off * off).ln_1p();
    let brightness = |s: &Spot| (s.contrast_grey.abs() + BRIGHTNESS_NOISE_GREY).ln();
    let sign = if spot.contrast_grey * last.contrast_grey < 0.0 {
        -2.0 * CHANGES_SIGN.ln()
    } else {
        0.0
    };
    cauchy((spot.radius / last.radius).ln() / RADIUS_STD)
        + cauchy((brightness(spot) - brightness(last)) / BRIGHTNESS_STD)
        + sign
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(id: usize, frame: usize, right: f64, up: f64) -> Spot {
        Spot {
            id,
            frame,
            time_s: frame as f64 / 100.0,
            place: PlanePoint::new(right, up),
            std: 0.05,
            coded: Coded::Whole,
            radius: 10.0,
            contrast_grey: 80.0,
        }
    }

    #[test]
    fn two_things_that_cross_keep_their_own_tracks() {
        let mut spots = Vec::new();
        for f in 0..40 {
            let x = f as f64 * 12.0;
            spots.push(spot(2 * f, f, x, 200.0 - x * 0.4));
            spots.push(spot(2 * f + 1, f, 480.0 - x, 100.0));
        }
        let tracks = link(&spots);
        assert_eq!(tracks.len(), 2);
        for t in &tracks {
            assert_eq!(t.len(), 40);
            let first = spots[t[0]].id % 2;
            assert!(t.iter().all(|&i| spots[i].id % 2 == first));
        }
    }

    #[test]
    fn an_impact_and_a_gap_do_not_break_a_track() {
        let spots: Vec<Spot> = (0..60)
            .filter(|f| !(20..23).contains(f))
            .map(|f| spot(f, f, f as f64 * 8.0, (f as f64 - 35.0).abs() * 15.0))
            .collect();
        let tracks = link(&spots);
        assert_eq!(tracks[0].len(), 57);
    }
}
