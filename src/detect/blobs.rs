//! What moves in a frame: connected groups of blocks that differ from the background, cut out with a margin.

use super::background::{Background, BlockChanges};
use super::centre::disc::Disc;
use super::crop::Crop;
use super::registration::Registration;
use super::scene_grey::behind;
use crate::frames::Luma;
use crate::geometry::PixelPoint;
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual};
use opencv::imgproc;

/// A connected region that differs from the background.
#[derive(Debug, Clone)]
pub struct Blob {
    /// Centroid of the pixels that differ, in the frame.
    pub centroid: PixelPoint,
    /// Number of pixels that differ.
    pub area_px: f64,
    /// Of these, the number that are brighter than the background.
    pub brighter_px: f64,
    /// Standard deviations of the pixels that differ along their long and short axis, px.
    pub spread_px: (f64, f64),
    /// Direction of the long axis, rad from u towards v.
    pub direction_rad: f64,
    /// Typical difference from the background, grey levels, with its sign.
    pub contrast_grey: f64,
    /// The region with a margin.
    pub crop: Crop,
    /// Whether the region reaches the frame's border.
    pub at_border: bool,
}

/// A blob longer than wide by more than this is no smeared ball but a thing.
const LONGEST_OVAL: f64 = 4.0;

/// Area of an oval blob over that of the ellipse with its spreads: 1 for an ellipse, 0.95 for a long capsule.
const OVAL_FILL: (f64, f64) = (0.88, 1.1);

/// Fewer pixels than this have no shape.
const LEAST_OVAL_AREA_PX: f64 = 20.0;

impl Blob {
    /// The region as a disc smeared by its motion; `None` where it is no full oval inside the frame.
    ///
    /// Along a path of length L, pixels above 0.3 of the full change reach as far as R + 0.2 L, across it as far as R.
    #[must_use]
    pub fn oval(&self) -> Option<Disc> {
        let (long, short) = self.spread_px;
        // An ellipse's half axes are twice its standard deviations.
        let fill = self.area_px / (4.0 * std::f64::consts::PI * long * short);
        let full = long < LONGEST_OVAL * short
            && (OVAL_FILL.0..OVAL_FILL.1).contains(&fill)
            && self.area_px > LEAST_OVAL_AREA_PX
            && !self.at_border;
        let length = (10.0 * (long - short)).min(6.0 * short);
        let (s, c) = self.direction_rad.sin_cos();
        full.then_some(Disc {
            centre: self.centroid,
            radius_px: 2.0 * short,
            swept_px: [length * c, length * s],
            bent_px: [0.0; 2],
        })
    }
}

/// A part of a blob is at least this part of it, and so large: of fewer pixels nobody can say that they are round.
const LEAST_PART: f64 = 0.1;
const LEAST_PART_AREA_PX: f64 = 40.0;

/// What a blob may consist of.
#[derive(Debug, Clone)]
pub struct BlobPart {
    /// The part as a blob of its own.
    pub blob: Blob,
    /// The middles of its pixels in the frame.
    pub pixels: Vec<PixelPoint>,
}

impl BlobPart {
    /// The part of its pixels that lie within a `circle` (which is not swept), or less than `margin_px` beyond its edge.
    #[must_use]
    pub fn within(&self, circle: &Disc, margin_px: f64) -> f64 {
        let inside = |p: &&PixelPoint| circle.centre.distance_px(**p) < circle.radius_px + margin_px;
        self.pixels.iter().filter(inside).count() as f64 / self.pixels.len().max(1) as f64
    }

    /// Whether it fills a `circle`, which is not swept.
    #[must_use]
    pub fn fills(&self, circle: &Disc) -> bool {
        let area_px2 = std::f64::consts::PI * circle.radius_px * circle.radius_px;
        self.within(circle, 0.0) * self.pixels.len() as f64 > LEAST_FILL * area_px2
    }
}

/// What fills less than this part of a disc is none.
const LEAST_FILL: f64 = 0.75;

impl Blob {
    /// What is brighter in this blob than the scene, and what is darker, where it has much of both.
    #[must_use]
    pub fn bright_and_dark(
        &self,
        background: &Background,
        registration: &Registration,
    ) -> Option<[BlobPart; 2]> {
        let least = (LEAST_PART * self.area_px).max(LEAST_PART_AREA_PX);
        if self.brighter_px.min(self.area_px - self.brighter_px) < least {
            return None;
        }
        let changes = pixel_changes(background, registration, &self.crop);
        let threshold = change_threshold(&changes, background.noise_grey);
        let part = |sign: f32| self.part(&changes, threshold, sign);
        Some([part(1.0)?, part(-1.0)?])
    }

    /// The pixels of this blob whose `changes` have a `sign`.
    fn part(&self, changes: &[f32], threshold: f32, sign: f32) -> Option<BlobPart> {
        let width = self.crop.luma.width;
        let of_sign = changes.iter().map(|c| if sign * c > 0.0 { *c } else { 0.0 });
        let changes: Vec<f32> = of_sign.collect();
        let differ = (0..changes.len()).filter(|&i| changes[i].abs() > threshold);
        let place = |i: usize| (self.crop.u + i % width, self.crop.v + i / width);
        let middle = |(u, v): (usize, usize)| PixelPoint::new(u as f64, v as f64);
        let corner = (self.crop.u as f64, self.crop.v as f64);
        let moments = Moments::of(&changes, width, threshold)?;
        Some(BlobPart {
            // With all pixels of the whole: a fit looks beyond the part's own.
            blob: Self::of(&moments, corner, self.crop.clone(), self.at_border),
            pixels: differ.map(|i| middle(place(i))).collect(),
        })
    }

    /// The blob of `moments` in the picture whose corner is at `(u, v)`.
    fn of(moments: &Moments, (u, v): (f64, f64), crop: Crop, at_border: bool) -> Self {
        Self {
            centroid: PixelPoint::new(u + moments.u, v + moments.v),
            area_px: moments.area,
            brighter_px: moments.brighter,
            spread_px: moments.spread,
            direction_rad: moments.direction_rad,
            contrast_grey: moments.contrast,
            crop,
            at_border,
        }
    }
}

/// The change that a pixel of a blob has at least: a part of that of its strongest ones.
fn change_threshold(changes: &[f32], noise_grey: f64) -> f32 {
    let mut magnitudes: Vec<f32> = changes.iter().map(|c| c.abs()).collect();
    let strong_index = magnitudes.len() - 1 - magnitudes.len() / 20;
    let strong = f64::from(*magnitudes.select_nth_unstable_by(strong_index, f32::total_cmp).1);
    (0.3 * strong).max(3.0 * noise_grey) as f32
}

/// Blobs larger than this part of the picture's width or height are not a ball; half the picture is the largest
/// ball there is.
const LARGEST_PART: f64 = 0.75;

/// Margin around a blob's blocks, px: the outer half of a blurred edge and the background beyond it.
const MARGIN_PX: usize = 10;

/// At most this many blobs a frame, the strongest first: a picture that moves as a whole has no ball to find.
const MOST_BLOBS: usize = 24;

/// The blobs of `frame`, the largest summed change first.
///
/// `changes` are the block changes by [`Background::block_changes`].
#[must_use]
pub fn find(
    background: &Background,
    frame: &Luma,
    registration: &Registration,
    changes: &BlockChanges<'_>,
) -> Vec<Blob> {
    let (columns, rows) = background.blocks;
    let thresholds = &background.block_threshold_grey;
    let moving = changes
        .grey()
        .zip(thresholds)
        .map(|(c, &t)| if c.abs() > t { 255 } else { 0 });
    let mask: Vec<u8> = moving.collect();
    let mut boxes = components(&mask, columns, rows, changes);
    boxes.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    boxes.truncate(MOST_BLOBS);
    boxes
        .iter()
        .filter_map(|b| outline(background, frame, registration, b))
        .collect()
}

/// A component's bounding box in blocks, half-open, and the sum of its changes.
#[derive(Debug, Clone, Copy)]
struct BlockBox {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
    strength: f32,
}

/// The smallest range of columns and rows, with a margin for the closing, that holds all of `mask`.
fn moving_part(mask: &[u8], columns: usize, rows: usize) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    const MARGIN: usize = 2;
    let (mut left, mut right, mut top, mut bottom) = (columns, 0, rows, 0);
    for (y, line) in mask.chunks_exact(columns).enumerate() {
        // Most lines are empty, which the compiler sees many bytes at a time.
        if line.iter().fold(0, |any, &m| any | m) == 0 {
            continue;
        }
        if let Some(first) = line.iter().position(|&m| m != 0) {
            let last = line.iter().rposition(|&m| m != 0).unwrap_or(first);
            left = left.min(first);
            right = right.max(last + 1);
            top = top.min(y);
            bottom = y + 1;
        }
    }
    (
        left.saturating_sub(MARGIN)..(right + MARGIN).min(columns),
        top.saturating_sub(MARGIN)..(bottom + MARGIN).min(rows),
    )
}

/// The connected parts of `mask`, as boxes of the whole picture.
fn components(mask: &[u8], columns: usize, rows: usize, changes: &BlockChanges<'_>) -> Vec<BlockBox> {
    let (xs, ys) = moving_part(mask, columns, rows);
    if xs.is_empty() || ys.is_empty() {
        return Vec::new();
    }
    let part: Vec<u8> = ys
        .clone()
        .flat_map(|y| &mask[y * columns + xs.start..y * columns + xs.end])
        .copied()
        .collect();
    // Closing by one block joins the parts of a ball that a stripe of background grey splits.
    let joined = || -> opencv::Result<(Mat, i32)> {
        let flat = Mat::from_slice(&part)?;
        let mat = flat.reshape(1, i32::try_from(ys.len()).unwrap_or(i32::MAX))?;
        let kernel = imgproc::get_structuring_element(
            imgproc::MORPH_RECT,
            opencv::core::Size::new(3, 3),
            opencv::core::Point::new(-1, -1),
        )?;
        let mut closed = Mat::default();
        imgproc::morphology_ex(
            &mat,
            &mut closed,
            imgproc::MORPH_CLOSE,
            &kernel,
            opencv::core::Point::new(-1, -1),
            1,
            opencv::core::BORDER_CONSTANT,
            imgproc::morphology_default_border_value()?,
        )?;
        let mut labels = Mat::default();
        let count = imgproc::connected_components(&closed, &mut labels, 8, opencv::core::CV_32S)?;
        Ok((labels, count))
    };
    let Ok((labels, count)) = joined() else {
        return Vec::new();
    };
    let Ok(labels) = labels.data_typed::<i32>() else {
        return Vec::new();
    };
    let empty = BlockBox {
        left: usize::MAX,
        top: usize::MAX,
        right: 0,
        bottom: 0,
        strength: 0.0,
    };
    let mut boxes = vec![empty; usize::try_from(count).unwrap_or(0)];
    for (i, &label) in labels.iter().enumerate() {
        if label > 0 {
            let b = &mut boxes[label as usize];
            let (x, y) = (xs.start + i % xs.len(), ys.start + i / xs.len());
            b.left = b.left.min(x);
            b.right = b.right.max(x + 1);
            b.top = b.top.min(y);
            b.bottom = b.bottom.max(y + 1);
            b.strength += changes.grey_of(y * columns + x).abs();
        }
    }
    boxes.retain(|b| b.right > b.left && b.bottom > b.top);
    boxes
}

/// The blob of a box: its pixels that differ, their moments, and the cut-out.
fn outline(background: &Background, frame: &Luma, registration: &Registration, b: &BlockBox) -> Option<Blob> {
    let side = background.block_px;
    let too_wide = (b.right - b.left) as f64 * side as f64 > LARGEST_PART * frame.width as f64;
    let too_high = (b.bottom - b.top) as f64 * side as f64 > LARGEST_PART * frame.height as f64;
    if too_wide || too_high {
        return None;
    }
    let reach = |low: usize, high: usize, n: usize| {
        (low * side).saturating_sub(MARGIN_PX)..(high * side + MARGIN_PX).min(n)
    };
    let crop = Crop::of(
        frame,
        reach(b.left, b.right, frame.width),
        reach(b.top, b.bottom, frame.height),
    );
    let changes = pixel_changes(background, registration, &crop);
    let threshold = change_threshold(&changes, background.noise_grey);
    let moments = Moments::of(&changes, crop.luma.width, threshold)?;
    let at_border = b.left == 0
        || b.top == 0
        || b.right * side + side > frame.width
        || b.bottom * side + side > frame.height;
    let corner = (crop.u as f64, crop.v as f64);
    Some(Blob::of(&moments, corner, crop, at_border))
}

/// Differences of a crop's pixels from the background as `registration` sees it, grey levels, row by row.
#[must_use]
pub fn pixel_changes(background: &Background, registration: &Registration, crop: &Crop) -> Vec<f32> {
    behind(&background.luma.data, background.luma.width, registration, crop)
        .iter()
        .zip(&crop.luma.data)
        .map(|(&b, &i)| f32::from(i) - b)
        .collect()
}

struct Moments {
    u: f64,
    v: f64,
    area: f64,
    brighter: f64,
    spread: (f64, f64),
    direction_rad: f64,
    contrast: f64,
}

impl Moments {
    /// Moments of the pixels whose change exceeds `threshold`; `None` when there are fewer than four.
    fn of(changes: &[f32], width: usize, threshold: f32) -> Option<Self> {
        let (mut n, mut su, mut sv, mut suu, mut suv, mut svv, mut sc) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let mut brighter = 0.0;
        for (i, &c) in changes.iter().enumerate() {
            if c.abs() > threshold {
                let (u, v) = ((i % width) as f64, (i / width) as f64);
                n += 1.0;
                su += u;
                sv += v;
                suu += u * u;
                suv += u * v;
                svv += v * v;
                sc += f64::from(c);
                brighter += f64::from(u8::from(c > 0.0));
            }
        }
        if n < 4.0 {
            return None;
        }
        let (u, v) = (su / n, sv / n);
        // 1/12 is the variance of a pixel's own square.
        let (cuu, cvv) = (suu / n - u * u + 1.0 / 12.0, svv / n - v * v + 1.0 / 12.0);
        let cuv = suv / n - u * v;
        let mean = 0.5 * (cuu + cvv);
        let half = (0.5 * (cuu - cvv)).hypot(cuv);
        Some(Self {
            u,
            v,
            area: n,
            brighter,
            spread: ((mean + half).sqrt(), (mean - half).max(1.0 / 12.0).sqrt()),
            direction_rad: 0.5 * (2.0 * cuv).atan2(cuu - cvv),
            contrast: sc / n,
        })
    }
}
