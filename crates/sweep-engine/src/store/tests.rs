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
const POINT_COUNT: u64 = 81;

/// A temporary folder for the result of a test.
struct TestFolder(TempDir);

impl TestFolder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Returns the path of the result.
    fn result_path(&self) -> PathBuf {
        self.0.path().join("x.parquet")
    }

    /// Returns the folder of unfinished work.
    fn partial_folder(&self) -> PathBuf {
        self.0.path().join("x.parquet.partial")
    }
}

fn default_options() -> OpenOptions<'static> {
    OpenOptions { starts_over: false, shard: None, environment: &|_| None }
}

fn open_run(output: &Path, job: &Job<'_>) -> OpenRun {
    match OpenRun::open(output, job, default_options()).unwrap() {
        OpenOutcome::Open(run) => run,
        OpenOutcome::Finished((file, _)) => panic!("finished: {file:?}"),
    }
}

/// Writes a complete chunk.
fn write_complete_chunk(run: &OpenRun, chunk: u64) {
    let chunk_rows: Vec<_> = run.chunk_range(chunk).map(synthetic::point_rows).collect();
    run.write_chunk(&synthetic::job(POINT_COUNT), chunk, chunk_rows).unwrap();
}

/// Returns the bytes of a complete chunk's part.
fn part_bytes(job: &Job<'_>, chunk: u64) -> Vec<u8> {
    let test_folder = TestFolder::new();
    let run = open_run(&test_folder.result_path(), job);
    write_complete_chunk(&run, chunk);
    fs::read(test_folder.partial_folder().join(part_name(chunk))).unwrap()
}

/// Writes all missing chunks, and returns their number.
fn write_missing_chunks(run: &OpenRun) -> u64 {
    (0..run.chunk_count())
        .filter(|&chunk| run.is_missing(chunk))
        .inspect(|&chunk| write_complete_chunk(run, chunk))
        .count() as u64
}

/// Joins the parts and completes the run. Returns the counts of the result and the notes for the
/// user.
fn finish_run(mut run: OpenRun, job: &Job<'_>) -> (Tally, Vec<String>) {
    let tally = run.join(job, &|| false).unwrap().unwrap();
    let notes = run.complete(job, &tally, None).unwrap();
    (tally, notes)
}

/// Returns the bytes of a result that one process has computed without interruption.
fn uninterrupted_result_bytes(points: u64) -> Vec<u8> {
    let test_folder = TestFolder::new();
    let job = synthetic::job(points);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    assert!(!test_folder.partial_folder().exists());
    fs::read(test_folder.result_path()).unwrap()
}

/// Returns the columns of a search's trials.
fn trial_columns() -> TrialColumns {
    let axis_column = |name: &str| DeclaredColumn::new(name, "1", "a parameter", CellType::Axis);
    let value_columns = vec![DeclaredColumn::new("distance", "1", "an answer", CellType::Measured)];
    TrialColumns { key_columns: ["x", "y"].map(axis_column).to_vec(), value_columns }
}

/// Opens the trials of a search.
fn open_trials(output: &Path, job: &Job<'_>) -> Trials {
    match Trials::open(output, job, trial_columns(), false).unwrap() {
        OpenOutcome::Open(trials) => trials,
        OpenOutcome::Finished(()) => panic!("is not done"),
    }
}

fn read_batches(path: &Path) -> Vec<RecordBatch> {
    let file = ParquetFile::open(path).unwrap();
    let column_indices = (0..file.schema().fields().len()).collect();
    file.batches(column_indices).unwrap().map(Result::unwrap).collect()
}
