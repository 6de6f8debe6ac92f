//! How a stored picture is turned to be upright.

use super::RowOrder;

/// The turn (and mirroring) that sets a stored picture upright: stored (x, y) is shown at (±x, ±y), or at (±y, ±x)
/// when transposed, moved back into the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Orientation {
    /// Columns become rows.
    pub transposed: bool,
    /// The shown picture's columns run from right to left of where they came from.
    pub mirror_x: bool,
    /// The shown picture's rows run from bottom to top.
    pub mirror_y: bool,
}

impl Orientation {
    /// By a container's display matrix; the angle in degrees (clockwise) when it is no right angle.
    ///
    /// Containers store (a b 0; c d 0; ..) in 16.16 numbers, and (x, y, 1) times it is the place shown.
    pub(super) fn of(matrix: &[i32; 9]) -> Result<Self, f64> {
        let [a, b, c, d] = [matrix[0], matrix[1], matrix[3], matrix[4]].map(f64::from);
        let scale = a.hypot(b);
        // A degree either way is a right angle, like in FFmpeg's own autorotation.
        let near = |x: f64| x.abs() < scale * 0.0175;
        if scale == 0.0 {
            return Ok(Self::default()); // some cameras write an empty matrix
        }
        if near(b) && near(c) {
            Ok(Self {
                transposed: false,
                mirror_x: a < 0.0,
                mirror_y: d < 0.0,
            })
        } else if near(a) && near(d) {
            Ok(Self {
                transposed: true,
                mirror_x: c < 0.0,
                mirror_y: b < 0.0,
            })
        } else {
            Err(b.atan2(a).to_degrees())
        }
    }

    /// Where stored rows run to in the shown picture.
    pub(super) fn row_order(self) -> RowOrder {
        match self {
            Self {
                transposed: false,
                mirror_y: false,
                ..
            } => RowOrder::Down,
            Self {
                transposed: false, ..
            } => RowOrder::Up,
            Self { mirror_x: false, .. } => RowOrder::Right,
            Self { .. } => RowOrder::Left,
        }
    }

    /// Where the stored picture of this size has the pixel that is shown at column u, row v.
    pub(super) fn stored_place(
        self,
        (u, v): (usize, usize),
        (width, height): (usize, usize),
    ) -> (usize, usize) {
        let (shown_width, shown_height) = self.shown((width, height));
        let u = if self.mirror_x { shown_width - 1 - u } else { u };
        let v = if self.mirror_y { shown_height - 1 - v } else { v };
        if self.transposed { (v, u) } else { (u, v) }
    }

    /// Columns and rows as shown.
    pub(super) fn shown(self, (width, height): (usize, usize)) -> (usize, usize) {
        if self.transposed {
            (height, width)
        } else {
            (width, height)
        }
    }

    /// Copies the `width * height` stored bytes that `row` gives into `out`, upright.
    pub(super) fn place<'a>(
        self,
        (width, height): (usize, usize),
        row: impl Fn(usize) -> &'a [u8],
        out: &mut Vec<u8>,
    ) {
        out.clear();
        out.reserve_exact(width * height);
        if self == Self::default() {
            (0..height).for_each(|y| out.extend_from_slice(&row(y)[..width]));
        } else if self.transposed {
            out.resize(width * height, 0);
            self.transpose((width, height), row, out);
        } else {
            for y in 0..height {
                let from = &row(if self.mirror_y { height - 1 - y } else { y })[..width];
                if self.mirror_x {
                    out.extend(from.iter().rev());
                } else {
                    out.extend_from_slice(from);
                }
            }
        }
    }

    /// Writes whole short runs of shown rows, a band of stored rows at a time: one row of bytes scattered over
    /// as many rows of output would touch a cache line for each byte.
    fn transpose<'a>(self, (width, height): (usize, usize), row: impl Fn(usize) -> &'a [u8], out: &mut [u8]) {
        const BAND: usize = 32;
        for top in (0..height).step_by(BAND) {
            let band: Vec<&[u8]> = (top..height.min(top + BAND)).map(|y| &row(y)[..width]).collect();
            for x in 0..width {
                let shown_y = if self.mirror_y { width - 1 - x } else { x };
                let line = &mut out[shown_y * height..(shown_y + 1) * height];
                let values = band.iter().map(|stored| stored[x]);
                if self.mirror_x {
                    let end = height - top;
                    let to = line[end - band.len()..end].iter_mut().rev();
                    to.zip(values).for_each(|(to, value)| *to = value);
                } else {
                    line[top..top + band.len()]
                        .iter_mut()
                        .zip(values)
                        .for_each(|(to, value)| *to = value);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Matrices as players and phones write them, by the clockwise turn in degrees.
    fn matrix(a: i32, b: i32, c: i32, d: i32) -> [i32; 9] {
        [a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30]
    }

    fn placed(matrix: [i32; 9], size: (usize, usize), stored: &[u8]) -> Vec<u8> {
        let mut out = Vec::new();
        Orientation::of(&matrix)
            .unwrap()
            .place(size, |y| &stored[y * size.0..][..size.0], &mut out);
        out
    }

    #[test]
    fn each_turn_shows_the_picture_upright() {
        let stored = [1, 2, 3, 4, 5, 6]; // 3 wide, 2 high
        assert_eq!(placed(matrix(1, 0, 0, 1), (3, 2), &stored), [1, 2, 3, 4, 5, 6]);
        assert_eq!(
            placed(matrix(0, 1, -1, 0), (3, 2), &stored),
            [4, 1, 5, 2, 6, 3],
            "90 clockwise"
        );
        assert_eq!(
            placed(matrix(-1, 0, 0, -1), (3, 2), &stored),
            [6, 5, 4, 3, 2, 1],
            "180"
        );
        assert_eq!(
            placed(matrix(0, -1, 1, 0), (3, 2), &stored),
            [3, 6, 2, 5, 1, 4],
            "270 clockwise"
        );
        assert_eq!(
            placed(matrix(-1, 0, 0, 1), (3, 2), &stored),
            [3, 2, 1, 6, 5, 4],
            "mirrored"
        );
        assert_eq!(
            placed(matrix(0, 1, 1, 0), (3, 2), &stored),
            [1, 4, 2, 5, 3, 6],
            "transposed"
        );
    }

    #[test]
    fn stored_rows_run_where_the_turn_takes_them() {
        for (turn, order) in [
            (matrix(1, 0, 0, 1), RowOrder::Down),
            (matrix(-1, 0, 0, 1), RowOrder::Down),
            (matrix(-1, 0, 0, -1), RowOrder::Up),
            (matrix(0, 1, -1, 0), RowOrder::Left),
            (matrix(0, -1, 1, 0), RowOrder::Right),
        ] {
            assert_eq!(Orientation::of(&turn).unwrap().row_order(), order);
            // Two rows of three: the first holds 1.
            let shown = placed(turn, (3, 2), &[1, 1, 1, 2, 2, 2]);
            let first = match order {
                RowOrder::Down => [shown[0], shown[2]],
                RowOrder::Up => [shown[3], shown[5]],
                RowOrder::Right => [shown[0], shown[4]],
                RowOrder::Left => [shown[1], shown[5]],
            };
            assert_eq!(first, [1, 1], "{order:?}");
        }
    }

    #[test]
    fn bands_of_a_large_picture_join_without_a_seam() {
        let (width, height) = (70, 101);
        let stored: Vec<u8> = (0..width * height).map(|i| (i * 7 % 251) as u8).collect();
        for turn in [
            matrix(0, 1, -1, 0),
            matrix(0, -1, 1, 0),
            matrix(0, 1, 1, 0),
            matrix(0, -1, -1, 0),
        ] {
            let o = Orientation::of(&turn).unwrap();
            let out = placed(turn, (width, height), &stored);
            for y in 0..height {
                for x in 0..width {
                    let u = if o.mirror_x { height - 1 - y } else { y };
                    let v = if o.mirror_y { width - 1 - x } else { x };
                    assert_eq!(out[v * height + u], stored[y * width + x]);
                }
            }
        }
    }

    #[test]
    fn a_turn_between_right_angles_is_told_by_its_angle() {
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let fixed = |x: f64| (x * 65536.0) as i32;
        let m = [
            fixed(cos),
            fixed(sin),
            0,
            -fixed(sin),
            fixed(cos),
            0,
            0,
            0,
            1 << 30,
        ];
        assert!((Orientation::of(&m).unwrap_err() - 30.0).abs() < 0.01);
        assert_eq!(Orientation::of(&[0; 9]), Ok(Orientation::default()));
    }

    #[test]
    fn each_shown_pixel_is_found_where_it_is_stored() {
        let size = (3, 2);
        let stored = [1, 2, 3, 4, 5, 6];
        for turn in [
            matrix(1, 0, 0, 1),
            matrix(0, 1, -1, 0),
            matrix(-1, 0, 0, -1),
            matrix(0, -1, 1, 0),
            matrix(-1, 0, 0, 1),
            matrix(0, 1, 1, 0),
        ] {
            let orientation = Orientation::of(&turn).unwrap();
            let (width, height) = orientation.shown(size);
            let found: Vec<u8> = (0..height)
                .flat_map(|v| (0..width).map(move |u| (u, v)))
                .map(|shown| {
                    let (x, y) = orientation.stored_place(shown, size);
                    stored[y * size.0 + x]
                })
                .collect();
            assert_eq!(found, placed(turn, size, &stored));
        }
    }
}
