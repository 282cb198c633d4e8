//! `sweep completions SHELL` prints the completion script of a shell.

use clap_complete::Shell;

use sweep_engine::{Error, Exit, print};

/// Arguments of `sweep completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// Shell to complete for
    shell: Shell,
}

/// Prints the completion script of a command line.
///
/// # Errors
/// Returns an error if standard output cannot be written.
pub(crate) fn run(args: &CompletionsArgs, program: clap::Command) -> Result<Exit, Error> {
    print(&generate_script(args.shell, program))
}

fn generate_script(shell: Shell, mut program: clap::Command) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut program, "sweep", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum as _;

    use super::*;
    use crate::commands::visible_command;

    #[test]
    fn every_shell_completes_visible_commands_and_no_hidden_ones() {
        for shell in Shell::value_variants() {
            let script = generate_script(*shell, visible_command());
            for name in ["boundary", "completions", "--keep-traces", "--version"] {
                assert!(script.contains(name.trim_start_matches('-')), "{shell}: no {name}");
            }
            let script_words = script.split(|c: char| !(c.is_alphanumeric() || c == '-'));
            let shows_hidden = script_words.clone().any(|word| word == "reference");
            assert!(!shows_hidden, "{shell} completes what is hidden");
        }
    }
}
