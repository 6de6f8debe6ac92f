//! A series of bounces: what was measured of each, before any model.
//!
//! A [`Row`] holds what its columns say, in the units that their names say. [`Series::new`] looks at all of them and sets
//! aside, with a reason, what cannot be used; nothing is dropped silently. A file becomes rows in [`super::csv`].

pub use super::columns::{Column, ColumnSet, Reading};

use super::error::FitError;
use crate::rebound::SOLID_SPHERE;
use crate::rebound::compliant::STIFFNESS_RATIO_RANGE;
use std::collections::HashMap;
use std::sync::Arc;

/// Gravity where a row does not give it, m/s².
pub const GRAVITY_M_S2: f64 = 9.81;

/// Name of the group of rows that name none.
pub const DEFAULT_GROUP: &str = "all";

/// A bounce.
#[derive(Debug, Clone)]
pub struct Row {
    /// Its number in its file, counted from 1 below the column names.
    pub number: usize,
    /// Which rows it is fitted with.
    pub group: Arc<str>,
    readings: PackedReadings,
    /// What few rows have.
    more: Option<Box<RowExtras>>,
}

/// What few rows have beside their readings.
#[derive(Debug, Clone, Default)]
struct RowExtras {
    recording: Option<Arc<str>>,
    page: Option<Arc<str>>,
    correlations: Vec<(Column, Column, f64)>,
}

/// The readings of a row, without room for those that it has not: of a million rows, all of the same few columns.
#[derive(Debug, Clone, Default)]
struct PackedReadings {
    /// A bit for each column with a value, and for each with a deviation.
    values: u16,
    stds: u16,
    /// In the order of the columns; a deviation stands after its value.
    numbers: Box<[f64]>,
}

const _: () = assert!(Column::COUNT <= u16::BITS as usize);

impl PackedReadings {
    fn of(readings: &[Option<Reading>; Column::COUNT]) -> Self {
        let mut packed = Self::default();
        let mut numbers = Vec::with_capacity(2 * Column::COUNT);
        for (place, reading) in readings.iter().enumerate() {
            let Some(Reading { value, std }) = reading else {
                continue;
            };
            packed.values |= 1 << place;
            numbers.push(*value);
            if let Some(std) = std {
                packed.stds |= 1 << place;
                numbers.push(*std);
            }
        }
        packed.numbers = numbers.as_slice().into();
        packed
    }

    fn get(&self, column: Column) -> Option<Reading> {
        let bit = 1_u16 << column as usize;
        if self.values & bit == 0 {
            return None;
        }
        let before = bit - 1;
        let place = (self.values & before).count_ones() + (self.stds & before).count_ones();
        let numbers = &self.numbers[place as usize..];
        Some(Reading {
            value: numbers[0],
            std: (self.stds & bit != 0).then(|| numbers[1]),
        })
    }
}

impl Row {
    /// A row without numbers.
    #[must_use]
    pub fn new(number: usize, group: impl Into<Arc<str>>) -> Self {
        Self {
            number,
            group: group.into(),
            readings: PackedReadings::default(),
            more: None,
        }
    }

    /// With `readings`, one for each column of [`Column::ALL`], in place of its own.
    pub(super) fn with_all(mut self, readings: &[Option<Reading>; Column::COUNT]) -> Self {
        self.readings = PackedReadings::of(readings);
        self
    }

    /// With `value` and its standard deviation in `column`.
    #[must_use]
    pub fn with(mut self, column: Column, value: f64, std: Option<f64>) -> Self {
        self.set(column, Some(Reading { value, std }));
        self
    }

    /// With errors of `a` and `b` that are correlated by `correlation`.
    #[must_use]
    pub fn with_correlation(mut self, a: Column, b: Column, correlation: f64) -> Self {
        self.extras().correlations.push((a, b, correlation));
        self
    }

    /// Puts a reading in its place, or takes it away.
    pub fn set(&mut self, column: Column, reading: Option<Reading>) {
        let mut readings = Column::ALL.map(|column| self.readings.get(column));
        readings[column as usize] = reading;
        self.readings = PackedReadings::of(&readings);
    }

    /// What stands in `column`.
    #[must_use]
    pub fn reading(&self, column: Column) -> Option<Reading> {
        self.readings.get(column)
    }

    /// The number in `column`.
    #[must_use]
    pub fn value(&self, column: Column) -> Option<f64> {
        self.reading(column).map(|reading| reading.value)
    }

    /// The correlations that were given.
    #[must_use]
    pub fn correlations(&self) -> &[(Column, Column, f64)] {
        self.more.as_ref().map_or(&[], |more| &more.correlations)
    }

    /// What it was measured on, for people.
    #[must_use]
    pub fn recording(&self) -> Option<&str> {
        self.more.as_ref()?.recording.as_deref()
    }

    /// Says what it was measured on.
    pub fn set_recording(&mut self, recording: impl Into<Arc<str>>) {
        self.extras().recording = Some(recording.into());
    }

    /// Where its page lies, relative to the report; only a relative path is linked.
    #[must_use]
    pub fn page(&self) -> Option<&str> {
        self.more.as_ref()?.page.as_deref()
    }

    /// Says where its page lies.
    pub fn set_page(&mut self, page: impl Into<Arc<str>>) {
        self.extras().page = Some(page.into());
    }

    fn extras(&mut self) -> &mut RowExtras {
        self.more.get_or_insert_default()
    }

    /// k, by default that of a solid sphere.
    #[must_use]
    pub fn inertia_factor(&self) -> f64 {
        self.value(Column::InertiaFactor).unwrap_or(SOLID_SPHERE)
    }
}

/// Where the weights of a fit come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weights {
    /// The deviations of the rows.
    Stated,
    /// No row has a deviation: all count the same, and how they scatter tells how sure they are.
    Unit,
}

/// A row that is not in the fit, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct SetAside {
    /// Its number.
    pub row: usize,
    /// Its group.
    pub group: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Something to know about a series or its fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Stable, lower case with underscores.
    pub code: &'static str,
    /// What was noticed, with numbers, and what to do.
    pub message: String,
}

/// Rows that can be fitted, and those that cannot.
#[derive(Debug, Clone)]
pub struct Series {
    /// What it is called in messages and on the page.
    pub name: String,
    /// The columns of the fit.
    pub set: ColumnSet,
    /// Where the weights come from.
    pub weights: Weights,
    /// The names of the groups, in the order in which they appear.
    pub groups: Vec<String>,
    /// Rows whose numbers can be used.
    pub rows: Vec<Row>,
    /// Rows whose numbers cannot.
    pub set_aside: Vec<SetAside>,
    /// What to know about it as a whole.
    pub notes: Vec<Note>,
}

impl Series {
    /// Looks through `rows`. `set_aside` are those that were no rows of numbers to begin with.
    ///
    /// Which set of columns is fitted is the first of [`ColumnSet::ALL`] that some row holds in full.
    ///
    /// # Errors
    ///
    /// No row at all, or none that holds one of the sets.
    pub fn new(name: &str, rows: Vec<Row>, set_aside: Vec<SetAside>) -> Result<Self, FitError> {
        if rows.is_empty() && set_aside.is_empty() {
            return Err(FitError::NoRows {
                name: name.to_owned(),
            });
        }
        let full = |set: &ColumnSet| {
            rows.iter()
                .any(|row| set.required().iter().all(|&c| row.value(c).is_some()))
        };
        let set = ColumnSet::ALL.into_iter().find(full);
        match set {
            Some(set) => Ok(Self::of_set(name, set, rows, set_aside)),
            None if rows.is_empty() => Ok(Self::of_set(name, ColumnSet::Velocities, rows, set_aside)),
            None => Err(FitError::Columns {
                name: name.to_owned(),
                missing: "no row holds a whole set of numbers".to_owned(),
                found: present(&rows),
            }),
        }
    }

    /// As [`Series::new`], on the columns of `set`.
    #[must_use]
    pub fn of_set(name: &str, set: ColumnSet, rows: Vec<Row>, set_aside: Vec<SetAside>) -> Self {
        let groups = group_names(&rows, &set_aside);
        let deviations = StatedDeviations::of(set, &rows);
        let mut series = Self {
            name: name.to_owned(),
            set,
            weights: deviations.weights(),
            groups,
            rows,
            set_aside,
            notes: deviations.notes(),
        };
        let Self { rows, set_aside, .. } = &mut series;
        rows.retain(|row| {
            let checked = deviations.check(row);
            if let Err(reason) = checked {
                set_aside.push(SetAside {
                    row: row.number,
                    group: row.group.to_string(),
                    reason,
                });
                return false;
            }
            true
        });
        series.set_aside.sort_by_key(|s| s.row);
        series
    }
}

/// The names of the groups, in the order of the rows.
fn group_names(rows: &[Row], set_aside: &[SetAside]) -> Vec<String> {
    let mut first: HashMap<&str, usize> = HashMap::new();
    let named = rows.iter().map(|row| (&*row.group, row.number));
    for (group, number) in named.chain(set_aside.iter().map(|s| (s.group.as_str(), s.row))) {
        let first = first.entry(group).or_insert(number);
        *first = number.min(*first);
    }
    let mut names: Vec<(usize, &str)> = first.into_iter().map(|(group, number)| (number, group)).collect();
    names.sort_unstable();
    names.into_iter().map(|(_, group)| group.to_owned()).collect()
}

/// The names of the columns in which some row has a number.
fn present(rows: &[Row]) -> String {
    let names: Vec<&str> = Column::ALL
        .into_iter()
        .filter(|&c| rows.iter().any(|row| row.value(c).is_some()))
        .map(Column::name)
        .collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

/// What is known of the rows' deviations, column by column.
struct StatedDeviations {
    set: ColumnSet,
    /// Columns of the fit in which some row has a deviation, be it zero.
    given: Vec<Column>,
    /// Those in which some deviation is not zero.
    positive: Vec<Column>,
    /// Relations between the numbers in which none has a deviation.
    exact: Vec<&'static [Column]>,
}

impl StatedDeviations {
    fn of(set: ColumnSet, rows: &[Row]) -> Self {
        let columns = set.required().iter().chain(set.optional());
        let std = |row: &Row, column| row.reading(column).and_then(|r| r.std);
        let given: Vec<Column> = columns
            .copied()
            .filter(|&c| rows.iter().any(|row| std(row, c).is_some()))
            .collect();
        let positive: Vec<Column> = given
            .iter()
            .copied()
            .filter(|&c| rows.iter().any(|row| std(row, c).is_some_and(|s| s != 0.0)))
            .collect();
        let exact = relations(set)
            .iter()
            .copied()
            .filter(|relation| !relation.iter().any(|c| positive.contains(c)))
            .collect();
        Self {
            set,
            given,
            positive,
            exact,
        }
    }

    fn weights(&self) -> Weights {
        if self.exact.is_empty() {
            Weights::Stated
        } else {
            Weights::Unit
        }
    }

    fn notes(&self) -> Vec<Note> {
        const ALL_THE_SAME: &str = "all rows count the same, and their scatter tells how sure the result is";
        let names = |columns: &[Column]| columns.iter().map(|c| c.name()).collect::<Vec<_>>();
        let note = |code, message| vec![Note { code, message }];
        if self.given.is_empty() {
            return note(
                "no_deviations",
                format!(
                    "no column of standard deviations (such as {}_std): {ALL_THE_SAME}. So the fit itself cannot be tested.",
                    self.set.required()[self.set.required().len() - 1].name()
                ),
            );
        }
        if self.positive.is_empty() {
            return note(
                "deviations_all_zero",
                format!(
                    "every standard deviation in the file is 0, which no measurement has; {ALL_THE_SAME}. Give the \
                     deviations, or leave the columns out."
                ),
            );
        }
        if let Some(relation) = self.exact.first() {
            let without = names(relation).join(" and ");
            return note(
                "deviations_not_used",
                format!(
                    "standard deviations for {}, but none for {without}, which would have to agree exactly then; they \
                     are not used: {ALL_THE_SAME}. Give all of them.",
                    names(&self.positive).join(", ")
                ),
            );
        }
        let required = self.set.required().iter().copied();
        let exact: Vec<Column> = required.filter(|c| !self.given.contains(c)).collect();
        match exact.first() {
            None => Vec::new(),
            Some(first) => note(
                "taken_as_exact",
                format!(
                    "no standard deviations for {}, which is taken as exact while other columns have theirs; add {}_std.",
                    names(&exact).join(", "),
                    first.name()
                ),
            ),
        }
    }

    /// Whether the row's numbers can be used; why not.
    fn check(&self, row: &Row) -> Result<(), String> {
        for &column in self.set.required() {
            let reading = row
                .reading(column)
                .ok_or_else(|| format!("{} is empty", column.name()))?;
            self.check_reading(column, reading, true)?;
        }
        for &column in self.set.optional() {
            if let Some(reading) = row.reading(column) {
                self.check_reading(column, reading, false)?;
            }
        }
        check_inertia(row)?;
        check_stiffness(row)?;
        check_range(self.set, row)?;
        let known = |c: &Column| self.set.required().contains(c) || self.set.optional().contains(c);
        for &(a, b, r) in row.correlations() {
            if known(&a) && known(&b) && !(r.is_finite() && r.abs() <= 1.0) {
                return Err(format!(
                    "the correlation of {} and {} is {r}; it lies between -1 and 1",
                    a.name(),
                    b.name()
                ));
            }
        }
        Ok(())
    }

    fn check_reading(&self, column: Column, reading: Reading, required: bool) -> Result<(), String> {
        let name = column.name();
        if !reading.value.is_finite() {
            return Err(format!("{name} is not a finite number"));
        }
        // Far beyond any laboratory; products of such numbers overflow.
        if !(reading.value.abs() <= 1e9) {
            return Err(format!("{name} is {}, which no bounce has", reading.value));
        }
        match reading.std {
            Some(std) if std < 0.0 => Err(format!("{name}_std is negative ({std})")),
            Some(std) if !(std <= 1e9) => Err(format!("{name}_std is {std}, not a deviation")),
            None if required && self.weights() == Weights::Stated && self.given.contains(&column) => {
                Err(format!("{name}_std is empty, while other rows have one"))
            }
            _ => Ok(()),
        }
    }
}

/// The numbers that a rebound ties together, one set for each equation: some of each need deviations.
fn relations(set: ColumnSet) -> &'static [&'static [Column]] {
    match set {
        ColumnSet::Velocities => &[
            &[Column::IncidentVx, Column::ReboundVx],
            &[Column::IncidentVz, Column::ReboundVz],
        ],
        ColumnSet::Angles => &[&[Column::IncidentAngle, Column::ReboundAngle]],
        ColumnSet::Distances => &[&[Column::X0, Column::X]],
    }
}

fn check_inertia(row: &Row) -> Result<(), String> {
    let k = row.inertia_factor();
    if k > 0.0 && k <= 1.0 {
        Ok(())
    } else {
        Err(format!(
            "inertia_factor is {k}; it lies above 0 (0.4 for a solid sphere, 0.667 for a thin shell) and up to 1"
        ))
    }
}

fn check_stiffness(row: &Row) -> Result<(), String> {
    match row.value(Column::StiffnessRatio) {
        Some(kappa) if !(STIFFNESS_RATIO_RANGE.holds)(kappa) => Err(format!(
            "stiffness_ratio is {kappa}, not {}: {}",
            STIFFNESS_RATIO_RANGE.accepted, STIFFNESS_RATIO_RANGE.hint
        )),
        _ => Ok(()),
    }
}

/// What no bounce on a floor has.
fn check_range(set: ColumnSet, row: &Row) -> Result<(), String> {
    let value = |column| row.value(column).unwrap_or(f64::NAN);
    match set {
        ColumnSet::Velocities => {
            if !(value(Column::IncidentVz) < 0.0) {
                return Err(format!(
                    "incident_vz_m_s is {}: before the bounce the ball goes down, which is negative",
                    value(Column::IncidentVz)
                ));
            }
            if !(value(Column::ReboundVz) >= 0.0) {
                return Err(format!(
                    "rebound_vz_m_s is {}: after the bounce the ball goes up, which is positive",
                    value(Column::ReboundVz)
                ));
            }
        }
        ColumnSet::Angles => {
            for column in [Column::IncidentAngle, Column::ReboundAngle] {
                if !(value(column).abs() < 90.0) {
                    return Err(format!(
                        "{} is {}: angles are from the vertical, between -90 and 90 degrees",
                        column.name(),
                        value(column)
                    ));
                }
            }
        }
        ColumnSet::Distances => {
            for column in [Column::X0, Column::LaunchSpeed] {
                if !(value(column) > 0.0) {
                    return Err(format!(
                        "{} is {}; it has to be above 0",
                        column.name(),
                        value(column)
                    ));
                }
            }
            let gravity = row.value(Column::Gravity).unwrap_or(GRAVITY_M_S2);
            if !(gravity > 0.0) {
                return Err(format!("gravity_m_s2 is {gravity}; it has to be above 0"));
            }
        }
    }
    Ok(())
}
