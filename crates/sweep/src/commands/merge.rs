//! `sweep merge GRID.toml`: finished shards into the one file.

use super::examples::Examples;
use super::grid::ResultArgs;
use super::run::{line, rows};
use crate::exit::{Error, Exit, tell};
use crate::interrupt::Interrupt;
use crate::speeds::{Speeds, turning};
use crate::store::{OpenRun, Opened};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples =
    &[["sweep merge my.toml", "when `sweep status my.toml` finds no shard missing"]];

/// Arguments of `sweep merge`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: ResultArgs,
    /// Of `sweep stability` with these speeds, not of `sweep run`
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = turning, allow_hyphen_values = true)]
    speed: Option<Speeds>,
}

/// Joins what the shards have left.
///
/// # Errors
/// [`crate::store::StoreError::Incomplete`] with what is missing, and whatever else keeps it from
/// its end.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan = args.target.grid.load()?;
    let (job, output) = args.target.job(&plan, args.speed);
    let interrupt = Interrupt::install().map_err(|source| Error::File {
        action: "install signal handlers for",
        path: "this process".into(),
        source,
    })?;
    let mut run = match OpenRun::open_for_merge(&output, &job)? {
        Opened::Run(run) => run,
        Opened::Finished(file, tally) => {
            let mut text = format!("{}: all {} points are there already\n", plan.name, file.points);
            text.push_str(&rows(&tally, &job));
            tell(text.trim_end());
            return Ok(Exit::Done);
        }
    };
    for note in run.take_notes() {
        tell(&note);
    }
    let Some(tally) = run.join(&job, &|| interrupt.stopped())? else {
        tell("interrupted; the chunks are kept");
        return Ok(if interrupt.signal() == Some(15) {
            Exit::Terminated
        } else {
            Exit::Interrupted
        });
    };
    let joined = run.complete(&job, tally, None)?;
    for note in &joined.notes {
        tell(note);
    }
    let mut text = format!("{}: joined {} points\n", plan.name, joined.tally.points);
    text.push_str(&rows(&joined.tally, &job));
    line(&mut text, "file", &output.display().to_string());
    tell(text.trim_end());
    Ok(Exit::Done)
}
