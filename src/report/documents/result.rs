//! `<stem>.result.json` and what `--json` prints: schema `track.result/1`.

use super::{OrderedObject, WarningDocument, degrees, quantity};
use crate::Build;
use crate::edits::Edits;
use crate::impact::compliant_reading::{CompliantReading, Foretold, FrictionSource};
use crate::impact::{
    AlongFloor, BenchLaunch, Bounce, CentreVelocity, Correlation, FloorSource, Readings, XSource,
};
use crate::pipeline::{
    ArcMotion, ArcSpin, ArcTrace, CalibrationFacts, CameraSeen, Measurement, Outcome, PointUse, ShownMotion,
    TimeSource, Track, TrackPoint, UpSource, VideoFacts, View,
};
use crate::quantity::Quantity;
use crate::rebound::ModelName;
use crate::report::words;
use schemars::JsonSchema;
use serde::Serialize;
use std::borrow::Cow;

/// The schema that [`ResultDocument`] follows.
pub const SCHEMA: &str = "track.result/1";

/// The result of one recording.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ResultDocument<'a> {
    /// `track.result/1`.
    pub schema: &'static str,
    /// The program that wrote it.
    #[serde(flatten)]
    pub build: Build,
    /// `measured` or `rejected`.
    pub status: &'static str,
    /// Why it was rejected.
    pub reason: Option<&'a str>,
    /// The recording as a file.
    pub video: VideoDocument<'a>,
    /// The calibration as it was used.
    pub calibration: CalibrationDocument<'a>,
    /// The ball in every frame where it was seen.
    pub track: TrackDocument<'a>,
    /// The fitted arcs of free flight.
    pub arcs: Vec<ArcDocument>,
    /// Drag of the arcs: the deceleration over the square of the speed.
    pub drag_per_m: Option<Quantity>,
    /// Magnitude of the acceleration in flight, m/s²; `null` where the scale itself comes from gravity.
    pub gravity_m_s2: Option<Quantity>,
    /// How far "up" is from where the calibration has it.
    pub up: Option<UpDocument>,
    /// The floor's slope.
    pub floor: Option<FloorDocument>,
    /// Where the ball left a bench that it was seen on.
    pub launch: Option<LaunchDocument>,
    /// The impacts on the floor, in time order.
    pub bounces: Vec<BounceDocument>,
    /// Launch edge to first impact, m.
    pub x0_m: Option<Quantity>,
    /// First to second impact, m.
    pub x_m: Option<Quantity>,
    /// `observed` or `extrapolated`.
    pub x_source: Option<&'static str>,
    /// What the models make of the first bounce.
    pub models: Option<ModelsDocument>,
    /// Where the recording holds several launches, each of them in time order; what stands above is then the first's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub launches: Vec<OneLaunchDocument<'a>>,
    /// What a person said of the recording, where the result was made with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edits: Option<&'a Edits>,
    /// What the user has to know.
    pub warnings: Vec<WarningDocument<'a>>,
}

/// One of several launches of a recording.
#[derive(Debug, Serialize, JsonSchema)]
pub struct OneLaunchDocument<'a> {
    /// When the ball was first seen in free flight.
    pub from_s: Option<f64>,
    /// When it was last.
    pub to_s: Option<f64>,
    /// The impacts on the floor, in time order.
    pub bounces: Vec<BounceDocument>,
    /// Launch edge to first impact, m.
    pub x0_m: Option<Quantity>,
    /// First to second impact, m.
    pub x_m: Option<Quantity>,
    /// `observed` or `extrapolated`.
    pub x_source: Option<&'static str>,
    /// Magnitude of the acceleration in flight, m/s²; `null` where the scale itself comes from gravity.
    pub gravity_m_s2: Option<Quantity>,
    /// What the models make of the first bounce.
    pub models: Option<ModelsDocument>,
    /// Where the ball left a bench that it was seen on.
    pub launch: Option<LaunchDocument>,
    /// How far "up" is from where the calibration has it.
    pub up: Option<UpDocument>,
    /// The floor's slope.
    pub floor: Option<FloorDocument>,
    /// The ball in every frame of the launch where it was seen.
    pub track: TrackDocument<'a>,
    /// The fitted arcs of free flight.
    pub arcs: Vec<ArcDocument>,
    /// Drag of the arcs: the deceleration over the square of the speed.
    pub drag_per_m: Option<Quantity>,
    /// What the user has to know of this launch.
    pub warnings: Vec<WarningDocument<'a>>,
}

/// A recording as a file.
#[derive(Debug, Serialize, JsonSchema)]
pub struct VideoDocument<'a> {
    /// As the user named it.
    pub path: Cow<'a, str>,
    /// SHA-256 of the file, as `sha256sum` tells it; of a folder, of its pictures' names and digests.
    pub sha256: Option<&'a str>,
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Frames read.
    pub frames: u64,
    /// Rate of distinct frames.
    pub frame_rate_hz: Option<f64>,
    /// Last time minus first.
    pub duration_s: f64,
    /// `stamps` (of the file) or `calibration` (its `frame_rate_hz`).
    pub time_source: &'static str,
    /// The camera, as far as the scene shows its motion; `null` where points were given and no picture.
    pub camera: Option<CameraDocument>,
}

/// What the scene shows of the camera's motion.
#[derive(Debug, Serialize, JsonSchema)]
pub struct CameraDocument {
    /// No motion is seen, but for swings.
    pub stands_still: bool,
    /// Which motions the scene is sure to show: `all`, `across` (any but those along `unseen_along_px`), or `none`.
    pub shown_motion: &'static str,
    /// The direction in the picture, columns and rows, along which it is not sure to.
    pub unseen_along_px: Option<[f64; 2]>,
}

/// The calibration as it was used.
#[derive(Debug, Serialize, JsonSchema)]
pub struct CalibrationDocument<'a> {
    /// As the user named it.
    pub path: &'a str,
    /// SHA-256 of the file, as `sha256sum` tells it.
    pub sha256: Option<&'a str>,
    /// Length of a pixel near the ball.
    pub metres_per_pixel: Option<Quantity>,
    /// The world's origin in the picture.
    pub origin_px: Option<[f64; 2]>,
    /// Direction of "up" in the picture.
    pub up_px: [f64; 2],
    /// The true capture rate, where the calibration gives it.
    pub frame_rate_hz: Option<f64>,
}

/// An arc of free flight: from its motion at one time, gravity ("gravity_m_s2", "up") and drag ("drag_per_m") its curve can be drawn again.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ArcDocument {
    /// First time: the impact before it, or its first point.
    pub from_s: f64,
    /// Last time: the impact after it, or its last point.
    pub to_s: f64,
    /// When the ball is there and so fast.
    pub time_s: f64,
    /// Along the launch.
    pub x_m: f64,
    /// Above the floor; `null` in a top view.
    pub z_m: Option<f64>,
    /// Along the launch.
    pub vx_m_s: f64,
    /// Up; `null` in a top view.
    pub vz_m_s: Option<f64>,
    /// Sideways; only in a top view.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_m: Option<f64>,
    /// Sideways; only in a top view.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vy_m_s: Option<f64>,
    /// How the ball turned, by the marks on it; `null` of a plain ball.
    pub spin: Option<ArcSpinDocument>,
}

/// How the ball turned on an arc.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ArcSpinDocument {
    /// In the plane of motion, positive where the top moves along x. All rates are `null` where several suit the pictures, or none.
    pub y_rad_s: Option<Quantity>,
    /// About x.
    pub x_rad_s: Option<Quantity>,
    /// About z.
    pub z_rad_s: Option<Quantity>,
    /// The rates about y that suit the pictures, where several do or none is stated; the most likely first.
    pub candidates_rad_s: Vec<f64>,
    /// Why there is no rate, or how it was told from the other candidates.
    pub reason: Option<String>,
}

/// The ball in the frames.
#[derive(Debug, Serialize, JsonSchema)]
pub struct TrackDocument<'a> {
    /// How centres were found.
    pub method: &'a str,
    /// Frames in which the ball was seen.
    pub detected: usize,
    /// Standard uncertainty of a centre, each coordinate.
    pub centre_std_px: Option<f64>,
    /// Radius of the ball.
    pub radius_px: Option<Quantity>,
    /// A point a frame.
    pub points: Vec<PointDocument>,
}

/// The ball in one frame.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PointDocument {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// Its time.
    pub time_s: f64,
    /// Column of the centre.
    pub u_px: f64,
    /// Row of the centre.
    pub v_px: f64,
    /// Along the launch.
    pub x_m: Option<f64>,
    /// Above the floor; `null` in a top view.
    pub z_m: Option<f64>,
    /// Whether an arc was fitted to it.
    pub used: bool,
    /// Standard uncertainty of the centre.
    pub std_px: Option<f64>,
    /// Number of its arc, from 0.
    pub arc: Option<usize>,
    /// Why it is not in use.
    pub reason: Option<String>,
    /// Sideways; only in a top view.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_m: Option<Option<f64>>,
}

/// The direction of "up" in use.
#[derive(Debug, Serialize, JsonSchema)]
pub struct UpDocument {
    /// From the calibration's "up", positive to the right in the picture.
    pub tilt_deg: Option<Quantity>,
    /// `calibration` or `fall`.
    pub source: &'static str,
}

/// The floor's slope along x.
#[derive(Debug, Serialize, JsonSchema)]
pub struct FloorDocument {
    /// Positive where the floor rises along the launch.
    pub slope_deg: Option<Quantity>,
    /// `impacts`, `calibration` or `assumed_level`.
    pub source: &'static str,
}

/// Where the ball left its bench.
#[derive(Debug, Serialize, JsonSchema)]
pub struct LaunchDocument {
    /// The edge along x.
    pub edge_x_m: Option<Quantity>,
    /// When the ball left it.
    pub time_s: Option<Quantity>,
    /// How fast.
    pub speed_m_s: Option<Quantity>,
    /// For how long it was seen on the bench.
    pub rolled_s: f64,
    /// Height of the launch above the first impact.
    pub drop_height_m: Option<Quantity>,
}

/// An impact on the floor.
#[derive(Debug, Serialize, JsonSchema)]
pub struct BounceDocument {
    /// When.
    pub time_s: Option<Quantity>,
    /// Where, along the launch.
    pub x_m: Option<Quantity>,
    /// Just before.
    pub incident: VelocityDocument,
    /// Just after.
    pub rebound: VelocityDocument,
    /// e.
    pub restitution: Option<Quantity>,
    /// Tangential velocity after over before.
    pub tangential_ratio: Option<Quantity>,
    /// What it is on: `floor` or `ceiling`, along which and whose normal everything but the velocities is told.
    pub surface: &'static str,
    /// What the contact point did: `sliding`, `nonsliding`, `grip` or `undetermined`.
    pub regime: &'static str,
    /// μ of a ball that slid.
    pub friction: Option<Quantity>,
    /// What μ is at least, of any other.
    pub friction_at_least: Option<Quantity>,
    /// e_x for the given or assumed spin before.
    pub tangential_restitution: Option<Quantity>,
    /// R ω before.
    pub spin_in_m_s: Option<Quantity>,
    /// R ω after.
    pub spin_out_m_s: Option<Quantity>,
    /// R ω before as the ball's marks show it.
    pub measured_spin_in_m_s: Option<Quantity>,
    /// R ω after as the ball's marks show it.
    pub measured_spin_out_m_s: Option<Quantity>,
    /// Where `spin_in_m_s` comes from: `measured`, `launch` (the calibration's) or `previous_bounce`.
    pub spin_in_source: Option<&'static str>,
    /// k of the ball, where both spins were measured: 0.4 of a solid one, 0.667 of a thin shell.
    pub inertia_factor: Option<Quantity>,
    /// Deviation of the rebound in the floor's plane; top view only.
    pub azimuth_deg: Option<Quantity>,
    /// Correlations of the errors of `incident` and `rebound`, by the names of a series' columns: `a__b`.
    pub correlations: OrderedObject<String, f64>,
    /// The velocities along the floor and its normal.
    pub along_floor: Option<AlongFloorDocument>,
}

/// A velocity of the ball's centre.
#[derive(Debug, Serialize, JsonSchema)]
pub struct VelocityDocument {
    /// Along the launch.
    pub vx_m_s: Option<Quantity>,
    /// Up.
    pub vz_m_s: Option<Quantity>,
    /// From the floor's normal.
    pub angle_deg: Option<Quantity>,
}

/// The velocities of an impact along the floor and its normal.
#[derive(Debug, Serialize, JsonSchema)]
pub struct AlongFloorDocument {
    /// Along the floor, before.
    pub incident_tangential_m_s: Option<Quantity>,
    /// Away from the floor, before.
    pub incident_normal_m_s: Option<Quantity>,
    /// Along the floor, after.
    pub rebound_tangential_m_s: Option<Quantity>,
    /// Away from the floor, after.
    pub rebound_normal_m_s: Option<Quantity>,
    /// Correlations of their errors, as those of the bounce.
    pub correlations: OrderedObject<String, f64>,
}

/// What the models of a single bounce give.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ModelsDocument {
    /// Coulomb friction.
    pub mu_e: MuEDocument,
    /// Restitution sideways, too.
    pub e_e: EEDocument,
    /// A contact that gives way sideways, where the calibration says what ball and floor are made of.
    pub compliant: Option<CompliantDocument>,
    /// `mu_e`, `e_e` or `undetermined`.
    pub preferred: &'static str,
}

/// A bounce by the μ-e model.
#[derive(Debug, Serialize, JsonSchema)]
pub struct MuEDocument {
    /// e.
    pub restitution: Option<Quantity>,
    /// μ.
    pub friction: Option<Quantity>,
    /// `sliding`, `nonsliding` or `undetermined`.
    pub regime: &'static str,
}

/// A bounce by the e-e model.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EEDocument {
    /// e.
    pub restitution: Option<Quantity>,
    /// e_x.
    pub tangential_restitution: Option<Quantity>,
    /// `ordinary`, `nonsliding`, `grip` or `undetermined`.
    pub regime: &'static str,
}

/// What the compliant model makes of a bounce, beside what was measured.
#[derive(Debug, Serialize, JsonSchema)]
pub struct CompliantDocument {
    /// e.
    pub restitution: Option<Quantity>,
    /// μ.
    pub friction: Option<Quantity>,
    /// `other_bounces` of the recording, which foretell this one, or `this_bounce`, whose μ suits itself.
    pub friction_source: &'static str,
    /// κ, from the materials.
    pub stiffness_ratio: f64,
    /// ψ₁ = κ slip / (μ normal speed).
    pub incidence: Option<Quantity>,
    /// `sliding`, `slip_stick_slip`, `stick_slip` or `undetermined`.
    pub regime: &'static str,
    /// What the model foretells.
    pub predicted: ForetoldDocument<Quantity>,
    /// Measured less foretold, in standard uncertainties of the difference.
    pub off_sigmas: ForetoldDocument<f64>,
}

/// A number for each thing that a model foretells of a rebound.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ForetoldDocument<T> {
    /// e_x.
    pub tangential_restitution: Option<T>,
    /// Along the floor, as `along_floor`.
    pub rebound_tangential_m_s: Option<T>,
    /// R ω_y after.
    pub spin_out_m_s: Option<T>,
}

impl<'a> ResultDocument<'a> {
    /// The result of a measurement.
    #[must_use]
    pub fn new(measurement: &'a Measurement) -> Self {
        let (status, reason) = match &measurement.outcome {
            Outcome::Measured => ("measured", None),
            Outcome::Rejected { reason } => ("rejected", Some(reason.as_str())),
        };
        let first = one_launch(measurement);
        Self {
            schema: SCHEMA,
            build: Build::THIS,
            status,
            reason,
            video: video(&measurement.video),
            calibration: calibration(&measurement.calibration),
            track: first.track,
            arcs: first.arcs,
            drag_per_m: first.drag_per_m,
            gravity_m_s2: first.gravity_m_s2,
            up: first.up,
            floor: first.floor,
            launch: first.launch,
            bounces: first.bounces,
            x0_m: first.x0_m,
            x_m: first.x_m,
            x_source: first.x_source,
            models: first.models,
            launches: measurement.launches.iter().map(one_launch).collect(),
            edits: measurement.edits.as_ref(),
            warnings: first.warnings,
        }
    }
}

fn one_launch(measurement: &Measurement) -> OneLaunchDocument<'_> {
    let seen = measurement.time_span();
    let warnings = measurement.warnings.iter().map(|warning| WarningDocument {
        code: warning.code,
        message: &warning.message,
    });
    OneLaunchDocument {
        from_s: seen.map(|(from, _)| from),
        to_s: seen.map(|(_, to)| to),
        bounces: measurement.bounces.iter().map(bounce).collect(),
        x0_m: quantity(measurement.distances.x0_m),
        x_m: quantity(measurement.distances.x_m),
        x_source: measurement.distances.x_source.map(|source| match source {
            XSource::Observed => "observed",
            XSource::Extrapolated => "extrapolated",
        }),
        gravity_m_s2: quantity(measurement.gravity_m_s2),
        models: measurement.readings.as_ref().map(models),
        launch: measurement.launch.as_ref().map(launch),
        up: measurement.up.map(|up| UpDocument {
            tilt_deg: degrees(Some(up.tilt_rad)),
            source: match up.source {
                UpSource::Calibration => "calibration",
                UpSource::Fall => "fall",
            },
        }),
        floor: measurement.floor.map(|floor| FloorDocument {
            slope_deg: degrees(Some(floor.slope_rad)),
            source: match floor.source {
                FloorSource::Impacts => "impacts",
                FloorSource::Calibration => "calibration",
                FloorSource::Level => "assumed_level",
            },
        }),
        track: track(&measurement.track, measurement.view),
        arcs: measurement
            .arcs
            .iter()
            .filter_map(|a| arc(a, measurement.view))
            .collect(),
        drag_per_m: quantity(measurement.drag_per_m),
        warnings: warnings.collect(),
    }
}

fn video(video: &VideoFacts) -> VideoDocument<'_> {
    VideoDocument {
        path: video.path.to_string_lossy(),
        sha256: video.sha256.as_deref(),
        width_px: video.width_px,
        height_px: video.height_px,
        frames: video.frames,
        frame_rate_hz: video.frame_rate_hz,
        duration_s: video.duration_s,
        time_source: match video.time_source {
            TimeSource::Stamps => "stamps",
            TimeSource::Calibration => "calibration",
        },
        camera: video.camera.as_ref().map(camera),
    }
}

fn camera(seen: &CameraSeen) -> CameraDocument {
    let (shown_motion, unseen_along_px) = match seen.shown_motion {
        ShownMotion::All => ("all", None),
        ShownMotion::AllBut { along } => ("across", Some(along.into())),
        ShownMotion::None => ("none", None),
    };
    CameraDocument {
        stands_still: seen.stands_still,
        shown_motion,
        unseen_along_px,
    }
}

fn calibration(facts: &CalibrationFacts) -> CalibrationDocument<'_> {
    CalibrationDocument {
        path: &facts.name,
        sha256: facts.sha256.as_deref(),
        metres_per_pixel: quantity(facts.metres_per_pixel),
        origin_px: facts.origin_px.map(|p| [p.u_px, p.v_px]),
        up_px: facts.up_px,
        frame_rate_hz: facts.frame_rate_hz,
    }
}

fn arc(arc: &ArcTrace, view: View) -> Option<ArcDocument> {
    let ArcMotion {
        time_s,
        place,
        vx_m_s,
        up_m_s,
    } = arc.motion;
    let (side, top) = (view == View::Side, view == View::Top);
    Some(ArcDocument {
        from_s: arc.samples.first()?.time_s,
        to_s: arc.samples.last()?.time_s,
        time_s,
        x_m: place.x_m,
        z_m: side.then_some(place.up_m),
        vx_m_s,
        vz_m_s: side.then_some(up_m_s),
        y_m: top.then_some(place.up_m),
        vy_m_s: top.then_some(up_m_s),
        spin: arc.spin.as_ref().map(arc_spin),
    })
}

fn arc_spin(spin: &ArcSpin) -> ArcSpinDocument {
    let about = |axis: usize| quantity(spin.rate_rad_s.map(|rate| rate[axis]));
    ArcSpinDocument {
        y_rad_s: about(1),
        x_rad_s: about(0),
        z_rad_s: about(2),
        candidates_rad_s: spin.candidates_rad_s.clone(),
        reason: spin.reason.clone(),
    }
}

fn track(track: &Track, view: View) -> TrackDocument<'_> {
    TrackDocument {
        method: &track.method,
        detected: track.detected,
        centre_std_px: track.centre_std_px,
        radius_px: quantity(track.radius_px),
        points: track.points.iter().map(|p| point(p, view)).collect(),
    }
}

fn point(point: &TrackPoint, view: View) -> PointDocument {
    let up_m = point.world.map(|world| world.up_m);
    let (arc, reason) = match &point.use_ {
        PointUse::Used(arc) => (Some(*arc), None),
        PointUse::Unused(reason) => (None, Some(reason.to_string())),
    };
    PointDocument {
        frame: point.frame,
        time_s: point.time_s,
        u_px: point.pixel.u_px,
        v_px: point.pixel.v_px,
        x_m: point.world.map(|world| world.x_m),
        z_m: up_m.filter(|_| view == View::Side),
        used: arc.is_some(),
        std_px: point.std_px,
        arc,
        reason,
        y_m: (view == View::Top).then_some(up_m),
    }
}

fn launch(launch: &BenchLaunch) -> LaunchDocument {
    LaunchDocument {
        edge_x_m: quantity(launch.edge_x_m),
        time_s: quantity(launch.time_s),
        speed_m_s: quantity(launch.speed_m_s),
        rolled_s: launch.rolled_s,
        drop_height_m: quantity(launch.drop_height_m),
    }
}

fn bounce(bounce: &Bounce) -> BounceDocument {
    BounceDocument {
        time_s: quantity(bounce.time_s),
        x_m: quantity(bounce.x_m),
        incident: velocity(&bounce.incident),
        rebound: velocity(&bounce.rebound),
        restitution: quantity(bounce.restitution),
        tangential_ratio: quantity(bounce.tangential_ratio),
        surface: bounce.surface.name(),
        regime: words::slip(bounce.slip),
        friction: quantity(bounce.friction),
        friction_at_least: quantity(bounce.friction_at_least),
        tangential_restitution: quantity(bounce.tangential_restitution),
        spin_in_m_s: quantity(bounce.spin_in_m_s),
        spin_out_m_s: quantity(bounce.spin_out_m_s),
        measured_spin_in_m_s: quantity(bounce.measured_spin_in_m_s),
        measured_spin_out_m_s: quantity(bounce.measured_spin_out_m_s),
        spin_in_source: bounce.spin_in_source.map(words::spin_source),
        inertia_factor: quantity(bounce.inertia_factor),
        azimuth_deg: degrees(bounce.azimuth_rad),
        correlations: correlations(&bounce.correlations),
        along_floor: bounce.along_floor.as_ref().map(along_floor),
    }
}

fn velocity(velocity: &CentreVelocity) -> VelocityDocument {
    VelocityDocument {
        vx_m_s: quantity(velocity.vx_m_s),
        vz_m_s: quantity(velocity.vz_m_s),
        angle_deg: degrees(velocity.angle_rad),
    }
}

fn along_floor(v: &AlongFloor) -> AlongFloorDocument {
    AlongFloorDocument {
        incident_tangential_m_s: quantity(v.incident_m_s.0),
        incident_normal_m_s: quantity(v.incident_m_s.1),
        rebound_tangential_m_s: quantity(v.rebound_m_s.0),
        rebound_normal_m_s: quantity(v.rebound_m_s.1),
        correlations: correlations(&v.correlations),
    }
}

/// An entry a pair of velocities, by the name that it has in a series.
fn correlations(all: &[Correlation]) -> OrderedObject<String, f64> {
    all.iter()
        .map(|c| (format!("{}__{}", c.of.0.name(), c.of.1.name()), c.value))
        .collect()
}

fn compliant(reading: &CompliantReading, restitution: Option<Quantity>) -> CompliantDocument {
    let predicted = |foretold: &Foretold| quantity(foretold.predicted);
    CompliantDocument {
        restitution,
        friction: quantity(reading.friction),
        friction_source: match reading.source {
            FrictionSource::OtherBounces => "other_bounces",
            FrictionSource::ThisBounce => "this_bounce",
        },
        stiffness_ratio: reading.stiffness_ratio,
        incidence: quantity(reading.incidence),
        regime: words::regime_name(reading.regime),
        predicted: ForetoldDocument {
            tangential_restitution: predicted(&reading.tangential_restitution),
            rebound_tangential_m_s: predicted(&reading.tangential_m_s),
            spin_out_m_s: predicted(&reading.spin_out_m_s),
        },
        off_sigmas: ForetoldDocument {
            tangential_restitution: reading.tangential_restitution.sigmas(),
            rebound_tangential_m_s: reading.tangential_m_s.sigmas(),
            spin_out_m_s: reading.spin_out_m_s.sigmas(),
        },
    }
}

/// The models that the file's schema names; others are not read from a single bounce.
fn models(readings: &Readings) -> ModelsDocument {
    let own = |name| readings.of(name).and_then(|reading| quantity(reading.quantity));
    let regime = |name| words::regime_name(readings.of(name).and_then(|reading| reading.regime));
    let restitution = quantity(readings.restitution);
    ModelsDocument {
        mu_e: MuEDocument {
            restitution,
            friction: own(ModelName::MuE),
            regime: regime(ModelName::MuE),
        },
        e_e: EEDocument {
            restitution,
            tangential_restitution: own(ModelName::EE),
            regime: regime(ModelName::EE),
        },
        compliant: readings
            .compliant
            .as_ref()
            .map(|reading| compliant(reading, restitution)),
        preferred: readings.preferred.name(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;
    use serde_json::{Value, json};

    fn result_json(measurement: &Measurement) -> Value {
        serde_json::to_value(ResultDocument::new(measurement)).unwrap()
    }

    fn keys(value: &Value) -> Vec<&str> {
        value.as_object().unwrap().keys().map(String::as_str).collect()
    }

    #[test]
    fn every_key_of_the_contract_is_there_in_its_order() {
        let result = result_json(&test_measurements::two_bounces());
        assert_eq!(
            keys(&result),
            [
                "schema",
                "version",
                "commit",
                "status",
                "reason",
                "video",
                "calibration",
                "track",
                "arcs",
                "drag_per_m",
                "gravity_m_s2",
                "up",
                "floor",
                "launch",
                "bounces",
                "x0_m",
                "x_m",
                "x_source",
                "models",
                "warnings"
            ]
        );
        assert_eq!(
            keys(&result["video"]),
            [
                "path",
                "sha256",
                "width_px",
                "height_px",
                "frames",
                "frame_rate_hz",
                "duration_s",
                "time_source",
                "camera"
            ]
        );
        assert_eq!(
            keys(&result["calibration"]),
            [
                "path",
                "sha256",
                "metres_per_pixel",
                "origin_px",
                "up_px",
                "frame_rate_hz"
            ]
        );
        assert_eq!(
            keys(&result["arcs"][0]),
            [
                "from_s", "to_s", "time_s", "x_m", "z_m", "vx_m_s", "vz_m_s", "spin"
            ]
        );
        assert_eq!(
            keys(&result["track"]),
            ["method", "detected", "centre_std_px", "radius_px", "points"]
        );
        assert_eq!(
            keys(&result["track"]["points"][0])[..7],
            ["frame", "time_s", "u_px", "v_px", "x_m", "z_m", "used"]
        );
        assert_eq!(
            keys(&result["bounces"][0]),
            [
                "time_s",
                "x_m",
                "incident",
                "rebound",
                "restitution",
                "tangential_ratio",
                "surface",
                "regime",
                "friction",
                "friction_at_least",
                "tangential_restitution",
                "spin_in_m_s",
                "spin_out_m_s",
                "measured_spin_in_m_s",
                "measured_spin_out_m_s",
                "spin_in_source",
                "inertia_factor",
                "azimuth_deg",
                "correlations",
                "along_floor"
            ]
        );
        assert_eq!(keys(&result["floor"]), ["slope_deg", "source"]);
        assert_eq!(keys(&result["up"]), ["tilt_deg", "source"]);
        assert_eq!(
            keys(&result["launch"]),
            ["edge_x_m", "time_s", "speed_m_s", "rolled_s", "drop_height_m"]
        );
        for leg in ["incident", "rebound"] {
            assert_eq!(
                keys(&result["bounces"][0][leg]),
                ["vx_m_s", "vz_m_s", "angle_deg"]
            );
        }
        assert_eq!(keys(&result["models"]), ["mu_e", "e_e", "compliant", "preferred"]);
        assert_eq!(
            keys(&result["models"]["mu_e"]),
            ["restitution", "friction", "regime"]
        );
        assert_eq!(
            keys(&result["models"]["e_e"]),
            ["restitution", "tangential_restitution", "regime"]
        );
        assert_eq!(keys(&result["warnings"][0]), ["code", "message"]);
        assert_eq!(keys(&result["x0_m"]), ["value", "std_uncertainty"]);
        assert_eq!(result["schema"], "track.result/1");
        assert_eq!(result["version"], Build::THIS.version);
        assert_eq!(result["commit"], Build::THIS.commit);
    }

    #[test]
    fn angles_are_degrees_and_points_are_all_there() {
        let measurement = test_measurements::two_bounces();
        let result = result_json(&measurement);
        let radians = measurement.bounces[0].incident.angle_rad.unwrap();
        let degrees = &result["bounces"][0]["incident"]["angle_deg"];
        assert!((degrees["value"].as_f64().unwrap() - radians.value * 57.295_779_513).abs() < 1e-9);
        let points = result["track"]["points"].as_array().unwrap();
        assert_eq!(points.len(), measurement.track.points.len());
        for (row, point) in points.iter().zip(&measurement.track.points) {
            let used = matches!(point.use_, PointUse::Used(_));
            assert_eq!(row["used"], used);
            assert_eq!(row["reason"].is_null(), used);
            assert_eq!(row["arc"].is_null(), !used);
        }
    }

    #[test]
    fn a_rejected_recording_says_why_and_has_no_models() {
        let result = result_json(&test_measurements::rejected());
        assert_eq!(result["status"], "rejected");
        assert!(result["reason"].as_str().unwrap().contains("no free flight"));
        assert!(result["models"].is_null());
        assert!(result["x_source"].is_null());
        assert_eq!(result["bounces"], json!([]));
    }

    #[test]
    fn several_launches_stand_each_by_itself() {
        let measurement = test_measurements::three_launches();
        let result = result_json(&measurement);
        let launches = result["launches"].as_array().unwrap();
        assert_eq!(launches.len(), 3);
        assert_eq!(
            keys(&launches[0])[..9],
            [
                "from_s",
                "to_s",
                "bounces",
                "x0_m",
                "x_m",
                "x_source",
                "gravity_m_s2",
                "models",
                "launch"
            ]
        );
        for key in ["bounces", "x0_m", "gravity_m_s2", "models", "track"] {
            assert_eq!(result[key], launches[0][key], "{key}");
        }
        let from = |i: usize| launches[i]["from_s"].as_f64().unwrap();
        assert!(from(0) < from(1) && from(1) < from(2));
    }

    #[test]
    fn a_top_view_has_y_and_no_z() {
        let measurement = test_measurements::top_view();
        let result = result_json(&measurement);
        let row = &result["track"]["points"][0];
        assert!(row["z_m"].is_null());
        assert_eq!(row["y_m"], measurement.track.points[0].world.unwrap().up_m);
        assert!(result["bounces"][0]["incident"]["vz_m_s"].is_null());
        assert!(result["bounces"][0]["azimuth_deg"]["value"].is_number());
        assert!(
            result_json(&test_measurements::two_bounces())["track"]["points"][0]
                .get("y_m")
                .is_none()
        );
    }

    #[test]
    fn what_is_not_finite_is_null_and_no_uncertainty_is_zero() {
        let mut measurement = test_measurements::two_bounces();
        measurement.gravity_m_s2 = Some(Quantity {
            value: f64::NAN,
            std_uncertainty: Some(0.1),
        });
        measurement.distances.x0_m = Some(Quantity {
            value: 0.2,
            std_uncertainty: Some(0.0),
        });
        measurement.track.points[3].std_px = Some(f64::INFINITY);
        let result = result_json(&measurement);
        assert!(result["gravity_m_s2"].is_null());
        assert!(result["x0_m"]["std_uncertainty"].is_null());
        assert!(result["track"]["points"][3]["std_px"].is_null());
        let text = serde_json::to_string_pretty(&result).unwrap();
        assert!(!text.contains("NaN") && !text.contains("inf"));
        let back: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["bounces"].as_array().unwrap().len(), 2);
    }
}
