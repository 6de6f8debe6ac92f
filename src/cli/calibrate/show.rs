//! `track calibrate show CALIB VIDEO [--out PAGE]`.

use super::{Status, answer, beside, check_folder, note, refuse_foreign};
use crate::calibration::{Calibration, CalibrationError};
use crate::config::FileError;
use crate::config::made_by;
use crate::frames::stills::stills;
use crate::report::calibrate_page::{PageFrame, PageNames, calibrate_html, photograph};
use crate::report::escape::on_one_line;
use crate::report::write;
use anyhow::{Context, bail};
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Which calibration, on which recording.
#[derive(Debug, Args)]
pub(super) struct ShowArgs {
    /// The calibration to begin with; a file that does not exist yet begins anew.
    calib: PathBuf,
    /// The recording.
    video: PathBuf,
    /// Where the page goes; by default beside the calibration, as <name>.show.html.
    #[arg(long, value_name = "PAGE")]
    out: Option<PathBuf>,
    /// Frames to choose from on the page, evenly spread (all of a recording that has no more).
    #[arg(long, value_name = "N", default_value = "120", value_parser = clap::value_parser!(u64).range(1..=2000))]
    frames: u64,
    /// Replace a page there that this program did not make.
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &ShowArgs) -> anyhow::Result<Status> {
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| beside(&args.calib, "show.html"));
    let _folders = check_folder(&out)?;
    if !args.force {
        refuse_foreign(&made_by::foreign(&out, std::slice::from_ref(&out)))?;
    }
    let calib = content(&args.calib)?;
    let facts = super::facts(&args.video)?;
    // At most 2000, by the option.
    let count = args.frames as usize;
    let shown: Vec<PageFrame> = stills(&args.video, count, |picture| photograph(picture, count))?
        .into_iter()
        .map(|still| PageFrame {
            name: if facts.has_time_base {
                format!("{}, at {:.3} s", still.index, still.time_s)
            } else {
                still.index.to_string()
            },
            photograph: still.picture,
        })
        .collect();
    let size = shown.first().map(|f| f.photograph.size_px);
    check_size(calib.as_ref().map(|(_, c)| c), size, args)?;
    let name = |path: &Path| {
        path.file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
    };
    let names = PageNames {
        video: &name(&args.video),
        calib: &name(&args.calib),
        marks: &name(&beside(&args.calib, "marks.json")),
    };
    let page = calibrate_html(names, calib.as_ref(), &shown)
        .with_context(|| format!("{}: the page could not be made", args.video.display()))?;
    write::write_together(&[(&out, page.as_bytes())])?;
    answer(&format!("{}\n", on_one_line(&out.display().to_string())))?;
    note(
        "open that page in a browser, drag the marks, and save them; the page shows the command that makes the calibration",
    );
    Ok(Status::Done)
}

/// The file as it stands and what it means; `None` where there is none yet.
fn content(path: &Path) -> anyhow::Result<Option<(Value, Calibration)>> {
    match Calibration::read(path) {
        Ok(calibration) => {
            let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
            let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
            Ok(Some((serde_json::from_str(text)?, calibration)))
        }
        Err(CalibrationError::File(FileError::Unreadable { source, .. }))
            if source.kind() == std::io::ErrorKind::NotFound =>
        {
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Marks of one size of picture are meaningless on another.
fn check_size(
    calib: Option<&Calibration>,
    shown: Option<(usize, usize)>,
    args: &ShowArgs,
) -> anyhow::Result<()> {
    if let (Some((width, height)), Some(shown)) = (calib.and_then(|c| c.image_size_px), shown)
        && (width, height) != shown
    {
        bail!(
            "{} is for pictures of {width}x{height} px, {} has {}x{} px: give the recording it was made for, or the name of a new \
             calibration",
            args.calib.display(),
            args.video.display(),
            shown.0,
            shown.1
        );
    }
    Ok(())
}
