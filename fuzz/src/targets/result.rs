//! Fuzz target of result files. All readers show and draw an input, or report an error. They never
//! accept it as the result of a plan that did not write it.
//!
//! An input that contains a digest gets the right one, because readers reject files with a wrong
//! one.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use clap::Parser as _;
use sweep::{Job, OpenRun, Plan, RunStage, WasherCli, read_status};
use tempfile::TempDir;

/// Runs the target with an input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let files = result_files();
    let bytes = with_digest(bytes);
    let bytes = bytes.as_slice();
    fs::write(&files.result, bytes).expect("the input is written");
    let job = Job::new(&files.plan);
    match read_status(&files.result, &job) {
        // An empty file is treated like a missing one.
        Ok(status) => {
            assert!(status.state == RunStage::NotStarted && bytes.is_empty(), "{status:?}")
        }
        Err(error) => assert!(error.to_string().contains("x.parquet"), "{error}"),
    }
    if !bytes.is_empty() {
        assert!(OpenRun::open_for_merge(&files.result, &job).is_err());
    }
    assert_eq!(fs::read(&files.result).expect("the input is there"), bytes);
    run_command(&["sweep", "show", &files.result_text]);
    run_command(&["sweep", "plot", &files.result_text, "-o", &files.picture_text]);
}

/// Returns an input with the digest of its other bytes, if it has the metadata entry of a digest.
fn with_digest(bytes: &[u8]) -> Vec<u8> {
    /// The key of the entry, with the type and the length of its value.
    const ENTRY: &[u8] = b"sweep.digest\x18\x40";
    /// The number of hexadecimal digits of a digest.
    const DIGITS: usize = 64;
    let mut bytes = bytes.to_vec();
    let last_entry_start = bytes.windows(ENTRY.len()).rposition(|window| window == ENTRY);
    if let Some(start) = last_entry_start.map(|start| start + ENTRY.len())
        && start + DIGITS <= bytes.len()
    {
        bytes[start..start + DIGITS].fill(b'0');
        let digest = blake3::hash(&bytes).to_hex();
        bytes[start..start + DIGITS].copy_from_slice(digest.as_bytes());
    }
    bytes
}

/// Runs a command with the words of its command line.
fn run_command(words: &[&str]) {
    let cli = WasherCli::try_parse_from(words).expect("the line is right");
    if let Err(error) = cli.command.run() {
        assert!(!error.to_string().is_empty());
    }
}

/// A plan, and the files of a result and of its figure.
struct ResultFiles {
    _folder: TempDir,
    result: PathBuf,
    result_text: String,
    picture_text: String,
    plan: Plan,
}

fn result_files() -> &'static ResultFiles {
    /// The files that all inputs share.
    static FILES: OnceLock<ResultFiles> = OnceLock::new();
    FILES.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let text = |path: &Path| path.to_str().expect("temporary folders are UTF-8").to_owned();
        let run = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
            time = { end_s = 1 }\n";
        fs::write(path("g.toml"), run).expect("the grid is written");
        ResultFiles {
            result: path("x.parquet"),
            result_text: text(&path("x.parquet")),
            picture_text: text(&path("x.svg")),
            plan: sweep::load(&path("g.toml"), &[]).expect("the grid is right"),
            _folder: folder,
        }
    })
}
