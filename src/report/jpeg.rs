//! Photographs for pages. OpenCV is here for its resizing only; its types do not leave this file.

use crate::frames::{Chroma, Luma};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use opencv::core::{Mat, MatTraitConst as _, MatTraitConstManual as _, Size};
use opencv::imgproc;

/// A picture as JPEG, made no wider than `max_width_px` and compressed harder until it is no larger than `max_bytes`; in `colour` by its chroma (full
/// range) and the shares of red and blue in its luma, where it has one that can be told from grey.
pub(super) fn jpeg(
    picture: &Luma,
    colour: Option<(&Chroma, (f64, f64))>,
    max_width_px: usize,
    max_bytes: usize,
) -> opencv::Result<Vec<u8>> {
    let colour = colour.filter(|(chroma, _)| chroma.shows());
    let pixels = colour.map(|(chroma, shares)| blue_green_red(picture, chroma, shares));
    let flat = match &pixels {
        Some(pixels) => Mat::from_slice(pixels)?,
        None => Mat::from_slice(&picture.data)?,
    };
    let channels = if pixels.is_some() { 3 } else { 1 };
    let full = flat.reshape(channels, i32::try_from(picture.height).unwrap_or(i32::MAX))?;
    let mut small = Mat::default();
    if picture.width > max_width_px {
        let height = (picture.height * max_width_px).div_ceil(picture.width);
        let size = Size::new(max_width_px as i32, i32::try_from(height).unwrap_or(i32::MAX));
        imgproc::resize(&full, &mut small, size, 0.0, 0.0, imgproc::INTER_AREA)?;
    } else {
        full.copy_to(&mut small)?;
    }
    compressed(&small, max_bytes)
}

/// `pixels` (grey, or blue, green and red) as JPEG, compressed harder until it is no larger than `max_bytes`.
pub(super) fn compressed(pixels: &Mat, max_bytes: usize) -> opencv::Result<Vec<u8>> {
    let (kind, sides) = (pixels.channels(), [pixels.cols(), pixels.rows()]);
    let kind = if kind == 1 {
        ColorType::Luma
    } else {
        ColorType::Bgr
    };
    let too_large = |e: &dyn std::fmt::Display| opencv::Error::new(opencv::core::StsBadSize, e.to_string());
    // JPEG counts its columns and rows in 16 bits.
    let [width, height] = sides.map(u16::try_from);
    let (width, height) = (
        width.map_err(|e| too_large(&e))?,
        height.map_err(|e| too_large(&e))?,
    );
    let data = pixels.data_bytes()?;
    let mut jpeg = Vec::new();
    for quality in [90, 80, 65, 45, 25] {
        jpeg.clear();
        let mut encoder = Encoder::new(&mut jpeg, quality);
        encoder.set_sampling_factor(SamplingFactor::F_2_2);
        let encoded = encoder.encode(data, width, height, kind);
        encoded.map_err(|e| too_large(&e))?;
        if jpeg.len() <= max_bytes {
            break;
        }
    }
    Ok(jpeg)
}

/// The picture's pixels, three bytes each.
fn blue_green_red(picture: &Luma, chroma: &Chroma, (red_share, blue_share): (f64, f64)) -> Vec<u8> {
    let green_share = 1.0 - red_share - blue_share;
    let code = |x: f64| x.round().clamp(0.0, 255.0) as u8;
    let mut pixels = Vec::with_capacity(3 * picture.data.len());
    for row in 0..picture.height {
        for (column, &y) in picture.row(row).iter().enumerate() {
            let y = f64::from(y);
            let [u, v] = chroma.at(column, row).map(|c| f64::from(c) - 128.0);
            let blue = y + 2.0 * (1.0 - blue_share) * u;
            let red = y + 2.0 * (1.0 - red_share) * v;
            let green = (y - red_share * red - blue_share * blue) / green_share;
            pixels.extend([blue, green, red].map(code));
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_those_of_their_matrix() {
        let plane = |grey| Luma::from_fn(2, 2, |_, _| grey);
        let one = |grey| Luma::from_fn(1, 1, |_, _| grey);
        // Pure red and green by BT.601: Y 76, U 85, V 255; Y 150, U 44, V 21.
        for (y, u, v, expected) in [(76, 85, 255, [0, 0, 254]), (150, 44, 21, [1, 255, 0])] {
            let chroma = Chroma { u: one(u), v: one(v) };
            let pixels = blue_green_red(&plane(y), &chroma, (0.299, 0.114));
            for (found, wanted) in pixels[..3].iter().zip(expected) {
                assert!(found.abs_diff(wanted) <= 1, "{pixels:?}");
            }
        }
    }

    #[test]
    fn a_colourless_picture_is_stored_grey() {
        let picture = Luma::from_fn(16, 16, |u, _| (16 * u) as u8);
        let grey = Luma::from_fn(8, 8, |_, _| 129);
        let chroma = Chroma {
            u: grey.clone(),
            v: grey,
        };
        let shares = (0.299, 0.114);
        assert_eq!(
            jpeg(&picture, Some((&chroma, shares)), 1600, 700_000).unwrap(),
            jpeg(&picture, None, 1600, 700_000).unwrap()
        );
    }

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
            None,
            1600,
            700_000,
        )
        .unwrap();
        assert!(jpeg.starts_with(&[0xff, 0xd8]));
        assert!(jpeg.len() < 1_000_000, "{}", jpeg.len());
    }
}
