//! The equations of a row with their derivatives, and the few matrices of them, written out: they are small, and there are
//! many rows.

use crate::rebound::fit::observation::{SLOTS, Slots};
use crate::rebound::parameter::PARAMETERS;

/// Most equations of a row: three, and the edge.
pub(super) const MOST: usize = 4;

/// The equations at some ẑ.
pub(super) struct Equations {
    pub count: usize,
    pub f: [f64; MOST],
    pub by_slot: [Slots; MOST],
    pub by_parameter: [[f64; PARAMETERS]; MOST],
}

impl Equations {
    pub fn empty() -> Self {
        Self {
            count: 0,
            f: [0.0; MOST],
            by_slot: [[0.0; SLOTS]; MOST],
            by_parameter: [[0.0; PARAMETERS]; MOST],
        }
    }

    /// Room for one more, cleared.
    pub fn next(&mut self) -> (&mut f64, &mut Slots, &mut [f64; PARAMETERS]) {
        let i = self.count;
        self.count += 1;
        self.by_slot[i] = [0.0; SLOTS];
        self.by_parameter[i] = [0.0; PARAMETERS];
        (&mut self.f[i], &mut self.by_slot[i], &mut self.by_parameter[i])
    }
}

pub(super) fn dot(a: &Slots, b: &Slots) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The largest change of a slot, against its size. One that is not a number counts as none (as with `f64::max`, which takes longer).
pub(super) fn relative_move(from: &Slots, to: &Slots) -> f64 {
    let larger = |x: f64, y: f64| if y > x { y } else { x };
    let mut largest = 0.0;
    for (a, b) in from.iter().zip(to) {
        let size = larger(larger(a.abs(), b.abs()), 1e-9);
        largest = larger(largest, (a - b).abs() / size);
    }
    largest
}

/// L of J Σ Jᵀ = L Lᵀ; false where an equation has no error at all, or two have the same one.
pub(super) fn cholesky(
    equations: &Equations,
    spread: &[Slots; MOST],
    lower: &mut [[f64; MOST]; MOST],
) -> bool {
    for i in 0..equations.count {
        for j in 0..=i {
            let entry = dot(&equations.by_slot[i], &spread[j]);
            let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            if i == j {
                let pivot = entry - known;
                // Positive and not mere rounding of what it was before.
                if !(pivot > 1e-13 * entry && pivot.is_finite()) {
                    return false;
                }
                lower[i][i] = pivot.sqrt();
            } else {
                lower[i][j] = (entry - known) / lower[j][j];
            }
        }
    }
    true
}

/// L⁻¹ v.
pub(super) fn forward(lower: &[[f64; MOST]; MOST], mut v: [f64; MOST], count: usize) -> [f64; MOST] {
    for i in 0..count {
        for j in 0..i {
            v[i] -= lower[i][j] * v[j];
        }
        v[i] /= lower[i][i];
    }
    v
}

/// L⁻ᵀ v.
pub(super) fn backward(lower: &[[f64; MOST]; MOST], mut v: [f64; MOST], count: usize) -> [f64; MOST] {
    for i in (0..count).rev() {
        for j in i + 1..count {
            v[i] -= lower[j][i] * v[j];
        }
        v[i] /= lower[i][i];
    }
    v
}
