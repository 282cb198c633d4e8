//! The journal of a fit's evaluations, written as they come: the same fit again goes on from there,
//! and ends in the same bits. A record is a line: a hash of what follows it, the hash of the
//! problem, the hash of what was evaluated, and the answer, null where there is none.

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
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
    /// Opens and locks the journal of a problem at a path. Torn and damaged records do not count.
    ///
    /// # Errors
    /// Errors of the file system; another fit that has the lock; a file that is no journal or holds
    /// evaluations of another problem, which stays as it is.
    pub(crate) fn open(path: &Path, problem: Hash) -> std::io::Result<Self> {
        let mut file = regular::open_or_create(path)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(refusal("another fit is writing it")),
            locked => locked?,
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        let records: Vec<_> =
            bytes[..whole].split(|byte| *byte == b'\n').filter_map(record).collect();
        if records.is_empty() && !bytes.is_empty() && !is_torn_record(&bytes) {
            return Err(refusal("it is not a journal of a fit; move it or name another output"));
        }
        let problem_hex = problem.to_hex();
        if records.iter().any(|record| record.0 != problem_hex.as_str()) {
            return Err(refusal(
                "it holds evaluations of another fit; finish that fit, remove the file or name \
                 another output",
            ));
        }
        file.set_len(whole as u64)?;
        file.seek(SeekFrom::End(0))?;
        let known = records.into_iter().map(|(_, key, answer)| (key, answer)).collect();
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
        let answer = json!([self.problem.to_hex().as_str(), key, found]).to_string();
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

/// Returns the problem, the question and the answer of a line.
fn record(line: &[u8]) -> Option<(String, String, Option<Summary>)> {
    let (check, answer) = std::str::from_utf8(line).ok()?.split_once(' ')?;
    let is_whole = blake3::hash(answer.as_bytes()).to_hex().as_str() == check;
    is_whole.then(|| serde_json::from_str(answer).ok())?
}

/// Whether bytes are the beginning of a journal whose first record a kill has cut off.
fn is_torn_record(bytes: &[u8]) -> bool {
    let is_one_line = !bytes.contains(&b'\n');
    let has_check = bytes.iter().take(64).all(u8::is_ascii_hexdigit);
    is_one_line && has_check && bytes.get(64..67) == Some(b" [\"".as_slice())
}

/// Returns the error for a file that stays as it is.
fn refusal(reason: &str) -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::AlreadyExists, reason)
}
