//! The exact place of a chessboard's corners.
//!
//! OpenCV's finders (sector based, or classic with `cornerSubPix`) are good to 0.03 to 0.06 px rms on rendered boards
//! without any noise, with outliers of 0.6 px; a lens to 0.1 px in the far corners of the picture needs better. Around
//! each corner the picture is therefore fitted by what a camera sees of a corner,
//!
//! ```text
//! I(p) = (1 + g · (p − c)) (a + b E(X / |∇X|) E(Y / |∇Y|)),        E(d) = ∫ erf(t / √2 σ) dt over d − ½ .. d + ½
//! ```
//!
//! with E an edge at the distance d (px), blurred by σ and averaged over a pixel, X, Y the board's own coordinates from the corner on (polynomials through the neighbouring corners, so that
//! perspective and the lens may bend the edges), a the mean grey, b the contrast, g the slope of the light, σ the blur. The fit gives
//! the place c with its standard uncertainty. The product of the two edges is exact for edges at right angles; elsewhere
//! it is wrong within a blur's width of the corner, but point symmetric about it, so that the place does not suffer.

use crate::calibration::blurred_edge::shade;
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{Accumulate, Damping, NormalEquations, Termination, fit_normal};
use nalgebra::{DMatrix, Matrix3, SVector};
use opencv::calib3d::find_homography_ext_def;
use opencv::core::{MatTraitConst as _, Point2d, Vector};

/// The homography from pixels to squares that all corners together show best; `None` where they have none.
fn perspective(places: &[PixelPoint], columns: usize) -> Option<Matrix3<f64>> {
    let pixels: Vector<Point2d> = places.iter().map(|p| Point2d::new(p.u_px, p.v_px)).collect();
    let squares: Vector<Point2d> = (0..places.len())
        .map(|i| Point2d::new((i % columns) as f64, (i / columns) as f64))
        .collect();
    let found = find_homography_ext_def(&pixels, &squares).ok()?;
    let mut matrix = Matrix3::zeros();
    for i in 0..3 {
        for j in 0..3 {
            matrix[(i, j)] = *found.at_2d::<f64>(i as i32, j as i32).ok()?;
        }
    }
    Some(matrix)
}

/// (value, d/du, d/dv) of both coordinates of a pixel's image under a homography.
fn through(h: &Matrix3<f64>, p: PixelPoint) -> [(f64, f64, f64); 2] {
    let row = |i: usize| h[(i, 0)] * p.u_px + h[(i, 1)] * p.v_px + h[(i, 2)];
    let w = row(2);
    [0, 1].map(|i| {
        let value = row(i) / w;
        (
            value,
            (h[(i, 0)] - value * h[(2, 0)]) / w,
            (h[(i, 1)] - value * h[(2, 1)]) / w,
        )
    })
}

/// Half the window's side in squares: clear of the next corners' lines.
const REACH_SQUARES: f64 = 0.45;
/// The window reaches at least and at most this far, px.
const REACH_PX: (f64, f64) = (3.0, 22.0);
/// Blur to start from, px.
const FIRST_BLUR_PX: f64 = 0.9;
/// Blur that can be believed, px.
const BLUR_PX: (f64, f64) = (0.2, 8.0);
const ITERATIONS: usize = 25;
/// A step of the place that ends the fit, px.
const SETTLED_PX: f64 = 1e-4;
/// Root mean square residual of the fit, over the contrast, above which this is no corner.
const LARGEST_RESIDUAL: f64 = 0.2;
/// Rounds over all corners: the second knows the neighbours' places.
const ROUNDS: usize = 2;

/// A corner of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Where.
    pub at: PixelPoint,
    /// Standard uncertainty of each coordinate from the picture's noise, px.
    pub std_px: f64,
}

/// The corners of a board of `columns` corners a row, refined from `found` (row by row); `None` where the picture around
/// one does not look like a corner (covered, smeared, overexposed, at the picture's border).
pub fn refine(picture: &Luma, columns: usize, found: &[PixelPoint]) -> Vec<Option<Corner>> {
    let mut places = found.to_vec();
    let mut corners = vec![None; found.len()];
    for _ in 0..ROUNDS {
        let Some(perspective) = perspective(&places, columns) else {
            return vec![None; found.len()];
        };
        corners = (0..places.len())
            .map(|i| {
                fit(
                    picture,
                    &BoardCoordinates::around(&places, columns, i, &perspective)?,
                )
            })
            .collect();
        for (place, corner) in places.iter_mut().zip(&corners) {
            if let Some(Corner { at, .. }) = corner {
                *place = *at;
            }
        }
    }
    corners
}

/// Terms of a polynomial without its constant: u, v, u², u v, v².
type Polynomial = SVector<f64, 5>;

/// The board's coordinates around a corner: X and Y in squares as functions of the pixel's offset from it.
///
/// The perspective is that of the whole view; what it leaves (the lens) goes into a polynomial through the 3 by 3 corners
/// around this one (or nearest to it at the board's rim).
struct BoardCoordinates<'a> {
    corner: PixelPoint,
    perspective: &'a Matrix3<f64>,
    /// X and Y of the perspective at the corner.
    zero: [f64; 2],
    rest: [Polynomial; 2],
}

impl<'a> BoardCoordinates<'a> {
    #[allow(
        clippy::needless_range_loop,
        reason = "indices of matrices, as in the formulas"
    )]
    fn around(
        places: &[PixelPoint],
        columns: usize,
        index: usize,
        perspective: &'a Matrix3<f64>,
    ) -> Option<Self> {
        let rows = places.len() / columns;
        let (column, row) = (index % columns, index / columns);
        let block = |at: usize, size: usize| at.saturating_sub(1).min(size.saturating_sub(3));
        let corner = places[index];
        let zero = through(perspective, corner).map(|x| x.0);
        let mut board = Self {
            corner,
            perspective,
            zero,
            rest: [Polynomial::zeros(); 2],
        };
        let mut terms = DMatrix::zeros(9, 5);
        let mut rests = DMatrix::zeros(9, 2);
        for k in 0..9 {
            let (c, r) = (block(column, columns) + k % 3, block(row, rows) + k / 3);
            let p = places.get(r * columns + c)?;
            let (u, v) = (p.u_px - corner.u_px, p.v_px - corner.v_px);
            terms.row_mut(k).copy_from_slice(&[u, v, u * u, u * v, v * v]);
            let [x, y] = board.at(u, v);
            rests[(k, 0)] = c as f64 - column as f64 - x.0;
            rests[(k, 1)] = r as f64 - row as f64 - y.0;
        }
        // Columns of one size each, so that a square of 5 px and one of 500 are solved alike.
        let scale: Vec<f64> = terms.column_iter().map(|c| c.norm()).collect();
        for (mut column, s) in terms.column_iter_mut().zip(&scale) {
            column /= *s;
        }
        let solution = terms.svd(true, true).solve(&rests, 1e-9).ok()?;
        board.rest = [0, 1].map(|axis| Polynomial::from_fn(|i, _| solution[(i, axis)] / scale[i]));
        Some(board)
    }

    /// (value, d/du, d/dv) of X and of Y at an offset.
    fn at(&self, u: f64, v: f64) -> [(f64, f64, f64); 2] {
        let seen = PixelPoint::new(self.corner.u_px + u, self.corner.v_px + v);
        let mut both = through(self.perspective, seen);
        for ((axis, zero), p) in both.iter_mut().zip(self.zero).zip(&self.rest) {
            axis.0 += (p[0] + p[2] * u + p[3] * v) * u + (p[1] + p[4] * v) * v - zero;
            axis.1 += p[0] + 2.0 * p[2] * u + p[3] * v;
            axis.2 += p[1] + p[3] * u + 2.0 * p[4] * v;
        }
        both
    }

    /// How far the window reaches from the corner, px.
    fn reach_px(&self) -> f64 {
        // Half a square along each axis of the board is det / |other gradient| along the picture's axes; the smaller
        // height of the parallelogram is what fits.
        let [x, y] = self.at(0.0, 0.0);
        REACH_SQUARES / x.1.hypot(x.2).max(y.1.hypot(y.2))
    }
}

/// What is fitted: place (2), blur, mean grey, slope of the light (2), contrast.
type CornerParameters = SVector<f64, 7>;
const BLUR: usize = 2;
const MEAN: usize = 3;
const CONTRAST: usize = 6;

fn fit(picture: &Luma, board: &BoardCoordinates<'_>) -> Option<Corner> {
    let reach = board.reach_px().clamp(REACH_PX.0, REACH_PX.1);
    let window = CornerWindow::new(picture, board, reach)?;
    let (p, equations, end) = fit_normal(&window, window.start(), &Damping::MARQUARDT, ITERATIONS);
    if end == Termination::Singular {
        return None;
    }
    let freedom = window.pixels.len() as f64 - 7.0;
    let residual_std = (equations.cost / freedom).sqrt();
    let mut information = equations.matrix;
    information.fill_upper_triangle_with_lower_triangle();
    let covariance = information.try_inverse()? * residual_std * residual_std;
    let std_px = (0.5 * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt();
    let believable = p[0].hypot(p[1]) < 0.5 * reach
        && residual_std < LARGEST_RESIDUAL * p[CONTRAST].abs()
        && std_px > 0.0
        && std_px < 0.5;
    believable.then(|| Corner {
        at: PixelPoint::new(board.corner.u_px + p[0], board.corner.v_px + p[1]),
        // Rounding to whole grey levels, even where it hides the noise.
        std_px: std_px.max(std_px / residual_std.max(1e-9) / 12.0_f64.sqrt()),
    })
}

/// The picture around a corner.
struct CornerWindow<'a> {
    board: &'a BoardCoordinates<'a>,
    /// (u, v) from the corner, grey.
    pixels: Vec<(f64, f64, f64)>,
}

impl<'a> CornerWindow<'a> {
    fn new(picture: &Luma, board: &'a BoardCoordinates<'a>, reach: f64) -> Option<Self> {
        let (cu, cv) = (board.corner.u_px, board.corner.v_px);
        let side = |centre: f64, size: usize| {
            let (from, to) = ((centre - reach).ceil(), (centre + reach).floor());
            // A corner near the border would be seen on one side only.
            (from >= 0.0 && to < size as f64).then(|| from as usize..to as usize + 1)
        };
        let (us, vs) = (side(cu, picture.width)?, side(cv, picture.height)?);
        let mut pixels = Vec::new();
        for v in vs {
            let row = picture.row(v);
            for u in us.clone() {
                let (du, dv) = (u as f64 - cu, v as f64 - cv);
                let near = |x: (f64, f64, f64)| x.0.abs() <= REACH_SQUARES;
                if du.hypot(dv) <= reach && board.at(du, dv).into_iter().all(near) {
                    pixels.push((du, dv, f64::from(row[u])));
                }
            }
        }
        (pixels.len() > 20).then_some(Self { board, pixels })
    }

    /// Light and contrast of a corner at the place it was found.
    fn start(&self) -> CornerParameters {
        let mut p = CornerParameters::zeros();
        p[BLUR] = FIRST_BLUR_PX;
        let count = self.pixels.len() as f64;
        p[MEAN] = self.pixels.iter().map(|x| x.2).sum::<f64>() / count;
        let sign = |u: f64, v: f64| {
            let [x, y] = self.board.at(u, v);
            if x.0 * y.0 > 0.0 { 1.0 } else { -1.0 }
        };
        let sum: f64 = self
            .pixels
            .iter()
            .map(|&(u, v, grey)| sign(u, v) * (grey - p[MEAN]))
            .sum();
        p[CONTRAST] = sum / count;
        p
    }

    /// The model at an offset, and its derivatives.
    fn model(&self, p: &CornerParameters, u: f64, v: f64) -> (f64, CornerParameters) {
        let (du, dv, blur) = (u - p[0], v - p[1], p[BLUR]);
        let [(ex, ex_u, ex_v, ex_blur), (ey, ey_u, ey_v, ey_blur)] =
            self.board.at(du, dv).map(|axis| edge(axis, blur));
        let contrast = p[CONTRAST];
        let light = 1.0 + p[MEAN + 1] * du + p[MEAN + 2] * dv;
        let board = p[MEAN] + contrast * ex * ey;
        let slope = SVector::from([
            -p[MEAN + 1] * board - light * contrast * (ex_u * ey + ex * ey_u),
            -p[MEAN + 2] * board - light * contrast * (ex_v * ey + ex * ey_v),
            light * contrast * (ex_blur * ey + ex * ey_blur),
            light,
            du * board,
            dv * board,
            light * ex * ey,
        ]);
        (light * board, slope)
    }
}

impl Accumulate<7> for CornerWindow<'_> {
    fn equations(&self, p: &CornerParameters) -> NormalEquations<7> {
        let mut equations = NormalEquations::default();
        for &(u, v, grey) in &self.pixels {
            let (value, slope) = self.model(p, u, v);
            equations.push(&slope, grey - value, 1.0);
        }
        equations
    }

    fn within_limits(&self, mut p: CornerParameters) -> CornerParameters {
        p[BLUR] = p[BLUR].clamp(BLUR_PX.0, BLUR_PX.1);
        p
    }

    fn is_small(&self, step: &CornerParameters) -> bool {
        step[0].hypot(step[1]) < SETTLED_PX
    }
}

/// A blurred edge at a place (value, d/du, d/dv) of its coordinate: grey from −1 to 1, its derivatives by u, v and the
/// blur. The gradient that turns the coordinate into pixels counts as constant.
fn edge((x, x_u, x_v): (f64, f64, f64), blur_px: f64) -> (f64, f64, f64, f64) {
    let steep = x_u.hypot(x_v);
    let s = shade(x / steep, blur_px);
    let by_x = s.by_distance / steep;
    (s.value, by_x * x_u, by_x * x_v, s.by_blur)
}
