//! A folder with a grid in it, in which the command runs.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// Variables by which a scheduler sets shards and threads; those of the tests' own scheduler are
/// removed.
const SCHEDULERS: [&str; 3] =
    ["SLURM_ARRAY_TASK_ID", "SLURM_CPUS_PER_TASK", "JOB_COMPLETION_INDEX"];

/// The `sweep` binary of this build, or the one that `SWEEP_BINARY` names, such as an installed
/// one.
pub(crate) fn sweep_binary() -> PathBuf {
    std::env::var_os("SWEEP_BINARY").map_or_else(|| env!("CARGO_BIN_EXE_sweep").into(), Into::into)
}

/// A grid of so many masses by so many dampings, without dampings of masses alone; its trajectories
/// are so short that the files are most of the work.
pub(crate) fn grid(masses: u32, dampings: u32) -> String {
    let axis = |name: &str, from: f64, to: f64, count: u32| {
        let range = format!("{{ from = {from:?}, to = {to:?}, count = {count} }}");
        format!("[[axis]]\nparameter = \"{name}\"\nrange = {range}\n")
    };
    let axes = [
        axis("unbalance_mass_kg", 0.05, 1.0, masses),
        if dampings > 0 { axis("damping_n_s_per_m", 60.0, 300.0, dampings) } else { String::new() },
    ];
    format!(
        "name = \"short\"\n\
         [spin]\nprofile = \"triangular\"\npeak_rpm = 350.0\nramp_s = 50.0\n\
         [time]\nend_s = 0.1\nwindow_s = [0.05, 0.1]\n\
         [integrator]\nmethod = \"rk4\"\nstep_s = 2.0e-4\n\
         {}\
         [reliability]\nratio_limit = 2.0\nchannels = [\"tub_front_y\", \"tub_yaw\"]\n",
        axes.concat()
    )
}

/// Returns the output of a command and its messages.
pub(crate) fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text)).concat()
}

/// A temporary folder; it goes with this value.
pub(crate) struct Home(TempDir);

impl Home {
    /// A folder with nothing but this grid, as `g.toml`.
    pub(crate) fn new(grid: &str) -> Self {
        let home = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::write(home.path("g.toml"), grid).expect("the grid is written");
        home
    }

    /// Puts a list of 256 machines in the grid's place: steps are chosen for all of them before the
    /// first point, which takes seconds.
    pub(crate) fn choose_for_seconds(&self) {
        let rows = (0..256).map(|k| {
            format!("{},{}\n", 0.1 + 0.9 * f64::from(k) / 255.0, 60 + 239 * (k * 37 % 256) / 255)
        });
        let list = format!("unbalance_mass_kg,damping_n_s_per_m\n{}", rows.collect::<String>());
        fs::write(self.path("list.csv"), list).expect("the list is written");
        let grid = "spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
            time = { end_s = 50 }\n\
            design = { method = \"list\", file = \"list.csv\" }\n";
        fs::write(self.path("g.toml"), grid).expect("the grid is written");
    }

    /// A path in it; of the folder itself by the empty name.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The binary behind another program's command line, or alone, in this folder and out of every
    /// scheduler's.
    pub(crate) fn under(&self, wrapper: &[&str]) -> Command {
        let mut command = match wrapper {
            [] => Command::new(sweep_binary()),
            [program, options @ ..] => {
                let mut command = Command::new(program);
                command.args(options).arg(sweep_binary());
                command
            }
        };
        for name in SCHEDULERS {
            command.env_remove(name);
        }
        command.current_dir(self.0.path());
        command
    }

    /// Runs the command with these words.
    pub(crate) fn sweep(&self, words: &[&str]) -> Output {
        self.under(&[]).args(words).output().expect("the command starts")
    }

    /// Names of all that is in it.
    #[cfg(target_os = "linux")]
    pub(crate) fn names(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).expect("the folder is there");
        let mut names: Vec<String> = names
            .map(|name| name.expect("a name").file_name().into_string().expect("UTF-8"))
            .collect();
        names.sort();
        names
    }
}
