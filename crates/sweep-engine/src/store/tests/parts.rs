//! Tests of parts: interrupted runs, damaged parts, shards, and counts.

use super::super::part::Damage;
use super::super::point_parts::{PointPart, PointParts};
use super::*;

#[test]
fn chunks_of_small_grids_are_small_and_those_of_large_grids_bounded() {
    let sizes: Vec<u64> =
        [1, 81, 128, 129, 1287, 100_000, 1_000_000, 1 << 40, u64::MAX].map(chunk_points).to_vec();
    assert_eq!(sizes, [8, 8, 8, 32, 32, 128, 1024, 4096, 4096]);
}

#[test]
fn only_names_of_parts_have_an_index() {
    for index in [0, 7, 99_999_999, 100_000_000, u64::MAX] {
        assert_eq!(part_index(&part_name(index)), Some(index));
    }
    for name in [
        "part-7.parquet",
        "part-00000007.parquet.damaged",
        "part-+0000007.parquet",
        "part-00000007.bin",
        "plan.json",
    ] {
        assert_eq!(part_index(name), None, "{name}");
    }
}

#[test]
fn a_run_interrupted_after_any_chunk_is_resumed() {
    let bytes = uninterrupted_result(POINTS);
    let job = synthetic::job(POINTS);
    for written_chunks in 0..=POINTS.div_ceil(8) {
        let home = Home::new();
        let run = open(&home.output(), &job);
        (0..written_chunks).for_each(|chunk| write(&run, chunk));
        drop(run);
        let run = open(&home.output(), &job);
        assert_eq!(write_missing(&run), POINTS.div_ceil(8) - written_chunks);
        finish(run, &job);
        assert_eq!(fs::read(home.output()).unwrap(), bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn damaged_parts_are_renamed_noted_and_computed_again(
        damages in prop::collection::vec((0..11_u64, any::<prop::sample::Index>(), 0..4_u8), 0..6)
    ) {
        let home = Home::new();
        let job = synthetic::job(POINTS);
        let run = open(&home.output(), &job);
        write_missing(&run);
        drop(run);
        let mut damaged_chunks = std::collections::BTreeSet::new();
        for (chunk, position, kind) in damages {
            let path = home.partial().join(part_name(chunk));
            let Ok(mut bytes) = fs::read(&path) else { continue };
            let position = position.index(bytes.len().max(1));
            match kind {
                0 => bytes.truncate(position),
                1 if !bytes.is_empty() => bytes[position] ^= 0x40,
                2 => bytes.push(0),
                _ => bytes.clear(),
            }
            fs::write(&path, &bytes).unwrap();
            let is_intact = bytes == { part_bytes(&job, chunk) };
            if is_intact { damaged_chunks.remove(&chunk); } else { damaged_chunks.insert(chunk); }
        }
        let mut run = open(&home.output(), &job);
        prop_assert_eq!(run.take_notes().len(), damaged_chunks.len());
        for chunk in &damaged_chunks {
            let damaged_name = format!("{}.damaged", part_name(*chunk));
            prop_assert!(home.partial().join(damaged_name).exists());
        }
        prop_assert_eq!(write_missing(&run), damaged_chunks.len() as u64);
        finish(run, &job);
        prop_assert_eq!(fs::read(home.output()).unwrap(), uninterrupted_result(POINTS));
    }
}

#[test]
fn damage_after_opening_is_found_by_the_join() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    fs::write(home.partial().join(part_name(4)), b"not a part").unwrap();
    fs::remove_file(home.partial().join(part_name(6))).unwrap();
    let error = run.join(&job, &|| false).unwrap_err();
    assert!(error.to_string().contains("2 of 11 chunks are missing"), "{error}");
    assert!(!home.output().exists());
    assert_eq!(write_missing(&run), 2);
    let (_, notes) = finish(run, &job);
    assert!(notes[0].contains("part-00000004.parquet"), "{:?}", notes);
    assert_eq!(fs::read(home.output()).unwrap(), uninterrupted_result(POINTS));
}

#[test]
fn shards_make_the_same_result_and_the_merge_names_missing_ones() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let shard = |index| {
        let shard = Some(ShardRequest::Given(Shard { index, count: 4 }));
        match OpenRun::open(&home.output(), &job, OpenOptions { shard, ..options() }).unwrap() {
            OpenOutcome::Open(run) => run,
            OpenOutcome::Finished(..) => panic!("is not done"),
        }
    };
    assert!(matches!(
        OpenRun::open_for_merge(&home.output(), &job).unwrap_err(),
        StoreError::NoRun { .. }
    ));
    // Two shards at once, one of them in two processes.
    let first_shard = shard(1);
    let third_shard = shard(3);
    let second_third_shard = shard(3);
    assert_eq!(first_shard.count_own_points(), (3 * 8, 0));
    assert_eq!(third_shard.count_own_points(), (8 + 8 + 1, 0), "the last chunk has one point");
    for run in [&first_shard, &third_shard, &second_third_shard] {
        write_missing(run);
    }
    let busy_error = OpenRun::open_for_merge(&home.output(), &job).unwrap_err();
    assert!(matches!(busy_error, StoreError::Busy { .. }), "{busy_error}");
    let running = read_status(&home.output(), &job).unwrap().running;
    assert_eq!(running.iter().map(|holder| holder.shard).collect::<Vec<_>>(), [Some(1), Some(3)]);
    drop((first_shard, third_shard, second_third_shard));

    let OpenOutcome::Open(mut merge) = OpenRun::open_for_merge(&home.output(), &job).unwrap()
    else {
        panic!("is not done")
    };
    let error = merge.join(&job, &|| false).unwrap_err();
    assert!(!error.is_refusal());
    assert!(error.to_string().contains("5 of 11 chunks are missing, of shards 2,4"), "{error}");
    drop(merge);
    let folder_status = read_status(&home.output(), &job).unwrap();
    assert_eq!(
        (folder_status.state, folder_status.missing_shards.as_str(), folder_status.shards),
        (RunStage::Unfinished, "2,4", Some(4))
    );
    assert_eq!((folder_status.chunks_done, folder_status.chunks_missing), (6, 5));

    let other_count =
        OpenOptions { shard: Some(ShardRequest::Given(Shard { index: 1, count: 5 })), ..options() };
    assert!(
        OpenRun::open(&home.output(), &job, other_count)
            .unwrap_err()
            .to_string()
            .contains("into 4 shards")
    );
    let fresh = OpenOptions {
        fresh: true,
        shard: Some(ShardRequest::Given(Shard { index: 2, count: 4 })),
        ..options()
    };
    assert!(
        OpenRun::open(&home.output(), &job, fresh)
            .unwrap_err()
            .to_string()
            .contains("--fresh would delete")
    );

    for index in [2, 4] {
        write_missing(&shard(index));
    }
    assert_eq!(read_status(&home.output(), &job).unwrap().state, RunStage::Complete);
    let OpenOutcome::Open(merge) = OpenRun::open_for_merge(&home.output(), &job).unwrap() else {
        panic!("is not done")
    };
    finish(merge, &job);
    assert_eq!(fs::read(home.output()).unwrap(), uninterrupted_result(POINTS));
    let folder_status = read_status(&home.output(), &job).unwrap();
    assert_eq!((folder_status.state, folder_status.points_done), (RunStage::Finished, POINTS));
    assert!(folder_status.points_failed > 0);
}

#[test]
fn status_counts_without_changing_files() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    assert_eq!(read_status(&home.output(), &job).unwrap().state, RunStage::NotStarted);
    assert_eq!(fs::read_dir(home.0.path()).unwrap().count(), 0);
    let run = open(&home.output(), &job);
    write(&run, 0);
    write(&run, 1);
    fs::write(home.partial().join(part_name(1)), "not a part").unwrap();
    let folder_status = read_status(&home.output(), &job).unwrap();
    assert_eq!(
        (
            folder_status.chunks_done,
            folder_status.chunks_damaged.as_slice(),
            folder_status.points_done
        ),
        (1, &[1][..], 8)
    );
    assert_eq!(folder_status.points_failed, 2, "points 4 and 7 of the formula fail");
    assert_eq!(folder_status.running[0].pid, std::process::id());
    assert!(home.partial().join(part_name(1)).exists());
    let other_plan = Job { plan: json!({}), ..synthetic::job(POINTS) };
    assert!(matches!(
        read_status(&home.output(), &other_plan).unwrap_err(),
        StoreError::PlanDiffers { .. }
    ));
}

fn outcomes(points: impl Iterator<Item = u64>) -> Vec<PointRows> {
    points.map(synthetic::point_rows).collect()
}

#[test]
fn an_incomplete_chunk_is_resumed() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write(&run, 0);
    // Rows arrive in any order.
    run.write_chunk(&job, 3, outcomes([30, 25, 27].into_iter())).unwrap();
    assert_eq!(run.count_own_points(), (POINTS, 8 + 3));
    drop(run);
    let folder_status = read_status(&home.output(), &job).unwrap();
    assert_eq!((folder_status.points_done, folder_status.chunks_done), (11, 1));
    assert!(home.partial().join("part-00000003.parquet").exists());

    let run = open(&home.output(), &job);
    assert_eq!(run.count_own_points(), (POINTS, 11));
    let incomplete = run.take_incomplete();
    assert_eq!(
        incomplete.into_iter().collect::<Vec<_>>(),
        [(3, outcomes([25, 27, 30].into_iter()))]
    );
    assert_eq!(write_missing(&run), 10);
    assert_eq!(run.count_own_points(), (POINTS, POINTS));
    finish(run, &job);
    assert_eq!(fs::read(home.output()).unwrap(), uninterrupted_result(POINTS));
}

#[test]
fn an_unfinished_run_is_found_by_the_path_of_result_or_folder() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    assert_eq!(find_unfinished(&home.output()).unwrap(), None);
    let run = open(&home.output(), &job);
    write(&run, 0);
    run.write_chunk(&job, 3, outcomes([30, 25, 27].into_iter())).unwrap();
    write(&run, 5);
    // A damaged part does not count.
    fs::write(home.partial().join(part_name(5)), part_bytes(&job, 5).split_off(1)).unwrap();
    for path in [home.output(), home.partial()] {
        let unfinished_work = find_unfinished(&path).unwrap().unwrap();
        assert_eq!((unfinished_work.points, unfinished_work.points_done), (Some(POINTS), 8 + 3));
        assert_eq!(
            (&unfinished_work.output, &unfinished_work.folder),
            (&home.output(), &home.partial())
        );
        assert_eq!(
            (unfinished_work.name.as_str(), unfinished_work.running.len()),
            ("synthetic", 1)
        );
        assert_eq!(unfinished_work.progress(), "11 of 81 points done (13.6 %)");
    }
    let error = refuse_unfinished(&home.output()).unwrap_err();
    assert!(error.is_refusal());
    assert!(error.to_string().contains("is not finished: 11 of 81 points done"), "{error}");
    fs::remove_file(home.partial().join(part_name(5))).unwrap();
    drop(run);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    assert_eq!(find_unfinished(&home.output()).unwrap(), None);
    assert_eq!(find_unfinished(&home.partial()).unwrap(), None);
}

#[test]
fn an_unfinished_search_shows_the_number_of_trials() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let mut trials = trials(&home.output(), &job);
    for k in 0..5 {
        trials.add(vec![k, 0], vec![Some(1)]).unwrap();
    }
    trials.write().unwrap();
    let unfinished_work = find_unfinished(&home.output()).unwrap().unwrap();
    assert_eq!((unfinished_work.points, unfinished_work.points_done), (None, 5));
    assert_eq!(unfinished_work.progress(), "5 trials of a search kept");
}

#[test]
fn a_damaged_part_is_renamed_and_a_new_one_replaces_it() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    run.write_chunk(&job, 1, outcomes(8..10)).unwrap();
    run.write_chunk(&job, 2, outcomes(16..20)).unwrap();
    drop(run);
    let part = home.partial().join("part-00000002.parquet");
    let mut bytes = fs::read(&part).unwrap();
    bytes[100] ^= 1;
    fs::write(&part, bytes).unwrap();
    write(&open(&home.output(), &job), 1);

    let mut run = open(&home.output(), &job);
    assert!(run.take_incomplete().is_empty());
    assert_eq!(
        run.take_notes().len(),
        0,
        "the damaged part was renamed and noted when it was found"
    );
    assert!(home.partial().join("part-00000002.parquet.damaged").exists());
    write_missing(&run);
    finish(run, &job);
    assert_eq!(fs::read(home.output()).unwrap(), uninterrupted_result(POINTS));
}

/// Writes bytes to the file of a part, and returns the damage that reading them finds, if any.
fn write_and_find_damage(home: &Home, job: &Job<'_>, index: u64, bytes: &[u8]) -> Option<Damage> {
    let folder = Folder::new(&home.output(), &job.layout).unwrap();
    fs::create_dir_all(&folder.path).unwrap();
    fs::write(folder.file(part_name(index)), bytes).unwrap();
    let read_outcomes = |part: &PointPart<'_>| part.outcomes();
    super::super::open::read_part(&PointParts::new(job), &folder, index, read_outcomes)
        .unwrap()
        .err()
}

#[test]
fn any_flipped_bit_in_a_part_is_found() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let bytes = part_bytes(&job, 3);
    assert_eq!(write_and_find_damage(&home, &job, 3, &bytes), None);
    for position in 0..bytes.len() {
        let mut flipped = bytes.clone();
        flipped[position] ^= 1 << (position % 8);
        assert!(write_and_find_damage(&home, &job, 3, &flipped).is_some(), "byte {position}");
    }
}

#[test]
fn any_truncation_of_a_part_is_found() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let bytes = part_bytes(&job, 3);
    for length in (0..bytes.len()).step_by(3) {
        assert!(
            write_and_find_damage(&home, &job, 3, &bytes[..length]).is_some(),
            "cut to {length}"
        );
    }
    let longer = [bytes.as_slice(), &[0]].concat();
    assert_eq!(write_and_find_damage(&home, &job, 3, &longer), Some(Damage::Bytes));
}

#[test]
fn parts_of_another_plan_index_or_layout_are_foreign() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let bytes = part_bytes(&job, 3);
    assert_eq!(
        write_and_find_damage(&home, &job, 4, &bytes),
        Some(Damage::Foreign),
        "another index"
    );
    let other_build = Job { numerics: 2, ..synthetic::job(POINTS) };
    assert_eq!(
        write_and_find_damage(&home, &other_build, 3, &bytes),
        Some(Damage::Foreign),
        "another build"
    );
    let mut job_with_fewer_columns = synthetic::job(POINTS);
    job_with_fewer_columns.layout.columns.pop();
    assert_eq!(
        write_and_find_damage(&home, &job_with_fewer_columns, 3, &bytes),
        Some(Damage::Foreign),
        "another layout"
    );
    // A result has a digest too, but is not a part.
    assert_eq!(
        write_and_find_damage(&home, &job, 3, &uninterrupted_result(POINTS)),
        Some(Damage::Foreign)
    );
}

#[test]
fn rows_that_do_not_fit_their_part_are_refused() {
    let job = synthetic::job(POINTS);
    let parts = PointParts::new(&job);
    let valid_rows = outcomes(8..16);
    let reason = |outcomes: &[PointRows]| parts.encode(&job, 1, outcomes).unwrap_err().to_string();
    for subset in [&valid_rows[..0], &valid_rows[1..2], &valid_rows] {
        assert!(parts.encode(&job, 1, subset).is_ok());
    }
    let swapped: Vec<PointRows> = valid_rows.iter().rev().cloned().collect();
    assert!(reason(&swapped).contains("8 outcomes that are not of its points"));
    assert!(reason(&outcomes(15..17)).contains("2 outcomes that are not of its points"));
    let mut short_row = valid_rows.clone();
    short_row[0].rows[0].pop();
    assert!(reason(&short_row).contains("does not fit"), "{}", reason(&short_row));
    let mut null_count = valid_rows.clone();
    let steps = synthetic::layout().position("steps").unwrap();
    null_count[0].rows[0][steps] = None;
    assert!(reason(&null_count).contains("does not fit"), "{}", reason(&null_count));
    let mut without_rows = valid_rows;
    without_rows[0].rows.clear();
    assert!(reason(&without_rows).contains("0 rows of"), "{}", reason(&without_rows));
}

/// Returns a strategy for rows of cells that fit the columns.
fn any_row(columns: &[DeclaredColumn]) -> impl Strategy<Value = RowCells> + use<> {
    let cell = |column: &DeclaredColumn| match &column.kind {
        CellType::Count | CellType::Axis => any::<u64>().prop_map(Some).boxed(),
        CellType::Flag => prop::option::of(0..2_u64).boxed(),
        CellType::Name(names) => prop::option::of(0..names.len() as u64).boxed(),
        _ => any::<Option<u64>>().boxed(),
    };
    columns.iter().map(cell).collect::<Vec<_>>()
}

/// Returns a layout with every type of column, several tasks for each point, and several rows for
/// each task.
fn wide_layout() -> Layout {
    let mut layout = synthetic::layout();
    layout.columns.insert(2, DeclaredColumn::new("kept", "", "", CellType::Kept));
    layout.columns.push(DeclaredColumn::new("known", "1", "a count", CellType::KnownCount));
    Layout { tasks_per_point: 3, has_several_rows: true, ..layout }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn written_rows_are_read_back_unchanged(
        points in prop::collection::vec(
            prop::collection::vec(any_row(&wide_layout().columns), 1..4),
            1..8,
        ),
    ) {
        let home = Home::new();
        let job = Job { layout: wide_layout(), ..synthetic::job(POINTS) };
        let outcome = |(rows, point)| PointRows { point, rows };
        let outcomes: Vec<PointRows> = points.into_iter().zip(8..).map(outcome).collect();
        let run = open(&home.output(), &job);
        run.write_chunk(&job, 1, outcomes.clone()).unwrap();
        prop_assert_eq!(run.stored_rows(8), outcomes.first().cloned());
        drop(run);
        let incomplete = open(&home.output(), &job).take_incomplete();
        let read_back: Vec<PointRows> = incomplete.into_values().flatten().collect();
        prop_assert_eq!(read_back, outcomes);
    }

    #[test]
    fn arbitrary_bytes_are_damage(
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let damage = write_and_find_damage(&Home::new(), &synthetic::job(POINTS), 1, &bytes);
        prop_assert!(damage.is_some());
    }
}

#[test]
fn a_part_has_the_columns_of_the_result() {
    let home = Home::new();
    let job = synthetic::job(POINTS);
    let run = open(&home.output(), &job);
    write(&run, 2);
    let part = ParquetFile::open(&home.partial().join(part_name(2))).unwrap();
    assert_eq!(part.schema(), &job.layout.schema());
    let part_batches = batches(&home.partial().join(part_name(2)));
    write_missing(&run);
    finish(run, &job);
    let result = &batches(&home.output())[0];
    assert_eq!(part_batches, [result.slice(16, 8)]);
}
