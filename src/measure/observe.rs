//! One pass over the recording: every frame looked at once, what moves kept within a budget of memory.

use super::{MeasureError, Progress};
use crate::detect::background::Background;
use crate::detect::blobs::Crop;
use crate::detect::registration::Registration;
use crate::detect::{Detector, Sighting};
use crate::frames::{self, FrameSource, Luma, SourceInfo, StreamHealth};
use std::collections::VecDeque;
use std::path::Path;

/// Everything seen in a recording.
#[derive(Debug)]
pub struct Observation {
    /// The file.
    pub info: SourceInfo,
    /// What was wrong with it.
    pub health: StreamHealth,
    /// Time stamp of each frame, s.
    pub stamps_s: Vec<f64>,
    /// Mean change of each frame against the one before, grey levels.
    pub changes: Vec<Option<f32>>,
    /// Each frame against the reference picture.
    pub registrations: Vec<Registration>,
    /// Moving things in frame order.
    pub sightings: Vec<Sighting>,
    /// The detector with the background it used.
    pub detector: Detector,
}

/// Frames for the background: an odd number, so that the median is one of them; enough that a ball that is seldom
/// in one place never is the median.
const SURVEY_FRAMES: usize = 15;

/// Pixels kept of all sightings together, bytes. With decoder, survey and frames in flight the whole stays below
/// 300 MB at 1080p.
const CROPS_BUDGET_BYTES: usize = 80 << 20;

/// Watches the whole recording, opened as `source`.
///
/// # Errors
///
/// What stops the decoder, or a recording without frames.
pub fn observe(
    video: &Path,
    source: Box<dyn FrameSource + Send>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Observation, MeasureError> {
    progress(Progress::Survey);
    // It decodes its first frames while the survey does its own.
    let mut source = frames::ReadAhead::start(source)?;
    let survey: Vec<Luma> = frames::open_sparse(video, SURVEY_FRAMES)?
        .into_iter()
        .map(|f| f.luma)
        .collect();
    let info = source.info().clone();
    let background = Background::from_survey(&survey).ok_or_else(|| MeasureError::NothingToSee {
        path: video.to_path_buf(),
        frames: 0,
    })?;
    drop(survey);
    let mut detector = Detector::new(background);
    let mut kept = Kept::default();
    let (mut stamps_s, mut changes, mut registrations) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(frame) = source.next_frame()? {
        let reading = detector.look(&frame);
        stamps_s.push(frame.time_s);
        changes.push(reading.change_grey);
        registrations.push(reading.registration);
        kept.add(reading.sightings);
        progress(Progress::Frame {
            index: frame.index,
            expected: info.frames_expected,
        });
        source.recycle(frame);
    }
    let health = source.health();
    Ok(Observation {
        info,
        health,
        stamps_s,
        changes,
        registrations,
        sightings: kept.sightings,
        detector,
    })
}

/// Sightings whose pixels are let go when the budget is spent: first of what is no ball, the oldest first.
#[derive(Default)]
struct Kept {
    sightings: Vec<Sighting>,
    shapeless: VecDeque<usize>,
    round: VecDeque<usize>,
    bytes: usize,
}

impl Kept {
    fn add(&mut self, new: Vec<Sighting>) {
        for s in new {
            self.bytes += s.blob.crop.luma.data.len();
            let queue = if s.centre.is_some() {
                &mut self.round
            } else {
                &mut self.shapeless
            };
            queue.push_back(self.sightings.len());
            self.sightings.push(s);
        }
        while self.bytes > CROPS_BUDGET_BYTES {
            let Some(i) = self.shapeless.pop_front().or_else(|| self.round.pop_front()) else {
                break;
            };
            let crop = &mut self.sightings[i].blob.crop;
            self.bytes -= crop.luma.data.len();
            *crop = Crop {
                u: crop.u,
                v: crop.v,
                luma: Luma {
                    width: 0,
                    height: 0,
                    data: Vec::new(),
                },
            };
        }
    }
}
