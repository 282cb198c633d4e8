//! Pages of the guide that are made from the program's own tables: `docs/reference/` holds what
//! stands here.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs, iter};

use washer_model::{Channel, Machine, Parameter, Profile, Range, Spin, Target};
use washer_row::{Criterion, Measures, Metric, ROW_STATUSES};

use super::command;
use crate::columns::Columns;
use crate::config::machine::with_one_of_each;
use crate::dwell::columns as of_dwells;
use crate::method::METHODS;
use arrow_schema::Schema;
use sweep_engine::Model as _;
use sweep_engine::columns::declared;
use sweep_engine::store::{Column, Holds, Layout};
use sweep_files::key;

/// The head of a page, which says that it is generated.
fn head(title: &str) -> String {
    format!("# {title}\n\n<!-- Made by crates/sweep/src/commands/reference.rs. -->\n\n")
}

/// A table row; a bar inside a cell would end it.
fn row(text: &mut String, cells: &[&str]) {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    // Writing to a String cannot fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

fn parameters() -> String {
    let mut text = head("Parameters");
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 };
    let all = Parameter::all(&with_one_of_each(), &spin);
    // Told once, before the table.
    let how = all.iter().find_map(|parameter| parameter.source().strip_prefix("derived: "));
    let how = how.unwrap_or_default();
    text.push_str(&format!(include_str!("reference/parameters.txt"), how = how));
    row(&mut text, &["name", "built in", "meaning", "values", "source"]);
    row(&mut text, &["---"; 5]);
    let machine = Machine::paper();
    let value_of = |name: &str| {
        let parameter = all.iter().find(|parameter| parameter.name() == name)?;
        let value = parameter.get(&machine, &spin).filter(|_| !name.starts_with("spin_"))?;
        Some(value.to_string())
    };
    for parameter in &all {
        let (name, description) = (parameter.name(), parameter.description());
        let is_told = ["upwards", "sideways"].iter().any(|way| description.ends_with(way));
        if is_told || is_a_further_one(name) {
            continue;
        }
        let of_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let none = if of_grid { "as the grid file says" } else { "none" };
        let has_source = value_of(name).is_some() || of_grid;
        let source = match parameter.source() {
            _ if !has_source => String::new(),
            source if source.strip_prefix("derived: ") == Some(how) => "derived".to_owned(),
            source => source.to_owned(),
        };
        // The first of three coordinates tells of all.
        let of_three = description.strip_suffix("towards the door");
        let axes: &[&str] = if of_three.is_some() { &["_x", "_y", "_z"] } else { &["_x"] };
        let value =
            |axis: &&str| value_of(&name.replacen("_x", axis, 1)).unwrap_or_else(|| none.into());
        let mut values: Vec<String> = axes.iter().map(value).collect();
        if values.iter().all(|value| *value == values[0]) {
            values.truncate(1);
        }
        let name = format!("`{name}`{}", if of_three.is_some() { ", y, z" } else { "" });
        let meaning = of_three.unwrap_or(description).trim_end_matches([',', ' ']);
        let (values, range) = (values.join(", "), allowed(parameter.range()));
        row(&mut text, &[&name, &values, meaning, &range, &source]);
    }
    text
}

/// Whether a name is that of the second or a later one of several parts.
fn is_a_further_one(name: &str) -> bool {
    ["spring_", "damper_", "stop_", "foot_", "growth_mode_"].into_iter().any(|kind| {
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
    let mut text = head("Methods of integration");
    text.push_str(
        "The `method` of `[integrator]`, with its keys. [Method and \
         accuracy](../method.md)\nsays which one to take.\n\n",
    );
    row(&mut text, &["`method`", "what it does", "key", "meaning", "default", "values"]);
    row(&mut text, &["---"; 6]);
    for entry in &METHODS {
        let is_default = entry.name == crate::Washer::ABOUT.default_method().name;
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
    let mut text = head("Columns of a result file");
    text.push_str(include_str!("reference/columns.txt"));
    let (machine, spin) = (
        Machine::paper(),
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 },
    );
    let axes = Parameter::all(&machine, &spin)
        .into_iter()
        .filter(|parameter| ["unbalance_mass_kg", "damping_n_s_per_m"].contains(&parameter.name()))
        .map(|parameter| {
            Column::new(parameter.name(), parameter.unit(), parameter.description(), Holds::Axis)
        })
        .collect();
    let metrics = Metric::ALL.to_vec();
    let measures = Measures { metrics, stops: 1, feet: 1, dampers: 1, ..Measures::default() };
    let columns = Columns::of_measures(&Channel::ALL, 2.0.into(), &measures, true);
    let layout = Layout::of_map(axes, columns.declared());
    list(&mut text, &layout.schema());
    text.push_str("\nChannels:\n\n");
    row(&mut text, &["channel", "unit", "what moves"]);
    row(&mut text, &["---"; 3]);
    for channel in Channel::ALL {
        row(&mut text, &[&format!("`{}`", channel.name()), channel.unit(), channel.description()]);
    }
    text.push_str("\nWhat `criterion` in `[reliability]` makes of a channel's columns:\n\n");
    row(&mut text, &["criterion", "`nonlinear_` and `linear_`", "`ratio_`"]);
    row(&mut text, &["---"; 3]);
    for criterion in Criterion::ALL {
        let name = format!("`{}`", criterion.name());
        row(&mut text, &[&name, criterion.amplitude(), criterion.ratio()]);
    }
    let listed = |names: &mut dyn Iterator<Item = &'static str>| {
        names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    };
    text.push_str(&format!(
        include_str!("reference/metrics.txt"),
        metrics = listed(&mut Metric::ALL.iter().map(|metric| metric.name())),
        statuses = listed(&mut ROW_STATUSES.into_iter()),
    ));
    let columns = declared(of_dwells::columns(&Channel::ALL, &Measures::default(), false));
    list(&mut text, &Layout::of_map(Vec::new(), columns).schema());
    text
}

/// A line for each column, once for all channels and models.
fn list(text: &mut String, columns: &Schema) {
    let mut names = HashSet::new();
    for field in columns.fields().iter().filter(|field| !is_a_further_one(field.name())) {
        let name = of_any(field.name());
        if !names.insert(name.clone()) {
            continue;
        }
        let told = |key: &str| field.metadata().get(key).map_or("", String::as_str);
        let unit = match told("unit") {
            "1" => "",
            _ if name.ends_with("CHANNEL") => "the channel's unit",
            unit => unit,
        };
        let [worse, limit] = [key::WORSE, key::LIMIT].map(told);
        let facts = [("", unit), ("worse: ", worse), ("limit: ", limit)];
        let facts = facts.iter().filter(|(_, fact)| !fact.is_empty());
        let facts =
            facts.map(|(what, fact)| format!("{what}{fact}")).collect::<Vec<_>>().join(", ");
        let facts = if facts.is_empty() { facts } else { format!(" ({facts})") };
        // Writing to a String cannot fail.
        let _ = writeln!(text, "- `{name}`{facts}: {}", of_any_model(told("description")));
    }
}

/// A column's name, with CHANNEL and MODEL in place of one channel's and one model's.
fn of_any(name: &str) -> String {
    let of_channel = Channel::ALL.iter().find_map(|channel| {
        ["nonlinear_", "linear_", "ratio_", "dwell_", "periodic_"].into_iter().find_map(|before| {
            (name.strip_prefix(before)? == channel.name()).then(|| format!("{before}CHANNEL"))
        })
    });
    of_channel
        .unwrap_or_else(|| name.into())
        .replace("nonlinear", "MODEL")
        .replace("linear", "MODEL")
}

/// A column's description, with that of any channel; the column's name says MODEL.
fn of_any_model(description: &str) -> String {
    let first = Channel::ALL
        .iter()
        .find_map(|channel| description.strip_prefix(channel.description())?.strip_prefix(": "));
    let of_all = first.unwrap_or(description).replace(", nonlinear model", "");
    of_all.replace("; null if it failed", "")
}

fn commands(program: clap::Command) -> String {
    let mut text = head("Commands");
    text.push_str("`sweep COMMAND --help` begins with examples of the command.\n\n");
    // The width of a terminal must not show in a file.
    let mut program = program.term_width(100);
    program.build();
    let mut part = |title: &str, help: String, more: &str| {
        // The usage says it.
        let help = help.replace("Arguments:\n  <GRID.toml>  Grid file\n\n", "");
        let help: Vec<&str> = help.lines().map(str::trim_end).collect();
        // Writing to a String cannot fail.
        let _ =
            writeln!(text, "## {title}\n\n```text\n{}\n```\n{more}", help.join("\n").trim_end());
    };
    // Examples and the flag that shows them are for a terminal.
    let help_of_program = program.clone().before_help(None::<&'static str>).render_help();
    part("sweep", help_of_program.to_string().trim_start().into(), "");
    let shared = shared_options(&program);
    let mut options = clap::Command::new("options").disable_help_flag(true).term_width(100);
    options = options.help_template("{options}").args(shared.clone());
    part("Options of several commands", options.render_help().to_string(), "");
    for command in program.get_subcommands().filter(|command| !command.is_hide_set()) {
        let is_shared = |arg: &clap::Arg| shared.iter().any(|of_many| is_same(of_many, arg));
        let longs = command
            .get_arguments()
            .filter(|arg| is_shared(arg))
            .filter_map(|arg| arg.get_long().map(|long| format!("`--{long}`")));
        let longs: Vec<String> = longs.collect();
        let more = if longs.is_empty() {
            String::new()
        } else {
            format!("\nAlso {}: [above](#options-of-several-commands).\n", longs.join(", "))
        };
        let is_hidden = |arg: &clap::Arg| is_shared(arg) || arg.get_long() == Some("help");
        let mut alone = command.clone().before_help(None::<&'static str>);
        alone = alone.mut_args(|arg| if is_hidden(&arg) { arg.hide(true) } else { arg });
        part(&format!("sweep {}", command.get_name()), alone.render_help().to_string(), &more);
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// Whether two commands' arguments are one option, told alike.
fn is_same(a: &clap::Arg, b: &clap::Arg) -> bool {
    let told = |arg: &clap::Arg| arg.get_help().map(ToString::to_string);
    a.get_long().is_some() && a.get_long() == b.get_long() && told(a) == told(b)
}

/// Options that at least three commands have, each once; the help flag stays with its command.
fn shared_options(program: &clap::Command) -> Vec<clap::Arg> {
    let visible = || program.get_subcommands().filter(|command| !command.is_hide_set());
    let mut shared: Vec<clap::Arg> = Vec::new();
    for arg in visible().flat_map(clap::Command::get_arguments) {
        let times = visible().flat_map(clap::Command::get_arguments).filter(|a| is_same(a, arg));
        let is_known = shared.iter().any(|known| is_same(known, arg));
        if arg.get_long() != Some("help") && !is_known && times.count() > 2 {
            shared.push(arg.clone());
        }
    }
    shared
}

/// With `RENEW` in the environment it writes them.
#[test]
fn the_guide_has_these_pages() {
    let pages = [
        ("parameters", parameters()),
        ("methods", methods()),
        ("columns", columns()),
        ("commands", commands(command())),
    ];
    for (page, made) in pages {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference");
        let path = folder.join(page).with_extension("md");
        if env::var_os("RENEW").is_some() {
            fs::write(path, made).unwrap();
        } else {
            let is_made = fs::read_to_string(&path).unwrap() == made;
            assert!(is_made, "{page}.md: RENEW=1 cargo test --release -p sweep --lib reference");
        }
    }
}

#[test]
fn further_springs_and_dampers_are_left_out_and_nothing_else() {
    assert!(
        is_a_further_one("spring_2_tub_x_m")
            && is_a_further_one("damper_12_damping_n_s_per_m")
            && is_a_further_one("foot_3_load_linear_n")
    );
    assert!(!is_a_further_one("spring_1_tub_x_m") && !is_a_further_one("spring_stiffness_n_per_m"));
}
