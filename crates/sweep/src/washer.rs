//! The washing machine as a model of the engine.

use serde_json::Value;
use sweep_engine::config::{Draft, Keys};
use sweep_engine::store::{Layout, axis_columns};
use sweep_engine::{About, Engine, Error, Estimate, GridTable, Model, ModelFile, ModelParameter};
use washer_model::{Channel, Machine, MachineParameter, UnknownParameter};
use washer_row::{Measures, Metric};

use crate::columns::Columns;
use crate::config::grid::find_missing_part;
use crate::config::{WasherGridInput, read, spin};
use crate::engine::ModelEngine;
use crate::identity::BUILD;
use crate::method::METHODS;
use crate::model::{Washer, engine_channel};
use crate::plan::Plan;

/// Channels that are compared if the grid file names none.
const DEFAULT_CHANNELS: [sweep_parameter::Channel; 6] = [
    engine_channel(Channel::TubFrontY),
    engine_channel(Channel::TubFrontZ),
    engine_channel(Channel::DrumFrontY),
    engine_channel(Channel::DrumFrontZ),
    engine_channel(Channel::TubYaw),
    engine_channel(Channel::TubPitch),
];

/// All channels, in the order of the models' output.
const ALL_CHANNELS: [sweep_parameter::Channel; Channel::ALL.len()] = {
    let mut channels = [engine_channel(Channel::TubFrontY); Channel::ALL.len()];
    let mut k = 0;
    while k < channels.len() {
        channels[k] = engine_channel(Channel::ALL[k]);
        k += 1;
    }
    channels
};

impl Model for Washer {
    type Handle = MachineParameter;

    const ABOUT: About = About {
        default_channels: &DEFAULT_CHANNELS,
        model_file: Some(ModelFile { key: "machine", keys: &read::MACHINE_KEYS }),
        start_advice: Some("`sweep init FILE` writes a grid file to start from"),
        required_settings: &[
            ("growth", HELD_SPEEDS_REQUIREMENT),
            ("dwell", HELD_SPEEDS_REQUIREMENT),
            ("foot", CABINET_REQUIREMENT),
            ("slip", CABINET_REQUIREMENT),
            ("walk", CABINET_REQUIREMENT),
            ("stop", "a machine with [[stops]]"),
        ],
        further_columns: "; a machine with [cabinet] and feet, with stops, and a grid file with \
                  [stability] have more",
        ..About::new(BUILD, &ALL_CHANNELS, &METHODS)
    };

    fn blank() -> Self {
        Self {
            machine: Machine::paper(),
            spin: spin::PLACEHOLDER_SPIN,
            measures: Measures::default(),
            held_speeds: None,
        }
    }

    fn parameters(&self) -> Vec<ModelParameter<Self>> {
        let all = MachineParameter::all(&self.machine, &self.spin).into_iter();
        all.map(|parameter| self.parameter(parameter)).collect()
    }

    fn find(&self, name: &str) -> Result<ModelParameter<Self>, UnknownParameter> {
        MachineParameter::find(name, &self.machine, &self.spin)
            .map(|machine_parameter| self.parameter(machine_parameter))
    }

    fn write(&mut self, parameter: &MachineParameter, value: f64) {
        parameter.set(&mut self.machine, &mut self.spin, value);
    }

    fn walk(&mut self, table: GridTable, keys: &mut Keys<'_>, input: Option<&WasherGridInput>) {
        match table {
            GridTable::Top => read::walk_top(self, keys, input),
            GridTable::Reliability => read::walk_reliability(&mut self.measures, keys),
        }
    }

    fn check(draft: &Draft<'_, Self>) {
        read::check(draft);
    }

    fn schema_of_set() -> Value {
        read::schema_of_set()
    }

    fn layout(plan: &Plan) -> Layout {
        Layout::map(axis_columns(plan), Columns::for_run(plan).declared())
    }

    fn engine<'a>(plan: &'a Plan, only: Option<&str>) -> Result<Engine<'a>, Error> {
        Ok(ModelEngine::for_column(plan, only)?.into_engine())
    }

    fn estimate(plan: &Plan, threads: usize) -> Result<Estimate, Error> {
        crate::estimate::estimate(plan, threads)
    }

    fn variants(plan: &Plan) -> Vec<Plan> {
        let machine_can_have = |metric: &Metric| match metric {
            metric if metric.is_at_held_speeds() => plan.model.held_speeds.is_some(),
            metric => find_missing_part(*metric, &plan.model.machine).is_none(),
        };
        let possible_metrics: Vec<Metric> =
            Metric::ALL.into_iter().filter(machine_can_have).collect();
        let single_metrics = possible_metrics.iter().map(|metric| vec![*metric]);
        let plan_with_metrics = |metrics: Vec<Metric>| {
            let mut plan = plan.clone();
            plan.model.measures.metrics = metrics;
            plan
        };
        single_metrics.chain([possible_metrics.clone()]).map(plan_with_metrics).collect()
    }
}

/// The requirement of columns at held speeds.
const HELD_SPEEDS_REQUIREMENT: &str = "[stability] in the grid file, with the speeds of dwells";
/// The requirement of columns of the cabinet's feet.
const CABINET_REQUIREMENT: &str = "a machine with [cabinet] and [[feet]]";

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use washer_model::{Profile, Spin};

    use super::*;
    use sweep_engine::commands::parameters::{format_json, list_parameters};
    use sweep_engine::plan::NumberSources;

    #[test]
    fn json_has_every_parameter() {
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 120.0, ramp_s: 2.0 };
        let json: Value =
            serde_json::from_str(&format_json(&list_parameters::<Washer>(None))).unwrap();
        assert_eq!(
            json.as_array().map(Vec::len),
            Some(MachineParameter::all(&Machine::paper(), &spin).len())
        );
        assert_eq!(json[0]["name"], "gravity_m_per_s2");
    }

    #[test]
    fn a_number_that_a_user_wrote_has_the_user_as_its_source() {
        let folder = tempfile::tempdir().unwrap();
        let machine_text =
            crate::config::machine_file(&Machine::paper(), &NumberSources::default())
                + "friction_n = 40\nfriction_linear_speed_m_per_s = \"auto\"\n";
        std::fs::write(folder.path().join("own.toml"), machine_text).unwrap();
        let grid_path = folder.path().join("grid.toml");
        let grid_text =
            "spin = { profile = \"ramp\", peak_rpm = 120, ramp_s = 2 }\ntime.end_s = 2\n";
        let source_lookup = |machine_line: &str, set_values: &[&str]| {
            std::fs::write(&grid_path, format!("{machine_line}{grid_text}")).unwrap();
            let set_values: Vec<String> = set_values.iter().copied().map(str::to_owned).collect();
            let plan = crate::config::load(&grid_path, &set_values).unwrap();
            move |name: &str| {
                let rows = list_parameters(Some(&plan));
                rows.iter().find(|row| row.parameter.name == name).unwrap().source.clone()
            }
        };
        let own_machine_source =
            source_lookup("machine = \"own.toml\"\n", &["damper_1_damping_n_s_per_m=140"]);
        let machine_path = folder.path().join("own.toml").display().to_string();
        assert_eq!(own_machine_source("tub_mass_kg"), format!("given: {machine_path}"));
        assert_eq!(own_machine_source("damper_1_damping_n_s_per_m"), "given: --set");
        assert_eq!(
            own_machine_source("damping_n_s_per_m"),
            format!("given: --set, {machine_path}")
        );
        assert_eq!(own_machine_source("spring_1_cubic_n_per_m3"), "assumed: none unless given");
        assert_eq!(own_machine_source("damper_2_friction_n"), format!("given: {machine_path}"));
        // The word "auto" in the file leaves this number to the program.
        let speed_source = own_machine_source("damper_2_friction_linear_speed_m_per_s");
        assert_eq!(speed_source, "assumed: that of the linear motion");
        assert_eq!(own_machine_source("spin_peak_rpm"), "the grid file's [spin]");
        let built_in_source = source_lookup("", &["tub_mass_kg=23.87"]);
        assert_eq!(built_in_source("tub_mass_kg"), "given: --set");
        assert_eq!(built_in_source("shaft_mass_kg"), "paper, Table 2");
    }
}
