//! `sweep export FILE OUT`: writes a result in another format.

use std::path::{Path, PathBuf};

use crate::exit::{Error, Exit, tell};
use crate::store::refuse_unfinished;
use sweep_files::Output;
use sweep_results::{ExportFormat, ResultTable, export};

/// Arguments of `sweep export`.
#[derive(Debug, clap::Args)]
pub struct ExportArgs {
    /// A result, trace, modes or boundary file, or any other Parquet file of this program
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// File to write; its extension selects the format
    #[arg(value_name = "OUT", required_unless_present = "output")]
    #[arg(help = format!("File to write; its extension {} selects the format", list_extensions()))]
    out: Option<PathBuf>,

    /// File to write, as an option instead of the second argument
    #[arg(short, long, visible_alias = "out", value_name = "FILE", conflicts_with = "out")]
    output: Option<PathBuf>,
}

impl ExportArgs {
    /// Returns the file to write, which is either an argument or an option.
    fn output_path(&self) -> &Path {
        self.out.as_ref().or(self.output.as_ref()).expect("required")
    }
}

/// Writes the result in the format that the extension of the output names.
///
/// # Errors
/// An unknown extension, a file that cannot be read or is too large for the format, an output that
/// cannot be written.
pub fn run(args: &ExportArgs) -> Result<Exit, Error> {
    let output_path = args.output_path();
    let Some(format) = ExportFormat::from_path(output_path) else {
        let expectation = format!("a name that ends in {}", list_extensions());
        return Err(Error::option("OUT", output_path.display(), &expectation));
    };
    refuse_unfinished(&args.file)?;
    let file = ResultTable::open(&args.file)?;
    let output = Output::begin(output_path, format.file_kind())?;
    export(&file, format, output)?;
    tell(&format!("wrote {}: {} rows", output_path.display(), file.rows()));
    Ok(Exit::Done)
}

/// Returns the extensions of all formats in words: `.csv or .xlsx`.
fn list_extensions() -> String {
    ExportFormat::ALL.map(|format| format!(".{}", format.name())).join(" or ")
}
