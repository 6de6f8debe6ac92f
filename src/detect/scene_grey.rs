//! The empty scene to fractions of a grey level, and what of it lies behind a thing.
//!
//! Of pictures that leave no memory for all digits it is rounded to 1/256 of a grey level, where those of a frame are rounded to 1.

use super::camera_swing::SceneEdges;
use super::crop::Crop;
use super::registration::Registration;
use super::resample::bilinear;
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use std::sync::Arc;

/// A grey level to 1/256.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FineGrey(u16);

const FINE_STEPS: f32 = 256.0;

impl From<f32> for FineGrey {
    fn from(grey: f32) -> Self {
        Self((grey * FINE_STEPS).round() as u16)
    }
}

impl From<FineGrey> for f32 {
    fn from(FineGrey(steps): FineGrey) -> Self {
        Self::from(steps) / FINE_STEPS
    }
}

/// The scene, row by row.
#[derive(Debug, Clone)]
pub enum SceneGrey {
    /// As computed.
    Exact(Vec<f32>),
    /// In half of the memory.
    Fine(Vec<FineGrey>),
    /// In whole levels.
    Whole(Arc<Luma>),
}

impl SceneGrey {
    /// What is behind a crop as `registration` sees it, grey levels, row by row, in a picture of this width.
    #[must_use]
    pub fn behind(&self, width: usize, registration: &Registration, crop: &Crop) -> Vec<f32> {
        match self {
            Self::Exact(rows) => behind(rows, width, registration, crop),
            Self::Fine(rows) => behind(rows, width, registration, crop),
            Self::Whole(luma) => behind(&luma.data, width, registration, crop),
        }
    }

    /// The edges of the scene, of pictures of this width whose noise is `noise_grey`.
    #[must_use]
    pub fn edges(&self, width: usize, noise_grey: f64) -> SceneEdges {
        match self {
            Self::Exact(rows) => SceneEdges::new(rows, width, noise_grey),
            Self::Fine(rows) => SceneEdges::new(rows, width, noise_grey),
            Self::Whole(luma) => SceneEdges::new(&luma.data, width, noise_grey),
        }
    }
}

/// What is behind a crop as `registration` sees it, grey levels, row by row, by a `scene` of rows of this width.
#[must_use]
pub fn behind<T: Copy + Into<f32>>(
    scene: &[T],
    width: usize,
    registration: &Registration,
    crop: &Crop,
) -> Vec<f32> {
    let (gain, offset) = (registration.gain as f32, registration.offset_grey as f32);
    let mut values = Vec::with_capacity(crop.luma.data.len());
    if registration.is_still() {
        for v in 0..crop.luma.height {
            let start = (crop.v + v) * width + crop.u;
            let row = &scene[start..start + crop.luma.width];
            values.extend(row.iter().map(|&p| gain * p.into() + offset));
        }
        return values;
    }
    let height = scene.len() / width;
    let (w, h) = ((width - 1) as f64, (height - 1) as f64);
    for v in 0..crop.luma.height {
        for u in 0..crop.luma.width {
            let here = PixelPoint::new((crop.u + u) as f64, (crop.v + v) as f64);
            let there = registration.reference_from_frame(here);
            let (u, v) = (there.u_px.clamp(0.0, w), there.v_px.clamp(0.0, h));
            let value = bilinear(scene, (width, height), u, v);
            values.push(gain * value.map_or(0.0, |b| b as f32) + offset);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_memory_keeps_grey_levels_to_half_a_step() {
        for grey in [0.0, 0.001, 12.3456, 100.5, 254.9999, 255.0] {
            let kept = f32::from(FineGrey::from(grey));
            assert!((kept - grey).abs() <= 0.5 / FINE_STEPS, "{grey} {kept}");
        }
        assert_eq!(size_of::<FineGrey>() * 2, size_of::<f32>());
    }

    #[test]
    fn whole_levels_lie_behind_a_crop_alike_however_they_are_kept() {
        let luma = Luma {
            width: 8,
            height: 8,
            data: (0..64).map(|i| 3 * i).collect(),
        };
        let crop = Crop {
            u: 2,
            v: 3,
            luma: Luma {
                width: 3,
                height: 2,
                data: vec![0; 6],
            },
        };
        let floats: Vec<f32> = luma.data.iter().map(|&p| p.into()).collect();
        let fine = floats.iter().map(|&p| p.into()).collect();
        let whole = SceneGrey::Whole(Arc::new(luma));
        let shifted = Registration {
            shift_u_px: 0.25,
            shift_v_px: -0.5,
            ..Registration::IDENTITY
        };
        for registration in [Registration::IDENTITY, shifted] {
            let behind = |scene: &SceneGrey| scene.behind(8, &registration, &crop);
            assert_eq!(behind(&SceneGrey::Exact(floats.clone())), behind(&whole));
            assert_eq!(behind(&SceneGrey::Fine(Vec::clone(&fine))), behind(&whole));
        }
        assert_eq!(whole.behind(8, &Registration::IDENTITY, &crop)[0], 78.0);
    }
}
