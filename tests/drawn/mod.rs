//! Random recordings of the lab as it is, for the tests of coverage: how they are drawn, measured against the truth and summed up.
//!
//! `tests/coverage.rs` has them as they are, `tests/wild.rs` with what recordings outside of a laboratory have besides.

use crate::noise;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::{Value, json};
use track::pipeline::Measurement;
use track::quantity::Quantity;
use track::simulate::truth::BounceTruth;
use track::simulate::{SimulatedRecording, calibration};

/// The quantities that are compared, and the least share of recordings that tells them: a ball that rolls as it lands has no
/// slip and so no e_x, and not every second impact is in the picture.
pub const QUANTITIES: [(&str, f64); 10] = [
    ("e", 0.9),
    ("mu", 0.85),
    ("e_x", 0.5),
    ("incident angle", 0.9),
    ("rebound angle", 0.9),
    ("x0", 0.9),
    ("x", 0.9),
    ("X", 0.6),
    ("spin out", 0.85),
    ("time", 0.9),
];

/// Warnings that name what makes numbers wrong.
pub const CAUSES: [&str; 10] = [
    "camera_shaken",
    "up_tilted",
    "gravity_mismatch",
    "floor_contradicts",
    "floor_slopes",
    "impossible_tangential",
    "not_a_parabola",
    "light_changed",
    "ball_lingers",
    "edge_mismatch",
];

/// A number further out than this, in standard uncertainties, is wrong.
pub const FAR_OUT: f64 = 4.0;

pub struct Dice(pub ChaCha8Rng);

impl Dice {
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u32() as f64 / f64::from(u32::MAX))
    }

    /// From a normal distribution, cut at 2.5 standard deviations.
    pub fn about(&mut self, mean: f64, std: f64) -> f64 {
        let (u, v) = (self.between(f64::MIN_POSITIVE, 1.0), self.between(0.0, 1.0));
        mean + std * noise::box_muller(u, v).clamp(-2.5, 2.5)
    }

    /// With a probability of `chance`.
    pub fn is(&mut self, chance: f64) -> bool {
        self.between(0.0, 1.0) < chance
    }

    pub fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.0.next_u32() as usize % of.len()]
    }
}

/// A recording to be made.
pub struct Drawn {
    pub scene: Value,
    /// Whether the calibration says that "up" is straight up in the picture, which the camera's roll makes it not.
    pub up_given: bool,
}

/// A ball of R 6 to 16 px that bounces twice in a picture that just holds it.
pub fn drawn(seed: u64) -> Drawn {
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
    // A slower one would tip round the edge.
    let leaves_bench = speed_m_s * speed_m_s > 1.05 * 9.81 * radius_m;
    let bench_s = (dice.is(0.5) && leaves_bench).then(|| dice.between(0.001, 0.15));
    let bench_m = speed_m_s * bench_s.unwrap_or(0.0);
    let fall_s = (2.0 * drop_m / 9.81).sqrt();
    let even = |px: f64| (px / 2.0).floor() * 2.0;
    let way_m = bench_m + speed_m_s * fall_s * (1.0 + 2.2 * e) + 6.0 * radius_m;
    let width = even((way_m / m_per_px).min(720.0)).max(160.0);
    let height = even((drop_m + 5.5 * radius_m) / m_per_px).max(120.0);
    let density_kg_m3 = dice.one_of(&[7800.0, 1200.0, 1100.0]);
    let spin = dice.one_of(&[0.0, 1.0]) * dice.between(-0.3, 0.6);
    let mut launch = json!({"drop_height_m": drop_m, "speed_m_s": speed_m_s, "spin_ratio": [0, spin, 0]});
    if let Some(seen_s) = bench_s {
        let track_m = dice.is(0.5).then(|| dice.between(0.3, 1.6) * radius_m);
        let grey = dice.is(0.5).then(|| dice.one_of(&[30, 90, 120]));
        launch["bench"] = json!({"seen_s": seen_s, "track_width_m": track_m, "bench_grey": grey});
        if dice.is(0.7) {
            // Then it rolls.
            launch.as_object_mut().unwrap().remove("spin_ratio");
        }
    }
    let bump = dice.is(0.2).then(|| {
        let (size_px, way) = (dice.between(1.0, 3.0), dice.between(0.0, std::f64::consts::TAU));
        json!({"amplitude_px": [size_px * way.cos(), size_px * way.sin()],
               "frequency_hz": dice.between(15.0, 25.0), "decay_s": dice.between(0.01, 0.02)})
    });
    let roll_deg = dice.about(0.0, 0.3);
    let up_given = dice.is(0.5);
    let mut scene = json!({
        "schema": "track.scene/1", "seed": seed,
        "ball": {"radius_m": radius_m, "mass_kg": density_kg_m3 * 4.19 * radius_m.powi(3), "inertia_factor": 0.4},
        "contact": contact,
        "floor": {"slope_deg": dice.about(0.0, 0.1)},
        "launch": launch,
        "camera": {"image_size_px": [width, height], "frame_rate_hz": dice.one_of(&[120, 240, 480]),
                   "exposure_s": dice.one_of(&[0.0002, 0.0005, 0.001]), "metres_per_pixel": m_per_px,
                   "origin_px": [3.0 * radius_px + bench_m / m_per_px, height - 2.3 * radius_px],
                   "roll_deg": roll_deg, "bump": bump, "blur_px": dice.between(0.5, 1.0),
                   "noise_grey": dice.one_of(&[0.7, 2.0, 4.0]), "codec": dice.one_of(&["h264", "lossless"])},
        "look": {"background_grey": 60, "floor_grey": dice.one_of(&[60, 85]),
                 "ball_grey": dice.one_of(&[160, 200, 230]), "shading": dice.between(0.1, 0.9),
                 "highlight_grey": dice.one_of(&[0, 20]), "texture_grey": dice.one_of(&[0, 3])},
        // Real air, slopes and bumps are there however little they do.
        "effects": {"drag": "on", "magnus": "on", "buoyancy": "on", "contact_time": "on", "floor_slope": "on",
                    "camera_roll": "on", "bench": "on", "bump": "on"},
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
    Drawn { scene, up_given }
}

/// What a scene has that others have not, for who looks for the cause of a wrong number.
pub fn described(recording: &Drawn) -> String {
    let Drawn { scene, up_given } = recording;
    let (camera, look, launch) = (&scene["camera"], &scene["look"], &scene["launch"]);
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    let radius_px = number(&scene["ball"]["radius_m"]) / number(&camera["metres_per_pixel"]);
    let mut words = vec![
        format!("drop {:.3} m", number(&launch["drop_height_m"])),
        format!("{:.2} m/s", number(&launch["speed_m_s"])),
        format!(
            "{} e {:.2}",
            scene["contact"]["model"].as_str().unwrap_or_default(),
            number(&scene["contact"]["restitution"])
        ),
        format!("R {radius_px:.1} px"),
        format!("{} Hz", camera["frame_rate_hz"]),
        format!("{}", camera["codec"].as_str().unwrap_or_default()),
        format!("noise {}", camera["noise_grey"]),
        format!(
            "contrast {:.0}",
            number(&look["ball_grey"]) - number(&look["background_grey"])
        ),
        format!("shading {:.2}", number(&look["shading"])),
        format!("slope {:.2}", number(&scene["floor"]["slope_deg"])),
        format!(
            "roll {:.2}{}",
            number(&camera["roll_deg"]),
            if *up_given { " denied" } else { "" }
        ),
    ];
    if launch["bench"].is_object() {
        words.push(format!("bench {:.3} s", number(&launch["bench"]["seen_s"])));
    }
    if camera["bump"].is_object() {
        words.push(format!("bump {}", camera["bump"]["amplitude_px"]));
    }
    words.join(", ")
}

/// The calibration as an experimenter would have it: the simulator knows how the camera is rolled, he does not.
pub fn known(recording: &SimulatedRecording, up_given: bool) -> Value {
    let mut file = calibration(recording);
    let keys = file.as_object_mut().unwrap();
    keys.remove("up_px");
    if up_given {
        keys.insert("up_px".to_owned(), json!([0, -1]));
    }
    file
}

/// Error and stated standard uncertainty of each of [`QUANTITIES`]; `None` where it was not given.
pub type Errors = [Option<(f64, f64)>; QUANTITIES.len()];

/// What the first bounce of a measurement is compared with.
pub struct TruthOfFirst<'a> {
    pub bounce: &'a BounceTruth,
    /// The one after it.
    pub next: Option<&'a BounceTruth>,
    pub x0_m: Option<f64>,
    pub x_m: Option<f64>,
}

/// What was made of a recording.
pub struct Tried {
    pub errors: Errors,
    /// Codes of its warnings.
    pub warnings: Vec<&'static str>,
    /// Whether its first bounce is not the first that was.
    pub is_another: bool,
}

/// The errors of the first bounce of `m`; `None` where it has none.
pub fn compared(m: &Measurement, truth: &TruthOfFirst<'_>) -> Option<Errors> {
    let (b, t) = (m.bounces.first()?, truth.bounce);
    let of = |q: Option<Quantity>, true_: Option<f64>| -> Option<(f64, f64)> {
        let q = q?;
        Some((q.value - true_?, q.std_uncertainty?))
    };
    let degrees = |q: Option<Quantity>| q.map(|q| q.scaled(180.0 / std::f64::consts::PI));
    let second = m.bounces.get(1);
    Some([
        of(b.restitution, t.restitution),
        of(b.friction.or(b.friction_at_least), t.friction),
        of(b.tangential_restitution, t.tangential_restitution),
        of(degrees(b.incident.angle_rad), Some(t.incident.angle_deg)),
        of(degrees(b.rebound.angle_rad), Some(t.rebound.angle_deg)),
        of(m.distances.x0_m, truth.x0_m),
        of(m.distances.x_m, truth.x_m),
        of(second.and_then(|b| b.x_m), truth.next.map(|t| t.x_m)),
        of(b.spin_out_m_s, Some(t.spin_out_m_s)),
        of(b.time_s, Some(t.time_s)),
    ])
}

/// What the errors of one quantity show.
pub struct Summary {
    pub count: f64,
    pub in_68: f64,
    pub in_95: f64,
    pub mean_pull: f64,
    pub pull_width: f64,
    pub most: f64,
}

pub fn summary(errors: &[(f64, f64)]) -> Summary {
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

/// The table of `recordings`.
pub fn print_table(what: &str, recordings: &[(u64, Tried)]) {
    println!("\n{what}: {} recordings\n", recordings.len());
    println!("| quantity | recordings | in 68 % | in 95 % | mean pull | width of pulls | largest error |");
    println!("|---|---|---|---|---|---|---|");
    for (k, (name, _)) in QUANTITIES.iter().enumerate() {
        let s = summary(&errors_of(k, recordings));
        println!(
            "| {name} | {} | {:.1} % | {:.1} % | {:+.2} | {:.2} | {:.2e} |",
            s.count,
            100.0 * s.in_68,
            100.0 * s.in_95,
            s.mean_pull,
            s.pull_width,
            s.most
        );
    }
}

pub fn errors_of(quantity: usize, recordings: &[(u64, Tried)]) -> Vec<(f64, f64)> {
    recordings
        .iter()
        .filter_map(|(_, t)| t.errors[quantity])
        .collect()
}

/// What of the intervals of `measured` holds the truth less often than it says, by more than chance.
pub fn faults_of(measured: &[(u64, Tried)]) -> Vec<String> {
    let mut faults = Vec::new();
    for (k, (name, _)) in QUANTITIES.iter().enumerate() {
        let s = summary(&errors_of(k, measured));
        // Three standard deviations of a binomial count, on the side where intervals are too narrow.
        for (stated, held) in [(0.68, s.in_68), (0.95, s.in_95)] {
            let least = stated - 3.0 * (stated * (1.0 - stated) / s.count).sqrt();
            if held < least {
                faults.push(format!(
                    "{name}: {held:.3} in {stated}, at least {least:.3} wanted"
                ));
            }
        }
    }
    faults
}
