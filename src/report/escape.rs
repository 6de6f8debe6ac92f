//! Text from outside as it may stand on a page.

use maud::html;
use std::borrow::Cow;

/// A control character has no place in HTML; a file name may hold one.
pub(super) fn without_controls(text: &str) -> String {
    text.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}")
}

/// A name as it may stand on a line of its own: in quotes with its escapes where it holds characters that move the cursor.
pub fn on_one_line(name: &str) -> Cow<'_, str> {
    if name.chars().any(char::is_control) {
        Cow::Owned(format!("{name:?}"))
    } else {
        Cow::Borrowed(name)
    }
}

/// Text as it may stand in HTML, in an attribute in double quotes, too.
pub(super) fn escape(text: &str) -> String {
    without_controls(&html! { (text) }.into_string())
}
