//! `track points CSV --calib CALIB`: centres that another program found.

use super::measure::{finish, format_names, formats_named};
use super::{Status, say};
use crate::calibration::Calibration;
use crate::pipeline::measure_points;
use crate::points::table;
use crate::report::formats::batch_formats;
use crate::report::write;
use anyhow::bail;
use clap::Args;
use std::path::PathBuf;

/// What to measure, and where to put it.
#[derive(Debug, Args)]
pub struct PointsArgs {
    /// The centres: frame or time_s, and u_px with v_px [, std_px], or x_m with z_m; trackpy's and Tracker's tables as they are.
    pub points: PathBuf,
    /// The calibration (calib.json): scale, origin, up, frame rate, ball.
    #[arg(long)]
    pub calib: PathBuf,
    /// Write <name>.result.json, .points.csv and .report.html into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// What to write there: html, json, csv (all of these without this option), svg (each figure a file), trk (for Tracker).
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "out", value_parser = format_names())]
    pub formats: Option<Vec<String>>,
    /// Print the result as one JSON document in place of the table.
    #[arg(long)]
    pub json: bool,
}

/// Measures and reports.
///
/// # Errors
///
/// Whatever keeps the centres from being read, or the results from being written.
pub fn run(args: &PointsArgs) -> anyhow::Result<Status> {
    let formats = formats_named(args.formats.as_deref(), batch_formats());
    if formats.iter().any(|format| format.needs_frames()) {
        bail!(
            "--formats overlay: a table of centres has no pictures to draw into; accepted are html, json, csv, svg, trk"
        );
    }
    let calibration = Calibration::read(&args.calib)?;
    // Kept to the end: a folder that nothing came into goes again.
    let _folders = args.out.as_deref().map(write::check_output_dir).transpose()?;
    let given = table::read(&args.points)?;
    let name = args.calib.display().to_string();
    let mut measurement = measure_points(&args.points, &given, &calibration, &name)?;
    measurement.note_digests(&args.points, &args.calib);
    if given.points.iter().all(|p| p.std_px.is_none()) {
        say("note: the table has no std_px; the centres' uncertainty is what they scatter by about the arcs");
    }
    finish(
        &measurement,
        &args.points,
        args.out.as_deref(),
        args.json,
        &formats,
    )
}
