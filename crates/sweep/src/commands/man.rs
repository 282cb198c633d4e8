//! `sweep man DIR` writes manual pages, for packagers.

use std::io;
use std::path::PathBuf;

use clap_mangen::Man;
use clap_mangen::roff::{Roff, bold, roman};

use sweep_engine::commands::examples::Examples;
use sweep_engine::{Error, Exit};
use sweep_files::{self as files, FileKind};

/// Arguments of `sweep man`.
#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Folder for the pages; created if it does not exist
    folder: PathBuf,
}

/// Writes a page for the program and one for each command, with their examples.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub(crate) fn run(
    args: &ManArgs,
    mut program: clap::Command,
    examples: &dyn Fn(&str) -> Examples,
) -> Result<Exit, Error> {
    let write_error =
        |source| Error::File { action: "write manual pages to", path: args.folder.clone(), source };
    files::create_folder_without_leftovers(&args.folder)?;
    let write_page =
        |name: &str, page: &[u8]| files::write(&args.folder.join(name), FileKind::ManPage, page);
    // Gives each command its full name, such as `sweep run`.
    program.build();
    for command in program.get_subcommands().filter(|command| !command.is_hide_set()) {
        let name = command.get_name();
        write_page(
            &format!("sweep-{name}.1"),
            &render_page(command, name, examples(name)).map_err(write_error)?,
        )?;
    }
    write_page("sweep.1", &render_page(&program, "", examples("sweep")).map_err(write_error)?)?;
    Ok(Exit::Done)
}

/// Returns a manual page. Unlike help, a manual page ends with the examples.
fn render_page(command: &clap::Command, name: &str, examples: Examples) -> io::Result<Vec<u8>> {
    let title = if name.is_empty() { "sweep".to_owned() } else { format!("sweep-{name}") };
    let man =
        Man::new(command.clone()).title(title).source(concat!("sweep ", env!("CARGO_PKG_VERSION")));
    let mut page_text = Vec::new();
    man.render_title(&mut page_text)?;
    man.render_name_section(&mut page_text)?;
    man.render_synopsis_section(&mut page_text)?;
    man.render_description_section(&mut page_text)?;
    man.render_options_section(&mut page_text)?;
    if name.is_empty() {
        man.render_subcommands_section(&mut page_text)?;
    }
    let mut last_sections = Roff::new();
    last_sections.control("SH", ["EXIT STATUS"]);
    for (exit, meaning) in Exit::ALL {
        last_sections
            .control("TP", [])
            .text([bold((exit as u8).to_string())])
            .text([roman(meaning)]);
    }
    last_sections.control("SH", ["EXAMPLES"]);
    for [line, purpose] in examples {
        last_sections.control("TP", []).text([bold(line)]).text([roman(purpose)]);
    }
    last_sections.to_writer(&mut page_text)?;
    Ok(page_text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::{command_line, find_examples};

    #[test]
    fn pages_have_their_name_examples_and_exit_codes() {
        let mut program = command_line();
        program.build();
        let run_command = program.find_subcommand("run").unwrap();
        let page_text =
            String::from_utf8(render_page(run_command, "run", find_examples("run")).unwrap())
                .unwrap();
        for expected_part in [
            ".TH sweep-run 1",
            "sweep run",
            ".SH EXAMPLES",
            "\\-\\-shard 3/16",
            ".SH \"EXIT STATUS\"",
            "75",
        ] {
            assert!(page_text.contains(expected_part), "no {expected_part} in\n{page_text}");
        }
    }
}
