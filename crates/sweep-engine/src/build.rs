//! The build of the program that made a file. With the plan it decides the file's bytes.

/// A build of the program. Builds with the same version and numerics write the same bytes for the
/// same input. Unfinished work of other builds is never resumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Build {
    /// The version of the program.
    pub version: &'static str,
    /// The version of the numerics: of all code that a byte of a result depends on, which is the
    /// model, the methods, the numbers derived from motions, and the columns.
    pub numerics: u32,
}

/// Formats version and numerics as `show` prints them.
pub fn words(version: &str, numerics: u32) -> String {
    format!("sweep {version}, numerics {numerics}")
}
