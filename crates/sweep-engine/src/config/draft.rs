//! A grid file while it is read.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::{Located, Report, twice};
use crate::{Model, Plan};

/// A plan in the making: whole, but sound only if nothing was reported.
pub struct Draft<'a, M: Model> {
    /// The plan.
    pub plan: Plan<M>,
    /// Where its numbers were written, and what is wrong.
    pub report: &'a Report,
    /// What `[set]`, `--set` and `--at` have written.
    pub constants: Vec<Constant<M>>,
}

/// A name with its value.
#[derive(Clone)]
pub struct Constant<M: Model> {
    /// The name, and where it stands.
    pub name: Located<String>,
    /// What it names.
    pub parameter: M::Parameter,
    /// Its value.
    pub value: Located<f64>,
    /// The single numbers that it writes.
    pub parts: Vec<Cow<'static, str>>,
    /// Whether it is over the file, and so fixes what an axis sweeps.
    pub is_over_file: bool,
}

/// Single numbers that are written, each with the name that does.
#[derive(Default)]
pub(super) struct Claimed(BTreeMap<Cow<'static, str>, Located<String>>);

impl Claimed {
    /// Takes note of the numbers that a name writes. Not if another name writes one of them: that
    /// is reported, as nothing says which comes last.
    pub(super) fn claim(
        &mut self,
        name: &Located<impl AsRef<str>>,
        parts: Vec<Cow<'static, str>>,
        report: &Report,
    ) -> bool {
        if let Some(first) = parts.iter().find_map(|part| self.0.get(part)) {
            report.push(twice(name, first));
            return false;
        }
        let name = Located { value: name.value.as_ref().to_owned(), at: name.at.clone() };
        self.0.extend(parts.into_iter().map(|part| (part, name.clone())));
        true
    }
}
