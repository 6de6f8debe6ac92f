//! What velocities before and after an impact say of it: plain numbers in, plain numbers out (NaN or infinite where there is
//! no such thing, which becomes `None` in a [`Quantity`](crate::quantity::Quantity)).
//!
//! Each is written so that it loses no more digits than the relation itself does.

/// The motion across an impact in the x-z plane, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImpactVelocities {
    /// v_ox, v_oz, m/s (v_oz < 0).
    pub before_m_s: (f64, f64),
    /// v_x, v_z, m/s.
    pub after_m_s: (f64, f64),
    /// R ω_oy, m/s; NaN where it is not known.
    pub spin_in_m_s: f64,
    /// R ω_y after as it was measured, m/s; NaN where it was not.
    pub measured_spin_out_m_s: f64,
    /// k.
    pub inertia_factor: f64,
}

impl ImpactVelocities {
    /// θ from the vertical, rad, positive along `along` (+1 or −1 times x).
    #[must_use]
    pub fn incident_angle_rad(&self, along: f64) -> f64 {
        (along * self.before_m_s.0).atan2(-self.before_m_s.1)
    }

    /// φ from the vertical, rad, positive along `along`.
    #[must_use]
    pub fn rebound_angle_rad(&self, along: f64) -> f64 {
        (along * self.after_m_s.0).atan2(self.after_m_s.1)
    }

    /// e = v_z / |v_oz|.
    #[must_use]
    pub fn restitution(&self) -> f64 {
        -self.after_m_s.1 / self.before_m_s.1
    }

    /// v_x / v_ox.
    #[must_use]
    pub fn tangential_ratio(&self) -> f64 {
        self.after_m_s.0 / self.before_m_s.0
    }

    /// −P = v_ox − v_x, m/s: the tangential impulse a mass, against x.
    #[must_use]
    pub fn lost_m_s(&self) -> f64 {
        self.before_m_s.0 - self.after_m_s.0
    }

    /// (v_ox − v_x) / (|v_oz| (1 + e)), the same as over |v_oz| + v_z: μ of a ball that slid, positive where it was slowed.
    #[must_use]
    pub fn friction(&self) -> f64 {
        self.lost_m_s() / (self.after_m_s.1 - self.before_m_s.1)
    }

    /// R ω_y = R ω_oy + (v_ox − v_x) / k \[7\], m/s.
    #[must_use]
    pub fn spin_out_m_s(&self) -> f64 {
        self.spin_in_m_s + self.lost_m_s() / self.inertia_factor
    }

    /// v_ox − R ω_oy, m/s \[5\].
    #[must_use]
    pub fn slip_in_m_s(&self) -> f64 {
        self.before_m_s.0 - self.spin_in_m_s
    }

    /// e_x = −(v_x − R ω_y) / (v_ox − R ω_oy) \[17\]. As v_x − R ω_y is the slip before less (1 + 1/k)(v_ox − v_x), it is
    /// (v_ox − v_x) / (s (v_ox − R ω_oy)) − 1.
    /// With the spin after as it was measured, where it was.
    #[must_use]
    pub fn tangential_restitution(&self) -> f64 {
        let measured = self.measured_spin_out_m_s;
        let spin_out = if measured.is_finite() {
            measured
        } else {
            self.spin_out_m_s()
        };
        -(self.after_m_s.0 - spin_out) / self.slip_in_m_s()
    }
}
