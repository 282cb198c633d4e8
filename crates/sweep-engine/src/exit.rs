//! How the program ends, and why it could not go on.

use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

use crate::{Diagnostics, StoreError, ThreadsError};
use sweep_files::FileError;
use sweep_plot::PlotError;
use sweep_results::ResultsError;

/// Exit codes, a contract with scripts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done = 0,
    /// Something failed that the input is not to blame for.
    Failed = 1,
    /// Bad input; nothing was done.
    BadInput = 2,
    /// Done, but some points failed and `--fail-on-error` was given.
    PointsFailed = 3,
    /// What `require`, `report` or `compare --fail-on` asks does not hold, or `optimise` found
    /// nothing that keeps its conditions.
    NotHeld = 4,
    /// Another run holds this output.
    Busy = 75,
    /// Hung up (SIGHUP).
    HungUp = 129,
    /// Interrupted (SIGINT).
    Interrupted = 130,
    /// Asked to stop (SIGTERM).
    Terminated = 143,
}

impl Exit {
    /// Every exit code, with what it means to a script.
    pub const ALL: [(Self, &'static str); 9] = [
        (Self::Done, "done"),
        (Self::Failed, "a failure of the system or of this program"),
        (Self::BadInput, "bad input, or an unreadable file: refused before any work"),
        (Self::PointsFailed, "with --fail-on-error: done, but some points failed"),
        (Self::NotHeld, "done: what require, report, compare or optimise asks for does not hold"),
        (Self::Busy, "another run holds this output"),
        (Self::HungUp, "hung up; finished work is kept"),
        (Self::Interrupted, "interrupted; finished work is kept"),
        (Self::Terminated, "terminated; finished work is kept"),
    ];

    /// What a process ends with that this signal has interrupted.
    pub fn interrupted(signal: Option<u8>) -> Self {
        match signal {
            Some(1) => Self::HungUp,
            Some(15) => Self::Terminated,
            _ => Self::Interrupted,
        }
    }

    /// All codes with their meanings, and what goes where, for `--help`.
    pub fn table() -> String {
        let line = |(exit, meaning)| format!("\n  {:>3}  {meaning}", exit as u8);
        let outputs = "Answers go to standard output, all else to standard error.";
        format!("{outputs}\n\nExit codes:{}", Self::ALL.map(line).concat())
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why a command ended early.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Mistakes in what the user wrote.
    #[error(transparent)]
    Input(#[from] Diagnostics),
    /// What cannot be done with what the user gave, and why.
    #[error("{0}")]
    Refused(String),
    /// A run's files.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A figure.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A result that does not answer.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A model that cannot do what was asked.
    #[error(transparent)]
    Model(Box<dyn std::error::Error + Send + Sync>),
    /// A file of this program's.
    #[error(transparent)]
    Files(#[from] FileError),
    /// No threads.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// A file that could not be read or written.
    #[error("cannot {action} {}: {source}", path.display())]
    File {
        /// What was attempted: `"write"`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Standard output could not be written.
    #[error("cannot write to standard output: {0}")]
    Stdout(io::Error),
}

impl Error {
    /// An option (`"--every"`) whose value, as typed, makes no sense here.
    pub fn option(option: &str, given: impl Display, expected: impl Display) -> Self {
        Self::Refused(format!("`{option} {given}`: expected {expected}"))
    }

    /// The process cannot listen to signals.
    pub fn signals(source: std::io::Error) -> Self {
        Self::File { action: "install signal handlers for", path: "this process".into(), source }
    }

    /// What a model says that it cannot do.
    pub fn model(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Model(Box::new(error))
    }

    /// The exit code it ends with.
    pub fn exit(&self) -> Exit {
        let is_refusal = match self {
            Self::Files(error)
            | Self::Results(ResultsError::File(error))
            | Self::Plot(PlotError::File(error)) => error.is_refusal(),
            Self::Store(StoreError::Busy { .. }) => return Exit::Busy,
            Self::Store(error) => error.is_refusal(),
            Self::Threads(error) => error.is_refusal(),
            Self::File { .. } | Self::Stdout(_) | Self::Plot(PlotError::Drawing(_)) => false,
            _ => true,
        };
        if is_refusal { Exit::BadInput } else { Exit::Failed }
    }

    /// Tells the user, on standard error, in colour on a terminal unless `NO_COLOR` is set.
    pub fn report(&self) {
        match self {
            Self::Input(diagnostics) => {
                let text = diagnostics.styled();
                // Its own escapes are colours, and its renderer replaces those of what it quotes.
                let text = escaped(&text, |c| c != '\x1b' && is_unsafe(c));
                // With standard error gone there is nobody left to tell; the exit code still does.
                let _ = writeln!(anstream::stderr(), "{text}");
            }
            other => tell(&format!("error: {other}")),
        }
    }
}

/// Whether a character can do something to a terminal, or to the order of the text in it.
fn is_unsafe(c: char) -> bool {
    let is_control = c.is_control() && !matches!(c, '\n' | '\t');
    is_control || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A text with some characters written as `\u001b`, which is their form in JSON too.
fn escaped(text: &str, is_bad: impl Fn(char) -> bool) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        if is_bad(c) {
            // Writing to a String cannot fail.
            let _ = write!(safe, "\\u{:04x}", u32::from(c));
        } else {
            safe.push(c);
        }
    }
    safe
}

/// Writes the answer that was asked for, as people read it or as JSON, to standard output. What a
/// file has put into it that is no text cannot reach the terminal.
///
/// # Errors
/// As [`print()`].
pub fn show(text: &str) -> Result<Exit, Error> {
    print(&escaped(text, is_unsafe))
}

/// Writes a command's product to standard output, as it is: a script, a file. A reader that has
/// seen enough (`| head`) is no failure.
///
/// # Errors
/// When standard output cannot be written for any other reason.
pub fn print(text: &str) -> Result<Exit, Error> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::Stdout(error)),
        _ => Ok(Exit::Done),
    }
}

/// Writes what else people should hear to standard error; as in `show`, text only.
pub fn tell(text: &str) {
    // As in `Error::report`: nobody is left to tell.
    let _ = writeln!(anstream::stderr(), "{}", escaped(text, is_unsafe));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_are_the_contract() {
        assert_eq!(Exit::ALL.map(|(exit, _)| exit as u8), [0, 1, 2, 3, 4, 75, 129, 130, 143]);
        for (_, meaning) in Exit::ALL {
            assert!(Exit::table().contains(meaning));
        }
    }

    #[test]
    fn what_moves_a_cursor_is_written_out_and_text_stays() {
        let told = escaped("a\x1b[2J\u{9b}3m\r\u{202e}é\tb\n", is_unsafe);
        assert_eq!(told, "a\\u001b[2J\\u009b3m\\u000d\\u202eé\tb\n");
        let json = serde_json::json!({ "host": "a\u{9b}\x07b" }).to_string();
        let back: serde_json::Value = serde_json::from_str(&escaped(&json, is_unsafe)).unwrap();
        assert_eq!(back["host"], "a\u{9b}\x07b");
        assert_eq!(escaped("plain", is_unsafe), "plain");
    }

    #[test]
    fn a_store_that_is_busy_refuses_or_fails_has_a_code_each() {
        let (output, folder) = (PathBuf::from("x.parquet"), PathBuf::from("x.parquet.partial"));
        let differs = StoreError::PlanDiffers { folder: folder.clone(), differences: Vec::new() };
        for (error, exit) in [
            (StoreError::Busy { output: output.clone(), holders: Vec::new() }, Exit::Busy),
            (differs, Exit::BadInput),
            (ThreadsError::Scheduler { given: "0".to_owned() }.into(), Exit::BadInput),
            (StoreError::NoRun { output, folder }, Exit::Failed),
        ] {
            assert_eq!(Error::Store(error).exit(), exit);
        }
    }

    #[test]
    fn a_file_that_cannot_be_read_is_bad_input_and_a_disk_that_fails_is_not() {
        let io = |action, kind: io::ErrorKind| {
            let (path, source) = (PathBuf::from("x.parquet"), kind.into());
            Error::from(FileError::Io { action, path, source }).exit()
        };
        assert_eq!(io("open", io::ErrorKind::NotFound), Exit::BadInput);
        assert_eq!(io("open", io::ErrorKind::Other), Exit::Failed);
        assert_eq!(io("write", io::ErrorKind::PermissionDenied), Exit::Failed);
        let error = FileError::damaged(&PathBuf::from("x.parquet"));
        assert_eq!(Error::Plot(error.into()).exit(), Exit::BadInput);
    }
}
