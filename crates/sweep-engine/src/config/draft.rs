//! The state of a grid file while it is read.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::{Located, Report, written_twice_mistake};
use crate::{Model, ModelParameter, Plan};

/// A plan while it is read; it is valid only if nothing was reported.
pub struct Draft<'a, M: Model> {
    /// The plan so far.
    pub plan: Plan<M>,
    /// The locations of the plan's numbers, and the mistakes.
    pub report: &'a Report,
    /// The constants that `[set]`, `--set` and `--at` have written.
    pub constants: Vec<SetConstant<M>>,
}

/// A constant: a parameter's name with its value.
#[derive(Clone)]
pub struct SetConstant<M: Model> {
    /// The name with its location.
    pub name: Located<String>,
    /// The parameter.
    pub parameter: ModelParameter<M>,
    /// The value with its location.
    pub value: Located<f64>,
    /// Whether the constant overrides the file, and so fixes a swept parameter.
    pub overrides_file: bool,
}

/// The single numbers that are written, each with the name that writes it.
#[derive(Default)]
pub(super) struct WrittenNumbers(BTreeMap<Cow<'static, str>, Located<String>>);

impl WrittenNumbers {
    /// Records the numbers that a name writes. Returns false, after a report, if another name
    /// writes one of them, because their order is not defined.
    pub(super) fn record(
        &mut self,
        name: &Located<impl AsRef<str>>,
        parts: Vec<Cow<'static, str>>,
        report: &Report,
    ) -> bool {
        if let Some(first) = parts.iter().find_map(|part| self.0.get(part)) {
            report.push(written_twice_mistake(name, first));
            return false;
        }
        let name =
            Located { value: name.value.as_ref().to_owned(), location: name.location.clone() };
        self.0.extend(parts.into_iter().map(|part| (part, name.clone())));
        true
    }
}
