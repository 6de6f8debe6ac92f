//! The same flight once more: with its points moved, or under another motion model; and what of such a move its arcs do not follow.

use super::free_flight::{Flight, FlightPoint, SpotUse};
use super::launch;
use super::linking::Spot;
use super::motion_model::{FitPoint, MotionModel, VerticalPrior};
use super::outliers::refitted;
use nalgebra::DVector;

/// How far points are moved to see how their arcs follow, at most, in parts of the ball's radius: arcs with drag do not follow in proportion.
const PROBE: f64 = 1e-4;

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

    /// Where the `points` are against their arcs, two rows a point, in their standard deviations.
    #[must_use]
    pub fn whitened_residuals(&self, points: &[FitPoint]) -> DVector<f64> {
        let residual = |p: &FitPoint| {
            let m = self.fit.motion(p.arc, p.sample.t);
            (p.sample.r - m.r, p.sample.h - m.h)
        };
        whitened(points, points.iter().map(residual))
    }

    /// Of `shifts` of the `points`, what their arcs do not follow, in the same form; `None` where the points do not determine the arcs.
    #[must_use]
    pub fn left_over(&self, points: &[FitPoint], shifts: &[(f64, f64)]) -> Option<DVector<f64>> {
        let change = self.fit.response(points, shifts)?;
        let (model, fit) = (&self.fit.model, &self.fit);
        let largest = shifts
            .iter()
            .fold(0.0_f64, |most, s| most.max(s.0.abs()).max(s.1.abs()));
        let part = PROBE * self.radius() / largest;
        let moved = |by: f64| fit.parameters.clone() + by * &change;
        let (ahead, behind) = (moved(part), moved(-part));
        let followed = points.iter().zip(shifts).map(|(p, (r, h))| {
            let at = |q: &DVector<f64>| model.motion_in_picture(q.as_slice(), &fit.times, p.arc, p.sample.t);
            let (a, b) = (at(&ahead), at(&behind));
            (r - (a.r - b.r) / (2.0 * part), h - (a.h - b.h) / (2.0 * part))
        });
        Some(whitened(points, followed))
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

/// Two rows a point: its `shifts` in its standard deviations.
pub(super) fn whitened(points: &[FitPoint], shifts: impl Iterator<Item = (f64, f64)>) -> DVector<f64> {
    let rows = points.iter().zip(shifts).flat_map(|(p, (r, h))| {
        let w = p.sample.weight.sqrt();
        [w * r, w * h]
    });
    DVector::from_iterator(2 * points.len(), rows)
}
