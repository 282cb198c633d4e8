//! A chunk: the outcomes of a run of neighbouring points, in one file with its own hash.
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SWEEPCHK` |
//! | 4 | format, u32 |
//! | 4 | channels C, u32 |
//! | 4 | metrics M of a model, u32 |
//! | 32 | hash of the plan |
//! | 8, 8, 8 | chunk index, first point, number of points, u64 |
//! | points x (20 + 2 x (32 + 8 C + 8 M) + 8 B + 56 G) | records |
//! | 32 | blake3 of everything before |
//!
//! A record is the point (u64), flags, the two models' status codes and that of the method's level
//! (u8 each), the error (f64, NaN where there is none), then for the nonlinear and the linear
//! model: fail time, least gap (f64), steps, rejected (u64), C amplitudes and M metrics (f64). What
//! a flag says is absent is zero. After both models come B numbers (f64) of both together: ratios
//! by turns, then the static sag; NaN where there is none. Where G is 1 a disturbance follows: its
//! speed, NaN where there is none, and its multiplier (f64), then of two modes number, name (u32,
//! number 0 where there is none) and frequency (f64). M, B and G follow from the plan, and are zero
//! unless it asks for more than peaks.
//!
//! A part is what an interrupted process has of a chunk: the same with `SWEEPPRT`, and records of
//! some of the points, in order.

use super::error::StoreError;
use super::schema::Layout;
use washer_model::{Disturbance, Motion};
use washer_row::{Criterion, GrowingMode, Growth, Level, Metric, Outcome, Status, Trajectory};

const MAGIC: [u8; 8] = *b"SWEEPCHK";
const PART_MAGIC: [u8; 8] = *b"SWEEPPRT";
const FORMAT: u32 = 3;
const HEADER: usize = 8 + 4 + 4 + 4 + 32 + 3 * 8;
const HASH: usize = blake3::OUT_LEN;
const GROWTH_BYTES: usize = 3 * 8 + 2 * (4 + 4 + 8);

/// Flag bits of a record; the linear model's are three above the nonlinear one's.
const AMPLITUDES: u8 = 1;
const GAP: u8 = 1 << 1;
const FAIL_TIME: u8 = 1 << 2;
const LINEAR_SHIFT: u32 = 3;
const SENSITIVE_KNOWN: u8 = 1 << 6;
const SENSITIVE: u8 = 1 << 7;

/// How many numbers a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    /// Amplitudes a model.
    pub(crate) channels: u32,
    /// Metrics a model.
    pub(crate) metrics: u32,
    /// Whether there are ratios by turns, one a channel.
    pub(crate) by_turns: bool,
    /// Whether there is a static sag.
    pub(crate) with_sag: bool,
    /// Whether a disturbance is kept.
    pub(crate) with_growth: bool,
}

impl Shape {
    /// That of a result file's outcomes.
    pub(crate) fn of(layout: &Layout) -> Self {
        let count = |many: usize| u32::try_from(many).unwrap_or(u32::MAX);
        Self {
            channels: count(layout.channels.len()),
            metrics: count(layout.measures.of_model().count()),
            by_turns: layout.measures.criterion == Criterion::Envelope,
            with_sag: layout.measures.metrics.contains(&Metric::StaticSag),
            with_growth: layout.with_growth(),
        }
    }

    /// Bytes of a record.
    pub(crate) const fn bytes_a_point(&self) -> usize {
        let turn_ratios = if self.by_turns { self.channels as usize } else { 0 };
        let of_both = turn_ratios + self.with_sag as usize;
        let growth = if self.with_growth { GROWTH_BYTES } else { 0 };
        8 + 4 + 8 + 2 * (4 * 8 + 8 * (self.channels + self.metrics) as usize) + 8 * of_both + growth
    }
}

/// What a chunk's header must say to be the chunk that is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Hash of the plan.
    pub(crate) plan: blake3::Hash,
    /// Numbers of a record; the hash tells shapes with as many channels and metrics apart.
    pub(crate) shape: Shape,
    /// Index of the chunk.
    pub(crate) chunk: u64,
    /// Its first point.
    pub(crate) first: u64,
    /// Its number of points.
    pub(crate) count: u64,
}

impl Place {
    /// Bytes of the whole file.
    pub(crate) fn bytes(&self) -> u64 {
        self.count
            .saturating_mul(self.shape.bytes_a_point() as u64)
            .saturating_add((HEADER + HASH) as u64)
    }
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

/// The chunk's file.
pub(crate) fn encode(place: &Place, outcomes: &[Outcome]) -> Result<Vec<u8>, StoreError> {
    if outcomes.len() as u64 != place.count {
        return Err(reject(
            place,
            format!("{} outcomes for {} points", outcomes.len(), place.count),
        ));
    }
    for (outcome, point) in outcomes.iter().zip(place.first..) {
        if outcome.point != point {
            return Err(reject(
                place,
                format!("an outcome of point {} in the place of {point}", outcome.point),
            ));
        }
    }
    write(MAGIC, place, outcomes)
}

/// The file of a part of a chunk: outcomes of some of its points, in order.
pub(crate) fn encode_part(place: &Place, outcomes: &[Outcome]) -> Result<Vec<u8>, StoreError> {
    if !is_part(place, outcomes) {
        let reason = format!("{} outcomes that are no part of the chunk", outcomes.len());
        return Err(reject(place, reason));
    }
    write(PART_MAGIC, place, outcomes)
}

/// Whether these are some of a chunk's points, in order, and not all.
fn is_part(place: &Place, outcomes: &[Outcome]) -> bool {
    let points = place.first..place.first.saturating_add(place.count);
    (outcomes.len() as u64) < place.count
        && outcomes.iter().all(|outcome| points.contains(&outcome.point))
        && outcomes.is_sorted_by(|a, b| a.point < b.point)
}

fn write(magic: [u8; 8], place: &Place, outcomes: &[Outcome]) -> Result<Vec<u8>, StoreError> {
    let shape = &place.shape;
    let mut bytes = Vec::with_capacity(HEADER + outcomes.len() * shape.bytes_a_point() + HASH);
    bytes.extend_from_slice(&header(magic, place));
    for outcome in outcomes {
        let point = outcome.point;
        for (model, name) in [(&outcome.nonlinear, "nonlinear"), (&outcome.linear, "linear")] {
            let is_ok = model.status == Status::Ok;
            for (got, many, what) in [
                (model.amplitudes.len(), shape.channels, "amplitudes"),
                (model.metrics.len(), shape.metrics, "metrics"),
            ] {
                let expected = if is_ok { many as usize } else { 0 };
                if got != expected {
                    return Err(reject(
                        place,
                        format!(
                            "point {point}, {name} model: {got} {what} where {expected} belong"
                        ),
                    ));
                }
            }
        }
        record(outcome, shape, &mut bytes);
    }
    let hash = blake3::hash(&bytes);
    bytes.extend_from_slice(hash.as_bytes());
    Ok(bytes)
}

/// The outcomes in a chunk's file, if every byte is as it was written and it is the chunk looked
/// for.
pub(crate) fn decode(place: &Place, bytes: &[u8]) -> Result<Vec<Outcome>, Damage> {
    let outcomes = read(MAGIC, place, bytes)?;
    if outcomes.len() as u64 != place.count {
        return Err(Damage::Length);
    }
    let is_whole =
        outcomes.iter().zip(place.first..).all(|(outcome, point)| outcome.point == point);
    if is_whole { Ok(outcomes) } else { Err(Damage::Record) }
}

/// As [`decode`], of a part of the chunk.
pub(crate) fn decode_part(place: &Place, bytes: &[u8]) -> Result<Vec<Outcome>, Damage> {
    let outcomes = read(PART_MAGIC, place, bytes)?;
    if is_part(place, &outcomes) { Ok(outcomes) } else { Err(Damage::Record) }
}

fn read(magic: [u8; 8], place: &Place, bytes: &[u8]) -> Result<Vec<Outcome>, Damage> {
    let (body, hash) = bytes.split_last_chunk::<HASH>().ok_or(Damage::Length)?;
    if blake3::hash(body) != *hash {
        return Err(Damage::Hash);
    }
    let (found, records) = body.split_at_checked(HEADER).ok_or(Damage::Length)?;
    if found != header(magic, place) {
        return Err(Damage::Foreign);
    }
    let shape = &place.shape;
    let records = records.chunks_exact(shape.bytes_a_point());
    if !records.remainder().is_empty() {
        return Err(Damage::Length);
    }
    records.map(|bytes| read_record(bytes, shape).ok_or(Damage::Record)).collect()
}

fn header(magic: [u8; 8], place: &Place) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER);
    bytes.extend_from_slice(&magic);
    bytes.extend_from_slice(&FORMAT.to_le_bytes());
    bytes.extend_from_slice(&place.shape.channels.to_le_bytes());
    bytes.extend_from_slice(&place.shape.metrics.to_le_bytes());
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

fn record(outcome: &Outcome, shape: &Shape, bytes: &mut Vec<u8>) {
    let sensitive = match outcome.sensitive {
        None => 0,
        Some(false) => SENSITIVE_KNOWN,
        Some(true) => SENSITIVE_KNOWN | SENSITIVE,
    };
    bytes.extend_from_slice(&outcome.point.to_le_bytes());
    bytes.push(flags(&outcome.nonlinear) | flags(&outcome.linear) << LINEAR_SHIFT | sensitive);
    bytes.extend_from_slice(&[
        outcome.nonlinear.status as u8,
        outcome.linear.status as u8,
        outcome.method as u8,
    ]);
    bytes.extend_from_slice(&outcome.error.unwrap_or(f64::NAN).to_le_bytes());
    for model in [&outcome.nonlinear, &outcome.linear] {
        for number in [model.fail_time_s, model.min_gap_m] {
            bytes.extend_from_slice(&number.unwrap_or(0.0).to_le_bytes());
        }
        for number in [model.steps, model.rejected] {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        for (numbers, many) in
            [(&model.amplitudes, shape.channels), (&model.metrics, shape.metrics)]
        {
            for i in 0..many as usize {
                bytes.extend_from_slice(&numbers.get(i).copied().unwrap_or(0.0).to_le_bytes());
            }
        }
    }
    let mut optional = |number: Option<f64>| {
        bytes.extend_from_slice(&number.unwrap_or(f64::NAN).to_le_bytes());
    };
    if shape.by_turns {
        for i in 0..shape.channels as usize {
            optional(outcome.turn_ratios.get(i).copied().flatten());
        }
    }
    if shape.with_sag {
        optional(outcome.static_sag_m);
    }
    if shape.with_growth {
        write_growth(outcome.growth.as_ref(), bytes);
    }
}

/// Takes a fixed-length record apart; `None` where it makes no sense.
fn read_record(bytes: &[u8], shape: &Shape) -> Option<Outcome> {
    let mut rest = bytes;
    let point = u64::from_le_bytes(take(&mut rest)?);
    let [flags, nonlinear, linear, level] = take(&mut rest)?;
    let error = optional(&mut rest)?;
    let nonlinear = read_model(&mut rest, nonlinear, flags, shape)?;
    let linear = read_model(&mut rest, linear, flags >> LINEAR_SHIFT, shape)?;
    let both_ok = nonlinear.status == Status::Ok && linear.status == Status::Ok;
    let mut outcome = Outcome::new(point, nonlinear, linear);
    outcome.method = *Level::ALL.get(usize::from(level))?;
    outcome.error = error;
    outcome.sensitive = (flags & SENSITIVE_KNOWN != 0).then_some(flags & SENSITIVE != 0);
    if shape.by_turns {
        for _ in 0..shape.channels {
            let ratio = optional(&mut rest)?;
            if both_ok {
                outcome.turn_ratios.push(ratio);
            }
        }
    }
    if shape.with_sag {
        outcome.static_sag_m = optional(&mut rest)?;
    }
    if shape.with_growth {
        outcome.growth = read_growth(&mut rest)?;
    }
    Some(outcome)
}

fn write_growth(growth: Option<&Growth>, bytes: &mut Vec<u8>) {
    let (speed_rpm, multiplier, modes) = match growth {
        Some(growth) => (growth.fastest.speed_rpm, growth.fastest.multiplier, growth.modes),
        None => (f64::NAN, [0.0; 2], [None; 2]),
    };
    for number in [speed_rpm, multiplier[0], multiplier[1]] {
        bytes.extend_from_slice(&number.to_le_bytes());
    }
    for mode in modes {
        let none = GrowingMode { number: 0, name: 0, frequency_cpm: 0.0 };
        let GrowingMode { number, name, frequency_cpm } = mode.unwrap_or(none);
        bytes.extend_from_slice(&number.to_le_bytes());
        bytes.extend_from_slice(&name.to_le_bytes());
        bytes.extend_from_slice(&frequency_cpm.to_le_bytes());
    }
}

fn read_growth(rest: &mut &[u8]) -> Option<Option<Growth>> {
    let mut number = || Some(f64::from_le_bytes(take(rest)?));
    let fastest = Disturbance { speed_rpm: number()?, multiplier: [number()?, number()?] };
    let mut mode = || {
        let [number, name] = [u32::from_le_bytes(take(rest)?), u32::from_le_bytes(take(rest)?)];
        let frequency_cpm = f64::from_le_bytes(take(rest)?);
        let known = (name as usize) < Motion::NAMES.len();
        known.then_some((number > 0).then_some(GrowingMode { number, name, frequency_cpm }))
    };
    let modes = [mode()?, mode()?];
    Some((!fastest.speed_rpm.is_nan()).then_some(Growth { fastest, modes }))
}

/// A number, or none for NaN. Returns `None` at the end of the bytes.
fn optional(rest: &mut &[u8]) -> Option<Option<f64>> {
    let number = f64::from_le_bytes(take(rest)?);
    Some((!number.is_nan()).then_some(number))
}

fn read_model(rest: &mut &[u8], status: u8, flags: u8, shape: &Shape) -> Option<Trajectory> {
    let status = *Status::ALL.get(usize::from(status))?;
    let mut number = |present: u8| {
        let value = f64::from_le_bytes(take(rest)?);
        Some((flags & present != 0).then_some(value))
    };
    let (fail_time_s, min_gap_m) = (number(FAIL_TIME)?, number(GAP)?);
    let mut count = || Some(u64::from_le_bytes(take(rest)?));
    let (steps, rejected) = (count()?, count()?);
    let mut numbers = |many: u32| {
        let mut numbers = Vec::with_capacity(many as usize);
        for _ in 0..many {
            numbers.push(f64::from_le_bytes(take(rest)?));
        }
        Some(if flags & AMPLITUDES == 0 { Vec::new() } else { numbers })
    };
    let (amplitudes, metrics) = (numbers(shape.channels)?, numbers(shape.metrics)?);
    if (flags & AMPLITUDES != 0) != (status == Status::Ok) {
        return None;
    }
    Some(Trajectory {
        status,
        fail_time_s,
        amplitudes,
        min_gap_m,
        steps,
        rejected,
        metrics,
        turns: Vec::new(),
    })
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
        let shape =
            Shape { channels, metrics: 0, by_turns: false, with_sag: false, with_growth: false };
        Place { plan: blake3::hash(b"plan"), shape, chunk: 3, first: 48, count }
    }

    fn outcomes(place: &Place) -> Vec<Outcome> {
        (place.first..place.first + place.count)
            .map(|point| synthetic::outcome(point, place.shape.channels as usize))
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
            Place { shape: Shape { channels: 3, ..ours.shape }, ..ours },
            Place { shape: Shape { metrics: 1, ..ours.shape }, ..ours },
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
        let mut more = good.clone();
        more[0].nonlinear.metrics = vec![1.0];
        assert!(reason(&more).contains("1 metrics where 0 belong"), "{}", reason(&more));
    }

    #[test]
    fn a_part_is_some_points_in_order_and_no_chunk() {
        let place = place(4, 2);
        let all = outcomes(&place);
        for some in [&all[..0], &all[1..2], &all[..3]] {
            let bytes = encode_part(&place, some).unwrap();
            assert_eq!(decode_part(&place, &bytes).as_deref(), Ok(some));
            assert_eq!(decode(&place, &bytes), Err(Damage::Foreign));
            for at in 0..bytes.len() {
                let mut broken = bytes.clone();
                broken[at] ^= 1;
                assert_eq!(decode_part(&place, &broken), Err(Damage::Hash), "byte {at}");
                assert!(decode_part(&place, &bytes[..at]).is_err(), "cut to {at}");
            }
        }
        let elsewhere = [synthetic::outcome(place.first + 4, 2)];
        let backwards = [all[1].clone(), all[0].clone()];
        for wrong in [all.as_slice(), &elsewhere, &backwards] {
            assert!(encode_part(&place, wrong).is_err(), "{wrong:?}");
            let bytes = write(PART_MAGIC, &place, wrong).unwrap();
            assert_eq!(decode_part(&place, &bytes), Err(Damage::Record));
        }
        let whole = encode(&place, &all).unwrap();
        assert_eq!(decode_part(&place, &whole), Err(Damage::Foreign));
    }

    fn model(channels: usize, metrics: usize) -> impl Strategy<Value = Trajectory> {
        (
            prop::sample::select(Status::ALL.to_vec()),
            prop::option::of(any::<f64>()),
            prop::collection::vec(any::<f64>(), channels),
            prop::collection::vec(any::<f64>(), metrics),
            prop::option::of(any::<f64>()),
            any::<(u64, u64)>(),
        )
            .prop_map(
                |(status, fail_time_s, amplitudes, metrics, min_gap_m, (steps, rejected))| {
                    let is_ok = status == Status::Ok;
                    let kept = |numbers: Vec<f64>| if is_ok { numbers } else { Vec::new() };
                    let (amplitudes, metrics) = (kept(amplitudes), kept(metrics));
                    let turns = Vec::new();
                    Trajectory {
                        status,
                        fail_time_s,
                        amplitudes,
                        min_gap_m,
                        steps,
                        rejected,
                        metrics,
                        turns,
                    }
                },
            )
    }

    proptest! {
        #[test]
        fn whatever_goes_in_comes_out(
            rows in prop::collection::vec(
                (
                    model(3, 2),
                    model(3, 2),
                    any::<Option<bool>>(),
                    any::<[Option<f64>; 3]>(),
                    any::<Option<f64>>(),
                ),
                0..20,
            ),
            by_turns: bool,
            with_sag: bool,
            with_growth: bool,
        ) {
            let mut place = place(rows.len() as u64, 3);
            place.shape = Shape { metrics: 2, by_turns, with_sag, with_growth, ..place.shape };
            let outcomes: Vec<Outcome> = rows
                .into_iter()
                .zip(place.first..)
                .map(|((nonlinear, linear, sensitive, turn_ratios, static_sag_m), point)| {
                    let mut outcome = Outcome::new(point, nonlinear, linear);
                    outcome.sensitive = sensitive;
                    let models = [&outcome.nonlinear, &outcome.linear];
                    if by_turns && models.iter().all(|model| model.status == Status::Ok) {
                        let number = |ratio: Option<f64>| ratio.filter(|ratio| !ratio.is_nan());
                        outcome.turn_ratios = turn_ratios.map(number).to_vec();
                    }
                    outcome.static_sag_m = static_sag_m.filter(|sag_m| with_sag && !sag_m.is_nan());
                    let number = |number: Option<f64>| number.filter(|number| !number.is_nan());
                    let mode = GrowingMode { number: 2, name: 4, frequency_cpm: 150.0 };
                    let growth = |speed_rpm: f64| {
                        let multiplier = [number(turn_ratios[1]).unwrap_or(0.5), 1.0];
                        let fastest = Disturbance { speed_rpm, multiplier };
                        Growth { fastest, modes: [Some(mode), None] }
                    };
                    let speed_rpm = number(turn_ratios[0]).filter(|_| with_growth);
                    outcome.growth = speed_rpm.map(growth);
                    outcome
                })
                .collect();
            let bytes = encode(&place, &outcomes).unwrap();
            let back = decode(&place, &bytes).unwrap();
            // Through bytes, because NaN is not equal to itself.
            prop_assert_eq!(encode(&place, &back).unwrap(), bytes);
            let ratios = |outcomes: &[Outcome]| -> Vec<_> {
                outcomes.iter().map(|o| (o.turn_ratios.clone(), o.static_sag_m, o.growth)).collect()
            };
            prop_assert_eq!(ratios(&back), ratios(&outcomes));
        }

        #[test]
        fn any_bytes_at_all_are_answered(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            prop_assert!(decode(&place(1, 2), &bytes).is_err());
        }
    }
}
