//! `sweep modes [GRID.toml]` prints natural frequencies over spin speed, resonance speeds and mode
//! shapes.

use std::fmt::Write as _;
use std::path::PathBuf;

use lane_ode::Cancel;
use washer_model::{FloquetMode, ModeAtSpeed, ModeOverSpeed, decimal};

use crate::config::WasherGridInput;
use crate::library::modes::{ModeAnalysis, ModesInput};
use crate::speeds::Speeds;
use sweep_engine::{Error, Exit, show, tell};
use sweep_files::{FileKind, Output};

/// Number of modes that are compared with exact motions. Basis: the slowest four are modes of the
/// suspension, which differ most. Doubling it adds lines of modes that hardly differ.
const COMPARED_MODES: usize = 4;

/// Arguments of `sweep modes`.
#[derive(Debug, clap::Args)]
pub struct ModesArgs {
    /// Grid file whose machine is analysed, without its axes [default: the built-in machine]
    #[arg(value_name = "GRID.toml")]
    grid: Option<PathBuf>,
    /// Set a constant, in place of the grid file's value, or fix an axis at a value; may be
    /// repeated
    #[arg(long = "set", value_name = "NAME=VALUE", requires = "grid")]
    sets: Vec<String>,
    /// Analyse a point of the grid: give a value for each axis; may be repeated
    #[arg(long, value_name = "NAME=VALUE", requires = "grid")]
    at: Vec<String>,
    /// Spin speeds, in rpm
    #[arg(long, value_name = "FROM:TO:STEP", default_value = "0:1200:10")]
    speed: Speeds,
    /// Add the exact motion of the turning drum to each mode (Floquet exponents of the linear
    /// model): two more columns, and a line on the difference
    #[arg(long)]
    exact: bool,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
    /// Modes file to write: Parquet, one row per speed and mode
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Computes the modes, and prints them or writes them to a file.
///
/// # Errors
/// Returns an error for mistakes in the grid file or the options, for a machine without equilibrium
/// or modes, and if output cannot be written.
pub(crate) fn run(args: &ModesArgs) -> Result<Exit, Error> {
    let grid = args.grid.clone().map(|grid| WasherGridInput::file(grid, args.sets.clone()));
    let input = ModesInput::new(grid.as_ref(), &args.at, args.speed.to_rpm)?;
    let output =
        args.out.as_deref().map(|path| Output::begin(path, FileKind::Modes)).transpose()?;
    let speeds_rpm = args.speed.values();
    // A signal ends the process, because there are no partial results to keep.
    let analysis = ModeAnalysis::new(&input, &speeds_rpm, args.exact, Cancel::Never)?;
    let Some(analysis) = analysis else { return Ok(Exit::Interrupted) };
    if let (Some(path), Some(output)) = (&args.out, output) {
        output.finish(&analysis.table(&input).into_bytes(path)?)?;
        let mode_count = analysis.modes.len();
        tell(&format!(
            "wrote {}: {mode_count} modes at {} speeds",
            path.display(),
            speeds_rpm.len()
        ));
    }
    if args.json {
        return show(&format!("{:#}\n", analysis.to_json(&input.name)));
    }
    let mut text = format_mode_table(&speeds_rpm, &analysis.modes);
    text.push_str(&describe_differences(&analysis));
    if !analysis.friction_speeds.is_empty() {
        let damper_texts = analysis.friction_speeds.iter().map(|(damper, speed)| {
            let speed = speed.as_f64().unwrap_or_default();
            format!("{} at {speed:.3} m/s", damper.replace('_', " "))
        });
        let damper_list: Vec<String> = damper_texts.collect();
        text.push_str(&format!("friction is taken as in the run: {}\n", damper_list.join(", ")));
    }
    show(&text)
}

/// Returns lines on the differences between the suspension's modes at a frozen angle of the drum
/// and its exact motions. They are empty without exact motions.
fn describe_differences(analysis: &ModeAnalysis) -> String {
    let Some(exact_modes) = &analysis.exact_modes else { return String::new() };
    let speeds_rpm = &analysis.speeds_rpm;
    let modes = &analysis.modes;
    let mut text =
        "The table freezes theta, as the paper does (Eqs. 43 to 45). Over whole turns the \
                    linear model's motions\nare its Floquet exponents; with these, most:\n"
            .to_owned();
    for mode in 0..modes.len().min(COMPARED_MODES) {
        // The greatest difference (%) over all speeds, with its speed.
        let greatest_difference = |relative_difference: fn(&ModeAtSpeed, &FloquetMode) -> f64| {
            let difference_at_speed = |k: usize| {
                let difference = relative_difference(
                    &modes[mode].modes_at_speeds[k],
                    exact_modes[k][mode].as_ref()?,
                );
                difference.is_finite().then_some((100.0 * difference, speeds_rpm[k]))
            };
            let differences = (0..speeds_rpm.len()).filter_map(difference_at_speed);
            differences.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
        };
        let frequency_difference =
            greatest_difference(|frozen, exact| exact.frequency_rpm() / frozen.frequency_rpm - 1.0);
        let damping_difference =
            greatest_difference(|frozen, exact| exact.damping_ratio() / frozen.damping_ratio - 1.0);
        if let (Some((frequency, frequency_rpm)), Some((damping, damping_rpm))) =
            (frequency_difference, damping_difference)
        {
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{:>4}  frequency {frequency:+.2} % at {} rpm, damping {damping:+.1} % at {} rpm",
                mode + 1,
                decimal(frequency_rpm),
                decimal(damping_rpm)
            );
        }
    }
    text
}

/// Returns the printed table of modes: a line for each resonance of a mode, and one for a mode
/// without any.
fn format_mode_table(speeds_rpm: &[f64], modes: &[ModeOverSpeed]) -> String {
    let lowest_speed_heading = format!("at {} rpm", decimal(speeds_rpm[0]));
    let mut text = format!(
        "mode   resonance   over a turn   damping   frequency   motion\n             \
         rpm        +- rpm     ratio{lowest_speed_heading:>12}\n"
    );
    for (k, mode) in modes.iter().enumerate() {
        let first_frequency_rpm = mode.modes_at_speeds[0].frequency_rpm;
        let resonance_rows = mode.resonances.iter().map(|resonance| {
            let half_variation_rpm =
                0.5 * (resonance.mode.max_frequency_rpm - resonance.mode.min_frequency_rpm);
            (
                format!("{:.2}", resonance.speed_rpm),
                format!("{half_variation_rpm:.3}"),
                &resonance.mode,
            )
        });
        let row_without_resonance = ("none".to_owned(), "-".to_owned(), &mode.modes_at_speeds[0]);
        let row_without_resonance =
            Some(row_without_resonance).filter(|_| mode.resonances.is_empty());
        for (resonance, swing, mode_at_speed) in
            row_without_resonance.into_iter().chain(resonance_rows)
        {
            let mode_number = k + 1;
            let damping = mode_at_speed.damping_ratio;
            let motion = mode.motion.to_string();
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{mode_number:>4}{resonance:>12}{swing:>14}{damping:>10.4}\
                 {first_frequency_rpm:>12.2}   {motion}"
            );
        }
    }
    if let Some((variation, mode, speed)) = find_greatest_variation(speeds_rpm, modes) {
        let percent = 100.0 * variation;
        let _ = writeln!(
            text,
            "Over a turn, resonant modes vary by up to +-{percent:.3} % of their mean frequency \
             (mode {mode}, {} rpm).",
            decimal(speed)
        );
    }
    text
}

/// Returns the greatest variation of a resonant mode's frequency over a turn (half the distance
/// from least to greatest as a share of the mean), the mode's number, and the speed (rpm).
fn find_greatest_variation(
    speeds_rpm: &[f64],
    modes: &[ModeOverSpeed],
) -> Option<(f64, usize, f64)> {
    let resonant_modes = modes.iter().enumerate().filter(|(_, mode)| !mode.resonances.is_empty());
    resonant_modes
        .flat_map(|(k, mode)| {
            mode.modes_at_speeds.iter().zip(speeds_rpm).map(move |(at, &speed)| {
                (
                    0.5 * (at.max_frequency_rpm - at.min_frequency_rpm) / at.frequency_rpm,
                    k + 1,
                    speed,
                )
            })
        })
        .filter(|(variation, ..)| variation.is_finite())
        .max_by(|a, b| a.0.total_cmp(&b.0))
}
