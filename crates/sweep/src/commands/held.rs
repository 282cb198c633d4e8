//! What commands about held speeds have in common: doing it, what came of it, and which job it is.

use std::fmt;
use std::path::{Path, PathBuf};

use washer_model::{Starts, decimal};

use crate::dwell::{Carry, POSITIVE, Search, is_positive, motions};
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
