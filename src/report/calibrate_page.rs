//! `<name>.show.html`: the page on which the marks of a calibration are dragged over a frame of the recording.
//!
//! One file with everything in it: frames, style, script; no library, no address. The script draws the marks and lets the user
//! save where they are (schema `track.marks/1`); `track calibrate ruler --marks` makes the calibration of them.

use super::escape::escape;
use super::jpeg;
use super::page::STYLE;
use crate::calibration::Calibration;
use crate::frames::Luma;
use crate::geometry::{PixelPoint, PlanePoint};
use base64::Engine as _;
use serde_json::{Value, json};
use thiserror::Error;

const TEMPLATE: &str = include_str!("calibrate_page.html");
const OWN_STYLE: &str = include_str!("calibrate_page.css");
const SCRIPT: &str = include_str!("calibrate_page.js");

/// Frames are made no wider than this, px: the loupe shows single pixels up to here.
const MAX_WIDTH_PX: usize = 1920;
/// And no larger than this each, bytes.
const MAX_JPEG_BYTES: usize = 900_000;

/// Why the page could not be made.
#[derive(Debug, Error)]
pub enum CalibratePageError {
    /// There is nothing to put marks on.
    #[error("the recording has no frame to show")]
    NoFrame,
    /// OpenCV could not encode a frame.
    #[error("a frame could not be encoded as JPEG")]
    Encode(#[from] opencv::Error),
}

/// A frame of the recording.
#[derive(Debug, Clone)]
pub struct PageFrame {
    /// What the page calls it.
    pub name: String,
    /// The picture, full range.
    pub luma: Luma,
}

/// What the page is about, by its files' names.
#[derive(Debug, Clone, Copy)]
pub struct PageNames<'a> {
    /// The recording.
    pub video: &'a str,
    /// The calibration that is to be made.
    pub calib: &'a str,
    /// The marks that are saved for it.
    pub marks: &'a str,
}

/// The page for `calib`, the file's content as it stands and what it means, where there is one.
///
/// # Errors
/// See [`CalibratePageError`].
pub fn calibrate_html(
    names: PageNames<'_>,
    calib: Option<&(Value, Calibration)>,
    frames: &[PageFrame],
) -> Result<String, CalibratePageError> {
    let first = frames.first().ok_or(CalibratePageError::NoFrame)?;
    let shown = frames
        .iter()
        .map(|frame| {
            let jpeg = jpeg::jpeg(&frame.luma, MAX_WIDTH_PX, MAX_JPEG_BYTES)?;
            let text = base64::engine::general_purpose::STANDARD.encode(jpeg);
            Ok(json!({"name": frame.name, "jpeg": format!("data:image/jpeg;base64,{text}")}))
        })
        .collect::<Result<Vec<_>, CalibratePageError>>()?;
    let (width, height) = (first.luma.width, first.luma.height);
    let data = json!({
        "image_size_px": [width, height],
        "marks_name": names.marks,
        "calib": calib.map_or_else(|| json!({}), |(content, _)| content.clone()),
        "start": start(calib.map(|(_, calibration)| calibration), (width as f64, height as f64)),
        "frames": shown,
    });
    // In a script element only "<" could end what it holds.
    let data = data.to_string().replace('<', "\\u003c");
    // One pass over the template: a name that looks like a place holder stays a name.
    let mut page = String::with_capacity(TEMPLATE.len() + data.len() + SCRIPT.len());
    for (i, part) in TEMPLATE.split('@').enumerate() {
        match part {
            _ if i % 2 == 0 => page.push_str(part),
            "NAME" => page.push_str(&escape(names.video)),
            "CALIB" => page.push_str(&escape(names.calib)),
            "MARKS" => page.push_str(&escape(names.marks)),
            "STYLE" => [STYLE, OWN_STYLE].iter().for_each(|s| page.push_str(s)),
            "DATA" => page.push_str(&data),
            "SCRIPT" => page.push_str(SCRIPT),
            other => page.push_str(other),
        }
    }
    Ok(page)
}

/// Where the page begins: marks of floor and edge beside the calibration's origin, so that both can be taken hold of, and
/// the direction of "up" there.
fn start(calibration: Option<&Calibration>, (width, height): (f64, f64)) -> Value {
    let map = calibration.and_then(|c| c.rectification().ok());
    let zero = map
        .as_ref()
        .and_then(|m| m.pixel_from_plane(PlanePoint::new(0.0, 0.0)));
    let origin = zero.filter(|_| calibration.is_some_and(Calibration::has_origin));
    let from = origin.unwrap_or(PixelPoint::new((0.12 * width).round(), (0.92 * height).round()));
    // A tenth of the picture along each of the plane's axes.
    let beside = |right: f64, up: f64| {
        let map = map.as_ref()?;
        let (p, jacobian) = (map.plane_from_pixel(from)?, map.jacobian(from)?);
        let units = 0.1 * width * jacobian.determinant().abs().sqrt();
        map.pixel_from_plane(PlanePoint::new(p.right + right * units, p.up + up * units))
    };
    let floor = beside(1.0, 0.0).unwrap_or(from.shifted(0.1 * width, 0.0));
    let edge = beside(0.0, 1.0).unwrap_or(from.shifted(0.0, -0.1 * width));
    let (du, dv) = (edge.u_px - from.u_px, edge.v_px - from.v_px);
    let inside = |p: PixelPoint| [p.u_px.clamp(0.0, width - 1.0), p.v_px.clamp(0.0, height - 1.0)];
    json!({
        "floor_px": inside(floor),
        "edge_px": inside(edge),
        "up_px": [du / du.hypot(dv), dv / du.hypot(dv)],
        "has_origin": origin.is_some(),
        "has_edge": origin.is_some() && calibration.is_some_and(|c| c.launch.edge_x_m.is_some()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Scale;

    fn names(video: &str) -> PageNames<'_> {
        PageNames {
            video,
            calib: "x.calib.json",
            marks: "x.marks.json",
        }
    }

    fn frame(width: usize, height: usize) -> PageFrame {
        PageFrame {
            name: "1".into(),
            luma: Luma {
                width,
                height,
                data: vec![90; width * height],
            },
        }
    }

    #[test]
    fn the_page_holds_everything_and_nothing_breaks_out() {
        let content = json!({"schema": "track.calib/1", "odd": "</script><script>alert(1)"});
        let calib = (content, Calibration::new(Scale::Gravity));
        let page = calibrate_html(names("a<b>@DATA@.mp4"), Some(&calib), &[frame(64, 48)]).unwrap();
        assert!(page.contains("a&lt;b&gt;@DATA@.mp4"));
        assert_eq!(page.matches("</script>").count(), 2);
        let outward = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!outward.contains("http:") && !outward.contains("https:") && !outward.contains("src=\""));
        assert!(page.contains("data:image/jpeg;base64,"));
    }

    #[test]
    fn large_frames_are_shrunk_but_keep_their_size_in_pixels() {
        let page = calibrate_html(names("a"), None, &[frame(4000, 1000)]).unwrap();
        assert!(page.contains(r#""image_size_px":[4000,1000]"#));
        assert!(calibrate_html(names("a"), None, &[]).is_err());
    }
}
