//! What a fit has found out already, kept as it comes: the same question again goes on from there,
//! and ends in the same bits. A record is the hash of what was asked, how many numbers the answer
//! has (none where there is none), the numbers, and a hash of all that.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use blake3::Hash;
use sweep_files::regular;

use super::model::Summary;
use sweep_files::panics::lock;

/// Answers by the hash of their question.
type Known = BTreeMap<[u8; 32], Option<Summary>>;

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
        let (mut known, mut rest) = (Known::new(), &bytes[..]);
        while let Some((key, answer, after)) = record(rest) {
            known.insert(key, answer);
            rest = after;
        }
        file.set_len((bytes.len() - rest.len()) as u64)?;
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
        let key = *key.finalize().as_bytes();
        let lock = || lock(&self.state);
        if let Some(known) = lock().1.get(&key) {
            return Ok(known.clone());
        }
        let found = find()?;
        let mut state = lock();
        let _ = state.0.write_all(&bytes(&key, found.as_ref()));
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

fn bytes(key: &[u8; 32], answer: Option<&Summary>) -> Vec<u8> {
    let mut numbers = Vec::new();
    if let Some(Summary { cost, sigma, normal, pull }) = answer {
        numbers.extend([pull.len() as f64, *cost]);
        numbers.extend(pull.iter().chain(normal.iter().flatten()).chain(sigma));
    }
    let mut bytes = key.to_vec();
    bytes.extend((numbers.len() as u64).to_le_bytes());
    numbers.iter().for_each(|number| bytes.extend(number.to_bits().to_le_bytes()));
    bytes.extend(*blake3::hash(&bytes).as_bytes());
    bytes
}

/// The first record, and the bytes after it.
fn record(bytes: &[u8]) -> Option<([u8; 32], Option<Summary>, &[u8])> {
    let (key, _) = bytes.split_first_chunk::<32>()?;
    let (count, _) = bytes.get(32..)?.split_first_chunk::<8>()?;
    let end = usize::try_from(u64::from_le_bytes(*count)).ok()?.checked_mul(8)?.checked_add(40)?;
    let (check, after) = bytes.get(end..)?.split_first_chunk::<32>()?;
    if blake3::hash(&bytes[..end]).as_bytes() != check {
        return None;
    }
    let mut numbers = bytes[40..end]
        .chunks_exact(8)
        .filter_map(|word| Some(f64::from_le_bytes(word.try_into().ok()?)));
    let answer = numbers.next().and_then(|unknowns| {
        let n = unknowns as usize;
        let cost = numbers.next()?;
        let mut take = |n: usize| numbers.by_ref().take(n).collect::<Vec<f64>>();
        let pull = take(n);
        let normal = (0..n).map(|_| take(n)).collect();
        Some(Summary { cost, pull, normal, sigma: take(usize::MAX) })
    });
    Some((*key, answer, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_kept_and_torn_ones_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fit.partial");
        let summary = Summary {
            cost: -3.25,
            sigma: vec![0.5, 1e-300],
            normal: vec![vec![1.0, 0.1], vec![0.1, 2.0]],
            pull: vec![1.0 / 3.0, -0.0],
        };
        let problem = blake3::hash(b"one");
        let found = |it: Option<Summary>| move || Ok::<_, ()>(it);
        let never = || -> Result<Option<Summary>, ()> { panic!("it is known") };
        let journal = Journal::open(&path, problem).unwrap();
        journal.answer(&[1.0, 2.0], found(Some(summary.clone()))).unwrap();
        journal.answer(&[3.0, 2.0], found(None)).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, [&bytes[..], &bytes[..50]].concat()).unwrap();
        let journal = Journal::open(&path, problem).unwrap();
        assert_eq!(journal.count(), 2);
        assert_eq!(journal.answer(&[1.0, 2.0], never).unwrap(), Some(summary.clone()));
        assert_eq!(journal.answer(&[3.0, 2.0], never).unwrap(), None);
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        // Another problem has other answers.
        let other = Journal::open(&path, blake3::hash(b"two")).unwrap();
        assert_eq!(other.answer(&[1.0, 2.0], found(None)).unwrap(), None);
        other.complete();
        assert!(!path.exists());
    }
}
