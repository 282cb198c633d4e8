//! The kinds of files that this program writes, and the tests that recognise one before it is
//! overwritten.

use std::ffi::OsStr;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::{FileError, ParquetFile, key, regular};

/// A kind of file. A file may be written over another of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind<'a> {
    /// Result of `sweep run`.
    Map,
    /// Result of `sweep trace`.
    Trace,
    /// Result of `sweep modes`.
    Modes,
    /// Result of `sweep boundary`.
    Boundary,
    /// Result of `sweep stability`.
    Stability,
    /// Result of `sweep dwell`.
    Dwell,
    /// Result of `sweep optimise`.
    Optimise,
    /// A file of the model's parameters: `sweep optimise --best`, `sweep fit --out`.
    ModelFile,
    /// Curves of `sweep fit`.
    Fit,
    /// Result of `sweep compare --out`.
    Differences,
    /// A table that `sweep export` wrote.
    Exported {
        /// The ending: `csv` or `xlsx`.
        ending: &'static str,
    },
    /// The JSON file beside a result with the facts of the run: time, host and speed.
    Sidecar {
        /// The name of the result.
        result_name: &'a OsStr,
    },
    /// An SVG picture without a prologue, as `sweep plot` writes them and drawing programs do not.
    Svg,
    /// A PDF figure.
    Pdf,
    /// A PNG picture.
    Png,
    /// An HTML page.
    Html,
    /// A manual page.
    ManPage,
}

/// Results other than maps: for each kind its word, the metadata key that only its files have, and
/// its name.
const RESULT_KINDS: [(FileKind<'static>, &str, &str, &str); 8] = [
    (FileKind::Trace, "trace", key::TRACE, "result of `sweep trace`"),
    (FileKind::Modes, "modes", key::MODES, "result of `sweep modes`"),
    (FileKind::Boundary, "boundary", key::BOUNDARY, "result of `sweep boundary`"),
    (FileKind::Stability, "stability", key::STABILITY, "result of `sweep stability`"),
    (FileKind::Dwell, "dwell", key::DWELL, "result of `sweep dwell`"),
    (FileKind::Optimise, "study", key::OPTIMISE, "result of `sweep optimise`"),
    (FileKind::Fit, "fit", key::FIT, "curves of `sweep fit`"),
    (FileKind::Differences, "differences", key::DIFFERENCES, "result of `sweep compare --out`"),
];

/// The beginning of the first line of a model's file of parameters that a command wrote.
pub const MODEL_FILE_START: &str = "# Written by sweep: ";

/// The first lines of our PDF figures. The second line distinguishes them from other documents.
pub const PDF_START: &[u8] = b"%PDF-1.7\n%\xe2\xe3\xcf\xd3 sweep plot\n";

/// The first line of an exported CSV file.
pub const EXPORTED_CSV: &str = "# exported by sweep ";

impl FileKind<'_> {
    /// Returns the kind's name, as in "the file there is no NAME".
    pub fn name(self) -> &'static str {
        match self {
            Self::ModelFile => "file of `sweep optimise --best` or `sweep fit --out`",
            Self::Exported { .. } => "table of `sweep export`",
            Self::Sidecar { .. } => "sidecar of the run with this --out",
            Self::Svg => "SVG picture of `sweep plot`",
            Self::Pdf => "PDF figure of `sweep plot`",
            Self::Png => "PNG picture",
            Self::Html => "HTML page",
            Self::ManPage => "manual page of `sweep man`",
            _ => self.result_kind().map_or("result of `sweep run`", |(.., name)| name),
        }
    }

    /// Returns the reason why the regular file at `path` is not of this kind; `None` if it is.
    pub(crate) fn objection(self, path: &Path) -> Result<Option<String>, FileError> {
        let starts_with_bytes = |prefix: &[u8]| {
            let mut start = Vec::new();
            let result =
                regular::open(path).and_then(|file| file.take(256).read_to_end(&mut start));
            result.map_err(FileError::io("read", path))?;
            Ok(start.starts_with(prefix))
        };
        let objection = format!("the file there is no {}", self.name());
        let is_ours = match self {
            Self::ModelFile => starts_with_bytes(MODEL_FILE_START.as_bytes())?,
            Self::Exported { ending: "csv" } => starts_with_bytes(EXPORTED_CSV.as_bytes())?,
            Self::Exported { .. } => starts_with_bytes(b"PK\x03\x04")?,
            Self::Sidecar { result_name } => {
                is_sidecar(path, result_name).map_err(FileError::io("read", path))?
            }
            Self::Svg => starts_with_bytes(br#"<svg xmlns="http://www.w3.org/2000/svg" "#)?,
            Self::Pdf => starts_with_bytes(PDF_START)?,
            Self::Png => starts_with_bytes(b"\x89PNG\r\n\x1a\n")?,
            Self::Html => starts_with_bytes(b"<!doctype html>\n")?,
            Self::ManPage => starts_with_bytes(b".ie \\n(.g ")?,
            _ => match ParquetFile::open_unchecked(path) {
                Ok(file) if file.kind() == Some(self) => true,
                Ok(_) => {
                    // A result with a damaged key looks like one of another kind.
                    ParquetFile::open(path)?;
                    false
                }
                Err(FileError::NotParquet { reason, .. }) => {
                    return Ok(Some(format!("{objection}, nor a Parquet file ({reason})")));
                }
                Err(error) => return Err(error),
            },
        };
        Ok((!is_ours).then_some(objection))
    }

    /// Names a kind of result in one word.
    pub fn short_name(self) -> &'static str {
        self.result_kind().map_or("map", |(_, word, ..)| word)
    }

    /// Returns the ending of a path if it stands for a format that files of this kind do not have.
    pub(crate) fn other_format(self, path: &Path) -> Option<&'static str> {
        // Endings of formats that are not Parquet.
        const OTHER_FORMATS: &str = "csv tsv txt json toml xlsx ods nc h5 svg png pdf html zip";
        let ending = path.extension()?;
        let is_parquet = self == Self::Map || self.result_kind().is_some();
        OTHER_FORMATS.split(' ').find(|other| is_parquet && ending.eq_ignore_ascii_case(other))
    }

    fn result_kind(
        self,
    ) -> Option<&'static (FileKind<'static>, &'static str, &'static str, &'static str)> {
        RESULT_KINDS.iter().find(|(kind, ..)| *kind == self)
    }
}

impl ParquetFile {
    /// Returns the kind of result that the metadata tells, if the file is a result.
    pub fn kind(&self) -> Option<FileKind<'static>> {
        let has_key = |key: &str| self.value(key).is_some();
        let result_kind =
            RESULT_KINDS.iter().find(|(_, _, key, _)| has_key(key)).map(|(kind, ..)| *kind);
        result_kind.or_else(|| has_key(key::PLAN).then_some(FileKind::Map))
    }
}

/// Returns the path of a result's sidecar: `x.run.json` beside `x.parquet`, `v1.5.run.json` beside
/// `v1.5`.
pub fn path_beside(output: &Path, ending: &str) -> PathBuf {
    let stem = if output.extension().is_some_and(|extension| extension == "parquet") {
        output.file_stem()
    } else {
        output.file_name()
    };
    let mut name = stem.unwrap_or_default().to_owned();
    name.push(".");
    name.push(ending);
    output.with_file_name(name)
}

/// Returns whether the file at `path` is a sidecar (`run.json`) that may be overwritten: that of
/// the result `result_name`, or one that was renamed together with its result and still contains
/// the result's old name. The sidecar of another result that has the same path is kept.
fn is_sidecar(path: &Path, result_name: &OsStr) -> std::io::Result<bool> {
    let sidecar_text = regular::read_json(path)?;
    let sidecar: serde_json::Value = serde_json::from_slice(&sidecar_text).unwrap_or_default();
    let can_be_replaced = |stored_name: &str| {
        stored_name == result_name.to_string_lossy()
            || path_beside(&path.with_file_name(stored_name), "run.json") != path
    };
    Ok(sidecar["plan_hash"].is_string() && sidecar["file"].as_str().is_some_and(can_be_replaced))
}
