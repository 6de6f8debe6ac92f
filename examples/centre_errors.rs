//! How far centres are from the truth, over radius, noise, light and codec: a table, and a plot of the errors against the
//! sub-pixel phase. `cargo run --release --example centre_errors [DIR]` writes DIR/centre_errors.svg (default: here).
#![allow(clippy::print_stdout)] // that is what it is for

use anyhow::{Context, Result};
use plotters::prelude::*;
use std::path::{Path, PathBuf};
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::pipeline::{PointUse, measure};
use track::simulate::{Scene, SimulatedRecording, write};

/// Grey levels of the simulator's flat ball over its background.
const CONTRAST_GREY: f64 = 140.0;
const OPTICS_BLUR_PX: f64 = 0.7;

/// A light and a codec to try.
struct Look {
    name: &'static str,
    look: &'static str,
    codec: &'static str,
}

const LOOKS: [Look; 4] = [
    Look {
        name: "flat, lossless",
        look: r#"{"shading": 0}"#,
        codec: r#""codec": "lossless""#,
    },
    Look {
        name: "shaded with highlight, lossless",
        look: r#"{"shading": 0.5, "highlight_grey": 40}"#,
        codec: r#""codec": "lossless""#,
    },
    Look {
        name: "shaded with highlight, H.264 crf 14",
        look: r#"{"shading": 0.5, "highlight_grey": 40}"#,
        codec: r#""codec": "h264", "crf": 14"#,
    },
    Look {
        name: "shaded with highlight, H.264 crf 20",
        look: r#"{"shading": 0.5, "highlight_grey": 40}"#,
        codec: r#""codec": "h264", "crf": 20"#,
    },
];

/// A centre's error and where in its pixel the truth was.
struct Error {
    frame: usize,
    phase_px: f64,
    error_px: f64,
}

fn main() -> Result<()> {
    let dir = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| ".".to_owned()));
    let scratch = tempfile::tempdir()?;
    let mut clouds = Vec::new();
    let mut alike = Vec::new();
    println!(
        "| light and codec | R, px | noise, grey | method | centres | bias u, v, px | scatter u, v, px | Cramér-Rao, px | rms, px |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for look in &LOOKS {
        for (radius_px, noise_grey) in [(5.0, 2.0), (8.0, 2.0), (15.6, 2.0), (15.6, 8.0), (40.0, 2.0)] {
            let (calibration, video, truth) = recording(scratch.path(), look, radius_px, noise_grey)?;
            let mut by_edges = Vec::new();
            for (word, accuracy) in [
                ("fast", Accuracy::Fast),
                ("standard", Accuracy::Standard),
                ("fine", Accuracy::Fine),
            ] {
                let name = format!("{} | {radius_px} | {noise_grey} | {word}", look.name);
                let m = measure(&video, &calibration, "truth", accuracy, &mut |_| {})?;
                let errors: Vec<[Error; 2]> = m
                    .track
                    .points
                    .iter()
                    .filter(|p| matches!(p.use_, PointUse::Used(_)))
                    .filter_map(|p| {
                        let c = truth.centres.iter().find(|c| c.frame == p.frame)?;
                        let of = |found: f64, true_: f64| Error {
                            frame: p.frame,
                            phase_px: true_ - true_.floor(),
                            error_px: found - true_,
                        };
                        Some([of(p.pixel.u_px, c.u_px), of(p.pixel.v_px, c.v_px)])
                    })
                    .collect();
                report(&name, &errors, radius_px, noise_grey);
                if word == "fast" {
                    by_edges = errors;
                } else if word == "standard" {
                    alike.push((
                        format!("{} | {radius_px} | {noise_grey}", look.name),
                        likeness(&by_edges, &errors),
                    ));
                    clouds.push((
                        format!("{}, R {radius_px}, noise {noise_grey}", look.name),
                        errors,
                    ));
                }
            }
        }
    }
    println!(
        "\nDo edge points (`fast`) and pixels' likelihood (`standard`) err alike, frame by frame? Then the ball is displaced in"
    );
    println!("the picture itself, and no method that sees one frame finds it elsewhere.\n");
    println!("| light and codec | R, px | noise, grey | correlation of their errors | rms difference, px |");
    println!("|---|---|---|---|---|");
    for (name, (correlation, difference_px)) in &alike {
        println!("| {name} | {correlation:.2} | {difference_px:.4} |");
    }
    plot(&dir.join("centre_errors.svg"), &clouds)
}

/// Correlation of the errors of two methods in the frames that both have, biases aside, and the rms of their difference, px.
fn likeness(one: &[[Error; 2]], other: &[[Error; 2]]) -> (f64, f64) {
    let [
        mut product,
        mut squares,
        mut other_squares,
        mut difference,
        mut count,
    ] = [0.0; 5];
    for k in 0..2 {
        let pairs: Vec<(f64, f64)> = one
            .iter()
            .filter_map(|a| {
                let b = other.iter().find(|b| b[k].frame == a[k].frame)?;
                Some((a[k].error_px, b[k].error_px))
            })
            .collect();
        let n = pairs.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
        let (one_mean, other_mean) = (mean(|p| p.0), mean(|p| p.1));
        for (a, b) in &pairs {
            let (a, b) = (a - one_mean, b - other_mean);
            product += a * b;
            squares += a * a;
            other_squares += b * b;
            difference += (a - b).powi(2);
        }
        count += n;
    }
    let correlation = product / (squares * other_squares).sqrt();
    (correlation, (difference / count).sqrt())
}

/// A ball launched into free fall and one bounce, in a picture that just holds it.
fn recording(
    dir: &Path,
    look: &Look,
    radius_px: f64,
    noise_grey: f64,
) -> Result<(Calibration, PathBuf, track::simulate::truth::Truth)> {
    let q = 0.0125 / radius_px;
    let even = |m: f64| (m / q / 2.0).round() * 2.0;
    let (width, height) = (even(0.46), even(0.30));
    let json = format!(
        r#"{{"schema": "track.scene/1", "seed": 11, "ball": {{"radius_m": 0.0125, "mass_kg": 0.0639}},
            "contact": {{"model": "mu_e", "restitution": 0.8, "friction": 0.07}},
            "launch": {{"drop_height_m": 0.2, "speed_m_s": 0.7}},
            "camera": {{"image_size_px": [{width}, {height}], "frame_rate_hz": 240, "exposure_s": 0, "metres_per_pixel": {q},
                "origin_px": [{}, {}], "blur_px": {OPTICS_BLUR_PX}, "noise_grey": {noise_grey}, {}}},
            "look": {}, "stop": {{"bounces": 2, "tail_s": 0.02}}}}"#,
        0.03 / q,
        height - 0.035 / q,
        look.codec,
        look.look
    );
    let recording = SimulatedRecording::new(&Scene::from_json(&json)?)?;
    let written = write(&recording, "clip", dir, |_| {})?;
    let calibration = Calibration::read(&written.calib)?;
    Ok((calibration, written.video, recording.truth()))
}

fn report(name: &str, errors: &[[Error; 2]], radius_px: f64, noise_grey: f64) {
    let n = errors.len() as f64;
    let mean = |k: usize| errors.iter().map(|e| e[k].error_px).sum::<f64>() / n;
    let bias = [mean(0), mean(1)];
    let scatter = |k: usize| {
        (errors
            .iter()
            .map(|e| (e[k].error_px - bias[k]).powi(2))
            .sum::<f64>()
            / (n - 1.0))
            .sqrt()
    };
    let rms = (errors
        .iter()
        .map(|e| e[0].error_px.powi(2) + e[1].error_px.powi(2))
        .sum::<f64>()
        / (2.0 * n))
        .sqrt();
    // The pixel's own square blurs as well; rounding is noise as well.
    let blur_px = OPTICS_BLUR_PX.hypot(0.289);
    let noise = noise_grey.hypot(0.289);
    let bound = noise / CONTRAST_GREY * (2.0 * blur_px / (std::f64::consts::PI.sqrt() * radius_px)).sqrt();
    println!(
        "| {name} | {n} | {:+.4}, {:+.4} | {:.4}, {:.4} | {bound:.4} | {rms:.4} |",
        bias[0],
        bias[1],
        scatter(0),
        scatter(1)
    );
}

fn plot(path: &Path, clouds: &[(String, Vec<[Error; 2]>)]) -> Result<()> {
    let drawn = || -> Result<(), Box<dyn std::error::Error>> {
        let (columns, rows) = (5, clouds.len().div_ceil(5));
        let root = SVGBackend::new(path, (1500, 260 * rows as u32)).into_drawing_area();
        root.fill(&WHITE)?;
        for (area, (name, errors)) in root.split_evenly((rows, columns)).iter().zip(clouds) {
            let most = errors
                .iter()
                .flatten()
                .map(|e| e.error_px.abs())
                .fold(1e-3, f64::max);
            let mut chart = ChartBuilder::on(area)
                .caption(name, ("sans-serif", 12))
                .margin(6)
                .x_label_area_size(28)
                .y_label_area_size(48)
                .build_cartesian_2d(0.0..1.0, -most..most)?;
            chart
                .configure_mesh()
                .x_desc("sub-pixel phase, px")
                .y_desc("error, px")
                .x_labels(5)
                .y_labels(5)
                .light_line_style(WHITE)
                .draw()?;
            for (k, filled) in [(0, true), (1, false)] {
                chart.draw_series(errors.iter().map(|e| {
                    let style = if filled {
                        BLACK.filled()
                    } else {
                        BLACK.stroke_width(1)
                    };
                    Circle::new((e[k].phase_px, e[k].error_px), 2, style)
                }))?;
            }
        }
        root.present()?;
        Ok(())
    };
    drawn()
        .map_err(|e| anyhow::anyhow!("{e}"))
        .with_context(|| format!("cannot draw {}", path.display()))?;
    println!(
        "\nErrors along u (filled) and v (open) against the phase: {}",
        path.display()
    );
    Ok(())
}
