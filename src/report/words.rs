//! Numbers and findings in words, shared by the table and the page.

use crate::impact::compliant_reading::{CompliantReading, FrictionSource};
use crate::impact::seen_spin::SpinSource;
use crate::impact::{BenchLaunch, Bounce, BounceSurface, FloorSource, XSource};
use crate::pipeline::{CameraSeen, Measurement, PointUse, ShownMotion, TimeSource, UpSource, UpTilt};
use crate::quantity::Quantity;
use crate::rebound::{Preferred, Regime};

/// What stands where there is no value.
pub(super) const NO_VALUE: &str = "—";

/// A quantity in lab notation, "0.7812 ± 0.0031 m": two significant digits of the uncertainty, and the value to the
/// same place. "± ?" where the uncertainty was not determined (the value then gets three significant digits), "—" where
/// there is no value. Very large and very small ones share a power of ten: "(1.20 ± 0.34)×10⁻⁵ m".
#[must_use]
pub fn format_quantity(quantity: Option<Quantity>, unit: &str) -> String {
    match written(quantity) {
        None => NO_VALUE.to_owned(),
        Some(WrittenQuantity {
            value,
            uncertainty,
            power: None,
        }) => with_unit(format!("{value} ± {uncertainty}"), unit),
        Some(WrittenQuantity {
            value,
            uncertainty,
            power: Some(power),
        }) => with_unit(
            format!("({value} ± {uncertainty})×10{}", superscript(power)),
            unit,
        ),
    }
}

/// The parts of a quantity as it is written, for columns that line up at the ±.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct WrittenQuantity {
    /// The value's digits.
    pub value: String,
    /// The uncertainty's digits, or "?".
    pub uncertainty: String,
    /// The common power of ten, where there is one.
    pub power: Option<i32>,
}

/// A value and its uncertainty as digits; `None` where there is no (finite) value.
pub(super) fn written(quantity: Option<Quantity>) -> Option<WrittenQuantity> {
    let Quantity {
        value,
        std_uncertainty,
    } = quantity.filter(|quantity| quantity.value.is_finite())?;
    let std = std_uncertainty.filter(|std| std.is_finite() && *std > 0.0);
    let largest = value.abs().max(std.unwrap_or(0.0));
    // Outside this range a row of zeros hides the digits that matter.
    let power =
        (largest != 0.0 && !(1e-3..1e5).contains(&largest)).then(|| leading_digit(largest, MAX_DIGITS));
    let shift = |number: f64| power.map_or(number, |power| number / 10_f64.powi(power));
    let (value, std) = (shift(value), std.map(shift));
    let Some(std) = std.filter(|std| *std > 0.0) else {
        let places = if value == 0.0 {
            0
        } else {
            2 - leading_digit(value.abs(), 2)
        };
        return Some(WrittenQuantity {
            value: rounded(value, places),
            uncertainty: "?".to_owned(),
            power,
        });
    };
    // More digits than an f64 holds would be invented ones.
    let most = MAX_DIGITS as i32
        - if value == 0.0 {
            0
        } else {
            leading_digit(value.abs(), MAX_DIGITS).max(0)
        };
    let places = 1 - leading_digit(std, 1);
    Some(if places <= most {
        WrittenQuantity {
            value: rounded(value, places),
            uncertainty: rounded(std, places),
            power,
        }
    } else {
        let exponent = leading_digit(std, 1);
        WrittenQuantity {
            value: rounded(value, most),
            uncertainty: format!("10{}", superscript(exponent)),
            power,
        }
    })
}

/// Significant digits of an f64 that can be relied on.
const MAX_DIGITS: usize = 14;

/// The power of ten of `number`'s first digit once it is rounded to `decimals` digits after it: 9.96 with one decimal
/// is 10.0, whose first digit stands for tens.
fn leading_digit(number: f64, decimals: usize) -> i32 {
    let text = format!("{number:.decimals$e}");
    // `{:e}` always writes an exponent.
    text.split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok())
        .unwrap_or(0)
}

/// `number` rounded to `places` after the point (before it, where negative), with a true minus sign and no minus zero.
fn rounded(number: f64, places: i32) -> String {
    let text = match usize::try_from(places) {
        Ok(places) => format!("{number:.places$}"),
        Err(_) => {
            let step = 10_f64.powi(-places);
            format!("{:.0}", (number / step).round() * step)
        }
    };
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().any(|b| (b'1'..=b'9').contains(&b)) => format!("−{digits}"),
        Some(digits) => digits.to_owned(),
        None => text,
    }
}

/// A power of ten's exponent in raised digits.
pub(super) fn superscript(power: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    power
        .to_string()
        .chars()
        .map(|c| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]))
        .collect()
}

/// The number with its unit: apart, except for the degree sign.
pub(super) fn with_unit(number: String, unit: &str) -> String {
    match unit {
        "" => number,
        "°" => number + unit,
        _ => format!("{number} {unit}"),
    }
}

/// An angle in radians as degrees, for people.
pub(super) fn degrees(angle_rad: Option<Quantity>) -> Option<Quantity> {
    angle_rad.map(|angle| angle.scaled(1_f64.to_degrees()))
}

/// A model's regime by the name that files have for it.
pub(super) fn regime_name(regime: Option<Regime>) -> &'static str {
    regime.map_or("undetermined", Regime::name)
}

/// For whom the compliant model is.
pub(super) const COMPLIANT_IS_FOR: &str = "The model is meant for like, elastic bodies. Rubber loses energy sideways as well, a hollow ball bends: \
     the ratio of their stiffnesses is no number of the material, but one to be fitted from a series (track fit)";

/// What the compliant model makes of a bounce, in words, without a full stop.
pub(super) fn compliant(reading: &CompliantReading) -> String {
    let regime = match reading.regime {
        Some(Regime::Sliding) => "by it, the ball slid throughout",
        Some(Regime::SlipStickSlip) => {
            "by it, the ball slid at the touch, stuck, and slid again before it left"
        }
        Some(Regime::StickSlip) => "by it, the ball stuck first and slid before it left",
        _ => "its regime is not determined",
    };
    let friction = match reading.source {
        FrictionSource::OtherBounces => {
            "friction is that of the recording's other bounces, so this one tests the model"
        }
        FrictionSource::ThisBounce => {
            "friction was chosen to suit this bounce, as no other tells it: only a rebound that no friction gives would \
             speak against the model"
        }
    };
    format!("{regime}; {friction}")
}

/// A difference in standard uncertainties.
pub(super) fn sigmas(sigmas: Option<f64>) -> String {
    sigmas.map_or_else(|| NO_VALUE.to_owned(), |sigmas| format!("{sigmas:+.1} σ"))
}

/// A bounce's number, counted from 1, with what it is on where that is not the floor.
pub(super) fn bounce_name(number: usize, bounce: &Bounce) -> String {
    match bounce.surface {
        BounceSurface::Floor => format!("bounce {number}"),
        BounceSurface::Ceiling => format!("bounce {number} (ceiling)"),
    }
}

/// What the contact point did, in a word: where the slip is only slowed, it slid.
pub(super) fn slip(slip: Option<Regime>) -> &'static str {
    regime_name(slip.map(|slip| match slip {
        Regime::Ordinary => Regime::Sliding,
        other => other,
    }))
}

/// Where and how the ball left its bench.
pub(super) fn launch(launch: &BenchLaunch) -> String {
    let seen = format!("seen on the bench for {} s", trimmed(launch.rolled_s, 3));
    let speed = format_quantity(launch.speed_m_s, "m/s");
    match (launch.edge_x_m, launch.drop_height_m) {
        (Some(_), height) => format!(
            "edge at x = {}, left at {} with {speed}; {}{seen}",
            format_quantity(launch.edge_x_m, "m"),
            format_quantity(launch.time_s, "s"),
            height.map_or(String::new(), |_| format!(
                "{} above the first impact; ",
                format_quantity(height, "m")
            )),
        ),
        _ => format!("{seen}, but its flight does not begin where the bench ends: no edge is told"),
    }
}

/// Which way is up.
pub(super) fn up(up: &UpTilt) -> String {
    let tilt = format_quantity(degrees(Some(up.tilt_rad)), "°");
    let source = match up.source {
        UpSource::Calibration => "mostly by the calibration",
        UpSource::Fall => "by the fall",
    };
    format!("{tilt} to the right of the calibration's ({source})")
}

/// Where the floor's slope comes from.
pub(super) fn floor_source(source: FloorSource) -> &'static str {
    match source {
        FloorSource::Impacts => "from the places of the impacts",
        FloorSource::Calibration => "from the calibration",
        FloorSource::Level => "nothing tells it: taken as level to 0.1 degrees, as a bench is",
    }
}

/// Which model fits better, as a sentence without its full stop.
pub(super) fn preferred(preferred: Preferred) -> &'static str {
    match preferred {
        Preferred::Model(name) => name.model().preferred_words(),
        Preferred::Undetermined => "this recording alone does not tell which model is better",
    }
}

/// Where x comes from.
pub(super) fn x_source(source: Option<XSource>) -> &'static str {
    match source {
        Some(XSource::Observed) => "both impacts seen",
        Some(XSource::Extrapolated) => "the second impact extrapolated from the rebound's arc",
        None => "not measured",
    }
}

/// Where times come from.
pub(super) fn time_source(source: TimeSource) -> &'static str {
    match source {
        TimeSource::Stamps => "the file's own time stamps",
        TimeSource::Calibration => "frame_rate_hz of the calibration",
    }
}

/// What the scene shows of the camera's motion.
pub(super) fn camera(seen: &CameraSeen) -> String {
    const WOULD_SHOW: &str = "(a patterned sheet on the wall would show it)";
    let seen_to = if seen.stands_still {
        "stands still"
    } else {
        "moves, and is followed by the scene"
    };
    match seen.shown_motion {
        ShownMotion::All => seen_to.to_owned(),
        ShownMotion::AllBut { along } => {
            // Rows count downwards.
            let clockwise_deg = along.y.atan2(along.x).to_degrees();
            let turned = if clockwise_deg < 0.0 {
                "anticlockwise"
            } else {
                "clockwise"
            };
            let direction = match trimmed(clockwise_deg.abs(), 1).as_str() {
                "0" => "the picture's rows".to_owned(),
                "90" => "the picture's columns".to_owned(),
                deg => format!("a line {deg}° {turned} from the picture's rows"),
            };
            format!("{seen_to}; its motion along {direction} may stay unseen {WOULD_SHOW}")
        }
        ShownMotion::None if seen.stands_still => {
            format!("taken to stand still; its motion may stay unseen {WOULD_SHOW}")
        }
        ShownMotion::None => format!("moves; how may stay unseen {WOULD_SHOW}"),
    }
}

/// The file's name without its folders.
pub(super) fn file_name(measurement: &Measurement) -> String {
    let path = &measurement.video.path;
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

/// A column of a table with a row a launch.
pub(super) struct LaunchColumn {
    /// As in the paper.
    pub symbol: &'static str,
    /// Empty for a pure number.
    pub unit: &'static str,
    /// The quantity of a launch, in that unit: of its first bounce, or its own.
    pub quantity: fn(&Measurement) -> Option<Quantity>,
}

/// What tells launches apart.
pub(super) const LAUNCH_COLUMNS: [LaunchColumn; 6] = [
    launch_column("e", "", |m| m.bounces.first()?.restitution),
    launch_column("θ", "°", |m| degrees(m.bounces.first()?.incident.angle_rad)),
    launch_column("μ", "", |m| m.bounces.first()?.friction),
    launch_column("x_0", "m", |m| m.distances.x0_m),
    launch_column("x", "m", |m| m.distances.x_m),
    launch_column("g", "m/s²", |m| m.gravity_m_s2),
];

const fn launch_column(
    symbol: &'static str,
    unit: &'static str,
    quantity: fn(&Measurement) -> Option<Quantity>,
) -> LaunchColumn {
    LaunchColumn {
        symbol,
        unit,
        quantity,
    }
}

/// From when to when a launch was seen, and what of it.
pub(super) fn seen_flying(launch: &Measurement) -> String {
    let bounces = counted(launch.bounces.len() as u64, "bounce");
    let (used, _) = point_counts(launch);
    launch.time_span().map_or_else(String::new, |(from, to)| {
        format!(
            "seen flying from {} to {} s; {bounces}, {used} centres in use",
            trimmed(from, 3),
            trimmed(to, 3)
        )
    })
}

/// How many points were used, and how many were not for each reason, the most frequent first.
pub(super) fn point_counts(measurement: &Measurement) -> (usize, Vec<(&'static str, usize)>) {
    let mut used = 0;
    let mut reasons: Vec<(&'static str, usize)> = Vec::new();
    for point in &measurement.track.points {
        match &point.use_ {
            PointUse::Used(_) => used += 1,
            PointUse::Unused(reason) => {
                let phrase = reason.phrase();
                match reasons.iter_mut().find(|(known, _)| *known == phrase) {
                    Some((_, count)) => *count += 1,
                    None => reasons.push((phrase, 1)),
                }
            }
        }
    }
    reasons.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    (used, reasons)
}

/// `1 frame`, `2 frames`.
pub(super) fn counted(count: u64, noun: &str) -> String {
    let ending = match count {
        1 => "",
        _ if noun.ends_with("ch") => "es",
        _ => "s",
    };
    format!("{count} {noun}{ending}")
}

/// A bare uncertainty to two significant digits, as [`format_quantity`] writes it.
pub(super) fn two_digits(std: f64) -> String {
    rounded(std, 1 - leading_digit(std, 1))
}

/// A plain number of the file facts: at most `places` after the point, without trailing zeros.
pub(super) fn trimmed(number: f64, places: usize) -> String {
    let text = format!("{number:.places$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Where a spin comes from, as files have it.
#[must_use]
pub const fn spin_source(source: SpinSource) -> &'static str {
    match source {
        SpinSource::Measured => "measured",
        SpinSource::Launch => "launch",
        SpinSource::PreviousBounce => "previous_bounce",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_the_scene_does_not_show_of_the_camera_is_said() {
        let said = |stands_still, shown_motion| {
            camera(&CameraSeen {
                stands_still,
                shown_motion,
            })
        };
        let all_but = |degrees: f64| ShownMotion::AllBut {
            along: [degrees.to_radians().cos(), degrees.to_radians().sin()].into(),
        };
        assert_eq!(said(true, ShownMotion::All), "stands still");
        assert!(said(true, all_but(-0.01)).contains("along the picture's rows may stay unseen"));
        assert!(said(true, all_but(1.25)).contains("a line 1.2° clockwise from the picture's rows"));
        assert!(said(false, all_but(-30.0)).starts_with("moves"));
        assert!(said(false, all_but(-30.0)).contains("a line 30° anticlockwise from"));
        assert!(said(true, all_but(90.0)).contains("along the picture's columns"));
        assert!(said(true, ShownMotion::None).starts_with("taken to stand still"));
        assert!(said(false, ShownMotion::None).starts_with("moves"));
    }

    fn of(value: f64, std: f64) -> String {
        format_quantity(Quantity::new(value, std), "")
    }

    #[test]
    fn the_value_ends_where_the_uncertainty_does() {
        assert_eq!(of(0.781_234, 0.003_14), "0.7812 ± 0.0031");
        assert_eq!(of(24.1, 0.12), "24.10 ± 0.12");
        assert_eq!(of(-2.426_1, 0.0029), "−2.4261 ± 0.0029");
        assert_eq!(of(9.806, 0.11), "9.81 ± 0.11");
        assert_eq!(of(1234.0, 17.0), "1234 ± 17");
        assert_eq!(of(3.0, 1.0), "3.0 ± 1.0");
        assert_eq!(of(412.345_678_9, 0.000_042), "412.345679 ± 0.000042");
    }

    #[test]
    fn an_uncertainty_that_rounds_up_keeps_two_digits() {
        assert_eq!(of(123.456, 9.96), "123 ± 10");
        assert_eq!(of(0.5, 0.0996), "0.50 ± 0.10");
        assert_eq!(of(0.5, 0.0994), "0.500 ± 0.099");
        assert_eq!(of(1.5, 0.996), "1.5 ± 1.0");
    }

    #[test]
    fn a_large_uncertainty_rounds_before_the_point() {
        assert_eq!(of(1234.0, 234.0), "1230 ± 230");
        assert_eq!(of(98_765.0, 4321.0), "98800 ± 4300");
    }

    #[test]
    fn an_uncertainty_larger_than_the_value() {
        assert_eq!(of(0.012, 0.34), "0.01 ± 0.34");
        assert_eq!(of(0.0004, 0.0031), "0.0004 ± 0.0031");
        assert_eq!(of(0.0, 0.05), "0.000 ± 0.050");
        assert_eq!(of(3.0, 250.0), "0 ± 250");
    }

    #[test]
    fn there_is_no_minus_zero() {
        assert_eq!(of(-0.001, 0.5), "0.00 ± 0.50");
        assert_eq!(of(-0.0, 0.5), "0.00 ± 0.50");
        assert_eq!(of(-12.0, 400.0), "−10 ± 400");
        assert_eq!(of(-3.0, 400.0), "0 ± 400");
    }

    #[test]
    fn without_an_uncertainty_there_are_three_digits_and_a_question_mark() {
        let of = |value| format_quantity(Quantity::undetermined(value), "m");
        assert_eq!(of(0.781_234), "0.781 ± ? m");
        assert_eq!(of(9.999), "10.0 ± ? m");
        assert_eq!(of(1234.0), "1230 ± ? m");
        assert_eq!(of(0.0), "0 ± ? m");
        assert_eq!(of(-24.06), "−24.1 ± ? m");
        assert_eq!(of(1.25e-7), "(1.25 ± ?)×10⁻⁷ m");
    }

    #[test]
    fn huge_and_small_numbers_share_a_power_of_ten() {
        assert_eq!(of(1.2e-5, 3.4e-6), "(1.20 ± 0.34)×10⁻⁵");
        assert_eq!(of(6.022e23, 1.0e20), "(6.0220 ± 0.0010)×10²³");
        assert_eq!(of(999_996.0, 20.0), "(9.99996 ± 0.00020)×10⁵");
        assert_eq!(of(1e-300, 1e-301), "(1.00 ± 0.10)×10⁻³⁰⁰");
        assert_eq!(of(1e308, 1e307), "(1.00 ± 0.10)×10³⁰⁸");
        assert_eq!(of(2.0e-5, 3.0e-4), "(0.2 ± 3.0)×10⁻⁴");
    }

    #[test]
    fn digits_beyond_a_float_are_not_invented() {
        assert_eq!(of(1.0, 1e-300), "1.00000000000000 ± 10⁻³⁰⁰");
    }

    #[test]
    fn units_and_missing_values() {
        assert_eq!(format_quantity(None, "m"), "—");
        assert_eq!(format_quantity(Quantity::new(0.25, 0.01), "m"), "0.250 ± 0.010 m");
        assert_eq!(format_quantity(Quantity::new(24.1, 0.12), "°"), "24.10 ± 0.12°");
        let broken = Quantity {
            value: f64::NAN,
            std_uncertainty: Some(1.0),
        };
        assert_eq!(format_quantity(Some(broken), "m"), "—");
        let broken = Quantity {
            value: 1.0,
            std_uncertainty: Some(0.0),
        };
        assert_eq!(format_quantity(Some(broken), ""), "1.00 ± ?");
    }

    proptest! {
        /// Whatever is written reads back within half a unit of the last digit, which is under 5 % of the uncertainty.
        #[test]
        fn what_is_written_reads_back(mantissa in -10.0..10.0_f64, decade in -2..4_i32, ratio in -4.0..0.5_f64) {
            let value = mantissa * 10_f64.powi(decade);
            let std = (value.abs() + 1e-9) * 10_f64.powf(ratio);
            let w = written(Quantity::new(value, std)).unwrap();
            let scale = 10_f64.powi(w.power.unwrap_or(0));
            let read = |text: &str| text.replace('−', "-").parse::<f64>().unwrap() * scale;
            prop_assert!((read(&w.value) - value).abs() <= 0.0501 * std, "{value} {std} {w:?}");
            prop_assert!((read(&w.uncertainty) - std).abs() <= 0.0501 * std, "{value} {std} {w:?}");
            let digits = w.uncertainty.replace('.', "");
            prop_assert!(digits.trim_start_matches('0').trim_end_matches('0').len() <= 2);
        }
    }

    #[test]
    fn plain_numbers_lose_their_idle_zeros() {
        assert_eq!(trimmed(240.0, 3), "240");
        assert_eq!(trimmed(29.970_03, 3), "29.97");
        assert_eq!(trimmed(1200.0, 0), "1200");
    }
}
