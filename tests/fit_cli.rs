//! `track fit` as its user calls it.

use crate::browser;
use assert_cmd::Command;
use predicates::prelude::*;
use predicates::str::{contains, is_empty};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::tempdir;

fn track_fit(path: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command.timeout(std::time::Duration::from_secs(120));
    command.arg("fit").arg(path);
    command
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("fixtures/series/{name}.csv"))
}

fn json(command: &mut Command) -> Value {
    let output = command.arg("--json").output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).unwrap()
}

fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
    let dir = tempdir().unwrap();
    let path = dir.path().join("my.csv");
    fs::write(&path, text).unwrap();
    (dir, path)
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn the_json_holds_every_key_of_the_contract() {
    let fit = json(&mut track_fit(&fixture("fig3")));
    assert_eq!(fit["schema"], "track.fit/1");
    let groups = fit["groups"].as_array().unwrap();
    assert_eq!(groups.len(), 3);
    for group in groups {
        for key in [
            "name",
            "rows",
            "models",
            "preferred",
            "reason",
            "rows_used",
            "rows_set_aside",
        ] {
            assert!(keys(group).contains(&key), "{key}");
        }
        assert_eq!(group["rows"], 9);
        assert_eq!(group["rows_used"].as_array().unwrap().len(), 9);
        let names: Vec<&str> = group["models"]
            .as_array()
            .unwrap()
            .iter()
            .map(|m| m["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, ["mu_e", "e_e", "grip_slide", "compliant"]);
        for model in group["models"].as_array().unwrap() {
            for key in [
                "converged",
                "parameters",
                "transition_angle_deg",
                "chi2",
                "degrees_of_freedom",
                "log_likelihood",
                "aicc",
                "bic",
            ] {
                assert!(keys(model).contains(&key), "{key}");
            }
            assert_eq!(model["converged"], true);
            let parameters = keys(&model["parameters"]);
            assert_eq!(
                parameters[..4],
                [
                    "restitution",
                    "friction",
                    "static_friction",
                    "tangential_restitution"
                ]
            );
            for (name, value) in model["parameters"].as_object().unwrap() {
                if value.is_null() {
                    assert!(
                        model["not_determined"][name].is_string(),
                        "{name} is null without a reason"
                    );
                } else {
                    assert_eq!(keys(value), ["value", "std_uncertainty", "interval_95"]);
                }
            }
        }
    }
    assert_eq!(groups[0]["preferred"], "mu_e");
    assert_eq!(groups[2]["preferred"], "e_e");
    assert!(
        groups[2]["models"][2]["parameters"]["friction"].is_null(),
        "the superball never slid"
    );
    let angle = groups[0]["models"][0]["transition_angle_deg"]["value"]
        .as_f64()
        .unwrap();
    assert!((angle - 23.6).abs() < 0.5, "{angle}");
}

/// A series that no model fits: as published, with a quarter of its deviations.
fn overconfident(dir: &Path) -> PathBuf {
    let text = fs::read_to_string(fixture("kharaz2001")).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names = lines.next().unwrap();
    let is_std: Vec<bool> = names.split(',').map(|name| name.ends_with("_std")).collect();
    let mut made = format!("{names}\n");
    for line in lines {
        let cells = line.split(',').zip(&is_std).map(|(cell, is_std)| {
            let value: f64 = cell.parse().unwrap();
            if *is_std { 0.25 * value } else { value }.to_string()
        });
        made.push_str(&cells.collect::<Vec<_>>().join(","));
        made.push('\n');
    }
    let path = dir.join("overconfident.csv");
    fs::write(&path, made).unwrap();
    path
}

#[test]
fn the_table_is_for_people_and_warnings_go_to_stderr() {
    let dir = tempdir().unwrap();
    let shown = track_fit(&overconfident(dir.path())).assert().success();
    shown
        .stdout(
            contains("grip_slide")
                .and(contains("compliant"))
                .and(contains("warning").not()),
        )
        .stderr(contains("warning: no_model_fits"));
    let output = track_fit(&fixture("fig4")).output().unwrap();
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        table.contains("group       Ss") && table.contains("spin before, fitted"),
        "{table}"
    );
    let unbroken = table.lines().filter(|line| !line.contains('±'));
    assert!(
        unbroken.into_iter().all(|line| line.chars().count() <= 100),
        "{table}"
    );
}

#[test]
fn fit_json_and_the_page_appear_in_the_folder() {
    let dir = tempdir().unwrap();
    let out = dir.path().join("new/out");
    track_fit(&fixture("fig4"))
        .arg("--out")
        .arg(&out)
        .assert()
        .success()
        .stderr(contains("fit.json").and(contains("report.html")));
    let written: Value = serde_json::from_slice(&fs::read(out.join("fit.json")).unwrap()).unwrap();
    let printed = json(&mut track_fit(&fixture("fig4")));
    assert_eq!(written, printed);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    for expected in ["tan", "Distances", "Group Ss", "Parameters, to copy", "S1"] {
        assert!(page.contains(expected), "{expected}");
    }
    assert!(!page.contains("<script src") && !page.contains("href=\"http"));
    assert_eq!(fs::read_dir(&out).unwrap().count(), 2);
}

#[test]
fn the_page_says_that_no_model_fits() {
    let dir = tempdir().unwrap();
    let out = dir.path().join("out");
    track_fit(&overconfident(dir.path()))
        .arg("--out")
        .arg(&out)
        .assert()
        .success();
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("no model with constant coefficients describes these rows"));
}

#[test]
fn a_folder_of_a_batch_means_its_series() {
    let dir = tempdir().unwrap();
    fs::copy(fixture("fig3"), dir.path().join("series.csv")).unwrap();
    let of_folder = json(&mut track_fit(dir.path()));
    let of_file = json(&mut track_fit(&fixture("fig3")));
    assert_eq!(of_folder["groups"], of_file["groups"]);
    let empty = tempdir().unwrap();
    track_fit(empty.path())
        .assert()
        .code(2)
        .stdout(is_empty())
        .stderr(contains("no series.csv"));
}

#[test]
fn what_cannot_be_read_is_status_2_and_leaves_nothing() {
    for (text, words) in [
        ("", "empty"),
        ("a,b\n1,2\n", "none of the columns"),
        ("incident_angle_deg\n30\n", "lacks rebound_angle_deg"),
        ("incident_angle_deg,rebound_angle_deg\n", "no rows"),
        ("x0_m,x_m,x_m,launch_speed_m_s\n1,1,1,1\n", "twice"),
    ] {
        let (dir, path) = written(text);
        let out = dir.path().join("out");
        track_fit(&path)
            .arg("--out")
            .arg(&out)
            .assert()
            .code(2)
            .stdout(is_empty())
            .stderr(contains("error: ").and(contains(words)).and(contains("my.csv")));
        assert!(!out.exists());
    }
    track_fit(Path::new("/no/such.csv"))
        .assert()
        .code(2)
        .stderr(contains("/no/such.csv"));
    track_fit(&fixture("fig3"))
        .arg("--out")
        .arg("/proc/no")
        .assert()
        .code(2)
        .stderr(contains("/proc/no"));
    track_fit(&fixture("fig3"))
        .args(["--itf", "warm"])
        .assert()
        .code(2)
        .stderr(contains("-60 to 80"));
}

#[test]
fn rows_that_cannot_be_used_are_told_one_by_one() {
    let (_dir, path) = written(
        "incident_vx_m_s,incident_vz_m_s,rebound_vx_m_s,rebound_vz_m_s,rebound_vz_m_s_std,spin_in_m_s\n\
         1,-2,0.77,1.56,0.01,0\nnan,nan,nan,nan,nan,nan\n1,-1.5,0.82,1.17,-0.01,0\n1,-1.2,0.85,0.94,0.01,0\n\
         1,-1,0.87,0.78,0.01,0\n",
    );
    let fit = json(&mut track_fit(&path));
    let aside = fit["groups"][0]["rows_set_aside"].as_array().unwrap();
    assert_eq!(aside.len(), 2);
    assert_eq!(
        (&aside[0]["row"], &aside[1]["row"]),
        (&Value::from(2), &Value::from(3))
    );
    assert!(aside[0]["reason"].as_str().unwrap().contains("is empty"));
    assert!(aside[1]["reason"].as_str().unwrap().contains("negative"));
    assert_eq!(fit["groups"][0]["rows_used"], serde_json::json!([1, 4, 5]));
}

#[test]
fn a_series_without_a_usable_row_is_rejected() {
    let (dir, path) = written("incident_angle_deg,rebound_angle_deg\n95,20\n-120,20\n");
    let out = dir.path().join("out");
    track_fit(&path)
        .arg("--out")
        .arg(&out)
        .assert()
        .code(1)
        .stdout(contains("set aside"))
        .stderr(contains("rejected: "));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Not fitted") && page.contains("between -90 and 90"));
}

#[test]
fn the_court_pace_stands_in_table_json_and_page() {
    let dir = tempdir().unwrap();
    let mut command = track_fit(&fixture("fig3"));
    let fit = json(command.args(["--itf", "-3.5"]).arg("--out").arg(dir.path()));
    let pace = &fit["groups"][0]["court_pace"];
    assert_eq!(pace["temperature_c"], -3.5);
    assert!(pace["rating"]["std_uncertainty"].as_f64().unwrap() > 0.0);
    assert_eq!(pace["class"], "fast");
    let warned = fit["groups"][0]["warnings"].as_array().unwrap();
    assert!(
        warned.iter().any(|w| w["code"] == "rating_assumes_sliding"),
        "{warned:?}"
    );
    let page = fs::read_to_string(dir.path().join("report.html")).unwrap();
    assert!(page.contains("Court pace rating") && page.contains("rating_assumes_sliding"));
    track_fit(&fixture("fig3"))
        .args(["--itf", "20"])
        .assert()
        .success()
        .stdout(contains("court pace"));
}

#[test]
fn a_series_where_everything_is_one_row_or_the_same() {
    let header = "incident_vx_m_s,incident_vz_m_s,rebound_vx_m_s,rebound_vz_m_s";
    for rows in [1, 2, 7] {
        let (_dir, path) = written(&format!("{header}\n{}", "1,-2,0.77,1.56\n".repeat(rows)));
        let fit = json(&mut track_fit(&path));
        assert_eq!(fit["groups"][0]["preferred"], "undetermined");
        let e = fit["groups"][0]["models"][1]["parameters"]["restitution"]["value"]
            .as_f64()
            .unwrap();
        assert!((e - 0.78).abs() < 1e-9, "{e}");
        let text = fit.to_string();
        assert!(!text.contains("NaN") && !text.contains("inf,"), "{text}");
    }
}

/// Each figure in a file that stands alone: its words in the legend, 8 cm wide; of several groups each its own.
#[test]
fn figures_are_files_for_a_thesis() {
    let dir = tempdir().unwrap();
    let names = |path: &Path| -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(path)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    let one = dir.path().join("one");
    track_fit(&fixture("kharaz2001"))
        .args(["--formats", "svg", "--out"])
        .arg(&one)
        .assert()
        .success();
    assert!(
        names(&one).iter().all(|name| name.ends_with(".svg")),
        "{:?}",
        names(&one)
    );
    let figure = fs::read_to_string(one.join("master_curve.svg")).unwrap();
    let document = roxmltree::Document::parse(&figure).unwrap();
    assert_eq!(document.root_element().attribute("width"), Some("80mm"));
    let words: Vec<String> = document
        .descendants()
        .filter(|node| node.has_tag_name("text"))
        .filter_map(|node| node.text().map(|text| text.trim().to_owned()))
        .collect();
    for word in ["slides", "compliant", "sliding begins"] {
        assert!(words.iter().any(|w| w == word), "{words:?}");
    }

    let several = dir.path().join("several");
    track_fit(&fixture("fig4"))
        .args(["--formats", "svg,json", "--out"])
        .arg(&several)
        .assert()
        .success();
    let names = names(&several);
    for name in ["S1.distances.svg", "overview.distances.svg", "fit.json"] {
        assert!(names.iter().any(|n| n == name), "{names:?}");
    }
    assert!(!names.iter().any(|n| n == "report.html"), "{names:?}");
    let overview = fs::read_to_string(several.join("overview.distances.svg")).unwrap();
    assert!(
        ["S1", "S2", "Sr", "Ss", "So"]
            .iter()
            .all(|group| overview.contains(group))
    );

    track_fit(&fixture("fig4"))
        .args(["--formats", "svg"])
        .assert()
        .code(2)
        .stderr(contains("--out"));
}

#[test]
fn the_rows_of_the_page_sort_and_filter_in_a_browser() {
    let Some(chromium) = browser::chromium() else {
        return;
    };
    let dir = tempdir().unwrap();
    track_fit(&fixture("fig3"))
        .arg("--out")
        .arg(dir.path())
        .assert()
        .success();
    let page = dir.path().join("report.html");
    let script = r#"
        const table = document.querySelector("table.sortable");
        const body = table.tBodies[0];
        const column = (n) => [...body.rows].filter((row) => !row.hidden).map((row) => parseFloat(row.cells[n].textContent));
        const heads = [...table.tHead.rows[0].cells];
        const last = heads.length - 1;
        const rows = column(0);
        heads[last].querySelector("button").click();
        const rising = column(last);
        heads[last].querySelector("button").click();
        const falling = column(last);
        const sorted = heads[last].getAttribute("aria-sort");
        heads[0].querySelector("button").click();
        const again = column(0);
        const words = document.querySelector(".filter input");
        words.value = "grips";
        words.dispatchEvent(new Event("input"));
        const regimes = [...body.rows].filter((row) => !row.hidden).map((row) => row.cells[heads.length - 2].textContent);
        return { rows, rising, falling, sorted, again, regimes };
    "#;
    let out = browser::on_page(&chromium, 1000, &page, script);
    let column = |name: &str| -> Vec<f64> { serde_json::from_value(out[name].clone()).unwrap() };
    let (rising, falling) = (column("rising"), column("falling"));
    assert_eq!(rising.len(), 9, "{out}");
    assert!(rising.is_sorted(), "{out}");
    assert!(falling.is_sorted_by(|a, b| a >= b), "{out}");
    assert_eq!(out["sorted"], "descending");
    assert_eq!(column("again"), column("rows"));
    let regimes: Vec<String> = serde_json::from_value(out["regimes"].clone()).unwrap();
    assert!(!regimes.is_empty() && regimes.len() < rising.len(), "{out}");
    assert!(regimes.iter().all(|regime| regime == "grips"), "{out}");
}
