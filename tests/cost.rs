//! `track cost`: bad requirements through the binary, the files of a small run, and that a recommended setting holds on recordings
//! that it was not chosen by. Nothing here asserts a time.

use assert_cmd::Command;
use predicates::str::{contains, is_empty};
use serde_json::Value;
use std::fs;
use std::time::Instant;
use tempfile::tempdir;
use track::cost::recommendation::Requirement;
use track::cost::recordings::{RecordingPlan, RecordingSetting};
use track::cost::{self, CostPlan, CostProgress, Stopwatch, centres, fits, recordings, simulator};
use track::detect::centre::Accuracy;
use track::report::formats::cost::write_cost;

fn track() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command.timeout(std::time::Duration::from_secs(300));
    command
}

#[test]
fn a_want_that_makes_no_sense_stops_before_any_work() {
    for (want, says) in [
        ("nonsense=1", "Known: restitution, friction"),
        ("restituton=0.002", "did you mean \"restitution\""),
        ("restitution=-0.002", "not a number above 0"),
        ("restitution=much", "not a number above 0"),
        ("-1", "NAME=VALUE"),
        ("restitution", "NAME=VALUE"),
    ] {
        track()
            .args(["cost", "--quick", "--want", want])
            .assert()
            .code(2)
            .stdout(is_empty())
            .stderr(contains(says));
    }
    track()
        .args(["cost", "--quick", "--check", "0"])
        .assert()
        .code(2)
        .stderr(contains("1..=10000"));
}

#[test]
fn an_output_folder_that_cannot_be_stops_before_any_work() {
    let dir = tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "mine").unwrap();
    track()
        .args(["cost", "--quick", "--out"])
        .arg(&file)
        .assert()
        .code(2)
        .stdout(is_empty())
        .stderr(contains("there is a file where a folder is needed"));
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
}

/// Every kind of run, as few as there can be.
fn small() -> CostPlan {
    CostPlan {
        quick: true,
        centres: centres::CentrePlan {
            lights: vec![centres::LightAndCodec::Flat],
            noises_grey: vec![2.0],
            radii_px: vec![4.0],
            repeats: 1,
        },
        whole: RecordingPlan {
            accuracies: vec![Accuracy::Fast, Accuracy::Standard],
            frame_rates_hz: vec![8.0, 120.0],
            reductions: vec![4],
            exposures_s: vec![0.0005],
            usual: RecordingSetting {
                frame_rate_hz: 120.0,
                reduction: 4,
                ..RecordingSetting::DEFAULT
            },
            crfs: vec![14, 26],
            recordings: 2,
            ..RecordingPlan::full()
        },
        simulator: simulator::SimulatorPlan {
            repeats: 1,
            balls: 1,
            frames: 1,
            ..simulator::SimulatorPlan::quick()
        },
        fits: fits::FitPlan {
            series: 2,
            ..fits::FitPlan::quick()
        },
    }
}

#[test]
fn a_small_run_gives_its_four_files_and_progress_to_the_end() {
    let start = Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    let (mut last, mut steps) = (0.0, Vec::new());
    let mut progress = |step: CostProgress| {
        assert!(step.done >= last, "progress goes forwards");
        last = step.done;
        if steps.last() != Some(&step.what) {
            steps.push(step.what);
        }
    };
    let requirements: Vec<Requirement> = vec!["restitution=0.01".parse().unwrap()];
    let report = cost::run(&small(), &requirements, &clock, &mut progress).unwrap();
    let planned = ["centres", "whole recordings", "simulator", "fits"];
    assert_eq!(steps, [&planned[..], &["trying the recommendation"]].concat());
    assert!(last > 0.85 && last <= 1.0, "{last}");
    let dir = tempdir().unwrap();
    let paths = write_cost(&report, None, dir.path()).unwrap();
    let texts: Vec<String> = paths
        .iter()
        .map(|path| fs::read_to_string(path).unwrap())
        .collect();
    let [page, svg, json, csv] = <[String; 4]>::try_from(texts).unwrap();
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 4);
    for expected in [
        "rms error of a centre / px",
        "bound, R 4",
        "Pareto front",
        "What to take",
        "threshold, moments",
        "time a recording / s",
        "light at f/2, ISO 800 / lx",
        "storage a recording / MB",
        "threshold, circle",
        "H.264 constant rate factor",
        "width of the picture / px",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    for forbidden in ["<script", "src=\"http", "href=\"http", "@import", "NaN"] {
        assert!(
            !page.contains(forbidden) && !svg.contains(forbidden),
            "{forbidden}"
        );
    }
    assert!(svg.starts_with("<svg") && svg.len() < 100_000, "{}", svg.len());
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["schema"], "track.cost/1");
    let names: Vec<&str> = json["sections"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["centres", "whole", "integrator", "effects", "fits"]);
    // Four frames in all, at 8 frames a second, are too few: it is told, with its time, and has no error.
    let whole = &json["sections"][1]["runs"];
    let slow = whole
        .as_array()
        .unwrap()
        .iter()
        .find(|r| r["settings"]["frame_rate_hz"] == "8")
        .unwrap();
    assert!(
        slow["failed"].as_str().unwrap().starts_with("2 of 2 recordings"),
        "{slow}"
    );
    assert!(slow["work"]["measure_s"]["median"].as_f64().is_some());
    assert!(csv.lines().count() > 20 && csv.starts_with("section,settings,default,error,unit"));
}

#[test]
fn a_recommended_setting_reaches_what_was_wanted_on_new_recordings() {
    const NEW: u64 = 20;
    let start = Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    let mut progress = |_| {};
    let mut stopwatch = Stopwatch::new(1.0, &clock, &mut progress);
    let plan = RecordingPlan {
        accuracies: vec![Accuracy::Fast, Accuracy::Standard],
        frame_rates_hz: vec![60.0, 120.0],
        reductions: vec![2, 4],
        exposures_s: vec![0.0005],
        usual: RecordingSetting {
            frame_rate_hz: 120.0,
            reduction: 2,
            ..RecordingSetting::DEFAULT
        },
        tools: Vec::new(),
        crfs: vec![14],
        recordings: 5,
        ..RecordingPlan::full()
    };
    let requirements: Vec<Requirement> = ["restitution=0.002", "rebound_angle_deg=0.2"]
        .map(|w| w.parse().unwrap())
        .to_vec();
    let (section, settings) = recordings::run(&plan, &mut stopwatch).unwrap();
    let found = cost::recommendation::recommend(
        &section,
        &requirements,
        |_| true,
        |i| recordings::refusal(&settings[i], &requirements, &mut stopwatch),
    )
    .unwrap();
    println!("{}", found.words);
    let setting = settings[found.chosen.expect("some setting is good enough")];
    let check = recordings::check(&setting, &requirements, NEW, &mut stopwatch).unwrap();
    println!("{check:?}");
    assert_eq!(check.recordings as u64, NEW);
    assert!(check.inside as f64 >= 0.95 * NEW as f64, "{check:?}");
    // And a check can fail: one that nothing reaches.
    let hopeless: Vec<Requirement> = vec!["restitution=1e-9".parse().unwrap()];
    let check = recordings::check(&setting, &hopeless, 2, &mut stopwatch).unwrap();
    assert_eq!(check.inside, 0);
    assert!(check.first_miss.unwrap().contains("restitution off by"));
}
