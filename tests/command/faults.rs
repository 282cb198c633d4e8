//! Tests that a run that was disturbed in any way ends, once it is repeated, with the bytes of an
//! undisturbed run.
//!
//! The tests run the program on a small grid. Tests with faults of system calls need strace; those
//! of a full or read-only disk need to mount one. They are ignored by default.

#![cfg(target_os = "linux")]

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::send_signal;
use crate::test_folder::{TestFolder, all_output, grid_text, sweep_binary};

/// Returns a folder with a grid of five chunks of eight points.
fn fresh_folder() -> TestFolder {
    TestFolder::new(&grid_text(5, 8))
}

impl TestFolder {
    fn output_path(&self) -> PathBuf {
        self.path("x.parquet")
    }

    fn partial_folder(&self) -> PathBuf {
        self.path("x.parquet.partial")
    }

    /// Returns the arguments of a run. It has a single thread, so that the order of system calls is
    /// always the same. Paths are absolute, because messages shall show them so.
    fn run_words(&self) -> Vec<String> {
        let [grid, output_path] = [self.path("g.toml"), self.output_path()].map(read_text);
        ["run", &grid, "--threads", "1", "--out", &output_path].map(str::to_owned).to_vec()
    }

    /// Returns a run as a command line of a shell.
    fn shell_line(&self) -> String {
        [vec![read_text(sweep_binary())], self.run_words()].concat().join("' '")
    }

    fn run_command(&self) -> Command {
        self.run_command_under(&[])
    }

    /// Returns a run as the argument of another program.
    fn run_command_under(&self, wrapper: &[&str]) -> Command {
        let mut command = self.command_under(wrapper);
        command.args(self.run_words());
        command
    }

    /// Returns a run in which strace injects faults into system calls.
    fn run_command_with_faults(&self, faults: &[&str]) -> Command {
        let mut wrapper = vec!["strace", "-f", "-qq", "-o", "/dev/null"];
        for fault in faults {
            wrapper.extend(["-e", fault]);
        }
        self.run_command_under(&wrapper)
    }

    /// Asserts that the output is complete or missing, and that one more run completes it.
    fn assert_recovers(&self, disturbance: &str) {
        if let Ok(bytes) = fs::read(self.output_path()) {
            assert!(
                bytes == undisturbed_bytes(),
                "{disturbance}: a broken result stands at the output"
            );
        }
        let repeated_output = output_of(&mut self.run_command());
        assert_eq!(
            repeated_output.status.code(),
            Some(0),
            "{disturbance}: {}",
            all_output(&repeated_output)
        );
        let bytes = fs::read(self.output_path()).expect("a finished run has an output");
        assert!(
            bytes == undisturbed_bytes(),
            "{disturbance}: other bytes than the undisturbed run's"
        );
        assert!(!self.partial_folder().exists(), "{disturbance}: the folder stays behind");
    }
}

fn read_text(path: PathBuf) -> String {
    path.into_os_string().into_string().expect("temporary folders are UTF-8")
}

/// Returns the bytes of an undisturbed run.
fn undisturbed_bytes() -> &'static [u8] {
    static RESULT_BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    RESULT_BYTES.get_or_init(|| {
        let test_folder = fresh_folder();
        let command_output = output_of(&mut test_folder.run_command());
        assert!(command_output.status.success(), "{}", all_output(&command_output));
        fs::read(test_folder.output_path()).expect("a finished run has an output")
    })
}

fn output_of(command: &mut Command) -> Output {
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
fn process_with_first_chunk(test_folder: &TestFolder) -> u32 {
    let start_instant = Instant::now();
    loop {
        let lock_text =
            fs::read_to_string(test_folder.partial_folder().join("lock")).unwrap_or_default();
        let has_chunk = test_folder.partial_folder().join("part-00000000.parquet").exists();
        if let (true, Some(process)) =
            (has_chunk, lock_text.split(' ').next().and_then(|word| word.parse().ok()))
        {
            return process;
        }
        assert!(
            start_instant.elapsed() < Duration::from_secs(60),
            "no run starts: lock `{lock_text}`"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Starts a run that stops for some seconds between its first and its last chunk.
fn spawn_delayed_run(test_folder: &TestFolder, seconds: u32) -> Child {
    // A run syncs the plan and its folder, then each chunk and its folder. The sixth sync is that
    // of the folder after the second chunk.
    let delay_fault = format!("inject=fsync:delay_enter={seconds}s:when=6");
    spawn(&mut test_folder.run_command_with_faults(&["trace=fsync", &delay_fault]))
}

#[test]
fn killed_at_thirty_random_instants() {
    undisturbed_bytes();
    let test_folder = fresh_folder();
    let start_instant = Instant::now();
    assert!(output_of(&mut test_folder.run_command()).status.success());
    let run_duration = start_instant.elapsed();
    let mut random_bits = 0x2545_f491_4f6c_dd1d_u64;
    let mut killed_count = 0;
    for round in 0.. {
        let test_folder = fresh_folder();
        // Each run continues the one that was killed before.
        for _ in 0..6 {
            random_bits ^= random_bits << 13;
            random_bits ^= random_bits >> 7;
            random_bits ^= random_bits << 17;
            let mut run_child = spawn(&mut test_folder.run_command());
            std::thread::sleep(run_duration.mul_f64((random_bits % 1000) as f64 / 1000.0));
            // The run may have ended before.
            let _ = run_child.kill();
            let exit_status = run_child.wait().expect("a child can be waited for");
            killed_count += u32::from(exit_status.code().is_none());
        }
        test_folder.assert_recovers(&format!("round {round}"));
        if killed_count >= 30 {
            return;
        }
        assert!(round < 40, "only {killed_count} of {} kills met a run", 6 * round);
    }
}

/// Injects a fault into the first, second, ... of some system calls, until a run has fewer of them.
fn test_fault_at_every_call(calls: &str, fault: &str, check_output: impl Fn(&Output, u32)) {
    for call_number in 1.. {
        let test_folder = fresh_folder();
        let injection = format!("inject={calls}:{fault}:when={call_number}");
        let run_output = output_of(
            &mut test_folder.run_command_with_faults(&[&format!("trace={calls}"), &injection]),
        );
        let has_no_fault = run_output.status.success();
        check_output(&run_output, call_number);
        test_folder.assert_recovers(&format!("{fault} at {calls} {call_number}"));
        if has_no_fault {
            assert!(call_number > 3, "a run has more than {call_number} of {calls}");
            return;
        }
        assert!(call_number < 200, "{fault} at {calls} has no end");
    }
}

const RENAME_CALLS: &str = "rename,renameat,renameat2,linkat";

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_write() {
    test_fault_at_every_call("write", "signal=SIGKILL", |run_output, call_number| {
        assert!(
            run_output.status.code() != Some(1),
            "write {call_number}: {}",
            all_output(run_output)
        );
    });
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_fsync() {
    test_fault_at_every_call("fsync", "signal=SIGKILL", |run_output, call_number| {
        assert!(
            run_output.status.code() != Some(1),
            "fsync {call_number}: {}",
            all_output(run_output)
        );
    });
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_rename() {
    test_fault_at_every_call(RENAME_CALLS, "signal=SIGKILL", |run_output, call_number| {
        assert!(
            run_output.status.code() != Some(1),
            "rename {call_number}: {}",
            all_output(run_output)
        );
    });
}

/// Asserts that a run with a failed call has exit code 1 and an error message, which contains a
/// path in the temporary folder and advice.
fn assert_error_message(run_output: &Output, call_number: u32) {
    let messages = all_output(run_output);
    let temporary_folder = std::env::temp_dir();
    let temporary_folder = temporary_folder.to_str().expect("temporary folders are UTF-8");
    if !run_output.status.success() {
        assert_eq!(run_output.status.code(), Some(1), "call {call_number}: {messages}");
        assert!(
            messages.contains(temporary_folder) && messages.contains("= help: "),
            "call {call_number}: {messages}"
        );
        assert!(!messages.contains("panicked"), "call {call_number}: {messages}");
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn io_error_at_every_fsync() {
    test_fault_at_every_call("fsync", "error=EIO", assert_error_message);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn io_error_at_every_rename() {
    test_fault_at_every_call(RENAME_CALLS, "error=EIO", assert_error_message);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn disk_full_at_every_write() {
    test_fault_at_every_call("write", "error=ENOSPC", assert_error_message);
}

#[test]
#[ignore = "needs unshare and mount; .ci/run runs it"]
fn a_full_disk_is_an_error_and_the_run_continues_on_a_larger_one() {
    let test_folder = fresh_folder();
    let run_line = test_folder.shell_line();
    let result_path = test_folder.output_path();
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
        run_line.replace(result_path.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet"),
        run_line.replace(result_path.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet"),
    );
    let mut full_disk_count = 0;
    for pages in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16] {
        let mount_point = test_folder.path("disk");
        let copied_result = test_folder.path("result");
        fs::create_dir_all(&mount_point).expect("a mount point");
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--mount", "sh", "-c", &script, "sh"]);
        command.args([
            mount_point.as_os_str(),
            pages.to_string().as_ref(),
            copied_result.as_os_str(),
        ]);
        let run_output = output_of(&mut command);
        let messages = all_output(&run_output);
        assert!(run_output.status.success(), "{pages} pages: {messages}");
        let first_exit_line = String::from_utf8_lossy(&run_output.stdout).into_owned();
        if first_exit_line.contains("first 1") {
            full_disk_count += 1;
            assert!(
                messages.contains("the disk is full: free some space"),
                "{pages} pages: {messages}"
            );
        } else {
            assert!(
                first_exit_line.contains("first 0"),
                "{pages} pages: {first_exit_line} {messages}"
            );
        }
        assert!(
            fs::read(&copied_result).expect("a result") == undisturbed_bytes(),
            "{pages} pages: other bytes"
        );
    }
    assert!(full_disk_count >= 4, "only {full_disk_count} disks were too small");
}

#[test]
fn a_file_size_limit_is_an_error_and_the_run_continues_without_it() {
    let mut limited_count = 0;
    // The limits are in blocks of 512 bytes. The smallest ones are too small for the plan, larger
    // ones for a chunk or for the result.
    for block_count in [1, 2, 4, 8, 16, 24, 32] {
        let test_folder = fresh_folder();
        let limit_script = format!("ulimit -f {block_count}; exec \"$@\"");
        let run_output =
            output_of(&mut test_folder.run_command_under(&["sh", "-c", &limit_script, "sh"]));
        if !run_output.status.success() {
            limited_count += 1;
            assert_error_message(&run_output, block_count);
            assert!(
                all_output(&run_output).contains("a file-size limit was hit"),
                "{block_count} blocks: {}",
                all_output(&run_output)
            );
        }
        test_folder.assert_recovers(&format!("{block_count} blocks"));
    }
    assert!(limited_count >= 3, "only {limited_count} limits were met");
}

#[test]
fn a_flipped_bit_and_a_truncation_are_errors_and_repaired() {
    let assert_damage_is_repaired = |damage: &dyn Fn(&mut Vec<u8>)| {
        let test_folder = fresh_folder();
        let shard_output = output_of(test_folder.run_command().args(["--shard", "1/2"]));
        assert!(shard_output.status.success(), "{}", all_output(&shard_output));
        let part_path = test_folder.partial_folder().join("part-00000002.parquet");
        let mut bytes = fs::read(&part_path).expect("the first shard has the third chunk");
        damage(&mut bytes);
        fs::write(&part_path, bytes).expect("the part is broken");
        let run_output = output_of(&mut test_folder.run_command());
        assert!(run_output.status.success(), "{}", all_output(&run_output));
        assert!(
            all_output(&run_output).contains("part-00000002.parquet.damaged"),
            "{}",
            all_output(&run_output)
        );
        assert!(fs::read(test_folder.output_path()).expect("a result") == undisturbed_bytes());
    };
    assert_damage_is_repaired(&|bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
    });
    assert_damage_is_repaired(&|bytes| bytes.truncate(bytes.len() - 1));
    assert_damage_is_repaired(&Vec::clear);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_system_without_random_numbers_is_an_error() {
    for error_name in ["ENOSYS", "ENOLCK", "EIO"] {
        let test_folder = fresh_folder();
        let injection = format!("inject=getrandom:error={error_name}");
        let run_output =
            output_of(&mut test_folder.run_command_with_faults(&["trace=getrandom", &injection]));
        let text = all_output(&run_output);
        assert!(!text.contains("panicked"), "{error_name}: {text}");
        // The program may use another source if the call does not exist.
        let has_message = text.contains("cannot draw random numbers for this process");
        assert!(run_output.status.success() || has_message, "{error_name}: {text}");
        test_folder.assert_recovers(error_name);
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_second_run_names_the_process_of_the_first_unless_it_was_killed() {
    let test_folder = fresh_folder();
    let mut first_run = spawn_delayed_run(&test_folder, 3);
    let process = process_with_first_chunk(&test_folder);
    let second_output = output_of(&mut test_folder.run_command());
    assert_eq!(second_output.status.code(), Some(75), "{}", all_output(&second_output));
    assert!(
        all_output(&second_output).contains(&format!("process {process} on ")),
        "{}",
        all_output(&second_output)
    );
    assert!(first_run.wait().expect("a child can be waited for").success());
    test_folder.assert_recovers("two runners");

    let test_folder = fresh_folder();
    let mut first_run = spawn_delayed_run(&test_folder, 30);
    send_signal("KILL", process_with_first_chunk(&test_folder));
    first_run.wait().expect("a child can be waited for");
    test_folder.assert_recovers("a killed runner");
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_signal_keeps_completed_chunks() {
    for (name, code) in [("TERM", 143), ("INT", 130)] {
        let test_folder = fresh_folder();
        let run_child = spawn_delayed_run(&test_folder, 1);
        send_signal(name, process_with_first_chunk(&test_folder));
        let run_output = run_child.wait_with_output().expect("a child can be waited for");
        assert_eq!(run_output.status.code(), Some(code), "{}", all_output(&run_output));
        assert!(
            all_output(&run_output).contains("of 40 points kept"),
            "{}",
            all_output(&run_output)
        );
        assert!(!test_folder.output_path().exists());
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
    let mut run_child =
        test_folder.run_command().stderr(full_pipe).spawn().expect("the command starts");
    let start_instant = Instant::now();
    while !test_folder.partial_folder().join("plan.json").exists() {
        assert!(start_instant.elapsed() < Duration::from_secs(60), "no run starts");
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(500));
    send_signal("TERM", run_child.id());
    std::thread::sleep(Duration::from_millis(500));
    assert!(
        run_child.try_wait().expect("a child can be asked").is_none(),
        "the first signal lets it say what is kept"
    );
    let second_signal_instant = Instant::now();
    send_signal("TERM", run_child.id());
    assert_eq!(run_child.wait().expect("a child can be waited for").code(), Some(143));
    assert!(
        second_signal_instant.elapsed() < Duration::from_secs(10),
        "it stayed for {:?}",
        second_signal_instant.elapsed()
    );
    assert!(!test_folder.output_path().exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_an_error() {
    let test_folder = fresh_folder();
    let blocked_path = test_folder.path("g.toml/sub/x.parquet");
    let run_words = test_folder.run_words();
    let run_output = output_of(
        test_folder.command_under(&[]).args(&run_words[..run_words.len() - 1]).arg(&blocked_path),
    );
    assert_eq!(run_output.status.code(), Some(1), "{}", all_output(&run_output));
    assert!(
        all_output(&run_output).contains("or give another path"),
        "{}",
        all_output(&run_output)
    );
    assert!(Path::new(&test_folder.path("g.toml")).is_file());
}

#[test]
#[ignore = "needs unshare and mount; .ci/run runs it"]
fn a_read_only_folder_is_an_error_and_the_run_continues_once_it_is_writable() {
    let test_folder = fresh_folder();
    let mount_point = test_folder.path("disk");
    fs::create_dir(&mount_point).expect("a mount point");
    let result_path = test_folder.output_path();
    let run_line = test_folder
        .shell_line()
        .replace(result_path.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet");
    // A read-only mount stops root too, which permissions do not.
    let script = format!(
        "set -eu\n\
         mount -t tmpfs -o size=16m none \"$1\"\n\
         '{run_line}' --shard 1/2\n\
         mount -o remount,ro \"$1\"\n\
         code=0; '{run_line}' || code=$?\n\
         echo \"read-only $code\"\n\
         mount -o remount,rw \"$1\"\n\
         '{run_line}'\n\
         cp \"$1/x.parquet\" \"$2\"\n"
    );
    let mut command = Command::new("unshare");
    command.args(["--map-root-user", "--mount", "sh", "-c", &script, "sh"]);
    command.args([mount_point.as_os_str(), test_folder.path("result").as_os_str()]);
    let run_output = output_of(&mut command);
    assert!(run_output.status.success(), "{}", all_output(&run_output));
    assert!(
        String::from_utf8_lossy(&run_output.stdout).contains("read-only 1"),
        "{}",
        all_output(&run_output)
    );
    assert!(
        all_output(&run_output).contains("give this user the right to it"),
        "{}",
        all_output(&run_output)
    );
    assert!(fs::read(test_folder.path("result")).expect("a result") == undisturbed_bytes());
}

#[test]
fn failed_points_are_rows_and_fail_the_run_only_on_request() {
    let test_folder = fresh_folder();
    // The softest springs cannot carry the machine.
    let spring_axis =
        "[[axis]]\nparameter = \"spring_stiffness_n_per_m\"\nvalues = [1, 7000]\n[reliability]";
    fs::write(test_folder.path("g.toml"), grid_text(5, 8).replace("[reliability]", spring_axis))
        .expect("the grid is written");
    let run_output = output_of(&mut test_folder.run_command());
    assert_eq!(run_output.status.code(), Some(0), "{}", all_output(&run_output));
    assert!(
        all_output(&run_output).contains("failed  40 no_equilibrium"),
        "{}",
        all_output(&run_output)
    );
    // Every command with rows says why.
    let stability_output =
        test_folder.run_sweep(&["stability", "g.toml", "--speed", "100", "--out", "p.parquet"]);
    for summary in [&run_output, &stability_output].map(all_output) {
        assert!(summary.contains("    reason  no_equilibrium at "), "{summary}");
        assert!(summary.contains("the machine has no stable static equilibrium"), "{summary}");
    }
    // Rows of an earlier run count too.
    for fresh_option in [&[] as &[&str], &["--fresh"]] {
        let run_output =
            output_of(test_folder.run_command().arg("--fail-on-error").args(fresh_option));
        assert_eq!(
            run_output.status.code(),
            Some(3),
            "{fresh_option:?}: {}",
            all_output(&run_output)
        );
    }
    // A shard reports its own rows, and the merge all rows.
    let output_with_result = |command_words: &[&str]| {
        test_folder.run_sweep(&[command_words, &["g.toml", "--out", "s.parquet"]].concat())
    };
    for (command_words, exit_code) in [
        (&["run", "--shard", "1/2", "--fail-on-error"][..], 3),
        (&["run", "--shard", "2/2"], 0),
        (&["merge", "--fail-on-error"], 3),
        (&["merge"], 0),
    ] {
        let command_output = output_with_result(command_words);
        assert_eq!(
            command_output.status.code(),
            Some(exit_code),
            "{command_words:?}: {}",
            all_output(&command_output)
        );
        assert!(
            all_output(&command_output).contains(" no_equilibrium"),
            "{command_words:?}: {}",
            all_output(&command_output)
        );
    }
    let idle_shard_output =
        test_folder.run_sweep(&["run", "g.toml", "--shard", "12/12", "--out", "t.parquet"]);
    let idle_message = "with 10 chunks of 8 points, the run leaves 2 of the 12 shards without work";
    assert!(
        all_output(&idle_shard_output).contains(idle_message),
        "{}",
        all_output(&idle_shard_output)
    );
    let check_output = test_folder.run_sweep(&["check", "g.toml"]);
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
        test_folder.run_sweep(&["check", "g.toml", "--at", "spring_stiffness_n_per_m=1"]);
    assert_eq!(check_output.status.code(), Some(1), "{}", all_output(&check_output));
    let unknown_duration_text = "takes       not known: none of the ";
    assert!(
        all_output(&check_output).contains(unknown_duration_text),
        "{}",
        all_output(&check_output)
    );
    let complete_output = output_of(fresh_folder().run_command().arg("--fail-on-error"));
    assert_eq!(complete_output.status.code(), Some(0), "{}", all_output(&complete_output));
}
