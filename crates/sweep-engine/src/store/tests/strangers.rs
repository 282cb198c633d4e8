//! What is there that is not the run's: other files, leftovers of the dead.

use super::*;

#[test]
fn starting_over_deletes_what_a_run_wrote_and_nothing_else() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    drop(run);
    let theirs = ["part-notes.txt", "session-notes.md", "shard-plan.txt", "plan.json.old"];
    for name in theirs.into_iter().chain(["shard-3.lock"]) {
        fs::write(home.partial().join(name), "").unwrap();
    }
    drop(OpenRun::open(&home.output(), &job, fresh()).unwrap());
    assert_eq!(
        names(&home),
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

fn fresh() -> OpenOptions<'static> {
    OpenOptions { fresh: true, ..options() }
}

/// What is in the folder, sorted.
fn names(home: &Home) -> Vec<String> {
    let entries = fs::read_dir(home.partial()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Names that a run gives, and others close to them.
const NAMES: [&str; 12] = [
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
fn a_strangers_file_is_kept_whatever_its_name() {
    let job = synthetic::job(POINTS);
    for text in ["my thesis", "{}", "SWEEP", "2026 pages", "{\"shards\": 0}"] {
        for is_fresh in [false, true] {
            let home = Home::new();
            let run = open(&home.output(), &job);
            write(&run, 1);
            drop(run);
            for name in NAMES {
                fs::write(home.partial().join(name), text).unwrap();
            }
            let options = OpenOptions { fresh: is_fresh, ..options() };
            let Opened::Open(run) = OpenRun::open(&home.output(), &job, options).unwrap() else {
                panic!("is not done")
            };
            write_missing(&run);
            let (_, notes) = finish(run, &job);
            let note = notes.last().unwrap();
            assert!(note.contains("stays, for it holds what this run did not write"), "{note}");
            // Set aside under another name, or where it was.
            let left = names(&home);
            assert_eq!(left.len(), NAMES.len(), "{left:?}");
            for name in left {
                let found = fs::read_to_string(home.partial().join(&name)).unwrap();
                assert_eq!(found, text, "{name}");
            }
            assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
        }
    }
}

#[test]
fn what_a_run_wrote_goes_wherever_it_was_left() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let shard = Some(ShardRequest::Given(Shard { index: 2, of: 4 }));
    let sharded = OpenOptions { shard, ..options() };
    let Opened::Open(run) = OpenRun::open(&home.output(), &job, sharded).unwrap() else {
        panic!("is not done")
    };
    write_missing(&run);
    run.record(&session()).unwrap();
    drop(run);
    let left = names(&home);
    for name in ["plan.json", "shards.json", "shard-2.lock", "part-00000001.parquet"] {
        assert!(left.iter().any(|known| known == name), "{name}: {left:?}");
    }
    assert!(left.iter().any(|name| name.starts_with("session-")), "{left:?}");
    fs::write(home.partial().join(sweep_files::atomic::temporary_name()), "half").unwrap();
    drop(OpenRun::open(&home.output(), &job, fresh()).unwrap());
    assert_eq!(names(&home), ["lock", "plan.json"]);
}

#[test]
fn what_was_set_aside_stays_beside_what_is_set_aside_later() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    drop(run);
    for text in ["first", "second", "third"] {
        fs::write(home.partial().join(part_name(3)), text).unwrap();
        write_missing(&open(&home.output(), &job));
    }
    let (_, notes) = finish(open(&home.output(), &job), &job);
    assert!(notes[0].contains("part-00000003.parquet.damaged-2"), "{notes:?}");
    let read = |ending| {
        let name = format!("{}.damaged{ending}", part_name(3));
        fs::read_to_string(home.partial().join(name)).unwrap()
    };
    assert_eq!(["", "-2", "-3"].map(read), ["first", "second", "third"]);
    // A run that finds its result whole lets them be too.
    assert!(matches!(
        OpenRun::open(&home.output(), &job, options()).unwrap(),
        Opened::Finished(..)
    ));
    assert_eq!(names(&home).len(), 3);
}

/// A process's record of its work.
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
    fs::write(home.partial().join(part_name(3)), write_bytes(&job, 3)).unwrap();
    assert!(matches!(
        OpenRun::open(&home.output(), &job, options()).unwrap(),
        Opened::Finished(..)
    ));
    assert!(!home.partial().exists());
}

#[test]
fn leftovers_go_and_strangers_files_in_the_folder_stay() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    drop(open(&home.output(), &job));
    let left = home.partial().join(sweep_files::atomic::temporary_name());
    let mine = home.partial().join("notes.txt");
    fs::write(&left, "half a part").unwrap();
    fs::write(&mine, "mine").unwrap();
    let run = open(&home.output(), &job);
    assert!(!left.exists());
    write_missing(&run);
    let (_, notes) = finish(run, &job);
    assert!(mine.exists());
    assert!(notes[0].contains("or has set aside: notes.txt; delete"), "{:?}", notes);
    assert_eq!(fs::read_dir(home.partial()).unwrap().count(), 1);
}
