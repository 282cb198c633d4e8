//! Any bytes in place of a result, through everything that reads one: shown and drawn, or
//! explained; never taken for the result of a plan that it is not.
//!
//! An input that has a place for a digest gets the right one, so that changed bytes are read and
//! not refused beforehand.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use clap::Parser as _;
use sweep::{Cli, Job, OpenRun, Plan, State, status};
use tempfile::TempDir;

/// Tries one input; a panic is a finding.
pub(crate) fn run(bytes: &[u8]) {
    let home = home();
    let bytes = sealed(bytes);
    let bytes = bytes.as_slice();
    fs::write(&home.result, bytes).expect("the input is written");
    let job = Job::of(&home.plan);
    match status(&home.result, &job) {
        // An empty file counts as none.
        Ok(found) => assert!(found.state == State::NotStarted && bytes.is_empty(), "{found:?}"),
        Err(error) => assert!(error.to_string().contains("x.parquet"), "{error}"),
    }
    if !bytes.is_empty() {
        assert!(OpenRun::open_for_merge(&home.result, &job).is_err());
    }
    assert_eq!(fs::read(&home.result).expect("the input is there"), bytes);
    call(&["sweep", "show", &home.result_text]);
    call(&["sweep", "plot", &home.result_text, "-o", &home.picture_text]);
}

/// With the digest of the other bytes where one of ours would be.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    const ENTRY: &[u8] = b"sweep.digest\x18\x40";
    const DIGITS: usize = 64;
    let mut bytes = bytes.to_vec();
    let found = bytes.windows(ENTRY.len()).rposition(|window| window == ENTRY);
    if let Some(place) = found.map(|at| at + ENTRY.len())
        && place + DIGITS <= bytes.len()
    {
        bytes[place..place + DIGITS].fill(b'0');
        let digest = blake3::hash(&bytes).to_hex();
        bytes[place..place + DIGITS].copy_from_slice(digest.as_bytes());
    }
    bytes
}

/// A command from its line, as a user types it.
fn call(words: &[&str]) {
    let cli = Cli::try_parse_from(words).expect("the line is right");
    if let Err(error) = cli.command.run() {
        assert!(!error.to_string().is_empty());
    }
}

struct Home {
    _folder: TempDir,
    result: PathBuf,
    result_text: String,
    picture_text: String,
    plan: Plan,
}

fn home() -> &'static Home {
    static HOME: OnceLock<Home> = OnceLock::new();
    HOME.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let text = |path: &Path| path.to_str().expect("temporary folders are UTF-8").to_owned();
        let run = "spin = { profile = \"ramp\", peak_rpm = 300, ramp_s = 1 }\n\
            time = { end_s = 1 }\n";
        fs::write(path("g.toml"), run).expect("the grid is written");
        Home {
            result: path("x.parquet"),
            result_text: text(&path("x.parquet")),
            picture_text: text(&path("x.svg")),
            plan: sweep::load(&path("g.toml"), &[]).expect("the grid is right"),
            _folder: folder,
        }
    })
}
