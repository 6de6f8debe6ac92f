//! The crate's numerical kit: one least-squares loop, one factorisation, one set of robust statistics.
//!
//! | to | use |
//! |---|---|
//! | solve one linear least-squares problem, with covariance and rank | [`linear::Factorisation`] |
//! | the same where blocks of rows have unknowns of their own and share a few | [`blocks::BlockFactorisation`] |
//! | fit a model whose whitened residuals you can write down | [`least_squares::Residuals`] and [`least_squares::fit`] |
//! | fit a few parameters to many pixels, summing JᵀJ and Jᵀr yourself | [`least_squares::Accumulate`] and [`least_squares::fit_normal`] |
//! | run the loop on a state of your own (poses, a block structure, another cost) | [`least_squares::Problem`] and [`least_squares::minimise`] |
//! | take in weighted rows one at a time, weights spanning many orders of magnitude | [`r_factor::RFactor`] |
//! | find what lies between three values at even steps, or their minimum | [`parabola::Parabola`] |
//! | weigh down outliers, or ask for a median | [`robust`] |
//! | carry a covariance through any function | [`propagation`] |
//!
//! A fit states three things: what is fitted (the trait), how steps are damped ([`least_squares::Damping`]), and when a
//! step no longer matters (`is_settled`, or [`least_squares::StopRule`]). It ends with a [`least_squares::Termination`].
//!
//! ```
//! use nalgebra::{DVector, dvector};
//! use track::numeric::least_squares::{Damping, Residuals, StopRule, fit};
//!
//! /// y = a exp(-b t), seen at four times with a standard uncertainty of 0.1.
//! struct Decay;
//! const SEEN: [(f64, f64); 4] = [(0.0, 2.0), (1.0, 1.213), (2.0, 0.736), (3.0, 0.446)];
//!
//! impl Residuals for Decay {
//!     fn residuals(&self, p: &DVector<f64>) -> DVector<f64> {
//!         DVector::from_iterator(4, SEEN.iter().map(|(t, y)| (y - p[0] * (-p[1] * t).exp()) / 0.1))
//!     }
//! }
//!
//! let found = fit(&Decay, dvector![1.0, 1.0], &Damping::NIELSEN, &StopRule::default());
//! assert!((found.parameters[1] - 0.5).abs() < 1e-3);
//! let std = found.covariance.expect("both are determined")[(1, 1)].sqrt();
//! assert!(std > 0.01 && std < 0.1);
//! ```

pub mod blocks;
pub mod least_squares;
pub mod linear;
pub mod parabola;
pub mod propagation;
pub mod r_factor;
pub mod robust;
