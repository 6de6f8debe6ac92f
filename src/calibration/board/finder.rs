//! The board in a picture: OpenCV's sector-based finder (Duda and Frese, BMVC 2018), then each corner exactly
//! ([`super::corner`]).

use super::corner::{self, Corner};
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use opencv::calib3d::{self, CALIB_CB_EXHAUSTIVE, CALIB_CB_LARGER, CALIB_CB_NORMALIZE_IMAGE};
use opencv::core::{Mat, MatTraitConst as _, MatTraitConstManual as _, Point2f, Size, Vector};
use opencv::imgproc;

/// Pictures are searched at no more than this width or height, px; corners are then refined in the whole picture.
const SEARCH_SIDE_PX: usize = 1600;

/// Inner corners of a board: columns and rows.
pub type Corners = (usize, usize);

/// The corners, row by row, of a board of `corners` inner corners; one that could not be refined is `None`. `None` where the
/// picture shows no such board.
///
/// # Errors
/// What OpenCV says of a picture it cannot work on.
pub fn find(picture: &Luma, corners: Corners) -> opencv::Result<Option<Vec<Option<Corner>>>> {
    let (small, factor) = searched(picture)?;
    for flags in [0, CALIB_CB_NORMALIZE_IMAGE | CALIB_CB_EXHAUSTIVE] {
        let mut points = Vector::<Point2f>::new();
        if calib3d::find_chessboard_corners_sb(&small, size_of(corners), &mut points, flags)? {
            let places: Vec<PixelPoint> = points.iter().map(|p| enlarged(p, factor)).collect();
            if places.len() == corners.0 * corners.1 {
                return Ok(Some(corner::refine(picture, corners.0, &places)));
            }
        }
    }
    Ok(None)
}

/// The inner corners (more along a row than rows) of whatever board the picture shows, for a message.
pub fn any_board(picture: &Luma) -> opencv::Result<Option<Corners>> {
    let (small, factor) = searched(picture)?;
    for least in [(4, 4), (3, 3)] {
        let (mut points, mut meta) = (Mat::default(), Mat::default());
        let flags = CALIB_CB_LARGER | CALIB_CB_EXHAUSTIVE | CALIB_CB_NORMALIZE_IMAGE;
        if calib3d::find_chessboard_corners_sb_with_meta(
            &small,
            size_of(least),
            &mut points,
            flags,
            &mut meta,
        )? {
            let side = |n: i32| usize::try_from(n).unwrap_or(0);
            let (a, b) = (side(meta.cols()), side(meta.rows()));
            let places: Vec<PixelPoint> = points
                .data_typed::<Point2f>()?
                .iter()
                .map(|p| enlarged(*p, factor))
                .collect();
            // Carpets and curtains have something like small boards in them, but not their sharp corners.
            let whole = a > 0 && places.len() == a * b;
            if whole && corner::refine(picture, a, &places).iter().all(Option::is_some) {
                return Ok(Some((a.max(b), a.min(b))));
            }
        }
    }
    Ok(None)
}

fn size_of((columns, rows): Corners) -> Size {
    let side = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
    Size::new(side(columns), side(rows))
}

/// The picture for OpenCV, made smaller where it is large, and the factor that undoes this.
fn searched(picture: &Luma) -> opencv::Result<(Mat, f64)> {
    let rows = i32::try_from(picture.height).unwrap_or(i32::MAX);
    let flat = Mat::from_slice(&picture.data)?;
    let whole = flat.reshape(1, rows)?;
    let largest = picture.width.max(picture.height);
    if largest <= SEARCH_SIDE_PX {
        return Ok((whole.try_clone()?, 1.0));
    }
    let factor = largest as f64 / SEARCH_SIDE_PX as f64;
    let mut small = Mat::default();
    let shrink = 1.0 / factor;
    imgproc::resize(
        &whole,
        &mut small,
        Size::default(),
        shrink,
        shrink,
        imgproc::INTER_AREA,
    )?;
    Ok((small, factor))
}

/// A point of the small picture in the whole one: pixel centres are at whole numbers in both.
fn enlarged(p: Point2f, factor: f64) -> PixelPoint {
    let back = |x: f32| (f64::from(x) + 0.5) * factor - 0.5;
    PixelPoint::new(back(p.x), back(p.y))
}
