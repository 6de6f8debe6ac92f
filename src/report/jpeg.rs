//! Photographs for pages. OpenCV is here for its resizing and encoders only; its types do not leave this file.

use crate::frames::Luma;
use opencv::core::{Mat, MatTraitConst as _, Size, Vector};
use opencv::{imgcodecs, imgproc};

/// A picture as JPEG, made no wider than `max_width_px` and compressed harder until it is no larger than `max_bytes`.
pub(super) fn jpeg(picture: &Luma, max_width_px: usize, max_bytes: usize) -> opencv::Result<Vec<u8>> {
    let flat = Mat::from_slice(&picture.data)?;
    let full = flat.reshape(1, i32::try_from(picture.height).unwrap_or(i32::MAX))?;
    let mut small = Mat::default();
    if picture.width > max_width_px {
        let height = (picture.height * max_width_px).div_ceil(picture.width);
        let size = Size::new(max_width_px as i32, i32::try_from(height).unwrap_or(i32::MAX));
        imgproc::resize(&full, &mut small, size, 0.0, 0.0, imgproc::INTER_AREA)?;
    } else {
        full.copy_to(&mut small)?;
    }
    let mut jpeg = Vector::<u8>::new();
    for quality in [90, 80, 65, 45, 25] {
        let flags = Vector::from_slice(&[imgcodecs::IMWRITE_JPEG_QUALITY, quality]);
        imgcodecs::imencode(".jpg", &small, &mut jpeg, &flags)?;
        if jpeg.len() <= max_bytes {
            break;
        }
    }
    Ok(jpeg.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_recording_is_shrunk() {
        let noise: Vec<u8> = (0..3840_u32 * 2160)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
            .collect();
        let jpeg = jpeg(
            &Luma {
                width: 3840,
                height: 2160,
                data: noise,
            },
            1600,
            700_000,
        )
        .unwrap();
        assert!(jpeg.starts_with(&[0xff, 0xd8]));
        assert!(jpeg.len() < 1_000_000, "{}", jpeg.len());
    }
}
