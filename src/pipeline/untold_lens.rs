//! A lens that bends lines and that the calibration does not tell of.
//!
//! It moves each place in the picture along the line from the middle, by the cube of its distance from there (Brown, Photogrammetric Engineering 37, 855,
//! 1971, first term). Phones correct theirs until it moves the corners by up to a hundredth of their way from the middle.

use super::camera::CalibratedCamera;
use crate::flight::motion_model::FitPoint;
use crate::flight::shown_shifts::Shifts;
use crate::geometry::{PixelPoint, PlanePoint};
use nalgebra::Vector2;

/// By what part of their way from the middle a lens that nobody tells of moves the corners of a picture, about.
pub const USUAL_CORNER_PART: f64 = 0.01;

/// By how much each point moves in the plane by such a lens, against the origin that was marked in the picture and with the scale in its middle that of
/// the calibration; `None` where the calibration tells of a lens, or the ball does not fall in the picture.
pub fn shifts(points: &[FitPoint], camera: &CalibratedCamera<'_>) -> Option<Shifts> {
    let calibration = camera.calibration;
    if calibration.lens.is_some() || !camera.falls() {
        return None;
    }
    let (width, height) = camera.size_px;
    let corner = 0.5 * Vector2::new(width as f64 - 1.0, height as f64 - 1.0);
    let moved = |at: PixelPoint| {
        let from_middle = Vector2::new(at.u_px, at.v_px) - corner;
        let part = USUAL_CORNER_PART * from_middle.norm_squared() / corner.norm_squared();
        let there = PixelPoint::new(at.u_px + part * from_middle.x, at.v_px + part * from_middle.y);
        let (from, to) = (
            camera.map.plane_from_pixel(at)?,
            camera.map.plane_from_pixel(there)?,
        );
        Some((to.right - from.right, to.up - from.up))
    };
    let origin = calibration.origin_px.map_or(Some((0.0, 0.0)), moved)?;
    let each = points.iter().map(|p| {
        let place = PlanePoint::new(p.sample.r, p.sample.h);
        let (right, up) = moved(camera.map.pixel_from_plane(place)?)?;
        Some((right - origin.0, up - origin.1))
    });
    each.collect()
}
