//! `track calibrate board IMAGE... --pattern 9x6 --square-m 0.025 [--plane IMAGE] [--out CALIB]`.

use super::{CalibrationWay, KnownArgs, MadeCalibration, StillFrame, direction, pixel, positive};
use crate::calibration::board::{
    BoardLens, BoardSearch, BoardView, BoardViews, Corners, MotionPlane, Pattern, PlaneMarks, ViewUse,
    plane_with_lens,
};
use crate::calibration::{Calibration, Rectification};
use crate::cli::messages::{detail, progress_bar, say};
use crate::frames;
use crate::geometry::{PixelPoint, PlanePoint};
use crate::report::board::{BoardReport, table, warnings};
use crate::report::documents;
use crate::report::documents::board::BoardDocument;
use crate::report::marked_frame::{MarkColour, MarkShape, marks_png};
use anyhow::{Context, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pictures of a board, and what to make of them.
#[derive(Debug, Args)]
pub(super) struct BoardArgs {
    /// Pictures of the board (png, jpg, ...), folders of them, or videos, taken in the recording's mode.
    #[arg(required_unless_present = "lens", value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Inner corners of the board, across and down: the points where four squares meet.
    #[arg(long, value_name = "9x6", value_parser = pattern)]
    pattern: Corners,
    /// Side of a square, m.
    #[arg(long, value_name = "L", value_parser = positive)]
    square_m: f64,
    /// Standard uncertainty of that, m.
    #[arg(long, value_name = "S", value_parser = positive)]
    square_std_m: Option<f64>,
    /// The board standing upright in the plane of motion (a picture, or a video, of which the first frame counts).
    #[arg(long, value_name = "IMAGE")]
    plane: Option<PathBuf>,
    /// A point of that picture at the height of the floor.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true, requires = "plane")]
    floor: Option<PixelPoint>,
    /// A point of that picture at the x of the launch edge.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true, requires = "floor")]
    edge: Option<PixelPoint>,
    /// Both in one: the point of that picture at x = 0 at the floor.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true, requires = "plane", conflicts_with_all = ["floor", "edge"])]
    origin: Option<PixelPoint>,
    /// How well those marks were read, each coordinate, px.
    #[arg(long, value_name = "S", value_parser = positive, default_value = "1")]
    point_std_px: f64,
    /// Roughly "up" in the picture, where that is not up: 1,0 for a camera on its side. Without --plane and this the fall tells.
    #[arg(long, value_name = "DU,DV", value_parser = direction, allow_hyphen_values = true)]
    up: Option<[f64; 2]>,
    /// How upright the board's edge stood, degrees.
    #[arg(long, value_name = "S", value_parser = positive)]
    up_std_deg: Option<f64>,
    /// Take the lens from this calibration in place of finding it (then --plane is needed).
    #[arg(long, value_name = "CALIB", requires = "plane", conflicts_with = "images")]
    lens: Option<PathBuf>,
    #[command(flatten)]
    known: KnownArgs,
    /// Write the calibration here, and beside it the marked picture of the plane.
    #[arg(long, value_name = "CALIB")]
    out: Option<PathBuf>,
    /// Replace a calibration there that this program did not make, or that was changed since.
    #[arg(long)]
    force: bool,
    /// Print everything as one JSON document.
    #[arg(long)]
    json: bool,
}

/// `9x6`.
fn pattern(text: &str) -> Result<Corners, String> {
    let wrong = "expected inner corners across and down, such as 9x6";
    let (a, b) = text.split_once(['x', 'X', '×']).ok_or(wrong)?;
    let number = |t: &str| t.trim().parse::<usize>().map_err(|_| wrong.to_owned());
    Ok((number(a)?, number(b)?))
}

impl CalibrationWay for BoardArgs {
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
        let pattern = Pattern::new(self.pattern, self.square_m, self.square_std_m)?;
        let outcome = match &self.lens {
            Some(lens) => with_lens(self, &pattern, lens)?,
            None => with_pictures(self, pattern)?,
        };
        let board = BoardReport {
            views: &outcome.views,
            lens: outcome.lens.as_ref(),
            plane: outcome.plane.as_ref(),
            calibration: &outcome.calibration,
        };
        let still = outcome.picture.as_ref().filter(|_| self.out.is_some());
        Ok(MadeCalibration {
            table: table(&board),
            document: Some(documents::json_text(&BoardDocument::new(&board))?),
            warnings: warnings(&board),
            marks_png: still.map(|still| marked(self, &outcome, still)).transpose()?,
            recording: None,
            calibration: outcome.calibration,
        })
    }
}

/// What came of the pictures.
struct BoardOutcome {
    views: Vec<BoardView>,
    lens: Option<BoardLens>,
    plane: Option<MotionPlane>,
    calibration: Calibration,
    /// The picture of the plane.
    picture: Option<StillFrame>,
}

fn marks(args: &BoardArgs) -> PlaneMarks {
    PlaneMarks {
        up_px: args.up.unwrap_or(PlaneMarks::default().up_px),
        floor: args.floor.or(args.origin),
        edge: args.edge.or(args.origin),
    }
}

fn with_pictures(args: &BoardArgs, pattern: Pattern) -> anyhow::Result<BoardOutcome> {
    let mut views = BoardViews::new(pattern);
    let picture = args.plane.as_deref().map(|p| super::still(p, 0)).transpose()?;
    look_at_all(args, &pattern, &mut views)?;
    if let (Some(path), Some(picture)) = (&args.plane, &picture) {
        views.add_plane(path.display().to_string(), &picture.raw)?;
    }
    let lens = views.lens().inspect_err(|_| report_views(views.views()))?;
    let plane = lens.plane(&views, &marks(args))?;
    let calibration = complete(args, lens.calibration(plane.as_ref()), plane.as_ref());
    Ok(BoardOutcome {
        views: views.views().to_vec(),
        lens: Some(lens),
        plane,
        calibration,
        picture,
    })
}

/// Pictures named for one reason, at most.
const NAMED: usize = 3;

/// What became of the pictures, where the lens failed: it is what the user can mend.
fn report_views(views: &[BoardView]) {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for view in views {
        let ViewUse::Aside(reason) = &view.use_ else {
            continue;
        };
        match reasons.iter_mut().find(|(r, _)| r == reason) {
            Some((_, names)) => names.push(&view.name),
            None => reasons.push((reason, vec![&view.name])),
        }
    }
    for (reason, names) in reasons {
        let more = match names.len().saturating_sub(NAMED) {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let shown = &names[..names.len().min(NAMED)];
        say(&format!("{}{more}: set aside: {reason}", shown.join(", ")));
    }
}

fn with_lens(args: &BoardArgs, pattern: &Pattern, lens: &Path) -> anyhow::Result<BoardOutcome> {
    let known = Calibration::read(lens)?;
    let Some(path) = &args.plane else {
        bail!(
            "--lens takes the lens from a file, so that only the plane is left to find: give --plane IMAGE"
        );
    };
    let picture = super::still(path, 0)?;
    let name = path.display().to_string();
    let lens_name = lens.display().to_string();
    let (plane, calibration, view) =
        plane_with_lens((&name, &picture.raw), pattern, (&lens_name, &known), &marks(args))?;
    let calibration = complete(args, calibration, Some(&plane));
    Ok(BoardOutcome {
        views: vec![view],
        lens: None,
        plane: Some(plane),
        calibration,
        picture: Some(picture),
    })
}

/// The calibration with what the options say.
fn complete(args: &BoardArgs, mut calibration: Calibration, plane: Option<&MotionPlane>) -> Calibration {
    args.known.put(&mut calibration);
    calibration.up_std_rad = args.up_std_deg.map(f64::to_radians);
    if plane.is_some_and(|p| p.homography.origin_known) {
        calibration.origin_std_px = Some(args.point_std_px);
        calibration.launch.edge_x_m = (args.edge.is_some() || args.origin.is_some()).then_some(0.0);
    } else if let (None, Some([du, dv])) = (plane, args.up) {
        calibration.up_px = [du, dv].map(|x| x / du.hypot(dv));
        calibration.up_given = true;
    }
    calibration
}

/// Frames of a video that are looked at.
const FRAMES: usize = 40;

/// Looks for the board in every picture, several at a time; that of the plane has its own turn.
fn look_at_all(args: &BoardArgs, pattern: &Pattern, views: &mut BoardViews) -> anyhow::Result<()> {
    let sources = sources(&args.images, args.plane.as_deref())?;
    let bar = progress_bar(
        Some(sources.len() as u64),
        "looking for the board {wide_bar} {pos}/{len}",
    );
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some(path) = sources.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push((path, look_at(path, pattern)));
            bar.inc(1);
            bar.suspend(|| detail(|| format!("looked at {}", path.display())));
        }
        done
    };
    let threads = std::thread::available_parallelism().map_or(2, usize::from).min(8);
    let done = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .map(std::thread::ScopedJoinHandle::join)
            .collect::<Vec<_>>()
    });
    bar.finish_and_clear();
    let mut all = Vec::new();
    for part in done {
        all.extend(part.map_err(|_| {
            anyhow::anyhow!("a thread that looked for the board died; this is a fault of track")
        })?);
    }
    // In the order of the command line, whoever was ready first.
    all.sort_by_key(|(path, _)| sources.iter().position(|s| s == *path));
    for (_, looked) in all {
        for (name, looked) in looked? {
            match looked {
                Ok(looked) => views.add(name, looked),
                Err(reason) => views.add_unreadable(name, reason),
            }
        }
    }
    Ok(())
}

/// The files that are looked at, without that of the plane.
fn sources(paths: &[PathBuf], plane: Option<&Path>) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            files.extend(frames::pictures_in(path)?);
        } else {
            files.push(path.clone());
        }
    }
    if let Some(plane) = plane.and_then(|p| p.canonicalize().ok()) {
        files.retain(|p| p.canonicalize().ok().as_ref() != Some(&plane));
    }
    Ok(files)
}

/// A picture's name and what was found in it, or why it cannot be read.
type NamedSearch = (String, Result<BoardSearch, String>);

/// The picture at `path`, or frames of the video there.
fn look_at(path: &Path, pattern: &Pattern) -> anyhow::Result<Vec<NamedSearch>> {
    let name = path.display().to_string();
    if frames::is_picture(path) || !path.exists() {
        return match frames::open_picture(path) {
            Ok(picture) => Ok(vec![(name, Ok(pattern.search(&picture)?))]),
            Err(error @ frames::FrameError::Missing { .. }) => Err(error.into()),
            Err(error) => Ok(vec![(name, Err(error.to_string()))]),
        };
    }
    // Not a picture by its name: a video, whose error says what else it may be.
    frames::open_sparse(path, FRAMES)?
        .iter()
        .map(|frame| {
            Ok((
                format!("{name} at {:.2} s", frame.time_s),
                Ok(pattern.search(&frame.luma)?),
            ))
        })
        .collect()
}

/// The picture of the plane with the world's axes and a grid drawn in.
fn marked(args: &BoardArgs, made: &BoardOutcome, still: &StillFrame) -> anyhow::Result<Vec<u8>> {
    let map = made.calibration.rectification()?;
    let (width, height) = (still.luma.width as f64, still.luma.height as f64);
    let mut shapes = grid(&map, width, height);
    for (mark, ink) in [
        (args.floor, MarkColour::Green),
        (args.edge, MarkColour::Blue),
        (args.origin, MarkColour::Green),
    ] {
        shapes.extend(mark.map(|at| MarkShape::Ring { at, ink }));
    }
    if let Some(view) = made
        .views
        .iter()
        .find(|v| Some(&v.name) == plane_name(args).as_ref())
    {
        let corners = view.places();
        shapes.extend(corners.map(|at| MarkShape::Cross {
            at,
            ink: MarkColour::Red,
        }));
    }
    marks_png(&still.luma, &shapes).context("the picture of the marks could not be drawn")
}

fn plane_name(args: &BoardArgs) -> Option<String> {
    args.plane.as_ref().map(|p| p.display().to_string())
}

/// Lines of the plane every 1, 2 or 5 × 10ⁿ m, and its axes at the origin.
fn grid(map: &Rectification, width: f64, height: f64) -> Vec<MarkShape> {
    let rim = (0..=8).flat_map(|i| {
        let part = f64::from(i) / 8.0;
        [
            (part * width, 0.0),
            (part * width, height),
            (0.0, part * height),
            (width, part * height),
        ]
    });
    let places: Vec<PlanePoint> = rim
        .filter_map(|(u, v)| map.plane_from_pixel(PixelPoint::new(u, v)))
        .collect();
    let span = |of: fn(&PlanePoint) -> f64| {
        let values = places.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
            (a.min(x), b.max(x))
        })
    };
    let (x, z) = (span(|p| p.right), span(|p| p.up));
    let largest = (x.1 - x.0).max(z.1 - z.0);
    // A picture of a plane that reaches to its horizon has no size to divide.
    if !(largest.is_finite() && largest > 0.0) {
        return Vec::new();
    }
    let step = nice(largest / 12.0);
    let mut shapes = Vec::new();
    let mut line = |from: (f64, f64), to: (f64, f64)| {
        let points = (0..=40)
            .filter_map(|i| {
                let t = f64::from(i) / 40.0;
                map.pixel_from_plane(PlanePoint::new(
                    from.0 + t * (to.0 - from.0),
                    from.1 + t * (to.1 - from.1),
                ))
            })
            .collect();
        shapes.push(MarkShape::Line {
            points,
            ink: MarkColour::White,
            fine: true,
        });
    };
    let ticks = |(low, high): (f64, f64)| {
        let first = (low / step).ceil() as i64;
        (0..40)
            .map(move |i| (first + i) as f64 * step)
            .take_while(move |t| *t <= high)
    };
    ticks(x).for_each(|t| line((t, z.0), (t, z.1)));
    ticks(z).for_each(|t| line((x.0, t), (x.1, t)));
    let at = |right: f64, up: f64| map.pixel_from_plane(PlanePoint::new(right, up));
    if let (Some(from), Some(right), Some(up)) = (at(0.0, 0.0), at(2.0 * step, 0.0), at(0.0, 2.0 * step)) {
        for (to, ink, name) in [(right, MarkColour::Blue, "x"), (up, MarkColour::Green, "z")] {
            shapes.push(MarkShape::Arrow { from, to, ink });
            let text = format!("{name} = {} m", 2.0 * step);
            shapes.push(MarkShape::Label { at: to, text, ink });
        }
    }
    shapes
}

/// The next of 1, 2, 5 × 10ⁿ.
fn nice(x: f64) -> f64 {
    let power = 10_f64.powf(x.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|n| n * power)
        .find(|n| *n >= x)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_two_numbers() {
        assert_eq!(pattern("9x6"), Ok((9, 6)));
        assert_eq!(pattern("7X5"), Ok((7, 5)));
        for bad in ["9", "9x", "x6", "9 by 6", "-9x6"] {
            assert!(pattern(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn grids_have_round_steps() {
        for (x, expected) in [(0.083, 0.1), (0.0011, 0.002), (3.0, 5.0), (1.0, 1.0), (7.0, 10.0)] {
            assert!((nice(x) - expected).abs() < 1e-12 * expected, "{x}");
        }
    }
}
