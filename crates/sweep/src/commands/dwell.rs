//! `sweep dwell GRID.toml --speed SPEEDS`: the motions that held speeds end in.

use std::fmt;

use washer_model::{Starts, decimal};

use super::held::{SpeedArgs, carry_out};
use crate::dwell::{Carry, Motions, POSITIVE, Search, is_positive, motions, summary};
use crate::plan::Plan;
use crate::stability::{Asked, DwellEngine, check};
use sweep_engine::commands::examples::Examples;
use sweep_engine::commands::grid::ResultArgs;
use sweep_engine::commands::run::{RunCommand, WorkArgs};
use sweep_engine::exit::{Error, Exit};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    ["sweep dwell my.toml --speed 250", "what the machine ends in that is held at 250 rpm"],
    ["sweep dwell my.toml --speed 230:330:2.5 --threshold", "and how hard one may push it"],
    ["sweep plot results/first-dwell.parquet", "every motion over speed"],
];

/// How motions are looked for, as `dwell`, `status` and `merge` take it.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SearchArgs {
    /// Starts a speed, the disturbed periodic response among them
    #[arg(long, value_name = "N", default_value_t = 8,
          value_parser = clap::value_parser!(u16).range(1..=Search::MOST_STARTS))]
    starts: u16,
    /// Hardest kick, in rad/s of the tub's rocking
    #[arg(long, value_name = "RAD/S", default_value_t = 6.0, value_parser = positive)]
    kick: f64,
    /// Take the motion along from speed to speed, up or down, instead of starts at each
    #[arg(long, value_name = "up|down", conflicts_with_all = ["starts", "kick", "threshold"])]
    carry: Option<Carry>,
    /// Look for the smallest kick that does not come back, where there are several motions
    #[arg(long)]
    threshold: bool,
    /// Keep so many states of each motion, once a turn: a row each, with its coordinates
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true,
          value_parser = clap::value_parser!(u16).range(..=256))]
    sections: u16,
    /// Follow a motion that does not settle for at most this long, in s
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0, value_parser = positive)]
    longest: f64,
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value| is_positive(*value));
    value.ok_or_else(|| format!("expected {POSITIVE}"))
}

impl fmt::Display for SearchArgs {
    /// What differs from the defaults, as it is written on a command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let usual = Starts::default();
        let starts = self.search().starts;
        if let Some(carry) = self.carry {
            write!(f, " --carry {}", carry.name())?;
        }
        if starts.count != usual.count {
            write!(f, " --starts {}", starts.count)?;
        }
        if starts.kick_rad_per_s != usual.kick_rad_per_s {
            write!(f, " --kick {}", decimal(starts.kick_rad_per_s))?;
        }
        if starts.longest_s != usual.longest_s {
            write!(f, " --longest {}", decimal(starts.longest_s))?;
        }
        if self.sections > 0 {
            write!(f, " --sections {}", self.sections)?;
        }
        if self.threshold { f.write_str(" --threshold") } else { Ok(()) }
    }
}

impl SearchArgs {
    pub(super) fn search(&self) -> Search {
        let starts = Starts {
            count: usize::from(self.starts),
            kick_rad_per_s: self.kick,
            longest_s: self.longest,
            with_threshold: self.threshold,
            ..Starts::default()
        };
        Search { starts, carry: self.carry, sections: usize::from(self.sections) }
    }
}

/// Where the result goes.
const OUT: &str = "Result file [default: results/NAME-dwell.parquet]";

/// Arguments of `sweep dwell`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG, mut_arg("out", |out| out.help(OUT)))]
pub struct Args {
    /// The grid, and the file: results/NAME-dwell.parquet by default.
    #[command(flatten)]
    target: ResultArgs,
    #[command(flatten)]
    held: SpeedArgs,
    /// How motions are looked for.
    #[command(flatten)]
    search: SearchArgs,
    /// How it is done.
    #[command(flatten)]
    work: WorkArgs,
    /// Exit with 3 if any row is not ok
    #[arg(long)]
    fail_on_error: bool,
}

/// What `--help` adds.
const LONG: &str = "\
A row for every point of the grid, every speed and every motion that was found there while the \
drum turns at that speed. Trajectories start from the periodic response, slightly disturbed, and \
from kicks in the two modes that rock most, one by one and together, each a third of a decade \
harder. They are followed until their largest deviations no longer change. It is a search, not a \
proof: a motion that no start leads to is not found.

The result is written to results/NAME-dwell.parquet unless --out names a file. The file is a pure \
function of its input, whatever the number of threads, shards and interruptions. What an \
interrupted command has computed stays in FILE.partial, and the same command goes on from there.";

/// Finds the motions and writes them.
///
/// # Errors
/// Mistakes in the grid file or the options, and whatever keeps the file from being written;
/// finished chunks are kept.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan: Plan = args.target.grid.load()?;
    check(&plan, "--speed", &args.held.speed.to_string())?;
    let (search, speeds_rpm) = (args.search.search(), args.held.speed.values());
    let engine =
        DwellEngine::asking(&plan, speeds_rpm, Asked::Motions(Motions::new(&plan, search)))?;
    let (job, output) = motions(&plan, speeds_rpm, &search, args.target.out.as_deref());
    let options = format!(" --speed {}{}", args.held.speed, args.search);
    let command = RunCommand {
        name: &plan.name,
        verb: "dwell",
        rows: "rows",
        target: &args.target,
        work: &args.work,
        options: [&options, &format!(" --dwell{options}")],
    };
    carry_out(&command, &engine, (&job, &output), summary::lines, args.fail_on_error)
}
