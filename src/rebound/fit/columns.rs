//! The columns of a series: what they are called, which sets of them can be fitted.

/// The three sets of columns, for messages.
pub(super) const SETS: &str = "velocities (incident_vx_m_s, incident_vz_m_s, rebound_vx_m_s, rebound_vz_m_s), \
     angles (incident_angle_deg, rebound_angle_deg), or distances (x0_m, x_m, launch_speed_m_s)";

/// A column of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Column {
    /// Velocity along x before, m/s.
    IncidentVx,
    /// Velocity upwards before, m/s: negative.
    IncidentVz,
    /// Velocity along x after, m/s.
    ReboundVx,
    /// Velocity upwards after, m/s.
    ReboundVz,
    /// R ω_y before, m/s.
    SpinIn,
    /// R ω_y after, m/s.
    SpinOut,
    /// From the vertical before, degrees.
    IncidentAngle,
    /// From the vertical after, degrees.
    ReboundAngle,
    /// Launch edge to first impact, m.
    X0,
    /// First to second impact, m.
    X,
    /// u_o, m/s.
    LaunchSpeed,
    /// R ω_y / v_x before.
    SpinRatio,
    /// g, m/s².
    Gravity,
    /// k = I / (m R²).
    InertiaFactor,
    /// κ = G*/E*.
    StiffnessRatio,
}

impl Column {
    /// How many there are.
    pub const COUNT: usize = 15;

    /// All of them.
    pub const ALL: [Self; Self::COUNT] = [
        Self::IncidentVx,
        Self::IncidentVz,
        Self::ReboundVx,
        Self::ReboundVz,
        Self::SpinIn,
        Self::SpinOut,
        Self::IncidentAngle,
        Self::ReboundAngle,
        Self::X0,
        Self::X,
        Self::LaunchSpeed,
        Self::SpinRatio,
        Self::Gravity,
        Self::InertiaFactor,
        Self::StiffnessRatio,
    ];

    /// Its name in a file.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::IncidentVx => "incident_vx_m_s",
            Self::IncidentVz => "incident_vz_m_s",
            Self::ReboundVx => "rebound_vx_m_s",
            Self::ReboundVz => "rebound_vz_m_s",
            Self::SpinIn => "spin_in_m_s",
            Self::SpinOut => "spin_out_m_s",
            Self::IncidentAngle => "incident_angle_deg",
            Self::ReboundAngle => "rebound_angle_deg",
            Self::X0 => "x0_m",
            Self::X => "x_m",
            Self::LaunchSpeed => "launch_speed_m_s",
            Self::SpinRatio => "spin_ratio",
            Self::Gravity => "gravity_m_s2",
            Self::InertiaFactor => "inertia_factor",
            Self::StiffnessRatio => "stiffness_ratio",
        }
    }

    /// The column of that name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|column| column.name() == name)
    }
}

/// Which columns a series is fitted on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnSet {
    /// Velocities before and after.
    Velocities,
    /// Angles before and after.
    Angles,
    /// Distances of the horizontal launch.
    Distances,
}

impl ColumnSet {
    /// In the order in which a file that holds several is read.
    pub const ALL: [Self; 3] = [Self::Velocities, Self::Angles, Self::Distances];

    /// Its name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocities => "velocities",
            Self::Angles => "angles",
            Self::Distances => "distances",
        }
    }

    /// What every row has to hold.
    #[must_use]
    pub fn required(self) -> &'static [Column] {
        match self {
            Self::Velocities => &[
                Column::IncidentVx,
                Column::IncidentVz,
                Column::ReboundVx,
                Column::ReboundVz,
            ],
            Self::Angles => &[Column::IncidentAngle, Column::ReboundAngle],
            Self::Distances => &[Column::X0, Column::X, Column::LaunchSpeed],
        }
    }

    /// What a row may hold beside: it enters the fit where it is there.
    #[must_use]
    pub fn optional(self) -> &'static [Column] {
        match self {
            Self::Velocities => &[Column::SpinIn, Column::SpinRatio, Column::SpinOut],
            Self::Angles => &[Column::SpinRatio],
            Self::Distances => &[Column::SpinRatio, Column::Gravity],
        }
    }
}

/// A number as it stands in a row. Zero is an exact number's deviation, `None` that of a number whose deviation is not
/// known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The number.
    pub value: f64,
    /// Its standard deviation.
    pub std: Option<f64>,
}
