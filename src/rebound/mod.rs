//! The rebound relations of Domenech 2005 (Am. J. Phys. 73, 28, "the paper"): pure functions of
//! vectors.
//!
//! # Axes and symbols
//!
//! x along the launch, y sideways, z up, right-handed; the floor is z = 0. A sphere of mass m, radius R and moment of
//! inertia I = k m R² (k = 2/5 solid, 2/3 thin shell), s = k / (1 + k). `R ω` is the surface speed from spin, a
//! vector in m/s, so that the radius itself never appears.
//!
//! The contact point slips with c = (v_x − R ω_y, v_y + R ω_x) \[5\]; friction acts along −c. Where c = 0 there is no
//! friction: the code uses c/|c| and never the tangent of its direction.
//!
//! # Impulse balance \[1–7\]
//!
//! With P = (tangential impulse)/m and the normal impulse/m = (1 + e)|v_oz|:
//!
//! ```text
//! v_x = v_ox + P_x              v_y = v_oy + P_y              v_z = e |v_oz|
//! R ω_x = R ω_ox + P_y / k      R ω_y = R ω_oy − P_x / k      ω_z unchanged
//! ```
//!
//! Each model is one file and says what P is, or what becomes of the slip: [`mu_e`], [`e_e`], [`grip_slide`],
//! [`compliant`]. Besides, each
//! answers what the fits, reports and scenes ask of it ([`model::ReboundModel`], [`model::ReboundLaw`]); [`models`] is the
//! list, and the only place that names them all. A new model is a file of its own, its lines in the list, and, where it
//! has a new parameter, lines in [`parameter`].
//!
//! # Limits
//!
//! Coefficients are constants and the normal force passes through the centre, as in the paper. Real balls have an offset normal force
//! (Cross 2002).

pub mod compliant;
pub mod e_e;
pub mod fit;
pub mod grip_slide;
pub mod impulse;
pub mod itf;
pub mod launch;
pub mod model;
pub mod models;
pub mod mu_e;
pub mod parameter;

pub use impulse::{
    Regime, RigidMotion, SOLID_SPHERE, THIN_SHELL, apply_impulse, azimuth_rad, normal_impulse_m_s,
    sliding_impulse_m_s, slip_share,
};
pub use models::{Contact, ModelName, Preferred};
pub use parameter::Parameter;
