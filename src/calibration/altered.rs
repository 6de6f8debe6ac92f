//! A calibration under a small change: the camera turned, or the lens and homography off by what they are uncertain by.

use super::scale::shift_back;
use super::{Calibration, Deviation, Lens, Rectification, ScaleEvidence};
use crate::geometry::PixelPoint;
use nalgebra::Matrix3;

impl Calibration {
    /// The same for the camera turned a little, so that what was at p is at p + (`du_px`, `dv_px`). The lens, which turns
    /// with the camera, is taken along, as if the picture were shifted: for shifts that are small against the picture.
    #[must_use]
    pub fn shifted(&self, du_px: f64, dv_px: f64) -> Self {
        let mut there = self.clone();
        there.origin_px = self.origin_px.map(|p| p.shifted(du_px, dv_px));
        there.floor.line = self.floor.line.map(|line| line.shifted(du_px, dv_px));
        there.scale = self.scale.shifted(du_px, dv_px);
        let changes = there
            .deviations
            .iter_mut()
            .filter_map(|d| d.world_from_pixel.as_mut());
        changes.for_each(|change| *change *= shift_back(du_px, dv_px));
        there.lens = self.lens.as_ref().map(|lens| {
            let mut matrix = *lens.camera_matrix();
            matrix[(0, 2)] += du_px;
            matrix[(1, 2)] += dv_px;
            // A lens remains one wherever its axis is.
            Lens::new(matrix, lens.distortion()).unwrap_or_else(|_| lens.clone())
        });
        there
    }

    /// The calibration once off by each of its [`Deviation`]s. One that makes no calibration is left out (it would take
    /// a lens whose uncertainty is as large as itself).
    #[must_use]
    pub fn deviated(&self) -> Vec<Self> {
        self.deviations.iter().filter_map(|d| self.off_by(d)).collect()
    }

    fn off_by(&self, deviation: &Deviation) -> Option<Self> {
        let mut off = self.clone();
        off.deviations.clear();
        if let Some(lens) = &self.lens {
            let mut matrix = *lens.camera_matrix();
            let mut distortion = lens.distortion();
            for (i, at) in [(0, 0), (1, 1), (0, 2), (1, 2)].into_iter().enumerate() {
                matrix[at] += deviation.lens[i];
            }
            distortion
                .iter_mut()
                .zip(&deviation.lens[4..])
                .for_each(|(k, d)| *k += d);
            off.lens = Some(Lens::new(matrix, distortion).ok()?);
        }
        if let (Some(homography), Some(change)) = (off.scale.homography_mut(), &deviation.world_from_pixel) {
            homography.world_from_pixel += change;
        }
        off.rectification().is_ok().then_some(off)
    }

    /// The same with the origin of its homography at the height of the pixel `floor` and the x of the pixel `edge`; `None`
    /// where one of them does not show the plane. However lens and homography are off, those pixels remain the origin's.
    pub(super) fn with_world_origin(&self, floor: PixelPoint, edge: PixelPoint) -> Option<Self> {
        let moved = |c: &Self| {
            let map = c.rectification().ok()?;
            let (low, left) = (map.plane_from_pixel(floor)?, map.plane_from_pixel(edge)?);
            let shift = Matrix3::new(1.0, 0.0, -left.right, 0.0, 1.0, -low.up, 0.0, 0.0, 1.0);
            // The map scales its own copy of the matrix; the file's keeps the size of its numbers.
            Some(shift * c.scale.homography()?.world_from_pixel)
        };
        let mut there = self.clone();
        let world_from_pixel = moved(self)?;
        for deviation in &mut there.deviations {
            let off = self.off_by(deviation).and_then(|off| moved(&off));
            if let (Some(change), Some(off)) = (&mut deviation.world_from_pixel, off) {
                *change = off - world_from_pixel;
            }
        }
        let homography = there.scale.homography_mut()?;
        homography.world_from_pixel = world_from_pixel;
        homography.origin_known = true;
        Some(there)
    }

    /// Metres per plane unit of the calibration `off` over those of this one, each with its map, where the scale is seen
    /// through the lens: a ruler's marks, or the ball at `ball_at`. The fall is fitted anew, so that it has no share here.
    #[must_use]
    pub fn metres_ratio(
        &self,
        map: &Rectification,
        (off, off_map): (&Self, &Rectification),
        ball_at: PixelPoint,
    ) -> Option<f64> {
        if self.scale.rests_on_fall() {
            return Some(1.0);
        }
        if self.scale.rests_on_ball() {
            let units = |map: &Rectification| Some(map.jacobian(ball_at)?.determinant().abs().sqrt());
            return Some(units(map)? / units(off_map)?);
        }
        let metres = |c: &Self| Some(c.metres_per_unit(&ScaleEvidence::default()).ok()?.value);
        Some(metres(off)? / metres(self)?)
    }
}
