//! The model's part of a grid file.

use serde_json::Value;

use super::{Draft, GridInput, Keys};
use crate::Model;

/// A model that grid files configure. The engine walks over `name`, `[set]`, `[time]`,
/// `[integrator]`, `[reliability]`, `[design]` and `[[axis]]`; the model walks over all other keys.
pub trait Read: Model {
    /// The key by which a grid names the model's own file, if there is one.
    const OWN_FILE: Option<&'static str> = None;

    /// The advice for a user without a grid file.
    const TO_START: Option<&'static str> = None;

    /// Returns whether the model's own files have this key at the top.
    fn is_own_key(_: &str) -> bool {
        false
    }

    /// Returns the model with its default values.
    fn blank() -> Self;

    /// Walks over the model's keys at the top of a grid file; `input` is the grid that is read.
    fn walk(&mut self, _: &mut Keys<'_>, _input: Option<&GridInput<Self>>) {}

    /// Walks over the model's keys of `[reliability]`.
    fn walk_reliability(&mut self, _: &mut Keys<'_>) {}

    /// Checks the plan as a whole, after every value is set.
    fn check(draft: &Draft<'_, Self>) {
        super::whole::windows(draft);
    }

    /// Returns the schema of `[set]`, made by [`crate::config::schema::set`].
    fn schema_of_set() -> Value;
}
