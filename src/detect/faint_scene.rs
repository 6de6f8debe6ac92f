//! Whether the camera moves before a scene so faint that no pixel of one frame shows a gradient (a wall with a texture below the noise), or of which a
//! codec holds the sharpest places where they were.
//!
//! A single pixel tells nothing there, but all of them together do: the cross-correlation of two whole pictures stands out of its own noise
//! by the signal of every pixel (a matched filter), where they are shifted as the camera is. From each frame the picture's light is taken (a
//! mean around each pixel), and what moves is left out: places that differ from the median of all frames by much more than the scene does.
//!
//! ```text
//! c(s) = Σ frame(p + s) reference(p)     shift: where c is largest, between pixels by a parabola
//! std of the shift along an axis = std of dc/ds over the surface / −d²c/ds² at the peak
//! ```
//!
//! Assumed: the picture shifts as a whole, by less than a quarter of its sides. Where nothing stands out of the correlation's noise, or along one axis
//! only, as before a plain wall with a floor line, the camera's motion cannot be seen, and is not told.

use super::registration::Registration;
use super::resample::reduced;
use crate::frames::Luma;
use crate::numeric::robust::{STD_OF_MEDIAN, lower_median, median};
use opencv::core::{
    self, DFT_INVERSE, DFT_REAL_OUTPUT, DFT_SCALE, Mat, MatTraitConst, MatTraitConstManual, Point, Size,
};
use opencv::imgproc;
use rayon::prelude::*;

/// Longest side of the pictures that are compared, px: larger ones are reduced to that.
const LONGEST_PX: usize = 640;

/// Side of the mean that is taken for the light, px.
const LIGHT_PX: i32 = 25;

/// Side of the means by which moving things are found, and by how much they are taken larger, px.
const THING_PX: i32 = 5;
const AROUND_PX: i32 = 9;

/// A thing differs by so many standard deviations of such a mean, and ...
const THING_SIGMAS: f32 = 5.0;
/// ... by so many grey levels.
const LEAST_CHANGE_GREY: f32 = 1.0;

/// What is left of a pixel at most, in deviations of a frame from the median: the rest of a thing tells no shift.
const CLIPPED_SIGMAS: f32 = 4.0;

/// A correlation stands out where its peak is so many standard deviations of the surface: noise has 5 in a picture of a million pixels. It also has to rise
/// above its surroundings along each axis by so many times what other places of the line through it do.
const STANDS_OUT: f64 = 6.0;

/// Part of the frames in which it has to.
const MOST_FRAMES: f64 = 0.75;

/// Root mean square of a distance in two directions over its median, for normal errors.
const DISTANCE_STD_OF_MEDIAN: f64 = 1.2011;

/// Where the frames of a survey look, as their whole pictures say.
#[derive(Debug, Clone)]
pub struct CorrelatedShifts {
    /// Against the middle frame.
    pub registrations: Vec<Registration>,
    /// Standard uncertainty of a shift, px: the median over the frames.
    pub std_px: f64,
}

/// A survey whose pictures are compared as wholes.
#[derive(Debug)]
pub struct FaintScene {
    /// The middle frame without its light and without what moves.
    middle: Mat,
    /// The spectra of all frames, cleaned like that.
    spectra: Vec<Mat>,
    /// A pixel of them, px.
    factor: usize,
}

/// A shift, px, and its standard uncertainty, px; `None` where the pictures do not tell.
type FoundShift = Option<([f64; 2], f64)>;

impl FaintScene {
    /// Of these frames, of which `scene` is the median; `None` where they cannot be compared.
    pub fn new(survey: &[&Luma], scene: &Luma) -> Option<Self> {
        let first = survey.first()?;
        let factor = first.width.max(first.height).div_ceil(LONGEST_PX);
        let small: Vec<Luma>;
        let mut pictures = if factor > 1 {
            small = survey
                .par_iter()
                .map(|f| reduced(f, factor))
                .collect::<Option<_>>()?;
            cleaned(&small.iter().collect::<Vec<_>>(), &reduced(scene, factor)?)
        } else {
            cleaned(survey, scene)
        }
        .ok()?;
        let spectra = pictures.par_iter().map(spectrum).collect::<opencv::Result<_>>();
        Some(Self {
            spectra: spectra.ok()?,
            middle: pictures.swap_remove(survey.len() / 2),
            factor,
        })
    }

    /// The shift of each frame against the picture with the spectrum `reference`.
    fn against(&self, reference: &Mat) -> Vec<FoundShift> {
        let px = self.factor as f64;
        let in_px = |([u, v], std): ([f64; 2], f64)| ([px * u, px * v], px * std);
        self.spectra
            .par_iter()
            .map(|of_frame| shift(of_frame, reference).ok().flatten().map(in_px))
            .collect()
    }

    /// The same against a quarter of the middle frame: of its left or right half and its upper or lower one.
    fn against_quarter(&self, right: bool, lower: bool) -> Vec<FoundShift> {
        let quarter = quarter(&self.middle, right, lower).and_then(|q| spectrum(&q));
        quarter.map_or_else(|_| vec![None; self.spectra.len()], |q| self.against(&q))
    }

    /// The shifts of the frames against the middle one; `None` where the pictures do not tell.
    pub fn shifts(&self) -> Option<CorrelatedShifts> {
        let found = self.against(self.spectra.get(self.spectra.len() / 2)?);
        let seen = found.iter().flatten().count();
        if (seen as f64) < MOST_FRAMES * found.len() as f64 {
            return None;
        }
        let mut stds_px: Vec<f64> = found.iter().flatten().map(|(_, std_px)| *std_px).collect();
        let nearest = |i: usize| {
            let all = (0..found.len()).filter(|&k| found[k].is_some());
            all.min_by_key(|&k| k.abs_diff(i)).and_then(|k| found[k])
        };
        let registration = |i: usize| {
            nearest(i).map_or(Registration::IDENTITY, |([shift_u_px, shift_v_px], _)| {
                Registration {
                    shift_u_px,
                    shift_v_px,
                    ..Registration::IDENTITY
                }
            })
        };
        Some(CorrelatedShifts {
            registrations: (0..found.len()).map(registration).collect(),
            std_px: median(&mut stds_px)?,
        })
    }

    /// The same with the standard uncertainty by what the quarters of the picture say by themselves: a camera's motion is the same in all, a
    /// thing's is not. Infinite where fewer than three of them tell.
    pub fn by_quarters(&self, shifts: CorrelatedShifts) -> CorrelatedShifts {
        let quarters = [(false, false), (false, true), (true, false), (true, true)]
            .map(|(right, lower)| self.against_quarter(right, lower));
        let mut stds_px: Vec<f64> = shifts
            .registrations
            .iter()
            .enumerate()
            .map(|(i, r)| {
                let found: Vec<[f64; 2]> = quarters.iter().filter_map(|q| q[i].map(|(at, _)| at)).collect();
                if found.len() < 3 {
                    return f64::INFINITY;
                }
                let off = |at: &[f64; 2]| (at[0] - r.shift_u_px).hypot(at[1] - r.shift_v_px);
                let mut off_px: Vec<f64> = found.iter().map(off).collect();
                let root = (off_px.len() as f64).sqrt();
                median(&mut off_px).map_or(f64::INFINITY, |m| DISTANCE_STD_OF_MEDIAN * m / root)
            })
            .collect();
        CorrelatedShifts {
            std_px: median(&mut stds_px).map_or(f64::INFINITY, |std_px| std_px.max(shifts.std_px)),
            ..shifts
        }
    }
}

/// A picture in which only a quarter is not 0.
fn quarter(picture: &Mat, right: bool, lower: bool) -> opencv::Result<Mat> {
    let (columns, rows) = (picture.cols() as usize, picture.rows() as usize);
    let inside = |i: usize| ((i % columns) * 2 >= columns) == right && ((i / columns) * 2 >= rows) == lower;
    let kept: Vec<f32> = picture
        .data_typed::<f32>()?
        .iter()
        .enumerate()
        .map(|(i, c)| if inside(i) { *c } else { 0.0 })
        .collect();
    Mat::from_slice(&kept)?.reshape(1, picture.rows())?.try_clone()
}

/// The frames without their light and without what moves.
fn cleaned(survey: &[&Luma], scene: &Luma) -> opencv::Result<Vec<Mat>> {
    let scene = as_mat(scene)?;
    let light = blurred(&scene, LIGHT_PX)?;
    // The picture's rim, where others come in, counts little.
    let mut window = Mat::default();
    imgproc::create_hanning_window(&mut window, scene.size()?, core::CV_32F)?;
    survey
        .par_iter()
        .map(|frame| clean(frame, &scene, &light, &window))
        .collect()
}

fn clean(frame: &Luma, scene: &Mat, light: &Mat, window: &Mat) -> opencv::Result<Mat> {
    let frame = as_mat(frame)?;
    let mut change = Mat::default();
    core::subtract_def(&frame, scene, &mut change)?;
    let smooth = blurred(&change, THING_PX)?;
    let least = THING_SIGMAS * std_of(smooth.data_typed()?) + LEAST_CHANGE_GREY;
    let thing: Vec<f32> = smooth
        .data_typed::<f32>()?
        .iter()
        .map(|c| f32::from(u8::from(c.abs() > least)))
        .collect();
    let thing = Mat::from_slice(&thing)?.reshape(1, frame.rows())?.try_clone()?;
    let around = blurred(&thing, AROUND_PX)?;
    let most = CLIPPED_SIGMAS * std_of(change.data_typed()?).max(LEAST_CHANGE_GREY);
    let pixels = frame.data_typed::<f32>()?.iter().zip(light.data_typed::<f32>()?);
    let left: Vec<f32> = pixels
        .zip(around.data_typed::<f32>()?)
        .map(|((grey, light), thing)| {
            if *thing > 0.0 {
                0.0
            } else {
                (grey - light).clamp(-most, most)
            }
        })
        .collect();
    let left = Mat::from_slice(&left)?.reshape(1, frame.rows())?.try_clone()?;
    let mut windowed = Mat::default();
    core::multiply_def(&left, window, &mut windowed)?;
    Ok(windowed)
}

/// Robust standard deviation around 0.
fn std_of(values: &[f32]) -> f32 {
    let mut sizes: Vec<f32> = values.iter().step_by(7).map(|x| x.abs()).collect();
    STD_OF_MEDIAN as f32 * lower_median(&mut sizes)
}

fn as_mat(luma: &Luma) -> opencv::Result<Mat> {
    let grey: Vec<f32> = luma.data.iter().map(|&p| f32::from(p)).collect();
    let rows = i32::try_from(luma.height).unwrap_or(i32::MAX);
    Mat::from_slice(&grey)?.reshape(1, rows)?.try_clone()
}

fn blurred(picture: &Mat, side_px: i32) -> opencv::Result<Mat> {
    let mut out = Mat::default();
    imgproc::blur(
        picture,
        &mut out,
        Size::new(side_px, side_px),
        Point::new(-1, -1),
        core::BORDER_REPLICATE,
    )?;
    Ok(out)
}

fn spectrum(picture: &Mat) -> opencv::Result<Mat> {
    let mut out = Mat::default();
    core::dft(picture, &mut out, 0, 0)?;
    Ok(out)
}

/// The shift of the picture with a spectrum against that with the spectrum `reference`, and its standard uncertainty, px; `None` where it does not
/// stand out.
fn shift(of_frame: &Mat, reference: &Mat) -> opencv::Result<Option<([f64; 2], f64)>> {
    let mut product = Mat::default();
    core::mul_spectrums(of_frame, reference, &mut product, 0, true)?;
    let mut surface = Mat::default();
    core::dft(
        &product,
        &mut surface,
        DFT_INVERSE | DFT_SCALE | DFT_REAL_OUTPUT,
        0,
    )?;
    let (columns, rows) = (surface.cols() as usize, surface.rows() as usize);
    Ok(peak(surface.data_typed()?, (columns, rows)))
}

/// The peak of a surface that goes round at its ends.
fn peak(surface: &[f32], (columns, rows): (usize, usize)) -> Option<([f64; 2], f64)> {
    let at = |u: i64, v: i64| {
        let (u, v) = (
            u.rem_euclid(columns as i64) as usize,
            v.rem_euclid(rows as i64) as usize,
        );
        f64::from(surface[v * columns + u])
    };
    // A shift by half of a picture and one by minus that look alike.
    let near = |k: usize, n: usize| 4 * k.min(n - k) <= n;
    let (place, height) = surface
        .iter()
        .enumerate()
        .filter(|(i, _)| near(i % columns, columns) && near(i / columns, rows))
        .max_by(|a, b| a.1.total_cmp(b.1))?;
    let mean_square = surface.iter().map(|c| f64::from(*c).powi(2)).sum::<f64>() / surface.len() as f64;
    if f64::from(*height) < STANDS_OUT * mean_square.sqrt() {
        return None;
    }
    let (u, v) = ((place % columns) as i64, (place / columns) as i64);
    let signed = |k: i64, n: usize| if 2 * k > n as i64 { k - n as i64 } else { k };
    let mut shift_px = [signed(u, columns) as f64, signed(v, rows) as f64];
    let mut std_px = 0.0;
    for (axis, (du, dv)) in [(1, 0), (0, 1)].into_iter().enumerate() {
        let slope = |u: i64, v: i64| 0.5 * (at(u + du, v + dv) - at(u - du, v - dv));
        let curvature = 2.0 * at(u, v) - at(u + du, v + dv) - at(u - du, v - dv);
        // A floor line is a ridge of the surface, along which any place is as good.
        let bend = |k: i64| {
            let at = |k: i64| at(u + k * du, v + k * dv);
            at(k) - 0.5 * (at(k - i64::from(LIGHT_PX)) + at(k + i64::from(LIGHT_PX)))
        };
        let mut along: Vec<f64> = (0..[columns, rows][axis] as i64).map(|k| bend(k).abs()).collect();
        let stands_out = bend(0) > STANDS_OUT * STD_OF_MEDIAN * median(&mut along)?;
        if !stands_out || curvature <= 0.0 {
            return None;
        }
        shift_px[axis] += (slope(u, v) / curvature).clamp(-0.5, 0.5);
        // Away from the peak slopes are noise alone.
        let mut slopes: Vec<f64> = (0..surface.len())
            .step_by(surface.len() / 5000 + 1)
            .map(|i| slope((i % columns) as i64, (i / columns) as i64).abs())
            .collect();
        let noise = STD_OF_MEDIAN * median(&mut slopes)?;
        std_px = f64::hypot(std_px, noise / curvature);
    }
    Some((shift_px, std_px))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::background::median_of;
    use crate::test_noise::TestNoise;

    const SIZE: usize = 160;

    /// A texture of 3 grey levels: means of random numbers around each pixel, some pixels larger than a frame.
    struct Texture(Vec<f64>);

    const TEXTURE: usize = SIZE + 20;

    impl Texture {
        fn new(random: &mut TestNoise) -> Self {
            let raw: Vec<f64> = (0..TEXTURE * TEXTURE).map(|_| random.normal()).collect();
            let near = |k: usize| k.saturating_sub(2)..(k + 3).min(TEXTURE);
            let mean = |i: usize| {
                let (x, y) = (i % TEXTURE, i / TEXTURE);
                let all = near(y).flat_map(|v| near(x).map(move |u| v * TEXTURE + u));
                // Of 25 numbers with a standard deviation of 1.
                all.map(|k| raw[k]).sum::<f64>() / 5.0
            };
            Self((0..raw.len()).map(|i| 3.0 * mean(i)).collect())
        }

        /// Between pixels, by the four around.
        fn at(&self, x: f64, y: f64) -> f64 {
            let (u, v) = (x.floor() as usize, y.floor() as usize);
            let (a, b) = (x - x.floor(), y - y.floor());
            let row = |v: usize| (1.0 - a) * self.0[v * TEXTURE + u] + a * self.0[v * TEXTURE + u + 1];
            (1.0 - b) * row(v) + b * row(v + 1)
        }
    }

    /// The texture in noise of 4, with a bright ball at (`u`, 60), seen shifted by `shift` px.
    fn frame(texture: &Texture, random: &mut TestNoise, shift: [f64; 2], u: f64) -> Luma {
        Luma::from_fn(SIZE, SIZE, |x, y| {
            let (x, y) = (x as f64, y as f64);
            let ball = (x - u).hypot(y - 60.0) < 12.0;
            let scene = 100.0 + texture.at(x - shift[0] + 8.0, y - shift[1] + 8.0);
            let grey = if ball { 220.0 } else { scene };
            (grey + 4.0 * random.normal()).round().clamp(0.0, 255.0) as u8
        })
    }

    #[test]
    fn a_pan_before_a_texture_below_the_noise_is_seen_beside_a_ball_that_moves() {
        let mut random = TestNoise(3);
        let texture = Texture::new(&mut random);
        let truth = |i: usize| [0.4 * (i as f64 - 4.0), -0.2 * (i as f64 - 4.0)];
        let frames: Vec<Luma> = (0..9)
            .map(|i| frame(&texture, &mut random, truth(i), 20.0 + 14.0 * i as f64))
            .collect();
        let frames: Vec<&Luma> = frames.iter().collect();
        let scene = FaintScene::new(&frames, &median_of(&frames)).unwrap();
        let found = scene.by_quarters(scene.shifts().unwrap());
        assert!(found.std_px < 0.2, "{}", found.std_px);
        for (i, r) in found.registrations.iter().enumerate() {
            let off = (r.shift_u_px - truth(i)[0]).hypot(r.shift_v_px - truth(i)[1]);
            assert!(off < 5.0 * found.std_px + 0.05, "{i}: {off} {}", found.std_px);
        }
    }

    #[test]
    fn a_wall_without_texture_tells_nothing() {
        let mut random = TestNoise(5);
        let plain = |u: f64, random: &mut TestNoise| {
            Luma::from_fn(SIZE, SIZE, |x, y| {
                let ball = (x as f64 - u).hypot(y as f64 - 60.0) < 12.0;
                (if ball { 220.0 } else { 100.0 } + 4.0 * random.normal()).round() as u8
            })
        };
        let frames: Vec<Luma> = (0..9)
            .map(|i| plain(20.0 + 14.0 * f64::from(i), &mut random))
            .collect();
        let frames: Vec<&Luma> = frames.iter().collect();
        let scene = FaintScene::new(&frames, &median_of(&frames)).unwrap();
        assert!(scene.shifts().is_none_or(|s| scene.by_quarters(s).std_px > 1.0));
    }

    #[test]
    fn a_plain_wall_with_a_floor_line_tells_nothing_beside_a_ball_that_moves() {
        let mut random = TestNoise(7);
        let noise = |random: &mut TestNoise| 2.0 * random.normal();
        let picture = |u: f64, random: &mut TestNoise| {
            Luma::from_fn(SIZE, SIZE, |x, y| {
                let wall = if y < 120 { 120.0 } else { 140.0 };
                let ball = (x as f64 - u).hypot(y as f64 - 60.0) < 12.0;
                (if ball { 30.0 } else { wall } + noise(random)).round() as u8
            })
        };
        let frames: Vec<Luma> = (0..9)
            .map(|i| picture(20.0 + 14.0 * f64::from(i), &mut random))
            .collect();
        let frames: Vec<&Luma> = frames.iter().collect();
        let scene = FaintScene::new(&frames, &median_of(&frames)).unwrap();
        assert!(scene.shifts().is_none());
    }
}
