//! `sweep export FILE OUT`: a result in another format.

use std::path::PathBuf;

use crate::exit::{Error, Exit, tell};
use crate::store::refuse_unfinished;
use sweep_files::Output;
use sweep_results::{ExportFormat, ResultTable, export};

/// Arguments of `sweep export`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A result, trace, modes or boundary file, or any other Parquet file of this program
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Where to write; the ending says how
    #[arg(value_name = "OUT")]
    #[arg(help = format!("Where to write; the ending {} says how", endings()))]
    out: PathBuf,
}

/// Writes the result in the format of the output's ending.
///
/// # Errors
/// An ending of no format, a file that cannot be read or is too large for the format, an output
/// that cannot be written.
pub fn run(args: &Args) -> Result<Exit, Error> {
    let Some(format) = ExportFormat::from_path(&args.out) else {
        let expected = format!("a name that ends in {}", endings());
        return Err(Error::option("OUT", args.out.display(), &expected));
    };
    refuse_unfinished(&args.file)?;
    let file = ResultTable::open(&args.file)?;
    let output = Output::begin(&args.out, format.kind())?;
    export(&file, format, output)?;
    tell(&format!("wrote {}: {} rows", args.out.display(), file.rows()));
    Ok(Exit::Done)
}

/// `.csv or .xlsx`.
fn endings() -> String {
    ExportFormat::ALL.map(|format| format!(".{}", format.name())).join(" or ")
}
