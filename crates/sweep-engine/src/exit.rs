//! The exit of the program: exit codes, errors, and the text on standard output and standard error.

use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use crate::{Diagnostics, StoreError, ThreadsError};
use sweep_files::FileError;
use sweep_plot::PlotError;
use sweep_results::ResultsError;

/// The exit codes, a contract with scripts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// The command succeeded.
    Done = 0,
    /// The system or the program failed.
    Failed = 1,
    /// The input was refused before any work.
    BadInput = 2,
    /// The command succeeded, but some points failed with `--fail-on-error`.
    PointsFailed = 3,
    /// A condition of `require`, `report` or `compare --fail-on` is violated, or `optimise` found
    /// no feasible candidate.
    ConditionViolated = 4,
    /// Another run has locked the output.
    Busy = 75,
    /// SIGHUP ended the command.
    HungUp = 129,
    /// SIGINT ended the command.
    Interrupted = 130,
    /// SIGTERM ended the command.
    Terminated = 143,
}

impl Exit {
    /// The exit codes with their meanings.
    pub const ALL: [(Self, &'static str); 9] = [
        (Self::Done, "done"),
        (Self::Failed, "a failure of the system or of this program"),
        (Self::BadInput, "bad input, or an unreadable file: refused before any work"),
        (Self::PointsFailed, "with --fail-on-error: done, but some points failed"),
        (
            Self::ConditionViolated,
            "done, but a condition of require, report, compare or optimise does not hold",
        ),
        (Self::Busy, "another run holds this output"),
        (Self::HungUp, "hung up; finished work is kept"),
        (Self::Interrupted, "interrupted; finished work is kept"),
        (Self::Terminated, "terminated; finished work is kept"),
    ];

    /// Returns the exit code of a process that a signal has interrupted.
    pub fn from_signal(signal: Option<u8>) -> Self {
        match signal {
            Some(1) => Self::HungUp,
            Some(15) => Self::Terminated,
            _ => Self::Interrupted,
        }
    }

    /// Formats all codes with their meanings for `--help`.
    pub fn format_codes() -> String {
        let format_line = |(exit, meaning)| format!("\n  {:>3}  {meaning}", exit as u8);
        let streams_note = "Results go to standard output, messages to standard error.";
        format!("{streams_note}\n\nExit codes:{}", Self::ALL.map(format_line).concat())
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// The error of a command.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Errors in the input.
    #[error(transparent)]
    Input(#[from] Diagnostics),
    /// A request that cannot be satisfied, with the reason.
    #[error("{0}")]
    Refused(String),
    /// An error of a run's files.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// An error of a figure.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// An error of a query of a result.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// An error of the model.
    #[error(transparent)]
    Model(Box<dyn std::error::Error + Send + Sync>),
    /// An error of a file of this program.
    #[error(transparent)]
    Files(#[from] FileError),
    /// An error of starting threads.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// A file that could not be read or written.
    #[error("cannot {action} {}: {source}", path.display())]
    File {
        /// The attempted action: `"write"`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Standard output could not be written.
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}

impl Error {
    /// Creates the error of an option (`"--every"`) with an invalid value.
    pub fn option(option: &str, value: impl Display, expected: impl Display) -> Self {
        Self::Refused(format!("`{option} {value}`: expected {expected}"))
    }

    /// Creates the error of signal handlers that cannot be installed.
    pub fn signal_handlers(source: std::io::Error) -> Self {
        Self::File { action: "install signal handlers for", path: "this process".into(), source }
    }

    /// Creates the error of a model.
    pub fn model(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Model(Box::new(error))
    }

    /// Returns the exit code.
    pub fn exit_code(&self) -> Exit {
        let is_refusal = match self {
            Self::Files(error)
            | Self::Results(ResultsError::File(error))
            | Self::Plot(PlotError::File(error)) => error.is_refusal(),
            Self::Store(StoreError::Busy { .. }) => return Exit::Busy,
            Self::Store(error) => error.is_refusal(),
            Self::Threads(error) => error.is_refusal(),
            Self::File { .. }
            | Self::Stdout(_)
            | Self::Plot(PlotError::Drawing(_))
            | Self::Results(ResultsError::TemporaryFile { .. }) => false,
            _ => true,
        };
        if is_refusal { Exit::BadInput } else { Exit::Failed }
    }

    /// Writes the error to standard error, in colour on a terminal unless `NO_COLOR` is set.
    pub fn report(&self) {
        match self {
            Self::Input(diagnostics) => {
                let text = diagnostics.styled();
                // The escapes in this text are those of colours, because the renderer has replaced
                // the escapes in quoted input.
                let text = escape(&text, |letter| letter != '\x1b' && is_unsafe(letter));
                // Without standard error, only the exit code reports the error.
                let _ = writeln!(anstream::stderr(), "{text}");
            }
            other => tell(&format!("error: {other}")),
        }
    }
}

/// Returns whether a character can control a terminal, or change the order of its text.
fn is_unsafe(letter: char) -> bool {
    let is_control = letter.is_control() && !matches!(letter, '\n' | '\t');
    is_control || matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Returns a text with some characters written as `\u001b`, which is their form in JSON too.
fn escape(text: &str, must_escape: impl Fn(char) -> bool) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if must_escape(c) {
            // Writing to a String cannot fail.
            let _ = write!(escaped, "\\u{:04x}", u32::from(c));
        } else {
            escaped.push(c);
        }
    }
    escaped
}

/// Writes a text, for people or as JSON, to standard output. Control characters that come from
/// files are escaped.
///
/// # Errors
/// The errors of [`print()`].
pub fn show(text: &str) -> Result<Exit, Error> {
    print(&escape(text, is_unsafe))
}

/// Writes the output of a command (a script, a file) to standard output without changes. A reader
/// that closes the pipe (`| head`) is not an error.
///
/// # Errors
/// Any other error of writing to standard output.
pub fn print(text: &str) -> Result<Exit, Error> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::Stdout(error)),
        _ => Ok(Exit::Done),
    }
}

/// Writes a message to standard error, with control characters escaped.
pub fn tell(text: &str) {
    // Without standard error, the message is lost.
    let _ = writeln!(anstream::stderr(), "{}", escape(text, is_unsafe));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_do_not_change() {
        assert_eq!(Exit::ALL.map(|(exit, _)| exit as u8), [0, 1, 2, 3, 4, 75, 129, 130, 143]);
        for (_, meaning) in Exit::ALL {
            assert!(Exit::format_codes().contains(meaning));
        }
    }

    #[test]
    fn control_characters_are_escaped_and_text_stays() {
        let text = escape("a\x1b[2J\u{9b}3m\r\u{202e}é\tb\n", is_unsafe);
        assert_eq!(text, "a\\u001b[2J\\u009b3m\\u000d\\u202eé\tb\n");
        let json = serde_json::json!({ "host": "a\u{9b}\x07b" }).to_string();
        let parsed: serde_json::Value = serde_json::from_str(&escape(&json, is_unsafe)).unwrap();
        assert_eq!(parsed["host"], "a\u{9b}\x07b");
        assert_eq!(escape("plain", is_unsafe), "plain");
    }

    #[test]
    fn store_errors_have_exit_codes() {
        let output = PathBuf::from("x.parquet");
        let folder = PathBuf::from("x.parquet.partial");
        let plan_differs =
            StoreError::PlanDiffers { folder: folder.clone(), differences: Vec::new() };
        for (error, exit) in [
            (StoreError::Busy { output: output.clone(), holders: Vec::new() }, Exit::Busy),
            (plan_differs, Exit::BadInput),
            (ThreadsError::Scheduler { given: "0".to_owned() }.into(), Exit::BadInput),
            (StoreError::NoRun { output, folder }, Exit::Failed),
        ] {
            assert_eq!(Error::Store(error).exit_code(), exit);
        }
    }

    #[test]
    fn unreadable_files_are_bad_input_but_failing_disks_are_not() {
        let io_exit_code = |action, kind: io::ErrorKind| {
            let path = PathBuf::from("x.parquet");
            let source = kind.into();
            Error::from(FileError::Io { action, path, source }).exit_code()
        };
        assert_eq!(io_exit_code("open", io::ErrorKind::NotFound), Exit::BadInput);
        assert_eq!(io_exit_code("open", io::ErrorKind::Other), Exit::Failed);
        assert_eq!(io_exit_code("write", io::ErrorKind::PermissionDenied), Exit::Failed);
        let path = PathBuf::from("x.parquet");
        let error = ResultsError::TemporaryFile { path, reason: "disk full".to_owned() };
        assert_eq!(Error::from(error).exit_code(), Exit::Failed);
        let error = FileError::damaged(&PathBuf::from("x.parquet"));
        assert_eq!(Error::Plot(error.into()).exit_code(), Exit::BadInput);
    }
}
