//! Rules for the numbers that a data sheet or a planar model does not give.
//!
//! A machine file that gives the drum's radius and depth may leave these numbers out. Lengths
//! follow by geometric similarity with the built-in machine, masses as shares of the moving mass,
//! moments of inertia from thin-walled cylinders.

use super::MachineParameter;
use crate::{Machine, Spin};

/// The numbers of a data sheet from which left-out numbers follow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DataSheet {
    /// The mass of tub, shaft and drum together, without laundry; absent if each is given.
    pub moving_mass_kg: Option<f64>,
    /// The inner radius of the drum (R).
    pub drum_radius_m: f64,
    /// The inner depth of the drum (H).
    pub drum_depth_m: f64,
}

/// The rule for a number that a machine file may leave out.
#[derive(Debug)]
pub struct Assumption {
    /// The function that computes the value from the data sheet and the machine's other numbers.
    pub(super) compute_value: fn(&DataSheet, &Machine) -> f64,
    /// The rule in words, as listings show it.
    pub rule: &'static str,
    /// The range in which real machines are expected.
    pub expected_range: ExpectedRange,
}

/// The range about an assumed value in which real machines are expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExpectedRange {
    /// A range from the first to the second multiple of the value.
    Factor(f64, f64),
    /// A range from the first to the second share of the drum's depth, added to the value.
    Depth(f64, f64),
}

impl Assumption {
    /// Returns the ends of the expected range about a value. The drum's depth is that of the
    /// machine: from the hinge to the drum's front.
    pub fn expected_bounds(&self, value: f64, machine: &Machine) -> [f64; 2] {
        let depth_m = machine.drum.front_x_m - machine.drum.hinge_x_m;
        match self.expected_range {
            ExpectedRange::Factor(low, high) => [value * low, value * high],
            ExpectedRange::Depth(low, high) => [value + low * depth_m, value + high * depth_m],
        }
    }
}

impl DataSheet {
    /// Sets the parameters that a file leaves out to their assumed values. Rules may read the
    /// results of other rules, without cycles, so that the passes end.
    pub fn fill_omitted(&self, omitted: &[MachineParameter], machine: &mut Machine) {
        let mut no_spin = Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() };
        for _ in omitted {
            let previous_machine = machine.clone();
            for parameter in omitted {
                if let Some(assumption) = parameter.assumption() {
                    let value = (assumption.compute_value)(self, machine);
                    parameter.set(machine, &mut no_spin, value);
                }
            }
            if *machine == previous_machine {
                return;
            }
        }
    }
}

/// Returns the moments of inertia of a thin-walled open cylinder about its mass centre, along and
/// across its axis.
pub(super) fn cylinder_inertia_kg_m2(mass_kg: f64, radius_m: f64, length_m: f64) -> [f64; 2] {
    let axial_inertia_kg_m2 = mass_kg * radius_m * radius_m;
    [axial_inertia_kg_m2, axial_inertia_kg_m2 / 2.0 + mass_kg * length_m * length_m / 12.0]
}
