//! Single flipped bits in a finished result: every command that reads it refuses it by name, or
//! says and writes the very same as without the flip.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::home::{Home, grid, said};

const FLIPS: u64 = 300;

const COMMANDS: [&[&str]; 5] = [
    &["run", "g.toml", "--threads", "1", "--out", "x.parquet"],
    &["show", "x.parquet"],
    &["plot", "x.parquet", "-o", "x.svg"],
    &["status", "g.toml", "--out", "x.parquet"],
    &["merge", "g.toml", "--out", "x.parquet"],
];

/// The exit code and the output of a command, its result and its picture.
#[derive(PartialEq)]
struct Left {
    output: Output,
    result: Vec<u8>,
    picture: Option<Vec<u8>>,
}

/// A folder with a grid and its finished result, `x.parquet`.
pub(super) fn finished() -> Home {
    let home = Home::new(&grid(12, 12));
    let run = home.sweep(COMMANDS[0]);
    assert!(run.status.success(), "{}", said(&run));
    home
}

impl Home {
    /// Has a command meet these bytes.
    fn meet(&self, bytes: &[u8], words: &[&str]) -> Left {
        fs::write(self.path("x.parquet"), bytes).expect("the result is written");
        // Absent unless drawn before.
        let _ = fs::remove_file(self.path("x.svg"));
        let output = self.sweep(words);
        let read = |path: &Path| fs::read(path).ok();
        let result = read(&self.path("x.parquet")).expect("nobody removes a result");
        Left { output, result, picture: read(&self.path("x.svg")) }
    }
}

/// Numbers from a seed: splitmix64.
fn random(seed: u64) -> u64 {
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[test]
fn a_flipped_bit_of_a_result_is_refused_or_changes_nothing() {
    let home = finished();
    let whole = fs::read(home.path("x.parquet")).expect("there is a result");
    let mut undisturbed = Vec::new();
    for words in COMMANDS {
        let left = home.meet(&whole, words);
        assert!(left.output.status.success(), "{words:?}: {}", said(&left.output));
        undisturbed.push(left);
    }
    let mut refused = [0_u64; COMMANDS.len()];
    for flip in 0..FLIPS {
        let bit = random(flip + 1) % (8 * whole.len() as u64);
        let mut bytes = whole.clone();
        bytes[(bit / 8) as usize] ^= 1 << (bit % 8);
        for (k, words) in COMMANDS.iter().enumerate() {
            let left = home.meet(&bytes, words);
            let told = said(&left.output);
            if left.output.status.success() {
                let same = Left { result: whole.clone(), ..left };
                assert!(same == undisturbed[k], "bit {bit}: {words:?} took it: {told}");
                continue;
            }
            refused[k] += 1;
            let is_named = told.contains("error: ") && told.contains("x.parquet");
            assert!(is_named && !told.contains("panicked"), "bit {bit}, {words:?}: {told}");
            assert_eq!(left.output.status.code(), Some(2), "bit {bit}, {words:?}: {told}");
            assert!(left.result == bytes && left.picture.is_none(), "bit {bit}, {words:?}: {told}");
        }
    }
    println!("{FLIPS} flips; refused by run, show, plot, status, merge: {refused:?}");
}
