//! The result file and its sidecar: what they say, and what is taken for them.

use super::*;

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
fn the_file_says_what_it_is_and_nothing_of_where_or_when() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
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
    let (tally, _) = finish(run, &job);
    assert_eq!(tally.points, points);
    assert_eq!(fs::read(home.output()).unwrap(), bytes);
}

#[test]
fn a_finished_output_is_left_alone() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    let Opened::Finished((file, tally)) = OpenRun::open(&home.output(), &job, options()).unwrap()
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

    // A build with further columns for the same plan does not take it for its own.
    let mut with = synthetic::job(POINTS);
    with.layout.columns.push(Column::new("further_n", "N", "a further one", Holds::Measured));
    let error = OpenRun::open(&home.output(), &with, options()).unwrap_err();
    assert!(matches!(error, StoreError::OutputDiffers { .. }) && error.is_refusal(), "{error}");
    assert!(error.to_string().contains("further_n"), "{error}");

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
    let mut refused = |word: &[u8], by: &[u8]| {
        let at = bytes.windows(word.len()).rposition(|window| window == word).unwrap();
        bytes[at..at + by.len()].copy_from_slice(by);
        fs::write(home.output(), &bytes).unwrap();
        OpenRun::open(&home.output(), &job, options()).unwrap_err()
    };
    let error = refused(b"sweep.digest", b"sweep.D");
    assert!(matches!(error, StoreError::File(FileError::Damaged { .. })), "{error}");
    let error = refused(b"sweep version", b"other");
    assert!(matches!(error, StoreError::File(FileError::Rewritten { .. })), "{error}");
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
    // They may be renamed together.
    for (was, is) in [("v1.0", "w.parquet"), ("v1.0.run.json", "w.run.json")] {
        fs::rename(home.0.path().join(was), home.0.path().join(is)).unwrap();
    }
    let renamed = OpenRun::open(&home.0.path().join("w.parquet"), &job, options()).unwrap();
    assert!(matches!(renamed, Opened::Finished(..)));
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
fn the_tally_agrees_with_the_outcomes() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write_missing(&run);
    let (tally, _) = finish(run, &job);
    let layout = synthetic::layout();
    let position = |name: &str| layout.position(name).unwrap();
    let (reliable, ratio) = (position("reliable"), position("ratio_max"));
    let rows: Vec<_> = (0..POINTS).map(synthetic::row).collect();
    let with = |flag| rows.iter().filter(|row| row[reliable] == flag).count() as u64;
    assert_eq!(
        (tally.reliable, tally.unreliable, tally.undefined),
        (with(Some(1)), with(Some(0)), with(None))
    );
    assert_eq!(tally.reliable + tally.unreliable + tally.undefined, POINTS);
    let ratios =
        (0..).zip(&rows).filter_map(|(point, row)| Some((point, f64::from_bits(row[ratio]?))));
    let (point, greatest) =
        ratios.reduce(|best, row| if row.1 > best.1 { row } else { best }).unwrap();
    assert_eq!(tally.greatest_ratio, Some(read::Extreme { value: greatest, point }));
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
