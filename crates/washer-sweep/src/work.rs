//! Runs the engine's work without the interpreter's lock, and lets Python's signals stop it.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Duration;

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use sweep::{Error, Execution, Interrupt, ProgressMode};

use crate::errors;

/// The interval at which signals are checked. Basis: too short for a user to notice after Ctrl-C.
/// Doubling it doubles the delay.
const SIGNAL_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// The options of work that Python's keywords set.
#[derive(Clone, Copy)]
pub(crate) struct WorkOptions {
    pub(crate) threads: Option<usize>,
    /// Whether progress is shown.
    pub(crate) progress: bool,
}

impl WorkOptions {
    fn execution(self, interrupt: &Interrupt) -> Execution<'_> {
        let progress = if self.progress { ProgressMode::Auto } else { ProgressMode::None };
        Execution { threads: self.threads, progress, interrupt }
    }
}

/// The result of work, and the exception that a signal handler raised during the work.
pub(crate) struct Supervised<T> {
    value: Result<T, Error>,
    raised: Option<PyErr>,
}

impl<T> Supervised<T> {
    /// Returns the value, or raises its error. After Ctrl-C it raises the exception that
    /// `interrupted` creates from the value; exceptions of other signal handlers are raised
    /// unchanged.
    pub(crate) fn value_or_raise(
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

/// Waits for the result of work, and checks for signals in the meantime. A signal whose handler
/// raises an exception, such as Ctrl-C, raises the interrupt; the function then returns at once if
/// the work `is_abandoned`. Work that panics has no result.
fn wait_for_result<T>(
    results: &Receiver<T>,
    interrupt: &Interrupt,
    is_abandoned: bool,
) -> (Option<T>, Option<PyErr>) {
    let mut raised = None;
    loop {
        let received = results.recv_timeout(SIGNAL_POLL_INTERVAL);
        // Signals are checked after the end of the work as well, because one may have arrived just
        // before.
        if raised.is_none() {
            raised = Python::attach(|py| py.check_signals().err());
            if raised.is_some() {
                // The number of SIGINT.
                interrupt.raise(2);
            }
        }
        let is_running = received.as_ref().err() == Some(&RecvTimeoutError::Timeout);
        if !is_running || is_abandoned && raised.is_some() {
            return (received.ok(), raised);
        }
    }
}

/// Runs work like [`supervise`], but does not wait for it after Ctrl-C: the thread ends by itself,
/// and its result is dropped.
pub(crate) fn supervise_abandonable<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    computation: impl FnOnce(Execution<'_>) -> Result<Option<T>, Error> + Send + 'static,
) -> PyResult<T> {
    let result = py.detach(|| {
        let (sender, results) = channel();
        let interrupt = Interrupt::new();
        let work_interrupt = interrupt.clone();
        let run_and_send = move || {
            // The receiver no longer exists if the work was abandoned.
            let _ = sender.send(computation(
                WorkOptions { threads, progress: false }.execution(&work_interrupt),
            ));
        };
        Builder::new().spawn(run_and_send).map_err(thread_error)?;
        match wait_for_result(&results, &interrupt, true) {
            (_, Some(raised)) => Err(raised),
            (value, None) => value.ok_or_else(panic_error),
        }
    });
    let value =
        result.map_err(|raised| match raised.is_instance_of::<PyKeyboardInterrupt>(py) {
            true => errors::interrupted_without_result(py),
            false => raised,
        })?;
    value
        .map_err(|error| errors::error(py, &error))?
        .ok_or_else(|| errors::interrupted_without_result(py))
}

fn thread_error(error: std::io::Error) -> PyErr {
    PyRuntimeError::new_err(format!("cannot start a thread: {error}"))
}

fn panic_error() -> PyErr {
    PyRuntimeError::new_err("the engine panicked: please report this with the plan")
}

/// Runs work on another thread while this one checks for signals. A signal whose handler raises an
/// exception, such as Ctrl-C, raises the interrupt; the function waits for the end of the work.
pub(crate) fn supervise<T: Send>(
    py: Python<'_>,
    options: WorkOptions,
    computation: impl FnOnce(Execution<'_>) -> Result<T, Error> + Send,
) -> PyResult<Supervised<T>> {
    py.detach(|| {
        let interrupt = Interrupt::new();
        std::thread::scope(|scope| {
            let (sender, results) = channel();
            let interrupt = &interrupt;
            let run_and_send = move || {
                // The receiver exists, because this function waits for the work.
                let _ = sender.send(computation(options.execution(interrupt)));
            };
            let worker = Builder::new().spawn_scoped(scope, run_and_send).map_err(thread_error)?;
            let (value, raised) = wait_for_result(&results, interrupt, false);
            // Without this join the scope would propagate a panic of the thread.
            let _ = worker.join();
            value.map(|value| Supervised { value, raised }).ok_or_else(panic_error)
        })
    })
}
