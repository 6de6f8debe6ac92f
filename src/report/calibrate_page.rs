//! `<name>.show.html`: the page on which the marks of a calibration are dragged over a frame of the recording.
//!
//! One file with everything in it: frames, style, script; no library, no address. The script draws the marks and lets the user
//! save where they are (schema `track.marks/1`); `track calibrate ruler --marks` makes the calibration of them.

use super::escape::escape;
use super::page::{STYLE, filled, script_data};
use super::photograph::Photograph;
use crate::calibration::Calibration;
use crate::frames::{FrameError, Yuv420};
use crate::geometry::{PixelPoint, PlanePoint};
use base64::Engine as _;
use serde_json::{Value, json};
use thiserror::Error;

const TEMPLATE: &str = include_str!("calibrate_page.html");
const OWN_STYLE: &str = include_str!("calibrate_page.css");
const SCRIPT: &str = include_str!("calibrate_page.js");

/// Frames are made no wider than this, px: the loupe shows single pixels up to here.
const MAX_WIDTH_PX: usize = 1920;
/// All of them together take about this much, bytes: a page that a browser opens at once.
const ALL_JPEG_BYTES: usize = 10_000_000;
/// And each no more than this.
const MAX_JPEG_BYTES: usize = 700_000;

/// Why the page could not be made.
#[derive(Debug, Error)]
pub enum CalibratePageError {
    /// There is nothing to put marks on.
    #[error("the recording has no frame to show")]
    NoFrame,
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] FrameError),
    /// OpenCV could not encode a frame.
    #[error("a frame could not be encoded as JPEG")]
    Encode(#[from] opencv::Error),
}

/// A frame of the recording.
#[derive(Debug, Clone)]
pub struct PageFrame {
    /// What the page calls it.
    pub name: String,
    /// Its picture.
    pub photograph: Photograph,
}

/// A frame as the page holds it, one of so many.
///
/// # Errors
/// [`CalibratePageError::Encode`].
pub fn photograph(picture: &Yuv420, count: usize) -> Result<Photograph, CalibratePageError> {
    let most = (ALL_JPEG_BYTES / count.max(1)).min(MAX_JPEG_BYTES);
    Ok(Photograph::of(picture, MAX_WIDTH_PX, most)?)
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
            let text = base64::engine::general_purpose::STANDARD.encode(&frame.photograph.jpeg);
            json!({"name": frame.name, "jpeg": format!("data:image/jpeg;base64,{text}")})
        })
        .collect::<Vec<_>>();
    let (width, height) = first.photograph.size_px;
    let data = json!({
        "image_size_px": [width, height],
        "marks_name": names.marks,
        "calib": calib.map_or_else(|| json!({}), |(content, _)| content.clone()),
        "start": start(calib.map(|(_, calibration)| calibration), (width as f64, height as f64)),
        "frames": shown,
    });
    let value = |name: &str| match name {
        "NAME" => Some(escape(names.video)),
        "CALIB" => Some(escape(names.calib)),
        "MARKS" => Some(escape(names.marks)),
        "STYLE" => Some([STYLE, OWN_STYLE].concat()),
        "DATA" => Some(script_data(&data)),
        "SCRIPT" => Some(SCRIPT.to_owned()),
        _ => None,
    };
    Ok(filled(TEMPLATE, value))
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
    use crate::config::made_by;

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
            photograph: photograph(&Yuv420::black(width, height), 1).unwrap(),
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
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.show.html");
        std::fs::write(&path, page).unwrap();
        assert!(made_by::foreign(&path, std::slice::from_ref(&path)).is_empty());
    }

    #[test]
    fn large_frames_are_shrunk_but_keep_their_size_in_pixels() {
        let page = calibrate_html(names("a"), None, &[frame(4000, 1000)]).unwrap();
        assert!(page.contains(r#""image_size_px":[4000,1000]"#));
        assert!(calibrate_html(names("a"), None, &[]).is_err());
    }
}
