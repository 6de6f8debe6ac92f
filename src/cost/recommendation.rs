//! The cheapest setting that was measured to reach wanted errors. Nothing is interpolated: a setting between two that were
//! run is not one that was run.

use super::recording_metrics::{LIGHT, QUANTITIES, SECONDS, STORAGE};
use super::study::{Metric, Run, Subject};
use crate::config::{Closeness, nearest};
use std::str::FromStr;

/// A quantity and how large its error may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Requirement {
    /// One of [`QUANTITIES`].
    pub quantity: Metric,
    /// In its unit, for 95 % of the recordings.
    pub at_most: f64,
}

/// What can be wrong with a want.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RequirementError {
    /// No equals sign.
    #[error("{found:?} is not NAME=VALUE; write for example restitution=0.002")]
    NotAPair {
        /// As given.
        found: String,
    },
    /// A quantity that is not measured.
    #[error(
        "unknown quantity {found:?}{}Known: {known}",
        nearest.as_ref().map_or("; ".to_owned(), |n| format!(", did you mean {n:?}? "))
    )]
    Unknown {
        /// As given.
        found: String,
        /// The most similar one.
        nearest: Option<String>,
        /// All of them.
        known: String,
    },
    /// No error that could be reached.
    #[error(
        "the error {found:?} for {quantity} is not a number above 0; write for example {quantity}={example}"
    )]
    Impossible {
        /// Of what.
        quantity: &'static str,
        /// As given.
        found: String,
        /// What makes sense.
        example: f64,
    },
}

impl FromStr for Requirement {
    type Err = RequirementError;

    fn from_str(text: &str) -> Result<Self, RequirementError> {
        let (name, value) = text.split_once('=').ok_or_else(|| RequirementError::NotAPair {
            found: text.to_owned(),
        })?;
        let name = name.trim();
        let Some(quantity) = QUANTITIES.into_iter().find(|q| q.name == name) else {
            let known: Vec<&str> = QUANTITIES.iter().map(|q| q.name).collect();
            let nearest = nearest(name, known.iter().copied(), Closeness::Guess);
            return Err(RequirementError::Unknown {
                found: name.to_owned(),
                nearest: nearest.map(str::to_owned),
                known: known.join(", "),
            });
        };
        match value.trim().parse::<f64>() {
            Ok(at_most) if at_most > 0.0 && at_most.is_finite() => Ok(Self { quantity, at_most }),
            _ => Err(RequirementError::Impossible {
                quantity: quantity.name,
                found: value.trim().to_owned(),
                example: example(quantity.name),
            }),
        }
    }
}

/// An error that makes sense to want.
fn example(quantity: &str) -> f64 {
    match quantity {
        "restitution" => 0.002,
        "friction" => 0.005,
        "x0_m" | "x_m" => 0.0005,
        _ => 0.1,
    }
}

/// What is wanted where nobody says.
#[must_use]
pub fn default_requirements() -> Vec<Requirement> {
    vec![Requirement {
        quantity: QUANTITIES[0],
        at_most: example(QUANTITIES[0].name),
    }]
}

/// What to take.
#[derive(Debug, Clone, PartialEq)]
pub struct Recommendation {
    /// What was wanted.
    pub requirements: Vec<Requirement>,
    /// Index into the runs of the section `whole`; `None` where no run reaches all that is wanted.
    pub chosen: Option<usize>,
    /// Cheaper runs that reached it on the recordings they were chosen by but not on new ones, and why not.
    pub set_aside: Vec<(usize, String)>,
    /// All of it in words.
    pub words: String,
}

/// Candidates that new recordings may refuse before none is recommended.
const MOST_REFUSED: usize = 12;

/// The run with the least median time among those where no recording failed and the 95 % bound of every wanted error
/// is within what is wanted, and that `holds` on new recordings: the cheapest of a hundred settings is a lucky one, so that its
/// own recordings say too much good of it. `holds` gives the reason why a run does not; only runs that `is_choice` are taken, what a
/// user can ask this program for.
///
/// # Errors
/// Those of `holds`.
pub fn recommend<E>(
    whole: &Subject,
    requirements: &[Requirement],
    is_choice: impl Fn(usize) -> bool,
    mut holds: impl FnMut(usize) -> Result<Option<String>, E>,
) -> Result<Recommendation, E> {
    let seconds = |i: usize| {
        whole.runs[i]
            .work(SECONDS.name)
            .map_or(f64::INFINITY, |s| s.median)
    };
    let reaches = |i: &usize| {
        let run = &whole.runs[*i];
        run.failed.is_none()
            && requirements.iter().all(|w| {
                run.error(w.quantity.name)
                    .is_some_and(|e| e.bound_95 <= w.at_most)
            })
    };
    let mut candidates: Vec<usize> = (0..whole.runs.len())
        .filter(|i| is_choice(*i) && reaches(i))
        .collect();
    candidates.sort_by(|a, b| seconds(*a).total_cmp(&seconds(*b)));
    let (mut chosen, mut set_aside) = (None, Vec::new());
    for i in candidates.into_iter().take(MOST_REFUSED) {
        match holds(i)? {
            None => {
                chosen = Some(i);
                break;
            }
            Some(why) => set_aside.push((i, why)),
        }
    }
    let choices = (0..whole.runs.len())
        .filter(|i| is_choice(*i))
        .collect::<Vec<_>>();
    let words = match chosen {
        Some(i) => reached(whole, requirements, i, choices.len()) + &refused(whole, &set_aside),
        None => missed(whole, requirements, &choices) + &refused(whole, &set_aside),
    };
    Ok(Recommendation {
        requirements: requirements.to_vec(),
        chosen,
        set_aside,
        words,
    })
}

/// What was said of the settings that new recordings refused.
fn refused(whole: &Subject, set_aside: &[(usize, String)]) -> String {
    let Some((i, why)) = set_aside.first() else {
        return String::new();
    };
    format!(
        " Set aside, because new recordings did not bear them out: {} (the cheapest: {}; {why}).",
        set_aside.len(),
        settings(&whole.runs[*i]),
    )
}

fn settings(run: &Run) -> String {
    let each: Vec<String> = run
        .settings
        .iter()
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    each.join(", ")
}

fn listed(requirements: &[Requirement]) -> String {
    requirements
        .iter()
        .map(|w| {
            let unit = if w.quantity.unit.is_empty() { "" } else { " " };
            format!(
                "{} within {}{unit}{}",
                w.quantity.name, w.at_most, w.quantity.unit
            )
        })
        .collect::<Vec<_>>()
        .join(", ")
}

/// `choices` is how many there were.
fn reached(whole: &Subject, requirements: &[Requirement], chosen: usize, choices: usize) -> String {
    let run = &whole.runs[chosen];
    let of = |name: &str| run.setting(name).unwrap_or_default();
    let found: Vec<String> = requirements
        .iter()
        .filter_map(|w| {
            let e = run.error(w.quantity.name)?;
            Some(format!(
                "{}: rms {:.2e}, 95 % of those seen within {:.2e}, 95 % of all within {:.2e} by the bound",
                w.quantity.name, e.rms, e.p95, e.bound_95
            ))
        })
        .collect();
    let recordings = run.work(SECONDS.name).map_or(0, |s| s.repeats);
    let seconds = run.work(SECONDS.name).map_or(0.0, |s| s.median);
    let light = run.work(LIGHT.name).map_or(0.0, |s| s.median);
    let megabytes = run.work(STORAGE.name).map_or(0.0, |s| s.median);
    format!(
        "For {}: --accuracy {} at {} frames a second, {} picture, exposure {} s, H.264 at crf {}. Measured on {recordings} recordings: \
         {}. It takes {seconds:.2} s a recording (median, decoding included), {megabytes:.3} MB and about {light:.0} lx at f/2, ISO 800. It is the cheapest of the {choices} settings that \
         were measured which also held on new recordings, every one of them; none is interpolated.",
        listed(requirements),
        of("accuracy"),
        of("frame_rate_hz"),
        of("picture"),
        of("exposure_s"),
        of("crf"),
        found.join("; "),
    )
}

fn missed(whole: &Subject, requirements: &[Requirement], choices: &[usize]) -> String {
    let mut words = format!(
        "For {}: none of the {} settings that were measured reaches it.",
        listed(requirements),
        choices.len()
    );
    for want in requirements {
        let best = choices
            .iter()
            .map(|i| &whole.runs[*i])
            .filter(|run| run.failed.is_none())
            .filter_map(|run| Some((run.error(want.quantity.name)?.bound_95, run)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((bound, run)) = best {
            words.push_str(&format!(
                " The best for {} holds 95 % of the errors within {bound:.2e}: {}.",
                want.quantity.name,
                settings(run)
            ));
        }
    }
    words.push_str(" Ask for less, or record with more light, a larger ball or more pixels.");
    words
}

#[cfg(test)]
mod tests {
    use super::super::stats::{ErrorStatistics, Quartiles};
    use super::*;

    fn run(seconds: f64, errors: &[f64], failed: bool) -> Run {
        Run {
            settings: vec![("accuracy", "fast".to_owned()), ("picture", "half".to_owned())],
            errors: vec![("restitution", ErrorStatistics::of(errors).unwrap())],
            work: vec![(SECONDS.name, Quartiles::exact(seconds))],
            counts: Vec::new(),
            failed: failed.then(|| "one was rejected".to_owned()),
            is_default: false,
        }
    }

    fn section(runs: Vec<Run>) -> Subject {
        Subject {
            name: "whole",
            title: "",
            words: Vec::new(),
            errors: Vec::new(),
            works: Vec::new(),
            runs,
            diagrams: Vec::new(),
        }
    }

    #[test]
    fn the_cheapest_that_reaches_it_is_taken_and_never_one_that_failed() {
        let good = [1e-4; 20];
        let runs = vec![
            run(0.1, &[0.1; 20], false),
            run(0.2, &good, true),
            run(0.6, &good, false),
            run(0.4, &good, false),
        ];
        let requirements: Vec<Requirement> = vec!["restitution=0.002".parse().unwrap()];
        let all_hold = |_| Ok::<_, std::convert::Infallible>(None);
        let found = recommend(&section(runs.clone()), &requirements, |_| true, all_hold).unwrap();
        assert_eq!(found.chosen, Some(3));
        let of_another_program = |i| i != 3;
        let found_without = recommend(
            &section(runs.clone()),
            &requirements,
            of_another_program,
            all_hold,
        )
        .unwrap();
        assert_eq!(found_without.chosen, Some(2));
        assert!(found.words.contains("--accuracy fast"), "{}", found.words);
        let strict: Vec<Requirement> = vec!["restitution=1e-6".parse().unwrap()];
        let found = recommend(
            &section(vec![run(0.4, &good, false)]),
            &strict,
            |_| true,
            all_hold,
        )
        .unwrap();
        assert_eq!(found.chosen, None);
        assert!(found.words.contains("none of the 1 settings") && found.words.contains("The best"));
    }

    #[test]
    fn few_errors_are_not_believed() {
        // Three errors just below what is wanted say little of the next hundred.
        let requirements: Vec<Requirement> = vec!["restitution=0.002".parse().unwrap()];
        let few = recommend(
            &section(vec![run(0.1, &[0.0015, -0.0012, 0.0014], false)]),
            &requirements,
            |_| true,
            |_| Ok::<_, std::convert::Infallible>(None),
        )
        .unwrap();
        assert_eq!(few.chosen, None);
    }

    #[test]
    fn what_new_recordings_refuse_is_set_aside() {
        let requirements: Vec<Requirement> = vec!["restitution=0.002".parse().unwrap()];
        let runs = vec![
            run(0.6, &[1e-4; 20], false),
            run(0.1, &[1e-4; 20], false),
            run(0.4, &[1e-4; 20], false),
        ];
        let lucky = |i: usize| {
            Ok::<_, std::convert::Infallible>((i == 1).then(|| "restitution off by 6.4e-3".to_owned()))
        };
        let found = recommend(&section(runs.clone()), &requirements, |_| true, lucky).unwrap();
        assert_eq!(found.chosen, Some(2));
        assert_eq!(found.set_aside.len(), 1);
        assert!(found.words.contains("off by 6.4e-3"), "{}", found.words);
        let none = recommend(
            &section(runs),
            &requirements,
            |_| true,
            |_| Ok::<_, std::convert::Infallible>(Some("no".to_owned())),
        );
        assert_eq!(none.unwrap().chosen, None);
    }

    #[test]
    fn a_want_that_makes_no_sense_says_what_would() {
        let error = |text: &str| text.parse::<Requirement>().unwrap_err().to_string();
        assert!(error("nonsense=1").contains("Known: restitution, friction"));
        assert!(error("restitition=0.1").contains("did you mean \"restitution\""));
        assert!(error("frictoin=0.1").contains("did you mean \"friction\""));
        assert!(error("x_o=0.1").contains("x0_m") || error("x_o=0.1").contains("x_m"));
        for bad in [
            "restitution=-0.002",
            "restitution=0",
            "restitution=nan",
            "restitution=inf",
            "restitution=",
        ] {
            assert!(error(bad).contains("not a number above 0"), "{bad}");
        }
        assert!(error("restitution").contains("NAME=VALUE"));
        assert_eq!("x0_m = 0.0005".parse::<Requirement>().unwrap().at_most, 0.0005);
    }
}
