//! Tests with single flipped bits in a finished result: every command that reads it ends with an
//! error, or has the same output and files as without the flip.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::test_folder::{TestFolder, all_output, grid};

const FLIPS: u64 = 300;

const COMMANDS: [&[&str]; 5] = [
    &["run", "g.toml", "--threads", "1", "--out", "x.parquet"],
    &["show", "x.parquet"],
    &["plot", "x.parquet", "-o", "x.svg"],
    &["status", "g.toml", "--out", "x.parquet"],
    &["merge", "g.toml", "--out", "x.parquet"],
];

/// The exit code of a command, its output, and the files that it wrote.
#[derive(PartialEq)]
struct RemainingFiles {
    output: Output,
    result: Vec<u8>,
    picture: Option<Vec<u8>>,
}

/// Returns a folder with a grid and its finished result, `x.parquet`.
pub(super) fn finished() -> TestFolder {
    let test_folder = TestFolder::new(&grid(12, 12));
    let run = test_folder.sweep(COMMANDS[0]);
    assert!(run.status.success(), "{}", all_output(&run));
    test_folder
}

impl TestFolder {
    /// Runs a command with these bytes as the result.
    fn run_on(&self, bytes: &[u8], words: &[&str]) -> RemainingFiles {
        fs::write(self.path("x.parquet"), bytes).expect("the result is written");
        // The figure exists only if a command drew it before.
        let _ = fs::remove_file(self.path("x.svg"));
        let output = self.sweep(words);
        let read = |path: &Path| fs::read(path).ok();
        let result = read(&self.path("x.parquet")).expect("nobody removes a result");
        RemainingFiles { output, result, picture: read(&self.path("x.svg")) }
    }
}

/// Returns a random number for a seed (splitmix64).
fn random(seed: u64) -> u64 {
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[test]
fn a_flipped_bit_of_a_result_is_an_error_or_without_effect() {
    let test_folder = finished();
    let whole_file = fs::read(test_folder.path("x.parquet")).expect("there is a result");
    let mut undisturbed_output = Vec::new();
    for words in COMMANDS {
        let remaining_files = test_folder.run_on(&whole_file, words);
        assert!(
            remaining_files.output.status.success(),
            "{words:?}: {}",
            all_output(&remaining_files.output)
        );
        undisturbed_output.push(remaining_files);
    }
    let mut refused_output = [0_u64; COMMANDS.len()];
    for flip in 0..FLIPS {
        let bit = random(flip + 1) % (8 * whole_file.len() as u64);
        let mut bytes = whole_file.clone();
        bytes[(bit / 8) as usize] ^= 1 << (bit % 8);
        for (k, words) in COMMANDS.iter().enumerate() {
            let remaining_files = test_folder.run_on(&bytes, words);
            let messages = all_output(&remaining_files.output);
            if remaining_files.output.status.success() {
                let expected_files =
                    RemainingFiles { result: whole_file.clone(), ..remaining_files };
                assert!(
                    expected_files == undisturbed_output[k],
                    "bit {bit}: {words:?} took it: {messages}"
                );
                continue;
            }
            refused_output[k] += 1;
            let is_named = messages.contains("error: ") && messages.contains("x.parquet");
            assert!(is_named && !messages.contains("panicked"), "bit {bit}, {words:?}: {messages}");
            assert_eq!(
                remaining_files.output.status.code(),
                Some(2),
                "bit {bit}, {words:?}: {messages}"
            );
            assert!(
                remaining_files.result == bytes && remaining_files.picture.is_none(),
                "bit {bit}, {words:?}: {messages}"
            );
        }
    }
    println!("{FLIPS} flips; refused by run, show, plot, status, merge: {refused_output:?}");
}
