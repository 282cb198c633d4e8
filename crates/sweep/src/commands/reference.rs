//! The pages of the guide in `docs/reference/`, which are generated from the program's own tables.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs, iter};

use washer_model::{Channel, Machine, MachineParameter, Profile, Range, Spin, Target};
use washer_row::{Criterion, Measures, Metric, ROW_STATUSES};

use super::command;
use crate::columns::Columns;
use crate::config::machine::with_one_of_each;
use crate::dwell::columns as dwell_columns;
use crate::method::METHODS;
use arrow_schema::Schema;
use sweep_engine::Model as _;
use sweep_engine::columns::into_declarations;
use sweep_engine::store::{CellType, DeclaredColumn, Layout};
use sweep_files::key;

/// Returns the head of a page, with a comment that it is generated.
fn page_head(title: &str) -> String {
    format!("# {title}\n\n<!-- Made by crates/sweep/src/commands/reference.rs. -->\n\n")
}

/// Appends a row of a table. Bars are escaped, because they would end a cell.
fn push_row(text: &mut String, cells: &[&str]) {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

fn parameters_page() -> String {
    let mut text = page_head("Parameters");
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 };
    let all = MachineParameter::all(&with_one_of_each(), &spin);
    // The common source of derived parameters stands once, before the table.
    let derivation = all.iter().find_map(|parameter| parameter.source().strip_prefix("derived: "));
    let derivation = derivation.unwrap_or_default();
    text.push_str(&format!(include_str!("reference/parameters.txt"), how = derivation));
    push_row(&mut text, &["name", "built in", "meaning", "values", "source"]);
    push_row(&mut text, &["---"; 5]);
    let machine = Machine::paper();
    let value_of = |name: &str| {
        let parameter = all.iter().find(|parameter| parameter.name() == name)?;
        let value = parameter.get(&machine, &spin).filter(|_| !name.starts_with("spin_"))?;
        Some(value.to_string())
    };
    for parameter in &all {
        let name = parameter.name();
        let description = parameter.description();
        // A row of three coordinates is that of the first, towards the door.
        let is_other_coordinate =
            ["upwards", "sideways"].iter().any(|way| description.ends_with(way));
        if is_other_coordinate || is_further_part(name) {
            continue;
        }
        let is_from_grid_file = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let missing_text = if is_from_grid_file { "as the grid file says" } else { "none" };
        let has_source = value_of(name).is_some() || is_from_grid_file;
        let source = match parameter.source() {
            _ if !has_source => String::new(),
            source if source.strip_prefix("derived: ") == Some(derivation) => "derived".to_owned(),
            source => source.to_owned(),
        };
        let coordinate = description.strip_suffix("towards the door");
        let axes: &[&str] = if coordinate.is_some() { &["_x", "_y", "_z"] } else { &["_x"] };
        let value = |axis: &&str| {
            value_of(&name.replacen("_x", axis, 1)).unwrap_or_else(|| missing_text.into())
        };
        let mut values: Vec<String> = axes.iter().map(value).collect();
        if values.iter().all(|value| *value == values[0]) {
            values.truncate(1);
        }
        let name = format!("`{name}`{}", if coordinate.is_some() { ", y, z" } else { "" });
        let meaning = coordinate.unwrap_or(description).trim_end_matches([',', ' ']);
        let values = values.join(", ");
        let range = range_text(parameter.range());
        push_row(&mut text, &[&name, &values, meaning, &range, &source]);
    }
    text
}

/// Whether a name belongs to the second or a later one of several parts.
fn is_further_part(name: &str) -> bool {
    ["spring_", "damper_", "stop_", "foot_", "growth_mode_"].into_iter().any(|kind| {
        let number = name.strip_prefix(kind).and_then(|rest| rest.split('_').next());
        number.and_then(|number| number.parse::<usize>().ok()).is_some_and(|number| number > 1)
    })
}

fn range_text(range: Range) -> String {
    match range {
        Range::Any => "any".into(),
        Range::Positive => "above 0".into(),
        Range::NonNegative => "0 and above".into(),
        Range::Negative => "below 0".into(),
        Range::Within(least, greatest) => format!("{least:?} to {greatest:?}"),
    }
}

fn methods_page() -> String {
    let mut text = page_head("Methods of integration");
    text.push_str(
        "The `method` of `[integrator]`, with its keys. [Method and \
         accuracy](../method.md)\nsays which one to take.\n\n",
    );
    push_row(&mut text, &["`method`", "what it does", "key", "meaning", "default", "values"]);
    push_row(&mut text, &["---"; 6]);
    for entry in &METHODS {
        let is_default = entry.name == crate::Washer::ABOUT.default_method().name;
        let name = format!("`{}`{}", entry.name, if is_default { ", the default" } else { "" });
        // Only the first key's row has the name and the description.
        let first_cells =
            [[name.as_str(), entry.description]].into_iter().chain(iter::repeat([""; 2]));
        for ([name, description], setting) in first_cells.zip(entry.settings) {
            let key = format!("`{}`", setting.key);
            let default = format!("{:e}", setting.default);
            let values = range_text(setting.range);
            push_row(&mut text, &[name, description, &key, setting.description, &default, &values]);
        }
    }
    text
}

fn columns_page() -> String {
    let mut text = page_head("Columns of a result file");
    text.push_str(include_str!("reference/columns.txt"));
    let machine = Machine::paper();
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 };
    let axes = MachineParameter::all(&machine, &spin)
        .into_iter()
        .filter(|parameter| ["unbalance_mass_kg", "damping_n_s_per_m"].contains(&parameter.name()))
        .map(|parameter| {
            DeclaredColumn::new(
                parameter.name(),
                parameter.unit(),
                parameter.description(),
                CellType::Axis,
            )
        })
        .collect();
    let metrics = Metric::ALL.to_vec();
    let measures = Measures { metrics, stops: 1, feet: 1, dampers: 1, ..Measures::default() };
    let columns = Columns::for_measures(&Channel::ALL, 2.0.into(), &measures, true);
    let layout = Layout::map(axes, columns.declared());
    list_columns(&mut text, &layout.schema());
    text.push_str("\nChannels:\n\n");
    push_row(&mut text, &["channel", "unit", "what moves"]);
    push_row(&mut text, &["---"; 3]);
    for channel in Channel::ALL {
        push_row(
            &mut text,
            &[&format!("`{}`", channel.name()), channel.unit(), channel.description()],
        );
    }
    text.push_str("\nWhat `criterion` in `[reliability]` makes of a channel's columns:\n\n");
    push_row(&mut text, &["criterion", "`nonlinear_` and `linear_`", "`ratio_`"]);
    push_row(&mut text, &["---"; 3]);
    for criterion in Criterion::ALL {
        let name = format!("`{}`", criterion.name());
        push_row(
            &mut text,
            &[&name, criterion.amplitude_description(), criterion.ratio_description()],
        );
    }
    let join_names = |names: &mut dyn Iterator<Item = &'static str>| {
        names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    };
    text.push_str(&format!(
        include_str!("reference/metrics.txt"),
        metrics = join_names(&mut Metric::ALL.iter().map(|metric| metric.name())),
        statuses = join_names(&mut ROW_STATUSES.into_iter()),
    ));
    let columns =
        into_declarations(dwell_columns::columns(&Channel::ALL, &Measures::default(), false));
    list_columns(&mut text, &Layout::map(Vec::new(), columns).schema());
    text
}

/// Appends a line for each column; those of all channels and models share one.
fn list_columns(text: &mut String, columns: &Schema) {
    let mut names = HashSet::new();
    for field in columns.fields().iter().filter(|field| !is_further_part(field.name())) {
        let name = generic_name(field.name());
        if !names.insert(name.clone()) {
            continue;
        }
        let metadata = |key: &str| field.metadata().get(key).map_or("", String::as_str);
        let unit = match metadata("unit") {
            "1" => "",
            _ if name.ends_with("CHANNEL") => "the channel's unit",
            unit => unit,
        };
        let [worse, limit] = [key::WORSE, key::LIMIT].map(metadata);
        let facts = [("", unit), ("worse: ", worse), ("limit: ", limit)];
        let facts = facts.iter().filter(|(_, fact)| !fact.is_empty());
        let facts: Vec<String> = facts.map(|(label, fact)| format!("{label}{fact}")).collect();
        let facts = match facts.as_slice() {
            [] => String::new(),
            facts => format!(" ({})", facts.join(", ")),
        };
        let description = generic_description(metadata("description"));
        // Writing to a String cannot fail.
        let _ = writeln!(text, "- `{name}`{facts}: {description}");
    }
}

/// Returns a column's name with CHANNEL and MODEL in place of the names of a channel and a model.
fn generic_name(name: &str) -> String {
    let with_channel = Channel::ALL.iter().find_map(|channel| {
        ["nonlinear_", "linear_", "ratio_", "dwell_", "periodic_"].into_iter().find_map(|prefix| {
            (name.strip_prefix(prefix)? == channel.name()).then(|| format!("{prefix}CHANNEL"))
        })
    });
    with_channel
        .unwrap_or_else(|| name.into())
        .replace("nonlinear", "MODEL")
        .replace("linear", "MODEL")
}

/// Returns a column's description without the description of a channel and the name of a model.
fn generic_description(description: &str) -> String {
    let without_channel = Channel::ALL
        .iter()
        .find_map(|channel| description.strip_prefix(channel.description())?.strip_prefix(": "));
    let generic = without_channel.unwrap_or(description).replace(", nonlinear model", "");
    generic.replace("; null if it failed", "")
}

fn commands_page(program: clap::Command) -> String {
    let mut text = page_head("Commands");
    text.push_str("`sweep COMMAND --help` begins with examples of the command.\n\n");
    // The width of a terminal must not show in a file.
    let mut program = program.term_width(100);
    program.build();
    let mut add_part = |title: &str, help: String, more: &str| {
        // The usage names the argument already.
        let help = help.replace("Arguments:\n  <GRID.toml>  Grid file\n\n", "");
        let help: Vec<&str> = help.lines().map(str::trim_end).collect();
        // Writing to a String cannot fail.
        let _ =
            writeln!(text, "## {title}\n\n```text\n{}\n```\n{more}", help.join("\n").trim_end());
    };
    // Examples are for a terminal.
    let program_help = program.clone().before_help(None::<&'static str>).render_help();
    add_part("sweep", program_help.to_string().trim_start().into(), "");
    let shared = shared_options(&program);
    let mut options = clap::Command::new("options").disable_help_flag(true).term_width(100);
    options = options.help_template("{options}").args(shared.clone());
    add_part("Options of several commands", options.render_help().to_string(), "");
    for command in program.get_subcommands().filter(|command| !command.is_hide_set()) {
        let is_shared = |arg: &clap::Arg| shared.iter().any(|option| is_same_option(option, arg));
        let long_options = command
            .get_arguments()
            .filter(|arg| is_shared(arg))
            .filter_map(|arg| arg.get_long().map(|long| format!("`--{long}`")));
        let long_options: Vec<String> = long_options.collect();
        let more = if long_options.is_empty() {
            String::new()
        } else {
            format!("\nAlso {}: [above](#options-of-several-commands).\n", long_options.join(", "))
        };
        let is_hidden = |arg: &clap::Arg| is_shared(arg) || arg.get_long() == Some("help");
        let mut own_help = command.clone().before_help(None::<&'static str>);
        own_help = own_help.mut_args(|arg| if is_hidden(&arg) { arg.hide(true) } else { arg });
        add_part(
            &format!("sweep {}", command.get_name()),
            own_help.render_help().to_string(),
            &more,
        );
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// Whether two arguments are the same option with the same help.
fn is_same_option(a: &clap::Arg, b: &clap::Arg) -> bool {
    let help = |arg: &clap::Arg| arg.get_help().map(ToString::to_string);
    a.get_long().is_some() && a.get_long() == b.get_long() && help(a) == help(b)
}

/// Returns the options that at least three commands have, each once, without `--help`.
fn shared_options(program: &clap::Command) -> Vec<clap::Arg> {
    let visible = || program.get_subcommands().filter(|command| !command.is_hide_set());
    let mut shared: Vec<clap::Arg> = Vec::new();
    for arg in visible().flat_map(clap::Command::get_arguments) {
        let times =
            visible().flat_map(clap::Command::get_arguments).filter(|a| is_same_option(a, arg));
        let is_known = shared.iter().any(|known| is_same_option(known, arg));
        if arg.get_long() != Some("help") && !is_known && times.count() > 2 {
            shared.push(arg.clone());
        }
    }
    shared
}

/// Checks the pages, or writes them if `RENEW` is in the environment.
#[test]
fn the_guide_has_these_pages() {
    let pages = [
        ("parameters", parameters_page()),
        ("methods", methods_page()),
        ("columns", columns_page()),
        ("commands", commands_page(command())),
    ];
    for (page, generated) in pages {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference");
        let path = folder.join(page).with_extension("md");
        if env::var_os("RENEW").is_some() {
            fs::write(path, generated).unwrap();
        } else {
            let is_current = fs::read_to_string(&path).unwrap() == generated;
            assert!(is_current, "{page}.md: RENEW=1 cargo test --release -p sweep --lib reference");
        }
    }
}

#[test]
fn further_springs_and_dampers_are_left_out_and_nothing_else() {
    assert!(
        is_further_part("spring_2_tub_x_m")
            && is_further_part("damper_12_damping_n_s_per_m")
            && is_further_part("foot_3_load_linear_n")
    );
    assert!(!is_further_part("spring_1_tub_x_m") && !is_further_part("spring_stiffness_n_per_m"));
}
