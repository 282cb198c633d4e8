//! What is there that is not the run's: other files, leftovers of the dead.

use super::*;

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
fn leftovers_go_and_strangers_files_in_the_folder_stay() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    drop(open(&home.output(), &job));
    let (left, mine) = (home.partial().join(".sweep-abc.tmp"), home.partial().join("notes.txt"));
    fs::write(&left, "half a chunk").unwrap();
    fs::write(&mine, "mine").unwrap();
    let run = open(&home.output(), &job);
    assert!(!left.exists());
    write_missing(&run);
    let (_, notes) = finish(run, &job);
    assert!(mine.exists());
    assert!(notes[0].contains("could not be removed"), "{:?}", notes);
    assert_eq!(fs::read_dir(home.partial()).unwrap().count(), 1);
}
