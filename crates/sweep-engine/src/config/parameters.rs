//! Constants (`[set]`, `--set`, `--at`): names from the parameter table with a value each.

use std::borrow::Cow;
use std::collections::BTreeMap;

use sweep_parameter::{Parameter as _, Range};

use super::draft::{Draft, WrittenConstant};
use super::{
    Diagnostic, Located, NamedValues, Read, Section, Written, quoted, sections::described, twice,
};
use crate::{Plan, UnknownParameter, program};

/// Names offered as the nearest one; a machine of thousands of springs has more than a reader wants
/// compared.
const COMPARED: usize = 400;

/// A name with its value, and the numbers it writes.
struct Constant<'a, M: Read> {
    name: Located<&'a str>,
    parameter: M::Parameter,
    value: Located<f64>,
}

/// Reads `[set]`, then `--set` and `--at`, which override it, and writes all into the plan.
pub fn constants<M: Read>(
    root: &Section<'_>,
    sets: Vec<&String>,
    at: &[String],
    draft: &mut Draft<'_, M>,
) {
    let mut constants = Vec::new();
    if let Some(section) = root.table("set", "[set]").given() {
        let section = section.value;
        for name in section.names() {
            let number = |range: Range| section.number_named(name.value, range);
            constants.extend(constant(name.clone(), number, draft));
        }
        apply(&constants, false, draft);
    }
    let mut constants = arguments("--set", sets, draft);
    constants.extend(arguments("--at", at, draft));
    let before = draft.plan.clone();
    apply(&constants, true, draft);
    // What is set to what it was leaves the plan as it was.
    let changes = |constant: &&Constant<'_, M>| {
        let mut after = before.clone();
        write(&constant.parameter, &mut after, constant.value.value);
        after != before
    };
    draft.plan.set = constants
        .iter()
        .filter(changes)
        .map(|constant| (constant.name.value.to_owned(), constant.value.value.into()))
        .collect();
}

/// Puts one point in place of the axes: `--at` gives every axis of several values, and may give
/// more.
pub fn point<M: Read>(at: &[String], draft: &mut Draft<'_, M>) -> NamedValues {
    let constants = arguments("--at", at, draft);
    let named = |name: &str| {
        at.iter().any(|argument| argument.split('=').next().is_some_and(|n| n.trim() == name))
    };
    for (k, axis) in std::mem::take(&mut draft.plan.axes).into_iter().enumerate() {
        if named(axis.parameter.name()) {
            continue;
        }
        if axis.values.len() == 1 {
            write(&axis.parameter, &mut draft.plan, axis.values.value(0));
        } else if let Some(place) = draft.report.place(&format!("axis[{k}]")) {
            let name = axis.parameter.name();
            let title = format!("a point of the grid needs a value of `{name}`");
            draft.report.push(
                Diagnostic::new(title)
                    .at(&place, format!("expected --at {name}=VALUE for this axis")),
            );
        }
    }
    draft.plan.design = None;
    apply(&constants, true, draft);
    constants
        .iter()
        .map(|constant| (constant.name.value.to_owned(), constant.value.value))
        .collect()
}

/// Reads NAME=VALUE arguments.
fn arguments<'a, M: Read>(
    option: &str,
    arguments: impl IntoIterator<Item = &'a String>,
    draft: &Draft<'a, M>,
) -> Vec<Constant<'a, M>> {
    let written = arguments.into_iter().filter_map(|one| Written::read(option, one, draft.report));
    let constant = |one: Written<'a>| constant(one.name.clone(), |range| one.number(range), draft);
    written.filter_map(constant).collect()
}

/// A constant if its name is right and `number` has one in the parameter's range.
fn constant<'a, M: Read>(
    name: Located<&'a str>,
    number: impl FnOnce(Range) -> Option<Located<f64>>,
    draft: &Draft<'_, M>,
) -> Option<Constant<'a, M>> {
    let parameter = find(&name, draft)?;
    let value = number(parameter.range())?;
    Some(Constant { name, parameter, value })
}

/// The parameter of this name.
pub fn find<M: Read>(name: &Located<&str>, draft: &Draft<'_, M>) -> Option<M::Parameter> {
    let error = match draft.plan.model.find(name.value) {
        Ok(parameter) => return Some(parameter),
        Err(error) => error,
    };
    draft.report.push_with(|_| unknown(name, &error, &draft.plan.model));
    None
}

/// The mistake of a name that is no parameter.
pub fn unknown<M: Read>(
    name: &Located<&str>,
    UnknownParameter { reason, is_strange }: &UnknownParameter,
    model: &M,
) -> Diagnostic {
    let title = format!("unknown parameter {}", quoted(name.value));
    let diagnostic = Diagnostic::new(title).at(&name.at, reason.as_str());
    let tables = ["time", "integrator", "reliability"];
    let table = is_strange.then(|| described::<M>().table_of(name.value, &tables)).flatten();
    match (is_strange, table) {
        (true, Some(table)) => {
            let set = format!("`{}` is set in [{table}] of the grid file", name.value);
            diagnostic.help(match name.value {
                "window_s" => format!("{set}; `window_from_s` and `window_to_s` are its ends here"),
                _ => format!("{set} and is the same at every point"),
            })
        }
        (true, None) => {
            let all = model.parameters();
            let near =
                diagnostic.nearest(name.value, all.iter().take(COMPARED).map(|one| one.name()));
            near.help(format!("`{} parameters` lists every name", program()))
        }
        (false, _) => diagnostic,
    }
}

/// Writes constants of equal rank; no number may be written twice, as nothing says which comes
/// last.
fn apply<M: Read>(constants: &[Constant<'_, M>], is_over_file: bool, draft: &mut Draft<'_, M>) {
    let mut written: BTreeMap<Cow<'static, str>, &Constant<'_, M>> = BTreeMap::new();
    for constant in constants {
        let parts = draft.plan.model.parts(&constant.parameter);
        match parts.iter().find_map(|part| written.get(part)) {
            Some(first) => draft.report.push(twice(&constant.name, &first.name)),
            None => {
                write(&constant.parameter, &mut draft.plan, constant.value.value);
                for part in &parts {
                    draft.report.put(part.clone().into_owned(), constant.value.at.clone());
                    written.insert(part.clone(), constant);
                }
                let name =
                    Located { value: constant.name.value.to_owned(), at: constant.name.at.clone() };
                draft.constants.push(WrittenConstant { name, parts, is_over_file });
            }
        }
    }
}

fn write<M: Read>(parameter: &M::Parameter, plan: &mut Plan<M>, value: f64) {
    match parameter.window_edge() {
        Some(edge) => plan.window_s[edge] = value,
        None => plan.model.write(parameter, value),
    }
}
