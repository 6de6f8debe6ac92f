//! The shadow that goes along beside a ball: what is next to its outline in all frames, and does not belong to the scene.
//!
//! A ball before a wall that a lamp lights from near casts a shadow on it, of which a part may touch its outline. Its edge there is one against the
//! shadow, not against the wall; a fit that takes the wall for what is behind is drawn towards it. In the ball's own
//! coordinates the shadow stands still, while the wall moves: the median over frames of what differs from the scene around the
//! outline is the shadow (or a reflection, a halo), and is added to what is behind the ball.
//!
//! Behind the ball's rim nothing is seen of it: there it is the disc (`shadow_disc`) that what lies beside the ball tells, and what is no
//! disc of it goes on as it is beside the ball.
//!
//! Assumed: the shadow keeps its place beside the ball and changes what it falls on by as many grey levels everywhere. One that
//! does not (of a ball over its table) leaves no median, and nothing is added.

use super::ball::nearest_offset;
use super::disc::Disc;
use super::patch::Patch;
use super::shadow_disc::{Change, ShadowDisc};
use crate::detect::resample::bilinear;
use crate::geometry::PixelPoint;
use crate::numeric::robust::{MEDIAN_STD_OVER_MEAN_STD, median, std_from_magnitudes};

/// The shadow is learned to so far beyond the outline, px: further than any fit looks.
const BEYOND_PX: f64 = 10.0;

/// So near to the outline pixels are the ball's own in part, px.
const RIM_PX: f64 = 2.0;

/// Fewer frames than this tell no median.
const LEAST_VIEWS: usize = 8;

/// A shadow differs from the scene by this at least, grey levels, and by this part of what the ball does: less is a codec's halo.
const LEAST_GREY: f64 = 2.0;
const LEAST_PART_OF_CONTRAST: f64 = 0.03;

/// And by so many standard deviations of what a pixel beside the ball changes by from frame to frame: what comes and goes is no shadow that goes along.
const LEAST_SIGMAS: f64 = 2.0;

/// And along this part of the outline.
const LEAST_PART_OF_OUTLINE: f64 = 0.08;

/// A median of grey levels is known to this at best.
const LEAST_STD_GREY: f64 = 0.2;

/// Directions in which the outline is asked.
const DIRECTIONS: usize = 64;

/// A ball in a frame.
#[derive(Debug, Clone)]
pub struct ShadowView<'a> {
    /// The pixels around it, before the scene alone.
    pub patch: Patch<'a>,
    /// Its outline, swept for as long as the shutter may have been open: what is nearer to that may be its own.
    pub disc: Disc,
}

/// The change of the scene beside a ball, on a grid of pixels about its centre.
#[derive(Debug, Clone)]
pub struct AttachedShadow {
    /// Columns and rows on each side of the centre.
    half: usize,
    grey: Vec<f32>,
    /// The most that it changes beside the outline, over what the ball changes.
    part_of_contrast: f64,
}

impl AttachedShadow {
    /// The shadow in `views` of a ball that differs from the scene by about `contrast_grey`; `None` where there is none, or too little is
    /// seen.
    #[must_use]
    pub fn learned(views: &[ShadowView<'_>], contrast_grey: f64) -> Option<Self> {
        let mut radii: Vec<f64> = views.iter().map(|v| v.disc.radius_px).collect();
        let radius_px = median(&mut radii)?;
        let half = (radius_px + BEYOND_PX).ceil() as usize;
        let side = 2 * half + 1;
        let mut seen: Vec<Vec<f64>> = vec![Vec::new(); side * side];
        for view in views {
            let crop = &view.patch.crop.luma;
            let pairs = crop.data.iter().zip(&view.patch.background);
            let change: Vec<f32> = pairs.map(|(&i, &b)| f32::from(i) - b).collect();
            let centre = view.disc.centre;
            let (u0, v0) = (
                centre.u_px - view.patch.crop.u as f64,
                centre.v_px - view.patch.crop.v as f64,
            );
            for (i, values) in seen.iter_mut().enumerate() {
                let (du, dv) = offset(i, half);
                let (off_u, off_v) = nearest_offset(&view.disc, centre.u_px + du, centre.v_px + dv);
                if off_u.hypot(off_v) < view.disc.radius_px + RIM_PX {
                    continue;
                }
                let inside = u0 + du < (crop.width - 1) as f64 && v0 + dv < (crop.height - 1) as f64;
                let at = || bilinear(&change, (crop.width, crop.height), u0 + du, v0 + dv);
                values.extend(inside.then(at).flatten());
            }
        }
        let lasting = |values: &mut Vec<f64>| {
            let middle = median(values).filter(|_| values.len() >= LEAST_VIEWS)?;
            let mut off: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
            let std = std_from_magnitudes(&mut off)?;
            let of_middle = MEDIAN_STD_OVER_MEAN_STD * std / (values.len() as f64).sqrt();
            Some((middle, std, of_middle.max(LEAST_STD_GREY)))
        };
        let found: Vec<Option<(f64, f64, f64)>> = seen.iter_mut().map(lasting).collect();
        let changes: Vec<Change> = found
            .iter()
            .enumerate()
            .filter_map(|(i, f)| {
                f.map(|(grey, _, std)| Change {
                    place: offset(i, half),
                    grey,
                    std,
                })
            })
            .collect();
        let disc = ShadowDisc::fitted(&changes, radius_px);
        let of_disc = |i: usize| disc.map_or(0.0, |disc| disc.at(offset(i, half)));
        let left: Vec<Option<f32>> = found
            .iter()
            .enumerate()
            .map(|(i, f)| f.map(|(grey, ..)| (grey - of_disc(i)) as f32))
            .collect();
        let mut shadow = Self {
            half,
            grey: vec![0.0; side * side],
            part_of_contrast: 0.0,
        };
        shadow.smooth(&left);
        let rim_px = radius_px + RIM_PX + 1.5;
        shadow.grow_inwards(rim_px);
        for (i, grey) in shadow.grey.iter_mut().enumerate() {
            *grey += of_disc(i) as f32;
        }
        let least = LEAST_GREY.max(LEAST_PART_OF_CONTRAST * contrast_grey.abs());
        let mut dark = 0;
        for k in 0..DIRECTIONS {
            let angle = std::f64::consts::TAU * k as f64 / DIRECTIONS as f64;
            let (du, dv) = (rim_px * angle.cos(), rim_px * angle.sin());
            let cell = |d: f64| (d + half as f64).round() as usize;
            let scatter = found[cell(dv) * side + cell(du)].map_or(f64::INFINITY, |(_, std, _)| std);
            let change = f64::from(shadow.at(du, dv)).abs();
            if change > least.max(LEAST_SIGMAS * scatter) {
                dark += 1;
                shadow.part_of_contrast = shadow.part_of_contrast.max(change / contrast_grey.abs());
            }
        }
        (f64::from(dark) > LEAST_PART_OF_OUTLINE * DIRECTIONS as f64).then_some(shadow)
    }

    /// The most that it changes beside the outline, over what the ball changes there.
    #[must_use]
    pub const fn part_of_contrast(&self) -> f64 {
        self.part_of_contrast
    }

    /// Adds the shadow of a ball at `centre` to what is behind a patch.
    pub fn cast(&self, patch: &mut Patch<'_>, centre: PixelPoint) {
        let width = patch.crop.luma.width;
        for (i, grey) in patch.background.iter_mut().enumerate() {
            let (u, v) = (patch.crop.u + i % width, patch.crop.v + i / width);
            *grey += self.at(u as f64 - centre.u_px, v as f64 - centre.v_px);
        }
    }

    /// The change at a place beside the centre, grey levels.
    fn at(&self, du: f64, dv: f64) -> f32 {
        let side = 2 * self.half + 1;
        let (u, v) = (du + self.half as f64, dv + self.half as f64);
        let most = (side - 1) as f64;
        if u < 0.0 || v < 0.0 || u >= most || v >= most {
            return 0.0;
        }
        bilinear(&self.grey, (side, side), u, v).map_or(0.0, |g| g as f32)
    }

    /// The means of what is known around each cell.
    fn smooth(&mut self, medians: &[Option<f32>]) {
        let side = 2 * self.half + 1;
        for (i, grey) in self.grey.iter_mut().enumerate() {
            let (u, v) = (i % side, i / side);
            let near = |low: usize| low.saturating_sub(1)..(low + 2).min(side);
            let around = near(v).flat_map(|v| near(u).map(move |u| v * side + u));
            let known: Vec<f32> = around.filter_map(|k| medians[k]).collect();
            if medians[i].is_some() {
                *grey = known.iter().sum::<f32>() / known.len().max(1) as f32;
            }
        }
    }

    /// Goes on from `rim_px` towards the centre as it is there.
    fn grow_inwards(&mut self, rim_px: f64) {
        let outside = self.clone();
        for (i, grey) in self.grey.iter_mut().enumerate() {
            let (du, dv) = offset(i, self.half);
            let r = du.hypot(dv);
            if r > 0.0 && r < rim_px {
                *grey = outside.at(du * rim_px / r, dv * rim_px / r);
            }
        }
    }
}

/// The way from the centre to a cell of the grid.
fn offset(i: usize, half: usize) -> (f64, f64) {
    let side = 2 * half + 1;
    ((i % side) as f64 - half as f64, (i / side) as f64 - half as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::crop::Crop;
    use crate::frames::Luma;

    /// A ball of R 6 px at the middle of a picture before a wall of 100, darker by `depth` to the right of it.
    fn picture(depth: f64, centre: (f64, f64)) -> Crop {
        let (width, height) = (50, 40);
        let grey = |i: usize| {
            let (u, v) = ((i % width) as f64 - centre.0, (i / width) as f64 - centre.1);
            match (u.hypot(v), (u - 8.0).hypot(v)) {
                (r, _) if r < 6.0 => 200.0,
                (_, s) if s < 6.0 => 100.0 - depth,
                _ => 100.0,
            }
        };
        Crop {
            u: 10,
            v: 20,
            luma: Luma {
                width,
                height,
                data: (0..width * height).map(|i| grey(i) as u8).collect(),
            },
        }
    }

    fn learned(depth: f64) -> Option<AttachedShadow> {
        let crops: Vec<((f64, f64), Crop)> = (0..12)
            .map(|k| (20.0 + 0.3 * f64::from(k), 18.0 + 0.2 * f64::from(k)))
            .map(|centre| (centre, picture(depth, centre)))
            .collect();
        let views: Vec<ShadowView<'_>> = crops
            .iter()
            .map(|((u, v), crop)| ShadowView {
                patch: before_wall(crop),
                disc: Disc {
                    centre: PixelPoint::new(u + 10.0, v + 20.0),
                    radius_px: 6.0,
                    swept_px: [0.0; 2],
                    bent_px: [0.0; 2],
                },
            })
            .collect();
        AttachedShadow::learned(&views, 100.0)
    }

    fn before_wall(crop: &Crop) -> Patch<'_> {
        Patch {
            crop,
            background: vec![100.0; crop.luma.data.len()],
            noise_grey: 1.0,
            affine: None,
        }
    }

    #[test]
    fn a_shadow_that_goes_along_is_behind_the_ball_where_it_is_beside_it() {
        let shadow = learned(20.0).unwrap();
        let crop = picture(20.0, (20.0, 18.0));
        let mut patch = before_wall(&crop);
        shadow.cast(&mut patch, PixelPoint::new(30.0, 38.0));
        let behind = |u: usize, v: usize| patch.background[v * crop.luma.width + u];
        assert!((behind(29, 18) - 80.0).abs() < 2.0, "{}", behind(29, 18));
        // At the rim, which is not seen.
        assert!((behind(26, 18) - 80.0).abs() < 2.0, "{}", behind(26, 18));
        assert!((behind(11, 18) - 100.0).abs() < 1.0, "{}", behind(11, 18));
        assert!((behind(20, 8) - 100.0).abs() < 1.0, "{}", behind(20, 8));
    }

    #[test]
    fn a_ball_without_a_shadow_has_none() {
        assert!(learned(0.0).is_none());
    }
}
