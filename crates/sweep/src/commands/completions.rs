//! `sweep completions SHELL`.

use clap_complete::Shell;

use crate::cli;
use crate::exit::{Error, Exit, print};

/// Arguments of `sweep completions`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Shell to complete for
    shell: Shell,
}

/// Prints the completion script.
///
/// # Errors
/// When standard output cannot be written.
pub fn run(args: &Args) -> Result<Exit, Error> {
    print(&script(args.shell))
}

fn script(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut cli::shown_command(), "sweep", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;

    #[test]
    fn every_shell_completes_what_help_shows_and_nothing_else() {
        for shell in Shell::value_variants() {
            let script = script(*shell);
            for name in ["boundary", "completions", "--keep-traces", "--version"] {
                assert!(script.contains(name.trim_start_matches('-')), "{shell}: no {name}");
            }
            let words = script.split(|c: char| !(c.is_alphanumeric() || c == '-'));
            let shows_hidden = words.clone().any(|word| word == "reference");
            assert!(!shows_hidden, "{shell} completes what is hidden");
        }
    }
}
