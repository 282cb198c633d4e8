//! What commands about held speeds have in common: doing it, and which job it is.

use std::path::PathBuf;

use super::show::lines;
use crate::dwell::Search;
use crate::plan::Plan;
use crate::speeds::SpeedList;
use crate::stability::{Held, check};
use sweep_engine::commands::cells::Lines as _;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{RunCommand, WorkArgs, exit, installed};
use sweep_engine::{Error, Exit, Job};
use sweep_files::ParquetFile;

/// Speeds that the drum holds.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SpeedArgs {
    /// Constant spin speeds in rpm, above 0: one, several with commas, FROM:TO:STEP
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: SpeedList,
}

impl SpeedArgs {
    /// Does what a search asks at these speeds, or finds the periodic responses there; says what
    /// came of it, and how the program ends.
    ///
    /// # Errors
    /// Mistakes in the grid file or the options, and whatever keeps the file from being written;
    /// finished chunks are kept.
    pub(super) fn run(
        &self,
        search: Option<Search>,
        target: &ResultArgs,
        work: &WorkArgs,
        fail_on_error: bool,
    ) -> Result<Exit, Error> {
        let plan: Plan = target.grid.load()?;
        check(&plan, "--speed", &self.speed.to_string())?;
        let held = Held { plan: &plan, speeds_rpm: self.speed.values(), search };
        let (job, output) = (held.job(), held.output(target.out.as_deref()));
        let options = options(&self.speed, search);
        let of_merge = if search.is_some() { " --dwell" } else { "" };
        let command = RunCommand {
            name: &plan.name,
            verb: held.verb(),
            rows: "rows",
            target,
            work,
            options: [&options, &format!("{of_merge}{options}")],
        };
        let finished = |text: &mut String, _: &_| {
            for (name, words) in lines(&ParquetFile::open(&output)?)? {
                text.line(name, words);
            }
            text.line("file", output.display());
            text.next("show", &output);
            Ok(())
        };
        let report = command.execute(&held.engine()?, &job, &output, &installed()?, &finished)?;
        Ok(exit(fail_on_error, &report))
    }
}

/// The options of a command line that ask the same.
fn options(speed: &SpeedList, search: Option<Search>) -> String {
    let search = search.map(|search| search.to_string()).unwrap_or_default();
    format!(" --speed {speed}{search}")
}

/// Which job `status` and `merge` mean.
#[derive(Debug, clap::Args)]
pub(super) struct HeldArgs {
    /// Constant spin speeds in rpm of `sweep stability`, or of `sweep dwell`: as there
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    speed: Option<SpeedList>,
    /// The run is of `sweep dwell`, not of `sweep stability`
    #[arg(long, requires = "speed")]
    dwell: bool,
    /// How it looks for motions.
    #[command(flatten)]
    search: Search,
}

impl HeldArgs {
    /// The job on a plan and its output, the command that goes on with it and what stands behind
    /// its arguments.
    pub(super) fn job<'a>(
        &'a self,
        plan: &'a Plan,
        target: &ResultArgs,
    ) -> (Job<'a>, PathBuf, [String; 2]) {
        let Some(speed) = &self.speed else {
            return (Job::of(plan), target.output(plan), ["run".to_owned(), String::new()]);
        };
        let search = self.dwell.then_some(self.search);
        let held = Held { plan, speeds_rpm: speed.values(), search };
        let again = [held.verb().to_owned(), options(speed, search)];
        (held.job(), held.output(target.out.as_deref()), again)
    }
}
