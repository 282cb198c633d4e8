//! Reads a grid file, with the constants and options of the command line.

use super::draft::Draft;
use super::keys::Options;
use super::sections::{described, sections, walk};
use super::source::{Location, is_blank};
use super::syntax::{self, parse};
use super::written::name_of;
use super::{
    Diagnostic, Field, GridInput, Keys, Read, Report, Section, Walk, axes, design, list, parameters,
};
use crate::Design;
use crate::plan::Plan;

/// Reads the grid file and puts the constants in place. `None` if the grid file has no text.
pub fn draft<'a, M: Read>(input: &GridInput<M>, report: &'a Report) -> Option<Draft<'a, M>> {
    let GridInput { path, text, sets, at, .. } = input;
    let shown = path.display();
    let (text, source) = match text {
        Some(text) => (text.clone(), report.add(shown.to_string(), text.as_str())),
        None => syntax::text(path, "grid", M::TO_START, report)?,
    };
    if is_blank(&text) {
        let at = Location::new(source, 0..0);
        let refusal =
            Diagnostic::new(format!("the grid file {shown} is empty")).at(&at, "expected a grid");
        report.push(M::TO_START.into_iter().fold(refusal, Diagnostic::help));
        return None;
    }
    let table = parse(&text, source, report);
    let root = Section::new("the grid file", Location::new(source, 0..0), table.get_ref(), report);

    let mut keys = Keys::new(Walk::Read(root));
    let mut draft = Draft { plan: Plan::blank(), report, constants: Vec::new() };
    sections(&mut draft.plan, &mut keys, Some(input));
    let names = described::<M>().set;
    let (options, sets): (Vec<&String>, _) =
        sets.iter().partition(|set| set.contains('=') && names.contains(&name_of(set)));
    parameters::constants(keys.section()?, sets, at, &mut draft);
    let written = design::walk(&mut draft.plan.design, &mut keys);
    let root = keys.section()?;
    match (written, draft.plan.design.take()) {
        (_, Some(Design::List { file, .. })) => match list::read(&file, path, report) {
            Some(list) => axes::listed_axes(root, list, &mut draft),
            None => drop(root.tables("axis")),
        },
        // The right axes depend on a method that is unknown.
        (Field::Given(_) | Field::Bad, None) => drop(root.tables("axis")),
        (_, design) => axes::axes(root, design, &mut draft),
    }
    keys.finish();
    let options = Options::read(options, report);
    walk(&mut draft.plan, &mut Keys::new(Walk::Set(&options)));
    draft.plan.set.extend(options.changed.into_inner());
    Some(draft)
}
