//! Measurements for the tests of this module: a ball launched from an edge that bounces twice, with the noise that a
//! good recording has, and its less fortunate relatives.

use crate::frames::Luma;
use crate::geometry::{PixelPoint, WorldPoint};
use crate::impact::{
    AlongFloor, BenchLaunch, Bounce, BounceSurface, CentreVelocity, Correlation, Distances, FloorSlope,
    FloorSource, Readings, Speed, XSource,
};
use crate::pipeline::{
    ArcMotion, ArcSample, ArcTrace, CalibrationFacts, CameraSeen, Measurement, Outcome, PointUse,
    ShownMotion, Strobe, StrobeBall, TimeSource, Track, TrackPoint, UnusedReason, UpSource, UpTilt,
    VideoFacts, View, Warning,
};
use crate::quantity::Quantity;
use crate::rebound::model::BounceReading;
use crate::rebound::{ModelName, Parameter, Preferred, Regime};
use crate::test_noise::TestNoise;
use std::path::PathBuf;

const WIDTH: usize = 1280;
const HEIGHT: usize = 720;
const RATE_HZ: f64 = 240.0;
const METRES_PER_PIXEL: f64 = 0.0009;
const RADIUS_PX: f64 = 13.9;
const CENTRE_STD_PX: f64 = 0.05;
const G: f64 = 9.81;
const RESTITUTION: f64 = 0.78;
const FRICTION: f64 = 0.07;
const DROP_M: f64 = 0.30;
const LAUNCH_M_S: f64 = 1.3;
const INERTIA: f64 = 0.4;

/// A free flight: starts at `time_s`, `x_m`, `z_m` (of the centre above its lowest place) with these velocities.
#[derive(Clone, Copy)]
struct FreeFall {
    time_s: f64,
    end_s: f64,
    x_m: f64,
    z_m: f64,
    vx: f64,
    vz: f64,
    /// R ω_y.
    spin: f64,
}

impl FreeFall {
    fn at(&self, time_s: f64) -> (f64, f64) {
        let t = time_s - self.time_s;
        (self.x_m + self.vx * t, self.z_m + self.vz * t - 0.5 * G * t * t)
    }
}

/// Three flights with an impact between each.
fn flights() -> Vec<FreeFall> {
    let fall_s = (2.0 * DROP_M / G).sqrt();
    let mut flights = vec![FreeFall {
        time_s: 0.0125,
        end_s: 0.0125 + fall_s,
        x_m: 0.0,
        z_m: DROP_M,
        vx: LAUNCH_M_S,
        vz: 0.0,
        spin: 0.0,
    }];
    for _ in 0..2 {
        let last = flights[flights.len() - 1];
        let down = -(last.vz - G * (last.end_s - last.time_s));
        let up = RESTITUTION * down;
        // Friction at its limit, or what stops the slip, whichever is less: the second bounce leaves rolling.
        let slip = last.vx - last.spin;
        let impulse = (INERTIA / (1.0 + INERTIA) * slip).min(FRICTION * (1.0 + RESTITUTION) * down);
        flights.push(FreeFall {
            time_s: last.end_s,
            end_s: last.end_s + 2.0 * up / G,
            x_m: last.at(last.end_s).0,
            z_m: 0.0,
            vx: last.vx - impulse,
            vz: up,
            spin: last.spin + impulse / INERTIA,
        });
    }
    // The recording ends in the middle of the third flight.
    flights[2].end_s -= 0.12;
    flights
}

fn pixel(x_m: f64, z_m: f64) -> PixelPoint {
    PixelPoint::new(
        200.0 + x_m / METRES_PER_PIXEL,
        640.0 - RADIUS_PX - z_m / METRES_PER_PIXEL,
    )
}

fn q(value: f64, std: f64) -> Option<Quantity> {
    Quantity::new(value, std)
}

fn track_points() -> Vec<TrackPoint> {
    let mut noise = TestNoise(7);
    let flights = flights();
    let frames = (flights[2].end_s * RATE_HZ) as usize;
    (0..=frames)
        .map(|frame| {
            let time_s = frame as f64 / RATE_HZ;
            let arc = flights.iter().rposition(|f| time_s >= f.time_s).unwrap_or(0);
            let flight = flights[arc];
            let (x, z) = flight.at(time_s.max(flights[0].time_s));
            let contact = flights[1..]
                .iter()
                .any(|f| (f.time_s - time_s).abs() < 0.7 / RATE_HZ);
            let outlier = frame == 97;
            let (mut du, dv) = (CENTRE_STD_PX * noise.normal(), CENTRE_STD_PX * noise.normal());
            if outlier {
                du += 0.9;
            }
            let clean = pixel(x, z);
            let use_ = if time_s < flights[0].time_s {
                PointUse::Unused(UnusedReason::NotFree)
            } else if contact {
                PointUse::Unused(UnusedReason::Contact)
            } else if outlier {
                PointUse::Unused(UnusedReason::OffArc {
                    by_m: 0.9 * METRES_PER_PIXEL,
                })
            } else {
                PointUse::Used(arc)
            };
            let residual = WorldPoint {
                x_m: du * METRES_PER_PIXEL,
                up_m: -dv * METRES_PER_PIXEL,
            };
            TrackPoint {
                frame,
                time_s,
                pixel: PixelPoint::new(clean.u_px + du, clean.v_px + dv),
                std_px: Some(0.048),
                world: Some(WorldPoint {
                    x_m: x + residual.x_m,
                    up_m: z + RADIUS_PX * METRES_PER_PIXEL + residual.up_m,
                }),
                residual_m: (matches!(use_, PointUse::Used(_)) || outlier).then_some(residual),
                use_,
            }
        })
        .collect()
}

fn arcs() -> Vec<ArcTrace> {
    flights()
        .iter()
        .map(|flight| ArcTrace {
            samples: (0..=32)
                .map(|i| {
                    let time_s = flight.time_s + (flight.end_s - flight.time_s) * f64::from(i) / 32.0;
                    let (x_m, z_m) = flight.at(time_s);
                    ArcSample {
                        time_s,
                        pixel: pixel(x_m, z_m),
                        world: Some(WorldPoint {
                            x_m,
                            up_m: z_m + RADIUS_PX * METRES_PER_PIXEL,
                        }),
                    }
                })
                .collect(),
            spin: None,
            motion: ArcMotion {
                time_s: flight.time_s,
                place: WorldPoint {
                    x_m: flight.x_m,
                    up_m: flight.z_m + RADIUS_PX * METRES_PER_PIXEL,
                },
                vx_m_s: flight.vx,
                up_m_s: flight.vz,
            },
        })
        .collect()
}

fn bounces() -> Vec<Bounce> {
    let flights = flights();
    flights
        .windows(2)
        .map(|pair| {
            let (before, after) = (pair[0], pair[1]);
            let down = before.vz - G * (before.end_s - before.time_s);
            let sideways = |flight: &FreeFall| flight.vx - flight.spin;
            Bounce {
                surface: BounceSurface::Floor,
                time_s: q(after.time_s, 0.000_04),
                x_m: q(after.x_m, 0.000_31),
                incident: CentreVelocity {
                    vx_m_s: q(before.vx, 0.0012),
                    vz_m_s: q(down, 0.0029),
                    angle_rad: q(before.vx.atan2(-down), 0.000_61),
                },
                rebound: CentreVelocity {
                    vx_m_s: q(after.vx, 0.0011),
                    vz_m_s: q(after.vz, 0.0024),
                    angle_rad: q(after.vx.atan2(after.vz), 0.000_72),
                },
                restitution: q(RESTITUTION + 0.0004, 0.0013),
                tangential_ratio: q(after.vx / before.vx, 0.0016),
                slip: Some(Regime::Ordinary),
                friction: q((before.vx - after.vx) / (-down + after.vz), 0.000_38),
                friction_at_least: None,
                tangential_restitution: q(-sideways(&after) / sideways(&before), 0.0056),
                spin_in_m_s: q(before.spin, if before.spin == 0.0 { f64::NAN } else { 0.0041 }),
                spin_out_m_s: q(after.spin, 0.0041),
                measured_spin_in_m_s: None,
                measured_spin_out_m_s: None,
                spin_in_source: None,
                inertia_factor: None,
                azimuth_rad: None,
                correlations: vec![Correlation {
                    of: (Speed::IncidentVx, Speed::ReboundVx),
                    value: 0.4,
                }],
                along_floor: Some(AlongFloor {
                    incident_m_s: (q(before.vx, 0.0012), q(down, 0.0029)),
                    rebound_m_s: (q(after.vx, 0.0011), q(after.vz, 0.0024)),
                    correlations: Vec::new(),
                }),
                impossible: None,
            }
        })
        .collect()
}

/// The scene: a wall lit from the left with a lab bench below, and grain.
fn background() -> Luma {
    let mut noise = TestNoise(99);
    let mut data = Vec::with_capacity(WIDTH * HEIGHT);
    for v in 0..HEIGHT {
        for u in 0..WIDTH {
            let light = 96.0 - 36.0 * (u as f64 / WIDTH as f64);
            let grey = match v {
                640..645 => 150.0,
                645.. => 46.0,
                _ if u < 186 && v > 262 => 30.0,
                _ if (u / 160 + v / 160) % 2 == 0 => light + 4.0,
                _ => light,
            };
            data.push((grey + 1.2 * noise.normal()).clamp(0.0, 255.0) as u8);
        }
    }
    Luma {
        width: WIDTH,
        height: HEIGHT,
        data,
    }
}

fn ball_at(frame: usize, centre: PixelPoint) -> StrobeBall {
    let half = RADIUS_PX.ceil() as i64 + 4;
    let corner_px = (
        centre.u_px.round() as i64 - half,
        centre.v_px.round() as i64 - half,
    );
    let side = (2 * half + 1) as usize;
    let mut data = Vec::with_capacity(side * side);
    for row in 0..side {
        for column in 0..side {
            let du = (corner_px.0 + column as i64) as f64 - centre.u_px;
            let dv = (corner_px.1 + row as i64) as f64 - centre.v_px;
            let inside = (RADIUS_PX - du.hypot(dv) + 0.5).clamp(0.0, 1.0);
            let shade = 205.0 - 5.0 * (0.5 * du + 0.8 * dv);
            let light = (-((du + 5.0).powi(2) + (dv + 6.0).powi(2)) / 14.0).exp() * 70.0;
            data.push((inside * (shade + light) + (1.0 - inside) * 75.0).clamp(0.0, 255.0) as u8);
        }
    }
    StrobeBall {
        frame,
        corner_px,
        luma: Luma {
            width: side,
            height: side,
            data,
        },
        chroma: None,
        centre,
        radius_px: RADIUS_PX,
    }
}

/// A clean recording: launched to the right from an edge, two bounces, a third flight cut off.
pub fn two_bounces() -> Measurement {
    let points = track_points();
    let balls = points
        .iter()
        .filter(|p| matches!(p.use_, PointUse::Used(_)))
        .map(|p| ball_at(p.frame, p.pixel))
        .collect();
    let flights = flights();
    let bounces = bounces();
    Measurement {
        video: VideoFacts {
            sha256: Some("5e".repeat(32)),
            path: PathBuf::from("recordings/steel-on-ceramic <3> & \"co\".mp4"),
            width_px: WIDTH,
            height_px: HEIGHT,
            frames: points.len() as u64 + 4,
            frame_rate_hz: Some(RATE_HZ),
            duration_s: (points.len() + 3) as f64 / RATE_HZ,
            time_source: TimeSource::Stamps,
            camera: Some(CameraSeen {
                stands_still: true,
                shown_motion: ShownMotion::AllBut {
                    along: [1.0, 0.0].into(),
                },
            }),
        },
        calibration: CalibrationFacts {
            name: "calib/bench.calib.json".to_owned(),
            sha256: Some("ca".repeat(32)),
            metres_per_pixel: q(METRES_PER_PIXEL, 2e-6),
            origin_px: None,
            up_px: [0.0, -1.0],
            frame_rate_hz: None,
        },
        drag_per_m: q(0.01, 0.002),
        edits: None,
        view: View::Side,
        outcome: Outcome::Measured,
        gravity_m_s2: q(9.806, 0.011),
        up: q(0.0011, 0.000_35).map(|tilt_rad| UpTilt {
            tilt_rad,
            source: UpSource::Fall,
        }),
        floor: q(0.000_52, 0.000_17).map(|slope_rad| FloorSlope {
            slope_rad,
            source: FloorSource::Impacts,
        }),
        launch: Some(BenchLaunch {
            edge_x_m: q(0.0, 0.000_21),
            time_s: q(flights[0].time_s, 0.000_2),
            speed_m_s: q(LAUNCH_M_S, 0.0012),
            rolled_s: 0.15,
            drop_height_m: q(DROP_M, 0.000_4),
            gap_m: q(0.0, 0.000_02),
        }),
        distances: Distances {
            x0_m: q(flights[1].x_m, 0.000_31),
            x_m: q(flights[2].x_m - flights[1].x_m, 0.000_42),
            x_source: Some(XSource::Observed),
        },
        readings: Some(Readings {
            restitution: bounces[0].restitution,
            models: vec![
                (
                    ModelName::MuE,
                    BounceReading {
                        parameter: Parameter::Friction,
                        quantity: bounces[0].friction,
                        regime: Some(Regime::Sliding),
                    },
                ),
                (
                    ModelName::EE,
                    BounceReading {
                        parameter: Parameter::TangentialRestitution,
                        quantity: bounces[0].tangential_restitution,
                        regime: Some(Regime::Ordinary),
                    },
                ),
            ],
            compliant: None,
            preferred: Preferred::Model(ModelName::MuE),
        }),
        track: Track {
            method: "edge circle".to_owned(),
            detected: points.len(),
            centre_std_px: Some(CENTRE_STD_PX),
            radius_px: q(RADIUS_PX, 0.021),
            points,
        },
        bounces,
        warnings: vec![Warning {
            code: "dropped_frames",
            message: "2 frames are missing (at 0.512 s and 0.721 s): times come from the file's stamps, so the fit \
                      is not affected. If the recorder was set to a variable rate, fix it at 240 Hz."
                .to_owned(),
        }],
        arcs: arcs(),
        strobe: Some(Strobe {
            background: std::sync::Arc::new(background()),
            chroma: None,
            luma_shares: (0.299, 0.114),
            balls,
        }),
        launches: Vec::new(),
    }
}

/// Three launches in one recording, some seconds apart.
pub fn three_launches() -> Measurement {
    let launches: Vec<Measurement> = (0..3).map(|n| later(two_bounces(), n)).collect();
    let several = Warning {
        code: "several_launches",
        message: "the recording holds 3 launches".to_owned(),
    };
    Measurement {
        warnings: [vec![several], launches[0].warnings.clone()].concat(),
        launches: launches.clone(),
        ..launches[0].clone()
    }
}

/// `m` as the launch number `n`, 600 frames each after the one before.
fn later(mut m: Measurement, n: usize) -> Measurement {
    let frames = 600 * n;
    let seconds = frames as f64 / RATE_HZ;
    for p in &mut m.track.points {
        p.frame += frames;
        p.time_s += seconds;
    }
    for bounce in &mut m.bounces {
        bounce.time_s = bounce.time_s.map(|t| Quantity {
            value: t.value + seconds,
            ..t
        });
    }
    for sample in m.arcs.iter_mut().flat_map(|arc| &mut arc.samples) {
        sample.time_s += seconds;
    }
    for ball in &mut m.strobe.as_mut().unwrap().balls {
        ball.frame += frames;
    }
    m
}

/// The same to the left: every pixel mirrored, the world as before (x runs along the launch).
pub fn leftward() -> Measurement {
    let mut m = two_bounces();
    let mirror = |p: &mut PixelPoint| p.u_px = WIDTH as f64 - 1.0 - p.u_px;
    m.track.points.iter_mut().for_each(|p| mirror(&mut p.pixel));
    for sample in m.arcs.iter_mut().flat_map(|arc| &mut arc.samples) {
        mirror(&mut sample.pixel);
    }
    let strobe = m.strobe.as_mut().unwrap();
    for row in std::sync::Arc::make_mut(&mut strobe.background)
        .data
        .chunks_mut(WIDTH)
    {
        row.reverse();
    }
    for ball in &mut strobe.balls {
        *ball = ball_at(
            ball.frame,
            PixelPoint::new(WIDTH as f64 - 1.0 - ball.centre.u_px, ball.centre.v_px),
        );
    }
    m
}

/// A drop: the same heights and times, no way sideways.
pub fn vertical_drop() -> Measurement {
    let mut m = two_bounces();
    let steady = |p: &mut PixelPoint| p.u_px = 640.0;
    m.track.points.iter_mut().for_each(|p| steady(&mut p.pixel));
    for sample in m.arcs.iter_mut().flat_map(|arc| &mut arc.samples) {
        steady(&mut sample.pixel);
    }
    for ball in &mut m.strobe.as_mut().unwrap().balls {
        *ball = ball_at(ball.frame, PixelPoint::new(640.0, ball.centre.v_px));
    }
    m
}

/// A ball that a hand carries about.
pub fn rejected() -> Measurement {
    let mut m = two_bounces();
    m.video.path = PathBuf::from("ball-held-never-released.mp4");
    m.outcome = Outcome::Rejected {
        reason: "no free flight: the ball is seen in 180 frames, but nowhere does it fall for 5 frames in a row with \
                 a constant acceleration. Is the ball released within the clip, and is it in the picture then?"
            .to_owned(),
    };
    m.gravity_m_s2 = None;
    (m.up, m.floor, m.launch) = (None, None, None);
    m.bounces.clear();
    m.distances = Distances::default();
    m.readings = None;
    m.arcs.clear();
    m.strobe = None;
    m.track.centre_std_px = None;
    for point in &mut m.track.points {
        point.use_ = PointUse::Unused(UnusedReason::NotFree);
        point.residual_m = None;
    }
    m
}

/// Rejected before anything was seen.
pub fn nothing_seen() -> Measurement {
    let mut m = rejected();
    m.outcome = Outcome::Rejected {
        reason: "no ball: nothing round moves in this recording".to_owned(),
    };
    m.track.points.clear();
    m.track.detected = 0;
    m.track.radius_px = None;
    m.warnings.clear();
    m
}

/// Bounces without a scale: pixels, times and what needs neither metre.
pub fn no_scale() -> Measurement {
    let mut m = two_bounces();
    m.gravity_m_s2 = None;
    m.distances = Distances::default();
    for point in &mut m.track.points {
        point.world = None;
        point.residual_m = None;
    }
    for sample in m.arcs.iter_mut().flat_map(|arc| &mut arc.samples) {
        sample.world = None;
    }
    (m.floor, m.launch) = (None, None);
    for bounce in &mut m.bounces {
        bounce.x_m = None;
        bounce.along_floor = None;
        bounce.spin_in_m_s = None;
        bounce.spin_out_m_s = None;
        for leg in [&mut bounce.incident, &mut bounce.rebound] {
            leg.vx_m_s = None;
            leg.vz_m_s = None;
        }
    }
    m
}

/// From above: two straight lines that meet at an impact.
pub fn top_view() -> Measurement {
    let mut m = two_bounces();
    m.view = View::Top;
    m.gravity_m_s2 = None;
    (m.up, m.floor, m.launch) = (None, None, None);
    m.readings = None;
    m.distances = Distances::default();
    m.bounces.truncate(1);
    let bounce = &mut m.bounces[0];
    for leg in [&mut bounce.incident, &mut bounce.rebound] {
        leg.vz_m_s = None;
        leg.angle_rad = None;
    }
    bounce.restitution = None;
    bounce.friction = None;
    bounce.slip = None;
    bounce.along_floor = None;
    bounce.tangential_restitution = None;
    bounce.azimuth_rad = q(0.21, 0.004);
    m
}
