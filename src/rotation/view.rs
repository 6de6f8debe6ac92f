//! The ball in one frame: the light of its pixels well inside of the outline, and to which directions from its centre they belong.

use super::map_value::Three;
use nalgebra::{Rotation3, Vector3};

/// Part of the ball's usual brightness that is added before the logarithm is taken: what is black has no logarithm.
const FLOOR_PART: f64 = 0.1;

/// Sine of the largest angle from the line of sight: beyond it the rim's blur is not small.
const STEEPEST: f64 = 0.98;

/// A ball's pixels in one frame.
#[derive(Debug, Clone)]
pub struct BallView {
    /// When, s.
    pub time_s: f64,
    /// From the axes of the line of sight to the ball (right, down, away) to the camera's.
    pub sight: Rotation3<f64>,
    /// The pixels.
    pub pixels: Vec<BallPixel>,
}

/// A pixel within the ball's outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallPixel {
    /// Its place from the centre, in radii: right and down.
    pub place: [f64; 2],
    /// Its brightness, grey levels.
    pub grey: f64,
}

/// A list of directions, component by component.
#[derive(Debug, Clone, Default)]
pub struct Directions([Vec<f32>; 3]);

impl Directions {
    fn push(&mut self, Three(d): Three) {
        for (all, x) in self.0.iter_mut().zip(d) {
            all.push(x);
        }
    }

    /// Direction `p`.
    #[inline]
    #[must_use]
    pub fn at(&self, p: usize) -> Three {
        let [x, y, z] = self.0.each_ref().map(|c| c[p]);
        Three([x, y, z, 0.0])
    }

    /// The components of those from `range`.
    #[must_use]
    pub fn components(&self, range: std::ops::Range<usize>) -> [&[f32]; 3] {
        self.0.each_ref().map(|c| &c[range.clone()])
    }
}

/// The pixels of all frames as one list: logarithms of brightness, which marks, light and a camera's gain add to.
#[derive(Debug, Clone)]
pub struct BallSamples {
    /// Times of the frames from the middle one, s.
    pub times_s: Vec<f64>,
    /// The frames' pixels: frame i has those from `ends[i - 1]` (0) to `ends[i]`.
    pub ends: Vec<usize>,
    /// The two directions from the ball's centre, camera axes, whose mean a pixel shows ([`seen_towards`]): a list of the one, and of the other. One list
    /// alone where the blur is taken as even on the ball.
    pub towards: Vec<Directions>,
    /// From the axes of each frame's line of sight to the camera's.
    sights: Vec<Rotation3<f64>>,
    /// Places on the disc, radii.
    pub places: Vec<[f64; 2]>,
    /// Logarithms of brightness.
    pub values: Vec<f32>,
    /// Standard deviation of a value by the pixels' noise.
    pub noise: f64,
}

impl BallSamples {
    /// Of `views` whose pixels have a noise of `noise_grey`; `None` for fewer than `least` with pixels.
    #[must_use]
    pub fn new(views: &[BallView], noise_grey: f64, blur: f64, least: usize) -> Option<Self> {
        let views: Vec<&BallView> = views.iter().filter(|v| !v.pixels.is_empty()).collect();
        if views.len() < least.max(1) {
            return None;
        }
        let middle_s = views.iter().map(|v| v.time_s).sum::<f64>() / views.len() as f64;
        let pixels = || views.iter().flat_map(|v| &v.pixels);
        let count = pixels().count() as f64;
        let usual_grey = pixels().map(|p| p.grey).sum::<f64>() / count;
        let floor_grey = FLOOR_PART * usual_grey.max(1.0);
        let mut samples = Self {
            times_s: views.iter().map(|v| v.time_s - middle_s).collect(),
            ends: Vec::with_capacity(views.len()),
            towards: vec![Directions::default(); 2],
            sights: views.iter().map(|v| v.sight).collect(),
            places: Vec::new(),
            values: Vec::new(),
            noise: noise_grey / (usual_grey + floor_grey),
        };
        for view in views {
            for p in &view.pixels {
                let lit_grey = (p.grey + floor_grey).max(0.5 * floor_grey);
                for (all, d) in samples.towards.iter_mut().zip(seen_towards(p.place, blur)) {
                    all.push(Three::of(&(view.sight * d)));
                }
                samples.places.push(p.place);
                samples.values.push(lit_grey.ln() as f32);
            }
            samples.ends.push(samples.values.len());
        }
        Some(samples)
    }

    /// Every pixel in `step` of each frame, others in the frame that follows.
    #[must_use]
    pub fn thinned(&self, step: usize) -> Self {
        let mut thin = Self {
            ends: Vec::with_capacity(self.ends.len()),
            towards: vec![Directions::default(); self.towards.len()],
            sights: self.sights.clone(),
            places: Vec::new(),
            values: Vec::new(),
            times_s: self.times_s.clone(),
            noise: self.noise,
        };
        for i in 0..self.frames() {
            for p in self.of_frame(i).skip(i % step).step_by(step) {
                for (thin, all) in thin.towards.iter_mut().zip(&self.towards) {
                    thin.push(all.at(p));
                }
                thin.places.push(self.places[p]);
                thin.values.push(self.values[p]);
            }
            thin.ends.push(thin.values.len());
        }
        thin
    }

    /// The same as if the blur were even on the ball.
    #[must_use]
    pub fn evenly_blurred(&self) -> Self {
        let mut towards = Directions::default();
        for (i, sight) in self.sights.iter().enumerate() {
            for &place in &self.places[self.of_frame(i)] {
                let [_, d] = seen_towards(place, 0.0);
                towards.push(Three::of(&(sight * d)));
            }
        }
        Self {
            towards: vec![towards],
            ..self.clone()
        }
    }

    /// The same, evenly blurred, as if the ball's centre were off in each frame by as much as a point of the ball that is at `offset` (radii, camera axes)
    /// in the middle of the arc and turns with `rate_rad_s`.
    #[must_use]
    pub fn around(&self, offset: Vector3<f64>, rate_rad_s: &Vector3<f64>) -> Self {
        let mut moved = self.clone();
        for (i, &t) in self.times_s.iter().enumerate() {
            let off = Rotation3::new(t * rate_rad_s) * offset;
            for [a, b] in &mut moved.places[self.of_frame(i)] {
                *a -= off.x;
                *b -= off.y;
            }
        }
        moved.evenly_blurred()
    }

    /// From the middle to the frame furthest from it, s.
    #[must_use]
    pub fn longest_s(&self) -> f64 {
        self.times_s.iter().fold(0.0, |a, t| a.max(t.abs()))
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.ends.len()
    }

    /// The pixels of frame `i`.
    #[must_use]
    pub fn of_frame(&self, i: usize) -> std::ops::Range<usize> {
        let from = i.checked_sub(1).map_or(0, |before| self.ends[before]);
        from..self.ends[i]
    }
}

/// The two directions whose mean the pixel at `place` shows of a ball that is a sharp picture's `blur` (standard deviation, radii) softer
/// where it faces the camera.
///
/// A picture blurs evenly in its own plane. At the angle θ from the line of sight that is, to second order in the blur σ and beside an
/// even blur on the sphere,
///
/// ```text
/// σ²/2 [tan²θ f'' + tan θ (2 + tan²θ) f']      f along θ
/// ```
///
/// wider along θ, and from further out: two points at σ tan θ on both sides of a place that is σ²/2 tan θ (2 + tan²θ) further out.
pub fn seen_towards([a, b]: [f64; 2], blur: f64) -> [Vector3<f64>; 2] {
    let sine = a.hypot(b).min(STEEPEST);
    let tangent = sine / (1.0 - sine * sine).sqrt();
    let outward = if sine > 0.0 {
        [a / sine, b / sine]
    } else {
        [0.0, 0.0]
    };
    let (sine_out, cosine_out) = (blur * blur * tangent).sin_cos();
    [-1.0, 1.0].map(|side| {
        let planar = (sine + side * blur * sine).min(STEEPEST);
        let depth = (1.0 - planar * planar).sqrt();
        let s = planar * cosine_out + depth * sine_out;
        let c = depth * cosine_out - planar * sine_out;
        Vector3::new(s * outward[0], s * outward[1], -c)
    })
}
