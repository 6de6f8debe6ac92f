//! Files to frames and back: what `track::frames` promises, on clips that the tests make themselves.

use std::fs;
use std::path::Path;
use tempfile::tempdir;
use track::frames::{
    Coding, EncodeError, Frame, FrameError, FrameSource, Luma, LumaRange, ReadAhead, RecodeError, SourceInfo,
    StreamHealth, Timing, VideoOptions, VideoWriter, Yuv420, open, open_sparse, recode,
};

const H264: Coding = Coding::H264 {
    crf: 10,
    gop: 12,
    b_frames: 2,
};

/// A grey picture with a bright square whose place tells the frame's number.
fn scene(width: usize, height: usize, number: usize) -> Luma {
    let mut data = vec![60; width * height];
    let (u0, v0) = (4 + 2 * number % (width - 12), height / 2);
    for v in v0..v0 + 8 {
        data[v * width + u0..v * width + u0 + 8].fill(220);
    }
    Luma { width, height, data }
}

fn write_clip(path: &Path, frames: usize, options: &VideoOptions) {
    let mut writer = VideoWriter::create_with(path, 64, 48, options).unwrap();
    for i in 0..frames {
        writer.write(&scene(64, 48, i)).unwrap();
    }
    writer.finish().unwrap();
}

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn the_same_frames_give_the_same_bytes() {
    let dir = tempdir().unwrap();
    for (coding, extension) in [(H264, "mp4"), (Coding::Lossless, "mkv")] {
        let options = VideoOptions::new(240.0, coding);
        let [a, b] = ["a", "b"].map(|n| dir.path().join(format!("{n}.{extension}")));
        write_clip(&a, 30, &options);
        write_clip(&b, 30, &options);
        assert!(fs::read(&a).unwrap() == fs::read(&b).unwrap(), "{coding:?}");
    }
}

#[test]
fn a_writer_dropped_before_finish_leaves_nothing() {
    let dir = tempdir().unwrap();
    let mut writer = VideoWriter::create(&dir.path().join("a.mp4"), 64, 48, 30.0, H264).unwrap();
    writer.write(&scene(64, 48, 0)).unwrap();
    drop(writer);
    assert!(names(dir.path()).is_empty());
}

#[test]
fn a_finished_writer_leaves_one_file_and_replaces_the_old_one() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    fs::write(&path, "old").unwrap();
    write_clip(&path, 3, &VideoOptions::new(30.0, H264));
    assert_eq!(names(dir.path()), ["a.mp4"]);
    assert!(fs::metadata(&path).unwrap().len() > 500);
}

#[test]
fn a_failed_writer_leaves_the_old_file_as_it_was() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    fs::write(&path, "old").unwrap();
    let mut writer = VideoWriter::create(&path, 64, 48, 30.0, H264).unwrap();
    assert!(matches!(
        writer.write(&scene(66, 48, 0)),
        Err(EncodeError::Frame { frame: 0, .. })
    ));
    assert!(
        matches!(writer.finish(), Err(EncodeError::Frame { .. })),
        "no frame at all"
    );
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(dir.path()), ["a.mp4"]);
}

#[test]
fn what_cannot_be_coded_is_refused_with_what_is_accepted() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    let message = |w, h, options: &VideoOptions| {
        VideoWriter::create_with(&path, w, h, options)
            .unwrap_err()
            .to_string()
    };
    let usual = VideoOptions::new(30.0, H264);
    assert!(message(65, 48, &usual).contains("even"));
    assert!(message(0, 48, &usual).contains("1 to 16384"));
    assert!(message(20000, 48, &usual).contains("20000x48"));
    assert!(message(64, 48, &VideoOptions::new(f64::NAN, H264)).contains("frame_rate_hz is NaN"));
    let coding = Coding::H264 {
        crf: 60,
        gop: 1,
        b_frames: 0,
    };
    assert!(message(64, 48, &VideoOptions::new(30.0, coding)).contains("crf is 60"));
    let gone = VideoWriter::create(&dir.path().join("no/such/a.mp4"), 64, 48, 30.0, H264);
    assert!(matches!(gone, Err(EncodeError::Io { .. })));
    assert!(names(dir.path()).is_empty());
}

#[test]
fn times_must_increase_and_need_stamped_timing() {
    let dir = tempdir().unwrap();
    let mut options = VideoOptions::new(30.0, H264);
    let mut writer = VideoWriter::create_with(&dir.path().join("a.mp4"), 64, 48, &options).unwrap();
    assert!(writer.write_at(&scene(64, 48, 0), 0.0).is_err());
    options.timing = Timing::Stamped;
    let mut writer = VideoWriter::create_with(&dir.path().join("a.mp4"), 64, 48, &options).unwrap();
    writer.write_at(&scene(64, 48, 0), 0.0).unwrap();
    writer.write_at(&scene(64, 48, 1), 0.1).unwrap();
    assert!(
        writer
            .write_at(&scene(64, 48, 2), 0.1)
            .unwrap_err()
            .to_string()
            .contains("later")
    );
    assert!(writer.write_at(&scene(64, 48, 2), f64::NAN).is_err());
}

#[test]
fn colour_goes_to_h264_only() {
    let dir = tempdir().unwrap();
    let mut picture = Yuv420::black(64, 48);
    picture.put(10, 10, [200, 90, 240]);
    picture.put(-1, 10, [200, 90, 240]);
    picture.put(64, 48, [200, 90, 240]);
    let mut writer = VideoWriter::create(&dir.path().join("a.mp4"), 64, 48, 30.0, H264).unwrap();
    writer.write_yuv(&picture).unwrap();
    writer.finish().unwrap();
    let mut writer = VideoWriter::create(&dir.path().join("a.mkv"), 64, 48, 30.0, Coding::Lossless).unwrap();
    assert!(writer.write_yuv(&picture).is_err());
}

// ---------------------------------------------------------------------------------------------------- helpers

/// Everything that a recording gives.
struct Read {
    info: SourceInfo,
    frames: Vec<Frame>,
    health: StreamHealth,
}

impl Read {
    fn times(&self) -> Vec<f64> {
        self.frames.iter().map(|f| f.time_s).collect()
    }
}

fn read_source(mut source: Box<dyn FrameSource + Send>) -> Read {
    let info = source.info().clone();
    let frames: Vec<_> = std::iter::from_fn(|| source.next_frame().unwrap()).collect();
    assert!(source.next_frame().unwrap().is_none(), "the end stays the end");
    assert!(frames.iter().enumerate().all(|(i, f)| f.index == i));
    for f in &frames {
        assert_eq!((f.luma.width, f.luma.height), (info.width_px, info.height_px));
        assert_eq!(f.luma.data.len(), f.luma.width * f.luma.height);
    }
    Read {
        info,
        frames,
        health: source.health(),
    }
}

fn read(path: &Path) -> Read {
    read_source(open(path).unwrap())
}

fn error(path: &Path) -> FrameError {
    open(path).err().expect("it must be refused")
}

/// The number that `scene` was drawn for, from where its square is.
fn number(luma: &Luma) -> usize {
    let row = luma.row(luma.height / 2 + 4);
    let bright: Vec<_> = (0..luma.width).filter(|&u| row[u] > 140).collect();
    assert!((6..=10).contains(&bright.len()), "{bright:?}");
    (bright[0] + 1 - 4) / 2
}

fn numbers(frames: &[Frame]) -> Vec<usize> {
    frames.iter().map(|f| number(&f.luma)).collect()
}

fn assert_times(found: &[f64], wanted: impl Iterator<Item = f64>, within: f64) {
    let wanted: Vec<_> = wanted.collect();
    assert_eq!(found.len(), wanted.len());
    for (i, (f, w)) in found.iter().zip(&wanted).enumerate() {
        assert!((f - w).abs() <= within, "frame {i}: {f} instead of {w}");
    }
}

/// Puts `by` over the bytes at the first `mark` of a file, `offset` after it.
fn patch(path: &Path, mark: &[u8], offset: usize, by: impl Fn(u32) -> u32) {
    let mut bytes = fs::read(path).unwrap();
    let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len() + offset;
    let old = u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    bytes[at..at + 4].copy_from_slice(&by(old).to_be_bytes());
    fs::write(path, bytes).unwrap();
}

/// An uncompressed video, which any pixel format goes into: `plane(i)` gives the bytes of frame i.
fn write_y4m(path: &Path, tags: &str, frames: usize, plane: impl Fn(usize) -> Vec<u8>) {
    let mut bytes = format!("YUV4MPEG2 F50:1 {tags}\n").into_bytes();
    for i in 0..frames {
        bytes.extend(b"FRAME\n");
        bytes.extend(plane(i));
    }
    fs::write(path, bytes).unwrap();
}

fn write_pgm(path: &Path, luma: &Luma) {
    let mut bytes = format!("P5 {} {} 255\n", luma.width, luma.height).into_bytes();
    bytes.extend(&luma.data);
    fs::write(path, bytes).unwrap();
}

fn write_image(path: &Path, luma: &Luma) {
    use opencv::core::{Mat, MatTraitConst, Vector};
    let flat = Mat::from_slice(&luma.data).unwrap();
    let mat = flat.reshape(1, i32::try_from(luma.height).unwrap()).unwrap();
    assert!(opencv::imgcodecs::imwrite(path.to_str().unwrap(), &mat, &Vector::new()).unwrap());
}

// ------------------------------------------------------------------------------------------- times and order

#[test]
fn b_frames_come_in_order_and_the_last_ones_have_their_true_times() {
    let dir = tempdir().unwrap();
    for (name, b_frames) in [("none.mp4", 0), ("some.mp4", 3), ("many.mp4", 7)] {
        let path = dir.path().join(name);
        write_clip(
            &path,
            25,
            &VideoOptions::new(
                240.0,
                Coding::H264 {
                    crf: 10,
                    gop: 12,
                    b_frames,
                },
            ),
        );
        let read = read(&path);
        assert_eq!(numbers(&read.frames), (0..25).collect::<Vec<_>>(), "{name}");
        assert_times(&read.times(), (0..25).map(|i| f64::from(i) / 240.0), 1e-9);
        assert_eq!(read.info.frames_expected, Some(25));
        assert_eq!(read.info.nominal_rate_hz.map(f64::round), Some(240.0));
        assert_eq!(
            read.health,
            StreamHealth {
                frames_read: 25,
                frames_expected: Some(25),
                ..Default::default()
            }
        );
    }
}

#[test]
fn stamps_of_variable_rate_come_back_to_a_microsecond() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("vfr.mp4");
    let time =
        |i: usize| i as f64 / 240.0 + [0.0, 0.0011, 0.0007, 0.0023][i % 4] + if i > 20 { 1.5 } else { 0.0 };
    let options = VideoOptions {
        timing: Timing::Stamped,
        ..VideoOptions::new(240.0, H264)
    };
    let mut writer = VideoWriter::create_with(&path, 64, 48, &options).unwrap();
    (0..40).for_each(|i| writer.write_at(&scene(64, 48, i % 25), time(i)).unwrap());
    writer.finish().unwrap();
    let read = read(&path);
    assert_times(&read.times(), (0..40).map(time), 1e-6);
    assert_eq!(read.health.stamps_repaired, 0);
    assert_eq!(read.health.ended_early, None, "a long step is no cut");
}

#[test]
fn the_first_frame_stands_at_zero_whatever_its_stamp() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("late.mp4");
    let options = VideoOptions {
        timing: Timing::Stamped,
        ..VideoOptions::new(30.0, H264)
    };
    let mut writer = VideoWriter::create_with(&path, 64, 48, &options).unwrap();
    (0..9).for_each(|i| writer.write_at(&scene(64, 48, i), 2.0 + i as f64 / 30.0).unwrap());
    writer.finish().unwrap();
    assert_times(&read(&path).times(), (0..9).map(|i| f64::from(i) / 30.0), 1e-6);
}

#[test]
fn an_edit_list_that_starts_inside_a_group_gives_the_frames_it_shows() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("edit.mp4");
    write_clip(
        &path,
        24,
        &VideoOptions::new(
            30.0,
            Coding::H264 {
                crf: 10,
                gop: 12,
                b_frames: 2,
            },
        ),
    );
    // elst: version, count, then duration (1/1000 s) and media time (1/15360 s).
    patch(&path, b"elst", 12, |media_time| media_time + 7 * 15360 / 30);
    patch(&path, b"elst", 8, |duration| duration - 7 * 1000 / 30);
    let read = read(&path);
    assert_eq!(numbers(&read.frames), (7..24).collect::<Vec<_>>());
    assert_times(&read.times(), (0..17).map(|i| f64::from(i) / 30.0), 1e-9);
    assert_eq!(read.info.frames_expected, Some(17));
    assert_eq!(read.health.ended_early, None);
}

#[test]
fn lossless_video_keeps_every_value_and_its_rate_beyond_the_milliseconds_of_matroska() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mkv");
    let grey = |i: usize| Luma::from_fn(37, 23, |u, v| (((v * 37 + u) * 7 + i) % 256) as u8);
    let mut writer = VideoWriter::create(&path, 37, 23, 240.0, Coding::Lossless).unwrap();
    (0..50).for_each(|i| writer.write(&grey(i)).unwrap());
    writer.finish().unwrap();
    let read = read(&path);
    assert!(read.frames.iter().enumerate().all(|(i, f)| f.luma == grey(i)));
    assert_times(&read.times(), (0..50).map(|i| f64::from(i) / 240.0), 1e-9);
    assert_eq!(read.info.time_resolution_s, Some(1e-3));
    assert_eq!(read.info.luma_range, LumaRange { black: 0, white: 255 });
}

#[test]
fn a_gif_gives_its_own_delays_and_grey_from_its_palette() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.gif");
    let delays = [4_u8, 7, 4, 10]; // 1/100 s
    let mut bytes = b"GIF89a\x08\0\x08\0\x91\0\0".to_vec(); // 8x8, four colours
    bytes.extend([0, 0, 0, 255, 255, 255, 128, 128, 128, 255, 0, 0]);
    for (i, delay) in delays.iter().enumerate() {
        bytes.extend([
            0x21, 0xF9, 4, 4, *delay, 0, 0, 0, 0x2C, 0, 0, 0, 0, 8, 0, 8, 0, 0, 2,
        ]);
        // Codes of three bits: clear (4) before every two pixels keeps them so; 5 ends.
        let mut codes: Vec<u8> = Vec::new();
        for pair in 0..32 {
            let colour = if pair < 16 { i as u8 % 3 } else { 1 };
            codes.extend([4, colour, colour]);
        }
        codes.push(5);
        let bits: Vec<u8> = codes
            .iter()
            .flat_map(|c| (0..3).map(move |b| c >> b & 1))
            .collect();
        let data: Vec<u8> = bits
            .chunks(8)
            .map(|b| b.iter().enumerate().map(|(k, bit)| bit << k).sum())
            .collect();
        bytes.push(u8::try_from(data.len()).unwrap());
        bytes.extend(data);
        bytes.push(0);
    }
    bytes.push(0x3B);
    fs::write(&path, bytes).unwrap();
    let read = read(&path);
    assert_times(&read.times(), [0.0, 0.04, 0.11, 0.15].into_iter(), 1e-9);
    let top: Vec<_> = read.frames.iter().map(|f| f.luma.data[0]).collect();
    let bottom: Vec<_> = read.frames.iter().map(|f| f.luma.data[63]).collect();
    assert_eq!((top, bottom), (vec![0, 255, 128, 0], vec![255; 4]));
    assert_eq!(read.info.luma_range, LumaRange { black: 0, white: 255 });
}

// ------------------------------------------------------------------------------------------------- pictures

#[test]
fn a_rotation_tag_turns_the_picture_the_way_players_do() {
    let dir = tempdir().unwrap();
    // Four grey quarters, as stored: 40 100 / 160 220.
    let quarter = |u: usize, v: usize| [[40, 100], [160, 220]][v / 24][u / 32];
    let stored = Luma::from_fn(64, 48, quarter);
    for (clockwise, size, shown) in [
        (0.0, (64, 48), [40, 100, 160, 220]),
        (90.0, (48, 64), [160, 40, 220, 100]),
        (180.0, (64, 48), [220, 160, 100, 40]),
        (270.0, (48, 64), [100, 220, 40, 160]),
        (-90.0, (48, 64), [100, 220, 40, 160]),
    ] {
        let path = dir.path().join("turned.mp4");
        let options = VideoOptions {
            rotation_deg: clockwise,
            ..VideoOptions::new(30.0, H264)
        };
        let mut writer = VideoWriter::create_with(&path, 64, 48, &options).unwrap();
        (0..3).for_each(|_| writer.write(&stored).unwrap());
        writer.finish().unwrap();
        let read = read(&path);
        assert_eq!((read.info.width_px, read.info.height_px), size, "{clockwise}");
        let luma = &read.frames[2].luma;
        let (w, h) = size;
        let centres = [
            (w / 4, h / 4),
            (3 * w / 4, h / 4),
            (w / 4, 3 * h / 4),
            (3 * w / 4, 3 * h / 4),
        ];
        for ((u, v), grey) in centres.into_iter().zip(shown) {
            assert!(
                luma.row(v)[u].abs_diff(grey) <= 3,
                "{clockwise}: {} at {u},{v}",
                luma.row(v)[u]
            );
        }
        assert!(read.health.notes.is_empty());
    }
}

#[test]
fn a_rotation_that_is_no_right_angle_is_told_and_left_alone() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("askew.mp4");
    write_clip(
        &path,
        3,
        &VideoOptions {
            rotation_deg: 30.0,
            ..VideoOptions::new(30.0, H264)
        },
    );
    let read = read(&path);
    assert_eq!((read.info.width_px, read.info.height_px), (64, 48));
    let note = &read.health.notes[0];
    assert_eq!(note.code, "rotation_ignored");
    assert!(note.message.contains("30.0 degrees"), "{}", note.message);
}

#[test]
fn grey_of_full_range_survives_h264() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("ramp.mp4");
    let ramp = Luma::from_fn(256, 32, |u, _| u as u8);
    let mut writer = VideoWriter::create(
        &path,
        256,
        32,
        30.0,
        Coding::H264 {
            crf: 1,
            gop: 1,
            b_frames: 0,
        },
    )
    .unwrap();
    writer.write(&ramp).unwrap();
    writer.finish().unwrap();
    let read = read(&path);
    assert_eq!(read.info.luma_range, LumaRange { black: 0, white: 255 });
    let row = read.frames[0].luma.row(16);
    assert!(
        row.iter()
            .enumerate()
            .all(|(u, &grey)| usize::from(grey).abs_diff(u) <= 2),
        "{row:?}"
    );
}

#[test]
fn the_luma_plane_is_copied_as_stored_and_its_range_is_told() {
    let dir = tempdir().unwrap();
    let limited = LumaRange {
        black: 16,
        white: 235,
    };
    let full = LumaRange { black: 0, white: 255 };
    let chroma = vec![128; 2 * 8 * 4];
    let values = [16_u8, 235, 100, 7];
    for (tags, range) in [
        ("W16 H8 C420jpeg", limited),
        ("W16 H8 C420jpeg XCOLORRANGE=LIMITED", limited),
        ("W16 H8 C420jpeg XCOLORRANGE=FULL", full),
        ("W16 H8 Cmono", full),
        ("W16 H8 Cmono XCOLORRANGE=LIMITED", limited),
    ] {
        let path = dir.path().join("a.y4m");
        write_y4m(&path, tags, 4, |i| {
            let mut frame = vec![values[i]; 16 * 8];
            if !tags.contains("mono") {
                frame.extend(&chroma);
            }
            frame
        });
        let read = read(&path);
        assert_eq!(read.info.luma_range, range, "{tags}");
        let found: Vec<_> = read.frames.iter().map(|f| f.luma.data[77]).collect();
        assert_eq!(found, values, "{tags}");
        assert_times(&read.times(), (0..4).map(|i| f64::from(i) / 50.0), 1e-9);
    }
}

#[test]
fn ten_bits_are_rounded_to_eight() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("deep.y4m");
    let words = |n: usize, value: u16| (0..n).flat_map(move |_| value.to_le_bytes());
    let values = [64, 66, 502, 940, 1023];
    write_y4m(&path, "W16 H8 C420p10 XYSCSS=420P10", 5, |i| {
        words(128, values[i]).chain(words(64, 512)).collect()
    });
    let read = read(&path);
    let found: Vec<_> = read.frames.iter().map(|f| f.luma.data[3]).collect();
    assert_eq!(found, [16, 17, 126, 235, 255]);
    assert_eq!(
        read.info.luma_range,
        LumaRange {
            black: 16,
            white: 235
        }
    );
}

#[test]
fn interlacing_and_oblong_pixels_are_noticed() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("tv.y4m");
    write_y4m(&path, "W16 H8 It A4:3 Cmono", 5, |_| vec![90; 128]);
    let read = read(&path);
    assert_eq!(read.health.interlaced, 5);
    assert!((read.info.pixel_aspect - 4.0 / 3.0).abs() < 1e-9);
    assert_eq!(read.health.notes[0].code, "pixels_not_square");
    assert!(read.health.notes[0].message.contains("1.3333"));
}

#[test]
fn a_change_of_size_is_an_error_that_names_the_frame() {
    let dir = tempdir().unwrap();
    let (image, path) = (dir.path().join("a.jpg"), dir.path().join("a.mjpeg"));
    let mut bytes = Vec::new();
    for (w, h) in [(64, 48), (64, 48), (64, 48), (64, 48), (80, 48), (80, 48)] {
        write_image(&image, &scene(w, h, 3));
        bytes.extend(fs::read(&image).unwrap());
    }
    fs::write(&path, bytes).unwrap();
    let mut source = open(&path).unwrap();
    assert!(!source.info().has_time_base, "a bare stream has no clock");
    for i in 0..4 {
        assert_eq!(source.next_frame().unwrap().unwrap().time_s, f64::from(i));
    }
    let message = source.next_frame().unwrap_err().to_string();
    assert!(
        message.contains("frame 4") && message.contains("64x48 to 80x48"),
        "{message}"
    );
}

// --------------------------------------------------------------------------------------------- damaged files

#[test]
fn an_mp4_without_its_index_says_so() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    write_clip(&path, 30, &VideoOptions::new(30.0, H264));
    let whole = fs::read(&path).unwrap();
    let moov = whole.windows(4).position(|w| w == b"moov").unwrap();
    fs::write(&path, &whole[..moov - 20]).unwrap();
    assert!(matches!(error(&path), FrameError::MissingIndex { found, .. } if found == "missing"));
    fs::write(&path, &whole[..moov + 100]).unwrap();
    let message = error(&path).to_string();
    assert!(
        message.contains("moov") && message.contains("cut short by"),
        "{message}"
    );
}

#[test]
fn an_mp4_cut_after_its_index_is_read_up_to_the_cut() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    write_clip(
        &path,
        25,
        &VideoOptions {
            index_first: true,
            ..VideoOptions::new(30.0, H264)
        },
    );
    let whole = fs::read(&path).unwrap();
    let data = whole.windows(4).position(|w| w == b"mdat").unwrap();
    fs::write(&path, &whole[..data + (whole.len() - data) * 2 / 3]).unwrap();
    let read = read(&path);
    assert!((3..25).contains(&read.frames.len()), "{}", read.frames.len());
    assert_eq!(read.health.frames_expected, Some(25));
    assert_eq!(read.health.frames_read, read.frames.len() as u64);
    let words = read.health.ended_early.unwrap();
    assert!(
        words.contains("cut short") && words.contains(&whole.len().to_string()),
        "{words}"
    );
    let survey = open_sparse(&path, 5).unwrap();
    assert!((1..=5).contains(&survey.len()));
}

#[test]
fn a_matroska_file_cut_short_is_read_up_to_the_cut() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mkv");
    write_clip(&path, 60, &VideoOptions::new(240.0, Coding::Lossless));
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let read = read(&path);
    assert!((15..45).contains(&read.frames.len()));
    assert!(read.health.ended_early.unwrap().contains("0.25"));
}

#[test]
fn damage_in_the_middle_is_counted_and_reading_goes_on() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    let options = VideoOptions::new(
        30.0,
        Coding::H264 {
            crf: 5,
            gop: 5,
            b_frames: 0,
        },
    );
    let mut writer = VideoWriter::create_with(&path, 64, 48, &options).unwrap();
    let noise = |i: usize| Luma::from_fn(64, 48, |u, v| (((v * 64 + u) * 7919 + i * 104_729) % 251) as u8);
    (0..25).for_each(|i| writer.write(&noise(i)).unwrap());
    writer.finish().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let data = bytes.windows(4).position(|w| w == b"mdat").unwrap();
    let end = bytes.windows(4).position(|w| w == b"moov").unwrap();
    let middle = (data + end) / 2;
    bytes[middle..middle + 1500]
        .iter_mut()
        .enumerate()
        .for_each(|(i, b)| *b ^= (i * 37 + 11) as u8);
    fs::write(&path, bytes).unwrap();
    let read = read(&path);
    assert!((1..10).contains(&read.health.damaged), "{:?}", read.health);
    assert!(read.frames.len() >= 20);
    assert_eq!(read.health.ended_early, None);
    assert!(read.times().windows(2).all(|w| w[1] > w[0]));
}

// ---------------------------------------------------------------------------------------- what is no recording

#[test]
fn each_kind_of_bad_input_has_its_own_answer() {
    let dir = tempdir().unwrap();
    let file = |name: &str, content: &[u8]| {
        let path = dir.path().join(name);
        fs::write(&path, content).unwrap();
        path
    };
    assert!(matches!(
        error(&dir.path().join("gone.mp4")),
        FrameError::Missing { .. }
    ));
    assert!(matches!(error(&file("empty.mp4", b"")), FrameError::Empty { .. }));
    assert!(matches!(
        error(&file("text.mp4", b"only a few words")),
        FrameError::NotVideo { .. }
    ));
    assert!(matches!(
        error(&file("zeros.mp4", &[0; 5000])),
        FrameError::NotVideo { .. }
    ));
    let mut sound =
        b"RIFF\x24\x10\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x40\x1f\0\0\x80\x3e\0\0\x02\0\x10\0data\0\x10\0\0"
            .to_vec();
    sound.extend([0; 4096]);
    assert!(matches!(
        error(&file("sound.mp4", &sound)),
        FrameError::NoVideoStream { .. }
    ));
    let image = dir.path().join("one.png");
    write_image(&image, &scene(64, 48, 0));
    assert!(matches!(error(&image), FrameError::StillImage { .. }));
    let folder = tempdir().unwrap();
    fs::write(folder.path().join("notes.txt"), "no image").unwrap();
    assert!(matches!(error(folder.path()), FrameError::NoImages { .. }));
    #[cfg(unix)]
    assert!(matches!(
        error(Path::new("/dev/null")),
        FrameError::NotAFile { .. }
    ));
}

#[cfg(unix)]
#[test]
fn a_file_that_may_not_be_read_says_so() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    write_clip(&path, 3, &VideoOptions::new(30.0, H264));
    fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).unwrap();
    if fs::File::open(&path).is_ok() {
        return; // root may read everything
    }
    let message = error(&path).to_string();
    assert!(
        message.contains("ermission denied") && message.contains("a.mp4"),
        "{message}"
    );
}

#[test]
fn playlists_and_scripts_are_refused_whatever_their_name() {
    let dir = tempdir().unwrap();
    let inner = dir.path().join("inner.mp4");
    write_clip(&inner, 10, &VideoOptions::new(30.0, H264));
    let inner = inner.display();
    // Nobody listens on these ports; a reader that followed them would answer with another error.
    for (kind, script) in [
        ("hls", format!("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{inner}\n#EXT-X-ENDLIST\n")),
        ("hls", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nhttp://127.0.0.1:1/a.ts\n#EXT-X-ENDLIST\n".to_owned()),
        ("concat", format!("ffconcat version 1.0\nfile {inner}\n")),
        ("sdp", "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 1 RTP/AVP 96\na=rtpmap:96 H264/90000\n".to_owned()),
    ] {
        let path = dir.path().join("innocent.mp4");
        fs::write(&path, script).unwrap();
        for error in [error(&path), open_sparse(&path, 3).unwrap_err()] {
            let message = error.to_string();
            assert!(matches!(error, FrameError::Refused { .. }) && message.contains(kind), "{message}");
        }
    }
}

#[test]
fn a_path_that_looks_like_a_protocol_is_a_file_name() {
    for name in [
        "http://127.0.0.1:1/a.mp4",
        "pipe:0",
        "concat:a.mp4|b.mp4",
        "data:video/mp4;base64,AAAA",
    ] {
        assert!(
            matches!(error(Path::new(name)), FrameError::Missing { .. }),
            "{name}"
        );
    }
    let dir = tempdir().unwrap();
    let path = dir.path().join("concat:a.mp4|b.mp4");
    write_clip(&path, 3, &VideoOptions::new(30.0, H264));
    assert_eq!(read(&path).frames.len(), 3);
}

#[test]
fn absurd_sizes_are_refused() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("wide.y4m");
    write_y4m(&path, "W20000 H2 Cmono", 2, |_| vec![0; 40000]);
    let message = error(&path).to_string();
    assert!(
        message.contains("20000x2") && message.contains("16384"),
        "{message}"
    );
}

// --------------------------------------------------------------------------------------------------- folders

#[test]
fn a_folder_is_read_in_the_order_of_its_numbers() {
    let dir = tempdir().unwrap();
    for i in [10, 9, 8, 12, 100] {
        write_pgm(&dir.path().join(format!("run2_{i}.pgm")), &scene(64, 48, i % 25));
    }
    fs::write(dir.path().join("notes_11.txt"), "not an image").unwrap();
    fs::create_dir(dir.path().join("13.png")).unwrap();
    let read = read(dir.path());
    assert_eq!(numbers(&read.frames), [8, 9, 10, 12, 0]);
    assert_eq!(read.times(), [0.0, 1.0, 2.0, 4.0, 92.0]);
    assert!(!read.info.has_time_base);
    assert_eq!(
        (read.info.nominal_rate_hz, read.info.time_resolution_s),
        (None, None)
    );
    assert_eq!(read.health.frames_expected, Some(93));
    let note = &read.health.notes[0];
    assert_eq!(note.code, "image_numbers_missing");
    assert!(note.message.contains("88") && note.message.contains("run2_10.pgm and run2_12.pgm"));
}

#[test]
fn every_kind_of_image_is_read() {
    for extension in ["png", "jpg", "JPEG", "tif", "tiff", "bmp", "pgm", "webp"] {
        let dir = tempdir().unwrap();
        for i in 0..3 {
            write_image(&dir.path().join(format!("{i}.{extension}")), &scene(64, 48, i));
        }
        let read = read(dir.path());
        assert_eq!(numbers(&read.frames), [0, 1, 2], "{extension}");
    }
}

#[test]
fn a_folder_that_is_no_series_says_which_image_is_wrong() {
    let dir = tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    write_pgm(&path("1.pgm"), &scene(64, 48, 1));
    write_pgm(&path("2.pgm"), &scene(66, 48, 1));
    let mut source = open(dir.path()).unwrap();
    assert!(source.next_frame().unwrap().is_some());
    let message = source.next_frame().unwrap_err().to_string();
    assert!(
        message.contains("2.pgm") && message.contains("66x48") && message.contains("64x48"),
        "{message}"
    );
    assert!(source.next_frame().unwrap().is_none());

    fs::write(path("2.pgm"), "no picture at all").unwrap();
    let mut source = open(dir.path()).unwrap();
    source.next_frame().unwrap();
    assert!(matches!(source.next_frame(), Err(FrameError::Image { path, .. }) if path.ends_with("2.pgm")));

    write_image(&path("left_1.png"), &scene(64, 48, 1));
    let message = error(dir.path()).to_string();
    assert!(
        message.contains("1.pgm") && message.contains("left_1.png"),
        "{message}"
    );
}

#[test]
fn images_without_a_number_are_left_out_unless_none_has_one() {
    let dir = tempdir().unwrap();
    write_pgm(&dir.path().join("b.pgm"), &scene(64, 48, 5));
    write_pgm(&dir.path().join("a.pgm"), &scene(64, 48, 3));
    assert_eq!(numbers(&read(dir.path()).frames), [3, 5]);
    write_pgm(&dir.path().join("c7.pgm"), &scene(64, 48, 7));
    let read = read(dir.path());
    assert_eq!(numbers(&read.frames), [7]);
    assert_eq!(read.health.notes[0].code, "images_without_number");
}

// ------------------------------------------------------------------------------- reading ahead, survey, recoding

#[test]
fn reading_ahead_gives_the_same_frames_and_health() {
    let dir = tempdir().unwrap();
    let path = dir.path().join("a.mp4");
    write_clip(&path, 100, &VideoOptions::new(240.0, H264));
    let plain = read(&path);
    let ahead = read_source(Box::new(ReadAhead::start(open(&path).unwrap()).unwrap()));
    assert_eq!(plain.frames, ahead.frames);
    assert_eq!((plain.info, plain.health), (ahead.info, ahead.health));
    let mut early = ReadAhead::start(open(&path).unwrap()).unwrap();
    let frame = early.next_frame().unwrap().unwrap();
    early.recycle(frame);
    drop(early);
}

#[test]
fn a_survey_is_spread_over_the_whole_recording() {
    let dir = tempdir().unwrap();
    let many_keys = Coding::H264 {
        crf: 10,
        gop: 4,
        b_frames: 0,
    };
    let few_keys = Coding::H264 {
        crf: 10,
        gop: 1000,
        b_frames: 2,
    };
    for (name, coding) in [
        ("keys.mp4", many_keys),
        ("few.mp4", few_keys),
        ("a.mkv", Coding::Lossless),
    ] {
        let path = dir.path().join(name);
        let mut writer = VideoWriter::create(&path, 64, 48, 30.0, coding).unwrap();
        (0..200).for_each(|i| writer.write(&scene(64, 48, i / 8)).unwrap());
        writer.finish().unwrap();
        let frames = open_sparse(&path, 20).unwrap();
        assert!((10..=20).contains(&frames.len()), "{name}: {}", frames.len());
        let numbers = numbers(&frames);
        assert!(
            numbers[0] <= 1 && numbers.last().unwrap() >= &23,
            "{name}: {numbers:?}"
        );
        assert!(
            numbers.windows(2).all(|w| (0..=4).contains(&(w[1] - w[0]))),
            "{name}: {numbers:?}"
        );
    }
    let images = dir.path().join("images");
    fs::create_dir(&images).unwrap();
    (0..9).for_each(|i| write_pgm(&images.join(format!("{i}.pgm")), &scene(64, 48, i)));
    assert_eq!(numbers(&open_sparse(&images, 3).unwrap()), [0, 4, 8]);
    assert!(open_sparse(&images, 0).unwrap().is_empty());
}

#[test]
fn a_survey_of_key_frames_has_each_of_them_once_where_frames_are_shown_later_than_decoded() {
    let dir = tempdir().unwrap();
    let coding = Coding::H264 {
        crf: 10,
        gop: 5,
        b_frames: 2,
    };
    for name in ["a.mp4", "a.mkv"] {
        let path = dir.path().join(name);
        let mut writer = VideoWriter::create(&path, 64, 48, 30.0, coding).unwrap();
        (0..25).for_each(|i| writer.write(&scene(64, 48, i)).unwrap());
        writer.finish().unwrap();
        // So many that each key frame is the nearest to one of the instants.
        let numbers = numbers(&open_sparse(&path, 9).unwrap());
        let all: Vec<usize> = (0..25).step_by(5).collect();
        assert_eq!(numbers, all, "{name}");
    }
}

#[test]
fn recoding_keeps_every_frame_and_its_time_and_shows_the_drawing_upright() {
    let dir = tempdir().unwrap();
    let (input, output) = (dir.path().join("in.mp4"), dir.path().join("out.mp4"));
    let options = VideoOptions {
        timing: Timing::Stamped,
        rotation_deg: 90.0,
        ..VideoOptions::new(60.0, H264)
    };
    let mut writer = VideoWriter::create_with(&input, 64, 48, &options).unwrap();
    let time = |i: usize| i as f64 / 60.0 + if i % 3 == 1 { 0.005 } else { 0.0 };
    (0..20).for_each(|i| writer.write_at(&scene(64, 48, i), time(i)).unwrap());
    writer.finish().unwrap();
    let mut seen = Vec::new();
    recode(&input, &output, &mut |index, picture| {
        seen.push(index);
        assert_eq!((picture.width, picture.height), (48, 64));
        (0..10).for_each(|y| (0..48).for_each(|x| picture.put(x, y, [250, 128, 128])));
    })
    .unwrap();
    assert_eq!(seen, (0..20).collect::<Vec<_>>());
    let (before, after) = (read(&input), read(&output));
    assert_times(&after.times(), before.times().into_iter(), 2e-6);
    for (a, b) in before.frames.iter().zip(&after.frames) {
        assert!(b.luma.row(4).iter().all(|&grey| grey > 240));
        let rest = |f: &Frame| f.luma.data[48 * 14..].to_vec();
        let far = rest(a)
            .iter()
            .zip(rest(b))
            .map(|(x, y)| x.abs_diff(y))
            .max()
            .unwrap();
        assert!(far < 25, "frame {}: {far}", a.index);
    }
}

#[test]
fn recoding_stretches_limited_range_and_crops_odd_sizes() {
    let dir = tempdir().unwrap();
    let (input, output) = (dir.path().join("in.y4m"), dir.path().join("out.mp4"));
    write_y4m(&input, "W35 H27 C420jpeg XCOLORRANGE=LIMITED", 3, |_| {
        let mut frame = [vec![16; 35 * 14], vec![235; 35 * 13]].concat();
        frame.extend(vec![128; 2 * 18 * 14]);
        frame
    });
    recode(&input, &output, &mut |_, picture| {
        assert_eq!((picture.width, picture.height), (34, 26))
    })
    .unwrap();
    let read = read(&output);
    assert_eq!(read.info.luma_range, LumaRange { black: 0, white: 255 });
    let luma = &read.frames[1].luma;
    assert!(
        luma.row(2)[5] <= 3 && luma.row(24)[5] >= 252,
        "{} {}",
        luma.row(2)[5],
        luma.row(24)[5]
    );
}

#[test]
fn recoding_a_folder_works_and_the_recording_itself_is_never_replaced() {
    let dir = tempdir().unwrap();
    let images = dir.path().join("images");
    fs::create_dir(&images).unwrap();
    (0..5).for_each(|i| write_pgm(&images.join(format!("{i}.pgm")), &scene(64, 48, i)));
    let output = dir.path().join("out.mp4");
    recode(&images, &output, &mut |_, _| ()).unwrap();
    let read = read(&output);
    assert_eq!(numbers(&read.frames), [0, 1, 2, 3, 4]);
    assert_times(&read.times(), (0..5).map(|i| f64::from(i) / 25.0), 1e-6);
    let before = fs::read(&output).unwrap();
    assert!(matches!(
        recode(&output, &output, &mut |_, _| ()),
        Err(RecodeError::SameFile { .. })
    ));
    assert!(fs::read(&output).unwrap() == before);
    let gone = recode(
        &dir.path().join("gone.mp4"),
        &dir.path().join("x.mp4"),
        &mut |_, _| (),
    );
    assert!(matches!(gone, Err(RecodeError::Read(FrameError::Missing { .. }))));
    assert!(!dir.path().join("x.mp4").exists());
}

#[test]
fn a_picture_at_a_part_of_its_size_has_the_means_and_even_sides() {
    let mut picture = Yuv420::black(23, 17);
    let width = picture.width;
    for (at, y) in picture.y.iter_mut().enumerate() {
        *y = (10 * (at % width) + 2 * (at / width)) as u8;
    }
    let chroma_width = picture.chroma_width();
    for (at, u) in picture.u.iter_mut().enumerate() {
        *u = (20 * (at % chroma_width)) as u8;
    }
    let small = picture.reduced(4).unwrap();
    assert_eq!((small.width, small.height), (4, 4));
    assert_eq!((small.y.len(), small.u.len(), small.v.len()), (16, 4, 4));
    // Columns 4 to 7 and rows 8 to 11: 55 + 19.
    assert_eq!(small.y[2 * 4 + 1], 74);
    assert_eq!((small.u[1], small.v[1]), (110, 128));
    assert_eq!(picture.reduced(1).unwrap().width, 22);
    assert_eq!(picture.reduced(12), None);
}
