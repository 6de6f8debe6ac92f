//! A series from a CSV file.
//!
//! Columns go by name, in any order; what is not known is left alone, as `track batch` writes more than a fit needs. `,`,
//! `;` or a tab may part the cells (with `;` a decimal comma is read, as spreadsheets of half the world write it). Lines
//! that begin with `#` are comments. Beside any column of numbers may stand `<name>_std`, and `<a>__<b>_corr` for a
//! correlation of two errors. A cell that is empty, `null`, `nan` or `?` is not known. A row with something in `left_out` is
//! set aside, and that is the reason.

use super::error::FitError;
use super::series::{Column, ColumnSet, DEFAULT_GROUP, Note, Reading, Row, Series, SetAside};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The file of a series in the folder of a batch.
pub const BATCH_SERIES: &str = "series.csv";

/// Reads a series from a file, or from `series.csv` in the folder of a batch.
///
/// # Errors
///
/// See [`FitError`].
pub fn read(path: &Path) -> Result<Series, FitError> {
    let file = series_file(path)?;
    let bytes = std::fs::read(&file).map_err(|source| FitError::Unreadable {
        path: file.clone(),
        source,
    })?;
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
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    refuse_what_is_no_text(bytes, name)?;
    let delimiter = delimiter(bytes);
    let mut reader = ::csv::ReaderBuilder::new()
        .flexible(true)
        .has_headers(true)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .trim(::csv::Trim::All)
        .from_reader(bytes);
    let broken = |error: &::csv::Error| FitError::NotCsv {
        name: name.to_owned(),
        found: error.to_string(),
        hint: "save it again as CSV (UTF-8)",
    };
    let header = reader.byte_headers().map_err(|e| broken(&e))?.clone();
    let names: Vec<String> = header
        .iter()
        .map(|cell| String::from_utf8_lossy(cell).into_owned())
        .collect();
    let header = Header::new(&names, name)?;
    let mut rows = Vec::new();
    let mut set_aside = Vec::new();
    let mut record = ::csv::ByteRecord::new();
    let mut number = 0;
    while reader.read_byte_record(&mut record).map_err(|e| broken(&e))? {
        if record.iter().all(<[u8]>::is_empty) {
            continue; // A blank line at the end of a spreadsheet is no row.
        }
        number += 1;
        match header.row(&record, number, delimiter == b';') {
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

fn refuse_what_is_no_text(bytes: &[u8], name: &str) -> Result<(), FitError> {
    let refuse = |found: &str, hint| {
        Err(FitError::NotCsv {
            name: name.to_owned(),
            found: found.to_owned(),
            hint,
        })
    };
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return refuse(
            "the file is empty",
            "put the column names into its first line, a row a bounce below",
        );
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return refuse("it is text in UTF-16", "save it again as CSV (UTF-8)");
    }
    if bytes.starts_with(b"PK\x03\x04") {
        return refuse("it is a zip archive or a workbook", "export the sheet as CSV");
    }
    if bytes[..bytes.len().min(4096)].contains(&0) {
        return refuse("it is not text (a zero byte)", "give the CSV file of the series");
    }
    Ok(())
}

/// What parts the cells of the column names.
pub(crate) fn delimiter(bytes: &[u8]) -> u8 {
    let names = bytes
        .split(|&b| b == b'\n' || b == b'\r')
        .find(|line| !line.is_empty() && line[0] != b'#')
        .unwrap_or_default();
    [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|d| (names.iter().filter(|b| *b == d).count(), *d == b','))
        .unwrap_or(b',')
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
struct Header {
    set: ColumnSet,
    columns: Vec<(String, Meaning)>,
}

impl Header {
    fn new(names: &[String], file: &str) -> Result<Self, FitError> {
        let columns: Vec<(String, Meaning)> = names
            .iter()
            .map(|name| (name.clone(), Meaning::of(&name.to_ascii_lowercase())))
            .collect();
        let mut seen = HashMap::new();
        for (name, meaning) in columns.iter().filter(|(_, m)| *m != Meaning::Other) {
            if seen.insert(name.to_ascii_lowercase(), meaning).is_some() {
                return Err(FitError::Column {
                    name: file.to_owned(),
                    column: name.clone(),
                    problem: "it is there twice; remove one of the two".to_owned(),
                });
            }
        }
        let has = |column: &Column| columns.iter().any(|(_, m)| *m == Meaning::Value(*column));
        let set = ColumnSet::ALL
            .into_iter()
            .find(|set| set.required().iter().all(has));
        let Some(set) = set else {
            return Err(missing(names, file, &has));
        };
        for (name, meaning) in &columns {
            let lone = match meaning {
                Meaning::Std(c) => !has(c),
                Meaning::Correlation(a, b) => !has(a) || !has(b) || a == b,
                _ => false,
            };
            if lone {
                return Err(FitError::Column {
                    name: file.to_owned(),
                    column: name.clone(),
                    problem: "the column that it belongs to is not there; add it, or remove this one"
                        .to_owned(),
                });
            }
        }
        Ok(Self { set, columns })
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
    fn row(&self, record: &::csv::ByteRecord, number: usize, decimal_comma: bool) -> Result<Row, SetAside> {
        let mut row = Row::new(number, DEFAULT_GROUP);
        let mut left_out = None;
        let text = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
        let cells = || self.columns.iter().zip(record.iter());
        for ((_, meaning), cell) in cells().filter(|(_, cell)| !cell.is_empty()) {
            match meaning {
                Meaning::Group => row.group = text(cell),
                Meaning::Recording => row.recording = Some(text(cell)),
                Meaning::Page => row.page = Some(text(cell)),
                Meaning::LeftOut => left_out = Some(text(cell)),
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
        if record.len() > self.columns.len() {
            return Err(aside(format!(
                "it has {} cells, the line of column names {}",
                record.len(),
                self.columns.len()
            )));
        }
        let mut std = [None; Column::COUNT];
        let mut values = [None; Column::COUNT];
        let mut correlations = Vec::new();
        for ((name, meaning), cell) in cells() {
            let number =
                || number_in(cell, decimal_comma).map_err(|found| aside(format!("{name} is {found}")));
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
            if let Some(near) = nearest(&name.to_ascii_lowercase()) {
                notes.push(Note {
                    code: "column_not_used",
                    message: format!("column {name} is not used; was {near} meant?"),
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
            nearest(&name.to_ascii_lowercase()).map(|near| format!("is {name} meant to be {near}?"))
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

/// The known name that `name` may be a slip of.
fn nearest(name: &str) -> Option<String> {
    let known = Column::ALL
        .into_iter()
        .flat_map(|c| [c.name().to_owned(), format!("{}_std", c.name())]);
    known
        .chain(["group".to_owned()])
        .map(|known| (strsim::damerau_levenshtein(name, &known), known))
        // Two slips in a short name make another name.
        .filter(|(slips, known)| *slips > 0 && *slips <= 2 && 4 * slips <= known.len())
        .min()
        .map(|(_, known)| known)
}

/// The number in a cell: `None` where it is not known; what stands there where it is none.
fn number_in(cell: &[u8], decimal_comma: bool) -> Result<Option<f64>, String> {
    let told = || format!("\"{}\", not a number", clipped(&String::from_utf8_lossy(cell)));
    let Ok(text) = std::str::from_utf8(cell) else {
        return Err(told());
    };
    if matches!(text, "" | "?" | "-")
        || ["null", "nan", "na", "n/a", "none"]
            .iter()
            .any(|w| text.eq_ignore_ascii_case(w))
    {
        return Ok(None);
    }
    let parsed = if decimal_comma && text.contains(',') {
        text.replace(',', ".").parse()
    } else {
        // A true minus sign, as typeset tables have it.
        text.parse().or_else(|_| text.replace('\u{2212}', "-").parse())
    };
    match parsed {
        Ok(number) => Ok(Some(number)),
        Err(_) => Err(told()),
    }
}

/// The beginning of a text that may be long.
fn clipped(text: &str) -> String {
    const LONGEST: usize = 40;
    if text.chars().count() <= LONGEST {
        text.to_owned()
    } else {
        text.chars().take(LONGEST).chain("...".chars()).collect()
    }
}

#[cfg(test)]
mod tests;
