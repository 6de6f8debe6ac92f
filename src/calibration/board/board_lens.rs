//! The lens that pictures of a board give, and the plane of the board that stands in it.

use super::coverage::Coverage;
use super::error::BoardError;
use super::lens_fit::{self, LensFit};
use super::outliers::fit_without_outliers;
use super::plane_fit::{self, MotionPlane, PlaneMarks, PosedBoard};
use super::views::{BoardViews, ViewUse};
use crate::calibration::{Calibration, Lens, Scale};

/// A focal length less certain than this part of itself is not determined.
const VAGUE_PART: f64 = 0.02;

/// A lens with what it rests on.
#[derive(Debug)]
pub struct BoardLens {
    /// The fit.
    pub fit: LensFit,
    /// The lens.
    pub lens: Lens,
    /// Where in the picture it is how sure.
    pub coverage: Coverage,
    /// Width and height of the pictures.
    pub size_px: (usize, usize),
    /// Corners in use.
    pub corners: usize,
    /// Which of the fit's views is that of the plane.
    plane: Option<usize>,
}

impl BoardViews {
    /// The lens from all pictures that can serve.
    ///
    /// # Errors
    /// [`BoardError`]: no board anywhere, too few views, views that do not fix the lens.
    pub fn lens(&mut self) -> Result<BoardLens, BoardError> {
        let mut used: Vec<usize> = (0..self.views.len())
            .filter(|&i| self.views[i].use_ == ViewUse::Found)
            .collect();
        let size = match self.size {
            Some(size) if !used.is_empty() => size,
            _ => return Err(self.no_board()?),
        };
        let fit = fit_without_outliers(self, &mut used, size)?;
        let relative = fit.covariance[(0, 0)].sqrt() / fit.camera[0];
        let determined = relative < VAGUE_PART;
        if !determined {
            return Err(BoardError::not_determined(Some(relative), used.len()));
        }
        let lens = fit
            .lens()
            .ok_or_else(|| BoardError::not_determined(None, used.len()))?;
        for (k, &i) in used.iter().enumerate() {
            self.views[i].use_ = ViewUse::Used {
                rms_px: fit.view_rms_px[k],
                tilt_rad: fit.poses[k].tilt_rad(),
            };
        }
        let places = used.iter().flat_map(|&i| self.views[i].seen.iter().map(|s| s.at));
        let coverage = Coverage::new(size, places, &fit);
        Ok(BoardLens {
            coverage,
            lens,
            size_px: size,
            corners: used.iter().map(|&i| self.views[i].seen.len()).sum(),
            plane: self.plane.and_then(|p| used.iter().position(|&i| i == p)),
            fit,
        })
    }
}

impl BoardLens {
    /// The calibration of lens and plane. Without a plane the scale is the fall until another is given.
    #[must_use]
    pub fn calibration(&self, plane: Option<&MotionPlane>) -> Calibration {
        let scale = plane.map_or(Scale::Gravity, |p| Scale::Homography(p.homography.clone()));
        let deviations = match plane {
            Some(plane) => plane.deviations.clone(),
            None => plane_fit::lens_deviations(&self.fit, self.size_px),
        };
        Calibration {
            image_size_px: Some(self.size_px),
            lens: Some(self.lens.clone()),
            lens_std: lens_fit::deviations(&self.fit),
            deviations,
            ..Calibration::new(scale)
        }
    }

    /// The plane of the board in the picture given to [`BoardViews::add_plane`], with `marks`; `None` where none was given.
    ///
    /// # Errors
    /// [`BoardError::Askew`], [`BoardError::Mark`].
    pub fn plane(&self, views: &BoardViews, marks: &PlaneMarks) -> Result<Option<MotionPlane>, BoardError> {
        let (Some(index), Some(view)) = (self.plane, views.plane) else {
            return Ok(None);
        };
        let name = &views.views[view].name;
        let joint = self
            .fit
            .joint_covariance(index)
            .ok_or_else(|| BoardError::not_determined(None, self.fit.poses.len()))?;
        let seen = PosedBoard {
            camera: self.fit.camera,
            lens: &self.lens,
            size_px: self.size_px,
            pose: self.fit.poses[index],
            joint,
        };
        MotionPlane::new(name, &seen, &views.pattern, marks).map(Some)
    }
}
