//! Any bytes in place of one file of an unfinished run: the run is refused, or goes on and ends in
//! a result whose bytes are those of the undisturbed one, unless the file is a part that passes for
//! one.
//!
//! The first byte of an input says which file it is for. A part is a sound one whose first or last
//! bytes are the input's, with the digest of that, so that the fuzzer reaches its rows and its
//! metadata.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use sweep::{
    Interrupt, Job, ModelEngine, OpenOptions, OpenOutcome, OpenRun, Plan, ProgressMode, RunEnd,
    RunOptions, Shard, ShardRequest, status,
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
    // Beside the folder.
    "../x.run.json",
    PART,
];
/// The name of the only part.
const PART: &str = "part-00000000.parquet";

/// Tries one input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let Some((which, content)) = bytes.split_first() else { return };
    let home = home();
    let which = usize::from(*which) % NAMES.len();
    let name = NAMES[which];
    let content = match name {
        PART => as_part(content, which + 1 == NAMES.len(), &home.part),
        _ => content.to_vec(),
    };
    let partial = home.folder.path().join("x.parquet.partial");
    reset(home, &partial);
    fs::write(partial.join(name), &content).expect("the input is written");

    let job = Job::new(&home.plan);
    let output = home.folder.path().join("x.parquet");
    // Looking changes nothing, whatever it finds.
    let _ = status(&output, &job);
    assert_eq!(fs::read(partial.join(name)).expect("the input is there"), content);
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
            let tally = tally.expect("nobody stops it");
            assert_eq!(tally.points, home.plan.points());
            let result = fs::read(&output).expect("there is a result");
            assert!(name == PART || result == home.result, "{name} has changed the result");
            let _ = opened.complete(&job, &tally, None);
        }
        Err(error) => assert!(name == PART, "{name}: {error}"),
    }
}

fn options() -> OpenOptions<'static> {
    OpenOptions { fresh: false, shard: None, environment: &|_| None }
}

/// Returns a part with the input in place of its first or last bytes, between the magic numbers,
/// and the digest of that where there is still a place for it.
fn as_part(input: &[u8], is_at_end: bool, part: &[u8]) -> Vec<u8> {
    /// The number of bytes of the magic number at either end of a Parquet file.
    const MAGIC: usize = 4;
    let mut bytes = part.to_vec();
    let room = bytes.len() - 2 * MAGIC;
    let input = &input[..input.len().min(room)];
    let start = if is_at_end { bytes.len() - MAGIC - input.len() } else { MAGIC };
    bytes[start..start + input.len()].copy_from_slice(input);
    let mut file = std::io::Cursor::new(bytes);
    let _ = sweep_files::seal::seal(&mut file);
    file.into_inner()
}

struct Home {
    folder: TempDir,
    plan: Plan,
    /// Files of the whole run's folder, before it is joined.
    files: Vec<(String, Vec<u8>)>,
    part: Vec<u8>,
    result: Vec<u8>,
}

/// Puts everything back as an undisturbed run leaves it before its join.
fn reset(home: &Home, partial: &Path) {
    for file in ["x.parquet", "x.run.json"] {
        let _ = fs::remove_file(home.folder.path().join(file));
    }
    let _ = fs::remove_dir_all(partial);
    fs::create_dir(partial).expect("the folder is made");
    for (name, bytes) in &home.files {
        fs::write(partial.join(name), bytes).expect("a file is written");
    }
}

fn home() -> &'static Home {
    /// The run, computed once.
    static HOME: OnceLock<Home> = OnceLock::new();
    HOME.get_or_init(|| {
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
            sweep::run(&engine.into_engine(), &Job::new(&plan), &output, options, &Interrupt::new())
                .expect("the run ends")
                .end
        };
        // A shard of one leaves its folder.
        let shard = Some(ShardRequest::Given(Shard { index: 1, count: 1 }));
        assert!(matches!(go(shard), RunEnd::Shard(..)));
        let partial = folder.path().join("x.parquet.partial");
        let names = fs::read_dir(&partial).expect("the folder is there");
        let files: Vec<(String, Vec<u8>)> = names
            .map(|entry| entry.expect("an entry").path())
            .map(|path: PathBuf| {
                let name = path.file_name().and_then(|name| name.to_str()).expect("UTF-8");
                (name.to_owned(), fs::read(&path).expect("a file is read"))
            })
            .collect();
        assert!(matches!(go(None), RunEnd::Finished(_)));
        let result = fs::read(&output).expect("there is a result");
        let (_, part) = files.iter().find(|(name, _)| name == PART).expect("there is a part");
        Home { part: part.clone(), plan, files, result, folder }
    })
}
