//! Pictures of a chessboard with known truth: a pinhole camera with OpenCV's five distortion coefficients, a flat board
//! in space, blur, noise. It shares no code with `track`.
//!
//! A pixel is the mean of the board over its area: the way from picture to board is linearised over a pixel (its bend
//! there is below 1e-4 px) and sampled at 4 x 64 points of a low-discrepancy sequence where an edge crosses it.

use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use track::frames::Luma;

/// A camera: pixel = K · distorted(x, y).
#[derive(Debug, Clone, Copy)]
pub struct Camera {
    pub width: usize,
    pub height: usize,
    pub focal_px: [f64; 2],
    pub centre_px: [f64; 2],
    /// k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
}

impl Camera {
    /// Where the picture shows a point in front of the camera, px.
    pub fn project(&self, point_m: &Vector3<f64>) -> Vector2<f64> {
        self.pixel(&self.distorted(&Vector2::new(point_m.x / point_m.z, point_m.y / point_m.z)))
    }

    /// Where the picture shows what an ideal camera would show at `ideal`, px.
    pub fn distort(&self, ideal: Vector2<f64>) -> Vector2<f64> {
        self.pixel(&self.distorted(&self.normalised(ideal)))
    }

    /// The inverse of [`Self::distort`], by Newton's method from the point itself.
    pub fn undistort(&self, seen: Vector2<f64>) -> Vector2<f64> {
        self.pixel(&self.undistorted(&self.normalised(seen)))
    }

    fn pixel(&self, p: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            self.focal_px[0] * p.x + self.centre_px[0],
            self.focal_px[1] * p.y + self.centre_px[1],
        )
    }

    fn normalised(&self, p: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(
            (p.x - self.centre_px[0]) / self.focal_px[0],
            (p.y - self.centre_px[1]) / self.focal_px[1],
        )
    }

    fn distorted(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = p.norm_squared();
        let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
        Vector2::new(
            p.x * radial + 2.0 * p1 * p.x * p.y + p2 * (r2 + 2.0 * p.x * p.x),
            p.y * radial + p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * p.x * p.y,
        )
    }

    fn undistorted(&self, seen: &Vector2<f64>) -> Vector2<f64> {
        self.undistorted_near(seen, *seen)
    }

    /// By Newton's method from `p` on.
    fn undistorted_near(&self, seen: &Vector2<f64>, mut p: Vector2<f64>) -> Vector2<f64> {
        let [k1, k2, p1, p2, k3] = self.distortion;
        for _ in 0..30 {
            let (x, y, r2) = (p.x, p.y, p.norm_squared());
            let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
            let slope = 2.0 * (k1 + 2.0 * k2 * r2 + 3.0 * k3 * r2.powi(2));
            let mixed = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
            let jacobian = Matrix2::new(
                radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
                mixed,
                mixed,
                radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
            );
            let step = jacobian.try_inverse().unwrap() * (self.distorted(&p) - seen);
            p -= step;
            if step.norm() < 1e-11 {
                break;
            }
        }
        p
    }
}

/// A chessboard of `columns` x `rows` inner corners, with a white margin of one square.
#[derive(Debug, Clone, Copy)]
pub struct Board {
    pub columns: usize,
    pub rows: usize,
    pub square_m: f64,
}

/// The board in the camera's axes (x right, y down, z forward): a point (X, Y) of the board, from its first inner corner
/// on, is at `rotation · (X, Y, 0) + at_m`.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    pub rotation: Rotation3<f64>,
    pub at_m: Vector3<f64>,
}

impl Pose {
    /// The board's middle at `middle_m`, turned by `angles_deg` about the camera's x, y and z axes.
    pub fn of_middle(board: &Board, middle_m: Vector3<f64>, angles_deg: [f64; 3]) -> Self {
        let [x, y, z] = angles_deg.map(f64::to_radians);
        let rotation = Rotation3::from_euler_angles(x, y, z);
        let half =
            Vector3::new(board.columns as f64 - 1.0, board.rows as f64 - 1.0, 0.0) * 0.5 * board.square_m;
        Self {
            rotation,
            at_m: middle_m - rotation * half,
        }
    }
}

/// What the picture looks like.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    pub black: f64,
    pub white: f64,
    /// Around the board.
    pub around: f64,
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// Standard deviation of the noise, grey.
    pub noise: f64,
    /// Fall of the light from left to right, as a share.
    pub unevenness: f64,
    pub seed: u64,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            black: 40.0,
            white: 210.0,
            around: 120.0,
            blur_px: 0.7,
            noise: 2.0,
            unevenness: 0.2,
            seed: 1,
        }
    }
}

/// Views as a careful user takes them: the board in each part of the picture, out to `margin_px` from its rim, turned to
/// all sides, nearer and farther.
pub fn careful_views(camera: &Camera, board: &Board, margin_px: f64, random: &mut Gaussian) -> Vec<Pose> {
    // A board whose middle is at a corner of the picture is moved inwards until all of it is inside.
    let places = [
        (-1.0, -1.0),
        (1.0, -1.0),
        (-1.0, 1.0),
        (1.0, 1.0),
        (0.0, -1.0),
        (0.0, 1.0),
        (-1.0, 0.0),
        (1.0, 0.0),
        (0.0, 0.0),
        (-1.0, -1.0),
        (1.0, -1.0),
        (-1.0, 1.0),
        (1.0, 1.0),
        (0.3, 0.2),
        (-0.3, -0.1),
        (0.0, 0.3),
    ];
    let focal = 0.5 * (camera.focal_px[0] + camera.focal_px[1]);
    let wide_m = board.square_m * (board.columns as f64 + 1.0);
    places
        .iter()
        .enumerate()
        .map(|(i, &(right, down))| {
            // The board takes 30 to 55 % of the picture's width.
            let z = focal * wide_m / (camera.width as f64 * random.between(0.3, 0.55));
            let turn = random.between(15.0, 38.0);
            let sides = [(turn, 5.0), (-turn, -5.0), (4.0, turn), (-6.0, -turn)][i % 4];
            let angles = [sides.0, sides.1, random.between(-12.0, 12.0)];
            let half = Vector2::new(camera.width as f64, camera.height as f64) * 0.5 / focal * z;
            let at = |part: f64| {
                let middle = Vector3::new(part * right * half.x, part * down * half.y, z);
                Pose::of_middle(board, middle, angles)
            };
            let inside = |pose: &Pose| {
                corners(camera, board, pose).iter().all(|c| {
                    c.x > margin_px
                        && c.y > margin_px
                        && c.x < camera.width as f64 - margin_px
                        && c.y < camera.height as f64 - margin_px
                })
            };
            (0..=100)
                .map(|k| at(1.3 - 0.013 * f64::from(k)))
                .find(inside)
                .expect("a board in the middle of the picture is inside")
        })
        .collect()
}

/// True places of the inner corners in the picture, row by row.
pub fn corners(camera: &Camera, board: &Board, pose: &Pose) -> Vec<Vector2<f64>> {
    let at = |i: usize| {
        let (column, row) = (i % board.columns, i / board.columns);
        let on_board = Vector3::new(column as f64, row as f64, 0.0) * board.square_m;
        camera.project(&(pose.rotation * on_board + pose.at_m))
    };
    (0..board.columns * board.rows).map(at).collect()
}

/// Cells a pixel in each direction, so that the blur acts on something finer than pixels.
const CELLS: usize = 2;

/// The picture of the board.
pub fn render(camera: &Camera, board: &Board, pose: &Pose, look: &Look) -> Luma {
    let (w, h) = (camera.width, camera.height);
    // More pixels on every side, for differences and the blur.
    let pad = (4.0 * look.blur_px).ceil() as usize + 2;
    let (pw, ph) = (w + 2 * pad, h + 2 * pad);
    let places = places(camera, board, pose, (pw, ph), pad);
    let (cw, ch) = (CELLS * pw, CELLS * ph);
    let mut grey = vec![0.0_f32; cw * ch];
    for j in 0..ph {
        for i in 0..pw {
            let place = |i: usize, j: usize| places[j * pw + i];
            let (l, r) = (i.saturating_sub(1), (i + 1).min(pw - 1));
            let (t, b) = (j.saturating_sub(1), (j + 1).min(ph - 1));
            let right = (place(r, j) - place(l, j)) / (r - l) as f64;
            let down = (place(i, b) - place(i, t)) / (b - t) as f64;
            let light = 1.0 - look.unevenness * i as f64 / pw as f64;
            for k in 0..CELLS * CELLS {
                let off = |k: usize| (k as f64 + 0.5) / CELLS as f64 - 0.5;
                let at = place(i, j) + right * off(k % CELLS) + down * off(k / CELLS);
                let mean = mean_over(board, look, at, right / CELLS as f64, down / CELLS as f64);
                grey[(CELLS * j + k / CELLS) * cw + CELLS * i + k % CELLS] = (light * mean) as f32;
            }
        }
    }
    let blurred = blur(&grey, cw, look.blur_px * CELLS as f64);
    let mut noise = Gaussian::new(look.seed);
    Luma::from_fn(w, h, |i, j| {
        let cell = |k: usize| {
            let (x, y) = (CELLS * (i + pad) + k % CELLS, CELLS * (j + pad) + k / CELLS);
            f64::from(blurred[y * cw + x])
        };
        let mean = (0..CELLS * CELLS).map(cell).sum::<f64>() / (CELLS * CELLS) as f64;
        (mean + look.noise * noise.next()).round().clamp(0.0, 255.0) as u8
    })
}

/// The place on the board of each pixel, in squares, the first inner corner at (1, 1); `pad` pixels more on every side.
fn places(
    camera: &Camera,
    board: &Board,
    pose: &Pose,
    (w, h): (usize, usize),
    pad: usize,
) -> Vec<Vector2<f64>> {
    let normal = pose.rotation * Vector3::z();
    let distance = normal.dot(&pose.at_m);
    let inverse = pose.rotation.inverse();
    let mut places = Vec::with_capacity(w * h);
    let mut last = Vector2::zeros();
    for j in 0..h {
        for i in 0..w {
            let seen = camera.normalised(Vector2::new(i as f64 - pad as f64, j as f64 - pad as f64));
            let p = camera.undistorted_near(&seen, if i == 0 { seen } else { last });
            last = p;
            let ray = Vector3::new(p.x, p.y, 1.0);
            let hit = inverse * (ray * (distance / normal.dot(&ray)) - pose.at_m) / board.square_m;
            places.push(Vector2::new(hit.x + 1.0, hit.y + 1.0));
        }
    }
    places
}

/// Writes a picture as PNG.
pub fn write_png(picture: &Luma, path: &std::path::Path) {
    use opencv::core::{Mat, MatTraitConst as _, Vector};
    let flat = Mat::from_slice(&picture.data).unwrap();
    let grey = flat.reshape(1, picture.height as i32).unwrap();
    assert!(opencv::imgcodecs::imwrite(path.to_str().unwrap(), &grey, &Vector::new()).unwrap());
}

/// Mean grey over the parallelogram of sides `right` and `down` around `at`.
fn mean_over(board: &Board, look: &Look, at: Vector2<f64>, right: Vector2<f64>, down: Vector2<f64>) -> f64 {
    const SAMPLES: usize = 64;
    let reach = 0.5 * Vector2::new(right.x.abs() + down.x.abs(), right.y.abs() + down.y.abs());
    let near = |x: f64, reach: f64| (x - x.round()).abs() <= reach;
    if !(near(at.x, reach.x) || near(at.y, reach.y)) {
        return grey_at(board, look, at);
    }
    // Roberts' R2 sequence: multiples of 1/p and 1/p² modulo 1, p the plastic number.
    // Elsewhere for each cell: edges along the picture's rows would meet the same samples all along.
    let start = Vector2::new(
        (at.x * 7919.3 + at.y * 104_729.7).abs(),
        (at.y * 15_485.9 + at.x * 32_452.3).abs(),
    );
    let sum: f64 = (0..SAMPLES / 2)
        .map(|k| {
            let part = |step: f64, start: f64| (start + step * k as f64).fract() - 0.5;
            let off =
                right * part(0.754_877_666_246_693, start.x) + down * part(0.569_840_290_998_053_3, start.y);
            // In pairs, so that the samples' mean is the pixel's centre.
            grey_at(board, look, at + off) + grey_at(board, look, at - off)
        })
        .sum();
    sum / SAMPLES as f64
}

fn grey_at(board: &Board, look: &Look, at: Vector2<f64>) -> f64 {
    let (columns, rows) = (board.columns as f64 + 1.0, board.rows as f64 + 1.0);
    let within = |x: f64, most: f64, margin: f64| x >= -margin && x < most + margin;
    if within(at.x, columns, 0.0) && within(at.y, rows, 0.0) {
        if (at.x.floor() + at.y.floor()) as i64 % 2 == 0 {
            look.black
        } else {
            look.white
        }
    } else if within(at.x, columns, 1.0) && within(at.y, rows, 1.0) {
        look.white
    } else {
        look.around
    }
}

fn blur(grey: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    if sigma == 0.0 {
        return grey.to_vec();
    }
    let reach = (4.0 * sigma).ceil() as i64;
    let raw: Vec<f64> = (-reach..=reach)
        .map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = raw.iter().sum();
    let weights: Vec<f32> = raw.iter().map(|w| (w / sum) as f32).collect();
    // The rim within reach stays as it is: the picture is cut out of its middle.
    let reach = reach as usize;
    let pass = |from: &[f32], step: usize| -> Vec<f32> {
        let mut to = vec![0.0; from.len()];
        let inner = reach * step..from.len() - reach * step;
        for (d, w) in weights.iter().enumerate() {
            let shifted = &from[d * step..];
            to[inner.clone()]
                .iter_mut()
                .zip(shifted)
                .for_each(|(t, f)| *t += w * f);
        }
        to
    };
    pass(&pass(grey, 1), width)
}

/// Normal deviates, by Box and Muller.
pub struct Gaussian {
    random: ChaCha8Rng,
    spare: Option<f64>,
}

impl Gaussian {
    pub fn new(seed: u64) -> Self {
        Self {
            random: ChaCha8Rng::seed_from_u64(seed),
            spare: None,
        }
    }

    /// In (0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.random.next_u32() as f64 + 0.5) / 4_294_967_296.0
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    pub fn next(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let (radius, angle) = (
            (-2.0 * self.uniform().ln()).sqrt(),
            std::f64::consts::TAU * self.uniform(),
        );
        self.spare = Some(radius * angle.sin());
        radius * angle.cos()
    }
}
