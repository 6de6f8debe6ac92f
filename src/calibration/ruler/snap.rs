//! A mark moved to the nearest edge, to a part of a pixel.
//!
//! Along the given direction the nearest place where the brightness steps is looked for; around it the picture is fitted by
//! a straight blurred edge, a + b E(s − s₀ − m l), or, where a second, opposite step follows within a few pixels, by a
//! thin line, a + b (E(s − s₀ − m l + h) − E(s − s₀ − m l − h)), whose middle counts: s along the direction, l across,
//! m the edge's slant. The tick of a ruler has two edges, and whoever points at a tick means its middle.

use crate::calibration::blurred_edge::shade;
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{Accumulate, Damping, NormalEquations, Termination, fit_normal};
use nalgebra::{SVector, Vector2};

/// Half the length of edge that is looked at, across the direction, px.
const ACROSS_PX: f64 = 4.0;
/// Half the window along the direction around the edge, px.
const ALONG_PX: f64 = 5.0;
/// Two opposite steps within this are a line, px.
const LINE_PX: f64 = 8.0;
/// A second step counts when it is at least this part of the first.
const LINE_PART: f64 = 0.5;
/// Steps weaker than this part of the strongest within reach are texture.
const WEAK_PART: f64 = 0.35;
/// And steps of fewer grey levels a pixel than this are nothing.
const LEAST_SLOPE: f64 = 2.0;
/// The edge must stand out by this many standard uncertainties.
const LEAST_SIGMAS: f64 = 8.0;
/// Blur that can be believed, px.
const BLUR_PX: (f64, f64) = (0.2, 4.0);
const ITERATIONS: usize = 40;
/// A least uncertainty: edges of real things are no straighter, px.
const LEAST_STD_PX: f64 = 0.03;

/// What was found near a mark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapped {
    /// Where.
    pub at: PixelPoint,
    /// Standard uncertainty along the direction, px.
    pub std_px: f64,
    /// How far from the mark, px.
    pub moved_px: f64,
    /// The middle of a thin line, or one edge.
    pub line: bool,
}

/// The edge nearest to `at` along `direction` (and against it), within `reach_px`; `None` where there is none.
#[must_use]
pub fn snap(picture: &Luma, at: PixelPoint, direction: [f64; 2], reach_px: f64) -> Option<Snapped> {
    let along = Vector2::new(direction[0], direction[1]).try_normalize(0.0)?;
    let frame = EdgeSearch {
        picture,
        at: Vector2::new(at.u_px, at.v_px),
        along,
        across: Vector2::new(-along.y, along.x),
    };
    let steps = frame.steps(reach_px);
    let strongest = steps.iter().map(|s| s.slope.abs()).fold(0.0, f64::max);
    let counts = |s: &&BrightnessStep| s.slope.abs() > (WEAK_PART * strongest).max(LEAST_SLOPE);
    let nearest = steps
        .iter()
        .filter(|s| s.at.abs() <= reach_px)
        .filter(counts)
        .min_by(|a, b| a.at.abs().total_cmp(&b.at.abs()))?;
    // Of a line's two edges the mark may be nearer to either.
    let partner = steps
        .iter()
        .filter(|s| {
            s.slope * nearest.slope < 0.0
                && (s.at - nearest.at).abs() <= LINE_PX
                && s.slope.abs() > LINE_PART * nearest.slope.abs()
        })
        .min_by(|a, b| (a.at - nearest.at).abs().total_cmp(&(b.at - nearest.at).abs()));
    let fitted = match partner {
        Some(partner) => frame.fit(
            0.5 * (nearest.at + partner.at),
            Some(0.5 * (nearest.at - partner.at).abs()),
        ),
        None => frame.fit(nearest.at, None),
    }?;
    let place = frame.at + along * fitted.0;
    Some(Snapped {
        at: PixelPoint::new(place.x, place.y),
        std_px: fitted.1.max(LEAST_STD_PX),
        moved_px: fitted.0.abs(),
        line: partner.is_some(),
    })
}

/// A place along the direction where the brightness changes fastest.
#[derive(Debug, Clone, Copy)]
struct BrightnessStep {
    at: f64,
    /// Grey a pixel.
    slope: f64,
}

struct EdgeSearch<'a> {
    picture: &'a Luma,
    at: Vector2<f64>,
    along: Vector2<f64>,
    across: Vector2<f64>,
}

impl EdgeSearch<'_> {
    /// Grey between pixels, bilinear; `None` outside.
    fn grey(&self, p: Vector2<f64>) -> Option<f64> {
        let (u, v) = (p.x.floor(), p.y.floor());
        let inside = u >= 0.0
            && v >= 0.0
            && u + 1.0 < self.picture.width as f64
            && v + 1.0 < self.picture.height as f64;
        if !inside {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        let (a, b) = (p.x - u, p.y - v);
        let (top, bottom) = (self.picture.row(j), self.picture.row(j + 1));
        let mix = |row: &[u8]| f64::from(row[i]) * (1.0 - a) + f64::from(row[i + 1]) * a;
        Some(mix(top) * (1.0 - b) + mix(bottom) * b)
    }

    /// Extremes of the slope of the mean profile, a little beyond the reach for the second edge of a line.
    fn steps(&self, reach_px: f64) -> Vec<BrightnessStep> {
        const SPACING: f64 = 0.25;
        let reach = reach_px + LINE_PX + 2.0;
        let count = (2.0 * reach / SPACING) as i64;
        let places: Vec<f64> = (0..=count).map(|i| -reach + i as f64 * SPACING).collect();
        let mean = |s: f64| {
            let rows = -(ACROSS_PX as i64)..=ACROSS_PX as i64;
            let greys: Vec<f64> = rows
                .filter_map(|l| self.grey(self.at + self.along * s + self.across * l as f64))
                .collect();
            (!greys.is_empty()).then(|| greys.iter().sum::<f64>() / greys.len() as f64)
        };
        let profile: Vec<Option<f64>> = places.iter().map(|&s| mean(s)).collect();
        // Over two pixels: the blur of any camera, and half the noise of one.
        let half = (1.0 / SPACING) as usize;
        let slope = |i: usize| {
            let (a, b) = (profile.get(i.checked_sub(half)?)?, profile.get(i + half)?);
            Some((((*b)? - (*a)?) / 2.0, places[i]))
        };
        let slopes: Vec<Option<(f64, f64)>> = (0..places.len()).map(slope).collect();
        let mut steps = Vec::new();
        for i in 1..slopes.len().saturating_sub(1) {
            if let (Some(l), Some(c), Some(r)) = (slopes[i - 1], slopes[i], slopes[i + 1])
                && c.0.abs() > l.0.abs()
                && c.0.abs() >= r.0.abs()
                && c.0 != 0.0
            {
                steps.push(BrightnessStep { at: c.1, slope: c.0 });
            }
        }
        steps
    }

    /// Place along the direction and its standard uncertainty, from the edge or (with half its width) line near `start`.
    fn fit(&self, start: f64, half_width: Option<f64>) -> Option<(f64, f64)> {
        let reach = ALONG_PX + half_width.unwrap_or(0.0);
        let pixels = self.pixels(start, reach);
        if pixels.len() < 30 {
            return None;
        }
        let edge = BlurredEdge {
            pixels: &pixels,
            line: half_width.is_some(),
        };
        let first = self.start(&pixels, start, half_width);
        let (p, mut equations, end) = fit_normal(&edge, first, &Damping::MARQUARDT, ITERATIONS);
        if end == Termination::Singular {
            return None;
        }
        let fitted = if edge.line { 7.0 } else { 6.0 };
        let residual_grey2 = (equations.cost / (pixels.len() as f64 - fitted)).max(1.0 / 12.0);
        // By itself: of a narrow line only width times contrast is known.
        let contrast_std = (residual_grey2 / equations.matrix[(CONTRAST, CONTRAST)]).sqrt();
        if !edge.line {
            equations.hold(HALF);
        }
        let covariance = equations.covariance()? * residual_grey2;
        let std = covariance[(PLACE, PLACE)].max(0.0).sqrt();
        let near = (p[PLACE] - start).abs() < ALONG_PX;
        (near && std.is_finite() && p[CONTRAST].abs() > LEAST_SIGMAS * contrast_std)
            .then_some((p[PLACE], std))
    }

    /// (s, l, grey) of the pixels around a place along the direction.
    fn pixels(&self, place: f64, reach: f64) -> Vec<(f64, f64, f64)> {
        let middle = self.at + self.along * place;
        let radius = reach.hypot(ACROSS_PX).ceil();
        let range = |centre: f64, size: usize| {
            let from = (centre - radius).ceil().max(0.0) as usize;
            from..((centre + radius).floor() + 1.0).clamp(0.0, size as f64) as usize
        };
        let mut pixels = Vec::new();
        for v in range(middle.y, self.picture.height) {
            let row = self.picture.row(v);
            for u in range(middle.x, self.picture.width) {
                let off = Vector2::new(u as f64, v as f64) - self.at;
                let (s, l) = (off.dot(&self.along), off.dot(&self.across));
                if (s - place).abs() <= reach && l.abs() <= ACROSS_PX {
                    pixels.push((s, l, f64::from(row[u])));
                }
            }
        }
        pixels
    }

    fn start(&self, pixels: &[(f64, f64, f64)], place: f64, half_width: Option<f64>) -> EdgeParameters {
        let mean = |keep: &dyn Fn(f64) -> bool| {
            let (sum, count) = pixels
                .iter()
                .filter(|p| keep(p.0 - place))
                .fold((0.0, 0.0), |(s, n), p| (s + p.2, n + 1.0));
            if count > 0.0 { sum / count } else { 128.0 }
        };
        let mut p = EdgeParameters::zeros();
        p[PLACE] = place;
        p[BLUR] = 0.8;
        match half_width {
            Some(half) => {
                p[HALF] = half.max(0.5);
                p[MEAN] = mean(&|s| s.abs() > half + 2.0);
                // A narrow line never reaches its own grey: twice is near enough to start from.
                p[CONTRAST] = 0.5 * (mean(&|s| s.abs() < half.max(0.7)) - p[MEAN]);
            }
            None => {
                let (before, after) = (mean(&|s| s < -1.5), mean(&|s| s > 1.5));
                p[MEAN] = 0.5 * (before + after);
                p[CONTRAST] = 0.5 * (after - before);
            }
        }
        p
    }
}

/// Place, slant, blur, half width, mean grey, its slope along, contrast.
type EdgeParameters = SVector<f64, 7>;
const PLACE: usize = 0;
const SLANT: usize = 1;
const BLUR: usize = 2;
const HALF: usize = 3;
const MEAN: usize = 4;
const LIGHT: usize = 5;
const CONTRAST: usize = 6;

/// A straight blurred edge, or a thin line, and the pixels (s, l, grey) that show it.
struct BlurredEdge<'a> {
    pixels: &'a [(f64, f64, f64)],
    line: bool,
}

impl BlurredEdge<'_> {
    /// The grey at (s, l), and its derivatives.
    fn model(&self, p: &EdgeParameters, s: f64, l: f64) -> (f64, EdgeParameters) {
        let slant = (1.0 + p[SLANT] * p[SLANT]).sqrt();
        let off = s - p[PLACE];
        let distance = (off - p[SLANT] * l) / slant;
        let mut slope = EdgeParameters::zeros();
        let (shape, by_distance, by_blur) = if self.line {
            let (near, far) = (
                shade(distance + p[HALF], p[BLUR]),
                shade(distance - p[HALF], p[BLUR]),
            );
            slope[HALF] = p[CONTRAST] * (near.by_distance + far.by_distance);
            (
                near.value - far.value,
                near.by_distance - far.by_distance,
                near.by_blur - far.by_blur,
            )
        } else {
            let e = shade(distance, p[BLUR]);
            (e.value, e.by_distance, e.by_blur)
        };
        slope[PLACE] = -p[CONTRAST] * by_distance / slant - p[LIGHT];
        slope[SLANT] = p[CONTRAST] * by_distance * (-l / slant - distance * p[SLANT] / (slant * slant));
        slope[BLUR] = p[CONTRAST] * by_blur;
        slope[MEAN] = 1.0;
        slope[LIGHT] = off;
        slope[CONTRAST] = shape;
        (p[MEAN] + p[LIGHT] * off + p[CONTRAST] * shape, slope)
    }
}

impl Accumulate<7> for BlurredEdge<'_> {
    fn equations(&self, p: &EdgeParameters) -> NormalEquations<7> {
        let mut equations = NormalEquations::default();
        for &(s, l, grey) in self.pixels {
            let (value, slope) = self.model(p, s, l);
            equations.push(&slope, grey - value, 1.0);
        }
        equations
    }

    fn within_limits(&self, mut p: EdgeParameters) -> EdgeParameters {
        p[BLUR] = p[BLUR].clamp(BLUR_PX.0, BLUR_PX.1);
        p[HALF] = p[HALF].max(0.2);
        p
    }

    /// Of an edge the half width is not told by any pixel.
    fn floor(&self) -> f64 {
        1e-12
    }

    fn is_small(&self, step: &EdgeParameters) -> bool {
        step[PLACE].abs() < 1e-4
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;
    use proptest::prelude::*;

    /// A picture of a half plane (or a bar of width `width`) whose edge goes through `at` with the normal at `angle`.
    fn picture(
        at: (f64, f64),
        angle: f64,
        width: Option<f64>,
        (dark, bright): (f64, f64),
        noise: f64,
    ) -> Luma {
        let (normal_u, normal_v) = (angle.cos(), angle.sin());
        let mut random = TestNoise(12345);
        Luma::from_fn(80, 60, |u, v| {
            let d = (u as f64 - at.0) * normal_u + (v as f64 - at.1) * normal_v;
            let share = match width {
                Some(width) => 0.5 * (shade(d + 0.5 * width, 0.8).value - shade(d - 0.5 * width, 0.8).value),
                None => 0.5 + 0.5 * shade(d, 0.8).value,
            };
            (dark + (bright - dark) * share + noise * random.normal())
                .round()
                .clamp(0.0, 255.0) as u8
        })
    }

    #[test]
    fn a_mark_near_an_edge_comes_to_lie_on_it() {
        let p = picture((40.3, 30.0), 0.0, None, (60.0, 180.0), 2.0);
        let s = snap(&p, PixelPoint::new(36.0, 25.0), [1.0, 0.0], 10.0).unwrap();
        assert!(
            (s.at.u_px - 40.3).abs() < 0.05 && (s.at.v_px - 25.0).abs() < 1e-9,
            "{s:?}"
        );
        assert!(!s.line && (s.moved_px - 4.3).abs() < 0.05 && s.std_px < 0.1);
    }

    #[test]
    fn of_a_thin_line_the_middle_counts_from_either_side() {
        for width in [1.0, 2.0, 4.0] {
            let p = picture((40.3, 30.0), 0.0, Some(width), (200.0, 40.0), 2.0);
            for from in [36.0, 39.0, 44.0] {
                let s = snap(&p, PixelPoint::new(from, 30.0), [1.0, 0.0], 10.0).unwrap();
                assert!(s.line && (s.at.u_px - 40.3).abs() < 0.06, "{width} {from} {s:?}");
            }
        }
    }

    #[test]
    fn nothing_to_snap_to_is_none() {
        let even = picture((400.0, 30.0), 0.0, None, (60.0, 180.0), 2.0);
        assert_eq!(snap(&even, PixelPoint::new(40.0, 30.0), [1.0, 0.0], 10.0), None);
        let far = picture((40.0, 30.0), 0.0, None, (60.0, 180.0), 2.0);
        assert_eq!(snap(&far, PixelPoint::new(20.0, 30.0), [1.0, 0.0], 8.0), None);
        assert_eq!(snap(&far, PixelPoint::new(40.0, 30.0), [0.0, 0.0], 8.0), None);
        for outside in [(-500.0, 3.0), (1e9, -1e9), (f64::NAN, 3.0)] {
            assert_eq!(
                snap(&far, PixelPoint::new(outside.0, outside.1), [1.0, 0.0], 8.0),
                None
            );
        }
    }

    proptest! {
        #[test]
        fn slanted_edges_are_found_where_the_direction_crosses_them(
            angle in -0.6..0.6_f64, off in -5.0..5.0_f64, du in -0.5..0.5_f64, bright: bool,
        ) {
            let greys = if bright { (60.0, 180.0) } else { (180.0, 60.0) };
            let p = picture((40.0 + du, 30.0), angle, None, greys, 1.0);
            let s = snap(&p, PixelPoint::new(40.0 + du + off, 30.0), [1.0, 0.0], 12.0).unwrap();
            prop_assert!((s.at.u_px - 40.0 - du).abs() < 0.1, "{:?}", s);
            prop_assert!((s.at.u_px - 40.0 - du).abs() < 4.5 * s.std_px, "{:?}", s);
        }
    }
}
