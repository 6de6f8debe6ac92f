//! The empty scene in its colours, for pictures: nothing is measured on it.

use crate::detect::background::{self, Background};
use crate::frames::{Chroma, Frame, Luma};
use std::sync::Arc;

/// The colours of the empty scene in the reference picture.
#[derive(Debug, Clone)]
pub struct SceneColours {
    /// Its luma, where frames were given with a mixture in its place.
    pub luma: Option<Luma>,
    /// Its chroma.
    pub chroma: Chroma,
}

impl SceneColours {
    /// The median over the frames that `background` was made of, each moved to where that is; `None` where they have no colour to show.
    pub fn of(survey: &[&Frame], background: &Background) -> Option<Self> {
        let chroma = shown(survey)?;
        let moves = background.survey_registrations.len() == survey.len() && !background.registrar.fixed;
        let median = |plane: fn(&Chroma) -> &Luma| {
            if moves {
                let each = chroma.iter().zip(&background.survey_registrations);
                let aligned: Vec<Luma> = each.map(|(c, r)| r.scaled(0.5).aligned(plane(c))).collect();
                background::median_of(&aligned.iter().collect::<Vec<_>>())
            } else {
                background::median_of(&chroma.iter().map(|c| plane(c)).collect::<Vec<_>>())
            }
        };
        Some(Self {
            luma: None,
            chroma: Chroma {
                u: median(|c| &c.u),
                v: median(|c| &c.v),
            },
        })
    }

    /// The median over frames in luma, of a recording that is measured on a mixture.
    pub fn of_mixed(survey: &[&Frame]) -> Option<Self> {
        let chroma = shown(survey)?;
        let median = |planes: Vec<&Luma>| background::median_of(&planes);
        Some(Self {
            luma: Some(median(survey.iter().map(|f| &f.luma).collect())),
            chroma: Chroma {
                u: median(chroma.iter().map(|c| &c.u).collect()),
                v: median(chroma.iter().map(|c| &c.v).collect()),
            },
        })
    }
}

/// The chroma of all frames, where some of it is not grey.
fn shown(survey: &[&Frame]) -> Option<Vec<Arc<Chroma>>> {
    let chroma = survey.iter().map(|f| f.colour.as_ref().map(|c| c.chroma()));
    let chroma: Vec<Arc<Chroma>> = chroma.collect::<Option<_>>()?;
    chroma.iter().any(|c| c.shows()).then_some(chroma)
}
