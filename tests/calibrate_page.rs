//! The page of `track calibrate show` in a real browser: headless Chromium, in which a script drags the marks by pointer
//! events, types, presses keys and clicks, and reads what the page makes of it.
//!
//! Runs where there is a Chromium (or Chrome) in PATH, or where `TRACK_CHROMIUM` names one; elsewhere it says so and
//! passes: a browser is too much to install for one test (Debian: apt-get install chromium).

use crate::browser::{self, chromium};
use assert_cmd::Command;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::{TempDir, tempdir};
use track::calibration::ruler::{self, RulerRequest, calibrate};
use track::calibration::{Calibration, Ruler, Scale};
use track::frames::{Coding, Luma, VideoWriter, Yuv420};
use track::geometry::PixelPoint;

const SIZE: (usize, usize) = (640, 360);

/// A clip of a few frames: something with structure, so that the loupe has something to show.
fn clip(dir: &Path) -> PathBuf {
    let path = dir.join("clip.mp4");
    let mut writer = VideoWriter::create(&path, SIZE.0, SIZE.1, 30.0, Coding::Lossless).unwrap();
    for frame in 0..10 {
        let luma = Luma::from_fn(SIZE.0, SIZE.1, |u, v| {
            if (u / 8 + v / 8) % 2 == 0 {
                60 + 10 * frame
            } else {
                180
            }
        });
        writer.write(&luma).unwrap();
    }
    writer.finish().unwrap();
    path
}

/// The helpers that a test's script has. Pixels are those of the picture.
const HELPERS: &str = r#"
const mark = (name) => document.querySelector(`[data-mark="${name}"]`);
const stage = by("stage");
function screen(u, v) {
  return new DOMPoint(u, v).matrixTransform(stage.getScreenCTM());
}
function at(name) {
  return mark(name).getAttribute("transform").match(/-?\d[\d.]*(?:e-?\d+)?/g).map(Number);
}
function pointer(name, type, [u, v], kind) {
  const p = screen(u, v);
  mark(name).dispatchEvent(new PointerEvent(type, {
    bubbles: true, cancelable: true, pointerId: 7, pointerType: kind, isPrimary: true, clientX: p.x, clientY: p.y, button: 0,
    buttons: type === "pointerup" ? 0 : 1,
  }));
}
// Takes a mark a little off its middle, as people do, and carries it there in steps.
function drag(name, [u, v], kind = "mouse") {
  const [a, b] = at(name), [du, dv] = [2.3, -1.6];
  pointer(name, "pointerdown", [a + du, b + dv], kind);
  for (let i = 1; i <= 5; i++) pointer(name, "pointermove", [a + du + (u - a) * i / 5, b + dv + (v - b) * i / 5], kind);
  pointer(name, "pointerup", [u + du, v + dv], kind);
  pointer(name, "pointermove", [u + 50, v + 50], kind);
}
function key(name, key, more = {}) {
  mark(name).dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more }));
}
function type(id, value) {
  by(id).value = value;
  by(id).dispatchEvent(new Event("input", { bubbles: true }));
}
function tick(id, on) {
  by(id).checked = on;
  by(id).dispatchEvent(new Event("input", { bubbles: true }));
}
function choose(scale) {
  const radio = document.querySelector(`input[name="scale"][value="${scale}"]`);
  radio.checked = true;
  radio.dispatchEvent(new Event("input", { bubbles: true }));
}
const calib = () => by("result").textContent;
const problems = () => Array.from(by("problems").children).map((li) => li.textContent);
"#;

/// What a script returns after it ran on the page of `calib` (`None`: a file that does not exist yet).
fn on_page(browser: &Path, calib: Option<&Value>, script: &str) -> Value {
    on_page_of_width(browser, 1300, calib, script)
}

/// The same in a window so many pixels wide.
fn on_page_of_width(browser: &Path, width: u32, calib: Option<&Value>, script: &str) -> Value {
    let dir: TempDir = tempdir().unwrap();
    on_page_of_video(browser, width, &clip(dir.path()), calib, script)
}

/// The same of another recording.
fn on_page_of_video(browser: &Path, width: u32, video: &Path, calib: Option<&Value>, script: &str) -> Value {
    let dir: TempDir = tempdir().unwrap();
    let path = dir.path().join("my.calib.json");
    if let Some(calib) = calib {
        std::fs::write(&path, calib.to_string()).unwrap();
    }
    let page = dir.path().join("my.show.html");
    Command::new(env!("CARGO_BIN_EXE_track"))
        .args(["calibrate", "show"])
        .args([path.as_path(), video])
        .assert()
        .success()
        .stdout(format!("{}\n", page.display()));
    browser::on_page(browser, width, &page, &format!("{HELPERS}\n{script}"))
}

/// The calibration that the program makes of the marks which the page saves.
fn parsed(marks: &Value) -> Calibration {
    let dir = tempdir().unwrap();
    let (file, calib) = (dir.path().join("my.marks.json"), dir.path().join("my.calib.json"));
    std::fs::write(&file, marks.as_str().unwrap()).unwrap();
    Command::new(env!("CARGO_BIN_EXE_track"))
        .args(["calibrate", "ruler"])
        .arg(clip(dir.path()))
        .arg("--marks")
        .arg(&file)
        .arg("--out")
        .arg(&calib)
        .assert()
        .success();
    Calibration::read(&calib).unwrap()
}

/// The same calibration, as the program writes it, to the rounding of degrees and radians.
fn assert_same(a: &Value, b: &Value) {
    match (a, b) {
        (Value::Object(x), Value::Object(y)) => {
            assert!(x.keys().eq(y.keys()), "{a} {b}");
            x.iter().for_each(|(key, value)| assert_same(value, &y[key]));
        }
        (Value::Array(x), Value::Array(y)) => {
            assert_eq!(x.len(), y.len(), "{a} {b}");
            x.iter().zip(y).for_each(|(x, y)| assert_same(x, y));
        }
        (Value::Number(x), Value::Number(y)) => {
            let (x, y) = (x.as_f64().unwrap(), y.as_f64().unwrap());
            assert!((x - y).abs() <= 1e-12 * x.abs(), "{x} {y}");
        }
        _ => assert_eq!(a, b),
    }
}

#[test]
fn a_newcomer_drags_a_ruler_and_saves_a_file() {
    let Some(browser) = chromium() else { return };
    let out = on_page(
        &browser,
        None,
        r#"
        const before = { problems: problems(), disabled: by("save").disabled };
        type("length", "0.5");
        drag("from", [100.25, 300.5]);
        drag("to", [500.75, 300.5], "touch");
        const loupe = by("loupe");
        const shades = new Set(loupe.getContext("2d").getImageData(0, 0, 200, 200).data);
        key("to", "ArrowRight");
        key("to", "ArrowUp", { shiftKey: true });
        key("to", "ArrowLeft", { altKey: true });
        tick("floor-on", true);
        drag("floor", [320, 340]);
        const floorOnly = calib();
        tick("edge-on", true);
        drag("edge", [60.5, 100]);
        type("rate", "240");
        type("radius", "0.0125");
        let saved = null;
        URL.createObjectURL = (blob) => { saved = { blob }; return "blob:nothing"; };
        HTMLAnchorElement.prototype.click = function () { saved.name = this.download; };
        by("save").click();
        const slider = by("frame-slider"), first = by("frame").getAttribute("href");
        slider.value = 0;
        slider.dispatchEvent(new Event("input", { bubbles: true }));
        return {
          before, floorOnly, calib: calib(), shades: shades.size, loupe: loupe.style.visibility,
          saved: { name: saved.name, text: await saved.blob.text() },
          frames: Number(slider.max) + 1, changed: first !== by("frame").getAttribute("href"),
        };
        "#,
    );
    assert!(
        out["before"]["problems"][0]
            .as_str()
            .unwrap()
            .contains("length between"),
        "{out}"
    );
    assert_eq!(out["before"]["disabled"], true);
    let c = parsed(&out["calib"]);
    let Scale::Ruler(Ruler {
        from,
        to,
        length_m,
        point_std_px,
        ..
    }) = c.scale
    else {
        panic!("{out}")
    };
    let near = |a: PixelPoint, u: f64, v: f64| a.distance_px(PixelPoint::new(u, v)) < 0.02;
    assert!(near(from, 100.25, 300.5), "{from:?}");
    assert!(near(to, 500.75 + 1.0 - 0.1, 300.5 - 10.0), "{to:?}");
    assert_eq!((length_m, point_std_px), (0.5, Some(1.0)));
    assert_eq!(c.image_size_px, Some(SIZE));
    assert!(near(c.origin_px.unwrap(), 60.5, 340.0), "{:?}", c.origin_px);
    assert_eq!((c.launch.edge_x_m, c.origin_std_px), (Some(0.0), Some(1.0)));
    assert_eq!((c.frame_rate_hz, c.ball.radius_m), (Some(240.0), Some(0.0125)));
    let floor_only = parsed(&out["floorOnly"]);
    assert!((floor_only.origin_px.unwrap().v_px - 340.0).abs() < 0.02);
    assert_eq!(floor_only.launch.edge_x_m, None);
    assert_eq!(out["saved"]["name"], "my.marks.json");
    assert_eq!(out["saved"]["text"], out["calib"]);
    assert_eq!(out["loupe"], "visible");
    assert!(out["shades"].as_u64().unwrap() > 3, "the loupe shows the picture");
    assert!(
        out["frames"].as_u64().unwrap() > 1 && out["changed"] == true,
        "{out}"
    );
}

#[test]
fn what_makes_no_calibration_is_told_and_cannot_be_saved() {
    let Some(browser) = chromium() else { return };
    let out = on_page(
        &browser,
        None,
        r#"
        type("length", "0.5");
        drag("from", [200, 200]);
        drag("to", [200.5, 200]);
        const same = problems();
        choose("ball");
        const ball = problems();
        type("radius", "-1");
        const negative = problems();
        choose("gravity");
        type("radius", "");
        const fall = { problems: problems(), calib: calib() };
        tick("edge-on", true);
        const edge = problems();
        choose("ruler");
        drag("to", [-500, 9000]);
        return { same, ball, negative, fall, edge, outside: at("to"), saveable: !by("save").disabled };
        "#,
    );
    let says = |key: &str, words: &str| {
        assert!(out[key][0].as_str().unwrap().contains(words), "{key}: {out}");
    };
    says("same", "same point");
    says("ball", "radius");
    says("negative", "above 0");
    says("edge", "needs the floor");
    assert_eq!(out["fall"]["problems"], json!([]));
    assert_eq!(parsed(&out["fall"]["calib"]).scale, Scale::Gravity);
    assert_eq!(
        out["outside"],
        json!([0, SIZE.1 - 1]),
        "a mark stays in the picture"
    );
    assert_eq!(out["saveable"], false);
}

#[test]
fn a_line_along_the_floor_is_drawn_saved_and_read_back() {
    let Some(browser) = chromium() else { return };
    let out = on_page(
        &browser,
        None,
        r#"
        choose("gravity");
        const off = { calib: calib(), shown: mark("lineFrom").style.display };
        tick("line-on", true);
        const on = mark("lineFrom").style.display;
        drag("lineFrom", [40.25, 330.5]);
        drag("lineTo", [45, 330.5]);
        const short = problems();
        drag("lineTo", [600.5, 322], "touch");
        return { off, on, short, calib: calib() };
        "#,
    );
    assert_eq!((&out["off"]["shown"], &out["on"]), (&json!("none"), &json!("")));
    assert!(
        out["short"][0].as_str().unwrap().contains("nearly one point"),
        "{out}"
    );
    let file = parsed(&out["off"]["calib"]).to_json();
    for key in ["floor", "up_px", "gravity_m_s2"] {
        assert!(file.get(key).is_none(), "{key}: {file}");
    }
    let line = parsed(&out["calib"]).floor.line.unwrap();
    let near = |a: PixelPoint, u: f64, v: f64| a.distance_px(PixelPoint::new(u, v)) < 0.02;
    assert!(
        near(line.from, 40.25, 330.5) && near(line.to, 600.5, 322.0),
        "{line:?}"
    );
    assert_eq!(line.std_px, 1.0);
    // A file that has one begins with it; what nobody moves stays as it is, and so does what the page does not show.
    let mut file = json!({
        "schema": "track.calib/1", "image_size_px": [SIZE.0, SIZE.1], "scale": {"gravity": true},
        "ball": {"radius_m": 0.0125}, "launch": {"spin_ratio": "rolling", "track_width_m": 0.01},
        "floor": {"slope_deg": 0.5, "std_deg": 0.2, "line_px": [[20.123, 300.456], [620, 301]], "line_std_px": 0.07}
    });
    let script = r#"
        const kept = calib();
        key("lineTo", "ArrowUp");
        const moved = calib();
        tick("line-on", false);
        return { kept, moved, without: calib() };
    "#;
    let out = on_page(&browser, Some(&file), script);
    let made = |key: &str| parsed(&out[key]).to_json();
    let meant = |file: &Value| Calibration::parse(&file.to_string(), "file").unwrap().to_json();
    assert_same(&made("kept"), &meant(&file));
    file["floor"] =
        json!({"slope_deg": 0.5, "std_deg": 0.2, "line_px": [[20.12, 300.46], [620, 300]], "line_std_px": 1});
    assert_same(&made("moved"), &meant(&file));
    file["floor"] = json!({"slope_deg": 0.5, "std_deg": 0.2});
    assert_same(&made("without"), &meant(&file));
}

#[test]
fn with_a_lens_the_page_and_the_program_agree() {
    let Some(browser) = chromium() else { return };
    let lens = json!({"camera_matrix": [[520, 0, 321], [0, 522, 178], [0, 0, 1]], "distortion": [-0.25, 0.06, 0.001, -0.0008, 0.0]});
    let file = json!({
        "schema": "track.calib/1", "image_size_px": [SIZE.0, SIZE.1], "scale": {"gravity": true}, "lens": lens,
        "deviations": [{"lens": [1, 1, 0, 0, 0.001, 0, 0, 0, 0]}], "gravity_m_s2": 9.803,
    });
    let out = on_page(
        &browser,
        Some(&file),
        r#"
        choose("ruler");
        type("length", "0.3");
        drag("from", [80, 320]);
        drag("to", [560, 300]);
        by("held").value = "level";
        by("held").dispatchEvent(new Event("input", { bubbles: true }));
        tick("floor-on", true);
        tick("edge-on", true);
        drag("floor", [600, 330]);
        drag("edge", [40, 60]);
        return { calib: calib() };
        "#,
    );
    let page = parsed(&out["calib"]);
    let mut known = ruler::known(None, None);
    known.lens = Calibration::parse(&file.to_string(), "file").unwrap().lens;
    let p = PixelPoint::new;
    let request = RulerRequest {
        scale: Scale::Ruler(Ruler {
            from: p(80.0, 320.0),
            to: p(560.0, 300.0),
            length_m: 0.3,
            length_std_m: None,
            point_std_px: None,
        }),
        held: Some(ruler::RulerOrientation::Level),
        up_px: [0.0, -1.0],
        up_given: false,
        up_std_rad: None,
        origin: None,
        floor: Some(p(600.0, 330.0)),
        edge: Some(p(40.0, 60.0)),
        floor_line: None,
        point_std_px: 1.0,
        snap_px: None,
        known,
    };
    let frame = Luma {
        width: SIZE.0,
        height: SIZE.1,
        data: vec![0; SIZE.0 * SIZE.1],
    };
    let ours = calibrate(&request, &frame).unwrap().calibration;
    let (a, b) = (page.origin_px.unwrap(), ours.origin_px.unwrap());
    assert!(a.distance_px(b) < 0.05, "{a:?} {b:?}");
    let turn = (page.up_px[0] - ours.up_px[0]).hypot(page.up_px[1] - ours.up_px[1]);
    assert!(turn < 1e-4, "{:?} {:?}", page.up_px, ours.up_px);
    assert!((page.up_std_rad.unwrap() / ours.up_std_rad.unwrap() - 1.0).abs() < 1e-3);
    assert_eq!(
        (page.gravity_m_s2, page.deviations.len()),
        (9.803, 1),
        "what the page does not show stays"
    );
}

#[test]
fn the_origin_of_a_homography_moves_with_its_marks() {
    let Some(browser) = chromium() else { return };
    let h = [
        [0.001, 0.00002, -0.2],
        [0.00001, -0.00104, 0.33],
        [0.00008, -0.00002, 1.0],
    ];
    let file = json!({
        "schema": "track.calib/1", "image_size_px": [SIZE.0, SIZE.1],
        "scale": {"world_from_pixel": h, "relative_std": 0.001, "origin_unknown": true},
        "lens": {"camera_matrix": [[900, 0, 321], [0, 900, 178], [0, 0, 1]], "distortion": [-0.1, 0, 0, 0, 0]},
        "deviations": [{"lens": [2, 2, 0, 0, 0.002, 0, 0, 0, 0], "world_from_pixel": [[1e-6, 0, 1e-4], [0, 1e-6, 2e-4], [0, 0, 0]]}],
    });
    let out = on_page(
        &browser,
        Some(&file),
        r#"
        const before = calib();
        tick("floor-on", true);
        tick("edge-on", true);
        drag("floor", [400, 310]);
        drag("edge", [90, 200]);
        return { before, calib: calib() };
        "#,
    );
    assert!(!parsed(&out["before"]).has_origin());
    let c = parsed(&out["calib"]);
    assert!(c.has_origin() && c.launch.edge_x_m == Some(0.0));
    for c in c.deviated().iter().chain([&c]) {
        let map = c.rectification().unwrap();
        let plane = |u: f64, v: f64| map.plane_from_pixel(PixelPoint::new(u, v)).unwrap();
        // To the hundredth of a pixel that a drag has; lens and matrix off, the marks stay where they are.
        assert!(plane(400.0, 310.0).up.abs() < 2e-5, "{:?}", plane(400.0, 310.0));
        assert!(plane(90.0, 200.0).right.abs() < 2e-5, "{:?}", plane(90.0, 200.0));
    }
    let before = Calibration::parse(&file.to_string(), "file")
        .unwrap()
        .rectification()
        .unwrap();
    let after = c.rectification().unwrap();
    let step = |map: &track::calibration::Rectification| {
        let (a, b) = (
            map.plane_from_pixel(PixelPoint::new(100.0, 300.0)).unwrap(),
            map.plane_from_pixel(PixelPoint::new(500.0, 100.0)).unwrap(),
        );
        (b.right - a.right, b.up - a.up)
    };
    let (a, b) = (step(&before), step(&after));
    assert!(
        (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9,
        "only the origin moved"
    );
}

#[test]
fn a_decimal_comma_is_a_point_and_what_is_unclear_is_told() {
    let Some(browser) = chromium() else { return };
    let out = on_page(
        &browser,
        None,
        r#"
        const read = (text) => {
          type("length", text);
          return { problems: problems(), saved: calib() === "" ? null : JSON.parse(calib()).scale.length_m };
        };
        return Object.fromEntries(["2,32", "2.32", " 2 ", ",5", "1e-1", "1,250", "0,250", "2.3.2", "2,3,2", "two", "-1"].map((t) => [t, read(t)]));
        "#,
    );
    for (text, number) in [
        ("2,32", 2.32),
        ("2.32", 2.32),
        (" 2 ", 2.0),
        (",5", 0.5),
        ("1e-1", 0.1),
        ("0,250", 0.25),
    ] {
        assert_eq!(out[text]["saved"], number, "{text}: {out}");
        assert_eq!(out[text]["problems"], json!([]), "{text}: {out}");
    }
    for (text, words) in [
        ("1,250", "may be 1.250 or 1250"),
        ("2.3.2", "is no number"),
        ("2,3,2", "is no number"),
        ("two", "is no number"),
        ("-1", "above 0"),
    ] {
        assert_eq!(out[text]["saved"], Value::Null, "{text}: {out}");
        assert!(
            out[text]["problems"][0].as_str().unwrap().contains(words),
            "{text}: {out}"
        );
    }
}

#[test]
fn the_picture_comes_nearer_and_marks_stay_on_their_pixels() {
    let Some(browser) = chromium() else { return };
    let out = on_page(
        &browser,
        None,
        r#"
        const box = () => stage.getAttribute("viewBox").split(" ").map(Number);
        type("length", "0.5");
        drag("from", [100.25, 300.5]);
        const whole = box(), p = screen(100.25, 300.5);
        stage.dispatchEvent(new WheelEvent("wheel", { deltaY: -100, clientX: p.x, clientY: p.y, bubbles: true, cancelable: true }));
        const q = screen(100.25, 300.5), near = box();
        // Dragged where it is near, a mark is as exact.
        drag("from", [103.5, 298.25]);
        const saved = JSON.parse(calib()).scale.from_px;
        // The ground between marks pans.
        const ground = (type, x, y) => stage.dispatchEvent(new PointerEvent(type, {
          bubbles: true, cancelable: true, pointerId: 9, pointerType: "mouse", isPrimary: true, clientX: x, clientY: y }));
        ground("pointerdown", 300, 300);
        ground("pointermove", 290, 300);
        ground("pointerup", 290, 300);
        const panned = box();
        for (let i = 0; i < 40; i++) by("zoom-in").click();
        const nearest = box();
        by("zoom-all").click();
        const slider = by("frame-slider"), frames = [];
        for (let i = 0; i <= Number(slider.max); i++) {
          slider.value = i;
          slider.dispatchEvent(new Event("input", { bubbles: true }));
          frames.push(by("frame-name").textContent);
        }
        return { whole, near, shift: Math.hypot(p.x - q.x, p.y - q.y), saved, panned, nearest, again: box(), frames };
        "#,
    );
    let number = |key: &str, i: usize| out[key][i].as_f64().unwrap();
    assert_eq!(out["whole"], json!([-0.5, -0.5, SIZE.0, SIZE.1]));
    assert!((number("near", 2) - 640.0 / 1.25).abs() < 1e-9, "{out}");
    assert!(
        out["shift"].as_f64().unwrap() < 0.5,
        "what is under the pointer stays there: {out}"
    );
    assert!(
        (number("saved", 0) - 103.5).abs() < 0.02 && (number("saved", 1) - 298.25).abs() < 0.02,
        "{out}"
    );
    assert!(
        number("panned", 0) > number("near", 0) && number("panned", 2) == number("near", 2),
        "{out}"
    );
    assert!((number("nearest", 2) - 16.0).abs() < 1e-9, "{out}");
    assert_eq!(out["again"], out["whole"]);
    let frames = out["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 10, "every frame of a short clip");
    assert!(frames[9].as_str().unwrap().starts_with("9, at 0.300 s"), "{out}");
}

#[test]
fn a_calibration_that_is_opened_again_keeps_how_the_ruler_stood() {
    let Some(browser) = chromium() else { return };
    let marked = on_page(
        &browser,
        None,
        r#"
        type("length", "0.5");
        drag("from", [100.25, 40.5]);
        drag("to", [108.5, 330.25]);
        by("held").value = "upright";
        by("held").dispatchEvent(new Event("input", { bubbles: true }));
        return { calib: calib() };
        "#,
    );
    let first = parsed(&marked["calib"]).to_json();
    assert!(first["up_px"].is_array(), "{first}");
    let script = r#"return { held: by("held").value, calib: calib() };"#;
    let again = on_page(&browser, Some(&first), script);
    assert_eq!(again["held"], "upright");
    assert_same(&parsed(&again["calib"]).to_json(), &first);
    // An "up" that somebody gave is no stand of the ruler.
    let mut given = first.clone();
    given["up_std_deg"] = json!(0.3);
    let again = on_page(&browser, Some(&given), script);
    assert_eq!(again["held"], "");
    assert_same(&parsed(&again["calib"]).to_json(), &given);
}

#[test]
fn on_a_narrow_screen_the_loupe_covers_no_mark() {
    let Some(browser) = chromium() else { return };
    let script = r#"
        const marks = {};
        tick("floor-on", true);
        for (const name of ["from", "to", "floor"]) {
          mark(name).focus();
          const a = by("loupe").getBoundingClientRect(), b = mark(name).querySelector("circle").getBoundingClientRect();
          const apart = a.right < b.left || b.right < a.left || a.bottom < b.top || b.bottom < a.top;
          marks[name] = apart && by("loupe").style.visibility === "visible";
        }
        const wide = document.documentElement.scrollWidth <= innerWidth;
        return { marks, wide, width: innerWidth };
    "#;
    for width in [380, 1300] {
        let out = on_page_of_width(&browser, width, None, script);
        assert_eq!(
            out["marks"],
            json!({"from": true, "to": true, "floor": true}),
            "{width}: {out}"
        );
        assert_eq!(out["wide"], true, "nothing sticks out at {width}: {out}");
    }
}

#[test]
fn the_page_shows_the_colours_of_the_recording() {
    let Some(browser) = chromium() else { return };
    let dir = tempdir().unwrap();
    let coding = Coding::H264 {
        crf: 10,
        gop: 5,
        b_frames: 0,
    };
    let video = dir.path().join("red.mp4");
    let mut writer = VideoWriter::create(&video, 64, 48, 30.0, coding).unwrap();
    let mut red = Yuv420::black(64, 48);
    red.y.fill(76);
    red.u.fill(85);
    red.v.fill(255);
    (0..5).for_each(|_| writer.write_yuv(&red).unwrap());
    writer.finish().unwrap();
    let script = r#"
        const image = new Image();
        image.src = by("frame").getAttribute("href");
        await image.decode();
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
        canvas.getContext("2d").drawImage(image, 0, 0);
        return { pixel: Array.from(canvas.getContext("2d").getImageData(32, 24, 1, 1).data) };
    "#;
    let out = on_page_of_video(&browser, 1300, &video, None, script);
    let channel = |i: usize| out["pixel"][i].as_f64().unwrap();
    assert!(
        channel(0) > 230.0 && channel(1) < 25.0 && channel(2) < 25.0,
        "{out}"
    );
}
