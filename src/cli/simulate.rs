//! `track simulate SCENE --out DIR [--effects auto|all|none] [--explain] [--force]`.

use super::{Status, detail, interrupt, messages};
use crate::report::escape::on_one_line;
use crate::simulate::effects::{Decision, Unit};
use crate::simulate::scene::Switch;
use crate::simulate::{EffectsChoice, Scene, SimulatedFiles, SimulatedRecording, files_of, write};
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What to render, and where to.
#[derive(Debug, Args)]
pub struct SimulateArgs {
    /// The scene (JSON, schema track.scene/1).
    pub scene: PathBuf,
    /// Folder for <name>.mp4 (or .mkv), .truth.json and .calib.json.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Which effects to simulate, in place of the scene's own choice.
    #[arg(long, value_enum)]
    pub effects: Option<Effects>,
    /// Print each effect with its estimate, the tolerance, and whether it is simulated.
    #[arg(long)]
    pub explain: bool,
    /// Replace files of these names that this program did not make, or that were changed since.
    #[arg(long)]
    pub force: bool,
}

/// Which effects a scene is rendered with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Effects {
    /// Those that move a centre by more than the scene's tolerance.
    Auto,
    /// Every one.
    All,
    /// None beyond the parabola, the rigid impact and the disc.
    None,
}

impl Effects {
    fn choice(self) -> EffectsChoice {
        EffectsChoice::all(match self {
            Self::Auto => Switch::Auto,
            Self::All => Switch::On,
            Self::None => Switch::Off,
        })
    }
}

/// Renders the scene file into the folder and gives to `answer` what was written; before that the table of effects, where it is asked for.
///
/// # Errors
/// A scene that cannot be read or makes no sense, a folder or a stdout that cannot be written to, files there that somebody else made.
pub fn run(args: &SimulateArgs, answer: &mut dyn FnMut(&str) -> Result<()>) -> Result<Status> {
    let SimulateArgs { scene, out, .. } = args;
    let named = || format!("scene {}", scene.display());
    let mut read = Scene::read(scene)?;
    if let Some(effects) = args.effects {
        read.effects = effects.choice();
    }
    let recording = SimulatedRecording::new(&read).with_context(named)?;
    if args.explain {
        answer(&table(recording.decisions()))?;
    }
    let stem = stem(scene);
    if !args.force {
        super::refuse_foreign(&files_of(&recording, &stem, out).foreign())?;
    }
    detail(|| {
        let camera = &recording.scene().camera;
        let used = recording.decisions().iter().filter(|d| d.used).map(|d| d.name);
        format!(
            "scene {}: {} × {} px, {} Hz, {} frames; effects: {}",
            scene.display(),
            camera.width_px,
            camera.height_px,
            camera.frame_rate_hz,
            recording.frame_count(),
            used.collect::<Vec<_>>().join(", ")
        )
    });
    let bar = messages::progress_bar(
        Some(recording.frame_count() as u64),
        "{bar:40} frame {pos} of {len}, {eta} left",
    );
    interrupt::clear_when_told_to_end(out);
    let written = write(&recording, &stem, out, |done| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    detail(|| "rendered".to_owned());
    let SimulatedFiles {
        video,
        truth,
        calib,
        frames,
    } = written;
    let [video, truth, calib] = [video, truth, calib].map(|path| path.display().to_string());
    answer(&format!(
        "{} ({frames} frames)\n{}\n{}\n",
        on_one_line(&video),
        on_one_line(&truth),
        on_one_line(&calib)
    ))?;
    Ok(Status::Done)
}

/// The scene's file name without its ending, `.scene.json` or the last one.
fn stem(scene: &Path) -> String {
    let name = scene.file_name().map_or("scene".into(), |n| n.to_string_lossy());
    name.strip_suffix(".scene.json")
        .or_else(|| name.rsplit_once('.').map(|(stem, _)| stem))
        .filter(|stem| !stem.is_empty())
        .unwrap_or(&name)
        .to_owned()
}

/// The table of effects: effect, estimate, tolerance, used or not, why, by which formula.
fn table(decisions: &[Decision]) -> String {
    let mut text = format!(
        "{:<16} {:>15} {:>12}  {:<4}  why\n",
        "effect", "estimate", "tolerance", "used"
    );
    for d in decisions {
        let unit = match d.estimate.unit {
            Unit::Px => "px",
            Unit::Grey => "grey",
        };
        let used = if d.used { "yes" } else { "no" };
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{:<16} {:>10} {unit:<4} {:>7} {unit:<4}  {used:<4}  {}\n{:<52}{}",
            d.name,
            significant(d.estimate.amount),
            significant(d.tolerance),
            d.reason,
            "",
            d.estimate.formula
        );
    }
    text
}

/// Three significant digits, without an exponent where a person would not write one.
fn significant(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    let decimals = 2.0 - x.abs().log10().floor();
    if decimals > 7.0 {
        format!("{x:.2e}")
    } else {
        format!("{x:.*}", decimals.max(0.0) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stem_is_the_name_without_its_ending() {
        for (file, expected) in [
            ("a/steel.scene.json", "steel"),
            ("steel.json", "steel"),
            ("steel", "steel"),
            (".json", ".json"),
            ("a.b.json", "a.b"),
        ] {
            assert_eq!(stem(Path::new(file)), expected);
        }
    }

    #[test]
    fn numbers_in_the_table_have_three_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (0.0123456, "0.0123"),
            (140.4, "140"),
            (1.0, "1.00"),
            (3.21e-9, "3.21e-9"),
        ] {
            assert_eq!(significant(x), expected);
        }
    }

    #[test]
    fn a_command_writes_three_files() {
        let folder = std::env::temp_dir().join(format!("track-simulate-{}", std::process::id()));
        let scene = folder.join("tiny.scene.json");
        std::fs::create_dir_all(&folder).unwrap();
        let text = r#"{"schema": "track.scene/1", "contact": {"model": "mu_e", "restitution": 0.5, "friction": 0.1},
            "camera": {"image_size_px": [160, 120], "origin_px": [20, 110], "metres_per_pixel": 0.002}}"#;
        std::fs::write(&scene, text).unwrap();
        let mut output = String::new();
        let mut answer = |text: &str| {
            output += text;
            Ok(())
        };
        let args = |out: &str, effects| SimulateArgs {
            scene: scene.clone(),
            out: folder.join(out),
            effects,
            explain: effects.is_none(),
            force: false,
        };
        run(&args("out", None), &mut answer).unwrap();
        for ending in ["mp4", "truth.json", "calib.json"] {
            assert!(
                folder.join("out").join(format!("tiny.{ending}")).exists(),
                "{ending}"
            );
        }
        run(&args("none", Some(Effects::None)), &mut answer).unwrap();
        assert!(folder.join("none").join("tiny.mkv").exists());
        let missing = SimulateArgs {
            scene: folder.join("missing.json"),
            ..args("", None)
        };
        let error = run(&missing, &mut answer).unwrap_err();
        assert!(format!("{error:#}").contains("missing.json"));
        assert!(
            output.starts_with("effect") && output.contains("tiny.mkv"),
            "{output}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
