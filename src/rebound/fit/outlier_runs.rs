//! Whether rows that stick out stand together more than chance would have it.
//!
//! A mishap strikes anywhere. Rows next to each other in incidence that are off to the same side are the mark of a law which
//! the model lacks.

use super::group_data::{GroupData, friction_demand};
use super::row_law::{NearestMotion, Theta};
use super::search::Task;

/// Probability below which a few rows side by side are no chance.
const SIDE_BY_SIDE: f64 = 0.05;

/// Of this many rows and more: standard deviations beyond what chance puts side by side.
const MANY: usize = 6;
const SIDE_BY_SIDE_SIGMAS: f64 = 4.0;

/// Which equation a row violates most, and to which side.
pub(super) fn side(near: &NearestMotion) -> (usize, bool) {
    // The edge is no measured quantity; it comes last.
    let measured = near.equations - usize::from(near.state.on_edge());
    let largest = (0..measured)
        .max_by(|&a, &b| near.residuals[a].abs().total_cmp(&near.residuals[b].abs()))
        .unwrap_or(0);
    (largest, near.residuals[largest] > 0.0)
}

/// Whether the rows at `found` stand next to each other in incidence, off to the same side, more often than chance.
pub(super) fn side_by_side(data: &GroupData, task: &Task<'_>, theta: &Theta, found: &[usize]) -> bool {
    if found.len() < 2 {
        return false;
    }
    let mut order: Vec<(f64, usize)> = (0..data.rows.len())
        .map(|i| (friction_demand(&data.rows[i], theta), i))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sides: Vec<(usize, Option<(usize, bool)>)> = order
        .iter()
        .enumerate()
        .filter(|(_, (_, i))| found.binary_search(i).is_ok())
        .map(|(place, &(_, i))| (place, task.nearest(&data.rows[i], theta).as_ref().map(side)))
        .collect();
    let neighbours = |places: &[usize], sides: &[Option<(usize, bool)>]| {
        let pairs = places.windows(2).zip(sides.windows(2));
        pairs
            .filter(|(p, s)| p[1] == p[0] + 1 && s[0].is_some() && s[0] == s[1])
            .count()
    };
    let places: Vec<usize> = sides.iter().map(|s| s.0).collect();
    let mut tags: Vec<Option<(usize, bool)>> = sides.iter().map(|s| s.1).collect();
    let seen = neighbours(&places, &tags);
    if seen == 0 {
        return false;
    }
    // The same rows dealt out at random, many times: of many rows fewer times tell as much.
    let times = (200_000 / found.len()).clamp(50, 2000);
    let mut deal = Xorshift(0x9e37_79b9_7f4a_7c15);
    let dealt: Vec<f64> = (0..times)
        .map(|_| {
            let places = deal.places(found.len(), data.rows.len());
            deal.shuffle(&mut tags);
            neighbours(&places, &tags) as f64
        })
        .collect();
    let (n, seen) = (times as f64, seen as f64);
    if found.len() < MANY {
        let as_many = dealt.iter().filter(|d| **d >= seen).count();
        return (as_many as f64) < SIDE_BY_SIDE * n;
    }
    let mean = dealt.iter().sum::<f64>() / n;
    let variance = dealt.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / n;
    seen > mean + SIDE_BY_SIDE_SIGMAS * variance.sqrt().max(0.5)
}

/// Random places and orders, the same every time (Marsaglia's xorshift).
struct Xorshift(u64);

impl Xorshift {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % limit.max(1)
    }

    /// So many different places, ascending (Floyd's way).
    fn places(&mut self, count: usize, of: usize) -> Vec<usize> {
        let mut chosen = std::collections::BTreeSet::new();
        for top in of - count..of {
            let place = self.below(top + 1);
            if !chosen.insert(place) {
                chosen.insert(top);
            }
        }
        chosen.into_iter().collect()
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}
