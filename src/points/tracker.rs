//! Files of Tracker (physlets.org/tracker): `.trk`, XML, and `.trz`, a zip archive with one in it.
//!
//! | in the file | here |
//! |---|---|
//! | lengths in the picture count from the top-left corner of the first pixel | from its centre: half a pixel less |
//! | `xscale`, `yscale`: px a unit of length | the same |
//! | `angle`: of the x axis against the picture's rows, degrees, anticlockwise as seen | rad |
//! | `delta_t`: ms from frame to frame, one for the whole clip | s |
//! | `framedata` of a `PointMass`: places by the number of their frame | [`TrackerMass::places`] |
//!
//! Tracker reads its files line by line, a property a line; so they are written. Assumed: origin, angle and scale are those of the first frame that gives them
//! (Tracker can change them from frame to frame).

use crate::config::{FileError, FileKind, FileProblem, clipped, read_bytes};
use crate::geometry::PixelPoint;
use roxmltree::{Document, Node};
use std::fmt::Write as _;
use std::io::{Cursor, Read as _};
use std::path::Path;

/// A file of Tracker, for messages.
static KIND: FileKind = FileKind {
    what: "Tracker file",
    form: "XML as Tracker saves it (.trk), or a zip archive with that (.trz)",
    source: "in Tracker: File, Save Tab As",
    least: "a TrackerPanel",
};

/// A `.trz` may hold its video.
const LARGEST_FILE_BYTES: u64 = 4 << 30;

/// The XML of hours of clicked points is smaller.
const LARGEST_XML_BYTES: u64 = 200 << 20;

/// Tracker counts from a pixel's corner.
const CORNER_PX: f64 = 0.5;

const PANEL: &str = "org.opensourcephysics.cabrillo.tracker.TrackerPanel";
const MASS: &str = "org.opensourcephysics.cabrillo.tracker.PointMass";
const COORDS: &str = "org.opensourcephysics.media.core.ImageCoordSystem";

/// What a file of Tracker says.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackerFile {
    /// Width and height of the picture.
    pub size_px: Option<(f64, f64)>,
    /// From frame to frame, s.
    pub step_s: Option<f64>,
    /// The first frame of the clip, and its time, s.
    pub start: (usize, f64),
    /// Origin of the axes.
    pub origin: PixelPoint,
    /// Of the x axis against the picture's rows, rad, anticlockwise as seen.
    pub angle_rad: f64,
    /// Pixels a unit of length, along x and y.
    pub scale_px: (f64, f64),
    /// The name of that unit, where the file gives one.
    pub length_unit: Option<String>,
    /// What was marked.
    pub masses: Vec<TrackerMass>,
}

/// A point mass: a thing marked frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackerMass {
    /// What it is called.
    pub name: String,
    /// In Tracker's unit, kg; 1 where nobody set it.
    pub mass_kg: Option<f64>,
    /// Frames and centres, in order.
    pub places: Vec<(usize, PixelPoint)>,
}

/// Reads the file at `path`.
///
/// # Errors
/// See [`FileError`].
pub fn read(path: &Path) -> Result<TrackerFile, FileError> {
    let name = path.display().to_string();
    let bytes = read_bytes(path, &KIND, LARGEST_FILE_BYTES)?;
    let bytes = if bytes.starts_with(b"PK\x03\x04") {
        unzipped(bytes).map_err(|found| wrong_form(&name, found, "save it in Tracker again, as .trk"))?
    } else {
        bytes
    };
    parse(&String::from_utf8_lossy(&bytes), &name)
}

fn wrong_form(name: &str, found: String, hint: &str) -> FileError {
    FileError::WrongForm {
        name: name.to_owned(),
        kind: &KIND,
        found,
        hint: hint.to_owned(),
    }
}

/// The `.trk` in an archive.
fn unzipped(bytes: Vec<u8>) -> Result<Vec<u8>, String> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let names = archive.file_names().filter_map(Result::ok);
    let inside: Vec<String> = names.map(|name| name.into_owned()).collect();
    let is_trk = |name: &&String| name.to_lowercase().ends_with(".trk");
    let Some(name) = inside.iter().filter(is_trk).min_by_key(|name| name.len()) else {
        return Err("an archive without a .trk in it".to_owned());
    };
    let file = archive.by_name(name).map_err(|e| e.to_string())?;
    let mut xml = Vec::new();
    file.take(LARGEST_XML_BYTES)
        .read_to_end(&mut xml)
        .map_err(|e| e.to_string())?;
    Ok(xml)
}

/// What is in the `text` of the file `name`.
///
/// # Errors
/// See [`FileError`].
pub fn parse(text: &str, name: &str) -> Result<TrackerFile, FileError> {
    let text = text.trim_start_matches('\u{feff}');
    let document =
        Document::parse(text).map_err(|e| wrong_form(name, e.to_string(), "save it in Tracker again"))?;
    let objects = || document.descendants().filter(|n| n.has_tag_name("object"));
    let of_class = |class: &'static str| objects().filter(move |n| n.attribute("class") == Some(class));
    let Some(panel) = of_class(PANEL).next() else {
        let class = document.root_element().attribute("class").unwrap_or_default();
        let found = format!("no TrackerPanel in it (its first object is {:?})", clipped(class));
        return Err(wrong_form(
            name,
            found,
            "give the .trk of a tab, not of a tab set or a library",
        ));
    };
    let mut problems = Vec::new();
    let coords = of_class(COORDS)
        .next()
        .and_then(|c| frames(c).next())
        .map(|(_, axes)| axes);
    let Some(axes) = coords else {
        problems.push(FileProblem::new(
            "coords",
            "nothing",
            "origin, angle and scale of the axes",
            "calibrate in Tracker and save again",
        ));
        return Err(FileError::Invalid {
            name: name.to_owned(),
            problems,
        });
    };
    let mut needed = |key: &str, accepts: fn(f64) -> bool, accepted: &str| {
        let found = number(axes, key);
        if !found.is_some_and(accepts) {
            let found = property(axes, key).and_then(|n| n.text()).unwrap_or("nothing");
            problems.push(FileProblem::new(
                format!("coords.{key}"),
                clipped(found),
                accepted,
                "calibrate in Tracker and save again",
            ));
        }
        found.unwrap_or(f64::NAN)
    };
    let finite = |x: f64| x.is_finite();
    let above_zero = |x: f64| x.is_finite() && x > 0.0;
    let origin = PixelPoint::new(
        needed("xorigin", finite, "a number") - CORNER_PX,
        needed("yorigin", finite, "a number") - CORNER_PX,
    );
    let angle_deg = needed("angle", finite, "a number");
    let scale_px = (
        needed("xscale", above_zero, "a number above 0"),
        needed("yscale", above_zero, "a number above 0"),
    );
    if !problems.is_empty() {
        return Err(FileError::Invalid {
            name: name.to_owned(),
            problems,
        });
    }
    let clip = |key: &str| objects().find_map(|o| number(o, key));
    let size = |key: &str| number(panel, key).filter(|x| *x >= 1.0);
    Ok(TrackerFile {
        size_px: size("width").zip(size("height")),
        step_s: clip("delta_t").filter(|ms| *ms > 0.0).map(|ms| ms / 1000.0),
        start: (
            clip("startframe").filter(|n| *n >= 0.0).unwrap_or(0.0) as usize,
            clip("starttime").unwrap_or(0.0) / 1000.0,
        ),
        origin,
        angle_rad: angle_deg.to_radians(),
        scale_px,
        length_unit: property(panel, "length_unit")
            .and_then(|n| n.text())
            .map(str::to_owned),
        masses: of_class(MASS)
            .map(mass)
            .filter(|m| !m.places.is_empty())
            .collect(),
    })
}

fn mass(object: Node<'_, '_>) -> TrackerMass {
    let place = |(frame, data): (usize, Node<'_, '_>)| {
        let (x, y) = number(data, "x").zip(number(data, "y"))?;
        Some((frame, PixelPoint::new(x - CORNER_PX, y - CORNER_PX)))
    };
    let mut places: Vec<_> = frames(object).filter_map(place).collect();
    places.sort_by_key(|(frame, _)| *frame);
    TrackerMass {
        name: property(object, "name")
            .and_then(|n| n.text())
            .unwrap_or("mass")
            .to_owned(),
        mass_kg: number(object, "mass"),
        places,
    }
}

/// The property of an object itself.
fn property<'a, 'i>(object: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    object
        .children()
        .find(|n| n.has_tag_name("property") && n.attribute("name") == Some(name))
}

fn number(object: Node<'_, '_>, name: &str) -> Option<f64> {
    let number: f64 = property(object, name)?.text()?.trim().parse().ok()?;
    number.is_finite().then_some(number)
}

/// Numbers and objects of an object's `framedata`.
fn frames<'a, 'i>(object: Node<'a, 'i>) -> impl Iterator<Item = (usize, Node<'a, 'i>)> {
    let all = property(object, "framedata");
    let entries = all.into_iter().flat_map(|n| n.children());
    entries.filter_map(|entry| {
        let number = entry.attribute("name")?.strip_prefix('[')?.strip_suffix(']')?;
        let data = entry.children().find(|n| n.has_tag_name("object"))?;
        Some((number.parse().ok()?, data))
    })
}

impl TrackerFile {
    /// Time of a frame, s.
    #[must_use]
    pub fn time_s(&self, frame: usize) -> Option<f64> {
        let (first, first_s) = self.start;
        Some(first_s + (frame as f64 - first as f64) * self.step_s?)
    }

    /// The masses' places as a table that [`super::table`] reads.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = "frame,time_s,u_px,v_px,particle\n".to_owned();
        for (particle, mass) in self.masses.iter().enumerate() {
            for (frame, place) in &mass.places {
                let time = self.time_s(*frame).map_or_else(String::new, |t| t.to_string());
                // Writing into a string cannot fail.
                let _ = writeln!(text, "{frame},{time},{},{},{particle}", place.u_px, place.v_px);
            }
        }
        text
    }

    /// The file as Tracker reads it.
    #[must_use]
    pub fn to_xml(&self) -> String {
        let mut xml = Xml::default();
        let (width, height) = self.size_px.unwrap_or((0.0, 0.0));
        let steps = self
            .masses
            .iter()
            .filter_map(|m| m.places.last())
            .map(|p| p.0 + 1)
            .max();
        let (first, first_s) = self.start;
        xml.line("<?xml version=\"1.0\" encoding=\"UTF-8\"?>");
        xml.open_object(PANEL);
        xml.text("semantic_version", "6.2.0");
        xml.number("width", width);
        xml.number("height", height);
        if let Some(unit) = &self.length_unit {
            xml.text("length_unit", unit);
        }
        xml.open("videoclip", "object", None);
        xml.open_object("org.opensourcephysics.media.core.VideoClip");
        xml.whole("startframe", first);
        xml.whole("stepsize", 1);
        xml.whole("stepcount", steps.unwrap_or(1).saturating_sub(first));
        xml.number("starttime", 1000.0 * first_s);
        xml.close_object();
        xml.close();
        xml.open("clipcontrol", "object", None);
        xml.open_object("org.opensourcephysics.media.core.StepperClipControl");
        xml.number("rate", 1.0);
        if let Some(step_s) = self.step_s {
            xml.number("delta_t", 1000.0 * step_s);
        }
        xml.whole("frame", first);
        xml.close_object();
        xml.close();
        xml.open("coords", "object", None);
        xml.open_object(COORDS);
        for (key, value) in [
            ("fixedorigin", "true"),
            ("fixedangle", "true"),
            ("fixedscale", "true"),
            ("locked", "false"),
        ] {
            xml.property(key, "boolean", value);
        }
        xml.open(
            "framedata",
            "array",
            Some("[Lorg.opensourcephysics.media.core.ImageCoordSystem$FrameData;"),
        );
        xml.open("[0]", "object", None);
        xml.open_object("org.opensourcephysics.media.core.ImageCoordSystem$FrameData");
        xml.number("xorigin", self.origin.u_px + CORNER_PX);
        xml.number("yorigin", self.origin.v_px + CORNER_PX);
        xml.number("angle", self.angle_rad.to_degrees());
        xml.number("xscale", self.scale_px.0);
        xml.number("yscale", self.scale_px.1);
        xml.close_object();
        xml.close();
        xml.close();
        xml.close_object();
        xml.close();
        xml.open("tracks", "collection", Some("java.util.ArrayList"));
        for mass in &self.masses {
            xml.mass(mass);
        }
        xml.close();
        xml.close_object();
        xml.0
    }
}

/// Lines of XML.
#[derive(Default)]
struct Xml(String);

impl Xml {
    fn line(&mut self, line: &str) {
        self.0.push_str(line);
        self.0.push('\n');
    }

    fn property(&mut self, name: &str, kind: &str, value: &str) {
        let value = value
            .replace('&', "&amp;")
            .replace('<', "&lt;")
            .replace('>', "&gt;")
            .replace(['\n', '\r'], " ");
        self.line(&format!(
            "<property name=\"{name}\" type=\"{kind}\">{value}</property>"
        ));
    }

    fn text(&mut self, name: &str, value: &str) {
        self.property(name, "string", value);
    }

    /// The shortest digits that read back as the same number.
    fn number(&mut self, name: &str, value: f64) {
        self.property(name, "double", &format!("{value:?}"));
    }

    fn whole(&mut self, name: &str, value: usize) {
        self.property(name, "int", &value.to_string());
    }

    fn open(&mut self, name: &str, kind: &str, class: Option<&str>) {
        let class = class.map_or_else(String::new, |c| format!(" class=\"{c}\""));
        self.line(&format!("<property name=\"{name}\" type=\"{kind}\"{class}>"));
    }

    fn close(&mut self) {
        self.line("</property>");
    }

    fn open_object(&mut self, class: &str) {
        self.line(&format!("<object class=\"{class}\">"));
    }

    fn close_object(&mut self) {
        self.line("</object>");
    }

    fn mass(&mut self, mass: &TrackerMass) {
        self.open("item", "object", None);
        self.open_object(MASS);
        if let Some(mass_kg) = mass.mass_kg {
            self.number("mass", mass_kg);
        }
        self.text("name", &mass.name);
        self.open(
            "framedata",
            "array",
            Some("[Lorg.opensourcephysics.cabrillo.tracker.PointMass$FrameData;"),
        );
        for (frame, place) in &mass.places {
            self.open(&format!("[{frame}]"), "object", None);
            self.open_object("org.opensourcephysics.cabrillo.tracker.PointMass$FrameData");
            self.number("x", place.u_px + CORNER_PX);
            self.number("y", place.v_px + CORNER_PX);
            self.close_object();
            self.close();
        }
        self.close();
        self.close_object();
        self.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> TrackerFile {
        TrackerFile {
            size_px: Some((1280.0, 720.0)),
            step_s: Some(1.0 / 240.0),
            start: (4, 0.1),
            origin: PixelPoint::new(120.0, 660.25),
            angle_rad: 0.01,
            scale_px: (1250.0, 1250.0),
            length_unit: Some("m".to_owned()),
            masses: vec![TrackerMass {
                name: "ball <1> & co".to_owned(),
                mass_kg: Some(0.0639),
                places: vec![
                    (4, PixelPoint::new(0.1 + 0.2, 1.0 / 3.0)),
                    (7, PixelPoint::new(1e3, 123.456_789_012_345)),
                ],
            }],
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let again = parse(&file().to_xml(), "a.trk").unwrap();
        let (a, b) = (file(), again);
        for (p, q) in a.masses[0].places.iter().zip(&b.masses[0].places) {
            assert!(p.0 == q.0 && p.1.distance_px(q.1) < 1e-9);
        }
        assert!(a.origin.distance_px(b.origin) < 1e-9 && (a.angle_rad - b.angle_rad).abs() < 1e-15);
        assert_eq!(a.masses[0].name, b.masses[0].name);
        assert_eq!((a.size_px, a.start, a.scale_px), (b.size_px, b.start, b.scale_px));
        assert!((a.time_s(7).unwrap() - b.time_s(7).unwrap()).abs() < 1e-12);
        // Tracker reads line by line.
        assert!(a.to_xml().lines().all(|l| l.matches("<property").count() <= 1));
    }

    #[test]
    fn indented_files_with_other_tracks_are_read() {
        let plain = file().to_xml();
        let indented = plain.replace("<property", "    <property").replace(
            "<property name=\"tracks\"",
            "<property name=\"magnification\" type=\"double\">1.26</property>\n    <property name=\"tracks\"",
        );
        assert_eq!(parse(&indented, "a.trk").unwrap().masses.len(), 1);
    }

    #[test]
    fn what_is_wrong_is_told() {
        let message = |text: &str| parse(text, "a.trk").unwrap_err().to_string();
        assert!(message("no XML").contains("a.trk"));
        assert!(message("<object class=\"x\"/>").contains("no TrackerPanel"));
        let broken = file().to_xml().replace(
            "<property name=\"xscale\" type=\"double\">1250.0",
            "<property name=\"xscale\" type=\"double\">0.0",
        );
        assert!(message(&broken).contains("coords.xscale: found 0.0"));
        let cut = file().to_xml();
        assert!(message(&cut[..cut.len() / 2]).contains("a.trk"));
    }

    #[test]
    fn an_archive_holds_the_file() {
        use std::io::Write as _;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("clip.trz");
        let mut archive = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file("videos/clip.mp4", options).unwrap();
        archive.write_all(b"not read").unwrap();
        archive.start_file("clip.trk", options).unwrap();
        archive.write_all(file().to_xml().as_bytes()).unwrap();
        archive.finish().unwrap();
        assert_eq!(read(&path).unwrap().masses.len(), 1);
    }
}
