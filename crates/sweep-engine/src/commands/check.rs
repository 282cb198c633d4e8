//! `sweep check GRID.toml`: reports every mistake in a grid file, or else the plan of the run and
//! an estimate of its time.

use std::fmt::Write as _;

use super::run::describe_failures;
use super::{GridArgs, format_number, format_range};
use crate::config::section::format_count;
use crate::design::{Design, Distribution};
use crate::estimate::format_bytes;
use crate::method::Steps;
use crate::store::read::count_failed;
use crate::{Axis, AxisValues, Error, Estimate, Exit, Model, Plan, format_duration, show, threads};
use sweep_parameter::RatioLimits;

/// Arguments of `sweep check`.
#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    /// The grid file.
    #[command(flatten)]
    pub grid: GridArgs,
    /// Print the plan as JSON, with every default and constant in place
    #[arg(long)]
    json: bool,
}

/// Checks a grid and shows its plan.
///
/// # Errors
/// Mistakes in the grid file, no engine for it, or standard output that cannot be written.
pub fn run<M: Model>(args: &CheckArgs) -> Result<Exit, Error> {
    let plan: Plan<M> = args.grid.load()?;
    if args.json {
        return show(&format!("{:#}\n", plan.to_json()));
    }
    let estimate = M::estimate(&plan, threads::choose_count(None, &threads::read_variable)?)?;
    show(&format_summary(&plan, &estimate))?;
    // If every sampled point fails, the run would be of no use.
    Ok(if have_all_points_failed(&estimate) { Exit::Failed } else { Exit::Done })
}

/// Formats the plan and the estimate in a few lines.
fn format_summary<M: Model>(plan: &Plan<M>, estimate: &Estimate) -> String {
    let mut text = String::new();
    let mut add_line = |name: &str, value: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<12}{value}");
    };
    add_line("name", plan.name.clone());
    for (k, axis) in plan.axes.iter().enumerate() {
        add_line(if k == 0 { "axes" } else { "" }, describe_axis(axis, plan.design.as_ref()));
    }
    let points = plan.points();
    let points_text = match &plan.design {
        Some(Design::List { file, .. }) => format!("{points}, as listed in {file}"),
        Some(design) => format!("{points} by {}", design.method()),
        None if plan.axes.is_empty() => "1 (no axes)".to_owned(),
        None => points.to_string(),
    };
    add_line("points", points_text);
    let (end_s, [from_s, to_s]) = (plan.end_s, plan.window_s);
    add_line("time", format!("0 to {end_s} s, window {from_s} to {to_s} s"));
    add_line("method", estimate.method.clone());
    for (name, note) in &estimate.notes {
        add_line(name, note.clone());
    }
    let channel_names: Vec<_> =
        plan.reliability.channels.iter().map(|channel| channel.name).collect();
    add_line("channels", channel_names.join(", "));
    let RatioLimits { upper, lower } = plan.reliability.limits;
    let criterion = estimate.criterion;
    let lower_limit = lower.map_or(String::new(), |lower| format!(" and above {lower}"));
    add_line(
        "verdict",
        format!("reliable where every ratio is below {upper}{lower_limit}{criterion}"),
    );
    add_line("output", format!("results/{}.parquet", plan.name));
    let Estimate { threads, simd, .. } = estimate;
    let threads = format_count(*threads, "thread");
    add_line("runs on", format!("{threads}, instruction set {simd}"));
    let sampled_points =
        format_count(estimate.sample_statuses.values().sum::<u64>() as usize, "point");
    add_line("takes", describe_time(plan, estimate, &sampled_points));
    let [memory_text, disk_text, result_text] =
        [estimate.memory_bytes, estimate.disk_bytes, estimate.result_bytes].map(format_bytes);
    let disk_text =
        format!("on disk {disk_text} while it runs, and at most {result_text} for the result");
    add_line("", format!("{memory_text} of memory; {disk_text}"));
    if let Some(failures) = describe_failures(&estimate.sample_statuses) {
        add_line("failed", format!("{failures}, of {sampled_points} tried"));
    }
    text
}

/// Formats the estimated time and its basis.
fn describe_time<M: Model>(plan: &Plan<M>, estimate: &Estimate, sampled_points: &str) -> String {
    let sampled_time = match estimate.sampled_s {
        whole if whole >= plan.end_s => String::new(),
        sampled_s => {
            let has_fixed_steps = matches!(plan.integrator.steps(), Steps::Fixed(_));
            let step_warning = if has_fixed_steps {
                ""
            } else {
                "; as steps follow the motion, it may be far off"
            };
            format!(", the first {sampled_s} s each{step_warning}")
        }
    };
    if have_all_points_failed(estimate) {
        return format!("not known: none of the {sampled_points} tried could be computed");
    }
    let time_text = format_duration(estimate.wall_s);
    format!(
        "about {time_text}: an estimate, from {sampled_points} integrated just now{sampled_time}"
    )
}

/// Returns whether points were sampled, and every one of them failed.
fn have_all_points_failed(estimate: &Estimate) -> bool {
    let sampled_points = estimate.sample_statuses.values().sum::<u64>();
    sampled_points > 0 && count_failed(&estimate.sample_statuses) == sampled_points
}

fn describe_axis<M: Model>(axis: &Axis<M>, design: Option<&Design>) -> String {
    let name = &axis.parameter.name;
    let count_text = format_count(axis.values.len() as usize, "value");
    let count_prefix = if design.is_some() { String::new() } else { format!("{count_text} ") };
    match &axis.values {
        AxisValues::Linear { from, to, .. } => {
            format!(
                "{name}: {count_prefix}from {}",
                format_range([*from, *to], format_without_rounding_error)
            )
        }
        AxisValues::Log { from, to, .. } => {
            format!(
                "{name}: {count_prefix}from {}, logarithmic",
                format_range([*from, *to], format_without_rounding_error)
            )
        }
        AxisValues::Distributed(Distribution { shape, from, to }) => {
            let shape_numbers = shape
                .numbers()
                .map(|(key, number)| format!("{key} {}", format_without_rounding_error(number)));
            let range = format_range([*from, *to], format_number);
            format!("{name}: {}, {}, from {range}", shape.name(), shape_numbers.join(", "))
        }
        AxisValues::List(values) => {
            let first_values: Vec<_> =
                values.iter().take(8).copied().map(format_without_rounding_error).collect();
            let ellipsis = if values.len() > first_values.len() { ", ..." } else { "" };
            format!("{name}: {count_text}, {}{ellipsis}", first_values.join(", "))
        }
    }
}

/// Formats a number with at most 12 significant digits, which hides the rounding errors of computed
/// ends of a range.
fn format_without_rounding_error(value: f64) -> String {
    format!("{value:.11e}").parse().unwrap_or(value).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_without_rounding_errors() {
        assert_eq!(format_without_rounding_error(0.4 - 0.1), "0.3");
        assert_eq!(format_without_rounding_error(28.0 / 3.0), "9.33333333333");
        assert_eq!(
            [1e9, 60.0, 0.05, -2.5].map(format_without_rounding_error),
            ["1000000000", "60", "0.05", "-2.5"]
        );
    }
}
