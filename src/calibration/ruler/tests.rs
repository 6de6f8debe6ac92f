use super::*;
use crate::calibration::{Lens, ScaleEvidence};
use nalgebra::Matrix3;

/// Dark, with a bright bar from u = 100.5 to 499.5 and v = 299.5 to 339.5.
fn frame() -> Luma {
    Luma::from_fn(640, 480, |u, v| {
        if (101..500).contains(&u) && (300..340).contains(&v) {
            180
        } else {
            60
        }
    })
}

fn request(from: (f64, f64), to: (f64, f64)) -> RulerRequest {
    RulerRequest {
        scale: Scale::Ruler(Ruler {
            from: PixelPoint::new(from.0, from.1),
            to: PixelPoint::new(to.0, to.1),
            length_m: 0.4,
            length_std_m: Some(0.0005),
            point_std_px: None,
        }),
        held: None,
        up_px: [0.0, -1.0],
        up_given: false,
        up_std_rad: None,
        origin: None,
        floor: None,
        edge: None,
        floor_line: None,
        point_std_px: 1.0,
        snap_px: None,
        known: known(Some(0.02), None),
    }
}

#[test]
fn a_ruler_gives_a_scale_with_the_uncertainty_of_its_ends() {
    let ruled = calibrate(&request((100.0, 320.0), (500.0, 320.0)), &frame()).unwrap();
    let q = ruled
        .calibration
        .metres_per_unit(&ScaleEvidence::default())
        .unwrap();
    assert!((q.value - 0.001).abs() < 1e-12);
    let relative = (2.0_f64.sqrt() / 400.0).hypot(0.0005 / 0.4);
    assert!((q.std_uncertainty.unwrap() / q.value - relative).abs() < 1e-9);
    assert_eq!(ruled.calibration.image_size_px, Some((640, 480)));
    assert_eq!(
        ruled.calibration.up_std_rad, None,
        "nobody said how level the camera is"
    );
}

#[test]
fn snapped_ends_lie_on_the_bar() {
    let mut r = request((104.0, 318.0), (494.0, 322.0));
    r.snap_px = Some(10.0);
    r.floor = Some(PixelPoint::new(300.0, 344.0));
    r.edge = Some(PixelPoint::new(98.0, 330.0));
    let ruled = calibrate(&r, &frame()).unwrap();
    let Scale::Ruler(Ruler {
        from,
        to,
        point_std_px,
        ..
    }) = ruled.calibration.scale
    else {
        panic!("no ruler")
    };
    assert!(
        (from.u_px - 100.5).abs() < 0.05 && (to.u_px - 499.5).abs() < 0.05,
        "{from:?} {to:?}"
    );
    assert!(point_std_px.unwrap() < 0.1);
    let origin = ruled.calibration.origin_px.unwrap();
    assert!(
        (origin.u_px - 100.5).abs() < 0.05 && (origin.v_px - 339.5).abs() < 0.05,
        "{origin:?}"
    );
    assert_eq!(ruled.calibration.launch.edge_x_m, Some(0.0));
    assert_eq!(ruled.marks.len(), 4);
}

#[test]
fn a_line_along_the_floor_is_kept_with_the_uncertainty_of_its_ends() {
    let line = |r: &RulerRequest| calibrate(r, &frame()).unwrap().calibration.floor.line.unwrap();
    let mut r = request((100.0, 320.0), (500.0, 320.0));
    r.scale = Scale::Gravity;
    let (left, right) = (PixelPoint::new(120.0, 344.0), PixelPoint::new(480.0, 336.0));
    r.floor_line = Some([left, right]);
    let read = line(&r);
    assert_eq!((read.from, read.to, read.std_px), (left, right, 1.0));
    let ruled = calibrate(&r, &frame()).unwrap();
    let roles: Vec<MarkRole> = ruled.marks.iter().map(|m| m.role).collect();
    assert_eq!(roles, [MarkRole::LineFrom, MarkRole::LineTo]);
    assert!(!ruled.calibration.floor.given && ruled.calibration.origin_px.is_none());
    // The bar's lower edge, to which both ends are moved square to the line.
    r.snap_px = Some(10.0);
    let snapped = line(&r);
    assert!(
        (snapped.from.v_px - 339.5).abs() < 0.05 && (snapped.to.v_px - 339.5).abs() < 0.05,
        "{snapped:?}"
    );
    assert!((snapped.from.u_px - 120.0).abs() < 0.2, "{snapped:?}");
    assert!(snapped.std_px < 0.1, "{snapped:?}");
    let rise = snapped
        .rise_rad(&ruled.calibration.rectification().unwrap())
        .unwrap();
    assert!(rise.abs() < 5.0 * snapped.std_rad(), "{rise}");
}

#[test]
fn lines_along_the_floor_that_tell_nothing() {
    let message = |from: (f64, f64), to: (f64, f64), snap_px: Option<f64>| {
        let mut r = request((100.0, 320.0), (500.0, 320.0));
        r.scale = Scale::Gravity;
        r.floor_line = Some([PixelPoint::new(from.0, from.1), PixelPoint::new(to.0, to.1)]);
        r.snap_px = snap_px;
        calibrate(&r, &frame()).unwrap_err().to_string()
    };
    let outside = message((100.0, 400.0), (700.0, 400.0), None);
    assert!(
        outside.contains("--floor-line: [700, 400]") && outside.contains("640x480"),
        "{outside}"
    );
    let short = message((100.0, 400.0), (105.0, 400.0), None);
    assert!(
        short.contains("5.0 px apart: accepted are two points at least 10 px apart"),
        "{short}"
    );
    let nothing = message((100.0, 400.0), (500.0, 400.0), Some(10.0));
    assert!(
        nothing.contains("--floor-line: there is no edge within 10 px"),
        "{nothing}"
    );
    let mut r = request((100.0, 320.0), (500.0, 320.0));
    let camera = Matrix3::new(300.0, 0.0, 319.5, 0.0, 300.0, 239.5, 0.0, 0.0, 1.0);
    r.known.lens = Some(Lens::new(camera, [-0.5, 0.0, 0.0, 0.0, 0.0]).unwrap());
    r.floor_line = Some([PixelPoint::new(320.0, 400.0), PixelPoint::new(638.0, 478.0)]);
    let beyond = calibrate(&r, &frame()).unwrap_err().to_string();
    assert!(
        beyond.contains("--floor-line: the lens has no place for [638, 478]"),
        "{beyond}"
    );
}

#[test]
fn a_floor_alone_leaves_the_edge_unknown() {
    let mut r = request((100.0, 320.0), (500.0, 320.0));
    r.floor = Some(PixelPoint::new(300.0, 344.0));
    let calibration = calibrate(&r, &frame()).unwrap().calibration;
    assert_eq!(calibration.launch.edge_x_m, None);
    assert_eq!(calibration.origin_px, Some(PixelPoint::new(300.0, 344.0)));
    assert_eq!(calibration.origin_std_px, Some(1.0));
}

#[test]
fn floor_and_edge_meet_along_the_tilted_axes_of_the_undistorted_picture() {
    let mut r = request((100.0, 320.0), (500.0, 340.0));
    r.held = Some(RulerOrientation::Level);
    let camera = Matrix3::new(500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0);
    r.known.lens = Some(Lens::new(camera, [-0.2, 0.05, 0.0, 0.0, 0.0]).unwrap());
    r.floor = Some(PixelPoint::new(400.0, 450.0));
    r.edge = Some(PixelPoint::new(60.0, 200.0));
    let calibration = calibrate(&r, &frame()).unwrap().calibration;
    let map = calibration.rectification().unwrap();
    let plane = |p| map.plane_from_pixel(p).unwrap();
    assert!(plane(PixelPoint::new(400.0, 450.0)).up.abs() < 1e-6);
    assert!(plane(PixelPoint::new(60.0, 200.0)).right.abs() < 1e-6);
    let (a, b) = (
        plane(PixelPoint::new(100.0, 320.0)),
        plane(PixelPoint::new(500.0, 340.0)),
    );
    assert!((a.up - b.up).abs() < 1e-6, "the ruler is level");
    assert!(calibration.up_px[1] < 0.0 && calibration.up_std_rad.unwrap() > 0.0);
}

#[test]
fn an_upright_ruler_tells_up_from_either_end() {
    for (from, to) in [((300.0, 400.0), (310.0, 100.0)), ((310.0, 100.0), (300.0, 400.0))] {
        let mut r = request(from, to);
        r.held = Some(RulerOrientation::Upright);
        let [a, b] = calibrate(&r, &frame()).unwrap().calibration.up_px;
        assert!((a - 10.0 / 10.0_f64.hypot(300.0)).abs() < 1e-12 && b < 0.0);
    }
}

#[test]
fn marks_that_make_no_sense_are_told() {
    let message = |r: &RulerRequest| calibrate(r, &frame()).unwrap_err().to_string();
    let same = message(&request((100.0, 320.0), (100.0, 321.0)));
    assert!(
        same.contains("same point") && same.contains("far apart"),
        "{same}"
    );
    let outside = message(&request((100.0, 320.0), (320.0, 500.0)));
    assert!(
        outside.contains("--to") && outside.contains("640x480"),
        "{outside}"
    );
    let mut r = request((20.0, 100.0), (500.0, 100.0));
    r.snap_px = Some(10.0);
    let nothing = message(&r);
    assert!(
        nothing.contains("no edge within 10 px") && nothing.contains("--snap=20"),
        "{nothing}"
    );
    // Both ends snap to the bar's left end.
    let mut r = request((98.0, 320.0), (104.0, 320.0));
    r.snap_px = Some(10.0);
    assert!(message(&r).contains("once moved"));
    let mut r = request((100.0, 320.0), (500.0, 320.0));
    r.edge = Some(PixelPoint::new(98.0, 330.0));
    assert!(message(&r).contains("--floor"));
    let mut r = request((100.0, 320.0), (500.0, 320.0));
    r.scale = Scale::Ball;
    r.known.ball.radius_m = None;
    assert!(message(&r).contains("ball.radius_m"));
}
