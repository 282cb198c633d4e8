//! Reading of grid files with the constants and options of the command line.

use super::arguments::argument_name;
use super::draft::Draft;
use super::keys::Options;
use super::sections::{describe_keys, walk_plan_keys, walk_sections};
use super::source::{Location, SourceId, is_blank};
use super::syntax::{self, parse_toml};
use super::{
    Diagnostic, Field, GridInput, KeyWalk, Keys, Located, Report, Section, axes, design, list,
    parameters,
};
use crate::Model;
use crate::{Design, Plan, program};
use toml::de::DeTable;

/// Reads the grid file and applies the constants. Returns `None` if the file has no text.
pub fn read_draft<'a, M: Model>(input: &GridInput<M>, report: &'a Report) -> Option<Draft<'a, M>> {
    let GridInput { path, text, set_arguments: sets, at_arguments, .. } = input;
    let path_text = path.display();
    let (text, source) = match text {
        Some(text) => (text.clone(), report.add(path_text.to_string(), text.as_str())),
        None => syntax::read_text(path, "grid", M::ABOUT.start_advice, report)?,
    };
    if is_blank(&text) {
        let location = Location::new(source, 0..0);
        let refusal = Diagnostic::new(format!("the grid file {path_text} is empty"))
            .at_location(&location, "expected a grid");
        report.push(M::ABOUT.start_advice.into_iter().fold(refusal, Diagnostic::with_help));
        return None;
    }
    let table = parse_toml(&text, source, report);
    if refuse_other_kind::<M>("grid", table.get_ref(), source, report) {
        return None;
    }
    let root = Section::new("the grid file", Location::new(source, 0..0), table.get_ref(), report);

    let mut keys = Keys::new(KeyWalk::Read(root));
    let mut draft = Draft { plan: Plan::blank_plan(), report, constants: Vec::new() };
    walk_sections(&mut draft.plan, &mut keys, Some(input));
    let settable_names = describe_keys::<M>().settable_keys;
    let (options, sets): (Vec<&String>, _) = sets
        .iter()
        .partition(|set| set.contains('=') && settable_names.contains(&argument_name(set)));
    parameters::set_constants(keys.section()?, sets, at_arguments, &mut draft);
    draft.plan.reading_notes.columns = read_columns(keys.section()?);
    let design_field = design::walk_design(&mut draft.plan.design, &mut keys);
    let root = keys.section()?;
    match (design_field, draft.plan.design.take()) {
        (_, Some(Design::List { file, .. })) => {
            let model = draft.plan.model.clone();
            let find_quantity = |name: &str| {
                let parameter = model.find(name).ok()?;
                Some((parameter.name.into_owned(), parameter.unit.to_owned()))
            };
            let settable_names = list::ColumnNames {
                find_quantity: &find_quantity,
                renamed_headers: &draft.plan.reading_notes.columns,
            };
            match list::read(&file, path, &settable_names, report) {
                Some(list) => axes::add_list_axes(root, list, &mut draft),
                None => drop(root.tables("axis")),
            }
        }
        // If [design] is no table, it is unknown whether the axes are those of a grid or a design.
        (Field::Rejected, None) => drop(root.tables("axis")),
        (_, design) => axes::read_axes(root, design, &mut draft),
    }
    keys.finish();
    let options = Options::read(options, report);
    walk_plan_keys(&mut draft.plan, &mut Keys::new(KeyWalk::Set(&options)));
    draft.plan.set.extend(options.changes.into_inner());
    Some(draft)
}

/// Reads `[columns]`: headers of lists and measurements with the names that they stand for.
fn read_columns(root: &Section<'_>) -> Vec<(String, String)> {
    let Some(section) = root.table("columns", "[columns]").into_located() else {
        return Vec::new();
    };
    let section = section.value;
    let header_and_name = |header: Located<&str>| {
        let name = section.text_named(header.value)?;
        Some((header.value.to_owned(), name.value.to_owned()))
    };
    section.names().into_iter().filter_map(header_and_name).collect()
}

/// The keys of study files.
pub const STUDY_KEYS: [&str; 8] =
    ["name", "grid", "parameter", "population", "candidates", "seed", "objective", "conditions"];

/// Rejects a file of another kind: most of its keys are those of the other kind, and no key is only
/// of the expected kind. Returns whether the file was rejected.
pub fn refuse_other_kind<M: Model>(
    expected_kind: &str,
    table: &DeTable<'_>,
    source: SourceId,
    report: &Report,
) -> bool {
    let grid_schema = describe_keys::<M>().finish();
    let has_key = |kind: &str, key: &str| match kind {
        "grid" => {
            ["set", "axis", "columns"].contains(&key)
                || grid_schema["properties"].get(key).is_some()
        }
        "study" => STUDY_KEYS.contains(&key),
        _ => M::ABOUT.model_file.is_some_and(|file| file.keys.contains(&key)),
    };
    let file_keys: Vec<&str> = table.keys().map(|key| &**key.get_ref()).collect();
    let is_kind = |kind: &&str| {
        let keys_of_kind = file_keys.iter().filter(|key| has_key(kind, key)).count();
        2 * keys_of_kind > file_keys.len()
            && file_keys.iter().all(|key| has_key(kind, key) || !has_key(expected_kind, key))
    };
    let model_file_key = M::ABOUT.model_file.map_or("", |file| file.key);
    let file_kinds = [expected_kind, "grid", "study", model_file_key];
    let Some(kind) = file_kinds.into_iter().find(is_kind).filter(|kind| *kind != expected_kind)
    else {
        return false;
    };
    report.push_with(|sources| {
        let program = program();
        let name = sources.name(source);
        let help = match kind {
            "grid" => {
                format!("`{program} run` takes it, and a study file names it: grid = {name:?}")
            }
            "study" => format!("`{program} optimise` takes it"),
            _ => format!("a grid file names it: {kind} = {name:?}"),
        };
        Diagnostic::new(format!("this is a {kind} file"))
            .at_location(&Location::new(source, 0..0), format!("expected a {expected_kind} file"))
            .with_help(help)
    });
    true
}
