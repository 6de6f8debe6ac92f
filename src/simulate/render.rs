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
//! The ball, its shadow and its image in the floor are computed apart where they are apart (`exposed_region`); the light of a frame
//! is the backdrop, made once, and what is added there, put together and developed row by row. `slow_reference` holds that none of
//! this shows.
//!
//! A camera that is shaken shifts the whole picture: what was computed for a point is then seen beside it, and the backdrop
//! is computed anew at the points that the pixels see.
//!
//! Then light, flicker, noise and rounding. Noise has a stream of its own for each frame, so that frames do not depend
//! on the order in which they are made.

use super::camera::{BallOutline, PictureEdge, PictureOf};
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
use exposed_region::{CellWeights, ExposedRegion, PictureBox};
use nalgebra::{Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::OnceLock;

mod exposed_region;
mod fine_grid;

pub use fine_grid::FineGrid;

/// The empty picture.
#[derive(Clone)]
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
        let (width, height) = (scene.camera.width_px, scene.camera.height_px);
        let u_px: Vec<f64> = (0..width).map(|u| u as f64 - shift_px.x).collect();
        let mut grey = Vec::with_capacity(width * height);
        for v_px in (0..height).map(|v| v as f64 - shift_px.y) {
            let mut texture = vec![0.0; width];
            for pattern in &renderer.textures {
                pattern.apply().add_to_row(&u_px, v_px, &mut texture);
            }
            let row = u_px.iter().zip(texture);
            grey.extend(row.map(|(&u_px, texture)| (plain(Vector2::new(u_px, v_px)) + texture) as f32));
        }
        Self {
            width,
            height,
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
    let deviations = x / width;
    // Where a grey has no more digits for what is missing to 0 or 1: most of a picture.
    const ALL_OF_IT: f64 = 9.0;
    if deviations.abs() > ALL_OF_IT {
        return if deviations > 0.0 { 1.0 } else { 0.0 };
    }
    gaussian_below(deviations)
}

/// Φ, the normal distribution function.
pub(super) fn gaussian_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x / std::f64::consts::SQRT_2)
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
        let light = self.frame_light(trajectory, index);
        let mut sensor = Sensor::new(self, index);
        let (width, height) = (self.scene.camera.width_px, self.scene.camera.height_px);
        let mut data = vec![0; width * height];
        // Row by row: a row's light stays in the processor's cache until it is developed.
        let mut grey = vec![0.0; width];
        for (v, codes) in data.chunks_exact_mut(width).enumerate() {
            light.row(v, &mut grey);
            sensor.develop(&grey, codes);
        }
        Luma { width, height, data }
    }

    /// The light on each pixel in frame `index`, grey, without noise or rounding.
    pub(super) fn light(&self, trajectory: &Trajectory, index: usize) -> Vec<f32> {
        let light = self.frame_light(trajectory, index);
        let (width, height) = (self.scene.camera.width_px, self.scene.camera.height_px);
        let mut grey = vec![0.0; width * height];
        for (v, row) in grey.chunks_exact_mut(width).enumerate() {
            light.row(v, row);
        }
        grey
    }

    fn frame_light(&self, trajectory: &Trajectory, index: usize) -> FrameLight<'_> {
        let time_s = index as f64 / self.scene.camera.frame_rate_hz;
        let exposure_s = self.exposure_s.as_ref().map_or(0.0, |e| *e.apply());
        let turning_s = self.rotation_blur_s.as_ref().map_or(0.0, |e| *e.apply());
        let blur_px = self.blur_px.as_ref().map_or(0.0, |b| *b.apply());
        let shift_px = self.shift_px(trajectory, time_s);
        let mut backdrop = if shift_px == Vector2::zeros() {
            let at_rest = || Backdrop::new(self, Vector2::zeros());
            Cow::Borrowed(self.backdrop.get_or_init(at_rest))
        } else {
            Cow::Owned(Backdrop::new(self, shift_px))
        };
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
            let behind = (other.renderer).ball_light(&other.trajectory, &exposure, blur_px, &backdrop);
            let backdrop = backdrop.to_mut();
            for change in behind {
                change.add_to(backdrop);
            }
        }
        let exposure = Exposure {
            nodes: self.exposure_nodes(trajectory, time_s, exposure_s.max(turning_s), blur_px, shift_px),
            shift_px,
            time_s,
            moves: exposure_s > 0.0,
            turns: turning_s > 0.0,
        };
        let changes = self.ball_light(trajectory, &exposure, blur_px, &backdrop);
        let gain = if self.lights.is_empty() {
            None
        } else {
            Some(self.gain.get_or_init(|| self.gains()).as_slice())
        };
        let lamps = self.lamps.iter().map(|l| l.apply().gain(time_s, exposure_s));
        FrameLight {
            backdrop,
            changes,
            gain,
            lamp: lamps.reduce(|a, b| a * b).map(|lamp| lamp as f32),
        }
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

    /// What the ball changes in an exposure.
    fn ball_light(
        &self,
        trajectory: &Trajectory,
        exposure: &Exposure,
        blur_px: f64,
        backdrop: &Backdrop,
    ) -> Vec<RegionLight> {
        let things = self.layers.len() + 1;
        let reached: Vec<Vec<Option<PictureBox>>> = exposure
            .nodes
            .iter()
            .map(|(node_s, _)| self.reached(trajectory, exposure.place_s(*node_s)))
            .collect();
        let ever =
            (0..things).map(|thing| PictureBox::around(reached.iter().filter_map(|boxes| boxes[thing])));
        let weights = CellWeights::new(self.cells, blur_px);
        // On the points that the pixels see, so that the ball and what it does to the picture are where they would be without
        // a shift.
        let shift_px = exposure.shift_px;
        ExposedRegion::all(ever, blur_px, shift_px, backdrop)
            .into_iter()
            .map(|region| {
                let mut patch = region.patch(backdrop, &weights, shift_px);
                let empty = patch.grey.clone();
                let mut change = vec![0.0_f32; empty.len()];
                for ((node_s, weight), boxes) in exposure.nodes.iter().zip(&reached) {
                    let times_s = (exposure.place_s(*node_s), exposure.turned_s(*node_s));
                    let moment = NodeOfExposure {
                        times_s,
                        shift_px,
                        boxes,
                    };
                    let within = PictureBox::around(region.things.iter().filter_map(|thing| boxes[*thing]));
                    let Some(within) = within else { continue };
                    let (columns, rows) = patch.cells.window(&within);
                    let cells_of =
                        |row: usize, width: usize| row * width + columns.start..row * width + columns.end;
                    for row in rows.clone() {
                        let cells = cells_of(row, patch.cells.columns);
                        patch.grey[cells.clone()].copy_from_slice(&empty[cells]);
                    }
                    self.paint_node(
                        trajectory,
                        &moment,
                        &region.things,
                        backdrop,
                        &mut patch,
                        rows.clone(),
                    );
                    for row in rows {
                        let cells = cells_of(row, patch.cells.columns);
                        let (now, before) = (&patch.grey[cells.clone()], &empty[cells.clone()]);
                        for ((c, now), before) in change[cells].iter_mut().zip(now).zip(before) {
                            *c += *weight as f32 * (now - before);
                        }
                    }
                }
                RegionLight {
                    grey: region.light(&change, &patch.cells, &weights),
                    columns: region.columns,
                    rows: region.rows,
                }
            })
            .collect()
    }

    /// Paints the rows `rows` with `things` as they are at a node of an exposure.
    fn paint_node(
        &self,
        trajectory: &Trajectory,
        node: &NodeOfExposure<'_>,
        things: &[usize],
        backdrop: &Backdrop,
        patch: &mut FineGrid,
        rows: Range<usize>,
    ) {
        let (place_s, turned_s) = node.times_s;
        if self.readout_s.is_none() {
            let moment = self.moment(trajectory, place_s, turned_s);
            for thing in things {
                self.paint(*thing, &moment, backdrop, patch, rows.clone());
            }
            return;
        }
        let reach: Vec<(usize, Range<usize>)> = (things.iter())
            .filter_map(|thing| Some((*thing, patch.cells.window(&node.boxes[*thing]?).1)))
            .collect();
        for row in rows {
            let mut there = reach.iter().filter(|(_, rows)| rows.contains(&row)).peekable();
            if there.peek().is_none() {
                continue;
            }
            let late_s = self.row_delay_s(patch.row_px(row) + node.shift_px.y);
            let moment = self.moment(trajectory, place_s + late_s, turned_s + late_s);
            for (thing, _) in there {
                self.paint(*thing, &moment, backdrop, patch, row..row + 1);
            }
        }
    }

    /// Paints a thing: a layer (shadow, reflection) by its number, or after them the ball.
    fn paint(
        &self,
        thing: usize,
        moment: &BallMoment<'_>,
        backdrop: &Backdrop,
        patch: &mut FineGrid,
        rows: Range<usize>,
    ) {
        if let Some(layer) = self.layers.get(thing) {
            return layer.apply().paint(moment, backdrop, patch, rows);
        }
        let ellipse = &moment.outline.ellipse;
        match moment.seen_marks(patch.side_px()) {
            None => patch.paint_surface(ellipse, rows, moment.surface),
            Some(marks) => patch.paint(ellipse, rows, |unit, _, _| {
                (marks.albedo(unit) * moment.surface.grey(&normal(unit))) as f32
            }),
        }
    }

    /// Where each thing is at a time, in a picture that is not shifted: the layers, then the ball.
    fn reached(&self, trajectory: &Trajectory, time_s: f64) -> Vec<Option<PictureBox>> {
        // With a rolling shutter the ball's rows may have any time of the readout.
        let half_readout_s = self.readout_s.as_ref().map_or(0.0, |r| 0.5 * *r.apply());
        let shares: &[f64] = if half_readout_s > 0.0 {
            &[-1.0, -0.5, 0.0, 0.5, 1.0]
        } else {
            &[0.0]
        };
        let mut reached: Vec<Option<PictureBox>> = vec![None; self.layers.len() + 1];
        for share in shares {
            let at_s = time_s + share * half_readout_s;
            let moment = self.moment(trajectory, at_s, at_s);
            let (centre, reach) = (moment.outline.ellipse.centre, moment.outline.ellipse.reach());
            let boxes = self
                .layers
                .iter()
                .map(|l| l.apply().extent(&moment))
                .chain([Some((centre - reach, centre + reach))]);
            for (sofar, now) in reached.iter_mut().zip(boxes) {
                let now = now.map(|(low, high)| PictureBox { low, high });
                *sofar = PictureBox::around(sofar.iter().copied().chain(now));
            }
        }
        reached
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

/// A node of an exposure.
struct NodeOfExposure<'a> {
    /// When the ball is where it has it, and when turned as it has it, s.
    times_s: (f64, f64),
    /// How far the picture is shifted, px.
    shift_px: Vector2<f64>,
    /// Where each thing is.
    boxes: &'a [Option<PictureBox>],
}

/// What is added to the pixels of a region of the picture.
struct RegionLight {
    columns: Range<usize>,
    rows: Range<usize>,
    /// By row and column of the region.
    grey: Vec<f32>,
}

impl RegionLight {
    /// Adds its part of row `v` to that row.
    fn add_to_row(&self, v: usize, row: &mut [f32]) {
        if !self.rows.contains(&v) {
            return;
        }
        let width = self.columns.len();
        let own = &self.grey[(v - self.rows.start) * width..][..width];
        for (grey, change) in row[self.columns.clone()].iter_mut().zip(own) {
            *grey += change;
        }
    }

    fn add_to(&self, backdrop: &mut Backdrop) {
        for v in self.rows.clone() {
            let row = v * backdrop.width..(v + 1) * backdrop.width;
            self.add_to_row(v, &mut backdrop.grey[row]);
        }
    }
}

/// The light of a frame: the backdrop, which most frames share, and what makes it that of this one.
struct FrameLight<'a> {
    backdrop: Cow<'a, Backdrop>,
    changes: Vec<RegionLight>,
    /// Factor on each pixel.
    gain: Option<&'a [f32]>,
    /// Factor on all of them.
    lamp: Option<f32>,
}

impl FrameLight<'_> {
    /// Row `v`, into `grey`.
    fn row(&self, v: usize, grey: &mut [f32]) {
        let width = grey.len();
        grey.copy_from_slice(&self.backdrop.grey[v * width..][..width]);
        for change in &self.changes {
            change.add_to_row(v, grey);
        }
        if let Some(gain) = self.gain {
            let own = &gain[v * width..][..width];
            grey.iter_mut().zip(own).for_each(|(g, factor)| *g *= factor);
        }
        if let Some(lamp) = self.lamp {
            grey.iter_mut().for_each(|g| *g *= lamp);
        }
    }
}

/// The sensor in a frame: noise, rounding to code values.
struct Sensor {
    /// How large the noise is, and its source; `None` of a sensor without.
    noise: Option<(NoiseSpread, ChaCha8Rng)>,
    /// Of a row: random bits, and the standard normal numbers that they stand for.
    bits: Vec<u8>,
    draws: Vec<f32>,
}

/// Standard deviation of the noise, grey.
enum NoiseSpread {
    /// At any code value.
    Constant(f32),
    /// At each.
    ByCode(Vec<f32>),
}

impl Sensor {
    fn new(renderer: &Renderer, index: usize) -> Self {
        let noises: Vec<&dyn SensorNoise> = renderer.noises.iter().map(Acting::apply).collect();
        let noise = (!noises.is_empty()).then(|| {
            let by_code: Vec<f32> = (0..=255_u8)
                .map(|g| {
                    let variance: f64 = noises.iter().map(|n| n.variance(f64::from(g))).sum();
                    variance.sqrt() as f32
                })
                .collect();
            let spread = if by_code.iter().all(|s| *s == by_code[0]) {
                NoiseSpread::Constant(by_code[0])
            } else {
                NoiseSpread::ByCode(by_code)
            };
            let mut random = ChaCha8Rng::seed_from_u64(renderer.scene.seed);
            random.set_stream(index as u64);
            (spread, random)
        });
        Self {
            noise,
            // Rows are of even length, so that each begins with a word of its own of the random stream.
            bits: vec![0; 2 * renderer.scene.camera.width_px],
            draws: vec![0.0; renderer.scene.camera.width_px],
        }
    }

    /// The next row of the frame, from its light.
    fn develop(&mut self, grey: &[f32], codes: &mut [u8]) {
        let Some((spread, random)) = &mut self.noise else {
            for (to, g) in codes.iter_mut().zip(grey) {
                *to = code(*g);
            }
            return;
        };
        random.fill_bytes(&mut self.bits);
        let normal = normal_table();
        for (draw, pair) in self.draws.iter_mut().zip(self.bits.chunks_exact(2)) {
            *draw = normal[usize::from(u16::from_le_bytes([pair[0], pair[1]]))];
        }
        match spread {
            NoiseSpread::Constant(spread) => {
                for ((to, g), draw) in codes.iter_mut().zip(grey).zip(&self.draws) {
                    *to = code(g + *spread * draw);
                }
            }
            NoiseSpread::ByCode(spread) => {
                // A loop for each, so that what the machine can do for many pixels at once does not wait for the looking up.
                for (to, g) in codes.iter_mut().zip(grey) {
                    *to = code(*g);
                }
                for (draw, without) in self.draws.iter_mut().zip(&*codes) {
                    *draw *= spread[usize::from(*without)];
                }
                for ((to, g), draw) in codes.iter_mut().zip(grey).zip(&self.draws) {
                    *to = code(g + draw);
                }
            }
        }
    }
}

/// The code value of a grey: rounded half up, from 0 to 255.
fn code(grey: f32) -> u8 {
    // `(grey + 0.5) as u8` is the same and is done for one pixel at a time, this for as many as the machine can: a sum with 2²³ has
    // the whole number nearest to its other part in its last bits.
    const WHOLE: f32 = 8_388_608.0;
    let raised = (grey + 0.5).clamp(0.0, 255.0);
    let nearest = raised + WHOLE;
    let is_above = nearest - WHOLE > raised;
    (nearest.to_bits() - u32::from(is_above)) as u8
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
#[cfg(test)]
mod slow_reference;
