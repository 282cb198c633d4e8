//! Tests of the plan file: other plans, other builds, older formats.

use super::*;

#[test]
fn another_plan_is_refused_with_the_difference_unless_fresh() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    write(&open(&home.output(), &job), 0);
    let other_plan = Job {
        plan: json!({ "name": "synthetic", "points": POINTS, "step_s": 1.0e-4 }),
        ..synthetic::job(POINTS)
    };
    let error = OpenRun::open(&home.output(), &other_plan, options()).unwrap_err();
    assert!(error.is_refusal());
    let text = error.to_string();
    assert!(text.contains("/step_s: was 0.0002, is 0.0001") && text.contains("--fresh"), "{text}");

    let newer_build = Job { version: "9.9.9", ..synthetic::job(POINTS) };
    let text = OpenRun::open(&home.output(), &newer_build, options()).unwrap_err().to_string();
    assert!(text.contains(r#"/sweep_version: was "0.0.0-test", is "9.9.9""#), "{text}");

    let fresh = OpenOptions { fresh: true, ..options() };
    let OpenOutcome::Open(run) = OpenRun::open(&home.output(), &other_plan, fresh).unwrap() else {
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
fn another_build_of_the_same_version_is_refused() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let other_build = Job { numerics: 2, ..synthetic::job(POINTS) };
    let expect_refusal = |opened: Result<OpenOutcome<_, OpenRun>, StoreError>| {
        let error = opened.unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("/numerics: was 1, is 2"), "{error}");
    };
    let run = open(&home.output(), &job);
    write(&run, 0);
    drop(run);
    expect_refusal(OpenRun::open(&home.output(), &other_build, options()));
    expect_refusal(OpenRun::open_for_merge(&home.output(), &other_build));
    assert!(
        read_status(&home.output(), &other_build)
            .unwrap_err()
            .to_string()
            .contains("/numerics: was 1, is 2")
    );

    // A part of the other build in the folder of this one.
    let foreign = part_bytes(&other_build, 3);
    fs::write(home.partial().join(part_name(3)), foreign).unwrap();
    let mut run = open(&home.output(), &job);
    assert!(run.is_missing(3) && !run.is_missing(0));
    let notes = run.take_notes();
    assert!(notes[0].contains("another plan, index or version"), "{notes:?}");

    write_missing(&run);
    finish(run, &job);
    expect_refusal(OpenRun::open(&home.output(), &other_build, options()));
    let fresh = OpenOptions { fresh: true, ..options() };
    assert!(matches!(
        OpenRun::open(&home.output(), &other_build, fresh).unwrap(),
        OpenOutcome::Open(_)
    ));
}

#[test]
fn a_folder_of_an_older_format_is_refused() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    fs::create_dir(home.partial()).unwrap();
    let old_format = json!({
        "format": 1, "version": job.version, "plan_hash": "00", "points": POINTS, "chunk_points": 8,
        "plan": job.plan,
    });
    fs::write(home.partial().join("plan.json"), old_format.to_string()).unwrap();
    let error = OpenRun::open(&home.output(), &job, options()).unwrap_err();
    assert!(error.is_refusal());
    let text = error.to_string();
    assert!(
        text.contains("/store_format: was 1, is 3") && text.contains("/numerics: was 0"),
        "{text}"
    );
}

#[test]
fn a_damaged_plan_file_is_renamed_and_the_parts_are_used() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    write(&open(&home.output(), &job), 0);
    let plan = home.partial().join("plan.json");
    let text = fs::read_to_string(&plan).unwrap();
    for damaged_text in
        [text.replace("synthetic", "synthetik"), text[..text.len() / 2].to_owned(), String::new()]
    {
        fs::write(&plan, damaged_text).unwrap();
        let mut run = open(&home.output(), &job);
        assert!(run.take_notes()[0].contains("the frozen plan was damaged"));
        assert!(!run.is_missing(0) && run.is_missing(1));
        assert_eq!(fs::read_to_string(&plan).unwrap(), text);
    }
}

#[test]
fn json_files_of_any_length_do_not_fill_the_memory() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    drop(open(&home.output(), &job));
    for name in ["plan.json", "shards.json", "session-x-1-1.json"] {
        fs::File::create(home.partial().join(name)).unwrap().set_len(1 << 40).unwrap();
        assert!(read_status(&home.output(), &job).is_ok(), "{name}");
        drop(open(&home.output(), &job));
    }
    // A plan that would be too long to be read is not written.
    let numbers = vec![0.1; 2_000_000];
    let long_plan_job = Job { plan: json!({ "values": numbers }), ..synthetic::job(POINTS) };
    let error =
        OpenRun::open(&home.output().with_file_name("y.parquet"), &long_plan_job, options());
    let text = error.unwrap_err().to_string();
    assert!(text.contains("more than 16 MiB") && text.contains("as a list"), "{text}");
}
