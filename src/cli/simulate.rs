//! `track simulate SCENE --out DIR [--effects auto|all|none] [--explain]`.

use crate::simulate::effects::{Decision, Unit};
use crate::simulate::{EffectsChoice, Scene, SimulatedFiles, SimulatedRecording, write};
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write as _;
use std::path::Path;

/// Renders the scene file `scene` into the folder `out` and gives to `answer` what was written; with `explain` before
/// that the table of effects. `effects` overrides the scene's own choice.
///
/// # Errors
/// A scene that cannot be read or makes no sense, a folder or a stdout that cannot be written to.
pub fn run(
    scene: &Path,
    out: &Path,
    effects: Option<EffectsChoice>,
    explain: bool,
    answer: &mut dyn FnMut(&str) -> Result<()>,
) -> Result<()> {
    let named = || format!("scene {}", scene.display());
    let mut read = Scene::read(scene)?;
    if let Some(choice) = effects {
        read.effects = choice;
    }
    let recording = SimulatedRecording::new(&read).with_context(named)?;
    if explain {
        answer(&table(recording.decisions()))?;
    }
    let bar = ProgressBar::new(recording.frame_count() as u64).with_style(ProgressStyle::with_template(
        "{bar:40} frame {pos} of {len}, {eta} left",
    )?);
    let written = write(&recording, &stem(scene), out, |done| {
        bar.set_position(done as u64)
    })?;
    bar.finish_and_clear();
    let SimulatedFiles {
        video,
        truth,
        calib,
        frames,
    } = written;
    answer(&format!(
        "{} ({frames} frames)\n{}\n{}\n",
        video.display(),
        truth.display(),
        calib.display()
    ))
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
        run(&scene, &folder.join("out"), None, true, &mut answer).unwrap();
        for ending in ["mp4", "truth.json", "calib.json"] {
            assert!(
                folder.join("out").join(format!("tiny.{ending}")).exists(),
                "{ending}"
            );
        }
        let none = crate::simulate::scene::parse_effects_word("none");
        run(&scene, &folder.join("none"), none, false, &mut answer).unwrap();
        assert!(folder.join("none").join("tiny.mkv").exists());
        let error = run(&folder.join("missing.json"), &folder, None, false, &mut answer).unwrap_err();
        assert!(format!("{error:#}").contains("missing.json"));
        assert!(
            output.starts_with("effect") && output.contains("tiny.mkv"),
            "{output}"
        );
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
