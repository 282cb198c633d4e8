//! The place where each resolved number was written, so that a later check can point at it.

use std::collections::{BTreeMap, BTreeSet};

use super::source::Location;

/// Places by key: a parameter's name, `time.end_s` and the like for the rest of the grid file,
/// `spin.time_s[3]` for an entry of an array, `axis[0]` for an axis.
#[derive(Debug, Default)]
pub struct Origins {
    places: BTreeMap<String, Location>,
    doubtful: BTreeSet<String>,
}

impl Origins {
    /// Keeps the place of a number.
    pub fn put(&mut self, key: String, at: Location) {
        self.places.insert(key, at);
    }

    /// Marks a number that was refused or missing: a stand-in holds its place, and what depends on
    /// it is not judged.
    pub fn doubt(&mut self, key: String) {
        self.doubtful.insert(key);
    }

    /// The place of a number, if it was written.
    pub fn get(&self, key: &str) -> Option<&Location> {
        self.places.get(key)
    }

    /// Whether it was refused or missing.
    pub fn is_doubtful(&self, key: &str) -> bool {
        self.doubtful.contains(key)
    }
}
