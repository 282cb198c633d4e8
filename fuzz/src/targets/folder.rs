//! Fuzz target of the files of an unfinished run. An input replaces one file. The run is then
//! rejected with an error, or continues to a result with the bytes of an undisturbed run. Only an
//! input that replaces a part, and is itself a valid part, may change the result.
//!
//! The first byte of an input selects the file. An input for a part replaces the first or the last
//! bytes of a valid part, and the digest is computed again, so that the fuzzer reaches rows and
//! metadata.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use sweep::{
    Interrupt, Job, ModelEngine, OpenOptions, OpenOutcome, OpenRun, Plan, ProgressMode, RunEnd,
    RunOptions, Shard, ShardRequest, read_status,
};
use tempfile::TempDir;

/// The names of the files that an input can replace.
const NAMES: [&str; 8] = [
    "plan.json",
    "shards.json",
    "lock",
    "session-x-1-1.json",
    "shard-1.lock",
    PART,
    // A file beside the folder.
    "../x.run.json",
    PART,
];
/// The name of the run's only part.
const PART: &str = "part-00000000.parquet";

/// Runs the target with an input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let Some((selector, content)) = bytes.split_first() else { return };
    let undisturbed = undisturbed_run();
    let file_index = usize::from(*selector) % NAMES.len();
    let name = NAMES[file_index];
    let content = match name {
        PART => replace_part_bytes(content, file_index + 1 == NAMES.len(), &undisturbed.part),
        _ => content.to_vec(),
    };
    let partial = undisturbed.folder.path().join("x.parquet.partial");
    restore(undisturbed, &partial);
    fs::write(partial.join(name), &content).expect("the input is written");

    let job = Job::new(&undisturbed.plan);
    let output = undisturbed.folder.path().join("x.parquet");
    // Reading the status changes no file, even if the status is an error.
    let _ = read_status(&output, &job);
    assert_eq!(fs::read(partial.join(name)).expect("the input is still there"), content);
    let mut opened = match OpenRun::open(&output, &job, options()) {
        Ok(OpenOutcome::Open(opened)) => opened,
        Ok(OpenOutcome::Finished(..)) => panic!("there is no result"),
        Err(error) => {
            assert!(error.to_string().contains("x."), "{error}");
            return;
        }
    };
    match opened.join(&job, &|| false) {
        Ok(tally) => {
            let tally = tally.expect("the run is not stopped");
            assert_eq!(tally.points, undisturbed.plan.points());
            let result = fs::read(&output).expect("there is a result");
            assert!(name == PART || result == undisturbed.result, "{name} has changed the result");
            let _ = opened.complete(&job, &tally, None);
        }
        Err(error) => assert!(name == PART, "{name}: {error}"),
    }
}

fn options() -> OpenOptions<'static> {
    OpenOptions { starts_over: false, shard: None, environment: &|_| None }
}

/// Returns a part whose first or last bytes between the magic numbers are those of the input, with
/// the digest of these bytes if the entry of the digest is not overwritten.
fn replace_part_bytes(input: &[u8], is_at_end: bool, part: &[u8]) -> Vec<u8> {
    /// The number of bytes of the magic number at either end of a Parquet file.
    const MAGIC_LEN: usize = 4;
    let mut bytes = part.to_vec();
    let max_input_len = bytes.len() - 2 * MAGIC_LEN;
    let input = &input[..input.len().min(max_input_len)];
    let start = if is_at_end { bytes.len() - MAGIC_LEN - input.len() } else { MAGIC_LEN };
    bytes[start..start + input.len()].copy_from_slice(input);
    let mut file = std::io::Cursor::new(bytes);
    let _ = sweep_files::seal::seal(&mut file);
    file.into_inner()
}

/// The folder, the plan and the files of an undisturbed run.
struct UndisturbedRun {
    folder: TempDir,
    plan: Plan,
    /// The names and contents of the files of the run's folder before the parts are joined.
    files: Vec<(String, Vec<u8>)>,
    part: Vec<u8>,
    result: Vec<u8>,
}

/// Restores the files of an undisturbed run before its parts are joined.
fn restore(run: &UndisturbedRun, partial: &Path) {
    for file in ["x.parquet", "x.run.json"] {
        let _ = fs::remove_file(run.folder.path().join(file));
    }
    let _ = fs::remove_dir_all(partial);
    fs::create_dir(partial).expect("the folder is made");
    for (name, bytes) in &run.files {
        fs::write(partial.join(name), bytes).expect("a file is written");
    }
}

fn undisturbed_run() -> &'static UndisturbedRun {
    /// The run, which is computed once.
    static RUN: OnceLock<UndisturbedRun> = OnceLock::new();
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
        let run_shard = |shard| {
            let options = RunOptions {
                threads: 1,
                starts_over: false,
                shard,
                progress: ProgressMode::None,
                environment: &|_| None,
                show_message: &|_| {},
            };
            let engine = ModelEngine::new(&plan).expect("there is an engine");
            sweep::run(&engine.into_engine(), &Job::new(&plan), &output, options, &Interrupt::new())
                .expect("the run ends")
                .end
        };
        // A run of one shard of one does not join its parts, and leaves its folder.
        let shard = Some(ShardRequest::Given(Shard { index: 1, count: 1 }));
        assert!(matches!(run_shard(shard), RunEnd::Shard(..)));
        let partial = folder.path().join("x.parquet.partial");
        let names = fs::read_dir(&partial).expect("the folder is there");
        let files: Vec<(String, Vec<u8>)> = names
            .map(|entry| entry.expect("an entry").path())
            .map(|path: PathBuf| {
                let name = path.file_name().and_then(|name| name.to_str()).expect("UTF-8");
                (name.to_owned(), fs::read(&path).expect("a file is read"))
            })
            .collect();
        assert!(matches!(run_shard(None), RunEnd::Finished(_)));
        let result = fs::read(&output).expect("there is a result");
        let (_, part) = files.iter().find(|(name, _)| name == PART).expect("there is a part");
        UndisturbedRun { part: part.clone(), plan, files, result, folder }
    })
}
