//! `sweep slurm GRID.toml --shards N` prints the script that submits a sweep to a Slurm cluster.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::plan::Plan;
use sweep_engine::commands::grid::{ResultArgs, quote_for_shell};
use sweep_engine::store::{ShardRequest, note_idle_shards};
use sweep_engine::{Error, Exit, print, tell};

/// Maximum number of tasks of a Slurm array, above which a note is printed. Basis: Slurm's default
/// `MaxArraySize` of 1001, which counts from 0. Doubling it omits the note where it is needed.
const MAX_ARRAY_TASKS: u64 = 1000;

/// Arguments of `sweep slurm`.
#[derive(Debug, clap::Args)]
pub struct SlurmArgs {
    #[command(flatten)]
    target: ResultArgs,
    /// Number of parts that are computed side by side, each a task of the array
    #[arg(long, value_name = "N", value_parser = parse_shards)]
    shards: u64,
    /// Time limit of a task, as sbatch takes it: 30 (minutes), 4:00:00, 2-12
    #[arg(long, value_name = "TIME", value_parser = parse_word)]
    time: Option<String>,
    /// Partition to run in
    #[arg(long, value_name = "NAME", value_parser = parse_word)]
    partition: Option<String>,
    /// Account to charge
    #[arg(long, value_name = "NAME", value_parser = parse_word)]
    account: Option<String>,
    /// Cores a task, and so its threads
    #[arg(long, value_name = "N", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=4096))]
    cpus_per_task: u32,
    /// Memory a task, as sbatch takes it: 500M, 2G
    #[arg(long, value_name = "SIZE", value_parser = parse_word)]
    mem: Option<String>,
    /// Anything else for sbatch, after `--`: `-- --constraint=avx512 --qos=long`
    #[arg(last = true, value_name = "SBATCH OPTION", value_parser = parse_word)]
    sbatch: Vec<String>,
}

fn parse_shards(text: &str) -> Result<u64, String> {
    match format!("auto/{text}").parse() {
        Ok(ShardRequest::Auto { count }) => Ok(count),
        _ => Err(format!("expected a number of shards from 1 to 1000000; got `{text}`")),
    }
}

/// Parses a word of a command line, which must fit on one line of a script.
fn parse_word(text: &str) -> Result<String, String> {
    if text.is_empty() || text.chars().any(char::is_control) {
        return Err("expected a text on one line".into());
    }
    Ok(text.to_owned())
}

/// Prints the script.
///
/// # Errors
/// Returns an error for mistakes in the grid file, if the working folder or the program has no
/// path, and if standard output cannot be written.
pub(crate) fn run(args: &SlurmArgs) -> Result<Exit, Error> {
    let plan: Plan = args.target.grid.load()?;
    let path_error = |description: &'static str| {
        move |source| Error::File { action: "find the path of", path: description.into(), source }
    };
    let folder = std::env::current_dir().map_err(path_error("the working folder"))?;
    let program = std::env::current_exe().map_err(path_error("this program"))?;
    check_names(args, &folder, &program)?;
    note_idle_shards(plan.points(), args.shards).iter().for_each(|note| tell(note));
    if args.shards > MAX_ARRAY_TASKS {
        tell(
            "note: many clusters allow arrays of 1000 tasks (scontrol show config | grep \
             MaxArraySize); more --cpus-per-task need fewer shards",
        );
    }
    print(&format_script(args, &plan, &folder, &program))
}

/// Checks that a script can hold all names. A line break in one would end a here-document early,
/// and the shell would run the rest of the name.
///
/// # Errors
/// Returns an error for a name with control characters or not in UTF-8.
fn check_names(args: &SlurmArgs, folder: &Path, program: &Path) -> Result<(), Error> {
    let ResultArgs { grid, out } = &args.target;
    let paths = [
        ("GRID.toml", Some(grid.grid.as_path())),
        ("--out", out.as_deref()),
        ("the working folder", Some(folder)),
        ("the path of this program", Some(program)),
    ];
    let paths = paths.into_iter().filter_map(|(name, path)| Some((name, path?.as_os_str())));
    let set_texts = grid.sets.iter().map(|set| ("--set", OsStr::new(set)));
    let at_texts = grid.at.iter().map(|at| ("--at", OsStr::new(at)));
    for (option, name) in paths.chain(set_texts).chain(at_texts) {
        if name.to_str().is_none_or(|name| parse_word(name).is_err()) {
            let expected = "a name in UTF-8 without control characters, as a script needs";
            return Err(Error::option(option, format!("{name:?}"), expected));
        }
    }
    Ok(())
}

/// Returns the script, which submits the array and the merge that waits for it.
fn format_script(args: &SlurmArgs, plan: &Plan, folder: &Path, program: &Path) -> String {
    let output = args.target.output(plan);
    let results_folder = match output.parent() {
        Some(parent) if parent != Path::new("") => parent.to_path_buf(),
        _ => PathBuf::from("."),
    };
    // sbatch reads % as the start of a field.
    let log_name = |field: &str| {
        let stem = results_folder.join(&plan.name).display().to_string().replace('%', "%%");
        quote_pattern(&format!("{stem}.slurm-{field}.log"))
    };
    // `command` begins with the program's bare name; on a node only its path is sure to be found.
    let program = quote_for_shell(&program.display().to_string());
    let command_text = |verb: &str| args.target.command(verb).replacen("sweep", &program, 1);
    let SlurmArgs { time, partition, account, mem, .. } = args;
    let named_options =
        [("time", time), ("partition", partition), ("account", account), ("mem", mem)];
    let named_options =
        named_options.into_iter().filter_map(|(option, value)| Some((option, value.as_ref()?)));
    let named_options =
        named_options.map(|(option, value)| format!(" --{option}={}", quote_for_shell(value)));
    let further_options = args.sbatch.iter().map(|option| format!(" {}", quote_for_shell(option)));
    let common_options: String = named_options.chain(further_options).collect();
    format!(
        include_str!("slurm.sh"),
        name = quote_for_shell(&plan.name),
        folder = quote_for_shell(&folder.display().to_string()),
        results = quote_for_shell(&results_folder.display().to_string()),
        shards = args.shards,
        cpus = args.cpus_per_task,
        array_log = log_name("%A_%a"),
        merge_log = log_name("merge-%j"),
        run = command_text("run"),
        merge = command_text("merge"),
        common = common_options,
    )
}

/// Returns a pattern of file names, quoted for a shell if another character than `%` needs it.
fn quote_pattern(pattern: &str) -> String {
    let pattern_without_fields = pattern.replace('%', "");
    if quote_for_shell(&pattern_without_fields) == pattern_without_fields {
        pattern.to_owned()
    } else {
        quote_for_shell(pattern)
    }
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};

    use clap::Parser;

    use super::*;

    #[derive(clap::Parser)]
    struct SlurmCli {
        #[command(flatten)]
        args: SlurmArgs,
    }

    fn parse_words(words: &[&str]) -> Result<SlurmArgs, clap::Error> {
        SlurmCli::try_parse_from([&["slurm"], words].concat()).map(|line| line.args)
    }

    /// Runs a script, with a program in place of sbatch that records its calls. Returns the lines
    /// of all arguments and batch scripts, and the script's output.
    fn run_script(script: &str, arguments: &[&str], folder: &Path) -> (Vec<String>, String) {
        use std::io::Write;
        let bin_folder = folder.join("bin");
        std::fs::create_dir_all(&bin_folder).unwrap();
        let calls_path = folder.join("calls");
        let fake_sbatch = format!(
            "#!/bin/sh\nprintf '%s\\n' \"$@\" >> {0}\ncat >> {0}\necho '17;cluster'\n",
            calls_path.display()
        );
        std::fs::write(bin_folder.join("sbatch"), fake_sbatch).unwrap();
        std::fs::set_permissions(
            bin_folder.join("sbatch"),
            std::os::unix::fs::PermissionsExt::from_mode(0o755),
        )
        .unwrap();
        let path = format!("{}:{}", bin_folder.display(), std::env::var("PATH").unwrap());
        let mut shell = Command::new("sh")
            .args([&["-s", "--"], arguments].concat())
            .env("PATH", path)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        shell.stdin.take().unwrap().write_all(script.as_bytes()).unwrap();
        let output = shell.wait_with_output().unwrap();
        assert!(output.status.success());
        let recorded_calls = std::fs::read_to_string(calls_path).unwrap();
        (
            recorded_calls.lines().map(str::to_owned).collect(),
            String::from_utf8(output.stdout).unwrap(),
        )
    }

    #[test]
    fn a_script_submits_the_right_commands_even_with_names_that_need_quotes() {
        let home = tempfile::tempdir().unwrap();
        let grid_path = home.path().join("it's a grid.toml");
        let grid_text = "name = \"half.of-it\"\n[spin]\nprofile = \"triangular\"\npeak_rpm = \
                    350\nramp_s = 50\n[time]\nend_s = 50\n";
        std::fs::write(&grid_path, grid_text).unwrap();
        let grid_name = grid_path.to_str().unwrap();
        let args = parse_words(&[
            grid_name,
            "--shards",
            "8",
            "--set",
            "tub_mass_kg=20",
            "--time",
            "1:00:00",
            "--cpus-per-task",
            "4",
            "--mem",
            "1G",
            "--",
            "--comment=two words",
        ])
        .unwrap();
        let plan = args.target.grid.load().unwrap();
        let script = format_script(&args, &plan, home.path(), Path::new("/opt/my sweep"));
        let (calls, output) = run_script(&script, &["--array=3,7"], home.path());
        assert_eq!(output, "array 17, merge 17\n");
        let position_of = |expected: &str| {
            calls
                .iter()
                .position(|line| line == expected)
                .unwrap_or_else(|| panic!("no {expected} in\n{}", calls.join("\n")))
        };
        assert!(position_of("--array=1-8") < position_of("--array=3,7"), "the later one counts");
        for expected in [
            "--job-name=half.of-it",
            "--cpus-per-task=4",
            "--requeue",
            "--time=1:00:00",
            "--mem=1G",
            "--comment=two words",
        ] {
            position_of(expected);
        }
        position_of("--output=results/half.of-it.slurm-%A_%a.log");
        position_of("--dependency=afterany:17");
        let quoted_grid = grid_name.replace('\'', r"'\''");
        position_of(&format!(
            "exec '/opt/my sweep' run '{quoted_grid}' --set tub_mass_kg=20 \
             --shard \"$SLURM_ARRAY_TASK_ID/8\""
        ));
        position_of(&format!("exec '/opt/my sweep' merge '{quoted_grid}' --set tub_mass_kg=20"));
        assert!(home.path().join("results").is_dir(), "Slurm creates no folder for its logs");
    }

    #[test]
    fn names_with_line_breaks_are_refused() {
        use std::os::unix::ffi::OsStrExt;
        let is_accepted = |words: &[&str], folder: &[u8], program: &str| {
            let args = parse_words(&[words, &["--shards", "2"]].concat()).unwrap();
            check_names(&args, Path::new(OsStr::from_bytes(folder)), Path::new(program)).is_ok()
        };
        assert!(is_accepted(&["it's $(a) `grid`.toml", "--out", "ü x.parquet"], b"/a b", "/sweep"));
        let broken_name = "x\nEND\ntouch /tmp/out\n.toml";
        assert!(!is_accepted(&[broken_name], b"/", "/sweep"));
        assert!(!is_accepted(&["g.toml", "--out", broken_name], b"/", "/sweep"));
        assert!(!is_accepted(&["g.toml", "--set", broken_name], b"/", "/sweep"));
        assert!(!is_accepted(&["g.toml"], broken_name.as_bytes(), "/sweep"));
        assert!(!is_accepted(&["g.toml"], b"/", broken_name));
        assert!(!is_accepted(&["g.toml"], b"/\xff", "/sweep"), "a lossy name is another one");
        assert!(!is_accepted(&["g.toml", "--out", "a\r.parquet"], b"/", "/sweep"));
    }

    #[test]
    fn wrong_options_are_refused() {
        for words in [
            &["g.toml"] as &[&str],
            &["g.toml", "--shards", "0"],
            &["g.toml", "--shards", "x"],
            &["g.toml", "--shards", "8", "--cpus-per-task", "0"],
            &["g.toml", "--shards", "8", "--time", "1\n2"],
        ] {
            assert!(parse_words(words).is_err(), "{words:?}");
        }
    }
}
