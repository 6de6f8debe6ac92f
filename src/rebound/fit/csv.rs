//! A series from a CSV file.
//!
//! How the table itself is read says [`crate::config::table`]. A column that is not known is left alone, as `track batch` writes
//! more than a fit needs. Beside any column of numbers may stand `<name>_std`, and `<a>__<b>_corr` for a
//! correlation of two errors. A cell that is empty, `null`, `nan` or `?` is not known. A row with something in `left_out` is
//! set aside, and that is the reason; rows of recordings that gravity or the ball's size refutes are kept on request
//! ([`RefutedRecordings::Kept`]). Rows are read one by one and packed, so that a million take some 150 MB.

use super::error::FitError;
use super::series::{Column, ColumnSet, DEFAULT_GROUP, Note, Reading, Row, Series, SetAside};
use crate::config::table::{self, TableHead};
use crate::config::{Closeness, FileError, FileKind, FileProblem, clipped, nearest, open_file};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::collections::HashSet;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The file of a series in the folder of a batch.
pub const BATCH_SERIES: &str = "series.csv";

/// A series, for messages about a file.
static KIND: FileKind = FileKind {
    what: "series",
    form: "a CSV file in UTF-8 with one line of column names",
    source: "or give the folder that `track batch` wrote",
    least: "incident_angle_deg,rebound_angle_deg, a row a bounce below",
};
/// A series of a million bounces is smaller.
const LARGEST_FILE_BYTES: u64 = 1_000_000_000;

/// What becomes of recordings that gravity or the ball's size refutes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RefutedRecordings {
    /// They are not in the fit.
    #[default]
    LeftOut,
    /// They are in the fit.
    Kept,
}

/// How the reason in `left_out` ends of a row whose recording is refuted, which [`RefutedRecordings::Kept`] takes in.
pub const KEPT_ON_REQUEST: &str = "--keep-refuted keeps it";

/// A row, for the JSON Schema: the columns that a fit knows. There may be others.
#[derive(Debug)]
pub struct SeriesColumns;

impl JsonSchema for SeriesColumns {
    fn schema_name() -> Cow<'static, str> {
        "SeriesColumns".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let number = json!({"type": ["number", "null"]});
        let std =
            json!({"type": ["number", "null"], "minimum": 0, "description": "Its standard uncertainty."});
        let text = json!({"type": ["string", "null"]});
        let columns = Column::ALL.into_iter().flat_map(|c| {
            [
                (c.name().to_owned(), &number),
                (format!("{}_std", c.name()), &std),
            ]
        });
        let texts = ["group", "recording", "video", "page", "left_out"].map(|name| (name.to_owned(), &text));
        let properties: Map<String, Value> = columns
            .chain(texts)
            .map(|(name, form)| (name, form.clone()))
            .collect();
        let sets = ColumnSet::ALL
            .map(|set| json!({"required": set.required().iter().map(|c| c.name()).collect::<Vec<_>>()}));
        json_schema!({
            "type": "object",
            "properties": properties,
            "patternProperties": {"_corr$": {"type": ["number", "null"], "minimum": -1, "maximum": 1}},
            "anyOf": sets,
        })
    }
}

/// Reads a series from a file, or from `series.csv` in the folder of a batch.
///
/// # Errors
///
/// See [`FitError`].
pub fn read(path: &Path) -> Result<Series, FitError> {
    read_with(path, RefutedRecordings::LeftOut)
}

/// As [`read`], with or without the rows of `refuted` recordings.
///
/// # Errors
///
/// See [`FitError`].
pub fn read_with(path: &Path, refuted: RefutedRecordings) -> Result<Series, FitError> {
    let file = series_file(path)?;
    let source = open_file(&file, &KIND, LARGEST_FILE_BYTES)?;
    parse_from(source, &file.display().to_string(), refuted)
}

/// The file that `path` means.
///
/// # Errors
///
/// A folder without a series in it.
pub fn series_file(path: &Path) -> Result<PathBuf, FitError> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    let inside = path.join(BATCH_SERIES);
    if inside.is_file() {
        Ok(inside)
    } else {
        Err(FitError::NoSeriesInFolder {
            path: path.to_owned(),
        })
    }
}

/// Reads a series from the text of a file called `name`.
///
/// # Errors
///
/// See [`FitError`].
pub fn parse(bytes: &[u8], name: &str) -> Result<Series, FitError> {
    parse_from(bytes, name, RefutedRecordings::LeftOut)
}

fn parse_from(source: impl Read, name: &str, refuted: RefutedRecordings) -> Result<Series, FitError> {
    let (head, mut records) = table::rows_of(source, name, &KIND)?;
    let header = SeriesHeader::new(head, name, refuted)?;
    let mut rows = Vec::new();
    let mut set_aside = Vec::new();
    let mut words = SharedWords::default();
    let mut kept = 0;
    let mut number = 0;
    while records.next_row()? {
        number += 1;
        match header.row(records.cells(), number, &mut words) {
            Ok((row, was_refuted)) => {
                kept += usize::from(was_refuted);
                rows.push(row);
            }
            Err(reason) => set_aside.push(reason),
        }
    }
    if rows.is_empty() && set_aside.is_empty() {
        return Err(FitError::NoRows {
            name: name.to_owned(),
        });
    }
    rows.shrink_to_fit();
    let set = header.set(&rows);
    let mut series = Series::of_set(name, set, rows, set_aside);
    series.notes.extend(header.notes(set));
    series.notes.extend(refuted_rows(kept));
    Ok(series)
}

/// That rows are in the fit whose lengths and speeds something contradicts.
fn refuted_rows(count: usize) -> Option<Note> {
    (count > 0).then(|| Note {
        code: "refuted_rows",
        message: format!(
            "{count} rows of recordings that gravity or the ball's size contradicts are in the fit all the same, as \
             --keep-refuted asks. Their pages say which scale, rate or radius would mend them."
        ),
    })
}

/// Words that many rows have in common, each of them once in memory.
#[derive(Default)]
struct SharedWords(HashSet<Arc<str>>);

impl SharedWords {
    fn shared(&mut self, word: &str) -> Arc<str> {
        if let Some(known) = self.0.get(word) {
            return Arc::clone(known);
        }
        let word: Arc<str> = word.into();
        self.0.insert(Arc::clone(&word));
        word
    }
}

/// What a column of the file means.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    Value(Column),
    Std(Column),
    /// The same as the ball's marks show it: in place of the column's own.
    Seen(Column),
    SeenStd(Column),
    Correlation(Column, Column),
    Group,
    Recording,
    Page,
    LeftOut,
    Other,
}

impl Meaning {
    fn of(name: &str) -> Self {
        match name {
            "group" => return Self::Group,
            "recording" | "video" => return Self::Recording,
            "page" => return Self::Page,
            "left_out" => return Self::LeftOut,
            "measured_spin_in_m_s" => return Self::Seen(Column::SpinIn),
            "measured_spin_in_m_s_std" => return Self::SeenStd(Column::SpinIn),
            "measured_spin_out_m_s" => return Self::Seen(Column::SpinOut),
            "measured_spin_out_m_s_std" => return Self::SeenStd(Column::SpinOut),
            _ => {}
        }
        let correlated = name.strip_suffix("_corr").and_then(|pair| pair.split_once("__"));
        if let Some((a, b)) = correlated {
            return match (Column::of_name(a), Column::of_name(b)) {
                (Some(a), Some(b)) => Self::Correlation(a, b),
                _ => Self::Other,
            };
        }
        if let Some(column) = Column::of_name(name) {
            return Self::Value(column);
        }
        name.strip_suffix("_std")
            .and_then(Column::of_name)
            .map_or(Self::Other, Self::Std)
    }
}

/// The columns of a file.
struct SeriesHeader {
    set: ColumnSet,
    columns: Vec<(String, Meaning)>,
    head: TableHead,
    refuted: RefutedRecordings,
}

impl SeriesHeader {
    fn new(head: TableHead, file: &str, refuted: RefutedRecordings) -> Result<Self, FitError> {
        let meaning = |name: &String| (name.clone(), Meaning::of(&name.to_ascii_lowercase()));
        let columns: Vec<(String, Meaning)> = head.columns.iter().map(meaning).collect();
        let mut problems = head.columns_there_twice(|i| columns[i].1 != Meaning::Other);
        let has = |column: &Column| columns.iter().any(|(_, m)| *m == Meaning::Value(*column));
        let set = ColumnSet::ALL
            .into_iter()
            .find(|set| set.required().iter().all(has));
        if set.is_none() && problems.is_empty() {
            return Err(missing(&head.columns, file, &has));
        }
        problems.extend(columns.iter().filter_map(|(name, meaning)| {
            let lone = match meaning {
                Meaning::Std(c) => !has(c),
                Meaning::SeenStd(c) => !columns.iter().any(|(_, m)| *m == Meaning::Seen(*c)),
                Meaning::Correlation(a, b) => !has(a) || !has(b) || a == b,
                _ => false,
            };
            lone.then(|| belongs_to_none(&head, name))
        }));
        match set {
            Some(set) if problems.is_empty() => Ok(Self {
                set,
                columns,
                head,
                refuted,
            }),
            _ => Err(FitError::File(FileError::Invalid {
                name: file.to_owned(),
                problems,
            })),
        }
    }

    /// The first set that is there with a number in every column of some row: a batch of top views has the columns of
    /// velocities, but no number in those of z.
    fn set(&self, rows: &[Row]) -> ColumnSet {
        let full = |set: &ColumnSet| {
            rows.iter()
                .any(|row| set.required().iter().all(|&c| row.value(c).is_some()))
        };
        ColumnSet::ALL.into_iter().find(full).unwrap_or(self.set)
    }

    /// A row of the file, and whether its recording is refuted; why it cannot be one.
    fn row<'a>(
        &self,
        cells: impl Iterator<Item = Cow<'a, str>> + Clone,
        number: usize,
        words: &mut SharedWords,
    ) -> Result<(Row, bool), SetAside> {
        let mut row = Row::new(number, words.shared(DEFAULT_GROUP));
        let mut left_out = None;
        let with_meaning = || self.columns.iter().zip(cells.clone());
        let is_word = |meaning: Meaning| {
            matches!(
                meaning,
                Meaning::Group | Meaning::Recording | Meaning::Page | Meaning::LeftOut
            )
        };
        for ((_, meaning), cell) in with_meaning().filter(|((_, m), cell)| is_word(*m) && !cell.is_empty()) {
            match meaning {
                Meaning::Group => row.group = words.shared(&cell),
                Meaning::Recording => row.set_recording(words.shared(&cell)),
                Meaning::Page => row.set_page(words.shared(&cell)),
                _ => left_out = Some(cell.into_owned()),
            }
        }
        let aside = |reason: String| SetAside {
            row: number,
            group: row.group.to_string(),
            reason,
        };
        let was_refuted = self.refuted == RefutedRecordings::Kept
            && left_out
                .as_ref()
                .is_some_and(|reason| reason.ends_with(KEPT_ON_REQUEST));
        if let Some(reason) = left_out.filter(|_| !was_refuted) {
            return Err(aside(reason));
        }
        let count = cells.clone().count();
        if count > self.columns.len() {
            return Err(aside(format!(
                "it has {count} cells, the line of column names {}",
                self.columns.len()
            )));
        }
        let mut std = [None; Column::COUNT];
        let mut values = [None; Column::COUNT];
        let mut seen = [None; Column::COUNT];
        let mut seen_std = [None; Column::COUNT];
        let mut correlations = Vec::new();
        for ((name, meaning), cell) in with_meaning() {
            let number = || number_in(&self.head, &cell).map_err(|found| aside(format!("{name} is {found}")));
            match *meaning {
                Meaning::Value(c) => values[c as usize] = number()?,
                Meaning::Std(c) => std[c as usize] = number()?,
                Meaning::Seen(c) => seen[c as usize] = number()?,
                Meaning::SeenStd(c) => seen_std[c as usize] = number()?,
                Meaning::Correlation(a, b) => correlations.extend(number()?.map(|r| (a, b, r))),
                _ => {}
            }
        }
        let mut readings = Column::ALL.map(|column| {
            if let Some(value) = seen[column as usize] {
                let std = seen_std[column as usize];
                return Some(Reading { value, std });
            }
            // A spin after that is computed, beside one that was seen in other rows, says nothing new.
            if column == Column::SpinOut && self.has(Meaning::Seen(column)) {
                return None;
            }
            let std = std[column as usize];
            values[column as usize].map(|value| Reading { value, std })
        });
        if !self.knows_spin() {
            readings[Column::SpinRatio as usize] = Some(Reading {
                value: 0.0,
                std: None,
            });
        }
        row = row.with_all(&readings);
        for (a, b, r) in correlations {
            row = row.with_correlation(a, b, r);
        }
        Ok((row, was_refuted))
    }

    /// Whether the file says anything of the spin before the bounce.
    fn knows_spin(&self) -> bool {
        let spin_in = || self.has(Meaning::Value(Column::SpinIn)) || self.has(Meaning::Seen(Column::SpinIn));
        self.has(Meaning::Value(Column::SpinRatio)) || (self.set == ColumnSet::Velocities && spin_in())
    }

    fn has(&self, meaning: Meaning) -> bool {
        self.columns.iter().any(|(_, m)| *m == meaning)
    }

    fn notes(&self, set: ColumnSet) -> Vec<Note> {
        let mut notes = Vec::new();
        if !self.knows_spin() {
            let column = if set == ColumnSet::Velocities {
                "spin_in_m_s"
            } else {
                "spin_ratio"
            };
            notes.push(Note {
                code: "spin_taken_as_zero",
                message: format!(
                    "no column says how the ball spun before the bounce, so it is taken to have come without spin. Add \
                     {column}; leave its cells empty where the spin is not known, and it is fitted."
                ),
            });
        }
        for (name, _) in self.columns.iter().filter(|(_, m)| *m == Meaning::Other) {
            if let Some(near) = slip_of(&name.to_ascii_lowercase()) {
                notes.push(Note {
                    code: "column_not_used",
                    message: format!("column {name} is not used; did you mean {near}?"),
                });
            }
        }
        notes
    }
}

/// Which columns are missing, told for the set that lacks the fewest.
fn missing(names: &[String], file: &str, has: &impl Fn(&Column) -> bool) -> FitError {
    let lacking = |set: ColumnSet| -> Vec<&str> {
        let lacks = set.required().iter().filter(|c| !has(c));
        lacks.map(|c| c.name()).collect()
    };
    let nearest_set = ColumnSet::ALL
        .into_iter()
        .filter(|set| set.required().iter().any(has))
        .min_by_key(|set| lacking(*set).len());
    let missing = match nearest_set {
        Some(set) => format!("for {} it lacks {}", set.name(), lacking(set).join(", ")),
        None => "none of the columns of a series is there".to_owned(),
    };
    let typos: Vec<String> = names
        .iter()
        .filter(|name| Meaning::of(&name.to_ascii_lowercase()) == Meaning::Other)
        .filter_map(|name| {
            slip_of(&name.to_ascii_lowercase()).map(|near| format!("is {name} meant to be {near}?"))
        })
        .collect();
    let missing = if typos.is_empty() {
        missing
    } else {
        format!("{missing}; {}", typos.join(" "))
    };
    // A file with a thousand columns should not fill the screen.
    let mut found: Vec<&str> = names.iter().map(String::as_str).take(20).collect();
    if names.len() > found.len() {
        found.push("...");
    }
    FitError::Columns {
        name: file.to_owned(),
        missing,
        found: found.join(", "),
    }
}

/// The problem of a standard deviation or correlation of a column that is not there.
fn belongs_to_none(head: &TableHead, column: &str) -> FileProblem {
    head.column_problem(
        column,
        "no column that it belongs to",
        "<name>_std beside <name>, <a>__<b>_corr beside <a> and <b>",
        "add that column, or remove this one",
    )
}

/// The known name that `name` is a slip of.
fn slip_of(name: &str) -> Option<String> {
    let of_columns = Column::ALL
        .into_iter()
        .flat_map(|c| [c.name().to_owned(), format!("{}_std", c.name())]);
    let known: Vec<String> = of_columns.chain(["group".to_owned()]).collect();
    nearest(name, known.iter().map(String::as_str), Closeness::Slip).map(str::to_owned)
}

/// The number in a cell: `None` where it is not known; what stands there where it is none.
fn number_in(head: &TableHead, cell: &str) -> Result<Option<f64>, String> {
    let unknown = ["", "?", "-", "null", "nan", "na", "n/a", "none"];
    if unknown.iter().any(|word| cell.eq_ignore_ascii_case(word)) {
        return Ok(None);
    }
    let number = head.number(cell);
    number.map_or_else(
        || Err(format!("\"{}\", not a number", clipped(cell))),
        |number| Ok(Some(number)),
    )
}

#[cfg(test)]
mod tests;
