//! A temporary folder with a grid, in which the tests run the command.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// The environment variables by which a scheduler sets shards and threads. They are removed,
/// because the tests may run under a scheduler themselves.
const SCHEDULER_VARIABLES: [&str; 3] =
    ["SLURM_ARRAY_TASK_ID", "SLURM_CPUS_PER_TASK", "JOB_COMPLETION_INDEX"];

/// Returns the path of the `sweep` binary: that of this build, or the one in `SWEEP_BINARY`.
pub(crate) fn sweep_binary() -> PathBuf {
    std::env::var_os("SWEEP_BINARY").map_or_else(|| env!("CARGO_BIN_EXE_sweep").into(), Into::into)
}

/// Returns a grid of a number of masses by a number of dampings, which may be 0. Its trajectories
/// are so short that reading and writing files takes most of the time.
pub(crate) fn grid_text(mass_count: u32, damping_count: u32) -> String {
    let axis_text = |name: &str, from: f64, to: f64, count: u32| {
        let range_text = format!("{{ from = {from:?}, to = {to:?}, count = {count} }}");
        format!("[[axis]]\nparameter = \"{name}\"\nrange = {range_text}\n")
    };
    let axis_texts = [
        axis_text("unbalance_mass_kg", 0.05, 1.0, mass_count),
        if damping_count > 0 {
            axis_text("damping_n_s_per_m", 60.0, 300.0, damping_count)
        } else {
            String::new()
        },
    ];
    format!(
        "name = \"short\"\n\
         [spin]\nprofile = \"triangular\"\npeak_rpm = 350.0\nramp_s = 50.0\n\
         [time]\nend_s = 0.1\nwindow_s = [0.05, 0.1]\n\
         [integrator]\nmethod = \"rk4\"\nstep_s = 2.0e-4\n\
         {}\
         [reliability]\nratio_limit = 2.0\nchannels = [\"tub_front_y\", \"tub_yaw\"]\n",
        axis_texts.concat()
    )
}

/// Returns standard output and standard error of a command.
pub(crate) fn all_output(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text)).concat()
}

/// A temporary folder, which is deleted with this value.
pub(crate) struct TestFolder(TempDir);

impl TestFolder {
    /// Creates a folder with a grid as `g.toml`.
    pub(crate) fn new(grid_text: &str) -> Self {
        let test_folder = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::write(test_folder.path("g.toml"), grid_text).expect("the grid is written");
        test_folder
    }

    /// Replaces the grid by a list of 256 machines. The choice of steps for all of them, before the
    /// first point, takes seconds.
    pub(crate) fn write_slow_list(&self) {
        let rows = (0..256).map(|k| {
            format!("{},{}\n", 0.1 + 0.9 * f64::from(k) / 255.0, 60 + 239 * (k * 37 % 256) / 255)
        });
        let list_text =
            format!("unbalance_mass_kg,damping_n_s_per_m\n{}", rows.collect::<String>());
        fs::write(self.path("list.csv"), list_text).expect("the list is written");
        let grid_text = "spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
            time = { end_s = 50 }\n\
            design = { method = \"list\", file = \"list.csv\" }\n";
        fs::write(self.path("g.toml"), grid_text).expect("the grid is written");
    }

    /// Returns the path of a file in the folder, or of the folder itself for an empty name.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Returns a command of the binary in this folder, alone or as the argument of another program,
    /// without the variables of schedulers.
    pub(crate) fn command_under(&self, wrapper: &[&str]) -> Command {
        let mut command = match wrapper {
            [] => Command::new(sweep_binary()),
            [program, options @ ..] => {
                let mut command = Command::new(program);
                command.args(options).arg(sweep_binary());
                command
            }
        };
        for name in SCHEDULER_VARIABLES {
            command.env_remove(name);
        }
        command.current_dir(self.0.path());
        command
    }

    /// Runs the binary with arguments.
    pub(crate) fn run_sweep(&self, words: &[&str]) -> Output {
        self.command_under(&[]).args(words).output().expect("the command starts")
    }

    /// Returns the sorted names of all files in the folder.
    #[cfg(target_os = "linux")]
    pub(crate) fn sorted_file_names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).expect("the folder is there");
        let mut file_names: Vec<String> = entries
            .map(|entry| entry.expect("a name").file_name().into_string().expect("UTF-8"))
            .collect();
        file_names.sort();
        file_names
    }
}
