//! The files of a recording: video, truth, calibration.

use super::SimulatedRecording;
use super::camera::{axis_m, axis_px, origin_m, rolled};
use super::flight::Impact;
use super::scene::{SceneError, View};
use crate::config::made_by;
use crate::frames::encode::{Coding, EncodeError, Timing, VideoOptions, VideoWriter};
use crate::frames::{Luma, Yuv420, digest, temporary};
use nalgebra::Matrix3;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use thiserror::Error;

/// What can go wrong.
#[derive(Debug, Error)]
pub enum SimulationWriteError {
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The video.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// Truth or calibration.
    #[error("cannot write {}: {source}; check that the folder can be written to and has space left", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SimulatedFiles {
    /// `<stem>.mp4`, `.mkv` when lossless.
    pub video: PathBuf,
    /// `<stem>.truth.json`.
    pub truth: PathBuf,
    /// `<stem>.calib.json`.
    pub calib: PathBuf,
    /// Frames in the video.
    pub frames: usize,
}

/// Frames from one key frame to the next, and B-frames between references: what phones and cameras write.
const KEY_FRAMES: u32 = 48;
const B_FRAMES: u32 = 2;

/// Pictures that wait for the encoder.
const MADE_AHEAD: usize = 1;

/// What [`write()`] calls the files of `recording` in `out_dir`, before it has written any.
#[must_use]
pub fn files_of(recording: &SimulatedRecording, stem: &str, out_dir: &Path) -> SimulatedFiles {
    let extension = match coding(recording) {
        Coding::H264 { .. } => "mp4",
        Coding::Lossless | Coding::LosslessColour => "mkv",
    };
    let file = |ending: &str| out_dir.join(format!("{stem}.{ending}"));
    SimulatedFiles {
        video: file(extension),
        truth: file("truth.json"),
        calib: file("calib.json"),
        frames: recording.stored_frames().len(),
    }
}

impl SimulatedFiles {
    /// Those that are there already, but were not made by this program, or were changed since.
    #[must_use]
    pub fn foreign(&self) -> Vec<PathBuf> {
        let all = [&self.video, &self.truth, &self.calib].map(Clone::clone);
        made_by::foreign(&self.truth, &all)
    }
}

fn coding(recording: &SimulatedRecording) -> Coding {
    match recording.lossy_crf() {
        Some(crf) => Coding::H264 {
            crf,
            gop: KEY_FRAMES,
            b_frames: B_FRAMES,
        },
        None if recording.scene().look.is_coloured() => Coding::LosslessColour,
        None => Coding::Lossless,
    }
}

/// Renders `recording` into `<stem>.mp4` (`.mkv` when lossless), `<stem>.truth.json` and `<stem>.calib.json` in
/// `out_dir`, which is made if need be. `on_frame` hears the number of frames done after each.
///
/// # Errors
/// A folder or file that cannot be written, or an encoder that fails; each file appears whole or not at all.
pub fn write(
    recording: &SimulatedRecording,
    stem: &str,
    out_dir: &Path,
    on_frame: impl FnMut(usize),
) -> Result<SimulatedFiles, SimulationWriteError> {
    std::fs::create_dir_all(out_dir).map_err(|source| SimulationWriteError::Io {
        path: out_dir.to_owned(),
        source,
    })?;
    let written = files_of(recording, stem, out_dir);
    let camera = &recording.scene().camera;
    let clock = recording.clock.as_ref();
    let rate_hz = clock.map_or(camera.frame_rate_hz, |c| c.stamped_hz(camera.frame_rate_hz));
    let mut options = VideoOptions::new(rate_hz, coding(recording));
    if clock.is_some_and(|c| c.stamp_step_s.is_some()) {
        options.timing = Timing::Stamped;
    }
    if recording.scene().look.is_coloured() {
        options.chroma_siting = Some(camera.chroma_siting);
    }
    let mut video = VideoWriter::create_with(&written.video, camera.width_px, camera.height_px, &options)?;
    write_pictures(recording, &mut video, options.timing, on_frame)?;
    video.finish()?;
    let unwritten = |path: &Path, source: std::io::Error| SimulationWriteError::Io {
        path: path.to_owned(),
        source,
    };
    let digest = digest::of_file(&written.video).map_err(|e| unwritten(&written.video, e))?;
    let name = written.video.file_name().unwrap_or_default().to_string_lossy();
    let truth = serde_json::to_value(recording.truth()).map_err(|e| unwritten(&written.truth, e.into()))?;
    let truth = made_by::signed(truth, &[(name.into_owned(), digest)]);
    write_json(&written.truth, &truth).map_err(|e| unwritten(&written.truth, e))?;
    let calib = made_by::signed(calibration(recording), &[]);
    write_json(&written.calib, &calib).map_err(|e| unwritten(&written.calib, e))?;
    Ok(written)
}

/// Renders the pictures while others are encoded: neither keeps two cores busy alone.
fn write_pictures(
    recording: &SimulatedRecording,
    video: &mut VideoWriter,
    timing: Timing,
    mut on_frame: impl FnMut(usize),
) -> Result<(), EncodeError> {
    let stored = recording.stored_frames();
    // Repeats are the same picture, made once.
    let mut shows: Vec<usize> = stored.iter().map(|s| s.shows).collect();
    shows.dedup();
    std::thread::scope(|scope| {
        let (made, pictures) = mpsc::sync_channel(MADE_AHEAD);
        scope.spawn(move || {
            let of = |index| (index, SimulatedPicture::of(recording, index));
            // (Nobody receives any more after an encoder failed.)
            shows
                .into_iter()
                .map(of)
                .try_for_each(|picture| made.send(picture))
        });
        let mut shown: Option<(usize, SimulatedPicture)> = None;
        for (frame, done) in stored.into_iter().zip(1..) {
            if shown.as_ref().is_none_or(|(index, _)| *index != frame.shows) {
                shown = pictures.recv().ok();
            }
            let Some((_, picture)) = &shown else {
                // The thread that makes them panicked, and the scope will say so.
                break;
            };
            match (picture, timing) {
                (SimulatedPicture::Grey(luma), Timing::Stamped) => video.write_at(luma, frame.stamp_s)?,
                (SimulatedPicture::Grey(luma), Timing::Constant) => video.write(luma)?,
                (SimulatedPicture::Coloured(yuv), Timing::Stamped) => {
                    video.write_yuv_at(yuv, frame.stamp_s)?
                }
                (SimulatedPicture::Coloured(yuv), Timing::Constant) => video.write_yuv(yuv)?,
            }
            on_frame(done);
        }
        Ok(())
    })
}

/// A frame as it is written.
enum SimulatedPicture {
    Grey(Luma),
    Coloured(Yuv420),
}

impl SimulatedPicture {
    fn of(recording: &SimulatedRecording, index: usize) -> Self {
        recording
            .colour_frame(index)
            .map_or_else(|| Self::Grey(recording.frame(index)), Self::Coloured)
    }
}

fn write_json(path: &Path, content: &Value) -> std::io::Result<()> {
    let mut file = temporary::file_beside(path, ".tmp")?;
    serde_json::to_writer_pretty(&mut file, content)?;
    file.write_all(b"\n")?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// `calib.json` for the recording: what a careful experimenter would know. The time base is the file's own. That the camera is
/// pitched, that it wanders and that the ball comes nearer he does not know: the scale is that of the picture's middle.
#[must_use]
pub fn calibration(recording: &SimulatedRecording) -> Value {
    let scene = recording.scene();
    let camera = &scene.camera;
    let mut calib = Map::new();
    calib.insert("schema".into(), json!("track.calib/1"));
    let view = match camera.view {
        View::Side => "side",
        View::Top => "top",
    };
    calib.insert("view".into(), json!(view));
    calib.insert("image_size_px".into(), json!([camera.width_px, camera.height_px]));
    if camera.tilt_rad == 0.0 {
        calib.insert(
            "scale".into(),
            json!({"metres_per_pixel": camera.metres_per_pixel}),
        );
        calib.insert("origin_px".into(), json!(origin_px(recording)));
        let roll_rad = roll_rad(recording);
        if roll_rad != 0.0 {
            calib.insert("up_px".into(), json!([roll_rad.sin(), -roll_rad.cos()]));
        }
    } else {
        let h = world_from_pixel(recording);
        let rows = [0, 1, 2].map(|i| [h[(i, 0)], h[(i, 1)], h[(i, 2)]]);
        calib.insert("scale".into(), json!({"world_from_pixel": rows}));
    }
    if let Some(distance_m) = recording.distance_m() {
        calib.insert("distance_m".into(), json!(distance_m));
    }
    // Without perspective and distortion nothing of the lens is in the picture.
    let shows = recording.lens().is_some() || recording.distance_m().is_some();
    if let Some(lens) = camera.lens.filter(|_| shows) {
        // A distortion that was not worth simulating is not in the picture; the optical axis is where it is all the same.
        let distortion = recording.lens().map_or([0.0; 5], |used| used.distortion);
        calib.insert(
            "lens".into(),
            json!({"camera_matrix": lens.camera_matrix, "distortion": distortion}),
        );
    }
    if recording.uses("rolling_shutter") {
        calib.insert("camera".into(), json!({"readout_s": camera.readout_s}));
    }
    calib.insert("gravity_m_s2".into(), json!(scene.gravity_m_s2));
    let ball = &scene.ball;
    calib.insert(
        "ball".into(),
        json!({"radius_m": ball.radius_m, "mass_kg": ball.mass_kg, "inertia_factor": ball.inertia_factor}),
    );
    calib.insert(
        "launch".into(),
        json!({"edge_x_m": 0.0, "spin_ratio": spin_ratio(recording)}),
    );
    Value::Object(calib)
}

/// By how much the camera is rolled in the picture, rad.
fn roll_rad(recording: &SimulatedRecording) -> f64 {
    if recording.uses("camera_roll") {
        recording.scene().camera.roll_rad
    } else {
        0.0
    }
}

/// The homography of the calibrated plane seen by a turned camera: with d = x − x_m and h = z − z_m from the picture's
/// middle, the point is at (d cos τ, h)/q, times D/(D − d sin τ) where perspective is simulated, and
/// turned about the picture's middle where the camera is rolled.
fn world_from_pixel(recording: &SimulatedRecording) -> Matrix3<f64> {
    let camera = &recording.scene().camera;
    let (axis_m, axis_px) = (axis_m(camera), axis_px(camera));
    let (sin, cos) = camera.tilt_rad.sin_cos();
    let nearer = camera
        .distance_m
        .filter(|_| recording.uses("perspective"))
        .map_or(0.0, |distance_m| sin / distance_m);
    let from_middle = Matrix3::new(1.0, 0.0, -axis_m.x, 0.0, 1.0, -axis_m.y, 0.0, 0.0, 1.0);
    let q = camera.metres_per_pixel;
    let seen = Matrix3::new(cos / q, 0.0, 0.0, 0.0, -1.0 / q, 0.0, -nearer, 0.0, 1.0);
    let in_picture = Matrix3::new(1.0, 0.0, axis_px.x, 0.0, 1.0, axis_px.y, 0.0, 0.0, 1.0);
    // Never singular: |τ| is at most 80 degrees.
    let turned = rolled(roll_rad(recording)).to_homogeneous();
    let inverse = (in_picture * turned * seen * from_middle).try_inverse();
    let h = inverse.unwrap_or_else(Matrix3::identity);
    h / h[(2, 2)]
}

/// The world's origin as the picture shows it: a point of the calibrated plane, so that only lens and pitch move it.
fn origin_px(recording: &SimulatedRecording) -> [f64; 2] {
    let camera = &recording.scene().camera;
    let seen = recording.renderer().picture().outline(&origin_m(camera)).centre;
    [seen.u_px, seen.v_px]
}

/// R ω_oy / u_o at the first impact, where the air has slowed the ball and not its spin; of a ball that is only dropped 0 without spin, and
/// no number with it.
fn spin_ratio(recording: &SimulatedRecording) -> Option<f64> {
    let launch = &recording.scene().launch;
    let spin_m_s = launch.surface_spin_m_s.y;
    if launch.speed_m_s == 0.0 {
        return (spin_m_s == 0.0).then_some(0.0);
    }
    let of_impact = |i: &Impact| i.incident.surface_spin_m_s.y / i.incident.velocity_m_s.x;
    let impacts = recording.trajectory().impacts();
    let ratio = impacts.first().map(of_impact).filter(|r| r.is_finite());
    Some(ratio.unwrap_or(spin_m_s / launch.speed_m_s))
}
