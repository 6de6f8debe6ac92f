//! The parameters of the rebound models: names, symbols, what a bounce can have, and which of them a search moves.

/// A parameter of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// e.
    Restitution,
    /// μ.
    Friction,
    /// μ_o.
    StaticFriction,
    /// e_x.
    TangentialRestitution,
    /// κ.
    StiffnessRatio,
    /// R ω_oy / v_ox of the rows whose spin before is not known.
    SpinRatio,
}

/// What no bounce is outside of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The least value.
    pub least: f64,
    /// The largest value.
    pub most: f64,
    /// Why.
    pub why: &'static str,
}

impl Parameter {
    /// All of them, in the order of the results.
    pub const ALL: [Self; 6] = [
        Self::Restitution,
        Self::Friction,
        Self::StaticFriction,
        Self::TangentialRestitution,
        Self::StiffnessRatio,
        Self::SpinRatio,
    ];

    /// Its name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Restitution => "restitution",
            Self::Friction => "friction",
            Self::StaticFriction => "static_friction",
            Self::TangentialRestitution => "tangential_restitution",
            Self::StiffnessRatio => "stiffness_ratio",
            Self::SpinRatio => "spin_ratio",
        }
    }

    /// Its name in tables, short.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::Restitution => "restitution",
            Self::Friction => "friction",
            Self::StaticFriction => "static friction",
            Self::TangentialRestitution => "tang. restitution",
            Self::StiffnessRatio => "stiffness ratio",
            Self::SpinRatio => "spin before, fitted",
        }
    }

    /// Its symbol for people.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Restitution => "e",
            Self::Friction => "μ",
            Self::StaticFriction => "μ_o",
            Self::TangentialRestitution => "e_x",
            Self::StiffnessRatio => "κ",
            Self::SpinRatio => "spin before",
        }
    }

    /// That a model does not have it.
    #[must_use]
    pub fn absent(self) -> &'static str {
        match self {
            Self::Restitution => "the model has no restitution",
            Self::Friction => "the model has no friction",
            Self::StaticFriction => "the model has no static friction of its own",
            Self::TangentialRestitution => "the model has no tangential restitution of its own",
            Self::StiffnessRatio => "the model takes the contact as rigid sideways",
            Self::SpinRatio => "the rows give the spin before the bounce",
        }
    }

    /// What a bounce can have; `None` where anything is possible.
    #[must_use]
    pub fn bounds(self) -> Option<Bounds> {
        let (least, most, why) = match self {
            Self::Restitution => (0.0, 1.0, "no ball rebounds faster than it came"),
            Self::TangentialRestitution => (-1.0, 1.0, "e_x lies between -1 and 1"),
            Self::Friction | Self::StaticFriction => (0.0, f64::INFINITY, "friction does not push"),
            Self::StiffnessRatio => (0.0, f64::INFINITY, "a contact resists being moved sideways"),
            Self::SpinRatio => return None,
        };
        Some(Bounds { least, most, why })
    }

    /// A parameter whose standard uncertainty is more than this is not known: it is that of anything at all in the range of
    /// what bounces have.
    #[must_use]
    pub const fn vague_std(self) -> f64 {
        match self {
            Self::Restitution | Self::Friction | Self::StaticFriction => 0.3,
            Self::TangentialRestitution => 0.6,
            Self::StiffnessRatio => 0.6,
            Self::SpinRatio => 1.0,
        }
    }
}

/// How many parameters a search moves.
pub const PARAMETERS: usize = 5;

/// The parameters that a search moves, in the order of [`Theta`]. (Static friction is found along the order of the rows.)
pub const SEARCHED: [Parameter; PARAMETERS] = [
    Parameter::Restitution,
    Parameter::TangentialRestitution,
    Parameter::Friction,
    Parameter::SpinRatio,
    Parameter::StiffnessRatio,
];

/// A value for each of [`SEARCHED`].
pub type Theta = [f64; PARAMETERS];

/// Index of e in [`Theta`].
pub const E: usize = 0;
/// Index of e_x.
pub const E_X: usize = 1;
/// Index of μ.
pub const MU: usize = 2;
/// Index of ρ = R ω_oy / v_ox of the rows whose spin is not known.
pub const RATIO: usize = 3;
/// Index of κ.
pub const KAPPA: usize = 4;
