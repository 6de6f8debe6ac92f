//! One pass over the recording: every frame looked at once, what moves kept within a budget of memory.
//!
//! The empty scene comes from key frames where the file has enough of them. Elsewhere it comes from the frames that
//! the pass begins with (of large pictures, where memory has no room for enough of these, from few key frames, or from a
//! pass of its own), and the pass keeps frames spread over the recording as it goes. Their scene takes the place of the
//! opening's where both show the same; where they do not (a ball that lay there at first, a light or a camera that
//! moved), the pass is given up and begun anew with the scene of frames from all over the recording.

use super::error::MeasureError;
use super::measurement::Warning;
use super::scene_colours::SceneColours;
use super::sighting_store::SightingStore;
use super::warnings::of_file::of_file;
use crate::calibration::Calibration;
use crate::detect::background::{self, Background};
use crate::detect::blobs::Blob;
use crate::detect::colour::{self, ColourChoice};
use crate::detect::registration::Registration;
use crate::detect::{Detector, FrameReading, Sighting};
use crate::frames::even_clock::{self, EvenClock};
use crate::frames::{
    self, ChromaGrid, Coded, EvenSample, Frame, FrameSource, Luma, SourceInfo, SparseFrames, StreamHealth,
    Wanted,
};
use crate::geometry::PixelPoint;
use crate::numeric::robust::median;
use std::borrow::Cow;
use std::path::Path;

/// Everything seen in a recording.
#[derive(Debug)]
pub struct Decoded {
    /// The file.
    pub info: SourceInfo,
    /// What was wrong with it.
    pub health: StreamHealth,
    /// Time stamp of each frame, s: as the file has it, or as the even clock has it that all stamps are rounded from.
    pub stamps_s: Vec<f64>,
    /// That clock.
    pub even_clock: Option<EvenClock>,
    /// Mean change of each frame against the one before, grey levels.
    pub changes: Vec<Option<f32>>,
    /// Each frame against the reference picture.
    pub registrations: Vec<Registration>,
    /// Moving things in frame order, as many as memory has room for.
    pub sightings: Vec<Sighting>,
    /// Moving things that there were.
    pub moving: usize,
    /// The detector with the background it used.
    pub detector: Detector,
    /// What is odd about the file.
    pub warnings: Vec<Warning>,
    /// The mixture of luma and chroma that was looked at in the place of luma, where luma hardly shows the ball.
    pub colour: Option<ColourChoice>,
    /// The empty scene's colours, for pictures; `None` for a grey recording.
    pub scene_colours: Option<SceneColours>,
}

impl Decoded {
    /// Whether the camera stands still, but for swings.
    pub fn camera_stands_still(&self) -> bool {
        self.detector.background.registrar.fixed
    }

    /// The calibration of the reference picture, in which all is measured: where a camera moves, `calibration` is that of the
    /// first frame. (A swing of a camera that stands is none of that.)
    pub fn calibration_of_reference<'c>(&self, calibration: &'c Calibration) -> Cow<'c, Calibration> {
        let moves = !self.camera_stands_still();
        match self.registrations.first().filter(|r| moves && !r.is_still()) {
            Some(r) => Cow::Owned(calibration.shifted(-r.shift_u_px, -r.shift_v_px)),
            None => Cow::Borrowed(calibration),
        }
    }
}

/// How far the work has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// Frames for the background are being read.
    Survey,
    /// This frame was looked at.
    Frame {
        /// Its index, from 0.
        index: usize,
        /// Frames in all, by the container.
        expected: Option<u64>,
    },
    /// Arcs are being fitted.
    Fit,
}

/// Frames for the background: an odd number, so that the median is one of them; enough that a ball that is seldom
/// in one place never is the median.
const SURVEY_FRAMES: usize = 15;

/// What changes by less than this part of a coloured ball's contrast is not the ball: encoders leave such traces of its chroma where it was.
const LEAST_COLOUR_CHANGE: f64 = 0.1;

/// Frames held at the opening, bytes, where there are no key frames to take the scene from.
const OPENING_BYTES: usize = 64 << 20;

/// Where fewer fit into that, the ball is in one place in most of them, and the scene takes a pass of its own.
const LEAST_OPENING: usize = 2 * SURVEY_FRAMES;

/// Frames looked at together take at most so many bytes, and are so many at most: enough for all cores of a machine while pictures are small.
const TOGETHER_BYTES: usize = 4 << 20;
const MOST_TOGETHER: usize = 8;

/// Two scenes that differ by less than this part of a ball's area are one.
const NEGLIGIBLE_PART: f64 = 0.1;

/// Fewer frames than this hold no impact: three on one side of it, three on the other.
const LEAST_FRAMES: usize = 6;

/// Watches the whole recording, opened as `source`.
///
/// # Errors
///
/// What stops the decoder, or a recording with too few frames.
pub fn decode(
    video: &Path,
    source: Box<dyn FrameSource + Send>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Decoded, MeasureError> {
    let decoded = decode_all(video, source, progress)?;
    match decoded.stamps_s.len() {
        frames @ ..LEAST_FRAMES => Err(MeasureError::NothingToSee {
            path: video.to_owned(),
            frames,
        }),
        _ => Ok(decoded),
    }
}

fn decode_all(
    video: &Path,
    source: Box<dyn FrameSource + Send>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Decoded, MeasureError> {
    progress(Progress::Survey);
    let grid = source.info().chroma_grid;
    let size_px = (source.info().width_px, source.info().height_px);
    let beside = if frames::has_room_for_several(size_px) {
        // It decodes its first frames while the survey does its own.
        Some(frames::ReadAhead::start(source)?)
    } else {
        drop(source);
        None
    };
    let reading = || match beside {
        Some(source) => Ok(source),
        None => frames::ReadAhead::start(frames::open(video)?),
    };
    let is_large = opening_frames(size_px) < LEAST_OPENING;
    let wanted = if is_large { Wanted::Few } else { Wanted::Enough };
    if let Some(found) = frames::open_sparse_at_once(video, SURVEY_FRAMES, wanted)? {
        let SparseFrames {
            frames: survey,
            are_enough,
        } = found;
        let refs: Vec<&Frame> = survey.iter().collect();
        if let Some(choice) = colour::choose(&refs, grid) {
            drop(reading);
            let colours = SceneColours::of_mixed(&refs);
            drop(survey);
            return decode_mixed(video, choice, colours, progress);
        }
        let mut pass = DecodingPass::new(background_of(video, &refs)?);
        if are_enough {
            pass.scene_colours = SceneColours::of(&refs, &pass.detector.background);
        }
        drop(survey);
        if are_enough {
            return pass.whole(reading()?, progress);
        }
        // The pass's first frames lie closer together than these key frames, so that only its end tells better.
        pass.provisional = Some(ProvisionalBackground::new(size_px, usize::MAX));
        return pass.through(video, Vec::new(), reading()?, progress);
    }
    if is_large {
        drop(reading);
        return decode_surveyed(video, grid, progress);
    }
    let mut source = reading()?;
    let (opening, is_all) = opening(&mut source)?;
    let survey = spread_over(&opening);
    if let Some(choice) = colour::choose(&survey, grid) {
        drop(source);
        let colours = SceneColours::of_mixed(&survey);
        drop(opening);
        return decode_mixed(video, choice, colours, progress);
    }
    let mut pass = DecodingPass::new(background_of(video, &survey)?);
    if is_all {
        pass.scene_colours = SceneColours::of(&survey, &pass.detector.background);
    } else {
        pass.provisional = Some(ProvisionalBackground::new(size_px, 2 * opening.len()));
    }
    pass.through(video, opening, source, progress)
}

/// The same after a pass for the scene alone, over all frames that others refer to.
fn decode_surveyed(
    video: &Path,
    grid: Option<ChromaGrid>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Decoded, MeasureError> {
    progress(Progress::Survey);
    let survey = frames::open_sparse_by_pass(video, SURVEY_FRAMES)?;
    let refs: Vec<&Frame> = survey.iter().collect();
    if let Some(choice) = colour::choose(&refs, grid) {
        let colours = SceneColours::of_mixed(&refs);
        drop(survey);
        return decode_mixed(video, choice, colours, progress);
    }
    let mut pass = DecodingPass::new(background_of(video, &refs)?);
    pass.scene_colours = SceneColours::of(&refs, &pass.detector.background);
    drop(survey);
    pass.whole(frames::ReadAhead::start(frames::open(video)?)?, progress)
}

/// The same on a mixture of luma and chroma, of a scene of these `colours`.
fn decode_mixed(
    video: &Path,
    choice: ColourChoice,
    colours: Option<SceneColours>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Decoded, MeasureError> {
    progress(Progress::Survey);
    let mixed = frames::open_sparse_mixed(video, SURVEY_FRAMES, Some(choice.mix))?;
    let scene = background_of(video, &mixed)?.with_least_change(LEAST_COLOUR_CHANGE * choice.contrast_grey);
    let mut pass = DecodingPass::new(scene);
    drop(mixed);
    pass.colour = Some(choice);
    pass.scene_colours = colours;
    let source = frames::open_mixed(video, Some(choice.mix))?;
    pass.whole(frames::ReadAhead::start(source)?, progress)
}

fn background_of(
    video: &Path,
    survey: &[impl std::borrow::Borrow<Frame>],
) -> Result<Background, MeasureError> {
    let lumas: Vec<&Luma> = survey.iter().map(|f| &f.borrow().luma).collect();
    Background::from_survey(&lumas).ok_or_else(|| MeasureError::NothingToSee {
        path: video.to_path_buf(),
        frames: 0,
    })
}

/// How many frames of this size an opening may hold.
fn opening_frames((width_px, height_px): (usize, usize)) -> usize {
    OPENING_BYTES / width_px.saturating_mul(height_px).max(1)
}

/// How many frames of this size are looked at together.
fn frames_together((width_px, height_px): (usize, usize)) -> usize {
    let fit = TOGETHER_BYTES / width_px.saturating_mul(height_px).max(1);
    fit.clamp(1, MOST_TOGETHER)
}

/// The first frames, as many as the survey needs and memory has room for; whether they are all there are.
fn opening(source: &mut frames::ReadAhead) -> Result<(Vec<Frame>, bool), MeasureError> {
    let most = opening_frames((source.info().width_px, source.info().height_px));
    let mut opening = Vec::new();
    while opening.len() < most {
        match source.next_frame()? {
            Some(mut frame) => {
                frame.colour = frame.colour.map(|c| c.detached());
                opening.push(frame);
            }
            None => return Ok((opening, true)),
        }
    }
    Ok((opening, false))
}

/// Whether a frame is stored well enough to show the scene: one that is interpolated between two others is not.
fn shows_the_scene(frame: &Frame) -> bool {
    frame.coded != Coded::Interpolated
}

/// The frames of the survey among `frames`.
fn spread_over(frames: &[Frame]) -> Vec<&Frame> {
    let good: Vec<&Frame> = frames.iter().filter(|f| shows_the_scene(f)).collect();
    frames::evenly_of(good.into_iter(), SURVEY_FRAMES)
}

/// Looks at one frame after the other and keeps what it sees.
struct DecodingPass {
    detector: Detector,
    kept: SightingStore,
    stamps_s: Vec<f64>,
    changes: Vec<Option<f32>>,
    registrations: Vec<Registration>,
    /// Where the scene of the whole is still to be found.
    provisional: Option<ProvisionalBackground>,
    colour: Option<ColourChoice>,
    scene_colours: Option<SceneColours>,
}

/// How a pass over the recording ends.
enum PassEnd {
    /// All is seen.
    Seen(Box<Decoded>),
    /// The scene it began with is not that of the whole.
    OtherScene,
    /// Frames from all over it show a ball that luma hardly shows, and a scene of these colours.
    NeedsColour(Box<(ColourChoice, Option<SceneColours>)>),
}

/// What a scene taken from the opening is checked with.
struct ProvisionalBackground {
    /// Frames for the scene of the whole.
    spread: EvenSample,
    /// After so many frames.
    next_check: usize,
}

impl ProvisionalBackground {
    fn new(size_px: (usize, usize), next_check: usize) -> Self {
        Self {
            spread: EvenSample::for_pictures(SURVEY_FRAMES, size_px),
            next_check,
        }
    }
}

impl DecodingPass {
    fn new(background: Background) -> Self {
        Self {
            detector: Detector::new(background),
            kept: SightingStore::default(),
            stamps_s: Vec::new(),
            changes: Vec::new(),
            registrations: Vec::new(),
            provisional: None,
            colour: None,
            scene_colours: None,
        }
    }

    /// Over all of `source`, with the scene of the whole.
    fn whole(
        self,
        source: frames::ReadAhead,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Decoded, MeasureError> {
        match self.over(Vec::new(), source, progress)? {
            PassEnd::Seen(seen) => Ok(*seen),
            _ => unreachable!("only a provisional scene is given up"),
        }
    }

    /// Over the frames of the `opening` and the rest of `source`, and once more where the scene or the plane turns out to be another.
    fn through(
        self,
        video: &Path,
        opening: Vec<Frame>,
        source: frames::ReadAhead,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<Decoded, MeasureError> {
        let grid = source.info().chroma_grid;
        match self.over(opening, source, progress)? {
            PassEnd::Seen(seen) => Ok(*seen),
            PassEnd::NeedsColour(found) => {
                let (choice, colours) = *found;
                decode_mixed(video, choice, colours, progress)
            }
            PassEnd::OtherScene => decode_surveyed(video, grid, progress),
        }
    }

    /// Over the frames of the `opening` and the rest of `source`; a provisional scene may turn out not to be that of the whole, or
    /// not to be one for luma.
    fn over(
        mut self,
        opening: Vec<Frame>,
        mut source: frames::ReadAhead,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<PassEnd, MeasureError> {
        let mut opening = opening.into_iter();
        let together = frames_together((source.info().width_px, source.info().height_px));
        loop {
            let seen = self.stamps_s.len();
            let until_check = self
                .provisional
                .as_ref()
                .map(|p| p.next_check.saturating_sub(seen).max(1));
            let most = until_check.map_or(together, |frames| frames.min(together));
            let mut frames = Vec::with_capacity(most);
            while frames.len() < most
                && let Some(frame) = opening
                    .next()
                    .map_or_else(|| source.next_frame(), |f| Ok(Some(f)))?
            {
                frames.push(frame);
            }
            if frames.is_empty() {
                break;
            }
            self.look(frames, &mut source, progress);
            let seen = self.stamps_s.len();
            let due = self.provisional.as_mut().filter(|p| p.next_check == seen);
            if let Some(p) = due {
                p.next_check *= 2;
                if !self.shows_its_scene() {
                    return Ok(PassEnd::OtherScene);
                }
            }
        }
        if let Some(provisional) = &self.provisional {
            let spread = provisional.spread.frames();
            if let Some(choice) = colour::choose(&spread, source.info().chroma_grid) {
                let colours = SceneColours::of_mixed(&spread);
                return Ok(PassEnd::NeedsColour(Box::new((choice, colours))));
            }
            let Some((whole, light)) = self.scene_of_the_whole() else {
                return Ok(PassEnd::OtherScene);
            };
            self.scene_colours = SceneColours::of(&spread, &whole);
            self.adopt(whole, &light);
        }
        Ok(PassEnd::Seen(Box::new(self.seen(&source))))
    }

    fn seen(self, source: &frames::ReadAhead) -> Decoded {
        let (sightings, moving) = self.kept.finished();
        let (health, info) = (source.health(), source.info().clone());
        let even = |tick_s| even_clock::evened(&self.stamps_s, tick_s, info.nominal_rate_hz);
        let even = info.time_resolution_s.and_then(even);
        let (stamps_s, even_clock) = match even {
            Some((times_s, clock)) => (times_s, Some(clock)),
            None => (self.stamps_s, None),
        };
        Decoded {
            info,
            warnings: of_file(&health),
            health,
            stamps_s,
            even_clock,
            changes: self.changes,
            registrations: self.registrations,
            sightings,
            moving,
            detector: self.detector,
            colour: self.colour,
            scene_colours: self.scene_colours,
        }
    }

    /// Looks at the next `frames`, which go back to `source` where they are not kept.
    fn look(
        &mut self,
        frames: Vec<Frame>,
        source: &mut frames::ReadAhead,
        progress: &mut dyn FnMut(Progress),
    ) {
        for frame in &frames {
            progress(Progress::Frame {
                index: frame.index,
                expected: source.info().frames_expected,
            });
        }
        let readings = self.detector.look(&frames);
        for (frame, reading) in frames.into_iter().zip(readings) {
            self.keep(frame, reading, source);
        }
    }

    /// Keeps what was read off `frame`.
    fn keep(&mut self, mut frame: Frame, mut reading: FrameReading, source: &mut frames::ReadAhead) {
        if let Some(colour) = frame.colour.take() {
            // A picture shows balls only.
            for s in reading.sightings.iter_mut().filter(|s| s.centre.is_some()) {
                let crop = &s.blob.crop;
                let (us, vs) = (
                    crop.u..crop.u + crop.luma.width,
                    crop.v..crop.v + crop.luma.height,
                );
                s.colours = Some(colour.cut(us, vs, self.colour.is_some()));
            }
            frame.colour = Some(colour);
        }
        self.stamps_s.push(frame.time_s);
        self.changes.push(reading.change_grey);
        self.registrations.push(reading.registration);
        self.kept.add(reading.sightings);
        if let Some(p) = &mut self.provisional
            && shows_the_scene(&frame)
            && p.spread.wants_next()
        {
            frame.colour = frame.colour.map(|c| c.detached());
            p.spread.add(frame);
        } else {
            source.recycle(frame);
        }
    }

    /// The frames kept so far, where the camera does not move; those of a swing are left out.
    fn spread_so_far(&self) -> Option<Vec<&Luma>> {
        let fixed =
            self.detector.background.registrar.fixed || self.registrations.iter().all(Registration::is_still);
        let spread = &self.provisional.as_ref().filter(|_| fixed)?.spread;
        let stands = |f: &&Frame| self.registrations.get(f.index).is_none_or(Registration::is_still);
        let frames = spread.frames().into_iter().filter(stands);
        Some(frames.map(|f| &f.luma).collect())
    }

    /// Whether the frames kept so far show the scene looked at with.
    fn shows_its_scene(&self) -> bool {
        let scene = self.spread_so_far().filter(|lumas| !lumas.is_empty());
        scene.is_some_and(|lumas| {
            let so_far = background::median_of(&lumas);
            self.light_of(&so_far).is_some()
        })
    }

    /// The light of `scene` against that of the scene looked at with; `None` where these are two scenes.
    fn light_of(&self, scene: &Luma) -> Option<Registration> {
        let (light, shown) = self.detector.compare(scene);
        (light.is_still() && self.is_negligible(&shown)).then_some(light)
    }

    /// Whether things that one of two scenes shows are too small to be a ball that lay there, or to hide one: what a codec leaves at an
    /// edge. The measure is the usual round thing that was seen elsewhere (noise among those makes it smaller).
    fn is_negligible(&self, shown: &[Blob]) -> bool {
        let is_there = |at: PixelPoint| shown.iter().any(|blob| blob.crop.contains(at, 0.0));
        let round = self.kept.sightings.iter().filter(|s| s.centre.is_some());
        let elsewhere = round.filter(|s| !is_there(s.blob.centroid));
        let usual_px = median(&mut elsewhere.map(|s| s.blob.area_px).collect::<Vec<_>>());
        let shown_px: f64 = shown.iter().map(|blob| blob.area_px).sum();
        shown_px <= NEGLIGIBLE_PART * usual_px.unwrap_or(0.0)
    }

    /// The scene of the frames kept, with its light against that of the scene looked at with; `None` where these are two scenes,
    /// or where the camera moves.
    fn scene_of_the_whole(&self) -> Option<(Background, Registration)> {
        let whole = Background::from_survey(&self.spread_so_far()?)?;
        let fixed = !whole.registrar.follows_shifts();
        let light = self.light_of(&whole.luma).filter(|_| fixed)?;
        Some((whole, light))
    }

    /// Takes `whole`, whose light against the scene looked at with is `light`, for that scene.
    fn adopt(&mut self, whole: Background, light: &Registration) {
        self.detector = Detector::new(whole);
        for r in &mut self.registrations {
            *r = r.relative_to(light);
        }
        for s in &mut self.kept.sightings {
            s.registration = s.registration.relative_to(light);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Coding, VideoWriter};
    use crate::test_noise::TestNoise;

    const SIZE: (usize, usize) = (1280, 720);
    const FRAMES: usize = 130;

    /// Where the first pixel of a spot is, along both axes.
    const SPOT: usize = 600;

    /// Of which memory has no room for an opening.
    const LARGE_PX: (usize, usize) = (2560, 1440);

    /// A wall in noise, with a ball where `place` says for each frame, and a key frame every `gop`; from frame 50 on it also has a spot of
    /// so many pixels a side.
    fn written(
        path: &Path,
        size_px: (usize, usize),
        gop: usize,
        spot_px: usize,
        place: impl Fn(usize) -> [f64; 2],
    ) {
        let coding = Coding::H264 {
            crf: 24,
            gop: gop.try_into().unwrap(),
            b_frames: 2,
        };
        let mut writer = VideoWriter::create(path, size_px.0, size_px.1, 240.0, coding).unwrap();
        let mut random = TestNoise(1);
        for frame in 0..FRAMES {
            let [u, v] = place(frame);
            let luma = Luma::from_fn(size_px.0, size_px.1, |x, y| {
                let (along, down) = (x as f64 - u, y as f64 - v);
                let is_spot =
                    frame >= 50 && (SPOT..SPOT + spot_px).contains(&x) && (SPOT..SPOT + spot_px).contains(&y);
                let grey = if along * along + down * down < 16.0 * 16.0 {
                    200
                } else if is_spot {
                    100
                } else {
                    60
                };
                grey + random.below(4)
            });
            writer.write(&luma).unwrap();
        }
        writer.finish().unwrap();
    }

    /// What was seen with but two key frames, and how often a frame was looked at.
    fn observed(place: impl Fn(usize) -> [f64; 2]) -> (Decoded, usize) {
        observed_in(SIZE, 100, 0, place)
    }

    fn observed_in(
        size_px: (usize, usize),
        gop: usize,
        spot_px: usize,
        place: impl Fn(usize) -> [f64; 2],
    ) -> (Decoded, usize) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("ball.mp4");
        written(&path, size_px, gop, spot_px, place);
        let mut looks = 0;
        let mut count = |p: Progress| looks += usize::from(matches!(p, Progress::Frame { .. }));
        let seen = decode(&path, frames::open(&path).unwrap(), &mut count).unwrap();
        (seen, looks)
    }

    /// Whether every frame shows the ball where it is, to two pixels.
    fn follows(seen: &Decoded, place: impl Fn(usize) -> [f64; 2]) -> bool {
        (0..FRAMES).all(|frame| {
            let [u, v] = place(frame);
            let mut here = seen.sightings.iter().filter(|s| s.frame == frame);
            here.any(|s| (s.blob.centroid.u_px - u).hypot(s.blob.centroid.v_px - v) < 2.0)
        })
    }

    #[test]
    fn a_scene_that_the_opening_shows_is_looked_at_once() {
        let place = |frame: usize| [60.0 + 8.0 * frame as f64, 300.0];
        let (seen, looks) = observed(place);
        assert_eq!(looks, FRAMES);
        assert!(follows(&seen, place));
    }

    #[test]
    fn a_ball_that_lay_there_at_the_opening_is_no_part_of_the_scene() {
        // The opening holds 72 frames; without a second look a hole would stay where the ball lay.
        let place = |frame: usize| [60.0 + 14.0 * frame.saturating_sub(50) as f64, 300.0];
        let (seen, looks) = observed(place);
        assert_eq!(looks, 2 * FRAMES);
        assert!(follows(&seen, place));
        // The codec leaves a trace of the ball for some frames.
        let hole = |s: &Sighting| s.frame > 90 && s.blob.centroid.u_px < 100.0;
        assert!(!seen.sightings.iter().any(hole));
    }

    #[test]
    fn a_scene_that_changes_by_less_than_a_ball_is_looked_at_once() {
        let place = |frame: usize| [60.0 + 8.0 * frame as f64, 300.0];
        for (spot_px, passes) in [(6, 1), (26, 2)] {
            let (seen, looks) = observed_in(SIZE, 100, spot_px, place);
            assert_eq!(looks, passes * FRAMES, "spot of {spot_px} px a side");
            assert!(follows(&seen, place));
        }
    }

    #[test]
    fn few_key_frames_are_scene_enough_for_large_pictures_and_none_take_a_pass_of_their_own() {
        let place = |frame: usize| [60.0 + 8.0 * frame as f64, 300.0];
        for gop in [40, 200] {
            let (seen, looks) = observed_in(LARGE_PX, gop, 0, place);
            assert_eq!(looks, FRAMES);
            assert!(follows(&seen, place));
        }
    }
}
