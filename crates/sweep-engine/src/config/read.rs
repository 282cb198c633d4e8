//! The model's part of a grid file.

use serde_json::{Map, Value};

use super::{Draft, GridInput, Section, Written};
use crate::Model;

/// A model in grid files. The engine reads `name`, `[set]`, `[time]`, `[integrator]`,
/// `[reliability]`, `[design]` and `[[axis]]`; what else there is, the model reads.
pub trait Read: Model {
    /// The key under which a grid names a file of the model's own, if it may.
    const OWN_FILE: Option<&'static str> = None;

    /// What to do where there is no grid file yet.
    const TO_START: Option<&'static str> = None;

    /// Reads the model's keys of a grid file.
    fn read(input: &GridInput<Self>, root: &Section<'_>) -> Self;

    /// Reads what is the model's of `[reliability]`.
    fn read_reliability(&mut self, _: &Section<'_>) {}

    /// What `--set` takes beside parameters and the engine's own settings.
    fn scalars() -> &'static [&'static str] {
        &[]
    }

    /// Puts one of them in place; its value as it stands in the plan.
    fn put(_: &Written<'_>, _: &mut Draft<'_, Self>) -> Option<Value> {
        None
    }

    /// Judges the whole, once every value is in place.
    fn judge(draft: &Draft<'_, Self>) {
        super::whole::windows(draft);
    }

    /// Writes the model into a plan as JSON; a default may be left out.
    fn describe(&self, plan: &mut Map<String, Value>);

    /// The model's part of the schema of grid files.
    fn schema() -> Schema;
}

/// What a model adds to the schema of grid files.
pub struct Schema {
    /// Keys at the top.
    pub top: Vec<(&'static str, Value)>,
    /// Those that must be there.
    pub required: Vec<&'static str>,
    /// Keys of `[reliability]`.
    pub reliability: Vec<(&'static str, Value)>,
    /// `[set]`, by [`crate::config::schema::set`].
    pub set: Value,
}
