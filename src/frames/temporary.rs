//! Files under a temporary name, beside the one that they become.
//!
//! The name holds the number of the process, so that one that is told to end knows which are its own.

use std::io;
use std::path::Path;
use tempfile::NamedTempFile;

/// What every temporary name begins with.
pub const PREFIX: &str = ".track-";

/// What those of this process begin with.
#[must_use]
pub fn own_prefix() -> String {
    format!("{PREFIX}{}-", std::process::id())
}

/// A temporary file in the folder of `path`, so that the rename stays on one disk, with a name that ends in `suffix`. Its rights are
/// those of any file that the user creates (the umask takes its part), not the private ones that temporary files get.
///
/// # Errors
/// What the system says.
pub fn file_beside(path: &Path, suffix: &str) -> io::Result<NamedTempFile> {
    let prefix = own_prefix();
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(suffix);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder_of(path))
}

/// The folder that `path` lies in; of a bare file name that is the current one.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Takes away the temporary files of this process in `folder`: it is about to end and will not give them their names.
pub fn clear_own(folder: &Path) {
    let prefix = own_prefix();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry
            .file_name()
            .as_encoded_bytes()
            .starts_with(prefix.as_bytes())
        {
            // What cannot be taken away stays; there is nobody left to tell.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_files_of_this_process_go() {
        let dir = tempfile::tempdir().unwrap();
        let ours = file_beside(&dir.path().join("a.mp4"), ".part").unwrap();
        let (_, ours) = ours.keep().unwrap();
        let others = dir.path().join(".track-1-abc.part");
        std::fs::write(&others, "x").unwrap();
        clear_own(dir.path());
        assert!(!ours.exists() && others.exists());
        clear_own(&dir.path().join("missing"));
    }
}
