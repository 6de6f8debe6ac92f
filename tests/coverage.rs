//! Do the intervals hold the truth as often as they say? Random recordings with small pictures, rendered, coded, measured.
//!
//! `TRACK_COVERAGE=400 cargo test --release --test coverage -- --nocapture` prints the table of the README; without the
//! variable fewer are made. The seeds are fixed, so the same number gives the same recordings.

#![allow(clippy::unwrap_used)] // a test that cannot go on should stop

mod noise;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use serde_json::{Value, json};
use track::calibration::Calibration;
use track::detect::centre::Accuracy;
use track::measure::{Outcome, measure};
use track::quantity::Quantity;
use track::simulate::{Recording, Scene, write};

/// Recordings where none are asked for.
const RECORDINGS: usize = 48;

/// The first seed: no scene of this file was looked at while the uncertainties were made.
const FIRST_SEED: u64 = 90_000;

/// The quantities that are compared.
const NAMES: [&str; 8] = [
    "e",
    "mu",
    "e_x",
    "incident angle",
    "rebound angle",
    "x0",
    "x",
    "time",
];

struct Dice(ChaCha8Rng);

impl Dice {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u32() as f64 / f64::from(u32::MAX))
    }

    /// From a normal distribution, cut at 2.5 standard deviations.
    fn about(&mut self, mean: f64, std: f64) -> f64 {
        let (u, v) = (self.between(f64::MIN_POSITIVE, 1.0), self.between(0.0, 1.0));
        mean + std * noise::box_muller(u, v).clamp(-2.5, 2.5)
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.0.next_u32() as usize % of.len()]
    }
}

/// A ball of R 6 to 16 px that bounces twice in a picture that just holds it.
fn scene(seed: u64) -> Value {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed));
    let e = dice.between(0.55, 0.95);
    let contact = if dice.one_of(&[true, true, false]) {
        json!({"model": "mu_e", "restitution": e, "friction": dice.between(0.04, 0.25)})
    } else {
        json!({"model": "e_e", "restitution": e, "tangential_restitution_x": dice.between(-0.3, 0.6)})
    };
    let radius_px = dice.between(6.0, 16.0);
    let radius_m = dice.between(0.008, 0.02);
    let m_per_px = radius_m / radius_px;
    let (drop_m, speed_m_s) = (dice.between(0.08, 0.3), dice.between(0.3, 1.2));
    let fall_s = (2.0 * drop_m / 9.81).sqrt();
    let even = |px: f64| (px / 2.0).floor() * 2.0;
    let width =
        even(((speed_m_s * fall_s * (1.0 + 2.2 * e) + 6.0 * radius_m) / m_per_px).min(640.0)).max(160.0);
    let height = even((drop_m + 5.0 * radius_m) / m_per_px).max(120.0);
    let density_kg_m3 = dice.one_of(&[7800.0, 1200.0, 1100.0]);
    let mut scene = json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": radius_m, "mass_kg": density_kg_m3 * 4.19 * radius_m.powi(3), "inertia_factor": 0.4},
        "contact": contact,
        "launch": {"drop_height_m": drop_m, "speed_m_s": speed_m_s,
                   "spin_ratio": [0, dice.one_of(&[0.0, 1.0]) * dice.between(-0.3, 0.6), 0]},
        "camera": {"image_size_px": [width, height], "frame_rate_hz": dice.one_of(&[120, 240, 480]),
                   "exposure_s": dice.one_of(&[0.0002, 0.0005, 0.001]), "metres_per_pixel": m_per_px,
                   "origin_px": [3.0 * radius_px, height - 2.0 * radius_px], "blur_px": dice.between(0.5, 1.0),
                   "noise_grey": dice.one_of(&[0.7, 2.0, 4.0]), "codec": dice.one_of(&["h264", "lossless"])},
        "look": {"background_grey": 60, "ball_grey": dice.one_of(&[160, 200, 230]), "shading": dice.between(0.1, 0.6),
                 "highlight_grey": dice.one_of(&[0, 20]), "texture_grey": dice.one_of(&[0, 3])},
        // Real air is there however little it does.
        "effects": {"drag": "on", "magnus": "on", "buoyancy": "on", "contact_time": "on"},
        "stop": {"bounces": 2, "tail_s": 0.06}
    });
    // What is known of no ball exactly: hard floors, surfaces, air. Drawn as wide as the uncertainties say that it is known,
    // about what they take for usual; a contact's time goes as E^(-2/5).
    let ball = scene["ball"].as_object_mut().unwrap();
    let modulus_pa = dice.about(7e10_f64.ln(), 0.4).exp();
    for (name, value) in [
        ("contact_modulus_pa", modulus_pa),
        ("drag_factor", dice.about(1.0, 0.1)),
        ("lift_factor", dice.about(1.0, 0.22)),
    ] {
        ball.insert(name.to_owned(), json!(value));
    }
    scene
}

/// Error and stated standard uncertainty of each of [`NAMES`]; `None` where it was not given.
type Errors = [Option<(f64, f64)>; NAMES.len()];

/// What became of a recording.
enum Tried {
    /// Measured.
    Measured(Errors),
    /// Not measured, and why.
    Refused(String),
}

fn try_one(seed: u64) -> Tried {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::new(&Scene::from_json(&scene(seed).to_string()).unwrap()).unwrap();
    let written = write(&recording, "clip", dir.path(), |_| {}).unwrap();
    let calibration = Calibration::read(&written.calib).unwrap();
    let m = measure(
        &written.video,
        &calibration,
        "truth",
        Accuracy::Standard,
        &mut |_| {},
    )
    .unwrap();
    if let Outcome::Rejected { reason, .. } = &m.outcome {
        return Tried::Refused(reason.to_string());
    }
    let truth = recording.truth();
    let (Some(b), Some(t)) = (m.bounces.first(), truth.bounces.first()) else {
        return Tried::Refused("no bounce".to_owned());
    };
    let of = |q: Option<Quantity>, true_: Option<f64>| -> Option<(f64, f64)> {
        let q = q?;
        Some((q.value - true_?, q.std_uncertainty?))
    };
    let degrees = |q: Option<Quantity>| q.map(|q| q.scaled(180.0 / std::f64::consts::PI));
    Tried::Measured([
        of(b.restitution, t.restitution),
        of(b.friction, t.friction),
        of(b.tangential_restitution, t.tangential_restitution),
        of(degrees(b.incident.angle_rad), Some(t.incident.angle_deg)),
        of(degrees(b.rebound.angle_rad), Some(t.rebound.angle_deg)),
        of(m.distances.x0_m, truth.x0_m),
        of(m.distances.x_m, truth.x_m),
        of(b.time_s, Some(t.time_s)),
    ])
}

/// What the errors of one quantity show.
struct Summary {
    count: f64,
    in_68: f64,
    in_95: f64,
    mean_pull: f64,
    pull_width: f64,
    most: f64,
}

fn summary(errors: &[(f64, f64)]) -> Summary {
    let count = errors.len() as f64;
    let pulls: Vec<f64> = errors.iter().map(|(e, s)| e / s).collect();
    let within = |k: f64| pulls.iter().filter(|p| p.abs() <= k).count() as f64 / count;
    let mean_pull = pulls.iter().sum::<f64>() / count;
    Summary {
        count,
        in_68: within(1.0),
        in_95: within(1.96),
        mean_pull,
        pull_width: (pulls.iter().map(|p| (p - mean_pull).powi(2)).sum::<f64>() / count).sqrt(),
        most: errors.iter().map(|(e, _)| e.abs()).fold(0.0, f64::max),
    }
}

#[test]
fn intervals_hold_the_truth_as_often_as_they_say() {
    let asked = std::env::var("TRACK_COVERAGE").ok().and_then(|n| n.parse().ok());
    let recordings: usize = asked.unwrap_or(RECORDINGS);
    let seeds: Vec<u64> = (0..recordings as u64).map(|i| FIRST_SEED + i).collect();
    let tried: Vec<Tried> = seeds.par_iter().map(|&seed| try_one(seed)).collect();
    let mut measured: Vec<(u64, &Errors)> = Vec::new();
    for (seed, tried) in seeds.iter().zip(&tried) {
        match tried {
            Tried::Measured(errors) => measured.push((*seed, errors)),
            Tried::Refused(why) => println!("{seed}: {why}"),
        }
    }
    println!("{} of {recordings} measured\n", measured.len());
    println!("| quantity | recordings | in 68 % | in 95 % | mean pull | width of pulls | largest error |");
    println!("|---|---|---|---|---|---|---|");
    let mut faults = Vec::new();
    for (k, name) in NAMES.iter().enumerate() {
        let errors: Vec<(f64, f64)> = measured.iter().filter_map(|(_, e)| e[k]).collect();
        let s = summary(&errors);
        println!(
            "| {name} | {} | {:.1} % | {:.1} % | {:+.2} | {:.2} | {:.2e} |",
            s.count,
            100.0 * s.in_68,
            100.0 * s.in_95,
            s.mean_pull,
            s.pull_width,
            s.most
        );
        for (seed, e) in &measured {
            if let Some((error, std)) = e[k].filter(|(error, std)| error.abs() > 3.0 * std) {
                println!(
                    "  {name} of {seed}: off by {error:.2e}, {:.1} standard uncertainties",
                    error / std
                );
            }
        }
        // Three standard deviations of a binomial count, on the side where intervals are too narrow.
        for (stated, held) in [(0.68, s.in_68), (0.95, s.in_95)] {
            let least = stated - 3.0 * (stated * (1.0 - stated) / s.count).sqrt();
            if held < least {
                faults.push(format!(
                    "{name}: {held:.3} in {stated}, at least {least:.3} wanted"
                ));
            }
        }
        if s.count < 0.9 * recordings as f64 {
            faults.push(format!("{name}: of {} recordings only", s.count));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
