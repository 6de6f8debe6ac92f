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

/// Why it is none of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpinUntold {
    /// The pictures show none.
    #[default]
    Unseen,
    /// Nothing tells them apart.
    Several,
    /// The bounce beside the arc allows none of them with any that its neighbour's pictures show: the one or the other is wrong.
    Contradicted,
}

/// R ω of a ball about the axes that a bounce says something of, m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceSpin {
    /// About y: positive where the ball rolls to the right in the calibrated plane.
    pub y_m_s: Quantity,
    /// About the vertical.
    pub z_m_s: Quantity,
}

/// What is known of the spin of an arc.
#[derive(Debug, Clone, Default)]
pub(super) struct SpinCandidates {
    candidates: Vec<SurfaceSpin>,
    /// Those that nothing is against.
    possible: Vec<usize>,
    told_by: SpinEvidence,
    /// Why none is chosen where none is possible.
    untold: SpinUntold,
    fastest: FastestSpin,
}

/// The fastest spin about each axis that an arc's candidates may have, m/s.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct FastestSpin {
    pub y_m_s: f64,
    pub z_m_s: f64,
}

impl SpinCandidates {
    /// Those that the ball can have, which is seen up to the `fastest`, beside so many that are `too_fast` for it. Several of which each is too fast are no
    /// evidence: the right one is hardly among them.
    pub fn new(candidates: Vec<SurfaceSpin>, too_fast: usize, fastest: FastestSpin) -> Self {
        Self {
            told_by: if too_fast > 0 {
                SpinEvidence::Speed
            } else {
                SpinEvidence::Pictures
            },
            untold: if candidates.is_empty() && too_fast == 0 {
                SpinUntold::Unseen
            } else {
                SpinUntold::Several
            },
            possible: (0..candidates.len()).collect(),
            candidates,
            fastest,
        }
    }

    /// Leaves those that a bounce allows.
    pub fn leave(&mut self, possible: Vec<usize>) {
        if possible.len() < self.possible.len() {
            self.told_by = SpinEvidence::Bounce;
        }
        self.possible = possible;
    }

    /// Leaves none: the bounce beside the arc is against each.
    pub fn contradict(&mut self) {
        self.possible.clear();
        self.untold = SpinUntold::Contradicted;
    }

    /// The one that is left, and what told it from the others.
    pub fn chosen(&self) -> Result<ChosenSpin, SpinUntold> {
        match self.possible[..] {
            [index] => Ok(ChosenSpin {
                index,
                told_by: self.told_by,
            }),
            [] => Err(self.untold),
            _ => Err(SpinUntold::Several),
        }
    }

    /// R ω_y of the one that is left, m/s.
    pub fn chosen_m_s(&self) -> Option<Quantity> {
        Some(self.candidates[self.chosen().ok()?.index].y_m_s)
    }

    /// The fastest that they may be.
    pub const fn fastest(&self) -> FastestSpin {
        self.fastest
    }

    /// Whether any is left.
    pub fn is_seen(&self) -> bool {
        !self.possible.is_empty()
    }

    /// Those that are left, with their places in the list.
    pub fn possible_spins(&self) -> impl Iterator<Item = (usize, SurfaceSpin)> {
        self.possible.iter().map(|&i| (i, self.candidates[i]))
    }
}
