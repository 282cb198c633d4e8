//! The records of a search's trials, as `trials.bin` holds them ([`super::Trials`]).

use std::io::{BufReader, Read as _};
use std::path::Path;

use sweep_files::regular;

/// Bytes of a point and its answer.
const CONTENT_BYTES: usize = 32;
/// Bytes of a record.
pub(super) const RECORD_BYTES: usize = 40;

/// The point of a trial, as the bits of three numbers.
pub type Key = [u64; 3];

/// Returns whether a file holds a trial of the plan with this hash.
pub(super) fn has_any(path: &Path, plan: &[u8; blake3::OUT_LEN]) -> bool {
    records(path).any(|record| decode(plan, &record).is_some())
}

/// Counts the trials of the plan with this hash in a file.
pub(super) fn count(path: &Path, plan: &[u8; blake3::OUT_LEN]) -> u64 {
    records(path).filter(|record| decode(plan, record).is_some()).count() as u64
}

/// Iterates over the records of a file, whosesoever they are; none are in what cannot be read.
fn records(path: &Path) -> impl Iterator<Item = [u8; RECORD_BYTES]> {
    let mut file = regular::open(path).ok().map(BufReader::new);
    std::iter::from_fn(move || {
        let mut record = [0; RECORD_BYTES];
        file.as_mut()?.read_exact(&mut record).ok()?;
        Some(record)
    })
}

/// Returns the record of a trial.
pub(super) fn encode(plan: &[u8; blake3::OUT_LEN], key: Key, answer: Option<f64>) -> Vec<u8> {
    let [a, b, c] = key;
    let content = [a, b, c, answer.unwrap_or(f64::NAN).to_bits()].map(u64::to_le_bytes);
    [content.as_flattened(), &check(plan, content.as_flattened())].concat()
}

/// Returns the trial of a record; `None` of one that is torn or of another plan.
pub(super) fn decode(plan: &[u8; blake3::OUT_LEN], record: &[u8]) -> Option<(Key, Option<f64>)> {
    let (content, found) = record.split_at_checked(CONTENT_BYTES)?;
    let &[a, b, c, answer] = content.as_chunks().0 else { return None };
    let [a, b, c, answer] = [a, b, c, answer].map(u64::from_le_bytes);
    let answer = Some(f64::from_bits(answer)).filter(|answer| !answer.is_nan());
    (check(plan, content) == found).then_some(([a, b, c], answer))
}

fn check(plan: &[u8; blake3::OUT_LEN], content: &[u8]) -> [u8; RECORD_BYTES - CONTENT_BYTES] {
    blake3::keyed_hash(plan, content).as_bytes().first_chunk().copied().unwrap_or_default()
}
