//! `<name>.marks.png`: a frame with the marks of a calibration drawn in, so that the user sees what was meant.
//!
//! OpenCV draws and encodes; its types do not leave this file.

use crate::frames::Luma;
use crate::geometry::PixelPoint;
use opencv::core::{Mat, MatTraitConst as _, MatTraitConstManual as _, Point, Scalar, Size};
use opencv::imgproc;

/// Frames smaller than this are enlarged by a whole factor, px: marks need room.
const LEAST_SIDE_PX: usize = 900;
/// Fractional bits of OpenCV's coordinates.
const SHIFT: i32 = 4;

/// A colour that shows on grey.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MarkColour {
    /// The ruler.
    Orange,
    /// The floor, and "up".
    Green,
    /// The launch edge, and x.
    Blue,
    /// Corners of a board.
    Red,
    /// Where a mark was before it was moved.
    White,
}

impl MarkColour {
    fn bgr(self) -> Scalar {
        let [b, g, r] = match self {
            Self::Orange => [0, 176, 255],
            Self::Green => [110, 220, 90],
            Self::Blue => [255, 170, 60],
            Self::Red => [60, 60, 240],
            Self::White => [255, 255, 255],
        };
        Scalar::new(f64::from(b), f64::from(g), f64::from(r), 0.0)
    }
}

/// What is drawn, in pixels of the frame.
#[derive(Debug, Clone, PartialEq)]
pub enum MarkShape {
    /// A line through points; those that are nowhere are left out.
    Line {
        /// The points.
        points: Vec<PixelPoint>,
        /// Its colour.
        ink: MarkColour,
        /// Thinner and broken off nowhere: a line of a grid.
        fine: bool,
    },
    /// An arrow.
    Arrow {
        /// Its foot.
        from: PixelPoint,
        /// Its head.
        to: PixelPoint,
        /// Its colour.
        ink: MarkColour,
    },
    /// A small cross.
    Cross {
        /// Where.
        at: PixelPoint,
        /// Its colour.
        ink: MarkColour,
    },
    /// A ring around a point, which stays free.
    Ring {
        /// Where.
        at: PixelPoint,
        /// Its colour.
        ink: MarkColour,
    },
    /// A word beside a point.
    Label {
        /// The point.
        at: PixelPoint,
        /// The word; plain ASCII, as OpenCV has no other letters.
        text: String,
        /// Its colour.
        ink: MarkColour,
    },
}

/// The frame (full range) with `shapes` drawn over it, as PNG.
///
/// # Errors
/// What OpenCV says.
pub fn marks_png(frame: &Luma, shapes: &[MarkShape]) -> opencv::Result<Vec<u8>> {
    let mut canvas = Canvas::new(frame)?;
    for shape in shapes {
        canvas.draw(shape)?;
    }
    canvas.png()
}

struct Canvas {
    picture: Mat,
    /// Pixels of the canvas a pixel of the frame.
    factor: usize,
    /// Stroke, px of the canvas.
    stroke: i32,
}

impl Canvas {
    /// The picture as PNG.
    fn png(&self) -> opencv::Result<Vec<u8>> {
        let mut pixels = Mat::default();
        imgproc::cvt_color_def(&self.picture, &mut pixels, imgproc::COLOR_BGR2RGB)?;
        let sides = [pixels.cols(), pixels.rows()].map(i32::unsigned_abs);
        let data = pixels.data_bytes()?;
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, sides[0], sides[1]);
        encoder.set_color(png::ColorType::Rgb);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(data)?;
            writer.finish()
        });
        written.map_err(|e| opencv::Error::new(opencv::core::StsError, e.to_string()))?;
        Ok(png)
    }

    fn new(frame: &Luma) -> opencv::Result<Self> {
        let flat = Mat::from_slice(&frame.data)?;
        let grey = flat.reshape(1, i32::try_from(frame.height).unwrap_or(i32::MAX))?;
        let side = frame.width.max(frame.height).max(1);
        let factor = LEAST_SIDE_PX.div_ceil(side).min(4);
        let mut large = Mat::default();
        let times = factor as f64;
        imgproc::resize(
            &grey,
            &mut large,
            Size::default(),
            times,
            times,
            imgproc::INTER_NEAREST,
        )?;
        let mut picture = Mat::default();
        imgproc::cvt_color_def(&large, &mut picture, imgproc::COLOR_GRAY2BGR)?;
        Ok(Self {
            picture,
            factor,
            stroke: 1 + (side * factor / 900) as i32,
        })
    }

    /// In OpenCV's fixed point. What is far outside comes to lie at the rim of what fits.
    fn place(&self, p: PixelPoint) -> Point {
        let f = self.factor as f64;
        let fixed = |x: f64| (((x + 0.5) * f - 0.5) * f64::from(1 << SHIFT)).clamp(-1e6, 1e6) as i32;
        Point::new(fixed(p.u_px), fixed(p.v_px))
    }

    fn line(&mut self, places: &[Point], ink: MarkColour, thick: i32) -> opencv::Result<()> {
        // Dark beneath, so that it shows on bright ground too.
        for (colour, thick) in [(Scalar::all(20.0), thick + 2), (ink.bgr(), thick)] {
            for pair in places.windows(2) {
                imgproc::line(
                    &mut self.picture,
                    pair[0],
                    pair[1],
                    colour,
                    thick,
                    imgproc::LINE_AA,
                    SHIFT,
                )?;
            }
        }
        Ok(())
    }

    fn draw(&mut self, shape: &MarkShape) -> opencv::Result<()> {
        match shape {
            MarkShape::Line { points, ink, fine } => {
                let thick = if *fine { 1 } else { self.stroke };
                let places: Vec<Point> = points.iter().map(|p| self.place(*p)).collect();
                self.line(&places, *ink, thick)
            }
            MarkShape::Arrow { from, to, ink } => {
                let (a, b) = (self.place(*from), self.place(*to));
                self.line(&[a, b], *ink, self.stroke)?;
                let (dx, dy) = (f64::from(b.x - a.x), f64::from(b.y - a.y));
                let length = dx.hypot(dy).max(1.0);
                let head = f64::from((8 * self.stroke) << SHIFT);
                for side in [-1.0, 1.0] {
                    let (along, across) = (head / length, 0.5 * side * head / length);
                    let end = Point::new(
                        b.x - (along * dx - across * dy) as i32,
                        b.y - (along * dy + across * dx) as i32,
                    );
                    self.line(&[b, end], *ink, self.stroke)?;
                }
                Ok(())
            }
            MarkShape::Cross { at, ink } => {
                let (p, arm) = (self.place(*at), (3 * self.stroke) << SHIFT);
                let (a, b) = (Point::new(p.x - arm, p.y - arm), Point::new(p.x + arm, p.y + arm));
                self.line(&[a, b], *ink, 1)?;
                let (a, b) = (Point::new(p.x - arm, p.y + arm), Point::new(p.x + arm, p.y - arm));
                self.line(&[a, b], *ink, 1)
            }
            MarkShape::Ring { at, ink } => {
                let (p, radius) = (self.place(*at), (7 * self.stroke) << SHIFT);
                for (colour, thick) in [(Scalar::all(20.0), self.stroke + 2), (ink.bgr(), self.stroke)] {
                    imgproc::circle(
                        &mut self.picture,
                        p,
                        radius,
                        colour,
                        thick,
                        imgproc::LINE_AA,
                        SHIFT,
                    )?;
                }
                Ok(())
            }
            MarkShape::Label { at, text, ink } => self.label(*at, text, *ink),
        }
    }

    fn label(&mut self, at: PixelPoint, text: &str, ink: MarkColour) -> opencv::Result<()> {
        let size = 0.5 * f64::from(self.stroke);
        let font = imgproc::FONT_HERSHEY_SIMPLEX;
        let mut base = 0;
        let room = imgproc::get_text_size(text, font, size, self.stroke, &mut base)?;
        let p = self.place(at);
        let gap = 10 * self.stroke;
        // Beside the point, but inside the picture.
        let (right, bottom) = (
            self.picture.cols() - room.width - 4,
            self.picture.rows() - base - 4,
        );
        let mut x = (p.x >> SHIFT) + gap;
        if x > right {
            x = (p.x >> SHIFT) - gap - room.width;
        }
        let y = ((p.y >> SHIFT) - gap).clamp(room.height + 4, bottom.max(room.height + 4));
        let place = Point::new(x.clamp(4, right.max(4)), y);
        for (colour, thick) in [(Scalar::all(20.0), self.stroke + 3), (ink.bgr(), self.stroke)] {
            imgproc::put_text(
                &mut self.picture,
                text,
                place,
                font,
                size,
                colour,
                thick,
                imgproc::LINE_AA,
                false,
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_anywhere_make_a_picture() {
        let frame = Luma {
            width: 320,
            height: 240,
            data: vec![90; 320 * 240],
        };
        let p = PixelPoint::new;
        let shapes = [
            MarkShape::Line {
                points: vec![p(-1e9, 20.0), p(300.0, 1e12), p(f64::NAN, 3.0)],
                ink: MarkColour::Green,
                fine: false,
            },
            MarkShape::Arrow {
                from: p(10.0, 10.0),
                to: p(10.0, 10.0),
                ink: MarkColour::Blue,
            },
            MarkShape::Cross {
                at: p(500.0, -3.0),
                ink: MarkColour::Red,
            },
            MarkShape::Ring {
                at: p(100.0, 100.0),
                ink: MarkColour::Orange,
            },
            MarkShape::Label {
                at: p(319.0, 239.0),
                text: "launch edge".into(),
                ink: MarkColour::White,
            },
        ];
        let png = marks_png(&frame, &shapes).unwrap();
        assert_eq!(&png[1..4], b"PNG");
        // Enlarged three times, and something was drawn.
        assert_eq!(&png[16..24], &[0, 0, 3, 192, 0, 0, 2, 208]);
        assert!(png.len() > marks_png(&frame, &[]).unwrap().len());
    }
}
