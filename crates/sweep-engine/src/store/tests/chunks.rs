//! Chunks: left anywhere, damaged, dealt to shards, counted.

use super::*;

#[test]
fn chunk_sizes_feed_small_grids_to_all_cores_and_bound_large_ones() {
    let sizes: Vec<u64> =
        [1, 81, 128, 129, 1287, 100_000, 1_000_000, 1 << 40, u64::MAX].map(chunk_points).to_vec();
    assert_eq!(sizes, [8, 8, 8, 32, 32, 128, 1024, 4096, 4096]);
}

#[test]
fn chunk_names_stand_for_chunks_and_nothing_else_does() {
    for chunk in [0, 7, 99_999_999, 100_000_000, u64::MAX] {
        assert_eq!(chunk_of_name(&chunk_name(chunk)), Some(chunk));
    }
    for name in [
        "chunk-7.bin",
        "chunk-00000007.bin.damaged",
        "chunk-+0000007.bin",
        "part-00000007.bin",
        "plan.json",
    ] {
        assert_eq!(chunk_of_name(name), None, "{name}");
    }
}

#[test]
fn a_run_left_at_any_chunk_goes_on_from_there() {
    let bytes = undisturbed(POINTS);
    let job = synthetic::job(POINTS);
    for written in 0..=POINTS.div_ceil(8) {
        let home = Home::new();
        let run = open(&home.output(), &job);
        (0..written).for_each(|chunk| write(&run, chunk));
        drop(run);
        let run = open(&home.output(), &job);
        assert_eq!(write_missing(&run), POINTS.div_ceil(8) - written);
        finish(run, &job);
        assert_eq!(fs::read(home.output()).unwrap(), bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn damage_to_any_chunks_is_set_aside_told_and_mended(
        harm in prop::collection::vec((0..11_u64, any::<prop::sample::Index>(), 0..4_u8), 0..6)
    ) {
        let (home, job) = (Home::new(), synthetic::job(POINTS));
        let run = open(&home.output(), &job);
        write_missing(&run);
        drop(run);
        let mut harmed = std::collections::BTreeSet::new();
        for (chunk, at, how) in harm {
            let path = home.partial().join(chunk_name(chunk));
            let Ok(mut bytes) = fs::read(&path) else { continue };
            let at = at.index(bytes.len().max(1));
            match how {
                0 => bytes.truncate(at),
                1 if !bytes.is_empty() => bytes[at] ^= 0x40,
                2 => bytes.push(0),
                _ => bytes.clear(),
            }
            fs::write(&path, &bytes).unwrap();
            let intact = bytes == { write_bytes(&job, chunk) };
            if intact { harmed.remove(&chunk); } else { harmed.insert(chunk); }
        }
        let mut run = open(&home.output(), &job);
        prop_assert_eq!(run.take_notes().len(), harmed.len());
        for chunk in &harmed {
            let damaged = format!("{}.damaged", chunk_name(*chunk));
            prop_assert!(home.partial().join(damaged).exists());
        }
        prop_assert_eq!(write_missing(&run), harmed.len() as u64);
        finish(run, &job);
        prop_assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
    }
}

#[test]
fn damage_after_opening_is_met_at_the_join() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let mut run = open(&home.output(), &job);
    write_missing(&run);
    fs::write(home.partial().join(chunk_name(4)), b"not a chunk").unwrap();
    fs::remove_file(home.partial().join(chunk_name(6))).unwrap();
    let error = run.join(&job, &|| false).unwrap_err();
    assert!(error.to_string().contains("2 of 11 chunks are missing"), "{error}");
    assert!(!home.output().exists());
    assert_eq!(write_missing(&run), 2);
    let (_, notes) = finish(run, &job);
    assert!(notes[0].contains("chunk-00000004.bin"), "{:?}", notes);
    assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
}

#[test]
fn shards_together_make_the_whole_and_the_merge_says_who_is_missing() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let shard = |index| {
        let shard = Some(ShardRequest::Given(Shard { index, of: 4 }));
        match OpenRun::open(&home.output(), &job, OpenOptions { shard, ..options() }).unwrap() {
            Opened::Open(run) => run,
            Opened::Finished(..) => panic!("is not done"),
        }
    };
    assert!(matches!(
        OpenRun::open_for_merge(&home.output(), &job).unwrap_err(),
        StoreError::NoRun { .. }
    ));
    // Two at once, and one of them twice.
    let (first, third, again) = (shard(1), shard(3), shard(3));
    assert_eq!(first.own_points(), (3 * 8, 0));
    assert_eq!(third.own_points(), (8 + 8 + 1, 0), "the last chunk has one point");
    for run in [&first, &third, &again] {
        write_missing(run);
    }
    let busy = OpenRun::open_for_merge(&home.output(), &job).unwrap_err();
    assert!(matches!(busy, StoreError::Busy { .. }), "{busy}");
    let running = status(&home.output(), &job).unwrap().running;
    assert_eq!(running.iter().map(|holder| holder.shard).collect::<Vec<_>>(), [Some(1), Some(3)]);
    drop((first, third, again));

    let Opened::Open(mut merge) = OpenRun::open_for_merge(&home.output(), &job).unwrap() else {
        panic!("is not done")
    };
    let error = merge.join(&job, &|| false).unwrap_err();
    assert!(!error.is_refusal());
    assert!(error.to_string().contains("5 of 11 chunks are missing, of shards 2,4"), "{error}");
    drop(merge);
    let found = status(&home.output(), &job).unwrap();
    assert_eq!(
        (found.state, found.missing_shards.as_str(), found.shards),
        (State::Unfinished, "2,4", Some(4))
    );
    assert_eq!((found.chunks_done, found.chunks_missing), (6, 5));

    let other =
        OpenOptions { shard: Some(ShardRequest::Given(Shard { index: 1, of: 5 })), ..options() };
    assert!(
        OpenRun::open(&home.output(), &job, other)
            .unwrap_err()
            .to_string()
            .contains("into 4 shards")
    );
    let fresh = OpenOptions {
        fresh: true,
        shard: Some(ShardRequest::Given(Shard { index: 2, of: 4 })),
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
    assert_eq!(status(&home.output(), &job).unwrap().state, State::Complete);
    let Opened::Open(merge) = OpenRun::open_for_merge(&home.output(), &job).unwrap() else {
        panic!("is not done")
    };
    finish(merge, &job);
    assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
    let found = status(&home.output(), &job).unwrap();
    assert_eq!((found.state, found.points_done), (State::Finished, POINTS));
    assert!(found.points_failed > 0);
}

#[test]
fn status_counts_without_touching_anything() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    assert_eq!(status(&home.output(), &job).unwrap().state, State::NotStarted);
    assert_eq!(fs::read_dir(home.0.path()).unwrap().count(), 0);
    let run = open(&home.output(), &job);
    write(&run, 0);
    write(&run, 1);
    fs::write(home.partial().join(chunk_name(1)), "not a chunk").unwrap();
    let found = status(&home.output(), &job).unwrap();
    assert_eq!(
        (found.chunks_done, found.chunks_damaged.as_slice(), found.points_done),
        (1, &[1][..], 8)
    );
    assert_eq!(found.points_failed, 2, "points 4 and 7 of the formula fail");
    assert_eq!(found.running[0].pid, std::process::id());
    assert!(home.partial().join(chunk_name(1)).exists());
    let other = Job { plan: json!({}), ..synthetic::job(POINTS) };
    assert!(matches!(status(&home.output(), &other).unwrap_err(), StoreError::PlanDiffers { .. }));
}

fn outcomes(points: impl Iterator<Item = u64>) -> Vec<Done> {
    points.map(synthetic::done).collect()
}

#[test]
fn a_part_is_gone_on_from_until_its_chunk_is_whole() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    write(&run, 0);
    // As rows come: in any order.
    run.write_chunk(3, outcomes([30, 25, 27].into_iter())).unwrap();
    assert_eq!(run.own_points(), (POINTS, 8 + 3));
    drop(run);
    let seen = status(&home.output(), &job).unwrap();
    assert_eq!((seen.points_done, seen.chunks_done), (11, 1));
    assert!(home.partial().join("chunk-00000003.bin").exists());

    let run = open(&home.output(), &job);
    assert_eq!(run.own_points(), (POINTS, 11));
    let parts = run.take_parts();
    assert_eq!(parts.into_iter().collect::<Vec<_>>(), [(3, outcomes([25, 27, 30].into_iter()))]);
    assert_eq!(write_missing(&run), 10);
    assert_eq!(run.own_points(), (POINTS, POINTS));
    finish(run, &job);
    assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
}

#[test]
fn an_unfinished_run_is_found_by_its_result_and_by_its_folder() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    assert_eq!(unfinished(&home.output()).unwrap(), None);
    let run = open(&home.output(), &job);
    write(&run, 0);
    run.write_chunk(3, outcomes([30, 25, 27].into_iter())).unwrap();
    write(&run, 5);
    // What is not as it was written does not count.
    fs::write(home.partial().join(chunk_name(5)), write_bytes(&job, 5).split_off(1)).unwrap();
    for path in [home.output(), home.partial()] {
        let found = unfinished(&path).unwrap().unwrap();
        assert_eq!((found.points, found.points_done), (Some(POINTS), 8 + 3));
        assert_eq!((&found.output, &found.folder), (&home.output(), &home.partial()));
        assert_eq!((found.name.as_str(), found.running.len()), ("synthetic", 1));
        assert_eq!(found.progress(), "11 of 81 points done (13.6 %)");
    }
    let error = refuse_unfinished(&home.output()).unwrap_err();
    assert!(error.is_refusal());
    assert!(error.to_string().contains("is not finished: 11 of 81 points done"), "{error}");
    fs::remove_file(home.partial().join(chunk_name(5))).unwrap();
    drop(run);
    let run = open(&home.output(), &job);
    write_missing(&run);
    finish(run, &job);
    assert_eq!(unfinished(&home.output()).unwrap(), None);
    assert_eq!(unfinished(&home.partial()).unwrap(), None);
}

#[test]
fn an_unfinished_search_counts_its_trials() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let Ok(Opened::Open(mut trials)) = Trials::open(&home.output(), &job, false) else { panic!() };
    for k in 0..5 {
        trials.keep([k, 0, 0], Some(1.0)).unwrap();
    }
    let found = unfinished(&home.output()).unwrap().unwrap();
    assert_eq!((found.points, found.points_done), (None, 5));
    assert_eq!(found.progress(), "5 trials of a search kept");
}

#[test]
fn a_damaged_part_is_set_aside_and_a_whole_chunk_takes_its_place() {
    let (home, job) = (Home::new(), synthetic::job(POINTS));
    let run = open(&home.output(), &job);
    run.write_chunk(1, outcomes(8..10)).unwrap();
    run.write_chunk(2, outcomes(16..20)).unwrap();
    drop(run);
    let part = home.partial().join("chunk-00000002.bin");
    let mut bytes = fs::read(&part).unwrap();
    bytes[100] ^= 1;
    fs::write(&part, bytes).unwrap();
    write(&open(&home.output(), &job), 1);

    let mut run = open(&home.output(), &job);
    assert!(run.take_parts().is_empty());
    assert_eq!(run.take_notes().len(), 0, "it was told of when it was set aside");
    assert!(home.partial().join("chunk-00000002.bin.damaged").exists());
    write_missing(&run);
    finish(run, &job);
    assert_eq!(fs::read(home.output()).unwrap(), undisturbed(POINTS));
}
