//! Tests that a run that was disturbed in any way ends, once it is repeated, with the bytes of an
//! undisturbed run.
//!
//! They run the program on a small grid. Tests with faults of system calls need strace; those of a
//! full or read-only disk need to mount one. They are ignored by default.

#![cfg(target_os = "linux")]

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::signal;
use crate::test_folder::{TestFolder, all_output, grid, sweep_binary};

/// Returns a folder with a grid of five chunks of eight points.
fn fresh_folder() -> TestFolder {
    TestFolder::new(&grid(5, 8))
}

impl TestFolder {
    fn output(&self) -> PathBuf {
        self.path("x.parquet")
    }

    fn partial(&self) -> PathBuf {
        self.path("x.parquet.partial")
    }

    /// Returns the arguments of a run. It has a single thread, so that the order of system calls is
    /// always the same. Paths are absolute, because messages shall show them so.
    fn words(&self) -> Vec<String> {
        let [grid, output] = [self.path("g.toml"), self.output()].map(read_text);
        ["run", &grid, "--threads", "1", "--out", &output].map(str::to_owned).to_vec()
    }

    /// Returns a run as a command line of a shell.
    fn shell_line(&self) -> String {
        [vec![read_text(sweep_binary())], self.words()].concat().join("' '")
    }

    fn run(&self) -> Command {
        self.run_under(&[])
    }

    /// Returns a run as the argument of another program.
    fn run_under(&self, wrapper: &[&str]) -> Command {
        let mut command = self.under(wrapper);
        command.args(self.words());
        command
    }

    /// Returns a run in which strace injects faults into system calls.
    fn run_with_faults(&self, faults: &[&str]) -> Command {
        let mut wrapper = vec!["strace", "-f", "-qq", "-o", "/dev/null"];
        for fault in faults {
            wrapper.extend(["-e", fault]);
        }
        self.run_under(&wrapper)
    }

    /// Asserts that the output is complete or missing, and that one more run completes it.
    fn assert_recovers(&self, after: &str) {
        if let Ok(bytes) = fs::read(self.output()) {
            assert!(bytes == undisturbed_output(), "{after}: a broken result stands at the output");
        }
        let repeated_output = output(&mut self.run());
        assert_eq!(
            repeated_output.status.code(),
            Some(0),
            "{after}: {}",
            all_output(&repeated_output)
        );
        let bytes = fs::read(self.output()).expect("a finished run has an output");
        assert!(bytes == undisturbed_output(), "{after}: other bytes than the undisturbed run's");
        assert!(!self.partial().exists(), "{after}: the folder stays behind");
    }
}

fn read_text(path: PathBuf) -> String {
    path.into_os_string().into_string().expect("temporary folders are UTF-8")
}

/// Returns the bytes of an undisturbed run.
fn undisturbed_output() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let test_folder = fresh_folder();
        let command_output = output(&mut test_folder.run());
        assert!(command_output.status.success(), "{}", all_output(&command_output));
        fs::read(test_folder.output()).expect("a finished run has an output")
    })
}

fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| fail_to_start(command, &error))
}

fn spawn(command: &mut Command) -> Child {
    command.stderr(Stdio::piped()).spawn().unwrap_or_else(|error| fail_to_start(command, &error))
}

fn fail_to_start<T>(command: &Command, error: &std::io::Error) -> T {
    panic!(
        "{:?} does not start ({error}): scripts/tools/install_test_tools.sh installs what \
         tests need",
        command.get_program()
    )
}

/// Waits for the first chunk and returns the process that holds the run.
fn holder_with_chunk(test_folder: &TestFolder) -> u32 {
    let started = Instant::now();
    loop {
        let lock = fs::read_to_string(test_folder.partial().join("lock")).unwrap_or_default();
        let chunks = test_folder.partial().join("part-00000000.parquet").exists();
        if let (true, Some(process)) =
            (chunks, lock.split(' ').next().and_then(|word| word.parse().ok()))
        {
            return process;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "no run starts: lock `{lock}`");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Starts a run that stops for some seconds between its first and its last chunk.
fn delayed_run(test_folder: &TestFolder, seconds: u32) -> Child {
    // A run syncs the plan and its folder, then each chunk and its folder. The sixth sync is that
    // of the folder after the second chunk.
    let delay = format!("inject=fsync:delay_enter={seconds}s:when=6");
    spawn(&mut test_folder.run_with_faults(&["trace=fsync", &delay]))
}

#[test]
fn killed_at_thirty_random_instants() {
    undisturbed_output();
    let test_folder = fresh_folder();
    let started = Instant::now();
    assert!(output(&mut test_folder.run()).status.success());
    let run_duration = started.elapsed();
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut killed_count = 0;
    for round in 0.. {
        let test_folder = fresh_folder();
        // Each run continues the one that was killed before.
        for _ in 0..6 {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let mut run = spawn(&mut test_folder.run());
            std::thread::sleep(run_duration.mul_f64((random % 1000) as f64 / 1000.0));
            // The run may have ended before.
            let _ = run.kill();
            let status = run.wait().expect("a child can be waited for");
            killed_count += u32::from(status.code().is_none());
        }
        test_folder.assert_recovers(&format!("round {round}"));
        if killed_count >= 30 {
            return;
        }
        assert!(round < 40, "only {killed_count} of {} kills met a run", 6 * round);
    }
}

/// Injects a fault into the first, second, ... of some system calls, until a run has fewer of them.
fn at_every_call(calls: &str, what: &str, check: impl Fn(&Output, u32)) {
    for when in 1.. {
        let test_folder = fresh_folder();
        let tamper = format!("inject={calls}:{what}:when={when}");
        let run = output(&mut test_folder.run_with_faults(&[&format!("trace={calls}"), &tamper]));
        let has_no_fault = run.status.success();
        check(&run, when);
        test_folder.assert_recovers(&format!("{what} at {calls} {when}"));
        if has_no_fault {
            assert!(when > 3, "a run has more than {when} of {calls}");
            return;
        }
        assert!(when < 200, "{what} at {calls} has no end");
    }
}

const RENAMES: &str = "rename,renameat,renameat2,linkat";

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_write() {
    at_every_call("write", "signal=SIGKILL", |run, when| {
        assert!(run.status.code() != Some(1), "write {when}: {}", all_output(run));
    });
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_fsync() {
    at_every_call("fsync", "signal=SIGKILL", |run, when| {
        assert!(run.status.code() != Some(1), "fsync {when}: {}", all_output(run));
    });
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_rename() {
    at_every_call(RENAMES, "signal=SIGKILL", |run, when| {
        assert!(run.status.code() != Some(1), "rename {when}: {}", all_output(run));
    });
}

/// Asserts that a failed call gives exit code 1 and a message with the path of the result, of its
/// folder or of its record, and with advice.
fn assert_error_message(run: &Output, when: u32) {
    let messages = all_output(run);
    let folder = std::env::temp_dir();
    let folder = folder.to_str().expect("temporary folders are UTF-8");
    if !run.status.success() {
        assert_eq!(run.status.code(), Some(1), "call {when}: {messages}");
        assert!(
            messages.contains(folder) && messages.contains("= help: "),
            "call {when}: {messages}"
        );
        assert!(!messages.contains("panicked"), "call {when}: {messages}");
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn io_error_at_every_fsync() {
    at_every_call("fsync", "error=EIO", assert_error_message);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn io_error_at_every_rename() {
    at_every_call(RENAMES, "error=EIO", assert_error_message);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn disk_full_at_every_write() {
    at_every_call("write", "error=ENOSPC", assert_error_message);
}

#[test]
#[ignore = "needs unshare and mount; .ci/run runs it"]
fn a_full_disk_is_an_error_and_the_run_continues_on_a_larger_one() {
    let test_folder = fresh_folder();
    let run = test_folder.shell_line();
    let out = test_folder.output();
    // The file system exists in a namespace of its own, from which only the result is copied.
    let script = format!(
        "set -eu\n\
         disk=\"$1\"; pages=\"$2\"; result=\"$3\"\n\
         mount -t tmpfs -o size=$((pages * 4))k none \"$disk\"\n\
         code=0; '{}' || code=$?\n\
         echo \"first $code\"\n\
         mount -o remount,size=16m \"$disk\"\n\
         '{}'\n\
         cp \"$disk/x.parquet\" \"$result\"\n",
        run.replace(out.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet"),
        run.replace(out.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet"),
    );
    let mut full_disk_count = 0;
    for pages in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16] {
        let disk = test_folder.path("disk");
        let result = test_folder.path("result");
        fs::create_dir_all(&disk).expect("a mount point");
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--mount", "sh", "-c", &script, "sh"]);
        command.args([disk.as_os_str(), pages.to_string().as_ref(), result.as_os_str()]);
        let run = output(&mut command);
        let messages = all_output(&run);
        assert!(run.status.success(), "{pages} pages: {messages}");
        let first_run = String::from_utf8_lossy(&run.stdout).into_owned();
        if first_run.contains("first 1") {
            full_disk_count += 1;
            assert!(
                messages.contains("the disk is full: free some space"),
                "{pages} pages: {messages}"
            );
        } else {
            assert!(first_run.contains("first 0"), "{pages} pages: {first_run} {messages}");
        }
        assert!(
            fs::read(&result).expect("a result") == undisturbed_output(),
            "{pages} pages: other bytes"
        );
    }
    assert!(full_disk_count >= 4, "only {full_disk_count} disks were too small");
}

#[test]
fn a_file_size_limit_is_an_error_and_the_run_continues_without_it() {
    let mut limited_count = 0;
    // The limits, in blocks of 512 bytes, are too small for the plan, a chunk and the result.
    for blocks in [1, 2, 4, 8, 16, 24, 32] {
        let test_folder = fresh_folder();
        let limit = format!("ulimit -f {blocks}; exec \"$@\"");
        let run = output(&mut test_folder.run_under(&["sh", "-c", &limit, "sh"]));
        if !run.status.success() {
            limited_count += 1;
            assert_error_message(&run, blocks);
            assert!(
                all_output(&run).contains("a file-size limit was hit"),
                "{blocks} blocks: {}",
                all_output(&run)
            );
        }
        test_folder.assert_recovers(&format!("{blocks} blocks"));
    }
    assert!(limited_count >= 3, "only {limited_count} limits were met");
}

#[test]
fn a_flipped_bit_and_a_truncation_are_errors_and_repaired() {
    let break_part = |change: &dyn Fn(&mut Vec<u8>)| {
        let test_folder = fresh_folder();
        let shard = output(test_folder.run().args(["--shard", "1/2"]));
        assert!(shard.status.success(), "{}", all_output(&shard));
        let part = test_folder.partial().join("part-00000002.parquet");
        let mut bytes = fs::read(&part).expect("the first shard has the third chunk");
        change(&mut bytes);
        fs::write(&part, bytes).expect("the part is broken");
        let run = output(&mut test_folder.run());
        assert!(run.status.success(), "{}", all_output(&run));
        assert!(all_output(&run).contains("part-00000002.parquet.damaged"), "{}", all_output(&run));
        assert!(fs::read(test_folder.output()).expect("a result") == undisturbed_output());
    };
    break_part(&|bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
    });
    break_part(&|bytes| bytes.truncate(bytes.len() - 1));
    break_part(&Vec::clear);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_system_without_random_numbers_is_an_error() {
    for error in ["ENOSYS", "ENOLCK", "EIO"] {
        let test_folder = fresh_folder();
        let inject = format!("inject=getrandom:error={error}");
        let run = output(&mut test_folder.run_with_faults(&["trace=getrandom", &inject]));
        let text = all_output(&run);
        assert!(!text.contains("panicked"), "{error}: {text}");
        // The program may use another source if the call does not exist.
        let is_told = text.contains("cannot draw random numbers for this process");
        assert!(run.status.success() || is_told, "{error}: {text}");
        test_folder.assert_recovers(error);
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_second_run_names_the_process_of_the_first_unless_it_was_killed() {
    let test_folder = fresh_folder();
    let mut first_run = delayed_run(&test_folder, 3);
    let process = holder_with_chunk(&test_folder);
    let second = output(&mut test_folder.run());
    assert_eq!(second.status.code(), Some(75), "{}", all_output(&second));
    assert!(
        all_output(&second).contains(&format!("process {process} on ")),
        "{}",
        all_output(&second)
    );
    assert!(first_run.wait().expect("a child can be waited for").success());
    test_folder.assert_recovers("two runners");

    let test_folder = fresh_folder();
    let mut first_run = delayed_run(&test_folder, 30);
    signal("KILL", holder_with_chunk(&test_folder));
    first_run.wait().expect("a child can be waited for");
    test_folder.assert_recovers("a killed runner");
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_signal_keeps_completed_chunks() {
    for (name, code) in [("TERM", 143), ("INT", 130)] {
        let test_folder = fresh_folder();
        let run = delayed_run(&test_folder, 1);
        signal(name, holder_with_chunk(&test_folder));
        let run = run.wait_with_output().expect("a child can be waited for");
        assert_eq!(run.status.code(), Some(code), "{}", all_output(&run));
        assert!(all_output(&run).contains("of 40 points kept"), "{}", all_output(&run));
        assert!(!test_folder.output().exists());
        test_folder.assert_recovers(name);
    }
}

#[test]
fn a_second_signal_ends_the_run_at_once() {
    // Nobody reads the messages of the run, and the pipe is full, so that the run blocks on its
    // message about the first signal.
    const PIPE_BYTES: usize = 1 << 16;
    let (_reader, mut full_pipe) = std::io::pipe().expect("a pipe can be made");
    full_pipe.write_all(&[b' '; PIPE_BYTES]).expect("a pipe takes as much");
    let test_folder = fresh_folder();
    test_folder.write_slow_list();
    let mut run = test_folder.run().stderr(full_pipe).spawn().expect("the command starts");
    let begun = Instant::now();
    while !test_folder.partial().join("plan.json").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "no run starts");
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(500));
    signal("TERM", run.id());
    std::thread::sleep(Duration::from_millis(500));
    assert!(
        run.try_wait().expect("a child can be asked").is_none(),
        "the first signal lets it say what is kept"
    );
    let second = Instant::now();
    signal("TERM", run.id());
    assert_eq!(run.wait().expect("a child can be waited for").code(), Some(143));
    assert!(second.elapsed() < Duration::from_secs(10), "it stayed for {:?}", second.elapsed());
    assert!(!test_folder.output().exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_an_error() {
    let test_folder = fresh_folder();
    let blocked_path = test_folder.path("g.toml/sub/x.parquet");
    let words = test_folder.words();
    let run = output(test_folder.under(&[]).args(&words[..words.len() - 1]).arg(&blocked_path));
    assert_eq!(run.status.code(), Some(1), "{}", all_output(&run));
    assert!(all_output(&run).contains("or give another path"), "{}", all_output(&run));
    assert!(Path::new(&test_folder.path("g.toml")).is_file());
}

#[test]
#[ignore = "needs unshare and mount; .ci/run runs it"]
fn a_read_only_folder_is_an_error_and_the_run_continues_once_it_is_writable() {
    let test_folder = fresh_folder();
    let disk = test_folder.path("disk");
    fs::create_dir(&disk).expect("a mount point");
    let out = test_folder.output();
    let run = test_folder.shell_line().replace(out.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet");
    // A read-only mount stops root too, which permissions do not.
    let script = format!(
        "set -eu\n\
         mount -t tmpfs -o size=16m none \"$1\"\n\
         '{run}' --shard 1/2\n\
         mount -o remount,ro \"$1\"\n\
         code=0; '{run}' || code=$?\n\
         echo \"read-only $code\"\n\
         mount -o remount,rw \"$1\"\n\
         '{run}'\n\
         cp \"$1/x.parquet\" \"$2\"\n"
    );
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "sh", "-c", &script, "sh"]);
    command.args([disk.as_os_str(), test_folder.path("result").as_os_str()]);
    let run = output(&mut command);
    assert!(run.status.success(), "{}", all_output(&run));
    assert!(String::from_utf8_lossy(&run.stdout).contains("read-only 1"), "{}", all_output(&run));
    assert!(all_output(&run).contains("give this user the right to it"), "{}", all_output(&run));
    assert!(fs::read(test_folder.path("result")).expect("a result") == undisturbed_output());
}

#[test]
fn failed_points_are_rows_and_fail_the_run_only_on_request() {
    let test_folder = fresh_folder();
    // The softest springs cannot carry the machine.
    let axis =
        "[[axis]]\nparameter = \"spring_stiffness_n_per_m\"\nvalues = [1, 7000]\n[reliability]";
    fs::write(test_folder.path("g.toml"), grid(5, 8).replace("[reliability]", axis))
        .expect("the grid is written");
    let run = output(&mut test_folder.run());
    assert_eq!(run.status.code(), Some(0), "{}", all_output(&run));
    assert!(all_output(&run).contains("failed  40 no_equilibrium"), "{}", all_output(&run));
    // Every command with rows says why.
    let stability_output =
        test_folder.sweep(&["stability", "g.toml", "--speed", "100", "--out", "p.parquet"]);
    for summary in [&run, &stability_output].map(all_output) {
        assert!(summary.contains("    reason  no_equilibrium at "), "{summary}");
        assert!(summary.contains("the machine has no stable static equilibrium"), "{summary}");
    }
    // Rows of an earlier run count too.
    for fresh in [&[] as &[&str], &["--fresh"]] {
        let run = output(test_folder.run().arg("--fail-on-error").args(fresh));
        assert_eq!(run.status.code(), Some(3), "{fresh:?}: {}", all_output(&run));
    }
    // A shard reports its own rows, and the merge all rows.
    let run_sharded =
        |words: &[&str]| test_folder.sweep(&[words, &["g.toml", "--out", "s.parquet"]].concat());
    for (words, code) in [
        (&["run", "--shard", "1/2", "--fail-on-error"][..], 3),
        (&["run", "--shard", "2/2"], 0),
        (&["merge", "--fail-on-error"], 3),
        (&["merge"], 0),
    ] {
        let command_output = run_sharded(words);
        assert_eq!(
            command_output.status.code(),
            Some(code),
            "{words:?}: {}",
            all_output(&command_output)
        );
        assert!(
            all_output(&command_output).contains(" no_equilibrium"),
            "{words:?}: {}",
            all_output(&command_output)
        );
    }
    let idle_shard_output =
        test_folder.sweep(&["run", "g.toml", "--shard", "12/12", "--out", "t.parquet"]);
    let idle_message = "with 10 chunks of 8 points, the run leaves 2 of the 12 shards without work";
    assert!(
        all_output(&idle_shard_output).contains(idle_message),
        "{}",
        all_output(&idle_shard_output)
    );
    let check_output = test_folder.sweep(&["check", "g.toml"]);
    assert!(
        all_output(&check_output).contains(" no_equilibrium, of "),
        "{}",
        all_output(&check_output)
    );
    assert!(
        all_output(&check_output).contains("takes       about "),
        "{}",
        all_output(&check_output)
    );
    let check_output =
        test_folder.sweep(&["check", "g.toml", "--at", "spring_stiffness_n_per_m=1"]);
    assert_eq!(check_output.status.code(), Some(1), "{}", all_output(&check_output));
    let unknown_duration = "takes       not known: none of the ";
    assert!(all_output(&check_output).contains(unknown_duration), "{}", all_output(&check_output));
    let complete_output = output(fresh_folder().run().arg("--fail-on-error"));
    assert_eq!(complete_output.status.code(), Some(0), "{}", all_output(&complete_output));
}
