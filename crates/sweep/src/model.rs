//! The washing machine as a model of the engine: its parameters.

use std::borrow::Cow;

use sweep_engine::{Build, Model};
use washer_model::{Channel, Machine, Parameter, Spin, UnknownParameter};
use washer_row::Measures;

use crate::identity::BUILD;
use crate::method::Integrator;
use crate::speeds::SpeedList;

/// Channels that are compared if the grid file names none.
const DEFAULT_CHANNELS: [Channel; 6] = [
    Channel::TubFrontY,
    Channel::TubFrontZ,
    Channel::DrumFrontY,
    Channel::DrumFrontZ,
    Channel::TubYaw,
    Channel::TubPitch,
];

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

impl Model for Washer {
    type Parameter = Parameter;
    type Channel = Channel;
    type Integrator = Integrator;

    const BUILD: Build = BUILD;

    fn channels() -> &'static [Channel] {
        &Channel::ALL
    }

    fn default_channels() -> Vec<Channel> {
        DEFAULT_CHANNELS.to_vec()
    }

    fn parameters(&self) -> Vec<Parameter> {
        Parameter::all(&self.machine, &self.spin)
    }

    fn find(&self, name: &str) -> Result<Parameter, UnknownParameter> {
        Parameter::find(name, &self.machine, &self.spin)
    }

    fn parts(&self, parameter: &Parameter) -> Vec<Cow<'static, str>> {
        parameter.parts(&self.machine)
    }

    fn value(&self, parameter: &Parameter) -> Option<f64> {
        parameter.get(&self.machine, &self.spin)
    }

    fn write(&mut self, parameter: &Parameter, value: f64) {
        parameter.set(&mut self.machine, &mut self.spin, value);
    }
}
