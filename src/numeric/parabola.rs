//! What lies between three values at evenly spaced places: a parabola.

/// The parabola through three values.
#[derive(Debug, Clone, Copy)]
pub struct Parabola {
    /// The place in the middle, and the value there.
    middle: f64,
    value: f64,
    /// First derivative in the middle, and the second.
    slope: f64,
    bend: f64,
}

impl Parabola {
    /// Through `values` at evenly spaced `places`.
    #[must_use]
    pub fn through(places: [f64; 3], [a, b, c]: [f64; 3]) -> Self {
        let step = places[1] - places[0];
        Self {
            middle: places[1],
            value: b,
            slope: 0.5 * (c - a) / step,
            bend: (c - 2.0 * b + a) / (step * step),
        }
    }

    /// Its value at `place`.
    #[must_use]
    pub fn at(&self, place: f64) -> f64 {
        let off = place - self.middle;
        self.value + off * (self.slope + 0.5 * off * self.bend)
    }

    /// Its slope at `place`.
    #[must_use]
    pub fn slope_at(&self, place: f64) -> f64 {
        self.slope + (place - self.middle) * self.bend
    }

    /// The second derivative.
    #[must_use]
    pub fn bend(&self) -> f64 {
        self.bend
    }

    /// Where it is least; `None` where it has no minimum.
    #[must_use]
    pub fn minimum(&self) -> Option<f64> {
        (self.bend > 0.0).then(|| self.middle - self.slope / self.bend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_comes_back_from_three_of_its_values() {
        let of = |x: f64| 3.0 + 2.0 * (x - 0.7).powi(2);
        let places = [-0.1, 0.3, 0.7];
        let parabola = Parabola::through(places, places.map(of));
        for x in [-1.0, 0.0, 0.5, 2.0] {
            assert!((parabola.at(x) - of(x)).abs() < 1e-12);
            assert!((parabola.slope_at(x) - 4.0 * (x - 0.7)).abs() < 1e-12);
        }
        assert!((parabola.bend() - 4.0).abs() < 1e-12);
        assert!((parabola.minimum().unwrap() - 0.7).abs() < 1e-12);
        // Upside down, flat, or of no numbers: without a minimum.
        for values in [places.map(|x| -of(x)), [1.0; 3], [f64::NAN; 3]] {
            assert_eq!(Parabola::through(places, values).minimum(), None);
        }
    }
}
