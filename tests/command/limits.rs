//! Tests on a system that denies threads, memory or folders. Every denial gives an error message
//! with advice, not a panic, and no computed rows are lost.

#![cfg(target_os = "linux")]

use std::fs;
use std::process::Output;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::test_folder::{TestFolder, all_output, grid_text};

const RUN_WORDS: &[&str] = &["run", "g.toml", "--threads", "2", "--out", "x.parquet"];
const TRACE_WORDS: &[&str] =
    &["trace", "g.toml", "--at", "unbalance_mass_kg=0.4", "--out", "t.parquet"];
const BOUNDARY_WORDS: &[&str] =
    &["boundary", "g2.toml", "--threads", "2", "--lattice", "1", "--out", "b.parquet"];

/// Returns a folder with two grids.
fn fresh_folder() -> TestFolder {
    let test_folder = TestFolder::new(&grid_text(24, 0));
    fs::write(test_folder.path("g2.toml"), grid_text(2, 2)).expect("the grid is written");
    test_folder
}

/// Runs the command as the argument of another program.
fn output_under(test_folder: &TestFolder, wrapper: &[&str], words: &[&str]) -> Output {
    test_folder.command_under(wrapper).args(words).output().expect("the command starts")
}

fn undisturbed_bytes() -> &'static [u8] {
    static RESULT_BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    RESULT_BYTES.get_or_init(|| {
        let test_folder = TestFolder::new(&grid_text(24, 0));
        let run_output = test_folder.run_sweep(RUN_WORDS);
        assert!(run_output.status.success(), "{}", all_output(&run_output));
        fs::read(test_folder.path("x.parquet")).expect("a finished run has an output")
    })
}

/// Asserts that a command did not panic, and that it has a message if it failed.
fn assert_no_panic(output: &Output, circumstances: &str) {
    let messages = all_output(output);
    assert!(!messages.contains("panicked"), "{circumstances}: {messages}");
    assert!(
        matches!(output.status.code(), Some(0 | 1)),
        "{circumstances}: {:?} {messages}",
        output.status
    );
    assert!(output.status.success() || messages.contains("error: "), "{circumstances}: {messages}");
}

/// Asserts that one more run ends with the bytes of the undisturbed run.
fn assert_recovers(test_folder: &TestFolder, circumstances: &str) {
    if let Ok(bytes) = fs::read(test_folder.path("x.parquet")) {
        assert!(
            bytes == undisturbed_bytes(),
            "{circumstances}: a broken result stands at the output"
        );
    }
    let repeated_output = test_folder.run_sweep(RUN_WORDS);
    assert!(repeated_output.status.success(), "{circumstances}: {}", all_output(&repeated_output));
    assert!(
        fs::read(test_folder.path("x.parquet")).expect("a result") == undisturbed_bytes(),
        "{circumstances}: other bytes"
    );
}

/// Makes the first, second, ... of some system calls fail, until the command has no such call left.
fn test_error_at_every_call(calls: &str, error: &str, words: &[&str]) {
    for call_number in 1.. {
        let test_folder = fresh_folder();
        let trace_option = format!("trace={calls}");
        let inject_option = format!("inject={calls}:error={error}:when={call_number}");
        let command_output = output_under(
            &test_folder,
            &[
                "strace",
                "-f",
                "-qq",
                "-o",
                "/dev/stderr",
                "-e",
                &trace_option,
                "-e",
                &inject_option,
            ],
            words,
        );
        let circumstances = format!("{error} at {calls} {call_number} of {words:?}");
        let is_injected = all_output(&command_output).contains("(INJECTED)");
        if all_output(&command_output).contains("error while loading shared libraries") {
            // This call is the dynamic loader's, before the command starts.
            continue;
        }
        assert_no_panic(&command_output, &circumstances);
        if words == RUN_WORDS {
            assert_recovers(&test_folder, &circumstances);
        }
        if !is_injected {
            assert!(call_number > 1, "{words:?} calls none of {calls}");
            return;
        }
        assert!(call_number < 400, "{circumstances} has no end");
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn threads_that_cannot_be_created_are_an_error() {
    for words in [RUN_WORDS, TRACE_WORDS, BOUNDARY_WORDS] {
        test_error_at_every_call("clone,clone3", "EAGAIN", words);
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_folder_that_cannot_be_listed_is_an_error() {
    test_error_at_every_call("getdents64", "EIO", RUN_WORDS);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_folder_that_cannot_be_closed_is_an_error() {
    test_error_at_every_call("close", "EIO", RUN_WORDS);
}

#[test]
fn little_address_space_loses_no_rows() {
    let program_bytes =
        fs::metadata(env!("CARGO_BIN_EXE_sweep")).expect("the program is built").len();
    let mut failed_count = 0;
    for further_kilobytes in [4_000, 12_000, 28_000, 60_000, 370_000] {
        let test_folder = fresh_folder();
        let limit_kilobytes = program_bytes / 1000 + further_kilobytes;
        let limit_script = format!("ulimit -v {limit_kilobytes}; exec \"$@\"");
        let run_output = output_under(&test_folder, &["sh", "-c", &limit_script, "sh"], RUN_WORDS);
        failed_count += u32::from(!run_output.status.success());
        assert_recovers(&test_folder, &format!("{limit_kilobytes} kB"));
    }
    assert!((1..5).contains(&failed_count), "{failed_count} of 5 limits were too small");
}

#[test]
fn more_cores_than_possible_are_an_error_at_once() {
    let test_folder = fresh_folder();
    for command_words in [RUN_WORDS, BOUNDARY_WORDS, &["check", "g.toml"]] {
        let command_words: Vec<&str> = command_words
            .iter()
            .copied()
            .filter(|word| !["--threads", "2"].contains(word))
            .collect();
        let slurm_wrapper = ["env", "SLURM_CPUS_PER_TASK=99999999"];
        let command_output = output_under(&test_folder, &slurm_wrapper, &command_words);
        assert_eq!(
            command_output.status.code(),
            Some(2),
            "{command_words:?}: {}",
            all_output(&command_output)
        );
        assert!(
            all_output(&command_output).contains("SLURM_CPUS_PER_TASK is `99999999`"),
            "{command_words:?}: {}",
            all_output(&command_output)
        );
    }
    let threads_output =
        output_under(&test_folder, &["env", "SLURM_CPUS_PER_TASK=99999999"], RUN_WORDS);
    assert!(threads_output.status.success(), "--threads counts: {}", all_output(&threads_output));
}

#[test]
fn slurm_sets_the_threads_of_a_run_and_of_its_traces() {
    let test_folder = fresh_folder();
    let words = ["run", "g.toml", "--keep-traces", "--out", "x.parquet"];
    let run_output = output_under(&test_folder, &["env", "SLURM_CPUS_PER_TASK=3"], &words);
    assert!(run_output.status.success(), "{}", all_output(&run_output));
    assert!(all_output(&run_output).contains("on 3 threads"), "{}", all_output(&run_output));
    // The traces have the same error as the run, although the map is complete.
    let run_output = output_under(&test_folder, &["env", "SLURM_CPUS_PER_TASK=0"], &words);
    assert_eq!(run_output.status.code(), Some(2), "{}", all_output(&run_output));
}

#[test]
fn a_signal_stops_a_run_within_a_trajectory() {
    // Each trajectory takes an hour, because stability limits the steps of the explicit methods,
    // and the tolerance those of the additive one.
    for (constant, method_keys) in [
        ("tub_mass_kg = 1e-6", "method = \"rk4\"\nstep_s = 1.0e-8"),
        ("tub_mass_kg = 1e-6", "method = \"dopri5\""),
        ("tub_mass_kg = 20", "method = \"additive\"\nrtol = 1e-12\natol = 1e-18"),
    ] {
        let test_folder = fresh_folder();
        let grid_of_long_trajectories = format!(
            "spin = {{ profile = \"ramp\", peak_rpm = 350, ramp_s = 50 }}\ntime = {{ end_s = 90 \
             }}\n\
             [set]\n{constant}\n[integrator]\n{method_keys}\n"
        );
        fs::write(test_folder.path("g.toml"), grid_of_long_trajectories)
            .expect("the grid is written");
        let script = "\"$@\" & sweep=$!\nsleep 2\nkill -TERM $sweep; wait $sweep";
        let start_instant = Instant::now();
        let run_output = output_under(&test_folder, &["sh", "-c", script, "sh"], RUN_WORDS);
        assert_eq!(
            run_output.status.code(),
            Some(143),
            "{method_keys}: {}",
            all_output(&run_output)
        );
        assert!(
            start_instant.elapsed() < Duration::from_secs(30),
            "{method_keys}: {:?}",
            start_instant.elapsed()
        );
    }
}

/// Returns a shell loop that waits for a condition. It gives up after a minute, because the
/// condition never holds if the run has ended before.
fn wait_loop(condition: &str) -> String {
    format!("tries=0; until {condition} || test $((tries += 1)) -gt 3000; do sleep 0.02; done\n")
}

#[test]
fn a_signal_stops_the_choice_of_steps() {
    let test_folder = fresh_folder();
    test_folder.write_slow_list();
    // The folder is created before steps are chosen.
    let script = format!(
        "\"$@\" & sweep=$!\n{}date +%s%N; kill -TERM $sweep; wait $sweep; code=$?; \
         date +%s%N; exit $code",
        wait_loop("test -e x.parquet.partial/plan.json")
    );
    let run_output = output_under(&test_folder, &["sh", "-c", &script, "sh"], RUN_WORDS);
    assert_eq!(run_output.status.code(), Some(143), "{}", all_output(&run_output));
    assert!(
        all_output(&run_output).contains("interrupted with 0 of 256 points kept"),
        "{}",
        all_output(&run_output)
    );
    let printed_times = String::from_utf8_lossy(&run_output.stdout).into_owned();
    let times_ns: Vec<u64> =
        printed_times.lines().map(|line| line.parse().expect("a time")).collect();
    let stop_duration = Duration::from_nanos(times_ns[1] - times_ns[0]);
    // The run has had half a second of processor time, because other tests run at the same time.
    assert!(stop_duration < Duration::from_secs(2), "{stop_duration:?}");
}

#[test]
fn an_interrupted_shard_continues_as_that_shard() {
    let test_folder = fresh_folder();
    // The run is much longer than its first chunk, because the shell may be late under load.
    let long_grid = grid_text(2000, 0).replace("end_s = 0.1", "end_s = 50.0");
    fs::write(test_folder.path("g.toml"), long_grid).expect("the grid is written");
    let script = format!(
        "\"$@\" & sweep=$!\n{}kill -TERM $sweep; wait $sweep",
        wait_loop("ls x.parquet.partial/part-* > /dev/null 2>&1")
    );
    let words = ["run", "g.toml", "--threads", "1", "--shard", "2/3", "--out", "x.parquet"];
    let run_output = output_under(&test_folder, &["sh", "-c", &script, "sh"], &words);
    assert_eq!(run_output.status.code(), Some(143), "{}", all_output(&run_output));
    assert!(
        all_output(&run_output).contains("go on  sweep run g.toml --out x.parquet --shard 2/3"),
        "{}",
        all_output(&run_output)
    );
}

#[test]
fn a_hangup_ends_a_run_unless_it_was_ignored() {
    for (shell_prefix, exit_code) in [("", 129), ("trap '' HUP; ", 143)] {
        let test_folder = fresh_folder();
        test_folder.write_slow_list();
        let script = format!(
            "{shell_prefix}\"$@\" & sweep=$!\n{}sleep 0.1; kill -HUP $sweep; kill -HUP $sweep; \
             sleep 0.3; kill -TERM $sweep; wait $sweep",
            wait_loop("test -e x.parquet.partial/plan.json")
        );
        // The parent process of the tests may ignore the signal.
        let shell_words = ["env", "--default-signal=HUP", "sh", "-c", &script, "sh"];
        let run_output = output_under(&test_folder, &shell_words, RUN_WORDS);
        assert_eq!(
            run_output.status.code(),
            Some(exit_code),
            "{shell_prefix}: {}",
            all_output(&run_output)
        );
    }
}
