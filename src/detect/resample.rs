//! Pictures between their pixels, and at another size.

use crate::frames::Luma;
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Size};
use opencv::imgproc;

/// `out(u, v) = luma(u + du, v + dv)`, bilinear, edges repeated.
#[must_use]
pub fn shifted(luma: &Luma, du: f64, dv: f64) -> Luma {
    let (w, h) = (luma.width, luma.height);
    let (iu, iv) = (du.floor(), dv.floor());
    // Weights in 1/256; the four sum to 65536 exactly.
    let fu = ((du - iu) * 256.0).round() as u32;
    let fv = ((dv - iv) * 256.0).round() as u32;
    let clamp = |x: i64, n: usize| x.clamp(0, n as i64 - 1) as usize;
    let columns: Vec<usize> = (0..=w).map(|u| clamp(u as i64 + iu as i64, w)).collect();
    let mut data = Vec::with_capacity(w * h);
    for v in 0..h as i64 {
        let top = luma.row(clamp(v + iv as i64, h));
        let bottom = luma.row(clamp(v + iv as i64 + 1, h));
        for pair in columns.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            let upper = u32::from(top[a]) * (256 - fu) + u32::from(top[b]) * fu;
            let lower = u32::from(bottom[a]) * (256 - fu) + u32::from(bottom[b]) * fu;
            data.push(((upper * (256 - fv) + lower * fv + 32_768) >> 16) as u8);
        }
    }
    Luma {
        width: w,
        height: h,
        data,
    }
}

/// Bilinear value at (u, v) of a picture of this width and height; `None` outside.
#[must_use]
pub fn bilinear<T: Copy + Into<f32>>(
    rows: &[T],
    (width, height): (usize, usize),
    u: f64,
    v: f64,
) -> Option<f64> {
    let inside = u >= 0.0 && v >= 0.0 && u <= (width - 1) as f64 && v <= (height - 1) as f64;
    if !inside {
        return None;
    }
    let (iu, iv) = (u as usize, v as usize);
    let (ju, jv) = ((iu + 1).min(width - 1), (iv + 1).min(height - 1));
    let (fu, fv) = (u - iu as f64, v - iv as f64);
    let at = |a: usize, b: usize| f64::from(rows[b * width + a].into());
    let top = at(iu, iv) * (1.0 - fu) + at(ju, iv) * fu;
    let bottom = at(iu, jv) * (1.0 - fu) + at(ju, jv) * fu;
    Some(top * (1.0 - fv) + bottom * fv)
}

/// Value at (u, v) by Catmull and Rom's cubic; beyond the rim its pixels are repeated.
#[must_use]
pub fn cubic(luma: &Luma, u: f64, v: f64) -> f64 {
    let (iu, iv) = (u.floor(), v.floor());
    let weights = |t: f64| {
        [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ]
    };
    let (wu, wv) = (weights(u - iu), weights(v - iv));
    let (width, height) = (luma.width as i32, luma.height as i32);
    let at = |i: i32, j: i32| {
        let (u, v) = (
            (iu as i32 + i - 1).clamp(0, width - 1),
            (iv as i32 + j - 1).clamp(0, height - 1),
        );
        f64::from(luma.data[(v * width + u) as usize])
    };
    (0..4)
        .map(|j| wv[j as usize] * (0..4).map(|i| wu[i as usize] * at(i, j)).sum::<f64>())
        .sum()
}

/// `luma` at 1/`factor` of its size, each pixel the mean of those it replaces; `None` where OpenCV refuses.
#[must_use]
pub fn reduced(luma: &Luma, factor: usize) -> Option<Luma> {
    let reduce = || -> opencv::Result<Luma> {
        let flat = Mat::from_slice(&luma.data)?;
        let mat = flat.reshape(1, i32::try_from(luma.height).unwrap_or(i32::MAX))?;
        let scale = 1.0 / factor as f64;
        let mut small = Mat::default();
        imgproc::resize(
            &mat,
            &mut small,
            Size::default(),
            scale,
            scale,
            imgproc::INTER_AREA,
        )?;
        let (width, height) = (small.cols() as usize, small.rows() as usize);
        Ok(Luma {
            width,
            height,
            data: small.data_bytes()?.to_vec(),
        })
    };
    reduce().ok()
}
