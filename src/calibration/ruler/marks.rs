//! Marks as the page of `track calibrate show` saves them (schema `track.marks/1`), and the calibration they were made on.
//!
//! The page only records where the marks are and what was typed beside them; every sum is done by [`super::calibrate`]. What
//! the page does not show (lens, gravity, spin, ...) comes from `base`, the calibration that it was opened with.

use super::{Calibration, CalibrationError, RulerOrientation, RulerRequest, SCHEMA};
use crate::geometry::PixelPoint;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use thiserror::Error;

/// The schema of a file of marks.
pub const MARKS_SCHEMA: &str = "track.marks/1";

/// Marks on a frame of a recording, as the page of `track calibrate show` saves them.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MarksFile {
    /// `track.marks/1`.
    schema: String,
    /// Width and height of the frame that was marked.
    image_size_px: (usize, usize),
    /// `scale` of the calibration, a ruler's ends among it; without it that of `base`.
    scale: Option<Value>,
    /// How the ruler stood.
    held: Option<RulerOrientation>,
    /// The floor below the ball's first impact, px.
    floor_px: Option<[f64; 2]>,
    /// The launch edge, px.
    edge_px: Option<[f64; 2]>,
    /// Two points on a line along the floor, px.
    floor_line_px: Option<[[f64; 2]; 2]>,
    /// Standard uncertainty of each coordinate of each mark; 1 without it.
    point_std_px: Option<f64>,
    /// m.
    ball_radius_m: Option<f64>,
    /// kg.
    ball_mass_kg: Option<f64>,
    /// The rate at which the camera captured, Hz.
    frame_rate_hz: Option<f64>,
    /// The calibration that the page was opened with.
    base: Option<Map<String, Value>>,
}

/// What makes a file no marks.
#[derive(Debug, Error)]
pub enum MarksError {
    /// It is not a file of marks.
    #[error(
        "{name}: {found}; accepted is a file of marks (schema {MARKS_SCHEMA}) as the page of track calibrate show saves it; \
         make the page anew and save the marks again"
    )]
    NotMarks {
        /// The file.
        name: String,
        /// What is wrong with it.
        found: String,
    },
    /// The calibration that it holds, with what was typed on the page, is none.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// What was marked, for pictures of that size.
#[derive(Debug, Clone)]
pub struct PageMarks {
    /// What [`super::calibrate`] needs.
    pub request: RulerRequest,
    /// Width and height of the frame that was marked.
    pub image_size_px: (usize, usize),
}

impl PageMarks {
    /// The marks in `text`; `name` stands for the file in messages.
    ///
    /// # Errors
    /// See [`MarksError`].
    pub fn parse(text: &str, name: &str) -> Result<Self, MarksError> {
        let wrong = |found: String| MarksError::NotMarks {
            name: name.to_owned(),
            found,
        };
        let file: MarksFile = serde_json::from_str(text).map_err(|e| wrong(e.to_string()))?;
        if file.schema != MARKS_SCHEMA {
            return Err(wrong(format!("its schema is {}", file.schema)));
        }
        let point = |[u, v]: [f64; 2]| PixelPoint::new(u, v);
        let (known, line_kept) = file.known(name)?;
        Ok(Self {
            image_size_px: file.image_size_px,
            request: RulerRequest {
                scale: known.scale.clone(),
                held: file.held,
                up_px: known.up_px,
                up_given: known.up_given,
                // That of the ruler's ends takes its place.
                up_std_rad: known.up_std_rad.filter(|_| file.held.is_none()),
                origin: None,
                floor: file.floor_px.map(point),
                edge: file.edge_px.map(point),
                floor_line: file
                    .floor_line_px
                    .filter(|_| !line_kept)
                    .map(|ends| ends.map(point)),
                point_std_px: file.point_std_px.unwrap_or(1.0),
                snap_px: None,
                known,
            },
        })
    }
}

impl MarksFile {
    /// The calibration without its marks, and whether the line along the floor is the one it has.
    fn known(&self, name: &str) -> Result<(Calibration, bool), CalibrationError> {
        let mut known = self.base.clone().unwrap_or_default();
        known.insert("schema".into(), SCHEMA.into());
        known.insert("image_size_px".into(), json!(self.image_size_px));
        if let Some(scale) = &self.scale {
            known.insert("scale".into(), scale.clone());
        }
        if let Some(Value::Object(scale)) = known.get_mut("scale")
            && scale.contains_key("world_from_pixel")
        {
            // The marks say where the origin is.
            scale.insert("origin_unknown".into(), true.into());
        } else {
            self.drop_homography(&mut known);
        }
        known.remove("origin_px");
        known.remove("origin_std_px");
        let edge_x_m = known
            .get_mut("launch")
            .and_then(Value::as_object_mut)
            .and_then(|launch| launch.remove("edge_x_m"))
            .and_then(|x| x.as_f64());
        let line = json!(self.floor_line_px);
        let mut line_kept = false;
        if let Some(Value::Object(floor)) = known.get_mut("floor") {
            // Ends that nobody moved keep their uncertainty.
            let number = |v: &Value| serde_json::from_value::<[[f64; 2]; 2]>(v.clone()).ok();
            line_kept =
                self.floor_line_px.is_some() && floor.get("line_px").and_then(number) == number(&line);
            if !line_kept {
                floor.remove("line_px");
                floor.remove("line_std_px");
            }
        }
        let ball = known.entry("ball").or_insert_with(|| json!({}));
        if let Value::Object(ball) = ball {
            ball.insert("radius_m".into(), self.ball_radius_m.into());
            ball.insert("mass_kg".into(), self.ball_mass_kg.into());
        }
        known.insert("frame_rate_hz".into(), self.frame_rate_hz.into());
        let mut known = Calibration::parse(&Value::Object(known).to_string(), name)?;
        // Without an origin there is no x axis to place the edge on.
        known.launch.edge_x_m = edge_x_m.filter(|_| self.floor_px.is_some());
        Ok((known, line_kept))
    }

    /// Deviations of a homography that is gone have nothing to refer to.
    fn drop_homography(&self, known: &mut Map<String, Value>) {
        if !known.contains_key("lens") {
            known.remove("deviations");
        }
        let deviations = known.get_mut("deviations").and_then(Value::as_array_mut);
        for deviation in deviations.into_iter().flatten().filter_map(Value::as_object_mut) {
            deviation.remove("world_from_pixel");
        }
    }
}
