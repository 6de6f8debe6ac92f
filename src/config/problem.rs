//! What can be wrong with a file that a person writes, said so that it can be put right.

use std::fmt;
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};

/// A kind of file, as messages speak of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileKind {
    /// What it is, after "a": "calibration".
    pub what: &'static str,
    /// What it looks like, after "is": "one JSON object as in calib/README.md".
    pub form: &'static str,
    /// Where to get one: "samples are in the folder calib".
    pub source: &'static str,
    /// The least that may stand in it.
    pub least: &'static str,
}

/// Why a file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It could not be read at all.
    #[error("{}: cannot read the {}: {hint}", path.display(), kind.what)]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What it should be.
        kind: &'static FileKind,
        /// What the system said.
        source: std::io::Error,
        /// What that means and what to try.
        hint: String,
    },
    /// It is of another form: not text, not JSON, not a table.
    #[error("{name}: {found}; a {} is {}; {hint}", kind.what, kind.form)]
    WrongForm {
        /// The file.
        name: String,
        /// What it should be.
        kind: &'static FileKind,
        /// What was found, with line and column where there is one.
        found: String,
        /// What to try.
        hint: String,
    },
    /// Values that cannot be used: all of them, in the order in which they were found.
    #[error("{name}: {}", list(problems))]
    Invalid {
        /// The file.
        name: String,
        /// At least one.
        problems: Vec<FileProblem>,
    },
}

impl FileError {
    /// The problems of a file of the right form, none for the other errors.
    #[must_use]
    pub fn problems(&self) -> &[FileProblem] {
        match self {
            Self::Invalid { problems, .. } => problems,
            _ => &[],
        }
    }
}

/// One value that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileProblem {
    /// Dotted path of the key, such as `scale.metres_per_pixel`, or line and column of a table; empty for the whole file.
    pub key: String,
    /// What the file says.
    pub found: String,
    /// What it may say.
    pub accepted: String,
    /// What to try.
    pub hint: String,
}

impl FileProblem {
    /// A problem of `key`.
    pub fn new(
        key: impl Into<String>,
        found: impl Into<String>,
        accepted: impl Into<String>,
        hint: impl Into<String>,
    ) -> Self {
        Self {
            key: key.into(),
            found: found.into(),
            accepted: accepted.into(),
            hint: hint.into(),
        }
    }
}

impl fmt::Display for FileProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let key = if self.key.is_empty() { "(file)" } else { &self.key };
        write!(
            f,
            "{key}: found {}; accepted: {}; try: {}",
            self.found, self.accepted, self.hint
        )
    }
}

/// More problems than this are not listed: a wrong column of a long table is wrong in every row.
const MOST_LISTED: usize = 40;

/// One problem on the line of the file's name, several a line each.
fn list(problems: &[FileProblem]) -> String {
    let [one] = problems else {
        let listed = problems.iter().take(MOST_LISTED);
        let text = listed.fold(format!("{} problems", problems.len()), |text, p| {
            format!("{text}\n  {p}")
        });
        let more = if problems.len() > MOST_LISTED {
            "\n  ..."
        } else {
            ""
        };
        return text + more;
    };
    one.to_string()
}

/// A text as the file has it, cut where it is long.
pub(crate) fn clipped(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// The contents of a file of at most `most_bytes` (no file of its kind comes near; a video named by mistake does).
pub(crate) fn read_bytes(
    path: &Path,
    kind: &'static FileKind,
    most_bytes: u64,
) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(most_bytes + 1).read_to_end(&mut bytes))
        .map_err(|source| unreadable(path, kind, source))?;
    if bytes.len() as u64 > most_bytes {
        return Err(too_large(path, kind, most_bytes));
    }
    Ok(bytes)
}

/// A file of at most `most_bytes`, to be read bit by bit.
pub(crate) fn open_file(
    path: &Path,
    kind: &'static FileKind,
    most_bytes: u64,
) -> Result<std::fs::File, FileError> {
    let opened = std::fs::File::open(path).and_then(|file| {
        let metadata = file.metadata()?;
        if metadata.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        Ok((file, metadata.len()))
    });
    match opened {
        Ok((_, bytes)) if bytes > most_bytes => Err(too_large(path, kind, most_bytes)),
        Ok((file, _)) => Ok(file),
        Err(source) => Err(unreadable(path, kind, source)),
    }
}

fn unreadable(path: &Path, kind: &'static FileKind, source: std::io::Error) -> FileError {
    FileError::Unreadable {
        path: path.to_owned(),
        kind,
        hint: match source.kind() {
            ErrorKind::NotFound => format!("no such file; check the path ({})", kind.source),
            ErrorKind::IsADirectory => format!("it is a folder; name the {} in that folder", kind.what),
            ErrorKind::PermissionDenied => {
                "it may not be read by this user; check its permissions".to_owned()
            }
            _ => "the system reports an error; check the path and the disk".to_owned(),
        },
        source,
    }
}

fn too_large(path: &Path, kind: &'static FileKind, most_bytes: u64) -> FileError {
    FileError::WrongForm {
        name: path.display().to_string(),
        kind,
        found: format!("a file above {} MB", most_bytes / 1_000_000),
        hint: format!("name the {}, not a video or picture", kind.what),
    }
}
