//! Constants (`[set]`, `--set`, `--at`): parameters by name with their values.

use sweep_parameter::{Range, UnknownParameter};

use super::arguments::argument_name;
use super::draft::{Draft, SetConstant, WrittenNumbers};
use super::{
    Diagnostic, Located, NamedArgument, NamedValues, Section, quote, sections::describe_keys,
};
use crate::Model;
use crate::{ModelParameter, program};

/// Number of names that are compared for a suggestion. Basis: a machine of thousands of springs has
/// more, and the comparison of all would take long. Doubling it doubles that time.
pub(super) const MAX_COMPARED_NAMES: usize = 400;

/// Reads `[set]`, then `--set` and `--at`, which override it, and writes them into the plan.
pub fn set_constants<M: Model>(
    root: &Section<'_>,
    sets: Vec<&String>,
    at_arguments: &[String],
    draft: &mut Draft<'_, M>,
) {
    let mut constants = Vec::new();
    if let Some(section) = root.table("set", "[set]").into_located() {
        let section = section.value;
        for name in section.names() {
            let read_number = |range: Range| section.number_named(name.value, range);
            constants.extend(read_constant(name.clone(), read_number, false, draft));
        }
        write_constants(&constants, draft);
    }
    let mut constants = read_arguments("--set", sets, draft);
    constants.extend(read_arguments("--at", at_arguments, draft));
    let plan_before = draft.plan.clone();
    write_constants(&constants, draft);
    // A constant that equals the file's value does not change the plan.
    let changes_plan = |constant: &&SetConstant<M>| {
        let mut plan_after = plan_before.clone();
        plan_after.write(&constant.parameter, constant.value.value);
        plan_after != plan_before
    };
    draft.plan.set = constants
        .iter()
        .filter(changes_plan)
        .map(|constant| (constant.name.value.clone(), constant.value.value.into()))
        .collect();
}

/// Replaces the axes by one point. `at_arguments` has an argument NAME=VALUE for each axis of
/// several values, and may have arguments for other parameters.
pub fn fix_point<M: Model>(at_arguments: &[String], draft: &mut Draft<'_, M>) -> NamedValues {
    let constants = read_arguments("--at", at_arguments, draft);
    let is_given = |name: &str| at_arguments.iter().any(|argument| argument_name(argument) == name);
    for (k, axis) in std::mem::take(&mut draft.plan.axes).into_iter().enumerate() {
        if is_given(&axis.parameter.name) {
            continue;
        }
        if axis.values.len() == 1 {
            draft.plan.write(&axis.parameter, axis.values.value(0));
        } else if let Some(location) = draft.report.location(&format!("axis[{k}]")) {
            let name = &axis.parameter.name;
            let title = format!("a point of the grid needs a value of `{name}`");
            let expectation = format!("expected --at {name}=VALUE for this axis");
            draft.report.refuse::<()>(&location, title, expectation);
        }
    }
    draft.plan.design = None;
    write_constants(&constants, draft);
    constants.into_iter().map(|constant| (constant.name.value, constant.value.value)).collect()
}

/// Reads NAME=VALUE arguments.
fn read_arguments<'a, M: Model>(
    option: &str,
    arguments: impl IntoIterator<Item = &'a String>,
    draft: &Draft<'a, M>,
) -> Vec<SetConstant<M>> {
    let named_arguments =
        arguments.into_iter().filter_map(|text| NamedArgument::read(option, text, draft.report));
    let read_constant = |argument: NamedArgument<'a>| {
        read_constant(argument.name.clone(), |range| argument.number(range), true, draft)
    };
    named_arguments.filter_map(read_constant).collect()
}

/// Returns a constant if its name is a parameter and `number` gives a value in its range.
fn read_constant<M: Model>(
    name: Located<&str>,
    number: impl FnOnce(Range) -> Option<Located<f64>>,
    overrides_file: bool,
    draft: &Draft<'_, M>,
) -> Option<SetConstant<M>> {
    let parameter = find_parameter(&name, draft)?;
    let value = number(parameter.range)?;
    let name = Located { value: name.value.to_owned(), location: name.location };
    Some(SetConstant { name, parameter, value, overrides_file })
}

/// Finds the parameter of this name; an unknown name is reported.
pub fn find_parameter<M: Model>(
    name: &Located<&str>,
    draft: &Draft<'_, M>,
) -> Option<ModelParameter<M>> {
    let report_unknown =
        |error| draft.report.push_with(|_| unknown_parameter(name, &error, &draft.plan.model));
    draft.plan.model.find(name.value).map_err(report_unknown).ok()
}

/// Returns the mistake of a name that is no parameter.
pub fn unknown_parameter<M: Model>(
    name: &Located<&str>,
    UnknownParameter { reason, is_in_no_model }: &UnknownParameter,
    model: &M,
) -> Diagnostic {
    let title = format!("unknown parameter {}", quote(name.value));
    let diagnostic = Diagnostic::new(title).at_location(&name.location, reason.as_str());
    let table_names = ["time", "integrator", "reliability"];
    let table =
        is_in_no_model.then(|| describe_keys::<M>().table_of(name.value, &table_names)).flatten();
    match (is_in_no_model, table) {
        (true, Some(table)) => {
            let set_text = format!("`{}` is set in [{table}] of the grid file", name.value);
            diagnostic.with_help(match name.value {
                "window_s" => {
                    format!("{set_text}; `window_from_s` and `window_to_s` are its ends here")
                }
                _ => format!("{set_text} and is the same at every point"),
            })
        }
        (true, None) => {
            let parameters = model.parameters();
            let with_suggestion = diagnostic.with_nearest_name(
                name.value,
                parameters.iter().take(MAX_COMPARED_NAMES).map(|parameter| &*parameter.name),
            );
            with_suggestion.with_help(format!("`{} parameters` lists every name", program()))
        }
        (false, _) => diagnostic,
    }
}

/// Writes constants of equal precedence.
fn write_constants<M: Model>(constants: &[SetConstant<M>], draft: &mut Draft<'_, M>) {
    let mut written_numbers = WrittenNumbers::default();
    for constant in constants {
        if written_numbers.record(
            &constant.name,
            constant.parameter.number_names.clone(),
            draft.report,
        ) {
            draft.plan.write(&constant.parameter, constant.value.value);
            for part in &constant.parameter.number_names {
                draft.report.record_location(part.clone(), constant.value.location.clone());
            }
            draft.constants.push(constant.clone());
        }
    }
}
