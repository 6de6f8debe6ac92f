//! What every reported number of a motion depends on: the arcs' parameters, and errors that no arc shows.

use crate::flight::planar::{ACROSS, GRAVITY, Motion};
use crate::numeric::propagation::{InputQuantities, OutputQuantities};
use crate::quantity::Quantity;
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;

/// A struct of `f64` fields that stand in a vector one after the other.
macro_rules! named_entries {
    ($(#[$outer:meta])* $type:ident { $($(#[$doc:meta])* $field:ident,)* }) => {
        $(#[$outer])*
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct $type {
            $($(#[$doc])* pub $field: f64,)*
        }

        impl $type {
            const COUNT: usize = [$(stringify!($field)),*].len();

            fn to_array(self) -> [f64; Self::COUNT] {
                [$(self.$field),*]
            }

            fn from_array([$($field),*]: [f64; Self::COUNT]) -> Self {
                Self { $($field),* }
            }
        }
    };
}

named_entries! {
    /// Errors of calibration, air, contact and pictures: what each is taken to be, or its standard uncertainty.
    SystematicErrors {
        /// Logarithm of the scale over the best one.
        ln_scale,
        /// "Up" beyond the fall's direction, rad.
        up_rad,
        /// The origin and all centres, along right, plane units.
        zero_right,
        /// The same along up.
        zero_up,
        /// Half the time of a contact without loss, s.
        half_contact_s,
        /// Lift beyond its law on the arc before an impact, in its own standard uncertainties.
        lift_in,
        /// The same on the arc after it.
        lift_out,
        /// Drag beyond its law on the arc before an impact, over the drag.
        drag_in,
        /// The same on the arc after it.
        drag_out,
        /// What differs between the centres' errors at two impacts, along right, plane units.
        place_right,
        /// By how many times the law's all lift of known spins is more.
        lift_times_law,
        /// The rate of the bench's line, plane units/s.
        bench_rate,
        /// Direction of the floor's line in the picture, rad.
        floor_line_rad,
        /// The floor's slope by calibration or custom, rad.
        floor_level_rad,
        /// As `place_right`, along up.
        place_up,
        /// How far the ball is ahead of where pictures show it, on its way down and on its way up, plane units: a codec leaves it where it was
        /// predicted.
        ahead,
        /// Spin seen before an impact, in its own standard uncertainties.
        spin_in,
        /// The same after it.
        spin_out,
    }
}

/// The inputs at their best, or near it.
#[derive(Debug)]
pub struct InputValues<'a> {
    /// The arcs' parameters.
    pub arcs: &'a [f64],
    /// What else.
    pub errors: SystematicErrors,
    /// The impacts that one motion has with these, by the arc before each: most outputs ask for the same ones.
    impacts: RefCell<Vec<(usize, ImpactMotions)>>,
}

/// Time of an impact, s, with the motions before and after it.
pub type ImpactMotions = (f64, Motion, Motion);

impl<'a> InputValues<'a> {
    fn of(vector: &'a [f64]) -> Self {
        let (arcs, errors) = vector.split_at(vector.len() - SystematicErrors::COUNT);
        let mut array = [0.0; SystematicErrors::COUNT];
        array.copy_from_slice(errors);
        Self {
            arcs,
            errors: SystematicErrors::from_array(array),
            impacts: RefCell::default(),
        }
    }

    /// The impact after arc `k`, which `find` finds where it is asked for first. (Values are made for one motion.)
    pub fn impact(&self, k: usize, find: impl FnOnce() -> ImpactMotions) -> ImpactMotions {
        let known = self
            .impacts
            .borrow()
            .iter()
            .find(|(arc, _)| *arc == k)
            .map(|(_, m)| *m);
        known.unwrap_or_else(|| {
            let found = find();
            self.impacts.borrow_mut().push((k, found));
            found
        })
    }

    /// Size of the common acceleration, plane units/s².
    pub fn fall(&self) -> f64 {
        let p = self.arcs;
        if p[ACROSS] == 0.0 {
            p[GRAVITY]
        } else {
            p[GRAVITY].hypot(p[ACROSS])
        }
    }
}

/// The inputs with their covariance.
#[derive(Debug, Clone)]
pub struct MotionInputs {
    quantities: InputQuantities,
    errors: SystematicErrors,
    stds: SystematicErrors,
}

impl MotionInputs {
    /// Arcs with their covariance, and errors of 0 with the standard uncertainties `stds`, which have nothing in common.
    pub fn new(arcs: &DVector<f64>, covariance: &DMatrix<f64>, stds: SystematicErrors) -> Self {
        let all = arcs.len() + SystematicErrors::COUNT;
        let mut inputs = Self {
            quantities: InputQuantities {
                values: arcs.clone().resize_vertically(all, 0.0),
                covariance: covariance.clone().resize(all, all, 0.0),
            },
            errors: SystematicErrors::default(),
            stds,
        };
        inputs.set(|_, _| ());
        inputs
    }

    /// Changes errors and their standard uncertainties.
    pub fn set(&mut self, change: impl FnOnce(&mut SystematicErrors, &mut SystematicErrors)) {
        change(&mut self.errors, &mut self.stds);
        let first = self.quantities.values.len() - SystematicErrors::COUNT;
        let all = self.errors.to_array().into_iter().zip(self.stds.to_array());
        for (i, (error, std)) in all.enumerate() {
            self.quantities.values[first + i] = error;
            self.quantities.covariance[(first + i, first + i)] = std * std;
        }
    }

    /// The best estimates.
    pub fn best(&self) -> InputValues<'_> {
        InputValues::of(self.quantities.values.as_slice())
    }

    /// The one number that `function` makes of the inputs.
    pub fn quantity(&self, function: impl Fn(&InputValues<'_>) -> f64 + Sync) -> Option<Quantity> {
        self.outputs(|p| vec![function(p)]).quantity(0)
    }

    /// What `function` makes of the inputs, with its covariance.
    pub fn outputs(&self, function: impl Fn(&InputValues<'_>) -> Vec<f64> + Sync) -> OutputQuantities {
        self.quantities.outputs(|p| function(&InputValues::of(p)))
    }
}
