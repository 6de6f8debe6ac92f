//! What every page shares: one file with everything in it, no font, no address; it prints on A4 and reads on a phone. Where
//! scripts do not run, nothing is missing but the sorting of tables.
//!
//! Pages are `maud` templates, which escape whatever is put into them; only finished SVG goes in as it is.

use super::escape::without_controls;
use super::{figure, spin_section, strobe};
use crate::config::made_by::PAGE_MARK;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use thiserror::Error;

/// The style sheet, put into the page itself.
pub(super) const STYLE: &str = include_str!("page.css");

/// Why a page could not be made.
#[derive(Debug, Error)]
pub enum PageError {
    /// A plot failed.
    #[error(transparent)]
    Plot(#[from] figure::PlotError),
    /// The picture failed.
    #[error(transparent)]
    Strobe(#[from] strobe::StrobeError),
    /// The pictures of how the ball turned failed.
    #[error(transparent)]
    Spin(#[from] spin_section::SpinPictureError),
}

/// A whole page; `style` comes after the one that all share.
pub(super) fn document(title: &str, style: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { (body) }
        }
    };
    without_controls(&page.into_string()) + "\n"
}

/// A symbol like `v_ox` or `v_x/v_ox` with its indices lowered.
pub(super) fn symbol_html(symbol: &str) -> Markup {
    html! {
        @for (i, part) in symbol.split('/').enumerate() {
            @if i > 0 { " / " }
            @if let Some((letter, index)) = part.split_once('_') {
                i { (letter) } span.sub { (index) }
            } @else {
                i { (part) }
            }
        }
    }
}

/// Lets tables of class `sortable` be sorted by a click and filtered by words; goes after them, once.
pub(super) fn sorting() -> Markup {
    html! { script { (PreEscaped(include_str!("sortable_table.js"))) } }
}

/// A line of facts.
pub(super) fn fact(name: &str, content: impl maud::Render) -> Markup {
    html! { tr { th scope="row" { (name) } td { (content) } } }
}

/// What the user has to know: the code for programs, the message for people.
pub(super) fn warning(code: &str, message: impl maud::Render) -> Markup {
    html! { p.warning { code { "⚠ " (code) } br; (message) } }
}

/// A page that a script runs, of its `template`: what stands there between two `@` is a name, for which `part` gives what comes in its place.
/// `GENERATOR` is the line by which the program knows its own pages. One pass: a value that looks like a place holder stays what it is.
pub(super) fn filled(template: &str, part: impl Fn(&str) -> Option<String>) -> String {
    let parts = template.split('@').enumerate();
    parts.fold(String::new(), |mut page, (i, text)| {
        let value = match text {
            _ if i % 2 == 0 => None,
            "GENERATOR" => Some([PAGE_MARK, env!("CARGO_PKG_VERSION"), "\">"].concat()),
            _ => part(text),
        };
        page.push_str(value.as_deref().unwrap_or(text));
        page
    })
}

/// `data` for a script element, in which only "<" could end what it holds.
pub(super) fn script_data(data: &serde_json::Value) -> String {
    data.to_string().replace('<', "\\u003c")
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Every tag is closed in order; a page that is cut off or interleaved fails.
    pub(in crate::report) fn assert_well_formed(page: &str) {
        const VOID: [&str; 2] = ["meta", "br"];
        let mut open: Vec<String> = Vec::new();
        let body = page.strip_prefix("<!DOCTYPE html>").unwrap();
        for piece in body.split('<').skip(1) {
            let tag = piece.split('>').next().unwrap();
            assert!(piece.contains('>'), "an open bracket: {piece:.60}");
            if let Some(name) = tag.strip_prefix('/') {
                assert_eq!(open.pop().as_deref(), Some(name), "closing {name}");
            } else if !tag.ends_with('/') {
                let name = tag.split_whitespace().next().unwrap();
                if !VOID.contains(&name) {
                    open.push(name.to_owned());
                }
            }
        }
        assert!(open.is_empty(), "{open:?}");
    }

    #[test]
    fn symbols_get_their_indices() {
        assert_eq!(symbol_html("v_ox").0, "<i>v</i><span class=\"sub\">ox</span>");
        assert!(symbol_html("v_x/v_ox").0.contains(" / "));
    }
}
