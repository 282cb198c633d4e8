//! Fuzz target of the files of an unfinished run. An input replaces one of them. The program then
//! reports an error, or continues the run to a result with the bytes of the undisturbed run. Only a
//! chunk, whose rows are part of the result, may change it.
//!
//! The first byte of an input selects the file. A chunk gets a valid header and a valid hash, so
//! that the fuzzer changes its records: those of all points, or as many as the input has.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use sweep::{
    Ended, Interrupt, Job, ModelEngine, OpenOptions, OpenRun, Opened, Plan, ProgressMode,
    RunOptions, Shard, ShardRequest, status,
};
use tempfile::TempDir;

/// The number of bytes of a chunk before its records.
const HEADER: usize = 76;
/// The number of bytes of the hash after the records.
const HASH: usize = 32;

/// The names of the files that an input can replace.
const NAMES: [&str; 8] = [
    "plan.json",
    "shards.json",
    "lock",
    "session-x-1-1.json",
    "shard-1.lock",
    CHUNK,
    // This file is beside the folder.
    "../x.run.json",
    CHUNK,
];
/// The name of the only chunk.
const CHUNK: &str = "chunk-00000000.bin";

/// Runs the target with an input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let Some((selector, content)) = bytes.split_first() else { return };
    let undisturbed = unfinished_run();
    let file = usize::from(*selector) % NAMES.len();
    let name = NAMES[file];
    let records = undisturbed.chunk.len() - HEADER - HASH;
    let content = match name {
        CHUNK if file + 1 == NAMES.len() => as_chunk(content, content.len(), &undisturbed.chunk),
        CHUNK => as_chunk(content, records, &undisturbed.chunk),
        _ => content.to_vec(),
    };
    let partial = undisturbed.folder.path().join("x.parquet.partial");
    reset(undisturbed, &partial);
    fs::write(partial.join(name), &content).expect("the input is written");

    let job = Job::of(&undisturbed.plan);
    let output = undisturbed.folder.path().join("x.parquet");
    // `status` changes no file.
    let _ = status(&output, &job);
    assert_eq!(fs::read(partial.join(name)).expect("the input is there"), content);
    let mut opened = match OpenRun::open(&output, &job, options()) {
        Ok(Opened::Open(opened)) => opened,
        Ok(Opened::Finished(..)) => panic!("there is no result"),
        Err(error) => {
            assert!(error.to_string().contains("x."), "{error}");
            return;
        }
    };
    match opened.join(&job, &|| false) {
        Ok(tally) => {
            let tally = tally.expect("nobody stops it");
            assert_eq!(tally.points, undisturbed.plan.points());
            let result = fs::read(&output).expect("there is a result");
            assert!(name == CHUNK || result == undisturbed.result, "{name} has changed the result");
            let _ = opened.complete(&job, &tally, None);
        }
        Err(error) => assert!(name == CHUNK, "{name}: {error}"),
    }
}

fn options() -> OpenOptions<'static> {
    OpenOptions { fresh: false, shard: None, environment: &|_| None }
}

/// Returns a chunk with the records of an input, a valid header and a valid hash.
fn as_chunk(records: &[u8], length: usize, chunk: &[u8]) -> Vec<u8> {
    let mut bytes = chunk[..HEADER].to_vec();
    bytes.extend(records.iter().copied().chain(std::iter::repeat(0)).take(length));
    let hash = blake3::hash(&bytes);
    bytes.extend_from_slice(hash.as_bytes());
    bytes
}

/// An undisturbed run before its chunks are joined, and its result.
struct UnfinishedRun {
    folder: TempDir,
    plan: Plan,
    /// The files of the run's folder.
    files: Vec<(String, Vec<u8>)>,
    chunk: Vec<u8>,
    result: Vec<u8>,
}

/// Restores the files of the undisturbed run.
fn reset(undisturbed: &UnfinishedRun, partial: &Path) {
    for file in ["x.parquet", "x.run.json"] {
        let _ = fs::remove_file(undisturbed.folder.path().join(file));
    }
    let _ = fs::remove_dir_all(partial);
    fs::create_dir(partial).expect("the folder is made");
    for (name, bytes) in &undisturbed.files {
        fs::write(partial.join(name), bytes).expect("a file is written");
    }
}

fn unfinished_run() -> &'static UnfinishedRun {
    /// The run that all inputs share.
    static RUN: OnceLock<UnfinishedRun> = OnceLock::new();
    RUN.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let grid = folder.path().join("g.toml");
        let text = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
            time = { end_s = 1e-3 }\n\
            integrator = { method = \"rk4\", step_s = 1e-4 }\n\
            reliability = { channels = [\"tub_yaw\"] }\n\
            [[axis]]\nparameter = \"unbalance_mass_kg\"\n\
            range = { from = 0.1, to = 0.9, count = 10 }\n";
        fs::write(&grid, text).expect("the grid is written");
        let plan = sweep::load(&grid, &[]).expect("the grid is right");
        let output = folder.path().join("x.parquet");
        let go = |shard| {
            let options = RunOptions {
                threads: 1,
                fresh: false,
                shard,
                progress: ProgressMode::None,
                environment: &|_| None,
                tell: &|_| {},
            };
            let engine = ModelEngine::new(&plan).expect("there is an engine");
            sweep::run(&engine, &Job::of(&plan), &output, options, &Interrupt::new())
                .expect("the run ends")
                .ended
        };
        // A run with a single shard does not join its chunks.
        let shard = Some(ShardRequest::Given(Shard { index: 1, of: 1 }));
        assert!(matches!(go(shard), Ended::Shard(..)));
        let partial = folder.path().join("x.parquet.partial");
        let names = fs::read_dir(&partial).expect("the folder is there");
        let files: Vec<(String, Vec<u8>)> = names
            .map(|entry| entry.expect("an entry").path())
            .map(|path: PathBuf| {
                let name = path.file_name().and_then(|name| name.to_str()).expect("UTF-8");
                (name.to_owned(), fs::read(&path).expect("a file is read"))
            })
            .collect();
        assert!(matches!(go(None), Ended::Finished(_)));
        let result = fs::read(&output).expect("there is a result");
        let (_, chunk) = files.iter().find(|(name, _)| name == CHUNK).expect("there is a chunk");
        UnfinishedRun { chunk: chunk.clone(), plan, files, result, folder }
    })
}
