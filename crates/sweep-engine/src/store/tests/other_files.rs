//! Tests of other files in a run's folder and at its output: foreign files, and leftovers of killed
//! processes.

use super::*;

#[test]
fn starting_over_deletes_only_files_that_a_run_wrote() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    drop(run);
    let foreign_names = ["part-notes.txt", "session-notes.md", "shard-plan.txt", "plan.json.old"];
    for name in foreign_names.into_iter().chain(["shard-3.lock"]) {
        fs::write(home.partial().join(name), "").unwrap();
    }
    drop(OpenRun::open(&home.output(), &job, fresh()).unwrap());
    assert_eq!(
        file_names(&home),
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
fn fresh() -> OpenOptions<'static> {
    OpenOptions { fresh: true, ..options() }
}

/// Returns the names of the files in the folder, sorted.
fn file_names(home: &Home) -> Vec<String> {
    let entries = fs::read_dir(home.partial()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Names of files that a run writes, and similar ones.
const SIMILAR_NAMES: [&str; 12] = [
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
    let job = synthetic::job(POINTS);
    for text in ["my thesis", "{}", "SWEEP", "2026 pages", "{\"shards\": 0}"] {
        for is_fresh in [false, true] {
            let home = Home::new();
            let run = open(&home.output(), &job);
            write(&run, 1);
            drop(run);
            for name in SIMILAR_NAMES {
                fs::write(home.partial().join(name), text).unwrap();
            }
            let options = OpenOptions { fresh: is_fresh, ..options() };
            let OpenOutcome::Open(run) = OpenRun::open(&home.output(), &job, options).unwrap()
            else {
                panic!("is not done")
            };
            write_missing(&run);
            let (_, notes) = finish(run, &job);
            let note = notes.last().unwrap();
            assert!(note.contains("stays, for it holds what this run did not write"), "{note}");
            // A file is kept under its name, or renamed to `*.damaged`.
            let remaining_names = file_names(&home);
            assert_eq!(remaining_names.len(), SIMILAR_NAMES.len(), "{remaining_names:?}");
            for name in remaining_names {
                let content = fs::read_to_string(home.partial().join(&name)).unwrap();
                assert_eq!(content, text, "{name}");
            }
            assert_eq!(fs::read(home.output()).unwrap(), uninterrupted_result(POINTS));
        }
    }
}

#[test]
fn starting_over_deletes_all_files_of_an_unfinished_run() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let shard = Some(ShardRequest::Given(Shard { index: 2, count: 4 }));
    let shard_options = OpenOptions { shard, ..options() };
    let OpenOutcome::Open(run) = OpenRun::open(&home.output(), &job, shard_options).unwrap() else {
        panic!("is not done")
    };
    write_missing(&run);
    run.record_session(&session()).unwrap();
    drop(run);
    let remaining_names = file_names(&home);
    for name in ["plan.json", "shards.json", "shard-2.lock", "part-00000001.parquet"] {
        assert!(
            remaining_names.iter().any(|remaining_name| remaining_name == name),
            "{name}: {remaining_names:?}"
        );
    }
    assert!(remaining_names.iter().any(|name| name.starts_with("session-")), "{remaining_names:?}");
    fs::write(home.partial().join(sweep_files::atomic::temporary_name()), "half").unwrap();
    drop(OpenRun::open(&home.output(), &job, fresh()).unwrap());
    assert_eq!(file_names(&home), ["lock", "plan.json"]);
}

#[test]
fn several_damaged_files_of_one_part_are_all_kept() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    drop(run);
    for text in ["first", "second", "third"] {
        fs::write(home.partial().join(part_name(3)), text).unwrap();
        write_missing(&open(&home.output(), &job));
    }
    let (_, notes) = finish(open(&home.output(), &job), &job);
    assert!(notes[0].contains("part-00000003.parquet.damaged-2"), "{notes:?}");
    let read_damaged = |ending| {
        let name = format!("{}.damaged{ending}", part_name(3));
        fs::read_to_string(home.partial().join(name)).unwrap()
    };
    assert_eq!(["", "-2", "-3"].map(read_damaged), ["first", "second", "third"]);
    // A run whose result exists keeps the damaged files as well.
    assert!(matches!(
        OpenRun::open(&home.output(), &job, options()).unwrap(),
        OpenOutcome::Finished(..)
    ));
    assert_eq!(file_names(&home).len(), 3);
}

/// Returns the record of a process's work.
fn session() -> Session {
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
    let home = Home::new();
    let job = synthetic::job(POINTS);
    fs::write(home.output(), "my thesis").unwrap();
    for fresh in [false, true] {
        let error =
            OpenRun::open(&home.output(), &job, OpenOptions { fresh, ..options() }).unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("is no result of `sweep run`"), "{error}");
    }
    for error in [
        OpenRun::open_for_merge(&home.output(), &job).unwrap_err(),
        read_status(&home.output(), &job).unwrap_err(),
    ] {
        assert!(error.to_string().contains("is no result of `sweep run`"), "{error}");
    }
    assert_eq!(fs::read(home.output()).unwrap(), b"my thesis");
    assert!(!home.partial().exists());
    let error = OpenRun::open(home.0.path(), &job, options()).unwrap_err();
    assert!(error.to_string().contains("it is a folder"), "{error}");
}

#[test]
fn a_process_killed_before_it_removes_the_folder_loses_nothing() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    run.join(&job, &|| false).unwrap().unwrap();
    drop(run);
    let bytes = fs::read(home.output()).unwrap();
    let run = open(&home.output(), &job);
    assert_eq!(write_missing(&run), 0);
    finish(run, &job);
    assert_eq!(fs::read(home.output()).unwrap(), bytes);

    // A process that is killed while it removes the folder has deleted the plan first.
    fs::create_dir(home.partial()).unwrap();
    fs::write(home.partial().join(part_name(3)), part_bytes(&job, 3)).unwrap();
    assert!(matches!(
        OpenRun::open(&home.output(), &job, options()).unwrap(),
        OpenOutcome::Finished(..)
    ));
    assert!(!home.partial().exists());
}

#[test]
fn temporary_files_are_deleted_and_foreign_files_kept() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    drop(open(&home.output(), &job));
    let temporary = home.partial().join(sweep_files::atomic::temporary_name());
    let foreign = home.partial().join("notes.txt");
    fs::write(&temporary, "half a part").unwrap();
    fs::write(&foreign, "mine").unwrap();
    let run = open(&home.output(), &job);
    assert!(!temporary.exists());
    write_missing(&run);
    let (_, notes) = finish(run, &job);
    assert!(foreign.exists());
    assert!(notes[0].contains("or has set aside: notes.txt; delete"), "{:?}", notes);
    assert_eq!(fs::read_dir(home.partial()).unwrap().count(), 1);
}
