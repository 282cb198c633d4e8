//! A grid file while it is read.

use std::borrow::Cow;

use super::{Located, Report};
use crate::{Model, Plan};

/// A plan in the making: whole, but sound only if nothing was reported.
pub struct Draft<'a, M: Model> {
    /// The plan.
    pub plan: Plan<M>,
    /// Where its numbers were written, and what is wrong.
    pub report: &'a Report,
    /// What `[set]`, `--set` and `--at` have written.
    pub constants: Vec<WrittenConstant>,
}

/// A constant that was put in place.
pub struct WrittenConstant {
    /// The parameter's name, and where it stands.
    pub name: Located<String>,
    /// The numbers that it writes.
    pub parts: Vec<Cow<'static, str>>,
    /// Whether it is over the file, and so fixes what an axis sweeps.
    pub is_over_file: bool,
}
