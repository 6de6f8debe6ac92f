//! What the user has to know: what is odd about the file, the time base, the scale, the flight. Each warning names
//! what was found, with numbers, and the key or step that mends it.

pub mod of_clock;
pub mod of_file;
pub mod of_impacts;
pub mod of_launches;
pub mod of_track;
pub mod rejection;

/// A warning: its stable code, and a message as `format!` takes it.
macro_rules! warning {
    ($code:literal, $($message:tt)+) => {
        $crate::pipeline::measurement::Warning { code: $code, message: format!($($message)+) }
    };
}

pub(super) use warning;

/// Up to four digits without trailing zeros.
pub fn rounded(x: f64) -> String {
    let text = if x >= 100.0 {
        format!("{x:.0}")
    } else {
        format!("{x:.2}")
    };
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
