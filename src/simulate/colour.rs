//! The colours of a scene: its chroma, rendered as its luma is, then made as coarse as a camera makes it.
//!
//! Each of the two chroma planes is a picture of its own of the same scene, in which "grey" is how far a thing's chroma is from that of grey:
//! light and shade scale it as they scale luma, and blur and exposure smear it alike. A camera makes chroma from the same pixels, so it
//! has noise of its own in each; it then takes the mean over the pixels that share a sample, with the weights 1 2 1 where the
//! sample stands at one of them and 1 1 where it stands between two, and rounds.

use super::effects::{self, Decision, Ideal};
use super::flight::{Perturbations, Trajectory};
use super::render::{Renderer, normal_table};
use super::scene::{EffectsChoice, Scene, SceneError, Switch};
use super::second_ball;
use crate::frames::{ChromaSiting, Luma, Yuv420};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Effects that are of luma alone, or of the whole file.
const NOT_OF_CHROMA: [&str; 7] = [
    "texture",
    "wall_shadow",
    "noise",
    "shot_noise",
    "codec",
    "clock",
    "second_ball",
];

/// Renders U and V.
pub struct ChromaRenderer {
    planes: [Renderer; 2],
    siting: ChromaSiting,
    /// Standard deviation of a pixel's noise before the mean is taken, grey levels.
    noise_grey: f64,
    seed: u64,
}

impl ChromaRenderer {
    /// For the colours of `scene`, with the effects that `decisions` use; `None` where it has none.
    ///
    /// # Errors
    /// As for the scene itself.
    pub fn new(
        scene: &Scene,
        decisions: &[Decision],
        trajectory: &Trajectory,
    ) -> Result<Option<Self>, SceneError> {
        if !scene.look.is_coloured() {
            return Ok(None);
        }
        let plane = |k: usize| -> Result<Renderer, SceneError> {
            let scene = of_plane(scene, k);
            let named = decisions.iter().map(|d| {
                let used = d.used && !NOT_OF_CHROMA.contains(&d.name);
                (d.name.to_owned(), if used { Switch::On } else { Switch::Off })
            });
            let choice = EffectsChoice {
                default: Switch::Off,
                named: named.collect(),
            };
            let (_, mut chosen) = effects::decide(&scene, &choice, &Ideal::new(&scene)?);
            chosen.acts = Perturbations::default();
            let second = scene
                .second_ball
                .filter(|_| decisions.iter().any(|d| d.name == "second_ball" && d.used));
            let second = second
                .map(|second| second_ball::fly(&scene, &second, decisions, trajectory.end_s()))
                .transpose()?;
            Ok(Renderer::new(&scene, chosen, *trajectory.floor()).with_second(second))
        };
        let noisy = decisions.iter().any(|d| d.name == "noise" && d.used);
        Ok(Some(Self {
            planes: [plane(0)?, plane(1)?],
            siting: scene.camera.chroma_siting,
            noise_grey: if noisy { scene.camera.noise_grey } else { 0.0 },
            seed: scene.seed,
        }))
    }

    /// `luma`, which is frame `index`, with its chroma.
    #[must_use]
    pub fn coloured(&self, luma: Luma, trajectory: &Trajectory, index: usize) -> Yuv420 {
        let [u, v] = [0, 1].map(|k| {
            let mut chroma = self.planes[k].light(trajectory, index);
            self.add_noise(&mut chroma, 2 * index as u64 + k as u64);
            coarse(&chroma, (luma.width, luma.height), self.siting)
        });
        Yuv420 {
            width: luma.width,
            height: luma.height,
            y: luma.data,
            u,
            v,
        }
    }

    fn add_noise(&self, chroma: &mut [f32], stream: u64) {
        if self.noise_grey == 0.0 {
            return;
        }
        // Another key than that of luma's noise.
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ 0x6368_726f_6d61);
        random.set_stream(stream);
        let mut bits = vec![0_u8; 2 * chroma.len()];
        random.fill_bytes(&mut bits);
        let (normal, std) = (normal_table(), self.noise_grey as f32);
        for (c, pair) in chroma.iter_mut().zip(bits.chunks_exact(2)) {
            *c += std * normal[usize::from(u16::from_le_bytes([pair[0], pair[1]]))];
        }
    }
}

/// The scene whose greys are the chroma of `scene` in plane `k`.
fn of_plane(scene: &Scene, k: usize) -> Scene {
    let mut plane = scene.clone();
    let look = &mut plane.look;
    look.ball_grey = look.ball_colour[k];
    look.background_grey = look.background_colour[k];
    look.floor_grey = look.floor_colour[k];
    // A highlight is the lamp's own, and texture is light and dark.
    look.highlight_grey = 0.0;
    look.texture_grey = 0.0;
    look.wall_shadow = None;
    if let Some(bench) = &mut plane.launch.bench {
        bench.bench_grey = bench.bench_grey.map(|_| 0.0);
    }
    if let Some(second) = &mut plane.second_ball {
        second.ball_grey = 0.0;
    }
    plane
}

/// The samples of a plane of chroma, which `chroma` has for every pixel.
fn coarse(chroma: &[f32], (width, height): (usize, usize), siting: ChromaSiting) -> Vec<u8> {
    let across: Vec<f32> = chroma
        .chunks_exact(width)
        .flat_map(|row| {
            (0..width).step_by(2).map(move |x| {
                let right = row[(x + 1).min(width - 1)];
                match siting {
                    ChromaSiting::Left => 0.25 * row[x.saturating_sub(1)] + 0.5 * row[x] + 0.25 * right,
                    ChromaSiting::Centre => 0.5 * (row[x] + right),
                }
            })
        })
        .collect();
    let columns = width.div_ceil(2);
    (0..height)
        .step_by(2)
        .flat_map(|y| {
            let across = &across;
            (0..columns).map(move |x| {
                let mean = 0.5 * (across[y * columns + x] + across[(y + 1).min(height - 1) * columns + x]);
                // Rounding half up; the cast saturates.
                (mean + 128.5) as u8
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_has_the_middle_of_the_pixels_it_is_the_mean_of() {
        // Chroma that grows by 2 a column: a sample at the left column of its two has that column's, one between them the mean.
        let ramp: Vec<f32> = (0..6 * 4).map(|i| 2.0 * (i % 6) as f32).collect();
        assert_eq!(coarse(&ramp, (6, 4), ChromaSiting::Left)[1], 128 + 4);
        assert_eq!(coarse(&ramp, (6, 4), ChromaSiting::Centre)[1], 128 + 5);
    }
}
