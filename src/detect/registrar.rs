//! Finds where the camera looks and how bright the light is, frame by frame, against the reference picture.
//!
//! A camera held by hand drifts by pixels and a lamp flickers by percents. Both are read off a few thousand pixels of the
//! scene that carry gradient: the frame is modelled as `frame(p + s) = gain · reference(p) + offset`, and the shift s, the
//! gain and the offset are found by robust Gauss-Newton (Lucas and Kanade 1981, with Tukey weights so that whatever moves
//! does not count). Large first shifts are found on reduced pictures. Where the camera is known to move, frame and reference are
//! smoothed by a Gaussian of a pixel ([`SmoothShift`]), since bilinear weights follow a drifting scene in steps.
//!
//! A soft shadow is no one light: where shifts were found, the edges alone are asked ([`local_light`], [`Registrar::by_edges`]).
//!
//! A camera that is held by hand also turns about its axis. Where the survey shows that it does ([`Registrar::turning`]), one more number is found with
//! the shift. (It goes nearer, too, but what that does to the scene is not what it does to a ball in front of it: a change of size is not followed.)
//!
//! Assumed: the picture moves as a whole (no zoom), and what moves has gradients in few places. Where the scene has no gradient in a
//! direction, the shift along it stays what it was. So it does along a direction that few places tell of ([`Registrar::holding_unseen`]): before a plain
//! wall a floor line tells the rows, and nothing but the ball and its shadow the columns. Most samples are then plain wall, which fits whatever the shift: the
//! median residual does not tell that a line is lost. So where a direction is held, and as many samples fit nowhere as a scene has, a second search competes
//! in which samples keep their weight while the shift may still be off ([`Registrar::explains_more`]). In richer scenes the median tells.

use super::local_light::{self, FieldReadings, LitPixel};
use super::noise::ROUNDING_STD_GREY;
use super::registration::{Registration, middle_of, reach_px};
use super::resample::{SMOOTH_NOISE_PART, SmoothShift, bilinear};
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use crate::numeric::least_squares::{NormalEquations, gauss_newton};
use crate::numeric::robust::{STD_OF_MEDIAN, TUKEY, lower_median, median, tukey_cost, tukey_weight};
use nalgebra::{DMatrix, Matrix2, SVector, SymmetricEigen, Vector2, Vector3, Vector5};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// A reference pixel with what is needed to compare it.
#[derive(Debug, Clone, Copy)]
struct ReferencePixel {
    u: f64,
    v: f64,
    value: f64,
    gradient: Vector2<f64>,
}

impl ReferencePixel {
    /// The pixel of `reference` at column `u`, row `v`, which is not on its rim.
    fn of(reference: &Luma, u: usize, v: usize) -> Self {
        let half = |after: u8, before: u8| (f64::from(after) - f64::from(before)) / 2.0;
        let row = reference.row(v);
        Self {
            u: u as f64,
            v: v as f64,
            value: f64::from(row[u]),
            gradient: Vector2::new(
                half(row[u + 1], row[u - 1]),
                half(reference.row(v + 1)[u], reference.row(v - 1)[u]),
            ),
        }
    }

    /// Whether it has a gradient beyond the noise: others tell the brightness only.
    fn tells_shifts(&self) -> bool {
        self.gradient != Vector2::zeros()
    }
}

/// Where a frame looks, and how well the scene fits there.
#[derive(Debug, Clone, Copy)]
pub struct Followed {
    /// The frame's shift and light.
    pub registration: Registration,
    /// The median absolute residual, grey levels; infinite where nothing was compared.
    pub spread_grey: f64,
}

impl Followed {
    /// A frame of which nothing was compared, taken to look as `registration` says.
    #[must_use]
    pub fn not_compared(registration: Registration) -> Self {
        Self {
            registration,
            spread_grey: f64::INFINITY,
        }
    }

    /// Of pixels `times` as large.
    fn scaled(self, times: f64) -> Self {
        Self {
            registration: self.registration.scaled(times),
            ..self
        }
    }
}

/// Which motions of the camera a scene shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShownMotion {
    /// All.
    All,
    /// Those across a direction, as a floor line before a plain wall does.
    AllBut {
        /// The direction, columns and rows, of length 1.
        along: Vector2<f64>,
    },
    /// None: a plain wall.
    None,
}

/// Compares frames with a reference picture.
#[derive(Debug, Clone)]
pub struct Registrar {
    reference: Arc<Luma>,
    /// Frames are compared at one part in this many of their size: 1 where single pixels show the scene's gradients, more
    /// where only their means stand out from the noise.
    factor: usize,
    samples: Vec<ReferencePixel>,
    /// Enough of the scene carries gradient, in enough places, to tell a shift of the camera from a thing that moves.
    sees_shift: bool,
    /// The direction that is held because too few places carry gradient along it.
    held: Option<Vector2<f64>>,
    /// The scene has contrast enough to determine an offset of the brightness beside its gain.
    fits_offset: bool,
    noise_grey: f64,
    /// The part of it that the reference has.
    noise_part: f64,
    /// Least gradient of its samples at full size, grey levels a pixel.
    least_gradient_grey: f64,
    /// Frames are smoothed before they are compared, and the values of the samples are.
    smooths: bool,
    /// Turns of the picture are found with its shifts.
    turns: bool,
    /// The camera does not move: only brightness is followed.
    pub fixed: bool,
}

/// Samples over the whole picture; 3000 pixels of gradient 10 grey/px and noise 2 fix the shift to 0.005 px.
const SAMPLES: usize = 3000;

/// Sum of squared gradients below which a shift is not determined: noise of 2 grey levels would move it by 0.06 px.
const LEAST_INFORMATION: f64 = 1e3;

/// What is added to the information along a direction that is held.
const HELD: f64 = 1e12;

/// Single pixels are compared where they tell a shift to this, px; else whatever tells it best.
const GOOD_STD_PX: f64 = 0.05;

/// A gradient must exceed this many standard deviations of the noise to be one: by chance one pixel in 1e4 exceeds 4.
const GRADIENT_SIGMAS: f64 = 4.0;

/// A shift is determined where at least so many cells of the grid carry gradient; a ball, its shadow and a hand fill fewer. So it is along a direction.
const LEAST_CELLS: usize = 16;

/// So it is where such cells stand in so many of the grid's columns, or of its rows: a floor line runs through the picture, and a thing does not.
const LEAST_SPAN: usize = 10;

/// Gauss-Newton steps; from a start within a pixel, four suffice.
const STEPS: usize = 12;

/// Steps where only the light changes, which is almost linear.
const LIGHT_STEPS: usize = 3;

/// What a shift may be off by before the first step, where the next local minimum is not it, pixels of the size compared.
const FIRST_OFF_PX: f64 = 1.0;

/// What it is off by where that does not tell in the weights.
const SETTLED_PX: f64 = 0.02;

/// Fewer samples than this say nothing.
const LEAST_SAMPLES: usize = 50;

/// The offset is fitted beside the gain where brightness over the scene differs by so many standard deviations of the noise.
const OFFSET_CONTRAST: f64 = 5.0;

/// The median of a normal variable's magnitude over its standard deviation.
const NORMAL_MEDIAN: f64 = 0.6745;

/// A large shift is believed where its residuals are below this part of those of a small one.
const MUCH_BETTER: f64 = 0.8;

/// A shift below this may be the estimator's error, px.
const CLOSE_PX: f64 = 0.3;

/// A light that changes by more than this is another scene.
const SANE_GAIN: std::ops::Range<f64> = 0.3..3.0;

/// A picture that turns by more than this is another one.
const MOST_TURN_RAD: f64 = 0.2;

impl Registrar {
    /// A registrar for `reference`, a single frame with noise of `noise_grey`.
    #[must_use]
    pub fn new(reference: &Luma, noise_grey: f64) -> Self {
        let full = Self::at_full_size(reference, noise_grey);
        if full.sees_shift {
            return full;
        }
        // A faint scene: means of four or sixteen pixels have its gradients and a half or a quarter of the noise.
        let mut reduced = [2, 4].into_iter().filter_map(|factor| full.at(factor));
        reduced.find(|r| r.sees_shift).unwrap_or(full)
    }

    /// A registrar for a `reference` that is a mean of the aligned frames of a camera that moves, with noise of `noise_grey`, and has itself `noise_part`
    /// of that. What it compares is smoothed.
    #[must_use]
    pub fn of_mean(reference: &Luma, noise_grey: f64, noise_part: f64) -> Self {
        Self::of_mean_as_it_is(reference, noise_grey, noise_part).smoothing()
    }

    fn of_mean_as_it_is(reference: &Luma, noise_grey: f64, noise_part: f64) -> Self {
        let full_size = |least_grey| {
            Self::at_full_size_of(reference, noise_grey, noise_part, least_grey).holding_unseen()
        };
        let full = full_size(LEAST_GRADIENT_GREY);
        if full.sees_shift_well() {
            return full;
        }
        let full = full_size(FAINT_GRADIENT_GREY);
        let reduced: Vec<Self> = [2, 4].into_iter().filter_map(|factor| full.at(factor)).collect();
        std::iter::once(full)
            .chain(reduced)
            .min_by(|a, b| a.expected_std_px().total_cmp(&b.expected_std_px()))
            .expect("there is the one of full size")
    }

    /// The same that smooths what it compares. Its samples keep the gradients of the scene as it is: they only say in which direction a difference is
    /// to be made up for.
    fn smoothing(mut self) -> Self {
        let small = (self.factor > 1)
            .then(|| self.reference.reduced(self.factor))
            .flatten();
        let compared = small.as_ref().unwrap_or(&self.reference);
        let here = SmoothShift::new(0.0, 0.0);
        for s in &mut self.samples {
            s.value = here
                .value(compared, s.u as usize, s.v as usize)
                .unwrap_or(s.value);
        }
        self.smooths = true;
        self
    }

    /// The frame's value where a sample is seen, with the scene shifted as `now` says; `None` outside.
    fn value_in<'a>(
        &self,
        frame: &'a Luma,
        now: &Registration,
    ) -> impl Fn(&ReferencePixel) -> Option<f64> + 'a {
        let (now, smooths) = (*now, self.smooths);
        let (du, dv) = (now.shift_u_px, now.shift_v_px);
        let of_all = (smooths && !now.turns()).then(|| SmoothShift::new(du, dv));
        let size = (frame.width, frame.height);
        let place = now.place_in_frame();
        move |s| {
            let here = (s.u as usize, s.v as usize);
            if let Some(shift) = &of_all {
                return shift.value(frame, here.0, here.1);
            }
            if !now.turns() {
                return bilinear(&frame.data, size, s.u + du, s.v + dv);
            }
            let there = place(PixelPoint::new(s.u, s.v));
            if smooths {
                SmoothShift::near(there.u_px - s.u, there.v_px - s.v).value(frame, here.0, here.1)
            } else {
                bilinear(&frame.data, size, there.u_px, there.v_px)
            }
        }
    }

    /// The same that finds turns of the picture, too. It smooths what it compares: the ends of a line that turns are soon further off
    /// than a sharp edge reaches.
    #[must_use]
    pub fn turning(self) -> Self {
        let smooth = if self.smooths { self } else { self.smoothing() };
        Self {
            turns: true,
            ..smooth
        }
    }

    /// The same that compares one in so many of its samples.
    #[must_use]
    pub fn thinned(&self, to_one_in: usize) -> Self {
        let samples = self.samples.iter().step_by(to_one_in).copied().collect();
        Self {
            samples,
            ..self.clone()
        }
    }

    /// Standard uncertainty of a shift along the direction that the scene tells least of, px; infinite where it does not tell shifts.
    #[must_use]
    pub fn expected_std_px(&self) -> f64 {
        let information: Matrix2<f64> = self
            .samples
            .iter()
            .map(|s| s.gradient * s.gradient.transpose())
            .sum();
        let least = information.symmetric_eigenvalues().min();
        // With less a direction is held.
        if self.sees_shift && self.held.is_none() && least >= LEAST_INFORMATION {
            self.factor as f64 * self.noise_at_grey(self.factor) / least.sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// Which motions of the camera it sees; one that [holds what it does not see](Self::holding_unseen).
    #[must_use]
    pub fn shown_motion(&self) -> ShownMotion {
        match self.held {
            _ if self.expected_std_px().is_finite() => ShownMotion::All,
            Some(along) if self.sees_shift => ShownMotion::AllBut {
                along: if along.x < 0.0 { -along } else { along },
            },
            _ => ShownMotion::None,
        }
    }

    /// A registrar for a camera that does not move: only brightness is followed.
    #[must_use]
    pub fn of_fixed(reference: &Luma, noise_grey: f64) -> Self {
        Self {
            fixed: true,
            ..Self::at_full_size(reference, noise_grey)
        }
    }

    /// A registrar that compares single pixels, whether they show shifts or not.
    #[must_use]
    pub fn at_full_size(reference: &Luma, noise_grey: f64) -> Self {
        Self::at_full_size_of(reference, noise_grey, 1.0, LEAST_GRADIENT_GREY)
    }

    fn at_full_size_of(reference: &Luma, noise_grey: f64, noise_part: f64, least_gradient_grey: f64) -> Self {
        let (samples, sees_shift) =
            choose_samples(reference, noise_part * noise_grey, least_gradient_grey, 1);
        Self {
            fits_offset: determines_offset(&samples, noise_grey),
            samples,
            factor: 1,
            sees_shift,
            held: None,
            noise_grey,
            noise_part,
            least_gradient_grey,
            reference: Arc::new(reference.clone()),
            smooths: false,
            turns: false,
            fixed: false,
        }
    }

    /// The reference picture.
    #[must_use]
    pub fn reference(&self) -> &Arc<Luma> {
        &self.reference
    }

    /// Whether the scene shows shifts of the camera.
    #[must_use]
    pub fn sees_shift(&self) -> bool {
        self.sees_shift
    }

    /// Whether it shows them to [`GOOD_STD_PX`] in each frame.
    fn sees_shift_well(&self) -> bool {
        self.expected_std_px() < GOOD_STD_PX
    }

    /// Whether frames are followed where they shift.
    #[must_use]
    pub fn follows_shifts(&self) -> bool {
        self.sees_shift && !self.fixed
    }

    /// Whether they are followed in all directions.
    #[must_use]
    pub fn follows_all_shifts(&self) -> bool {
        self.follows_shifts() && self.held.is_none()
    }

    /// The noise at one part in `factor` of the size: averaging lowers it by the side of what is averaged, down to that of rounding.
    fn noise_at_grey(&self, factor: usize) -> f64 {
        (self.noise_grey / factor as f64).max(ROUNDING_STD_GREY)
    }

    /// The same comparing at one part in `factor` of the size; `None` where a picture cannot be reduced to that.
    fn at(&self, factor: usize) -> Option<Self> {
        let small = self.reference.reduced(factor)?;
        let noise_grey = self.noise_at_grey(factor);
        let (samples, sees_shift) = choose_samples(
            &small,
            self.noise_part * noise_grey,
            self.least_gradient_grey,
            factor,
        );
        let reduced = Self {
            fits_offset: determines_offset(&samples, noise_grey),
            samples,
            factor,
            sees_shift,
            held: None,
            ..self.clone()
        };
        let reduced = if self.held.is_some() {
            reduced.holding_unseen()
        } else {
            reduced
        };
        Some(if self.smooths {
            reduced.smoothing()
        } else {
            reduced
        })
    }

    /// The same that holds the direction along which fewest places of the scene carry gradient, if those are so few that they may be a thing that moves.
    #[must_use]
    pub fn holding_unseen(self) -> Self {
        let mut fields: Vec<Vec<Vector2<f64>>> = vec![Vec::new(); CELLS * CELLS];
        for s in &self.samples {
            fields[self.field_index(s)].push(s.gradient);
        }
        // Each field has one voice in what the directions are.
        let voice = |field: &Vec<Vector2<f64>>| {
            let all: Matrix2<f64> = field.iter().map(|g| g * g.transpose()).sum();
            all / all.trace().max(f64::MIN_POSITIVE)
        };
        let directions = SymmetricEigen::new(fields.iter().map(voice).sum::<Matrix2<f64>>());
        let least = directions.eigenvalues.imin();
        let along: Vector2<f64> = directions.eigenvectors.column(least).into();
        let strong = |g: &&Vector2<f64>| g.dot(&along).abs() >= self.least_sample_gradient_grey();
        let tells = |field: &&Vec<Vector2<f64>>| {
            field.iter().filter(strong).count() >= least_strong_samples(self.factor)
        };
        let telling = (0..fields.len()).filter(|&k| tells(&&fields[k]));
        let held = (!scene_fills(telling)).then_some(along);
        Self { held, ..self }
    }

    /// The direction, columns and rows, along which too few places tell a shift, so that it is held.
    #[must_use]
    pub fn held(&self) -> Option<Vector2<f64>> {
        self.held
    }

    /// Gradients below this are none, grey levels a pixel of the size compared.
    fn least_sample_gradient_grey(&self) -> f64 {
        let noise_grey = self.noise_part * self.noise_at_grey(self.factor);
        least_sample_gradient_grey(noise_grey, self.least_gradient_grey, self.factor)
    }

    /// Where each of `frames` looks, with no idea of it beforehand (within a quarter of the picture).
    #[must_use]
    pub fn locate(&self, frames: &[&Luma]) -> Vec<Registration> {
        let near: Vec<Followed> = frames.par_iter().map(|f| self.located_near(f)).collect();
        if near.iter().zip(frames).all(|(found, f)| self.is_there(f, found)) {
            return near.into_iter().map(|found| found.registration).collect();
        }
        let coarser = self.coarser();
        let all = frames.par_iter().zip(near);
        all.map(|(f, near)| self.located(f, near, &coarser)).collect()
    }

    /// Where each of `frames` looks, close to what is `known` of it.
    #[must_use]
    pub fn locate_near(&self, frames: &[&Luma], known: &[Registration]) -> Vec<Registration> {
        let each = frames.par_iter().zip(known);
        each.map(|(frame, start)| self.refine(frame, *start, true).registration)
            .collect()
    }

    /// Standard uncertainty of the motions `found` of `frames`, px: the median over the frames of what two halves of the scene,
    /// the colours of a chessboard, find each by itself. It is half of their distance, or the distance of their middle from
    /// `found`. A camera's motion is the same in both halves; noise, even a codec's correlated one, is not. Infinite where a
    /// half finds nothing.
    #[must_use]
    pub fn shift_std_px(&self, frames: &[&Luma], found: &[Registration]) -> f64 {
        let halves = [0, 1].map(|colour| self.part(|column, row| (column + row) % 2 == colour));
        let mut stds_px: Vec<f64> = frames
            .par_iter()
            .zip(found)
            .map(|(frame, r)| {
                let near = r.motion_px().norm() < NEAR_PX * self.factor as f64;
                // A line that turns leaves the place where a half would find it again.
                let start = if near && !self.turns {
                    Registration::IDENTITY
                } else {
                    *r
                };
                let place = |half: &Self| half.refine(frame, start, true).registration.motion_px();
                let [a, b] = halves.each_ref().map(place);
                let still = start.motion_px();
                if a == still || b == still {
                    return f64::INFINITY;
                }
                let whole = r.motion_px();
                (0.5 * (a - b).norm()).max((0.5 * (a + b) - whole).norm())
            })
            .collect();
        median(&mut stds_px).unwrap_or(f64::INFINITY)
    }

    /// What the shifts of the scene's parts, left and right, above and below, are off from the motion of the whole, px: root mean square over the `frames`,
    /// which look where `found` says. A camera whose turn is not found, and a scene of near and far things, have no one shift. 0 where no two parts
    /// tell shifts.
    #[must_use]
    pub fn parts_differ_px(&self, frames: &[&Luma], found: &[Registration]) -> f64 {
        let middle = CELLS / 2;
        // How each part shifts, with the turn of the whole.
        let shifting = Self {
            turns: false,
            ..self.clone()
        };
        let splits = [
            [
                shifting.part(|column, _| column < middle),
                shifting.part(|column, _| column >= middle),
            ],
            [
                shifting.part(|_, row| row < middle),
                shifting.part(|_, row| row >= middle),
            ],
        ];
        let square_px2 = |parts: &[Self; 2]| {
            let each = frames.par_iter().zip(found).filter_map(|(frame, start)| {
                let [a, b] = parts.each_ref().map(|part| part.refine(frame, *start, true));
                let told = |of: &Followed| of.registration != *start;
                let (u, v) = (
                    a.registration.shift_u_px - b.registration.shift_u_px,
                    a.registration.shift_v_px - b.registration.shift_v_px,
                );
                (told(&a) && told(&b)).then_some((u * u + v * v) / 4.0)
            });
            let each: Vec<f64> = each.collect();
            each.iter().sum::<f64>() / each.len().max(1) as f64
        };
        splits.iter().map(square_px2).sum::<f64>().sqrt()
    }

    /// The same on some of the fields, of columns and rows.
    fn part(&self, holds: impl Fn(usize, usize) -> bool) -> Self {
        let mut part = self.clone();
        part.samples.retain(|s| {
            let (column, row) = self.field(s);
            holds(column, row)
        });
        part
    }

    /// Column and row of the field that a sample is in.
    fn field(&self, s: &ReferencePixel) -> (usize, usize) {
        let (w, h) = (
            self.reference.width / self.factor,
            self.reference.height / self.factor,
        );
        let field = |at: f64, of: usize| (at * CELLS as f64 / of.max(1) as f64) as usize;
        (field(s.u, w), field(s.v, h))
    }

    /// The number of that field, row by row.
    fn field_index(&self, s: &ReferencePixel) -> usize {
        let (column, row) = self.field(s);
        row.min(CELLS - 1) * CELLS + column.min(CELLS - 1)
    }

    /// Where each of `frames` looks by the scene's edges alone, whatever the light does from field to field; `found` is what one
    /// light for the whole scene found. A far shift is believed only where the edges are better explained by it than by none.
    #[must_use]
    pub fn by_edges(&self, frames: &[&Luma], found: &[Registration]) -> Vec<Registration> {
        let all = frames.par_iter().zip(found);
        all.map(|(frame, r)| self.at_edges(frame, r).unwrap_or(*r))
            .collect()
    }

    fn at_edges(&self, frame: &Luma, found: &Registration) -> Option<Registration> {
        let frame = &*self.at_its_size(frame)?;
        let scale = self.factor as f64;
        let found = found.scaled(1.0 / scale);
        let far = found.shift_px() > NEAR_PX;
        let start = if far && !self.edges_say(frame, &found) {
            found.unshifted()
        } else {
            found
        };
        let step = |now: &Registration| {
            if self.turns {
                self.edge_step(frame, now, |s| Self::motion_gradient(s, frame))
            } else {
                let step = self.edge_step(frame, now, |s| s.gradient)?;
                Some(Vector3::new(step.x, step.y, 0.0))
            }
        };
        let reach = reach_px(middle_of(frame));
        let moved = |now: &Registration, step: &Vector3<f64>| moved_by(now, step, reach);
        let (at, _) = gauss_newton(start, STEPS, step, moved, |step| step.norm() < 1e-3);
        let near = (at.motion_px() - start.motion_px()).norm() < 2.0 * NEAR_PX;
        Some(if near { at } else { start }.scaled(scale))
    }

    /// The step of the motion by the edges of `frame`, of the size compared, that looks as `now` says; `None` where they do not tell it. A motion of N
    /// parameters changes a sample's grey by its `gradient`.
    fn edge_step<const N: usize>(
        &self,
        frame: &Luma,
        now: &Registration,
        gradient: impl Fn(&ReferencePixel) -> SVector<f64, N>,
    ) -> Option<SVector<f64, N>> {
        let value = self.value_in(frame, now);
        let lit = self.samples.iter().filter_map(|s| {
            let grey = value(s)?;
            Some(LitPixel {
                field: self.field_index(s),
                residual: grey - now.gain * s.value,
                gradient: now.gain * gradient(s),
            })
        });
        let (step, information) = local_light::step(&lit.collect::<Vec<_>>(), CELLS * CELLS)?;
        let information = DMatrix::from_column_slice(N, N, information.as_slice());
        let seen = self.held.is_none() && information.symmetric_eigenvalues().min() >= LEAST_INFORMATION;
        seen.then_some(step)
    }

    /// How a sample's grey grows with a motion of `frame`, of the size compared, in the order of [`Registration::motion_px`].
    fn motion_gradient(s: &ReferencePixel, frame: &Luma) -> Vector3<f64> {
        let middle = middle_of(frame);
        let reach = reach_px(middle);
        let (x, y) = ((s.u - middle.u_px) / reach, (s.v - middle.v_px) / reach);
        let g = s.gradient;
        Vector3::new(g.x, g.y, g.y * x - g.x * y)
    }

    /// Whether the edges of `frame` are more likely those of the scene shifted as `found` than those of the scene where it is.
    fn edges_say(&self, frame: &Luma, found: &Registration) -> bool {
        let mut fields: Vec<FieldReadings> = vec![Vec::new(); CELLS * CELLS];
        // Whole pixels: between them noise is averaged, which would speak for any shift.
        let (du, dv) = (found.shift_u_px.round(), found.shift_v_px.round());
        for s in &self.samples {
            let at = |u: f64, v: f64| {
                let inside = u >= 0.0 && v >= 0.0 && u < frame.width as f64 && v < frame.height as f64;
                inside.then(|| f64::from(frame.row(v as usize)[u as usize]))
            };
            if let (Some(here), Some(there)) = (at(s.u, s.v), at(s.u + du, s.v + dv)) {
                fields[self.field_index(s)].push([s.value, here, there]);
            }
        }
        local_light::ln_likelihood_ratio(&fields, self.noise_at_grey(self.factor)) > 0.0
    }

    /// Where `frame` looks: with no idea of it beforehand, or close to where another frame of its time looked, whatever fits better.
    #[must_use]
    pub fn locate_one(&self, frame: &Luma, nearby: &Registration) -> Followed {
        let anywhere = self.locate(&[frame]);
        let starts = anywhere.iter().chain([nearby]);
        let found = starts.map(|start| self.refine(frame, *start, true));
        let best = found.min_by(|a, b| a.spread_grey.total_cmp(&b.spread_grey));
        best.expect("one start is that nearby")
    }

    /// Where `frame` looks, the one after a frame that looked as `last` says: close to that, or, where the scene does not fit there as it did before (the
    /// camera was knocked, or clips were joined), wherever it fits better.
    #[must_use]
    pub fn follow_from(&self, frame: &Luma, last: &Followed) -> Followed {
        let found = self.follow_closely(frame, &last.registration);
        if !self.fixed && MUCH_BETTER * found.spread_grey > last.spread_grey {
            return self.locate_one(frame, &found.registration);
        }
        found
    }

    /// The shift found from none on.
    fn located_near(&self, frame: &Luma) -> Followed {
        self.refine(frame, Registration::IDENTITY, true)
    }

    /// Whether the residuals are the noise of two frames, and the shift hardly one: then no other shift fits better.
    fn is_there(&self, frame: &Luma, found: &Followed) -> bool {
        let of_two = NORMAL_MEDIAN * std::f64::consts::SQRT_2;
        let smoothed = if self.smooths { SMOOTH_NOISE_PART } else { 1.0 };
        let noise_grey = of_two * (smoothed * self.noise_at_grey(self.factor)).max(ROUNDING_STD_GREY);
        let is_close =
            found.spread_grey < noise_grey / MUCH_BETTER && found.registration.motion_px().norm() < CLOSE_PX;
        is_close
            && !self.compares(frame, |compared, size| {
                self.leaves_unexplained(compared, &found.scaled(size))
            })
    }

    /// The shift found near none, or a large one where that fits much better.
    fn located(&self, frame: &Luma, near: Followed, coarser: &[Self]) -> Registration {
        if coarser.is_empty() || self.is_there(frame, &near) {
            return near.registration;
        }
        let far = self.refine(frame, coarse_place(frame, coarser), true);
        // A moving hand can lead astray; the scene as a whole decides.
        let is_far = far.spread_grey < MUCH_BETTER * near.spread_grey
            || !near.spread_grey.is_finite()
            || self.compares(frame, |compared, size| {
                self.explains_more(compared, &far.scaled(size), &near.scaled(size))
            });
        if is_far { far } else { near }.registration
    }

    /// The same comparing at an eighth, a quarter and a half, where the scene shows shifts at all.
    fn coarser(&self) -> Vec<Self> {
        if !self.sees_shift {
            return Vec::new();
        }
        [8, 4, 2]
            .into_iter()
            .filter_map(|factor| self.at(factor))
            .map(|coarse| Self {
                held: self.held,
                // A small picture tells little of a turn, and would be led astray by it.
                turns: false,
                ..coarse
            })
            .collect()
    }

    /// Where `frame` looks, close to where `previous` looked. A fixed camera's shift is exactly zero.
    #[must_use]
    pub fn follow(&self, frame: &Luma, previous: &Registration) -> Registration {
        self.follow_closely(frame, previous).registration
    }

    fn follow_closely(&self, frame: &Luma, previous: &Registration) -> Followed {
        if self.fixed {
            return self.refine(frame, previous.unshifted(), false);
        }
        self.refine(frame, *previous, true)
    }

    /// Robust Gauss-Newton from `start`: the local minimum next to it, or one further off that explains more of the scene.
    fn refine(&self, frame: &Luma, start: Registration, moving: bool) -> Followed {
        let moving = moving && self.sees_shift;
        let Some(compared) = self.at_its_size(frame) else {
            return Followed::not_compared(start);
        };
        let scale = self.factor as f64;
        let start_there = start.scaled(1.0 / scale);
        let found = self.descend(&compared, start_there, moving.then_some(0.0));
        // A line that turns leaves its middle where it was: there is always more to explain.
        let may_be_further = self.turns || self.held.is_some() && self.leaves_unexplained(&compared, &found);
        if !moving || !may_be_further {
            return found.scaled(scale);
        }
        let further = self.descend(&compared, start_there, Some(FIRST_OFF_PX));
        let went_px = (further.registration.motion_px() - start_there.motion_px()).norm();
        let is_near = !self.turns || went_px < 2.0 * NEAR_PX;
        let best = if is_near && self.explains_more(&compared, &further, &found) {
            further
        } else {
            found
        };
        best.scaled(scale)
    }

    /// A frame at the size that is compared; `None` where it cannot be reduced to that.
    fn at_its_size<'a>(&self, frame: &'a Luma) -> Option<Cow<'a, Luma>> {
        match self.factor {
            1 => Some(Cow::Borrowed(frame)),
            factor => frame.reduced(factor).map(Cow::Owned),
        }
    }

    /// What `asked` says of a frame at the size that is compared, which is so many times as large; false where no direction is held, and where there is none.
    fn compares(&self, frame: &Luma, asked: impl Fn(&Luma, f64) -> bool) -> bool {
        let compared = self.held.and_then(|_| self.at_its_size(frame));
        compared.is_some_and(|compared| asked(&compared, 1.0 / self.factor as f64))
    }

    /// Residuals of the samples where `frame`, of the size compared, looks as `now` says, grey levels; not a number outside of it.
    fn residuals<'a>(&'a self, frame: &'a Luma, now: &Registration) -> impl Iterator<Item = f32> + 'a {
        let value = self.value_in(frame, now);
        let (gain, offset_grey) = (now.gain, now.offset_grey);
        self.samples
            .iter()
            .map(move |s| value(s).map_or(f32::NAN, |i| (i - gain * s.value - offset_grey) as f32))
    }

    /// Whether, with `frame` (of the size compared) looking as `found` says, samples with gradient fit nowhere in as many fields as a scene fills: not
    /// a thing that moves, but a shift that was not found. Before a plain wall most samples fit whatever the shift, and a floor line does not.
    fn leaves_unexplained(&self, frame: &Luma, found: &Followed) -> bool {
        let cut = tukey_cut(found.spread_grey);
        let mut beyond = vec![0; CELLS * CELLS];
        let telling = self
            .samples
            .iter()
            .zip(self.residuals(frame, &found.registration));
        for (s, r) in telling.filter(|(s, _)| s.tells_shifts()) {
            beyond[self.field_index(s)] += usize::from(f64::from(r.abs()) > cut);
        }
        scene_fills((0..beyond.len()).filter(|&k| beyond[k] >= least_strong_samples(self.factor)))
    }

    /// Whether `one` explains the scene better than `other`: a shift in as many fields as a scene fills, a turn in as many as it moves.
    fn explains_more(&self, frame: &Luma, one: &Followed, other: &Followed) -> bool {
        if !one.spread_grey.is_finite() {
            return false;
        }
        let cut = tukey_cut(other.spread_grey);
        let mut gained = vec![0.0; CELLS * CELLS];
        let (mut cost_of_one, mut cost_of_other) = (0.0, 0.0);
        let pairs = self
            .residuals(frame, &one.registration)
            .zip(self.residuals(frame, &other.registration));
        let telling = self.samples.iter().zip(pairs).filter(|(s, _)| s.tells_shifts());
        for (s, (one, other)) in telling.filter(|(_, (one, other))| one.is_finite() && other.is_finite()) {
            let [one, other] = [one, other].map(|r| tukey_cost(f64::from(r), cut));
            gained[self.field_index(s)] += other - one;
            cost_of_one += one;
            cost_of_other += other;
        }
        let of_sample = tukey_cost(f64::INFINITY, cut);
        cost_of_one < MUCH_BETTER * cost_of_other
            && (self.turns || scene_fills((0..gained.len()).filter(|&k| gained[k] > of_sample)))
    }

    /// The local minimum next to `start`, in a `frame` of the size compared. The shift is held where `off_px` is `None`; else it is what the shift may be
    /// off by in the beginning, so that samples which it puts off by as much keep their weight.
    fn descend(&self, frame: &Luma, start: Registration, off_px: Option<f64>) -> Followed {
        let moving = off_px.is_some();
        if self.samples.len() < LEAST_SAMPLES {
            return Followed::not_compared(start);
        }
        if !moving && start.is_still() {
            return self.refine_light(frame, start);
        }
        let turns = moving && self.turns;
        let start = Registration {
            middle: if turns { middle_of(frame) } else { start.middle },
            ..start
        };
        let graduated = off_px.is_some_and(|off_px| off_px > 0.0);
        let mut off_px = off_px.unwrap_or(0.0);
        let mut spread = f64::INFINITY;
        let mut residuals = Vec::with_capacity(self.samples.len());
        let mut magnitudes: Vec<f32> = Vec::with_capacity(self.samples.len());
        let step = |now: &Registration| {
            residuals.clear();
            residuals.extend(self.residuals(frame, now));
            magnitudes.clear();
            magnitudes.extend(residuals.iter().filter(|r| r.is_finite()).map(|r| r.abs()));
            if magnitudes.len() < LEAST_SAMPLES {
                spread = f64::INFINITY;
                return None;
            }
            spread = f64::from(lower_median(&mut magnitudes));
            let mut equations = NormalEquations::default();
            let cut = tukey_cut(spread);
            for (s, &r) in self.samples.iter().zip(&residuals) {
                let cut = if off_px > 0.0 {
                    cut.hypot(TUKEY * now.gain * off_px * s.gradient.norm())
                } else {
                    cut
                };
                let weight = tukey_weight(f64::from(r), cut);
                if weight > 0.0 {
                    let g = -now.gain * s.gradient;
                    let turn = if turns {
                        -now.gain * Self::motion_gradient(s, frame)[2]
                    } else {
                        0.0
                    };
                    let row = Vector5::new(g.x, g.y, s.value, 1.0, turn);
                    equations.push(&row, f64::from(r), weight);
                }
            }
            let settled = off_px < SETTLED_PX;
            if settled {
                self.restrain_offset(3, &mut equations);
            } else {
                // What is not yet where it belongs would pass for another light.
                equations.hold(2);
                equations.hold(3);
            }
            if moving {
                hold_unseen(self.held, &mut equations);
            } else {
                equations.hold(0);
                equations.hold(1);
            }
            if !turns || !tells_turn(&equations) {
                equations.hold(TURN);
            }
            let step = equations.step(0.0, 0.0)?;
            let motion = Vector3::new(step[0], step[1], step[TURN]);
            if graduated {
                off_px = motion.norm();
            }
            Some((motion, [step[2], step[3]], settled))
        };
        let reach = reach_px(middle_of(frame));
        let moved = |now: &Registration, (motion, light, _): &(Vector3<f64>, [f64; 2], bool)| Registration {
            gain: now.gain + light[0],
            offset_grey: now.offset_grey + light[1],
            ..moved_by(now, motion, reach)
        };
        let is_last = |(motion, light, settled): &(Vector3<f64>, [f64; 2], bool)| {
            *settled && motion.norm() < 1e-3 && light[0].abs() < 1e-5
        };
        let steps = match (moving, graduated) {
            (false, _) => LIGHT_STEPS,
            (true, false) => STEPS,
            (true, true) => 2 * STEPS,
        };
        let (found, _) = gauss_newton(start, steps, step, moved, is_last);
        sane(found, spread, frame).unwrap_or(Followed::not_compared(start))
    }

    /// The light alone, of a frame that is not shifted: what [`descend`](Self::descend) finds then, for a
    /// tenth of its time, since every pixel is where the reference has it.
    fn refine_light(&self, frame: &Luma, start: Registration) -> Followed {
        let seen: Vec<(f64, f64)> = self
            .samples
            .iter()
            .filter_map(|s| {
                let at = s.v as usize * frame.width + s.u as usize;
                Some((s.value, f64::from(*frame.data.get(at)?)))
            })
            .collect();
        if seen.len() < LEAST_SAMPLES {
            return Followed::not_compared(start);
        }
        let mut spread = f64::INFINITY;
        let mut magnitudes = vec![0.0; seen.len()];
        let step = |now: &Registration| {
            let residual = |&(value, grey): &(f64, f64)| grey - now.gain * value - now.offset_grey;
            for (m, pixel) in magnitudes.iter_mut().zip(&seen) {
                *m = residual(pixel).abs() as f32;
            }
            spread = f64::from(lower_median(&mut magnitudes));
            let mut equations = NormalEquations::default();
            let cut = tukey_cut(spread);
            for pixel in &seen {
                let r = residual(pixel);
                equations.push(&Vector2::new(pixel.0, 1.0), r, tukey_weight(r, cut));
            }
            self.restrain_offset(1, &mut equations);
            equations.step(0.0, 0.0)
        };
        let moved = |now: &Registration, step: &Vector2<f64>| Registration {
            gain: now.gain + step[0],
            offset_grey: now.offset_grey + step[1],
            ..*now
        };
        let is_last = |step: &Vector2<f64>| step[0].abs() < 1e-5;
        let (found, _) = gauss_newton(start, LIGHT_STEPS, step, moved, is_last);
        sane(found, spread, frame).unwrap_or(Followed::not_compared(start))
    }

    /// Holds the offset, at this place among the unknowns, where the scene does not determine it; damps it elsewhere, so that of
    /// a gain and an offset that are strongly correlated the gain takes more of the change.
    fn restrain_offset<const N: usize>(&self, at: usize, equations: &mut NormalEquations<N>) {
        if self.fits_offset {
            equations.matrix[(at, at)] = 1.1 * equations.matrix[(at, at)] + 1.0;
        } else {
            equations.hold(at);
        }
    }
}

/// Holds the shift (the first two unknowns) along a direction in which the scene has no gradient, it stays what it was, and along `held`. Of two directions
/// that hardly differ to hold both would hold the shift across them, too: beside `held` only what is square to it is asked.
fn hold_unseen(held: Option<Vector2<f64>>, equations: &mut NormalEquations<5>) {
    let [uu, vu, vv] = [(0, 0), (1, 0), (1, 1)].map(|at| equations.matrix[at]);
    let information = Matrix2::new(uu, vu, vu, vv);
    let axes = match held {
        Some(held) => [held, Vector2::new(-held.y, held.x)],
        None => {
            let axes = SymmetricEigen::new(information).eigenvectors;
            [0, 1].map(|k| axes.column(k).into_owned())
        }
    };
    for axis in axes {
        if held == Some(axis) || axis.dot(&(information * axis)) < LEAST_INFORMATION {
            hold_along(&axis, equations);
        }
    }
}

/// Holds the shift along `axis`.
fn hold_along(axis: &Vector2<f64>, equations: &mut NormalEquations<5>) {
    for (row, column) in [(0, 0), (1, 0), (1, 1)] {
        equations.matrix[(row, column)] += HELD * axis[row] * axis[column];
    }
}

/// The turn among the unknowns of a frame, px as in [`Registration::motion_px`]: after its shift and its light.
const TURN: usize = 4;

/// Whether the scene tells the turn, whatever the shift.
fn tells_turn(equations: &NormalEquations<5>) -> bool {
    let [uu, vu, vv] = [(0, 0), (1, 0), (1, 1)].map(|at| equations.matrix[at]);
    let beside = Vector2::new(equations.matrix[(TURN, 0)], equations.matrix[(TURN, 1)]);
    let shifts = Matrix2::new(uu, vu, vu, vv).try_inverse();
    shifts.is_some_and(|covariance| {
        equations.matrix[(TURN, TURN)] - beside.dot(&(covariance * beside)) >= LEAST_INFORMATION
    })
}

/// A frame that moves by so much more, px as in [`Registration::motion_px`], of a picture with this reach.
fn moved_by(now: &Registration, motion: &Vector3<f64>, reach_px: f64) -> Registration {
    Registration {
        shift_u_px: now.shift_u_px + motion[0],
        shift_v_px: now.shift_v_px + motion[1],
        turn_rad: now.turn_rad + motion[2] / reach_px,
        ..*now
    }
}

/// `found`, which fits to `spread_grey`, unless it cannot be: a shift beyond a quarter of the picture is a cut, and so is another light.
fn sane(found: Registration, spread_grey: f64, frame: &Luma) -> Option<Followed> {
    let sane = SANE_GAIN.contains(&found.gain)
        && found.turn_rad.abs() < MOST_TURN_RAD
        && found.shift_u_px.abs() < 0.25 * frame.width as f64
        && found.shift_v_px.abs() < 0.25 * frame.height as f64;
    (sane && spread_grey.is_finite()).then_some(Followed {
        registration: found,
        spread_grey,
    })
}

/// Residuals beyond this have no weight, for those of the median magnitude `spread`, grey levels.
fn tukey_cut(spread: f64) -> f64 {
    TUKEY * (STD_OF_MEDIAN * spread).max(0.5)
}

/// Whether the samples differ in brightness by so much more than noise that gain and offset are both determined. Where they do
/// not, a fit of both takes the noise of the reference for contrast that the frames do not have: gain falls, offset rises.
fn determines_offset(samples: &[ReferencePixel], noise_grey: f64) -> bool {
    let count = samples.len().max(1) as f64;
    let mean = samples.iter().map(|s| s.value).sum::<f64>() / count;
    let variance = samples.iter().map(|s| (s.value - mean).powi(2)).sum::<f64>() / count;
    variance > (OFFSET_CONTRAST * noise_grey).powi(2)
}

/// A first shift from reduced pictures, where a far shift is a near one.
fn coarse_place(frame: &Luma, coarser: &[Registrar]) -> Registration {
    let mut found = Registration::IDENTITY;
    for registrar in coarser {
        let refined = registrar.refine(frame, found, true);
        if refined.spread_grey.is_finite() {
            found = refined.registration;
        }
    }
    found
}

/// Gradients below this are within the noise or a codec's ringing, grey levels a pixel, in a picture that was reduced by `factor`.
fn least_sample_gradient_grey(noise_grey: f64, least_gradient_grey: f64, factor: usize) -> f64 {
    (GRADIENT_SIGMAS * noise_grey).max(least_gradient_grey / factor as f64)
}

/// Samples with a gradient that a cell of the grid needs to count.
fn least_strong_samples(factor: usize) -> usize {
    if factor > 4 { 2 } else { 4 }
}

/// Whether these cells of the grid, row by row, are more than a thing that moves fills.
fn scene_fills(cells: impl Iterator<Item = usize>) -> bool {
    let (mut columns, mut rows) = ([false; CELLS], [false; CELLS]);
    let mut count = 0;
    for cell in cells {
        (columns[cell % CELLS], rows[cell / CELLS]) = (true, true);
        count += 1;
    }
    let span = |line: [bool; CELLS]| line.into_iter().filter(|&there| there).count();
    count >= LEAST_CELLS || span(columns).max(span(rows)) >= LEAST_SPAN
}

/// The pixels of strongest gradient in each cell of a coarse grid, so that they spread over the picture.
///
/// Gradients within the noise are set to zero: such pixels tell the brightness only. The second value says whether real gradients are in as many
/// places as a scene's are.
///
/// `factor` is what the picture was reduced by: means of many pixels have less of the codec's ringing.
fn choose_samples(
    reference: &Luma,
    noise_grey: f64,
    least_gradient_grey: f64,
    factor: usize,
) -> (Vec<ReferencePixel>, bool) {
    let least_grey = least_sample_gradient_grey(noise_grey, least_gradient_grey, factor);
    let (w, h) = (reference.width, reference.height);
    let per_cell = SAMPLES / (CELLS * CELLS);
    let of_cell = |cell: usize| {
        let (cu, cv) = (cell % CELLS, cell / CELLS);
        let us = (cu * w / CELLS).max(2)..((cu + 1) * w / CELLS).min(w.saturating_sub(2));
        let vs = (cv * h / CELLS).max(2)..((cv + 1) * h / CELLS).min(h.saturating_sub(2));
        // Twice the gradient's components are whole numbers: a pixel is its squared gradient and its place.
        let mut here: Vec<(u32, u32)> = Vec::with_capacity(us.len() * vs.len());
        for v in vs {
            let (above, row, below) = (reference.row(v - 1), reference.row(v), reference.row(v + 1));
            for u in us.clone() {
                let square = |a: u8, b: u8| u32::from(a.abs_diff(b)).pow(2);
                here.push((
                    square(row[u + 1], row[u - 1]) + square(below[u], above[u]),
                    (v * w + u) as u32,
                ));
            }
        }
        if here.len() > per_cell {
            here.select_nth_unstable_by(per_cell, |a, b| b.0.cmp(&a.0));
            here.truncate(per_cell);
        }
        let mut here: Vec<ReferencePixel> = here
            .iter()
            .map(|&(_, at)| ReferencePixel::of(reference, at as usize % w, at as usize / w))
            .collect();
        let mut strong = 0;
        for s in &mut here {
            if s.gradient.norm() < least_grey {
                s.gradient = Vector2::zeros();
            } else {
                strong += 1;
            }
        }
        (here, strong >= least_strong_samples(factor))
    };
    let (samples, strong): (Vec<Vec<ReferencePixel>>, Vec<bool>) =
        (0..CELLS * CELLS).into_par_iter().map(of_cell).unzip();
    (
        samples.concat(),
        scene_fills((0..strong.len()).filter(|&cell| strong[cell])),
    )
}

/// A shift below this is found from no shift on, in pixels of the size compared.
const NEAR_PX: f64 = 2.0;

/// Fields of the scene along each side.
const CELLS: usize = 12;

/// Rounding and the codec's ringing make gradients of this size, grey levels a pixel.
const LEAST_GRADIENT_GREY: f64 = 3.0;

/// Where too few are larger, smaller ones than these count as well.
const FAINT_GRADIENT_GREY: f64 = 1.5;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    fn textured(shift: (f64, f64), gain: f64) -> Luma {
        let value = |u: f64, v: f64| {
            let (u, v) = (u - shift.0, v - shift.1);
            // Waves of many lengths and directions: no shift but the true one makes them agree.
            let waves: f64 = (1..=12)
                .map(|k| {
                    let (k, turn) = (f64::from(k), 2.4 * f64::from(k));
                    let number = 0.012 + 0.018 * k;
                    (number * (u * turn.cos() + v * turn.sin()) + k * k).sin() * 0.4
                })
                .sum();
            gain * (100.0 + 30.0 * waves)
        };
        Luma::from_fn(480, 360, |u, v| {
            value(u as f64, v as f64).round().clamp(0.0, 255.0) as u8
        })
    }

    #[test]
    fn shift_and_gain_are_found() {
        let registrar = Registrar::new(&textured((0.0, 0.0), 1.0), 0.3);
        for (shift, gain) in [((0.3, -0.2), 1.0), ((7.25, -4.5), 1.05), ((-20.0, 12.0), 0.95)] {
            let r = registrar.locate(&[&textured(shift, gain)])[0];
            assert!((r.shift_u_px - shift.0).abs() < 0.03, "{r:?} for {shift:?}");
            assert!((r.shift_v_px - shift.1).abs() < 0.03, "{r:?} for {shift:?}");
            assert!(
                (r.gain * 100.0 + r.offset_grey - gain * 100.0).abs() < 0.5,
                "{r:?}"
            );
        }
    }

    /// A plain wall above a floor that begins at row `v`.
    fn wall_and_floor(v: f64) -> Luma {
        Luma::from_fn(480, 360, |_, row| {
            let below = (row as f64 + 0.5 - v).clamp(0.0, 1.0);
            (80.0 + 40.0 * below).round() as u8
        })
    }

    #[test]
    fn a_floor_line_in_one_row_of_cells_tells_the_rows_and_nothing_else() {
        let registrar = Registrar::new(&wall_and_floor(315.0), 0.5).holding_unseen();
        assert!(registrar.sees_shift());
        assert!(registrar.held().is_some_and(|along| along.x.abs() > 0.99));
    }

    #[test]
    fn a_floor_line_that_moves_further_than_the_noise_explains_is_followed() {
        let registrar = Registrar::new(&wall_and_floor(315.0), 0.5).holding_unseen();
        let r = registrar.follow(&wall_and_floor(316.4), &Registration::IDENTITY);
        assert!((r.shift_v_px - 1.4).abs() < 0.1, "{r:?}");
        assert!(r.shift_u_px.abs() < 1e-3, "{r:?}");
        let r = registrar.locate(&[&wall_and_floor(322.4)])[0];
        assert!((r.shift_v_px - 7.4).abs() < 0.1, "{r:?}");
    }

    /// `scene` as a camera sees it that turned by `turn_rad` and shifted.
    fn turned(scene: &Luma, turn_rad: f64, shift: (f64, f64)) -> Luma {
        let registration = Registration {
            middle: middle_of(scene),
            turn_rad,
            shift_u_px: shift.0,
            shift_v_px: shift.1,
            ..Registration::IDENTITY
        };
        registration.seen(scene)
    }

    #[test]
    fn a_turn_is_found_with_the_shift() {
        let scene = textured((0.0, 0.0), 1.0);
        let registrar = Registrar::new(&scene, 0.3).turning();
        for (turn_rad, shift) in [(0.004, (0.3, -0.2)), (-0.01, (7.25, -4.5)), (0.0, (-2.0, 1.0))] {
            let r = registrar.locate(&[&turned(&scene, turn_rad, shift)])[0];
            assert!((r.turn_rad - turn_rad).abs() < 1e-4, "{r:?} for {turn_rad}");
            assert!((r.shift_u_px - shift.0).abs() < 0.03, "{r:?} for {shift:?}");
            assert!((r.shift_v_px - shift.1).abs() < 0.03, "{r:?} for {shift:?}");
        }
    }

    #[test]
    fn a_floor_line_tells_a_turn_though_its_middle_stays() {
        let scene = wall_and_floor(315.0);
        let registrar = Registrar::new(&scene, 0.5).holding_unseen().turning();
        for turn_rad in [0.003, -0.006] {
            let r = registrar.follow(&turned(&scene, turn_rad, (0.0, 0.0)), &Registration::IDENTITY);
            assert!((r.turn_rad - turn_rad).abs() < 2e-4, "{r:?} for {turn_rad}");
            assert!(r.shift_u_px.abs() < 1e-3, "{r:?}");
        }
    }

    #[test]
    fn a_ball_with_its_shadow_and_a_hand_do_not_fill_a_scene() {
        let at =
            |columns: std::ops::Range<usize>, row: usize| columns.map(move |column| row * CELLS + column);
        assert!(!scene_fills(at(0..6, 3).chain(at(4..6, 4)).chain(at(3..6, 10))));
        assert!(scene_fills(at(0..CELLS, 10)));
        assert!(scene_fills((0..4).flat_map(|row| at(0..4, row))));
    }

    #[test]
    fn a_camera_that_is_knocked_is_found_again() {
        let registrar = Registrar::new(&textured((0.0, 0.0), 1.0), 0.3);
        let before = registrar.locate_one(&textured((9.0, -7.0), 1.0), &Registration::IDENTITY);
        let (jumped, at) = (textured((-20.0, 12.0), 1.0), (-20.0, 12.0));
        let off = |r: &Registration| (r.shift_u_px - at.0).hypot(r.shift_v_px - at.1);
        let nearby = registrar.follow(&jumped, &before.registration);
        assert!(off(&nearby) > 1.0, "close by there would be nothing to show");
        let found = registrar.follow_from(&jumped, &before);
        assert!(off(&found.registration) < 0.05, "{found:?}");
    }

    #[test]
    fn a_scene_fainter_than_the_noise_of_a_pixel_is_followed() {
        // Waves of 1.5 grey levels or so under noise of 2.
        let mut random = TestNoise(7);
        let mut noisy = |shift: (f64, f64)| {
            let mut faint = textured(shift, 1.0);
            for p in &mut faint.data {
                *p = (100.0 + 0.15 * (f64::from(*p) - 100.0) + 2.0 * random.normal())
                    .round()
                    .clamp(0.0, 255.0) as u8;
            }
            faint
        };
        let registrar = Registrar::new(&noisy((0.0, 0.0)), 2.0);
        for shift in [(0.0, 0.0), (2.3, -1.2), (-12.0, 9.0)] {
            let r = registrar.locate(&[&noisy(shift)])[0];
            let off = (r.shift_u_px - shift.0).hypot(r.shift_v_px - shift.1);
            assert!(off < 0.3, "{r:?} for {shift:?}");
        }
    }

    #[test]
    fn the_light_alone_is_what_the_whole_comparison_finds_of_it() {
        let reference = textured((0.0, 0.0), 1.0);
        let registrar = Registrar::of_fixed(&reference, 0.3);
        let mut frame = textured((0.0, 0.0), 0.93);
        // Something moves through a tenth of it.
        frame.data[40_000..57_000].fill(220);
        let r = registrar.follow(&frame, &Registration::IDENTITY);
        assert!(r.is_still());
        assert!((r.gain - 0.93).abs() < 2e-3 && r.offset_grey.abs() < 0.2, "{r:?}");
        // A start that is shifted by next to nothing takes the other way.
        let start = Registration {
            shift_u_px: 1e-9,
            ..Registration::IDENTITY
        };
        let by_all = registrar.refine(&frame, start, false).registration;
        assert!((r.gain - by_all.gain).abs() < 1e-6, "{r:?} {by_all:?}");
        assert!(
            (r.offset_grey - by_all.offset_grey).abs() < 1e-4,
            "{r:?} {by_all:?}"
        );
    }

    #[test]
    fn brightness_against_another_reference_says_the_same() {
        let of = |gain: f64, offset_grey: f64| Registration {
            gain,
            offset_grey,
            ..Registration::IDENTITY
        };
        let (frame, other) = (of(1.04, -2.0), of(0.97, 1.5));
        let grey = 120.0;
        let against = frame.relative_to(&other);
        let by_other = against.gain * (other.gain * grey + other.offset_grey) + against.offset_grey;
        assert!((by_other - (frame.gain * grey + frame.offset_grey)).abs() < 1e-9);
    }

    #[test]
    fn the_light_of_a_plain_wall_does_not_drift() {
        let mut random = TestNoise(5);
        let mut wall = || Luma::from_fn(320, 240, |_, _| 60 + random.below(16));
        let registrar = Registrar::of_fixed(&wall(), 4.6);
        let mut r = Registration::IDENTITY;
        for _ in 0..300 {
            r = registrar.follow(&wall(), &r);
        }
        assert!((r.gain - 1.0).abs() < 0.01 && r.offset_grey.abs() < 0.5, "{r:?}");
    }

    #[test]
    fn an_even_scene_stays_where_it_is() {
        let flat = Luma {
            width: 64,
            height: 64,
            data: vec![80; 64 * 64],
        };
        let brighter = Luma {
            data: vec![84; 64 * 64],
            ..flat.clone()
        };
        let r = Registrar::new(&flat, 0.3).locate(&[&brighter])[0];
        assert!(r.is_still());
        assert!((r.gain - 1.05).abs() < 0.01, "{r:?}");
    }

    #[test]
    fn aligned_undoes_the_shift() {
        let reference = textured((0.0, 0.0), 1.0);
        let moved = textured((3.5, -2.25), 1.0);
        let r = Registration {
            shift_u_px: 3.5,
            shift_v_px: -2.25,
            ..Registration::IDENTITY
        };
        let back = r.aligned(&moved);
        for v in 20..340 {
            for u in 20..460 {
                let d = i32::from(back.row(v)[u]) - i32::from(reference.row(v)[u]);
                assert!(d.abs() <= 2, "{u},{v}: {d}"); // bilinear on waves of 27 px
            }
        }
    }
}
