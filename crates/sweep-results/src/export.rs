//! Results in the formats of other programs, with units.

mod csv;
mod xlsx;

use std::path::Path;

use sweep_files::{FileKind, Output, ResultTable};
use sweep_parameter::named;

use crate::error::{Result, ResultsError};

named! {
    /// A format, named as the ending of its files.
    pub enum Format {
        /// Text: comments that begin with `#`, a line of names, a line per row.
        Csv = "csv",
        /// A workbook: the rows, the columns with units and descriptions, the plan.
        Xlsx = "xlsx",
    }
}

impl Format {
    /// The format of a file's name.
    pub fn of(path: &Path) -> Option<Self> {
        Self::named(&path.extension()?.to_str()?.to_ascii_lowercase())
    }

    /// What such a file may be written over.
    pub const fn kind(self) -> FileKind<'static> {
        FileKind::Exported { ending: self.name() }
    }
}

/// Writes all rows of a result.
///
/// # Errors
/// [`ResultsError::File`], and [`ResultsError::Refused`] where the format has no room for it.
pub fn export(
    table: &ResultTable,
    format: Format,
    mut output: Output<'_>,
) -> Result<(), ResultsError> {
    let rest = match format {
        Format::Csv => {
            csv::write(table, &mut |text| output.write(text.as_bytes()))?;
            Vec::new()
        }
        Format::Xlsx => xlsx::bytes(table)?,
    };
    Ok(output.finish(&rest)?)
}

/// The names of all columns.
fn names(table: &ResultTable) -> Vec<&str> {
    table.columns.iter().map(|column| column.name.as_str()).collect()
}

/// A refusal of a format.
fn no_room(table: &ResultTable, format: Format, reason: &str) -> ResultsError {
    let (path, ending) = (table.path().display(), format.name());
    ResultsError::Refused(format!("{path} cannot be exported as .{ending}: {reason}"))
}
