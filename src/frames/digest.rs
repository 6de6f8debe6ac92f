//! SHA-256 of files, as `sha256sum` tells it: by which a result names what it was made from, and a batch knows what has changed.

use super::pictures_in;
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// The digest of a recording: of a folder, that of its pictures' names and digests in their order.
///
/// # Errors
/// Where it cannot be read through.
pub fn of_recording(path: &Path) -> io::Result<String> {
    if !path.is_dir() {
        return of_file(path);
    }
    let mut hash = Sha256::new();
    for picture in pictures_in(path).map_err(io::Error::other)? {
        // Names give the order; digests in place of contents let nothing run together.
        let name = picture.file_name().unwrap_or_default();
        hash.update(of_bytes(name.as_encoded_bytes()));
        hash.update(of_file(&picture)?);
    }
    Ok(hex(&hash.finalize()))
}

/// The digest of a plain file; a pipe or a device might never end.
///
/// # Errors
/// Where it cannot be read through, or is no plain file.
pub fn of_file(path: &Path) -> io::Result<String> {
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("not a plain file"));
    }
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut part = vec![0; 1 << 18];
    loop {
        match file.read(&mut part)? {
            0 => return Ok(hex(&hash.finalize())),
            n => hash.update(&part[..n]),
        }
    }
}

/// The digest of bytes.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(digest: &[u8]) -> String {
    digest.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_is_that_of_sha256sum() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        std::fs::write(&path, "abc").unwrap();
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(of_file(&path).unwrap(), expected);
        assert_eq!(of_bytes(b"abc"), expected);
        assert_eq!(of_recording(&path).unwrap(), expected);
        assert!(of_file(dir.path()).is_err());
    }
}
