//! A row as the fit sees it: measured numbers in their slots, their covariance, and how they make the ball's motion.
//!
//! | set | slots |
//! |---|---|
//! | velocities | v_ox, abs(v_oz), v_x, v_z, spin, R ω_y after |
//! | angles (speeds in units of v_o) | θ, φ, -, -, spin |
//! | distances | x_o, x, u_o, g, spin |
//!
//! Motion before the impact: a = v_ox, b = abs(v_oz), w = R ω_oy. For angles a = sin θ, b = cos θ; for distances
//! a = u_o, b = g x_o / u_o.

use super::series::{Column, ColumnSet, GRAVITY_M_S2, Reading, Row, Series, Weights};
use crate::rebound::slip_share;

/// Slots of a row.
pub(super) const SLOTS: usize = 6;
/// Slot of the spin before.
pub(super) const SPIN: usize = 4;
/// Slot of the spin after.
pub(super) const SPIN_OUT: usize = 5;

/// Values of the slots.
pub(super) type Slots = [f64; SLOTS];

/// What is known of the spin before an impact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Spin {
    /// None, exactly.
    Zero,
    /// Its slot holds R ω_oy.
    Surface,
    /// Its slot holds R ω_oy / v_ox.
    Ratio,
    /// Nothing: one ratio for all such rows of a group is fitted.
    Shared,
    /// Nothing, but the spin after was measured: R ω_oy = R ω_y − (v_ox − v_x) / k, whatever friction did.
    FromAfter,
}

/// A row ready for the fit.
#[derive(Debug, Clone)]
pub(super) struct Observation {
    /// Index of its row in the series.
    pub row: usize,
    pub set: ColumnSet,
    pub z: Slots,
    /// Variances.
    pub variance: Slots,
    /// The whole covariance, where errors are correlated.
    pub covariance: Option<Box<[Slots; SLOTS]>>,
    /// k.
    pub inertia_factor: f64,
    /// s = k / (1 + k).
    pub slip_share: f64,
    /// κ, where it is given.
    pub stiffness_ratio: Option<f64>,
    pub spin: Spin,
    /// Whether the measured spin after is one more equation.
    pub spin_out: bool,
    /// ln of the determinant of the errors' correlations, 0 where there are none.
    pub log_correlation: f64,
}

/// The motion before an impact, with what it changes by with each slot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kinematics {
    /// v_ox.
    pub a: f64,
    /// abs(v_oz).
    pub b: f64,
    /// R ω_oy.
    pub w: f64,
    pub da: Slots,
    pub db: Slots,
    pub dw: Slots,
    /// ∂w/∂ρ for a shared spin ratio ρ.
    pub dw_dratio: f64,
}

impl Observation {
    /// The row at `index` of the series; `spin_out` tells whether its spin after counts. Why not, where it cannot be
    /// weighted.
    pub fn new(series: &Series, index: usize, spin_out: bool) -> Result<Self, String> {
        let row = &series.rows[index];
        let mut observation = Self {
            row: index,
            set: series.set,
            z: [0.0; SLOTS],
            variance: [0.0; SLOTS],
            covariance: None,
            inertia_factor: row.inertia_factor(),
            slip_share: slip_share(row.inertia_factor()),
            stiffness_ratio: row.value(Column::StiffnessRatio),
            spin: Spin::Shared,
            spin_out: false,
            log_correlation: 0.0,
        };
        let slots = places(series.set);
        for &(column, slot) in slots {
            observation.put(series.weights, row.reading(column), column, slot);
        }
        if series.set == ColumnSet::Distances && row.value(Column::Gravity).is_none() {
            observation.z[3] = GRAVITY_M_S2;
        }
        observation.put_spin(series.weights, row, spin_out);
        observation.correlate(row, slots)?;
        Ok(observation)
    }

    fn put(&mut self, weights: Weights, reading: Option<Reading>, column: Column, slot: usize) {
        let Some(Reading { value, std }) = reading else {
            return;
        };
        let std = match weights {
            Weights::Stated => std.unwrap_or(0.0),
            Weights::Unit => unit_std(column),
        };
        let factor = factor(column);
        self.z[slot] = factor * value;
        self.variance[slot] = (factor * std).powi(2);
    }

    fn put_spin(&mut self, weights: Weights, row: &Row, spin_out: bool) {
        let surface = row
            .reading(Column::SpinIn)
            .filter(|_| self.set == ColumnSet::Velocities);
        let ratio = row.reading(Column::SpinRatio);
        let after = row
            .reading(Column::SpinOut)
            .filter(|_| spin_out && self.set == ColumnSet::Velocities);
        if surface.is_some() {
            self.put(weights, surface, Column::SpinIn, SPIN);
            self.spin = Spin::Surface;
        } else if ratio.is_some() {
            self.put(weights, ratio, Column::SpinRatio, SPIN);
            self.spin = Spin::Ratio;
        } else if after.is_some() {
            self.spin = Spin::FromAfter;
        }
        if self.z[SPIN] == 0.0
            && self.variance[SPIN] == 0.0
            && matches!(self.spin, Spin::Surface | Spin::Ratio)
        {
            self.spin = Spin::Zero;
        }
        if after.is_some() {
            self.put(weights, after, Column::SpinOut, SPIN_OUT);
            self.spin_out = self.spin != Spin::FromAfter;
        }
    }

    /// Puts the correlations in; refuses those that no errors have together.
    fn correlate(&mut self, row: &Row, slots: &[(Column, usize)]) -> Result<(), String> {
        let place = |column: Column| match column {
            Column::SpinIn if self.spin == Spin::Surface => Some(SPIN),
            Column::SpinRatio if self.spin == Spin::Ratio => Some(SPIN),
            Column::SpinOut if self.spin_out || self.spin == Spin::FromAfter => Some(SPIN_OUT),
            _ => slots.iter().find(|(c, _)| *c == column).map(|&(_, slot)| slot),
        };
        let mut full = [[0.0; SLOTS]; SLOTS];
        for (i, line) in full.iter_mut().enumerate() {
            line[i] = self.variance[i];
        }
        let mut any = false;
        for &(a, b, r) in row.correlations() {
            if let (Some(i), Some(j)) = (place(a), place(b))
                && r != 0.0
            {
                any = true;
                let sign = (factor(a) * factor(b)).signum();
                full[i][j] = sign * r * (self.variance[i] * self.variance[j]).sqrt();
                full[j][i] = full[i][j];
            }
        }
        if !any {
            return Ok(());
        }
        self.log_correlation = log_correlation(&full).ok_or_else(|| {
            "its correlations contradict each other: no errors have them all at once".to_owned()
        })?;
        self.covariance = Some(Box::new(full));
        Ok(())
    }

    /// Σ v.
    pub fn covariance_times(&self, v: &Slots) -> Slots {
        match &self.covariance {
            None => std::array::from_fn(|i| self.variance[i] * v[i]),
            Some(full) => std::array::from_fn(|i| full[i].iter().zip(v).map(|(c, x)| c * x).sum()),
        }
    }

    /// Equations that a model has to fulfil.
    pub fn equations(&self) -> usize {
        match self.set {
            ColumnSet::Velocities => 2 + usize::from(self.spin_out),
            ColumnSet::Angles | ColumnSet::Distances => 1,
        }
    }

    /// Whether every equation is linear in the slots, so that one step finds the nearest point.
    pub fn is_linear(&self) -> bool {
        self.set == ColumnSet::Velocities && !(self.spin == Spin::Ratio && self.variance[SPIN] > 0.0)
    }

    /// The motion before, for slots `z` and the shared spin ratio.
    pub fn kinematics(&self, z: &Slots, shared_ratio: f64) -> Kinematics {
        let mut k = Kinematics {
            a: 0.0,
            b: 0.0,
            w: 0.0,
            da: [0.0; SLOTS],
            db: [0.0; SLOTS],
            dw: [0.0; SLOTS],
            dw_dratio: 0.0,
        };
        match self.set {
            ColumnSet::Velocities => {
                (k.a, k.b) = (z[0], z[1]);
                (k.da[0], k.db[1]) = (1.0, 1.0);
            }
            ColumnSet::Angles => {
                (k.a, k.b) = z[0].sin_cos();
                (k.da[0], k.db[0]) = (k.b, -k.a);
            }
            ColumnSet::Distances => {
                let (x0, speed, gravity) = (z[0], z[2], z[3]);
                (k.a, k.b) = (speed, gravity * x0 / speed);
                k.da[2] = 1.0;
                (k.db[0], k.db[2], k.db[3]) = (gravity / speed, -k.b / speed, x0 / speed);
            }
        }
        let ratio = match self.spin {
            Spin::Zero => return k,
            Spin::Surface => {
                k.w = z[SPIN];
                k.dw[SPIN] = 1.0;
                return k;
            }
            Spin::FromAfter => {
                k.w = z[SPIN_OUT] - (z[0] - z[2]) / self.inertia_factor;
                k.dw[SPIN_OUT] = 1.0;
                (k.dw[0], k.dw[2]) = (-1.0 / self.inertia_factor, 1.0 / self.inertia_factor);
                return k;
            }
            Spin::Ratio => {
                k.dw[SPIN] = k.a;
                z[SPIN]
            }
            Spin::Shared => {
                k.dw_dratio = k.a;
                shared_ratio
            }
        };
        k.w = ratio * k.a;
        for (dw, da) in k.dw.iter_mut().zip(&k.da) {
            *dw += ratio * da;
        }
        k
    }

    /// a − w as measured, and its variance.
    pub fn slip(&self, shared_ratio: f64) -> (f64, f64) {
        let k = self.kinematics(&self.z, shared_ratio);
        let slope: Slots = std::array::from_fn(|i| k.da[i] - k.dw[i]);
        let spread = self.covariance_times(&slope);
        (k.a - k.w, slope.iter().zip(&spread).map(|(s, v)| s * v).sum())
    }

    /// Velocity along x after the impact as the measured numbers tell it, if restitution is `restitution` (which
    /// velocities do not need).
    pub fn rebound_vx(&self, restitution: f64) -> f64 {
        let z = &self.z;
        match self.set {
            ColumnSet::Velocities => z[2],
            ColumnSet::Angles => restitution * z[0].cos() * z[1].tan(),
            ColumnSet::Distances => z[1] * z[2] / (2.0 * restitution * z[0]),
        }
    }
}

/// The required columns of a set, and gravity, in their slots.
fn places(set: ColumnSet) -> &'static [(Column, usize)] {
    match set {
        ColumnSet::Velocities => &[
            (Column::IncidentVx, 0),
            (Column::IncidentVz, 1),
            (Column::ReboundVx, 2),
            (Column::ReboundVz, 3),
        ],
        ColumnSet::Angles => &[(Column::IncidentAngle, 0), (Column::ReboundAngle, 1)],
        ColumnSet::Distances => &[
            (Column::X0, 0),
            (Column::X, 1),
            (Column::LaunchSpeed, 2),
            (Column::Gravity, 3),
        ],
    }
}

/// From the column's unit to the slot's.
fn factor(column: Column) -> f64 {
    match column {
        Column::IncidentVz => -1.0,
        Column::IncidentAngle | Column::ReboundAngle => 1_f64.to_radians(),
        _ => 1.0,
    }
}

/// Deviation in a series without deviations: the measured numbers of one kind count the same; what is set (launch speed,
/// gravity, spin before) is taken as exact.
fn unit_std(column: Column) -> f64 {
    match column {
        Column::LaunchSpeed
        | Column::Gravity
        | Column::SpinIn
        | Column::SpinRatio
        | Column::InertiaFactor
        | Column::StiffnessRatio => 0.0,
        _ => 1.0,
    }
}

/// ln of the determinant of the correlations that belong to a covariance, over what has an error of its own; `None` where
/// the covariance has a negative direction. By Cholesky's scheme.
fn log_correlation(full: &[Slots; SLOTS]) -> Option<f64> {
    const ROUNDING: f64 = 1e-9;
    let std: Vec<f64> = (0..SLOTS).map(|i| full[i][i].sqrt()).collect();
    let mut m = [[0.0; SLOTS]; SLOTS];
    for (i, line) in m.iter_mut().enumerate() {
        for (j, entry) in line.iter_mut().enumerate() {
            let scale = std[i] * std[j];
            *entry = if scale > 0.0 { full[i][j] / scale } else { 0.0 };
        }
    }
    let mut sum = 0.0;
    for p in 0..SLOTS {
        let pivot = m[p][p];
        if !(pivot >= -ROUNDING) {
            return None;
        }
        if pivot <= ROUNDING {
            // Nothing left of this error's own: then nothing may hang on it either.
            if (p + 1..SLOTS).any(|i| m[i][p].abs() > ROUNDING.sqrt()) {
                return None;
            }
            continue;
        }
        sum += pivot.ln();
        let line = m[p];
        for below in &mut m[p + 1..] {
            let share = below[p] / pivot;
            for (entry, above) in below.iter_mut().zip(&line).skip(p + 1) {
                *entry -= share * above;
            }
        }
    }
    Some(sum)
}
