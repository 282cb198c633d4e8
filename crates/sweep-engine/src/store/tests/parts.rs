//! Tests of parts: interrupted runs, damaged parts, shards, and counts.

use super::super::part::PartDamage;
use super::super::point_parts::{PointPart, PointParts};
use super::*;

#[test]
fn chunks_of_small_grids_are_small_and_those_of_large_grids_bounded() {
    let chunk_sizes: Vec<u64> =
        [1, 81, 128, 129, 1287, 100_000, 1_000_000, 1 << 40, u64::MAX].map(chunk_points).to_vec();
    assert_eq!(chunk_sizes, [8, 8, 8, 32, 32, 128, 1024, 4096, 4096]);
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
    let expected_bytes = uninterrupted_result_bytes(POINT_COUNT);
    let job = synthetic::job(POINT_COUNT);
    for written_chunks in 0..=POINT_COUNT.div_ceil(8) {
        let test_folder = TestFolder::new();
        let run = open_run(&test_folder.result_path(), &job);
        (0..written_chunks).for_each(|chunk| write_complete_chunk(&run, chunk));
        drop(run);
        let run = open_run(&test_folder.result_path(), &job);
        assert_eq!(write_missing_chunks(&run), POINT_COUNT.div_ceil(8) - written_chunks);
        finish_run(run, &job);
        assert_eq!(fs::read(test_folder.result_path()).unwrap(), expected_bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn damaged_parts_are_renamed_noted_and_computed_again(
        damages in prop::collection::vec((0..11_u64, any::<prop::sample::Index>(), 0..4_u8), 0..6)
    ) {
        let test_folder = TestFolder::new();
        let job = synthetic::job(POINT_COUNT);
        let run = open_run(&test_folder.result_path(), &job);
        write_missing_chunks(&run);
        drop(run);
        let mut damaged_chunks = std::collections::BTreeSet::new();
        for (chunk, damage_offset, damage_kind) in damages {
            let part_path = test_folder.partial_folder().join(part_name(chunk));
            let Ok(mut part_bytes_on_disk) = fs::read(&part_path) else { continue };
            let damage_offset = damage_offset.index(part_bytes_on_disk.len().max(1));
            match damage_kind {
                0 => part_bytes_on_disk.truncate(damage_offset),
                1 if !part_bytes_on_disk.is_empty() => part_bytes_on_disk[damage_offset] ^= 0x40,
                2 => part_bytes_on_disk.push(0),
                _ => part_bytes_on_disk.clear(),
            }
            fs::write(&part_path, &part_bytes_on_disk).unwrap();
            let is_intact = part_bytes_on_disk == { part_bytes(&job, chunk) };
            if is_intact { damaged_chunks.remove(&chunk); } else { damaged_chunks.insert(chunk); }
        }
        let mut run = open_run(&test_folder.result_path(), &job);
        prop_assert_eq!(run.take_notes().len(), damaged_chunks.len());
        for chunk in &damaged_chunks {
            let damaged_name = format!("{}.damaged", part_name(*chunk));
            prop_assert!(test_folder.partial_folder().join(damaged_name).exists());
        }
        prop_assert_eq!(write_missing_chunks(&run), damaged_chunks.len() as u64);
        finish_run(run, &job);
        let result_bytes = fs::read(test_folder.result_path()).unwrap();
        prop_assert_eq!(result_bytes, uninterrupted_result_bytes(POINT_COUNT));
    }
}

#[test]
fn damage_after_opening_is_found_by_the_join() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let mut run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    fs::write(test_folder.partial_folder().join(part_name(4)), b"not a part").unwrap();
    fs::remove_file(test_folder.partial_folder().join(part_name(6))).unwrap();
    let error = run.join(&job, &|| false).unwrap_err();
    assert!(error.to_string().contains("2 of 11 chunks are missing"), "{error}");
    assert!(!test_folder.result_path().exists());
    assert_eq!(write_missing_chunks(&run), 2);
    let (_, notes) = finish_run(run, &job);
    assert!(notes[0].contains("part-00000004.parquet"), "{:?}", notes);
    assert_eq!(
        fs::read(test_folder.result_path()).unwrap(),
        uninterrupted_result_bytes(POINT_COUNT)
    );
}

#[test]
fn shards_make_the_same_result_and_the_merge_names_missing_ones() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let shard = |index| {
        let shard = Some(ShardRequest::Given(Shard { index, count: 4 }));
        match OpenRun::open(
            &test_folder.result_path(),
            &job,
            OpenOptions { shard, ..default_options() },
        )
        .unwrap()
        {
            OpenOutcome::Open(run) => run,
            OpenOutcome::Finished(..) => panic!("is not done"),
        }
    };
    assert!(matches!(
        OpenRun::open_for_merge(&test_folder.result_path(), &job).unwrap_err(),
        StoreError::NoRun { .. }
    ));
    // Two shards at once, one of them in two processes.
    let first_shard_run = shard(1);
    let third_shard_run = shard(3);
    let repeated_third_shard_run = shard(3);
    assert_eq!(first_shard_run.count_own_points(), (3 * 8, 0));
    assert_eq!(third_shard_run.count_own_points(), (8 + 8 + 1, 0), "the last chunk has one point");
    for run in [&first_shard_run, &third_shard_run, &repeated_third_shard_run] {
        write_missing_chunks(run);
    }
    let busy_error = OpenRun::open_for_merge(&test_folder.result_path(), &job).unwrap_err();
    assert!(matches!(busy_error, StoreError::Busy { .. }), "{busy_error}");
    let running_processes = read_status(&test_folder.result_path(), &job).unwrap().running;
    assert_eq!(
        running_processes.iter().map(|holder| holder.shard).collect::<Vec<_>>(),
        [Some(1), Some(3)]
    );
    drop((first_shard_run, third_shard_run, repeated_third_shard_run));

    let OpenOutcome::Open(mut merge_run) =
        OpenRun::open_for_merge(&test_folder.result_path(), &job).unwrap()
    else {
        panic!("is not done")
    };
    let error = merge_run.join(&job, &|| false).unwrap_err();
    assert!(!error.is_refusal());
    assert!(error.to_string().contains("5 of 11 chunks are missing, of shards 2,4"), "{error}");
    drop(merge_run);
    let folder_status = read_status(&test_folder.result_path(), &job).unwrap();
    assert_eq!(
        (folder_status.state, folder_status.missing_shards.as_str(), folder_status.shards),
        (RunStage::Unfinished, "2,4", Some(4))
    );
    assert_eq!((folder_status.chunks_done, folder_status.chunks_missing), (6, 5));

    let options_with_other_count = OpenOptions {
        shard: Some(ShardRequest::Given(Shard { index: 1, count: 5 })),
        ..default_options()
    };
    assert!(
        OpenRun::open(&test_folder.result_path(), &job, options_with_other_count)
            .unwrap_err()
            .to_string()
            .contains("into 4 shards")
    );
    let fresh_shard_options = OpenOptions {
        starts_over: true,
        shard: Some(ShardRequest::Given(Shard { index: 2, count: 4 })),
        ..default_options()
    };
    assert!(
        OpenRun::open(&test_folder.result_path(), &job, fresh_shard_options)
            .unwrap_err()
            .to_string()
            .contains("--fresh would delete")
    );

    for index in [2, 4] {
        write_missing_chunks(&shard(index));
    }
    assert_eq!(read_status(&test_folder.result_path(), &job).unwrap().state, RunStage::Complete);
    let OpenOutcome::Open(merge_run) =
        OpenRun::open_for_merge(&test_folder.result_path(), &job).unwrap()
    else {
        panic!("is not done")
    };
    finish_run(merge_run, &job);
    assert_eq!(
        fs::read(test_folder.result_path()).unwrap(),
        uninterrupted_result_bytes(POINT_COUNT)
    );
    let folder_status = read_status(&test_folder.result_path(), &job).unwrap();
    assert_eq!((folder_status.state, folder_status.points_done), (RunStage::Finished, POINT_COUNT));
    assert!(folder_status.points_failed > 0);
}

#[test]
fn status_counts_without_changing_files() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    assert_eq!(read_status(&test_folder.result_path(), &job).unwrap().state, RunStage::NotStarted);
    assert_eq!(fs::read_dir(test_folder.0.path()).unwrap().count(), 0);
    let run = open_run(&test_folder.result_path(), &job);
    write_complete_chunk(&run, 0);
    write_complete_chunk(&run, 1);
    fs::write(test_folder.partial_folder().join(part_name(1)), "not a part").unwrap();
    let folder_status = read_status(&test_folder.result_path(), &job).unwrap();
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
    assert!(test_folder.partial_folder().join(part_name(1)).exists());
    let job_with_other_plan = Job { plan: json!({}), ..synthetic::job(POINT_COUNT) };
    assert!(matches!(
        read_status(&test_folder.result_path(), &job_with_other_plan).unwrap_err(),
        StoreError::PlanDiffers { .. }
    ));
}

fn synthetic_rows(points: impl Iterator<Item = u64>) -> Vec<PointRows> {
    points.map(synthetic::point_rows).collect()
}

#[test]
fn an_incomplete_chunk_is_resumed() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_complete_chunk(&run, 0);
    // Rows arrive in any order.
    run.write_chunk(&job, 3, synthetic_rows([30, 25, 27].into_iter())).unwrap();
    assert_eq!(run.count_own_points(), (POINT_COUNT, 8 + 3));
    drop(run);
    let folder_status = read_status(&test_folder.result_path(), &job).unwrap();
    assert_eq!((folder_status.points_done, folder_status.chunks_done), (11, 1));
    assert!(test_folder.partial_folder().join("part-00000003.parquet").exists());

    let run = open_run(&test_folder.result_path(), &job);
    assert_eq!(run.count_own_points(), (POINT_COUNT, 11));
    let incomplete_chunks = run.take_incomplete_chunks();
    assert_eq!(
        incomplete_chunks.into_iter().collect::<Vec<_>>(),
        [(3, synthetic_rows([25, 27, 30].into_iter()))]
    );
    assert_eq!(write_missing_chunks(&run), 10);
    assert_eq!(run.count_own_points(), (POINT_COUNT, POINT_COUNT));
    finish_run(run, &job);
    assert_eq!(
        fs::read(test_folder.result_path()).unwrap(),
        uninterrupted_result_bytes(POINT_COUNT)
    );
}

#[test]
fn an_unfinished_run_is_found_by_the_path_of_result_or_folder() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    assert_eq!(find_unfinished(&test_folder.result_path()).unwrap(), None);
    let run = open_run(&test_folder.result_path(), &job);
    write_complete_chunk(&run, 0);
    run.write_chunk(&job, 3, synthetic_rows([30, 25, 27].into_iter())).unwrap();
    write_complete_chunk(&run, 5);
    // A damaged part does not count.
    fs::write(test_folder.partial_folder().join(part_name(5)), part_bytes(&job, 5).split_off(1))
        .unwrap();
    for path in [test_folder.result_path(), test_folder.partial_folder()] {
        let unfinished_work = find_unfinished(&path).unwrap().unwrap();
        assert_eq!(
            (unfinished_work.points, unfinished_work.points_done),
            (Some(POINT_COUNT), 8 + 3)
        );
        assert_eq!(
            (&unfinished_work.output, &unfinished_work.folder),
            (&test_folder.result_path(), &test_folder.partial_folder())
        );
        assert_eq!(
            (unfinished_work.name.as_str(), unfinished_work.running.len()),
            ("synthetic", 1)
        );
        assert_eq!(unfinished_work.progress(), "11 of 81 points done (13.6 %)");
    }
    let error = refuse_unfinished(&test_folder.result_path()).unwrap_err();
    assert!(error.is_refusal());
    assert!(error.to_string().contains("is not finished: 11 of 81 points done"), "{error}");
    fs::remove_file(test_folder.partial_folder().join(part_name(5))).unwrap();
    drop(run);
    let run = open_run(&test_folder.result_path(), &job);
    write_missing_chunks(&run);
    finish_run(run, &job);
    assert_eq!(find_unfinished(&test_folder.result_path()).unwrap(), None);
    assert_eq!(find_unfinished(&test_folder.partial_folder()).unwrap(), None);
}

#[test]
fn an_unfinished_search_shows_the_number_of_trials() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let mut trials = open_trials(&test_folder.result_path(), &job);
    for k in 0..5 {
        trials.add_trial(vec![k, 0], vec![Some(1)]).unwrap();
    }
    trials.write().unwrap();
    let unfinished_work = find_unfinished(&test_folder.result_path()).unwrap().unwrap();
    assert_eq!((unfinished_work.points, unfinished_work.points_done), (None, 5));
    assert_eq!(unfinished_work.progress(), "5 trials of a search kept");
}

#[test]
fn a_damaged_part_is_renamed_and_a_new_one_replaces_it() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    run.write_chunk(&job, 1, synthetic_rows(8..10)).unwrap();
    run.write_chunk(&job, 2, synthetic_rows(16..20)).unwrap();
    drop(run);
    let part_path = test_folder.partial_folder().join("part-00000002.parquet");
    let mut damaged_bytes = fs::read(&part_path).unwrap();
    damaged_bytes[100] ^= 1;
    fs::write(&part_path, damaged_bytes).unwrap();
    write_complete_chunk(&open_run(&test_folder.result_path(), &job), 1);

    let mut run = open_run(&test_folder.result_path(), &job);
    assert!(run.take_incomplete_chunks().is_empty());
    assert_eq!(
        run.take_notes().len(),
        0,
        "the damaged part was renamed and noted when it was found"
    );
    assert!(test_folder.partial_folder().join("part-00000002.parquet.damaged").exists());
    write_missing_chunks(&run);
    finish_run(run, &job);
    assert_eq!(
        fs::read(test_folder.result_path()).unwrap(),
        uninterrupted_result_bytes(POINT_COUNT)
    );
}

/// Writes bytes to the file of a part, and returns the damage that reading them finds, if any.
fn write_and_find_damage(
    test_folder: &TestFolder,
    job: &Job<'_>,
    index: u64,
    bytes: &[u8],
) -> Option<PartDamage> {
    let folder = Folder::new(&test_folder.result_path(), &job.layout).unwrap();
    fs::create_dir_all(&folder.path).unwrap();
    fs::write(folder.file(part_name(index)), bytes).unwrap();
    let read_point_rows = |part: &PointPart<'_>| part.read_point_rows();
    super::super::open::read_part(&PointParts::new(job), &folder, index, read_point_rows)
        .unwrap()
        .err()
}

#[test]
fn any_flipped_bit_in_a_part_is_found() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let bytes = part_bytes(&job, 3);
    assert_eq!(write_and_find_damage(&test_folder, &job, 3, &bytes), None);
    for position in 0..bytes.len() {
        let mut flipped_bytes = bytes.clone();
        flipped_bytes[position] ^= 1 << (position % 8);
        assert!(
            write_and_find_damage(&test_folder, &job, 3, &flipped_bytes).is_some(),
            "byte {position}"
        );
    }
}

#[test]
fn any_truncation_of_a_part_is_found() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let bytes = part_bytes(&job, 3);
    for length in (0..bytes.len()).step_by(3) {
        assert!(
            write_and_find_damage(&test_folder, &job, 3, &bytes[..length]).is_some(),
            "cut to {length}"
        );
    }
    let lengthened_bytes = [bytes.as_slice(), &[0]].concat();
    assert_eq!(
        write_and_find_damage(&test_folder, &job, 3, &lengthened_bytes),
        Some(PartDamage::Bytes)
    );
}

#[test]
fn parts_of_another_plan_index_or_layout_are_foreign() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let bytes = part_bytes(&job, 3);
    assert_eq!(
        write_and_find_damage(&test_folder, &job, 4, &bytes),
        Some(PartDamage::Foreign),
        "another index"
    );
    let job_of_other_build = Job { numerics: 2, ..synthetic::job(POINT_COUNT) };
    assert_eq!(
        write_and_find_damage(&test_folder, &job_of_other_build, 3, &bytes),
        Some(PartDamage::Foreign),
        "another build"
    );
    let mut job_with_fewer_columns = synthetic::job(POINT_COUNT);
    job_with_fewer_columns.layout.columns.pop();
    assert_eq!(
        write_and_find_damage(&test_folder, &job_with_fewer_columns, 3, &bytes),
        Some(PartDamage::Foreign),
        "another layout"
    );
    // A result has a digest too, but is not a part.
    assert_eq!(
        write_and_find_damage(&test_folder, &job, 3, &uninterrupted_result_bytes(POINT_COUNT)),
        Some(PartDamage::Foreign)
    );
}

#[test]
fn rows_that_do_not_fit_their_part_are_refused() {
    let job = synthetic::job(POINT_COUNT);
    let point_parts = PointParts::new(&job);
    let valid_rows = synthetic_rows(8..16);
    let encode_error = |synthetic_rows: &[PointRows]| {
        point_parts.encode(&job, 1, synthetic_rows).unwrap_err().to_string()
    };
    for subset in [&valid_rows[..0], &valid_rows[1..2], &valid_rows] {
        assert!(point_parts.encode(&job, 1, subset).is_ok());
    }
    let reversed_rows: Vec<PointRows> = valid_rows.iter().rev().cloned().collect();
    assert!(encode_error(&reversed_rows).contains("8 outcomes that are not of its points"));
    assert!(
        encode_error(&synthetic_rows(15..17)).contains("2 outcomes that are not of its points")
    );
    let mut rows_with_short_row = valid_rows.clone();
    rows_with_short_row[0].rows[0].pop();
    assert!(
        encode_error(&rows_with_short_row).contains("does not fit"),
        "{}",
        encode_error(&rows_with_short_row)
    );
    let mut rows_with_null_count = valid_rows.clone();
    let steps_column = synthetic::layout().position("steps").unwrap();
    rows_with_null_count[0].rows[0][steps_column] = None;
    assert!(
        encode_error(&rows_with_null_count).contains("does not fit"),
        "{}",
        encode_error(&rows_with_null_count)
    );
    let mut rows_without_cells = valid_rows;
    rows_without_cells[0].rows.clear();
    assert!(
        encode_error(&rows_without_cells).contains("0 rows of"),
        "{}",
        encode_error(&rows_without_cells)
    );
}

/// Returns a strategy for rows of cells that fit the columns.
fn row_strategy(columns: &[DeclaredColumn]) -> impl Strategy<Value = RowCells> + use<> {
    let cell_strategy = |column: &DeclaredColumn| match &column.cell_type {
        CellType::Count | CellType::Axis => any::<u64>().prop_map(Some).boxed(),
        CellType::Flag => prop::option::of(0..2_u64).boxed(),
        CellType::Name(names) => prop::option::of(0..names.len() as u64).boxed(),
        _ => any::<Option<u64>>().boxed(),
    };
    columns.iter().map(cell_strategy).collect::<Vec<_>>()
}

/// Returns a layout with every type of column, several tasks for each point, and several rows for
/// each task.
fn layout_with_all_types() -> Layout {
    let mut layout = synthetic::layout();
    layout.columns.insert(2, DeclaredColumn::new("kept", "", "", CellType::Kept));
    layout.columns.push(DeclaredColumn::new("known", "1", "a count", CellType::KnownCount));
    Layout { tasks_per_point: 3, has_several_rows: true, ..layout }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn written_rows_are_read_back_unchanged(
        rows_by_point in prop::collection::vec(
            prop::collection::vec(row_strategy(&layout_with_all_types().columns), 1..4),
            1..8,
        ),
    ) {
        let test_folder = TestFolder::new();
        let job = Job { layout: layout_with_all_types(), ..synthetic::job(POINT_COUNT) };
        let to_point_rows = |(rows, point)| PointRows { point, rows };
        let written_rows: Vec<PointRows> =
            rows_by_point.into_iter().zip(8..).map(to_point_rows).collect();
        let run = open_run(&test_folder.result_path(), &job);
        run.write_chunk(&job, 1, written_rows.clone()).unwrap();
        prop_assert_eq!(run.find_stored_rows(8), written_rows.first().cloned());
        drop(run);
        let incomplete_chunks = open_run(&test_folder.result_path(), &job).take_incomplete_chunks();
        let rows_read_back: Vec<PointRows> = incomplete_chunks.into_values().flatten().collect();
        prop_assert_eq!(rows_read_back, written_rows);
    }

    #[test]
    fn arbitrary_bytes_are_damage(
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let job = synthetic::job(POINT_COUNT);
        let damage = write_and_find_damage(&TestFolder::new(), &job, 1, &bytes);
        prop_assert!(damage.is_some());
    }
}

#[test]
fn a_part_has_the_columns_of_the_result() {
    let test_folder = TestFolder::new();
    let job = synthetic::job(POINT_COUNT);
    let run = open_run(&test_folder.result_path(), &job);
    write_complete_chunk(&run, 2);
    let part_file = ParquetFile::open(&test_folder.partial_folder().join(part_name(2))).unwrap();
    assert_eq!(part_file.schema(), &job.layout.schema());
    let part_batches = read_batches(&test_folder.partial_folder().join(part_name(2)));
    write_missing_chunks(&run);
    finish_run(run, &job);
    let result_batch = &read_batches(&test_folder.result_path())[0];
    assert_eq!(part_batches, [result_batch.slice(16, 8)]);
}
