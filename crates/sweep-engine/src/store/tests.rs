//! Tests of the store as a whole: interruptions, damage and shards do not change the bytes of a
//! result.

use std::fs;
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt64Type};
use arrow_array::{Array, RecordBatch};
use proptest::prelude::*;
use serde_json::json;
use tempfile::TempDir;

use super::*;
use sweep_files::{FileError, ParquetFile, cells};

mod other_files;
mod parts;
mod plans;
mod result;

/// The number of points of a job in most tests: ten full chunks and one of a single point.
const POINTS: u64 = 81;

/// A temporary folder for the result of a test.
struct Home(TempDir);

impl Home {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Returns the path of the result.
    fn output(&self) -> PathBuf {
        self.0.path().join("x.parquet")
    }

    /// Returns the folder of unfinished work.
    fn partial(&self) -> PathBuf {
        self.0.path().join("x.parquet.partial")
    }
}

fn options() -> OpenOptions<'static> {
    OpenOptions { fresh: false, shard: None, environment: &|_| None }
}

fn open(output: &Path, job: &Job<'_>) -> OpenRun {
    match OpenRun::open(output, job, options()).unwrap() {
        OpenOutcome::Open(run) => run,
        OpenOutcome::Finished((file, _)) => panic!("finished: {file:?}"),
    }
}

/// Writes a complete chunk.
fn write(run: &OpenRun, chunk: u64) {
    let outcomes: Vec<_> = run.chunk_range(chunk).map(synthetic::point_rows).collect();
    run.write_chunk(&synthetic::job(POINTS), chunk, outcomes).unwrap();
}

/// Returns the bytes of a complete chunk's part.
fn part_bytes(job: &Job<'_>, chunk: u64) -> Vec<u8> {
    let home = Home::new();
    let run = open(&home.output(), job);
    write(&run, chunk);
    fs::read(home.partial().join(part_name(chunk))).unwrap()
}

/// Writes all missing chunks, and returns their number.
fn write_missing(run: &OpenRun) -> u64 {
    (0..run.chunks())
        .filter(|&chunk| run.is_missing(chunk))
        .inspect(|&chunk| write(run, chunk))
        .count() as u64
}

/// Joins the parts and completes the run. Returns the counts of the result and the notes for the
/// user.
fn finish(mut run: OpenRun, job: &Job<'_>) -> (Tally, Vec<String>) {
    let tally = run.join(job, &|| false).unwrap().unwrap();
    let notes = run.complete(job, &tally, None).unwrap();
    (tally, notes)
}

/// Returns the bytes of a result that one process has computed without interruption.
fn uninterrupted_result(points: u64) -> Vec<u8> {
    let home = Home::new();
    let job = synthetic::job(points);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    assert!(!home.partial().exists());
    fs::read(home.output()).unwrap()
}

/// Returns the columns of a search's trials.
fn trial_columns() -> TrialColumns {
    let axis = |name: &str| DeclaredColumn::new(name, "1", "a parameter", CellType::Axis);
    let responses = vec![DeclaredColumn::new("distance", "1", "an answer", CellType::Measured)];
    TrialColumns { keys: ["x", "y"].map(axis).to_vec(), responses }
}

/// Opens the trials of a search.
fn trials(output: &Path, job: &Job<'_>) -> Trials {
    match Trials::open(output, job, trial_columns(), false).unwrap() {
        OpenOutcome::Open(trials) => trials,
        OpenOutcome::Finished(()) => panic!("is not done"),
    }
}

fn batches(path: &Path) -> Vec<RecordBatch> {
    let file = ParquetFile::open(path).unwrap();
    let all_columns = (0..file.schema().fields().len()).collect();
    file.batches(all_columns).unwrap().map(Result::unwrap).collect()
}
