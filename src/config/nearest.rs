//! The known name nearest to one that is not known.

/// How near a name has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Closeness {
    /// The name is refused anyway, so that a wide guess helps: also a unit left out or a word too many ("radius",
    /// "fps_frame_rate_hz").
    Guess,
    /// The name may well be meant as it is (a column that a fit does not use), so that only a clear slip counts: at most two
    /// letters, and no more than one in four.
    Slip,
}

/// The one of `known` that `name` may have been meant to be, small and capital letters being the same.
pub fn nearest<'a>(
    name: &str,
    known: impl IntoIterator<Item = &'a str>,
    closeness: Closeness,
) -> Option<&'a str> {
    let name = name.to_lowercase();
    let likeness = |known: &str| match closeness {
        Closeness::Guess => {
            let part = name.len() > 2 && (known.starts_with(&name) || name.starts_with(known));
            let likeness = strsim::jaro_winkler(&name, known).max(if part { 0.9 } else { 0.0 });
            (likeness > 0.75).then_some(likeness)
        }
        Closeness::Slip => {
            let slips = strsim::damerau_levenshtein(&name, known);
            // Two slips in a short name make another name.
            (slips > 0 && slips <= 2 && 4 * slips <= known.len()).then_some(-(slips as f64))
        }
    };
    // Of several that are as near, the first in the alphabet: it does not depend on the order of `known`.
    known
        .into_iter()
        .filter_map(|known| Some((likeness(known)?, known)))
        .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(a.1)))
        .map(|(_, known)| known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guess_is_wide_and_a_slip_is_not() {
        let known = ["radius_m", "frame_rate_hz", "drag"];
        for (name, meant) in [
            ("radius", "radius_m"),
            ("fram_rate_hz", "frame_rate_hz"),
            ("Drga", "drag"),
        ] {
            assert_eq!(nearest(name, known, Closeness::Guess), Some(meant));
        }
        assert_eq!(nearest("weather", known, Closeness::Guess), None);
        assert_eq!(
            nearest("fram_rate_hz", known, Closeness::Slip),
            Some("frame_rate_hz")
        );
        assert_eq!(nearest("radius", known, Closeness::Slip), Some("radius_m"));
        assert_eq!(nearest("drga", known, Closeness::Slip), Some("drag"));
        assert_eq!(nearest("drag", known, Closeness::Slip), None, "it is known");
        assert_eq!(nearest("rate", known, Closeness::Slip), None);
    }
}
