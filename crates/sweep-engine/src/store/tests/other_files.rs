//! Tests of other files in a run's folder and at its output: foreign files, and leftovers of killed
//! processes.

use super::*;

#[test]
fn starting_over_deletes_only_files_that_a_run_wrote() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    drop(run);
    let foreign_names = ["part-notes.txt", "session-notes.md", "shard-plan.txt", "plan.json.old"];
    for name in foreign_names.into_iter().chain(["shard-3.lock"]) {
        fs::write(test_folder.partial_folder().join(name), "").unwrap();
    }
    drop(OpenRun::open(&test_folder.result_path(), &job, fresh_options()).unwrap());
    assert_eq!(
        file_names(&test_folder),
        [
            "lock",
            "part-notes.txt",
            "plan.json",
            "plan.json.old",
            "session-notes.md",
            "shard-plan.txt"
        ]
    );
}

/// Returns the options of a run that starts over.
fn fresh_options() -> OpenOptions<'static> {
    OpenOptions { starts_over: true, ..default_options() }
}

/// Returns the names of the files in the folder, sorted.
fn file_names(test_folder: &TestFolder) -> Vec<String> {
    let entries = fs::read_dir(test_folder.partial_folder()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Names of files that a run writes, and similar ones.
const RUN_LIKE_FILE_NAMES: [&str; 12] = [
    "part-00000002.parquet",
    "part-00000002.parquet.damaged",
    "plan.json.damaged",
    "session-a-1-2.json",
    "session-interview.json",
    "shard-3.lock",
    "shard-+3.lock",
    "shards.json",
    "part-00000099.parquet",
    "part-notes.parquet",
    ".sweep-notes.tmp",
    ".sweep-Xb7Qz1.tmp",
];

#[test]
fn foreign_files_are_kept_under_any_name() {
    let job = synthetic::job(POINT_COUNT);
    for foreign_text in ["my thesis", "{}", "SWEEP", "2026 pages", "{\"shards\": 0}"] {
        for is_fresh in [false, true] {
            let test_folder = TestFolder::new();
            let run = open_run(&test_folder.result_path(), &job);
            write_complete_chunk(&run, 1);
            drop(run);
            for name in RUN_LIKE_FILE_NAMES {
                fs::write(test_folder.partial_folder().join(name), foreign_text).unwrap();
            }
            let options = OpenOptions { starts_over: is_fresh, ..default_options() };
            let OpenOutcome::Open(run) =
                OpenRun::open(&test_folder.result_path(), &job, options).unwrap()
            else {
                panic!("is not done")
            };
            write_missing_chunks(&run);
            let (_, notes) = finish_run(run, &job);
            let last_note = notes.last().unwrap();
            assert!(
                last_note.contains("stays, for it holds what this run did not write"),
                "{last_note}"
            );
            // A file is kept under its name, or renamed to `*.damaged`.
            let remaining_names = file_names(&test_folder);
            assert_eq!(remaining_names.len(), RUN_LIKE_FILE_NAMES.len(), "{remaining_names:?}");
            for name in remaining_names {
                let file_text =
                    fs::read_to_string(test_folder.partial_folder().join(&name)).unwrap();
                assert_eq!(file_text, foreign_text, "{name}");
            }
            assert_eq!(
                fs::read(test_folder.result_path()).unwrap(),
                uninterrupted_result_bytes(POINT_COUNT)
            );
        }
    }
}

#[test]
fn starting_over_deletes_all_files_of_an_unfinished_run() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let shard = Some(ShardRequest::Given(Shard { index: 2, count: 4 }));
    let shard_options = OpenOptions { shard, ..default_options() };
    let OpenOutcome::Open(run) =
        OpenRun::open(&test_folder.result_path(), &job, shard_options).unwrap()
    else {
        panic!("is not done")
    };
    write_missing_chunks(&run);
    run.record_session(&test_session()).unwrap();
    drop(run);
    let remaining_names = file_names(&test_folder);
    for name in ["plan.json", "shards.json", "shard-2.lock", "part-00000001.parquet"] {
        assert!(
            remaining_names.iter().any(|remaining_name| remaining_name == name),
            "{name}: {remaining_names:?}"
        );
    }
    assert!(remaining_names.iter().any(|name| name.starts_with("session-")), "{remaining_names:?}");
    fs::write(test_folder.partial_folder().join(sweep_files::atomic::temporary_name()), "half")
        .unwrap();
    drop(OpenRun::open(&test_folder.result_path(), &job, fresh_options()).unwrap());
    assert_eq!(file_names(&test_folder), ["lock", "plan.json"]);
}

#[test]
fn several_damaged_files_of_one_part_are_all_kept() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    drop(run);
    for text in ["first", "second", "third"] {
        fs::write(test_folder.partial_folder().join(part_name(3)), text).unwrap();
        write_missing_chunks(&open_run(&test_folder.result_path(), &job));
    }
    let (_, notes) = finish_run(open_run(&test_folder.result_path(), &job), &job);
    assert!(notes[0].contains("part-00000003.parquet.damaged-2"), "{notes:?}");
    let read_damaged_file = |ending| {
        let name = format!("{}.damaged{ending}", part_name(3));
        fs::read_to_string(test_folder.partial_folder().join(name)).unwrap()
    };
    assert_eq!(["", "-2", "-3"].map(read_damaged_file), ["first", "second", "third"]);
    // A run whose result exists keeps the damaged files as well.
    assert!(matches!(
        OpenRun::open(&test_folder.result_path(), &job, default_options()).unwrap(),
        OpenOutcome::Finished(..)
    ));
    assert_eq!(file_names(&test_folder).len(), 3);
}

/// Returns the record of a process's work.
fn test_session() -> Session {
    Session {
        started_unix_s: 1,
        wall_s: 1.0,
        host: "here".to_owned(),
        pid: 1,
        cpus: 1,
        cpu_model: None,
        simd: "none".to_owned(),
        threads: 1,
        shard: None,
        points: 1,
        points_per_s: 1.0,
        version: "0.0.0-test".to_owned(),
    }
}

#[test]
fn a_foreign_file_at_the_output_is_not_overwritten() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    fs::write(test_folder.result_path(), "my thesis").unwrap();
    for fresh in [false, true] {
        let error = OpenRun::open(
            &test_folder.result_path(),
            &job,
            OpenOptions { starts_over: fresh, ..default_options() },
        )
        .unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("is no result of `sweep run`"), "{error}");
    }
    for error in [
        OpenRun::open_for_merge(&test_folder.result_path(), &job).unwrap_err(),
        read_status(&test_folder.result_path(), &job).unwrap_err(),
    ] {
        assert!(error.to_string().contains("is no result of `sweep run`"), "{error}");
    }
    assert_eq!(fs::read(test_folder.result_path()).unwrap(), b"my thesis");
    assert!(!test_folder.partial_folder().exists());
    let error = OpenRun::open(test_folder.0.path(), &job, default_options()).unwrap_err();
    assert!(error.to_string().contains("it is a folder"), "{error}");
}

#[test]
fn a_process_killed_before_it_removes_the_folder_loses_nothing() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let mut run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    run.join(&job, &|| false).unwrap().unwrap();
    drop(run);
    let result_bytes = fs::read(test_folder.result_path()).unwrap();
    let run = open_run(&test_folder.result_path(), &job);
    assert_eq!(write_missing_chunks(&run), 0);
    finish_run(run, &job);
    assert_eq!(fs::read(test_folder.result_path()).unwrap(), result_bytes);

    // A process that is killed while it removes the folder has deleted the plan first.
    fs::create_dir(test_folder.partial_folder()).unwrap();
    fs::write(test_folder.partial_folder().join(part_name(3)), part_bytes(&job, 3)).unwrap();
    assert!(matches!(
        OpenRun::open(&test_folder.result_path(), &job, default_options()).unwrap(),
        OpenOutcome::Finished(..)
    ));
    assert!(!test_folder.partial_folder().exists());
}

#[test]
fn temporary_files_are_deleted_and_foreign_files_kept() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    drop(open_run(&test_folder.result_path(), &job));
    let temporary_file = test_folder.partial_folder().join(sweep_files::atomic::temporary_name());
    let foreign_file = test_folder.partial_folder().join("notes.txt");
    fs::write(&temporary_file, "half a part").unwrap();
    fs::write(&foreign_file, "mine").unwrap();
    let run = open_run(&test_folder.result_path(), &job);
    assert!(!temporary_file.exists());
    write_missing_chunks(&run);
    let (_, notes) = finish_run(run, &job);
    assert!(foreign_file.exists());
    assert!(notes[0].contains("or has set aside: notes.txt; delete"), "{:?}", notes);
    assert_eq!(fs::read_dir(test_folder.partial_folder()).unwrap().count(), 1);
}
