//! What the fuzzer's bytes stand for: a grid file, a machine file beside it and constants of the
//! command line.

use std::path::Path;

/// A line that begins the machine file, which the grid can name as `machine.toml`.
const MACHINE: &[u8] = b"\n%% machine.toml\n";
/// A line that begins the constants, one a line.
const SETS: &[u8] = b"\n%% set\n";

/// One input, taken apart.
pub(crate) struct Input<'a> {
    pub(crate) grid: &'a [u8],
    pub(crate) machine: Option<&'a [u8]>,
    pub(crate) sets: Vec<String>,
}

impl<'a> Input<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let (files, sets) = cut(bytes, SETS);
        let (grid, machine) = cut(files, MACHINE);
        let sets =
            String::from_utf8_lossy(sets.unwrap_or_default()).lines().map(str::to_owned).collect();
        Self { grid, machine, sets }
    }

    /// Puts the files where a user would have them and returns the grid's path.
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

fn cut<'a>(bytes: &'a [u8], at: &[u8]) -> (&'a [u8], Option<&'a [u8]>) {
    match bytes.windows(at.len()).position(|window| window == at) {
        Some(place) => (&bytes[..place], Some(&bytes[place + at.len()..])),
        None => (bytes, None),
    }
}
