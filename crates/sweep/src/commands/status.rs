//! `sweep status GRID.toml`: progress of a run.

use serde_json::json;

use super::examples::Examples;
use super::grid::ResultArgs;
use super::run::line;
use crate::exit::{Error, Exit, show, tell};
use crate::speeds::{Speeds, turning};
use crate::store::{FolderStatus, State, shard_list, status};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    ["sweep status my.toml", "how far it is"],
    ["sweep status my.toml --json", "the same for a program, missing shards as a list"],
];

/// Arguments of `sweep status`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    target: ResultArgs,
    /// Of `sweep stability` with these speeds, not of `sweep run`
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = turning, allow_hyphen_values = true)]
    speed: Option<Speeds>,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
}

/// Shows the progress of a run, without disturbing it.
///
/// # Errors
/// Mistakes in the grid file, a folder or file of another plan, a file that cannot be read.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan = args.target.grid.load()?;
    let (job, output) = args.target.job(&plan, args.speed);
    let found = status(&output, &job)?;
    if args.json {
        return show(&format!("{:#}\n", json!(found)));
    }
    tell(summary(args, &found).trim_end());
    Ok(Exit::Done)
}

fn summary(args: &Args, found: &FolderStatus) -> String {
    let mut text = String::new();
    let state = match found.state {
        State::NotStarted => "not started",
        State::Unfinished => "unfinished",
        State::Complete => "complete, to be merged",
        State::Finished => "finished",
    };
    line(&mut text, "state", state);
    line(&mut text, "file", &found.output.display().to_string());
    line(
        &mut text,
        "points",
        &format!("{} of {} done, {} failed", found.points_done, found.points, found.points_failed),
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
    line(&mut text, "chunks", &chunks);
    for holder in &found.running {
        let shard = holder.shard.map(|shard| format!(", shard {shard}")).unwrap_or_default();
        line(&mut text, "running", &format!("process {} on {}{shard}", holder.pid, holder.host));
    }
    if let Some(shards) = found.shards {
        line(&mut text, "shards", &shards.to_string());
        let missing = shard_list(found.missing_shard_numbers.iter().copied());
        if !missing.is_empty() {
            let run = format!("{} --shard I/{shards}", args.target.command("run"));
            line(&mut text, "again", &format!("{run}, for I = {missing}"));
            line(&mut text, "on Slurm", &format!("sbatch --array={} ...", found.missing_shards));
        }
    }
    let next = match found.state {
        State::Complete => args.target.command("merge"),
        _ if args.speed.is_some() => args.target.command("stability"),
        _ => args.target.command("run"),
    };
    let next = match args.speed {
        Some(speeds) => format!("{next} --speed {speeds}"),
        None => next,
    };
    if found.running.is_empty() && (found.shards.is_none() || found.state == State::Complete) {
        line(&mut text, "next", &next);
    }
    text
}
