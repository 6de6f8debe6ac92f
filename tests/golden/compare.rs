//! Comparing what the program writes with what it wrote before: the text of a file against the golden one.
//!
//! A number may differ by 1e-9 of its value, or by 1e-6 of its standard uncertainty where one stands beside it
//! (`{"value", "std_uncertainty"}`; a column `<name>_std`; a point's `std_px`). A standard uncertainty and a
//! correlation coefficient may differ by 1e-6, the first of itself. Everything else is compared to the letter, but
//! for what says who measured and not what was measured ([`WHO`]).

use serde_json::Value;

/// Keys that name the build or the files of a run.
const WHO: [&str; 4] = ["version", "commit", "sha256", "video_sha256"];

/// Of a number's own value.
const OF_VALUE: f64 = 1e-9;
/// Of a number's standard uncertainty.
const OF_STD: f64 = 1e-6;

/// Where two documents differ, a line each: the path of the value, what stood and what stands there.
pub fn differences_json(golden: &Value, now: &Value) -> Vec<String> {
    let mut out = Vec::new();
    walk("", golden, now, None, &mut out);
    out
}

fn walk(path: &str, golden: &Value, now: &Value, std: Option<f64>, out: &mut Vec<String>) {
    match (golden, now) {
        (Value::Object(a), Value::Object(b)) => {
            for key in a.keys().chain(b.keys().filter(|k| !a.contains_key(*k))) {
                if WHO.contains(&key.as_str()) {
                    continue;
                }
                let at = format!("{path}.{key}");
                match (a.get(key), b.get(key)) {
                    (Some(x), Some(y)) => {
                        let std = (key == "value")
                            .then(|| a.get("std_uncertainty")?.as_f64())
                            .flatten();
                        walk(&at, x, y, std, out);
                    }
                    (Some(x), None) => out.push(format!("{at}: was {x}, is no longer there")),
                    (None, Some(y)) => out.push(format!("{at}: new, {y}")),
                    (None, None) => {}
                }
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (i, (x, y)) in a.iter().zip(b).enumerate() {
                walk(&format!("{path}[{i}]"), x, y, None, out);
            }
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            let allowed = if path.contains("correlations") || path.ends_with("std_uncertainty") {
                OF_STD
                    * if path.contains("correlations") {
                        1.0
                    } else {
                        a.abs()
                    }
            } else {
                tolerance(a, std)
            };
            report(path, a, b, allowed, std, out);
        }
        _ if golden == now => {}
        _ => out.push(format!("{path}: {golden} -> {now}")),
    }
}

fn tolerance(value: f64, std: Option<f64>) -> f64 {
    (OF_VALUE * value.abs()).max(OF_STD * std.unwrap_or(0.0))
}

fn report(path: &str, was: f64, is: f64, allowed: f64, std: Option<f64>, out: &mut Vec<String>) {
    // Written so that NaN, which JSON cannot hold but a CSV could, fails.
    if (was - is).abs() <= allowed || was == is {
        return;
    }
    let in_std = std.map_or_else(String::new, |s| format!(" ({:+.2e} std)", (is - was) / s));
    out.push(format!("{path}: {was} -> {is}{in_std}"));
}

/// The standard uncertainty of a column's number, from the column's name and the numbers of its row by name.
pub type StdOf<'a> = dyn Fn(&str, &dyn Fn(&str) -> Option<f64>) -> Option<f64> + 'a;

/// The same for tables: a header, then a row a line. `std_of` gives the standard uncertainty of a column's number from
/// its row.
pub fn differences_csv(golden: &str, now: &str, std_of: &StdOf<'_>) -> Vec<String> {
    let read = |text: &str| -> Vec<Vec<String>> {
        csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .from_reader(text.as_bytes())
            .records()
            .map(|r| r.unwrap().iter().map(str::to_owned).collect())
            .collect()
    };
    let (a, b) = (read(golden), read(now));
    let mut out = Vec::new();
    if a.first() != b.first() {
        out.push(format!("header: {:?} -> {:?}", a.first(), b.first()));
    }
    if a.len() != b.len() {
        out.push(format!("{} rows -> {}", a.len(), b.len()));
    }
    if !out.is_empty() {
        return out;
    }
    let header = &a[0];
    for (i, (x, y)) in a.iter().zip(&b).enumerate().skip(1) {
        let number =
            |name: &str| -> Option<f64> { x.get(header.iter().position(|h| h == name)?)?.parse().ok() };
        for (column, (p, q)) in header.iter().zip(x.iter().zip(y)) {
            let at = format!("row {i}, {column}");
            match (p.parse::<f64>(), q.parse::<f64>()) {
                (Ok(p), Ok(q)) => {
                    let std = std_of(column, &number);
                    let own = if column.ends_with("_std") || column == "std_px" {
                        Some(p.abs())
                    } else {
                        std
                    };
                    let allowed = if column.contains("correlation") {
                        OF_STD
                    } else {
                        tolerance(p, own)
                    };
                    report(&at, p, q, allowed, std, &mut out);
                }
                _ if p == q => {}
                _ => out.push(format!("{at}: {p:?} -> {q:?}")),
            }
        }
    }
    out
}
