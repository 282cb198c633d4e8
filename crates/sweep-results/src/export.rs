//! Export of results to the formats of other programs, with units.

mod csv;
mod xlsx;

use std::path::Path;

use sweep_files::{FileKind, Output, ResultTable};
use sweep_parameter::named;

use crate::error::ResultsError;

named! {
    /// A format, named by the extension of its files.
    pub enum ExportFormat {
        /// Text: comments that begin with `#`, a line of names, a line for each row.
        Csv = "csv",
        /// A workbook with three sheets: the rows, the columns with units, the plan.
        Xlsx = "xlsx",
    }
}

impl ExportFormat {
    /// Returns the format that a file's extension names.
    pub fn from_path(path: &Path) -> Option<Self> {
        Self::named(&path.extension()?.to_str()?.to_ascii_lowercase())
    }

    /// Returns the kind of file that an export may overwrite.
    pub const fn file_kind(self) -> FileKind<'static> {
        FileKind::Exported { ending: self.name() }
    }
}

/// Writes all rows of a result.
///
/// # Errors
/// [`ResultsError::File`], and [`ResultsError::Refused`] for a result beyond the format's limits.
pub fn export(
    table: &ResultTable,
    format: ExportFormat,
    mut output: Output<'_>,
) -> Result<(), ResultsError> {
    let last_bytes = match format {
        ExportFormat::Csv => {
            csv::write(table, &mut |text| output.write(text.as_bytes()))?;
            Vec::new()
        }
        ExportFormat::Xlsx => xlsx::encode(table)?,
    };
    Ok(output.finish(&last_bytes)?)
}

/// Returns the names of all columns.
fn column_names(table: &ResultTable) -> Vec<&str> {
    table.columns.iter().map(|column| column.name.as_str()).collect()
}

/// Returns the error of a result that a format cannot hold.
fn export_error(table: &ResultTable, format: ExportFormat, reason: &str) -> ResultsError {
    let path = table.path().display();
    let extension = format.name();
    ResultsError::Refused(format!("{path} cannot be exported as .{extension}: {reason}"))
}
