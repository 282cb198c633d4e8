//! The fuzzer's targets without a fuzzer: inputs of its corpus, changed at random, for as long as
//! asked.
//!
//! ```sh
//! # target, seconds, seed
//! cargo run --release -p sweep --example mutate -- list 300 1 > /dev/null
//! ```
//!
//! Needs no instrumented build, so it finds less in a second than `scripts/checks/fuzz.sh` and can
//! be started at once. Targets are `list`, `result` and `folder`. Findings are in
//! `target/fuzz/findings`; exits with 1 if there is any.

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

/// An input is changed in at most so many places.
const MOST_CHANGES: u64 = 12;

/// An input that takes longer is a finding.
const SLOW: Duration = Duration::from_secs(10);

/// Bytes that formats stumble over.
const ODD: [u8; 8] = [0, 1, 0x7f, 0x80, 0xff, b'-', b',', b'\n'];

/// What makes numbers, and text of them, go wrong.
const WORDS: [&[u8]; 12] = [
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

/// Numbers from a seed: splitmix64.
struct Rng(u64);

impl Rng {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below another; 0 below 0.
    fn below(&mut self, end: usize) -> usize {
        (self.bits() % end.max(1) as u64) as usize
    }

    /// A stretch of so many bytes, rather short than long.
    fn stretch(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.below(length);
        let most = if self.below(4) == 0 { length } else { 16 };
        start..(start + self.below(most) + 1).min(length)
    }
}

fn changed(rng: &mut Rng, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[rng.below(seeds.len())].clone();
    for _ in 0..=rng.bits() % MOST_CHANGES {
        let at = rng.below(bytes.len() + 1);
        let here = rng.stretch(bytes.len());
        match rng.below(8) {
            0 | 1 if at < bytes.len() => bytes[at] ^= 1 << rng.below(8),
            2 if at < bytes.len() => bytes[at] = rng.bits() as u8,
            3 if at < bytes.len() => bytes[at] = ODD[rng.below(ODD.len())],
            4 => drop(bytes.drain(here)),
            5 => {
                let copy = bytes[here].to_vec();
                drop(bytes.splice(at..at, copy));
            }
            6 => {
                let word = WORDS[rng.below(WORDS.len())];
                let end = (at + rng.below(word.len() + 1)).min(bytes.len());
                drop(bytes.splice(at..end, word.iter().copied()));
            }
            7 => {
                let other = &seeds[rng.below(seeds.len())];
                let there = rng.stretch(other.len());
                drop(bytes.splice(here, other[there].iter().copied()));
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

fn seeds(corpus: &Path) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(corpus).expect("there is a corpus");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("an input is read")).collect()
}

/// Time that this thread has computed, so that other work of the machine slows no input down.
fn computed() -> Duration {
    let schedule = fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = schedule.split_whitespace().next().and_then(|text| text.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or_default())
}

/// The most memory that this process has had, in kB.
fn peak_kb() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.unwrap_or("unknown").trim().to_owned()
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: u64| {
        arguments.get(k).map_or(default, |text| text.parse().expect("a whole number"))
    };
    let name = arguments.first().map_or("list", String::as_str);
    let run = match name {
        "list" => list::run,
        "result" => result::run,
        "folder" => folder::run,
        _ => panic!("no target {name}: expected list, result or folder"),
    };
    let (seconds, mut rng) = (number(1, 60), Rng(number(2, 1)));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let findings = root.join("target/fuzz/findings");
    fs::create_dir_all(&findings).expect("a folder for findings");
    let seeds = seeds(&root.join("fuzz").join(format!("corpus-{name}")));

    let began = Instant::now();
    let (mut tried, mut found, mut slowest) = (0_u64, 0_u64, Duration::ZERO);
    let unchanged = seeds.clone().into_iter();
    let mut inputs = unchanged.chain(std::iter::repeat_with(|| changed(&mut rng, &seeds)));
    while began.elapsed() < Duration::from_secs(seconds) {
        let Some(input) = inputs.next() else { break };
        let start = computed();
        let is_sound = catch_unwind(|| run(&input)).is_ok();
        let took = computed() - start;
        tried += 1;
        slowest = slowest.max(took);
        if !is_sound || took > SLOW {
            found += 1;
            let path = findings.join(format!("{name}-{tried}"));
            fs::write(&path, &input).expect("a finding is kept");
            let what = if is_sound { "slow" } else { "panic" };
            eprintln!("{}: {what} after {took:?}", path.display());
        }
    }
    eprintln!(
        "{name}: {tried} inputs from {} in {:.0} s, slowest {slowest:?}, \
         at most {}, {found} findings",
        seeds.len(),
        began.elapsed().as_secs_f64(),
        peak_kb()
    );
    if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
