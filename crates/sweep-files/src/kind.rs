//! The kinds of files that this program writes, and how one is recognised before it is overwritten.

use std::ffi::OsStr;
use std::io::Read as _;
use std::path::Path;

use crate::regular;
use crate::{FileError, ParquetFile};

/// Keys of a Parquet file's own key-value metadata.
pub mod key {
    /// The plan as JSON: grid as run, full machine, method.
    pub const PLAN: &str = "sweep.plan";
    /// Hash over identity and plan, hexadecimal.
    pub const PLAN_HASH: &str = "sweep.plan_hash";
    /// Version of the program.
    pub const VERSION: &str = "sweep.version";
    /// Version of the program's numerics: what decides the numbers besides the plan.
    pub const NUMERICS: &str = "sweep.numerics";
    /// JSON object: column name to `type`, `unit`, `description`, and [`WORSE`] and [`LIMIT`] if
    /// the column can be bad.
    pub const COLUMNS: &str = "sweep.columns";
    /// Which way a column is bad: `greater` or `less`.
    pub const WORSE: &str = "worse";
    /// The value up to which a column is good, if that has a meaning of its own.
    pub const LIMIT: &str = "limit";
    /// What was traced: quantity, limit, tolerance, lattice, trials, rounds. In boundary files
    /// alone.
    pub const BOUNDARY: &str = "sweep.boundary";
    /// Which point, how often, how integrated, and how it ended. In traces alone.
    pub const TRACE: &str = "sweep.trace";
    /// Resonances and shapes. In modes files alone.
    pub const MODES: &str = "sweep.modes";
    /// Speeds, and what the rows mean. In files of `sweep stability` alone.
    pub const STABILITY: &str = "sweep.stability";
    /// Speeds and starts. In files of `sweep dwell` alone.
    pub const DWELL: &str = "sweep.dwell";
    /// What was looked for, and which candidate is the best. In files of `sweep optimise` alone.
    pub const OPTIMISE: &str = "sweep.optimise";
    /// What a fit found. In the curves of `sweep fit` alone.
    pub const FIT: &str = "sweep.fit";
    /// Which files were compared, and where their plans part. In files of differences alone.
    pub const DIFFERENCES: &str = "sweep.differences";
    /// BLAKE3 hash of the whole file with zeros in this place, hexadecimal.
    pub const DIGEST: &str = "sweep.digest";
}

/// A kind of file. One may be written over another of the same kind.
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
    /// Curves of `sweep fit`.
    Fit,
    /// Result of `sweep compare --out`.
    Differences,
    /// A table that `sweep export` wrote.
    Exported {
        /// Its ending: `csv` or `xlsx`.
        ending: &'static str,
    },
    /// The JSON file beside a map that says how the run went.
    Account {
        /// Name of the map.
        of: &'a OsStr,
    },
    /// An SVG picture without a prologue, as `sweep plot` writes them and drawing programs do not.
    Svg,
    /// A PNG picture.
    Png,
    /// An HTML page.
    Html,
    /// A manual page.
    ManPage,
}

/// Results that are no maps: each kind in a word, and the key that only its files have.
const OWN: [(FileKind<'static>, &str, &str); 8] = [
    (FileKind::Trace, "trace", key::TRACE),
    (FileKind::Modes, "modes", key::MODES),
    (FileKind::Boundary, "boundary", key::BOUNDARY),
    (FileKind::Stability, "stability", key::STABILITY),
    (FileKind::Dwell, "dwell", key::DWELL),
    (FileKind::Optimise, "study", key::OPTIMISE),
    (FileKind::Fit, "fit", key::FIT),
    (FileKind::Differences, "differences", key::DIFFERENCES),
];

/// The first line of an exported CSV file.
pub const EXPORTED_CSV: &str = "# exported by sweep ";

impl FileKind<'_> {
    /// The kind in words: "the file there is no NAME".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Map => "result of `sweep run`",
            Self::Trace => "result of `sweep trace`",
            Self::Modes => "result of `sweep modes`",
            Self::Boundary => "result of `sweep boundary`",
            Self::Stability => "result of `sweep stability`",
            Self::Dwell => "result of `sweep dwell`",
            Self::Optimise => "result of `sweep optimise`",
            Self::Fit => "curves of `sweep fit`",
            Self::Differences => "result of `sweep compare --out`",
            Self::Exported { .. } => "table of `sweep export`",
            Self::Account { .. } => "account of the run with this --out",
            Self::Svg => "SVG picture of `sweep plot`",
            Self::Png => "PNG picture",
            Self::Html => "HTML page",
            Self::ManPage => "manual page of `sweep man`",
        }
    }

    /// Says why the regular file at `path` is not of this kind; `None` if it is.
    pub(crate) fn objection(self, path: &Path) -> Result<Option<String>, FileError> {
        let begins = |with: &[u8]| {
            let mut start = Vec::new();
            let read = regular::open(path).and_then(|file| file.take(256).read_to_end(&mut start));
            read.map_err(FileError::io("read", path))?;
            Ok(start.starts_with(with))
        };
        let is_ours = match self {
            Self::Exported { ending: "csv" } => begins(EXPORTED_CSV.as_bytes())?,
            Self::Exported { .. } => begins(b"PK\x03\x04")?,
            Self::Account { of } => is_account(path, of).map_err(FileError::io("read", path))?,
            Self::Svg => begins(br#"<svg xmlns="http://www.w3.org/2000/svg" "#)?,
            Self::Png => begins(b"\x89PNG\r\n\x1a\n")?,
            Self::Html => begins(b"<!doctype html>\n")?,
            Self::ManPage => begins(b".ie \\n(.g ")?,
            _ => match ParquetFile::look(path) {
                Ok(file) if file.kind() == Some(self) => true,
                Ok(_) => {
                    // A damaged key makes one of ours look like another's.
                    ParquetFile::open(path)?;
                    false
                }
                Err(FileError::NotParquet { reason, .. }) => {
                    let name = self.name();
                    return Ok(Some(format!(
                        "the file there is no {name}, nor a Parquet file ({reason})"
                    )));
                }
                Err(error) => return Err(error),
            },
        };
        Ok(if is_ours { None } else { Some(format!("the file there is no {}", self.name())) })
    }

    /// A kind of result in one word.
    pub fn word(self) -> &'static str {
        OWN.iter().find(|(kind, ..)| *kind == self).map_or("map", |(_, word, _)| word)
    }
}

impl ParquetFile {
    /// The kind of result that the metadata speaks of, if of any.
    pub fn kind(&self) -> Option<FileKind<'static>> {
        let has = |key: &str| self.value(key).is_some();
        let own = OWN.iter().find(|(.., key)| has(key)).map(|(kind, ..)| *kind);
        own.or_else(|| has(key::PLAN).then_some(FileKind::Map))
    }
}

fn is_account(path: &Path, of: &OsStr) -> std::io::Result<bool> {
    let text = regular::read_json(path)?;
    let account: serde_json::Value = serde_json::from_slice(&text).unwrap_or_default();
    Ok(account["plan_hash"].is_string() && account["file"].as_str() == Some(&of.to_string_lossy()))
}
