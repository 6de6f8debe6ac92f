//! Frames a second of decoding alone, of the three accuracy levels, and of a hand-written OpenCV threshold pipeline, side
//! by side on one rendered 1080p H.264 recording: `cargo bench --bench speed [-- ROUNDS]`.
//!
//! `cargo bench --bench speed -- FILE... [ROUNDS]` takes recordings of your own instead: what measuring each takes, against decoding it
//! alone, in turn (the median of the ratios and the least and largest of them), and the parts of it: up to the first frame looked at
//! (the survey and the empty scene), the frames, and what follows the last one (the ball's appearance, centres, flights, impacts). A
//! `calib.json` among the files is that of those after it; without one a pixel is a millimetre.
//!
//! Decoding alone is the same decoder with the same threads, its frames thrown away. All are run in turn, round after
//! round, so that what else the machine does falls on all alike; the quickest round of each counts. Processor time stands beside the
//! clock, since on a busy machine the clock alone tells little.
#![allow(clippy::print_stdout)] // that is what it is for

use anyhow::{Context, Result};
use opencv::core::{Mat, MatExprTraitConst, MatTraitConst, Point, Size, Vector};
use opencv::imgproc;
use std::path::Path;
use std::time::{Duration, Instant};
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::frames::{self, FrameSource, Luma};
use track::pipeline::{Progress, measure};
use track::simulate::truth::Truth;
use track::simulate::{Scene, SimulatedRecording, write};

/// How long the recording goes on after the fifth bounce, s: a clip of 2 s and one of 9 s, since part of the work (the empty
/// scene, the ball's appearance) is done once.
const TAILS_S: [f64; 2] = [0.2, 7.0];

/// A shaded ball of R 20.8 px that bounces five times in 2 s, before a wall with texture.
const SCENE: &str = r#"{"schema": "track.scene/1", "seed": 3,
    "launch": {"drop_height_m": 0.5, "speed_m_s": 0.65},
    "ball": {"radius_m": 0.0125, "mass_kg": 0.0639},
    "contact": {"model": "mu_e", "restitution": 0.8, "friction": 0.07},
    "camera": {"image_size_px": [1920, 1080], "frame_rate_hz": 240, "exposure_s": 0.001,
        "metres_per_pixel": 0.0006, "origin_px": [150, 1000]},
    "look": {"shading": 0.5, "texture_grey": 6},
    "stop": {"bounces": 5, "tail_s": TAIL}}"#;

/// Rounds, where none are asked for.
const ROUNDS: usize = 5;

/// What a run took and found.
struct Run {
    clock: Duration,
    processor_s: Option<f64>,
    /// Frame and centre, px.
    centres: Vec<(usize, [f64; 2])>,
}

type Work<'a> = Box<dyn Fn() -> Result<Vec<(usize, [f64; 2])>> + 'a>;

fn main() -> Result<()> {
    // Cargo adds `--bench`; a number is ours.
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let rounds = arguments.iter().find_map(|a| a.parse().ok());
    let rounds = rounds.unwrap_or(ROUNDS).max(1);
    let ours = |a: &&String| !a.starts_with("--") && a.parse::<usize>().is_err();
    let files: Vec<&Path> = arguments.iter().filter(ours).map(Path::new).collect();
    if !files.is_empty() {
        return compare_files(&files, rounds);
    }
    for tail_s in TAILS_S {
        compare(tail_s, rounds)?;
    }
    Ok(())
}

/// A calibration for recordings that come without one.
const ANY_CALIBRATION: &str =
    r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": 0.001}, "origin_px": [0, 0]}"#;

/// What measuring takes, s: up to the first frame, up to the last, all of it; and decoding alone.
struct FileRun {
    first_frame_s: f64,
    last_frame_s: f64,
    whole_s: f64,
    decoding_s: f64,
}

fn compare_files(files: &[&Path], rounds: usize) -> Result<()> {
    let dir = tempfile::tempdir()?;
    let any = dir.path().join("calib.json");
    std::fs::write(&any, ANY_CALIBRATION)?;
    let mut calibration = Calibration::read(&any)?;
    println!("{rounds} rounds, {} cores; times are medians.\n", cores());
    println!(
        "| recording | frames | decoding alone, s | measuring, s | ratio | least to largest | before the frames, s | frames, s | after them, s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for file in files {
        if file.extension().is_some_and(|e| e == "json") {
            calibration = Calibration::read(file)?;
            continue;
        }
        let mut frames = 0;
        let mut runs = Vec::with_capacity(rounds);
        for _ in 0..rounds {
            runs.push(file_run(file, &calibration, &mut frames)?);
        }
        let median = |of: &dyn Fn(&FileRun) -> f64| sorted(&runs, of)[rounds / 2];
        let ratios = sorted(&runs, &|r| r.whole_s / r.decoding_s);
        println!(
            "| {} | {frames} | {:.2} | {:.2} | {:.2} | {:.2} to {:.2} | {:.2} | {:.2} | {:.2} |",
            file.file_name().unwrap_or_default().display(),
            median(&|r| r.decoding_s),
            median(&|r| r.whole_s),
            ratios[rounds / 2],
            ratios[0],
            ratios[rounds - 1],
            median(&|r| r.first_frame_s),
            median(&|r| r.last_frame_s - r.first_frame_s),
            median(&|r| r.whole_s - r.last_frame_s),
        );
    }
    Ok(())
}

fn sorted(runs: &[FileRun], of: &dyn Fn(&FileRun) -> f64) -> Vec<f64> {
    let mut all: Vec<f64> = runs.iter().map(of).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// Decoding alone, then measuring, of a recording whose number of frames is left in `frames`.
fn file_run(file: &Path, calibration: &Calibration, frames: &mut usize) -> Result<FileRun> {
    let start = Instant::now();
    decoded(file)?;
    let decoding_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let (mut first_frame_s, mut last_frame_s) = (None, 0.0);
    measure(file, calibration, "speed", Accuracy::Standard, &mut |progress| {
        let now_s = start.elapsed().as_secs_f64();
        match progress {
            Progress::Survey => {}
            Progress::Frame { index, .. } => {
                first_frame_s.get_or_insert(now_s);
                *frames = index + 1;
            }
            Progress::Fit => last_frame_s = now_s,
        }
    })?;
    Ok(FileRun {
        first_frame_s: first_frame_s.unwrap_or(last_frame_s),
        last_frame_s,
        whole_s: start.elapsed().as_secs_f64(),
        decoding_s,
    })
}

fn compare(tail_s: f64, rounds: usize) -> Result<()> {
    let dir = tempfile::tempdir()?;
    let scene = Scene::from_json(&SCENE.replace("TAIL", &tail_s.to_string()))?;
    let recording = SimulatedRecording::new(&scene)?;
    let truth = recording.truth();
    let written = write(&recording, "speed", dir.path(), |_| {})?;
    let calibration = Calibration::read(&written.calib)?;
    let video = written.video.as_path();
    let by = |accuracy| -> Work<'_> {
        let calibration = &calibration;
        Box::new(move || measured(video, calibration, accuracy))
    };
    let works: Vec<(&str, Work<'_>)> = vec![
        ("decoding alone", Box::new(move || decoded(video))),
        ("`fast`", by(Accuracy::Fast)),
        ("`standard`", by(Accuracy::Standard)),
        ("`fine`", by(Accuracy::Fine)),
        (
            "OpenCV: background, threshold, contour, moments",
            Box::new(move || thresholded(video)),
        ),
    ];
    let mut runs: Vec<Vec<Run>> = works.iter().map(|_| Vec::new()).collect();
    for _ in 0..rounds {
        for ((_, work), runs) in works.iter().zip(&mut runs) {
            runs.push(timed(work)?);
        }
    }
    report(&works, &runs, &truth, recording.frame_count());
    Ok(())
}

fn timed(work: &Work<'_>) -> Result<Run> {
    let before_s = processor_s();
    let start = Instant::now();
    let centres = work()?;
    Ok(Run {
        clock: start.elapsed(),
        processor_s: before_s.zip(processor_s()).map(|(a, b)| b - a),
        centres,
    })
}

fn report(works: &[(&str, Work<'_>)], runs: &[Vec<Run>], truth: &Truth, frames: usize) {
    let quickest = |runs: &[Run]| {
        runs.iter()
            .map(|r| r.clock)
            .min()
            .unwrap_or_default()
            .as_secs_f64()
    };
    let least = |runs: &[Run]| {
        let times = runs.iter().filter_map(|r| r.processor_s);
        times.min_by(f64::total_cmp).unwrap_or(f64::NAN)
    };
    println!(
        "\n{frames} frames, 1920 x 1080, H.264, {} cores; the quickest of {} rounds.\n",
        cores(),
        runs[0].len()
    );
    println!(
        "| | frames/s | of decoding alone | processor, ms a frame | its ratio | centres | rms error, px |"
    );
    println!("|---|---|---|---|---|---|---|");
    for ((name, _), these) in works.iter().zip(runs) {
        let (clock, processor) = (quickest(these), least(these));
        let (count, rms_px) = error(these.first().map_or(&[], |r| &r.centres), truth);
        let centres = if count == 0 {
            "".to_owned()
        } else {
            count.to_string()
        };
        let rms = if count == 0 {
            String::new()
        } else {
            format!("{rms_px:.3}")
        };
        println!(
            "| {name} | {:.0} | {:.2} | {:.2} | {:.2} | {centres} | {rms} |",
            frames as f64 / clock,
            quickest(&runs[0]) / clock,
            1e3 * processor / frames as f64,
            least(&runs[0]) / processor,
        );
    }
}

/// How many centres there are, and their rms distance from the truth, px.
fn error(centres: &[(usize, [f64; 2])], truth: &Truth) -> (usize, f64) {
    let squares: Vec<f64> = centres
        .iter()
        .filter_map(|(frame, [u, v])| {
            let c = truth.centres.iter().find(|c| c.frame == *frame)?;
            Some((u - c.u_px).powi(2) + (v - c.v_px).powi(2))
        })
        .collect();
    (
        squares.len(),
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt(),
    )
}

fn decoded(video: &Path) -> Result<Vec<(usize, [f64; 2])>> {
    let mut source = frames::open(video)?;
    while let Some(frame) = source.next_frame()? {
        source.recycle(frame);
    }
    Ok(Vec::new())
}

fn measured(video: &Path, calibration: &Calibration, accuracy: Accuracy) -> Result<Vec<(usize, [f64; 2])>> {
    let m = measure(video, calibration, "speed", accuracy, &mut |_| {})?;
    Ok(m.track
        .points
        .iter()
        .map(|p| (p.frame, [p.pixel.u_px, p.pixel.v_px]))
        .collect())
}

/// What one finds in many a lab: difference to the mean of some frames, blur, threshold, the largest contour's centre.
fn thresholded(video: &Path) -> Result<Vec<(usize, [f64; 2])>> {
    const SCENE_FRAMES: usize = 15;
    const THRESHOLD_GREY: f64 = 30.0;
    let survey = frames::open_sparse(video, SCENE_FRAMES)?;
    let first = survey.first().context("no frames")?;
    let mut sum = Mat::zeros(rows(&first.luma)?, columns(&first.luma)?, opencv::core::CV_32F)?.to_mat()?;
    for frame in &survey {
        imgproc::accumulate_def(&mat(&frame.luma)?, &mut sum)?;
    }
    let mut empty = Mat::default();
    sum.convert_to(&mut empty, opencv::core::CV_8U, 1.0 / survey.len() as f64, 0.0)?;
    let mut centres = Vec::new();
    let mut source = frames::ReadAhead::start(frames::open(video)?)?;
    while let Some(frame) = source.next_frame()? {
        let (mut change, mut smooth, mut mask) = (Mat::default(), Mat::default(), Mat::default());
        opencv::core::absdiff(&mat(&frame.luma)?, &empty, &mut change)?;
        imgproc::gaussian_blur_def(&change, &mut smooth, Size::new(5, 5), 0.0)?;
        imgproc::threshold(&smooth, &mut mask, THRESHOLD_GREY, 255.0, imgproc::THRESH_BINARY)?;
        let mut contours: Vector<Vector<Point>> = Vector::new();
        imgproc::find_contours_def(
            &mask,
            &mut contours,
            imgproc::RETR_EXTERNAL,
            imgproc::CHAIN_APPROX_NONE,
        )?;
        let mut largest = imgproc::moments_def(&Mat::zeros(1, 1, opencv::core::CV_8U)?.to_mat()?)?;
        for contour in contours {
            let m = imgproc::moments_def(&contour)?;
            if m.m00 > largest.m00 {
                largest = m;
            }
        }
        if largest.m00 > 0.0 {
            centres.push((
                frame.index,
                [largest.m10 / largest.m00, largest.m01 / largest.m00],
            ));
        }
        source.recycle(frame);
    }
    Ok(centres)
}

fn rows(luma: &Luma) -> Result<i32> {
    Ok(i32::try_from(luma.height)?)
}

fn columns(luma: &Luma) -> Result<i32> {
    Ok(i32::try_from(luma.width)?)
}

/// The picture as OpenCV's, without a copy.
fn mat(luma: &Luma) -> Result<opencv::boxed_ref::BoxedRef<'_, Mat>> {
    Ok(Mat::new_rows_cols_with_data(
        rows(luma)?,
        columns(luma)?,
        &luma.data,
    )?)
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Processor time of this process so far, all threads, s; where the system tells it as Linux does.
fn processor_s() -> Option<f64> {
    /// Ticks a second in /proc, fixed by Linux's interface.
    const TICKS_HZ: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The program's name, in brackets, may hold anything; user and system time are fields 14 and 15.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / TICKS_HZ)
}
