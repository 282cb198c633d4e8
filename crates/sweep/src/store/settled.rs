//! What an engine found out before the first chunk, kept so that later processes of the run need not.

use std::fs;
use std::io;

use serde_json::Value;

use super::{Run, StoreError};
use crate::files::atomic;

const NAME: &str = "settled.json";

impl Run {
    /// What an earlier process of this run left by [`Run::remember`]; a file that cannot be understood counts as none.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn remembered(&self) -> Result<Option<Value>, StoreError> {
        let path = self.folder().join(NAME);
        match fs::read(&path) {
            Ok(text) => Ok(serde_json::from_slice(&text).ok()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(StoreError::io("read", &path)(error)),
        }
    }

    /// Leaves something for later processes of this run. Whoever comes first or last writes the same.
    ///
    /// # Errors
    /// [`StoreError::File`].
    pub fn remember(&self, settled: &Value) -> Result<(), StoreError> {
        let text = super::plan_file::pretty(settled);
        Ok(atomic::write(self.folder(), &self.folder().join(NAME), &text)?)
    }
}
