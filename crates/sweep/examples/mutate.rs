//! Runs the fuzzer's targets without a fuzzer: on inputs of its corpus that are changed at random,
//! for a given time.
//!
//! ```sh
//! # target, seconds, seed
//! cargo run --release -p sweep --example mutate -- list 300 1 > /dev/null
//! ```
//!
//! It needs no instrumented build, so that it starts at once, but finds less in a second than
//! `scripts/checks/fuzz.sh`. Targets are `list`, `result` and `folder`. Findings are in
//! `target/fuzz/findings`; the exit code is 1 if there are any.

#[path = "../../../fuzz/src/targets/folder.rs"]
mod folder;
#[path = "../../../fuzz/src/targets/list.rs"]
mod list;
#[path = "../../../fuzz/src/targets/result.rs"]
mod result;

use std::fs;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Maximum number of changes of an input. Basis: few enough for most inputs to pass the first
/// checks. Doubling it makes more inputs invalid at once.
const MAX_CHANGES: u64 = 12;

/// Maximum time of an input; a longer one is a finding. Basis: the definition of a finding in
/// CONTRIBUTING.md. Doubling it finds fewer slow inputs.
const MAX_TIME: Duration = Duration::from_secs(10);

/// Bytes that are limits of formats, or have a meaning in them.
const SPECIAL_BYTES: [u8; 8] = [0, 1, 0x7f, 0x80, 0xff, b'-', b',', b'\n'];

/// Texts of extreme numbers, and separators of text formats.
const SPECIAL_WORDS: [&[u8]; 12] = [
    b"1e999",
    b"-0",
    b"nan",
    b"inf",
    b"1e-320",
    b"\n\n",
    b",,",
    b"#",
    b"\"",
    b"\xef\xbb\xbf",
    b"\xff\xff\xff\xff\x0f",
    b"\xff\xff\xff\xff\xff\xff\xff\x7f",
];

/// A random number generator with a seed (splitmix64).
struct RandomGenerator(u64);

impl RandomGenerator {
    fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a random number below `end`; 0 if `end` is 0.
    fn random_below(&mut self, end: usize) -> usize {
        (self.next_u64() % end.max(1) as u64) as usize
    }

    /// Returns a random range within `length` bytes, mostly a short one.
    fn random_range(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.random_below(length);
        let max_length = if self.random_below(4) == 0 { length } else { 16 };
        start..(start + self.random_below(max_length) + 1).min(length)
    }
}

fn mutate_input(rng: &mut RandomGenerator, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[rng.random_below(seeds.len())].clone();
    for _ in 0..=rng.next_u64() % MAX_CHANGES {
        let position = rng.random_below(bytes.len() + 1);
        let range = rng.random_range(bytes.len());
        match rng.random_below(8) {
            0 | 1 if position < bytes.len() => bytes[position] ^= 1 << rng.random_below(8),
            2 if position < bytes.len() => bytes[position] = rng.next_u64() as u8,
            3 if position < bytes.len() => {
                bytes[position] = SPECIAL_BYTES[rng.random_below(SPECIAL_BYTES.len())]
            }
            4 => drop(bytes.drain(range)),
            5 => {
                let copy = bytes[range].to_vec();
                drop(bytes.splice(position..position, copy));
            }
            6 => {
                let word = SPECIAL_WORDS[rng.random_below(SPECIAL_WORDS.len())];
                let end = (position + rng.random_below(word.len() + 1)).min(bytes.len());
                drop(bytes.splice(position..end, word.iter().copied()));
            }
            7 => {
                let other = &seeds[rng.random_below(seeds.len())];
                let other_range = rng.random_range(other.len());
                drop(bytes.splice(range, other[other_range].iter().copied()));
            }
            _ => bytes.truncate(position),
        }
    }
    bytes
}

fn read_corpus(corpus: &Path) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(corpus).expect("there is a corpus");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("an input is read")).collect()
}

/// Returns the processor time of this thread, which other work on the computer does not affect.
fn thread_time() -> Duration {
    let schedule = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = schedule.split_whitespace().next().and_then(|text| text.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or_default())
}

/// Returns the peak memory of this process as text, in kB.
fn peak_kb() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.unwrap_or("unknown").trim().to_owned()
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number_argument = |k: usize, default: u64| {
        arguments.get(k).map_or(default, |text| text.parse().expect("a whole number"))
    };
    let name = arguments.first().map_or("list", String::as_str);
    let run_target = match name {
        "list" => list::run,
        "result" => result::run,
        "folder" => folder::run,
        _ => panic!("no target {name}: expected list, result or folder"),
    };
    let seconds = number_argument(1, 60);
    let mut rng = RandomGenerator(number_argument(2, 1));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let findings = root.join("target/fuzz/findings");
    fs::create_dir_all(&findings).expect("a folder for findings");
    let seeds = read_corpus(&root.join("fuzz").join(format!("corpus-{name}")));

    let start_time = Instant::now();
    let mut input_count = 0_u64;
    let mut findings_count = 0_u64;
    let mut slowest = Duration::ZERO;
    let unchanged_inputs = seeds.clone().into_iter();
    let mut inputs =
        unchanged_inputs.chain(std::iter::repeat_with(|| mutate_input(&mut rng, &seeds)));
    while start_time.elapsed() < Duration::from_secs(seconds) {
        let Some(input) = inputs.next() else { break };
        let start_time_of_input = thread_time();
        let is_sound = catch_unwind(|| run_target(&input)).is_ok();
        let duration = thread_time() - start_time_of_input;
        input_count += 1;
        slowest = slowest.max(duration);
        if !is_sound || duration > MAX_TIME {
            findings_count += 1;
            let path = findings.join(format!("{name}-{input_count}"));
            fs::write(&path, &input).expect("a finding is kept");
            let kind = if is_sound { "slow" } else { "panic" };
            eprintln!("{}: {kind} after {duration:?}", path.display());
        }
    }
    eprintln!(
        "{name}: {input_count} inputs from {} in {:.0} s, slowest {slowest:?}, \
         at most {}, {findings_count} findings",
        seeds.len(),
        start_time.elapsed().as_secs_f64(),
        peak_kb()
    );
    if findings_count == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
