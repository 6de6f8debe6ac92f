//! `<name>.review.html`: a page on which a person looks a recording through and says what is wrong: which thing is the ball, which frames not
//! to use, where a centre is, when there is no impact.
//!
//! One file with everything in it: small pictures of the whole frames, the neighbourhood of what moves at full size, style, script; no
//! library, no address. The script saves what was said (schema `track.edits/1`, [`crate::edits`]); `track VIDEO --edits` measures by it.
//!
//! What is kept is bounded (`MOST_STILLS`, `MOST_CROPS`): of a long recording the whole frames are fewer than all, spread evenly, and
//! neighbourhoods are those of the first frames in which something moves.

use super::escape::escape;
use super::jpeg;
use super::page::{STYLE, filled, script_data};
use crate::detect::crop::Crop;
use crate::edits::Edits;
use crate::frames::{FrameColour, Luma};
use crate::geometry::PixelPoint;
use crate::pipeline::LookedThrough;
use base64::Engine as _;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::Path;

const TEMPLATE: &str = include_str!("review_page.html");
const OWN_STYLE: &str = include_str!("review_page.css");
const SCRIPT: &str = include_str!("review_page.js");

/// Pictures of whole frames, at most, their width, px, and the bytes of each.
const MOST_STILLS: usize = 240;
const STILL_WIDTH_PX: usize = 720;
const STILL_BYTES: usize = 36_000;

/// Neighbourhoods, at most, and the bytes of each.
const MOST_CROPS: usize = 2400;
const CROP_BYTES: usize = 12_000;

/// How far a neighbourhood reaches from the centre, in radii; at least and at most, px.
const CROP_RADII: f64 = 3.0;
const CROP_PX: (f64, f64) = (24.0, 80.0);

/// Tracks whose neighbourhoods are kept.
const TRACKS_WITH_CROPS: usize = 3;

/// A ball of unknown size, px.
const UNKNOWN_RADIUS_PX: f64 = 10.0;

/// Frames without a centre between two with one are shown where the ball is between.
const LONGEST_GAP: usize = 30;

/// What a page is about, by its files' names.
#[derive(Debug, Clone, Copy)]
pub struct ReviewNames<'a> {
    /// The recording.
    pub video: &'a str,
    /// The edits that are saved for it.
    pub edits: &'a str,
    /// The command that measures with them.
    pub command: &'a str,
}

/// A result to look at.
#[derive(Debug, Clone, Default)]
pub struct ReviewedResult {
    /// Its `result.json`; `None` where there is none.
    pub result: Option<Value>,
    /// The rows of its `points.csv`.
    pub points: Vec<ReviewedPoint>,
    /// What was said before, where nothing is said in the result.
    pub edits: Option<Edits>,
}

/// A row of `points.csv`.
#[derive(Debug, Clone, PartialEq)]
pub struct ReviewedPoint {
    /// Frame in presentation order, from 0.
    pub frame: usize,
    /// On the time base of the result, s.
    pub time_s: f64,
    /// In that frame's picture.
    pub centre: PixelPoint,
    /// x and z (in a top view y), m.
    pub place_m: Option<[f64; 2]>,
    /// The same of measured less fitted, m.
    pub residual_m: Option<[f64; 2]>,
    /// Whether it was used.
    pub used: bool,
    /// Why not.
    pub reason: String,
}

/// The rows of a `points.csv`, and what its second axis is called; `None` where it is no such table.
#[must_use]
pub fn read_points(text: &[u8]) -> Option<(Vec<ReviewedPoint>, &'static str)> {
    let mut reader = ::csv::Reader::from_reader(text);
    let names = reader.headers().ok()?.clone();
    let column = |name: &str| names.iter().position(|n| n == name);
    let second = if column("y_m").is_some() { "y" } else { "z" };
    let places = ["frame", "time_s", "u_px", "v_px", "used"].map(column);
    let [Some(frame), Some(time), Some(u), Some(v), Some(used)] = places else {
        return None;
    };
    let pair = |row: &::csv::StringRecord, names: [String; 2]| -> Option<[f64; 2]> {
        let number = |name: &String| row.get(column(name)?)?.parse().ok();
        Some([number(&names[0])?, number(&names[1])?])
    };
    let point = |row: ::csv::StringRecord| {
        let number = |i: usize| row.get(i)?.parse::<f64>().ok();
        Some(ReviewedPoint {
            frame: row.get(frame)?.parse().ok()?,
            time_s: number(time)?,
            centre: PixelPoint::new(number(u)?, number(v)?),
            place_m: pair(&row, ["x_m".to_owned(), format!("{second}_m")]),
            residual_m: pair(&row, ["residual_x_m".to_owned(), format!("residual_{second}_m")]),
            used: matches!(row.get(used), Some("1" | "true")),
            reason: column("reason")
                .and_then(|i| row.get(i))
                .unwrap_or_default()
                .to_owned(),
        })
    };
    let rows = reader.into_records().map_while(Result::ok);
    Some((rows.filter_map(point).collect(), second))
}

/// The page in the making: it takes the recording's frames one by one.
#[derive(Debug)]
pub struct ReviewPage {
    looked: LookedThrough,
    reviewed: ReviewedResult,
    second_axis: &'static str,
    radius_px: f64,
    /// Of each frame, the middles of the neighbourhoods that are kept.
    places: Vec<Vec<PixelPoint>>,
    stills: Vec<Value>,
    crops: Vec<Value>,
}

impl ReviewPage {
    /// For a recording that was `looked` through, and its `reviewed` result; `second_axis`: `z`, in a top view `y`.
    #[must_use]
    pub fn new(looked: LookedThrough, reviewed: ReviewedResult, second_axis: &'static str) -> Self {
        let frames = looked.times_s.len();
        let told = reviewed
            .result
            .as_ref()
            .and_then(|r| r.pointer("/track/radius_px/value")?.as_f64());
        let main = looked.moving.first();
        let of_main = looked
            .things
            .iter()
            .filter(|t| t.track.is_some() && t.track.as_ref() == main);
        let mut radii: Vec<f64> = of_main.map(|t| t.radius_px).collect();
        let seen = crate::numeric::robust::median(&mut radii);
        let radius_px = told.or(seen).unwrap_or(UNKNOWN_RADIUS_PX);
        let mut paths: Vec<Vec<(usize, PixelPoint)>> = Vec::new();
        paths.push(reviewed.points.iter().map(|p| (p.frame, p.centre)).collect());
        for track in looked.moving.iter().take(TRACKS_WITH_CROPS) {
            let things = looked.things.iter().filter(|t| t.track == Some(*track));
            paths.push(things.map(|t| (t.frame, t.centre)).collect());
        }
        let mut places = vec![Vec::new(); frames];
        let near = 0.5 * crop_reach_px(radius_px);
        for path in &mut paths {
            path.sort_by_key(|(frame, _)| *frame);
            for (frame, centre) in without_gaps(path) {
                let Some(here): Option<&mut Vec<PixelPoint>> = places.get_mut(frame) else {
                    continue;
                };
                if here.iter().all(|p| p.distance_px(centre) > near) {
                    here.push(centre);
                }
            }
        }
        Self {
            looked,
            reviewed,
            second_axis,
            radius_px,
            places,
            stills: Vec::new(),
            crops: Vec::new(),
        }
    }

    /// Takes the next frame, in its colours where it has some.
    ///
    /// # Errors
    /// OpenCV could not encode it.
    pub fn add(&mut self, frame: usize, luma: &Luma, colour: Option<&FrameColour>) -> opencv::Result<()> {
        let frames = self.places.len().max(1);
        let step = frames.div_ceil(MOST_STILLS);
        let (range, shares) = (self.looked.luma_range, self.looked.luma_shares);
        if frame.is_multiple_of(step) {
            let whole = range.stretched(luma);
            let chroma = colour.map(|c| c.chroma().stretched(range));
            let chroma = chroma.as_ref().map(|c| (c, shares));
            let jpeg = jpeg::jpeg(&whole, chroma, STILL_WIDTH_PX, STILL_BYTES)?;
            self.stills.push(json!({"frame": frame, "jpeg": text(&jpeg)}));
        }
        for place in self.places.get(frame).into_iter().flatten() {
            if self.crops.len() >= MOST_CROPS {
                break;
            }
            let (us, vs) = reach(luma, *place, crop_reach_px(self.radius_px));
            if us.is_empty() || vs.is_empty() {
                continue;
            }
            let part = range.stretched(&Crop::of(luma, us.clone(), vs.clone()).luma);
            let chroma = colour.map(|c| c.cut(us.clone(), vs.clone(), false).chroma.stretched(range));
            let chroma = chroma.as_ref().map(|c| (c, shares));
            let jpeg = jpeg::jpeg(&part, chroma, part.width, CROP_BYTES)?;
            self.crops.push(json!({
                "frame": frame, "u": us.start, "v": vs.start, "width": part.width, "height": part.height, "jpeg": text(&jpeg),
            }));
        }
        Ok(())
    }

    /// The page. `sha256`: of the recording.
    #[must_use]
    pub fn html(self, names: ReviewNames<'_>, sha256: Option<&str>) -> String {
        let tenth = |x: f64| (100.0 * x).round() / 100.0;
        let things = self.looked.things.iter().map(|t| {
            let c = t.centre;
            json!({"frame": t.frame, "u": tenth(c.u_px), "v": tenth(c.v_px), "r": tenth(t.radius_px), "track": t.track})
        });
        let points = self.reviewed.points.iter().map(|p| {
            let part = |pair: Option<[f64; 2]>, i: usize| pair.map(|pair| pair[i]);
            json!({
                "frame": p.frame, "u": p.centre.u_px, "v": p.centre.v_px, "x": part(p.place_m, 0), "z": part(p.place_m, 1),
                "rx": part(p.residual_m, 0), "rz": part(p.residual_m, 1), "used": p.used, "reason": p.reason,
            })
        });
        let result = self.reviewed.result.as_ref();
        let edits = result
            .and_then(|r| r.get("edits"))
            .filter(|e| e.is_object())
            .cloned();
        let edits = edits.or_else(|| serde_json::to_value(self.reviewed.edits.as_ref()?).ok());
        let data = json!({
            "image_size_px": [self.looked.width_px, self.looked.height_px],
            "times_s": times_s(&self.looked.times_s, &self.reviewed.points),
            "things": things.collect::<Vec<_>>(),
            "points": points.collect::<Vec<_>>(),
            "moving": self.looked.moving,
            "radius_px": self.radius_px,
            "second_axis": self.second_axis,
            "stills": self.stills,
            "crops": self.crops,
            "result": result,
            "edits": edits,
            "edits_name": names.edits,
            "sha256": sha256,
            "command": names.command,
        });
        let value = |name: &str| match name {
            "NAME" => Some(escape(names.video)),
            "EDITS" => Some(escape(names.edits)),
            "STYLE" => Some([STYLE, OWN_STYLE].concat()),
            "DATA" => Some(script_data(&data)),
            "SCRIPT" => Some(SCRIPT.to_owned()),
            _ => None,
        };
        filled(TEMPLATE, value)
    }
}

fn text(jpeg: &[u8]) -> String {
    base64::engine::general_purpose::STANDARD.encode(jpeg)
}

fn crop_reach_px(radius_px: f64) -> f64 {
    (CROP_RADII * radius_px).clamp(CROP_PX.0, CROP_PX.1)
}

/// Columns and rows of the neighbourhood of `centre`, from even ones on, as chroma has one sample for two of each; none outside of the picture.
fn reach(luma: &Luma, centre: PixelPoint, reach_px: f64) -> (Range<usize>, Range<usize>) {
    let span = |c: f64, size: usize| {
        let from = (c - reach_px).round().clamp(0.0, size as f64) as usize & !1;
        let to = (c + reach_px + 1.0).round().clamp(0.0, size as f64) as usize;
        from..to
    };
    (span(centre.u_px, luma.width), span(centre.v_px, luma.height))
}

/// A path with its short gaps filled in straight lines.
fn without_gaps(path: &[(usize, PixelPoint)]) -> Vec<(usize, PixelPoint)> {
    let mut all = path.to_vec();
    for pair in path.windows(2) {
        let [(from, a), (to, b)] = [pair[0], pair[1]];
        if to - from > LONGEST_GAP {
            continue;
        }
        for frame in from + 1..to {
            let part = (frame - from) as f64 / (to - from) as f64;
            all.push((
                frame,
                a.shifted(part * (b.u_px - a.u_px), part * (b.v_px - a.v_px)),
            ));
        }
    }
    all
}

/// The time of each frame on the time base of the result, as far as its points tell it: between and beside them in even steps.
fn times_s(stamps_s: &[f64], points: &[ReviewedPoint]) -> Vec<f64> {
    let mut known: Vec<(f64, f64)> = points.iter().map(|p| (p.frame as f64, p.time_s)).collect();
    known.dedup_by(|a, b| a.0 <= b.0);
    let (Some(first), Some(last)) = (known.first(), known.last()) else {
        return stamps_s.to_vec();
    };
    if last.0 <= first.0 {
        return stamps_s.to_vec();
    }
    let step_s = (last.1 - first.1) / (last.0 - first.0);
    let time = |frame: usize| {
        let frame = frame as f64;
        let after = known.partition_point(|(k, _)| *k < frame);
        match (after.checked_sub(1).and_then(|i| known.get(i)), known.get(after)) {
            (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (frame - a.0) / (b.0 - a.0),
            (Some(a), None) => a.1 + step_s * (frame - a.0),
            (None, Some(b)) => b.1 - step_s * (b.0 - frame),
            (None, None) => 0.0,
        }
    };
    (0..stamps_s.len()).map(time).collect()
}

/// `NAME` of a file's path.
#[must_use]
pub fn file_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::LumaRange;
    use crate::pipeline::RoundThing;

    fn looked() -> LookedThrough {
        let thing = |frame: usize| RoundThing {
            frame,
            centre: PixelPoint::new(20.0 + 5.0 * frame as f64, 30.0),
            radius_px: 6.0,
            track: Some(0),
        };
        LookedThrough {
            width_px: 200,
            height_px: 100,
            luma_range: LumaRange::FULL,
            luma_shares: (0.299, 0.114),
            times_s: (0..10).map(|f| f as f64 / 100.0).collect(),
            things: (0..10).filter(|f| *f != 4).map(thing).collect(),
            moving: vec![0],
        }
    }

    #[test]
    fn the_page_holds_every_frame_and_nothing_breaks_out() {
        let mut page = ReviewPage::new(looked(), ReviewedResult::default(), "z");
        let luma = Luma {
            width: 200,
            height: 100,
            data: vec![90; 20_000],
        };
        for frame in 0..10 {
            page.add(frame, &luma, None).unwrap();
        }
        // The one frame in which nothing was seen too.
        assert_eq!((page.stills.len(), page.crops.len()), (10, 10));
        let names = ReviewNames {
            video: "a<b>@DATA@.mp4",
            edits: "a.edits.json",
            command: "track </script>",
        };
        let html = page.html(names, None);
        assert!(html.contains("a&lt;b&gt;@DATA@.mp4"));
        assert_eq!(html.matches("</script>").count(), 2);
        let outward = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!outward.contains("http:") && !outward.contains("https:") && !outward.contains("src=\""));
    }

    #[test]
    fn times_are_those_of_the_result() {
        let point = |frame: usize, time_s: f64| ReviewedPoint {
            frame,
            time_s,
            centre: PixelPoint::new(0.0, 0.0),
            place_m: None,
            residual_m: None,
            used: true,
            reason: String::new(),
        };
        let times = times_s(&[0.0; 6], &[point(1, 0.1), point(3, 0.5), point(4, 0.6)]);
        let wanted = [-0.0667, 0.1, 0.3, 0.5, 0.6, 0.7667];
        for (time, wanted) in times.iter().zip(wanted) {
            assert!((time - wanted).abs() < 1e-3, "{times:?}");
        }
    }
}
