//! Tests of the runner with an engine that computes rows by a formula: threads, shards,
//! interruptions, panics, and a folder that vanishes.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::store::synthetic;
use crate::{Evaluator, RowSink, RowSource};

const POINT_COUNT: u64 = 81;

/// An engine that calls a function before each point and counts the points that it has evaluated.
struct FormulaEngine<F: Fn(u64) + Sync> {
    before_point: F,
    evaluated_points: AtomicU64,
}

impl<F: Fn(u64) + Sync> FormulaEngine<F> {
    fn new(before_point: F) -> Self {
        Self { before_point, evaluated_points: AtomicU64::new(0) }
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
                self.evaluated_points.fetch_add(1, Ordering::Relaxed);
                sink(synthetic::point_rows(point));
            }
        });
    }
}

/// Runs a job with the engine of a formula.
fn run_job(
    formula: &FormulaEngine<impl Fn(u64) + Sync>,
    job: &Job<'_>,
    output: &Path,
    options: RunOptions<'_>,
    interrupt: &Interrupt,
) -> Result<RunReport, StoreError> {
    super::run(&Engine::new(formula, "none"), job, output, options, interrupt)
}

fn run_options(threads: usize) -> RunOptions<'static> {
    RunOptions {
        threads,
        starts_over: false,
        shard: None,
        progress: ProgressMode::None,
        environment: &|_| None,
        show_message: &|_| {},
    }
}

fn result_path(test_folder: &tempfile::TempDir) -> PathBuf {
    test_folder.path().join("x.parquet")
}

/// Runs a job without interruption on a number of threads, and returns the bytes of the result.
fn uninterrupted_result_bytes(points: u64, threads: usize) -> Vec<u8> {
    let test_folder = tempfile::tempdir().unwrap();
    let report = run_job(
        &FormulaEngine::new(|_| {}),
        &synthetic::job(points),
        &result_path(&test_folder),
        run_options(threads),
        &Interrupt::new(),
    )
    .unwrap();
    assert!(matches!(report.end, RunEnd::Finished(_)), "{report:?}");
    assert_eq!(report.session.unwrap().points, points);
    fs::read(result_path(&test_folder)).unwrap()
}

#[test]
fn strides_visit_every_chunk_once_in_long_steps() {
    for chunks in [1, 2, 3, 4, 41, 42, 1000, 4096] {
        let stride = chunk_stride(chunks);
        let visit_order: Vec<u64> = (0..chunks).map(|k| k * stride % chunks).collect();
        let mut sorted_order = visit_order.clone();
        sorted_order.sort_unstable();
        assert_eq!(sorted_order, (0..chunks).collect::<Vec<_>>());
        let are_far_apart =
            visit_order.windows(2).all(|pair| pair[0].abs_diff(pair[1]) > chunks / 4);
        assert!(are_far_apart || chunks < 5, "{visit_order:?}");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let expected_bytes = uninterrupted_result_bytes(1000, 1);
    for threads in [2, 4] {
        assert!(uninterrupted_result_bytes(1000, threads) == expected_bytes, "{threads} threads");
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_shards() {
    let expected_bytes = uninterrupted_result_bytes(POINT_COUNT, 1);
    for count in [1, 2, 3, 20] {
        let test_folder = tempfile::tempdir().unwrap();
        let job = synthetic::job(POINT_COUNT);
        for index in (1..=count).rev() {
            let shard = Some(ShardRequest::Given(Shard { index, count }));
            let engine = FormulaEngine::new(|_| {});
            let report = run_job(
                &engine,
                &job,
                &result_path(&test_folder),
                RunOptions { shard, ..run_options(2) },
                &Interrupt::new(),
            )
            .unwrap();
            assert!(
                matches!(report.end, RunEnd::Shard(done, _) if done.index == index),
                "{report:?}"
            );
        }
        let engine = FormulaEngine::new(|_| {});
        run_job(&engine, &job, &result_path(&test_folder), run_options(1), &Interrupt::new())
            .unwrap();
        assert_eq!(engine.evaluated_points.into_inner(), 0, "the shards left nothing to compute");
        assert!(fs::read(result_path(&test_folder)).unwrap() == expected_bytes, "{count} shards");
    }
}

#[test]
fn a_run_interrupted_at_any_point_is_resumed_to_the_same_bytes() {
    let expected_bytes = uninterrupted_result_bytes(POINT_COUNT, 1);
    let job = synthetic::job(POINT_COUNT);
    // Chunks have eight points, so that some runs are interrupted at the edge of a chunk and others
    // within one.
    for interrupted_point in (0..POINT_COUNT).step_by(4) {
        let test_folder = tempfile::tempdir().unwrap();
        let interrupt = Interrupt::new();
        let interrupting_engine = FormulaEngine::new(|point| {
            if point == interrupted_point {
                interrupt.raise(15);
            }
        });
        let report = run_job(
            &interrupting_engine,
            &job,
            &result_path(&test_folder),
            run_options(1),
            &interrupt,
        )
        .unwrap();
        let RunEnd::Interrupted { signal: 15, stored_points, points: POINT_COUNT } = report.end
        else {
            panic!("{report:?}")
        };
        let evaluated_points = interrupting_engine.evaluated_points.into_inner();
        assert_eq!(stored_points, evaluated_points, "rows of incomplete chunks are stored too");
        assert!(!result_path(&test_folder).exists());
        let resumed_engine = FormulaEngine::new(|_| {});
        run_job(
            &resumed_engine,
            &job,
            &result_path(&test_folder),
            run_options(2),
            &Interrupt::new(),
        )
        .unwrap();
        assert_eq!(resumed_engine.evaluated_points.into_inner(), POINT_COUNT - stored_points);
        assert!(
            fs::read(result_path(&test_folder)).unwrap() == expected_bytes,
            "interrupted at {interrupted_point}"
        );
    }
}

#[test]
fn a_finished_run_is_not_repeated() {
    let test_folder = tempfile::tempdir().unwrap();
    let job = synthetic::job(POINT_COUNT);
    run_job(
        &FormulaEngine::new(|_| {}),
        &job,
        &result_path(&test_folder),
        run_options(2),
        &Interrupt::new(),
    )
    .unwrap();
    let second_engine = FormulaEngine::new(|_| {});
    let report = run_job(
        &second_engine,
        &job,
        &result_path(&test_folder),
        run_options(2),
        &Interrupt::new(),
    )
    .unwrap();
    assert!(matches!(report.end, RunEnd::AlreadyFinished(..)), "{report:?}");
    assert_eq!(second_engine.evaluated_points.into_inner(), 0);
}

#[test]
fn a_panic_of_the_engine_loses_only_unfinished_rows() {
    let test_folder = tempfile::tempdir().unwrap();
    let job = synthetic::job(POINT_COUNT);
    let engine = FormulaEngine::new(|point| assert_ne!(point, 20, "twenty is too much"));
    let error =
        run_job(&engine, &job, &result_path(&test_folder), run_options(1), &Interrupt::new())
            .unwrap_err();
    let stored_points = engine.evaluated_points.into_inner();
    assert!(stored_points >= 4, "points 16 to 19 come before the panic");
    assert!(!error.is_refusal());
    let text = error.to_string();
    assert!(text.contains("points 16 to 23") && text.contains("twenty is too much"), "{text}");
    let resumed_engine = FormulaEngine::new(|_| {});
    run_job(&resumed_engine, &job, &result_path(&test_folder), run_options(2), &Interrupt::new())
        .unwrap();
    assert_eq!(
        resumed_engine.evaluated_points.into_inner(),
        POINT_COUNT - stored_points,
        "the rows before the panic are kept"
    );
    assert!(
        fs::read(result_path(&test_folder)).unwrap() == uninterrupted_result_bytes(POINT_COUNT, 1)
    );
}

#[test]
fn a_folder_that_vanishes_ends_the_run_with_an_error() {
    let test_folder = tempfile::tempdir().unwrap();
    let job = synthetic::job(1000);
    let partial_folder = test_folder.path().join("x.parquet.partial");
    let moved_folder = test_folder.path().join("gone");
    let engine = FormulaEngine::new(|point| {
        if point == 40 {
            while !partial_folder.join("part-00000000.parquet").exists() {
                std::thread::yield_now();
            }
            fs::rename(&partial_folder, &moved_folder).unwrap();
        }
    });
    let error =
        run_job(&engine, &job, &result_path(&test_folder), run_options(1), &Interrupt::new())
            .unwrap_err();
    let text = error.to_string();
    assert!(text.contains("x.parquet.partial") && text.contains("bring it back"), "{text}");
    assert!(engine.evaluated_points.into_inner() < 1000, "the run ends early");
    fs::rename(&moved_folder, &partial_folder).unwrap();
    let resumed_engine = FormulaEngine::new(|_| {});
    run_job(&resumed_engine, &job, &result_path(&test_folder), run_options(2), &Interrupt::new())
        .unwrap();
    assert!(resumed_engine.evaluated_points.into_inner() < 1000, "the rows of the folder are used");
    assert!(fs::read(result_path(&test_folder)).unwrap() == uninterrupted_result_bytes(1000, 1));
}
