//! A table in CSV: one line of column names, a row a line below.
//!
//! `,`, `;` or a tab may part the cells (with `;` a decimal comma is read, as spreadsheets of half the world write it). Lines
//! that begin with `#` are comments; blank lines, and rows of empty cells at the end of a spreadsheet, are no rows. Columns go
//! by name, in any order, small and capital letters being the same.

use super::problem::{FileError, FileKind, FileProblem};
use std::borrow::Cow;
use std::collections::HashSet;
use std::io::{Cursor, Read};

/// A table as it stands in a file.
#[derive(Debug)]
pub struct Table {
    /// What stands above the rows.
    pub head: TableHead,
    /// The rows, in the order of the file.
    pub rows: Vec<TableRow>,
}

/// The names of a table's columns, and how its cells are read.
#[derive(Debug)]
pub struct TableHead {
    /// The names of the columns, as the file writes them.
    pub columns: Vec<String>,
    /// The line of the column names, from 1.
    pub line: u64,
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

/// The rows of a table one after the other, of which none is kept: a table of a million rows takes no more memory than one of ten.
pub struct TableRows<R> {
    reader: ::csv::Reader<R>,
    record: ::csv::ByteRecord,
    name: String,
    kind: &'static FileKind,
}

/// What is looked at to know what a file is, before its rows are.
const START_BYTES: u64 = 1 << 20;

impl Table {
    /// Reads the bytes of the file `name`. What is not UTF-8 in a cell becomes U+FFFD, and is no number.
    ///
    /// # Errors
    /// [`FileError::WrongForm`].
    pub fn parse(bytes: &[u8], name: &str, kind: &'static FileKind) -> Result<Self, FileError> {
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        let (head, mut rows) = TableRows::over(bytes, bytes, name, kind)?;
        let mut kept = Vec::new();
        while rows.next_row()? {
            kept.push(TableRow {
                line: line_of(bytes, rows.record.position()),
                cells: rows.cells().map(Cow::into_owned).collect(),
            });
        }
        Ok(Self { head, rows: kept })
    }
}

impl<R: Read> TableRows<R> {
    /// The table in `source`, whose first bytes (without a byte order mark) are `start`.
    fn over(
        start: &[u8],
        source: R,
        name: &str,
        kind: &'static FileKind,
    ) -> Result<(TableHead, Self), FileError> {
        if let Some((found, hint)) = no_text(start) {
            return Err(FileError::WrongForm {
                name: name.to_owned(),
                kind,
                found: found.to_owned(),
                hint: hint.replace("{least}", kind.least),
            });
        }
        let delimiter = delimiter(start);
        let reader = ::csv::ReaderBuilder::new()
            .flexible(true)
            .comment(Some(b'#'))
            .delimiter(delimiter)
            .trim(::csv::Trim::All)
            .from_reader(source);
        let mut rows = Self {
            reader,
            record: ::csv::ByteRecord::new(),
            name: name.to_owned(),
            kind,
        };
        let header = match rows.reader.byte_headers() {
            Ok(header) => header,
            Err(error) => return Err(rows.broken(&error)),
        };
        let head = TableHead {
            columns: header.iter().map(text).map(Cow::into_owned).collect(),
            line: line_of(start, header.position()),
            decimal_comma: delimiter == b';',
        };
        Ok((head, rows))
    }

    /// Goes to the next row that is not empty; whether there is one.
    ///
    /// # Errors
    /// [`FileError::WrongForm`], also where the file cannot be read on.
    pub fn next_row(&mut self) -> Result<bool, FileError> {
        loop {
            match self.reader.read_byte_record(&mut self.record) {
                Ok(true) if self.record.iter().all(<[u8]>::is_empty) => {}
                Ok(there) => return Ok(there),
                Err(error) => return Err(self.broken(&error)),
            }
        }
    }

    /// Its cells without the space around them; there may be fewer or more than columns.
    pub fn cells(&self) -> impl Iterator<Item = Cow<'_, str>> + Clone {
        self.record.iter().map(text)
    }

    fn broken(&self, error: &::csv::Error) -> FileError {
        FileError::WrongForm {
            name: self.name.clone(),
            kind: self.kind,
            found: error.to_string(),
            hint: "save it again as CSV (UTF-8)".to_owned(),
        }
    }
}

/// Opens a table whose rows are read one by one from `source`, the file `name`.
///
/// # Errors
/// [`FileError::WrongForm`], also where its start cannot be read.
pub fn rows_of<'a>(
    mut source: impl Read + 'a,
    name: &str,
    kind: &'static FileKind,
) -> Result<(TableHead, TableRows<impl Read + 'a>), FileError> {
    let mut start = Vec::new();
    source
        .by_ref()
        .take(START_BYTES)
        .read_to_end(&mut start)
        .map_err(|error| FileError::WrongForm {
            name: name.to_owned(),
            kind,
            found: error.to_string(),
            hint: "check the disk, or copy the file and try again".to_owned(),
        })?;
    if start.starts_with(BYTE_ORDER_MARK) {
        start.drain(..BYTE_ORDER_MARK.len());
    }
    let first = start.clone();
    TableRows::over(&first, Cursor::new(start).chain(source), name, kind)
}

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

fn text(cell: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(cell)
}

impl TableHead {
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
        FileProblem::new(place(self.line, column), found, accepted, hint)
    }

    /// The number in a cell.
    pub fn number(&self, cell: &str) -> Option<f64> {
        if let Ok(number) = cell.parse() {
            return Some(number);
        }
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
