//! The modes of a machine over spin speed, as a table.

use serde_json::{Map, Value, json};
use washer_model::{
    COORDINATES, Exact, Machine, ModeAtSpeed, ModeOverSpeed, Point, Profile, Spin, StopRequest,
    Timing, campbell_until, exact_motions,
};

use super::check_speeds;
use super::result::MemoryTable;
use crate::config::{self, Diagnostics, GridInput};
use crate::model::Washer;
use crate::plan::{friction_speeds, ready, timing};
use sweep_engine::{Error, Interrupt, Table};
use sweep_files::{FileKind, key};

/// The modes of a grid's machine at spin speeds (rpm, rising); `at` gives axes a value, which have
/// none otherwise. Without a grid, those of the built-in machine. `None` if it was interrupted.
///
/// # Errors
/// Mistakes in the grid, speeds that do not rise, a machine without equilibrium or modes.
pub fn find_modes(
    grid: Option<&GridInput>,
    at: &[String],
    speeds_rpm: &[f64],
    interrupt: &Interrupt,
) -> Result<Option<MemoryTable>, Error> {
    check_speeds(speeds_rpm, 2, |speed| speed >= 0.0, ", 0 or greater")?;
    let asked = Asked::of(grid, at, speeds_rpm[speeds_rpm.len() - 1])?;
    let analysis = Analysis::new(&asked, speeds_rpm, false, &|| interrupt.stopped())?;
    let table = |analysis: Analysis| MemoryTable::of_table(FileKind::Modes, analysis.table(&asked));
    analysis.map(table).transpose()
}

/// A machine whose modes are asked for, by its name, and the run that it is in.
pub(crate) struct Asked {
    pub(crate) name: String,
    /// Constants that were set, and the point, by name.
    set: Map<String, Value>,
    machine: Machine,
    spin: Spin,
    timing: Timing,
}

impl Asked {
    /// The machine of a grid, at a point of it if `at` names one; without a grid the built-in
    /// machine, on its way to a speed (rpm).
    ///
    /// # Errors
    /// Mistakes in the grid.
    pub(crate) fn of(
        grid: Option<&GridInput>,
        at: &[String],
        greatest_rpm: f64,
    ) -> Result<Self, Diagnostics> {
        let Some(grid) = grid else {
            return Ok(Self {
                name: "paper".to_owned(),
                set: Map::new(),
                machine: Machine::paper(),
                spin: Spin::Ramped { profile: Profile::Ramp, peak_rpm: greatest_rpm, ramp_s: 1.0 },
                timing: Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 },
            });
        };
        let (plan, at) =
            if at.is_empty() { (grid.load()?, Vec::new()) } else { grid.load_point(at)? };
        let at = at.into_iter().map(|(name, value)| (name, value.into()));
        let set = plan.set.iter().cloned().chain(at).collect();
        let (timing, Washer { machine, spin, .. }) = (timing(&plan), plan.model);
        Ok(Self { name: plan.name, set, machine, spin, timing })
    }
}

/// The modes of a machine at spin speeds.
pub(crate) struct Analysis {
    pub(crate) speeds_rpm: Vec<f64>,
    pub(crate) modes: Vec<ModeOverSpeed>,
    /// The exact motion of each mode at each speed, if it was asked for. There is none at
    /// standstill, where theta is frozen, and where a mode was not found at theta = 0.
    pub(crate) exact: Option<Vec<Vec<Option<Exact>>>>,
    /// At which speeds (m/s) friction is taken, by damper.
    pub(crate) friction_speeds: Map<String, Value>,
}

impl Analysis {
    /// The modes at each speed (rpm), with exact motions if wanted; `None` once `stop` says so.
    /// Friction is taken at the speeds that it has in the run.
    ///
    /// # Errors
    /// A machine without equilibrium, or whose modes cannot be computed.
    pub(crate) fn new(
        asked: &Asked,
        speeds_rpm: &[f64],
        is_exact: bool,
        stop: StopRequest<'_>,
    ) -> Result<Option<Self>, Error> {
        let point = ready(asked.machine.clone(), asked.spin.clone(), &asked.timing);
        let point = point.map_err(Error::model)?;
        let modes = campbell_until(&point, speeds_rpm, stop).map_err(Error::model)?;
        let Some(modes) = modes else { return Ok(None) };
        let exact = if is_exact { Some(exact_over(&point, speeds_rpm, &modes)?) } else { None };
        let friction_speeds = friction_speeds(&point);
        Ok(Some(Self { speeds_rpm: speeds_rpm.to_vec(), modes, exact, friction_speeds }))
    }

    /// The modes as JSON.
    pub(crate) fn to_json(&self, name: &str) -> Value {
        let modes = self.modes.iter().enumerate().map(|(k, mode)| {
            let mut facts = facts(k, mode);
            let at = |(i, at): (usize, &ModeAtSpeed)| {
                let mut at = at_speed(self.speeds_rpm[i], at);
                if let Some(exact) = self.exact.as_ref().and_then(|exact| exact[i][k]) {
                    at["exact_frequency_rpm"] = exact.frequency_rpm().into();
                    at["exact_damping_ratio"] = exact.damping_ratio().into();
                }
                at
            };
            facts["at_speed"] = mode.at_speed.iter().enumerate().map(at).collect();
            facts
        });
        let mut found = json!({ "name": name, "modes": modes.collect::<Value>() });
        if !self.friction_speeds.is_empty() {
            found["friction_speeds_m_per_s"] = self.friction_speeds.clone().into();
        }
        found
    }

    /// The modes as columns, with what is known of each in the metadata.
    pub(crate) fn table(&self, Asked { name, set, machine, .. }: &Asked) -> Table {
        let (speeds, modes) = (&self.speeds_rpm, &self.modes);
        let rows = || (0..speeds.len()).flat_map(|k| (0..modes.len()).map(move |mode| (k, mode)));
        let mut table = Table::new(crate::identity::BUILD);
        let speed = rows().map(|(k, _)| Some(speeds[k]));
        table.numbers("speed_rpm", "rpm", "spin of the shaft", speed);
        let said = "number of the mode, by its frequency at the lowest speed";
        table.counts("mode", said, rows().map(|(_, mode)| mode as u64 + 1));
        let names: Vec<String> = modes.iter().map(|mode| mode.motion.to_string()).collect();
        let said = "what moves, at the first resonance or the lowest speed";
        table.words("name", said, rows().map(|(_, mode)| names[mode].as_str()));
        let mut add = |name: &str, unit: &str, said: &str, of: fn(&ModeAtSpeed) -> f64| {
            let values = rows().map(|(k, mode)| Some(of(&modes[mode].at_speed[k])));
            table.numbers(name, unit, said, values);
        };
        let said = "damped natural frequency in cycles per minute, mean over a turn";
        add("frequency_rpm", "rpm", said, |at| at.frequency_rpm);
        add("frequency_hz", "Hz", "the same in cycles per second", |at| at.frequency_rpm / 60.0);
        let said = "share of critical damping, mean over a turn";
        add("damping_ratio", "1", said, |at| at.damping_ratio);
        let said = "real part of the eigenvalue, mean over a turn";
        add("eigenvalue_re", "1/s", said, |at| at.re_per_s);
        let said = "imaginary part of the eigenvalue, mean over a turn";
        add("eigenvalue_im", "rad/s", said, |at| at.im_rad_per_s);
        let said = "least damped natural frequency over a turn";
        add("frequency_min_rpm", "rpm", said, |at| at.least_rpm);
        let said = "greatest damped natural frequency over a turn";
        add("frequency_max_rpm", "rpm", said, |at| at.greatest_rpm);
        if let Some(exact) = &self.exact {
            let mut add = |name: &str, unit: &str, said: &str, of: fn(&Exact) -> f64| {
                let values = rows().map(|(k, mode)| exact[k][mode].as_ref().map(of));
                table.numbers(name, unit, said, values);
            };
            let said = "frequency by the linear model's Floquet exponent over whole turns, nearest \
                        to frequency_rpm; null at standstill";
            add("exact_frequency_rpm", "rpm", said, Exact::frequency_rpm);
            let said = "share of critical damping by it";
            add("exact_damping_ratio", "1", said, Exact::damping_ratio);
        }
        let mut plan = json!({ "name": name, "machine": config::machine_json(machine) });
        if !set.is_empty() {
            plan["set"] = set.clone().into();
        }
        table.metadata(key::PLAN, &plan);
        let all: Value = modes.iter().enumerate().map(|(k, mode)| facts(k, mode)).collect();
        table.metadata(key::MODES, &all);
        table
    }
}

/// The exact motions beside modes.
fn exact_over(
    point: &Point,
    speeds_rpm: &[f64],
    modes: &[ModeOverSpeed],
) -> Result<Vec<Vec<Option<Exact>>>, Error> {
    let at = |(k, &speed): (usize, &f64)| -> Result<Vec<Option<Exact>>, Error> {
        if speed == 0.0 {
            return Ok(vec![None; modes.len()]);
        }
        let motions = exact_motions(point, speed).map_err(Error::model)?;
        let of = |mode: &ModeOverSpeed| {
            motions.iter().find(|motion| motion.frozen.shape == mode.at_speed[k].shape).copied()
        };
        Ok(modes.iter().map(of).collect())
    };
    speeds_rpm.iter().enumerate().map(at).collect()
}

/// A mode's name, what it moves, its resonances.
fn facts(k: usize, mode: &ModeOverSpeed) -> Value {
    let resonance =
        |resonance: &washer_model::Resonance| at_speed(resonance.speed_rpm, &resonance.mode);
    let motion = &mode.motion;
    json!({
        "mode": k + 1,
        "name": motion.to_string(),
        "participation": {
            "translation_vertical": motion.vertical_translation,
            "translation_horizontal": motion.horizontal_translation,
            "rocking_horizontal": motion.yaw,
            "rocking_vertical": motion.pitch,
        },
        "resonances": mode.resonances.iter().map(resonance).collect::<Value>(),
    })
}

fn at_speed(speed_rpm: f64, at: &ModeAtSpeed) -> Value {
    let coordinates = (0..COORDINATES).map(|i| (format!("q{}", i + 1), json!(at.shape[i])));
    json!({
        "speed_rpm": speed_rpm,
        "frequency_rpm": at.frequency_rpm,
        "frequency_min_rpm": at.least_rpm,
        "frequency_max_rpm": at.greatest_rpm,
        "damping_ratio": at.damping_ratio,
        "eigenvalue": [at.re_per_s, at.im_rad_per_s],
        "shape": coordinates.collect::<serde_json::Map<_, _>>(),
    })
}
