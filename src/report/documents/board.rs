//! What `track calibrate board --json` prints: schema `track.board/1`.

use crate::Build;
use crate::calibration::board::{BoardView, COVERAGE_CELLS, ViewUse};
use crate::report::board::{BoardReport, warnings};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

/// The schema that [`BoardDocument`] follows.
pub const SCHEMA: &str = "track.board/1";

/// What pictures of a board gave.
#[derive(Debug, Serialize, JsonSchema)]
pub struct BoardDocument<'a> {
    /// `track.board/1`.
    pub schema: &'static str,
    /// The program that wrote it.
    #[serde(flatten)]
    pub build: Build,
    /// The calibration made of them, as its file holds it.
    pub calib: Value,
    /// The lens; `null` where it was given and not determined here.
    pub lens: Option<LensDocument<'a>>,
    /// The plane of motion.
    pub plane: Option<PlaneDocument>,
    /// What became of each picture.
    pub pictures: Vec<PictureDocument<'a>>,
    /// What the user has to know.
    pub warnings: Vec<String>,
}

/// A lens.
#[derive(Debug, Serialize, JsonSchema)]
pub struct LensDocument<'a> {
    /// Corners in use.
    pub corners: usize,
    /// Their misfit.
    pub rms_px: f64,
    /// Where in the picture it is how sure.
    pub coverage: CoverageDocument<'a>,
}

/// Where in the picture corners were seen, and how sure the lens is there. Cells run row by row from the top left.
#[derive(Debug, Serialize, JsonSchema)]
pub struct CoverageDocument<'a> {
    /// Share of the cells with corners.
    pub share: f64,
    /// Cells across.
    pub columns: usize,
    /// Cells down.
    pub rows: usize,
    /// Whether corners were seen in a cell.
    pub cells: &'a [bool],
    /// Standard uncertainty of a place in a cell.
    #[schemars(with = "Vec<Option<f64>>")]
    pub std_px: &'a [f64],
    /// The worst of them.
    #[schemars(with = "Option<f64>")]
    pub worst_std_px: f64,
    /// Where that is.
    pub worst_at_px: [f64; 2],
}

/// The plane of motion.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PlaneDocument {
    /// From the camera along its optical axis, as the calibration's key of that name.
    pub distance_m: f64,
    /// Turned from square.
    pub tilt_deg: f64,
    /// How its upright edge leans in the picture.
    pub lean_deg: f64,
}

/// A picture of the board.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PictureDocument<'a> {
    /// Its file.
    pub name: &'a str,
    /// Whether it is in use.
    pub used: bool,
    /// Corners found.
    pub corners: usize,
    /// Their misfit.
    pub rms_px: Option<f64>,
    /// How the board was turned.
    pub tilt_deg: Option<f64>,
    /// Why it is not in use.
    pub reason: Option<&'a str>,
}

impl<'a> BoardDocument<'a> {
    /// The document of what pictures of a board gave.
    #[must_use]
    pub fn new(board: &BoardReport<'a>) -> Self {
        Self {
            schema: SCHEMA,
            build: Build::THIS,
            calib: board.calibration.to_json(),
            lens: board.lens.map(|lens| {
                let coverage = &lens.coverage;
                let (columns, rows) = COVERAGE_CELLS;
                LensDocument {
                    corners: lens.corners,
                    rms_px: lens.fit.rms_px,
                    coverage: CoverageDocument {
                        share: coverage.share(),
                        columns,
                        rows,
                        cells: &coverage.cells,
                        std_px: &coverage.std_px,
                        worst_std_px: coverage.worst_std_px,
                        worst_at_px: [coverage.worst_at.u_px, coverage.worst_at.v_px],
                    },
                }
            }),
            plane: board.plane.map(|plane| PlaneDocument {
                distance_m: plane.distance_m,
                tilt_deg: plane.tilt_rad.to_degrees(),
                lean_deg: plane.lean_rad.to_degrees(),
            }),
            pictures: board.views.iter().map(picture).collect(),
            warnings: warnings(board),
        }
    }
}

fn picture(view: &BoardView) -> PictureDocument<'_> {
    let (rms_px, tilt_rad, reason) = match &view.use_ {
        ViewUse::Used { rms_px, tilt_rad } => (Some(*rms_px), Some(*tilt_rad), None),
        ViewUse::Found => (None, None, None),
        ViewUse::Aside(reason) => (None, None, Some(reason.as_str())),
    };
    PictureDocument {
        name: &view.name,
        used: reason.is_none(),
        corners: view.corners(),
        rms_px,
        tilt_deg: tilt_rad.map(f64::to_degrees),
        reason,
    }
}
