//! What was seen moving, within a budget of memory.

use crate::detect::Sighting;
use crate::detect::crop::Crop;
use std::collections::VecDeque;

/// Memory of all sightings together, bytes. With decoder, survey and frames in flight the whole stays below
/// 300 MB at 1080p.
const CROPS_BUDGET_BYTES: usize = 80 << 20;

/// Sightings within the budget of memory. When that is spent what is no ball is forgotten, the oldest first; then round things
/// lose their pixels, and keep what the first look made of them.
#[derive(Debug, Default)]
pub struct SightingStore {
    pub sightings: Vec<Sighting>,
    shapeless: VecDeque<usize>,
    round: VecDeque<usize>,
    /// Those of `sightings` that count no more.
    forgotten: Vec<usize>,
    bytes: usize,
    /// How many there were in all.
    seen: usize,
}

/// Forgotten sightings that are worth taking the list apart.
const MOST_FORGOTTEN: usize = 4096;

impl SightingStore {
    /// Takes in what a frame holds.
    pub fn add(&mut self, new: Vec<Sighting>) {
        for s in new {
            self.seen += 1;
            self.bytes += bytes_of(&s);
            let queue = if s.centre.is_some() {
                &mut self.round
            } else {
                &mut self.shapeless
            };
            queue.push_back(self.sightings.len());
            self.sightings.push(s);
        }
        while self.bytes > CROPS_BUDGET_BYTES {
            if let Some(i) = self.shapeless.pop_front() {
                self.bytes -= bytes_of(&self.sightings[i]);
                let_go(&mut self.sightings[i]);
                self.forgotten.push(i);
            } else if let Some(i) = self.round.pop_front() {
                let before = bytes_of(&self.sightings[i]);
                let_go(&mut self.sightings[i]);
                self.bytes -= before - bytes_of(&self.sightings[i]);
            } else {
                break;
            }
        }
        if self.forgotten.len() > MOST_FORGOTTEN {
            self.forget();
        }
    }

    /// Takes what is forgotten out of the list.
    fn forget(&mut self) {
        self.forgotten.sort_unstable();
        let forgotten = std::mem::take(&mut self.forgotten);
        let mut index = 0;
        self.sightings.retain(|_| {
            index += 1;
            forgotten.binary_search(&(index - 1)).is_err()
        });
        for i in self.shapeless.iter_mut().chain(&mut self.round) {
            *i -= forgotten.partition_point(|f| f < i);
        }
    }

    /// What is left, and how many sightings there were.
    pub fn finished(mut self) -> (Vec<Sighting>, usize) {
        self.forget();
        (self.sightings, self.seen)
    }
}

fn bytes_of(s: &Sighting) -> usize {
    size_of::<Sighting>() + s.blob.crop.luma.data.len()
}

/// Without its pixels.
fn let_go(s: &mut Sighting) {
    s.colours = None;
    let crop = &mut s.blob.crop;
    *crop = Crop::without_pixels(crop.u, crop.v);
}
