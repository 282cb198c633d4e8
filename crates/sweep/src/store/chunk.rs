//! A chunk: the outcomes of a run of neighbouring points, in one file with its own hash.
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SWEEPCHK` |
//! | 4 | format, u32 |
//! | 4 | channels C, u32 |
//! | 32 | hash of the plan |
//! | 8, 8, 8 | chunk index, first point, number of points, u64 |
//! | points x (11 + 2 x (32 + 8 C)) | records |
//! | 32 | blake3 of everything before |
//!
//! A record is the point (u64), flags, the two models' status codes (u8 each), then for the nonlinear and the linear
//! model: fail time, least gap (f64), steps, rejected (u64), C amplitudes (f64). What a flag says is absent is zero.

use super::error::StoreError;
use crate::outcome::{Outcome, Status, Trajectory};

const MAGIC: [u8; 8] = *b"SWEEPCHK";
const FORMAT: u32 = 1;
const HEADER: usize = 8 + 4 + 4 + 32 + 3 * 8;
const HASH: usize = blake3::OUT_LEN;

/// Flag bits of a record; the linear model's stand three above the nonlinear one's.
const AMPLITUDES: u8 = 1;
const GAP: u8 = 1 << 1;
const FAIL_TIME: u8 = 1 << 2;
const LINEAR_SHIFT: u32 = 3;
const SENSITIVE_KNOWN: u8 = 1 << 6;
const SENSITIVE: u8 = 1 << 7;

/// What a chunk's header must say to be the chunk that is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Hash of the plan.
    pub(crate) plan: blake3::Hash,
    /// Amplitudes a model.
    pub(crate) channels: u32,
    /// Index of the chunk.
    pub(crate) chunk: u64,
    /// Its first point.
    pub(crate) first: u64,
    /// Its number of points.
    pub(crate) count: u64,
}

/// Why bytes are not the chunk that is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Damage {
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

/// What a point takes in a chunk's file, bytes.
pub(crate) const fn bytes_a_point(channels: usize) -> usize {
    8 + 3 + 2 * (4 * 8 + 8 * channels)
}

/// The chunk's file.
pub(crate) fn encode(place: &Place, outcomes: &[Outcome]) -> Result<Vec<u8>, StoreError> {
    if outcomes.len() as u64 != place.count {
        return Err(reject(place, format!("{} outcomes for {} points", outcomes.len(), place.count)));
    }
    let channels = place.channels as usize;
    let mut bytes = Vec::with_capacity(HEADER + outcomes.len() * bytes_a_point(channels) + HASH);
    bytes.extend_from_slice(&header(place));
    for (outcome, point) in outcomes.iter().zip(place.first..) {
        if outcome.point != point {
            return Err(reject(
                place,
                format!("an outcome of point {} in the place of {point}", outcome.point),
            ));
        }
        for (model, name) in [(&outcome.nonlinear, "nonlinear"), (&outcome.linear, "linear")] {
            let expected = if model.status == Status::Ok { channels } else { 0 };
            if model.amplitudes.len() != expected {
                let got = model.amplitudes.len();
                return Err(reject(
                    place,
                    format!("point {point}, {name} model: {got} amplitudes where {expected} belong"),
                ));
            }
        }
        record(outcome, channels, &mut bytes);
    }
    let hash = blake3::hash(&bytes);
    bytes.extend_from_slice(hash.as_bytes());
    Ok(bytes)
}

/// The outcomes in a chunk's file, if every byte is as it was written and it is the chunk looked for.
pub(crate) fn decode(place: &Place, bytes: &[u8]) -> Result<Vec<Outcome>, Damage> {
    let (body, hash) = bytes.split_last_chunk::<HASH>().ok_or(Damage::Length)?;
    if blake3::hash(body) != *hash {
        return Err(Damage::Hash);
    }
    let (found, records) = body.split_at_checked(HEADER).ok_or(Damage::Length)?;
    if found != header(place) {
        return Err(Damage::Foreign);
    }
    let channels = place.channels as usize;
    let length = bytes_a_point(channels);
    if records.len() as u64 != place.count.saturating_mul(length as u64) {
        return Err(Damage::Length);
    }
    records
        .chunks_exact(length)
        .zip(place.first..)
        .map(|(bytes, point)| {
            let outcome = read_record(bytes, channels).ok_or(Damage::Record)?;
            if outcome.point == point { Ok(outcome) } else { Err(Damage::Record) }
        })
        .collect()
}

fn header(place: &Place) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&FORMAT.to_le_bytes());
    bytes.extend_from_slice(&place.channels.to_le_bytes());
    bytes.extend_from_slice(place.plan.as_bytes());
    for number in [place.chunk, place.first, place.count] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn flags(model: &Trajectory) -> u8 {
    let bit = |present: bool, flag: u8| if present { flag } else { 0 };
    bit(model.status == Status::Ok, AMPLITUDES)
        | bit(model.min_gap_m.is_some(), GAP)
        | bit(model.fail_time_s.is_some(), FAIL_TIME)
}

fn record(outcome: &Outcome, channels: usize, bytes: &mut Vec<u8>) {
    let sensitive = match outcome.sensitive {
        None => 0,
        Some(false) => SENSITIVE_KNOWN,
        Some(true) => SENSITIVE_KNOWN | SENSITIVE,
    };
    bytes.extend_from_slice(&outcome.point.to_le_bytes());
    bytes.push(flags(&outcome.nonlinear) | flags(&outcome.linear) << LINEAR_SHIFT | sensitive);
    bytes.extend_from_slice(&[outcome.nonlinear.status as u8, outcome.linear.status as u8]);
    for model in [&outcome.nonlinear, &outcome.linear] {
        for number in [model.fail_time_s, model.min_gap_m] {
            bytes.extend_from_slice(&number.unwrap_or(0.0).to_le_bytes());
        }
        for number in [model.steps, model.rejected] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        for i in 0..channels {
            bytes.extend_from_slice(&model.amplitudes.get(i).copied().unwrap_or(0.0).to_le_bytes());
        }
    }
}

/// Takes a fixed-length record apart; `None` where it makes no sense.
fn read_record(bytes: &[u8], channels: usize) -> Option<Outcome> {
    let mut rest = bytes;
    let point = u64::from_le_bytes(take(&mut rest)?);
    let [flags, nonlinear, linear] = take(&mut rest)?;
    let nonlinear = read_model(&mut rest, nonlinear, flags, channels)?;
    let linear = read_model(&mut rest, linear, flags >> LINEAR_SHIFT, channels)?;
    let sensitive = (flags & SENSITIVE_KNOWN != 0).then_some(flags & SENSITIVE != 0);
    Some(Outcome { point, nonlinear, linear, sensitive })
}

fn read_model(rest: &mut &[u8], status: u8, flags: u8, channels: usize) -> Option<Trajectory> {
    let status = *Status::ALL.get(usize::from(status))?;
    let mut number = |present: u8| {
        let value = f64::from_le_bytes(take(rest)?);
        Some((flags & present != 0).then_some(value))
    };
    let (fail_time_s, min_gap_m) = (number(FAIL_TIME)?, number(GAP)?);
    let mut count = || Some(u64::from_le_bytes(take(rest)?));
    let (steps, rejected) = (count()?, count()?);
    let mut amplitudes = Vec::with_capacity(channels);
    for _ in 0..channels {
        amplitudes.push(f64::from_le_bytes(take(rest)?));
    }
    if flags & AMPLITUDES == 0 {
        amplitudes = Vec::new();
    }
    if (flags & AMPLITUDES != 0) != (status == Status::Ok) {
        return None;
    }
    Some(Trajectory { status, fail_time_s, amplitudes, min_gap_m, steps, rejected })
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (head, tail) = rest.split_first_chunk::<N>()?;
    *rest = tail;
    Some(*head)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::synthetic;
    use proptest::prelude::*;

    fn place(count: u64, channels: u32) -> Place {
        Place { plan: blake3::hash(b"plan"), channels, chunk: 3, first: 48, count }
    }

    fn outcomes(place: &Place) -> Vec<Outcome> {
        (place.first..place.first + place.count)
            .map(|point| synthetic::outcome(point, place.channels as usize))
            .collect()
    }

    #[test]
    fn a_flipped_bit_anywhere_is_found() {
        let place = place(3, 2);
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
        let place = place(3, 2);
        let bytes = encode(&place, &outcomes(&place)).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&place, &bytes[..length]).is_err(), "cut to {length}");
        }
        let longer = [bytes.as_slice(), &[0]].concat();
        assert!(decode(&place, &longer).is_err());
    }

    #[test]
    fn a_whole_chunk_of_another_plan_place_or_shape_is_foreign() {
        let ours = place(2, 2);
        let bytes = encode(&ours, &outcomes(&ours)).unwrap();
        let others = [
            Place { plan: blake3::hash(b"other"), ..ours },
            Place { chunk: 4, ..ours },
            Place { first: 49, ..ours },
            Place { count: 3, ..ours },
            Place { channels: 3, ..ours },
        ];
        for other in others {
            assert_eq!(decode(&other, &bytes), Err(Damage::Foreign));
        }
    }

    #[test]
    fn outcomes_that_do_not_fit_the_chunk_are_refused() {
        let place = place(2, 2);
        let good = outcomes(&place);
        let reason = |outcomes: &[Outcome]| encode(&place, outcomes).unwrap_err().to_string();
        assert!(reason(&good[..1]).contains("1 outcomes for 2 points"));
        let swapped: Vec<Outcome> = good.iter().rev().cloned().collect();
        assert!(reason(&swapped).contains("an outcome of point 49 in the place of 48"));
        let mut short = good.clone();
        short[0].nonlinear.amplitudes = vec![1.0];
        assert!(reason(&short).contains("1 amplitudes"), "{}", reason(&short));
    }

    fn model(channels: usize) -> impl Strategy<Value = Trajectory> {
        (
            prop::sample::select(Status::ALL.to_vec()),
            prop::option::of(any::<f64>()),
            prop::collection::vec(any::<f64>(), channels),
            prop::option::of(any::<f64>()),
            any::<(u64, u64)>(),
        )
            .prop_map(|(status, fail_time_s, amplitudes, min_gap_m, (steps, rejected))| Trajectory {
                status,
                fail_time_s,
                amplitudes: if status == Status::Ok { amplitudes } else { Vec::new() },
                min_gap_m,
                steps,
                rejected,
            })
    }

    proptest! {
        #[test]
        fn whatever_goes_in_comes_out(
            rows in prop::collection::vec((model(3), model(3), any::<Option<bool>>()), 0..20)
        ) {
            let place = place(rows.len() as u64, 3);
            let outcomes: Vec<Outcome> = rows
                .into_iter()
                .zip(place.first..)
                .map(|((nonlinear, linear, sensitive), point)| Outcome { point, nonlinear, linear, sensitive })
                .collect();
            let bytes = encode(&place, &outcomes).unwrap();
            let back = decode(&place, &bytes).unwrap();
            // Through bytes, because NaN is not equal to itself.
            prop_assert_eq!(encode(&place, &back).unwrap(), bytes);
        }

        #[test]
        fn any_bytes_at_all_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            prop_assert!(decode(&place(1, 2), &bytes).is_err());
        }
    }
}
