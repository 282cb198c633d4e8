//! `sweep modes [GRID.toml]`: natural frequencies over spin speed, resonance speeds, mode shapes.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::str::FromStr;

use lane_ode::Simd;
use parquet::errors::ParquetError;
use serde_json::{Value, json};
use washer_model::{
    COORDINATES, Machine, ModeAtSpeed, ModeOverSpeed, Spin, Timing, campbell, decimal, prepare,
};

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, show, tell};
use crate::store::StoreError;
use crate::table::Table;
use sweep_files::{FileKind, Output, key};

/// Most speeds that are accepted: an hour of computing.
const MOST_SPEEDS: f64 = 100_000.0;

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    ["sweep modes", "resonance speeds of the built-in machine"],
    [
        "sweep modes my.toml --speed 0:400:10 --out modes.parquet",
        "a Campbell diagram's data, for `sweep plot`",
    ],
];

/// Arguments of `sweep modes`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Grid file whose machine is analysed, axes left aside; without it the built-in machine
    #[arg(value_name = "GRID.toml")]
    grid: Option<PathBuf>,
    /// Set a constant, over those of the grid file; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", requires = "grid")]
    sets: Vec<String>,
    /// A point of the grid instead: a value for each axis; may be repeated
    #[arg(long, value_name = "NAME=VALUE", requires = "grid")]
    at: Vec<String>,
    /// Spin speeds, in rpm
    #[arg(long, value_name = "FROM:TO:STEP", default_value = "0:1200:10")]
    speed: Speeds,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
    /// Modes file to write: Parquet, one row per speed and mode
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Even speeds, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Speeds {
    from: f64,
    to: f64,
    step: f64,
}

impl FromStr for Speeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<f64>> =
            text.split(':').map(|part| part.trim().parse().ok()).collect();
        let Some([from, to, step]) = numbers.as_deref() else {
            return Err("expected FROM:TO:STEP in rpm, as in 0:1200:10".to_owned());
        };
        let (from, to, step) = (*from, *to, *step);
        let count = (to - from) / step;
        if !(from >= 0.0 && to > from && step > 0.0 && to.is_finite()) {
            return Err(
                "expected speeds of 0 rpm or more, TO above FROM, and a STEP above 0".to_owned()
            );
        }
        if count > MOST_SPEEDS {
            return Err(format!("these are {count:.0} speeds, expected at most {MOST_SPEEDS}"));
        }
        Ok(Self { from, to, step })
    }
}

impl Speeds {
    /// The speeds (rpm); the last is the end itself.
    fn values(self) -> Vec<f64> {
        // The quotient may come out a hair beside the whole number that was meant.
        let steps = ((self.to - self.from) / self.step * (1.0 - 1e-12)).ceil().max(1.0) as usize;
        (0..=steps)
            .map(|k| if k == steps { self.to } else { self.from + k as f64 * self.step })
            .collect()
    }
}

/// Analyses, and prints or writes.
///
/// # Errors
/// Mistakes in the grid file or the options, a machine without equilibrium or modes, and what
/// cannot be written.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let (name, machine, spin) = match &args.grid {
        None => (
            "paper".to_owned(),
            Machine::paper(),
            Spin::Ramp { peak_rpm: args.speed.to, ramp_s: 1.0 },
        ),
        Some(grid) => {
            let plan = if args.at.is_empty() {
                config::load(grid, &args.sets)?
            } else {
                config::load_point(grid, &args.sets, &args.at)?.0
            };
            (plan.name, plan.machine, plan.spin)
        }
    };
    let timing = Timing { end_s: 1.0, window_s: [0.0, 1.0], checkpoints: 0 };
    let output =
        args.out.as_deref().map(|path| Output::begin(path, FileKind::Modes)).transpose()?;
    let point = prepare(Simd::Scalar, &[(machine.clone(), spin)], &timing).remove(0)?;
    let speeds = args.speed.values();
    let modes = campbell(&point, &speeds)?;
    if let (Some(path), Some(output)) = (&args.out, output) {
        let bytes =
            bytes(&name, &machine, &speeds, &modes).map_err(StoreError::parquet("write", path))?;
        output.finish(&bytes)?;
        tell(&format!(
            "wrote {}: {} modes at {} speeds",
            path.display(),
            modes.len(),
            speeds.len()
        ));
    }
    if args.json {
        return show(&format!("{:#}\n", to_json(&name, &speeds, &modes)));
    }
    tell(table(&speeds, &modes).trim_end());
    Ok(Exit::Done)
}

/// What a reader wants of each mode, a line each.
fn table(speeds: &[f64], modes: &[ModeOverSpeed]) -> String {
    let lowest = decimal(speeds[0]);
    let mut text = format!(
        "mode   resonance   over a turn   damping   frequency   motion\n\
         {:>16}{:>14}{:>10}{:>12}\n",
        "rpm",
        "+- rpm",
        "ratio",
        format!("at {lowest} rpm")
    );
    for (k, mode) in modes.iter().enumerate() {
        let start = mode.at_speed[0].frequency_rpm;
        let mut line = |resonance: String, turn: String, at: &ModeAtSpeed, motion: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{:>4}{resonance:>12}{turn:>14}{:>10.4}{start:>12.2}   {motion}",
                k + 1,
                at.damping_ratio
            );
        };
        if mode.resonances.is_empty() {
            line("none".to_owned(), "-".to_owned(), &mode.at_speed[0], mode.motion.to_string());
        }
        for resonance in &mode.resonances {
            let swing = 0.5 * (resonance.mode.greatest_rpm - resonance.mode.least_rpm);
            let speed = format!("{:.2}", resonance.speed_rpm);
            line(speed, format!("{swing:.3}"), &resonance.mode, mode.motion.to_string());
        }
    }
    if let Some((swing, mode, speed)) = widest_swing(speeds, modes) {
        let (percent, speed) = (100.0 * swing, decimal(speed));
        let _ = writeln!(
            text,
            "Over a turn, resonant modes vary by up to +-{percent:.3} % of their mean frequency \
             (mode {mode}, {speed} rpm)."
        );
    }
    text
}

/// Where the frequency of a mode that has a resonance varies most over a turn: half the distance
/// from least to greatest as a share of the mean, the mode's number, the speed (rpm).
fn widest_swing(speeds: &[f64], modes: &[ModeOverSpeed]) -> Option<(f64, usize, f64)> {
    let resonant = modes.iter().enumerate().filter(|(_, mode)| !mode.resonances.is_empty());
    resonant
        .flat_map(|(k, mode)| {
            mode.at_speed.iter().zip(speeds).map(move |(at, &speed)| {
                (0.5 * (at.greatest_rpm - at.least_rpm) / at.frequency_rpm, k + 1, speed)
            })
        })
        .filter(|(swing, ..)| swing.is_finite())
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

fn to_json(name: &str, speeds: &[f64], modes: &[ModeOverSpeed]) -> Value {
    let modes = modes.iter().enumerate().map(|(k, mode)| {
        let mut facts = facts(k, mode);
        facts["at_speed"] =
            speeds.iter().zip(&mode.at_speed).map(|(&speed, at)| at_speed(speed, at)).collect();
        facts
    });
    json!({ "name": name, "modes": modes.collect::<Value>() })
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

fn bytes(
    name: &str,
    machine: &Machine,
    speeds: &[f64],
    modes: &[ModeOverSpeed],
) -> Result<Vec<u8>, ParquetError> {
    let rows = || (0..speeds.len()).flat_map(|k| (0..modes.len()).map(move |mode| (k, mode)));
    let mut table = Table::default();
    table.numbers("speed_rpm", "rpm", "spin of the shaft", rows().map(|(k, _)| Some(speeds[k])));
    table.counts(
        "mode",
        "number of the mode, by its frequency at the lowest speed",
        rows().map(|(_, mode)| mode as u64 + 1),
    );
    let names: Vec<String> = modes.iter().map(|mode| mode.motion.to_string()).collect();
    table.words(
        "name",
        "what moves, at the first resonance or the lowest speed",
        rows().map(|(_, mode)| names[mode].as_str()),
    );
    let columns: [(&str, &str, &str, fn(&ModeAtSpeed) -> f64); 7] = [
        (
            "frequency_rpm",
            "rpm",
            "damped natural frequency in cycles per minute, mean over a turn",
            |at| at.frequency_rpm,
        ),
        ("frequency_hz", "Hz", "the same in cycles per second", |at| at.frequency_rpm / 60.0),
        ("damping_ratio", "1", "share of critical damping, mean over a turn", |at| {
            at.damping_ratio
        }),
        ("eigenvalue_re", "1/s", "real part of the eigenvalue, mean over a turn", |at| at.re_per_s),
        ("eigenvalue_im", "rad/s", "imaginary part of the eigenvalue, mean over a turn", |at| {
            at.im_rad_per_s
        }),
        ("frequency_min_rpm", "rpm", "least damped natural frequency over a turn", |at| {
            at.least_rpm
        }),
        ("frequency_max_rpm", "rpm", "greatest damped natural frequency over a turn", |at| {
            at.greatest_rpm
        }),
    ];
    for (column, unit, description, of) in columns {
        table.numbers(
            column,
            unit,
            description,
            rows().map(|(k, mode)| Some(of(&modes[mode].at_speed[k]))),
        );
    }
    let plan = json!({ "name": name, "machine": config::machine_json(machine) });
    table.metadata(key::PLAN, &plan);
    let all: Value = modes.iter().enumerate().map(|(k, mode)| facts(k, mode)).collect();
    table.metadata(key::MODES, &all);
    table.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_even_and_end_where_told() {
        let values = |text: &str| text.parse::<Speeds>().map(Speeds::values);
        assert_eq!(values("0:40:10").unwrap(), [0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(values("0:25:10").unwrap(), [0.0, 10.0, 20.0, 25.0]);
        assert_eq!(values("5:6:100").unwrap(), [5.0, 6.0]);
        assert_eq!(values("0:0.3:0.1").unwrap().len(), 4);
        for (text, said) in [
            ("", "FROM:TO:STEP"),
            ("0:1", "FROM:TO:STEP"),
            ("0:x:1", "FROM:TO:STEP"),
            ("10:0:1", "TO above FROM"),
            ("-1:10:1", "0 rpm or more"),
            ("0:10:0", "STEP above 0"),
            ("0:nan:1", "TO above FROM"),
            ("0:inf:1", "TO above FROM"),
            ("0:1e9:1", "at most"),
        ] {
            let refused = values(text).unwrap_err();
            assert!(refused.contains(said), "{text}: {refused}");
        }
    }
}
