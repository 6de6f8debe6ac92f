//! From the ball's path to frames.
//!
//! A frame is I(p) = ∫ over the exposure of (box ∗ blur ∗ scene)(p): the light on a pixel's area, after the optics. The
//! scene's *change* against the empty picture lives near the ball only, so that only that is computed:
//!
//! 1. on a grid S times finer than the pixels, each cell holds the exact share that the ball covers (`coverage`);
//! 2. the exposure is a Gauss-Legendre sum, split where the path has a kink (an impact), with a node every half px;
//! 3. each pixel sums the cells with the weight of box ∗ Gaussian at their centres. Cells of side h stand for a blur of
//!    variance h²/12 themselves, which the Gaussian's variance is reduced by; what remains is of fourth order in h.
//!
//! A camera that is shaken shifts the whole picture: what was computed for a point is then seen beside it, and the backdrop
//! is computed anew at the points that the pixels see.
//!
//! Then light, flicker, noise and rounding. Noise has a stream of its own for each frame, so that frames do not depend
//! on the order in which they are made.

use super::camera::{BallOutline, Ellipse, PictureEdge, PictureOf};
use super::coverage::EllipseCoverage;
use super::effects::{
    Acting, BackdropPattern, BallMoment, ChosenEffects, Fixture, Lamp, Layer, LightField, PictureShift,
    Plane, SensorNoise, Surface,
};
use super::flight::Trajectory;
use super::marks::BallMarks;
use super::quadrature::gauss_legendre;
use super::scene::Scene;
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use nalgebra::{Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::ops::Range;
use std::sync::OnceLock;

/// The empty picture.
pub struct Backdrop {
    width: usize,
    height: usize,
    /// Grey by row and column, before light and flicker.
    grey: Vec<f32>,
    /// The floor line of a camera that is not shaken; `None` in a top view.
    pub floor_line: Option<PictureEdge>,
}

/// A thing before the background: its grey and the edges between which it is.
struct FixtureInPicture {
    grey: f64,
    sides: Vec<PictureEdge>,
}

impl Backdrop {
    /// As seen by a camera whose picture is shifted by `shift_px`.
    fn new(renderer: &Renderer, shift_px: Vector2<f64>) -> Self {
        let (scene, picture) = (&renderer.scene, &renderer.picture);
        let blur_px = renderer.blur_px.as_ref().map_or(0.0, |b| *b.apply());
        let floor_line = picture.floor_line();
        let standing: Vec<FixtureInPicture> = renderer
            .fixtures
            .iter()
            .map(|f| FixtureInPicture {
                grey: f.apply().grey(),
                sides: f.apply().sides(picture),
            })
            .collect();
        let look = &scene.look;
        let plain = |p: Vector2<f64>| {
            // The share of the pixel below the floor line, softened by the blur.
            let below = floor_line.map_or(1.0, |line| step(line.beyond_px(p), blur_px));
            let mut grey = match floor_line {
                Some(_) => look.background_grey + (look.floor_grey - look.background_grey) * below,
                None => look.floor_grey,
            };
            for thing in &standing {
                let share = (thing.sides.iter())
                    .map(|side| step(-side.beyond_px(p), blur_px))
                    .product::<f64>()
                    * (1.0 - below);
                grey += (thing.grey - grey) * share;
            }
            grey
        };
        let grey = pixels(scene)
            .map(|p| {
                let at = Vector2::new(p.u_px, p.v_px) - shift_px;
                let seen = PixelPoint::new(at.x, at.y);
                let texture: f64 = renderer.textures.iter().map(|t| t.apply().grey(seen)).sum();
                (plain(at) + texture) as f32
            })
            .collect();
        Self {
            width: scene.camera.width_px,
            height: scene.camera.height_px,
            grey,
            floor_line,
        }
    }
}

/// The centres of all pixels, row by row.
fn pixels(scene: &Scene) -> impl Iterator<Item = PixelPoint> + use<> {
    let (width, height) = (scene.camera.width_px, scene.camera.height_px);
    (0..height).flat_map(move |v| (0..width).map(move |u| PixelPoint::new(u as f64, v as f64)))
}

/// Share of a unit interval around `x` that is above 0, blurred by a Gaussian of deviation `sigma`.
fn step(x: f64, sigma: f64) -> f64 {
    // Far enough from pure geometry to look soft, near enough not to matter: the floor line never moves.
    let width = (sigma * sigma + 1.0 / 12.0).sqrt();
    gaussian_below(x / width)
}

/// Φ, the normal distribution function.
pub(super) fn gaussian_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
}

/// A part of the picture on the fine grid.
pub struct FineGrid {
    /// Centre of its first cell, px.
    first: Vector2<f64>,
    /// Side of a cell, px.
    side: f64,
    columns: usize,
    rows: usize,
    grey: Vec<f32>,
}

impl FineGrid {
    /// Centre of a cell, px.
    fn centre(&self, column: usize, row: usize) -> Vector2<f64> {
        self.first + Vector2::new(column as f64, row as f64) * self.side
    }

    /// Columns and rows of the cells that a box touches, with one more on each side.
    fn window(&self, low: Vector2<f64>, high: Vector2<f64>) -> (Range<usize>, Range<usize>) {
        let range = |low: f64, high: f64, first: f64, cells: usize| {
            let from = ((low - first) / self.side).floor().max(1.0) as usize - 1;
            let to = ((high - first) / self.side).ceil().max(0.0) as usize + 2;
            from.min(cells)..to.min(cells)
        };
        (
            range(low.x, high.x, self.first.x, self.columns),
            range(low.y, high.y, self.first.y, self.rows),
        )
    }

    /// Side of a cell, px.
    #[must_use]
    pub fn side_px(&self) -> f64 {
        self.side
    }

    /// Height of a row of cells, px.
    #[must_use]
    pub fn row_px(&self, row: usize) -> f64 {
        self.first.y + row as f64 * self.side
    }

    /// Paints an ellipse over the rows `rows`: `paint` gives the grey of a cell from its place in the ellipse (inside is
    /// within 1 of the origin; right, down), its place in the picture and its grey so far. Cells at the edge are
    /// mixed by the exact share that is covered.
    pub fn paint(
        &mut self,
        ellipse: &Ellipse,
        rows: Range<usize>,
        mut paint: impl FnMut(Vector2<f64>, Vector2<f64>, f32) -> f32,
    ) {
        let Some(cover) = EllipseCoverage::new(ellipse) else {
            return;
        };
        let half = 0.5 * self.side;
        let to_row = |y: f64| ((y - self.first.y) / self.side).round().max(0.0) as usize;
        let reached = cover.rows();
        let rows = rows.start.max(to_row(*reached.start()))..rows.end.min(to_row(*reached.end()) + 1);
        for row in rows {
            let y = self.row_px(row);
            let Some(span) = cover.span(y - half, y + half) else {
                continue;
            };
            let to_column = |x: f64| ((x - self.first.x) / self.side).round().max(0.0) as usize;
            let columns = to_column(span.touched.0)..(to_column(span.touched.1) + 1).min(self.columns);
            for column in columns {
                let at = self.centre(column, row);
                let inside = at.x - half >= span.covered.0 && at.x + half <= span.covered.1;
                let share = if inside {
                    1.0
                } else {
                    cover.of_square(at, self.side) as f32
                };
                let cell = &mut self.grey[row * self.columns + column];
                *cell += share * (paint(cover.unit(at), at, *cell) - *cell);
            }
        }
    }
}

/// A ball of one grey, where shading is off.
struct Flat(f64);

impl Surface for Flat {
    fn grey(&self, _normal: &Vector3<f64>) -> f64 {
        self.0
    }
}

/// Makes frames.
pub struct Renderer {
    scene: Scene,
    picture: PictureOf,
    flat: Flat,
    exposure_s: Option<Acting<f64>>,
    rotation_blur_s: Option<Acting<f64>>,
    readout_s: Option<Acting<f64>>,
    blur_px: Option<Acting<f64>>,
    surface: Option<Acting<dyn Surface>>,
    marks: Option<Acting<BallMarks>>,
    fixtures: Vec<Acting<dyn Fixture>>,
    shakes: Vec<Acting<dyn PictureShift>>,
    textures: Vec<Acting<dyn BackdropPattern>>,
    layers: Vec<Acting<dyn Layer>>,
    lights: Vec<Acting<dyn LightField>>,
    lamps: Vec<Acting<dyn Lamp>>,
    noises: Vec<Acting<dyn SensorNoise>>,
    /// Of a camera at rest.
    backdrop: OnceLock<Backdrop>,
    /// Factor of uneven light on each pixel.
    gain: OnceLock<Vec<f32>>,
    cells: usize,
    /// Behind the first ball.
    second: Option<Box<OtherBall>>,
}

/// Another ball before the same camera.
pub struct OtherBall {
    /// When it is launched, s.
    pub start_s: f64,
    /// Where, along the calibrated plane, m.
    pub x_m: f64,
    /// m.
    pub radius_m: f64,
    /// Its way, from its launch at 0 on.
    pub trajectory: Trajectory,
    /// What the camera sees of it alone.
    pub renderer: Renderer,
}

impl OtherBall {
    /// Its own time at `time_s` of the recording: before its launch it lies still.
    #[must_use]
    pub fn own_time_s(&self, time_s: f64) -> f64 {
        (time_s - self.start_s).max(0.0)
    }
}

/// Cells a pixel and a standard deviation of blur, so that the midpoint rule over cells is good to less than 0.1 grey.
const CELLS_PER_BLUR: f64 = 3.2;
/// Cells a pixel, at least and at most.
const FEWEST_CELLS: usize = 4;
const MOST_CELLS: usize = 16;
/// Standard deviations after which blur is over.
const BLUR_REACH: f64 = 5.0;
/// Nodes of an exposure: at least, and for each length over which the picture of an edge changes (the blur, or what a
/// pixel's own size leaves where there is none).
const FEWEST_NODES: usize = 2;
const NODES_PER_GRAIN: f64 = 1.5;
const FINEST_GRAIN_PX: f64 = 0.25;
const MOST_NODES_A_RULE: usize = 24;

impl Renderer {
    /// For `scene` with the effects of `chosen`, whose flight has been used up, before `floor`.
    #[must_use]
    pub fn new(scene: &Scene, chosen: ChosenEffects, floor: Plane) -> Self {
        let blur_px = chosen.blur_px.as_ref().map_or(0.0, |b| *b.apply());
        let cells = if blur_px > 0.0 {
            ((CELLS_PER_BLUR / blur_px).ceil() as usize).clamp(FEWEST_CELLS, MOST_CELLS)
        } else {
            FEWEST_CELLS
        };
        Self {
            scene: scene.clone(),
            picture: PictureOf::new(scene, chosen.warps).before(floor),
            flat: Flat(scene.look.ball_grey),
            exposure_s: chosen.exposure_s,
            rotation_blur_s: chosen.rotation_blur_s,
            readout_s: chosen.readout_s,
            blur_px: chosen.blur_px,
            surface: chosen.surface,
            marks: chosen.marks,
            fixtures: chosen.fixtures,
            shakes: chosen.shakes,
            textures: chosen.textures,
            layers: chosen.layers,
            lights: chosen.lights,
            lamps: chosen.lamps,
            noises: chosen.noises,
            backdrop: OnceLock::new(),
            gain: OnceLock::new(),
            cells,
            second: None,
        }
    }

    /// The same with another ball behind.
    #[must_use]
    pub fn with_second(self, second: Option<OtherBall>) -> Self {
        Self {
            second: second.map(Box::new),
            ..self
        }
    }

    /// The ball behind.
    #[must_use]
    pub fn second(&self) -> Option<&OtherBall> {
        self.second.as_deref()
    }

    /// The way into the picture.
    #[must_use]
    pub fn picture(&self) -> &PictureOf {
        &self.picture
    }

    /// Whether it has marks on the ball.
    #[must_use]
    pub fn shows_marks(&self) -> bool {
        self.marks.is_some()
    }

    /// R in the picture, in the calibrated plane, px.
    #[must_use]
    pub fn radius_px(&self) -> f64 {
        self.scene.ball.radius_m / self.scene.camera.metres_per_pixel
    }

    /// How much later than the frame's time a row is exposed, s.
    #[must_use]
    pub fn row_delay_s(&self, row_px: f64) -> f64 {
        self.readout_s.as_ref().map_or(0.0, |readout| {
            *readout.apply() * ((row_px + 0.5) / self.scene.camera.height_px as f64 - 0.5)
        })
    }

    /// How far the whole picture is shifted (right, down) in the frame at `time_s`, px.
    #[must_use]
    pub fn shift_px(&self, trajectory: &Trajectory, time_s: f64) -> Vector2<f64> {
        self.shakes
            .iter()
            .map(|s| s.apply().shift_px(trajectory, time_s))
            .sum()
    }

    /// The frame with number `index`.
    #[must_use]
    pub fn frame(&self, trajectory: &Trajectory, index: usize) -> Luma {
        Luma {
            width: self.scene.camera.width_px,
            height: self.scene.camera.height_px,
            data: self.develop(&self.light(trajectory, index), index),
        }
    }

    /// The light on each pixel in frame `index`, grey, without noise or rounding.
    pub(super) fn light(&self, trajectory: &Trajectory, index: usize) -> Vec<f32> {
        let time_s = index as f64 / self.scene.camera.frame_rate_hz;
        let exposure_s = self.exposure_s.as_ref().map_or(0.0, |e| *e.apply());
        let turning_s = self.rotation_blur_s.as_ref().map_or(0.0, |e| *e.apply());
        let blur_px = self.blur_px.as_ref().map_or(0.0, |b| *b.apply());
        let shift_px = self.shift_px(trajectory, time_s);
        let shifted;
        let backdrop = if shift_px == Vector2::zeros() {
            self.backdrop
                .get_or_init(|| Backdrop::new(self, Vector2::zeros()))
        } else {
            shifted = Backdrop::new(self, shift_px);
            &shifted
        };
        let mut grey = backdrop.grey.clone();
        let behind;
        let mut backdrop = backdrop;
        if let Some(other) = self.second() {
            let own_s = other.own_time_s(time_s);
            let own_exposure_s = if own_s > 0.0 { exposure_s } else { 0.0 };
            let nodes =
                (other.renderer).exposure_nodes(&other.trajectory, own_s, own_exposure_s, blur_px, shift_px);
            let exposure = Exposure {
                nodes,
                shift_px,
                time_s: own_s,
                moves: own_exposure_s > 0.0,
                turns: false,
            };
            (other.renderer).add_ball(&other.trajectory, &exposure, blur_px, backdrop, &mut grey);
            behind = Backdrop {
                grey: grey.clone(),
                ..*backdrop
            };
            backdrop = &behind;
        }
        let exposure = Exposure {
            nodes: self.exposure_nodes(trajectory, time_s, exposure_s.max(turning_s), blur_px, shift_px),
            shift_px,
            time_s,
            moves: exposure_s > 0.0,
            turns: turning_s > 0.0,
        };
        self.add_ball(trajectory, &exposure, blur_px, backdrop, &mut grey);
        if !self.lights.is_empty() {
            let gain = self.gain.get_or_init(|| self.gains());
            grey.iter_mut().zip(gain).for_each(|(g, factor)| *g *= factor);
        }
        if !self.lamps.is_empty() {
            let lamp: f64 = self
                .lamps
                .iter()
                .map(|l| l.apply().gain(time_s, exposure_s))
                .product();
            grey.iter_mut().for_each(|g| *g *= lamp as f32);
        }
        grey
    }

    /// The factor of uneven light on each pixel.
    fn gains(&self) -> Vec<f32> {
        pixels(&self.scene)
            .map(|p| self.lights.iter().map(|l| l.apply().gain(p)).product::<f64>() as f32)
            .collect()
    }

    /// Times and weights of an exposure around `time_s`: dense enough for the way the ball goes meanwhile, and split where
    /// that has a kink.
    fn exposure_nodes(
        &self,
        trajectory: &Trajectory,
        time_s: f64,
        exposure_s: f64,
        blur_px: f64,
        shift_px: Vector2<f64>,
    ) -> Vec<(f64, f64)> {
        if exposure_s == 0.0 {
            return vec![(time_s, 1.0)];
        }
        let (from_s, to_s) = (time_s - 0.5 * exposure_s, time_s + 0.5 * exposure_s);
        // Rows of a rolling shutter share the split of the row in which the ball is.
        let row_px = self.outline(trajectory, time_s).ellipse.centre.y + shift_px.y;
        let delay_s = self.row_delay_s(row_px);
        let mut ends: Vec<f64> = vec![from_s];
        ends.extend(
            trajectory
                .kinks(from_s + delay_s, to_s + delay_s)
                .map(|kink| kink - delay_s),
        );
        ends.push(to_s);
        let grain_px = blur_px.max(FINEST_GRAIN_PX);
        ends.windows(2)
            .flat_map(|piece| {
                let length_s = piece[1] - piece[0];
                let middle_s = 0.5 * (piece[0] + piece[1]) + delay_s;
                let mut speed = trajectory.state(middle_s).velocity_m_s.norm();
                if self.rotation_blur_s.is_some() {
                    // Of a mark at the ball's middle.
                    speed += trajectory.spin_rad_s(middle_s).norm() * self.scene.ball.radius_m;
                }
                let smear_px = speed * length_s / self.scene.camera.metres_per_pixel;
                let nodes = FEWEST_NODES + (NODES_PER_GRAIN * smear_px / grain_px).ceil() as usize;
                // Long smears in parts: a rule of thousands of nodes would cost more than the frame.
                let parts = nodes.div_ceil(MOST_NODES_A_RULE);
                let rule = gauss_legendre(nodes.div_ceil(parts));
                let part_s = length_s / parts as f64;
                let start_s = piece[0];
                (0..parts).flat_map(move |part| {
                    let from_s = start_s + part as f64 * part_s;
                    rule.clone()
                        .into_iter()
                        .map(move |(x, w)| (from_s + x * part_s, w * part_s / exposure_s))
                })
            })
            .collect()
    }

    fn outline(&self, trajectory: &Trajectory, time_s: f64) -> BallOutline {
        self.picture.outline(&trajectory.state(time_s).position_m)
    }

    /// The ball where it is at `place_s`, turned as at `turned_s`.
    fn moment(&self, trajectory: &Trajectory, place_s: f64, turned_s: f64) -> BallMoment<'_> {
        let ball_m = trajectory.state(place_s).position_m;
        BallMoment {
            ball_m,
            outline: self.picture.outline(&ball_m),
            picture: &self.picture,
            surface: self.surface.as_ref().map_or(&self.flat, |s| s.apply()),
            marks: (self.marks.as_ref()).map(|marks| (marks.apply(), trajectory.orientation(turned_s))),
        }
    }

    /// Adds what the ball changes in an exposure.
    fn add_ball(
        &self,
        trajectory: &Trajectory,
        exposure: &Exposure,
        blur_px: f64,
        backdrop: &Backdrop,
        grey: &mut [f32],
    ) {
        let Some(field) = self.field(trajectory, exposure, blur_px, backdrop) else {
            return;
        };
        // On the points that the pixels see, so that the ball and what it does to the picture are where they would be without
        // a shift.
        let shift_px = exposure.shift_px;
        let mut patch = field.patch(backdrop, self.cells, shift_px);
        let empty = patch.grey.clone();
        let mut change = vec![0.0_f32; empty.len()];
        for (node_s, weight) in &exposure.nodes {
            let (place_s, turned_s) = (exposure.place_s(*node_s), exposure.turned_s(*node_s));
            let (low, high) = self.extent(trajectory, place_s);
            let (columns, rows) = patch.window(low, high);
            for row in rows.clone() {
                let cells = row * patch.columns + columns.start..row * patch.columns + columns.end;
                patch.grey[cells.clone()].copy_from_slice(&empty[cells]);
            }
            if self.readout_s.is_some() {
                for row in rows.clone() {
                    let late_s = self.row_delay_s(patch.row_px(row) + shift_px.y);
                    let moment = self.moment(trajectory, place_s + late_s, turned_s + late_s);
                    self.paint(&moment, backdrop, &mut patch, row..row + 1);
                }
            } else {
                let moment = self.moment(trajectory, place_s, turned_s);
                self.paint(&moment, backdrop, &mut patch, rows.clone());
            }
            for row in rows {
                let cells = row * patch.columns + columns.start..row * patch.columns + columns.end;
                let (now, before) = (&patch.grey[cells.clone()], &empty[cells.clone()]);
                for ((c, now), before) in change[cells].iter_mut().zip(now).zip(before) {
                    *c += *weight as f32 * (now - before);
                }
            }
        }
        let weights = CellWeights::new(self.cells, blur_px);
        field.add(&change, patch.columns, &weights, backdrop, grey);
    }

    /// Shadow, reflection, ball.
    fn paint(&self, moment: &BallMoment<'_>, backdrop: &Backdrop, patch: &mut FineGrid, rows: Range<usize>) {
        for layer in &self.layers {
            layer.apply().paint(moment, backdrop, patch, rows.clone());
        }
        let ellipse = &moment.outline.ellipse;
        match moment.seen_marks(patch.side_px()) {
            None => patch.paint(ellipse, rows, |unit, _, _| {
                moment.surface.grey(&normal(unit)) as f32
            }),
            Some(marks) => patch.paint(ellipse, rows, |unit, _, _| {
                (marks.albedo(unit) * moment.surface.grey(&normal(unit))) as f32
            }),
        }
    }

    /// The pixels that an exposure changes, `None` where those are outside the picture.
    fn field(
        &self,
        trajectory: &Trajectory,
        exposure: &Exposure,
        blur_px: f64,
        backdrop: &Backdrop,
    ) -> Option<ExposedRegion> {
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for (node_s, _) in &exposure.nodes {
            let (least, most) = self.extent(trajectory, exposure.place_s(*node_s));
            low = low.inf(&least);
            high = high.sup(&most);
        }
        let margin = (BLUR_REACH * blur_px + 0.5).ceil() + 1.0;
        let shift_px = exposure.shift_px;
        ExposedRegion::new(low + shift_px, high + shift_px, margin, backdrop)
    }

    /// Smallest and largest corner of what the ball changes at a time, in a picture that is not shifted, px.
    fn extent(&self, trajectory: &Trajectory, time_s: f64) -> (Vector2<f64>, Vector2<f64>) {
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        // With a rolling shutter the ball's rows may have any time of the readout.
        let half_readout_s = self.readout_s.as_ref().map_or(0.0, |r| 0.5 * *r.apply());
        let shares: &[f64] = if half_readout_s > 0.0 {
            &[-1.0, -0.5, 0.0, 0.5, 1.0]
        } else {
            &[0.0]
        };
        for share in shares {
            let at_s = time_s + share * half_readout_s;
            let moment = self.moment(trajectory, at_s, at_s);
            let (centre, reach) = (moment.outline.ellipse.centre, moment.outline.ellipse.reach());
            let boxes = self
                .layers
                .iter()
                .filter_map(|l| l.apply().extent(&moment))
                .chain([(centre - reach, centre + reach)]);
            for (least, most) in boxes {
                low = low.inf(&least);
                high = high.sup(&most);
            }
        }
        (low, high)
    }

    /// Noise, rounding to code values.
    fn develop(&self, grey: &[f32], index: usize) -> Vec<u8> {
        // Rounding half up; the cast saturates at 0 and 255.
        let code = |g: f32| (g + 0.5) as u8;
        if self.noises.is_empty() {
            return grey.iter().map(|g| code(*g)).collect();
        }
        let noises: Vec<&dyn SensorNoise> = self.noises.iter().map(Acting::apply).collect();
        let spread: Vec<f32> = (0..=255_u8)
            .map(|g| {
                let variance: f64 = noises.iter().map(|n| n.variance(f64::from(g))).sum();
                variance.sqrt() as f32
            })
            .collect();
        let mut random = ChaCha8Rng::seed_from_u64(self.scene.seed);
        random.set_stream(index as u64);
        let mut bits = vec![0_u8; 2 * grey.len()];
        random.fill_bytes(&mut bits);
        let normal = normal_table();
        grey.iter()
            .zip(bits.chunks_exact(2))
            .map(|(g, pair)| {
                let draw = normal[usize::from(u16::from_le_bytes([pair[0], pair[1]]))];
                code(g + spread[usize::from(code(*g))] * draw)
            })
            .collect()
    }
}

/// Outward normal (right, up, towards the camera) at a place in the ball's outline (right, down; the rim at 1).
#[must_use]
pub fn normal(unit: Vector2<f64>) -> Vector3<f64> {
    let squared = unit.norm_squared();
    // Cells of the rim have their centre a little outside.
    let unit = if squared > 1.0 {
        unit / squared.sqrt()
    } else {
        unit
    };
    Vector3::new(unit.x, -unit.y, (1.0 - squared.min(1.0)).sqrt())
}

/// When a frame is exposed, and where its picture is meanwhile.
struct Exposure {
    /// Times (s) and weights.
    nodes: Vec<(f64, f64)>,
    /// How far the picture is shifted, px.
    shift_px: Vector2<f64>,
    /// Its middle, s.
    time_s: f64,
    /// Whether the ball's way during it is simulated, and its turning; what is not stands as in the middle.
    moves: bool,
    turns: bool,
}

impl Exposure {
    /// When the ball is where a node has it, s.
    fn place_s(&self, node_s: f64) -> f64 {
        if self.moves { node_s } else { self.time_s }
    }

    /// When it is turned as a node has it, s.
    fn turned_s(&self, node_s: f64) -> f64 {
        if self.turns { node_s } else { self.time_s }
    }
}

/// The pixels that an exposure changes, with a margin of cells around them that blur carries into them.
struct ExposedRegion {
    /// First and one past the last pixel written.
    columns: Range<usize>,
    rows: Range<usize>,
    /// Pixels around them on each side, on the fine grid only.
    margin: usize,
}

impl ExposedRegion {
    /// What can change when the scene changes between `low` and `high`.
    fn new(low: Vector2<f64>, high: Vector2<f64>, margin: f64, backdrop: &Backdrop) -> Option<Self> {
        let clip = |from: f64, to: f64, size: usize| {
            let from = (from - margin).floor().max(0.0);
            let to = (to + margin).ceil().min(size as f64 - 1.0);
            (from <= to).then_some(from as usize..to as usize + 1)
        };
        Some(Self {
            columns: clip(low.x, high.x, backdrop.width)?,
            rows: clip(low.y, high.y, backdrop.height)?,
            margin: margin as usize,
        })
    }

    /// The empty scene on the fine grid, by the points that a picture shifted by `shift_px` shows there.
    fn patch(&self, backdrop: &Backdrop, cells: usize, shift_px: Vector2<f64>) -> FineGrid {
        let side = 1.0 / cells as f64;
        let corner = Vector2::new(self.columns.start as f64, self.rows.start as f64);
        let first = corner - Vector2::repeat(self.margin as f64 + 0.5 - 0.5 * side) - shift_px;
        // Beyond the picture its edge goes on.
        let pixels = |range: &Range<usize>, size: usize| -> Vec<usize> {
            let margin = self.margin;
            let from_margin = range.start..range.end + 2 * margin;
            from_margin
                .map(|i| i.saturating_sub(margin).min(size - 1))
                .collect()
        };
        let (columns, rows) = (
            pixels(&self.columns, backdrop.width),
            pixels(&self.rows, backdrop.height),
        );
        let mut grey = Vec::with_capacity(columns.len() * rows.len() * cells * cells);
        for v in &rows {
            let start = grey.len();
            for u in &columns {
                grey.extend(std::iter::repeat_n(backdrop.grey[v * backdrop.width + u], cells));
            }
            let row = start..grey.len();
            for _ in 1..cells {
                grey.extend_from_within(row.clone());
            }
        }
        FineGrid {
            first,
            side,
            columns: columns.len() * cells,
            rows: rows.len() * cells,
            grey,
        }
    }

    /// Adds `change`, on the fine grid, to the pixels `grey`: first along rows, then along columns.
    fn add(
        &self,
        change: &[f32],
        patch_columns: usize,
        weights: &CellWeights,
        backdrop: &Backdrop,
        grey: &mut [f32],
    ) {
        let cells = weights.cells;
        let taps = weights.taps.len();
        // The first cell that reaches the first pixel.
        let offset = (self.margin - weights.reach) * cells;
        let narrowed: Vec<f32> = change
            .chunks_exact(patch_columns)
            .flat_map(|row| {
                (0..self.columns.len()).map(move |i| {
                    let from = offset + i * cells;
                    dot(&row[from..from + taps], &weights.taps)
                })
            })
            .collect();
        let width = self.columns.len();
        for (j, v) in self.rows.clone().enumerate() {
            for (i, u) in self.columns.clone().enumerate() {
                let from = offset + j * cells;
                let sum: f32 = weights
                    .taps
                    .iter()
                    .zip(from..)
                    .map(|(w, row)| w * narrowed[row * width + i])
                    .sum();
                grey[v * backdrop.width + u] += sum;
            }
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// How much of each cell's light a pixel gets, along one axis: box ∗ Gaussian at the cell's centre, times its side.
struct CellWeights {
    cells: usize,
    /// Pixels on either side that matter.
    reach: usize,
    taps: Vec<f32>,
}

impl CellWeights {
    fn new(cells: usize, blur_px: f64) -> Self {
        let side = 1.0 / cells as f64;
        let sigma = (blur_px * blur_px - side * side / 12.0).max(0.0).sqrt();
        let reach = (BLUR_REACH * blur_px + 0.5).ceil() as usize;
        let taps = (0..(2 * reach + 1) * cells)
            .map(|k| {
                let d = (k as f64 + 0.5) * side - reach as f64 - 0.5;
                let weight = if sigma > 0.0 {
                    gaussian_below((d + 0.5) / sigma) - gaussian_below((d - 0.5) / sigma)
                } else if d.abs() < 0.5 {
                    1.0
                } else {
                    0.0
                };
                (weight * side) as f32
            })
            .collect();
        Self { cells, reach, taps }
    }
}

/// 65536 equally likely values of a standard normal variable, at the middles of their shares.
pub(super) fn normal_table() -> &'static [f32] {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    TABLE.get_or_init(|| {
        (0..=u16::MAX)
            .map(|i| normal_quantile((f64::from(i) + 0.5) / 65_536.0) as f32)
            .collect()
    })
}

/// Φ⁻¹ by bisection: done once, 65536 times, and needs no table of its own.
fn normal_quantile(share: f64) -> f64 {
    let (mut low, mut high) = (-6.0, 6.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if gaussian_below(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod accuracy;
#[cfg(test)]
mod marks_accuracy;
