//! The manifest: a CSV with a header, a row a recording.
//!
//! | column | holds |
//! |---|---|
//! | `video` | the file, or folder of numbered images; relative to the manifest |
//! | `calib` | its calibration, relative to the manifest |
//! | `group` | which rows of the series are fitted together |
//! | `spin_ratio` | R ω_oy / u_o at the launch, or `unknown` |
//! | `frame_rate_hz` | the true capture rate |
//! | `ball_radius_m` | the ball's radius |
//!
//! An empty cell leaves the calibration as it is. `,`, `;` or a tab may part the cells (with `;`, a decimal comma is read);
//! lines that begin with `#` are comments.

use super::{CalibrationChanges, LaunchSpin};
use crate::config::schema::Positive;
use crate::config::table::{Table, TableRow, place};
use crate::config::{Closeness, FINITE, FileError, FileKind, FileProblem, POSITIVE, nearest, read_bytes};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use std::path::{Path, PathBuf};

/// The columns, in the order in which messages name them.
pub const COLUMNS: [&str; 6] = [
    "video",
    "calib",
    "group",
    "spin_ratio",
    "frame_rate_hz",
    "ball_radius_m",
];

/// A manifest, for messages about a file.
static KIND: FileKind = FileKind {
    what: "manifest",
    form: "a CSV file in UTF-8 with one line of column names",
    source: "it lists the recordings of a batch, a row each",
    least: "video",
};
/// A manifest of a hundred thousand recordings is far smaller.
const LARGEST_FILE_BYTES: u64 = 100_000_000;

/// A row of the manifest.
#[derive(Debug, Clone, PartialEq)]
pub struct ManifestRow {
    /// Its line in the file, from 1; the header is one too.
    pub line: u64,
    /// The recording, found from where the manifest lies.
    pub video: PathBuf,
    /// Its calibration.
    pub calib: Option<PathBuf>,
    /// Its group.
    pub group: Option<String>,
    /// What it puts in place of the calibration's.
    pub changes: CalibrationChanges,
}

/// A row, for the JSON Schema: the columns that a manifest may have.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ManifestColumns {
    /// The file, or folder of numbered images; relative to the manifest.
    pub video: String,
    /// Its calibration, relative to the manifest.
    pub calib: Option<String>,
    /// Which rows of the series are fitted together.
    pub group: Option<String>,
    /// R ω_oy / u_o at the launch, or `unknown`.
    #[schemars(default, schema_with = "spin_ratio")]
    pub spin_ratio: Option<f64>,
    /// The true capture rate, Hz.
    pub frame_rate_hz: Option<Positive>,
    /// The ball's radius, m.
    pub ball_radius_m: Option<Positive>,
}

fn spin_ratio(_: &mut SchemaGenerator) -> Schema {
    json_schema!({"anyOf": [{"type": ["number", "null"]}, {"const": "unknown"}]})
}

/// Reads the manifest at `path`.
///
/// # Errors
/// See [`FileError`]; all problems at once.
pub fn read(path: &Path) -> Result<Vec<ManifestRow>, FileError> {
    parse(&read_bytes(path, &KIND, LARGEST_FILE_BYTES)?, path)
}

/// The rows in `bytes`, the contents of the file at `path`.
///
/// # Errors
/// See [`FileError`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<Vec<ManifestRow>, FileError> {
    let name = path.display().to_string();
    let wrong = |found: String, hint: &str| FileError::WrongForm {
        name: name.clone(),
        kind: &KIND,
        found,
        hint: hint.to_owned(),
    };
    let table = Table::parse(bytes, &name, &KIND)?;
    // A path with one wrong letter would be that of another file.
    if let Err(e) = std::str::from_utf8(bytes) {
        let found = format!("it is not text in UTF-8 (from byte {})", e.valid_up_to());
        return Err(wrong(found, "save it again as CSV (UTF-8)"));
    }
    let invalid = |problems| FileError::Invalid {
        name: name.clone(),
        problems,
    };
    let columns = columns(&table).map_err(&invalid)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut rows = Vec::new();
    let mut problems = Vec::new();
    for row in &table.rows {
        let cells = RowCells {
            columns: &columns,
            table: &table,
            row,
        };
        match cells.row(folder) {
            Ok(row) => rows.push(row),
            Err(mut found) => problems.append(&mut found),
        }
    }
    if !problems.is_empty() {
        return Err(invalid(problems));
    }
    if rows.is_empty() {
        return Err(wrong(
            "it has no rows below the names of the columns".to_owned(),
            "add a row for each recording",
        ));
    }
    Ok(rows)
}

/// Which column of the file each of [`COLUMNS`] is.
type ColumnPlaces = [Option<usize>; COLUMNS.len()];

fn columns(table: &Table) -> Result<ColumnPlaces, Vec<FileProblem>> {
    let known = |name: &str| COLUMNS.iter().position(|known| known.eq_ignore_ascii_case(name));
    let guess = |name: &str| nearest(name, COLUMNS, Closeness::Guess);
    let mut places: ColumnPlaces = [None; COLUMNS.len()];
    let mut problems = table
        .head
        .columns_there_twice(|i| known(&table.head.columns[i]).is_some());
    let accepted = COLUMNS.join(", ");
    for (i, name) in table.head.columns.iter().enumerate() {
        match known(name) {
            Some(k) => places[k] = places[k].or(Some(i)),
            None => {
                let (name, found) = match name.as_str() {
                    "" => ("(no name)", format!("no name over column {}", i + 1)),
                    name => (name, "an unknown column".to_owned()),
                };
                let hint = guess(name).map_or_else(
                    || "remove it, or give it one of these names".to_owned(),
                    |meant| format!("did you mean {meant}?"),
                );
                problems.push(table.head.column_problem(name, &found, &accepted, &hint));
            }
        }
    }
    let video = COLUMNS[0];
    if places[0].is_none() && !table.head.columns.iter().any(|name| guess(name) == Some(video)) {
        let (found, hint) = ("nothing", "add it: it names the recording of each row");
        problems.push(
            table
                .head
                .column_problem(video, found, "the file of each recording", hint),
        );
    }
    if problems.is_empty() {
        Ok(places)
    } else {
        Err(problems)
    }
}

/// A row's cells.
struct RowCells<'a> {
    columns: &'a ColumnPlaces,
    table: &'a Table,
    row: &'a TableRow,
}

impl RowCells<'_> {
    /// What stands in a column; `None` for nothing.
    fn get(&self, column: &str) -> Option<&str> {
        let place = COLUMNS.iter().position(|known| *known == column)?;
        let cell = self.row.cells.get(self.columns[place]?)?;
        Some(cell.as_str()).filter(|cell| !cell.is_empty())
    }

    fn row(&self, folder: &Path) -> Result<ManifestRow, Vec<FileProblem>> {
        let mut problems = Vec::new();
        let mut refuse = |column: &str, found: String, accepted: &str, hint: &str| {
            problems.push(FileProblem::new(
                place(self.row.line, column),
                found,
                accepted,
                hint,
            ));
        };
        let video = self.get("video");
        if video.is_none() {
            let hint = "give it, or remove the row";
            refuse("video", "nothing".to_owned(), "the file of the recording", hint);
        }
        let mut positive = |column: &str, unit: &str| {
            let cell = self.get(column)?;
            // What a calibration would refuse, a manifest may not put in its place.
            let number = self.table.head.number(cell).filter(|&x| (POSITIVE.holds)(x));
            if number.is_none() {
                let accepted = format!("{}, in {unit}", POSITIVE.accepted);
                let hint = "leave the cell empty for the calibration's";
                refuse(column, format!("{cell:?}"), &accepted, hint);
            }
            number
        };
        let changes = CalibrationChanges {
            frame_rate_hz: positive("frame_rate_hz", "Hz"),
            ball_radius_m: positive("ball_radius_m", "metres"),
            spin: LaunchSpin::AsCalibrated,
        };
        let spin = self.spin();
        if spin.is_none() {
            let cell = self.get("spin_ratio").unwrap_or_default();
            let accepted = format!("{}, or unknown", FINITE.accepted);
            let hint = "R ω / u of the launch, 0 for no spin; leave the cell empty for the calibration's";
            refuse("spin_ratio", format!("{cell:?}"), &accepted, hint);
        }
        let (cells, columns) = (self.row.cells.len(), self.table.head.columns.len());
        if cells > columns {
            let (found, accepted) = (
                format!("{cells} cells"),
                format!("at most {columns}, one a column"),
            );
            let hint = "quote a cell that holds the character between cells";
            refuse("(after the last)", found, &accepted, hint);
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        Ok(ManifestRow {
            line: self.row.line,
            video: folder.join(video.unwrap_or_default()),
            calib: self.get("calib").map(|calib| folder.join(calib)),
            group: self.get("group").map(str::to_owned),
            changes: CalibrationChanges {
                spin: spin.unwrap_or_default(),
                ..changes
            },
        })
    }

    /// `None` for what is no spin.
    fn spin(&self) -> Option<LaunchSpin> {
        let Some(cell) = self.get("spin_ratio") else {
            return Some(LaunchSpin::AsCalibrated);
        };
        if ["unknown", "null", "?"]
            .iter()
            .any(|word| cell.eq_ignore_ascii_case(word))
        {
            return Some(LaunchSpin::Unknown);
        }
        self.table
            .head
            .number(cell)
            .filter(|&x| (FINITE.holds)(x))
            .map(LaunchSpin::Ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows(text: &str) -> Vec<ManifestRow> {
        parse(text.as_bytes(), Path::new("lab/m.csv")).unwrap()
    }

    fn refused(text: &str) -> String {
        parse(text.as_bytes(), Path::new("lab/m.csv"))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn a_row_a_recording_with_paths_from_where_the_manifest_lies() {
        let all = rows(
            "group,video,spin_ratio,calib,ball_radius_m\n# by hand\nsteel,day1/a.mp4,-0.21,../c.json,0.0125\n\n\
             ,\"b, again.mp4\",unknown,,\n",
        );
        assert_eq!(all.len(), 2);
        assert_eq!(all[0].line, 3);
        assert_eq!(all[0].video, Path::new("lab/day1/a.mp4"));
        assert_eq!(all[0].calib.as_deref(), Some(Path::new("lab/../c.json")));
        assert_eq!(all[0].group.as_deref(), Some("steel"));
        assert_eq!(all[0].changes.spin, LaunchSpin::Ratio(-0.21));
        assert_eq!(all[0].changes.ball_radius_m, Some(0.0125));
        assert_eq!(all[1].changes.spin, LaunchSpin::Unknown);
        assert_eq!((all[1].calib.as_ref(), all[1].group.as_ref()), (None, None));
        assert_eq!(all[1].video, Path::new("lab/b, again.mp4"));
    }

    #[test]
    fn spreadsheets_with_a_decimal_comma() {
        let all = rows("\u{feff}video;frame_rate_hz;spin_ratio\r\na.mp4;239,76;\u{2212}0,2\r\n");
        assert_eq!(all[0].changes.frame_rate_hz, Some(239.76));
        assert_eq!(all[0].changes.spin, LaunchSpin::Ratio(-0.2));
    }

    #[test]
    fn an_unknown_column_is_named_with_the_one_that_was_meant() {
        for (name, meant) in [
            ("vidoe", "video"),
            ("fram_rate_hz", "frame_rate_hz"),
            ("spin", "spin_ratio"),
        ] {
            let text = refused(&format!("{name},group\na.mp4,b\n"));
            assert!(
                text.contains(&format!("column {name}: found an unknown column"))
                    && text.contains(&format!("did you mean {meant}?")),
                "{text}"
            );
            assert!(text.contains("lab/m.csv") && text.contains("line 1"), "{text}");
        }
        assert!(
            refused("video,weather\na.mp4,fine\n")
                .contains("column weather: found an unknown column; accepted: video, calib")
        );
        assert!(refused("group\nsteel\n").contains("column video: found nothing"));
        assert!(refused("video,video\na,b\n").contains("it is there twice"));
    }

    #[test]
    fn every_bad_cell_is_named_by_line_and_column() {
        let text = refused(
            "video,frame_rate_hz,ball_radius_m,spin_ratio\n,240,0.01,0\na.mp4,-1,abc,fast\nb.mp4,0,inf,nan\n",
        );
        for words in [
            "7 problems",
            "line 2, column video: found nothing",
            "line 3, column frame_rate_hz: found \"-1\"",
            "line 3, column ball_radius_m: found \"abc\"",
            "line 3, column spin_ratio: found \"fast\"",
            "line 4, column frame_rate_hz: found \"0\"",
            "line 4, column ball_radius_m: found \"inf\"",
            "line 4, column spin_ratio: found \"nan\"",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(refused("video\na.mp4,b\n").contains("found 2 cells; accepted: at most 1"));
    }

    #[test]
    fn what_is_no_manifest_is_told() {
        for (bytes, words) in [
            (b"".as_slice(), "empty"),
            (b"video\n", "no rows"),
            (b"\xff\xfev\0", "UTF-8"),
        ] {
            let text = parse(bytes, Path::new("m.csv")).unwrap_err().to_string();
            assert!(text.contains(words) && text.contains("m.csv"), "{text}");
        }
        assert!(
            read(Path::new("/no/m.csv"))
                .unwrap_err()
                .to_string()
                .contains("/no/m.csv")
        );
    }

    proptest! {
        #[test]
        fn nothing_that_is_read_panics(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = parse(&bytes, Path::new("m.csv"));
            let mut text = b"video,spin_ratio\na.mp4,0\n".to_vec();
            text.extend(&bytes);
            let _ = parse(&text, Path::new("m.csv"));
        }
    }
}
