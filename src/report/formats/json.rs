//! `<stem>.result.json`.

use super::{Contents, OutputFormat};
use crate::pipeline::Measurement;
use crate::report::documents::json_text;
use crate::report::documents::result::ResultDocument;
use std::error::Error;

/// The result with all its numbers, for programs.
pub struct Json;

impl OutputFormat for Json {
    fn name(&self) -> &'static str {
        "json"
    }

    fn suffix(&self) -> &'static str {
        "result.json"
    }

    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
        Ok(Contents::Bytes(json_text(&ResultDocument::new(measurement))?))
    }
}
