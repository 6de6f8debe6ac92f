//! How much memory a recording of the largest usual pictures takes (7680 × 4320 px): of those each frame more is 50 MB.

#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::tempdir;
use track::frames::{Coding, Luma, VideoOptions, VideoWriter};

const SIZE: (usize, usize) = (7680, 4320);
const RADIUS_PX: f64 = 80.0;

/// A bright disc that falls and bounces before a wall with a pattern.
fn write_clip(path: &Path, frames: usize, gop: u32) {
    let wall = Luma::from_fn(SIZE.0, SIZE.1, |u, v| 90 + ((u / 64 + v / 64) % 2 * 20) as u8);
    let mut picture = wall.clone();
    let coding = Coding::H264 {
        crf: 20,
        gop,
        b_frames: 3,
    };
    let mut writer =
        VideoWriter::create_with(path, SIZE.0, SIZE.1, &VideoOptions::new(60.0, coding)).unwrap();
    for i in 0..frames {
        let t = i as f64 / 60.0;
        let (u, v) = (
            400.0 + 5000.0 * t,
            4000.0 - 3000.0 * (2.5 * t - 12.0 * t * t).abs(),
        );
        let rows = (v - RADIUS_PX) as usize..(v + RADIUS_PX) as usize;
        let chord = |row: usize| {
            let half = (RADIUS_PX.powi(2) - (row as f64 - v).powi(2)).max(0.0).sqrt();
            row * SIZE.0 + (u - half) as usize..row * SIZE.0 + (u + half) as usize
        };
        for row in rows.clone() {
            picture.data[chord(row)].fill(220);
        }
        writer.write(&picture).unwrap();
        for row in rows {
            picture.data[chord(row)].copy_from_slice(&wall.data[chord(row)]);
        }
    }
    writer.finish().unwrap();
}

/// The largest resident set of `track` on `video`, with all files written beside it, kB of 1024 bytes; what it found does not matter here.
fn peak_kb(video: &Path) -> u64 {
    let calib = video.with_extension("calib.json");
    let text =
        r#"{"schema": "track.calib/1", "scale": {"metres_per_pixel": 0.0002}, "origin_px": [400, 4080]}"#;
    std::fs::write(&calib, text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_track"));
    command.arg(video).arg("--calib").arg(&calib);
    command.arg("--out").arg(video.with_extension("out"));
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut running = command.spawn().unwrap();
    let status = format!("/proc/{}/status", running.id());
    let mut peak_kb = 0;
    while running.try_wait().unwrap().is_none() {
        // (Its last moments have none.)
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        let kb = line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse().ok());
        peak_kb = peak_kb.max(kb.unwrap_or(0));
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let overlay = format!("{}.overlay.mp4", video.file_stem().unwrap().display());
    assert!(video.with_extension("out").join(overlay).is_file());
    peak_kb
}

/// Once with key frames enough for the scene of the whole, once where that takes a pass of its own.
#[test]
fn pictures_of_7680_by_4320_take_less_than_600_mb() {
    let dir = tempdir().unwrap();
    for (name, gop) in [("key-frames.mp4", 5), ("one-key-frame.mp4", 250)] {
        let video = dir.path().join(name);
        write_clip(&video, 24, gop);
        let kb = peak_kb(&video);
        println!("{name}: {kb} kB");
        assert!((100_000..600 * 1024).contains(&kb), "{name}: {kb} kB");
    }
}
