//! The modes of a machine over spin speed, as a table.

use serde_json::{Map, Value, json};
use washer_model::{
    COORDINATES, FloquetMode, Machine, ModeAtSpeed, ModeOverSpeed, Point, Profile, Spin, Timing,
    campbell_until, floquet_modes,
};

use super::check_speeds;
use super::result::MemoryTable;
use crate::config::{self, Diagnostics, WasherGridInput};
use crate::model::Washer;
use crate::plan::{friction_speeds, prepare_point, timing};
use lane_ode::Cancel;
use sweep_engine::{Error, Interrupt, Table};
use sweep_files::{FileKind, key};

/// Computes the modes of a grid's machine at increasing spin speeds (rpm); `None` if it was
/// interrupted. `point_values` has texts `NAME=VALUE` of the point, if the grid has axes. Without a
/// grid the machine is the built-in one.
///
/// # Errors
///
/// Returns an error for mistakes in the grid, for speeds that do not increase, and for a machine
/// without equilibrium or modes.
pub fn find_modes(
    grid: Option<&WasherGridInput>,
    point_values: &[String],
    speeds_rpm: &[f64],
    interrupt: &Interrupt,
) -> Result<Option<MemoryTable>, Error> {
    check_speeds(speeds_rpm, 2, |speed| speed >= 0.0, ", 0 or greater")?;
    let input = ModesInput::new(grid, point_values, speeds_rpm[speeds_rpm.len() - 1])?;
    let analysis = ModeAnalysis::new(&input, speeds_rpm, false, Cancel::Flag(interrupt.flag()))?;
    let table_of_analysis =
        |analysis: ModeAnalysis| MemoryTable::from_table(FileKind::Modes, analysis.table(&input));
    analysis.map(table_of_analysis).transpose()
}

/// A machine whose modes are computed, with its name and the run for which friction is linearised.
pub(crate) struct ModesInput {
    pub(crate) name: String,
    /// The constants that were set and the values of the axes, by name.
    constants: Map<String, Value>,
    machine: Machine,
    spin: Spin,
    timing: Timing,
}

impl ModesInput {
    /// Returns the machine of a grid, at the point of `point_values` if that is not empty; without
    /// a grid the built-in machine in a run-up to a speed (rpm).
    ///
    /// # Errors
    ///
    /// Returns the mistakes in the grid.
    pub(crate) fn new(
        grid: Option<&WasherGridInput>,
        point_values: &[String],
        peak_rpm: f64,
    ) -> Result<Self, Diagnostics> {
        let Some(grid) = grid else {
            return Ok(Self {
                name: "paper".to_owned(),
                constants: Map::new(),
                machine: Machine::paper(),
                spin: Spin::Ramped { profile: Profile::Ramp, peak_rpm, ramp_s: 1.0 },
                timing: Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 },
            });
        };
        let (plan, point_values) = if point_values.is_empty() {
            (grid.load()?, Vec::new())
        } else {
            grid.load_point(point_values)?
        };
        let point_values = point_values.into_iter().map(|(name, value)| (name, value.into()));
        let constants = plan.set.iter().cloned().chain(point_values).collect();
        let timing = timing(&plan);
        let Washer { machine, spin, .. } = plan.model;
        Ok(Self { name: plan.name, constants, machine, spin, timing })
    }
}

/// The modes of a machine at spin speeds.
pub(crate) struct ModeAnalysis {
    pub(crate) speeds_rpm: Vec<f64>,
    pub(crate) modes: Vec<ModeOverSpeed>,
    /// The exact motion of each mode at each speed, if it was requested. There is none at
    /// standstill, where theta is frozen, nor for a mode that was not found at theta = 0.
    pub(crate) exact_modes: Option<Vec<Vec<Option<FloquetMode>>>>,
    /// The speed amplitudes (m/s) at which friction is linearised, by damper.
    pub(crate) friction_speeds: Map<String, Value>,
}

impl ModeAnalysis {
    /// Computes the modes at each speed (rpm) with theta frozen and, if `is_exact`, the Floquet
    /// modes, with the drum turning; `None` after a request to cancel. Friction is linearised at
    /// the speeds of the run.
    ///
    /// # Errors
    /// Returns an error if the machine has no equilibrium, or if its modes cannot be computed.
    pub(crate) fn new(
        input: &ModesInput,
        speeds_rpm: &[f64],
        is_exact: bool,
        cancel: Cancel<'_>,
    ) -> Result<Option<Self>, Error> {
        let point = prepare_point(input.machine.clone(), input.spin.clone(), &input.timing);
        let point = point.map_err(Error::model)?;
        let modes = campbell_until(&point, speeds_rpm, cancel).map_err(Error::model)?;
        let Some(modes) = modes else { return Ok(None) };
        let exact_modes =
            if is_exact { Some(find_exact_modes(&point, speeds_rpm, &modes)?) } else { None };
        let friction_speeds = friction_speeds(&point);
        Ok(Some(Self { speeds_rpm: speeds_rpm.to_vec(), modes, exact_modes, friction_speeds }))
    }

    /// Returns the modes as JSON.
    pub(crate) fn to_json(&self, name: &str) -> Value {
        let modes = self.modes.iter().enumerate().map(|(k, mode)| {
            let mut mode_json = mode_properties(k, mode);
            let speed_json = |(i, mode): (usize, &ModeAtSpeed)| {
                let mut at_speed_json = mode_at_speed_json(self.speeds_rpm[i], mode);
                if let Some(exact) = self.exact_modes.as_ref().and_then(|modes| modes[i][k]) {
                    at_speed_json["exact_frequency_rpm"] = exact.frequency_rpm().into();
                    at_speed_json["exact_damping_ratio"] = exact.damping_ratio().into();
                }
                at_speed_json
            };
            mode_json["at_speed"] =
                mode.modes_at_speeds.iter().enumerate().map(speed_json).collect();
            mode_json
        });
        let mut analysis_json = json!({ "name": name, "modes": modes.collect::<Value>() });
        if !self.friction_speeds.is_empty() {
            analysis_json["friction_speeds_m_per_s"] = self.friction_speeds.clone().into();
        }
        analysis_json
    }

    /// Returns the modes as a table, with the properties of each mode in the metadata.
    pub(crate) fn table(&self, ModesInput { name, constants, machine, .. }: &ModesInput) -> Table {
        let speeds_rpm = &self.speeds_rpm;
        let modes = &self.modes;
        let speed_and_mode_indices =
            || (0..speeds_rpm.len()).flat_map(|k| (0..modes.len()).map(move |mode| (k, mode)));
        let mut table = Table::new(crate::identity::BUILD);
        let speed_values = speed_and_mode_indices().map(|(k, _)| Some(speeds_rpm[k]));
        table.add_numbers("speed_rpm", "rpm", "spin of the shaft", speed_values);
        let description = "number of the mode, by its frequency at the lowest speed";
        table.add_counts(
            "mode",
            description,
            speed_and_mode_indices().map(|(_, mode)| mode as u64 + 1),
        );
        let mode_names: Vec<String> = modes.iter().map(|mode| mode.motion.to_string()).collect();
        let description = "what moves, at the first resonance or the lowest speed";
        table.add_words(
            "name",
            description,
            speed_and_mode_indices().map(|(_, mode)| mode_names[mode].as_str()),
        );
        let mut add_column =
            |name: &str, unit: &str, description: &str, value: fn(&ModeAtSpeed) -> f64| {
                let values = speed_and_mode_indices()
                    .map(|(k, mode)| Some(value(&modes[mode].modes_at_speeds[k])));
                table.add_numbers(name, unit, description, values);
            };
        let description = "damped natural frequency in cycles per minute, mean over a turn";
        add_column("frequency_rpm", "rpm", description, |at| at.frequency_rpm);
        add_column("frequency_hz", "Hz", "the same in cycles per second", |at| {
            at.frequency_rpm / 60.0
        });
        let description = "share of critical damping, mean over a turn";
        add_column("damping_ratio", "1", description, |at| at.damping_ratio);
        let description = "real part of the eigenvalue, mean over a turn";
        add_column("eigenvalue_re", "1/s", description, |at| at.re_per_s);
        let description = "imaginary part of the eigenvalue, mean over a turn";
        add_column("eigenvalue_im", "rad/s", description, |at| at.im_rad_per_s);
        let description = "least damped natural frequency over a turn";
        add_column("frequency_min_rpm", "rpm", description, |at| at.min_frequency_rpm);
        let description = "greatest damped natural frequency over a turn";
        add_column("frequency_max_rpm", "rpm", description, |at| at.max_frequency_rpm);
        if let Some(exact_modes) = &self.exact_modes {
            let mut add_exact_column =
                |name: &str, unit: &str, description: &str, value: fn(&FloquetMode) -> f64| {
                    let values = speed_and_mode_indices()
                        .map(|(k, mode)| exact_modes[k][mode].as_ref().map(value));
                    table.add_numbers(name, unit, description, values);
                };
            let description = "frequency by the linear model's Floquet exponent over whole turns, \
                               nearest to frequency_rpm; null at standstill";
            add_exact_column("exact_frequency_rpm", "rpm", description, FloquetMode::frequency_rpm);
            let description = "share of critical damping by it";
            add_exact_column("exact_damping_ratio", "1", description, FloquetMode::damping_ratio);
        }
        let mut plan = json!({ "name": name, "machine": config::machine_json(machine) });
        if !constants.is_empty() {
            plan["set"] = constants.clone().into();
        }
        table.add_metadata(key::PLAN, &plan);
        let mode_entries: Value =
            modes.iter().enumerate().map(|(k, mode)| mode_properties(k, mode)).collect();
        table.add_metadata(key::MODES, &mode_entries);
        table
    }
}

/// Returns the exact motion of each mode at each speed (rpm).
fn find_exact_modes(
    point: &Point,
    speeds_rpm: &[f64],
    modes: &[ModeOverSpeed],
) -> Result<Vec<Vec<Option<FloquetMode>>>, Error> {
    let exact_modes_at_speed =
        |(k, &speed): (usize, &f64)| -> Result<Vec<Option<FloquetMode>>, Error> {
            if speed == 0.0 {
                return Ok(vec![None; modes.len()]);
            }
            let floquet_modes_at_speed = floquet_modes(point, speed).map_err(Error::model)?;
            let matching_motion = |mode: &ModeOverSpeed| {
                floquet_modes_at_speed
                    .iter()
                    .find(|motion| motion.frozen_mode.shape == mode.modes_at_speeds[k].shape)
                    .copied()
            };
            Ok(modes.iter().map(matching_motion).collect())
        };
    speeds_rpm.iter().enumerate().map(exact_modes_at_speed).collect()
}

/// Returns the name, the participation of motions and the resonances of a mode.
fn mode_properties(k: usize, mode: &ModeOverSpeed) -> Value {
    let resonance_json = |resonance: &washer_model::Resonance| {
        mode_at_speed_json(resonance.speed_rpm, &resonance.mode)
    };
    let motion = &mode.motion;
    json!({
        "mode": k + 1,
        "name": motion.to_string(),
        "participation": {
            "translation_vertical": motion.vertical_translation_share,
            "translation_horizontal": motion.horizontal_translation_share,
            "rocking_horizontal": motion.yaw_share,
            "rocking_vertical": motion.pitch_share,
        },
        "resonances": mode.resonances.iter().map(resonance_json).collect::<Value>(),
    })
}

fn mode_at_speed_json(speed_rpm: f64, mode: &ModeAtSpeed) -> Value {
    let named_coordinates = (0..COORDINATES).map(|i| (format!("q{}", i + 1), json!(mode.shape[i])));
    json!({
        "speed_rpm": speed_rpm,
        "frequency_rpm": mode.frequency_rpm,
        "frequency_min_rpm": mode.min_frequency_rpm,
        "frequency_max_rpm": mode.max_frequency_rpm,
        "damping_ratio": mode.damping_ratio,
        "eigenvalue": [mode.re_per_s, mode.im_rad_per_s],
        "shape": named_coordinates.collect::<serde_json::Map<_, _>>(),
    })
}
