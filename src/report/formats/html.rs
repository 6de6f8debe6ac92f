//! `<stem>.report.html`.

use super::{Contents, OutputFormat};
use crate::pipeline::Measurement;
use crate::report::recording_page;
use std::error::Error;

/// The page for people.
pub struct Page;

impl OutputFormat for Page {
    fn name(&self) -> &'static str {
        "html"
    }

    fn suffix(&self) -> &'static str {
        "report.html"
    }

    fn contents<'a>(
        &self,
        measurement: &'a Measurement,
    ) -> Result<Contents<'a>, Box<dyn Error + Send + Sync>> {
        Ok(Contents::Bytes(
            recording_page::report_html(measurement)?.into_bytes(),
        ))
    }
}
