//! `track calibrate ruler VIDEO --from U,V --to U,V --length-m L [--floor U,V --edge U,V] [--floor-line U,V U,V] [--out CALIB]`.

use super::{CalibrationWay, KnownArgs, MadeCalibration, StillFrame, direction, pixel, positive};
use crate::calibration::ruler::{
    MarkRole, PageMarks, PictureMark, RulerCalibration, RulerOrientation, RulerRequest, calibrate,
};
use crate::calibration::{Calibration, Rectification, Ruler, Scale, ScaleEvidence, View};
use crate::frames::{self, Luma};
use crate::geometry::{PixelPoint, PlanePoint};
use crate::report::marked_frame::{MarkColour, MarkShape, marks_png};
use crate::report::table::format_quantity;
use anyhow::{Context, bail};
use clap::{ArgAction, Args, ValueEnum};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Marks in a frame, and what they mean.
#[derive(Debug, Args)]
pub(super) struct RulerArgs {
    /// The recording (or a picture taken in the same mode).
    video: PathBuf,
    /// One end of a known length in the plane of motion, px: column, row.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true, requires = "to", requires = "length_m")]
    from: Option<PixelPoint>,
    /// The other end.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true, requires = "from")]
    to: Option<PixelPoint>,
    /// The length between them, m.
    #[arg(long, value_name = "L", value_parser = positive, requires = "from")]
    length_m: Option<f64>,
    /// Its standard uncertainty, m.
    #[arg(long, value_name = "S", value_parser = positive, requires = "length_m")]
    length_std_m: Option<f64>,
    /// Take the fall as the scale.
    #[arg(long, conflicts_with = "from")]
    gravity: bool,
    /// How the ruler stood; tells "up".
    #[arg(long, value_enum, requires = "from")]
    held: Option<HeldArg>,
    /// A point at the height of the floor.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true)]
    floor: Option<PixelPoint>,
    /// A point at the x of the launch edge.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true)]
    edge: Option<PixelPoint>,
    /// Both in one: the point at x = 0 at the floor.
    #[arg(long, value_name = "U,V", value_parser = pixel, allow_hyphen_values = true, conflicts_with_all = ["floor", "edge"])]
    origin: Option<PixelPoint>,
    /// Two points on a line along the floor, in the plane of motion: tells how the floor slopes.
    // No hyphens: an option that follows a single point is no second point.
    #[arg(long, value_names = ["U,V", "U,V"], value_parser = pixel, num_args = 2, action = ArgAction::Set)]
    floor_line: Option<Vec<PixelPoint>>,
    /// Move from, to, floor, edge and floor-line to the nearest edge in the picture, up to PX (10) pixels.
    #[arg(long, value_name = "PX", value_parser = positive, num_args = 0..=1, require_equals = true, default_missing_value = "10")]
    snap: Option<f64>,
    /// How well marks were read by eye, each coordinate, px.
    #[arg(long, value_name = "S", value_parser = positive, default_value = "1")]
    point_std_px: f64,
    /// Direction of "up" in the picture: 1,0 for a camera on its side. Without it the fall tells.
    #[arg(long, value_name = "DU,DV", value_parser = direction, allow_hyphen_values = true)]
    up: Option<[f64; 2]>,
    /// Standard uncertainty of "up" (or of how the ruler stood), degrees.
    #[arg(long, value_name = "S", value_parser = positive)]
    up_std_deg: Option<f64>,
    /// Take the lens from this calibration (of track calibrate board).
    #[arg(long, value_name = "CALIB")]
    lens: Option<PathBuf>,
    /// Take the marks from this file, as the page of track calibrate show saves it.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["from", "to", "gravity", "held", "floor", "edge", "origin", "floor_line", "snap", "point_std_px", "up", "up_std_deg", "lens", "ball_radius_m", "ball_mass_kg", "frame_rate_hz", "gravity_m_s2", "view"])]
    marks: Option<PathBuf>,
    /// Number of the frame in which the marks were read, from 0.
    #[arg(long, value_name = "N", default_value = "0")]
    frame: usize,
    #[command(flatten)]
    known: KnownArgs,
    /// Write the calibration here, and beside it the frame with the marks drawn in.
    #[arg(long, value_name = "CALIB")]
    out: Option<PathBuf>,
    /// Replace files there that this program did not make, or that were changed since.
    #[arg(long)]
    force: bool,
    /// Print the calibration as JSON in place of the table.
    #[arg(long)]
    json: bool,
}

/// How the ruler stood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HeldArg {
    /// Along a plumb line.
    Upright,
    /// Along the floor.
    Level,
}

impl CalibrationWay for RulerArgs {
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
        let still = super::still(&self.video, self.frame)?;
        let request = match &self.marks {
            Some(path) => from_page(path, &self.video, &still)?,
            None => request(self)?,
        };
        let ruled = calibrate(&request, &still.raw)?;
        let marks_png = match self.out {
            Some(_) => Some(picture(
                &still.luma,
                &shapes(&ruled, still.luma.width, still.luma.height)?,
            )?),
            None => None,
        };
        Ok(MadeCalibration {
            table: table(&ruled),
            document: None,
            warnings: Vec::new(),
            marks_png,
            // A picture taken in the recording's mode has no times to judge.
            recording: super::facts(&self.video)
                .ok()
                .filter(|_| !frames::is_picture(&self.video)),
            calibration: ruled.calibration,
        })
    }
}

/// The marks of the page, for pictures of the recording's size.
fn from_page(path: &Path, video: &Path, still: &StillFrame) -> anyhow::Result<RulerRequest> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let marks = PageMarks::parse(&text, &path.display().to_string())?;
    let (size, found) = (marks.image_size_px, (still.raw.width, still.raw.height));
    if found != size {
        bail!(
            "{} is for pictures of {}x{} px, {} has {}x{} px: give the recording that was marked",
            path.display(),
            size.0,
            size.1,
            video.display(),
            found.0,
            found.1
        );
    }
    Ok(marks.request)
}

fn request(args: &RulerArgs) -> anyhow::Result<RulerRequest> {
    let scale = match (args.from, args.to, args.length_m) {
        (Some(from), Some(to), Some(length_m)) => Scale::Ruler(Ruler {
            from,
            to,
            length_m,
            length_std_m: args.length_std_m,
            point_std_px: None,
        }),
        _ if args.gravity => Scale::Gravity,
        _ if args.known.ball_radius_m.is_some() => Scale::Ball,
        _ => bail!(
            "no scale: give --from U,V --to U,V --length-m L (two marks in the plane of motion and the length between \
             them), or --ball-radius-m R (the ball is the scale), or --gravity (the fall is the scale)"
        ),
    };
    let mut known = args.known.calibration();
    if let Some(path) = &args.lens {
        let with_lens = Calibration::read(path)?;
        if with_lens.lens.is_none() {
            bail!(
                "{} (--lens) holds no lens: accepted is a calib.json as track calibrate board writes it; leave --lens out to \
                 measure without a lens",
                path.display()
            );
        }
        known.lens = with_lens.lens;
        known.lens_std = with_lens.lens_std;
        known.deviations = with_lens.deviations;
        known
            .deviations
            .iter_mut()
            .for_each(|d| d.world_from_pixel = None);
        lens_fits(args, path, with_lens.image_size_px)?;
    }
    Ok(RulerRequest {
        scale,
        held: args.held.map(|h| match h {
            HeldArg::Upright => RulerOrientation::Upright,
            HeldArg::Level => RulerOrientation::Level,
        }),
        up_px: args
            .up
            .map_or([0.0, -1.0], |[du, dv]| [du, dv].map(|x| x / du.hypot(dv))),
        up_given: args.up.is_some(),
        up_std_rad: args.up_std_deg.map(f64::to_radians),
        origin: args.origin,
        floor: args.floor,
        edge: args.edge,
        floor_line: args
            .floor_line
            .as_ref()
            .and_then(|ends| Some([*ends.first()?, *ends.get(1)?])),
        point_std_px: args.point_std_px,
        snap_px: args.snap,
        known,
    })
}

/// A lens belongs to one size of picture.
fn lens_fits(args: &RulerArgs, lens: &Path, size: Option<(usize, usize)>) -> anyhow::Result<()> {
    let Some(size) = size else { return Ok(()) };
    let still = super::still(&args.video, args.frame)?;
    let found = (still.raw.width, still.raw.height);
    if found != size {
        bail!(
            "{} (--lens) is for pictures of {}x{} px, {} has {}x{} px: take the pictures of the board in the recording's mode",
            lens.display(),
            size.0,
            size.1,
            args.video.display(),
            found.0,
            found.1
        );
    }
    Ok(())
}

fn table(ruled: &RulerCalibration) -> String {
    let c = &ruled.calibration;
    let mut text = String::new();
    let mut row = |name: &str, content: String| {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{name:<11}{content}");
    };
    let scale = c.scale.in_words().map_or_else(
        || {
            let q = c.metres_per_unit(&ScaleEvidence::default()).ok();
            let relative = q.and_then(|q| Some(100.0 * q.std_uncertainty? / q.value));
            format!(
                "{} a pixel{}",
                format_quantity(q.map(|q| q.scaled(1e3)), "mm"),
                relative.map_or(String::new(), |r| format!(
                    "; every length and speed is uncertain by {r:.2} % from this"
                ))
            )
        },
        str::to_owned,
    );
    row("scale", scale);
    let of_line = |mark: &&PictureMark| matches!(mark.role, MarkRole::LineFrom | MarkRole::LineTo);
    for mark in ruled.marks.iter().filter(|m| !of_line(m)) {
        row(&mark.role.option()[2..], place(mark));
    }
    if let Some(direction) = line_direction(c) {
        row("floor line", direction);
    }
    for mark in ruled.marks.iter().filter(of_line) {
        row("", place(mark));
    }
    if let Some(origin) = c.origin_px {
        let edge = match c.launch.edge_x_m {
            Some(_) => "",
            None => "; x = 0 is where the floor was marked, the launch edge is not known",
        };
        row(
            "origin",
            format!("[{:.2}, {:.2}] px{edge}", origin.u_px, origin.v_px),
        );
    }
    let [a, b] = c.up_px;
    row(
        "up",
        if up_is_known(c) {
            format!(
                "{:.2} ± {:.2}° clockwise from the picture's own",
                a.atan2(-b).to_degrees() + 0.0,
                c.upright_std_rad().to_degrees()
            )
        } else if c.view == View::Top {
            // From above nothing falls along the picture.
            "not given: the picture's own".into()
        } else {
            "not given: the fall tells".into()
        },
    );
    text
}

/// Whether anything was said of "up"; else the fall alone tells.
const fn up_is_known(c: &Calibration) -> bool {
    c.up_given || c.up_std_rad.is_some()
}

/// How the line along the floor lies against "up".
fn line_direction(c: &Calibration) -> Option<String> {
    let line = c.floor.line?;
    let rise_deg = line.rise_rad(&c.rectification().ok()?)?.to_degrees();
    let (std_rad, against) = if up_is_known(c) {
        (line.std_rad().hypot(c.upright_std_rad()), "\"up\"")
    } else {
        // How the camera leaned is in neither number.
        (
            line.std_rad(),
            "the picture's own \"up\" (the fall tells the true one)",
        )
    };
    Some(format!(
        "rises by {:.2} ± {:.2}° to the right, against {against}",
        rise_deg + 0.0,
        std_rad.to_degrees()
    ))
}

fn place(mark: &PictureMark) -> String {
    let at = format!("[{:.2}, {:.2}] px", mark.at.u_px, mark.at.v_px);
    match mark.snapped {
        Some(s) => format!(
            "{at}, moved by {:.2} px to {} (± {:.2} px)",
            s.moved_px,
            if s.line { "the middle of a line" } else { "an edge" },
            s.std_px
        ),
        None => format!("{at}, as given"),
    }
}

fn picture(frame: &Luma, shapes: &[MarkShape]) -> anyhow::Result<Vec<u8>> {
    marks_png(frame, shapes).context("the picture of the marks could not be drawn")
}

/// The marks as they were meant.
fn shapes(ruled: &RulerCalibration, width: usize, height: usize) -> anyhow::Result<Vec<MarkShape>> {
    let map = ruled.calibration.rectification()?;
    let at = |role: MarkRole| ruled.marks.iter().find(|m| m.role == role).map(|m| m.at);
    let mut shapes = Vec::new();
    if let (Some(from), Some(to)) = (at(MarkRole::From), at(MarkRole::To)) {
        shapes.push(MarkShape::Line {
            points: vec![from, to],
            ink: MarkColour::Orange,
            fine: true,
        });
        if let Some(length_m) = ruled.calibration.scale.known_length_m() {
            let middle = PixelPoint::new(0.5 * (from.u_px + to.u_px), 0.5 * (from.v_px + to.v_px));
            let text = format!("{length_m} m");
            shapes.push(MarkShape::Label {
                at: middle,
                text,
                ink: MarkColour::Orange,
            });
        }
    }
    if let (Some(from), Some(to)) = (at(MarkRole::LineFrom), at(MarkRole::LineTo)) {
        shapes.push(MarkShape::Line {
            points: vec![from, to],
            ink: MarkColour::Green,
            fine: true,
        });
    }
    let reach = (width as f64).hypot(height as f64);
    for (role, across, ink) in [
        (MarkRole::Floor, true, MarkColour::Green),
        (MarkRole::Edge, false, MarkColour::Blue),
    ] {
        if let Some(points) = at(role).and_then(|p| through(&map, p, across, reach)) {
            shapes.push(MarkShape::Line {
                points,
                ink,
                fine: true,
            });
        }
    }
    for mark in &ruled.marks {
        let ink = match mark.role {
            MarkRole::From | MarkRole::To => MarkColour::Orange,
            MarkRole::Floor | MarkRole::Origin | MarkRole::LineFrom | MarkRole::LineTo => MarkColour::Green,
            MarkRole::Edge => MarkColour::Blue,
        };
        shapes.push(MarkShape::Ring { at: mark.at, ink });
        if mark.snapped.is_some() {
            shapes.push(MarkShape::Cross {
                at: mark.given,
                ink: MarkColour::White,
            });
        }
        if mark.role == MarkRole::LineTo {
            // Its other end is named.
            continue;
        }
        let text = mark.role.option()[2..].replace('-', " ");
        shapes.push(MarkShape::Label {
            at: mark.at,
            text,
            ink,
        });
    }
    shapes.extend(up_arrow(&map, width, height));
    Ok(shapes)
}

/// The line through a mark along the floor, or along "up", as the lens shows it.
fn through(map: &Rectification, mark: PixelPoint, across: bool, reach: f64) -> Option<Vec<PixelPoint>> {
    let p = map.plane_from_pixel(mark)?;
    let points = (-40..=40).filter_map(|i| {
        let t = f64::from(i) / 40.0 * reach;
        map.pixel_from_plane(if across {
            PlanePoint::new(p.right + t, p.up)
        } else {
            PlanePoint::new(p.right, p.up + t)
        })
    });
    Some(points.collect())
}

fn up_arrow(map: &Rectification, width: usize, height: usize) -> Option<MarkShape> {
    let (w, h) = (width as f64, height as f64);
    let from = PixelPoint::new(0.93 * w, 0.25 * h);
    let foot = map.plane_from_pixel(from)?;
    let to = map.pixel_from_plane(PlanePoint::new(foot.right, foot.up + 0.15 * w.min(h)))?;
    Some(MarkShape::Arrow {
        from,
        to,
        ink: MarkColour::Green,
    })
}
