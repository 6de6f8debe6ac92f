//! Hard recordings, of the lab as it is: a bench that the ball rolls along, a floor that is not level, a camera that is not, a
//! table that is bumped, scales and rates that are wrong, spin that nobody mentioned, a hand that lets go.
//! `docs/hard_cases.md` lists the cases.
//!
//! Every number of every row must hold the truth within [`HONEST_SIGMAS`] of its own uncertainty, with as many bounces as
//! there were, or the row's warning must say what is wrong. A test goes through all of its rows before it fails, so that what
//! it prints is the whole list.

use crate::hard::{self, Clip, HONEST_SIGMAS, Judged, scene, with};
use serde_json::{Value, json};
use track::rebound::Regime;

/// What the lift of a wrong spin may do to a speed.
const LIFT_PART: f64 = 0.005;

/// What is wrong with the rows of a test.
#[derive(Default)]
struct Faults(Vec<String>);

impl Faults {
    fn note(&mut self, fault: bool, what: &str, why: impl FnOnce() -> String) {
        if fault {
            self.0.push(format!("{what}: {}", why()));
        }
    }

    /// That it was measured, shows so many bounces, and no number lies but those whose names begin with one of `excused`.
    fn true_but_for(&mut self, found: &Judged, bounces: usize, excused: &[&str], what: &str) {
        self.note(!found.is_measured(), what, || format!("{:?}", found.reason()));
        let mut lies = found.lies(HONEST_SIGMAS);
        lies.retain(|lie| !excused.iter().any(|e| lie.starts_with(e)));
        let warned = || found.warnings();
        self.note(!lies.is_empty(), what, || {
            format!("{lies:#?}, warned of {:?}", warned())
        });
        let seen = found.bounces();
        self.note(seen != bounces, what, || {
            format!("{seen} bounces, not {bounces}, warned of {:?}", warned())
        });
        // Where it is shaken, and rightly said to be, nobody asks here.
        self.note(found.warns("camera_shaken"), what, || {
            let all = found.found.as_ref().map_or(&[][..], |m| &m.warnings);
            let told = all.iter().find(|w| w.code == "camera_shaken");
            format!("it stands still, and: {}", told.map_or("", |w| &w.message))
        });
    }

    /// The same of two bounces whose spin before is said wrong. Its lift was taken out of the path, where it had another: what
    /// that moves is as wrong as the spin, and right to [`LIFT_PART`].
    fn true_but_for_spin(&mut self, found: &Judged, excused: &[&str], what: &str) {
        let moved = [
            "gravity",
            "launch speed",
            "incident vx",
            "rebound vx",
            "incident angle",
            "rebound angle",
        ];
        self.true_but_for(found, 2, &[excused, &moved].concat(), what);
        for c in &found.compared {
            let lies = c.pull().is_some_and(|p| !(p.abs() <= HONEST_SIGMAS));
            let far = (c.value / c.truth - 1.0).abs() > LIFT_PART;
            let is_moved = moved.iter().any(|m| c.what.starts_with(m));
            self.note(is_moved && lies && far, what, || format!("{c:?}"));
        }
    }

    fn all_true(&mut self, found: &Judged, bounces: usize, what: &str) {
        self.true_but_for(found, bounces, &[], what);
    }

    fn warns(&mut self, found: &Judged, code: &str, what: &str) {
        self.note(!found.warns(code), what, || {
            format!("no {code} among {:?}", found.warnings())
        });
    }

    fn none(&self) {
        assert!(
            self.0.is_empty(),
            "{} faults:\n{}",
            self.0.len(),
            self.0.join("\n")
        );
    }
}

/// A ball of R 8 px before a plain wall, with room to its left for a bench.
fn lab(seed: u64, rate_hz: u32) -> Value {
    let scene = with(
        scene(seed),
        "camera",
        json!({"image_size_px": [400, 260], "frame_rate_hz": rate_hz, "origin_px": [110, 232]}),
    );
    with(scene, "stop", json!({"bounces": 2, "tail_s": 0.08}))
}

/// The same with a light ball that grips.
fn superball(scene: Value) -> Value {
    let mut scene = with(scene, "ball", json!({"mass_kg": 0.008}));
    scene["contact"] = json!({"model": "e_e", "restitution": 0.85, "tangential_restitution_x": 0.5});
    scene
}

fn of(ball: &str, seed: u64, rate_hz: u32) -> Value {
    match ball {
        "steel" => lab(seed, rate_hz),
        "superball" => superball(lab(seed, rate_hz)),
        other => panic!("no ball {other}"),
    }
}

/// The same with the ball seen on its bench for `seen_s`; `drawn` is the bench's grey, `track_m` the width of its track.
fn on_bench(scene: Value, seen_s: f64, drawn: Option<u8>, track_m: Option<f64>) -> Value {
    let bench = json!({"seen_s": seen_s, "bench_grey": drawn, "track_width_m": track_m});
    let mut scene = with(scene, "launch", json!({"bench": bench}));
    // The bench's own: it rolls.
    scene["launch"].as_object_mut().unwrap().remove("spin_ratio");
    scene
}

fn sloping(scene: Value, slope_deg: f64) -> Value {
    with(scene, "floor", json!({"slope_deg": slope_deg}))
}

fn turned(clip: Clip, to_the_left: bool) -> Clip {
    if to_the_left { clip.mirrored() } else { clip }
}

/// A ball on a bench: rate, codec, ball, frames seen on the bench, its grey, its track, whether it goes to the left.
type BenchRow = (
    u32,
    &'static str,
    &'static str,
    u32,
    Option<u8>,
    Option<f64>,
    bool,
);

const BENCHES: [BenchRow; 14] = [
    (120, "lossless", "steel", 5, None, None, false),
    (120, "h264", "steel", 18, Some(110), Some(0.01), false),
    (120, "lossless", "superball", 18, None, Some(0.012), true),
    (120, "h264", "superball", 5, Some(30), None, false),
    (240, "lossless", "steel", 5, None, Some(0.01), false),
    (240, "h264", "steel", 36, Some(110), None, false),
    (240, "lossless", "superball", 36, Some(110), Some(0.012), true),
    (240, "h264", "superball", 5, None, Some(0.012), false),
    (240, "lossless", "steel", 36, None, None, true),
    (240, "h264", "steel", 5, Some(30), Some(0.01), true),
    (480, "lossless", "superball", 5, Some(110), None, false),
    (480, "h264", "steel", 5, None, Some(0.01), false),
    (480, "lossless", "steel", 72, Some(110), None, false),
    (480, "h264", "superball", 72, None, Some(0.012), false),
];

fn bench_clip(seed: u64, row: BenchRow) -> Clip {
    let (rate_hz, _, ball, frames, drawn, track_m, to_the_left) = row;
    // Half a frame less, so that as many are on it.
    let seen_s = (f64::from(frames) - 0.5) / f64::from(rate_hz);
    let scene = on_bench(of(ball, seed, rate_hz), seen_s, drawn, track_m);
    turned(Clip::of(&scene), to_the_left)
}

#[test]
fn a_ball_seen_on_its_bench_is_measured_and_nothing_is_invented_there() {
    let mut faults = Faults::default();
    for (seed, row) in (7000..).zip(BENCHES) {
        let clip = bench_clip(seed, row);
        let found = clip.stored(row.1);
        let what = format!("{row:?}");
        faults.all_true(&found, 2, &what);
        faults.note(found.number("x0").is_none(), &what, || "no x0".to_owned());
        faults.note(found.number("launch edge").is_none(), &what, || {
            format!("no edge, warned of {:?}", found.warnings())
        });
    }
    faults.none();
}

#[test]
fn a_bench_seen_for_a_moment_at_a_slant_is_no_hop() {
    let mut faults = Faults::default();
    for (seed, ball, rate_hz, pitch_deg, seen_s) in [
        (7050, "steel", 480, 8.5, 0.03),
        (7050, "superball", 480, 8.5, 0.03),
        (7057, "steel", 480, 5.0, 0.03),
        (7053, "steel", 240, -7.5, 0.06),
    ] {
        let scene = on_bench(of(ball, seed, rate_hz), seen_s, Some(30), None);
        let camera = json!({"pitch_deg": pitch_deg, "distance_m": 1.3, "noise_grey": 4.0});
        let found = Clip::of(&with(scene, "camera", camera)).stored("h264");
        let what = format!("{ball}, {rate_hz} Hz, {pitch_deg} degrees");
        let seen = found.bounces();
        faults.note(seen != 2, &what, || format!("{seen} bounces"));
        faults.note(found.number("launch edge").is_none(), &what, || {
            "no edge".to_owned()
        });
        for number in ["e 1", "e 2", "x0"] {
            let pull = found.number(number).and_then(hard::Compared::pull);
            faults.note(pull.is_none_or(|p| p.abs() > HONEST_SIGMAS), &what, || {
                format!("{number}: {pull:?}")
            });
        }
    }
    faults.none();
}

#[test]
fn without_an_origin_x_counts_from_where_the_bench_ends() {
    let mut faults = Faults::default();
    // Half of them, by twos, as codecs take turns: the others would tell no more.
    for (seed, row) in (7052..).zip(BENCHES).filter(|(seed, _)| seed % 4 < 2) {
        let found = bench_clip(seed, row).untold("origin_px").stored(row.1);
        let what = format!("{row:?}");
        faults.all_true(&found, 2, &what);
        for name in ["x0", "place 1", "launch edge"] {
            faults.note(found.number(name).is_none(), &what, || {
                format!("no {name}, warned of {:?}", found.warnings())
            });
        }
    }
    faults.none();
}

#[test]
fn rolling_is_a_spin_that_the_calibration_may_name() {
    let mut faults = Faults::default();
    for (seed, (ball, track_m, codec)) in (7100..).zip([
        ("steel", None, "lossless"),
        ("steel", Some(0.01), "h264"),
        ("superball", Some(0.012), "lossless"),
        ("superball", Some(0.018), "h264"),
    ]) {
        let scene = on_bench(of(ball, seed, 240), 0.1, Some(110), track_m);
        let rolling = match track_m {
            Some(width_m) => json!({"spin_ratio": "rolling", "track_width_m": width_m}),
            None => json!({"spin_ratio": "rolling"}),
        };
        let clip = Clip::of(&scene).calibrated(|c| c["launch"] = rolling.clone());
        let found = clip.stored(codec);
        let what = format!("{ball} on {track_m:?}, {codec}");
        faults.all_true(&found, 2, &what);
        faults.note(found.warns("rolling_unsaid"), &what, || "it was said".to_owned());
    }
    faults.none();
}

#[test]
fn a_ball_that_slides_along_its_bench_is_as_true() {
    let mut faults = Faults::default();
    for (seed, ball) in (7120..).zip(["steel", "superball"]) {
        let mut scene = on_bench(of(ball, seed, 240), 0.1, Some(110), None);
        scene["launch"]["spin_ratio"] = json!([0, 0, 0]);
        faults.all_true(&Clip::of(&scene).measured(), 2, ball);
    }
    faults.none();
}

#[test]
fn spin_0_of_a_ball_that_was_seen_to_roll_is_questioned() {
    let mut faults = Faults::default();
    for (seed, (ball, codec, frames)) in (7140..).zip([
        ("steel", "lossless", 5),
        ("steel", "h264", 36),
        ("superball", "lossless", 36),
    ]) {
        let clip = bench_clip(seed, (240, codec, ball, frames, Some(110), None, false))
            .calibrated(|c| c["launch"]["spin_ratio"] = json!(0));
        let found = clip.stored(codec);
        let what = format!("{ball}, {codec}, {frames} frames");
        faults.warns(&found, "rolling_unsaid", &what);
        faults.true_but_for_spin(&found, &["e_x", "spin", "regime"], &what);
    }
    faults.none();
}

#[test]
fn an_origin_beside_the_edge_that_is_seen_is_questioned() {
    let mut faults = Faults::default();
    for (seed, (codec, aside_px, to_the_left)) in (7160..).zip([
        ("lossless", 5.0, false),
        ("h264", -5.0, false),
        ("h264", 5.0, true),
    ]) {
        let row = (240, codec, "steel", 24, Some(110), None, to_the_left);
        let clip = bench_clip(seed, row).calibrated(|c| {
            let u_px = c["origin_px"][0].as_f64().unwrap();
            c["origin_px"][0] = json!(u_px + aside_px);
        });
        let found = clip.stored(codec);
        let what = format!("{aside_px} px aside, {codec}, to the left: {to_the_left}");
        faults.warns(&found, "edge_mismatch", &what);
        faults.true_but_for(&found, 2, &["place", "x0", "launch edge"], &what);
        // It gives both.
        let message = found.message("edge_mismatch").unwrap_or_default();
        faults.note(message.matches("±").count() < 2, &what, || message.to_owned());
    }
    faults.none();
}

#[test]
fn a_bench_that_is_not_level_in_the_picture_is_no_floor() {
    let mut faults = Faults::default();
    // A fifth of a degree, and the ball nears or leaves the picture's horizontal while it rolls: that is no fall and no bounce.
    for (seed, (roll_deg, rate_hz, seen_s, codec, ball)) in (7180..).zip([
        (0.2, 120, 0.04, "lossless", "steel"),
        (0.2, 240, 0.03, "h264", "superball"),
        (-0.2, 240, 0.05, "lossless", "steel"),
        (-0.35, 120, 0.055, "h264", "steel"),
        (0.5, 480, 0.027, "h264", "superball"),
        (0.3, 240, 0.12, "lossless", "steel"),
    ]) {
        let scene = rolled(of(ball, seed, rate_hz), roll_deg);
        let scene = on_bench(scene, seen_s, None, Some(0.01));
        let found = Clip::of(&scene).untold("up_px").stored(codec);
        faults.all_true(
            &found,
            2,
            &format!("{roll_deg} degrees, {rate_hz} Hz, {seen_s} s, {codec}, {ball}"),
        );
    }
    faults.none();
}

const SLOPES: [(f64, u32, &str, &str, bool); 8] = [
    (0.1, 240, "lossless", "steel", false),
    (0.1, 120, "h264", "superball", false),
    (0.3, 480, "lossless", "steel", false),
    (0.3, 240, "h264", "superball", true),
    (1.0, 240, "lossless", "superball", false),
    (1.0, 120, "h264", "steel", true),
    (-0.5, 240, "lossless", "steel", true),
    (-0.5, 480, "h264", "superball", false),
];

#[test]
fn impacts_on_a_floor_that_is_not_level_are_along_it() {
    let mut faults = Faults::default();
    for (seed, row) in (7200..).zip(SLOPES) {
        let (slope_deg, rate_hz, codec, ball, to_the_left) = row;
        let scene = sloping(of(ball, seed, rate_hz), slope_deg);
        let found = turned(Clip::of(&scene), to_the_left).stored(codec);
        let what = format!("{row:?}");
        faults.all_true(&found, 2, &what);
        faults.note(found.number("floor slope").is_none(), &what, || {
            "no slope".to_owned()
        });
    }
    faults.none();
}

#[test]
fn a_slope_in_the_calibration_that_the_impacts_contradict_is_questioned_and_not_used() {
    let mut faults = Faults::default();
    for (seed, (slope_deg, said_deg, codec)) in (7220..).zip([
        (0.0, 1.0, "lossless"),
        (-0.5, 0.5, "h264"),
        (1.0, 0.0, "lossless"),
    ]) {
        let clip = Clip::of(&sloping(lab(seed, 240), slope_deg))
            .calibrated(|c| c["floor"] = json!({"slope_deg": said_deg}));
        let found = clip.stored(codec);
        let what = format!("{slope_deg} degrees, said to be {said_deg}, {codec}");
        faults.warns(&found, "floor_contradicts", &what);
        faults.all_true(&found, 2, &what);
    }
    faults.none();
}

#[test]
fn of_one_bounce_a_line_along_the_floor_tells_the_slope() {
    let mut faults = Faults::default();
    // Read by eye, to a pixel, it says no more than that benches are level; to a tenth it says the slope.
    for (seed, (slope_deg, std_px, codec, ball)) in (7240..).zip([
        (0.1, None, "lossless", "steel"),
        (0.3, Some(0.1), "h264", "superball"),
        (1.0, Some(0.1), "lossless", "steel"),
        (-0.5, Some(0.1), "lossless", "superball"),
    ]) {
        let scene = with(
            sloping(of(ball, seed, 240), slope_deg),
            "stop",
            json!({"bounces": 1, "tail_s": 0.25}),
        );
        let (from, along_px) = ([110.0, 232.0], 270.0);
        let to = [
            from[0] + along_px,
            from[1] - along_px * f64::tan(slope_deg.to_radians()),
        ];
        let clip = Clip::of(&scene).calibrated(|c| {
            c["floor"] = json!({"line_px": [from, to]});
            if let Some(std_px) = std_px {
                c["floor"]["line_std_px"] = json!(std_px);
            }
        });
        let found = clip.stored(codec);
        faults.all_true(
            &found,
            1,
            &format!("{slope_deg} degrees, line to {std_px:?} px, {codec}, {ball}"),
        );
    }
    faults.none();
}

fn rolled(scene: Value, roll_deg: f64) -> Value {
    with(scene, "camera", json!({"roll_deg": roll_deg}))
}

/// "Up" in the picture, this far to the right of straight up.
fn up_px(right_deg: f64) -> Value {
    let right = right_deg.to_radians();
    json!([right.sin(), -right.cos()])
}

/// That "up" was found where it is, `tilt_deg` to the right of where the calibration has it.
fn tilts(faults: &mut Faults, found: &Judged, tilt_deg: f64, what: &str) {
    let up = found.found.as_ref().ok().and_then(|m| m.up);
    let pull = up.and_then(|up| {
        let off = up.tilt_rad.value - tilt_deg.to_radians();
        Some(off / up.tilt_rad.std_uncertainty?)
    });
    let fine = pull.is_some_and(|p| p.abs() < HONEST_SIGMAS);
    faults.note(!fine, what, || {
        format!("up {up:?}, not {tilt_deg} degrees: {pull:?} σ")
    });
}

#[test]
fn where_up_is_not_given_the_fall_tells_it() {
    let mut faults = Faults::default();
    for (seed, (roll_deg, rate_hz, codec, ball, to_the_left)) in (7300..).zip([
        (0.2, 240, "lossless", "steel", false),
        (0.2, 480, "h264", "superball", false),
        (1.0, 120, "lossless", "superball", false),
        (-1.0, 240, "h264", "steel", true),
        (4.0, 240, "lossless", "steel", false),
        (4.0, 480, "h264", "superball", true),
    ]) {
        let scene = rolled(of(ball, seed, rate_hz), roll_deg);
        let found = turned(Clip::of(&scene).untold("up_px"), to_the_left).stored(codec);
        let what = format!("{roll_deg} degrees, {rate_hz} Hz, {codec}, {ball}, to the left: {to_the_left}");
        faults.all_true(&found, 2, &what);
        let seen_deg = if to_the_left { -roll_deg } else { roll_deg };
        tilts(&mut faults, &found, seen_deg, &what);
    }
    faults.none();
}

#[test]
fn an_up_that_is_wrong_by_as_much_as_cameras_are_does_no_harm() {
    let mut faults = Faults::default();
    for (seed, (roll_deg, said_deg, codec, ball)) in (7320..).zip([
        (0.2, 0.0, "lossless", "steel"),
        (0.0, 0.2, "h264", "steel"),
        (-0.2, 0.0, "h264", "superball"),
        (1.0, 0.8, "lossless", "superball"),
    ]) {
        let clip =
            Clip::of(&rolled(of(ball, seed, 240), roll_deg)).calibrated(|c| c["up_px"] = up_px(said_deg));
        let found = clip.stored(codec);
        let what = format!("{roll_deg} degrees, said to be {said_deg}, {codec}, {ball}");
        faults.all_true(&found, 2, &what);
        tilts(&mut faults, &found, roll_deg - said_deg, &what);
        faults.note(found.warns("up_tilted"), &what, || "up_tilted".to_owned());
    }
    faults.none();
}

#[test]
fn an_up_that_the_fall_contradicts_is_said_and_not_used() {
    let mut faults = Faults::default();
    for (seed, (roll_deg, said_deg, codec, ball)) in (7340..).zip([
        (2.0, 0.0, "lossless", "steel"),
        (0.0, 2.0, "h264", "superball"),
        (-2.0, 0.0, "h264", "steel"),
    ]) {
        let clip =
            Clip::of(&rolled(of(ball, seed, 240), roll_deg)).calibrated(|c| c["up_px"] = up_px(said_deg));
        let found = clip.stored(codec);
        let what = format!("{roll_deg} degrees, said to be {said_deg}, {codec}, {ball}");
        faults.warns(&found, "up_tilted", &what);
        faults.all_true(&found, 2, &what);
        tilts(&mut faults, &found, roll_deg - said_deg, &what);
    }
    faults.none();
}

/// A table that swings: amplitude (right, down), frequency, decay; frame rate, codec, ball.
type BumpRow = ([f64; 2], f64, f64, u32, &'static str, &'static str);

const BUMPS: [BumpRow; 8] = [
    ([0.0, 1.0], 20.0, 0.015, 240, "lossless", "steel"),
    ([0.0, 2.0], 15.0, 0.02, 240, "h264", "steel"),
    ([0.0, 3.0], 25.0, 0.01, 240, "lossless", "superball"),
    ([2.0, 0.0], 20.0, 0.015, 240, "lossless", "steel"),
    ([0.8, -1.8], 25.0, 0.02, 480, "h264", "steel"),
    ([1.5, 1.5], 15.0, 0.01, 120, "lossless", "steel"),
    ([0.0, -3.0], 15.0, 0.02, 120, "h264", "superball"),
    ([0.5, 1.0], 25.0, 0.02, 480, "lossless", "superball"),
];

/// That all of a bumped recording is true, or that it says so. `dressed` puts something that stands still in the picture.
fn bumped(first_seed: u64, dressed: impl Fn(Value) -> Value) {
    let mut faults = Faults::default();
    for (seed, row) in (first_seed..).zip(BUMPS) {
        let (amplitude_px, frequency_hz, decay_s, rate_hz, codec, ball) = row;
        let bump = json!({"amplitude_px": amplitude_px, "frequency_hz": frequency_hz, "decay_s": decay_s});
        let scene = with(dressed(of(ball, seed, rate_hz)), "camera", json!({"bump": bump}));
        // Until the table stands still again after the second impact.
        let scene = with(scene, "stop", json!({"tail_s": 0.12}));
        let found = Clip::of(&scene).stored(codec);
        let what = format!("{row:?}");
        if found.warns("camera_shaken") {
            // Numbers may then be wrong; that something is measured which never was may not.
            faults.note(!found.broken.is_empty(), &what, || format!("{:?}", found.broken));
        } else {
            faults.all_true(&found, 2, &what);
        }
    }
    faults.none();
}

#[test]
fn a_table_that_swings_is_followed_by_its_floor_line_and_bench() {
    bumped(7400, |scene| {
        let scene = on_bench(scene, 0.1, Some(110), None);
        with(scene, "look", json!({"floor_grey": 90}))
    });
}

#[test]
fn a_table_that_swings_before_a_bare_wall_is_said_or_does_no_harm() {
    bumped(7450, |scene| scene);
}

#[test]
fn a_ball_is_a_ruler_as_good_as_its_edge_is_known() {
    let mut faults = Faults::default();
    let (blurs, radii_px): ([f64; 4], [f64; 3]) = ([0.4, 0.7, 1.0, 1.5], [6.0, 10.0, 16.0]);
    let rows = blurs.iter().flat_map(|b| radii_px.iter().map(move |r| (*b, *r)));
    for (seed, (blur_px, radius_px)) in (7500_u64..).zip(rows) {
        let radius_m = 0.0015 * radius_px;
        let ball = json!({"radius_m": radius_m, "mass_kg": 7800.0 * 4.19 * radius_m.powi(3)});
        let scene = with(lab(seed, 240), "ball", ball);
        let scene = with(
            scene,
            "camera",
            json!({"blur_px": blur_px, "origin_px": [60, 230]}),
        );
        let clip = Clip::of(&scene).calibrated(|c| c["scale"] = json!({"ball": true}));
        let codec = if seed % 2 == 0 { "lossless" } else { "h264" };
        let found = clip.stored(codec);
        let what = format!("blur {blur_px}, R {radius_px} px, {codec}");
        faults.all_true(&found, 2, &what);
        let speed = found.number("incident vz 1");
        faults.note(speed.is_none(), &what, || "no speed".to_owned());
    }
    faults.none();
}

/// Higher and longer, so that g is known to some tenths of a per cent.
fn falling_far(seed: u64, rate_hz: u32) -> Value {
    let scene = with(
        lab(seed, rate_hz),
        "camera",
        json!({"image_size_px": [400, 360], "origin_px": [60, 335]}),
    );
    with(scene, "launch", json!({"drop_height_m": 0.4, "speed_m_s": 0.5}))
}

#[test]
fn a_scale_or_rate_stated_as_exact_that_the_fall_refutes_is_said() {
    let mut faults = Faults::default();
    for (seed, (scale, rate, rate_hz, codec)) in (7600..).zip([
        (1.008, 1.0, 240, "lossless"),
        (0.992, 1.0, 240, "h264"),
        (1.0, 1.004, 240, "h264"),
        (1.0, 0.996, 240, "lossless"),
    ]) {
        let clip = Clip::of(&falling_far(seed, rate_hz)).calibrated(|c| {
            let true_m = c["scale"]["metres_per_pixel"].as_f64().unwrap();
            c["scale"]["metres_per_pixel"] = json!(scale * true_m);
            if rate != 1.0 {
                c["frame_rate_hz"] = json!(rate * f64::from(rate_hz));
            }
        });
        let found = clip.stored(codec);
        let what = format!("scale times {scale}, rate times {rate}, {rate_hz} Hz, {codec}");
        faults.warns(&found, "gravity_mismatch", &what);
        faults.warns(&found, "refuted_calibration", &what);
        let message = found.message("gravity_mismatch").unwrap_or_default();
        for named in ["scale", "frame_rate_hz"] {
            faults.note(!message.contains(named), &what, || {
                format!("{named} is not named: {message}")
            });
        }
        // e and angles are those of the picture, whatever a metre is.
        let of_picture: Vec<String> = found
            .lies(HONEST_SIGMAS)
            .into_iter()
            .filter(|lie| lie.starts_with("e ") || lie.contains("angle"))
            .collect();
        faults.note(!of_picture.is_empty(), &what, || format!("{of_picture:#?}"));
    }
    faults.none();
}

#[test]
fn a_right_scale_and_rate_are_not_refuted() {
    let mut faults = Faults::default();
    for (seed, (rate_hz, codec)) in (7620..).zip([(240, "lossless"), (240, "h264")]) {
        let found = Clip::of(&falling_far(seed, rate_hz)).stored(codec);
        let what = format!("{rate_hz} Hz, {codec}");
        faults.all_true(&found, 2, &what);
        for code in ["gravity_mismatch", "refuted_calibration"] {
            faults.note(found.warns(code), &what, || code.to_owned());
        }
    }
    faults.none();
}

#[test]
fn a_spin_that_the_calibration_denies_gives_no_impossible_number() {
    let mut faults = Faults::default();
    let rolls_off = json!({"model": "mu_e", "restitution": 0.78, "friction": 0.25});
    let grips = json!({"model": "e_e", "restitution": 0.85, "tangential_restitution_x": 0.5});
    // Backspin that takes more along the floor than the slip that is said; topspin that drives the ball on.
    for (seed, (spin, contact, codec, to_the_left)) in (7700..).zip([
        (-1.5, &rolls_off, "lossless", false),
        (-1.5, &grips, "h264", false),
        (2.0, &rolls_off, "h264", true),
        (2.0, &grips, "lossless", false),
    ]) {
        let mut scene = with(lab(seed, 240), "launch", json!({"spin_ratio": [0, spin, 0]}));
        scene["contact"] = contact.clone();
        let clip = Clip::of(&scene).calibrated(|c| c["launch"]["spin_ratio"] = json!(0));
        let found = turned(clip, to_the_left).stored(codec);
        let what = format!("spin {spin}, {contact}, {codec}");
        faults.warns(&found, "impossible_tangential", &what);
        faults.true_but_for_spin(&found, &[], &what);
        for name in [
            "e_x 1",
            "spin in 1",
            "spin out 1",
            "e_x 2",
            "spin in 2",
            "spin out 2",
            "mu 1",
        ] {
            let number = found.number(name);
            faults.note(number.is_some(), &what, || format!("{number:?}"));
        }
    }
    faults.none();
}

#[test]
fn a_bounce_that_does_not_slide_has_only_a_friction_that_is_enough() {
    let mut faults = Faults::default();
    for (seed, (rate_hz, friction, codec, to_the_left)) in (7800..).zip([
        (240, 0.25, "lossless", false),
        (240, 0.12, "h264", false),
        (480, 0.25, "h264", true),
        (120, 0.4, "lossless", false),
    ]) {
        let mut scene = lab(seed, rate_hz);
        scene["contact"] = json!({"model": "mu_e", "restitution": 0.78, "friction": friction});
        let clip = Clip::of(&scene);
        assert_eq!(clip.truth.bounces[0].regime, "nonsliding");
        let found = turned(clip, to_the_left).stored(codec);
        let what = format!("friction {friction}, {rate_hz} Hz, {codec}");
        faults.all_true(&found, 2, &what);
        let first = found.found.as_ref().ok().and_then(|m| m.bounces.first());
        let fine = first.is_some_and(|b| {
            b.slip == Some(Regime::Nonsliding) && b.friction.is_none() && b.friction_at_least.is_some()
        });
        faults.note(!fine, &what, || {
            format!("{:?}", first.map(|b| (b.slip, b.friction, b.friction_at_least)))
        });
    }
    faults.none();
}

#[test]
fn a_ball_that_is_held_and_let_go_was_not_launched() {
    let mut faults = Faults::default();
    for (seed, (frames, ball, codec, has_origin)) in (7900..).zip([
        (5, "steel", "lossless", true),
        (30, "steel", "h264", true),
        (30, "superball", "lossless", false),
        (50, "steel", "lossless", false),
    ]) {
        let scene = with(
            of(ball, seed, 240),
            "launch",
            json!({"speed_m_s": 0.0, "drop_height_m": 0.2}),
        );
        let mut clip = Clip::of(&scene).held(&scene, frames);
        if !has_origin {
            clip = clip.untold("origin_px");
        }
        let found = clip.stored(codec);
        let what = format!("{ball} held for {frames} frames, {codec}, origin given: {has_origin}");
        // A launch would be among the broken, a false x0 among the lies.
        faults.all_true(&found, 2, &what);
    }
    faults.none();
}

#[test]
fn a_ball_that_rolls_on_along_the_floor_does_not_bounce_there() {
    let mut faults = Faults::default();
    for (seed, (restitution, rate_hz, codec, on_a_bench)) in (7950..).zip([
        (0.35, 240, "lossless", false),
        (0.5, 240, "h264", false),
        (0.35, 480, "h264", true),
        (0.3, 120, "lossless", false),
    ]) {
        let mut scene = with(
            lab(seed, rate_hz),
            "launch",
            json!({"drop_height_m": 0.15, "speed_m_s": 0.5}),
        );
        scene["contact"] = json!({"model": "mu_e", "restitution": restitution, "friction": 0.2});
        scene["stop"] = json!({"bounces": 60, "tail_s": 0.35});
        if on_a_bench {
            scene = on_bench(scene, 0.1, None, None);
        }
        let clip = Clip::of(&scene);
        let found = clip.stored(codec);
        let what = format!("e {restitution}, {rate_hz} Hz, {codec}, on a bench: {on_a_bench}");
        // The last bounces are too low to be seen as such.
        let seen = found.bounces();
        faults.all_true(&found, seen, &what);
        faults.note(seen == 0 || seen > clip.truth.bounces.len(), &what, || {
            format!("{seen} bounces of {}", clip.truth.bounces.len())
        });
    }
    faults.none();
}

/// Far enough for long paths, through a lens that moves the corners of the picture by `corner` of their way from the middle.
fn through_lens(seed: u64, rate_hz: f64, bounces: usize, corner: f64) -> Value {
    let size_px = [640.0_f64, 480.0];
    let focal_px = 700.0;
    let middle_px = size_px.map(|side| 0.5 * (side - 1.0));
    let square = (middle_px[0].powi(2) + middle_px[1].powi(2)) / (focal_px * focal_px);
    let camera = json!({
        "image_size_px": size_px, "metres_per_pixel": 0.0015, "origin_px": [30, 440], "frame_rate_hz": rate_hz,
        "lens": {"camera_matrix": [[focal_px, 0, middle_px[0]], [0, focal_px, middle_px[1]], [0, 0, 1]],
                 "distortion": [corner / square, 0, 0, 0, 0]}
    });
    let scene = with(scene(seed), "camera", camera);
    let scene = with(scene, "launch", json!({"drop_height_m": 0.5, "speed_m_s": 0.7}));
    let scene = with(scene, "ball", json!({"radius_m": 0.015, "mass_kg": 0.11}));
    with(scene, "stop", json!({"bounces": bounces, "tail_s": 0.15}))
}

#[test]
fn a_lens_that_nobody_tells_of_is_in_the_uncertainties() {
    let mut faults = Faults::default();
    for (seed, (rate_hz, bounces, corner, codec)) in (7900..).zip([
        (240.0, 2, -0.01, "h264"),
        (120.0, 1, 0.006, "lossless"),
        (60.0, 2, 0.01, "h264"),
        (60.0, 1, -0.01, "h264"),
    ]) {
        let what = format!("{rate_hz} Hz, {bounces} bounces, {corner}");
        let found = Clip::of(&through_lens(seed, rate_hz, bounces, corner))
            .untold("lens")
            .stored(codec);
        faults.all_true(&found, bounces, &what);
        // None, not said to be none and said to be.
        let straight = Clip::of(&through_lens(seed, rate_hz, bounces, 0.0));
        let (untold, told) = (
            straight.clone().untold("lens").stored(codec),
            straight.stored(codec),
        );
        let std = |found: &Judged| found.number("x0").and_then(|x0| x0.std);
        for (found, what) in [(&untold, "untold"), (&told, "told")] {
            faults.all_true(
                found,
                bounces,
                &format!("{rate_hz} Hz, {bounces} bounces, none, {what}"),
            );
            faults.note(found.warns("lens_unknown"), what, || "a lens is seen".to_owned());
        }
        faults.note(
            !(std(&told).zip(std(&untold))).is_some_and(|(told, untold)| told < untold),
            &what,
            || format!("x0 to {:?} and {:?}", std(&told), std(&untold)),
        );
    }
    faults.none();
}
