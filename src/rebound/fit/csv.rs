//! A series from a CSV file.
//!
//! How the table itself is read says [`crate::config::table`]. A column that is not known is left alone, as `track batch` writes
//! more than a fit needs. Beside any column of numbers may stand `<name>_std`, and `<a>__<b>_corr` for a
//! correlation of two errors. A cell that is empty, `null`, `nan` or `?` is not known. A row with something in `left_out` is
//! set aside, and that is the reason.

use super::error::FitError;
use super::series::{Column, ColumnSet, DEFAULT_GROUP, Note, Reading, Row, Series, SetAside};
use crate::config::table::{Table, TableRow};
use crate::config::{Closeness, FileError, FileKind, FileProblem, clipped, nearest, read_bytes};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value, json};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

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
    let file = series_file(path)?;
    let bytes = read_bytes(&file, &KIND, LARGEST_FILE_BYTES)?;
    parse(&bytes, &file.display().to_string())
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
    let table = Table::parse(bytes, name, &KIND)?;
    let header = SeriesHeader::new(&table, name)?;
    let mut rows = Vec::new();
    let mut set_aside = Vec::new();
    for (row, number) in table.rows.iter().zip(1..) {
        match header.row(&table, row, number) {
            Ok(row) => rows.push(row),
            Err(reason) => set_aside.push(reason),
        }
    }
    if rows.is_empty() && set_aside.is_empty() {
        return Err(FitError::NoRows {
            name: name.to_owned(),
        });
    }
    let set = header.set(&rows);
    let mut series = Series::of_set(name, set, rows, set_aside);
    series.notes.extend(header.notes(set));
    Ok(series)
}

/// What a column of the file means.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    Value(Column),
    Std(Column),
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
}

impl SeriesHeader {
    fn new(table: &Table, file: &str) -> Result<Self, FitError> {
        let meaning = |name: &String| (name.clone(), Meaning::of(&name.to_ascii_lowercase()));
        let columns: Vec<(String, Meaning)> = table.columns.iter().map(meaning).collect();
        let mut problems = table.columns_there_twice(|i| columns[i].1 != Meaning::Other);
        let has = |column: &Column| columns.iter().any(|(_, m)| *m == Meaning::Value(*column));
        let set = ColumnSet::ALL
            .into_iter()
            .find(|set| set.required().iter().all(has));
        if set.is_none() && problems.is_empty() {
            return Err(missing(&table.columns, file, &has));
        }
        problems.extend(columns.iter().filter_map(|(name, meaning)| {
            let lone = match meaning {
                Meaning::Std(c) => !has(c),
                Meaning::Correlation(a, b) => !has(a) || !has(b) || a == b,
                _ => false,
            };
            lone.then(|| belongs_to_none(table, name))
        }));
        match set {
            Some(set) if problems.is_empty() => Ok(Self { set, columns }),
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

    /// A row of the file; why it cannot be one.
    fn row(&self, table: &Table, record: &TableRow, number: usize) -> Result<Row, SetAside> {
        let mut row = Row::new(number, DEFAULT_GROUP);
        let mut left_out = None;
        let cells = || self.columns.iter().zip(&record.cells);
        for ((_, meaning), cell) in cells().filter(|(_, cell)| !cell.is_empty()) {
            match meaning {
                Meaning::Group => row.group = cell.clone(),
                Meaning::Recording => row.recording = Some(cell.clone()),
                Meaning::Page => row.page = Some(cell.clone()),
                Meaning::LeftOut => left_out = Some(cell.clone()),
                _ => {}
            }
        }
        let aside = |reason: String| SetAside {
            row: number,
            group: row.group.clone(),
            reason,
        };
        if let Some(reason) = left_out {
            return Err(aside(reason));
        }
        if record.cells.len() > self.columns.len() {
            return Err(aside(format!(
                "it has {} cells, the line of column names {}",
                record.cells.len(),
                self.columns.len()
            )));
        }
        let mut std = [None; Column::COUNT];
        let mut values = [None; Column::COUNT];
        let mut correlations = Vec::new();
        for ((name, meaning), cell) in cells() {
            let number = || number_in(table, cell).map_err(|found| aside(format!("{name} is {found}")));
            match *meaning {
                Meaning::Value(c) => values[c as usize] = number()?,
                Meaning::Std(c) => std[c as usize] = number()?,
                Meaning::Correlation(a, b) => correlations.extend(number()?.map(|r| (a, b, r))),
                _ => {}
            }
        }
        for column in Column::ALL {
            let reading = values[column as usize].map(|value| Reading {
                value,
                std: std[column as usize],
            });
            row.set(column, reading);
        }
        if !self.knows_spin() {
            row.set(
                Column::SpinRatio,
                Some(Reading {
                    value: 0.0,
                    std: None,
                }),
            );
        }
        for (a, b, r) in correlations {
            row = row.with_correlation(a, b, r);
        }
        Ok(row)
    }

    /// Whether the file says anything of the spin before the bounce.
    fn knows_spin(&self) -> bool {
        let is = |c| self.columns.iter().any(|(_, m)| *m == Meaning::Value(c));
        is(Column::SpinRatio) || (self.set == ColumnSet::Velocities && is(Column::SpinIn))
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
fn belongs_to_none(table: &Table, column: &str) -> FileProblem {
    table.column_problem(
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
fn number_in(table: &Table, cell: &str) -> Result<Option<f64>, String> {
    let unknown = ["", "?", "-", "null", "nan", "na", "n/a", "none"];
    if unknown.iter().any(|word| cell.eq_ignore_ascii_case(word)) {
        return Ok(None);
    }
    let number = table.number(cell);
    number.map_or_else(
        || Err(format!("\"{}\", not a number", clipped(cell))),
        |number| Ok(Some(number)),
    )
}

#[cfg(test)]
mod tests;
