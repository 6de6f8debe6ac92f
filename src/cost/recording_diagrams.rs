//! What is drawn of whole recordings: each error against time, light and storage; e, μ and x0 also against codec quality and
//! picture size.

use super::centres::ComparedMethod;
use super::recording_metrics::{CRF, LIGHT, PICTURE, QUANTITIES, SECONDS, STORAGE};
use super::recording_plan::{RecordingPlan, RecordingSetting, picture_name};
use super::study::{Diagram, Metric, SettingCurve};

/// The quantities that are drawn against codec quality and picture size: e, μ, x0.
const DRAWN: [&str; 3] = ["restitution", "friction", "x0_m"];

/// An abscissa, what is said of it, and the curves.
struct Against {
    work: Metric,
    how: String,
    curves: Vec<SettingCurve>,
    overview: bool,
}

/// For each quantity: against time, light and storage, and some against what a lab sets besides.
pub(super) fn diagrams(plan: &RecordingPlan, settings: &[RecordingSetting]) -> Vec<Diagram> {
    let usual = &plan.usual;
    let rates: Vec<String> = plan.frame_rates_hz.iter().map(f64::to_string).collect();
    let rates = rates.join(", ");
    let (exposure, picture, rate) = (
        milliseconds(usual.exposure_s),
        usual.picture(),
        usual.frame_rate_hz,
    );
    let level = usual.method.name();
    let kinds = [
        Against {
            work: SECONDS,
            how: format!("against time; exposure {exposure}, along a curve {rates} Hz"),
            curves: against_time(plan, settings),
            overview: true,
        },
        Against {
            work: LIGHT,
            how: format!("against light; {level}, {picture} picture, along a curve the exposure"),
            curves: against_light(plan, settings),
            overview: true,
        },
        Against {
            work: STORAGE,
            how: format!(
                "against storage; {level}, along a curve {rates} Hz, or at {rate} Hz the codec quality"
            ),
            curves: against_storage(plan, settings),
            overview: false,
        },
        Against {
            work: CRF,
            how: format!(
                "against codec quality (less is better); {picture} picture, {rate} Hz, exposure {exposure}"
            ),
            curves: each_method(plan, settings, |s| RecordingSetting { crf: usual.crf, ..*s }),
            overview: true,
        },
        Against {
            work: PICTURE,
            how: format!("against picture size; {rate} Hz, exposure {exposure}"),
            curves: each_method(plan, settings, |s| RecordingSetting {
                reduction: usual.reduction,
                ..*s
            }),
            overview: true,
        },
    ];
    let of_quantity = |error: Metric| {
        let drawn = kinds
            .iter()
            .filter(move |kind| ![CRF, PICTURE].contains(&kind.work) || DRAWN.contains(&error.name));
        drawn.map(move |kind| Diagram {
            title: format!("{} {}", error.name, kind.how),
            error,
            work: kind.work,
            floors: Vec::new(),
            curves: kind.curves.clone(),
            alternatives: true,
            overview: kind.overview && error == QUANTITIES[0],
            less_is_better: kind.work != CRF,
        })
    };
    QUANTITIES.into_iter().flat_map(of_quantity).collect()
}

/// A curve a picture size and accuracy, and a tool in the usual picture, along which the frame rate grows.
fn against_time(plan: &RecordingPlan, settings: &[RecordingSetting]) -> Vec<SettingCurve> {
    let usual = &plan.usual;
    let each = plan.reductions.iter().flat_map(|&reduction| {
        plan.every_method().filter_map(move |method| {
            let is_tool = matches!(method, ComparedMethod::Tool(_));
            let name = format!("{}, {}", picture_name(reduction), method.name());
            let name = if is_tool { method.name().to_owned() } else { name };
            let wanted = RecordingSetting {
                method,
                reduction,
                ..*usual
            };
            curve(name, settings, |s| {
                let varied = RecordingSetting {
                    frame_rate_hz: usual.frame_rate_hz,
                    ..*s
                };
                varied == wanted && (!is_tool || reduction == usual.reduction)
            })
        })
    });
    each.collect()
}

/// A curve a frame rate, along which the exposure grows.
fn against_light(plan: &RecordingPlan, settings: &[RecordingSetting]) -> Vec<SettingCurve> {
    let usual = &plan.usual;
    let each = plan.frame_rates_hz.iter().filter_map(|&frame_rate_hz| {
        let wanted = RecordingSetting {
            frame_rate_hz,
            ..*usual
        };
        curve(format!("{frame_rate_hz} Hz"), settings, |s| {
            wanted
                == RecordingSetting {
                    exposure_s: usual.exposure_s,
                    ..*s
                }
        })
    });
    each.collect()
}

/// A curve an exposure and picture size, along which the frame rate grows; and one a picture size, along which the codec quality
/// falls.
fn against_storage(plan: &RecordingPlan, settings: &[RecordingSetting]) -> Vec<SettingCurve> {
    let usual = &plan.usual;
    let by_rate = plan.exposures_s.iter().flat_map(|&exposure_s| {
        plan.reductions.iter().filter_map(move |&reduction| {
            let name = format!("{}, {}", picture_name(reduction), milliseconds(exposure_s));
            let wanted = RecordingSetting {
                exposure_s,
                reduction,
                ..*usual
            };
            curve(name, settings, |s| {
                wanted
                    == RecordingSetting {
                        frame_rate_hz: usual.frame_rate_hz,
                        ..*s
                    }
            })
        })
    });
    let by_codec = plan.reductions.iter().filter_map(|&reduction| {
        let wanted = RecordingSetting { reduction, ..*usual };
        let along = curve(format!("{}, by crf", picture_name(reduction)), settings, |s| {
            wanted == RecordingSetting { crf: usual.crf, ..*s }
        })?;
        (along.runs.len() > 1).then_some(along)
    });
    by_rate.chain(by_codec).collect()
}

/// A curve a way to find centres, of the settings that `varied` makes the usual one.
fn each_method(
    plan: &RecordingPlan,
    settings: &[RecordingSetting],
    varied: impl Fn(&RecordingSetting) -> RecordingSetting,
) -> Vec<SettingCurve> {
    let each = plan.every_method().filter_map(|method| {
        let wanted = plan.usual.with(method);
        curve(method.name().to_owned(), settings, |s| varied(s) == wanted)
    });
    each.collect()
}

/// The settings that `belongs` holds of; `None` without any.
fn curve(
    name: String,
    settings: &[RecordingSetting],
    belongs: impl Fn(&RecordingSetting) -> bool,
) -> Option<SettingCurve> {
    let runs: Vec<usize> = (0..settings.len()).filter(|&i| belongs(&settings[i])).collect();
    (!runs.is_empty()).then_some(SettingCurve { name, runs })
}

fn milliseconds(seconds: f64) -> String {
    format!("{} ms", (1e4 * seconds).round() / 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_diagram_of_both_plans_has_several_places_to_the_right_and_no_empty_curve() {
        for plan in [RecordingPlan::full(), RecordingPlan::quick()] {
            let settings: Vec<RecordingSetting> = plan
                .cameras()
                .into_iter()
                .flat_map(|(camera, methods)| methods.into_iter().map(move |m| camera.with(m)))
                .collect();
            let diagrams = diagrams(&plan, &settings);
            assert_eq!(diagrams.len(), 6 * 3 + 3 * 2);
            let usual = settings.iter().position(|s| *s == plan.usual).unwrap();
            for d in &diagrams {
                assert!(d.curves.iter().any(|c| c.runs.contains(&usual)), "{}", d.title);
                assert!(d.curves.iter().all(|c| !c.runs.is_empty()));
                assert!(d.curves.iter().any(|c| c.runs.len() > 1), "{}", d.title);
            }
        }
    }
}
