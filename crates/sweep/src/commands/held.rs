//! What commands about held speeds have in common: doing it and what came of it.

use std::fmt::Write as _;
use std::path::Path;

use crate::engine::Engine;
use crate::speeds::SpeedList;
use sweep_engine::commands::grid::{ResultArgs, quoted};
use sweep_engine::commands::run::{WorkArgs, exit, installed, line, work};
use sweep_engine::exit::{Error, Exit, tell};
use sweep_engine::progress::duration;
use sweep_engine::run::{self as runner, Ended, RunReport};
use sweep_engine::store::{Job, StoreError};
use sweep_engine::threads::Environment;
use sweep_files::ParquetFile;

/// Speeds that the drum holds.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SpeedArgs {
    /// Constant spin speeds in rpm, above 0: one, several with commas, FROM:TO:STEP
    #[arg(long, value_name = "SPEEDS", allow_hyphen_values = true)]
    pub(super) speed: SpeedList,
}

/// A command about held speeds.
pub(super) struct Held<'a> {
    pub(super) verb: &'static str,
    pub(super) target: &'a ResultArgs,
    pub(super) work: &'a WorkArgs,
    /// Its options, to copy: those of the command, and those that tell `merge` the same.
    pub(super) options: [String; 2],
    pub(super) fail_on_error: bool,
    /// What a finished file says, a line each with its name.
    pub(super) lines: fn(&ParquetFile) -> Result<Vec<(&'static str, String)>, StoreError>,
}

impl Held<'_> {
    /// Does it and says what came of it.
    ///
    /// # Errors
    /// Mistakes in the options, and whatever keeps the file from being written; finished chunks are
    /// kept.
    pub(super) fn carry_out(
        &self,
        name: &str,
        engine: &(dyn Engine + Sync),
        job: &Job<'_>,
        output: &Path,
    ) -> Result<Exit, Error> {
        let interrupt = installed()?;
        let environment: Environment<'_> = &|name| std::env::var(name).ok();
        let options = self.work.options(environment)?;
        let report = runner::run(engine, job, output, options, &interrupt)?;
        for note in &report.notes {
            tell(note);
        }
        tell(self.summary(name, output, &report)?.trim_end());
        Ok(exit(self.fail_on_error, &report))
    }

    /// What came of it.
    fn summary(&self, name: &str, output: &Path, report: &RunReport) -> Result<String, Error> {
        let mut text = String::new();
        let [own, of_merge] = &self.options;
        // Writing to a String cannot fail.
        let _ = match (&report.ended, &report.session) {
            (Ended::Already(file, _), _) => writeln!(
                text,
                "{name}: all {} rows are there already (--fresh computes them again)",
                file.points
            ),
            (Ended::Interrupted { kept, points, .. }, session) => {
                let after = session.as_ref().map(|session| duration(session.wall_s));
                let after = after.map(|wall| format!(", after {wall}")).unwrap_or_default();
                writeln!(text, "{name}: interrupted with {kept} of {points} rows kept{after}")
            }
            (Ended::Shard(shard), Some(session)) => {
                writeln!(text, "{name}, shard {} of {}: {}", shard.index, shard.of, work(session))
            }
            (_, Some(session)) => writeln!(text, "{name}: {}", work(session)),
            (_, None) => Ok(()),
        };
        match &report.ended {
            Ended::Already(..) | Ended::Finished(_) => {
                for (name, words) in (self.lines)(&ParquetFile::open(output)?)? {
                    line(&mut text, name, &words);
                }
                let shown = output.display().to_string();
                line(&mut text, "file", &shown);
                line(&mut text, "next", &format!("sweep show {}", quoted(&shown)));
            }
            Ended::Shard(_) => {
                let merge = self.target.command("merge");
                line(&mut text, "next", &format!("{merge} {of_merge}, when all shards are done"));
            }
            Ended::Interrupted { .. } => {
                let mut again = format!("{} {own}", self.target.command(self.verb));
                let shard = report.session.as_ref().and_then(|session| session.shard.as_deref());
                if let Some(shard) = shard {
                    let _ = write!(again, " --shard {shard}");
                }
                line(&mut text, "go on", &again);
            }
        }
        Ok(text)
    }
}
