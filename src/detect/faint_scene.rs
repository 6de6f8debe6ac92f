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
//! A thing that moves, or a codec that draws the scene anew, may shift a correlation, too; a camera shifts all of the scene. So the shifts that one half of
//! the places finds (the colours of a chessboard) have to explain each place of the other half better than a scene at rest does
//! ([`FaintScene::moves_everywhere`]): over all frames f together, a place tells what a single frame may not.
//!
//! ```text
//! D(p) = Σ_f Σ_x [frame_f(x + p + s_f) − frame_f(x + p + s'_f)] reference(x)     evidence of a place: D(0) / std of D elsewhere
//! s'_f    s_f without its part along one axis: a codec that holds a floor line, which tells the rows, says nothing of the columns
//! ```
//!
//! Assumed: the picture shifts as a whole, by less than a quarter of its sides. Where nothing stands out of the correlation's noise, or along one axis
//! only, as before a plain wall with a floor line, the camera's motion cannot be seen, and is not told.

use super::registration::Registration;
use crate::frames::Luma;
use crate::numeric::robust::{STD_OF_MEDIAN, lower_median, median};
use opencv::core::{
    self, DFT_INVERSE, DFT_REAL_OUTPUT, DFT_SCALE, Mat, MatTraitConst, MatTraitConstManual, Point, Size,
};
use opencv::imgproc;
use rayon::prelude::*;
use std::ops::Range;

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

/// Places along each side of the picture, each of which tells for itself whether it moves as the others do.
const PLACES: usize = 4;

/// So many of them may be a thing that moves, with its shadow: those that tell most of a motion do not count.
const THING_PLACES: usize = 4;

/// The others move where what they tell together is so many standard deviations.
const EVERYWHERE_SIGMAS: f64 = 4.0;

/// A half of the scene is so far from where the whole of it is found, at most, pixels of the size compared.
const HALF_OFF_PX: i64 = 2;

/// What a place tells by chance is read off shifts that are off by multiples of so many pixels, up to so many of them along each axis.
const CHANCE_STEP_PX: isize = 8;
const CHANCE_STEPS: isize = 4;

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
    /// The frames without their light and without what moves.
    pictures: Vec<Mat>,
    /// The spectra of these.
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
        let pictures = if factor > 1 {
            small = survey
                .par_iter()
                .map(|f| f.reduced(factor))
                .collect::<Option<_>>()?;
            cleaned(&small.iter().collect::<Vec<_>>(), &scene.reduced(factor)?)
        } else {
            cleaned(survey, scene)
        }
        .ok()?;
        let spectra = pictures.par_iter().map(spectrum).collect::<opencv::Result<_>>();
        Some(Self {
            spectra: spectra.ok()?,
            pictures,
            factor,
        })
    }

    /// The shifts of the frames against the middle one; `None` where the pictures do not tell.
    pub fn shifts(&self) -> Option<CorrelatedShifts> {
        let px = self.factor as f64;
        let in_px = |([u, v], std): ([f64; 2], f64)| ([px * u, px * v], px * std);
        let reference = self.spectra.get(self.middle())?;
        let found: Vec<FoundShift> = self
            .spectra
            .par_iter()
            .map(|of_frame| {
                let surface = CorrelationSurface::of(of_frame, reference).ok();
                surface.and_then(|surface| surface.peak()).map(in_px)
            })
            .collect();
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

    /// Whether the scene shifts by `shifts` along one axis at least wherever it tells that, rather than resting: what does so is the camera, not a thing.
    pub fn moves_everywhere(&self, shifts: &[Registration]) -> bool {
        let evidence = [0, 1].map(|colour| self.evidence(colour, shifts).unwrap_or_default());
        (0..AXES.len()).any(|axis| {
            let places = evidence.iter().flatten();
            let mut all: Vec<f64> = places.map(|by_axis| by_axis[axis]).collect();
            all.sort_by(f64::total_cmp);
            all.truncate(all.len().saturating_sub(THING_PLACES));
            all.iter().sum::<f64>() > EVERYWHERE_SIGMAS * (all.len() as f64).sqrt()
        })
    }

    /// What the places of one colour tell, along each axis, of a motion near `shifts` that the other colour finds, standard deviations each: above 0 where
    /// they move so, below 0 where they rest.
    fn evidence(&self, colour: usize, shifts: &[Registration]) -> opencv::Result<Vec<[f64; 2]>> {
        let middle = &self.pictures[self.middle()];
        let grid = PlaceGrid::of(middle);
        let by_other = self.shifts_by(&grid.kept(middle, 1 - colour)?, shifts)?;
        let changes = self.changes_by(&by_other)?;
        let grey = middle.data_typed::<f32>()?;
        let tells = |place: usize| changes.each_ref().map(|change| grid.told_by(place, change, grey));
        let places: Vec<usize> = PlaceGrid::places(colour).collect();
        Ok(places.into_par_iter().map(tells).collect())
    }

    /// Where each frame looks near `shifts`, as a `part` of the middle picture tells, pixels of the size compared.
    fn shifts_by(&self, part: &Mat, shifts: &[Registration]) -> opencv::Result<Vec<[f64; 2]>> {
        let part = spectrum(part)?;
        let frames = self.spectra.par_iter().zip(shifts);
        let shift = |(of_frame, r): (&Mat, &Registration)| {
            let near = [r.shift_u_px, r.shift_v_px].map(|px| px / self.factor as f64);
            Ok(CorrelationSurface::of(of_frame, &part)?.peak_near(near))
        };
        frames.map(shift).collect()
    }

    /// How the frames differ, pixel by pixel and all together, where they look as `shifts` say from where they look with no shift along the columns, and
    /// with none along the rows.
    fn changes_by(&self, shifts: &[[f64; 2]]) -> opencv::Result<[Vec<f32>; 2]> {
        let pictures = self.pictures.iter().map(|p| p.data_typed::<f32>());
        let frames: Vec<(&[f32], [f64; 2])> = pictures
            .zip(shifts)
            .map(|(picture, shift)| Ok((picture?, *shift)))
            .collect::<opencv::Result<_>>()?;
        let PlaceGrid { columns, rows } = PlaceGrid::of(&self.pictures[self.middle()]);
        let mut changes = [0, 1].map(|_| vec![0.0_f32; columns * rows]);
        let [by_columns, by_rows] = &mut changes;
        let lines = by_columns
            .par_chunks_mut(columns)
            .zip(by_rows.par_chunks_mut(columns));
        let change = |below: &mut Vec<f32>, (y, (by_columns, by_rows)): (usize, (&mut [f32], &mut [f32]))| {
            for &(picture, [u, v]) in &frames {
                let line = |y: usize| &picture[y * columns..][..columns];
                below.fill(0.0);
                for (further, weight) in between_two(v) {
                    let y = y.checked_add_signed(further).filter(|y| *y < rows);
                    y.into_iter().for_each(|y| add(below, weight, line(y)));
                }
                add_seen_further(by_columns, u, 1.0, below);
                add(by_columns, -1.0, below);
                add_seen_further(by_rows, u, 1.0, below);
                add_seen_further(by_rows, u, -1.0, line(y));
            }
        };
        lines.enumerate().for_each_init(|| vec![0.0; columns], change);
        Ok(changes)
    }

    /// Number of the frame that the others are compared with.
    fn middle(&self) -> usize {
        self.pictures.len() / 2
    }
}

/// A picture's pixels in the places that tell each for itself, numbered row by row.
#[derive(Debug, Clone, Copy)]
struct PlaceGrid {
    columns: usize,
    rows: usize,
}

impl PlaceGrid {
    fn of(picture: &Mat) -> Self {
        Self {
            columns: picture.cols() as usize,
            rows: picture.rows() as usize,
        }
    }

    /// The places of one colour of the chessboard.
    fn places(colour: usize) -> impl Iterator<Item = usize> {
        (0..PLACES * PLACES).filter(move |k| (k % PLACES + k / PLACES) % 2 == colour)
    }

    /// The columns and the rows of a place.
    fn sides(&self, place: usize) -> (Range<usize>, Range<usize>) {
        let span = |k: usize, of: usize| (k * of).div_ceil(PLACES)..((k + 1) * of).div_ceil(PLACES);
        (
            span(place % PLACES, self.columns),
            span(place / PLACES, self.rows),
        )
    }

    /// A picture in which only the places of one colour are not 0.
    fn kept(&self, picture: &Mat, colour: usize) -> opencv::Result<Mat> {
        let grey = picture.data_typed::<f32>()?;
        let mut kept = vec![0.0_f32; grey.len()];
        for (us, vs) in Self::places(colour).map(|place| self.sides(place)) {
            for row in vs.map(|y| y * self.columns) {
                let pixels = row + us.start..row + us.end;
                kept[pixels.clone()].copy_from_slice(&grey[pixels]);
            }
        }
        Mat::from_slice(&kept)?.reshape(1, picture.rows())?.try_clone()
    }

    /// How well the `change` that a motion explains agrees with the scene `grey` at a place, in standard deviations of how well it does by chance.
    fn told_by(&self, place: usize, change: &[f32], grey: &[f32]) -> f64 {
        let (us, vs) = self.sides(place);
        let agrees = |(du, dv): (isize, isize)| {
            let (us, further_us) = pairs(&us, du, self.columns);
            let (vs, further_vs) = pairs(&vs, dv, self.rows);
            let row = |(y, further_y): (usize, usize)| {
                let scene = &grey[y * self.columns..][us.clone()];
                let changes = &change[further_y * self.columns..][further_us.clone()];
                let products = scene.iter().zip(changes).map(|(g, c)| f64::from(g * c));
                products.sum::<f64>()
            };
            vs.zip(further_vs).map(row).sum::<f64>()
        };
        let steps = || (-CHANCE_STEPS..=CHANCE_STEPS).map(|k| k * CHANCE_STEP_PX);
        let off = steps().flat_map(|dv| steps().map(move |du| (du, dv)));
        let by_chance = off.filter(|off| *off != (0, 0)).map(|off| agrees(off).abs());
        let std = STD_OF_MEDIAN * median(&mut by_chance.collect::<Vec<_>>()).unwrap_or(0.0);
        if std > 0.0 { agrees((0, 0)) / std } else { 0.0 }
    }
}

/// Those of `range` whose partner `further` along is below `of`, and their partners.
fn pairs(range: &Range<usize>, further: isize, of: usize) -> (Range<usize>, Range<usize>) {
    let start = range.start.max(0_usize.saturating_add_signed(-further));
    let end = range.end.min(of.saturating_add_signed(-further));
    if start >= end {
        return (0..0, 0..0);
    }
    let partner = |i: usize| i.saturating_add_signed(further);
    (start..end, partner(start)..partner(end))
}

/// The whole steps to the two neighbours of a place that is `further` along, and what each of them weighs there.
fn between_two(further: f64) -> [(isize, f32); 2] {
    let part = (further - further.floor()) as f32;
    let whole = further.floor() as isize;
    [(whole, 1.0 - part), (whole + 1, part)]
}

/// Adds to a line `weight` times another that is seen `further` along; nothing where that is outside: a picture's rim is 0.
fn add_seen_further(sum: &mut [f32], further: f64, weight: f32, line: &[f32]) {
    for (steps, part) in between_two(further) {
        let (here, there) = pairs(&(0..sum.len()), steps, line.len());
        add(&mut sum[here], weight * part, &line[there]);
    }
}

/// Adds `weight` times `values`.
fn add(sum: &mut [f32], weight: f32, values: &[f32]) {
    let both = sum.iter_mut().zip(values);
    both.for_each(|(sum, value)| *sum += weight * value);
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

/// The correlation of two pictures for every shift between them; it goes round at its ends.
struct CorrelationSurface {
    values: Vec<f32>,
    columns: usize,
    rows: usize,
}

impl CorrelationSurface {
    /// Of the picture with a spectrum and that with the spectrum `reference`.
    fn of(of_frame: &Mat, reference: &Mat) -> opencv::Result<Self> {
        let mut product = Mat::default();
        core::mul_spectrums(of_frame, reference, &mut product, 0, true)?;
        let mut surface = Mat::default();
        core::dft(
            &product,
            &mut surface,
            DFT_INVERSE | DFT_SCALE | DFT_REAL_OUTPUT,
            0,
        )?;
        Ok(Self {
            values: surface.data_typed()?.to_vec(),
            columns: surface.cols() as usize,
            rows: surface.rows() as usize,
        })
    }

    fn at(&self, u: i64, v: i64) -> f64 {
        let (u, v) = (
            u.rem_euclid(self.columns as i64) as usize,
            v.rem_euclid(self.rows as i64) as usize,
        );
        f64::from(self.values[v * self.columns + u])
    }

    /// Half the difference of the neighbours along one direction.
    fn slope(&self, (u, v): (i64, i64), (du, dv): (i64, i64)) -> f64 {
        0.5 * (self.at(u + du, v + dv) - self.at(u - du, v - dv))
    }

    /// How much lower the neighbours along one direction are.
    fn curvature(&self, (u, v): (i64, i64), (du, dv): (i64, i64)) -> f64 {
        2.0 * self.at(u, v) - self.at(u + du, v + dv) - self.at(u - du, v - dv)
    }

    /// A shift between pixels by the parabolas through a place that is higher than those around.
    fn between_pixels(&self, place: (i64, i64)) -> [f64; 2] {
        let along = |at: i64, axis| {
            let curvature = self.curvature(place, axis);
            let off = if curvature > 0.0 {
                (self.slope(place, axis) / curvature).clamp(-0.5, 0.5)
            } else {
                0.0
            };
            at as f64 + off
        };
        [along(place.0, AXES[0]), along(place.1, AXES[1])]
    }

    /// Where it is highest within [`HALF_OFF_PX`] of a shift.
    fn peak_near(&self, shift: [f64; 2]) -> [f64; 2] {
        let [u, v] = shift.map(|s| s.round() as i64);
        let around = |k: i64| k - HALF_OFF_PX..=k + HALF_OFF_PX;
        let all = around(v).flat_map(|v| around(u).map(move |u| (u, v)));
        let highest = all.max_by(|a, b| self.at(a.0, a.1).total_cmp(&self.at(b.0, b.1)));
        self.between_pixels(highest.unwrap_or((u, v)))
    }

    /// The shift at which it is highest, and its standard uncertainty; `None` where it does not stand out.
    fn peak(&self) -> FoundShift {
        let (columns, rows) = (self.columns, self.rows);
        // A shift by half of a picture and one by minus that look alike.
        let near = |k: usize, n: usize| 4 * k.min(n - k) <= n;
        let (place, height) = self
            .values
            .iter()
            .enumerate()
            .filter(|(i, _)| near(i % columns, columns) && near(i / columns, rows))
            .max_by(|a, b| a.1.total_cmp(b.1))?;
        let sum: f64 = self.values.iter().map(|c| f64::from(*c).powi(2)).sum();
        let mean_square = sum / self.values.len() as f64;
        if f64::from(*height) < STANDS_OUT * mean_square.sqrt() {
            return None;
        }
        let signed = |k: usize, n: usize| {
            if 2 * k > n { k as i64 - n as i64 } else { k as i64 }
        };
        let (u, v) = (signed(place % columns, columns), signed(place / columns, rows));
        let mut std_px = 0.0;
        for (axis, length) in AXES.into_iter().zip([columns, rows]) {
            let curvature = self.curvature((u, v), axis);
            // A floor line is a ridge of the surface, along which any place is as good.
            let bend = |k: i64| {
                let at = |k: i64| self.at(u + k * axis.0, v + k * axis.1);
                at(k) - 0.5 * (at(k - i64::from(LIGHT_PX)) + at(k + i64::from(LIGHT_PX)))
            };
            let mut along: Vec<f64> = (0..length as i64).map(|k| bend(k).abs()).collect();
            let stands_out = bend(0) > STANDS_OUT * STD_OF_MEDIAN * median(&mut along)?;
            if !stands_out || curvature <= 0.0 {
                return None;
            }
            // Away from the peak slopes are noise alone.
            let place = |i: usize| ((i % columns) as i64, (i / columns) as i64);
            let some = (0..self.values.len()).step_by(self.values.len() / 5000 + 1);
            let mut slopes: Vec<f64> = some.map(|i| self.slope(place(i), axis).abs()).collect();
            let noise = STD_OF_MEDIAN * median(&mut slopes)?;
            std_px = f64::hypot(std_px, noise / curvature);
        }
        Some((self.between_pixels((u, v)), std_px))
    }
}

/// Along the columns and along the rows.
const AXES: [(i64, i64); 2] = [(1, 0), (0, 1)];

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
    fn a_slope_changes_by_the_shift_along_each_axis_between_pixels_too() {
        let slope: Vec<f32> = (0..35).map(|i| (10 * (i % 7) + i / 7) as f32).collect();
        let picture = Mat::from_slice(&slope)
            .unwrap()
            .reshape(1, 5)
            .unwrap()
            .try_clone()
            .unwrap();
        let scene = FaintScene {
            pictures: vec![picture],
            spectra: Vec::new(),
            factor: 1,
        };
        for (u, v) in [(1.5, -0.75), (-0.25, 1.0), (0.0, 0.0), (-3.0, 0.5)] {
            let [by_columns, by_rows] = scene.changes_by(&[[u, v]]).unwrap();
            let inside = |i: &usize| {
                let (x, y) = ((i % 7) as f64 + u, (i / 7) as f64 + v);
                (0.0..=6.0).contains(&x) && (0.0..=4.0).contains(&y)
            };
            for i in (0..35).filter(inside) {
                assert!((f64::from(by_columns[i]) - 10.0 * u).abs() < 1e-4, "{u} {v} {i}");
                assert!((f64::from(by_rows[i]) - v).abs() < 1e-4, "{u} {v} {i}");
            }
        }
        let outside = scene.changes_by(&[[40.0, -40.0]]).unwrap();
        assert!(outside[0].iter().all(|c| *c == 0.0));
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
        let found = scene.shifts().unwrap();
        assert!(scene.moves_everywhere(&found.registrations));
        assert!(found.std_px < 0.2, "{}", found.std_px);
        for (i, r) in found.registrations.iter().enumerate() {
            let off = (r.shift_u_px - truth(i)[0]).hypot(r.shift_v_px - truth(i)[1]);
            assert!(off < 5.0 * found.std_px + 0.05, "{i}: {off} {}", found.std_px);
        }
    }

    /// Pictures of a wall with texture down to a row, in noise of 4, shifted by `shift`.
    fn scene_shifted(lowest: usize, seed: u64, shift: impl Fn(usize) -> [f64; 2]) -> Vec<Luma> {
        let mut random = TestNoise(seed);
        let texture = Texture::new(&mut random);
        let mut picture = |shift: [f64; 2]| {
            Luma::from_fn(SIZE, SIZE, |x, y| {
                let (u, v) = (x as f64 - shift[0] + 8.0, y as f64 - shift[1] + 8.0);
                let wall = 100.0 + if y < lowest { texture.at(u, v) } else { 0.0 };
                (wall + 4.0 * random.normal()).round().clamp(0.0, 255.0) as u8
            })
        };
        (0..9).map(|i| picture(shift(i))).collect()
    }

    #[test]
    fn a_pan_is_told_where_half_of_the_scene_is_plain() {
        let pan = |i: usize| [0.4 * (i as f64 - 4.0), -0.2 * (i as f64 - 4.0)];
        let frames = scene_shifted(SIZE / 2, 11, pan);
        let frames: Vec<&Luma> = frames.iter().collect();
        let scene = FaintScene::new(&frames, &median_of(&frames)).unwrap();
        assert!(scene.moves_everywhere(&scene.shifts().unwrap().registrations));
    }

    #[test]
    fn a_scene_of_which_one_part_moves_rests() {
        // A texture that stands still, and a quarter of the picture that does not.
        let frames = scene_shifted(SIZE, 13, |_| [0.0, 0.0]);
        let moving = scene_shifted(SIZE, 17, |i| [0.6 * (i as f64 - 4.0), 0.0]);
        let part = SIZE / 4;
        let mixed: Vec<Luma> = frames
            .iter()
            .zip(&moving)
            .map(|(still, moving)| {
                Luma::from_fn(SIZE, SIZE, |x, y| {
                    let inside = (part..3 * part).contains(&x) && (part..2 * part).contains(&y);
                    (if inside { moving } else { still }).row(y)[x]
                })
            })
            .collect();
        let mixed: Vec<&Luma> = mixed.iter().collect();
        let scene = FaintScene::new(&mixed, &median_of(&mixed)).unwrap();
        let shift = |i: usize| Registration {
            shift_u_px: 0.6 * (i as f64 - 4.0),
            ..Registration::IDENTITY
        };
        let as_the_part_moves: Vec<Registration> = (0..mixed.len()).map(shift).collect();
        assert!(!scene.moves_everywhere(&as_the_part_moves));
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
        assert!(
            scene
                .shifts()
                .is_none_or(|s| !scene.moves_everywhere(&s.registrations))
        );
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
