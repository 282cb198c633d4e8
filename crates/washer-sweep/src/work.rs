//! The engine's work under Python's eyes: without the interpreter's lock, stopped by its signals.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Duration;

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use sweep::{Effort, Error, Interrupt, ProgressMode};

use crate::errors;

/// How often signals are looked for.
const LOOK_UP: Duration = Duration::from_millis(50);

/// How a work is to be done, as keywords say.
#[derive(Clone, Copy)]
pub(crate) struct How {
    pub(crate) threads: Option<usize>,
    /// Whether progress is shown.
    pub(crate) progress: bool,
}

impl How {
    fn until(self, interrupt: &Interrupt) -> Effort<'_> {
        let progress = if self.progress { ProgressMode::Auto } else { ProgressMode::None };
        Effort { threads: self.threads, progress, interrupt }
    }
}

/// What came of a work, and what a signal's handler has raised meanwhile.
pub(crate) struct Attended<T> {
    value: Result<T, Error>,
    raised: Option<PyErr>,
}

impl<T> Attended<T> {
    /// The value, unless it is an error or a handler raised: Ctrl-C becomes what `interrupted`
    /// makes of the value, and anything else goes on as it is.
    pub(crate) fn or_raise(
        self,
        py: Python<'_>,
        interrupted: impl FnOnce(Result<T, Error>) -> PyErr,
    ) -> PyResult<T> {
        match self.raised {
            None => self.value.map_err(|error| errors::error(py, &error)),
            Some(raised) if raised.is_instance_of::<PyKeyboardInterrupt>(py) => {
                Err(interrupted(self.value))
            }
            Some(raised) => Err(raised),
        }
    }
}

/// Waits for what a work sends, and looks for signals meanwhile. A signal whose handler raises, as
/// Ctrl-C's does, raises the interrupt; a work that `is_left` then is not waited for. Nothing comes
/// of a work that panics.
fn waited<T>(
    ended: &Receiver<T>,
    interrupt: &Interrupt,
    is_left: bool,
) -> (Option<T>, Option<PyErr>) {
    let mut raised = None;
    loop {
        let come = ended.recv_timeout(LOOK_UP);
        // Of a work that is done too: a signal since the last look is its own.
        if raised.is_none() {
            raised = Python::attach(|py| py.check_signals().err());
            if raised.is_some() {
                // As SIGINT would.
                interrupt.raise(2);
            }
        }
        let goes_on = come.as_ref().err() == Some(&RecvTimeoutError::Timeout);
        if !goes_on || is_left && raised.is_some() {
            return (come.ok(), raised);
        }
    }
}

/// As [`attended`], for a work of which nothing is worth waiting for: Ctrl-C raises the interrupt
/// and leaves the thread to end by itself, and what comes of it is dropped.
pub(crate) fn abandonable<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    work: impl FnOnce(Effort<'_>) -> Result<Option<T>, Error> + Send + 'static,
) -> PyResult<T> {
    let left = py.detach(|| {
        let (done, ended) = channel();
        let interrupt = Interrupt::new();
        let of_work = interrupt.clone();
        let work = move || {
            // Nobody may wait for it any more.
            let _ = done.send(work(How { threads, progress: false }.until(&of_work)));
        };
        Builder::new().spawn(work).map_err(no_thread)?;
        match waited(&ended, &interrupt, true) {
            (_, Some(raised)) => Err(raised),
            (value, None) => value.ok_or_else(panicked),
        }
    });
    let value = left.map_err(|raised| match raised.is_instance_of::<PyKeyboardInterrupt>(py) {
        true => errors::early(py),
        false => raised,
    })?;
    value.map_err(|error| errors::error(py, &error))?.ok_or_else(|| errors::early(py))
}

fn no_thread(error: std::io::Error) -> PyErr {
    PyRuntimeError::new_err(format!("cannot start a thread: {error}"))
}

fn panicked() -> PyErr {
    PyRuntimeError::new_err("the engine panicked: please report this with the plan")
}

/// Does a work on a thread of its own while this one looks for signals. A signal whose handler
/// raises, as Ctrl-C's does, raises the interrupt, and the work is waited for.
pub(crate) fn attended<T: Send>(
    py: Python<'_>,
    how: How,
    work: impl FnOnce(Effort<'_>) -> Result<T, Error> + Send,
) -> PyResult<Attended<T>> {
    py.detach(|| {
        let interrupt = Interrupt::new();
        std::thread::scope(|scope| {
            let (done, ended) = channel();
            let interrupt = &interrupt;
            let work = move || {
                // The receiver waits for it.
                let _ = done.send(work(how.until(interrupt)));
            };
            let worker = Builder::new().spawn_scoped(scope, work).map_err(no_thread)?;
            let (value, raised) = waited(&ended, interrupt, false);
            // Joined here, or the scope would pass a panic on.
            let _ = worker.join();
            value.map(|value| Attended { value, raised }).ok_or_else(panicked)
        })
    })
}
