//! Tests of trials: interrupted searches, damaged parts, other plans.

use std::fs;

use serde_json::json;

use super::super::synthetic::{job, layout};
use super::super::{CellType, Layout};
use super::*;
use crate::build::Build;
use crate::table::Table;
use sweep_files::{ParquetFile, key};

const BUILD: Build = Build { version: "0.0.0-test", numerics: 1 };

fn trial_columns() -> TrialColumns {
    let make_column =
        |name: &str, kind| DeclaredColumn::new(name, "1", format!("the {name}"), kind);
    TrialColumns {
        key_columns: vec![
            make_column("candidate", CellType::Count),
            make_column("x", CellType::Axis),
        ],
        value_columns: vec![
            make_column("cost", CellType::Measured),
            make_column("excess", CellType::Measured),
        ],
    }
}

fn open_trials(output: &Path, job: &Job<'_>) -> Trials {
    match Trials::open(output, job, trial_columns(), false) {
        Ok(OpenOutcome::Open(trials)) => trials,
        other => panic!("expected trials, got {other:?}"),
    }
}

/// Returns the key and the response of trial `k`. The cost is null for every third trial.
fn key_and_response(k: u64) -> (TrialKey, RowCells) {
    let x = 0.1 * k as f64;
    let cost = (!k.is_multiple_of(3)).then_some(x.sin().to_bits());
    (vec![k, x.to_bits()], vec![cost, Some(x.to_bits())])
}

fn add_trials(trials: &mut Trials, range: std::ops::Range<u64>) {
    for k in range {
        let (key, response) = key_and_response(k);
        trials.add_trial(key, response).unwrap();
    }
}

fn part_names(output: &Path) -> Vec<String> {
    let names = fs::read_dir(output.with_file_name("x.parquet.partial")).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.starts_with("part-")).collect();
    names.sort();
    names
}

#[test]
fn trials_of_several_processes_are_stored_in_few_parts() {
    const TRIAL_COUNT: u64 = 2500;
    let test_folder = tempfile::tempdir().unwrap();
    let output = test_folder.path().join("x.parquet");
    let job = job(8);
    // Each process writes several times, and then adds a trial that it does not write.
    for from in (0..TRIAL_COUNT).step_by(100) {
        let mut trials = open_trials(&output, &job);
        assert_eq!(trials.trial_count() as u64, from);
        add_trials(&mut trials, from..from + 60);
        trials.write().unwrap();
        add_trials(&mut trials, from + 60..from + 100);
        trials.write().unwrap();
        trials.write().unwrap();
        add_trials(&mut trials, TRIAL_COUNT..TRIAL_COUNT + 1);
    }
    let trials = open_trials(&output, &job);
    assert_eq!(trials.trial_count() as u64, TRIAL_COUNT);
    for k in 0..TRIAL_COUNT {
        let (key, response) = key_and_response(k);
        assert_eq!(trials.find_values(&key), Some(&response), "trial {k}");
    }
    assert_eq!(trials.find_values(&[0, 1]), None);
    let names = [0, 1, 2].map(|index| format!("part-{index:08}.parquet"));
    assert_eq!(part_names(&output), names);
    // The columns of parts have names.
    let first_part = output.with_file_name("x.parquet.partial").join(&names[0]);
    let first_part = ParquetFile::open(&first_part).unwrap();
    let fields = first_part.schema().fields().iter().map(|field| field.name().as_str());
    assert_eq!(fields.collect::<Vec<_>>(), ["candidate", "x", "cost", "excess"]);
    assert_eq!(first_part.rows(), PART_ROWS as u64);
    assert_eq!(trials.complete(), None);
    assert_eq!(fs::read_dir(test_folder.path()).unwrap().count(), 0);
}

#[test]
fn a_damaged_part_loses_only_the_trials_in_it() {
    let test_folder = tempfile::tempdir().unwrap();
    let output = test_folder.path().join("x.parquet");
    let job = job(8);
    let mut trials = open_trials(&output, &job);
    add_trials(&mut trials, 0..3000);
    trials.write().unwrap();
    drop(trials);
    let folder = output.with_file_name("x.parquet.partial");
    let second_part = fs::read(folder.join("part-00000001.parquet")).unwrap();
    let third_part = fs::read(folder.join("part-00000002.parquet")).unwrap();
    for (k, position) in (0..second_part.len()).step_by(second_part.len() / 40).enumerate() {
        let mut bytes = second_part.clone();
        bytes[position] ^= 1 << (position % 8);
        fs::write(folder.join("part-00000001.parquet"), &bytes).unwrap();
        fs::write(folder.join("part-00000002.parquet"), &third_part).unwrap();
        let mut trials = open_trials(&output, &job);
        assert_eq!(trials.trial_count(), 3000 - PART_ROWS, "byte {position}");
        let notes = trials.take_notes();
        assert!(notes[0].contains("part-00000001.parquet.damaged"), "{notes:?}");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 4 + k + 1);
        // The lost trials are added again, after the others.
        add_trials(&mut trials, 1024..1034);
        trials.write().unwrap();
        drop(trials);
        let (key, response) = key_and_response(1030);
        assert_eq!(open_trials(&output, &job).find_values(&key), Some(&response));
    }
    // A foreign file with the name of a part is kept.
    fs::write(folder.join("part-00000001.parquet"), "my thesis").unwrap();
    drop(open_trials(&output, &job));
    let names: Vec<String> = part_names(&output);
    let read_part = |name: &String| fs::read(folder.join(name)).unwrap();
    assert!(names.iter().any(|name| read_part(name) == b"my thesis"), "{names:?}");
}

#[test]
fn another_plan_is_refused_unless_fresh() {
    let test_folder = tempfile::tempdir().unwrap();
    let output = test_folder.path().join("x.parquet");
    let own_job = job(8);
    let job_with_other_plan = job(9);
    let mut trials = open_trials(&output, &own_job);
    add_trials(&mut trials, 0..5);
    trials.write().unwrap();
    drop(trials);
    let outcome = Trials::open(&output, &job_with_other_plan, trial_columns(), false);
    assert!(matches!(outcome, Err(StoreError::PlanDiffers { .. })), "{outcome:?}");
    let Ok(OpenOutcome::Open(trials)) =
        Trials::open(&output, &job_with_other_plan, trial_columns(), true)
    else {
        panic!()
    };
    assert_eq!(trials.trial_count(), 0);
    assert!(part_names(&output).is_empty());
    let busy_error = Trials::open(&output, &job_with_other_plan, trial_columns(), false);
    assert!(matches!(busy_error, Err(StoreError::Busy { .. })), "{busy_error:?}");
}

#[test]
fn a_finished_file_of_the_same_plan_is_recognised() {
    let test_folder = tempfile::tempdir().unwrap();
    let output = test_folder.path().join("x.parquet");
    let [own_job, job_with_other_plan] = [8, 9].map(|points| {
        let job = job(points);
        let layout = Layout { kind: FileKind::Boundary, ..job.layout };
        Job { version: BUILD.version, numerics: BUILD.numerics, layout, ..job }
    });
    let mut table = Table::new(BUILD);
    table.add_metadata(key::PLAN, &own_job.plan);
    table.add_text(key::PLAN_HASH, own_job.hash().to_hex().to_string());
    table.add_metadata(key::BOUNDARY, &json!({}));
    table.add_counts("points", "", [1]);
    fs::write(&output, table.into_bytes(&output).unwrap()).unwrap();
    let open_trials = |job: &Job<'_>, fresh| Trials::open(&output, job, trial_columns(), fresh);
    let outcome = open_trials(&own_job, false);
    assert!(matches!(outcome, Ok(OpenOutcome::Finished(()))), "{outcome:?}");
    let refusal = open_trials(&job_with_other_plan, false);
    assert!(matches!(refusal, Err(StoreError::OutputDiffers { .. })), "{refusal:?}");
    assert!(!test_folder.path().join("x.parquet.partial").exists());
    // A search that was killed after it wrote its file leaves its folder behind.
    let Ok(OpenOutcome::Open(_)) = open_trials(&own_job, true) else { panic!() };
    fs::remove_file(test_folder.path().join("x.parquet.partial/plan.json")).unwrap();
    let outcome = open_trials(&own_job, false);
    assert!(matches!(outcome, Ok(OpenOutcome::Finished(()))), "{outcome:?}");
    assert!(!test_folder.path().join("x.parquet.partial").exists());
}

#[test]
fn a_file_of_a_model_is_never_taken_for_a_finished_search() {
    let test_folder = tempfile::tempdir().unwrap();
    let output = test_folder.path().join("x.toml");
    let job = job(8);
    let model_file_job = Job { layout: Layout { kind: FileKind::ModelFile, ..layout() }, ..job };
    fs::write(&output, format!("{}by a fit\n", sweep_files::MODEL_FILE_START)).unwrap();
    let outcome = Trials::open(&output, &model_file_job, trial_columns(), false);
    assert!(matches!(outcome, Ok(OpenOutcome::Open(_))), "{outcome:?}");
}
