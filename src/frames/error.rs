//! Why a recording could not be read.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

const KINDS: &str = "a video file (mp4, mov, avi, mkv, gif, ...) or a folder of numbered images";

/// Why a recording could not be read: what, where, what was found, what is accepted, what to try.
#[derive(Debug, Error)]
pub enum FrameError {
    /// There is nothing of that name.
    #[error("cannot read {}: there is no such file or folder; check the spelling of the path", path.display())]
    Missing {
        /// As the user named it.
        path: PathBuf,
    },
    /// The system does not let us read.
    #[error(
        "cannot read {}: {source}; check that you may read it (ls -l) and that its disk is there", path.display()
    )]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A device, a pipe or a socket.
    #[error(
        "cannot read {}: it is neither a file nor a folder (a device or a pipe); accepted is {KINDS}: \
         save the recording to a file first", path.display()
    )]
    NotAFile {
        /// As the user named it.
        path: PathBuf,
    },
    /// A file of no bytes.
    #[error("cannot read {}: the file is empty (0 bytes); copy it again from the camera", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Not a recording by its content.
    #[error(
        "cannot read {}: its content is not a video, whatever its name says; accepted is {KINDS}", path.display()
    )]
    NotVideo {
        /// The file.
        path: PathBuf,
    },
    /// A playlist, a script, a session description: it names other files or hosts.
    #[error(
        "cannot read {}: its content is {found}, which is refused because it is no container of video and may name \
         other files or hosts; accepted is {KINDS}: give the video itself", path.display()
    )]
    Refused {
        /// The file.
        path: PathBuf,
        /// What it is.
        found: String,
    },
    /// One picture.
    #[error(
        "cannot read {}: it is a single picture, {found}; accepted is {KINDS}: give the folder that holds the \
         numbered images", path.display()
    )]
    StillImage {
        /// The file.
        path: PathBuf,
        /// What it is.
        found: String,
    },
    /// Sound without pictures.
    #[error(
        "cannot read {}: there is no video stream in it, only sound or data ({found}); accepted is {KINDS}",
        path.display()
    )]
    NoVideoStream {
        /// The file.
        path: PathBuf,
        /// The container.
        found: String,
    },
    /// An mp4 or mov whose index was never written or is cut off.
    #[error(
        "cannot read {}: its index (the moov box) is {found}, so the frames in it cannot be found: the file was cut \
         short while it was recorded or copied; copy it again from the camera, or rebuild the index with a repair \
         tool (untrunc) and an intact file of the same camera", path.display()
    )]
    MissingIndex {
        /// The file.
        path: PathBuf,
        /// What there is of it.
        found: String,
    },
    /// A container that cannot be read on.
    #[error(
        "cannot read {}: it begins like a {container} file, but FFmpeg cannot open it: {message}; the file is \
         damaged or cut short: copy it again from the camera", path.display()
    )]
    Broken {
        /// The file.
        path: PathBuf,
        /// The container.
        container: String,
        /// What FFmpeg said.
        message: String,
    },
    /// No decoder.
    #[error(
        "cannot read {}: this FFmpeg has no decoder for its codec, {codec}; convert it on another machine \
         (ffmpeg -i in -c:v libx264 -crf 10 out.mp4)", path.display()
    )]
    NoDecoder {
        /// The file.
        path: PathBuf,
        /// The codec.
        codec: String,
    },
    /// A picture of absurd size.
    #[error(
        "cannot read {}: its picture is {width}x{height} px; accepted are 1 to {accepted} px a side: crop or scale \
         it down first", path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Columns.
        width: i64,
        /// Rows.
        height: i64,
        /// Largest side.
        accepted: usize,
    },
    /// Not one frame could be decoded.
    #[error(
        "cannot read {}: not one frame could be decoded ({damaged} damaged packets or frames); the file is damaged \
         or holds no frames: copy it again from the camera", path.display()
    )]
    NoFrames {
        /// The file.
        path: PathBuf,
        /// Packets or frames that the decoder called damaged.
        damaged: u64,
    },
    /// The picture size changes in the middle.
    #[error(
        "cannot read frame {frame} of {}: the picture changes from {} to {} px there; accepted is one size \
         throughout: cut the recording at that frame", path.display(), side_by_side(*expected), side_by_side(*found)
    )]
    SizeChanged {
        /// The file.
        path: PathBuf,
        /// The first frame of another size.
        frame: usize,
        /// Columns and rows before.
        expected: (usize, usize),
        /// Columns and rows from there on.
        found: (usize, usize),
    },
    /// A folder without images.
    #[error(
        "cannot read {}: there are no images in this folder; accepted are {accepted}, with a number in each name \
         (frame_0001.png)", path.display()
    )]
    NoImages {
        /// The folder.
        path: PathBuf,
        /// Extensions.
        accepted: String,
    },
    /// Two images with one number.
    #[error(
        "cannot read {}: the images {first} and {second} have the same number, {number}, so their order is unknown; \
         accepted is one image a number: move one series to a folder of its own", path.display()
    )]
    SameNumber {
        /// The folder.
        path: PathBuf,
        /// A file name.
        first: String,
        /// Another file name.
        second: String,
        /// The number in both.
        number: u64,
    },
    /// An image of another size than the first.
    #[error(
        "cannot read {}: the image is {} px, but the first of the folder is {} px; accepted is one size throughout: \
         move images of other recordings away", path.display(), side_by_side(*found), side_by_side(*expected)
    )]
    ImageSize {
        /// The image.
        path: PathBuf,
        /// Columns and rows of the first image.
        expected: (usize, usize),
        /// Columns and rows of this one.
        found: (usize, usize),
    },
    /// An image that cannot be decoded.
    #[error(
        "cannot read {}: the image cannot be decoded: {message}; accepted are {accepted}: export it again",
        path.display()
    )]
    Image {
        /// The image.
        path: PathBuf,
        /// What is wrong.
        message: String,
        /// Extensions.
        accepted: String,
    },
    /// Trouble of FFmpeg or of the machine.
    #[error("cannot read {}: FFmpeg failed to {step}: {message}; check the file with ffprobe", path.display())]
    Ffmpeg {
        /// The file.
        path: PathBuf,
        /// What was being done.
        step: &'static str,
        /// What FFmpeg said.
        message: String,
    },
    /// The reading thread could not be started or died.
    #[error("cannot read {}: the reading thread {message}; this is a defect of the program or a full machine", path.display())]
    Thread {
        /// The file.
        path: PathBuf,
        /// What happened.
        message: String,
    },
}

fn side_by_side((width, height): (usize, usize)) -> String {
    format!("{width}x{height}")
}
