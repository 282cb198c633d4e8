//! Tests of the runner with an engine that computes rows by a formula: threads, shards,
//! interruptions, panics, and a folder that vanishes.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::store::synthetic;
use crate::{Evaluator, RowSink, RowSource};

const POINTS: u64 = 81;

/// An engine that calls a function before each point and counts the points that it has evaluated.
struct FormulaEngine<F: Fn(u64) + Sync> {
    before_point: F,
    evaluated: AtomicU64,
}

impl<F: Fn(u64) + Sync> FormulaEngine<F> {
    fn new(before_point: F) -> Self {
        Self { before_point, evaluated: AtomicU64::new(0) }
    }
}

impl<F: Fn(u64) + Sync> Evaluator for &FormulaEngine<F> {
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>) {
        rayon::broadcast(|_| {
            while let Some((point, _)) = source() {
                (self.before_point)(point);
                if context.must_stop() {
                    return;
                }
                self.evaluated.fetch_add(1, Ordering::Relaxed);
                sink(synthetic::point_rows(point));
            }
        });
    }
}

/// Runs a job with the engine of a formula.
fn run(
    formula: &FormulaEngine<impl Fn(u64) + Sync>,
    job: &Job<'_>,
    output: &Path,
    options: RunOptions<'_>,
    interrupt: &Interrupt,
) -> Result<RunReport, StoreError> {
    super::run(&Engine::new(formula, "none"), job, output, options, interrupt)
}

fn options(threads: usize) -> RunOptions<'static> {
    RunOptions {
        threads,
        fresh: false,
        shard: None,
        progress: ProgressMode::None,
        environment: &|_| None,
        tell: &|_| {},
    }
}

fn output(home: &tempfile::TempDir) -> PathBuf {
    home.path().join("x.parquet")
}

/// Runs a job without interruption on a number of threads, and returns the bytes of the result.
fn whole_run(points: u64, threads: usize) -> Vec<u8> {
    let home = tempfile::tempdir().unwrap();
    let report = run(
        &FormulaEngine::new(|_| {}),
        &synthetic::job(points),
        &output(&home),
        options(threads),
        &Interrupt::new(),
    )
    .unwrap();
    assert!(matches!(report.end, RunEnd::Finished(_)), "{report:?}");
    assert_eq!(report.session.unwrap().points, points);
    fs::read(output(&home)).unwrap()
}

#[test]
fn strides_visit_every_chunk_once_in_long_steps() {
    for chunks in [1, 2, 3, 4, 41, 42, 1000, 4096] {
        let stride = chunk_stride(chunks);
        let order: Vec<u64> = (0..chunks).map(|k| k * stride % chunks).collect();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..chunks).collect::<Vec<_>>());
        let is_far = order.windows(2).all(|pair| pair[0].abs_diff(pair[1]) > chunks / 4);
        assert!(is_far || chunks < 5, "{order:?}");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let bytes = whole_run(1000, 1);
    for threads in [2, 4] {
        assert!(whole_run(1000, threads) == bytes, "{threads} threads");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_shards() {
    let bytes = whole_run(POINTS, 1);
    for count in [1, 2, 3, 20] {
        let home = tempfile::tempdir().unwrap();
        let job = synthetic::job(POINTS);
        for index in (1..=count).rev() {
            let shard = Some(ShardRequest::Given(Shard { index, count }));
            let engine = FormulaEngine::new(|_| {});
            let report = run(
                &engine,
                &job,
                &output(&home),
                RunOptions { shard, ..options(2) },
                &Interrupt::new(),
            )
            .unwrap();
            assert!(
                matches!(report.end, RunEnd::Shard(done, _) if done.index == index),
                "{report:?}"
            );
        }
        let engine = FormulaEngine::new(|_| {});
        run(&engine, &job, &output(&home), options(1), &Interrupt::new()).unwrap();
        assert_eq!(engine.evaluated.into_inner(), 0, "the shards left nothing to compute");
        assert!(fs::read(output(&home)).unwrap() == bytes, "{count} shards");
    }
}

#[test]
fn a_run_interrupted_at_any_point_is_resumed_to_the_same_bytes() {
    let bytes = whole_run(POINTS, 1);
    let job = synthetic::job(POINTS);
    // Chunks have eight points, so that some runs are interrupted at the edge of a chunk and others
    // within one.
    for interrupted_point in (0..POINTS).step_by(4) {
        let home = tempfile::tempdir().unwrap();
        let interrupt = Interrupt::new();
        let interrupting_engine = FormulaEngine::new(|point| {
            if point == interrupted_point {
                interrupt.raise(15);
            }
        });
        let report =
            run(&interrupting_engine, &job, &output(&home), options(1), &interrupt).unwrap();
        let RunEnd::Interrupted { signal: 15, stored_points, points: POINTS } = report.end else {
            panic!("{report:?}")
        };
        let evaluated = interrupting_engine.evaluated.into_inner();
        assert_eq!(stored_points, evaluated, "rows of incomplete chunks are stored_points too");
        assert!(!output(&home).exists());
        let resumed_engine = FormulaEngine::new(|_| {});
        run(&resumed_engine, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
        assert_eq!(resumed_engine.evaluated.into_inner(), POINTS - stored_points);
        assert!(fs::read(output(&home)).unwrap() == bytes, "interrupted at {interrupted_point}");
    }
}

#[test]
fn a_finished_run_is_not_repeated() {
    let home = tempfile::tempdir().unwrap();
    let job = synthetic::job(POINTS);
    run(&FormulaEngine::new(|_| {}), &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    let second_engine = FormulaEngine::new(|_| {});
    let report = run(&second_engine, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    assert!(matches!(report.end, RunEnd::AlreadyFinished(..)), "{report:?}");
    assert_eq!(second_engine.evaluated.into_inner(), 0);
}

#[test]
fn a_panic_of_the_engine_loses_only_unfinished_rows() {
    let home = tempfile::tempdir().unwrap();
    let job = synthetic::job(POINTS);
    let engine = FormulaEngine::new(|point| assert_ne!(point, 20, "twenty is too much"));
    let error = run(&engine, &job, &output(&home), options(1), &Interrupt::new()).unwrap_err();
    let stored = engine.evaluated.into_inner();
    assert!(stored >= 4, "points 16 to 19 come before the panic");
    assert!(!error.is_refusal());
    let text = error.to_string();
    assert!(text.contains("points 16 to 23") && text.contains("twenty is too much"), "{text}");
    let resumed_engine = FormulaEngine::new(|_| {});
    run(&resumed_engine, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    assert_eq!(
        resumed_engine.evaluated.into_inner(),
        POINTS - stored,
        "the rows before the panic are kept"
    );
    assert!(fs::read(output(&home)).unwrap() == whole_run(POINTS, 1));
}

#[test]
fn a_folder_that_vanishes_ends_the_run_with_an_error() {
    let home = tempfile::tempdir().unwrap();
    let job = synthetic::job(1000);
    let partial = home.path().join("x.parquet.partial");
    let moved_folder = home.path().join("gone");
    let engine = FormulaEngine::new(|point| {
        if point == 40 {
            while !partial.join("part-00000000.parquet").exists() {
                std::thread::yield_now();
            }
            fs::rename(&partial, &moved_folder).unwrap();
        }
    });
    let error = run(&engine, &job, &output(&home), options(1), &Interrupt::new()).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("x.parquet.partial") && text.contains("bring it back"), "{text}");
    assert!(engine.evaluated.into_inner() < 1000, "the run ends early");
    fs::rename(&moved_folder, &partial).unwrap();
    let resumed_engine = FormulaEngine::new(|_| {});
    run(&resumed_engine, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    assert!(resumed_engine.evaluated.into_inner() < 1000, "the rows of the folder are used");
    assert!(fs::read(output(&home)).unwrap() == whole_run(1000, 1));
}
