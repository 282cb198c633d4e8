//! The input from which a point is prepared.

use crate::{Machine, MachineParameter, Spin, Target};

/// The machine, the spin and the window of a point that is to be prepared.
#[derive(Clone, Debug, PartialEq)]
pub struct PointInput {
    pub machine: Machine,
    pub spin: Spin,
    /// The closed interval over which amplitudes are taken (s).
    pub window_s: [f64; 2],
}

impl PointInput {
    /// Writes the value of a parameter of machine, spin or window, without a check.
    pub fn write(&mut self, parameter: &MachineParameter, value: f64) {
        match parameter.target() {
            Target::Window(end_index) => self.window_s[end_index] = value,
            _ => parameter.set(&mut self.machine, &mut self.spin, value),
        }
    }
}
