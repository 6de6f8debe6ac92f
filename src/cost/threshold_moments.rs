//! The baseline: what one finds in many a lab. Difference to the empty scene, a threshold, the centroid of what is above.

use crate::frames::{self, FrameError};
use std::path::Path;

/// Frames of which the empty scene is the median.
const SCENE_FRAMES: usize = 15;

/// What counts as ball, grey: clear of the noise, below the contrast of a well-lit ball.
const THRESHOLD_GREY: i16 = 30;

/// Fewer pixels than this are no ball.
const LEAST_PIXELS: usize = 5;

/// Frame and centre (u, v), px, of every frame with something in it.
pub(super) fn centres(video: &Path) -> Result<Vec<(usize, [f64; 2])>, FrameError> {
    let survey = frames::open_sparse(video, SCENE_FRAMES)?;
    let Some(first) = survey.first() else {
        return Ok(Vec::new());
    };
    let width = first.luma.width;
    let mut column = vec![0; survey.len()];
    let empty: Vec<u8> = (0..first.luma.data.len())
        .map(|i| {
            for (value, frame) in column.iter_mut().zip(&survey) {
                *value = frame.luma.data[i];
            }
            column.sort_unstable();
            column[column.len() / 2]
        })
        .collect();
    let mut source = frames::open(video)?;
    let mut found = Vec::new();
    while let Some(frame) = source.next_frame()? {
        if let Some(centre) = centroid(&frame.luma.data, &empty, width) {
            found.push((frame.index, centre));
        }
        source.recycle(frame);
    }
    Ok(found)
}

/// The centroid of what is above the threshold, near the median place: single pixels of noise far away do not count.
fn centroid(picture: &[u8], empty: &[u8], width: usize) -> Option<[f64; 2]> {
    let above: Vec<(usize, usize)> = picture
        .iter()
        .zip(empty)
        .enumerate()
        .filter(|(_, (a, b))| (i16::from(**a) - i16::from(**b)).abs() > THRESHOLD_GREY)
        .map(|(i, _)| (i % width, i / width))
        .collect();
    if above.len() < LEAST_PIXELS {
        return None;
    }
    let middle = |of: fn(&(usize, usize)) -> usize| {
        let mut values: Vec<usize> = above.iter().map(of).collect();
        let half = values.len() / 2;
        *values.select_nth_unstable(half).1 as f64
    };
    let (u, v) = (middle(|p| p.0), middle(|p| p.1));
    let reach = 1.5 * (above.len() as f64 / std::f64::consts::PI).sqrt() + 3.0;
    let near = above
        .iter()
        .map(|p| (p.0 as f64, p.1 as f64))
        .filter(|p| (p.0 - u).hypot(p.1 - v) <= reach);
    let (mut sum, mut count) = ([0.0, 0.0], 0.0);
    for (u, v) in near {
        sum[0] += u;
        sum[1] += v;
        count += 1.0;
    }
    (count > 0.0).then(|| sum.map(|s| s / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_square_has_its_middle_as_centroid() {
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
        let [u, v] = centroid(&picture, &empty, width).unwrap();
        assert!((u - 22.5).abs() < 1e-12 && (v - 12.0).abs() < 1e-12, "{u} {v}");
        assert!(centroid(&empty, &empty, width).is_none());
    }
}
