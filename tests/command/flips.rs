//! Tests with single flipped bits in a finished result: every command that reads it ends with an
//! error, or has the same output and files as without the flip.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::test_folder::{TestFolder, all_output, grid_text};

/// The number of random bits that are flipped, one in each run of all commands.
const FLIP_COUNT: u64 = 300;

/// The commands that read the result.
const COMMANDS: [&[&str]; 5] = [
    &["run", "g.toml", "--threads", "1", "--out", "x.parquet"],
    &["show", "x.parquet"],
    &["plot", "x.parquet", "-o", "x.svg"],
    &["status", "g.toml", "--out", "x.parquet"],
    &["merge", "g.toml", "--out", "x.parquet"],
];

/// The exit code of a command, its output, and the files that it wrote.
#[derive(PartialEq)]
struct CommandEffect {
    output: Output,
    result_bytes: Vec<u8>,
    figure: Option<Vec<u8>>,
}

/// Returns a folder with a grid and its finished result, `x.parquet`.
pub(super) fn folder_with_result() -> TestFolder {
    let test_folder = TestFolder::new(&grid_text(12, 12));
    let run_output = test_folder.run_sweep(COMMANDS[0]);
    assert!(run_output.status.success(), "{}", all_output(&run_output));
    test_folder
}

impl TestFolder {
    /// Runs a command with these bytes as the result.
    fn run_on_result(&self, bytes: &[u8], words: &[&str]) -> CommandEffect {
        fs::write(self.path("x.parquet"), bytes).expect("the result is written");
        // The figure exists only if a command drew it before.
        let _ = fs::remove_file(self.path("x.svg"));
        let output = self.run_sweep(words);
        let read_if_present = |path: &Path| fs::read(path).ok();
        let result_bytes =
            read_if_present(&self.path("x.parquet")).expect("nobody removes a result");
        CommandEffect { output, result_bytes, figure: read_if_present(&self.path("x.svg")) }
    }
}

/// Returns a random number for a seed (splitmix64).
fn random_bits(seed: u64) -> u64 {
    let mixed_bits = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed_bits = (mixed_bits ^ (mixed_bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed_bits = (mixed_bits ^ (mixed_bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed_bits ^ (mixed_bits >> 31)
}

#[test]
fn a_flipped_bit_of_a_result_is_an_error_or_without_effect() {
    let test_folder = folder_with_result();
    let whole_file = fs::read(test_folder.path("x.parquet")).expect("there is a result");
    let mut undisturbed_effects = Vec::new();
    for words in COMMANDS {
        let effect = test_folder.run_on_result(&whole_file, words);
        assert!(effect.output.status.success(), "{words:?}: {}", all_output(&effect.output));
        undisturbed_effects.push(effect);
    }
    let mut refusal_counts = [0_u64; COMMANDS.len()];
    for flip_index in 0..FLIP_COUNT {
        let bit = random_bits(flip_index + 1) % (8 * whole_file.len() as u64);
        let mut bytes = whole_file.clone();
        bytes[(bit / 8) as usize] ^= 1 << (bit % 8);
        for (k, words) in COMMANDS.iter().enumerate() {
            let effect = test_folder.run_on_result(&bytes, words);
            let messages = all_output(&effect.output);
            if effect.output.status.success() {
                let effect_but_for_result =
                    CommandEffect { result_bytes: whole_file.clone(), ..effect };
                assert!(
                    effect_but_for_result == undisturbed_effects[k],
                    "bit {bit}: {words:?} took it: {messages}"
                );
                continue;
            }
            refusal_counts[k] += 1;
            let names_result = messages.contains("error: ") && messages.contains("x.parquet");
            assert!(
                names_result && !messages.contains("panicked"),
                "bit {bit}, {words:?}: {messages}"
            );
            assert_eq!(effect.output.status.code(), Some(2), "bit {bit}, {words:?}: {messages}");
            assert!(
                effect.result_bytes == bytes && effect.figure.is_none(),
                "bit {bit}, {words:?}: {messages}"
            );
        }
    }
    println!("{FLIP_COUNT} flips; refused by run, show, plot, status, merge: {refusal_counts:?}");
}
