//! `sweep modes [GRID.toml]`: natural frequencies over spin speed, resonance speeds, mode shapes.

use std::fmt::Write as _;
use std::path::PathBuf;

use lane_ode::Simd;
use parquet::errors::ParquetError;
use serde_json::{Value, json};
use washer_model::{
    COORDINATES, Exact, Machine, ModeAtSpeed, ModeOverSpeed, Point, Spin, Timing, campbell,
    decimal, exact_motions, prepare,
};

use super::examples::Examples;
use crate::config;
use crate::exit::{Error, Exit, show, tell};
use crate::speeds::Speeds;
use crate::store::StoreError;
use crate::table::Table;
use sweep_files::{FileKind, Output, key};

/// Modes of the suspension, which differ from exact motions most.
const SUSPENSION_MODES: usize = 4;

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
    /// Beside each mode, the exact motion of the turning drum (Floquet exponents of the linear
    /// model): two more columns, and a line on how far the two differ
    #[arg(long)]
    exact: bool,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
    /// Modes file to write: Parquet, one row per speed and mode
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
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
    let exact = if args.exact { Some(exact(&point, &speeds, &modes)?) } else { None };
    if let (Some(path), Some(output)) = (&args.out, output) {
        let bytes = bytes(&name, &machine, &speeds, &modes, exact.as_deref())
            .map_err(StoreError::parquet("write", path))?;
        output.finish(&bytes)?;
        tell(&format!(
            "wrote {}: {} modes at {} speeds",
            path.display(),
            modes.len(),
            speeds.len()
        ));
    }
    if args.json {
        let json = to_json(&name, &speeds, &modes, exact.as_deref());
        return show(&format!("{json:#}\n"));
    }
    let mut text = table(&speeds, &modes);
    if let Some(exact) = &exact {
        text.push_str(&differences(&speeds, &modes, exact));
    }
    tell(text.trim_end());
    Ok(Exit::Done)
}

/// Of each speed and mode the exact motion; none at standstill, where theta is frozen indeed, and
/// where a mode was not found at theta = 0.
type ExactOver = [Vec<Option<Exact>>];

fn exact(
    point: &Point,
    speeds: &[f64],
    modes: &[ModeOverSpeed],
) -> Result<Vec<Vec<Option<Exact>>>, Error> {
    let at = |(k, &speed): (usize, &f64)| -> Result<Vec<Option<Exact>>, Error> {
        if speed == 0.0 {
            return Ok(vec![None; modes.len()]);
        }
        let motions = exact_motions(point, speed)?;
        let of = |mode: &ModeOverSpeed| {
            motions.iter().find(|motion| motion.frozen.shape == mode.at_speed[k].shape).copied()
        };
        Ok(modes.iter().map(of).collect())
    };
    speeds.iter().enumerate().map(at).collect()
}

/// How far frozen and exact motions differ, the suspension's modes.
fn differences(speeds: &[f64], modes: &[ModeOverSpeed], exact: &ExactOver) -> String {
    let mut text =
        "The table freezes theta, as the paper does (Eqs. 43 to 45). Over whole turns the \
                    linear model's motions\nare its Floquet exponents; with these, most:\n"
            .to_owned();
    for mode in 0..modes.len().min(SUSPENSION_MODES) {
        let most = |of: fn(&ModeAtSpeed, &Exact) -> f64| {
            let at = |k: usize| {
                let apart = of(&modes[mode].at_speed[k], exact[k][mode].as_ref()?);
                apart.is_finite().then_some((100.0 * apart, speeds[k]))
            };
            let all = (0..speeds.len()).filter_map(at);
            all.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
        };
        let frequency = most(|frozen, exact| exact.frequency_rpm() / frozen.frequency_rpm - 1.0);
        let damping = most(|frozen, exact| exact.damping_ratio() / frozen.damping_ratio - 1.0);
        if let (Some((frequency, at)), Some((damping, damping_at))) = (frequency, damping) {
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{:>4}  frequency {frequency:+.2} % at {} rpm, damping {damping:+.1} % at {} rpm",
                mode + 1,
                decimal(at),
                decimal(damping_at)
            );
        }
    }
    text
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

fn to_json(
    name: &str,
    speeds: &[f64],
    modes: &[ModeOverSpeed],
    exact: Option<&ExactOver>,
) -> Value {
    let modes = modes.iter().enumerate().map(|(k, mode)| {
        let mut facts = facts(k, mode);
        let at = |(i, at): (usize, &ModeAtSpeed)| {
            let mut at = at_speed(speeds[i], at);
            if let Some(exact) = exact.and_then(|exact| exact[i][k]) {
                at["exact_frequency_rpm"] = exact.frequency_rpm().into();
                at["exact_damping_ratio"] = exact.damping_ratio().into();
            }
            at
        };
        facts["at_speed"] = mode.at_speed.iter().enumerate().map(at).collect();
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
    exact: Option<&ExactOver>,
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
    let columns: [(&str, &str, &str, fn(&Exact) -> f64); 2] = [
        (
            "exact_frequency_rpm",
            "rpm",
            "frequency by the linear model's Floquet exponent over whole turns, nearest to \
             frequency_rpm; null at standstill",
            Exact::frequency_rpm,
        ),
        ("exact_damping_ratio", "1", "share of critical damping by it", Exact::damping_ratio),
    ];
    for (column, unit, description, of) in exact.map_or(&[][..], |_| &columns[..]) {
        let values = rows().map(|(k, mode)| exact?[k][mode].as_ref().map(of));
        table.numbers(column, unit, description, values);
    }
    let plan = json!({ "name": name, "machine": config::machine_json(machine) });
    table.metadata(key::PLAN, &plan);
    let all: Value = modes.iter().enumerate().map(|(k, mode)| facts(k, mode)).collect();
    table.metadata(key::MODES, &all);
    table.into_bytes()
}
