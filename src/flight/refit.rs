//! The same flight once more: with its points moved, or under another motion model.

use super::free_flight::{Flight, FlightPoint, SpotUse};
use super::launch;
use super::linking::Spot;
use super::motion_model::{MotionModel, VerticalPrior};
use super::outliers::refitted;

impl Flight {
    /// The same points, each in use or off its arc moved by the `shift` of it and its arc (along right and up, plane units), with the
    /// arcs and the centres' scatter found anew. `None` where the points do not determine them.
    #[must_use]
    pub fn moved(&self, shift: impl Fn(&Spot, usize) -> (f64, f64)) -> Option<Self> {
        let mut points = self.points.clone();
        for p in &mut points {
            let arc = match p.use_ {
                SpotUse::Used(arc) => arc,
                SpotUse::Outlier(_) => self.arc_at(p.spot.time_s),
                SpotUse::NotFree | SpotUse::Contact => continue,
            };
            let (right, up) = shift(&p.spot, arc);
            p.spot.place.right += right;
            p.spot.place.up += up;
        }
        self.refitted(points, &*self.fit.model)
    }

    /// The same points under another `model`; `None` where they do not determine the arcs.
    #[must_use]
    pub fn under(&self, model: &dyn MotionModel) -> Option<Self> {
        let mut flight = self.refitted(self.points.clone(), model)?;
        for (k, impact) in flight.impacts.iter_mut().enumerate() {
            let p = flight.fit.parameters.as_slice();
            *impact = impact.and_then(|_| flight.fit.impact_time(p, k));
        }
        flight.launch = launch::find(&flight);
        Some(flight)
    }

    /// The flight under everything that is not known of it: how "up" leans by what the calibration knows alone (to
    /// `upright_std_rad`), and the drag of a ball of which nothing is said. (While arcs are looked for in rough centres, so much
    /// freedom would let them follow what is no ball's.)
    #[must_use]
    pub fn with_all_unknowns(&self, upright_std_rad: f64) -> Self {
        let upright = VerticalPrior::known_to(upright_std_rad);
        let open = self.fit.model.with_unknowns(upright, self.radius());
        let fitted = open.and_then(|open| self.under(&*open));
        fitted.unwrap_or_else(|| self.clone())
    }

    /// The arcs of these `points`, which keep their uses.
    pub(super) fn refitted(&self, points: Vec<FlightPoint>, model: &dyn MotionModel) -> Option<Self> {
        let spots: Vec<Spot> = points.iter().map(|p| p.spot).collect();
        let uses: Vec<SpotUse> = points.iter().map(|p| p.use_).collect();
        let (fit, extra) = refitted(&spots, &uses, self.fit.arcs(), model, self.extra)?;
        Some(Self {
            points,
            fit,
            extra,
            ..self.clone()
        })
    }
}
