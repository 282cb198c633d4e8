//! The commands about held speeds, `sweep stability` and `sweep dwell`, and the options by which
//! `sweep status` and `sweep merge` refer to their jobs.

use std::path::{Path, PathBuf};

use super::show::MODEL_SUMMARY;
use crate::dwell::AttractorSearch;
use crate::plan::Plan;
use crate::speeds::SpeedList;
use crate::stability::{HeldPlan, check_axes};
use sweep_engine::commands::cells::Lines as _;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{
    RunCommand, RunControlArgs, exit_code, format_counts, format_failure_reasons, install_interrupt,
};
use sweep_engine::commands::{merge, status};
use sweep_engine::store::Tally;
use sweep_engine::{Error, Exit, Job};
use sweep_files::ParquetFile;

/// Arguments of a command about held speeds. `Options` are those of the command alone.
#[derive(Debug, clap::Args)]
pub struct HeldSpeedArgs<Options: clap::Args> {
    #[command(flatten)]
    target: ResultArgs,
    /// Constant spin speeds in rpm, above 0: one, several with commas, FROM:TO:STEP
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: SpeedList,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    control: RunControlArgs,
}

/// The options of `sweep stability` alone: none.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct ResponseOptions {}

impl From<ResponseOptions> for Option<AttractorSearch> {
    fn from(_: ResponseOptions) -> Self {
        None
    }
}

/// The end of `sweep stability --help`.
pub(super) const STABILITY_LONG_HELP: &str = "\
The result has a row for every point of the grid and every speed: the periodic response of both \
models while the drum turns at that speed for ever, and the growth rate of a small disturbance of \
the nonlinear response. The spin profile, the window and the integrator of the grid file have no \
effect, except that modes of a machine with friction have the names of that run. The result is \
written to results/NAME-stability.parquet unless --out names a file.

The file is a pure function of its input, whatever the number of threads, shards and \
interruptions. An interrupted command leaves its finished rows in FILE.partial, and the same \
command continues from there.";

/// The end of `sweep dwell --help`.
pub(super) const DWELL_LONG_HELP: &str = "\
The result has a row for every point of the grid, every speed and every motion that was found \
while the drum turns at that speed. Trajectories start from the slightly disturbed periodic \
response, and from kicks: two thirds of these act on the two modes that rock most, one by one and \
together, the others act in random directions, every other one on the machine at rest. \
Trajectories are followed until their largest deviations no longer change. This is a search, not \
a proof: a motion that no start leads to is not found.

The result is written to results/NAME-dwell.parquet unless --out names a file. The file is a pure \
function of its input, whatever the number of threads, shards and interruptions. An interrupted \
command leaves its finished rows in FILE.partial, and the same command continues from there.";

impl<Options: clap::Args + Copy + Into<Option<AttractorSearch>>> HeldSpeedArgs<Options> {
    /// Finds the attractors or the periodic responses at the speeds, and prints a summary.
    ///
    /// # Errors
    /// Returns an error for mistakes in the grid file or the options, and if the file cannot be
    /// written; finished chunks are kept.
    pub(super) fn run(&self) -> Result<Exit, Error> {
        let Self { target, speed, options, control } = self;
        let search: Option<AttractorSearch> = (*options).into();
        let plan: Plan = target.grid.load()?;
        check_axes(&plan, "--speed", &speed.to_string())?;
        let held_plan = HeldPlan { plan: &plan, speeds_rpm: speed.values(), search };
        let job = held_plan.job();
        let output = held_plan.output(target.out.as_deref());
        let [speed_options, merge_options] = format_options(speed, search);
        let command = RunCommand {
            name: &plan.name,
            subcommand: held_plan.command_name(),
            row_noun: "rows",
            target,
            control,
            further_options: [&speed_options, &merge_options],
        };
        let engine = held_plan.engine()?;
        let add_summary = |text: &mut String, tally: &Tally| {
            text.push_str(&describe_content(&output)?);
            text.push_str(&format_failure_reasons(&engine, tally, &job));
            text.line("file", output.display());
            text.suggest_command("show", &output);
            Ok(())
        };
        let report =
            command.execute(&engine, &job, &output, &install_interrupt()?, &add_summary)?;
        Ok(exit_code(control, &report))
    }
}

/// Describes the content of a finished file about held speeds.
fn describe_content(output: &Path) -> Result<String, Error> {
    let mut text = String::new();
    for (name, description) in MODEL_SUMMARY.shortened_lines(&ParquetFile::open(output)?)? {
        text.line(name, description);
    }
    Ok(text)
}

/// Returns the options that repeat a command about held speeds, and those by which `merge` refers
/// to its job.
fn format_options(speed: &SpeedList, search: Option<AttractorSearch>) -> [String; 2] {
    let search_options = search.map(|search| search.to_string()).unwrap_or_default();
    let speed_options = format!(" --speed {speed}{search_options}");
    let dwell_flag = if search.is_some() { " --dwell" } else { "" };
    let merge_options = format!("{dwell_flag}{speed_options}");
    [speed_options, merge_options]
}

/// Arguments of `sweep status` or `sweep merge` (`CommandArgs`), for a run or for held speeds.
#[derive(Debug, clap::Args)]
pub struct JobArgs<CommandArgs: clap::Args> {
    #[command(flatten)]
    command: CommandArgs,
    #[command(flatten)]
    options: HeldArgs,
}

impl JobArgs<status::StatusArgs> {
    /// Shows the progress of the job, which may be running.
    ///
    /// # Errors
    /// Returns an error for mistakes in the grid file, for a folder or file of another plan, and
    /// for a file that cannot be read.
    pub(super) fn show_status(&self) -> Result<Exit, Error> {
        let target = &self.command.target;
        let plan: Plan = target.grid.load()?;
        let (job, output, resume_texts) = self.options.job(&plan, target);
        status::show_job(&self.command, &job, &output, resume_texts.each_ref().map(String::as_str))
    }
}

impl JobArgs<merge::MergeArgs> {
    /// Merges the results of the shards.
    ///
    /// # Errors
    /// Returns the errors of the engine's command.
    pub(super) fn merge(&self) -> Result<Exit, Error> {
        let target = &self.command.target;
        let plan: Plan = target.grid.load()?;
        let (job, output, _) = self.options.job(&plan, target);
        let content = |tally: &Tally| match self.options.speed {
            Some(_) => describe_content(&output),
            None => Ok(format_counts(tally, &job)),
        };
        merge::merge_job(&self.command, &plan.name, &job, &output, &content)
    }
}

/// The options by which `status` and `merge` refer to a job about held speeds.
#[derive(Debug, clap::Args)]
struct HeldArgs {
    /// The job of `sweep stability` at these speeds in rpm, written as in that command; with
    /// --dwell that of `sweep dwell`
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: Option<SpeedList>,
    /// The job of `sweep dwell`, not that of `sweep stability`
    #[arg(long, requires = "speed")]
    dwell: bool,
    #[command(flatten)]
    search: AttractorSearch,
}

impl HeldArgs {
    /// Returns the job on a plan, its output, and three texts: the command that continues it,
    /// further options of that command, and further options of `merge`.
    fn job<'a>(&'a self, plan: &'a Plan, target: &ResultArgs) -> (Job<'a>, PathBuf, [String; 3]) {
        let Some(speed) = &self.speed else {
            return (Job::new(plan), target.output(plan), ["run", "", ""].map(str::to_owned));
        };
        let search = self.dwell.then_some(self.search);
        let held_plan = HeldPlan { plan, speeds_rpm: speed.values(), search };
        let [speed_options, merge_options] = format_options(speed, search);
        let resume_texts = [held_plan.command_name().to_owned(), speed_options, merge_options];
        (held_plan.job(), held_plan.output(target.out.as_deref()), resume_texts)
    }
}
