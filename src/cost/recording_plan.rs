//! Which settings whole recordings are run at.

use super::centres::ComparedMethod;
use super::todays_tools::Tool;
use crate::detect::centre::Accuracy;

/// Columns and rows of the full picture.
pub(super) const FULL_PX: [usize; 2] = [1280, 720];

/// What a user chooses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordingSetting {
    /// How centres are found.
    pub method: ComparedMethod,
    /// Frames a second.
    pub frame_rate_hz: f64,
    /// How many pixels of the full picture make one, along each side.
    pub reduction: usize,
    /// Of a frame, s.
    pub exposure_s: f64,
    /// Quality of the codec: the constant rate factor of H.264, 0 to 51, less is better.
    pub crf: u8,
}

impl RecordingSetting {
    /// What the program and its scenes take by themselves.
    pub const DEFAULT: Self = Self {
        method: ComparedMethod::Level(Accuracy::Standard),
        frame_rate_hz: 240.0,
        reduction: 1,
        exposure_s: 0.0005,
        crf: 14,
    };

    /// The level of accuracy, where it is this program that finds the centres.
    #[must_use]
    pub fn level(&self) -> Option<Accuracy> {
        match self.method {
            ComparedMethod::Level(level) => Some(level),
            ComparedMethod::Tool(_) => None,
        }
    }

    /// Size of the picture in a word.
    #[must_use]
    pub fn picture(&self) -> &'static str {
        picture_name(self.reduction)
    }

    /// Columns of the picture.
    #[must_use]
    pub fn width_px(&self) -> usize {
        FULL_PX[0] / self.reduction
    }

    /// In how many things it differs from `other`.
    #[must_use]
    pub fn differences(&self, other: &Self) -> usize {
        usize::from(self.method != other.method) + self.camera_differences(other)
    }

    fn camera_differences(&self, other: &Self) -> usize {
        [
            self.frame_rate_hz != other.frame_rate_hz,
            self.reduction != other.reduction,
            self.exposure_s != other.exposure_s,
            self.crf != other.crf,
        ]
        .into_iter()
        .filter(|differs| *differs)
        .count()
    }

    pub(super) fn named(&self) -> Vec<(&'static str, String)> {
        vec![
            ("accuracy", self.method.name().to_owned()),
            ("frame_rate_hz", self.frame_rate_hz.to_string()),
            ("picture", self.picture().to_owned()),
            ("exposure_s", self.exposure_s.to_string()),
            ("crf", self.crf.to_string()),
        ]
    }

    /// The same camera with another way to find centres.
    #[must_use]
    pub fn with(self, method: ComparedMethod) -> Self {
        Self { method, ..self }
    }

    /// Work of one pass over a recording, in the units of [`super::centres`]: a full picture at 240 Hz is 7 passes over a small one.
    pub(super) fn units(&self) -> f64 {
        let pixels = 1.0 / (self.reduction * self.reduction) as f64;
        (0.1 + 0.9 * pixels) * (1.0 + 6.0 * self.frame_rate_hz / 240.0)
    }
}

/// Size of a picture in a word, by how many pixels of the full one make one of its own.
pub(super) fn picture_name(reduction: usize) -> &'static str {
    match reduction {
        1 => "full",
        2 => "half",
        _ => "quarter",
    }
}

/// Which of all that could be combined is run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Design {
    /// Every rate with every picture and exposure at the usual codec quality, and every codec quality with every picture at the usual
    /// rate and exposure. Each accuracy and tool where the exposure is the usual one, else the usual accuracy.
    Grid,
    /// What differs from the usual setting in one thing; each tool everywhere.
    OneAtATime,
}

/// What is run.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingPlan {
    /// What is combined.
    pub design: Design,
    /// From which the others differ; its own values are among those below.
    pub usual: RecordingSetting,
    /// Levels of accuracy.
    pub accuracies: Vec<Accuracy>,
    /// What they are compared with.
    pub tools: Vec<Tool>,
    /// Frames a second.
    pub frame_rates_hz: Vec<f64>,
    /// Pixels of the full picture that make one, along each side: 1, 2 or 4.
    pub reductions: Vec<usize>,
    /// Exposures, s; those longer than a frame's time are left out.
    pub exposures_s: Vec<f64>,
    /// Codec qualities.
    pub crfs: Vec<u8>,
    /// Recordings of each setting.
    pub recordings: u64,
}

impl RecordingPlan {
    /// Minutes.
    #[must_use]
    pub fn full() -> Self {
        Self {
            design: Design::Grid,
            usual: RecordingSetting::DEFAULT,
            accuracies: Accuracy::ALL.to_vec(),
            tools: Tool::ALL.to_vec(),
            frame_rates_hz: vec![30.0, 60.0, 120.0, 240.0, 960.0],
            reductions: vec![1, 2, 4],
            exposures_s: vec![0.0001, 0.0005, 0.0025],
            crfs: vec![14, 20, 26, 32],
            recordings: 4,
        }
    }

    /// Seconds: around half a picture at 60 frames a second, where a recording is rendered and measured in a quarter of the time.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            design: Design::OneAtATime,
            usual: RecordingSetting {
                frame_rate_hz: 60.0,
                reduction: 2,
                ..RecordingSetting::DEFAULT
            },
            frame_rates_hz: vec![60.0, 240.0],
            crfs: vec![14, 23, 32],
            recordings: 2,
            ..Self::full()
        }
    }

    /// The cameras in an order of their own, each with the ways in which its recordings are measured.
    pub(super) fn cameras(&self) -> Vec<(RecordingSetting, Vec<ComparedMethod>)> {
        let mut cameras = Vec::new();
        for &crf in &self.crfs {
            for &exposure_s in &self.exposures_s {
                for &reduction in &self.reductions {
                    for &frame_rate_hz in &self.frame_rates_hz {
                        let camera = RecordingSetting {
                            frame_rate_hz,
                            reduction,
                            exposure_s,
                            crf,
                            ..self.usual
                        };
                        if exposure_s * frame_rate_hz <= 1.0 && self.combines(&camera) {
                            cameras.push((camera, self.methods(&camera)));
                        }
                    }
                }
            }
        }
        cameras
    }

    fn combines(&self, camera: &RecordingSetting) -> bool {
        let is_usual_but_codec =
            camera.frame_rate_hz == self.usual.frame_rate_hz && camera.exposure_s == self.usual.exposure_s;
        match self.design {
            Design::Grid => camera.crf == self.usual.crf || is_usual_but_codec,
            Design::OneAtATime => camera.camera_differences(&self.usual) <= 1,
        }
    }

    fn methods(&self, camera: &RecordingSetting) -> Vec<ComparedMethod> {
        let (every_level, tools) = match self.design {
            Design::Grid => {
                let usual = camera.exposure_s == self.usual.exposure_s;
                (usual, usual)
            }
            Design::OneAtATime => (camera.camera_differences(&self.usual) == 0, true),
        };
        let levels = (self.accuracies.iter().map(|level| ComparedMethod::Level(*level)))
            .filter(|method| every_level || *method == self.usual.method);
        let tools = (self.tools.iter().map(|tool| ComparedMethod::Tool(*tool))).filter(|_| tools);
        levels.chain(tools).collect()
    }

    /// Every way to find centres that it holds.
    pub(super) fn every_method(&self) -> impl Iterator<Item = ComparedMethod> {
        let levels = self.accuracies.iter().map(|level| ComparedMethod::Level(*level));
        levels.chain(self.tools.iter().map(|tool| ComparedMethod::Tool(*tool)))
    }

    /// Work of all, rendering included.
    pub(super) fn units(&self) -> f64 {
        let each = self.cameras();
        let each = each
            .iter()
            .map(|(camera, methods)| camera.units() * (2 + methods.len()) as f64);
        each.sum::<f64>() * self.recordings as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_longer_than_a_frame_is_left_out() {
        let cameras = RecordingPlan::full().cameras();
        assert!(cameras.iter().all(|(c, _)| c.exposure_s * c.frame_rate_hz <= 1.0));
        assert!(cameras.iter().any(|(c, _)| *c == RecordingSetting::DEFAULT));
        // 5 rates with two exposures, 4 with the longest, and 3 other codec qualities at the usual of both; at three sizes.
        assert_eq!(cameras.len(), (5 + 5 + 4 + 3) * 3);
    }

    #[test]
    fn the_quick_plan_has_every_choice_and_no_two_differences() {
        let plan = RecordingPlan::quick();
        let cameras = plan.cameras();
        // The usual one, another rate, two more pictures, exposures, codec qualities.
        assert_eq!(cameras.len(), 1 + 1 + 2 + 2 + 2);
        assert!(
            cameras
                .iter()
                .all(|(c, _)| c.camera_differences(&plan.usual) <= 1)
        );
        let of_usual = cameras.iter().find(|(c, _)| *c == plan.usual).unwrap();
        assert_eq!(of_usual.1.len(), 5);
    }
}
