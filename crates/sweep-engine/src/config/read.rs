//! The model's part of a grid file.

use serde_json::Value;

use super::{Draft, GridInput, Keys};
use crate::Model;

/// A model in grid files. The engine walks over `name`, `[set]`, `[time]`, `[integrator]`,
/// `[reliability]`, `[design]` and `[[axis]]`; over what else there is, the model does.
pub trait Read: Model {
    /// The key under which a grid names a file of the model's own, if it may.
    const OWN_FILE: Option<&'static str> = None;

    /// What to do where there is no grid file yet.
    const TO_START: Option<&'static str> = None;

    /// Whether files of the model's own have this key at the top.
    fn is_own_key(_: &str) -> bool {
        false
    }

    /// The model before anything is read: what is left out has these values.
    fn blank() -> Self;

    /// Walks over the model's keys at the top of a grid file; `input` is what is read.
    fn walk(&mut self, _: &mut Keys<'_>, _input: Option<&GridInput<Self>>) {}

    /// Walks over the model's keys of `[reliability]`.
    fn walk_reliability(&mut self, _: &mut Keys<'_>) {}

    /// Judges the whole, once every value is in place.
    fn judge(draft: &Draft<'_, Self>) {
        super::whole::windows(draft);
    }

    /// The schema of `[set]`, by [`crate::config::schema::set`].
    fn schema_of_set() -> Value;
}
