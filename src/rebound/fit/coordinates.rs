//! What the paper's figures show of a row, with its uncertainty, and what a model makes of the same incidence.
//!
//! | figure | abscissa | ordinate |
//! |---|---|---|
//! | 3 | tan θ | tan φ |
//! | 4 | x_o | x / x_o |
//! | 5 | θ | R ω_y / u_o |
//! | 7 | θ | R ω_oy / u_o |
//!
//! and, as the field shows compliant contacts, v_x / v_ox and R ω_y / v_o against θ, and the slip after against that before, each over
//! the normal speed: ψ₂ against ψ₁ once multiplied by κ/μ.

use super::series::{Column, ColumnSet, GRAVITY_M_S2, Row, Weights};
use crate::rebound::{Contact, RigidMotion};
use nalgebra::Vector3;

/// Spin ratios no further from each other than this are those of one kind of launch.
pub const SAME_SPIN: f64 = 0.03;

/// A number to draw, with the length of its error bar to either side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Where.
    pub value: f64,
    /// One standard uncertainty; `None` without.
    pub std: Option<f64>,
}

/// A row in the coordinates of the figures. What it does not hold is `None`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinates {
    /// tan θ.
    pub incident_tangent: Mark,
    /// θ, rad.
    pub incident_rad: Mark,
    /// tan φ; distances do not hold it.
    pub rebound_tangent: Option<Mark>,
    /// x_o, m.
    pub x0_m: Option<Mark>,
    /// x / x_o.
    pub distance_ratio: Option<Mark>,
    /// R ω_oy / u_o.
    pub spin_ratio: Option<Mark>,
    /// R ω_y / u_o, from the impulse balance; angles and distances hold it only with the model's restitution.
    pub spin_after_ratio: Option<Mark>,
    /// v_x / v_ox, of which the same is true.
    pub tangential_ratio: Option<Mark>,
    /// R ω_y / v_o, likewise.
    pub spin_over_speed: Option<Mark>,
    /// Slip before over normal speed before.
    pub slip_before: Option<Mark>,
    /// Slip after over normal speed before, positive along that before.
    pub slip_after: Option<Mark>,
}

/// What a model makes of an incidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// tan φ.
    pub rebound_tangent: f64,
    /// x / x_o.
    pub distance_ratio: f64,
    /// R ω_y / u_o.
    pub spin_after_ratio: f64,
    /// v_x / v_ox.
    pub tangential_ratio: f64,
    /// R ω_y / v_o.
    pub spin_over_speed: f64,
    /// Slip after over normal speed before, positive along that before.
    pub slip_after: f64,
}

/// The numbers of a row that everything else is computed from.
const COLUMNS: [Column; 11] = [
    Column::IncidentVx,
    Column::IncidentVz,
    Column::ReboundVx,
    Column::ReboundVz,
    Column::SpinIn,
    Column::IncidentAngle,
    Column::ReboundAngle,
    Column::X0,
    Column::X,
    Column::LaunchSpeed,
    Column::SpinRatio,
];

/// A row's numbers, in the order of [`COLUMNS`].
type RowNumbers = [Option<f64>; COLUMNS.len()];

impl Coordinates {
    /// Of `row`, in a series of `set`; `restitution` and `shared_spin_ratio` are the model's, for what the row itself does
    /// not hold. Error bars only with `weights` that were stated.
    #[must_use]
    pub fn new(
        row: &Row,
        set: ColumnSet,
        weights: Weights,
        restitution: f64,
        shared_spin_ratio: Option<f64>,
    ) -> Option<Self> {
        let reader = FigureReader {
            row,
            set,
            weights,
            restitution,
            shared_spin_ratio,
        };
        Some(Self {
            incident_tangent: reader.mark(FigureReader::incident_tangent)?,
            incident_rad: reader.mark(|r, n| r.incident_tangent(n).map(f64::atan))?,
            rebound_tangent: reader.mark(FigureReader::rebound_tangent),
            x0_m: reader.mark(|_, n| get(n, Column::X0)),
            distance_ratio: reader.mark(|_, n| Some(get(n, Column::X)? / get(n, Column::X0)?)),
            spin_ratio: reader.mark(FigureReader::spin_ratio),
            spin_after_ratio: reader.mark(FigureReader::spin_after_ratio),
            tangential_ratio: reader.mark(FigureReader::kept),
            spin_over_speed: reader
                .mark(|r, n| Some(r.spin_after_ratio(n)? * r.incident_tangent(n)?.atan().sin())),
            slip_before: reader.mark(|r, n| Some((r.incident_tangent(n)? * (1.0 - r.spin_ratio(n)?)).abs())),
            slip_after: reader.mark(|r, n| {
                let forward = (r.incident_tangent(n)? * (1.0 - r.spin_ratio(n)?)).signum();
                Some(forward * r.incident_tangent(n)? * (r.kept(n)? - r.spin_after_ratio(n)?))
            }),
        })
    }
}

fn get(numbers: &RowNumbers, column: Column) -> Option<f64> {
    COLUMNS.iter().position(|c| *c == column).and_then(|i| numbers[i])
}

/// A row and what it is read with.
struct FigureReader<'a> {
    row: &'a Row,
    set: ColumnSet,
    weights: Weights,
    restitution: f64,
    shared_spin_ratio: Option<f64>,
}

impl FigureReader<'_> {
    /// A number with its uncertainty, by differences over each of the row's own.
    fn mark(&self, function: impl Fn(&Self, &RowNumbers) -> Option<f64>) -> Option<Mark> {
        let numbers: RowNumbers = COLUMNS.map(|c| self.row.value(c));
        let value = function(self, &numbers).filter(|v| v.is_finite())?;
        if self.weights == Weights::Unit {
            return Some(Mark { value, std: None });
        }
        let mut slopes = [0.0; COLUMNS.len()];
        for (i, column) in COLUMNS.into_iter().enumerate() {
            let Some(std) = self.row.reading(column).and_then(|r| r.std).filter(|s| *s > 0.0) else {
                continue;
            };
            let at = |sign: f64| {
                let mut moved = numbers;
                moved[i] = moved[i].map(|x| x + 0.1 * sign * std);
                function(self, &moved).filter(|v| v.is_finite())
            };
            // Times the deviation already.
            slopes[i] = 5.0 * (at(1.0)? - at(-1.0)?);
        }
        let mut variance: f64 = slopes.iter().map(|s| s * s).sum();
        for &(a, b, r) in self.row.correlations() {
            let place = |c: Column| COLUMNS.iter().position(|known| *known == c);
            if let (Some(i), Some(j)) = (place(a), place(b)) {
                variance += 2.0 * r * slopes[i] * slopes[j];
            }
        }
        Some(Mark {
            value,
            std: Some(variance.max(0.0).sqrt()).filter(|s| *s > 0.0),
        })
    }

    fn incident_tangent(&self, n: &RowNumbers) -> Option<f64> {
        Some(match self.set {
            ColumnSet::Velocities => get(n, Column::IncidentVx)? / -get(n, Column::IncidentVz)?,
            ColumnSet::Angles => get(n, Column::IncidentAngle)?.to_radians().tan(),
            ColumnSet::Distances => {
                get(n, Column::LaunchSpeed)?.powi(2) / (self.gravity() * get(n, Column::X0)?)
            }
        })
    }

    fn gravity(&self) -> f64 {
        self.row.value(Column::Gravity).unwrap_or(GRAVITY_M_S2)
    }

    fn rebound_tangent(&self, n: &RowNumbers) -> Option<f64> {
        match self.set {
            ColumnSet::Velocities => Some(get(n, Column::ReboundVx)? / get(n, Column::ReboundVz)?),
            ColumnSet::Angles => Some(get(n, Column::ReboundAngle)?.to_radians().tan()),
            ColumnSet::Distances => None,
        }
    }

    fn spin_ratio(&self, n: &RowNumbers) -> Option<f64> {
        let surface = get(n, Column::SpinIn).filter(|_| self.set == ColumnSet::Velocities);
        match surface {
            Some(surface) => Some(surface / get(n, Column::IncidentVx)?),
            None => get(n, Column::SpinRatio).or(self.shared_spin_ratio),
        }
    }

    /// v_x / v_ox.
    fn kept(&self, n: &RowNumbers) -> Option<f64> {
        Some(match self.set {
            ColumnSet::Velocities => get(n, Column::ReboundVx)? / get(n, Column::IncidentVx)?,
            ColumnSet::Angles => self.restitution * self.rebound_tangent(n)? / self.incident_tangent(n)?,
            ColumnSet::Distances => get(n, Column::X)? / (2.0 * self.restitution * get(n, Column::X0)?),
        })
    }

    fn spin_after_ratio(&self, n: &RowNumbers) -> Option<f64> {
        Some(self.spin_ratio(n)? + (1.0 - self.kept(n)?) / self.row.inertia_factor())
    }
}

impl Contact {
    /// What the model makes of a ball that comes at `incident_tangent` with `spin_ratio`; `None` where the rebound has no
    /// such number (straight down, or no rebound).
    #[must_use]
    pub fn predict(&self, incident_tangent: f64, spin_ratio: f64, inertia_factor: f64) -> Option<Prediction> {
        self.predictions(&[incident_tangent], spin_ratio, inertia_factor)[0]
    }

    /// The same at several incident tangents.
    #[must_use]
    pub fn predictions(
        &self,
        incident_tangents: &[f64],
        spin_ratio: f64,
        inertia_factor: f64,
    ) -> Vec<Option<Prediction>> {
        let incoming = |&tangent: &f64| RigidMotion {
            velocity_m_s: Vector3::new(tangent, 0.0, -1.0),
            surface_spin_m_s: Vector3::new(0.0, spin_ratio * tangent, 0.0),
        };
        let incoming: Vec<RigidMotion> = incident_tangents.iter().map(incoming).collect();
        let after = self.impacts(&incoming, inertia_factor).into_iter();
        incoming
            .iter()
            .zip(after)
            .map(|(incoming, (after, _))| Prediction::of(incoming, &after))
            .collect()
    }
}

impl Prediction {
    /// Of an impact with a normal speed of 1 before it; `None` where the rebound has no such number.
    fn of(incoming: &RigidMotion, after: &RigidMotion) -> Option<Self> {
        let incident_tangent = incoming.velocity_m_s.x;
        let kept = after.velocity_m_s.x / incident_tangent;
        let spin_after_ratio = after.surface_spin_m_s.y / incident_tangent;
        let forward = incoming.slip_m_s().x.signum();
        let prediction = Self {
            rebound_tangent: after.velocity_m_s.x / after.velocity_m_s.z,
            // x = v_x · 2 v_z / g, x_o = u_o |v_oz| / g.
            distance_ratio: 2.0 * kept * after.velocity_m_s.z,
            spin_after_ratio,
            tangential_ratio: kept,
            spin_over_speed: spin_after_ratio * incident_tangent.atan().sin(),
            slip_after: forward * after.slip_m_s().x,
        };
        [
            prediction.rebound_tangent,
            prediction.distance_ratio,
            prediction.spin_after_ratio,
        ]
        .iter()
        .all(|x| x.is_finite())
        .then_some(prediction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rebound::{SOLID_SPHERE, e_e};

    #[test]
    fn every_set_shows_the_same_bounce() {
        // e = 0.8, leaves rolling from u = 1 m/s at 30 degrees.
        let (u, e, g) = (1.0, 0.8, 10.0);
        let b = u / 30_f64.to_radians().tan();
        let (after_x, after_z) = (5.0 / 7.0 * u, e * b);
        let velocities = Row::new(1, "all")
            .with(Column::IncidentVx, u, Some(0.01))
            .with(Column::IncidentVz, -b, Some(0.0))
            .with(Column::ReboundVx, after_x, Some(0.0))
            .with(Column::ReboundVz, after_z, Some(0.0))
            .with(Column::SpinIn, 0.0, None);
        let angles = Row::new(1, "all")
            .with(Column::IncidentAngle, 30.0, None)
            .with(Column::ReboundAngle, after_x.atan2(after_z).to_degrees(), None)
            .with(Column::SpinRatio, 0.0, None);
        let distances = Row::new(1, "all")
            .with(Column::X0, u * b / g, None)
            .with(Column::X, after_x * 2.0 * after_z / g, None)
            .with(Column::LaunchSpeed, u, None)
            .with(Column::Gravity, g, None)
            .with(Column::SpinRatio, 0.0, None);
        let curve = Contact::EE(e_e::Parameters {
            restitution: e,
            tangential_restitution_x: 0.0,
            tangential_restitution_y: 0.0,
        });
        let predicted = curve.predict(u / b, 0.0, SOLID_SPHERE).unwrap();
        for (row, set) in [
            (velocities, ColumnSet::Velocities),
            (angles, ColumnSet::Angles),
            (distances, ColumnSet::Distances),
        ] {
            let c = Coordinates::new(&row, set, Weights::Stated, e, None).unwrap();
            assert!((c.incident_rad.value.to_degrees() - 30.0).abs() < 1e-9, "{set:?}");
            assert!(
                (c.spin_after_ratio.unwrap().value - 5.0 / 7.0).abs() < 1e-9,
                "{set:?}"
            );
            if let Some(mark) = c.rebound_tangent {
                assert!((mark.value - predicted.rebound_tangent).abs() < 1e-9);
            }
            if let Some(mark) = c.distance_ratio {
                assert!((mark.value - predicted.distance_ratio).abs() < 1e-9);
            }
            if set == ColumnSet::Velocities {
                assert!((c.incident_tangent.std.unwrap() - 0.01 / b).abs() < 1e-9);
            }
        }
        assert!((predicted.spin_after_ratio - 5.0 / 7.0).abs() < 1e-12);
    }
}
