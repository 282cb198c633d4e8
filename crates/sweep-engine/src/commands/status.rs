//! `sweep status GRID.toml`: shows the progress of a run.

use std::path::Path;

use serde_json::json;

use super::{Lines as _, ResultArgs};
use crate::store::{FolderStatus, State, shard_list, status};
use crate::{Error, Exit, Job, Model, Plan, show};

/// Arguments of `sweep status`.
#[derive(Debug, clap::Args)]
pub struct StatusArgs {
    #[command(flatten)]
    /// The grid file and the output of the run.
    pub target: ResultArgs,
    /// Print the progress as JSON
    #[arg(long)]
    json: bool,
}

/// Shows the progress of a run, without disturbing it.
///
/// # Errors
/// Mistakes in the grid file, a folder or file of another plan, a file that cannot be read.
pub fn run<M: Model>(args: &StatusArgs) -> Result<Exit, Error> {
    let plan: Plan<M> = args.target.grid.load()?;
    show_job(args, &Job::new(&plan), &args.target.output(&plan), ["run", "", ""])
}

/// Shows the progress of a job. `again` has the command that continues it, further options of that
/// command, and further options of `merge`.
///
/// # Errors
/// The errors of [`run`].
pub fn show_job(
    args: &StatusArgs,
    job: &Job<'_>,
    output: &Path,
    again: [&str; 3],
) -> Result<Exit, Error> {
    let found = status(output, job)?;
    show(&if args.json { format!("{:#}\n", json!(found)) } else { summary(args, &found, again) })
}

fn summary(
    args: &StatusArgs,
    found: &FolderStatus,
    [verb, own, merge_options]: [&str; 3],
) -> String {
    let mut text = String::new();
    let state = match found.state {
        State::NotStarted => "not started",
        State::Unfinished => "unfinished",
        State::Complete => "complete, to be merged",
        State::Finished => "finished",
    };
    text.line("state", state);
    text.line("file", found.output.display());
    text.line(
        "points",
        format!("{} of {} done, {} failed", found.points_done, found.points, found.points_failed),
    );
    if found.state == State::Finished || found.state == State::NotStarted {
        return text;
    }
    let damaged = match found.chunks_damaged.len() {
        0 => String::new(),
        count => format!(" ({count} of them damaged)"),
    };
    let chunks = format!(
        "{} of {} done, {} missing{damaged}",
        found.chunks_done, found.chunks, found.chunks_missing
    );
    text.line("chunks", &chunks);
    for holder in &found.running {
        let shard = holder.shard.map(|shard| format!(", shard {shard}")).unwrap_or_default();
        text.line("running", format!("process {} on {}{shard}", holder.pid, holder.host));
    }
    if let Some(shards) = found.shards {
        text.line("shards", shards);
        let missing = shard_list(found.missing_shard_numbers.iter().copied());
        if !missing.is_empty() {
            let run = format!("{}{own} --shard I/{shards}", args.target.command(verb));
            text.line("again", format!("{run}, for I = {missing}"));
            text.line("on Slurm", format!("sbatch --array={} ...", found.missing_shards));
        }
    }
    let next = match found.state {
        State::Complete => args.target.command("merge") + merge_options,
        _ => args.target.command(verb) + own,
    };
    if found.running.is_empty() && (found.shards.is_none() || found.state == State::Complete) {
        text.line("next", &next);
    }
    text
}
