//! `<name>.show.html`: the page on which the marks of a calibration are dragged over a frame of the recording.
//!
//! One file with everything in it: frames, style, script; no library, no address. The script draws the marks, computes the
//! calib.json that follows from them as [`crate::calibration::ruler`] does, and lets the user save it.

use super::jpeg;
use super::page::{STYLE, escape};
use crate::frames::Luma;
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

/// The page for `calib` (the file's content, as it stands), to be saved as `calib_name`; `video` is the recording's name.
///
/// # Errors
/// See [`CalibratePageError`].
pub fn calibrate_html(
    video: &str,
    calib_name: &str,
    calib: &Value,
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
    let data = json!({
        "image_size_px": [first.luma.width, first.luma.height],
        "calib_name": calib_name,
        "calib": calib,
        "frames": shown,
    });
    // In a script element only "<" could end what it holds.
    let data = data.to_string().replace('<', "\\u003c");
    // One pass over the template: a name that looks like a place holder stays a name.
    let mut page = String::with_capacity(TEMPLATE.len() + data.len() + SCRIPT.len());
    for (i, part) in TEMPLATE.split('@').enumerate() {
        match part {
            _ if i % 2 == 0 => page.push_str(part),
            "NAME" => page.push_str(&escape(video)),
            "CALIB" => page.push_str(&escape(calib_name)),
            "STYLE" => [STYLE, OWN_STYLE].iter().for_each(|s| page.push_str(s)),
            "DATA" => page.push_str(&data),
            "SCRIPT" => page.push_str(SCRIPT),
            other => page.push_str(other),
        }
    }
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let calib = json!({"schema": "track.calib/1", "odd": "</script><script>alert(1)"});
        let page = calibrate_html("a<b>@DATA@.mp4", "x.calib.json", &calib, &[frame(64, 48)]).unwrap();
        assert!(page.contains("a&lt;b&gt;@DATA@.mp4"));
        assert_eq!(page.matches("</script>").count(), 2);
        let outward = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!outward.contains("http:") && !outward.contains("https:") && !outward.contains("src=\""));
        assert!(page.contains("data:image/jpeg;base64,"));
    }

    #[test]
    fn large_frames_are_shrunk_but_keep_their_size_in_pixels() {
        let page = calibrate_html("a", "b", &json!({}), &[frame(4000, 1000)]).unwrap();
        assert!(page.contains(r#""image_size_px":[4000,1000]"#));
        assert!(calibrate_html("a", "b", &json!({}), &[]).is_err());
    }
}
