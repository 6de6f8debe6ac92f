//! Hard recordings, of several launches in one file: with a pause between, joined frame to frame, with a piece cut out by the
//! stamps, with a second ball in the picture. And of one launch that must not be taken for several.
//!
//! Every number of every launch must hold the truth within its own uncertainty.

use crate::hard::{Clip, HONEST_SIGMAS, Judged, paint_disc, scene, with};
use serde_json::json;
use track::detect::centre::Accuracy;
use track::frames::{Coding, Luma, Timing, VideoOptions, VideoWriter};
use track::pipeline::{Measurement, measure};

/// A launch from a bench at this height with this speed.
fn thrown(seed: u64, drop_height_m: f64, speed_m_s: f64) -> Clip {
    Clip::of(&with(
        scene(seed),
        "launch",
        json!({"drop_height_m": drop_height_m, "speed_m_s": speed_m_s}),
    ))
}

/// The scene of `clip` without its ball, each time with noise of its own.
fn empty(clip: &Clip, count: usize) -> Vec<Luma> {
    let last = clip.frames.len() - 1;
    let ball = |i: usize| (clip.truth.centres[i].u_px, clip.truth.centres[i].v_px);
    let picture = |n: usize| {
        let i = n % (last / 3);
        let (a, b) = (&clip.frames[i], &clip.frames[last - i]);
        let (u, v) = ball(i);
        Luma::from_fn(a.width, a.height, |x, y| {
            let near = (x as f64 - u).hypot(y as f64 - v) < 40.0;
            let from = if near { b } else { a };
            from.data[y * a.width + x]
        })
    };
    (0..count).map(picture).collect()
}

/// Several launches before one camera, and when each begins in the file.
struct Session {
    pictures: Vec<Luma>,
    /// Which of them each frame shows, and when.
    frames: Vec<(usize, f64)>,
    clips: Vec<Clip>,
    starts_s: Vec<f64>,
}

/// Pictures of the empty scene, shown in turn.
const EMPTY_PICTURES: usize = 40;

impl Session {
    /// The `clips` one after the other, with so many frames without a ball between them.
    fn of(clips: Vec<Clip>, pause: usize) -> Self {
        let order: Vec<usize> = (0..clips.len()).collect();
        Self::in_order(&clips, &order, pause)
    }

    /// The same of those of `kinds` that `order` says.
    fn in_order(kinds: &[Clip], order: &[usize], pause: usize) -> Self {
        let rate_hz = kinds[0].rate_hz;
        let mut pictures = empty(&kinds[0], EMPTY_PICTURES);
        let firsts: Vec<usize> = kinds
            .iter()
            .map(|clip| {
                pictures.extend(clip.frames.clone());
                pictures.len() - clip.frames.len()
            })
            .collect();
        let (mut shown, mut starts_s) = (Vec::new(), Vec::new());
        for (i, &kind) in order.iter().enumerate() {
            if i > 0 {
                shown.extend((0..pause).map(|n| n % EMPTY_PICTURES));
            }
            starts_s.push(shown.len() as f64 / rate_hz);
            shown.extend(firsts[kind]..firsts[kind] + kinds[kind].frames.len());
        }
        let timed = shown.into_iter().enumerate();
        Self {
            pictures,
            frames: timed.map(|(i, picture)| (picture, i as f64 / rate_hz)).collect(),
            clips: order
                .iter()
                .map(|&kind| kinds[kind].clone().without_pictures())
                .collect(),
            starts_s,
        }
    }

    /// The same with `cut_s` seconds missing before each launch but the first: their stamps are later by as much.
    fn cut(mut self, cut_s: f64) -> Self {
        let starts = self.starts_s.clone();
        let later = |t: f64| cut_s * starts[1..].iter().filter(|&&s| t >= s - 1e-9).count() as f64;
        self.frames.iter_mut().for_each(|(_, t)| *t += later(*t));
        self.starts_s.iter_mut().for_each(|t| *t += later(*t));
        self
    }

    fn write(&self, path: &std::path::Path) {
        let first = &self.pictures[0];
        let coding = Coding::H264 {
            crf: 0,
            gop: 12,
            b_frames: 0,
        };
        let options = VideoOptions {
            timing: Timing::Stamped,
            ..VideoOptions::new(self.clips[0].rate_hz, coding)
        };
        let mut writer = VideoWriter::create_with(path, first.width, first.height, &options).unwrap();
        for &(picture, t) in &self.frames {
            writer.write_at(&self.pictures[picture], t).unwrap();
        }
        writer.finish().unwrap();
    }

    fn measured(&self) -> Measurement {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("session.mp4");
        self.write(&path);
        let calibration = &self.clips[0].calibration;
        measure(&path, calibration, "calib.json", Accuracy::Standard, &mut |_| {}).unwrap()
    }

    /// That each launch is measured, with all its bounces, and true.
    fn assert_true(&self, what: &str) -> Measurement {
        self.assert_within(HONEST_SIGMAS, what)
    }

    /// The same to so many standard uncertainties.
    fn assert_within(&self, sigmas: f64, what: &str) -> Measurement {
        let m = self.measured();
        let found: Vec<_> = m.each_launch().iter().map(Measurement::time_span).collect();
        assert_eq!(
            m.each_launch().len(),
            self.clips.len(),
            "{what}: {found:.3?} of {:.3?}, warned {:?}",
            self.starts_s,
            m.warnings
        );
        for (n, launch) in m.each_launch().iter().enumerate() {
            let mut clip = self.clips[n].clone();
            // What the launch's own clock shows where the file begins.
            clip.times_s[0] -= self.starts_s[n];
            let bounces = clip.truth.bounces.len();
            let judged = Judged::new(Ok(launch.clone()), &clip);
            let lies = judged.lies(sigmas);
            assert!(lies.is_empty(), "{what}, launch {}: {lies:#?}", n + 1);
            assert_eq!(judged.bounces(), bounces, "{what}, launch {}", n + 1);
            assert!(launch.distances.x0_m.is_some(), "{what}, launch {}", n + 1);
        }
        m
    }
}

fn codes(m: &Measurement) -> Vec<&'static str> {
    m.warnings.iter().map(|w| w.code).collect()
}

#[test]
fn each_launch_of_a_session_is_measured() {
    let clips = vec![thrown(1, 0.2, 0.6), thrown(2, 0.2, 0.6), thrown(3, 0.12, 0.9)];
    let m = Session::of(clips, 120).assert_true("three launches");
    assert!(codes(&m).contains(&"several_launches"), "{:?}", m.warnings);
    assert!(!codes(&m).contains(&"piece_cut_out"), "{:?}", m.warnings);
    // What stands at the top is the first.
    assert_eq!(m.bounces, m.launches[0].bounces);
    assert_eq!(m.distances, m.launches[0].distances);
    let codes = codes(&m);
    assert!(
        codes
            .iter()
            .all(|c| codes.iter().filter(|d| d == &c).count() == 1),
        "{codes:?}"
    );
}

#[test]
fn launches_that_lose_speed_are_told_from_the_rest_of_one() {
    let clips = vec![thrown(4, 0.22, 0.7), thrown(5, 0.1, 0.5), thrown(6, 0.05, 0.35)];
    Session::of(clips, 60).assert_true("slower and lower");
}

/// As long as a camera runs: each launch is found, however many there are.
#[test]
fn a_session_of_twenty_launches_is_measured_whole() {
    let kinds = [(0.2, 0.6), (0.12, 0.7), (0.16, 0.5), (0.2, 0.4)];
    let kinds: Vec<Clip> = (16..)
        .zip(kinds)
        .map(|(seed, (h, v))| thrown(seed, h, v))
        .collect();
    let order: Vec<usize> = (0..20).map(|i| i % kinds.len()).collect();
    // Of 600 numbers one in 20 sessions is off by more than 4.
    let m = Session::in_order(&kinds, &order, 260).assert_within(4.5, "twenty");
    assert_eq!(codes(&m).iter().filter(|c| **c == "several_launches").count(), 1);
}

#[test]
fn a_batch_fits_the_bounces_of_all_launches() {
    let session = Session::of(vec![thrown(14, 0.2, 0.6), thrown(15, 0.15, 0.6)], 80);
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    std::fs::create_dir(path("clips")).unwrap();
    session.write(&path("clips/session.mp4"));
    let calibration = session.clips[0].calibration_json.to_string();
    std::fs::write(path("clips/session.calib.json"), calibration).unwrap();
    assert_cmd::Command::new(env!("CARGO_BIN_EXE_track"))
        .args(["batch", "clips", "--out", "lab"])
        .current_dir(dir.path())
        .assert()
        .success();
    let table = std::fs::read_to_string(path("lab/series.csv")).unwrap();
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let column = rows
        .headers()
        .unwrap()
        .iter()
        .position(|name| name == "launch")
        .unwrap();
    let launches: Vec<String> = rows
        .records()
        .map(|row| row.unwrap()[column].to_owned())
        .collect();
    assert_eq!(launches, ["1", "1", "2", "2"]);
    let fit: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path("lab/fit.json")).unwrap()).unwrap();
    assert_eq!(fit["groups"][0]["rows"], 4);
    let e = &fit["groups"][0]["models"][0]["parameters"]["restitution"];
    let off = e["value"].as_f64().unwrap() - 0.78;
    assert!(off.abs() < 4.0 * e["std_uncertainty"].as_f64().unwrap(), "{e}");
}

#[test]
fn clips_joined_frame_to_frame_are_two_launches_and_said() {
    let m = Session::of(vec![thrown(7, 0.2, 0.6), thrown(8, 0.15, 0.5)], 0).assert_true("joined");
    assert!(codes(&m).contains(&"piece_cut_out"), "{:?}", m.warnings);
}

#[test]
fn a_piece_cut_out_of_the_stamps_is_said() {
    let session = Session::of(vec![thrown(9, 0.2, 0.6), thrown(10, 0.15, 0.7)], 10).cut(7.0);
    let m = session.assert_true("cut");
    assert!(codes(&m).contains(&"piece_cut_out"), "{:?}", m.warnings);
    assert!(
        m.warnings.iter().any(|w| w.message.contains("7.0")),
        "{:?}",
        m.warnings
    );
}

#[test]
fn a_second_ball_in_the_air_is_no_launch() {
    let (first, second) = (thrown(11, 0.2, 0.6), thrown(12, 0.15, 0.3));
    // The second ball flies later and longer, from before the first one's end.
    let late = 2 * first.frames.len() / 3;
    let path = second.truth.centres.clone();
    let mut frames = first.frames.clone();
    frames.extend(empty(&first, late + path.len() - first.frames.len()));
    for (i, c) in path.iter().enumerate() {
        paint_disc(&mut frames[late + i], c.u_px + 60.0, c.v_px, 8.0, 200.0);
    }
    let session = Session {
        frames: (0..frames.len()).map(|i| (i, i as f64 / 240.0)).collect(),
        pictures: frames,
        clips: vec![first],
        starts_s: vec![0.0],
    };
    assert_eq!(session.measured().each_launch().len(), 1);
}

#[test]
fn one_launch_that_is_hidden_for_a_while_is_one() {
    let long = with(scene(13), "stop", json!({"bounces": 7, "tail_s": 0.1}));
    let long = with(long, "launch", json!({"speed_m_s": 0.2}));
    let clip = Clip::of(&long);
    let bounces = &clip.truth.bounces;
    let scene = empty(&clip, clip.frames.len());
    for (from, to) in [(1, 2), (2, 4), (1, 5)] {
        // Something stands before the ball from above one bounce to above another.
        let (from, to) = (bounces[from].time_s + 0.04, bounces[to].time_s + 0.03);
        let mut hidden = clip.clone();
        for (i, frame) in scene.iter().enumerate() {
            if (from..to).contains(&clip.times_s[i]) {
                hidden.frames[i] = frame.clone();
            }
        }
        let found = hidden.measured();
        let m = found.found.as_ref().unwrap();
        assert!(
            found.is_measured() && m.launches.is_empty(),
            "{from}: {:?}",
            m.warnings
        );
    }
}
