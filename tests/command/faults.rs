//! Whatever happens to a run, running it again ends in the undisturbed run's bytes.
//!
//! Drives the real binary on a small grid. Tests that tamper with system calls need strace, those
//! of a disk that fills up or is read-only need to mount one: they are ignored unless asked for.

#![cfg(target_os = "linux")]

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use crate::home::{Home, grid, said, sweep_binary};
use crate::signal;

/// Five chunks of eight points.
fn fresh_home() -> Home {
    Home::new(&grid(5, 8))
}

impl Home {
    fn output(&self) -> PathBuf {
        self.path("x.parquet")
    }

    fn partial(&self) -> PathBuf {
        self.path("x.parquet.partial")
    }

    /// The words of a run: one thread, so that which call is the third does not depend on luck.
    /// Paths are absolute, as messages are to show them.
    fn words(&self) -> Vec<String> {
        let [grid, output] = [self.path("g.toml"), self.output()].map(text);
        ["run", &grid, "--threads", "1", "--out", &output].map(str::to_owned).to_vec()
    }

    /// A run as a shell takes it, between two single quotes.
    fn line(&self) -> String {
        [vec![text(sweep_binary())], self.words()].concat().join("' '")
    }

    fn run(&self) -> Command {
        self.run_under(&[])
    }

    /// A run behind another program's command line.
    fn run_under(&self, wrapper: &[&str]) -> Command {
        let mut command = self.under(wrapper);
        command.args(self.words());
        command
    }

    /// A run in which strace tampers with system calls.
    fn tampered(&self, tamper: &[&str]) -> Command {
        let mut wrapper = vec!["strace", "-f", "-qq", "-o", "/dev/null"];
        for tamper in tamper {
            wrapper.extend(["-e", tamper]);
        }
        self.run_under(&wrapper)
    }

    /// Whatever stands at the output is whole, and one more run makes it so if nothing does.
    fn assert_mends(&self, after: &str) {
        if let Ok(bytes) = fs::read(self.output()) {
            assert!(bytes == undisturbed(), "{after}: a broken result stands at the output");
        }
        let again = output(&mut self.run());
        assert_eq!(again.status.code(), Some(0), "{after}: {}", said(&again));
        let bytes = fs::read(self.output()).expect("a finished run has an output");
        assert!(bytes == undisturbed(), "{after}: other bytes than the undisturbed run's");
        assert!(!self.partial().exists(), "{after}: the folder stays behind");
    }
}

fn text(path: PathBuf) -> String {
    path.into_os_string().into_string().expect("temporary folders are UTF-8")
}

/// The bytes of a run that nothing happens to.
fn undisturbed() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let home = fresh_home();
        let done = output(&mut home.run());
        assert!(done.status.success(), "{}", said(&done));
        fs::read(home.output()).expect("a finished run has an output")
    })
}

fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| missing(command, &error))
}

fn spawn(command: &mut Command) -> Child {
    command.stderr(Stdio::piped()).spawn().unwrap_or_else(|error| missing(command, &error))
}

fn missing<T>(command: &Command, error: &std::io::Error) -> T {
    panic!(
        "{:?} does not start ({error}): scripts/tools/install_test_tools.sh installs what \
         tests need",
        command.get_program()
    )
}

/// The process that holds the run, once it has computed something.
fn holder_with_chunk(home: &Home) -> u32 {
    let started = Instant::now();
    loop {
        let lock = fs::read_to_string(home.partial().join("lock")).unwrap_or_default();
        let chunks = home.partial().join("part-00000000.parquet").exists();
        if let (true, Some(process)) =
            (chunks, lock.split(' ').next().and_then(|word| word.parse().ok()))
        {
            return process;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "no run starts: lock `{lock}`");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Holds a run up, for some seconds, between its first chunk and its last.
fn held_up(home: &Home, seconds: u32) -> Child {
    // Syncs: the plan and its folder, then each chunk and its folder; the sixth is the second
    // chunk's folder.
    let delay = format!("inject=fsync:delay_enter={seconds}s:when=6");
    spawn(&mut home.tampered(&["trace=fsync", &delay]))
}

#[test]
fn killed_at_thirty_random_instants() {
    undisturbed();
    let home = fresh_home();
    let started = Instant::now();
    assert!(output(&mut home.run()).status.success());
    let whole = started.elapsed();
    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut killed = 0;
    for round in 0.. {
        let home = fresh_home();
        // Each kill meets what the ones before left.
        for _ in 0..6 {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let mut run = spawn(&mut home.run());
            std::thread::sleep(whole.mul_f64((random % 1000) as f64 / 1000.0));
            // It may have ended by itself.
            let _ = run.kill();
            let status = run.wait().expect("a child can be waited for");
            killed += u32::from(status.code().is_none());
        }
        home.assert_mends(&format!("round {round}"));
        if killed >= 30 {
            return;
        }
        assert!(round < 40, "only {killed} of {} kills met a run", 6 * round);
    }
}

/// Tampers with the first, second, ... call of some system calls, until a run has fewer of them.
fn at_every_call(calls: &str, what: &str, check: impl Fn(&Output, u32)) {
    for when in 1.. {
        let home = fresh_home();
        let tamper = format!("inject={calls}:{what}:when={when}");
        let run = output(&mut home.tampered(&[&format!("trace={calls}"), &tamper]));
        let untouched = run.status.success();
        check(&run, when);
        home.assert_mends(&format!("{what} at {calls} {when}"));
        if untouched {
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
        assert!(run.status.code() != Some(1), "write {when}: {}", said(run));
    });
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_fsync() {
    at_every_call("fsync", "signal=SIGKILL", |run, when| {
        assert!(run.status.code() != Some(1), "fsync {when}: {}", said(run));
    });
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn killed_at_every_rename() {
    at_every_call(RENAMES, "signal=SIGKILL", |run, when| {
        assert!(run.status.code() != Some(1), "rename {when}: {}", said(run));
    });
}

/// A failed call is a message with the path (the result's, its folder's or its sidecar's) and what
/// to do, and exit code 1.
fn told(run: &Output, when: u32) {
    let said = said(run);
    let folder = std::env::temp_dir();
    let folder = folder.to_str().expect("temporary folders are UTF-8");
    if !run.status.success() {
        assert_eq!(run.status.code(), Some(1), "call {when}: {said}");
        assert!(said.contains(folder) && said.contains("= help: "), "call {when}: {said}");
        assert!(!said.contains("panicked"), "call {when}: {said}");
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn io_error_at_every_fsync() {
    at_every_call("fsync", "error=EIO", told);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn io_error_at_every_rename() {
    at_every_call(RENAMES, "error=EIO", told);
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn disk_full_at_every_write() {
    at_every_call("write", "error=ENOSPC", told);
}

#[test]
#[ignore = "needs unshare and mount; .ci/run runs it"]
fn a_disk_too_small_is_told_and_a_larger_one_is_gone_on_with() {
    let home = fresh_home();
    let run = home.line();
    let out = home.output();
    // The file system lives in a name space of its own and goes with it; only the result leaves.
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
    let mut full = 0;
    for pages in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16] {
        let disk = home.path("disk");
        let result = home.path("result");
        fs::create_dir_all(&disk).expect("a mount point");
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--mount", "sh", "-c", &script, "sh"]);
        command.args([disk.as_os_str(), pages.to_string().as_ref(), result.as_os_str()]);
        let run = output(&mut command);
        let said = said(&run);
        assert!(run.status.success(), "{pages} pages: {said}");
        let first = String::from_utf8_lossy(&run.stdout).into_owned();
        if first.contains("first 1") {
            full += 1;
            assert!(said.contains("the disk is full: free some space"), "{pages} pages: {said}");
        } else {
            assert!(first.contains("first 0"), "{pages} pages: {first} {said}");
        }
        assert!(
            fs::read(&result).expect("a result") == undisturbed(),
            "{pages} pages: other bytes"
        );
    }
    assert!(full >= 4, "only {full} disks were too small");
}

#[test]
fn a_file_size_limit_is_told_and_gone_on_from() {
    let mut limited = 0;
    // Blocks of 512 bytes: too small for the plan, for a chunk, for the result.
    for blocks in [1, 2, 4, 8, 16, 24, 32] {
        let home = fresh_home();
        let limit = format!("ulimit -f {blocks}; exec \"$@\"");
        let run = output(&mut home.run_under(&["sh", "-c", &limit, "sh"]));
        if !run.status.success() {
            limited += 1;
            told(&run, blocks);
            assert!(
                said(&run).contains("a file-size limit was hit"),
                "{blocks} blocks: {}",
                said(&run)
            );
        }
        home.assert_mends(&format!("{blocks} blocks"));
    }
    assert!(limited >= 3, "only {limited} limits were met");
}

#[test]
fn a_flipped_bit_and_a_truncation_are_told_and_mended() {
    let break_part = |change: &dyn Fn(&mut Vec<u8>)| {
        let home = fresh_home();
        let shard = output(home.run().args(["--shard", "1/2"]));
        assert!(shard.status.success(), "{}", said(&shard));
        let part = home.partial().join("part-00000002.parquet");
        let mut bytes = fs::read(&part).expect("the first shard has the third chunk");
        change(&mut bytes);
        fs::write(&part, bytes).expect("the part is broken");
        let run = output(&mut home.run());
        assert!(run.status.success(), "{}", said(&run));
        assert!(said(&run).contains("part-00000002.parquet.damaged"), "{}", said(&run));
        assert!(fs::read(home.output()).expect("a result") == undisturbed());
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
fn a_system_without_random_numbers_is_told() {
    for error in ["ENOSYS", "ENOLCK", "EIO"] {
        let home = fresh_home();
        let inject = format!("inject=getrandom:error={error}");
        let run = output(&mut home.tampered(&["trace=getrandom", &inject]));
        let text = said(&run);
        assert!(!text.contains("panicked"), "{error}: {text}");
        // Another source may take the place of a call that is not there.
        let is_told = text.contains("cannot draw random numbers for this process");
        assert!(run.status.success() || is_told, "{error}: {text}");
        home.assert_mends(error);
    }
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_second_runner_is_sent_away_with_the_first_ones_process_and_a_killed_one_blocks_nobody() {
    let home = fresh_home();
    let mut first = held_up(&home, 3);
    let process = holder_with_chunk(&home);
    let second = output(&mut home.run());
    assert_eq!(second.status.code(), Some(75), "{}", said(&second));
    assert!(said(&second).contains(&format!("process {process} on ")), "{}", said(&second));
    assert!(first.wait().expect("a child can be waited for").success());
    home.assert_mends("two runners");

    let home = fresh_home();
    let mut first = held_up(&home, 30);
    signal("KILL", holder_with_chunk(&home));
    first.wait().expect("a child can be waited for");
    home.assert_mends("a killed runner");
}

#[test]
#[ignore = "needs strace; .ci/run runs it"]
fn a_signal_keeps_what_is_done() {
    for (name, code) in [("TERM", 143), ("INT", 130)] {
        let home = fresh_home();
        let run = held_up(&home, 1);
        signal(name, holder_with_chunk(&home));
        let run = run.wait_with_output().expect("a child can be waited for");
        assert_eq!(run.status.code(), Some(code), "{}", said(&run));
        assert!(said(&run).contains("of 40 points kept"), "{}", said(&run));
        assert!(!home.output().exists());
        home.assert_mends(name);
    }
}

#[test]
fn a_second_signal_leaves_at_once() {
    // Nobody reads what the run says, and no more fits into the pipe: with its answer to the first
    // signal it waits there.
    const PIPE_BYTES: usize = 1 << 16;
    let (_reader, mut full) = std::io::pipe().expect("a pipe can be made");
    full.write_all(&[b' '; PIPE_BYTES]).expect("a pipe takes as much");
    let home = fresh_home();
    home.choose_for_seconds();
    let mut run = home.run().stderr(full).spawn().expect("the command starts");
    let begun = Instant::now();
    while !home.partial().join("plan.json").exists() {
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
    assert!(!home.output().exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_told() {
    let home = fresh_home();
    let blocked = home.path("g.toml/sub/x.parquet");
    let words = home.words();
    let run = output(home.under(&[]).args(&words[..words.len() - 1]).arg(&blocked));
    assert_eq!(run.status.code(), Some(1), "{}", said(&run));
    assert!(said(&run).contains("or give another path"), "{}", said(&run));
    assert!(Path::new(&home.path("g.toml")).is_file());
}

#[test]
#[ignore = "needs unshare and mount; .ci/run runs it"]
fn a_read_only_folder_is_told_and_gone_on_with_when_it_is_not() {
    let home = fresh_home();
    let disk = home.path("disk");
    fs::create_dir(&disk).expect("a mount point");
    let out = home.output();
    let run = home.line().replace(out.to_str().expect("UTF-8"), "'\"$1\"'/x.parquet");
    // For root too, which permissions do not stop.
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
    command.args([disk.as_os_str(), home.path("result").as_os_str()]);
    let run = output(&mut command);
    assert!(run.status.success(), "{}", said(&run));
    assert!(String::from_utf8_lossy(&run.stdout).contains("read-only 1"), "{}", said(&run));
    assert!(said(&run).contains("give this user the right to it"), "{}", said(&run));
    assert!(fs::read(home.path("result")).expect("a result") == undisturbed());
}

#[test]
fn failed_points_are_rows_and_fail_the_run_only_when_asked() {
    let home = fresh_home();
    // Springs from too soft to carry the machine to its own.
    let axis =
        "[[axis]]\nparameter = \"spring_stiffness_n_per_m\"\nvalues = [1, 7000]\n[reliability]";
    fs::write(home.path("g.toml"), grid(5, 8).replace("[reliability]", axis))
        .expect("the grid is written");
    let run = output(&mut home.run());
    assert_eq!(run.status.code(), Some(0), "{}", said(&run));
    assert!(said(&run).contains("failed  40 no_equilibrium"), "{}", said(&run));
    // Rows that are there already count too.
    for fresh in [&[] as &[&str], &["--fresh"]] {
        let run = output(home.run().arg("--fail-on-error").args(fresh));
        assert_eq!(run.status.code(), Some(3), "{fresh:?}: {}", said(&run));
    }
    // A shard speaks of its own rows, and the merge of all.
    let sharded = |words: &[&str]| home.sweep(&[words, &["g.toml", "--out", "s.parquet"]].concat());
    for (words, code) in [
        (&["run", "--shard", "1/2", "--fail-on-error"][..], 3),
        (&["run", "--shard", "2/2"], 0),
        (&["merge", "--fail-on-error"], 3),
        (&["merge"], 0),
    ] {
        let done = sharded(words);
        assert_eq!(done.status.code(), Some(code), "{words:?}: {}", said(&done));
        assert!(said(&done).contains(" no_equilibrium"), "{words:?}: {}", said(&done));
    }
    let last = home.sweep(&["run", "g.toml", "--shard", "12/12", "--out", "t.parquet"]);
    let idle = "with 10 chunks of 8 points, the run leaves 2 of the 12 shards without work";
    assert!(said(&last).contains(idle), "{}", said(&last));
    let checked = home.sweep(&["check", "g.toml"]);
    assert!(said(&checked).contains(" no_equilibrium, of "), "{}", said(&checked));
    let whole = output(fresh_home().run().arg("--fail-on-error"));
    assert_eq!(whole.status.code(), Some(0), "{}", said(&whole));
}
