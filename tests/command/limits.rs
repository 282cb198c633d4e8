//! A system that gives less than is asked for: threads, memory, folders.
//! Every refusal is an error that says what and what to do, never a panic, and nothing that was
//! computed is lost.

#![cfg(target_os = "linux")]

use std::fs;
use std::process::Output;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::home::{Home, grid, said};

const RUN: &[&str] = &["run", "g.toml", "--threads", "2", "--out", "x.parquet"];
const TRACE: &[&str] = &["trace", "g.toml", "--at", "unbalance_mass_kg=0.4", "--out", "t.parquet"];
const BOUNDARY: &[&str] =
    &["boundary", "g2.toml", "--threads", "2", "--lattice", "1", "--out", "b.parquet"];

/// A folder with two grids.
fn fresh_home() -> Home {
    let home = Home::new(&grid(24, 0));
    fs::write(home.path("g2.toml"), grid(2, 2)).expect("the grid is written");
    home
}

/// Runs the command behind another program's command line.
fn under(home: &Home, wrapper: &[&str], words: &[&str]) -> Output {
    home.under(wrapper).args(words).output().expect("the command starts")
}

fn undisturbed() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let home = Home::new(&grid(24, 0));
        let run = home.sweep(RUN);
        assert!(run.status.success(), "{}", said(&run));
        fs::read(home.path("x.parquet")).expect("a finished run has an output")
    })
}

/// Whatever a command met: no panic, and words if it failed.
fn assert_told(output: &Output, what: &str) {
    let said = said(output);
    assert!(!said.contains("panicked"), "{what}: {said}");
    assert!(matches!(output.status.code(), Some(0 | 1)), "{what}: {:?} {said}", output.status);
    assert!(output.status.success() || said.contains("error: "), "{what}: {said}");
}

/// After that, the same run ends in the undisturbed run's bytes.
fn assert_mends(home: &Home, what: &str) {
    if let Ok(bytes) = fs::read(home.path("x.parquet")) {
        assert!(bytes == undisturbed(), "{what}: a broken result stands at the output");
    }
    let again = home.sweep(RUN);
    assert!(again.status.success(), "{what}: {}", said(&again));
    assert!(
        fs::read(home.path("x.parquet")).expect("a result") == undisturbed(),
        "{what}: other bytes"
    );
}

/// Fails the first, second, ... of some system calls, until the command has fewer of them.
fn at_every_call(calls: &str, error: &str, words: &[&str]) {
    for when in 1.. {
        let home = fresh_home();
        let trace = format!("trace={calls}");
        let inject = format!("inject={calls}:error={error}:when={when}");
        let run = under(
            &home,
            &["strace", "-f", "-qq", "-o", "/dev/stderr", "-e", &trace, "-e", &inject],
            words,
        );
        let what = format!("{error} at {calls} {when} of {words:?}");
        let is_hit = said(&run).contains("(INJECTED)");
        if said(&run).contains("error while loading shared libraries") {
            // The loader's own call; the command has not begun.
            continue;
        }
        assert_told(&run, &what);
        if words == RUN {
            assert_mends(&home, &what);
        }
        if !is_hit {
            assert!(when > 1, "{words:?} calls none of {calls}");
            return;
        }
        assert!(when < 400, "{what} has no end");
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn threads_that_cannot_be_made_are_told() {
    for words in [RUN, TRACE, BOUNDARY] {
        at_every_call("clone,clone3", "EAGAIN", words);
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_folder_that_cannot_be_listed_is_told() {
    at_every_call("getdents64", "EIO", RUN);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_folder_that_cannot_be_closed_is_told() {
    at_every_call("close", "EIO", RUN);
}

#[test]
fn little_address_space_loses_nothing() {
    let program = fs::metadata(env!("CARGO_BIN_EXE_sweep")).expect("the program is built").len();
    let mut refused = 0;
    for more in [4_000, 12_000, 28_000, 60_000, 370_000] {
        let home = fresh_home();
        let kilobytes = program / 1000 + more;
        let limit = format!("ulimit -v {kilobytes}; exec \"$@\"");
        let run = under(&home, &["sh", "-c", &limit, "sh"], RUN);
        refused += u32::from(!run.status.success());
        assert_mends(&home, &format!("{kilobytes} kB"));
    }
    assert!((1..5).contains(&refused), "{refused} of 5 limits were too small");
}

#[test]
fn more_cores_than_there_can_be_are_refused_at_once() {
    let home = fresh_home();
    for words in [RUN, BOUNDARY, &["check", "g.toml"]] {
        let words: Vec<&str> =
            words.iter().copied().filter(|word| !["--threads", "2"].contains(word)).collect();
        let slurm = ["env", "SLURM_CPUS_PER_TASK=99999999"];
        let run = under(&home, &slurm, &words);
        assert_eq!(run.status.code(), Some(2), "{words:?}: {}", said(&run));
        assert!(
            said(&run).contains("SLURM_CPUS_PER_TASK is `99999999`"),
            "{words:?}: {}",
            said(&run)
        );
    }
    let given = under(&home, &["env", "SLURM_CPUS_PER_TASK=99999999"], RUN);
    assert!(given.status.success(), "--threads counts: {}", said(&given));
}

#[test]
fn slurm_gives_the_threads_of_a_run_and_of_its_traces() {
    let home = fresh_home();
    let words = ["run", "g.toml", "--keep-traces", "--out", "x.parquet"];
    let run = under(&home, &["env", "SLURM_CPUS_PER_TASK=3"], &words);
    assert!(run.status.success(), "{}", said(&run));
    assert!(said(&run).contains("on 3 threads"), "{}", said(&run));
    // Refused for the traces as for the run, although the map is there.
    let run = under(&home, &["env", "SLURM_CPUS_PER_TASK=0"], &words);
    assert_eq!(run.status.code(), Some(2), "{}", said(&run));
}

#[test]
fn a_signal_is_answered_within_a_trajectory() {
    // An hour of computing by each: the explicit methods are held by stability, the additive one by
    // its tolerance.
    for (set, method) in [
        ("tub_mass_kg = 1e-6", "method = \"rk4\"\nstep_s = 1.0e-8"),
        ("tub_mass_kg = 1e-6", "method = \"dopri5\""),
        ("tub_mass_kg = 20", "method = \"additive\"\nrtol = 1e-12\natol = 1e-18"),
    ] {
        let home = fresh_home();
        let grid = format!(
            "spin = {{ profile = \"ramp\", peak_rpm = 350, ramp_s = 50 }}\ntime = {{ end_s = 90 \
             }}\n\
             [set]\n{set}\n[integrator]\n{method}\n"
        );
        fs::write(home.path("g.toml"), grid).expect("the grid is written");
        let script = "\"$@\" & sweep=$!\nsleep 2\nkill -TERM $sweep; wait $sweep";
        let began = Instant::now();
        let run = under(&home, &["sh", "-c", script, "sh"], RUN);
        assert_eq!(run.status.code(), Some(143), "{method}: {}", said(&run));
        assert!(began.elapsed() < Duration::from_secs(30), "{method}: {:?}", began.elapsed());
    }
}

/// A shell's loop until a condition holds; given up after a minute, as a run that has ended by
/// itself never fulfils it.
fn until(condition: &str) -> String {
    format!("tries=0; until {condition} || test $((tries += 1)) -gt 3000; do sleep 0.02; done\n")
}

#[test]
fn a_signal_is_answered_while_steps_are_chosen() {
    let home = fresh_home();
    home.choose_for_seconds();
    // The folder is made before steps are chosen.
    let script = format!(
        "\"$@\" & sweep=$!\n{}sleep 0.1; date +%s%N; kill -TERM $sweep; wait $sweep; code=$?; \
         date +%s%N; exit $code",
        until("test -e x.parquet.partial/plan.json")
    );
    let run = under(&home, &["sh", "-c", &script, "sh"], RUN);
    assert_eq!(run.status.code(), Some(143), "{}", said(&run));
    assert!(said(&run).contains("interrupted with 0 of 256 points kept"), "{}", said(&run));
    let times = String::from_utf8_lossy(&run.stdout).into_owned();
    let times: Vec<u64> = times.lines().map(|line| line.parse().expect("a time")).collect();
    let took = Duration::from_nanos(times[1] - times[0]);
    // Half a second of a core; tests run beside others.
    assert!(took < Duration::from_secs(2), "{took:?}");
}

#[test]
fn an_interrupted_shard_is_gone_on_with_as_that_shard() {
    let home = fresh_home();
    // Long beside its first chunk: under a load the shell looks late.
    let long = grid(2000, 0).replace("end_s = 0.1", "end_s = 50.0");
    fs::write(home.path("g.toml"), long).expect("the grid is written");
    let script = format!(
        "\"$@\" & sweep=$!\n{}kill -TERM $sweep; wait $sweep",
        until("ls x.parquet.partial/part-* > /dev/null 2>&1")
    );
    let words = ["run", "g.toml", "--threads", "1", "--shard", "2/3", "--out", "x.parquet"];
    let run = under(&home, &["sh", "-c", &script, "sh"], &words);
    assert_eq!(run.status.code(), Some(143), "{}", said(&run));
    assert!(
        said(&run).contains("go on  sweep run g.toml --out x.parquet --shard 2/3"),
        "{}",
        said(&run)
    );
}

#[test]
fn a_hangup_ends_a_run_unless_it_was_ignored() {
    for (before, code) in [("", 129), ("trap '' HUP; ", 143)] {
        let home = fresh_home();
        home.choose_for_seconds();
        let script = format!(
            "{before}\"$@\" & sweep=$!\n{}sleep 0.1; kill -HUP $sweep; kill -HUP $sweep; \
             sleep 0.3; kill -TERM $sweep; wait $sweep",
            until("test -e x.parquet.partial/plan.json")
        );
        // Whatever started the tests may ignore it.
        let shell = ["env", "--default-signal=HUP", "sh", "-c", &script, "sh"];
        let run = under(&home, &shell, RUN);
        assert_eq!(run.status.code(), Some(code), "{before}: {}", said(&run));
    }
}
