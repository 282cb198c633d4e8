//! A study, with or without a file that keeps what it finds out.

use std::path::Path;

use super::Effort;
use super::result::ResultTable;
use crate::model::Washer;
use sweep_engine::boundary::search::Stopped;
use sweep_engine::exit::Error;
use sweep_engine::optimise::{Study, file::table, search::search};
use sweep_engine::store::{OpenedTrials, Trials};
use sweep_files::{FileKind, Output};

/// The candidates of a study file, constants `NAME=VALUE` over those of its grid; `None` if the
/// interrupt was raised. With an output it writes that file, byte for byte as `sweep optimise`
/// does, and goes on there after an interruption; `fresh` starts over.
///
/// # Errors
/// Mistakes in the study and its grid file, and whatever keeps the file from being written.
pub fn optimise_study(
    path: &Path,
    sets: &[String],
    output: Option<&Path>,
    fresh: bool,
    effort: Effort<'_>,
) -> Result<Option<ResultTable>, Error> {
    let study = Study::<Washer>::load(path, sets)?;
    let file = output.map(|path| Output::begin(path, FileKind::Optimise)).transpose()?;
    let trials = match output.map(|path| Trials::open(path, &study.job(), fresh)).transpose()? {
        Some(OpenedTrials::Finished) => return output.map(ResultTable::read).transpose(),
        Some(OpenedTrials::Open(trials)) => Some(*trials),
        None => None,
    };
    let (tried, trials) = search(&study, trials, effort)?;
    let tried = match tried {
        Ok(tried) => tried,
        Err(Stopped::Failed(error)) => return Err(error.into()),
        Err(Stopped::Interrupted) => return Ok(None),
    };
    let found = ResultTable::of_table(FileKind::Optimise, table(&study, &tried))?;
    if let Some(file) = file {
        found.finish(file)?;
    }
    // What it says matters where a user watches the folder.
    let _ = trials.and_then(Trials::complete);
    Ok(Some(found))
}
