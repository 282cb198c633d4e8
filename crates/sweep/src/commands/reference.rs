//! `sweep reference PAGE`: pages of the guide that are made from the program's own tables, as
//! Markdown.

use std::fmt::Write as _;
use std::iter;

use washer_model::{Channel, Machine, Parameter, Range, Spin, Target};
use washer_row::{Criterion, Measures, Metric, ROW_STATUSES};

use crate::method::Integrator;
use crate::{columns, config};
use sweep_engine::exit::{Error, Exit, print};
use sweep_engine::method::{Integrator as _, default_method};
use sweep_engine::store::{Column, Kind};

/// Arguments of `sweep reference`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Page to print
    page: Page,
}

/// Pages made from tables of the code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Page {
    /// Every parameter that can be set or swept.
    Parameters,
    /// Every method of integration with its settings.
    Methods,
    /// Every column of a result file.
    Columns,
    /// Every command with its options.
    Commands,
}

/// Prints a page.
///
/// # Errors
/// Standard output that cannot be written.
pub(crate) fn run(args: &Args, program: clap::Command) -> Result<Exit, Error> {
    print(&match args.page {
        Page::Parameters => parameters(),
        Page::Methods => methods(),
        Page::Columns => columns(),
        Page::Commands => commands(program),
    })
}

/// The head of a page, which says that it is generated.
fn head(title: &str, page: &str) -> String {
    format!(
        "# {title}\n\n<!-- Made by `sweep reference {page}`; scripts/checks/check_docs.py holds it \
         against the program. -->\n\n"
    )
}

/// A table row; a bar inside a cell would end it.
fn row(text: &mut String, cells: &[&str]) {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

fn parameters() -> String {
    let mut text = head("Parameters", "parameters");
    text.push_str(
        "Every number of the machine and of the spin has one name, the same in `[set]`, in `--set \
         NAME=VALUE` and as the\n\
         `parameter` of an `[[axis]]`. Values are those of the built-in machine. *Paper* means \
         printed there, *derived*\n\
         follows from what is printed, *assumed* is this project's own choice where the paper is \
         silent.\n\
         Springs, dampers, stops, bushings and unbalances are numbered in the order of the machine \
         file; the table shows the first\n\
         of each, and no value where the built-in machine has none. The end of the run\n\
         (`end_s`) and the integrator's settings are no parameters: `[time]` and `[integrator]` \
         set them once, because rows whose\n\
         runs differ in length or method would not compare. The window's edges are.\n\n",
    );
    row(&mut text, &["name", "built in", "unit", "meaning", "values", "source"]);
    row(&mut text, &["---"; 6]);
    let machine = Machine::paper();
    let spin = Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 };
    for parameter in Parameter::all(&config::with_one_of_each(), &spin) {
        let name = parameter.name();
        if is_a_further_one(name) {
            continue;
        }
        let of_spin = name.starts_with("spin_");
        let value = parameter.get(&machine, &spin).filter(|_| !of_spin);
        let of_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let none = if of_grid { "as the grid file says" } else { "none" };
        let value = value.map_or_else(|| none.to_owned(), |value| value.to_string());
        row(
            &mut text,
            &[
                &format!("`{name}`"),
                &value,
                parameter.unit(),
                parameter.description(),
                &allowed(parameter.range()),
                &parameter.source().to_string(),
            ],
        );
    }
    text
}

/// Whether a name is that of the second or a later one of several parts.
fn is_a_further_one(name: &str) -> bool {
    ["spring_", "damper_", "stop_", "foot_"].into_iter().any(|kind| {
        let number = name.strip_prefix(kind).and_then(|rest| rest.split('_').next());
        number.and_then(|number| number.parse::<usize>().ok()).is_some_and(|number| number > 1)
    })
}

fn allowed(range: Range) -> String {
    match range {
        Range::Any => "any".into(),
        Range::Positive => "above 0".into(),
        Range::NonNegative => "0 and above".into(),
        Range::Negative => "below 0".into(),
        Range::Within(least, greatest) => format!("{least:?} to {greatest:?}"),
    }
}

fn methods() -> String {
    let mut text = head("Methods of integration", "methods");
    text.push_str(
        "The `method` of `[integrator]`, with its keys. [Method and \
         accuracy](../method.md)\nsays which one to take.\n\n",
    );
    row(&mut text, &["`method`", "what it does", "key", "meaning", "default", "values"]);
    row(&mut text, &["---"; 6]);
    for entry in Integrator::methods() {
        let is_default = entry.name == default_method::<Integrator>().name;
        let name = format!("`{}`{}", entry.name, if is_default { ", the default" } else { "" });
        // Only the first key's row has the name and the description.
        let heads = [[name.as_str(), entry.description]].into_iter().chain(iter::repeat([""; 2]));
        for ([name, does], setting) in heads.zip(entry.settings) {
            let (key, default) = (format!("`{}`", setting.key), format!("{:e}", setting.default));
            let values = allowed(setting.range);
            row(&mut text, &[name, does, &key, setting.description, &default, &values]);
        }
    }
    text
}

fn columns() -> String {
    let mut text = head("Columns of a result file", "columns");
    text.push_str(
        "One row per grid point, in grid order. Behind `point` stands one column per axis, named \
         as its\n\
         parameter (here the two axes of `sweeps/fig12.toml`); the channels are those of \
         `[reliability]`,\n\
         here all that exist. Each column's unit and description also stand in the file: in the \
         Arrow field\n\
         metadata (`unit`, `description`), and as JSON under the key `sweep.columns` of the \
         file's key-value\n\
         metadata. There stand too `sweep.plan` (the grid as run with the full machine), \
         `sweep.plan_hash`,\n\
         `sweep.version` and `sweep.numerics` (together they say which build made it), and last\n\
         `sweep.digest`, by which every command that reads the file knows that no bit of it has \
         changed.\n\n",
    );
    let (machine, spin) = (Machine::paper(), Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 });
    let axes = Parameter::all(&machine, &spin)
        .into_iter()
        .filter(|parameter| ["unbalance_mass_kg", "damping_n_s_per_m"].contains(&parameter.name()))
        .map(|parameter| {
            Column::new(parameter.name(), parameter.unit(), parameter.description(), Kind::Axis)
        })
        .collect();
    let metrics = Metric::ALL.to_vec();
    let measures = Measures { metrics, stops: 2, feet: 3, ..Measures::default() };
    let layout = columns::of_measures(axes, &Channel::ALL, 2.0, measures);
    row(&mut text, &["column", "type", "unit", "null", "meaning"]);
    row(&mut text, &["---"; 5]);
    for field in layout.schema().fields().iter().filter(|field| !is_a_further_one(field.name())) {
        let told = |key: &str| field.metadata().get(key).map_or("", String::as_str);
        let data_type = match field.data_type() {
            arrow_schema::DataType::Dictionary(..) => "text".to_owned(),
            plain => plain.to_string().to_lowercase(),
        };
        let null = if field.is_nullable() { "may be" } else { "never" };
        row(
            &mut text,
            &[&format!("`{}`", field.name()), &data_type, told("unit"), null, told("description")],
        );
    }
    text.push_str("\nWhat `criterion` in `[reliability]` makes of a channel's columns:\n\n");
    row(&mut text, &["criterion", "`nonlinear_` and `linear_`", "`ratio_`"]);
    row(&mut text, &["---"; 3]);
    for criterion in Criterion::ALL {
        row(
            &mut text,
            &[&format!("`{}`", criterion.name()), criterion.amplitude(), criterion.ratio()],
        );
    }
    let metrics: Vec<String> =
        Metric::ALL.iter().map(|metric| format!("`{}`", metric.name())).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "\nThe columns of a metric ({}) are there only where the grid file's `metrics` names it, \
         in its order. Machines with two stops or more have those of `stop_1` for each of them \
         (`stop_2_force_nonlinear_n`), and so have feet.",
        metrics.join(", ")
    );
    let statuses: Vec<String> = ROW_STATUSES.iter().map(|status| format!("`{status}`")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "\nValues of `status`: {}.", statuses.join(", "));
    text
}

fn commands(program: clap::Command) -> String {
    let mut text = head("Commands", "commands");
    // The width of a terminal must not show in a file.
    let mut program = program.term_width(100);
    program.build();
    let mut part = |title: &str, help: String| {
        let help: Vec<&str> = help.lines().map(str::trim_end).collect();
        // Writing to a String cannot fail.
        let _ = writeln!(text, "## {title}\n\n```text\n{}\n```\n", help.join("\n").trim());
    };
    part("sweep", program.clone().render_help().to_string());
    for command in program.get_subcommands_mut().filter(|command| !command.is_hide_set()) {
        part(&format!("sweep {}", command.get_name()), command.render_help().to_string());
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::command;

    #[test]
    fn further_springs_and_dampers_are_left_out_and_nothing_else() {
        assert!(
            is_a_further_one("spring_2_tub_x_m")
                && is_a_further_one("damper_12_damping_n_s_per_m")
                && is_a_further_one("foot_3_load_linear_n")
        );
        assert!(
            !is_a_further_one("spring_1_tub_x_m") && !is_a_further_one("spring_stiffness_n_per_m")
        );
    }

    #[test]
    fn pages_hold_what_the_tables_hold() {
        let page = parameters();
        for name in ["tub_mass_kg", "spring_1_free_length_m", "spin_peak_rpm"] {
            assert!(page.contains(&format!("| `{name}` |")), "{name}");
        }
        for entry in Integrator::methods() {
            assert!(methods().contains(&format!("| `{}`", entry.name)), "{}", entry.name);
        }
        assert!(columns().contains("| `ratio_max_channel` | text |"));
        let page = commands(command());
        assert!(page.contains("## sweep run\n") && page.contains("--fail-on-error"));
        assert!(!page.contains("sweep reference PAGE"), "hidden commands stay hidden");
    }
}
