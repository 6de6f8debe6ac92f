//! Decoding in a thread of its own, a few frames ahead of whoever uses them.

use super::error::FrameError;
use super::pixels::has_room_for_several;
use super::video::FrameSource;
use super::{Frame, SourceInfo, StreamHealth};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::thread::{self, JoinHandle};

/// Frames ahead take at most about this much memory, bytes. More brings nothing: the system has to clear each page first, and a
/// survey beside it keeps all cores busy.
const MEMORY: usize = 15 << 20;

/// Bytes of a frame for each pixel: its own plane, and the decoder's picture that it holds for its colours.
const BYTES_A_PIXEL: usize = 2;

/// More frames than this bring nothing: two cores are busy long before.
const MOST: usize = 64;

/// Runs a [`FrameSource`] in a thread of its own, so that decoding overlaps with the use of the frames.
///
/// Frames and errors come in order. Dropping it stops the thread. Of pictures that memory has no room for several of
/// ([`has_room_for_several`]) a frame is taken from the decoder only when it is asked for: a caller that gives each frame back before it asks for
/// the next holds one at a time.
pub struct ReadAhead {
    info: SourceInfo,
    /// To ask for a frame; `None` where frames come as memory has room for them.
    asking: Option<Sender<()>>,
    /// `None` once the thread has nothing more to give.
    incoming: Option<Receiver<ReadMessage>>,
    used: SyncSender<Frame>,
    health: StreamHealth,
    thread: Option<JoinHandle<()>>,
}

/// What the thread sends: a frame (or the end, or an error) and the health up to it.
struct ReadMessage {
    outcome: Result<Option<Frame>, FrameError>,
    health: StreamHealth,
}

impl ReadAhead {
    /// Starts reading `source`.
    ///
    /// # Errors
    /// The system refuses a thread.
    pub fn start(source: Box<dyn FrameSource + Send>) -> Result<Self, FrameError> {
        let info = source.info().clone();
        let depth = depth(info.width_px, info.height_px);
        let (sender, incoming) = sync_channel(depth);
        let (used, returned) = sync_channel(depth + 1);
        let health = source.health();
        let (asking, asked) = if has_room_for_several((info.width_px, info.height_px)) {
            (None, None)
        } else {
            let (asking, asked) = channel();
            (Some(asking), Some(asked))
        };
        let thread = thread::Builder::new()
            .name("decode".to_owned())
            .spawn(move || run(source, &sender, &returned, asked.as_ref()))
            .map_err(|e| thread_error(&info.path, format!("could not be started: {e}")))?;
        Ok(Self {
            info,
            asking,
            incoming: Some(incoming),
            used,
            health,
            thread: Some(thread),
        })
    }

    /// Waits for the thread; whether it ended well.
    fn join(&mut self) -> bool {
        // The receiver goes first: a thread that waits to send then gets an error and ends.
        self.incoming = None;
        self.asking = None;
        self.thread.take().is_none_or(|thread| thread.join().is_ok())
    }
}

impl FrameSource for ReadAhead {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, FrameError> {
        let Some(incoming) = &self.incoming else {
            return Ok(None);
        };
        if let Some(asking) = &self.asking {
            let _ = asking.send(()); // (A thread that died says nothing below.)
        }
        let Ok(message) = incoming.recv() else {
            // The thread sends an end or an error last, so silence means that it died.
            self.join();
            return Err(thread_error(&self.info.path, "ended without a word".to_owned()));
        };
        self.health = message.health;
        if !matches!(message.outcome, Ok(Some(_))) {
            self.join();
        }
        message.outcome
    }

    fn health(&self) -> StreamHealth {
        self.health.clone()
    }

    fn recycle(&mut self, frame: Frame) {
        // When the thread is gone or has enough, the frame is simply dropped.
        if let Err(TrySendError::Full(frame) | TrySendError::Disconnected(frame)) = self.used.try_send(frame)
        {
            drop(frame);
        }
    }
}

impl Drop for ReadAhead {
    fn drop(&mut self) {
        self.join();
    }
}

/// Frames to decode ahead for pictures of this size: of the largest none but the one that waits to be taken, while the decoder's own threads
/// go on.
fn depth(width: usize, height: usize) -> usize {
    let bytes = width.saturating_mul(height).max(1).saturating_mul(BYTES_A_PIXEL);
    (MEMORY / bytes).min(MOST)
}

fn run(
    mut source: Box<dyn FrameSource + Send>,
    sender: &SyncSender<ReadMessage>,
    returned: &Receiver<Frame>,
    asked: Option<&Receiver<()>>,
) {
    loop {
        if let Some(asked) = asked {
            source.prepare();
            if asked.recv().is_err() {
                return;
            }
        }
        for frame in returned.try_iter() {
            source.recycle(frame);
        }
        let outcome = source.next_frame();
        let last = !matches!(outcome, Ok(Some(_)));
        let health = source.health();
        if sender.send(ReadMessage { outcome, health }).is_err() || last {
            return;
        }
    }
}

fn thread_error(path: &std::path::Path, message: String) -> FrameError {
    FrameError::Thread {
        path: PathBuf::from(path),
        message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{Coded, Luma, LumaRange};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Gives `frames` frames, then fails or ends, and counts what it was asked for.
    struct FakeSource {
        info: SourceInfo,
        frames: usize,
        fails: bool,
        asked: Arc<AtomicUsize>,
        /// Says that a frame was prepared.
        prepared: Option<Sender<()>>,
    }

    impl FakeSource {
        fn boxed(frames: usize, fails: bool) -> (Box<dyn FrameSource + Send>, Arc<AtomicUsize>) {
            let (source, asked) = Self::new(frames, fails);
            (Box::new(source), asked)
        }

        fn new(frames: usize, fails: bool) -> (Self, Arc<AtomicUsize>) {
            let asked = Arc::new(AtomicUsize::new(0));
            let info = SourceInfo {
                path: "fake".into(),
                width_px: 4096,
                height_px: 4096,
                nominal_rate_hz: None,
                frames_expected: None,
                luma_range: LumaRange::FULL,
                codec: String::new(),
                has_time_base: true,
                time_resolution_s: None,
                row_order: crate::frames::RowOrder::Down,
                pixel_aspect: 1.0,
                chroma_grid: None,
                luma_shares: (0.299, 0.114),
            };
            let source = Self {
                info,
                frames,
                fails,
                asked: Arc::clone(&asked),
                prepared: None,
            };
            (source, asked)
        }
    }

    impl FrameSource for FakeSource {
        fn info(&self) -> &SourceInfo {
            &self.info
        }

        fn next_frame(&mut self) -> Result<Option<Frame>, FrameError> {
            let index = self.asked.fetch_add(1, Ordering::SeqCst);
            if index < self.frames {
                let luma = Luma {
                    width: 1,
                    height: 1,
                    data: vec![7],
                };
                Ok(Some(Frame {
                    index,
                    time_s: index as f64,
                    luma,
                    coded: Coded::Whole,
                    colour: None,
                }))
            } else if self.fails {
                Err(FrameError::Empty { path: "fake".into() })
            } else {
                Ok(None)
            }
        }

        fn prepare(&mut self) {
            if let Some(prepared) = &self.prepared {
                prepared.send(()).unwrap();
            }
        }

        fn health(&self) -> StreamHealth {
            StreamHealth {
                frames_read: self.asked.load(Ordering::SeqCst) as u64,
                ..StreamHealth::default()
            }
        }
    }

    #[test]
    fn frames_come_in_order_and_health_belongs_to_the_frame() {
        let (source, _) = FakeSource::boxed(50, false);
        let mut ahead = ReadAhead::start(source).unwrap();
        for i in 0..50 {
            let frame = ahead.next_frame().unwrap().unwrap();
            assert_eq!(frame.index, i);
            assert_eq!(ahead.health().frames_read, i as u64 + 1);
            ahead.recycle(frame);
        }
        assert!(ahead.next_frame().unwrap().is_none());
        assert!(ahead.next_frame().unwrap().is_none());
    }

    #[test]
    fn an_error_comes_after_the_frames_before_it() {
        let (source, _) = FakeSource::boxed(3, true);
        let mut ahead = ReadAhead::start(source).unwrap();
        for _ in 0..3 {
            assert!(ahead.next_frame().unwrap().is_some());
        }
        assert!(matches!(ahead.next_frame(), Err(FrameError::Empty { .. })));
        assert!(ahead.next_frame().unwrap().is_none());
    }

    #[test]
    fn dropping_it_early_stops_the_thread_and_no_more_than_the_depth_was_read() {
        let (source, asked) = FakeSource::boxed(usize::MAX, false);
        let mut ahead = ReadAhead::start(source).unwrap();
        assert!(ahead.next_frame().unwrap().is_some());
        drop(ahead); // joins: a hang would show here
        // One taken, up to 2 in the channel, one in the hand of the thread, one more slot freed by the one taken.
        assert!(asked.load(Ordering::SeqCst) <= 5);
    }

    #[test]
    fn a_large_frame_is_prepared_at_once_and_taken_when_it_is_asked_for() {
        let (mut source, asked) = FakeSource::new(2, false);
        source.info.width_px = 7680;
        let (prepared, is_prepared) = channel();
        source.prepared = Some(prepared);
        let mut ahead = ReadAhead::start(Box::new(source)).unwrap();
        let wait = || {
            let waited = is_prepared.recv_timeout(std::time::Duration::from_secs(60));
            waited.unwrap();
        };
        for taken in 0..2 {
            wait();
            assert_eq!(asked.load(Ordering::SeqCst), taken);
            assert_eq!(ahead.next_frame().unwrap().unwrap().index, taken);
        }
        wait();
        assert!(ahead.next_frame().unwrap().is_none());
    }

    #[test]
    fn the_depth_follows_from_memory() {
        assert_eq!(depth(1920, 1080), 3);
        assert_eq!(depth(3840, 2160), 0);
        assert_eq!(depth(16384, 16384), 0);
        assert_eq!(depth(320, 240), 64);
        assert_eq!(depth(0, 0), 64);
    }
}
