//! `sweep init` writes a grid or machine file to start from.

use std::path::{Path, PathBuf};

use washer_model::Machine;

use crate::config;
use sweep_engine::plan::NumberSources;
use sweep_engine::{Error, Exit, print, tell};
use sweep_files::{FileError, atomic};

/// The commented grid file that `sweep init` writes.
const STARTER_GRID: &str = include_str!("starter.toml");

/// The commented machine file that `sweep init --machine --short` writes.
const SHORT_MACHINE_FILE: &str = include_str!("starter_machine.toml");

/// Arguments of `sweep init`.
#[derive(Debug, clap::Args)]
pub struct InitArgs {
    /// File to write; `-` for standard output [default: grid.toml, or machine.toml with --machine]
    file: Option<PathBuf>,
    /// Write the built-in machine as a machine file instead, to be changed and named by a grid file
    #[arg(long)]
    machine: bool,
    /// Write a short machine file, as a data sheet fills it: the rest is assumed by rules
    #[arg(long, requires = "machine")]
    short: bool,
}

/// Writes the file. It never overwrites another one.
///
/// # Errors
/// Returns an error if the file exists or cannot be written.
pub(crate) fn run(args: &InitArgs) -> Result<Exit, Error> {
    let file_text = match (args.machine, args.short) {
        (true, true) => SHORT_MACHINE_FILE.to_owned(),
        // Scripts read the complete file, in which no number is left to the rules of assumption.
        (true, false) => config::machine_file(&Machine::paper(), &NumberSources::default()),
        (false, _) => STARTER_GRID.to_owned(),
    };
    let default_name = if args.machine { "machine.toml" } else { "grid.toml" };
    let path = args.file.as_deref().unwrap_or(Path::new(default_name));
    if path == Path::new("-") {
        return print(&file_text);
    }
    if !atomic::create(atomic::parent(path), path, file_text.as_bytes())? {
        let reason = "a file is there already".to_owned();
        let help = "give another name, or remove that file first";
        return Err(FileError::Refused { path: path.to_owned(), reason, help }.into());
    }
    let shown_path = path.display();
    tell(&if args.machine {
        format!(
            "wrote {shown_path}; a grid file beside it names it: machine = \"{}\"",
            path.file_name().unwrap_or_default().display()
        )
    } else {
        format!("wrote {shown_path}; next: sweep check {shown_path}")
    });
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::METHODS;

    #[test]
    fn the_starter_shows_every_method_and_setting() {
        for method in &METHODS {
            assert!(STARTER_GRID.contains(&format!("\"{}\"", method.name)), "no {}", method.name);
            for setting in method.settings {
                let line = format!("{} = {:e}", setting.key, setting.default);
                assert!(STARTER_GRID.contains(&line), "no {line}");
            }
        }
    }
}
