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
use crate::calibration::{FINITE, POSITIVE};
use std::fmt;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The columns, in the order in which messages name them.
pub const COLUMNS: [&str; 6] = [
    "video",
    "calib",
    "group",
    "spin_ratio",
    "frame_rate_hz",
    "ball_radius_m",
];

/// More problems than this are not listed.
const MOST_PROBLEMS: usize = 20;

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

/// Why a manifest cannot be used.
#[derive(Debug, Error)]
pub enum ManifestError {
    /// It cannot be opened or read.
    #[error("cannot read the manifest {}; check the path", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// As the system says it.
        source: std::io::Error,
    },
    /// It is no table.
    #[error("the manifest {}: {found}; accepted is a CSV file in UTF-8, its first line the names of the columns", path.display())]
    NotCsv {
        /// The file.
        path: PathBuf,
        /// What was found.
        found: String,
    },
    /// Something in it is not accepted.
    #[error("the manifest {}: {}", path.display(), Listed(problems))]
    Invalid {
        /// The file.
        path: PathBuf,
        /// All of it, in the order of the file.
        problems: Vec<Problem>,
    },
}

/// Something in a manifest that is not accepted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Line, from 1.
    pub line: u64,
    /// Name of the column.
    pub column: String,
    /// What was found, what is accepted, what to try.
    pub what: String,
}

/// Problems for people: one in the same line, several below each other.
struct Listed<'a>(&'a [Problem]);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = |p: &Problem| format!("line {}, column {}: {}", p.line, p.column, p.what);
        match self.0 {
            [only] => write!(f, "{}", one(only)),
            all => {
                write!(f, "{} problems", all.len())?;
                for problem in all.iter().take(MOST_PROBLEMS) {
                    write!(f, "\n  {}", one(problem))?;
                }
                if all.len() > MOST_PROBLEMS {
                    write!(f, "\n  ...")?;
                }
                Ok(())
            }
        }
    }
}

/// Reads the manifest at `path`.
///
/// # Errors
/// See [`ManifestError`]; all problems at once.
pub fn read(path: &Path) -> Result<Vec<ManifestRow>, ManifestError> {
    let bytes = std::fs::read(path).map_err(|source| ManifestError::Unreadable {
        path: path.to_owned(),
        source,
    })?;
    parse(&bytes, path)
}

/// The rows in `bytes`, the contents of the file at `path`.
///
/// # Errors
/// See [`ManifestError`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<Vec<ManifestRow>, ManifestError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let not_csv = |found: String| ManifestError::NotCsv {
        path: path.to_owned(),
        found,
    };
    let text = std::str::from_utf8(bytes)
        .map_err(|e| not_csv(format!("it is not text in UTF-8 (from byte {})", e.valid_up_to())))?;
    if text.trim().is_empty() {
        return Err(not_csv("it is empty".to_owned()));
    }
    let delimiter = crate::rebound::fit::csv::delimiter(bytes);
    let mut reader = ::csv::ReaderBuilder::new()
        .flexible(true)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(::csv::Trim::All)
        .from_reader(bytes);
    let header = reader.headers().map_err(|e| not_csv(e.to_string()))?.clone();
    let invalid = |problems| ManifestError::Invalid {
        path: path.to_owned(),
        problems,
    };
    let columns = columns(&header, line_of(bytes, header.position())).map_err(&invalid)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut rows = Vec::new();
    let mut problems = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| not_csv(e.to_string()))?;
        if record.iter().all(str::is_empty) {
            continue;
        }
        let cells = RowCells {
            line: line_of(bytes, record.position()),
            columns: &columns,
            record: &record,
            decimal_comma: delimiter == b';',
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
        return Err(not_csv(
            "it has no rows below the names of the columns".to_owned(),
        ));
    }
    Ok(rows)
}

/// The line of a record. The reader's own count stops at the comments and blank lines before it.
fn line_of(bytes: &[u8], position: Option<&::csv::Position>) -> u64 {
    let Some(position) = position else { return 1 };
    let from = usize::try_from(position.byte())
        .unwrap_or(usize::MAX)
        .min(bytes.len());
    let skipped = bytes[from..]
        .split(|&b| b == b'\n')
        .take_while(|line| line.starts_with(b"#") || line.trim_ascii().is_empty())
        .count();
    position.line() + skipped as u64
}

/// Which column of the file each of [`COLUMNS`] is.
type ColumnPlaces = [Option<usize>; COLUMNS.len()];

fn columns(header: &::csv::StringRecord, line: u64) -> Result<ColumnPlaces, Vec<Problem>> {
    let mut places: ColumnPlaces = [None; COLUMNS.len()];
    let mut problems = Vec::new();
    let mut refuse = |column: &str, what: String| {
        problems.push(Problem {
            line,
            column: column.to_owned(),
            what,
        });
    };
    for (i, name) in header.iter().enumerate() {
        match COLUMNS.iter().position(|known| known.eq_ignore_ascii_case(name)) {
            Some(k) if places[k].is_some() => {
                refuse(name, "it is there twice; remove one of the two".to_owned());
            }
            Some(k) => places[k] = Some(i),
            None if name.is_empty() => {
                refuse(
                    "(no name)",
                    format!("column {} has no name; accepted: {}", i + 1, COLUMNS.join(", ")),
                );
            }
            None => {
                let meant = nearest(name).map_or(String::new(), |near| format!("was {near} meant? "));
                refuse(name, format!("unknown; {meant}Accepted: {}", COLUMNS.join(", ")));
            }
        }
    }
    if places[0].is_none() && !header.iter().any(|name| nearest(name) == Some(COLUMNS[0])) {
        refuse(
            "video",
            "it is missing; it names the recording of each row".to_owned(),
        );
    }
    if problems.is_empty() {
        Ok(places)
    } else {
        Err(problems)
    }
}

/// The column that `name` may be a slip of.
fn nearest(name: &str) -> Option<&'static str> {
    let name = name.to_ascii_lowercase();
    let likeness = |known: &str| {
        let part = name.len() > 2 && (known.starts_with(&name) || name.starts_with(known));
        strsim::jaro_winkler(&name, known).max(if part { 0.9 } else { 0.0 })
    };
    COLUMNS
        .iter()
        .map(|&known| (likeness(known), known))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, known)| known)
}

/// A row's cells.
struct RowCells<'a> {
    line: u64,
    columns: &'a ColumnPlaces,
    record: &'a ::csv::StringRecord,
    decimal_comma: bool,
}

impl RowCells<'_> {
    /// What stands in a column; `None` for nothing.
    fn get(&self, column: &str) -> Option<&str> {
        let place = COLUMNS.iter().position(|known| *known == column)?;
        self.record
            .get(self.columns[place]?)
            .filter(|cell| !cell.is_empty())
    }

    fn row(&self, folder: &Path) -> Result<ManifestRow, Vec<Problem>> {
        let mut problems = Vec::new();
        let mut refuse = |column: &str, what: String| {
            problems.push(Problem {
                line: self.line,
                column: column.to_owned(),
                what,
            });
        };
        let video = self.get("video");
        if video.is_none() {
            refuse("video", "it is empty; give the file of the recording".to_owned());
        }
        let mut positive = |column: &str, unit: &str| {
            let cell = self.get(column)?;
            // What a calibration would refuse, a manifest may not put in its place.
            let number = self.number(cell).filter(|&x| (POSITIVE.holds)(x));
            if number.is_none() {
                refuse(
                    column,
                    format!(
                        "found \"{cell}\"; accepted is {}, in {unit}, or nothing for the calibration's",
                        POSITIVE.accepted
                    ),
                );
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
            refuse(
                "spin_ratio",
                format!(
                    "found \"{}\"; accepted is {} (R ω / u of the launch, 0 for no spin), unknown, or nothing for the \
                     calibration's",
                    self.get("spin_ratio").unwrap_or_default(),
                    FINITE.accepted
                ),
            );
        }
        if self.record.len() > self.columns.iter().flatten().count() {
            refuse(
                "(after the last)",
                format!(
                    "{} cells for {} columns; quote a cell that holds the character between cells",
                    self.record.len(),
                    self.columns.iter().flatten().count()
                ),
            );
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        Ok(ManifestRow {
            line: self.line,
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
        self.number(cell)
            .filter(|&x| (FINITE.holds)(x))
            .map(LaunchSpin::Ratio)
    }

    fn number(&self, cell: &str) -> Option<f64> {
        let cell = cell.replace('\u{2212}', "-");
        if self.decimal_comma && cell.contains(',') {
            cell.replace(',', ".").parse().ok()
        } else {
            cell.parse().ok()
        }
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
                text.contains(&format!("column {name}: unknown; was {meant} meant?")),
                "{text}"
            );
            assert!(text.contains("lab/m.csv") && text.contains("line 1"), "{text}");
        }
        assert!(
            refused("video,weather\na.mp4,fine\n")
                .contains("column weather: unknown; Accepted: video, calib")
        );
        assert!(refused("group\nsteel\n").contains("column video: it is missing"));
        assert!(refused("video,video\na,b\n").contains("it is there twice"));
    }

    #[test]
    fn every_bad_cell_is_named_by_line_and_column() {
        let text = refused(
            "video,frame_rate_hz,ball_radius_m,spin_ratio\n,240,0.01,0\na.mp4,-1,abc,fast\nb.mp4,0,inf,nan\n",
        );
        for words in [
            "7 problems",
            "line 2, column video: it is empty",
            "line 3, column frame_rate_hz: found \"-1\"",
            "line 3, column ball_radius_m: found \"abc\"",
            "line 3, column spin_ratio: found \"fast\"",
            "line 4, column frame_rate_hz: found \"0\"",
            "line 4, column ball_radius_m: found \"inf\"",
            "line 4, column spin_ratio: found \"nan\"",
        ] {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(refused("video\na.mp4,b\n").contains("2 cells for 1 columns"));
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
