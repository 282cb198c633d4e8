//! `sweep status GRID.toml`: shows the progress of a run.

use std::path::Path;

use serde_json::json;

use super::{Lines as _, ResultArgs};
use crate::store::{FolderStatus, RunStage, format_shard_numbers, read_status};
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

/// Shows the progress of a job. `continuation` has the command that continues the job, further
/// options of that command, and further options of `merge`.
///
/// # Errors
/// The errors of [`run`].
pub fn show_job(
    args: &StatusArgs,
    job: &Job<'_>,
    output: &Path,
    continuation: [&str; 3],
) -> Result<Exit, Error> {
    let folder_status = read_status(output, job)?;
    show(&if args.json {
        format!("{:#}\n", json!(folder_status))
    } else {
        format_summary(args, &folder_status, continuation)
    })
}

fn format_summary(
    args: &StatusArgs,
    folder_status: &FolderStatus,
    [verb, run_options, merge_options]: [&str; 3],
) -> String {
    let mut text = String::new();
    let state_text = match folder_status.state {
        RunStage::NotStarted => "not started",
        RunStage::Unfinished => "unfinished",
        RunStage::Complete => "complete, to be merged",
        RunStage::Finished => "finished",
    };
    text.line("state", state_text);
    text.line("file", folder_status.output.display());
    text.line(
        "points",
        format!(
            "{} of {} done, {} failed",
            folder_status.points_done, folder_status.points, folder_status.points_failed
        ),
    );
    if folder_status.state == RunStage::Finished || folder_status.state == RunStage::NotStarted {
        return text;
    }
    let damaged_note = match folder_status.chunks_damaged.len() {
        0 => String::new(),
        count => format!(" ({count} of them damaged)"),
    };
    let chunks_text = format!(
        "{} of {} done, {} missing{damaged_note}",
        folder_status.chunks_done, folder_status.chunks, folder_status.chunks_missing
    );
    text.line("chunks", &chunks_text);
    for holder in &folder_status.running {
        let shard_text =
            holder.shard.map(|shard_text| format!(", shard {shard_text}")).unwrap_or_default();
        text.line("running", format!("process {} on {}{shard_text}", holder.pid, holder.host));
    }
    if let Some(shards) = folder_status.shards {
        text.line("shards", shards);
        let missing_shards =
            format_shard_numbers(folder_status.missing_shard_numbers.iter().copied());
        if !missing_shards.is_empty() {
            let run_command =
                format!("{}{run_options} --shard I/{shards}", args.target.command(verb));
            text.line("again", format!("{run_command}, for I = {missing_shards}"));
            text.line("on Slurm", format!("sbatch --array={} ...", folder_status.missing_shards));
        }
    }
    let next_command = match folder_status.state {
        RunStage::Complete => args.target.command("merge") + merge_options,
        _ => args.target.command(verb) + run_options,
    };
    if folder_status.running.is_empty()
        && (folder_status.shards.is_none() || folder_status.state == RunStage::Complete)
    {
        text.line("next", &next_command);
    }
    text
}
