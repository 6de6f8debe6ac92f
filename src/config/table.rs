//! A table in CSV: one line of column names, a row a line below.
//!
//! `,`, `;` or a tab may part the cells (with `;` a decimal comma is read, as spreadsheets of half the world write it). Lines
//! that begin with `#` are comments; blank lines, and rows of empty cells at the end of a spreadsheet, are no rows. Columns go
//! by name, in any order, small and capital letters being the same.

use super::problem::{FileError, FileKind, FileProblem};
use std::collections::HashSet;

/// A table as it stands in a file.
#[derive(Debug)]
pub struct Table {
    /// The names of the columns, as the file writes them.
    pub columns: Vec<String>,
    /// The line of the column names, from 1.
    pub header_line: u64,
    /// The rows, in the order of the file.
    pub rows: Vec<TableRow>,
    /// Whether `0,5` is a number.
    pub decimal_comma: bool,
}

/// A row of a table.
#[derive(Debug)]
pub struct TableRow {
    /// Its line in the file, from 1.
    pub line: u64,
    /// Its cells without the space around them; there may be fewer or more than columns.
    pub cells: Vec<String>,
}

impl Table {
    /// Reads the bytes of the file `name`. What is not UTF-8 in a cell becomes U+FFFD, and is no number.
    ///
    /// # Errors
    /// [`FileError::WrongForm`].
    pub fn parse(bytes: &[u8], name: &str, kind: &'static FileKind) -> Result<Self, FileError> {
        let wrong = |found: String, hint: String| FileError::WrongForm {
            name: name.to_owned(),
            kind,
            found,
            hint,
        };
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if let Some((found, hint)) = no_text(bytes) {
            return Err(wrong(found.to_owned(), hint.replace("{least}", kind.least)));
        }
        let delimiter = delimiter(bytes);
        let mut reader = ::csv::ReaderBuilder::new()
            .flexible(true)
            .comment(Some(b'#'))
            .delimiter(delimiter)
            .trim(::csv::Trim::All)
            .from_reader(bytes);
        let broken = |e: ::csv::Error| wrong(e.to_string(), "save it again as CSV (UTF-8)".to_owned());
        let cells = |record: &::csv::ByteRecord| -> Vec<String> {
            let cells = record.iter();
            cells.map(|c| String::from_utf8_lossy(c).into_owned()).collect()
        };
        let header = reader.byte_headers().map_err(broken)?;
        let (columns, header_line) = (cells(header), line_of(bytes, header.position()));
        let mut rows = Vec::new();
        for record in reader.byte_records() {
            let record = record.map_err(broken)?;
            if !record.iter().all(<[u8]>::is_empty) {
                rows.push(TableRow {
                    line: line_of(bytes, record.position()),
                    cells: cells(&record),
                });
            }
        }
        Ok(Self {
            columns,
            header_line,
            rows,
            decimal_comma: delimiter == b';',
        })
    }

    /// A problem for each column of `used` (by position) whose name another has too.
    pub fn columns_there_twice(&self, used: impl Fn(usize) -> bool) -> Vec<FileProblem> {
        let mut seen = HashSet::new();
        let named = self.columns.iter().enumerate().filter(|(i, _)| used(*i));
        named
            .filter(|(_, name)| !seen.insert(name.to_lowercase()))
            .map(|(_, name)| {
                self.column_problem(
                    name,
                    "it is there twice",
                    "each column once",
                    "remove one of the two",
                )
            })
            .collect()
    }

    /// A problem with a column as such.
    pub fn column_problem(&self, column: &str, found: &str, accepted: &str, hint: &str) -> FileProblem {
        FileProblem::new(place(self.header_line, column), found, accepted, hint)
    }

    /// The number in a cell.
    pub fn number(&self, cell: &str) -> Option<f64> {
        // A true minus sign, as typeset tables have it.
        let cell = cell.replace('\u{2212}', "-");
        if self.decimal_comma && cell.contains(',') {
            cell.replace(',', ".").parse().ok()
        } else {
            cell.parse().ok()
        }
    }
}

/// How messages name a cell.
pub fn place(line: u64, column: &str) -> String {
    format!("line {line}, column {column}")
}

/// What the bytes are that are no text, and what to try; `{least}` stands for the least that a file may hold.
fn no_text(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        Some((
            "the file is empty",
            "put the column names into its first line: {least}",
        ))
    } else if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        Some(("it is text in UTF-16", "save it again as CSV (UTF-8)"))
    } else if bytes.starts_with(b"PK\x03\x04") {
        Some(("it is a zip archive or a workbook", "export the sheet as CSV"))
    } else if bytes[..bytes.len().min(4096)].contains(&0) {
        Some(("it is not text (a zero byte)", "give a CSV file"))
    } else {
        None
    }
}

/// What parts the cells of the column names.
fn delimiter(bytes: &[u8]) -> u8 {
    let names = bytes
        .split(|&b| b == b'\n' || b == b'\r')
        .find(|line| !line.is_empty() && line[0] != b'#')
        .unwrap_or_default();
    [b',', b';', b'\t']
        .into_iter()
        .max_by_key(|d| (names.iter().filter(|b| *b == d).count(), *d == b','))
        .unwrap_or(b',')
}

/// The line of a record. The csv crate's own count stops at the comments and blank lines before it.
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
