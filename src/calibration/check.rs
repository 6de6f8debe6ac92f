//! What is wrong with a calibration, or odd about it: all of it at once, in plain words.
//!
//! A *problem* makes results wrong or keeps the calibration from being used; a *remark* is worth knowing. What the reader
//! of the file refuses is a problem as it stands; the rest is judged here, by itself and against a recording.

use super::finding::Finding;
use super::{Calibration, CalibrationError, FileProblem, Lens, ScaleEvidence, View, file};
use crate::frames::SourceInfo;
use crate::geometry::PixelPoint;
use std::f64::consts::PI;
use std::path::Path;

/// Everything found in the file at `path`, problems first; against a recording where one is given.
///
/// # Errors
/// A file that cannot be read, or is not JSON.
pub fn check(path: &Path, recording: Option<&SourceInfo>) -> Result<Vec<Finding>, CalibrationError> {
    let (calibration, problems) = file::inspect(path)?;
    let mut findings = Findings::default();
    for problem in &problems {
        findings.refused(problem);
    }
    if let Some(calibration) = &calibration {
        // A value that was refused stands at its default here: whatever follows from that is no finding.
        findings.refused = problems.into_iter().map(|p| p.key).collect();
        findings.judge(calibration, recording);
    }
    Ok(findings.sorted())
}

/// Everything found in a calibration that was just made, problems first; against a recording where one is given.
#[must_use]
pub fn findings(calibration: &Calibration, recording: Option<&SourceInfo>) -> Vec<Finding> {
    let mut findings = Findings::default();
    findings.judge(calibration, recording);
    findings.sorted()
}

#[derive(Default)]
struct Findings {
    all: Vec<Finding>,
    refused: Vec<String>,
}

impl Findings {
    fn judge(&mut self, calibration: &Calibration, recording: Option<&SourceInfo>) {
        by_itself(calibration, recording, self);
        if let Some(recording) = recording {
            against(calibration, recording, self);
        }
    }

    fn sorted(mut self) -> Vec<Finding> {
        self.all.sort_by_key(|f| f.severity);
        self.all
    }

    fn refused(&mut self, problem: &FileProblem) {
        self.all.push(Finding::problem(
            &problem.key,
            format!(
                "found {}; accepted: {}; try: {}",
                problem.found, problem.accepted, problem.hint
            ),
        ));
    }

    fn add(&mut self, finding: Finding) {
        let key = finding.key.as_str();
        if !self
            .refused
            .iter()
            .any(|r| r.starts_with(key) || key.starts_with(r.as_str()))
        {
            self.all.push(finding);
        }
    }

    fn problem(&mut self, key: &str, message: impl Into<String>) {
        self.add(Finding::problem(key, message));
    }

    fn remark(&mut self, key: &str, message: impl Into<String>) {
        self.add(Finding::remark(key, message));
    }
}

fn by_itself(c: &Calibration, recording: Option<&SourceInfo>, out: &mut Findings) {
    let size = c
        .image_size_px
        .or_else(|| recording.map(|r| (r.width_px, r.height_px)));
    if c.image_size_px.is_none() {
        out.remark(
            "image_size_px",
            "not given, so that a scaled or cropped version of the recording would be measured without a word; give [width, height]",
        );
    }
    scale(c, size, out);
    ball(c, size, out);
    up(c, out);
    floor(c, out);
    if let (Some(lens), Some(size)) = (&c.lens, size) {
        lens_findings(lens, size, out);
        if c.deviations.is_empty() {
            out.remark(
                "lens",
                "it has no uncertainty (\"deviations\"), so that results take it as exact; track calibrate board determines it",
            );
        }
    }
    if let (Some(origin), Some(size)) = (c.origin_px, size)
        && !inside(origin, size)
    {
        out.remark(
            "origin_px",
            format!(
                "[{}, {}] is outside the picture of {}x{} px; right if the launch edge is, otherwise check the order: column first, then row",
                origin.u_px, origin.v_px, size.0, size.1
            ),
        );
    }
    if c.origin_px.is_some() && c.origin_std_px.is_none() {
        out.remark(
            "origin_std_px",
            "not given, so that x0 takes the origin as exact; a mark read off by eye is good to about 1 px",
        );
    }
    surroundings(c, out);
}

fn inside(p: PixelPoint, (width, height): (usize, usize)) -> bool {
    let within = |x: f64, size: usize| x >= -1.0 && x <= size as f64;
    within(p.u_px, width) && within(p.v_px, height)
}

/// The file's own size of the picture in metres, where the scale tells.
fn metres_per_pixel(c: &Calibration, size: (usize, usize)) -> Option<f64> {
    let q = c.metres_per_unit(&ScaleEvidence::default()).ok()?;
    let middle = PixelPoint::new(size.0 as f64 / 2.0, size.1 as f64 / 2.0);
    let jacobian = c.rectification().ok()?.jacobian(middle)?;
    Some(q.value * jacobian.determinant().abs().sqrt())
}

fn scale(c: &Calibration, size: Option<(usize, usize)>, out: &mut Findings) {
    if let Some(size) = size
        && let Some(q) = metres_per_pixel(c, size)
    {
        let longer = size.0.max(size.1);
        let longer_m = q * longer as f64;
        if !(1e-3..200.0).contains(&longer_m) {
            out.problem(
                "scale",
                format!(
                    "the picture's longer side would be {longer_m:.3} m ({longer} px of {q:.3e} m): check the unit, lengths are metres"
                ),
            );
        }
    }
    for finding in c.scale_findings(size) {
        out.add(finding);
    }
}

fn ball(c: &Calibration, size: Option<(usize, usize)>, out: &mut Findings) {
    let Some(radius_m) = c.ball.radius_m else { return };
    if !(2e-4..0.5).contains(&radius_m) {
        out.problem(
            "ball.radius_m",
            format!(
                "{radius_m} m is no ball's radius: give half the diameter, in metres (20 mm across: 0.01)"
            ),
        );
    } else if let Some(size) = size
        && let Some(q) = metres_per_pixel(c, size)
    {
        let radius_px = radius_m / q;
        let most = size.0.min(size.1) as f64 / 2.0;
        if !(1.5..most).contains(&radius_px) {
            out.problem(
                "ball.radius_m",
                format!(
                    "by the scale the ball's radius is {radius_px:.2} px in a picture of {}x{} px: ball or scale is wrong",
                    size.0, size.1
                ),
            );
        }
    }
    if let Some(mass_kg) = c.ball.mass_kg {
        let density = mass_kg / (4.0 / 3.0 * PI * radius_m.powi(3));
        if !(5.0..25_000.0).contains(&density) {
            out.problem(
                "ball.mass_kg",
                format!(
                    "{mass_kg} kg in a ball of {:.1} mm radius are {density:.0} kg/m³ (foam has 20, steel 7800): check mass and radius",
                    1e3 * radius_m
                ),
            );
        }
    }
}

fn up(c: &Calibration, out: &mut Findings) {
    let [a, b] = c.up_px;
    if b > 0.5 {
        out.problem(
            "up_px",
            format!("[{a:.3}, {b:.3}] points down in the picture (v grows downwards): up is [0, -1] unless the camera stood on its head"),
        );
    } else if a.abs() > 0.35 && c.view == View::Side {
        let lean = a.atan2(-b).to_degrees();
        out.remark(
            "up_px",
            format!("the camera leaned by {lean:.0} degrees: right for one on its side, otherwise check it"),
        );
    }
}

/// A line along the floor is as steep as floor.slope_deg may be, at most.
const STEEPEST_LINE_DEG: f64 = 45.0;

fn floor(c: &Calibration, out: &mut Findings) {
    let says = c.floor.given || c.floor.line.is_some();
    if says && c.view == View::Top {
        out.remark("floor", "a picture from above shows no slope: it has no say");
        return;
    }
    let rise_rad = c
        .floor
        .line
        .and_then(|line| line.rise_rad(&c.rectification().ok()?));
    if let Some(rise_deg) = rise_rad.map(f64::to_degrees)
        && rise_deg.abs() > STEEPEST_LINE_DEG
    {
        out.problem(
            "floor.line_px",
            format!(
                "the line rises by {rise_deg:.0} degrees against \"up\": a floor is level, nearly; check the order (column first, then row), and up_px for a camera on its side"
            ),
        );
    }
}

fn lens_findings(lens: &Lens, size: (usize, usize), out: &mut Findings) {
    let m = lens.camera_matrix();
    let (fx, fy, centre) = (m[(0, 0)], m[(1, 1)], lens.principal_point());
    let (width, height) = (size.0 as f64, size.1 as f64);
    let off = ((centre.u_px - width / 2.0) / width)
        .abs()
        .max(((centre.v_px - height / 2.0) / height).abs());
    let key = "lens.camera_matrix";
    if off > 0.2 {
        out.problem(
            key,
            format!(
                "its centre, [{:.0}, {:.0}], is far from the middle of a picture of {}x{} px: it was made for another size or cut of the picture",
                centre.u_px, centre.v_px, size.0, size.1
            ),
        );
    }
    if (fx / fy - 1.0).abs() > 0.05 {
        out.problem(
            key,
            format!("fx is {fx:.0} and fy {fy:.0}: pixels are square in almost every camera; calibrate the lens again"),
        );
    }
    if !(0.2..30.0).contains(&(fx / width)) {
        out.problem(
            key,
            format!(
                "a focal length of {fx:.0} px with a picture {} px wide sees {:.1} degrees: check it",
                size.0,
                2.0 * (0.5 * width / fx).atan().to_degrees()
            ),
        );
    }
    let corners = [
        (0.0, 0.0),
        (width - 1.0, 0.0),
        (0.0, height - 1.0),
        (width - 1.0, height - 1.0),
    ];
    let lost = corners
        .iter()
        .filter(|&&(u, v)| lens.undistort(PixelPoint::new(u, v)).is_none())
        .count();
    if lost > 0 {
        out.problem(
            "lens.distortion",
            format!("{lost} of the picture's 4 corners cannot be undistorted: the model folds back before; calibrate with the board in the corners"),
        );
    }
}

/// Gravity, spin: what has usual values.
fn surroundings(c: &Calibration, out: &mut Findings) {
    if !(9.76..=9.84).contains(&c.gravity_m_s2) {
        out.remark(
            "gravity_m_s2",
            format!("{}: on the Earth it is between 9.76 and 9.84", c.gravity_m_s2),
        );
    }
    if let Some(spin) = c.launch.spin_ratio.filter(|s| s.abs() > 3.0) {
        out.remark(
            "launch.spin_ratio",
            format!("{spin}: R w / u is 1 for a rolling ball, rarely above 2"),
        );
    }
}

fn against(c: &Calibration, recording: &SourceInfo, out: &mut Findings) {
    let size = (recording.width_px, recording.height_px);
    if let Err(CalibrationError::ImageSize {
        calibrated,
        found,
        hint,
    }) = c.check_image_size(size.0, size.1)
    {
        out.problem(
            "image_size_px",
            format!(
                "the calibration is for pictures of {}x{} px, the recording has {}x{} px; {hint}",
                calibrated.0, calibrated.1, found.0, found.1
            ),
        );
    }
    if c.image_size_px.is_none() {
        for (key, end) in c.marks() {
            if !inside(end, size) {
                out.problem(
                    key,
                    format!(
                        "[{}, {}] is outside the recording's picture of {}x{} px",
                        end.u_px, end.v_px, size.0, size.1
                    ),
                );
            }
        }
    }
    if (recording.pixel_aspect - 1.0).abs() > 1e-3 {
        out.problem(
            "scale",
            format!(
                "the recording's pixels are {:.3} times as wide as high, so one scale cannot hold for both directions; convert it first (ffmpeg -i in -vf scale=iw*sar:ih,setsar=1 out.mp4)",
                recording.pixel_aspect
            ),
        );
    }
    frame_rate(c, recording, out);
}

/// Capture rate over stored rate that slow-motion files and doubled frames have.
const FACTORS: [f64; 16] = [
    0.25, 0.5, 1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 32.0, 40.0,
];

fn frame_rate(c: &Calibration, recording: &SourceInfo, out: &mut Findings) {
    let key = "frame_rate_hz";
    match (c.frame_rate_hz, recording.nominal_rate_hz) {
        (None, _) if !recording.has_time_base => {
            out.problem(key, "the recording has no time stamps, so the capture rate must be given");
        }
        (None, Some(stored)) => out.remark(
            key,
            format!("not given: times are the file's own, {stored:.4} frames a second; a slow-motion file needs the true rate"),
        ),
        (Some(given), Some(stored)) => {
            let ratio = given / stored;
            let usual = FACTORS.iter().any(|f| (ratio / f - 1.0).abs() < 0.02);
            if !usual {
                out.problem(
                    key,
                    format!(
                        "{given} Hz is {ratio:.3} times the file's {stored:.4} frames a second, which no camera makes; if times are the file's own, leave it out"
                    ),
                );
            } else if (ratio - 1.0).abs() >= 0.02 {
                out.remark(
                    key,
                    format!("{given} Hz is {ratio:.2} times the file's {stored:.4}: right for slow motion (or stored repeats), otherwise leave it out"),
                );
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests;
