//! The spins that suit the pictures of one arc, and what told them apart.

use crate::quantity::Quantity;

/// Surface speed over the fastest speed of the centre, at most.
pub const MOST_SPEEDS: f64 = 3.0;

/// Which of the spins that suit an arc's pictures it is, and what told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChosenSpin {
    /// Its place among the candidates.
    pub index: usize,
    /// What told.
    pub told_by: SpinEvidence,
}

/// What tells a spin from its rivals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpinEvidence {
    /// The pictures.
    #[default]
    Pictures,
    /// The others are too fast for a ball of this speed.
    Speed,
    /// The bounce beside it.
    Bounce,
}

/// What is known of the spin of an arc.
#[derive(Debug, Clone, Default)]
pub(super) struct SpinCandidates {
    candidates_m_s: Vec<Quantity>,
    /// Those that nothing is against.
    possible: Vec<usize>,
    told_by: SpinEvidence,
}

impl SpinCandidates {
    /// Those that a ball can have whose fastest speed is `speed_m_s`, where any is.
    pub fn new(candidates_m_s: Vec<Quantity>, speed_m_s: f64) -> Self {
        let all: Vec<usize> = (0..candidates_m_s.len()).collect();
        let slow = |&i: &usize| candidates_m_s[i].value.abs() <= MOST_SPEEDS * speed_m_s;
        let slow: Vec<usize> = all.iter().copied().filter(slow).collect();
        let by_speed = !slow.is_empty() && slow.len() < all.len();
        Self {
            possible: if by_speed { slow } else { all },
            candidates_m_s,
            told_by: if by_speed {
                SpinEvidence::Speed
            } else {
                SpinEvidence::Pictures
            },
        }
    }

    /// Leaves those that a bounce allows.
    pub fn leave(&mut self, possible: Vec<usize>) {
        if possible.len() < self.possible.len() {
            self.told_by = SpinEvidence::Bounce;
        }
        self.possible = possible;
    }

    /// The one that is left.
    pub fn chosen(&self) -> Option<usize> {
        match self.possible[..] {
            [one] => Some(one),
            _ => None,
        }
    }

    /// The same, m/s.
    pub fn chosen_m_s(&self) -> Option<Quantity> {
        Some(self.candidates_m_s[self.chosen()?])
    }

    /// What told them from the others.
    pub const fn told_by(&self) -> SpinEvidence {
        self.told_by
    }

    /// The places of those that are left.
    pub fn possible(&self) -> &[usize] {
        &self.possible
    }

    /// Those that are left, with their places in the list.
    pub fn possible_m_s(&self) -> impl Iterator<Item = (usize, Quantity)> {
        self.possible.iter().map(|&i| (i, self.candidates_m_s[i]))
    }
}
