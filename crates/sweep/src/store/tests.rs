//! The store as a whole: the same bytes whatever happens on the way.

use std::fs;
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt64Type};
use arrow_array::{Array, RecordBatch};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use proptest::prelude::*;
use serde_json::json;
use tempfile::TempDir;

use super::merge::Joined;
use super::*;
use crate::verdict::{ROW_STATUSES, Verdict, row_status};
use sweep_files::FileError;
use sweep_files::cells;

const POINTS: u64 = 81;

struct Home(TempDir);

impl Home {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn output(&self) -> PathBuf {
        self.0.path().join("x.parquet")
    }

    fn partial(&self) -> PathBuf {
        self.0.path().join("x.parquet.partial")
    }
}

fn options() -> OpenOptions<'static> {
    OpenOptions { fresh: false, shard: None, environment: &|_| None }
}

fn open(output: &Path, job: &Job<'_>) -> OpenRun {
    match OpenRun::open(output, job, options()).unwrap() {
        Opened::Run(run) => *run,
        Opened::Finished(file, _) => panic!("finished: {file:?}"),
    }
}

fn write(run: &OpenRun, chunk: u64) {
    let outcomes: Vec<_> =
        run.chunk_range(chunk).map(|point| synthetic::outcome(point, 2)).collect();
    run.write_chunk(chunk, &outcomes).unwrap();
}

fn write_missing(run: &OpenRun) -> u64 {
    (0..run.chunks())
        .filter(|&chunk| run.is_missing(chunk))
        .inspect(|&chunk| write(run, chunk))
        .count() as u64
}

fn finish(mut run: OpenRun, job: &Job<'_>) -> Joined {
    let tally = run.join(job, &|| false).unwrap().unwrap();
    run.complete(job, tally, None).unwrap()
}

/// The bytes of an undisturbed run.
fn undisturbed(points: u64) -> Vec<u8> {
    let (home, job) = (Home::new(), synthetic::job(points));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    assert!(!home.partial().exists());
    fs::read(home.output()).unwrap()
}

fn batches(path: &Path) -> Vec<RecordBatch> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap()).unwrap();
    reader.with_batch_size(1 << 20).build().unwrap().map(Result::unwrap).collect()
}

#[test]
fn chunk_sizes_feed_small_grids_to_all_cores_and_bound_large_ones() {
    let sizes: Vec<u64> =
        [1, 81, 128, 129, 1287, 100_000, 1_000_000, 1 << 40, u64::MAX].map(chunk_points).to_vec();
    assert_eq!(sizes, [8, 8, 8, 32, 32, 128, 1024, 4096, 4096]);
}

#[test]
fn chunk_names_stand_for_chunks_and_nothing_else_does() {
    for chunk in [0, 7, 99_999_999, 100_000_000, u64::MAX] {
        assert_eq!(chunk_of_name(&chunk_name(chunk)), Some(chunk));
    }
    for name in ["chunk-7.bin", "chunk-00000007.bin.damaged", "chunk-+0000007.bin", "plan.json"] {
        assert_eq!(chunk_of_name(name), None, "{name}");
    }
}

#[test]
fn every_cell_is_what_the_outcome_says() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let batch = &batches(&home.output())[0];
    assert_eq!(batch.num_rows() as u64, POINTS);
    let number = |name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_primitive::<Float64Type>().clone();
        column.is_valid(row).then(|| column.value(row))
    };
    let text = |name: &str, row: usize| {
        let column = cells::texts(batch.column_by_name(name).unwrap()).unwrap();
        column[row].map(str::to_owned)
    };
    let flag = |name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_boolean();
        column.is_valid(row).then(|| column.value(row))
    };
    let count = |name: &str, row: usize| {
        batch.column_by_name(name).unwrap().as_primitive::<UInt64Type>().value(row)
    };
    let mut statuses = std::collections::BTreeSet::new();
    for row in 0..POINTS as usize {
        let outcome = synthetic::outcome(row as u64, 2);
        let verdict = Verdict::new(&outcome, 2, 2.0);
        let (status, fail_time_s) = row_status(&outcome);
        statuses.insert(status);
        assert_eq!(count("point", row), row as u64);
        let axes = (job.axis_values)(row as u64);
        assert_eq!(number("unbalance_mass_kg", row), Some(axes[0]));
        assert_eq!(number("damping_n_s_per_m", row), Some(axes[1]));
        assert_eq!(number("nonlinear_tub_yaw", row), outcome.nonlinear.amplitudes.get(1).copied());
        assert_eq!(number("linear_tub_front_y", row), outcome.linear.amplitudes.first().copied());
        assert_eq!(number("ratio_tub_front_y", row), verdict.ratios[0]);
        assert_eq!(number("ratio_max", row), verdict.greatest.map(|(_, ratio)| ratio));
        let channel =
            verdict.greatest.map(|(channel, _)| job.layout.channels[channel].name().to_owned());
        assert_eq!(text("ratio_max_channel", row), channel);
        assert_eq!(flag("reliable", row), verdict.reliable);
        assert_eq!(flag("sensitive", row), outcome.sensitive);
        assert_eq!(text("method", row).as_deref(), Some(outcome.method.name()));
        assert_eq!(number("error", row), outcome.error);
        assert_eq!(number("min_gap_linear_m", row), outcome.linear.min_gap_m);
        assert_eq!(text("status", row).as_deref(), Some(ROW_STATUSES[status]));
        assert_eq!(number("fail_time_s", row), fail_time_s);
        assert_eq!(count("steps_nonlinear", row), outcome.nonlinear.steps);
        assert_eq!(count("rejected_linear", row), outcome.linear.rejected);
    }
    assert!(statuses.len() > 6, "the formula must bring every kind of row by: {statuses:?}");
}

#[test]
fn the_file_says_what_it_is_and_nothing_of_where_or_when() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let reader =
        ParquetRecordBatchReaderBuilder::try_new(fs::File::open(home.output()).unwrap()).unwrap();
    let file = reader.metadata().file_metadata();
    assert_eq!(file.created_by(), Some("sweep version 0.0.0-test"));
    let pairs = file.key_value_metadata().unwrap();
    let keys: Vec<&str> = pairs.iter().map(|pair| pair.key.as_str()).collect();
    let expected = [
        "sweep.plan",
        "sweep.plan_hash",
        "sweep.version",
        "sweep.numerics",
        "sweep.columns",
        "ARROW:schema",
        "sweep.digest",
    ];
    assert_eq!(keys, expected);
    assert_eq!(serde_json::from_str::<Value>(pairs[0].value.as_ref().unwrap()).unwrap(), job.plan);
    assert_eq!(reader.schema().field(1).metadata()["unit"], "kg");
    let bytes = fs::read(home.output()).unwrap();
    let host = provenance::host();
    let home_text = home.0.path().to_str().unwrap();
    for secret in [host.as_str(), home_text] {
        assert!(
            !bytes.windows(secret.len()).any(|window| window == secret.as_bytes()),
            "{secret} is in the file"
        );
    }
}

#[test]
fn chunks_leave_no_trace_across_batches() {
    // More rows than one batch, and a last chunk that is not full.
    let points = 5003;
    let bytes = undisturbed(points);
    let (home, job) = (Home::new(), synthetic::job(points));
    let run = open(&home.output(), &job);
    for chunk in (0..run.chunks()).rev() {
        write(&run, chunk);
    }
    let joined = finish(run, &job);
    assert_eq!(joined.tally.points, points);
    assert_eq!(fs::read(home.output()).unwrap(), bytes);
}

#[test]
fn a_run_left_at_any_chunk_goes_on_from_there() {
    let bytes = undisturbed(POINTS);
    let job = synthetic::job(POINTS);
    for written in 0..=POINTS.div_ceil(8) {
        let home = Home::new();
        let run = open(&home.output(), &job);
        (0..written).for_each(|chunk| write(&run, chunk));
        drop(run);
        let run = open(&home.output(), &job);
        assert_eq!(write_missing(&run), POINTS.div_ceil(8) - written);
        finish(run, &job);
        assert_eq!(fs::read(home.output()).unwrap(), bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn damage_to_any_chunks_is_set_aside_told_and_mended(
        harm in prop::collection::vec((0..11_u64, any::<prop::sample::Index>(), 0..4_u8), 0..6)
    ) {
        let (home, job) = (Home::new(), synthetic::job(POINTS));
        let run = open(&home.output(), &job);
        write_missing(&run);
        drop(run);
        let mut harmed = std::collections::BTreeSet::new();
        for (chunk, at, how) in harm {
            let path = home.partial().join(chunk_name(chunk));
            let Ok(mut bytes) = fs::read(&path) else { continue };
            let at = at.index(bytes.len().max(1));
            match how {
                0 => bytes.truncate(at),
                1 if !bytes.is_empty() => bytes[at] ^= 0x40,
                2 => bytes.push(0),
                _ => bytes.clear(),
            }
            fs::write(&path, &bytes).unwrap();
            let intact = bytes == { write_bytes(&job, chunk) };
            if intact { harmed.remove(&chunk); } else { harmed.insert(chunk); }
        }
        let mut run = open(&home.output(), &job);
        prop_assert_eq!(run.take_notes().len(), harmed.len());
        for chunk in &harmed {
            let damaged = format!("{}.damaged", chunk_name(*chunk));
            prop_assert!(home.partial().join(damaged).exists());
        }
        prop_assert_eq!(write_missing(&run), harmed.len() as u64);
        finish(run, &job);
        prop_assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
    }
}

fn write_bytes(job: &Job<'_>, chunk: u64) -> Vec<u8> {
    let home = Home::new();
    let run = open(&home.output(), job);
    write(&run, chunk);
    fs::read(home.partial().join(chunk_name(chunk))).unwrap()
}

#[test]
fn damage_after_opening_is_met_at_the_join() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    fs::write(home.partial().join(chunk_name(4)), b"not a chunk").unwrap();
    fs::remove_file(home.partial().join(chunk_name(6))).unwrap();
    let error = run.join(&job, &|| false).unwrap_err();
    assert!(error.to_string().contains("2 of 11 chunks are missing"), "{error}");
    assert!(!home.output().exists());
    assert_eq!(write_missing(&run), 2);
    let joined = finish(run, &job);
    assert!(joined.notes[0].contains("chunk-00000004.bin"), "{:?}", joined.notes);
    assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
}

#[test]
fn another_plan_is_refused_with_the_difference_until_fresh() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    write(&open(&home.output(), &job), 0);
    let other = Job {
        plan: json!({ "name": "synthetic", "points": POINTS, "step_s": 1.0e-4 }),
        ..synthetic::job(POINTS)
    };
    let error = OpenRun::open(&home.output(), &other, options()).unwrap_err();
    assert!(error.is_refusal());
    let text = error.to_string();
    assert!(text.contains("/step_s: was 0.0002, is 0.0001") && text.contains("--fresh"), "{text}");

    let newer = Job { version: "9.9.9", ..synthetic::job(POINTS) };
    let text = OpenRun::open(&home.output(), &newer, options()).unwrap_err().to_string();
    assert!(text.contains(r#"/sweep_version: was "0.0.0-test", is "9.9.9""#), "{text}");

    let fresh = OpenOptions { fresh: true, ..options() };
    let Opened::Run(run) = OpenRun::open(&home.output(), &other, fresh).unwrap() else {
        panic!("must run")
    };
    assert!(run.is_missing(0));
    drop(run);
    assert!(
        OpenRun::open(&home.output(), &job, options()).is_err(),
        "the folder is the other plan's now"
    );
}

#[test]
fn a_finished_output_is_left_alone() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let Opened::Finished(file, tally) = OpenRun::open(&home.output(), &job, options()).unwrap()
    else {
        panic!("is done")
    };
    assert_eq!((file.points, &file.plan), (POINTS, &job.plan));
    assert_eq!((file.numerics, tally.points), (1, POINTS));
    assert!(!home.partial().exists());

    let other = Job { plan: json!({ "name": "other" }), ..synthetic::job(POINTS) };
    let error = OpenRun::open(&home.output(), &other, options()).unwrap_err();
    assert!(matches!(error, StoreError::OutputDiffers { .. }) && error.is_refusal(), "{error}");
    assert!(error.to_string().contains(r#"/name: was "synthetic", is "other""#), "{error}");

    // Started over, the old result stays until the new one takes its place, interrupted or not.
    let before = fs::read(home.output()).unwrap();
    let fresh = OpenOptions { fresh: true, ..options() };
    drop(OpenRun::open(&home.output(), &other, fresh).unwrap());
    assert_eq!(fs::read(home.output()).unwrap(), before);
    let run = open(&home.output(), &other);
    write_missing(&run);
    finish(run, &other);
    assert_ne!(fs::read(home.output()).unwrap(), before);
}

#[test]
fn another_build_of_the_version_is_another_run() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let other = Job { numerics: 2, ..synthetic::job(POINTS) };
    let refusal = |what: Result<Opened, StoreError>| {
        let error = what.unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("/numerics: was 1, is 2"), "{error}");
    };
    let run = open(&home.output(), &job);
    write(&run, 0);
    drop(run);
    refusal(OpenRun::open(&home.output(), &other, options()));
    refusal(OpenRun::open_for_merge(&home.output(), &other));
    assert!(
        status(&home.output(), &other).unwrap_err().to_string().contains("/numerics: was 1, is 2")
    );

    // A chunk of that build under this one's plan.
    let foreign = write_bytes(&other, 3);
    fs::write(home.partial().join(chunk_name(3)), foreign).unwrap();
    let mut run = open(&home.output(), &job);
    assert!(run.is_missing(3) && !run.is_missing(0));
    let notes = run.take_notes();
    assert!(notes[0].contains("another plan, place or version"), "{notes:?}");

    write_missing(&run);
    finish(run, &job);
    refusal(OpenRun::open(&home.output(), &other, options()));
    let fresh = OpenOptions { fresh: true, ..options() };
    assert!(matches!(OpenRun::open(&home.output(), &other, fresh).unwrap(), Opened::Run(_)));
}

#[test]
fn a_folder_of_an_older_format_is_refused_as_such() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    fs::create_dir(home.partial()).unwrap();
    let old = json!({
        "format": 1, "version": job.version, "plan_hash": "00", "points": POINTS, "chunk_points": 8,
        "plan": job.plan,
    });
    fs::write(home.partial().join("plan.json"), old.to_string()).unwrap();
    let error = OpenRun::open(&home.output(), &job, options()).unwrap_err();
    assert!(error.is_refusal());
    let text = error.to_string();
    assert!(
        text.contains("/store_format: was 1, is 2") && text.contains("/numerics: was 0"),
        "{text}"
    );
}

#[test]
fn no_flipped_bit_of_a_result_is_taken_for_it() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let whole = fs::read(home.output()).unwrap();
    let mut damaged = 0;
    let places = (0..whole.len()).step_by(7);
    let tried = places.len();
    for at in places {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        fs::write(home.output(), &bytes).unwrap();
        let error = OpenRun::open(&home.output(), &job, options()).unwrap_err();
        let text = error.to_string();
        damaged += usize::from(matches!(error, StoreError::File(FileError::Damaged { .. })));
        assert!(text.contains("x.parquet") && text.contains("= help: "), "byte {at}: {text}");
        assert!(
            status(&home.output(), &job).is_err()
                && OpenRun::open_for_merge(&home.output(), &job).is_err()
        );
        assert!(fs::read(home.output()).unwrap() == bytes && !home.partial().exists(), "byte {at}");
    }
    // The others have lost what makes them a result of ours: the end of the file, a key of the
    // metadata.
    assert!(damaged * 100 > tried * 95, "{damaged} of {tried} bytes");
}

#[test]
fn a_result_whose_digest_is_cut_out_is_no_result_of_this_build() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let mut bytes = fs::read(home.output()).unwrap();
    let at = bytes.windows(12).rposition(|window| window == b"sweep.digest").unwrap();
    bytes[at + 6] = b'D';
    fs::write(home.output(), &bytes).unwrap();
    let error = OpenRun::open(&home.output(), &job, options()).unwrap_err();
    assert!(matches!(error, StoreError::File(FileError::Damaged { .. })), "{error}");
}

#[test]
fn results_that_differ_after_a_dot_have_a_sidecar_each() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    for (name, sidecar) in
        [("v1.0", "v1.0.run.json"), ("v1.5", "v1.5.run.json"), ("x.parquet", "x.run.json")]
    {
        let output = home.0.path().join(name);
        let run = open(&output, &job);
        write_missing(&run);
        finish(run, &job);
        let text = fs::read_to_string(home.0.path().join(sidecar)).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap()["file"], name);
    }
    // A result whose sidecar would be another's, and a stranger's file of its name.
    let refused = |output: &Path| {
        let error = OpenRun::open(output, &job, options()).unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("is no account of the run with this --out"), "{error}");
    };
    refused(&home.0.path().join("x"));
    let mine = home.0.path().join("y.run.json");
    fs::write(&mine, r#"{ "mine": true }"#).unwrap();
    refused(&home.0.path().join("y.parquet"));
    assert_eq!(fs::read_to_string(mine).unwrap(), r#"{ "mine": true }"#);
    assert!(!home.0.path().join("y.parquet.partial").exists());
}

#[test]
fn starting_over_deletes_what_a_run_wrote_and_nothing_else() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    drop(run);
    let damaged = format!("{}.damaged", chunk_name(2));
    let theirs = ["chunk-notes.txt", "session-notes.md", "shard-plan.txt", "plan.json.old"];
    for name in theirs.into_iter().chain([damaged.as_str(), "shard-3.lock"]) {
        fs::write(home.partial().join(name), "").unwrap();
    }
    let fresh = OpenOptions { fresh: true, ..options() };
    drop(OpenRun::open(&home.output(), &job, fresh).unwrap());
    let mut left: Vec<String> = fs::read_dir(home.partial())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    left.sort();
    assert_eq!(
        left,
        [
            "chunk-notes.txt",
            "lock",
            "plan.json",
            "plan.json.old",
            "session-notes.md",
            "shard-plan.txt"
        ]
    );
}

#[test]
fn a_strangers_file_is_not_overwritten() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    fs::write(home.output(), "my thesis").unwrap();
    for fresh in [false, true] {
        let error =
            OpenRun::open(&home.output(), &job, OpenOptions { fresh, ..options() }).unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("is no result of `sweep run`"), "{error}");
    }
    for error in [
        OpenRun::open_for_merge(&home.output(), &job).unwrap_err(),
        status(&home.output(), &job).unwrap_err(),
    ] {
        assert!(error.to_string().contains("is no result of `sweep run`"), "{error}");
    }
    assert_eq!(fs::read(home.output()).unwrap(), b"my thesis");
    assert!(!home.partial().exists());
    let error = OpenRun::open(home.0.path(), &job, options()).unwrap_err();
    assert!(error.to_string().contains("it is a folder"), "{error}");
}

#[test]
fn death_between_publishing_and_removing_the_folder_loses_nothing() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    run.join(&job, &|| false).unwrap().unwrap();
    drop(run);
    let bytes = fs::read(home.output()).unwrap();
    let run = open(&home.output(), &job);
    assert_eq!(write_missing(&run), 0);
    finish(run, &job);
    assert_eq!(fs::read(home.output()).unwrap(), bytes);

    // The same, half-way through the removal: the plan goes first.
    fs::create_dir(home.partial()).unwrap();
    fs::write(home.partial().join(chunk_name(3)), "left").unwrap();
    assert!(matches!(
        OpenRun::open(&home.output(), &job, options()).unwrap(),
        Opened::Finished(..)
    ));
    assert!(!home.partial().exists());
}

#[test]
fn a_stopped_join_publishes_nothing() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    assert!(run.join(&job, &|| true).unwrap().is_none());
    assert!(!home.output().exists());
    finish(run, &job);
    assert!(home.output().exists());
}

#[test]
fn a_damaged_plan_is_set_aside_and_its_chunks_are_used() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    write(&open(&home.output(), &job), 0);
    let plan = home.partial().join("plan.json");
    let text = fs::read_to_string(&plan).unwrap();
    for broken in
        [text.replace("synthetic", "synthetik"), text[..text.len() / 2].to_owned(), String::new()]
    {
        fs::write(&plan, broken).unwrap();
        let mut run = open(&home.output(), &job);
        assert!(run.take_notes()[0].contains("the frozen plan was damaged"));
        assert!(!run.is_missing(0) && run.is_missing(1));
        assert_eq!(fs::read_to_string(&plan).unwrap(), text);
    }
}

#[test]
fn leftovers_go_and_strangers_files_in_the_folder_stay() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    drop(open(&home.output(), &job));
    let (left, mine) = (home.partial().join(".sweep-abc.tmp"), home.partial().join("notes.txt"));
    fs::write(&left, "half a chunk").unwrap();
    fs::write(&mine, "mine").unwrap();
    let run = open(&home.output(), &job);
    assert!(!left.exists());
    write_missing(&run);
    let joined = finish(run, &job);
    assert!(mine.exists());
    assert!(joined.notes[0].contains("could not be removed"), "{:?}", joined.notes);
    assert_eq!(fs::read_dir(home.partial()).unwrap().count(), 1);
}

#[test]
fn shards_together_make_the_whole_and_the_merge_says_who_is_missing() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let shard = |index| {
        let shard = Some(ShardRequest::Given(Shard { index, of: 4 }));
        match OpenRun::open(&home.output(), &job, OpenOptions { shard, ..options() }).unwrap() {
            Opened::Run(run) => *run,
            Opened::Finished(..) => panic!("is not done"),
        }
    };
    assert!(matches!(
        OpenRun::open_for_merge(&home.output(), &job).unwrap_err(),
        StoreError::NoRun { .. }
    ));
    // Two at once, and one of them twice.
    let (first, third, again) = (shard(1), shard(3), shard(3));
    assert_eq!(first.own_points(), (3 * 8, 0));
    assert_eq!(third.own_points(), (8 + 8 + 1, 0), "the last chunk has one point");
    for run in [&first, &third, &again] {
        write_missing(run);
    }
    let busy = OpenRun::open_for_merge(&home.output(), &job).unwrap_err();
    assert!(matches!(busy, StoreError::Busy { .. }), "{busy}");
    let running = status(&home.output(), &job).unwrap().running;
    assert_eq!(running.iter().map(|holder| holder.shard).collect::<Vec<_>>(), [Some(1), Some(3)]);
    drop((first, third, again));

    let Opened::Run(mut merge) = OpenRun::open_for_merge(&home.output(), &job).unwrap() else {
        panic!("is not done")
    };
    let error = merge.join(&job, &|| false).unwrap_err();
    assert!(!error.is_refusal());
    assert!(error.to_string().contains("5 of 11 chunks are missing, of shards 2,4"), "{error}");
    drop(merge);
    let found = status(&home.output(), &job).unwrap();
    assert_eq!(
        (found.state, found.missing_shards.as_str(), found.shards),
        (State::Unfinished, "2,4", Some(4))
    );
    assert_eq!((found.chunks_done, found.chunks_missing), (6, 5));

    let other =
        OpenOptions { shard: Some(ShardRequest::Given(Shard { index: 1, of: 5 })), ..options() };
    assert!(
        OpenRun::open(&home.output(), &job, other)
            .unwrap_err()
            .to_string()
            .contains("into 4 shards")
    );
    let fresh = OpenOptions {
        fresh: true,
        shard: Some(ShardRequest::Given(Shard { index: 2, of: 4 })),
        ..options()
    };
    assert!(
        OpenRun::open(&home.output(), &job, fresh)
            .unwrap_err()
            .to_string()
            .contains("--fresh would delete")
    );

    for index in [2, 4] {
        write_missing(&shard(index));
    }
    assert_eq!(status(&home.output(), &job).unwrap().state, State::Complete);
    let Opened::Run(merge) = OpenRun::open_for_merge(&home.output(), &job).unwrap() else {
        panic!("is not done")
    };
    finish(*merge, &job);
    assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
    let found = status(&home.output(), &job).unwrap();
    assert_eq!((found.state, found.points_done), (State::Finished, POINTS));
    assert!(found.points_failed > 0);
}

#[test]
fn status_counts_without_touching_anything() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    assert_eq!(status(&home.output(), &job).unwrap().state, State::NotStarted);
    assert_eq!(fs::read_dir(home.0.path()).unwrap().count(), 0);
    let run = open(&home.output(), &job);
    write(&run, 0);
    write(&run, 1);
    fs::write(home.partial().join(chunk_name(1)), "not a chunk").unwrap();
    let found = status(&home.output(), &job).unwrap();
    assert_eq!(
        (found.chunks_done, found.chunks_damaged.as_slice(), found.points_done),
        (1, &[1][..], 8)
    );
    assert_eq!(found.points_failed, 2, "points 4 and 7 of the formula fail");
    assert_eq!(found.running[0].pid, std::process::id());
    assert!(home.partial().join(chunk_name(1)).exists());
    let other = Job { plan: json!({}), ..synthetic::job(POINTS) };
    assert!(matches!(status(&home.output(), &other).unwrap_err(), StoreError::PlanDiffers { .. }));
}

#[test]
fn the_sidecar_adds_up_the_sessions() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let session = |pid, points| provenance::Session {
        started_unix_s: 1_700_000_000 + u64::from(pid),
        wall_s: 2.0,
        host: "node/1".into(),
        pid,
        cpus: 4,
        cpu_model: None,
        simd: "avx2".into(),
        threads: 2,
        shard: None,
        points,
        points_per_s: points as f64 / 2.0,
        version: "0.0.0-test".into(),
    };
    let mut run = open(&home.output(), &job);
    run.record(&session(7, 40)).unwrap();
    write_missing(&run);
    let tally = run.join(&job, &|| false).unwrap().unwrap();
    run.complete(&job, tally, Some(session(9, 41))).unwrap();
    let text = fs::read_to_string(home.0.path().join("x.run.json")).unwrap();
    let sidecar: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(sidecar["file"], "x.parquet");
    assert_eq!(sidecar["wall_s"], 4.0);
    assert_eq!(sidecar["points_per_s"], 81.0 / 4.0);
    assert_eq!(sidecar["sessions"].as_array().unwrap().len(), 2);
    assert_eq!(sidecar["rows"]["points"], POINTS);
    let by_status: u64 = sidecar["rows"]["by_status"]
        .as_object()
        .unwrap()
        .values()
        .map(|count| count.as_u64().unwrap())
        .sum();
    assert_eq!(by_status, POINTS);
}

#[test]
fn the_tally_agrees_with_the_outcomes() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    let tally = finish(run, &job).tally;
    let rows: Vec<_> = (0..POINTS)
        .map(|point| synthetic::outcome(point, 2))
        .map(|outcome| (Verdict::new(&outcome, 2, 2.0), outcome))
        .collect();
    let with =
        |reliable| rows.iter().filter(|(verdict, _)| verdict.reliable == reliable).count() as u64;
    assert_eq!(
        (tally.reliable, tally.unreliable, tally.undefined),
        (with(Some(true)), with(Some(false)), with(None))
    );
    assert_eq!(tally.reliable + tally.unreliable + tally.undefined, POINTS);
    let (point, greatest) = rows
        .iter()
        .filter_map(|(verdict, outcome)| Some((outcome.point, verdict.greatest?.1)))
        .reduce(|best, row| if row.1 > best.1 { row } else { best })
        .unwrap();
    assert_eq!(tally.greatest_ratio, Some(read::Extreme { value: greatest, point }));
}
