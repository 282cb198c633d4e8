//! `sweep modes [GRID.toml]`: natural frequencies over spin speed, resonance speeds, mode shapes.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::str::FromStr;

use washer_model::{ModeAtSpeed, ModeOverSpeed, decimal};

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, show, tell};
use crate::library::modes::{MOST_SPEEDS, analysed, built_in, table, to_json};
use crate::store::StoreError;
use sweep_files::{FileKind, Output};

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
        None => built_in(args.speed.to),
        Some(grid) => {
            let plan = if args.at.is_empty() {
                config::load(grid, &args.sets)?
            } else {
                config::load_point(grid, &args.sets, &args.at)?.0
            };
            (plan.name, plan.machine, plan.spin)
        }
    };
    let output =
        args.out.as_deref().map(|path| Output::begin(path, FileKind::Modes)).transpose()?;
    let speeds = args.speed.values();
    let modes = analysed(&machine, &spin, &speeds)?;
    if let (Some(path), Some(output)) = (&args.out, output) {
        let bytes = table(&name, &machine, &speeds, &modes).into_bytes();
        let bytes = bytes.map_err(StoreError::parquet("write", path))?;
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
    tell(listing(&speeds, &modes).trim_end());
    Ok(Exit::Done)
}

/// What a reader wants of each mode, a line each.
fn listing(speeds: &[f64], modes: &[ModeOverSpeed]) -> String {
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
