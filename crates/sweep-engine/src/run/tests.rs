//! Tests of the runner with an engine that evaluates a formula: threads, shards, interruptions,
//! panics, a failing disk.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::store::synthetic;
use crate::{Evaluator, RowSink, RowSource};

const POINTS: u64 = 81;

/// Calls `on_point` before each point.
struct Formula<F: Fn(u64) + Sync> {
    on_point: F,
    evaluated: AtomicU64,
}

impl<F: Fn(u64) + Sync> Formula<F> {
    fn new(on_point: F) -> Self {
        Self { on_point, evaluated: AtomicU64::new(0) }
    }
}

impl<F: Fn(u64) + Sync> Evaluator for &Formula<F> {
    fn evaluate(&self, source: &RowSource<'_>, sink: &RowSink<'_>, context: &RunContext<'_>) {
        rayon::broadcast(|_| {
            while let Some((point, _)) = source() {
                (self.on_point)(point);
                if context.stopped() {
                    return;
                }
                self.evaluated.fetch_add(1, Ordering::Relaxed);
                sink(synthetic::done(point));
            }
        });
    }
}

/// Runs a job with the engine of a formula.
fn run(
    formula: &Formula<impl Fn(u64) + Sync>,
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

/// Runs whole with this many threads and returns the bytes.
fn whole(points: u64, threads: usize) -> Vec<u8> {
    let home = tempfile::tempdir().unwrap();
    let report = run(
        &Formula::new(|_| {}),
        &synthetic::job(points),
        &output(&home),
        options(threads),
        &Interrupt::new(),
    )
    .unwrap();
    assert!(matches!(report.ended, Ended::Finished(_)), "{report:?}");
    assert_eq!(report.session.unwrap().points, points);
    fs::read(output(&home)).unwrap()
}

#[test]
fn strides_take_every_chunk_once_each_far_from_the_last() {
    for chunks in [1, 2, 3, 4, 41, 42, 1000, 4096] {
        let stride = stride(chunks);
        let order: Vec<u64> = (0..chunks).map(|k| k * stride % chunks).collect();
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..chunks).collect::<Vec<_>>());
        let is_far = order.windows(2).all(|pair| pair[0].abs_diff(pair[1]) > chunks / 4);
        assert!(is_far || chunks < 5, "{order:?}");
    }
}

#[test]
fn same_bytes_for_1_2_and_4_threads() {
    let bytes = whole(1000, 1);
    for threads in [2, 4] {
        assert!(whole(1000, threads) == bytes, "{threads} threads");
    }
}

#[test]
fn same_bytes_for_any_number_of_shards() {
    let bytes = whole(POINTS, 1);
    for of in [1, 2, 3, 20] {
        let home = tempfile::tempdir().unwrap();
        let job = synthetic::job(POINTS);
        for index in (1..=of).rev() {
            let shard = Some(ShardRequest::Given(Shard { index, of }));
            let engine = Formula::new(|_| {});
            let report = run(
                &engine,
                &job,
                &output(&home),
                RunOptions { shard, ..options(2) },
                &Interrupt::new(),
            )
            .unwrap();
            assert!(
                matches!(report.ended, Ended::Shard(done, _) if done.index == index),
                "{report:?}"
            );
        }
        let engine = Formula::new(|_| {});
        run(&engine, &job, &output(&home), options(1), &Interrupt::new()).unwrap();
        assert_eq!(engine.evaluated.into_inner(), 0, "the shards left nothing to compute");
        assert!(fs::read(output(&home)).unwrap() == bytes, "{of} shards");
    }
}

#[test]
fn interrupted_at_any_point_it_goes_on_and_ends_in_the_same_bytes() {
    let bytes = whole(POINTS, 1);
    let job = synthetic::job(POINTS);
    // Chunks hold eight points: at their edges and in their middle.
    for at in (0..POINTS).step_by(4) {
        let home = tempfile::tempdir().unwrap();
        let interrupt = Interrupt::new();
        let stopping = Formula::new(|point| {
            if point == at {
                interrupt.raise(15);
            }
        });
        let report = run(&stopping, &job, &output(&home), options(1), &interrupt).unwrap();
        let Ended::Interrupted { signal: 15, kept, points: POINTS } = report.ended else {
            panic!("{report:?}")
        };
        let evaluated = stopping.evaluated.into_inner();
        assert_eq!(kept, evaluated, "every row is kept, of the chunk in hand too");
        assert!(!output(&home).exists());
        let resumed = Formula::new(|_| {});
        run(&resumed, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
        assert_eq!(resumed.evaluated.into_inner(), POINTS - kept);
        assert!(fs::read(output(&home)).unwrap() == bytes, "interrupted at {at}");
    }
}

#[test]
fn done_is_done() {
    let home = tempfile::tempdir().unwrap();
    let job = synthetic::job(POINTS);
    run(&Formula::new(|_| {}), &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    let again = Formula::new(|_| {});
    let report = run(&again, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    assert!(matches!(report.ended, Ended::Already(..)), "{report:?}");
    assert_eq!(again.evaluated.into_inner(), 0);
}

#[test]
fn a_panic_that_leaves_the_engine_costs_what_it_had_not_handed_over() {
    let home = tempfile::tempdir().unwrap();
    let job = synthetic::job(POINTS);
    let engine = Formula::new(|point| assert_ne!(point, 20, "twenty is too much"));
    let error = run(&engine, &job, &output(&home), options(1), &Interrupt::new()).unwrap_err();
    let there = engine.evaluated.into_inner();
    assert!(there >= 4, "those of its chunk came before it");
    assert!(!error.is_refusal());
    let text = error.to_string();
    assert!(text.contains("points 16 to 23") && text.contains("twenty is too much"), "{text}");
    let mended = Formula::new(|_| {});
    run(&mended, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    assert_eq!(mended.evaluated.into_inner(), POINTS - there, "the rows before it are kept");
    assert!(fs::read(output(&home)).unwrap() == whole(POINTS, 1));
}

#[test]
fn a_folder_that_vanishes_ends_the_run_with_its_path_and_advice() {
    let home = tempfile::tempdir().unwrap();
    let job = synthetic::job(1000);
    let partial = home.path().join("x.parquet.partial");
    let gone = home.path().join("gone");
    let engine = Formula::new(|point| {
        if point == 40 {
            while !partial.join("part-00000000.parquet").exists() {
                std::thread::yield_now();
            }
            fs::rename(&partial, &gone).unwrap();
        }
    });
    let error = run(&engine, &job, &output(&home), options(1), &Interrupt::new()).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("x.parquet.partial") && text.contains("bring it back"), "{text}");
    assert!(engine.evaluated.into_inner() < 1000, "what cannot be kept is not computed");
    fs::rename(&gone, &partial).unwrap();
    let resumed = Formula::new(|_| {});
    run(&resumed, &job, &output(&home), options(2), &Interrupt::new()).unwrap();
    assert!(resumed.evaluated.into_inner() < 1000, "what came back is used");
    assert!(fs::read(output(&home)).unwrap() == whole(1000, 1));
}
