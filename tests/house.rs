//! The layout of the source, held: imports run downwards through the rooms of `src/lib.rs`, no two files import each
//! other in a circle, a type's name stands for one idea, and the documents' commands run the tests that they name.
//!
//! Read as text: `use` declarations and paths that begin with `crate::` or `super::`. A folder's `mod.rs` and the files
//! under it may use each other, since the one is the face of the others.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The rooms from the ground up; a room imports from those before it only.
const FLOORS: [&[&str]; 13] = [
    &["geometry", "quantity", "version", "error_chain", "test_noise"],
    &["numeric"],
    &["config"],
    &["frames", "points", "rebound"],
    &["calibration", "edits"],
    &["detect", "flight", "rotation"],
    &["impact"],
    &["pipeline", "simulate"],
    &["cost"],
    &["report"],
    &["batch"],
    &["schemas"],
    &["cli", "lib", "main"],
];

/// Names that several types share because they are the same idea in each place, and why.
const SAME_IDEA: [(&str, &str); 1] = [(
    "Parameters",
    "the coefficients of a rebound model, in its own file",
)];

/// The one circle there is: an effect of the simulator acts on camera, flight and rendering through the hooks of
/// `effects`, and these take what acts from it.
const KNOWN_CIRCLE: &str = "simulate";

struct File {
    /// `["detect", "centre", "fast"]`.
    module: Vec<String>,
    text: String,
}

fn files() -> Vec<File> {
    fn walk(dir: &Path, out: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, out);
            } else if path.extension().is_some_and(|e| e == "rs") {
                out.push(path);
            }
        }
    }
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    walk(&src, &mut paths);
    paths.sort();
    paths
        .iter()
        .filter(|p| p.file_name().unwrap() != "tests.rs")
        .map(|path| {
            let mut module: Vec<String> = path
                .strip_prefix(&src)
                .unwrap()
                .with_extension("")
                .iter()
                .map(|p| p.to_str().unwrap().to_owned())
                .collect();
            module.retain(|part| part != "mod");
            File {
                module,
                text: code(&fs::read_to_string(path).unwrap()),
            }
        })
        .collect()
}

/// Without comments and without the tests at the end.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
    let lines = text.lines().filter(|l| !l.trim_start().starts_with("//"));
    lines.collect::<Vec<_>>().join("\n")
}

/// All paths of a `use` tree: `a::{b, c::{d, e}}` gives a::b, a::c::d, a::c::e.
fn expand(tree: &str) -> Vec<String> {
    let Some(open) = tree.find('{') else {
        return vec![tree.split(" as ").next().unwrap().trim().to_owned()];
    };
    let (prefix, rest) = (
        &tree[..open],
        &tree[open + 1..tree.rfind('}').unwrap_or(tree.len())],
    );
    let (mut depth, mut from, mut out) = (0, 0, Vec::new());
    let bounds = rest.char_indices().chain([(rest.len(), ',')]);
    for (i, c) in bounds {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = rest[from..i].trim();
                if !part.is_empty() {
                    out.extend(expand(part).into_iter().map(|p| format!("{prefix}{p}")));
                }
                from = i + 1;
            }
            _ => {}
        }
    }
    out
}

/// The modules that a file imports from, as the longest part of each path that is a file.
fn imports(file: &File, modules: &BTreeSet<Vec<String>>) -> BTreeSet<Vec<String>> {
    let mut paths = Vec::new();
    for (i, _) in file.text.match_indices("use ") {
        let begins = file.text[..i]
            .chars()
            .next_back()
            .is_none_or(|c| c.is_whitespace() || c == ')');
        if let Some(end) = file.text[i..].find(';').filter(|_| begins) {
            paths.extend(expand(&file.text[i + 4..i + end].replace('\n', " ")));
        }
    }
    for start in ["crate::", "super::"] {
        paths.extend(file.text.match_indices(start).map(|(i, _)| {
            let path = file.text[i..]
                .chars()
                .take_while(|c| c.is_alphanumeric() || "_:".contains(*c));
            path.collect::<String>()
        }));
    }
    let mut out = BTreeSet::new();
    for path in paths {
        let mut at = file.module.clone();
        let mut known = false;
        for (i, part) in path.split("::").map(str::trim).enumerate() {
            match part {
                "crate" if i == 0 => at.clear(),
                "self" if i == 0 => {}
                "super" => {
                    at.pop();
                }
                _ if i == 0 => {
                    // A child, or a name of another crate.
                    at.push(part.to_owned());
                    if !modules.contains(&at) {
                        break;
                    }
                }
                _ => at.push(part.to_owned()),
            }
            known = true;
        }
        while known && !at.is_empty() && !modules.contains(&at) {
            at.pop();
        }
        if known && !at.is_empty() && at != file.module {
            out.insert(at);
        }
    }
    out
}

fn graph() -> BTreeMap<Vec<String>, BTreeSet<Vec<String>>> {
    let files = files();
    let modules: BTreeSet<Vec<String>> = files.iter().map(|f| f.module.clone()).collect();
    files
        .iter()
        .map(|f| (f.module.clone(), imports(f, &modules)))
        .collect()
}

#[test]
fn rooms_import_downwards() {
    let floor = |room: &str| {
        FLOORS
            .iter()
            .position(|rooms| rooms.contains(&room))
            .unwrap_or_else(|| {
                panic!("src/{room} has no floor here: put it into FLOORS, and into the map of src/lib.rs")
            })
    };
    let mut upwards = Vec::new();
    for (file, imported) in graph() {
        for other in imported.iter().filter(|o| o[0] != file[0]) {
            if floor(&other[0]) >= floor(&file[0]) {
                upwards.push(format!("{} imports {}", file.join("::"), other.join("::")));
            }
        }
    }
    assert!(upwards.is_empty(), "upwards or sideways:\n{}", upwards.join("\n"));
}

/// Files that reach each other.
#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut graph = graph();
    for (file, imported) in &mut graph {
        imported.retain(|o| !file.starts_with(o) && !o.starts_with(file));
    }
    let reach = |from: &Vec<String>| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
        while let Some(at) = next.pop() {
            for other in &graph[at] {
                if seen.insert(other) {
                    next.push(other);
                }
            }
        }
        seen
    };
    let circles: Vec<String> = graph
        .keys()
        .filter(|file| file[0] != KNOWN_CIRCLE && reach(file).contains(file))
        .map(|file| file.join("::"))
        .collect();
    assert!(circles.is_empty(), "in a circle: {}", circles.join(", "));
}

#[test]
fn a_type_name_is_one_idea() {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in files() {
        for line in file.text.lines() {
            let mut words = line.split_whitespace().skip_while(|w| w.starts_with("pub"));
            if let (Some("struct" | "enum" | "trait"), Some(name)) = (words.next(), words.next()) {
                let name: String = name.chars().take_while(|c| c.is_alphanumeric()).collect();
                places.entry(name).or_default().push(file.module.join("::"));
            }
        }
    }
    let same: Vec<&str> = SAME_IDEA.iter().map(|(name, _)| *name).collect();
    let twice: Vec<String> = places
        .iter()
        .filter(|(name, at)| at.len() > 1 && !same.contains(&name.as_str()))
        .map(|(name, at)| format!("{name}: {}", at.join(", ")))
        .collect();
    assert!(
        twice.is_empty(),
        "one name for several types:\n{}",
        twice.join("\n")
    );
}

/// Where commands that run tests stand, beside `docs` and the heads of the tests themselves.
const TELLING: [&str; 4] = ["README.md", "CONTRIBUTING.md", "Makefile", "calib/README.md"];

/// The names of the tests in each file.
fn tests_by_file() -> BTreeMap<String, Vec<String>> {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let main = fs::read_to_string(tests.join("main.rs")).unwrap();
    let modules = main
        .lines()
        .filter_map(|l| l.strip_prefix("mod ")?.strip_suffix(';'));
    let names = |module: &str| {
        let in_folder = tests.join(module).join("mod.rs");
        let file = Some(in_folder).filter(|p| p.exists());
        let text = fs::read_to_string(file.unwrap_or_else(|| tests.join(format!("{module}.rs")))).unwrap();
        let tests = text.split("#[test]\n").skip(1);
        let name = |behind: &str| Some(behind.split_once("fn ")?.1.split('(').next()?.to_owned());
        tests.filter_map(name).collect()
    };
    modules.map(|m| (m.to_owned(), names(m))).collect()
}

/// A filter that no test matches passes without a word, and one that is part of another file's name runs that one, too.
#[test]
fn commands_in_documents_run_tests_of_one_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut telling: Vec<PathBuf> = TELLING.iter().map(|p| root.join(p)).collect();
    for folder in ["docs", "tests"] {
        let entries = fs::read_dir(root.join(folder))
            .unwrap()
            .map(|e| e.unwrap().path());
        telling.extend(entries.filter(|p| p.extension().is_some_and(|e| e == "md" || e == "rs")));
    }
    let files = tests_by_file();
    let (mut told, mut wrong) = (0, Vec::new());
    for path in telling {
        let text = fs::read_to_string(&path).unwrap();
        for (i, flag) in text.match_indices("--test all ") {
            let line = text[i + flag.len()..].split(['\n', '`', '#']).next().unwrap();
            for filter in line.split_whitespace().filter(|word| word.contains("::")) {
                let (file, test) = filter.split_once("::").unwrap();
                let run = files.iter().filter(|(name, tests)| {
                    name.ends_with(file) && tests.iter().any(|t| t.starts_with(test))
                });
                let run: Vec<&String> = run.map(|(name, _)| name).collect();
                if run != [file] && file != "FILE" {
                    wrong.push(format!("{}: {filter} runs tests of {run:?}", path.display()));
                }
                told += 1;
            }
        }
    }
    assert!(told > 20, "{told} commands found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
