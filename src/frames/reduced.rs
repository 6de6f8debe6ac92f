//! Planes at a part of their size.

use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Rect, Size};
use opencv::imgproc;

/// `width` by `height` means of squares of `times` pixels a side, from the first row and column of a plane of `columns` on; `None` where the plane
/// has not as many rows or columns, or there are to be none.
pub(super) fn reduced_plane(
    plane: &[u8],
    columns: usize,
    times: usize,
    (width, height): (usize, usize),
) -> Option<Vec<u8>> {
    let [rows, times, width, height] =
        [plane.len() / columns.max(1), times, width, height].map(i32::try_from);
    let (rows, times, width, height) = (rows.ok()?, times.ok()?, width.ok()?, height.ok()?);
    let reduce = || -> opencv::Result<Vec<u8>> {
        let flat = Mat::from_slice(plane)?;
        let whole = flat.reshape(1, rows)?;
        let squares = whole.roi(Rect::new(0, 0, times * width, times * height))?;
        let mut small = Mat::default();
        let size = Size::new(width, height);
        imgproc::resize(&squares, &mut small, size, 0.0, 0.0, imgproc::INTER_AREA)?;
        Ok(small.data_bytes()?.to_vec())
    };
    reduce().ok()
}
