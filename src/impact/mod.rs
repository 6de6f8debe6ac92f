//! An impact's angles, restitution, friction and spin; the distances x0 and x; the models' readings.
//!
//! With v before and v' after the impact, from the arcs at the time where they meet, along the floor's tangent t and its normal
//! n. (A floor that rises by the angle s along x: t = (cos s, sin s), n = (−sin s, cos s) in x and z up.)
//!
//! ```text
//! e     = -v'n / vn                       tan θ = vt / |vn|          tan φ = v't / v'n
//! μ     = |vt - v't| / (|vn| (1 + e))     (friction, if the ball slid)
//! Rω'   = Rω + (vt - v't)/k               e_x = -(v't - Rω') / (vt - Rω)          [eqs. 7, 17 of Domenech 2005]
//! ```

mod bench_edge;
mod bounces;
pub mod compliant_reading;
pub mod contact;
mod distances;
pub mod error_budget;
mod floor;
pub mod from_flight;
mod inputs;
pub mod motion;
pub mod reading;
pub mod relations;
pub mod seen_spin;
mod side_bounce;
mod spin;
pub mod spin_candidates;
pub mod spin_lift;
mod top_view;

use crate::quantity::Quantity;
use crate::rebound::model::BounceReading;
use crate::rebound::{ModelName, Preferred, Regime};
use compliant_reading::CompliantReading;
use seen_spin::SpinSource;

/// Velocity of the centre just before or after an impact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CentreVelocity {
    /// Along the launch, m/s.
    pub vx_m_s: Option<Quantity>,
    /// Up, m/s (negative going down); `None` in a top view, unless the camera is near enough to tell.
    pub vz_m_s: Option<Quantity>,
    /// From the vertical, positive along the incident direction of motion, rad; `None` where `vz_m_s` is.
    pub angle_rad: Option<Quantity>,
}

/// A velocity of an impact, for the [`Correlation`]s of their errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speed {
    /// Along x before.
    IncidentVx,
    /// Up before.
    IncidentVz,
    /// Along x after.
    ReboundVx,
    /// Up after.
    ReboundVz,
    /// R ω_y before.
    SpinIn,
}

impl Speed {
    /// All of them, in the order of files.
    pub const ALL: [Self; 5] = [
        Self::IncidentVx,
        Self::IncidentVz,
        Self::ReboundVx,
        Self::ReboundVz,
        Self::SpinIn,
    ];

    /// Its name in a file, unit included.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::IncidentVx => "incident_vx_m_s",
            Self::IncidentVz => "incident_vz_m_s",
            Self::ReboundVx => "rebound_vx_m_s",
            Self::ReboundVz => "rebound_vz_m_s",
            Self::SpinIn => "spin_in_m_s",
        }
    }
}

/// Correlation of the errors of two velocities of an impact: what they share (the scale, the time of impact, gravity).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correlation {
    /// Which two.
    pub of: (Speed, Speed),
    /// Between −1 and 1.
    pub value: f64,
}

/// What a ball bounces on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BounceSurface {
    /// Below it.
    #[default]
    Floor,
    /// Above it, taken as parallel to the floor. All relations hold as on a floor that is seen upside down: the normal points down.
    Ceiling,
}

impl BounceSurface {
    /// Its name in files and words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Floor => "floor",
            Self::Ceiling => "ceiling",
        }
    }

    /// +1 where its normal points up, −1 where it points down.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::Floor => 1.0,
            Self::Ceiling => -1.0,
        }
    }
}

/// An impact on the floor, or on a ceiling. What does not apply or could not be measured is `None`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bounce {
    /// What it is on.
    pub surface: BounceSurface,
    /// Time, s.
    pub time_s: Option<Quantity>,
    /// Place along the launch, m.
    pub x_m: Option<Quantity>,
    /// Before.
    pub incident: CentreVelocity,
    /// After.
    pub rebound: CentreVelocity,
    /// e = e_z.
    pub restitution: Option<Quantity>,
    /// vx after / vx before.
    pub tangential_ratio: Option<Quantity>,
    /// What became of the slip: slowed (ordinary), stopped or reversed; `None` where its uncertainty does not tell.
    pub slip: Option<Regime>,
    /// |change of vt| / (|vn| (1 + e)) of a ball that slid: μ.
    pub friction: Option<Quantity>,
    /// The same of any other: friction is at least as much.
    pub friction_at_least: Option<Quantity>,
    /// e_x for the given or assumed spin before.
    pub tangential_restitution: Option<Quantity>,
    /// R ω_y before, m/s.
    pub spin_in_m_s: Option<Quantity>,
    /// R ω_y after, m/s.
    pub spin_out_m_s: Option<Quantity>,
    /// R ω_y before as the ball's marks show it, m/s.
    pub measured_spin_in_m_s: Option<Quantity>,
    /// R ω_y after as the ball's marks show it, m/s.
    pub measured_spin_out_m_s: Option<Quantity>,
    /// Where `spin_in_m_s` comes from.
    pub spin_in_source: Option<SpinSource>,
    /// k = (vt − v't) / (Rω' − Rω), where both spins were measured and differ.
    pub inertia_factor: Option<Quantity>,
    /// Deviation of the rebound in the floor plane, rad; top view only.
    pub azimuth_rad: Option<Quantity>,
    /// How the errors of the velocities hang together; nothing of those that have no uncertainty.
    pub correlations: Vec<Correlation>,
    /// The velocities along the floor and away from it, which the models speak of; `None` in a top view.
    pub along_floor: Option<AlongFloor>,
    /// What no impact on a floor does, where that stands out: then e_x, spins and friction are left out.
    pub impossible: Option<Impossible>,
}

/// Velocities of an impact in the own axes of floor or ceiling: along its tangent, and along its normal (negative before).
#[derive(Debug, Clone, PartialEq)]
pub struct AlongFloor {
    /// Before: tangent, normal, m/s.
    pub incident_m_s: (Option<Quantity>, Option<Quantity>),
    /// After.
    pub rebound_m_s: (Option<Quantity>, Option<Quantity>),
    /// How their errors hang together; [`Speed`]'s x is the tangent, its z the normal.
    pub correlations: Vec<Correlation>,
}

/// What no contact does to the motion along the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Impossible {
    /// |e_x| above 1: more than the slip turned round.
    Reversed(Quantity),
    /// Friction that drives the slip on: the ball gained speed along the floor that no spin had to give.
    Driven(Quantity),
}

/// The floor as the models have it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorSlope {
    /// Angle by which it rises along x, rad.
    pub slope_rad: Quantity,
    /// Where that comes from.
    pub source: FloorSource,
}

/// Where the floor's slope comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FloorSource {
    /// The places of two or more impacts.
    Impacts,
    /// The calibration: its number, or its line in the picture.
    Calibration,
    /// Nothing tells: level, as a lab's bench is.
    Level,
}

/// Where the ball left its bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BenchLaunch {
    /// x of the edge, m; `None` where line and arc do not meet as on an edge.
    pub edge_x_m: Option<Quantity>,
    /// When it left, s.
    pub time_s: Option<Quantity>,
    /// Its speed then, m/s.
    pub speed_m_s: Option<Quantity>,
    /// How long it was seen on the bench, s.
    pub rolled_s: f64,
    /// How far the ball fell from there to the first impact, m.
    pub drop_height_m: Option<Quantity>,
    /// How far above the line the arc begins, m: not 0 of a ball that was not simply released.
    pub gap_m: Option<Quantity>,
}

/// x0 (edge to first impact) and x (first to second impact).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distances {
    /// Edge to first impact, m.
    pub x0_m: Option<Quantity>,
    /// First to second impact, m.
    pub x_m: Option<Quantity>,
    /// Where x comes from.
    pub x_source: Option<XSource>,
}

/// Where x comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum XSource {
    /// The second impact was seen.
    Observed,
    /// The rebound's arc was continued to the floor.
    Extrapolated,
}

/// What the models make of the first bounce.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// e of all models.
    pub restitution: Option<Quantity>,
    /// Of each model that a single bounce tells something of, in the order of the list.
    pub models: Vec<(ModelName, BounceReading)>,
    /// What the compliant model makes of it, where its stiffness ratio is known.
    pub compliant: Option<CompliantReading>,
    /// The model that describes the recording's bounces better.
    pub preferred: Preferred,
}

impl Readings {
    /// What a model makes of the first bounce; `None` of one that a single bounce does not tell of.
    #[must_use]
    pub fn of(&self, model: ModelName) -> Option<&BounceReading> {
        self.models
            .iter()
            .find(|(name, _)| *name == model)
            .map(|(_, reading)| reading)
    }
}
