//! The washing machine's part of a plan, and its parameters and channels in the form that the
//! engine takes.

use sweep_engine::ModelParameter;
use washer_model::{Channel, Machine, MachineParameter, Spin, Target};
use washer_row::Measures;

use crate::speeds::SpeedList;

/// Returns a channel of the model in the form that the engine takes.
pub(crate) const fn engine_channel(channel: Channel) -> sweep_parameter::Channel {
    sweep_parameter::Channel {
        name: channel.name(),
        unit: channel.unit(),
        description: channel.description(),
    }
}

/// Returns a parameter of a machine and a spin in the form that the engine takes.
pub(crate) fn engine_parameter(
    parameter: MachineParameter,
    machine: &Machine,
    spin: &Spin,
) -> ModelParameter<Washer> {
    sweep_parameter::Parameter {
        name: parameter.name().to_owned().into(),
        unit: parameter.unit(),
        description: parameter.description(),
        range: parameter.range(),
        source: parameter.source(),
        value: parameter.get(machine, spin),
        number_names: parameter.single_names(machine),
        window_edge: match parameter.target() {
            Target::Window(edge) => Some(edge),
            _ => None,
        },
        is_from_grid_file: matches!(parameter.target(), Target::Spin | Target::Window(_)),
        handle: parameter,
    }
}

/// The washing machine's part of a plan, from a grid file.
#[derive(Clone, Debug, PartialEq)]
pub struct Washer {
    /// The machine after `[set]` and `--set`, before the axes.
    pub machine: Machine,
    /// The spin after `[set]` and `--set`, before the axes.
    pub spin: Spin,
    /// The criterion and the metrics that are computed from the motions.
    pub measures: Measures,
    /// The constant speeds of the metrics `growth` and `dwell`; `None` if neither is asked for.
    pub held_speeds: Option<SpeedList>,
}

impl Washer {
    /// Returns a parameter, with its value, in the form that the engine takes.
    pub(crate) fn parameter(&self, parameter: MachineParameter) -> ModelParameter<Self> {
        engine_parameter(parameter, &self.machine, &self.spin)
    }
}
