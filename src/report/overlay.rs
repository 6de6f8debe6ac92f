//! What is drawn into each frame of the overlay video: the ball's outline with a cross at its centre, the centres so far,
//! the fitted arcs faintly, and a tick under each impact once it has happened.
//!
//! Everything is drawn anti-aliased straight into the planes of a 4:2:0 picture. A ball in use has a closed outline, one
//! that is not in use a broken one: the difference survives grey video.
//!
//! OpenCV's `line` and `circle` are not used: their strokes are whole pixels wide, where these are 1.4 px and 2.2 times that;
//! they have no opacity, so that a faint line made of pieces would have dark joints; and they fill a plane of full
//! resolution, of which the chroma planes of 4:2:0 would have to be made once more for every shape of every frame.

use super::drawing_geometry;
use crate::frames::{Yuv420, drawn_smaller};
use crate::geometry::PixelPoint;
use crate::pipeline::{Measurement, PointUse, TrackPoint, View};
use std::collections::BTreeMap;

/// At most this many past centres are shown, so that a long clip costs no more a frame than a short one.
const TRAIL: usize = 600;

/// Length of an arm of the cross that turns with the ball, radii.
const TURNED_ARM: f64 = 0.85;

/// A colour of the video.
#[derive(Debug, Clone, Copy)]
struct YuvColour {
    y: f64,
    u: f64,
    v: f64,
}

// By BT.601; in another matrix or range the hue shifts a little, which does no harm here.
const USED: YuvColour = YuvColour {
    y: 159.0,
    u: 105.0,
    v: 61.0,
}; // green
const UNUSED: YuvColour = YuvColour {
    y: 160.0,
    u: 60.0,
    v: 183.0,
}; // orange
const PAST: YuvColour = YuvColour {
    y: 205.0,
    u: 58.0,
    v: 150.0,
}; // yellow
const ARC: YuvColour = YuvColour {
    y: 190.0,
    u: 160.0,
    v: 100.0,
}; // light blue
const IMPACT: YuvColour = YuvColour {
    y: 124.0,
    u: 101.0,
    v: 209.0,
}; // red
const SHADE: YuvColour = YuvColour {
    y: 16.0,
    u: 128.0,
    v: 128.0,
}; // black, under what must show on a bright ground

/// The drawing for one recording, made ready once and then laid into frame after frame.
#[derive(Debug, Clone)]
pub struct Overlay {
    /// In the order of frames.
    balls: Vec<DrawnBall>,
    radius_px: f64,
    /// Stroke of a line, px.
    stroke_px: f64,
    arcs: CoverageMask,
    /// The frame from which on an impact is shown, and where.
    impacts: Vec<(usize, PixelPoint)>,
}

/// A picture so many times smaller than the recording's, along each side.
#[derive(Debug, Clone, Copy)]
struct Smaller(f64);

impl Smaller {
    fn length(self, px: f64) -> f64 {
        px / self.0
    }

    /// Pixels' centres have whole numbers: the middle of four is 1.5.
    fn place(self, p: PixelPoint) -> PixelPoint {
        let along = |px: f64| (px - 0.5 * (self.0 - 1.0)) / self.0;
        PixelPoint::new(along(p.u_px), along(p.v_px))
    }
}

#[derive(Debug, Clone, Copy)]
struct DrawnBall {
    frame: usize,
    centre: PixelPoint,
    used: bool,
    /// Two arms that turn with the ball, radii; of a ball without seen marks there are none.
    turned: Option<[[f64; 2]; 2]>,
}

impl Overlay {
    /// Prepares the drawing of a measurement. One without a track leaves every frame as it is.
    #[must_use]
    pub fn new(measurement: &Measurement) -> Self {
        let video = &measurement.video;
        let smaller = Smaller(drawn_smaller((video.width_px, video.height_px)) as f64);
        let side_px = smaller.length(video.width_px.max(video.height_px) as f64);
        let stroke_px = (side_px / 1280.0).max(1.0) * 1.4;
        let radius_px = measurement
            .track
            .radius_px
            .map(|radius| smaller.length(radius.value))
            .filter(|radius| radius.is_finite() && *radius > 0.0)
            .unwrap_or(5.0 * stroke_px);
        let mut arcs = CoverageMask::default();
        let drawn = measurement.each_launch().iter().flat_map(|launch| &launch.arcs);
        for pair in drawn.flat_map(|arc| arc.samples.windows(2)) {
            arcs.line(
                smaller.place(pair[0].pixel),
                smaller.place(pair[1].pixel),
                stroke_px,
            );
        }
        Self {
            balls: balls(measurement, smaller),
            radius_px,
            stroke_px,
            arcs,
            impacts: impacts(measurement, smaller, radius_px),
        }
    }

    /// Draws into frame number `frame` (in presentation order, from 0).
    pub fn draw(&self, frame: usize, picture: &mut Yuv420) {
        self.arcs.lay(picture, ARC, 0.45);
        self.draw_impacts(frame, picture);
        let next = self.balls.partition_point(|ball| ball.frame <= frame);
        let mut trail = CoverageMask::default();
        for ball in &self.balls[next.saturating_sub(TRAIL)..next] {
            trail.disc(ball.centre, 0.9 * self.stroke_px);
        }
        trail.lay(picture, PAST, 0.8);
        if let Some(ball) = self.balls[..next].last().filter(|ball| ball.frame == frame) {
            self.draw_ball(*ball, picture);
        }
    }

    fn draw_ball(&self, ball: DrawnBall, picture: &mut Yuv420) {
        let ink = if ball.used { USED } else { UNUSED };
        let short = (0.4 * self.radius_px).clamp(2.0 * self.stroke_px, 6.0 * self.stroke_px);
        let PixelPoint { u_px, v_px } = ball.centre;
        // A cross that turns with the ball, where its marks tell how.
        let long = |arm: [f64; 2]| arm.map(|part| TURNED_ARM * self.radius_px * part);
        let arms = ball
            .turned
            .map_or([[short, 0.0], [0.0, short]], |arms| arms.map(long));
        // First wider in black, so that it shows on a bright ball or wall, too.
        for (ink, stroke, opacity) in [(SHADE, 2.2 * self.stroke_px, 0.45), (ink, self.stroke_px, 1.0)] {
            let mut lines = CoverageMask::default();
            lines.circle(ball.centre, self.radius_px, stroke, !ball.used);
            for [du, dv] in arms {
                lines.line(
                    PixelPoint::new(u_px - du, v_px - dv),
                    PixelPoint::new(u_px + du, v_px + dv),
                    stroke,
                );
            }
            lines.lay(picture, ink, opacity);
        }
    }

    fn draw_impacts(&self, frame: usize, picture: &mut Yuv420) {
        let half = 0.9 * self.radius_px + 3.0 * self.stroke_px;
        let happened = || self.impacts.iter().filter(|(from, _)| *from <= frame);
        for (ink, stroke, opacity) in [
            (SHADE, 3.2 * self.stroke_px, 0.45),
            (IMPACT, 1.6 * self.stroke_px, 1.0),
        ] {
            let mut ticks = CoverageMask::default();
            for (_, PixelPoint { u_px, v_px }) in happened() {
                ticks.line(
                    PixelPoint::new(u_px - half, *v_px),
                    PixelPoint::new(u_px + half, *v_px),
                    stroke,
                );
            }
            ticks.lay(picture, ink, opacity);
        }
    }
}

/// The centres with finite places, in the order of frames.
fn balls(measurement: &Measurement, smaller: Smaller) -> Vec<DrawnBall> {
    let points = measurement
        .each_launch()
        .iter()
        .flat_map(|launch| launch.track.points.iter().map(move |point| (launch, point)));
    let mut balls: Vec<DrawnBall> = points
        .filter(|(_, point)| point.pixel.u_px.is_finite() && point.pixel.v_px.is_finite())
        .map(|(launch, point)| DrawnBall {
            frame: point.frame,
            centre: smaller.place(point.pixel),
            used: matches!(point.use_, PointUse::Used(_)),
            turned: turned(launch, point),
        })
        .collect();
    balls.sort_by_key(|ball| ball.frame);
    balls
}

/// Two arms square to the axis of rotation as a point's frame has them, radii.
fn turned(launch: &Measurement, point: &TrackPoint) -> Option<[[f64; 2]; 2]> {
    let PointUse::Used(arc) = point.use_ else {
        return None;
    };
    let turning = launch.arcs.get(arc)?.spin.as_ref()?.turning.as_ref()?;
    let turn = turning.turn_at(point.time_s);
    let [one, two, _] = turning.ball_axes().map(|axis| turn * axis);
    Some([[one.x, one.y], [two.x, two.y]])
}

/// Where the ball touched: at the lowest place of its outline in a side view, at its centre in a top view. From the first
/// frame after the impact in which the ball was seen.
fn impacts(measurement: &Measurement, smaller: Smaller, radius_px: f64) -> Vec<(usize, PixelPoint)> {
    let below = match measurement.view {
        View::Side => radius_px,
        View::Top => 0.0,
    };
    let of_launch = |launch: &Measurement| {
        let points = &launch.track.points;
        let shown = |mark: &drawing_geometry::ImpactMark| {
            let centre = smaller.place(mark.centre?);
            let frame = points.iter().find(|point| point.time_s >= mark.time_s)?.frame;
            Some((frame, PixelPoint::new(centre.u_px, centre.v_px + below)))
        };
        drawing_geometry::impacts(launch)
            .iter()
            .filter_map(shown)
            .collect::<Vec<_>>()
    };
    measurement.each_launch().iter().flat_map(of_launch).collect()
}

/// How much of each pixel is covered, for the 2 × 2 pixels that share a chroma sample: (0, 0), (1, 0), (0, 1), (1, 1).
///
/// Shapes that overlap in one stencil count once, so that a faint line has no dark joints.
#[derive(Debug, Clone, Default)]
struct CoverageMask {
    /// By row and column of the chroma sample.
    blocks: BTreeMap<(usize, usize), [f32; 4]>,
}

/// Beyond any picture: keeps a wild coordinate from asking for endless pixels.
const FAR_PX: f64 = 1e5;

impl CoverageMask {
    fn disc(&mut self, centre: PixelPoint, radius_px: f64) {
        self.add(centre, centre, radius_px, |u, v| {
            radius_px - (u - centre.u_px).hypot(v - centre.v_px)
        });
    }

    fn line(&mut self, from: PixelPoint, to: PixelPoint, stroke_px: f64) {
        let (du, dv) = (to.u_px - from.u_px, to.v_px - from.v_px);
        let length_squared = du * du + dv * dv;
        self.add(from, to, 0.5 * stroke_px, |u, v| {
            let along = (u - from.u_px) * du + (v - from.v_px) * dv;
            let share = if length_squared > 0.0 {
                (along / length_squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            0.5 * stroke_px - (u - from.u_px - share * du).hypot(v - from.v_px - share * dv)
        });
    }

    fn circle(&mut self, centre: PixelPoint, radius_px: f64, stroke_px: f64, broken: bool) {
        self.add(centre, centre, radius_px + 0.5 * stroke_px, |u, v| {
            let (du, dv) = (u - centre.u_px, v - centre.v_px);
            // Eight dashes around.
            if broken && (dv.atan2(du) * 8.0).sin() < 0.0 {
                return -1.0;
            }
            0.5 * stroke_px - (du.hypot(dv) - radius_px).abs()
        });
    }

    /// A shape within `reach_px` of the box between two points; `inside_px` is how deep a place lies in it, which over a
    /// pixel's width goes from not covered to covered.
    fn add(&mut self, a: PixelPoint, b: PixelPoint, reach_px: f64, inside_px: impl Fn(f64, f64) -> f64) {
        let ends = [a.u_px, a.v_px, b.u_px, b.v_px];
        if !(reach_px < FAR_PX && ends.iter().all(|end| end.abs() < FAR_PX)) {
            return;
        }
        let columns = blocks(a.u_px.min(b.u_px) - reach_px, a.u_px.max(b.u_px) + reach_px);
        let rows = blocks(a.v_px.min(b.v_px) - reach_px, a.v_px.max(b.v_px) + reach_px);
        for row in rows {
            for column in columns.clone() {
                let (u, v) = ((2 * column) as f64, (2 * row) as f64);
                let places = [(u, v), (u + 1.0, v), (u, v + 1.0), (u + 1.0, v + 1.0)];
                let covered = places.map(|(u, v)| (inside_px(u, v) + 0.5).clamp(0.0, 1.0) as f32);
                if covered.iter().any(|c| *c > 0.0) {
                    let block = self.blocks.entry((row, column)).or_default();
                    for (old, new) in block.iter_mut().zip(covered) {
                        *old = old.max(new);
                    }
                }
            }
        }
    }

    /// Blends `ink` into what the stencil covers of the picture.
    fn lay(&self, picture: &mut Yuv420, ink: YuvColour, opacity: f64) {
        let chroma_width = picture.width.div_ceil(2);
        for (&(row, column), block) in &self.blocks {
            if 2 * row >= picture.height || 2 * column >= picture.width {
                continue;
            }
            for (index, covered) in block.iter().enumerate() {
                let (u, v) = (2 * column + index % 2, 2 * row + index / 2);
                if u < picture.width && v < picture.height {
                    blend(
                        picture.y.get_mut(v * picture.width + u),
                        ink.y,
                        opacity * f64::from(*covered),
                    );
                }
            }
            let share = opacity * f64::from(block.iter().sum::<f32>() / 4.0);
            let chroma = row * chroma_width + column;
            blend(picture.u.get_mut(chroma), ink.u, share);
            blend(picture.v.get_mut(chroma), ink.v, share);
        }
    }
}

/// The blocks of two pixels that a stretch touches, from the picture's border on.
fn blocks(low_px: f64, high_px: f64) -> std::ops::Range<usize> {
    // One pixel more at each end for the soft edge. A negative number becomes 0.
    let first = ((low_px - 1.0) / 2.0).floor().max(0.0) as usize;
    let end = ((high_px + 1.0) / 2.0).floor() + 1.0;
    first..end.max(0.0) as usize
}

fn blend(sample: Option<&mut u8>, ink: f64, share: f64) {
    if let Some(sample) = sample {
        *sample = (f64::from(*sample) * (1.0 - share) + ink * share).round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn grey(width: usize, height: usize) -> Yuv420 {
        let chroma = width.div_ceil(2) * height.div_ceil(2);
        Yuv420 {
            width,
            height,
            y: vec![80; width * height],
            u: vec![128; chroma],
            v: vec![128; chroma],
        }
    }

    fn luma(picture: &Yuv420, u: f64, v: f64) -> u8 {
        picture.y[v.round() as usize * picture.width + u.round() as usize]
    }

    fn red(picture: &Yuv420, u: f64, v: f64) -> u8 {
        picture.v[(v / 2.0) as usize * picture.width.div_ceil(2) + (u / 2.0) as usize]
    }

    #[test]
    fn the_outline_lies_on_the_ball_and_the_cross_at_its_centre() {
        let measurement = test_measurements::two_bounces();
        let overlay = Overlay::new(&measurement);
        let point = &measurement.track.points[40];
        let mut picture = grey(1280, 720);
        overlay.draw(point.frame, &mut picture);
        let (u, v) = (point.pixel.u_px, point.pixel.v_px);
        let radius = measurement.track.radius_px.unwrap().value;
        for angle in 0..16 {
            let (sin, cos) = (f64::from(angle) * std::f64::consts::FRAC_PI_8).sin_cos();
            assert!(
                luma(&picture, u + radius * cos, v + radius * sin) > 110,
                "{angle}"
            );
        }
        assert!(luma(&picture, u, v) > 120);
        // Between cross and outline, away from path and trail, the ball itself stays visible.
        assert_eq!(luma(&picture, u + 0.6 * radius, v - 0.6 * radius), 80);
        assert_eq!(luma(&picture, 1200.0, 50.0), 80);
    }

    #[test]
    fn of_a_very_large_picture_the_outline_lies_on_the_smaller_ball() {
        let mut measurement = test_measurements::two_bounces();
        (measurement.video.width_px, measurement.video.height_px) = (7680, 4320);
        let point = &measurement.track.points[40];
        let mut picture = grey(7680, 4320).reduced(4).unwrap();
        assert_eq!((picture.width, picture.height), (1920, 1080));
        Overlay::new(&measurement).draw(point.frame, &mut picture);
        // The middle of four by four pixels, 0 to 3, is 1.5.
        let [u, v] = [point.pixel.u_px, point.pixel.v_px].map(|px| (px - 1.5) / 4.0);
        let radius = measurement.track.radius_px.unwrap().value / 4.0;
        for [x, y] in [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]] {
            assert!(luma(&picture, u + radius * x, v + radius * y) > 110, "{x} {y}");
        }
        assert_eq!(luma(&picture, 4.0 * u, 4.0 * v), 80);
    }

    #[test]
    fn used_and_unused_differ_in_colour_and_in_shape() {
        let measurement = test_measurements::two_bounces();
        let overlay = Overlay::new(&measurement);
        let draw = |used: bool| {
            let mut picture = grey(200, 200);
            let ball = DrawnBall {
                frame: 0,
                centre: PixelPoint::new(100.0, 100.0),
                used,
                turned: None,
            };
            overlay.draw_ball(ball, &mut picture);
            picture
        };
        let (used, unused) = (draw(true), draw(false));
        assert!(red(&used, 100.0, 100.0) < 110 && red(&unused, 100.0, 100.0) > 145);
        let bright = |p: &Yuv420| p.y.iter().filter(|y| **y > 120).count();
        assert!(bright(&unused) * 10 < bright(&used) * 8);
    }

    #[test]
    fn the_trail_grows_and_impacts_appear_when_they_happen() {
        let measurement = test_measurements::two_bounces();
        let overlay = Overlay::new(&measurement);
        let drawn = |frame: usize| {
            let mut picture = grey(1280, 720);
            overlay.draw(frame, &mut picture);
            picture
        };
        let red_below = |p: &Yuv420| {
            let place = overlay.impacts[0].1;
            red(p, place.u_px, place.v_px)
        };
        let impact = overlay.impacts[0].0;
        assert!(red_below(&drawn(impact - 1)) < 150);
        assert!(red_below(&drawn(impact + 20)) > 180);
        let changed = |p: &Yuv420| p.y.iter().filter(|y| **y != 80).count();
        assert!(changed(&drawn(150)) > changed(&drawn(20)));
    }

    #[test]
    fn a_frame_without_the_ball_shows_the_past_only() {
        let measurement = test_measurements::two_bounces();
        let overlay = Overlay::new(&measurement);
        let mut late = grey(1280, 720);
        overlay.draw(100_000, &mut late);
        assert!(late.y.iter().any(|y| *y != 80));
        let mut untouched = grey(1280, 720);
        Overlay::new(&test_measurements::nothing_seen()).draw(3, &mut untouched);
        assert_eq!(untouched, grey(1280, 720));
    }

    #[test]
    fn borders_odd_sizes_and_wild_places_do_no_harm() {
        let mut measurement = test_measurements::two_bounces();
        let wild = [-20.0, 0.0, 75.0, 76.0, 1e9, f64::NAN, f64::INFINITY, -1e300];
        for (point, place) in measurement.track.points.iter_mut().zip(wild) {
            point.pixel = PixelPoint::new(place, place);
        }
        measurement.arcs[0].samples[3].pixel.u_px = f64::NAN;
        let overlay = Overlay::new(&measurement);
        for frame in 0..wild.len() {
            let mut picture = grey(77, 75);
            overlay.draw(frame, &mut picture);
            let mut broken = grey(77, 75);
            broken.u.clear();
            broken.y.truncate(100);
            overlay.draw(frame, &mut broken);
        }
    }

    #[test]
    fn a_faint_line_has_no_dark_joints() {
        let mut stencil = CoverageMask::default();
        let points: Vec<PixelPoint> = (0..10)
            .map(|i| PixelPoint::new(10.0 + 8.0 * f64::from(i), 20.0))
            .collect();
        for pair in points.windows(2) {
            stencil.line(pair[0], pair[1], 2.0);
        }
        let mut picture = grey(100, 40);
        stencil.lay(&mut picture, ARC, 0.4);
        let row: Vec<u8> = (12..80).map(|u| luma(&picture, f64::from(u), 20.0)).collect();
        assert!(row.iter().all(|y| *y == row[0]), "{row:?}");
    }
}
