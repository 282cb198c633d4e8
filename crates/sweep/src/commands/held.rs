//! What commands about held speeds have in common: doing it, what came of it, and which job it is.

use std::path::{Path, PathBuf};

use super::dwell::SearchArgs;
use crate::dwell::motions;
use crate::engine::Engine;
use crate::plan::Plan;
use crate::speeds::SpeedList;
use crate::stability::dwells;
use sweep_engine::commands::cells::Lines as _;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{RunCommand, exit, installed};
use sweep_engine::exit::{Error, Exit};
use sweep_engine::store::{Job, StoreError};
use sweep_files::ParquetFile;

/// Speeds that the drum holds.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SpeedArgs {
    /// Constant spin speeds in rpm, above 0: one, several with commas, FROM:TO:STEP
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    pub(super) speed: SpeedList,
}

/// Does it, says what came of it by the `lines` of the file, and how the program ends.
///
/// # Errors
/// Mistakes in the options, and whatever keeps the file from being written; finished chunks are
/// kept.
pub(super) fn carry_out(
    command: &RunCommand<'_>,
    engine: &dyn Engine,
    (job, output): (&Job<'_>, &Path),
    lines: impl Fn(&ParquetFile) -> Result<Vec<(&'static str, String)>, StoreError>,
    fail_on_error: bool,
) -> Result<Exit, Error> {
    let finished = |text: &mut String, _: &_| {
        for (name, words) in lines(&ParquetFile::open(output)?)? {
            text.line(name, words);
        }
        text.line("file", output.display());
        text.next("show", output);
        Ok(())
    };
    let report = command.execute(engine, job, output, &installed()?, &finished)?;
    Ok(exit(fail_on_error, &report))
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
    search: SearchArgs,
}

impl HeldArgs {
    /// The job on a plan and its output, the command that goes on with it and what stands behind
    /// its arguments.
    pub(super) fn job<'a>(
        &self,
        plan: &'a Plan,
        target: &ResultArgs,
    ) -> (Job<'a>, PathBuf, [String; 2]) {
        let out = target.out.as_deref();
        let Some(speed) = &self.speed else {
            return (Job::of(plan), target.output(plan), ["run".to_owned(), String::new()]);
        };
        if self.dwell {
            let search = self.search.search();
            let (job, output) = motions(plan, speed.values(), &search, out);
            let options = format!(" --speed {speed}{}", self.search);
            return (job, output, ["dwell".to_owned(), options]);
        }
        let (job, output) = dwells(plan, speed, out);
        (job, output, ["stability".to_owned(), format!(" --speed {speed}")])
    }
}
