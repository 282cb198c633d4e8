//! A chunk: the rows of a run of neighbouring points, in one file with its own hash.
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SWEEPCHK` |
//! | 4 | format, u32 |
//! | 4 | columns C of the model, u32 |
//! | 32 | hash of the plan |
//! | 8, 8, 8 | chunk index, first point, number of points, u64 |
//! | rows x (8 + B + 8 C) | records: one a point, or several |
//! | 32 | blake3 of everything before |
//!
//! A record is the point (u64), a bit for each column that says whether there is a cell, in B bytes
//! as many as it takes, and the cells (u64): the bits of numbers, positions of names, 0 or 1. What
//! is not there is zero.
//!
//! Points are in order. An interrupted process leaves a chunk that lacks some: a part.

use std::sync::Arc;

use super::{Column, Done, Layout, Row, StoreError};

/// What every chunk begins with.
pub(super) const MAGIC: [u8; 8] = *b"SWEEPCHK";
const FORMAT: u32 = 5;
const HEADER: usize = 8 + 4 + 4 + 32 + 3 * 8;
const HASH: usize = blake3::OUT_LEN;

/// Rows of a point, at most: 256 states of each of 32 motions.
const MOST_ROWS: u64 = 32 * 256;

/// What a record holds.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    columns: Arc<[Column]>,
    /// Whether there may be several rows of a point.
    has_several: bool,
}

impl Shape {
    /// That of a result file's rows.
    pub fn of(layout: &Layout) -> Self {
        Self { columns: layout.columns.as_slice().into(), has_several: layout.has_several }
    }

    /// Bytes of a record.
    pub fn bytes_a_row(&self) -> usize {
        record_bytes(self.columns.len())
    }
}

/// Computes the bytes of a record of so many columns.
const fn record_bytes(columns: usize) -> usize {
    8 + columns.div_ceil(8) + 8 * columns
}

/// What a chunk's header must say to be the chunk that is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Hash of the plan.
    pub plan: blake3::Hash,
    /// What a record holds; the hash tells shapes with as many columns apart.
    pub shape: Shape,
    /// Index of the chunk.
    pub chunk: u64,
    /// Its first point.
    pub first: u64,
    /// Its number of points.
    pub count: u64,
}

impl Place {
    /// Bytes of the whole file, at most.
    pub fn most_bytes(&self) -> u64 {
        let rows = if self.shape.has_several { MOST_ROWS } else { 1 };
        self.count
            .saturating_mul(rows * self.shape.bytes_a_row() as u64)
            .saturating_add((HEADER + HASH) as u64)
    }
}

/// Why bytes are not the chunk that is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Damage {
    #[error("it is cut short or too long")]
    Length,
    #[error("its hash is wrong")]
    Hash,
    #[error("it belongs to another plan, place or version")]
    Foreign,
    #[error("a record makes no sense")]
    Record,
}

/// Why outcomes are not a chunk: a defect of whoever computed them.
fn reject(place: &Place, reason: String) -> StoreError {
    let last = (place.first + place.count).saturating_sub(1);
    StoreError::Engine { first: place.first, last, reason }
}

/// Whether these are points of a chunk, in order.
fn are_of(place: &Place, outcomes: &[Done]) -> bool {
    let points = place.first..place.first.saturating_add(place.count);
    outcomes.iter().all(|outcome| points.contains(&outcome.point))
        && outcomes.is_sorted_by(|a, b| a.point < b.point)
}

/// The chunk's file.
pub(super) fn encode(place: &Place, outcomes: &[Done]) -> Result<Vec<u8>, StoreError> {
    if !are_of(place, outcomes) {
        let reason = format!("{} outcomes that are not of its points", outcomes.len());
        return Err(reject(place, reason));
    }
    let shape = &place.shape;
    let mut bytes = Vec::with_capacity(HEADER + outcomes.len() * shape.bytes_a_row() + HASH);
    bytes.extend_from_slice(&header(place));
    if let Some(done) = outcomes.iter().find(|done| done.rows.len() as u64 > MOST_ROWS) {
        let reason = format!("point {}: {} rows of {MOST_ROWS}", done.point, done.rows.len());
        return Err(reject(place, reason));
    }
    let rows = outcomes.iter().flat_map(|done| done.rows.iter().map(|row| (done.point, row)));
    for (point, row) in rows {
        let fits = row.len() == shape.columns.len()
            && shape.columns.iter().zip(row).all(|(column, cell)| column.takes(*cell));
        if !fits {
            let reason = format!("point {point}: a row that does not fit its columns");
            return Err(reject(place, reason));
        }
        record(point, row, &mut bytes);
    }
    let hash = blake3::hash(&bytes);
    bytes.extend_from_slice(hash.as_bytes());
    Ok(bytes)
}

/// What a chunk's file holds.
pub(super) fn decode(place: &Place, bytes: &[u8]) -> Result<Vec<Done>, Damage> {
    let (body, hash) = bytes.split_last_chunk::<HASH>().ok_or(Damage::Length)?;
    if blake3::hash(body) != *hash {
        return Err(Damage::Hash);
    }
    let (found, records) = body.split_at_checked(HEADER).ok_or(Damage::Length)?;
    if found != header(place) {
        return Err(Damage::Foreign);
    }
    let shape = &place.shape;
    let records = records.chunks_exact(shape.bytes_a_row());
    if !records.remainder().is_empty() {
        return Err(Damage::Length);
    }
    let mut outcomes: Vec<Done> = Vec::with_capacity(records.len());
    for record in records {
        let (point, row) = read_record(record, shape).ok_or(Damage::Record)?;
        match outcomes.last_mut() {
            Some(last) if last.point == point => last.rows.push(row),
            _ => outcomes.push(Done { point, rows: vec![row] }),
        }
    }
    if are_of(place, &outcomes) { Ok(outcomes) } else { Err(Damage::Record) }
}

/// Counts the points in a chunk of the plan with this hash, whatever its columns are; none are in
/// what is not as it was written.
pub(super) fn count_points(plan: &blake3::Hash, bytes: &[u8]) -> u64 {
    let Some((body, hash)) = bytes.split_last_chunk::<HASH>() else { return 0 };
    let Some((header, records)) = body.split_at_checked(HEADER) else { return 0 };
    let [format, columns] = [8, 12].map(|at| {
        let word = header[at..].first_chunk().copied().unwrap_or_default();
        u32::from_le_bytes(word)
    });
    let is_ours =
        header.starts_with(&MAGIC) && format == FORMAT && header[16..48] == *plan.as_bytes();
    if !is_ours || blake3::hash(body) != *hash {
        return 0;
    }
    let points = records.chunks_exact(record_bytes(columns as usize)).map(|record| &record[..8]);
    let points: Vec<&[u8]> = points.collect();
    points.chunk_by(|a, b| a == b).count() as u64
}

fn header(place: &Place) -> Vec<u8> {
    let kind = [FORMAT, place.shape.columns.len() as u32].map(u32::to_le_bytes);
    let place_bytes = [place.chunk, place.first, place.count].map(u64::to_le_bytes);
    let plan = place.plan.as_bytes();
    [&MAGIC, kind.as_flattened(), plan, place_bytes.as_flattened()].concat()
}

fn record(point: u64, row: &Row, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(&point.to_le_bytes());
    for eight in row.chunks(8) {
        let bits = eight.iter().enumerate().map(|(k, cell)| u8::from(cell.is_some()) << k);
        bytes.push(bits.sum());
    }
    for cell in row {
        bytes.extend_from_slice(&cell.unwrap_or_default().to_le_bytes());
    }
}

/// Takes a fixed-length record apart; `None` where it makes no sense.
fn read_record(bytes: &[u8], shape: &Shape) -> Option<(u64, Row)> {
    let columns = &shape.columns;
    let (point, rest) = bytes.split_first_chunk()?;
    let (bits, cells) = rest.split_at_checked(columns.len().div_ceil(8))?;
    let mut row = Row::with_capacity(columns.len());
    for (k, (column, cell)) in columns.iter().zip(cells.as_chunks().0).enumerate() {
        let number = u64::from_le_bytes(*cell);
        let is_there = bits[k / 8] >> (k % 8) & 1 == 1;
        let cell = is_there.then_some(number);
        if !column.takes(cell) || (!is_there && number != 0) {
            return None;
        }
        row.push(cell);
    }
    Some((u64::from_le_bytes(*point), row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::synthetic;
    use proptest::prelude::*;

    fn place(count: u64) -> Place {
        let shape = Shape::of(&synthetic::layout());
        Place { plan: blake3::hash(b"plan"), shape, chunk: 3, first: 48, count }
    }

    fn outcomes(place: &Place) -> Vec<Done> {
        (place.first..place.first + place.count).map(synthetic::done).collect()
    }

    #[test]
    fn a_flipped_bit_anywhere_is_found() {
        let place = place(3);
        let bytes = encode(&place, &outcomes(&place)).unwrap();
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut broken = bytes.clone();
                broken[at] ^= 1 << bit;
                assert_eq!(decode(&place, &broken), Err(Damage::Hash), "byte {at}, bit {bit}");
            }
        }
    }

    #[test]
    fn a_truncation_anywhere_is_found() {
        let place = place(3);
        let bytes = encode(&place, &outcomes(&place)).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&place, &bytes[..length]).is_err(), "cut to {length}");
        }
        let longer = [bytes.as_slice(), &[0]].concat();
        assert!(decode(&place, &longer).is_err());
    }

    #[test]
    fn a_whole_chunk_of_another_plan_place_or_shape_is_foreign() {
        let ours = place(2);
        let bytes = encode(&ours, &outcomes(&ours)).unwrap();
        let mut layout = synthetic::layout();
        layout.columns.pop();
        let others = [
            Place { plan: blake3::hash(b"other"), ..ours.clone() },
            Place { chunk: 4, ..ours.clone() },
            Place { first: 49, ..ours.clone() },
            Place { count: 3, ..ours.clone() },
            Place { shape: Shape::of(&layout), ..ours },
        ];
        for other in others {
            assert_eq!(decode(&other, &bytes), Err(Damage::Foreign));
        }
    }

    #[test]
    fn rows_that_do_not_fit_the_chunk_are_refused() {
        let place = place(2);
        let good = outcomes(&place);
        let reason = |outcomes: &[Done]| encode(&place, outcomes).unwrap_err().to_string();
        let swapped: Vec<Done> = good.iter().rev().cloned().collect();
        assert!(reason(&swapped).contains("2 outcomes that are not of its points"));
        let mut short = good.clone();
        short[0].rows[0].pop();
        assert!(reason(&short).contains("does not fit"), "{}", reason(&short));
        let mut null = good;
        let steps = synthetic::layout().position("steps").unwrap();
        null[0].rows[0][steps] = None;
        assert!(reason(&null).contains("does not fit"), "{}", reason(&null));
    }

    #[test]
    fn a_chunk_has_points_of_its_own_each_once_in_order() {
        let place = place(4);
        let all = outcomes(&place);
        for some in [&all[..0], &all[1..2], &all[..3], &all] {
            let bytes = encode(&place, some).unwrap();
            assert_eq!(decode(&place, &bytes).as_deref(), Ok(some));
        }
        let elsewhere = [synthetic::done(place.first + 4)];
        let backwards = [all[1].clone(), all[0].clone()];
        let larger = Place { first: 0, count: 100, ..place.clone() };
        for wrong in [elsewhere.as_slice(), &backwards] {
            assert!(encode(&place, wrong).is_err(), "{wrong:?}");
        }
        let mut bytes = encode(&larger, &elsewhere).unwrap();
        bytes.truncate(bytes.len() - HASH);
        bytes[..HEADER].copy_from_slice(&header(&place));
        let hash = blake3::hash(&bytes);
        bytes.extend_from_slice(hash.as_bytes());
        assert_eq!(decode(&place, &bytes), Err(Damage::Record));
    }

    fn row() -> impl Strategy<Value = Row> {
        let cell = |column: &Column| match &column.kind {
            crate::store::Holds::Count | crate::store::Holds::Axis => {
                any::<u64>().prop_map(Some).boxed()
            }
            crate::store::Holds::Flag => prop::option::of(0..2_u64).boxed(),
            crate::store::Holds::Name(names) => prop::option::of(0..names.len() as u64).boxed(),
            _ => any::<Option<u64>>().boxed(),
        };
        synthetic::layout().columns.iter().map(cell).collect::<Vec<_>>()
    }

    proptest! {
        #[test]
        fn whatever_goes_in_comes_out(
            points in prop::collection::vec(prop::collection::vec(row(), 1..4), 0..20),
        ) {
            let mut place = place(points.len() as u64);
            place.shape.has_several = true;
            let done = |(rows, point)| Done { point, rows };
            let outcomes: Vec<Done> = points.into_iter().zip(place.first..).map(done).collect();
            let bytes = encode(&place, &outcomes).unwrap();
            prop_assert_eq!(decode(&place, &bytes), Ok(outcomes));
        }

        #[test]
        fn any_bytes_at_all_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            prop_assert!(decode(&place(1), &bytes).is_err());
        }
    }
}
