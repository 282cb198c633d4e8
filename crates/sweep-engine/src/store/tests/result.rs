//! Tests of results and sidecars: their content, and files that are refused in their place.

use sweep_parameter::Worse;

use super::*;

#[test]
fn every_cell_has_the_value_of_its_row() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
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
        let column = cells::words(batch.column_by_name(name).unwrap()).unwrap();
        column.into_iter().nth(row).unwrap().map(str::to_owned)
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
        let cells = synthetic::row(row as u64);
        let cell = |name: &str| cells[job.layout.position(name).unwrap()];
        statuses.insert(cell("status"));
        assert_eq!(count("point", row), row as u64);
        let axes = (job.axis_values)(row as u64);
        assert_eq!(number("mass_kg", row), Some(axes[0]));
        assert_eq!(number("damping", row), Some(axes[1]));
        for name in ["nonlinear_a", "linear_a", "ratio_max", "error", "fail_time_s"] {
            assert_eq!(number(name, row), cell(name).map(f64::from_bits), "{name}");
        }
        for name in ["reliable", "sensitive", "converged"] {
            assert_eq!(flag(name, row), cell(name).map(|flag| flag == 1), "{name}");
        }
        let method = cell("method").map(|method| ["rk4", "dopri5"][method as usize]);
        assert_eq!(text("method", row).as_deref(), method);
        let status = synthetic::STATUSES[cell("status").unwrap() as usize];
        assert_eq!(text("status", row).as_deref(), Some(status));
        assert_eq!(Some(count("steps", row)), cell("steps"));
    }
    assert!(statuses.len() > 3, "the formula must bring every kind of row by: {statuses:?}");
}

#[test]
fn the_metadata_do_not_depend_on_host_or_folder() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let file = ParquetFile::open(&home.output()).unwrap();
    assert_eq!(file.created_by(), Some("sweep version 0.0.0-test"));
    let pairs: Vec<_> = file.pairs().collect();
    let keys: Vec<&str> = pairs.iter().map(|pair| pair.key.as_str()).collect();
    let expected = [
        "sweep.plan",
        "sweep.plan_hash",
        "sweep.version",
        "sweep.numerics",
        "sweep.columns",
        "sweep.digest",
    ];
    assert_eq!(keys, expected);
    assert_eq!(serde_json::from_str::<Value>(pairs[0].value.as_ref().unwrap()).unwrap(), job.plan);
    assert_eq!(file.schema(), &job.layout.schema());
    let columns: Value = file.json("sweep.columns").unwrap();
    assert_eq!(columns["mass_kg"]["type"], "float64");
    let bytes = fs::read(home.output()).unwrap();
    let host = provenance::host_name();
    let home_text = home.0.path().to_str().unwrap();
    for private_text in [host.as_str(), home_text] {
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
    let bytes = uninterrupted_result(points);
    let home = Home::new();
    let job = synthetic::job(points);
    let run = open(&home.output(), &job);
    for chunk in (0..run.chunks()).rev() {
        write(&run, chunk);
    }
    let (tally, _) = finish(run, &job);
    assert_eq!(tally.points, points);
    assert_eq!(fs::read(home.output()).unwrap(), bytes);
}

/// Other programs may write a mark for summaries without a worse side.
#[test]
fn a_mark_without_a_worse_side_leaves_the_other_extremes() {
    let home = Home::new();
    let mut job = synthetic::job(POINTS);
    let without_side = job.layout.position("nonlinear_a").unwrap();
    job.layout.columns[without_side].metadata.is_in_summary = true;
    let with_side = job.layout.position("linear_a").unwrap();
    job.layout.columns[with_side].metadata.is_in_summary = true;
    job.layout.columns[with_side].metadata.worse = Some(Worse::Greater);
    let run = open(&home.output(), &job);
    write_missing(&run);
    let (tally, _) = finish(run, &job);
    let columns: Vec<&str> = tally.extremes.iter().map(|extreme| &*extreme.column).collect();
    assert_eq!(columns, ["linear_a"]);
    let rows = (0..POINTS).map(synthetic::row);
    let greatest = rows.filter_map(|row| job.layout.number(&row, "linear_a")).reduce(f64::max);
    assert_eq!(tally.extremes[0].worst.as_ref().map(|worst| worst.value), greatest);
}

#[test]
fn the_condition_of_undefined_ratios_is_that_of_their_column() {
    let home = Home::new();
    let mut job = synthetic::job(POINTS);
    let ratio = job.layout.position("ratio_max").unwrap();
    job.layout.columns[ratio].metadata.description = "a quotient; null where b is zero".to_owned();
    let run = open(&home.output(), &job);
    write_missing(&run);
    let (tally, _) = finish(run, &job);
    assert_eq!(tally.undefined_condition.as_deref(), Some("null where b is zero"));
}

#[test]
fn a_finished_result_is_not_computed_again() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let OpenOutcome::Finished((file, tally)) =
        OpenRun::open(&home.output(), &job, options()).unwrap()
    else {
        panic!("is done")
    };
    assert_eq!((file.points, &file.plan), (POINTS, &job.plan));
    assert_eq!((file.numerics, tally.points), (1, POINTS));
    assert!(!home.partial().exists());

    let other_plan = Job { plan: json!({ "name": "other_plan" }), ..synthetic::job(POINTS) };
    let error = OpenRun::open(&home.output(), &other_plan, options()).unwrap_err();
    assert!(matches!(error, StoreError::OutputDiffers { .. }) && error.is_refusal(), "{error}");
    assert!(error.to_string().contains(r#"/name: was "synthetic", is "other_plan""#), "{error}");

    // A build with further columns for the same plan refuses the result.
    let mut job_with_more_columns = synthetic::job(POINTS);
    job_with_more_columns.layout.columns.push(DeclaredColumn::new(
        "further_n",
        "N",
        "a further one",
        CellType::Measured,
    ));
    let error = OpenRun::open(&home.output(), &job_with_more_columns, options()).unwrap_err();
    assert!(matches!(error, StoreError::OutputDiffers { .. }) && error.is_refusal(), "{error}");
    assert!(error.to_string().contains("further_n"), "{error}");

    // With `--fresh`, the old result stays until the new one replaces it.
    let old_bytes = fs::read(home.output()).unwrap();
    let fresh = OpenOptions { fresh: true, ..options() };
    drop(OpenRun::open(&home.output(), &other_plan, fresh).unwrap());
    assert_eq!(fs::read(home.output()).unwrap(), old_bytes);
    let run = open(&home.output(), &other_plan);
    write_missing(&run);
    finish(run, &other_plan);
    assert_ne!(fs::read(home.output()).unwrap(), old_bytes);
}

#[test]
fn a_result_with_a_flipped_bit_is_refused() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let undamaged = fs::read(home.output()).unwrap();
    let mut recognised_damages = 0;
    let positions = (0..undamaged.len()).step_by(7);
    let flipped_count = positions.len();
    for position in positions {
        let mut bytes = undamaged.clone();
        bytes[position] ^= 1 << (position % 8);
        fs::write(home.output(), &bytes).unwrap();
        let error = OpenRun::open(&home.output(), &job, options()).unwrap_err();
        let text = error.to_string();
        recognised_damages +=
            usize::from(matches!(error, StoreError::File(FileError::Damaged { .. })));
        assert!(text.contains("x.parquet") && text.contains("= help: "), "byte {position}: {text}");
        assert!(
            read_status(&home.output(), &job).is_err()
                && OpenRun::open_for_merge(&home.output(), &job).is_err()
        );
        assert!(
            fs::read(home.output()).unwrap() == bytes && !home.partial().exists(),
            "byte {position}"
        );
    }
    // Elsewhere the bit is in the end of the file or in a key of the metadata, so that the
    // file is not recognised as a result.
    assert!(
        recognised_damages * 100 > flipped_count * 95,
        "{recognised_damages} of {flipped_count} bytes"
    );
}

#[test]
fn a_result_without_its_digest_is_refused() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let mut bytes = fs::read(home.output()).unwrap();
    let mut refusal = |word: &[u8], replacement: &[u8]| {
        let position = bytes.windows(word.len()).rposition(|window| window == word).unwrap();
        bytes[position..position + replacement.len()].copy_from_slice(replacement);
        fs::write(home.output(), &bytes).unwrap();
        OpenRun::open(&home.output(), &job, options()).unwrap_err()
    };
    let error = refusal(b"sweep.digest", b"sweep.D");
    assert!(matches!(error, StoreError::File(FileError::Damaged { .. })), "{error}");
    let error = refusal(b"sweep version", b"other");
    assert!(matches!(error, StoreError::File(FileError::Rewritten { .. })), "{error}");
}

#[test]
fn results_whose_names_differ_after_a_dot_have_different_sidecars() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
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
    // A result and its sidecar may be renamed together.
    for (old_name, new_name) in [("v1.0", "w.parquet"), ("v1.0.run.json", "w.run.json")] {
        fs::rename(home.0.path().join(old_name), home.0.path().join(new_name)).unwrap();
    }
    let outcome_after_rename =
        OpenRun::open(&home.0.path().join("w.parquet"), &job, options()).unwrap();
    assert!(matches!(outcome_after_rename, OpenOutcome::Finished(..)));
    // Two outputs are refused: one whose sidecar is that of another result, and one with a foreign
    // file under the sidecar's name.
    let refusal = |output: &Path| {
        let error = OpenRun::open(output, &job, options()).unwrap_err();
        assert!(error.is_refusal());
        assert!(error.to_string().contains("is no sidecar of the run with this --out"), "{error}");
    };
    refusal(&home.0.path().join("x"));
    let foreign_sidecar = home.0.path().join("y.run.json");
    fs::write(&foreign_sidecar, r#"{ "mine": true }"#).unwrap();
    refusal(&home.0.path().join("y.parquet"));
    assert_eq!(fs::read_to_string(foreign_sidecar).unwrap(), r#"{ "mine": true }"#);
    assert!(!home.0.path().join("y.parquet.partial").exists());
}

#[test]
fn the_sidecar_adds_up_the_sessions() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
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
    run.record_session(&session(7, 40)).unwrap();
    write_missing(&run);
    let tally = run.join(&job, &|| false).unwrap().unwrap();
    run.complete(&job, &tally, Some(session(9, 41))).unwrap();
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
fn the_counts_agree_with_the_rows() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write_missing(&run);
    let (tally, _) = finish(run, &job);
    let layout = synthetic::layout();
    let position = |name: &str| layout.position(name).unwrap();
    let reliable = position("reliable");
    let ratio = position("ratio_max");
    let rows: Vec<_> = (0..POINTS).map(synthetic::row).collect();
    let count_verdicts = |flag| rows.iter().filter(|row| row[reliable] == flag).count() as u64;
    assert_eq!(
        (tally.reliable, tally.unreliable, tally.undefined),
        (count_verdicts(Some(1)), count_verdicts(Some(0)), count_verdicts(None))
    );
    assert_eq!(tally.reliable + tally.unreliable + tally.undefined, POINTS);
    let status = position("status");
    let is_undefined_without_failure =
        |row: &&Vec<Option<u64>>| row[reliable].is_none() && row[status] == Some(0);
    assert_eq!(
        tally.undefined_without_failure,
        rows.iter().filter(is_undefined_without_failure).count() as u64
    );
    let ratios =
        (0..).zip(&rows).filter_map(|(point, row)| Some((point, f64::from_bits(row[ratio]?))));
    let (point, greatest) =
        ratios.reduce(|best, row| if row.1 > best.1 { row } else { best }).unwrap();
    assert_eq!(tally.greatest_ratio, Some(read::Extreme { value: greatest, point }));
}

#[test]
fn a_stopped_join_writes_no_result() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    assert!(run.join(&job, &|| true).unwrap().is_none());
    assert!(!home.output().exists());
    finish(run, &job);
    assert!(home.output().exists());
}
