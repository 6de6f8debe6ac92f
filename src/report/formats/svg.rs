//! `<stem>.picture.svg`, `<stem>.x.svg`, `<stem>.z.svg`: the figures of the page, a file each, for a thesis: black on white, 8 cm wide with words of
//! 8 points.
//!
//! Of several launches they are the first's, as the top of the result is; in a view from above `z.svg` holds y.

use super::{Contents, OutputFormat};
use crate::pipeline::Measurement;
use crate::report::figure::PlotUse;
use crate::report::strobe;
use crate::report::track_plots::{Coordinate, coordinate_plot};
use std::error::Error;

/// A figure in a file of its own.
pub enum FigureFile {
    /// The ball cut out of its frames, with the arcs.
    Picture,
    /// x against time.
    X,
    /// z against time.
    Z,
}

impl OutputFormat for FigureFile {
    fn name(&self) -> &'static str {
        "svg"
    }

    fn suffix(&self) -> &'static str {
        match self {
            Self::Picture => "picture.svg",
            Self::X => "x.svg",
            Self::Z => "z.svg",
        }
    }

    fn is_extra(&self) -> bool {
        true
    }

    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
        let plot =
            |coordinate| coordinate_plot(measurement, coordinate, PlotUse::Column).map(|p| p.map(|p| p.svg));
        let svg = match self {
            Self::Picture => strobe::strobe_picture(measurement, 1)?.map(|picture| picture.svg),
            Self::X => plot(Coordinate::Along)?,
            Self::Z => plot(Coordinate::Up)?,
        };
        Ok(svg.map_or(Contents::Nothing, |svg| Contents::Bytes(svg_file(&svg))))
    }
}

/// An `<svg>` element as a file of its own.
pub(super) fn svg_file(element: &str) -> Vec<u8> {
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{element}\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::test_measurements;

    fn svg(figure: &FigureFile) -> String {
        match figure.contents(&test_measurements::two_bounces()).unwrap() {
            Contents::Bytes(bytes) => String::from_utf8(bytes).unwrap(),
            _ => panic!("no figure"),
        }
    }

    #[test]
    fn figures_are_whole_files_with_words_of_8_points() {
        for figure in [FigureFile::X, FigureFile::Z] {
            let svg = svg(&figure);
            let document = roxmltree::Document::parse(&svg).unwrap();
            let root = document.root_element();
            assert_eq!(root.attribute("width"), Some("80mm"));
            let sides: Vec<f64> = root
                .attribute("viewBox")
                .unwrap()
                .split(' ')
                .map(|x| x.parse().unwrap())
                .collect();
            let points = 80.0 / 25.4 * 72.0 / sides[2];
            let words = document.descendants().filter(|n| n.has_tag_name("text"));
            let sizes: Vec<f64> = words
                .map(|n| points * n.attribute("font-size").unwrap().parse::<f64>().unwrap())
                .collect();
            assert!(
                sizes.len() > 8 && sizes.iter().all(|size| *size > 8.0),
                "{sizes:?}"
            );
        }
        assert!(roxmltree::Document::parse(&svg(&FigureFile::Picture)).is_ok());
        let empty = test_measurements::nothing_seen();
        let nothing = FigureFile::X.contents(&empty).unwrap();
        assert!(matches!(nothing, Contents::Nothing));
    }
}
