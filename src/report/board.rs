//! What pictures of a board gave, as a table for people.

use super::escape::on_one_line;
use super::table::format_quantity;
use crate::calibration::Calibration;
use crate::calibration::board::{BoardLens, BoardView, COVERAGE_CELLS, Coverage, MotionPlane, ViewUse};
use crate::quantity::Quantity;
use std::fmt::Write as _;

/// Everything there is to say.
#[derive(Debug, Clone, Copy)]
pub struct BoardReport<'a> {
    /// The pictures.
    pub views: &'a [BoardView],
    /// The lens; `None` where it was given and not determined here.
    pub lens: Option<&'a BoardLens>,
    /// The plane of motion.
    pub plane: Option<&'a MotionPlane>,
    /// The calibration made of them.
    pub calibration: &'a Calibration,
}

/// A lens that is less certain than this somewhere in the picture is warned of, px.
const POOR_PX: f64 = 0.1;
/// Fewer views than this are few.
const FEW_VIEWS: usize = 8;
/// Deviation that corners of a flat board in focus stay below, px.
const ROUGH_PX: f64 = 0.5;

/// The table.
#[must_use]
pub fn table(board: &BoardReport<'_>) -> String {
    let mut text = String::new();
    if let Some(lens) = board.lens {
        lens_rows(&mut text, board, lens);
    }
    if let Some(plane) = board.plane {
        plane_rows(&mut text, plane);
    }
    text.push('\n');
    view_rows(&mut text, board.views);
    text
}

fn row(text: &mut String, name: &str, content: &str) {
    // Writing into a String cannot fail.
    let _ = writeln!(text, "{name:<12}{content}");
}

fn lens_rows(text: &mut String, board: &BoardReport<'_>, lens: &BoardLens) {
    let used = used(board.views).count();
    let (width, height) = lens.size_px;
    row(
        text,
        "lens",
        &format!(
            "from {used} of {} pictures with {} corners, {width} × {height} px; misfit {:.3} px rms",
            board.views.len(),
            lens.corners,
            lens.fit.rms_px
        ),
    );
    let numbers = numbers(board.calibration);
    let say = |i: usize, unit: &str| {
        let (value, std) = numbers[i];
        if std.is_none() && value == 0.0 {
            return "0".to_owned();
        }
        format_quantity(
            Some(Quantity {
                value,
                std_uncertainty: std,
            }),
            unit,
        )
    };
    row(
        text,
        "focal",
        &format!("fx {}, fy {}", say(0, "px"), say(1, "px")),
    );
    row(
        text,
        "centre",
        &format!("cx {}, cy {}", say(2, "px"), say(3, "px")),
    );
    row(
        text,
        "distortion",
        &format!("k1 {}, k2 {}, k3 {}", say(4, ""), say(5, ""), say(8, "")),
    );
    row(text, "", &format!("p1 {}, p2 {}", say(6, ""), say(7, "")));
    let coverage = &lens.coverage;
    row(
        text,
        "sure to",
        &format!(
            "{:.3} px in the picture's middle, {:.3} px at its worst place, [{:.0}, {:.0}]",
            middle(coverage),
            coverage.worst_std_px,
            coverage.worst_at.u_px.max(0.0),
            coverage.worst_at.v_px.max(0.0)
        ),
    );
    row(
        text,
        "coverage",
        &format!("corners (#) in {:.0} % of the picture", 100.0 * coverage.share()),
    );
    for cells in coverage.cells.chunks(COVERAGE_CELLS.0) {
        let line: String = cells.iter().map(|&c| if c { '#' } else { '·' }).collect();
        row(text, "", &line);
    }
}

fn plane_rows(text: &mut String, plane: &MotionPlane) {
    row(
        text,
        "plane",
        &format!(
            "{:.3} m away along the line of sight, turned by {:.2}° from square; its upright edge leans by {:.2}° in the picture",
            plane.distance_m,
            plane.tilt_rad.to_degrees(),
            plane.lean_rad.to_degrees()
        ),
    );
    let origin = if plane.homography.origin_known {
        "where it was marked"
    } else {
        "not marked: the board's lower left corner, for drawing only"
    };
    row(text, "origin", origin);
}

fn view_rows(text: &mut String, views: &[BoardView]) {
    let width = views
        .iter()
        .map(|v| on_one_line(&v.name).chars().count())
        .max()
        .unwrap_or(0)
        .clamp(7, 48);
    let _ = writeln!(text, "{:<width$}  corners  misfit px  turned", "picture");
    for view in views {
        let name = on_one_line(&view.name);
        match &view.use_ {
            ViewUse::Used { rms_px, tilt_rad } => {
                let _ = writeln!(
                    text,
                    "{:<width$}  {:>7}  {rms_px:>9.3}  {:>5.0}°",
                    name,
                    view.corners(),
                    tilt_rad.to_degrees()
                );
            }
            ViewUse::Found => {
                let _ = writeln!(text, "{name:<width$}  {:>7}", view.corners());
            }
            ViewUse::Aside(reason) => {
                let _ = writeln!(text, "{name:<width$}  set aside: {}", on_one_line(reason));
            }
        }
    }
}

fn used(views: &[BoardView]) -> impl Iterator<Item = &BoardView> {
    views.iter().filter(|v| matches!(v.use_, ViewUse::Used { .. }))
}

/// The lens's nine numbers with their standard uncertainties.
fn numbers(c: &Calibration) -> [(f64, Option<f64>); 9] {
    let mut values = [0.0; 9];
    if let Some(lens) = &c.lens {
        let m = lens.camera_matrix();
        values[..4].copy_from_slice(&[m[(0, 0)], m[(1, 1)], m[(0, 2)], m[(1, 2)]]);
        values[4..].copy_from_slice(&lens.distortion());
    }
    std::array::from_fn(|i| (values[i], c.lens_std[i]))
}

fn middle(coverage: &Coverage) -> f64 {
    let (columns, rows) = COVERAGE_CELLS;
    coverage
        .std_px
        .get(columns * (rows / 2) + columns / 2)
        .copied()
        .unwrap_or(f64::NAN)
}

/// What the user has to know, in sentences.
#[must_use]
pub fn warnings(board: &BoardReport<'_>) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(lens) = board.lens {
        let count = used(board.views).count();
        if count < FEW_VIEWS {
            out.push(format!(
                "few_views: {count} usable pictures are few; 10 to 20 with the board turned to all sides make the lens surer"
            ));
        }
        let coverage = &lens.coverage;
        if !(coverage.worst_std_px <= POOR_PX) {
            out.push(format!(
                "poor_coverage: the lens is only sure to {:.2} px near [{:.0}, {:.0}]: take pictures with the board there (corners \
                 were seen in {:.0} % of the picture); what flies there is measured worse, and the uncertainties say so",
                coverage.worst_std_px,
                coverage.worst_at.u_px.max(0.0),
                coverage.worst_at.v_px.max(0.0),
                100.0 * coverage.share()
            ));
        }
        if lens.fit.rms_px > ROUGH_PX {
            out.push(format!(
                "rough_corners: corners miss by {:.2} px rms, where a flat board in focus has 0.1: is it glued to something \
                 flat, sharp in the pictures, and the pattern printed without scaling in one direction?",
                lens.fit.rms_px
            ));
        }
    }
    match board.plane {
        Some(plane) => {
            if board.calibration.up_std_rad.is_none() {
                out.push(
                    "up_uncertainty_unknown: how upright the board stood is known to you alone; --up-std-deg says it (about 0.1 \
                     with a spirit level), and angles get it in their uncertainty"
                        .to_owned(),
                );
            }
            if plane.homography.relative_std.is_none() {
                out.push(
                    "square_uncertainty_unknown: the squares count as exact; measure the board across many of them and give \
                     --square-std-m (200.0 ± 0.2 mm over 8 squares: 0.000025)"
                        .to_owned(),
                );
            }
            if !plane.homography.origin_known {
                out.push(
                    "origin_unknown: no --floor (and --edge) was marked, so the floor will be found from the impacts, and x0 is \
                     left out"
                        .to_owned(),
                );
            }
        }
        None => out.push(
            "scale_from_fall: this is a lens without a scale, so the fall is the scale for now; add one with --plane, or with \
             track calibrate ruler VIDEO --lens THIS_FILE"
                .to_owned(),
        ),
    }
    out
}
