//! The pages of the guide in `docs/reference/`, which are generated from the program's own tables.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs, iter};

use washer_model::{Channel, Machine, MachineParameter, Profile, Range, Spin, Target};
use washer_row::{Criterion, Measures, Metric, ROW_STATUSES};

use super::command_line;
use crate::columns::Columns;
use crate::config::machine::machine_with_every_element;
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
fn push_table_row(text: &mut String, cells: &[&str]) {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

fn parameters_page() -> String {
    let mut text = page_head("Parameters");
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 };
    let all_parameters = MachineParameter::all(&machine_with_every_element(), &spin);
    // The common source of derived parameters stands once, before the table.
    let common_derivation =
        all_parameters.iter().find_map(|parameter| parameter.source().strip_prefix("derived: "));
    let common_derivation = common_derivation.unwrap_or_default();
    text.push_str(&format!(include_str!("reference/parameters.txt"), how = common_derivation));
    push_table_row(&mut text, &["name", "built in", "meaning", "values", "source"]);
    push_table_row(&mut text, &["---"; 5]);
    let machine = Machine::paper();
    let built_in_value = |name: &str| {
        let parameter = all_parameters.iter().find(|parameter| parameter.name() == name)?;
        let value = parameter.get(&machine, &spin).filter(|_| !name.starts_with("spin_"))?;
        Some(value.to_string())
    };
    for parameter in &all_parameters {
        let name = parameter.name();
        let description = parameter.description();
        // A row of three coordinates is that of the first, towards the door.
        let is_other_coordinate =
            ["upwards", "sideways"].iter().any(|way| description.ends_with(way));
        if is_other_coordinate || is_further_part(name) {
            continue;
        }
        let is_from_grid_file = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let text_without_value = if is_from_grid_file { "as the grid file says" } else { "none" };
        let has_source = built_in_value(name).is_some() || is_from_grid_file;
        let source = match parameter.source() {
            _ if !has_source => String::new(),
            source if source.strip_prefix("derived: ") == Some(common_derivation) => {
                "derived".to_owned()
            }
            source => source.to_owned(),
        };
        let coordinate = description.strip_suffix("towards the door");
        let axis_suffixes: &[&str] =
            if coordinate.is_some() { &["_x", "_y", "_z"] } else { &["_x"] };
        let value = |axis: &&str| {
            built_in_value(&name.replacen("_x", axis, 1))
                .unwrap_or_else(|| text_without_value.into())
        };
        let mut value_texts: Vec<String> = axis_suffixes.iter().map(value).collect();
        if value_texts.iter().all(|value| *value == value_texts[0]) {
            value_texts.truncate(1);
        }
        let name = format!("`{name}`{}", if coordinate.is_some() { ", y, z" } else { "" });
        let meaning = coordinate.unwrap_or(description).trim_end_matches([',', ' ']);
        let values = value_texts.join(", ");
        let range = format_range(parameter.range());
        push_table_row(&mut text, &[&name, &values, meaning, &range, &source]);
    }
    text
}

/// Returns whether a name belongs to the second or a later one of several parts.
fn is_further_part(name: &str) -> bool {
    ["spring_", "damper_", "stop_", "foot_", "growth_mode_"].into_iter().any(|kind| {
        let number = name.strip_prefix(kind).and_then(|rest| rest.split('_').next());
        number.and_then(|number| number.parse::<usize>().ok()).is_some_and(|number| number > 1)
    })
}

fn format_range(range: Range) -> String {
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
    push_table_row(&mut text, &["`method`", "what it does", "key", "meaning", "default", "values"]);
    push_table_row(&mut text, &["---"; 6]);
    for entry in &METHODS {
        let is_default = entry.name == crate::Washer::ABOUT.default_method().name;
        let name = format!("`{}`{}", entry.name, if is_default { ", the default" } else { "" });
        // Only the first key's row has the name and the description.
        let first_cells =
            [[name.as_str(), entry.description]].into_iter().chain(iter::repeat([""; 2]));
        for ([name, description], setting) in first_cells.zip(entry.settings) {
            let key = format!("`{}`", setting.key);
            let default = format!("{:e}", setting.default);
            let values = format_range(setting.range);
            push_table_row(
                &mut text,
                &[name, description, &key, setting.description, &default, &values],
            );
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
    append_columns(&mut text, &layout.schema());
    text.push_str("\nChannels:\n\n");
    push_table_row(&mut text, &["channel", "unit", "what moves"]);
    push_table_row(&mut text, &["---"; 3]);
    for channel in Channel::ALL {
        push_table_row(
            &mut text,
            &[&format!("`{}`", channel.name()), channel.unit(), channel.description()],
        );
    }
    text.push_str("\nWhat `criterion` in `[reliability]` makes of a channel's columns:\n\n");
    push_table_row(&mut text, &["criterion", "`nonlinear_` and `linear_`", "`ratio_`"]);
    push_table_row(&mut text, &["---"; 3]);
    for criterion in Criterion::ALL {
        let name = format!("`{}`", criterion.name());
        push_table_row(
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
        into_declarations(dwell_columns::dwell_columns(&Channel::ALL, &Measures::default(), false));
    append_columns(&mut text, &Layout::map(Vec::new(), columns).schema());
    text
}

/// Appends a line for each column; those of all channels and models share one.
fn append_columns(text: &mut String, columns: &Schema) {
    let mut names = HashSet::new();
    for field in columns.fields().iter().filter(|field| !is_further_part(field.name())) {
        let name = generalise_name(field.name());
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
        let labelled_facts = [("", unit), ("worse: ", worse), ("limit: ", limit)];
        let known_facts = labelled_facts.iter().filter(|(_, fact)| !fact.is_empty());
        let fact_texts: Vec<String> =
            known_facts.map(|(label, fact)| format!("{label}{fact}")).collect();
        let facts_text = match fact_texts.as_slice() {
            [] => String::new(),
            facts => format!(" ({})", facts.join(", ")),
        };
        let description = generalise_description(metadata("description"));
        // Writing to a String cannot fail.
        let _ = writeln!(text, "- `{name}`{facts_text}: {description}");
    }
}

/// Returns a column's name with CHANNEL and MODEL in place of the names of a channel and a model.
fn generalise_name(name: &str) -> String {
    let name_with_channel = Channel::ALL.iter().find_map(|channel| {
        ["nonlinear_", "linear_", "ratio_", "dwell_", "periodic_"].into_iter().find_map(|prefix| {
            (name.strip_prefix(prefix)? == channel.name()).then(|| format!("{prefix}CHANNEL"))
        })
    });
    name_with_channel
        .unwrap_or_else(|| name.into())
        .replace("nonlinear", "MODEL")
        .replace("linear", "MODEL")
}

/// Returns a column's description without the description of a channel and the name of a model.
fn generalise_description(description: &str) -> String {
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
    let mut add_section = |title: &str, help: String, further_text: &str| {
        // The usage names the argument already.
        let help = help.replace("Arguments:\n  <GRID.toml>  Grid file\n\n", "");
        let help: Vec<&str> = help.lines().map(str::trim_end).collect();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "## {title}\n\n```text\n{}\n```\n{further_text}",
            help.join("\n").trim_end()
        );
    };
    // Examples are for a terminal.
    let program_help = program.clone().before_help(None::<&'static str>).render_help();
    add_section("sweep", program_help.to_string().trim_start().into(), "");
    let shared = shared_options(&program);
    let mut options_command = clap::Command::new("options").disable_help_flag(true).term_width(100);
    options_command = options_command.help_template("{options}").args(shared.clone());
    add_section("Options of several commands", options_command.render_help().to_string(), "");
    for command in program.get_subcommands().filter(|command| !command.is_hide_set()) {
        let is_shared = |arg: &clap::Arg| shared.iter().any(|option| is_same_option(option, arg));
        let long_options = command
            .get_arguments()
            .filter(|arg| is_shared(arg))
            .filter_map(|arg| arg.get_long().map(|long| format!("`--{long}`")));
        let long_options: Vec<String> = long_options.collect();
        let shared_options_text = if long_options.is_empty() {
            String::new()
        } else {
            format!("\nAlso {}: [above](#options-of-several-commands).\n", long_options.join(", "))
        };
        let is_hidden = |arg: &clap::Arg| is_shared(arg) || arg.get_long() == Some("help");
        let mut own_help = command.clone().before_help(None::<&'static str>);
        own_help = own_help.mut_args(|arg| if is_hidden(&arg) { arg.hide(true) } else { arg });
        add_section(
            &format!("sweep {}", command.get_name()),
            own_help.render_help().to_string(),
            &shared_options_text,
        );
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// Returns whether two arguments are the same option with the same help.
fn is_same_option(a: &clap::Arg, b: &clap::Arg) -> bool {
    let help_text = |arg: &clap::Arg| arg.get_help().map(ToString::to_string);
    a.get_long().is_some() && a.get_long() == b.get_long() && help_text(a) == help_text(b)
}

/// Returns the options that at least three commands have, each once, without `--help`.
fn shared_options(program: &clap::Command) -> Vec<clap::Arg> {
    let visible_commands = || program.get_subcommands().filter(|command| !command.is_hide_set());
    let mut shared: Vec<clap::Arg> = Vec::new();
    for arg in visible_commands().flat_map(clap::Command::get_arguments) {
        let commands_with_option = visible_commands()
            .flat_map(clap::Command::get_arguments)
            .filter(|a| is_same_option(a, arg));
        let is_known = shared.iter().any(|known| is_same_option(known, arg));
        if arg.get_long() != Some("help") && !is_known && commands_with_option.count() > 2 {
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
        ("commands", commands_page(command_line())),
    ];
    for (page, generated_text) in pages {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference");
        let path = folder.join(page).with_extension("md");
        if env::var_os("RENEW").is_some() {
            fs::write(path, generated_text).unwrap();
        } else {
            let is_current = fs::read_to_string(&path).unwrap() == generated_text;
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
