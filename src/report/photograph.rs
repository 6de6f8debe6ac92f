//! Frames of a recording in its colours, as JPEG. OpenCV's types do not leave this file.

use super::jpeg;
use crate::frames::Yuv420;
use opencv::core::{Mat, MatTraitConst as _, Size, Vector, merge};
use opencv::imgproc;

/// A picture as a page holds it.
#[derive(Debug, Clone)]
pub struct Photograph {
    /// Columns and rows of the recording's own picture.
    pub size_px: (usize, usize),
    /// As JPEG.
    pub jpeg: Vec<u8>,
}

impl Photograph {
    /// Of a frame, made no wider than `max_width_px` and compressed harder until it is no larger than `max_bytes`. A grey recording stays
    /// grey.
    ///
    /// # Errors
    /// What OpenCV says.
    pub fn of(picture: &Yuv420, max_width_px: usize, max_bytes: usize) -> opencv::Result<Self> {
        let size_px = (picture.width, picture.height);
        let size = shrunk(size_px, max_width_px);
        let luma = plane(&picture.y, picture.height, size)?;
        let pixels = if is_grey(picture) {
            luma
        } else {
            coloured(picture, luma, size)?
        };
        let jpeg = jpeg::compressed(&pixels, max_bytes)?;
        Ok(Self { size_px, jpeg })
    }
}

/// Chroma that is off by no more than a coder's rounding is none.
fn is_grey(picture: &Yuv420) -> bool {
    let none = |chroma: &[u8]| chroma.iter().all(|c| c.abs_diff(128) <= 1);
    none(&picture.u) && none(&picture.v)
}

/// `luma`, of that `size`, with the picture's colours.
fn coloured(picture: &Yuv420, luma: Mat, size: Size) -> opencv::Result<Mat> {
    let rows = picture.chroma_height();
    // OpenCV's order: the red before the blue.
    let (red, blue) = (plane(&picture.v, rows, size)?, plane(&picture.u, rows, size)?);
    let planes: Vector<Mat> = [luma, red, blue].into_iter().collect();
    let (mut joined, mut pixels) = (Mat::default(), Mat::default());
    merge(&planes, &mut joined)?;
    imgproc::cvt_color_def(&joined, &mut pixels, imgproc::COLOR_YCrCb2BGR)?;
    Ok(pixels)
}

/// The size of a picture made no wider than so.
fn shrunk((width, height): (usize, usize), max_width_px: usize) -> Size {
    let side = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
    if width <= max_width_px {
        return Size::new(side(width), side(height));
    }
    Size::new(side(max_width_px), side((height * max_width_px).div_ceil(width)))
}

/// A plane of so many rows in another size.
fn plane(data: &[u8], rows: usize, size: Size) -> opencv::Result<Mat> {
    let flat = Mat::from_slice(data)?;
    let full = flat.reshape(1, i32::try_from(rows).unwrap_or(i32::MAX))?;
    let mut other = Mat::default();
    if full.size()? == size {
        full.copy_to(&mut other)?;
    } else {
        let way = if full.cols() > size.width {
            imgproc::INTER_AREA
        } else {
            imgproc::INTER_LINEAR
        };
        imgproc::resize(&full, &mut other, size, 0.0, 0.0, way)?;
    }
    Ok(other)
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::imgcodecs;

    #[test]
    fn a_wide_picture_is_shrunk_and_a_grey_one_has_no_colours() {
        let mut picture = Yuv420::black(400, 100);
        let grey = Photograph::of(&picture, 200, 100_000).unwrap();
        assert_eq!(grey.size_px, (400, 100));
        assert!(grey.jpeg.starts_with(&[0xff, 0xd8]));
        picture.v.fill(200);
        let decoded = |jpeg: Vec<u8>| {
            let bytes = Vector::<u8>::from(jpeg);
            imgcodecs::imdecode(&bytes, imgcodecs::IMREAD_UNCHANGED).unwrap()
        };
        let red = decoded(Photograph::of(&picture, 200, 100_000).unwrap().jpeg);
        assert_eq!((red.cols(), red.rows(), red.channels()), (200, 50, 3));
        assert_eq!(decoded(grey.jpeg).channels(), 1);
    }
}
