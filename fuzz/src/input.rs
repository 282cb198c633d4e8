//! The parts of an input: a grid file, a machine file beside it and constants of the command line.

use std::path::Path;

/// The line before the machine file, which the grid can name as `machine.toml`.
const MACHINE_MARKER: &[u8] = b"\n%% machine.toml\n";
/// The line before the constants, which have a line each.
const SETS_MARKER: &[u8] = b"\n%% set\n";

/// The parts of an input.
pub(crate) struct Input<'a> {
    pub(crate) grid: &'a [u8],
    pub(crate) machine: Option<&'a [u8]>,
    pub(crate) sets: Vec<String>,
}

impl<'a> Input<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let (files, sets) = split_at_line(bytes, SETS_MARKER);
        let (grid, machine) = split_at_line(files, MACHINE_MARKER);
        let sets =
            String::from_utf8_lossy(sets.unwrap_or_default()).lines().map(str::to_owned).collect();
        Self { grid, machine, sets }
    }

    /// Writes the files to a folder and returns the path of the grid file.
    pub(crate) fn write(&self, folder: &Path) -> std::io::Result<std::path::PathBuf> {
        let machine = folder.join("machine.toml");
        match self.machine {
            Some(text) => std::fs::write(machine, text)?,
            None => match std::fs::remove_file(machine) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
                _ => {}
            },
        }
        let grid = folder.join("grid.toml");
        std::fs::write(&grid, self.grid)?;
        Ok(grid)
    }
}

/// Returns the bytes before and after a line; `None` if the line is missing.
fn split_at_line<'a>(bytes: &'a [u8], line: &[u8]) -> (&'a [u8], Option<&'a [u8]>) {
    match bytes.windows(line.len()).position(|window| window == line) {
        Some(start) => (&bytes[..start], Some(&bytes[start + line.len()..])),
        None => (bytes, None),
    }
}
