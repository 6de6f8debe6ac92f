//! A function on the disc that the ball is in the picture: values at the nodes of a square grid, linear between them.

use super::cube_map::{GridCell, NodeWeights};

/// A square grid over the disc of radius 1.
#[derive(Debug, Clone, Copy)]
pub struct DiscGrid {
    /// Nodes along each side.
    side: usize,
}

impl DiscGrid {
    /// With nodes about `spacing` radii apart.
    #[must_use]
    pub fn with_spacing(spacing: f64) -> Self {
        Self {
            side: (2.0 / spacing).ceil().clamp(6.0, 40.0) as usize + 1,
        }
    }

    /// Nodes in all.
    #[must_use]
    pub fn nodes(self) -> usize {
        self.side * self.side
    }

    /// Nodes along each side.
    #[must_use]
    pub fn side(self) -> usize {
        self.side
    }

    /// The place of node `index`, radii.
    #[must_use]
    pub fn place(self, index: usize) -> [f64; 2] {
        let step = 2.0 / (self.side - 1) as f64;
        [
            (index % self.side) as f64 * step - 1.0,
            (index / self.side) as f64 * step - 1.0,
        ]
    }

    /// The nodes around `place`, with the weights that a linear function has there.
    #[must_use]
    pub fn corners(self, place: [f64; 2]) -> NodeWeights {
        self.cell(place).corners(self.side)
    }

    /// `place` between its nodes.
    #[must_use]
    pub fn cell(self, place: [f64; 2]) -> GridCell {
        let steps = (self.side - 1) as f64;
        let [p, q] = place.map(|c| (0.5 * (c + 1.0) * steps).clamp(0.0, steps));
        let last = self.side - 2;
        let (i, j) = ((p as usize).min(last), (q as usize).min(last));
        GridCell::new(
            (j * self.side + i) as u32,
            (q - j as f64) as f32,
            (p - i as f64) as f32,
        )
    }
}
