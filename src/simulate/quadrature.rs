//! Gauss-Legendre quadrature.

use std::f64::consts::PI;

/// Nodes in 0..1 and weights that add up to 1, for a rule of `order` nodes: exact for polynomials of degree
/// 2 `order` − 1. Roots of the Legendre polynomial by Newton's method (Press et al., Numerical Recipes, 4.6).
pub(super) fn gauss_legendre(order: usize) -> Vec<(f64, f64)> {
    (0..order)
        .map(|i| {
            let mut x = -(PI * (i as f64 + 0.75) / (order as f64 + 0.5)).cos();
            // Newton converges quadratically from this start; six steps are enough for any order in use.
            for _ in 0..6 {
                let (p, slope) = legendre(order, x);
                x -= p / slope;
            }
            let (_, slope) = legendre(order, x);
            (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// P_n(x) and its derivative.
fn legendre(order: usize, x: f64) -> (f64, f64) {
    let (mut before, mut now) = (1.0, x);
    for k in 2..=order {
        let k = k as f64;
        (before, now) = (now, ((2.0 * k - 1.0) * x * now - (k - 1.0) * before) / k);
    }
    (now, order as f64 * (x * now - before) / (x * x - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_is_exact_to_its_degree() {
        for order in [1, 2, 5, 24, 200] {
            let rule = gauss_legendre(order);
            for degree in [0, 1, 2 * order as i32 - 1] {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree)).sum();
                let exact = 1.0 / f64::from(degree + 1);
                assert!((sum - exact).abs() < 1e-13, "{order} {degree}: {sum} {exact}");
            }
        }
    }
}
