//! `track calibrate board|ruler|tracker|show|check`: from a board, a ruler or a file of Tracker to a calib.json.
//!
//! Each way to calibrate is a [`CalibrationWay`]; what they have in common (where the calibration goes, how it is shown, what
//! is wrong with it) is done here.

mod board;
mod check;
mod ruler;
mod show;
mod tracker;

use super::{Status, answer, note, refuse_foreign, say};
use crate::calibration::check::findings as check_findings;
use crate::calibration::{Calibration, Scale, Severity, View};
use crate::config::made_by;
use crate::frames::{self, Luma, SourceInfo, digest};
use crate::geometry::PixelPoint;
use crate::report::{documents, write};
use anyhow::{Context, bail};
use clap::{Args, Subcommand, ValueEnum};
use std::path::{Path, PathBuf};

/// Makes, shows or checks a calibration (calib.json).
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    #[command(subcommand)]
    what: CalibrateCommand,
}

#[derive(Debug, Subcommand)]
enum CalibrateCommand {
    /// A lens, and the plane of motion, from pictures of a chessboard.
    Board(board::BoardArgs),
    /// A scale from two marks and a length, from the ball, or from the fall; floor and launch edge.
    Ruler(ruler::RulerArgs),
    /// What was calibrated in Tracker (.trk, .trz), and the point masses that were marked.
    Tracker(tracker::TrackerArgs),
    /// A page on which the marks are dragged over a frame with the mouse.
    Show(show::ShowArgs),
    /// Everything that is wrong with a calibration, at once.
    Check(check::CheckArgs),
}

/// Runs one of them.
///
/// # Errors
/// What keeps it from running: unreadable input, marks or pictures that make no calibration, output that cannot be written.
pub fn run(args: &CalibrateArgs) -> anyhow::Result<Status> {
    match &args.what {
        CalibrateCommand::Board(args) => calibrate_by(args),
        CalibrateCommand::Ruler(args) => calibrate_by(args),
        CalibrateCommand::Tracker(args) => calibrate_by(args),
        CalibrateCommand::Show(args) => show::run(args),
        CalibrateCommand::Check(args) => check::run(args),
    }
}

/// A way to calibrate: the options of a command, in a file beside this one, and a variant of [`CalibrateCommand`].
trait CalibrationWay {
    /// Where the calibration goes.
    fn out(&self) -> Option<&Path>;

    /// Whether JSON is wanted in place of the table.
    fn json(&self) -> bool;

    /// Whether files of other origin may be replaced.
    fn force(&self) -> bool;

    /// Makes the calibration.
    fn make(&self) -> anyhow::Result<MadeCalibration>;
}

/// A calibration that was just made, and how it is shown.
struct MadeCalibration {
    calibration: Calibration,
    /// What it rests on, for people.
    table: String,
    /// The same as JSON; `None`: the calibration says all.
    document: Option<Vec<u8>>,
    /// What the user has to know.
    warnings: Vec<String>,
    /// The picture with the marks drawn in, as PNG; only asked for where the calibration goes to a file.
    marks_png: Option<Vec<u8>>,
    /// The recording it is checked against.
    recording: Option<SourceInfo>,
}

/// Makes a calibration, and shows or writes it.
fn calibrate_by(way: &impl CalibrationWay) -> anyhow::Result<Status> {
    let _folders = way.out().map(check_folder).transpose()?;
    if let (Some(out), false) = (way.out(), way.force()) {
        refuse_foreign(&made_by::foreign(out, &[beside(out, MARKS), out.to_owned()]))?;
    }
    let made = way.make()?;
    if !way.json() {
        for warning in &made.warnings {
            say(&format!("warning: {warning}"));
        }
    }
    warn_of_problems(&made.calibration, made.recording.as_ref());
    if let Some(out) = way.out() {
        write_files(out, &made.calibration, made.marks_png)?;
    }
    if way.json() {
        match &made.document {
            Some(document) => answer(&String::from_utf8_lossy(document))?,
            None => answer(&documents::calib_text(&made.calibration.to_json())?)?,
        }
    } else if way.out().is_some() {
        answer(&made.table)?;
    } else {
        for line in made.table.trim_end().lines() {
            say(line);
        }
        answer(&documents::calib_text(&made.calibration.to_json())?)?;
    }
    Ok(Status::Done)
}

/// Where the camera looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ViewArg {
    /// At the plane of motion.
    Side,
    /// Down at the floor.
    Top,
}

/// What marks and boards do not tell, for the file.
#[derive(Debug, Args)]
struct KnownArgs {
    /// Radius of the ball (half its diameter), m.
    #[arg(long, value_name = "R", value_parser = positive)]
    ball_radius_m: Option<f64>,
    /// Mass of the ball, kg.
    #[arg(long, value_name = "M", value_parser = positive)]
    ball_mass_kg: Option<f64>,
    /// The rate at which the camera captured, for slow-motion files, Hz.
    #[arg(long, value_name = "RATE", value_parser = positive)]
    frame_rate_hz: Option<f64>,
    /// Acceleration of free fall where you are, m/s²; 9.81 without it.
    #[arg(long, value_name = "G", value_parser = positive)]
    gravity_m_s2: Option<f64>,
    /// Where the camera looks.
    #[arg(long, value_enum, default_value = "side")]
    view: ViewArg,
}

impl KnownArgs {
    /// A calibration with these and every default; the scale is the fall until it is replaced.
    fn calibration(&self) -> Calibration {
        let mut c = Calibration::new(Scale::Gravity);
        self.put(&mut c);
        c
    }

    fn put(&self, c: &mut Calibration) {
        c.ball.radius_m = self.ball_radius_m;
        c.ball.mass_kg = self.ball_mass_kg;
        c.frame_rate_hz = self.frame_rate_hz;
        if let Some(gravity_m_s2) = self.gravity_m_s2 {
            (c.gravity_m_s2, c.gravity_given) = (gravity_m_s2, true);
        }
        c.view = match self.view {
            ViewArg::Side => View::Side,
            ViewArg::Top => View::Top,
        };
    }
}

/// `U,V`.
fn pixel(text: &str) -> Result<PixelPoint, String> {
    let [u, v] = pair(text).ok_or("expected U,V in pixels (column, row), such as 120,660.5")?;
    Ok(PixelPoint::new(u, v))
}

/// `DU,DV`, not zero.
fn direction(text: &str) -> Result<[f64; 2], String> {
    pair(text).filter(|[a, b]| a.hypot(*b) > 1e-9).ok_or_else(|| {
        "expected a direction DU,DV in the picture, such as 0,-1 (up) or 1,0 (right)".to_owned()
    })
}

fn pair(text: &str) -> Option<[f64; 2]> {
    let (a, b) = text.split_once(',')?;
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|x| x.abs() < 1e6);
    Some([number(a)?, number(b)?])
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse::<f64>()
        .ok()
        .filter(|x| (1e-15..=1e15).contains(x))
        .ok_or_else(|| "expected a number above 0".to_owned())
}

/// A frame to put marks on.
struct StillFrame {
    /// Full range.
    luma: Luma,
    /// As decoded.
    raw: Luma,
}

/// Frame `number` of a video or folder (from 0), or a picture.
fn still(path: &Path, number: usize) -> anyhow::Result<StillFrame> {
    if path.is_file() && frames::is_picture(path) {
        let raw = frames::open_picture(path)?;
        return Ok(StillFrame {
            luma: raw.clone(),
            raw,
        });
    }
    let mut source = frames::open(path)?;
    let range = source.info().luma_range;
    let mut count = 0;
    while let Some(frame) = source.next_frame()? {
        if count == number {
            return Ok(StillFrame {
                luma: range.stretched(&frame.luma),
                raw: frame.luma,
            });
        }
        count += 1;
        source.recycle(frame);
    }
    bail!(
        "{}: there is no frame {number}; accepted are 0 to {}",
        path.display(),
        count.max(1) - 1
    )
}

/// What is known of the recording `path`.
fn facts(path: &Path) -> anyhow::Result<SourceInfo> {
    Ok(frames::open(path)?.info().clone())
}

/// What the picture of the marks ends in.
const MARKS: &str = "marks.png";

fn file_name(path: &Path) -> Option<String> {
    Some(path.file_name()?.to_string_lossy().into_owned())
}

/// `<name>.calib.json` (or `<name>.json`, or anything) with another ending.
fn beside(calib: &Path, ending: &str) -> PathBuf {
    let name = calib
        .file_name()
        .map_or_else(|| "calibration".into(), |n| n.to_string_lossy());
    let stem = [".calib.json", ".json"]
        .iter()
        .find_map(|e| name.strip_suffix(e).filter(|stem| !stem.is_empty()))
        .unwrap_or(&name);
    calib.with_file_name(format!("{stem}.{ending}"))
}

/// The folder that `path` lies in, checked and made before the work.
fn check_folder(path: &Path) -> anyhow::Result<write::NewFolders> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if path.is_dir() {
        bail!(
            "cannot write {}: a folder has that name; give the name of a file, such as {}",
            path.display(),
            path.join("my.calib.json").display()
        );
    }
    Ok(write::check_output_dir(folder)?)
}

/// Writes the calibration and a picture of its marks, both or none, and says so.
fn write_files(out: &Path, calibration: &Calibration, marks: Option<Vec<u8>>) -> anyhow::Result<()> {
    let picture = beside(out, MARKS);
    let named = marks
        .as_ref()
        .and_then(|bytes| Some((file_name(&picture)?, digest::of_bytes(bytes))));
    let signed = made_by::signed(calibration.to_json(), named.as_slice());
    let text = documents::calib_text(&signed).context("the calibration could not be put together")?;
    let mut files: Vec<(&Path, &[u8])> = Vec::new();
    if let Some(marks) = &marks {
        files.push((&picture, marks));
    }
    files.push((out, text.as_bytes()));
    write::write_together(&files)?;
    for (path, _) in files {
        note(&format!("wrote {}", path.display()));
    }
    Ok(())
}

/// Says what is wrong with a calibration that was just made, as `calibrate check` would.
fn warn_of_problems(calibration: &Calibration, recording: Option<&SourceInfo>) {
    for finding in check_findings(calibration, recording) {
        if finding.severity == Severity::Problem {
            say(&format!("warning: {}: {}", finding.key, finding.message));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_read_with_care() {
        assert_eq!(pixel("120,660.5"), Ok(PixelPoint::new(120.0, 660.5)));
        assert_eq!(pixel(" 1 , -2 "), Ok(PixelPoint::new(1.0, -2.0)));
        for bad in ["120", "120;3", "a,b", "1,2,3", "NaN,1", "1e9,1", ""] {
            assert!(pixel(bad).is_err(), "{bad}");
        }
        assert_eq!(direction("0,-1"), Ok([0.0, -1.0]));
        assert!(direction("0,0").is_err());
        assert!(positive("0").is_err() && positive("-1").is_err() && positive("nan").is_err());
    }

    #[test]
    fn files_beside_a_calibration_share_its_name() {
        for (calib, expected) in [
            ("a/b.calib.json", "a/b.marks.png"),
            ("b.json", "b.marks.png"),
            ("b", "b.marks.png"),
            (".calib.json", ".calib.marks.png"),
        ] {
            assert_eq!(beside(Path::new(calib), "marks.png"), Path::new(expected));
        }
    }
}
