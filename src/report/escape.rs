//! Text from outside as it may stand on a page.

use maud::html;

/// A control character has no place in HTML; a file name may hold one.
pub(super) fn without_controls(text: &str) -> String {
    text.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}")
}

/// Text as it may stand in HTML, in an attribute in double quotes, too.
pub(super) fn escape(text: &str) -> String {
    without_controls(&html! { (text) }.into_string())
}
