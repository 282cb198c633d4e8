//! Tests of the plan file: other plans, other builds, older formats.

use super::*;

#[test]
fn another_plan_is_refused_with_the_difference_unless_fresh() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    write_complete_chunk(&open_run(&test_folder.result_path(), &job), 0);
    let job_with_other_plan = Job {
        plan: json!({ "name": "synthetic", "points": POINT_COUNT, "step_s": 1.0e-4 }),
        ..synthetic::job(POINT_COUNT)
    };
    let error = OpenRun::open(&test_folder.result_path(), &job_with_other_plan, default_options())
        .unwrap_err();
    assert!(error.is_refusal());
    let text = error.to_string();
    assert!(text.contains("/step_s: was 0.0002, is 0.0001") && text.contains("--fresh"), "{text}");

    let job_of_newer_build = Job { version: "9.9.9", ..synthetic::job(POINT_COUNT) };
    let text = OpenRun::open(&test_folder.result_path(), &job_of_newer_build, default_options())
        .unwrap_err()
        .to_string();
    assert!(text.contains(r#"/sweep_version: was "0.0.0-test", is "9.9.9""#), "{text}");

    let fresh_options = OpenOptions { starts_over: true, ..default_options() };
    let OpenOutcome::Open(run) =
        OpenRun::open(&test_folder.result_path(), &job_with_other_plan, fresh_options).unwrap()
    else {
        panic!("must run")
    };
    assert!(run.is_missing(0));
    drop(run);
    assert!(
        OpenRun::open(&test_folder.result_path(), &job, default_options()).is_err(),
        "the folder is the other plan's now"
    );
}

#[test]
fn another_build_of_the_same_version_is_refused() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let job_of_other_build = Job { numerics: 2, ..synthetic::job(POINT_COUNT) };
    let assert_refused = |opened: Result<OpenOutcome<_, OpenRun>, StoreError>| {
        let error = opened.unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("/numerics: was 1, is 2"), "{error}");
    };
    let run = open_run(&test_folder.result_path(), &job);
    write_complete_chunk(&run, 0);
    drop(run);
    assert_refused(OpenRun::open(
        &test_folder.result_path(),
        &job_of_other_build,
        default_options(),
    ));
    assert_refused(OpenRun::open_for_merge(&test_folder.result_path(), &job_of_other_build));
    assert!(
        read_status(&test_folder.result_path(), &job_of_other_build)
            .unwrap_err()
            .to_string()
            .contains("/numerics: was 1, is 2")
    );

    // A part of the other build in the folder of this one.
    let foreign_part_bytes = part_bytes(&job_of_other_build, 3);
    fs::write(test_folder.partial_folder().join(part_name(3)), foreign_part_bytes).unwrap();
    let mut run = open_run(&test_folder.result_path(), &job);
    assert!(run.is_missing(3) && !run.is_missing(0));
    let notes = run.take_notes();
    assert!(notes[0].contains("another plan, index or version"), "{notes:?}");

    write_missing_chunks(&run);
    finish_run(run, &job);
    assert_refused(OpenRun::open(
        &test_folder.result_path(),
        &job_of_other_build,
        default_options(),
    ));
    let fresh_options = OpenOptions { starts_over: true, ..default_options() };
    assert!(matches!(
        OpenRun::open(&test_folder.result_path(), &job_of_other_build, fresh_options).unwrap(),
        OpenOutcome::Open(_)
    ));
}

#[test]
fn a_folder_of_an_older_format_is_refused() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    fs::create_dir(test_folder.partial_folder()).unwrap();
    let old_plan = json!({
        "format": 1, "version": job.version, "plan_hash": "00", "points": POINT_COUNT,
        "chunk_points": 8, "plan": job.plan,
    });
    fs::write(test_folder.partial_folder().join("plan.json"), old_plan.to_string()).unwrap();
    let error = OpenRun::open(&test_folder.result_path(), &job, default_options()).unwrap_err();
    assert!(error.is_refusal());
    let text = error.to_string();
    assert!(
        text.contains("/store_format: was 1, is 3") && text.contains("/numerics: was 0"),
        "{text}"
    );
}

#[test]
fn a_damaged_plan_file_is_renamed_and_the_parts_are_used() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    write_complete_chunk(&open_run(&test_folder.result_path(), &job), 0);
    let plan_path = test_folder.partial_folder().join("plan.json");
    let plan_text = fs::read_to_string(&plan_path).unwrap();
    for damaged_text in [
        plan_text.replace("synthetic", "synthetik"),
        plan_text[..plan_text.len() / 2].to_owned(),
        String::new(),
    ] {
        fs::write(&plan_path, damaged_text).unwrap();
        let mut run = open_run(&test_folder.result_path(), &job);
        assert!(run.take_notes()[0].contains("the frozen plan was damaged"));
        assert!(!run.is_missing(0) && run.is_missing(1));
        assert_eq!(fs::read_to_string(&plan_path).unwrap(), plan_text);
    }
}

#[test]
fn json_files_of_any_length_do_not_fill_the_memory() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    drop(open_run(&test_folder.result_path(), &job));
    for name in ["plan.json", "shards.json", "session-x-1-1.json"] {
        fs::File::create(test_folder.partial_folder().join(name))
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        assert!(read_status(&test_folder.result_path(), &job).is_ok(), "{name}");
        drop(open_run(&test_folder.result_path(), &job));
    }
    // A plan that would be too long to be read is not written.
    let plan_values = vec![0.1; 2_000_000];
    let long_plan_job =
        Job { plan: json!({ "values": plan_values }), ..synthetic::job(POINT_COUNT) };
    let error = OpenRun::open(
        &test_folder.result_path().with_file_name("y.parquet"),
        &long_plan_job,
        default_options(),
    );
    let text = error.unwrap_err().to_string();
    assert!(text.contains("more than 16 MiB") && text.contains("as a list"), "{text}");
}
