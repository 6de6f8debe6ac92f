//! What does not fit together of what was measured and what the calibration gives, or is doubtful.

use super::{rounded, warning};
use crate::calibration::{Calibration, View};
use crate::flight::bend::{Departure, SizeTrend};
use crate::flight::linking::Spot;
use crate::flight::shake::Shake;
use crate::impact::contact::SoftBall;
use crate::impact::error_budget::READ_STD_PX;
use crate::impact::motion::MeasuredMotion;
use crate::impact::{Bounce, BounceSurface, Impossible};
use crate::pipeline::camera::CalibratedCamera;
use crate::pipeline::in_metres::Impacts;
use crate::pipeline::measurement::Warning;
use crate::quantity::Quantity;

/// What is measured contradicts what is given when they differ by more than this many of their standard uncertainties together.
const CONTRADICTS_SIGMAS: f64 = 4.0;

/// Residuals this much larger than the centres' own uncertainty say that the flight is not a parabola.
const LARGE_SCATTER_RATIO: f64 = 4.0;

/// Errors of successive frames that hang together as (1 + ρ)/(1 − ρ) = this: ρ = 0.5. A codec's change from frame to
/// frame; a path that is no parabola lasts.
const LASTING: f64 = 3.0;

/// Everything to judge a measured flight by.
pub struct WarningContext<'a> {
    /// What is given.
    pub calibration: &'a Calibration,
    /// By what it was seen.
    pub camera: &'a CalibratedCamera<'a>,
    /// In metres.
    pub motion: &'a MeasuredMotion<'a>,
    /// What follows from that.
    pub impacts: &'a Impacts,
    /// What the arcs are beyond parabolas with drag; `None` where they are that.
    pub departure: Option<Departure>,
    /// The ball's sightings, each with its own size.
    pub first_look: &'a [Spot],
    /// Time between distinct frames, s.
    pub interval_s: f64,
    /// Standard uncertainty of the first bounce's restitution, and what it would be with a readout known exactly; `None` where one is told or found.
    pub restitution_stds: [Option<f64>; 2],
    /// By what part of their way from the middle a lens that nobody tells of moves the corners of the picture; `None` where none is likely.
    pub lens_part: Option<f64>,
}

/// Oddities of the measured flight.
pub fn of_impacts(j: &WarningContext<'_>) -> Vec<Warning> {
    let (impacts, flight, calibration) = (j.impacts, &j.impacts.flight, j.calibration);
    let mut out = Vec::new();
    out.extend(impacts.gravity_m_s2.map(|g| gravity(g, j)).unwrap_or_default());
    out.extend(up_tilted(j));
    out.extend(impacts.shake.map(|s| shaken_ball(&s, j)));
    out.extend(floor_slope(j));
    out.extend(bench(j));
    out.extend(impossible_tangential(&impacts.bounces));
    out.extend(distance_against_fall(j));
    out.extend(readout_unknown(j));
    out.extend(j.lens_part.map(lens_unknown));
    out.extend(j.motion.bend().map(bent));
    out.extend(
        j.departure
            .map(|departure| departing(departure, SizeTrend::of(j.first_look, j.camera.stands_still))),
    );
    out.extend(scale_against_ball(j));
    out.extend(floor_height(j));
    out.extend(different_heights(j));
    let x0_missing = impacts.distances.x0_m.is_none() && calibration.launch.edge_x_m.is_some();
    if x0_missing && !impacts.bounces.is_empty() {
        out.push(warning!(
            "first_impact_unsure",
            "the first impact seen cannot be the first after the launch edge: followed back to \"launch.edge_x_m\", its arc runs below the floor. An impact before it was missed, or the edge or \"origin_px\" is wrong; x0 and x are left out, and so are spins and e_x, which need the spin at the launch."
        ));
    }
    let gains = j.motion.impossible(&impacts.bounces);
    if gains > 0 {
        out.push(warning!(
            "impossible_impact",
            "{gains} impact(s) would have sent the ball up faster than it came down: on one side of them something else was followed (a shadow, a reflection, a hand). They are not among the bounces; x0 counts from the first that is."
        ));
    }
    if impacts.walls > 0 {
        out.push(warning!(
            "not_a_floor",
            "{} impact(s) are on something upright (the speed along x turned, not the speed up): they are not among the bounces.",
            impacts.walls
        ));
    }
    let ratio = flight.scatter_ratio();
    let lasting = ratio > LARGE_SCATTER_RATIO && flight.fit.autocorrelation_inflation > LASTING;
    if lasting && j.departure.is_none() {
        out.push(warning!(
            "not_a_parabola",
            "the centres scatter {ratio:.1} times more about the arcs than about the ball's outline: air drag on a light ball, a moving or rolling-shutter camera, a lens without correction, or a plane of motion seen at a slant. The uncertainties are those of such a scatter; what bends all arcs alike may shift speeds, restitution and angles by more."
        ));
    }
    out.extend(j.motion.may_be_soft().map(soft));
    if j.motion.metres_per_unit.std_uncertainty.is_none() {
        let key = calibration.scale.uncertainty_key();
        out.push(warning!(
            "scale_uncertainty_unknown",
            "the calibration's scale has no uncertainty, so those of lengths and speeds hold the tracking's part only. Set \"{key}\"."
        ));
    }
    out
}

/// A readout that is not known is worth a word where restitution is so many times as uncertain by it.
const WORTH_A_WORD: f64 = 2.0;

/// That a readout which nobody tells of is most of the uncertainty.
fn readout_unknown(j: &WarningContext<'_>) -> Option<Warning> {
    let [std, by_known] = j.restitution_stds;
    let (std, by_known) = std.zip(by_known)?;
    (std > WORTH_A_WORD * by_known).then(|| {
        warning!(
            "readout_unknown",
            "most cameras expose the rows of a picture one after the other (phones within 5 to 30 ms), which changes the speeds of a ball that goes up or down. Nobody tells whether this one does, and so short a flight hardly shows it: that is most of the uncertainty of speeds and restitution, ± {std:.4} of the first bounce, which would be ± {by_known:.4} with a known readout. Set \"camera\": {{\"readout_s\": …}} in the calibration (0 of a global shutter), or record longer arcs before and after the impact."
        )
    })
}

/// That the lens bends lines, and that what it does is in the uncertainties alone.
fn lens_unknown(part: f64) -> Warning {
    warning!(
        "lens_unknown",
        "the flight bends as if the lens bent lines: it moves the corners of the picture by about {:.1} % of their way from the middle. The calibration tells of no lens, so nothing was put right; what it does to places and speeds is in their uncertainties. Measure it (`track calibrate board`, key \"lens\") and measure again, or keep the flight near the middle of the picture.",
        100.0 * part
    )
}

/// A trend of the ball's size is believed where it stands out by so many standard uncertainties, and is worth a word from this part on.
const TREND_SIGMAS: f64 = 4.0;
const LEAST_TREND: f64 = 0.01;

/// That arcs are no parabolas, what was done, and whether the ball's size says why.
fn departing(departure: Departure, trend: Option<SizeTrend>) -> Warning {
    let clear = |t: &(f64, f64)| t.0.abs() > TREND_SIGMAS * t.1 && t.0.abs() > LEAST_TREND;
    let percent = |t: (f64, f64)| format!("{:+.1} ± {:.1} %", 100.0 * t.0, 100.0 * t.1);
    let seen = trend.map_or_else(Vec::new, |t| {
        let all = [
            (
                t.up,
                "from the lowest place to the highest: the camera looks at the plane of motion at a slant",
            ),
            (
                t.right,
                "from the left to the right: the camera looks at the plane of motion from the side",
            ),
            (
                t.time,
                "from the first frame to the last: the ball nears the camera or goes away from it",
            ),
        ];
        let told = all.into_iter().filter(|(t, _)| clear(t));
        told.map(|(t, what)| format!("{} {what}", percent(t))).collect()
    });
    let done = match departure {
        Departure::ScaleChanges { .. } => {
            "One fall for all arcs tells how the scale changes, and the ball's size does: speeds and places were corrected by it, with its uncertainty.".to_owned()
        }
        Departure::Bent(part) => format!(
            "The path is bent by about {:.1} % of its way beyond what gravity and drag make of it. Speeds at an impact were taken from the path near it, with uncertainties to match; lengths far from the impacts may be off by as much.",
            100.0 * part
        ),
    };
    if matches!(departure, Departure::ScaleChanges { .. }) || !seen.is_empty() {
        let width = if seen.is_empty() {
            String::new()
        } else {
            format!(
                " (the ball's width in the picture changes by {})",
                seen.join("; and by ")
            )
        };
        warning!(
            "scale_changes",
            "the scale is not the same everywhere{width}: one scale for the whole picture does not describe the path. {done} Put the camera square to the plane of motion and further away, or calibrate the plane with a board."
        )
    } else {
        warning!(
            "not_a_parabola",
            "the arcs are no parabolas: a camera that pans or is held by hand, a plane of motion seen at a slant, a ball that nears the camera, moving air, a hand at the ball. {done} Put the camera on a tripod, square to the plane of motion, and further away."
        )
    }
}

/// That the ball may be softer than its times and restitution are for.
fn soft(ball: SoftBall) -> Warning {
    warning!(
        "contact_time_unknown",
        "a ball of {:.2} g/cm³ may be soft, and nothing tells how long it stays on the floor. Times, restitution and their uncertainties are those of a ball as hard as metal or glass; one as soft as a superball touches {:.1} ms earlier than said, and its restitution is off by up to {:.1} %.",
        ball.density_kg_m3 / 1000.0,
        1000.0 * ball.earlier_s,
        100.0 * ball.restitution_part
    )
}

/// The self-check: gravity as the flight shows it, and what would explain another.
fn gravity(g: Quantity, j: &WarningContext<'_>) -> Vec<Warning> {
    let expected = j.calibration.gravity_m_s2;
    let std = g.std_uncertainty.unwrap_or(0.0);
    let local = j.calibration.gravity_uncertainty_m_s2();
    if j.calibration.gravity_mismatch(g).is_none() {
        return Vec::new();
    }
    let ratio = expected / g.value;
    let mut causes = Vec::new();
    if let Some(n) = time_factor(ratio) {
        causes.push(format!(
            "time: it fits a capture rate of {} Hz in place of {} Hz (a factor {} in time is {} in g): set \"frame_rate_hz\": {}",
            rounded(n / j.interval_s),
            rounded(1.0 / j.interval_s),
            rounded(n),
            rounded(n * n),
            rounded(n / j.interval_s),
        ));
    } else {
        causes.push(format!(
            "time: it would be right with {:.4} Hz in place of {:.4} Hz (\"frame_rate_hz\")",
            ratio.sqrt() / j.interval_s,
            1.0 / j.interval_s,
        ));
    }
    causes.push(format!(
        "scale: it would be right with lengths times {ratio:.4} ({:.6} m/px in place of {:.6}): check the two ends and the length of the ruler, and that it stood in the plane of motion (\"scale\")",
        j.motion.metres_per_unit.value * ratio,
        j.motion.metres_per_unit.value,
    ));
    if ratio > 1.0 && ratio < 1.35 {
        causes.push(format!(
            "tilt: a plane of motion or camera that leans away by {:.1} degrees would do it",
            (1.0 / ratio).acos().to_degrees()
        ));
    }
    if j.calibration.ball.mass_kg.is_none() || j.calibration.ball.radius_m.is_none() {
        causes.push("air: drag on a light ball, if \"ball\" had its radius and mass".to_owned());
    }
    let mut out = vec![warning!(
        "gravity_mismatch",
        "the flight falls with {:.4} ± {:.4} m/s², not {expected} ± {local:.4}: lengths and speeds are not to be trusted before this is explained, and their uncertainties hold as much (restitution and angles hardly depend on it). Possible: {}.",
        g.value,
        std,
        causes.join("; ")
    )];
    if j.motion.metres_per_unit.std_uncertainty.is_none() {
        out.push(warning!(
            "refuted_calibration",
            "scale and frame rate are stated as exact, and the fall refutes them: together they are off by {:.2} % in g. Give the scale's \"std_uncertainty\", or measure it again.",
            100.0 * (1.0 / ratio - 1.0)
        ));
    }
    out
}

/// "Up" that is not worth a word where nobody said where it is, rad.
const UPRIGHT_RAD: f64 = 0.0175;

/// That the fall has another "up" than the calibration.
fn up_tilted(j: &WarningContext<'_>) -> Option<Warning> {
    let up = j.impacts.up?;
    let given = j.calibration.has_up();
    let degrees = |rad: f64| rad.to_degrees();
    let (tilt, std) = (up.tilt_rad.value, j.impacts.flight.fit.lean_std_rad());
    let (prior, word) = (
        j.calibration.upright_std_rad(),
        if tilt > 0.0 { "right" } else { "left" },
    );
    // What contradicts the calibration is in the fit without it.
    let alone = j
        .impacts
        .flight
        .fit
        .model
        .vertical_prior()
        .is_some_and(|u| u.std_rad.is_infinite());
    if given && alone {
        return Some(warning!(
            "up_tilted",
            "the ball falls {:.2} ± {:.2} degrees to the {word} of \"up_px\", which is stated to {:.2} degrees: the direction of the fall was used. Check \"up_px\" (a plumb line in the picture), or leave it out.",
            degrees(tilt.abs()),
            degrees(std),
            degrees(prior)
        ));
    }
    let seen = up.tilt_rad.value.abs();
    let shows = seen > UPRIGHT_RAD && seen > CONTRADICTS_SIGMAS * up.tilt_rad.std_uncertainty.unwrap_or(0.0);
    (!given && shows).then(|| {
        warning!(
            "up_tilted",
            "\"up\" is {:.2} degrees to the {word} of the picture's, as the fall shows: x, z and angles are along and against the fall. If the camera stood level, the plane of motion is seen at a slant, or something pushes the ball sideways.",
            degrees(seen)
        )
    })
}

/// A floor steeper than this is worth a word, rad: half a degree.
const STEEP_RAD: f64 = 0.0087;

/// That the floor slopes, or is said to do otherwise than it does.
fn floor_slope(j: &WarningContext<'_>) -> Option<Warning> {
    let slope = j.impacts.floor?.slope_rad;
    let (value, std) = (slope.value, slope.std_uncertainty.unwrap_or(0.0));
    let found = format!("{:.2} ± {:.2} degrees", value.to_degrees(), std.to_degrees());
    if let Some((said, std)) = j.motion.floor_contradicts().filter(|_| j.calibration.floor.given) {
        return Some(warning!(
            "floor_contradicts",
            "the floor slopes by {found} along x as the picture shows it, and by {:.2} ± {:.2} degrees by \"floor.slope_deg\": the first was used. Check that the impacts are on one floor, and the calibration's sign (positive where the floor rises along the launch).",
            said.to_degrees(),
            std.to_degrees()
        ));
    }
    (value.abs() > STEEP_RAD && value.abs() > CONTRADICTS_SIGMAS * std).then(|| {
        warning!(
            "floor_slopes",
            "the floor slopes by {found} along x, if the impacts are on one plane floor: restitution, friction and angles are along it and its normal. If it is level, the impacts are at different heights (a step, a mat), and these numbers are off by the slope."
        )
    })
}

/// What a bench that is seen says against the calibration.
fn bench(j: &WarningContext<'_>) -> Vec<Warning> {
    let Some(launch) = &j.impacts.launch else {
        return Vec::new();
    };
    let mut out = Vec::new();
    let Some(edge) = launch.edge_x_m else {
        let gap = launch.gap_m.map_or(0.0, |g| 1e3 * g.value);
        out.push(warning!(
            "launch_unclear",
            "the ball moves along a bench for {:.3} s, but its flight does not begin where that ends: followed back, it is {gap:.2} mm above the bench (below, if negative). It tipped round the edge, went over a step, or was pushed: the edge is not told.",
            launch.rolled_s
        ));
        return out;
    };
    if let Some(said) = j
        .calibration
        .launch
        .edge_x_m
        .filter(|_| j.calibration.has_origin())
    {
        let metre = j.motion.metres_per_unit.value * j.camera.units_per_px();
        let read = j.calibration.origin_std_px.unwrap_or(READ_STD_PX) * metre;
        let std = edge.std_uncertainty.unwrap_or(0.0);
        if (edge.value - said).abs() > CONTRADICTS_SIGMAS * std.hypot(read) {
            out.push(warning!(
                "edge_mismatch",
                "the ball leaves its bench at x = {:.2} ± {:.2} mm, the calibration has the edge at {:.2} ± {:.2} mm: x0 counts from the latter. Check \"origin_px\" and \"launch.edge_x_m\", or leave origin_px out: then x = 0 is where the bench ends.",
                1e3 * edge.value, 1e3 * std, 1e3 * said, 1e3 * read
            ));
        }
    }
    if j.calibration.launch.spin_ratio == Some(0.0) {
        out.push(warning!(
            "rolling_unsaid",
            "the ball is seen moving along its bench for {:.3} s, and \"launch.spin_ratio\" is 0: if it rolled, e_x, spins and regimes are wrong. Set \"spin_ratio\": \"rolling\" (with \"track_width_m\" on a track), or null where nobody knows.",
            launch.rolled_s
        ));
    }
    out
}

/// A swing that the ball alone shows.
fn shaken_ball(shake: &Shake, j: &WarningContext<'_>) -> Warning {
    warning!(
        "camera_shaken",
        "after the impact at {:.3} s the ball seems to leave its arc by up to {:.2} px and comes back within some hundredths of a second: the table or the camera is bumped, and nothing in the picture tells by how much. The centres after each impact count for as little as that makes them sure. Put the camera on a stand of its own, or have an edge in the picture (the floor, the bench).",
        shake.impact_s,
        shake.size / j.camera.units_per_px()
    )
}

/// Impacts whose motion along the floor no contact makes.
fn impossible_tangential(bounces: &[(usize, Bounce)]) -> Option<Warning> {
    let found: Vec<String> = bounces
        .iter()
        .enumerate()
        .filter_map(|(i, (_, b))| {
            let words = match b.impossible? {
                Impossible::Reversed(e_x) => format!(
                    "e_x would be {:.2} ± {:.2}",
                    e_x.value,
                    e_x.std_uncertainty.unwrap_or(f64::NAN)
                ),
                Impossible::Driven(gain) => format!(
                    "the slip grows by {:.3} ± {:.3} m/s",
                    gain.value,
                    gain.std_uncertainty.unwrap_or(f64::NAN)
                ),
            };
            Some(format!("bounce {}: {words}", i + 1))
        })
        .collect();
    (!found.is_empty()).then(|| {
        warning!(
            "impossible_tangential",
            "no contact does that ({}), so e_x, spins and friction are left out there. Possible: the ball spun before (\"launch.spin_ratio\": a number, \"rolling\" or null), it moves out of the plane, the floor slopes, or two things were taken for one.",
            found.join("; ")
        )
    })
}

/// The self-check of a top view: the bend of the path tells g over the camera's distance.
fn distance_against_fall(j: &WarningContext<'_>) -> Option<Warning> {
    let above = j.calibration.view == View::Top;
    let distance_m = j.calibration.distance_m.filter(|_| above)?;
    let seen = j.impacts.flight.fall_ratio()?;
    let given = j.calibration.distance_std_m.unwrap_or(0.0) / distance_m;
    let std = seen.std_uncertainty? / seen.value;
    let off = seen.value.ln().abs();
    if !(off > DISTANCE_SIGMAS * std.hypot(given) && off > DISTANCE_PART) {
        return None;
    }
    let time = time_factor(1.0 / seen.value).map_or(String::new(), |n| {
        let (given, meant) = (rounded(1.0 / j.interval_s), rounded(n / j.interval_s));
        format!(" Or the clock is wrong: it fits a capture rate of {meant} Hz in place of {given} Hz (\"frame_rate_hz\").")
    });
    Some(warning!(
        "distance_mismatch",
        "the ball's path bends as for a camera {:.2} ± {:.2} m above the floor, not {distance_m} m: directions and speeds are not to be trusted before this is explained. Check \"distance_m\": from the lens to the floor, in metres, along the line of sight.{time}",
        distance_m / seen.value,
        distance_m / seen.value * std
    ))
}

/// A path that is no straight line, where it is taken for one.
fn bent(part: f64) -> Warning {
    warning!(
        "paths_bend",
        "seen from above, the ball's path bends by {:.0} % of its speed within one flight (up to {:.0} degrees), as a near camera shows it: directions and speeds may be off by as much, so their uncertainties are left out. Set \"distance_m\" to the distance from the lens to the floor, and this is corrected.",
        100.0 * part,
        part.atan().to_degrees()
    )
}

/// A distance is off when it is by this part, which turns directions by less than the tracking does, and by so many
/// standard uncertainties.
const DISTANCE_PART: f64 = 0.04;
const DISTANCE_SIGMAS: f64 = 4.0;

/// Whole factors between stored and true frame rates that phones and editors make.
fn time_factor(ratio: f64) -> Option<f64> {
    // Phones store 60 to 960 Hz at 24 to 30 Hz; editors halve or double.
    const FACTORS: [f64; 13] = [
        2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 16.0, 20.0, 32.0, 0.5, 0.25,
    ];
    let n = ratio.sqrt();
    FACTORS
        .into_iter()
        .filter(|f| (n / f - 1.0).abs() < 0.12)
        .min_by(|a, b| (n / a).ln().abs().total_cmp(&(n / b).ln().abs()))
}

/// A ball of known size is a second ruler.
fn scale_against_ball(j: &WarningContext<'_>) -> Option<Warning> {
    if j.calibration.scale.rests_on_ball() {
        return None;
    }
    let (known, seen) = (
        j.calibration.ball.radius_m?,
        j.impacts.radius_px?.value * j.camera.ball_units_per_px() * j.motion.metres_per_unit.value,
    );
    let ratio = seen / known;
    if (ratio - 1.0).abs() < 0.1 {
        return None;
    }
    let time = if j.calibration.scale.rests_on_fall() {
        let n = time_factor(1.0 / ratio).map_or(String::new(), |n| {
            let rate = rounded(n / j.interval_s);
            format!(" It fits a capture rate of {rate} Hz: set \"frame_rate_hz\": {rate}.")
        });
        format!(" The scale comes from the fall, so a wrong time base would do this.{n}")
    } else {
        String::new()
    };
    Some(warning!(
        "ball_size_mismatch",
        "by the scale the ball's radius is {:.2} mm, by the calibration {:.2} mm (factor {ratio:.3}).{time}",
        1e3 * seen,
        1e3 * known
    ))
}

/// With an origin on the floor, the ball's centre must touch at its radius.
fn floor_height(j: &WarningContext<'_>) -> Option<Warning> {
    let off_m = j.motion.floor_mismatch_m()?;
    let side = if off_m < 0.0 { "below" } else { "above" };
    Some(warning!(
        "floor_mismatch",
        "the ball touches with its centre {:.1} mm {side} where the calibration's floor has it. Either \"origin_px\" is wrong (its row is the \
         floor where the ball bounces), or what was measured is not the ball but its shadow, its reflection or another thing: look at the \
         overlay. Distances from the origin and x0 carry as much uncertainty.",
        1e3 * off_m.abs()
    ))
}

/// x is a distance on one floor.
fn different_heights(j: &WarningContext<'_>) -> Option<Warning> {
    if j.calibration.view == View::Top {
        return None;
    }
    let heights: Vec<f64> = j
        .impacts
        .bounces
        .iter()
        .filter(|(_, b)| b.surface == BounceSurface::Floor)
        .filter_map(|(k, b)| Some(j.motion.place_m(*k, b.time_s?.value).1))
        .collect();
    let (first, second) = (heights.first()?, heights.get(1)?);
    let radius_m = j.impacts.radius_m.unwrap_or(0.01);
    ((first - second).abs() > radius_m).then(|| {
        warning!(
            "floors_differ",
            "the second impact is {:.0} mm {} than the first: x is the distance between them, not one on a level floor, and the relation of x to x0 does not hold.",
            1e3 * (first - second).abs(), if second < first { "lower" } else { "higher" }
        )
    })
}
