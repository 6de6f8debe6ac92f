//! Swings of a camera that otherwise stands still, such as those of a table that is struck by the ball.
//!
//! The edges of the scene (floor line, bench, texture) are where the empty scene has them unless the whole picture is shifted:
//! frame(p + s) = gain · scene(p) + offset. The shift s is found by least squares over the pixels that carry gradient g, first on
//! whole pixels, then by Gauss-Newton between them (Lucas and Kanade 1981); what moves before the scene does not count (Tukey's
//! weights, and the regions of the balls seen are left out).
//!
//! How well s is known follows from Σ g gᵀ/σ²: a floor line tells the rows alone. Along a direction in which the scene has no
//! edges nothing is followed, and the shift there is left at 0.
//!
//! A codec draws the scene anew in each key frame: a faint artefact that passed for an edge is gone, and a floor line has another profile, the same all along
//! it. So a shift has to make the frame more likely than none does, by what a shift of its size would, and the edges that tell of it have to be in the
//! frame at their new places. Its uncertainty is that of residuals that are alike along a row or a column (a cluster-robust one: Liang and Zeger
//! 1986), of as many degrees of freedom as rows or columns tell: a codec may draw one line a third of a pixel aside, which is then no swing.
//!
//! Assumed: the picture shifts as a whole (a swing of a degree's hundredth does), and by less than five pixels.

use super::registration::Registration;
use super::resample::cubic;
use crate::frames::Luma;
use crate::numeric::least_squares::{NormalEquations, Termination, gauss_newton};
use crate::numeric::robust::{TUKEY, median, std_from_magnitudes, tukey_weight};
use nalgebra::{Matrix2, SymmetricEigen, Vector2};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How far the whole picture may be shifted, px.
const REACH_PX: i32 = 5;

/// Pixels compared, at most: enough for a hundredth of a pixel from a floor line of 30 grey levels.
const MOST_PIXELS: usize = 4000;

/// A gradient has to exceed so many standard deviations of the noise, and this, grey levels a pixel.
const GRADIENT_SIGMAS: f64 = 2.5;
const LEAST_GRADIENT_GREY: f64 = 3.0;

/// Fewer pixels say nothing.
const LEAST_PIXELS: usize = 40;

/// A direction is followed where the edges tell the shift along it to this, px.
const FOLLOWED_STD_PX: f64 = 0.1;

/// What a shift has to be to count: more than so many standard deviations, and than this.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftThreshold {
    sigmas: f64,
    /// The same of an uncertainty that lets residuals be alike, with few degrees of freedom.
    alike_sigmas: f64,
    px: f64,
    /// More than so many times the shift that frames of a camera at rest seem to have.
    rest_multiples: f64,
}

impl ShiftThreshold {
    /// For a camera that stood still so far: a smaller shift is within a centre's own uncertainty, and a codec moves edges by
    /// as much.
    pub const ONSET: Self = Self {
        sigmas: 4.5,
        alike_sigmas: 2.6,
        px: 0.1,
        rest_multiples: 5.0,
    };

    /// For a camera that swings, while that dies away.
    pub const DECAY: Self = Self {
        sigmas: 0.5,
        alike_sigmas: 0.3,
        px: 0.0,
        rest_multiples: 0.5,
    };
}

/// A codec's errors are correlated from pixel to pixel: the shift's standard uncertainty is so many times that of white noise.
const NOISE_CORRELATION: f64 = 2.0;

/// A shift makes a frame more likely by at least this part of what one of its size is expected to.
const LEAST_EXPLAINED: f64 = 0.5;

/// Of the scene's edges, by the squares of their gradients, at least this part is in a frame of a camera that swings.
const LEAST_KEPT: f64 = 0.5;

/// Gauss-Newton steps at most.
const STEPS: usize = 8;

/// A pixel of the empty scene with its gradient.
#[derive(Debug, Clone, Copy)]
struct EdgePixel {
    u: i32,
    v: i32,
    grey: f64,
    gradient: Vector2<f64>,
}

/// Compares frames with the edges of the empty scene.
#[derive(Debug, Clone)]
pub struct SceneEdges {
    pixels: Vec<EdgePixel>,
    noise_grey: f64,
    /// The median shift that frames of a camera at rest seem to have, px: a codec draws the scene's edges anew in each.
    rest_shift_px: f64,
}

/// A region of the picture: columns and rows.
pub type PixelRegion = (std::ops::Range<usize>, std::ops::Range<usize>);

impl SceneEdges {
    /// The edges of the scene `grey`, row by row, whose frames have noise of `noise_grey`.
    #[must_use]
    pub fn new<T: Copy + Into<f32> + Sync>(grey: &[T], width: usize, noise_grey: f64) -> Self {
        let height = grey.len() / width.max(1);
        let least = (GRADIENT_SIGMAS * noise_grey).max(LEAST_GRADIENT_GREY);
        let at = |u: usize, v: usize| f64::from(grey[v * width + u].into());
        let margin = REACH_PX as usize + 2;
        let edge_at = |u: usize, v: usize| {
            let gradient = Vector2::new(
                0.5 * (at(u + 1, v) - at(u - 1, v)),
                0.5 * (at(u, v + 1) - at(u, v - 1)),
            );
            (gradient.norm_squared() > least * least).then(|| EdgePixel {
                u: u as i32,
                v: v as i32,
                grey: at(u, v),
                gradient,
            })
        };
        let edges_of_row = |v: usize| {
            let columns = margin..width.saturating_sub(margin);
            columns.filter_map(move |u| edge_at(u, v))
        };
        let rows = (margin..height.saturating_sub(margin)).into_par_iter();
        // Evenly over the scene, but for edges of which there are few: those along the rarer direction all stay. They are counted first, since
        // those of a textured scene would take many times its memory.
        let is_upright = |e: &EdgePixel| e.gradient.x.abs() > e.gradient.y.abs();
        let count = |v: usize| {
            edges_of_row(v).fold([0_usize; 2], |mut counts, e| {
                counts[usize::from(is_upright(&e))] += 1;
                counts
            })
        };
        let counts: Vec<[usize; 2]> = rows.clone().map(count).collect();
        let part = |upright: bool| -> Vec<EdgePixel> {
            let of_rows = counts.iter().map(|c| c[usize::from(upright)]);
            let step = of_rows.clone().sum::<usize>().div_ceil(MOST_PIXELS / 2).max(1);
            let before = of_rows.scan(0, |before, count| {
                *before += count;
                Some(*before - count)
            });
            let some_of_row = |(v, before): (usize, usize)| {
                let numbered = (before..).zip(edges_of_row(v).filter(|e| is_upright(e) == upright));
                numbered
                    .filter(|(n, _)| n.is_multiple_of(step))
                    .map(|(_, e)| e)
                    .collect::<Vec<_>>()
            };
            let before: Vec<usize> = before.collect();
            rows.clone().zip(before).flat_map_iter(some_of_row).collect()
        };
        Self {
            pixels: [part(true), part(false)].concat(),
            noise_grey,
            rest_shift_px: 0.0,
        }
    }

    /// The same with the median shift that `frames`, whose light is `lights`, seem to have: most of them are at rest.
    #[must_use]
    pub fn with_rest_shift_of(mut self, frames: &[&Luma], lights: &[Registration]) -> Self {
        let any = ShiftThreshold {
            sigmas: 0.0,
            alike_sigmas: 0.0,
            px: 0.0,
            rest_multiples: 0.0,
        };
        let mut shifts: Vec<f64> = frames
            .par_iter()
            .zip(lights)
            .map(|(frame, light)| {
                let shift = self.shift(frame, light, &[], any);
                shift.map_or(0.0, |[u, v]| u.hypot(v))
            })
            .collect();
        self.rest_shift_px = median(&mut shifts).unwrap_or(0.0);
        self
    }

    /// How far `frame`, whose light is `light`, is shifted as a whole, px, along the directions in which the scene has edges;
    /// `None` where that is below the threshold. The regions `balls` are left out.
    #[must_use]
    pub fn shift(
        &self,
        frame: &Luma,
        light: &Registration,
        balls: &[PixelRegion],
        least: ShiftThreshold,
    ) -> Option<[f64; 2]> {
        self.shift_above(frame, light, balls, &[least])
            .map(|(_, shift)| shift)
    }

    /// The same, found once for several thresholds, with the first of them that it is above.
    #[must_use]
    pub fn shift_above(
        &self,
        frame: &Luma,
        light: &Registration,
        balls: &[PixelRegion],
        thresholds: &[ShiftThreshold],
    ) -> Option<(ShiftThreshold, [f64; 2])> {
        let is_scene = |e: &&EdgePixel| {
            let inside = |r: &std::ops::Range<usize>, x: i32| r.contains(&(x.max(0) as usize));
            !balls.iter().any(|(us, vs)| inside(us, e.u) && inside(vs, e.v))
        };
        let pixels: Vec<EdgePixel> = self.pixels.iter().filter(is_scene).copied().collect();
        if pixels.len() < LEAST_PIXELS {
            return None;
        }
        let expected = |e: &EdgePixel| light.gain * e.grey + light.offset_grey;
        let whole = |s: (i32, i32)| {
            move |e: &EdgePixel| {
                f64::from(frame.data[((e.v + s.1) * frame.width as i32 + e.u + s.0) as usize]) - expected(e)
            }
        };
        // Of most frames one step from no shift says that there is none to look for.
        let (still, _, _) = self.step(&pixels, light.gain, whole((0, 0)))?;
        // The information of a frame at rest; in a shifted one the residuals are not noise alone.
        let all: Matrix2<f64> = pixels.iter().map(|e| e.gradient * e.gradient.transpose()).sum();
        let axes = ObservableAxes::new(&(light.gain.powi(2) * all), self.noise_grey);
        let than_at_rest = |least: &ShiftThreshold| ShiftThreshold {
            px: least.px.max(least.rest_multiples * self.rest_shift_px),
            ..*least
        };
        let mut possible = thresholds
            .iter()
            .filter(|least| axes.exceeds(&still, than_at_rest(least)))
            .peekable();
        possible.peek()?;
        let start = self.best_whole(&pixels, whole);
        let start = Vector2::new(f64::from(start.0), f64::from(start.1));
        let between = |shift: &Vector2<f64>| {
            let (du, dv) = (shift.x, shift.y);
            move |e: &EdgePixel| cubic(frame, f64::from(e.u) + du, f64::from(e.v) + dv) - expected(e)
        };
        let step = |shift: &Vector2<f64>| {
            let (step, _, _) = self.step(&pixels, light.gain, between(shift))?;
            Some(axes.project(&step))
        };
        let moved = |shift: &Vector2<f64>, step: &Vector2<f64>| shift + step;
        let (shift, end) = gauss_newton(start, STEPS, step, moved, |step| step.norm() < 1e-4);
        let shift = axes.project(&shift);
        if end == Termination::Singular || shift.amax() >= f64::from(REACH_PX) {
            return None;
        }
        let (_, information, spread) = self.step(&pixels, light.gain, between(&shift))?;
        let at = |shift: &Vector2<f64>| -> Vec<f64> { pixels.iter().map(between(shift)).collect() };
        let found = at(&shift);
        let axes = ObservableAxes::new(&information, spread).with_alike(&pixels, &found, spread);
        let chi_square = |residuals: &[f64]| -> f64 {
            let bounded = |r: &f64| (r / spread).powi(2).min(TUKEY * TUKEY);
            residuals.iter().map(bounded).sum()
        };
        let best = chi_square(&found);
        let explains = |part: &Vector2<f64>, sigmas: f64| {
            let expected = (NOISE_CORRELATION * sigmas.min(ShiftThreshold::ONSET.sigmas)).powi(2);
            let gained = chi_square(&at(&(shift - part))) - best;
            gained > LEAST_EXPLAINED * expected
                && kept_edges(&pixels, frame, &shift, part) > LEAST_KEPT * light.gain
        };
        let shift = axes.parts_that(&shift, explains);
        let exceeded = possible.find(|least| axes.exceeds(&shift, than_at_rest(least)))?;
        Some((*exceeded, [shift.x, shift.y]))
    }

    /// A step of Gauss-Newton by `residual`s in grey levels, Σ w g gᵀ, and the residuals' standard deviation.
    fn step(
        &self,
        pixels: &[EdgePixel],
        gain: f64,
        residual: impl Fn(&EdgePixel) -> f64,
    ) -> Option<(Vector2<f64>, Matrix2<f64>, f64)> {
        let residuals: Vec<f64> = pixels.iter().map(&residual).collect();
        let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
        let spread = std_from_magnitudes(&mut sizes)?.max(0.5 * self.noise_grey);
        let mut equations = NormalEquations::default();
        for (e, &r) in pixels.iter().zip(&residuals) {
            equations.push(&(-gain * e.gradient), r, tukey_weight(r, TUKEY * spread));
        }
        // A direction without edges takes no step: a little more than nothing along the diagonal.
        let little = 1e-9 * equations.matrix.trace().max(f64::MIN_POSITIVE);
        let step = equations.step(0.0, little)?;
        equations.matrix.fill_upper_triangle_with_lower_triangle();
        Some((step, equations.matrix, spread))
    }

    /// The whole pixels by which the frame is shifted, by the least sum of bounded squares.
    fn best_whole<F: Fn(&EdgePixel) -> f64>(
        &self,
        pixels: &[EdgePixel],
        whole: impl Fn((i32, i32)) -> F,
    ) -> (i32, i32) {
        let most = (6.0 * self.noise_grey).max(10.0).powi(2);
        let cost = |s: (i32, i32)| {
            let residual = whole(s);
            pixels.iter().map(|e| residual(e).powi(2).min(most)).sum::<f64>()
        };
        let all = (-REACH_PX..=REACH_PX).flat_map(|dv| (-REACH_PX..=REACH_PX).map(move |du| (du, dv)));
        // Of equal ones (along an edge) the nearest.
        let rank = |s: (i32, i32)| cost(s) * (1.0 + 1e-3 * f64::from(s.0 * s.0 + s.1 * s.1));
        all.map(|s| (rank(s), s))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or((0, 0), |(_, s)| s)
    }
}

/// The slope of the frame at the shifted places of `pixels` over that of the scene, along a direction, by least squares: 1 where the scene's
/// edges are there, 0 where nothing is.
fn kept_edges(pixels: &[EdgePixel], frame: &Luma, shift: &Vector2<f64>, direction: &Vector2<f64>) -> f64 {
    let Some(axis) = direction.try_normalize(0.0) else {
        return 1.0;
    };
    let (mut both, mut own) = (0.0, 0.0);
    for e in pixels {
        let (u, v) = (f64::from(e.u) + shift.x, f64::from(e.v) + shift.y);
        let slope = 0.5 * (cubic(frame, u + axis.x, v + axis.y) - cubic(frame, u - axis.x, v - axis.y));
        let along = e.gradient.dot(&axis);
        both += slope * along;
        own += along * along;
    }
    both / own.max(f64::MIN_POSITIVE)
}

/// A direction in which a shift is seen.
#[derive(Debug, Clone, Copy)]
struct ObservableAxis {
    direction: Vector2<f64>,
    /// Standard uncertainty of a shift along it, px, by residuals that are independent.
    std: f64,
    /// The same by residuals that are alike along rows or columns, and its degrees of freedom.
    alike: Option<(f64, f64)>,
}

impl ObservableAxis {
    /// By how many standard deviations of a normal variable a shift is as unlikely as this one is where residuals are alike: Student's t
    /// as a normal deviate (Wallace 1959, Ann. Math. Statist. 30, 1124).
    fn alike_sigmas(&self, along: f64) -> f64 {
        self.alike.map_or(f64::INFINITY, |(std, freedom)| {
            let t = along / std;
            (freedom * (t * t / freedom).ln_1p()).sqrt()
        })
    }

    fn exceeds(&self, along: f64, least: &ShiftThreshold) -> bool {
        along.abs() / self.std > least.sigmas
            && self.alike_sigmas(along) > least.alike_sigmas
            && along.abs() > least.px
    }
}

/// Two directions, square to each other.
struct ObservableAxes {
    axes: [ObservableAxis; 2],
}

impl ObservableAxes {
    fn new(information: &Matrix2<f64>, spread: f64) -> Self {
        let eigen = SymmetricEigen::new(*information);
        let axis = |i: usize| {
            let std = NOISE_CORRELATION * spread / eigen.eigenvalues[i].max(f64::MIN_POSITIVE).sqrt();
            ObservableAxis {
                direction: eigen.eigenvectors.column(i).into_owned(),
                std,
                alike: None,
            }
        };
        Self {
            axes: [axis(0), axis(1)],
        }
    }

    /// The same with uncertainties that allow for `residuals` of `pixels` that are alike along the edges that tell of an axis, those of a row or of a column.
    fn with_alike(mut self, pixels: &[EdgePixel], residuals: &[f64], spread: f64) -> Self {
        for axis in &mut self.axes {
            let by_rows = axis.direction.y.abs() > axis.direction.x.abs();
            // Of each row or column what it says of the shift, and how much it tells.
            let mut lines: BTreeMap<i32, (f64, f64)> = BTreeMap::new();
            for (e, &r) in pixels.iter().zip(residuals) {
                let along = e.gradient.dot(&axis.direction);
                let weight = tukey_weight(r, TUKEY * spread);
                let line = lines.entry(if by_rows { e.v } else { e.u }).or_default();
                line.0 += weight * r * along;
                line.1 += weight * along * along;
            }
            let information: f64 = lines.values().map(|l| l.1).sum();
            let squares: f64 = lines.values().map(|l| l.0 * l.0).sum();
            // As many lines of equal weight tell as much as all do.
            let telling = information.powi(2) / lines.values().map(|l| l.1 * l.1).sum::<f64>();
            axis.alike = (telling > 1.0).then(|| {
                let std = (squares * telling / (telling - 1.0)).sqrt() / information;
                (std, telling - 1.0)
            });
        }
        self
    }

    /// The parts of `v` along the axes for which `is_so` (part, standard deviations).
    fn parts_that(&self, v: &Vector2<f64>, is_so: impl Fn(&Vector2<f64>, f64) -> bool) -> Vector2<f64> {
        let parts = self.axes.iter().map(|axis| {
            let along = axis.direction.dot(v);
            let std = axis.alike.map_or(axis.std, |(std, _)| std.max(axis.std));
            (axis.direction * along, along.abs() / std)
        });
        parts
            .filter(|(part, sigmas)| is_so(part, *sigmas))
            .map(|(part, _)| part)
            .sum()
    }

    /// The part of `v` along the directions in which a shift is determined.
    fn project(&self, v: &Vector2<f64>) -> Vector2<f64> {
        let part = |axis: &ObservableAxis| {
            if axis.std < FOLLOWED_STD_PX {
                axis.direction * axis.direction.dot(v)
            } else {
                Vector2::zeros()
            }
        };
        part(&self.axes[0]) + part(&self.axes[1])
    }

    fn exceeds(&self, v: &Vector2<f64>, least: ShiftThreshold) -> bool {
        self.axes.iter().any(|axis| {
            let along = axis.direction.dot(v);
            axis.std < FOLLOWED_STD_PX && axis.exceeds(along, &least)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    const SIZE: (usize, usize) = (400, 240);

    /// A wall with a floor line at row 200, and a bench's end at column 60 above row 120, all softened, shifted by `s`, with noise.
    fn scene(s: [f64; 2], bench: bool, noise: f64, seed: u64) -> Luma {
        let step = |x: f64| 1.0 / (1.0 + (-2.2 * x).exp());
        let mut random = TestNoise(seed);
        Luma::from_fn(SIZE.0, SIZE.1, |u, v| {
            let (u, v) = (u as f64 - s[0], v as f64 - s[1]);
            let mut grey = 60.0 + 35.0 * step(v - 200.0);
            if bench {
                grey += 40.0 * step(60.0 - u) * step(v - 120.0) * step(160.0 - v);
            }
            (grey + noise * random.normal()).round().clamp(0.0, 255.0) as u8
        })
    }

    fn edges(bench: bool) -> SceneEdges {
        let grey: Vec<f32> = scene([0.0; 2], bench, 0.0, 1)
            .data
            .iter()
            .map(|&p| f32::from(p))
            .collect();
        SceneEdges::new(&grey, SIZE.0, 2.0)
    }

    #[test]
    fn a_swing_is_followed_to_hundredths_of_a_pixel() {
        let edges = edges(true);
        for (i, s) in [[0.6, 0.4], [1.5, -2.3], [-3.0, 0.5], [0.1, 3.7]]
            .into_iter()
            .enumerate()
        {
            let frame = scene(s, true, 2.0, 7 + i as u64);
            let found = edges
                .shift(&frame, &Registration::IDENTITY, &[], ShiftThreshold::ONSET)
                .unwrap();
            assert!((found[0] - s[0]).abs() < 0.08, "{found:?} for {s:?}");
            assert!((found[1] - s[1]).abs() < 0.03, "{found:?} for {s:?}");
        }
    }

    #[test]
    fn a_camera_that_stands_still_does_not_swing() {
        let edges = edges(true);
        for seed in 0..40 {
            let frame = scene([0.0; 2], true, 2.0, 100 + seed);
            assert_eq!(
                edges.shift(&frame, &Registration::IDENTITY, &[], ShiftThreshold::ONSET),
                None,
                "{seed}"
            );
        }
    }

    #[test]
    fn along_a_line_nothing_is_followed() {
        let edges = edges(false);
        let found = edges
            .shift(
                &scene([2.0, 1.2], false, 2.0, 3),
                &Registration::IDENTITY,
                &[],
                ShiftThreshold::ONSET,
            )
            .unwrap();
        assert!(
            found[0].abs() < 0.02 && (found[1] - 1.2).abs() < 0.03,
            "{found:?}"
        );
        let aside = scene([2.0, 0.0], false, 2.0, 4);
        assert_eq!(
            edges.shift(&aside, &Registration::IDENTITY, &[], ShiftThreshold::ONSET),
            None
        );
    }

    #[test]
    fn a_ball_before_an_edge_is_no_swing() {
        let edges = edges(true);
        let mut frame = scene([0.0; 2], true, 2.0, 5);
        for v in 120..150 {
            frame.data[v * SIZE.0 + 45..v * SIZE.0 + 75].fill(200);
        }
        let ball: PixelRegion = (43..77, 118..152);
        assert_eq!(
            edges.shift(&frame, &Registration::IDENTITY, &[ball], ShiftThreshold::ONSET),
            None
        );
    }

    #[test]
    fn a_line_that_a_codec_draws_anew_is_no_swing() {
        let edges = edges(false);
        let mut frame = scene([0.0; 2], false, 0.4, 6);
        for (row, change) in [(198, 1), (199, -2), (200, -3), (201, 2), (202, 3), (203, 1)] {
            for p in &mut frame.data[row * SIZE.0..(row + 1) * SIZE.0] {
                *p = p.saturating_add_signed(change);
            }
        }
        assert_eq!(
            edges.shift(&frame, &Registration::IDENTITY, &[], ShiftThreshold::ONSET),
            None
        );
    }

    #[test]
    fn artefacts_of_a_codec_that_are_gone_are_no_swing() {
        // Faint upright edges at random places, of which the frame has none.
        let mut random = TestNoise(8);
        let mut grey = scene([0.0; 2], false, 0.0, 1);
        for _ in 0..40 {
            let at = |n: usize, x: f64| 20 + (x.abs() * 50.0) as usize % (n - 60);
            let (u, v) = (at(SIZE.0, random.normal()), at(190, random.normal()));
            for row in v..v + 8 {
                grey.data[row * SIZE.0 + u..row * SIZE.0 + u + 8]
                    .iter_mut()
                    .for_each(|p| *p += 7);
            }
        }
        let grey: Vec<f32> = grey.data.iter().map(|&p| f32::from(p)).collect();
        let edges = SceneEdges::new(&grey, SIZE.0, 0.4);
        for seed in 0..20 {
            let frame = scene([0.0; 2], false, 0.4, 300 + seed);
            let found = edges.shift(&frame, &Registration::IDENTITY, &[], ShiftThreshold::ONSET);
            assert_eq!(found, None, "{seed}");
        }
    }
}
