//! What commands about held speeds have in common: doing it, and which job it is.

use std::path::PathBuf;

use super::show::FURTHER;
use crate::dwell::AttractorSearch;
use crate::plan::Plan;
use crate::speeds::SpeedList;
use crate::stability::{HeldPlan, check};
use sweep_engine::commands::cells::Lines as _;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{RunCommand, WorkArgs, exit, installed};
use sweep_engine::commands::{merge, status};
use sweep_engine::{Error, Exit, Job};
use sweep_files::ParquetFile;

/// Arguments of a command about held speeds, with what it asks for there.
#[derive(Debug, clap::Args)]
pub struct Args<Asked: clap::Args> {
    /// The grid, and the file.
    #[command(flatten)]
    target: ResultArgs,
    /// Constant spin speeds in rpm, above 0: one, several with commas, FROM:TO:STEP
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: SpeedList,
    /// What is asked for.
    #[command(flatten)]
    asked: Asked,
    /// How it is done.
    #[command(flatten)]
    work: WorkArgs,
}

/// The periodic responses are asked for, of which nothing more can be said.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Responses {}

impl From<Responses> for Option<AttractorSearch> {
    fn from(_: Responses) -> Self {
        None
    }
}

/// What `sweep stability --help` adds.
pub(super) const RESPONSES_LONG: &str = "\
A row for every point of the grid and every speed: the periodic response of both models while the \
drum turns at that speed for ever, and how fast a small disturbance of the nonlinear one grows. \
The spin profile, the window and the integrator of the grid file do not matter here, but that the \
modes of a machine with friction are named as in that run. The result is written to \
results/NAME-stability.parquet unless --out names a file.

The file is a pure function of its input, whatever the number of threads, shards and \
interruptions. What an interrupted command has computed stays in FILE.partial, and the same \
command goes on from there.";

/// What `sweep dwell --help` adds.
pub(super) const MOTIONS_LONG: &str = "\
A row for every point of the grid, every speed and every motion that was found there while the \
drum turns at that speed. Trajectories start from the periodic response, slightly disturbed, and \
from kicks: two thirds of these in the two modes that rock most, one by one and together, the \
others in random directions, every other one of the machine at rest. They are followed until their \
largest deviations no longer change. It is a search, not a \
proof: a motion that no start leads to is not found.

The result is written to results/NAME-dwell.parquet unless --out names a file. The file is a pure \
function of its input, whatever the number of threads, shards and interruptions. What an \
interrupted command has computed stays in FILE.partial, and the same command goes on from there.";

impl<Asked: clap::Args + Copy + Into<Option<AttractorSearch>>> Args<Asked> {
    /// Does what a search asks at these speeds, or finds the periodic responses there; says what
    /// came of it, and how the program ends.
    ///
    /// # Errors
    /// Mistakes in the grid file or the options, and whatever keeps the file from being written;
    /// finished chunks are kept.
    pub(super) fn run(&self) -> Result<Exit, Error> {
        let Self { target, speed, asked, work } = self;
        let search: Option<AttractorSearch> = (*asked).into();
        let plan: Plan = target.grid.load()?;
        check(&plan, "--speed", &speed.to_string())?;
        let held = HeldPlan { plan: &plan, speeds_rpm: speed.values(), search };
        let (job, output) = (held.job(), held.output(target.out.as_deref()));
        let [own, of_merge] = options(speed, search);
        let command = RunCommand {
            name: &plan.name,
            verb: held.verb(),
            rows: "rows",
            target,
            work,
            options: [&own, &of_merge],
        };
        let finished = |text: &mut String, _: &_| {
            for (name, words) in FURTHER.listed(&ParquetFile::open(&output)?)? {
                text.line(name, words);
            }
            text.line("file", output.display());
            text.next("show", &output);
            Ok(())
        };
        let report = command.execute(&held.engine()?, &job, &output, &installed()?, &finished)?;
        Ok(exit(work, &report))
    }
}

/// The options of a command line that ask the same, and those of `merge`.
fn options(speed: &SpeedList, search: Option<AttractorSearch>) -> [String; 2] {
    let own = search.map(|search| search.to_string()).unwrap_or_default();
    let own = format!(" --speed {speed}{own}");
    let of_merge = format!("{}{own}", if search.is_some() { " --dwell" } else { "" });
    [own, of_merge]
}

/// Arguments of `sweep status` or `sweep merge`, of a run or of held speeds.
#[derive(Debug, clap::Args)]
pub struct JobArgs<Of: clap::Args> {
    #[command(flatten)]
    of: Of,
    #[command(flatten)]
    held: HeldArgs,
}

impl JobArgs<status::Args> {
    /// Shows the progress, without disturbing it.
    ///
    /// # Errors
    /// Mistakes in the grid file, a folder or file of another plan, a file that cannot be read.
    pub(super) fn status(&self) -> Result<Exit, Error> {
        let plan: Plan = self.of.target.grid.load()?;
        let (job, output, [verb, own, of_merge]) = self.held.job(&plan, &self.of.target);
        status::of_job(&self.of, &job, &output, [&verb, &own, &of_merge])
    }
}

impl JobArgs<merge::Args> {
    /// Joins what the shards have left.
    ///
    /// # Errors
    /// As the engine's command.
    pub(super) fn merge(&self) -> Result<Exit, Error> {
        let plan: Plan = self.of.target.grid.load()?;
        let (job, output, _) = self.held.job(&plan, &self.of.target);
        merge::of_job(&self.of, &plan.name, &job, &output)
    }
}

/// Which job `status` and `merge` mean.
#[derive(Debug, clap::Args)]
struct HeldArgs {
    /// Constant spin speeds in rpm of `sweep stability`, or of `sweep dwell`: as there
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: Option<SpeedList>,
    /// The run is of `sweep dwell`, not of `sweep stability`
    #[arg(long, requires = "speed")]
    dwell: bool,
    /// How it looks for motions.
    #[command(flatten)]
    search: AttractorSearch,
}

impl HeldArgs {
    /// The job on a plan and its output, the command that goes on with it, what stands behind its
    /// arguments and what behind those of `merge`.
    fn job<'a>(&'a self, plan: &'a Plan, target: &ResultArgs) -> (Job<'a>, PathBuf, [String; 3]) {
        let Some(speed) = &self.speed else {
            return (Job::of(plan), target.output(plan), ["run", "", ""].map(str::to_owned));
        };
        let search = self.dwell.then_some(self.search);
        let held = HeldPlan { plan, speeds_rpm: speed.values(), search };
        let [own, of_merge] = options(speed, search);
        let again = [held.verb().to_owned(), own, of_merge];
        (held.job(), held.output(target.out.as_deref()), again)
    }
}
