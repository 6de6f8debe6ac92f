//! `track calibrate tracker FILE.trk|FILE.trz [--out CALIB] [--points CSV]`: what somebody calibrated and clicked in Tracker.

use super::{CalibrationWay, KnownArgs, MadeCalibration};
use crate::calibration::{Calibration, MetresPerPixel, Scale};
use crate::cli::{note, refuse_foreign};
use crate::points::tracker::{self, TrackerFile};
use crate::report::write;
use anyhow::bail;
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A file of Tracker.
#[derive(Debug, Args)]
pub(super) struct TrackerArgs {
    /// A tab that Tracker saved (.trk), or a project with one (.trz).
    file: PathBuf,
    #[command(flatten)]
    known: KnownArgs,
    /// Write the calibration here.
    #[arg(long, value_name = "CALIB")]
    out: Option<PathBuf>,
    /// Write the point masses here, a table that track points reads.
    #[arg(long, value_name = "CSV")]
    points: Option<PathBuf>,
    /// Replace files there that this program did not make, or that were changed since.
    #[arg(long)]
    force: bool,
    /// Print the calibration as JSON in place of the table.
    #[arg(long)]
    json: bool,
}

/// Tracker's scale is one number in the picture; two that differ by more than this part are of pixels that are not square.
const SQUARE_PART: f64 = 1e-3;

/// Tracker's mass of a point mass that nobody set, kg.
const UNSET_MASS_KG: f64 = 1.0;

impl CalibrationWay for TrackerArgs {
    fn out(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    fn json(&self) -> bool {
        self.json
    }

    fn force(&self) -> bool {
        self.force
    }

    fn make(&self) -> anyhow::Result<MadeCalibration> {
        let file = tracker::read(&self.file)?;
        let (calibration, warnings) = self.calibration(&file)?;
        if let Some(path) = &self.points {
            if file.masses.is_empty() {
                bail!(
                    "{}: no point mass in it has a mark; mark the ball in Tracker and save again, or leave out --points",
                    self.file.display()
                );
            }
            let table = file.table();
            // A table says nothing of who made it: it is ours where it is the same.
            let same = std::fs::read(path).is_ok_and(|there| there == table.as_bytes());
            if !self.force && !same && path.exists() {
                refuse_foreign(std::slice::from_ref(path))?;
            }
            write::write_together(&[(path.as_path(), table.as_bytes())])?;
            note(&format!("wrote {}", path.display()));
        }
        Ok(MadeCalibration {
            table: table(&file, &calibration),
            document: None,
            warnings,
            marks_png: None,
            recording: None,
            calibration,
        })
    }
}

impl TrackerArgs {
    fn calibration(&self, file: &TrackerFile) -> anyhow::Result<(Calibration, Vec<String>)> {
        let mut warnings = Vec::new();
        let (x, y) = file.scale_px;
        if (x / y - 1.0).abs() > SQUARE_PART {
            bail!(
                "{}: xscale is {x} and yscale {y} px a unit: pixels that are not square; accepted: the same; give the video square pixels, and calibrate again",
                self.file.display()
            );
        }
        let Some(unit_m) = metres(file.length_unit.as_deref()) else {
            bail!(
                "{}: lengths are in {:?}; accepted: m, cm, mm, km, in, ft; set the unit in Tracker (Coordinate System, Units) and save again",
                self.file.display(),
                file.length_unit.as_deref().unwrap_or_default()
            );
        };
        if file.length_unit.is_none() {
            warnings.push("the file names no unit of length: metres are taken for it".to_owned());
        }
        let mut c = self.known.calibration();
        c.scale = Scale::MetresPerPixel(MetresPerPixel {
            value: unit_m / (x * y).sqrt(),
            std: None,
        });
        c.image_size_px = file
            .size_px
            .map(|(w, h)| (w.round() as usize, h.round() as usize));
        c.origin_px = Some(file.origin);
        c.launch.edge_x_m = Some(0.0);
        warnings.push(
            "x counts from Tracker's origin, which is taken for the launch edge at the floor: x0 is right where the axes stand there".to_owned(),
        );
        if file.angle_rad != 0.0 {
            let (sin, cos) = file.angle_rad.sin_cos();
            (c.up_px, c.up_given) = ([-sin, -cos], true);
        }
        if let (None, Some(step_s)) = (self.known.frame_rate_hz, file.step_s) {
            c.frame_rate_hz = Some(1.0 / step_s);
            warnings.push(format!(
                "frame_rate_hz is Tracker's step of {:.4} ms, one for all frames; leave it out where the recording's own time stamps are right",
                1000.0 * step_s
            ));
        }
        if let (None, [mass]) = (self.known.ball_mass_kg, &file.masses[..]) {
            c.ball.mass_kg = mass.mass_kg.filter(|m| *m > 0.0 && *m != UNSET_MASS_KG);
        }
        Ok((c, warnings))
    }
}

/// Metres of a unit of length; of none, metres.
fn metres(unit: Option<&str>) -> Option<f64> {
    Some(match unit.map(|u| u.trim().to_lowercase()).as_deref() {
        None | Some("" | "m") => 1.0,
        Some("cm") => 1e-2,
        Some("mm") => 1e-3,
        Some("km") => 1e3,
        Some("in") => 0.0254,
        Some("ft") => 0.3048,
        Some(_) => return None,
    })
}

fn table(file: &TrackerFile, calibration: &Calibration) -> String {
    let mut text = String::new();
    // Writing into a string cannot fail.
    if let Scale::MetresPerPixel(scale) = &calibration.scale {
        let _ = writeln!(text, "scale       {:.6e} m/px", scale.value);
    }
    let _ = writeln!(
        text,
        "origin      ({:.2}, {:.2}) px",
        file.origin.u_px, file.origin.v_px
    );
    let _ = writeln!(
        text,
        "x axis      {:.3}° anticlockwise of the picture's rows",
        file.angle_rad.to_degrees()
    );
    for mass in &file.masses {
        let _ = writeln!(
            text,
            "point mass  {}: {} frames",
            mass.name.replace(['\n', '\r'], " "),
            mass.places.len()
        );
    }
    text
}
