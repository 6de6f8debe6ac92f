//! What today's tools reach: the centres that a script of a few lines finds, by plain OpenCV calls.
//!
//! Difference to the empty scene (`absdiff` with the median of some frames), a threshold, the largest contour (`findContours`), and of
//! that either the centroid (`moments`) or the middle of the smallest enclosing circle (`minEnclosingCircle`).
//!
//! For e, μ and distances of a whole recording these centres are given to this program's own evaluation, as those of any other
//! program are ([`measure_points`](crate::pipeline::measure_points)): arcs fitted together, what is off set aside, impact where two arcs
//! meet. So what differs from an accuracy level is the centres alone. A script that fits a parabola an arc by hand gets no better
//! numbers from the same centres, and worse ones where it does not set aside the frames of the impact.

use crate::frames::{self, FrameError};
use crate::geometry::PixelPoint;
use crate::points::{GivenPlace, GivenPoint, GivenPoints};
use opencv::core::{self, Mat, Point, Vector};
use opencv::imgproc;
use opencv::prelude::*;
use std::path::Path;

/// Frames of which the empty scene is the median.
const SCENE_FRAMES: usize = 15;

/// What counts as ball, grey: clear of the noise, below the contrast of a well-lit ball.
const THRESHOLD_GREY: f64 = 30.0;

/// A contour around fewer square pixels than this is no ball.
const LEAST_AREA_PX: f64 = 4.0;

/// How the middle of a contour is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tool {
    /// Centroid of its area.
    Moments,
    /// Middle of the smallest circle around it.
    EnclosingCircle,
}

impl Tool {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Moments, Self::EnclosingCircle];

    /// For people and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Moments => "threshold, moments",
            Self::EnclosingCircle => "threshold, circle",
        }
    }
}

/// What can go wrong.
#[derive(Debug, thiserror::Error)]
pub(super) enum ToolError {
    /// The recording.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// A call of OpenCV.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

/// The ball in a frame, by each tool.
pub(super) struct ToolCentre {
    /// In presentation order, from 0.
    pub frame: usize,
    time_s: f64,
    /// In the order of [`Tool::ALL`], (u, v), px.
    places: [[f64; 2]; 2],
}

impl ToolCentre {
    /// (u, v) by `tool`, px.
    pub fn place(&self, tool: Tool) -> [f64; 2] {
        self.places[tool as usize]
    }
}

/// The centres of every frame with something in it, by both tools in one pass: they share all but the last call.
pub(super) fn centres(video: &Path) -> Result<Vec<ToolCentre>, ToolError> {
    let survey = frames::open_sparse(video, SCENE_FRAMES)?;
    let Some(first) = survey.first() else {
        return Ok(Vec::new());
    };
    let rows = i32::try_from(first.luma.height).unwrap_or(i32::MAX);
    let mut column = vec![0; survey.len()];
    let empty: Vec<u8> = (0..first.luma.data.len())
        .map(|i| {
            for (value, frame) in column.iter_mut().zip(&survey) {
                *value = frame.luma.data[i];
            }
            let middle = column.len() / 2;
            *column.select_nth_unstable(middle).1
        })
        .collect();
    let empty = Mat::from_slice(&empty)?;
    let empty = empty.reshape(1, rows)?;
    let mut source = frames::open(video)?;
    let mut found = Vec::new();
    while let Some(frame) = source.next_frame()? {
        if let Some(places) = middles(&frame.luma.data, &empty, rows)? {
            found.push(ToolCentre {
                frame: frame.index,
                time_s: frame.time_s,
                places,
            });
        }
        source.recycle(frame);
    }
    Ok(found)
}

/// The middles of the largest contour of what differs from the empty scene; `None` where nothing does.
fn middles(
    picture: &[u8],
    empty: &impl core::ToInputArray,
    rows: i32,
) -> opencv::Result<Option<[[f64; 2]; 2]>> {
    let picture = Mat::from_slice(picture)?;
    let picture = picture.reshape(1, rows)?;
    let (mut difference, mut above) = (Mat::default(), Mat::default());
    core::absdiff(&picture, empty, &mut difference)?;
    imgproc::threshold(
        &difference,
        &mut above,
        THRESHOLD_GREY,
        255.0,
        imgproc::THRESH_BINARY,
    )?;
    let mut contours: Vector<Vector<Point>> = Vector::new();
    imgproc::find_contours(
        &above,
        &mut contours,
        imgproc::RETR_EXTERNAL,
        imgproc::CHAIN_APPROX_NONE,
        Point::new(0, 0),
    )?;
    let mut largest = (LEAST_AREA_PX, None);
    for contour in &contours {
        let area = imgproc::contour_area(&contour, false)?;
        if area >= largest.0 {
            largest = (area, Some(contour));
        }
    }
    let Some(contour) = largest.1 else {
        return Ok(None);
    };
    let moments = imgproc::moments(&contour, false)?;
    let (mut middle, mut radius) = (core::Point2f::default(), 0.0);
    imgproc::min_enclosing_circle(&contour, &mut middle, &mut radius)?;
    Ok(Some([
        [moments.m10 / moments.m00, moments.m01 / moments.m00],
        [f64::from(middle.x), f64::from(middle.y)],
    ]))
}

/// The centres of `tool` as another program's.
pub(super) fn given(centres: &[ToolCentre], tool: Tool) -> GivenPoints {
    let point = |centre: &ToolCentre| {
        let [u_px, v_px] = centre.place(tool);
        GivenPoint {
            frame: centre.frame,
            time_s: Some(centre.time_s),
            place: GivenPlace::Picture(PixelPoint::new(u_px, v_px)),
            std_px: None,
        }
    };
    GivenPoints {
        points: centres.iter().map(point).collect(),
        has_frames: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_square_has_its_middle_by_both() {
        let (width, height) = (40, 30);
        let empty = vec![60_u8; width * height];
        let mut picture = empty.clone();
        for v in 10..15 {
            for u in 20..26 {
                picture[v * width + u] = 200;
            }
        }
        // A hot pixel far away.
        picture[3] = 255;
        let of = |picture: &[u8]| {
            let empty = Mat::from_slice(&empty).unwrap();
            middles(picture, &empty.reshape(1, 30).unwrap(), 30).unwrap()
        };
        for [u, v] in of(&picture).unwrap() {
            assert!((u - 22.5).abs() < 1e-4 && (v - 12.0).abs() < 1e-4, "{u} {v}");
        }
        assert!(of(&empty).is_none());
    }
}
