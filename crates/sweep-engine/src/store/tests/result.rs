//! Tests of results and sidecars: their content, and files that are refused in their place.

use sweep_parameter::Worse;

use super::*;

#[test]
fn every_cell_has_the_value_of_its_row() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    let batch = &read_batches(&test_folder.result_path())[0];
    assert_eq!(batch.num_rows() as u64, POINT_COUNT);
    let read_number = |name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_primitive::<Float64Type>().clone();
        column.is_valid(row).then(|| column.value(row))
    };
    let read_text = |name: &str, row: usize| {
        let column = cells::words(batch.column_by_name(name).unwrap()).unwrap();
        column.into_iter().nth(row).unwrap().map(str::to_owned)
    };
    let read_flag = |name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_boolean();
        column.is_valid(row).then(|| column.value(row))
    };
    let read_count = |name: &str, row: usize| {
        batch.column_by_name(name).unwrap().as_primitive::<UInt64Type>().value(row)
    };
    let mut statuses = std::collections::BTreeSet::new();
    for row in 0..POINT_COUNT as usize {
        let cells = synthetic::row(row as u64);
        let expected_cell = |name: &str| cells[job.layout.position(name).unwrap()];
        statuses.insert(expected_cell("status"));
        assert_eq!(read_count("point", row), row as u64);
        let axis_values = (job.axis_values)(row as u64);
        assert_eq!(read_number("mass_kg", row), Some(axis_values[0]));
        assert_eq!(read_number("damping", row), Some(axis_values[1]));
        for name in ["nonlinear_a", "linear_a", "ratio_max", "error", "fail_time_s"] {
            assert_eq!(read_number(name, row), expected_cell(name).map(f64::from_bits), "{name}");
        }
        for name in ["reliable", "sensitive", "converged"] {
            assert_eq!(
                read_flag(name, row),
                expected_cell(name).map(|read_flag| read_flag == 1),
                "{name}"
            );
        }
        let method_name =
            expected_cell("method").map(|method_name| ["rk4", "dopri5"][method_name as usize]);
        assert_eq!(read_text("method", row).as_deref(), method_name);
        let status_name = synthetic::STATUSES[expected_cell("status").unwrap() as usize];
        assert_eq!(read_text("status", row).as_deref(), Some(status_name));
        assert_eq!(Some(read_count("steps", row)), expected_cell("steps"));
    }
    assert!(statuses.len() > 3, "the formula must bring every kind of row by: {statuses:?}");
}

#[test]
fn the_metadata_do_not_depend_on_host_or_folder() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    let file = ParquetFile::open(&test_folder.result_path()).unwrap();
    assert_eq!(file.created_by(), Some("sweep version 0.0.0-test"));
    let metadata_entries: Vec<_> = file.pairs().collect();
    let metadata_keys: Vec<&str> = metadata_entries.iter().map(|pair| pair.key.as_str()).collect();
    let expected_keys = [
        "sweep.plan",
        "sweep.plan_hash",
        "sweep.version",
        "sweep.numerics",
        "sweep.columns",
        "sweep.digest",
    ];
    assert_eq!(metadata_keys, expected_keys);
    assert_eq!(
        serde_json::from_str::<Value>(metadata_entries[0].value.as_ref().unwrap()).unwrap(),
        job.plan
    );
    assert_eq!(file.schema(), &job.layout.schema());
    let column_metadata: Value = file.json("sweep.columns").unwrap();
    assert_eq!(column_metadata["mass_kg"]["type"], "float64");
    let bytes = fs::read(test_folder.result_path()).unwrap();
    let host = provenance::host_name();
    let folder_text = test_folder.0.path().to_str().unwrap();
    for private_text in [host.as_str(), folder_text] {
        assert!(
            !bytes.windows(private_text.len()).any(|window| window == private_text.as_bytes()),
            "{private_text} is in the file"
        );
    }
}

#[test]
fn the_result_does_not_depend_on_the_order_of_chunks() {
    // More rows than one batch, and a last chunk that is not full.
    let points = 5003;
    let expected_bytes = uninterrupted_result_bytes(points);
    let test_folder = TestFolder::new();
    let job = synthetic::job(points);
    let run = open_run(&test_folder.result_path(), &job);
    for chunk in (0..run.chunk_count()).rev() {
        write_complete_chunk(&run, chunk);
    }
    let (tally, _) = finish_run(run, &job);
    assert_eq!(tally.points, points);
    assert_eq!(fs::read(test_folder.result_path()).unwrap(), expected_bytes);
}

/// Other programs may write a mark for summaries without a worse side.
#[test]
fn a_mark_without_a_worse_side_leaves_the_other_extremes() {
    let test_folder = TestFolder::new();
    let mut job = synthetic::job(POINT_COUNT);
    let column_without_worse_side = job.layout.position("nonlinear_a").unwrap();
    job.layout.columns[column_without_worse_side].metadata.is_in_summary = true;
    let column_with_worse_side = job.layout.position("linear_a").unwrap();
    job.layout.columns[column_with_worse_side].metadata.is_in_summary = true;
    job.layout.columns[column_with_worse_side].metadata.worse = Some(Worse::Greater);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    let (tally, _) = finish_run(run, &job);
    let extreme_columns: Vec<&str> =
        tally.extremes.iter().map(|extreme| &*extreme.column).collect();
    assert_eq!(extreme_columns, ["linear_a"]);
    let rows = (0..POINT_COUNT).map(synthetic::row);
    let greatest_value =
        rows.filter_map(|row| job.layout.number(&row, "linear_a")).reduce(f64::max);
    assert_eq!(tally.extremes[0].worst_value.as_ref().map(|worst| worst.value), greatest_value);
}

#[test]
fn the_condition_of_undefined_ratios_is_that_of_their_column() {
    let test_folder = TestFolder::new();
    let mut job = synthetic::job(POINT_COUNT);
    let ratio_column = job.layout.position("ratio_max").unwrap();
    job.layout.columns[ratio_column].metadata.description =
        "a quotient; null where b is zero".to_owned();
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    let (tally, _) = finish_run(run, &job);
    assert_eq!(tally.undefined_condition.as_deref(), Some("null where b is zero"));
}

#[test]
fn a_finished_result_is_not_computed_again() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    let OpenOutcome::Finished((file, tally)) =
        OpenRun::open(&test_folder.result_path(), &job, default_options()).unwrap()
    else {
        panic!("is done")
    };
    assert_eq!((file.points, &file.plan), (POINT_COUNT, &job.plan));
    assert_eq!((file.numerics, tally.points), (1, POINT_COUNT));
    assert!(!test_folder.partial_folder().exists());

    let job_with_other_plan =
        Job { plan: json!({ "name": "other_plan" }), ..synthetic::job(POINT_COUNT) };
    let error = OpenRun::open(&test_folder.result_path(), &job_with_other_plan, default_options())
        .unwrap_err();
    assert!(matches!(error, StoreError::OutputDiffers { .. }) && error.is_refusal(), "{error}");
    assert!(error.to_string().contains(r#"/name: was "synthetic", is "other_plan""#), "{error}");

    // A build with further columns for the same plan refuses the result.
    let mut job_with_more_columns = synthetic::job(POINT_COUNT);
    job_with_more_columns.layout.columns.push(DeclaredColumn::new(
        "further_n",
        "N",
        "a further one",
        CellType::Measured,
    ));
    let error =
        OpenRun::open(&test_folder.result_path(), &job_with_more_columns, default_options())
            .unwrap_err();
    assert!(matches!(error, StoreError::OutputDiffers { .. }) && error.is_refusal(), "{error}");
    assert!(error.to_string().contains("further_n"), "{error}");

    // With `--fresh`, the old result stays until the new one replaces it.
    let old_bytes = fs::read(test_folder.result_path()).unwrap();
    let fresh_options = OpenOptions { starts_over: true, ..default_options() };
    drop(OpenRun::open(&test_folder.result_path(), &job_with_other_plan, fresh_options).unwrap());
    assert_eq!(fs::read(test_folder.result_path()).unwrap(), old_bytes);
    let run = open_run(&test_folder.result_path(), &job_with_other_plan);
    write_missing_chunks(&run);
    finish_run(run, &job_with_other_plan);
    assert_ne!(fs::read(test_folder.result_path()).unwrap(), old_bytes);
}

#[test]
fn a_result_with_a_flipped_bit_is_refused() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    let undamaged_bytes = fs::read(test_folder.result_path()).unwrap();
    let mut recognised_damage_count = 0;
    let flipped_positions = (0..undamaged_bytes.len()).step_by(7);
    let flipped_count = flipped_positions.len();
    for position in flipped_positions {
        let mut flipped_bytes = undamaged_bytes.clone();
        flipped_bytes[position] ^= 1 << (position % 8);
        fs::write(test_folder.result_path(), &flipped_bytes).unwrap();
        let error = OpenRun::open(&test_folder.result_path(), &job, default_options()).unwrap_err();
        let text = error.to_string();
        recognised_damage_count +=
            usize::from(matches!(error, StoreError::File(FileError::Damaged { .. })));
        assert!(text.contains("x.parquet") && text.contains("= help: "), "byte {position}: {text}");
        assert!(
            read_status(&test_folder.result_path(), &job).is_err()
                && OpenRun::open_for_merge(&test_folder.result_path(), &job).is_err()
        );
        assert!(
            fs::read(test_folder.result_path()).unwrap() == flipped_bytes
                && !test_folder.partial_folder().exists(),
            "byte {position}"
        );
    }
    // Elsewhere the bit is in the end of the file or in a key of the metadata, so that the
    // file is not recognised as a result.
    assert!(
        recognised_damage_count * 100 > flipped_count * 95,
        "{recognised_damage_count} of {flipped_count} bytes"
    );
}

#[test]
fn a_result_without_its_digest_is_refused() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    let mut bytes = fs::read(test_folder.result_path()).unwrap();
    let mut refuse_after_replacing = |word: &[u8], replacement: &[u8]| {
        let position = bytes.windows(word.len()).rposition(|window| window == word).unwrap();
        bytes[position..position + replacement.len()].copy_from_slice(replacement);
        fs::write(test_folder.result_path(), &bytes).unwrap();
        OpenRun::open(&test_folder.result_path(), &job, default_options()).unwrap_err()
    };
    let error = refuse_after_replacing(b"sweep.digest", b"sweep.D");
    assert!(matches!(error, StoreError::File(FileError::Damaged { .. })), "{error}");
    let error = refuse_after_replacing(b"sweep version", b"other");
    assert!(matches!(error, StoreError::File(FileError::Rewritten { .. })), "{error}");
}

#[test]
fn results_whose_names_differ_after_a_dot_have_different_sidecars() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    for (name, sidecar) in
        [("v1.0", "v1.0.run.json"), ("v1.5", "v1.5.run.json"), ("x.parquet", "x.run.json")]
    {
        let output = test_folder.0.path().join(name);
        let run = open_run(&output, &job);
        write_missing_chunks(&run);
        finish_run(run, &job);
        let text = fs::read_to_string(test_folder.0.path().join(sidecar)).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap()["file"], name);
    }
    // A result and its sidecar may be renamed together.
    for (old_name, new_name) in [("v1.0", "w.parquet"), ("v1.0.run.json", "w.run.json")] {
        fs::rename(test_folder.0.path().join(old_name), test_folder.0.path().join(new_name))
            .unwrap();
    }
    let outcome_after_rename =
        OpenRun::open(&test_folder.0.path().join("w.parquet"), &job, default_options()).unwrap();
    assert!(matches!(outcome_after_rename, OpenOutcome::Finished(..)));
    // Two outputs are refused: one whose sidecar is that of another result, and one with a foreign
    // file under the sidecar's name.
    let assert_refused = |output: &Path| {
        let error = OpenRun::open(output, &job, default_options()).unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("is no sidecar of the run with this --out"), "{error}");
    };
    assert_refused(&test_folder.0.path().join("x"));
    let foreign_sidecar = test_folder.0.path().join("y.run.json");
    fs::write(&foreign_sidecar, r#"{ "mine": true }"#).unwrap();
    assert_refused(&test_folder.0.path().join("y.parquet"));
    assert_eq!(fs::read_to_string(foreign_sidecar).unwrap(), r#"{ "mine": true }"#);
    assert!(!test_folder.0.path().join("y.parquet.partial").exists());
}

#[test]
fn the_sidecar_adds_up_the_sessions() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let make_session = |pid, points| provenance::Session {
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
    let mut run = open_run(&test_folder.result_path(), &job);
    run.record_session(&make_session(7, 40)).unwrap();
    write_missing_chunks(&run);
    let tally = run.join(&job, &|| false).unwrap().unwrap();
    run.complete(&job, &tally, Some(make_session(9, 41))).unwrap();
    let text = fs::read_to_string(test_folder.0.path().join("x.run.json")).unwrap();
    let sidecar: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(sidecar["file"], "x.parquet");
    assert_eq!(sidecar["wall_s"], 4.0);
    assert_eq!(sidecar["points_per_s"], 81.0 / 4.0);
    assert_eq!(sidecar["sessions"].as_array().unwrap().len(), 2);
    assert_eq!(sidecar["rows"]["points"], POINT_COUNT);
    let status_count_sum: u64 = sidecar["rows"]["by_status"]
        .as_object()
        .unwrap()
        .values()
        .map(|count| count.as_u64().unwrap())
        .sum();
    assert_eq!(status_count_sum, POINT_COUNT);
}

#[test]
fn the_counts_agree_with_the_rows() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    let (tally, _) = finish_run(run, &job);
    let layout = synthetic::layout();
    let column_index = |name: &str| layout.position(name).unwrap();
    let reliable_column = column_index("reliable");
    let ratio_column = column_index("ratio_max");
    let rows: Vec<_> = (0..POINT_COUNT).map(synthetic::row).collect();
    let count_verdicts =
        |flag| rows.iter().filter(|row| row[reliable_column] == flag).count() as u64;
    assert_eq!(
        (tally.reliable, tally.unreliable, tally.undefined),
        (count_verdicts(Some(1)), count_verdicts(Some(0)), count_verdicts(None))
    );
    assert_eq!(tally.reliable + tally.unreliable + tally.undefined, POINT_COUNT);
    let status_column = column_index("status");
    let is_undefined_without_failure =
        |row: &&Vec<Option<u64>>| row[reliable_column].is_none() && row[status_column] == Some(0);
    assert_eq!(
        tally.undefined_without_failure,
        rows.iter().filter(is_undefined_without_failure).count() as u64
    );
    let defined_ratios = (0..)
        .zip(&rows)
        .filter_map(|(point, row)| Some((point, f64::from_bits(row[ratio_column]?))));
    let (point, greatest_ratio) =
        defined_ratios.reduce(|best, row| if row.1 > best.1 { row } else { best }).unwrap();
    assert_eq!(tally.greatest_ratio, Some(read::Extreme { value: greatest_ratio, point }));
}

#[test]
fn a_stopped_join_writes_no_result() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let mut run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    assert!(run.join(&job, &|| true).unwrap().is_none());
    assert!(!test_folder.result_path().exists());
    finish_run(run, &job);
    assert!(test_folder.result_path().exists());
}
