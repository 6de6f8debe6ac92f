//! Which model is preferred, and why.
//!
//! The lowest AICc is. Less than [`DECISIVE`] below the next is no preference, with one exception: a general model, one that
//! holds others as special cases (grip-slide: e_x = 0; friction never reached), always fits as well as those and can never
//! be beaten by much. Up to [`NO_MORE`] better it does not count (where it is not needed, chance puts it beyond that in 1 series of 40),
//! (twice as much for one that bends with the incidence, as the compliant contact does) and the choice is between the simple ones; from [`GENERAL`] on it is preferred (1 series of 120); between, nothing is.
//!
//! Where rows scatter more than they should around every model, differences of χ² are divided by the least χ² per degree of
//! freedom, lest a wrong scale of the deviations decide.

use super::criteria::{InformationCriteria, LEAST_PROBABILITY};
use super::estimate::three_digits;
use super::group_data::GroupData;
use super::result::ModelFit;
use super::series::{Note, Weights};
use super::variants::Solution;
use crate::rebound::{ModelName, Preferred};

/// A difference of AICc that decides.
const DECISIVE: f64 = 2.0;

/// Where no model fits, how many times the χ² of the preferred one its rival's has to be: less may be the rivals' different
/// luck with what all of them lack.
const FAR_BETTER: f64 = 10.0;

/// Up to this much better than the best of its own special cases, grip-slide is not needed.
const NO_MORE: f64 = 3.0;

/// What grip-slide has to be better by than its own special cases to be preferred.
const GENERAL: f64 = 5.0;

/// The same two for a model that bends with the incidence (compliant): there is more in it that chance can follow.
const NO_MORE_BENDS: f64 = 6.0;
/// See [`NO_MORE_BENDS`].
const BENDS: f64 = 8.0;

/// Up to how much better than its special cases a general model is not needed, and from how much on it is preferred.
fn leads(name: ModelName) -> (f64, f64) {
    if name.model().grip_is_linear() {
        (NO_MORE, GENERAL)
    } else {
        (NO_MORE_BENDS, BENDS)
    }
}

/// The choice among `fits`, whose solutions are `solutions`.
pub(super) fn choose(
    data: &GroupData,
    solutions: &[Solution],
    fits: &[ModelFit],
) -> (Preferred, String, Vec<Note>) {
    let spread = spread(data, fits);
    let notes = notes(data, fits, spread);
    let mut candidates: Vec<(ModelName, f64)> = Vec::new();
    let mut excluded = Vec::new();
    for (solution, fit) in solutions.iter().zip(fits) {
        let name = fit.name.name();
        let limit = usize::from(solution.jump().is_some());
        let criteria = InformationCriteria::new(data, solution.best.chi2, solution.rank + limit, spread);
        match (&fit.impossible, criteria.aicc, fit.converged) {
            (Some(why), ..) => excluded.push(format!("{name} cannot be: {why}")),
            (_, _, false) => excluded.push(format!("{name}: the search did not come to an end")),
            (_, None, _) => excluded.push(format!(
                "{name}: {} equations are too few for AICc, which takes {} for {} parameters",
                criteria.equations,
                criteria.parameters + 2,
                criteria.parameters
            )),
            (None, Some(aicc), true) => candidates.push((fit.name, aicc)),
        }
    }
    candidates.sort_by(|a, b| a.1.total_cmp(&b.1));
    // A model that the rows are too few to judge may be the right one; a general one has to show that it is needed.
    let unjudged = |fit: &&ModelFit| {
        let judged = candidates.iter().any(|c| c.0 == fit.name);
        !is_general(fit.name) && fit.impossible.is_none() && !judged
    };
    if fits.iter().any(|fit| unjudged(&fit)) {
        candidates.clear();
    }
    let none_slides: Vec<ModelName> = fits.iter().filter(|f| f.sliding == 0).map(|f| f.name).collect();
    let (mut preferred, mut sentences) = decide(&candidates, &none_slides);
    if let Preferred::Model(name) = preferred
        && spread > 1.0
        && !far_better(name, fits)
    {
        preferred = Preferred::Undetermined;
        sentences.push(format!("{} is the least bad, but not by far", name.name()));
    }
    sentences.extend(excluded);
    if spread > 1.0 && candidates.len() > 1 {
        sentences.push(format!(
            "differences of χ² are divided by the scatter, {}",
            three_digits(spread)
        ));
    }
    if notes.iter().any(|n| n.code == "no_model_fits") {
        sentences.push(match preferred {
            Preferred::Model(_) => "no model describes the data: the preference is only relative".to_owned(),
            Preferred::Undetermined => "no model describes the data".to_owned(),
        });
    }
    let mut reason = sentences.join("; ");
    reason.push('.');
    (preferred, reason, notes)
}

/// Whether a model that does not fit is still in another class than its rivals.
fn far_better(name: ModelName, fits: &[ModelFit]) -> bool {
    let chi2 = |of: ModelName| {
        fits.iter()
            .find(|f| f.name == of)
            .map_or(f64::INFINITY, |f| f.chi2)
    };
    // A general model fits as well as its special cases do: it is no rival of theirs.
    let rivals = ModelName::ALL
        .into_iter()
        .filter(|&rival| rival != name && !is_general(rival));
    rivals
        .into_iter()
        .all(|rival| chi2(rival) > FAR_BETTER * chi2(name))
}

/// Whether a model holds others as special cases.
fn is_general(name: ModelName) -> bool {
    name.special_cases().next().is_some()
}

/// By how much the AICc of each other model is above `base`, in words.
fn against(candidates: &[(ModelName, f64)], preferred: ModelName, base: f64) -> Vec<String> {
    let others = candidates.iter().filter(|(name, _)| *name != preferred);
    others
        .map(|&(name, aicc)| {
            let contains = if is_general(name) {
                " (which holds the others as special cases)"
            } else {
                ""
            };
            format!("AICc of {}{contains} is {}", name.name(), difference(aicc - base))
        })
        .collect()
}

/// The decision among models in the order of their AICc; `none_slides` are those in which no row slides.
fn decide(candidates: &[(ModelName, f64)], none_slides: &[ModelName]) -> (Preferred, Vec<String>) {
    let Some(&(best, least)) = candidates.first() else {
        return (
            Preferred::Undetermined,
            vec!["the models cannot be compared".to_owned()],
        );
    };
    let aicc = |name| candidates.iter().find(|c| c.0 == name).map(|c| c.1);
    let list = |preferred, base| against(candidates, preferred, base);
    if candidates.len() == 1 {
        return (
            Preferred::Model(best),
            vec![format!("{} is the only model left", best.name())],
        );
    }
    // They are sorted: the first of a kind is its best.
    let mut simple_ones = candidates.iter().filter(|c| !is_general(c.0));
    let Some(&(simple, simple_aicc)) = simple_ones.next() else {
        return (Preferred::Model(best), list(best, least));
    };
    let lead = |&&(_, aicc): &&(ModelName, f64)| simple_aicc - aicc;
    let general_ones = || candidates.iter().filter(|c| is_general(c.0));
    let mut needed = general_ones().filter(|c| lead(c) >= leads(c.0).1);
    if let Some(&(general, aicc)) = needed.next() {
        let mut sentences = list(general, aicc);
        let close = |rival: &&(ModelName, f64)| rival.0 != general && rival.1 - aicc < DECISIVE;
        if general_ones().any(|rival| close(&rival)) {
            sentences.push(format!(
                "the difference is under {DECISIVE}, which decides nothing"
            ));
            return (Preferred::Undetermined, sentences);
        }
        return (Preferred::Model(general), sentences);
    }
    if let Some((general, _)) = general_ones().find(|c| lead(c) >= leads(c.0).0) {
        let (least, most) = leads(*general);
        let mut sentences = list(simple, simple_aicc);
        sentences.push(format!(
            "a model that holds the other as a special case is ahead by {least} to {most} by chance now and then"
        ));
        return (Preferred::Undetermined, sentences);
    }
    let gap = simple_ones.next().map(|(_, aicc)| aicc - simple_aicc);
    // Where all rows leave rolling, one model is the other with a coefficient less: that is no evidence.
    let same = none_slides.iter().find_map(|&name| {
        let (other, sentence) = name.model().same_without_sliding()?;
        let both = aicc(name).is_some() && aicc(ModelName::of_name(other)?).is_some();
        let counts = simple == name || gap.is_some_and(|gap| gap < DECISIVE);
        (both && counts).then_some(sentence)
    });
    if let Some(sentence) = same {
        let mut sentences = vec![sentence.to_owned()];
        sentences.extend(list(simple, simple_aicc));
        return (Preferred::Undetermined, sentences);
    }
    match gap {
        Some(gap) if gap < DECISIVE => {
            let mut sentences = list(simple, simple_aicc);
            sentences.push(format!(
                "the difference is under {DECISIVE}, which decides nothing"
            ));
            (Preferred::Undetermined, sentences)
        }
        _ => (Preferred::Model(simple), list(simple, simple_aicc)),
    }
}

fn difference(gap: f64) -> String {
    if gap.abs() < 0.05 {
        "the same".to_owned()
    } else if gap > 0.0 {
        format!("{gap:.1} higher")
    } else {
        format!("{:.1} lower", -gap)
    }
}

/// Least χ² per degree of freedom where chance does not explain it; 1 elsewhere.
fn spread(data: &GroupData, fits: &[ModelFit]) -> f64 {
    if data.weights == Weights::Unit {
        return 1.0;
    }
    let passes = |fit: &ModelFit| fit.p_value.is_some_and(|p| p >= LEAST_PROBABILITY);
    if fits.iter().any(passes) {
        return 1.0;
    }
    fits.iter()
        .filter(|fit| fit.degrees_of_freedom > 0 && fit.impossible.is_none())
        .map(|fit| fit.chi2 / fit.degrees_of_freedom as f64)
        .reduce(f64::min)
        .map_or(1.0, |spread| spread.max(1.0))
}

fn notes(data: &GroupData, fits: &[ModelFit], spread: f64) -> Vec<Note> {
    if data.weights == Weights::Unit || !(spread > 1.0) {
        return Vec::new();
    }
    let each: Vec<String> = fits
        .iter()
        .filter_map(|fit| {
            let p = fit.p_value?;
            Some(format!(
                "{} has χ² = {} for {} degrees of freedom (probability {})",
                fit.name.name(),
                three_digits(fit.chi2),
                fit.degrees_of_freedom,
                probability(p)
            ))
        })
        .collect();
    if each.is_empty() {
        return Vec::new();
    }
    vec![Note {
        code: "no_model_fits",
        message: format!(
            "no model with constant coefficients describes these rows: {}. Either the standard deviations are too small \
             (by about {} times), or the coefficients change from row to row, as they do with the elastic give of a \
             contact. Uncertainties are widened by the scatter; look at the residuals.",
            each.join("; "),
            three_digits(spread.sqrt())
        ),
    }]
}

/// A probability for people.
pub(super) fn probability(p: f64) -> String {
    if p < 1e-4 {
        "under 0.0001".to_owned()
    } else {
        three_digits(p)
    }
}
