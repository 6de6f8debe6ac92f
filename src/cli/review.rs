//! `track review VIDEO [RESULT] [--out PAGE]`: a page to look a recording through and say what is wrong.

use super::measure::show;
use super::messages::progress_bar;
use super::{Status, answer, note, refuse_foreign};
use crate::config::made_by;
use crate::edits::{self, Edits};
use crate::frames::{self, digest};
use crate::pipeline::look_through;
use crate::report::review_page::{ReviewNames, ReviewPage, ReviewedResult, file_name, read_points};
use crate::report::write;
use anyhow::{Context, bail};
use clap::Args;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Which recording.
#[derive(Debug, Args)]
pub struct ReviewArgs {
    /// The recording.
    pub video: PathBuf,
    /// Its <name>.result.json, measured or rejected; by default the one beside the recording, if there is one. The points come from the
    /// <name>.points.csv beside it.
    pub result: Option<PathBuf>,
    /// Where the page goes; by default beside the result (or else the recording), as <name>.review.html.
    #[arg(long, value_name = "PAGE")]
    pub out: Option<PathBuf>,
    /// Replace a page there that this program did not make.
    #[arg(long)]
    pub force: bool,
}

/// Makes the page.
///
/// # Errors
/// Whatever keeps the recording or the result from being read, or the page from being written.
pub fn run(args: &ReviewArgs) -> anyhow::Result<Status> {
    let edits_path = edits::beside(&args.video);
    let name = edits_path.to_string_lossy();
    let stem = name.strip_suffix(".edits.json").unwrap_or(&name);
    let beside = PathBuf::from(format!("{stem}.result.json"));
    let result_path = args.result.clone().or_else(|| beside.is_file().then_some(beside));
    let out = args.out.clone().unwrap_or_else(|| {
        let page = format!("{}.review.html", file_name(Path::new(stem)));
        result_path.as_deref().unwrap_or(&args.video).with_file_name(page)
    });
    let folder = out
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let _folders = write::check_output_dir(folder)?;
    if !args.force {
        refuse_foreign(&made_by::foreign(&out, std::slice::from_ref(&out)))?;
    }
    let sha256 = digest::of_recording(&args.video).ok();
    let (mut reviewed, second_axis) = match &result_path {
        Some(path) => read(path, &args.video, sha256.as_deref())?,
        None => (ReviewedResult::default(), "z"),
    };
    if edits_path.is_file() {
        reviewed.edits = Some(Edits::read(&edits_path, &args.video)?);
    }
    let bar = progress_bar(None, "{msg:9} {wide_bar} {pos}/{len} {eta}");
    let looked = look_through(&args.video, &mut |p| {
        show(&bar, p);
    })?;
    bar.finish_and_clear();
    let command = command(args, &reviewed, &edits_path);
    let mut page = ReviewPage::new(looked, reviewed, second_axis);
    let mut source = frames::open(&args.video)?;
    while let Some(frame) = source.next_frame()? {
        page.add(frame.index, &frame.luma, frame.colour.as_ref())
            .with_context(|| {
                format!(
                    "{}: frame {} could not be encoded",
                    args.video.display(),
                    frame.index
                )
            })?;
    }
    let names = ReviewNames {
        video: &file_name(&args.video),
        edits: &file_name(&edits_path),
        command: &command,
    };
    let html = page.html(names, sha256.as_deref());
    write::write_together(&[(&out, html.as_bytes())])?;
    answer(&format!("{}\n", out.display()))?;
    note(
        "open that page in a browser, say what is wrong, and save it; the page shows the command that measures with it",
    );
    Ok(Status::Done)
}

/// The result at `path`, of `video`, and the name of its second axis.
fn read(path: &Path, video: &Path, sha256: Option<&str>) -> anyhow::Result<(ReviewedResult, &'static str)> {
    let text = std::fs::read(path).with_context(|| format!("{}: cannot read the result", path.display()))?;
    let result: Value = serde_json::from_slice(&text).with_context(|| {
        format!("{}: this is no result; give the <name>.result.json that track wrote (its key schema is track.result/1)", path.display())
    })?;
    if result["schema"] != "track.result/1" {
        bail!(
            "{}: this is no result (its key schema is {}); give the <name>.result.json that track wrote (track.result/1)",
            path.display(),
            result["schema"]
        );
    }
    if let (Some(told), Some(found)) = (result.pointer("/video/sha256").and_then(Value::as_str), sha256)
        && told != found
    {
        bail!(
            "{} was measured from another recording ({}, SHA-256 {}...); {} has {}...: give the recording it was measured from",
            path.display(),
            result["video"]["path"].as_str().unwrap_or("?"),
            told.get(..12).unwrap_or(told),
            video.display(),
            found.get(..12).unwrap_or(found)
        );
    }
    let name = path.to_string_lossy();
    let table = name
        .strip_suffix("result.json")
        .map(|stem| format!("{stem}points.csv"));
    let points = table.and_then(|table| read_points(&std::fs::read(table).ok()?));
    if points.is_none() && result["status"] == "measured" {
        note(&format!(
            "note: no points.csv lies beside {}: the page shows no residuals",
            path.display()
        ));
    }
    let (points, second_axis) = points.unwrap_or((Vec::new(), "z"));
    let reviewed = ReviewedResult {
        result: Some(result),
        points,
        edits: None,
    };
    Ok((reviewed, second_axis))
}

/// The command that measures with the edits.
fn command(args: &ReviewArgs, reviewed: &ReviewedResult, edits: &Path) -> String {
    let told = reviewed
        .result
        .as_ref()
        .and_then(|r| r.pointer("/calibration/path")?.as_str());
    format!(
        "track {} --calib {} --edits {} --out DIR",
        quoted(&args.video.to_string_lossy()),
        quoted(told.unwrap_or("CALIB")),
        quoted(&edits.to_string_lossy())
    )
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+,:@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}
