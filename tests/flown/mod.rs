//! Flights made of formulas, as the finder of spots would give them: no picture, so that what is asked is the arithmetic
//! from centres to physics alone.

use crate::noise::Noise;
use track::calibration::{Calibration, Floor, MetresPerPixel, Scale};
use track::flight::extra_variance::ExtraVariance;
use track::flight::linking::{LinkedSpots, Spot};
use track::flight::motion_model::{FitPoint, MotionModel, VerticalPrior};
use track::flight::segment::TrackSample;
use track::flight::side_view::SideView;
use track::flight::{self, Flight, FlightPoint, NoFlight, SpotUse};
use track::frames::Coded;
use track::geometry::PixelPoint;
use track::impact::from_flight::ImagingErrors;
use track::impact::motion::MeasuredMotion;
use track::impact::reading;
use track::impact::spin_lift::SpinLift;
use track::impact::{Bounce, Distances, Readings};
use track::quantity::Quantity;
use track::rebound::{RigidMotion, SOLID_SPHERE};

pub const G: f64 = 9.81;

/// Half of a hard ball's contact, s, as `bounce` assumes where ball and floor are not known: so much passes from the touch to
/// the deepest point, and again (longer after a slow rebound) to the release.
const TOUCH_S: f64 = 3.5e-5;

/// One bounce, filmed.
#[derive(Debug, Clone, Copy)]
pub struct Film {
    /// Just before and just after; x along the launch.
    pub before: RigidMotion,
    pub after: RigidMotion,
    pub inertia_factor: f64,
    /// R ω_oy / u_o as the calibration says it; `None`: not known.
    pub spin_ratio: Option<f64>,
    pub rate_hz: f64,
    /// Of the first frame, s.
    pub start_s: f64,
    /// The impact's time after the first frame, s; the last frame is at most as long after it.
    pub fall_s: f64,
    pub metres_per_px: f64,
    /// Noise of a centre, px; stated as such, never below 1e-6.
    pub noise_px: f64,
    /// Where the ball hits in the picture.
    pub hit_px: [f64; 2],
    /// The world's origin in the picture; the launch edge is there, too.
    pub origin_px: [f64; 2],
    /// "Up" in the picture, from its own up towards the right, rad; it goes with `up_px`.
    pub tilt_rad: f64,
    /// Flies to the left in the picture.
    pub left: bool,
    pub seed: u64,
}

impl Film {
    /// 240 Hz and 0.8 mm a pixel (a small fall is filmed faster and from nearer), centres to 0.02 px.
    pub fn new(before: RigidMotion, after: RigidMotion, spin_ratio: Option<f64>) -> Self {
        let speed = before.velocity_m_s.z.abs();
        // Free flight from the floor or above: no longer than the whole arc that ends at this speed.
        let fall_s = (1.7 * speed / G).min(0.16);
        // As near and as fast as it takes to see it: a fall of 100 px, in 36 frames.
        let height_m = (speed - 0.5 * G * fall_s) * fall_s;
        Self {
            before,
            after,
            inertia_factor: SOLID_SPHERE,
            spin_ratio,
            rate_hz: (36.0 / fall_s).max(240.0),
            start_s: 0.0,
            fall_s,
            metres_per_px: (0.01 * height_m).min(0.0008),
            noise_px: 0.02,
            hit_px: [600.0, 650.0],
            origin_px: [600.0, 650.0],
            tilt_rad: 0.0,
            left: false,
            seed: 1,
        }
    }

    pub fn calibration(&self) -> Calibration {
        let mut c = Calibration::new(Scale::MetresPerPixel(MetresPerPixel {
            value: self.metres_per_px,
            std: Some(1e-9 * self.metres_per_px),
        }))
        .with_origin(PixelPoint::new(self.origin_px[0], self.origin_px[1]));
        c.up_px = [self.tilt_rad.sin(), -self.tilt_rad.cos()];
        // One impact tells no slope: what is asked here is not how level a bench is.
        (c.up_given, c.up_std_rad) = (true, Some(1e-7));
        c.floor = Floor {
            std_rad: 1e-7,
            given: true,
            ..Floor::default()
        };
        c.ball.inertia_factor = self.inertia_factor;
        c.launch.spin_ratio = self.spin_ratio;
        c.launch.edge_x_m = None;
        c
    }

    /// x of the place of the impact in the world, m.
    pub fn hit_x_m(&self) -> f64 {
        let (du, dv) = (
            self.hit_px[0] - self.origin_px[0],
            self.hit_px[1] - self.origin_px[1],
        );
        let (sin, cos) = self.tilt_rad.sin_cos();
        let right = du * cos + dv * sin;
        self.metres_per_px * if self.left { -right } else { right }
    }

    /// Place in the world at `t` after the first frame: x from the place of the impact, z above the touching height, m.
    fn place_m(&self, t: f64) -> (f64, f64) {
        let (v, w) = (self.before.velocity_m_s, self.after.velocity_m_s);
        let since = t - self.fall_s;
        // As slow a rebound as this takes longer to let go.
        let slower = (v.z.abs() / w.z).clamp(1.0, 2.0);
        let contact_s = TOUCH_S * (1.0 + slower);
        if since <= 0.0 {
            return (v.x * since, (v.z - 0.5 * G * since) * since);
        }
        let free = since - contact_s;
        let pushed = TOUCH_S * (v.x + slower * w.x);
        if free <= 0.0 {
            return (pushed * since / contact_s, 0.0);
        }
        // What does not rise stays on the floor.
        let up = ((w.z - 0.5 * G * free) * free).max(0.0);
        (pushed + w.x * free, up)
    }

    /// The ball in every frame, through the calibration.
    pub fn spots(&self) -> Vec<Spot> {
        let calibration = self.calibration();
        let map = calibration.rectification().unwrap();
        let mut noise = Noise(self.seed);
        let back = 2.0 * self.after.velocity_m_s.z / G;
        let end = self.fall_s
            + if back > 0.0 {
                (0.9 * back).min(self.fall_s.max(0.16))
            } else {
                0.16
            };
        let frames = (end * self.rate_hz).floor() as usize + 1;
        let radius_px = 15.0;
        (0..frames)
            .map(|frame| {
                let t = frame as f64 / self.rate_hz;
                let (x, z) = self.place_m(t);
                let (right, up) = (
                    if self.left { -x } else { x } / self.metres_per_px,
                    z / self.metres_per_px,
                );
                let (sin, cos) = self.tilt_rad.sin_cos();
                let pixel = PixelPoint::new(
                    self.hit_px[0] + right * cos + up * sin + self.noise_px * noise.normal(),
                    self.hit_px[1] + right * sin - up * cos + self.noise_px * noise.normal(),
                );
                Spot {
                    id: frame,
                    frame,
                    time_s: self.start_s + t,
                    place: map.plane_from_pixel(pixel).unwrap(),
                    std: self.noise_px.max(1e-6),
                    coded: Coded::Whole,
                    radius: radius_px,
                    contrast_grey: 120.0,
                }
            })
            .collect()
    }

    /// What the whole numeric layer makes of it, from unsorted spots on.
    pub fn measured(&self) -> Result<Measured, NoFlight> {
        measured(&self.spots(), &self.calibration(), self.metres_per_px)
    }

    /// The same where it is known which spot belongs to which arc; `None` where the spots do not determine the arcs.
    pub fn fitted(&self) -> Option<Measured> {
        let end = self.start_s + self.fall_s;
        let used: Vec<(usize, Spot)> = self
            .spots()
            .into_iter()
            .filter_map(|s| match s.time_s - end {
                t if t <= 0.0 => Some((0, s)),
                // Twice the longest contact, so that no spot of it counts as flight.
                t if t >= 6.0 * TOUCH_S => Some((1, s)),
                _ => None,
            })
            .collect();
        let points: Vec<FitPoint> = used
            .iter()
            .map(|&(arc, s)| FitPoint {
                arc,
                sample: TrackSample::of_spot(&s, 1.0 / (s.std * s.std)),
            })
            .collect();
        let fit = SideView::new(VerticalPrior::LEVEL_CAMERA).fit(&points, 2)?;
        let span = |arc| {
            let times = || used.iter().filter(|u| u.0 == arc).map(|u| u.1.time_s);
            (
                times().fold(f64::INFINITY, f64::min),
                times().fold(f64::NEG_INFINITY, f64::max),
            )
        };
        let flight = Flight {
            launch: None,
            spans: vec![span(0), span(1)],
            impacts: vec![fit.impact_time(fit.parameters.as_slice(), 0)],
            fit,
            extra: ExtraVariance::default(),
            interval_s: 1.0 / self.rate_hz,
            points: used
                .into_iter()
                .map(|(arc, spot)| FlightPoint {
                    spot,
                    use_: SpotUse::Used(arc),
                })
                .collect(),
        };
        Some(of_flight(flight, &self.calibration(), self.metres_per_px))
    }
}

/// Plane units are pixels; the common error is what a camera's centres would have.
const IMAGING: ImagingErrors = ImagingErrors {
    units_per_px: 1.0,
    common_std_px: 0.03,
    places_std_px: 0.01,
    steady: true,
};

/// What the numeric layer makes of spots.
#[derive(Debug, Clone)]
pub struct Measured {
    pub flight: Flight,
    pub gravity_m_s2: Option<Quantity>,
    pub bounces: Vec<Bounce>,
    pub distances: Distances,
    pub readings: Option<Readings>,
}

pub fn measured(
    spots: &[Spot],
    calibration: &Calibration,
    metres_per_unit: f64,
) -> Result<Measured, NoFlight> {
    let flight = flight::find(
        &LinkedSpots::new(spots.to_vec()),
        &SideView::new(VerticalPrior::LEVEL_CAMERA),
    )?;
    Ok(of_flight(flight, calibration, metres_per_unit))
}

fn of_flight(flight: Flight, calibration: &Calibration, metres_per_unit: f64) -> Measured {
    let scale = Quantity::new(metres_per_unit, 1e-9 * metres_per_unit).unwrap();
    let lifted = MeasuredMotion::new(&flight, calibration, scale, IMAGING, SpinLift::default());
    let (free, lift) = lifted.without_lift();
    let scene = MeasuredMotion::new(&free, calibration, scale, IMAGING, lift);
    let indexed = scene.bounces();
    let distances = scene.distances(&indexed);
    let gravity_m_s2 = scene.gravity_m_s2();
    let bounces: Vec<Bounce> = indexed.into_iter().map(|(_, b)| b).collect();
    let readings = reading::read(&bounces, None);
    Measured {
        gravity_m_s2,
        distances,
        readings,
        bounces,
        flight,
    }
}

/// Every quantity of a bounce, by name.
pub fn quantities(b: &Bounce) -> Vec<(&'static str, Option<Quantity>)> {
    vec![
        ("time", b.time_s),
        ("x", b.x_m),
        ("vx before", b.incident.vx_m_s),
        ("vz before", b.incident.vz_m_s),
        ("angle before", b.incident.angle_rad),
        ("vx after", b.rebound.vx_m_s),
        ("vz after", b.rebound.vz_m_s),
        ("angle after", b.rebound.angle_rad),
        ("restitution", b.restitution),
        ("tangential ratio", b.tangential_ratio),
        // Of a ball that did not slide for sure, what friction was at least.
        ("friction", b.friction.or(b.friction_at_least)),
        ("tangential restitution", b.tangential_restitution),
        ("spin before", b.spin_in_m_s),
        ("spin after", b.spin_out_m_s),
    ]
}

/// The same of the truth; `None` where there is no such number.
pub fn truths(film: &Film) -> Vec<(&'static str, Option<f64>)> {
    let (v, w) = (film.before.velocity_m_s, film.after.velocity_m_s);
    let (spin, spun) = (film.before.surface_spin_m_s.y, film.after.surface_spin_m_s.y);
    let along = if v.x < 0.0 { -1.0 } else { 1.0 };
    let defined = |x: f64| x.is_finite().then_some(x);
    vec![
        ("time", Some(film.start_s + film.fall_s)),
        ("x", Some(film.hit_x_m())),
        ("vx before", Some(v.x)),
        ("vz before", Some(v.z)),
        ("angle before", Some((along * v.x).atan2(-v.z))),
        ("vx after", Some(w.x)),
        ("vz after", Some(w.z)),
        ("angle after", Some((along * w.x).atan2(w.z))),
        ("restitution", Some(-w.z / v.z)),
        ("tangential ratio", defined(w.x / v.x)),
        ("friction", Some((v.x - w.x).abs() / (v.z.abs() + w.z))),
        ("tangential restitution", defined(-(w.x - spun) / (v.x - spin))),
        ("spin before", Some(spin)),
        ("spin after", Some(spun)),
    ]
}

/// That no number anywhere is NaN or infinite, and no uncertainty zero, negative, NaN or infinite.
pub fn sound(m: &Measured, what: &str) {
    let fits = |q: Option<Quantity>, name: &str| {
        if let Some(q) = q {
            assert!(q.value.is_finite(), "{what}: {name} is {q:?}");
            assert!(
                q.std_uncertainty.is_none_or(|s| s.is_finite() && s > 0.0),
                "{what}: {name} is {q:?}"
            );
        }
    };
    for b in &m.bounces {
        for (name, q) in quantities(b) {
            fits(q, name);
        }
        for c in &b.correlations {
            assert!(c.value.abs() <= 1.0, "{what}: {c:?}");
        }
    }
    fits(m.gravity_m_s2, "gravity");
    fits(m.distances.x0_m, "x0");
    fits(m.distances.x_m, "x");
    if let Some(r) = &m.readings {
        for (name, reading) in &r.models {
            fits(reading.quantity, name.name());
        }
    }
}
