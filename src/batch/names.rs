//! What recordings are called.
//!
//! A recording is called by its file's name without the extension (a folder of images by the folder's). Where several share
//! that, those in one folder keep their extension, and those in different folders get as many names of folders in front,
//! joined by `-`, as tell them apart. So a name depends on what is given, and on nothing else.

use super::PlanError;
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};

/// A path that ends in a name: what `.` and `..` stand for.
pub(super) fn whole(path: &Path) -> PathBuf {
    match path.components().next_back() {
        Some(Component::Normal(_)) => path.to_owned(),
        _ => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
    }
}

/// The recording's name without its extension; for a folder, the folder's.
pub(super) fn stem(whole: &Path) -> String {
    let name = if whole.is_dir() {
        whole.file_name()
    } else {
        whole.file_stem()
    };
    name.map_or_else(|| "recording".to_owned(), |n| n.to_string_lossy().into_owned())
}

/// What each recording is called; see the head of this file.
pub(super) fn names(paths: &[&Path]) -> Result<Vec<String>, PlanError> {
    let wholes: Vec<PathBuf> = paths.iter().map(|path| whole(path)).collect();
    let mut names: Vec<String> = wholes.iter().map(|path| stem(path)).collect();
    for alike in alike(&names) {
        let folders: Vec<Vec<String>> = alike.iter().map(|&i| folders_of(&wholes[i])).collect();
        let together = (1..folders.len()).any(|k| folders[..k].contains(&folders[k]));
        let bases: Vec<String> = alike
            .iter()
            .map(|&i| {
                if together {
                    file_name(&wholes[i])
                } else {
                    names[i].clone()
                }
            })
            .collect();
        let deepest = folders.iter().map(Vec::len).max().unwrap_or(0);
        let distinct = (0..=deepest)
            .map(|levels| {
                let with = |(base, folders): (&String, &Vec<String>)| in_front(base, folders, levels);
                bases.iter().zip(&folders).map(with).collect::<Vec<String>>()
            })
            .find(|distinct| self::alike(distinct).is_empty());
        for (&i, name) in alike.iter().zip(distinct.unwrap_or(bases)) {
            names[i] = name;
        }
    }
    match alike(&names).first() {
        None => Ok(names),
        Some(two) => Err(PlanError::SameName {
            a: paths[two[0]].to_owned(),
            b: paths[two[1]].to_owned(),
            name: names[two[0]].clone(),
        }),
    }
}

/// The places of each name that is there more than once, in the order of the names.
fn alike(names: &[String]) -> Vec<Vec<usize>> {
    let mut places: HashMap<&str, Vec<usize>> = HashMap::new();
    for (i, name) in names.iter().enumerate() {
        places.entry(name).or_default().push(i);
    }
    let mut alike: Vec<Vec<usize>> = places.into_values().filter(|p| p.len() > 1).collect();
    alike.sort();
    alike
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}

/// The names of the folders above `path`, from the innermost.
fn folders_of(path: &Path) -> Vec<String> {
    let parent = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let parent = parent.canonicalize().unwrap_or_else(|_| parent.to_owned());
    let names = parent.components().rev().filter_map(|c| match c {
        Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
        _ => None,
    });
    names.collect()
}

fn in_front(base: &str, folders: &[String], levels: usize) -> String {
    let mut parts: Vec<&str> = folders.iter().take(levels).map(String::as_str).rev().collect();
    parts.push(base);
    parts.join("-")
}
