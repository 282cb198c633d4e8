//! The build of the program that made a file. With the plan it decides the file's bytes.

/// A build. Builds alike in both write the same bytes for the same input; unfinished work of others
/// is never mixed with theirs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Build {
    /// Version of the program.
    pub version: &'static str,
    /// Version of everything that decides a byte of a result: the model, the methods, what is
    /// derived from motions, the columns.
    pub numerics: u32,
}

/// Version and numerics, as `show` prints them.
pub fn words(version: &str, numerics: u32) -> String {
    format!("sweep {version}, numerics {numerics}")
}
