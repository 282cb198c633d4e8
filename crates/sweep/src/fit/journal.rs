//! What a fit has found out already, kept as it comes: the same question again goes on from there,
//! and ends in the same bits. A record is a line: a hash of what follows it, the hash of what was
//! asked, and the answer, null where there is none.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use blake3::Hash;
use serde_json::json;
use sweep_files::panics::lock;
use sweep_files::regular;

use super::model::Summary;

/// Answers by the hash of their question.
type Known = BTreeMap<String, Option<Summary>>;

/// An open journal.
pub(crate) struct Journal {
    path: PathBuf,
    /// The problem, of which every answer is.
    problem: Hash,
    state: Mutex<(File, Known)>,
}

impl Journal {
    /// Opens the journal of a problem at a path; records of others, and torn ones, do not count.
    ///
    /// # Errors
    /// Of the file system.
    pub(crate) fn open(path: &Path, problem: Hash) -> std::io::Result<Self> {
        let mut file = regular::open_or_create(path)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64)?;
        file.seek(SeekFrom::End(0))?;
        let known = bytes[..whole].split(|byte| *byte == b'\n').filter_map(record).collect();
        Ok(Self { path: path.to_owned(), problem, state: Mutex::new((file, known)) })
    }

    /// The answer for some unknowns, kept or found now. A journal that cannot be written to goes
    /// without.
    pub(crate) fn answer<E>(
        &self,
        x: &[f64],
        find: impl FnOnce() -> Result<Option<Summary>, E>,
    ) -> Result<Option<Summary>, E> {
        let mut key = blake3::Hasher::new_keyed(self.problem.as_bytes());
        for x in x {
            key.update(&x.to_bits().to_le_bytes());
        }
        let key = key.finalize().to_hex().to_string();
        let lock = || lock(&self.state);
        if let Some(known) = lock().1.get(&key) {
            return Ok(known.clone());
        }
        let found = find()?;
        let mut state = lock();
        let answer = json!([key, found]).to_string();
        let check = blake3::hash(answer.as_bytes());
        let _ = state.0.write_all(format!("{check} {answer}\n").as_bytes());
        state.1.insert(key, found.clone());
        Ok(found)
    }

    /// How many answers are there.
    pub(crate) fn count(&self) -> usize {
        lock(&self.state).1.len()
    }

    /// Removes it: what it was for is done.
    pub(crate) fn complete(self) {
        let _ = std::fs::remove_file(self.path);
    }
}

/// The question and the answer of a line.
fn record(line: &[u8]) -> Option<(String, Option<Summary>)> {
    let (check, answer) = std::str::from_utf8(line).ok()?.split_once(' ')?;
    let is_whole = blake3::hash(answer.as_bytes()).to_hex().as_str() == check;
    is_whole.then(|| serde_json::from_str(answer).ok())?
}
