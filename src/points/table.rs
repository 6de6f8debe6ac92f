//! A table of centres: one line of column names, a row a centre.
//!
//! | column | also called | holds |
//! |---|---|---|
//! | `frame` | `step`, `frame_number` | number of the frame |
//! | `time_s` | `t`, `time`, `t (s)`; `time_ms` | time, s (ms) |
//! | `u_px`, `v_px` | `x`, `y` where there is no time (trackpy) | the centre in the picture, px; (0, 0) is the centre of the top-left pixel |
//! | `x_m`, `z_m` | `x`, `y` where there is a time (Tracker, Kinovea) | the centre in the world, m; x to the right, z up |
//! | `std_px` | | standard uncertainty of each coordinate, px |
//!
//! Other columns are left unread. Rows whose place is empty (or NaN, as trackpy has it) are frames without the ball. Where pixels and metres are both there (as
//! in `NAME.points.csv`), pixels count: the calibration makes metres of them. A line before the column names that holds none of them (Tracker
//! writes the name of the mass there) is left out.

use super::{GivenPlace, GivenPoint, GivenPoints};
use crate::config::table::{Table, TableRow, place};
use crate::config::{FileError, FileKind, FileProblem, clipped, read_bytes};
use crate::geometry::{PixelPoint, WorldPoint};
use std::path::Path;

/// A table of centres, for messages about a file.
static KIND: FileKind = FileKind {
    what: "table of centres",
    form: "a CSV file in UTF-8 with one line of column names",
    source: "Tracker, trackpy and Kinovea export it",
    least: "frame,u_px,v_px",
};

/// Hours at a thousand frames a second are smaller.
const LARGEST_FILE_BYTES: u64 = 500_000_000;

/// A frame of a higher number is a mistake: it is a day at a thousand frames a second.
const LAST_FRAME: f64 = 1e8;

const ACCEPTED: &str = "frame or time_s, and u_px with v_px, or x_m with z_m";

/// Reads the table at `path`.
///
/// # Errors
/// See [`FileError`]; all problems at once.
pub fn read(path: &Path) -> Result<GivenPoints, FileError> {
    let bytes = read_bytes(path, &KIND, LARGEST_FILE_BYTES)?;
    parse(&bytes, &path.display().to_string())
}

/// The centres in `bytes`, the contents of the file `name`.
///
/// # Errors
/// See [`FileError`].
pub fn parse(bytes: &[u8], name: &str) -> Result<GivenPoints, FileError> {
    let mut table = Table::parse(bytes, name, &KIND)?;
    let is_known = |cell: &str| PointColumn::named(cell).is_some();
    if !table.head.columns.iter().any(|c| is_known(c))
        && table
            .rows
            .first()
            .is_some_and(|row| row.cells.iter().any(|c| is_known(c)))
    {
        let header = table.rows.remove(0);
        (table.head.columns, table.head.line) = (header.cells, header.line);
    }
    let invalid = |problems: Vec<FileProblem>| FileError::Invalid {
        name: name.to_owned(),
        problems,
    };
    let columns = Columns::of(&table).map_err(|problem| invalid(vec![problem]))?;
    let mut problems = Vec::new();
    let mut rows = Vec::new();
    for row in &table.rows {
        match columns.point(&table, row) {
            Ok(Some(point)) => rows.push(point),
            Ok(None) => {}
            Err(problem) => problems.push(problem),
        }
    }
    if rows.is_empty() && problems.is_empty() {
        problems.push(FileProblem::new(
            "",
            "no row with a centre",
            "a row a frame",
            "export the table again with the ball's positions in it",
        ));
    }
    if !problems.is_empty() {
        return Err(invalid(problems));
    }
    Ok(numbered(rows, columns.frame.is_some()))
}

/// The points in the order of their frames; where the file numbers none, by the rank of their times.
fn numbered(mut points: Vec<GivenPoint>, has_frames: bool) -> GivenPoints {
    if has_frames {
        points.sort_by_key(|p| p.frame);
    } else {
        let time = |p: &GivenPoint| p.time_s.unwrap_or(0.0);
        points.sort_by(|a, b| time(a).total_cmp(&time(b)));
        let mut frame = 0;
        for i in 1..points.len() {
            if time(&points[i]) > time(&points[i - 1]) {
                frame += 1;
            }
            points[i].frame = frame;
        }
    }
    GivenPoints { points, has_frames }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PointColumn {
    Frame,
    Seconds,
    Milliseconds,
    Right,
    Down,
    X,
    Y,
    XMetres,
    ZMetres,
    Std,
}

impl PointColumn {
    /// The column that a name means.
    fn named(name: &str) -> Option<Self> {
        let name = name.trim().to_lowercase();
        let plain: String = name.chars().filter(|c| !c.is_whitespace()).collect();
        Some(match plain.as_str() {
            "frame" | "frame_number" | "framenumber" | "step" => Self::Frame,
            "time_s" | "t" | "t(s)" | "time" | "time(s)" | "t_s" => Self::Seconds,
            "time_ms" | "time(ms)" | "t(ms)" => Self::Milliseconds,
            "u_px" => Self::Right,
            "v_px" => Self::Down,
            "x" | "x(m)" => Self::X,
            "y" | "y(m)" => Self::Y,
            "x_m" => Self::XMetres,
            "z_m" | "y_m" => Self::ZMetres,
            "std_px" => Self::Std,
            _ => return None,
        })
    }
}

/// Where the columns stand.
struct Columns {
    frame: Option<usize>,
    /// With what a cell is multiplied to be seconds.
    time: Option<(usize, f64)>,
    place: (usize, usize),
    is_world: bool,
    std: Option<usize>,
}

impl Columns {
    fn of(table: &Table) -> Result<Self, FileProblem> {
        let at = |wanted: PointColumn| {
            table
                .head
                .columns
                .iter()
                .position(|c| PointColumn::named(c) == Some(wanted))
        };
        let frame = at(PointColumn::Frame);
        let time = at(PointColumn::Seconds).map(|i| (i, 1.0));
        let time = time.or(at(PointColumn::Milliseconds).map(|i| (i, 1e-3)));
        let pair = |a: PointColumn, b: PointColumn| at(a).zip(at(b));
        let (place, is_world) = if let Some(place) = pair(PointColumn::Right, PointColumn::Down) {
            (Some(place), false)
        } else if let Some(place) = pair(PointColumn::XMetres, PointColumn::ZMetres) {
            (Some(place), true)
        } else {
            // trackpy numbers frames and has pixels; Tracker has times and metres.
            (pair(PointColumn::X, PointColumn::Y), time.is_some())
        };
        let missing = |found: &str| {
            FileProblem::new(
                format!("line {}", table.head.line),
                format!("{found} ({})", clipped(&table.head.columns.join(", "))),
                ACCEPTED,
                "name the columns so, or export the table again with them",
            )
        };
        let place = place.ok_or_else(|| missing("no columns of a place"))?;
        if frame.is_none() && time.is_none() {
            return Err(missing("neither frames nor times"));
        }
        Ok(Self {
            frame,
            time,
            place,
            is_world,
            std: at(PointColumn::Std),
        })
    }

    /// The centre of a row; `None` of a frame without the ball.
    fn point(&self, table: &Table, row: &TableRow) -> Result<Option<GivenPoint>, FileProblem> {
        let cell = |i: usize| row.cells.get(i).map_or("", String::as_str);
        let problem = |i: usize, accepted: &str| {
            FileProblem::new(
                place(row.line, &table.head.columns[i]),
                clipped(cell(i)),
                accepted,
                "correct it, or leave out the row",
            )
        };
        let number = |i: usize| {
            if cell(i).is_empty() || cell(i).eq_ignore_ascii_case("nan") {
                return Ok(None);
            }
            let number = table.head.number(cell(i)).filter(|x| x.is_finite());
            number.map(Some).ok_or_else(|| problem(i, "a finite number"))
        };
        let (Some(a), Some(b)) = (number(self.place.0)?, number(self.place.1)?) else {
            return Ok(None);
        };
        let frame = match self.frame {
            None => 0,
            Some(i) => number(i)?
                .filter(|n| (0.0..=LAST_FRAME).contains(n) && n.fract() == 0.0)
                .ok_or_else(|| problem(i, "a whole number from 0 to 100000000"))?
                as usize,
        };
        let time_s = match self.time {
            None => None,
            Some((i, unit_s)) => Some(number(i)?.ok_or_else(|| problem(i, "a time"))? * unit_s),
        };
        let std_px = match self.std {
            None => None,
            Some(i) => match number(i)? {
                Some(std) if !(std > 0.0) => return Err(problem(i, "a number above 0, or nothing")),
                std => std,
            },
        };
        Ok(Some(GivenPoint {
            frame,
            time_s,
            place: if self.is_world {
                GivenPlace::World(WorldPoint { x_m: a, up_m: b })
            } else {
                GivenPlace::Picture(PixelPoint::new(a, b))
            },
            std_px,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(text: &str) -> Vec<GivenPoint> {
        parse(text.as_bytes(), "points.csv").unwrap().points
    }

    #[test]
    fn pixels_metres_and_names_of_other_programs() {
        let own = points("frame,time_s,u_px,v_px,std_px,x_m,z_m\n3,0.5,10,20,0.1,7,8\n");
        assert_eq!(own[0].place, GivenPlace::Picture(PixelPoint::new(10.0, 20.0)));
        assert_eq!(
            (own[0].frame, own[0].time_s, own[0].std_px),
            (3, Some(0.5), Some(0.1))
        );

        let trackpy = points(",y,x,mass,ep,frame,particle\n0,20.5,10,99,nan,4,0\n1,nan,10,9,1,5,0\n");
        assert_eq!(trackpy.len(), 1);
        assert_eq!(trackpy[0].place, GivenPlace::Picture(PixelPoint::new(10.0, 20.5)));

        let tracker = points("mass A\t\t\nt\tx\ty\n0.0\t1.0E-1\t2.0\n4.0E-3\t0.2\t1.9\n");
        let world = |x_m, up_m| GivenPlace::World(WorldPoint { x_m, up_m });
        assert_eq!(tracker[1].place, world(0.2, 1.9));
        assert_eq!((tracker[0].frame, tracker[1].frame), (0, 1));

        let kinovea = points("Time (ms);X (m);Y (m)\n40;0,25;1,5\n");
        assert_eq!(
            (kinovea[0].time_s, kinovea[0].place),
            (Some(0.04), world(0.25, 1.5))
        );
    }

    #[test]
    fn what_cannot_be_read_is_told_with_line_and_column() {
        let message = |text: &str| parse(text.as_bytes(), "points.csv").unwrap_err().to_string();
        assert!(message("a,b\n1,2\n").contains("no columns of a place (a, b)"));
        assert!(message("u_px,v_px\n1,2\n").contains("neither frames nor times"));
        let wrong = message("frame,u_px,v_px,std_px\n1.5,2,3,\n2,x,3,\n3,1,2,-1\n");
        for part in [
            "line 2, column frame",
            "line 3, column u_px",
            "line 4, column std_px",
        ] {
            assert!(wrong.contains(part), "{wrong}");
        }
        assert!(message("frame,u_px,v_px\n").contains("no row with a centre"));
    }
}
