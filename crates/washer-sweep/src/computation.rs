//! Runs the engine's computations without the interpreter's lock, and lets Python's signals stop
//! them.

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

/// The options of a computation that Python's keywords set.
#[derive(Clone, Copy)]
pub(crate) struct ComputationOptions {
    pub(crate) threads: Option<usize>,
    /// Whether progress is shown.
    pub(crate) progress: bool,
}

impl ComputationOptions {
    fn execution(self, interrupt: &Interrupt) -> Execution<'_> {
        let progress = if self.progress { ProgressMode::Auto } else { ProgressMode::None };
        Execution { threads: self.threads, progress, interrupt }
    }
}

/// The result of a computation, and the exception that a signal handler raised in the meantime.
pub(crate) struct Supervised<T> {
    value: Result<T, Error>,
    raised_exception: Option<PyErr>,
}

impl<T> Supervised<T> {
    /// Returns the value, or raises its error. After Ctrl-C raises the exception that
    /// `interrupted` creates from the value; exceptions of other signal handlers are raised
    /// unchanged.
    pub(crate) fn value_or_raise(
        self,
        py: Python<'_>,
        interrupted: impl FnOnce(Result<T, Error>) -> PyErr,
    ) -> PyResult<T> {
        match self.raised_exception {
            None => self.value.map_err(|error| errors::to_exception(py, &error)),
            Some(raised_exception)
                if raised_exception.is_instance_of::<PyKeyboardInterrupt>(py) =>
            {
                Err(interrupted(self.value))
            }
            Some(raised_exception) => Err(raised_exception),
        }
    }
}

/// Waits for the result of a computation, and checks for signals in the meantime. A signal whose
/// handler raises an exception, such as Ctrl-C, raises the interrupt; the function then returns at
/// once if the computation `is_abandoned`. A computation that panics has no result.
fn wait_for_result<T>(
    results: &Receiver<T>,
    interrupt: &Interrupt,
    is_abandoned: bool,
) -> (Option<T>, Option<PyErr>) {
    let mut raised_exception = None;
    loop {
        let reception = results.recv_timeout(SIGNAL_POLL_INTERVAL);
        // Signals are checked after the end of the computation as well, because one may have
        // arrived just before.
        if raised_exception.is_none() {
            raised_exception = Python::attach(|py| py.check_signals().err());
            if raised_exception.is_some() {
                // The number of SIGINT.
                interrupt.raise(2);
            }
        }
        let is_running = reception.as_ref().err() == Some(&RecvTimeoutError::Timeout);
        if !is_running || is_abandoned && raised_exception.is_some() {
            return (reception.ok(), raised_exception);
        }
    }
}

/// Runs a computation like [`supervise`], but does not wait for its end after Ctrl-C: the thread
/// ends by itself, and its result is dropped.
pub(crate) fn supervise_abandonable<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    computation: impl FnOnce(Execution<'_>) -> Result<Option<T>, Error> + Send + 'static,
) -> PyResult<T> {
    let result = py.detach(|| {
        let (sender, results) = channel();
        let interrupt = Interrupt::new();
        let thread_interrupt = interrupt.clone();
        let run_and_send = move || {
            // The receiver no longer exists if the computation was abandoned.
            let _ = sender.send(computation(
                ComputationOptions { threads, progress: false }.execution(&thread_interrupt),
            ));
        };
        Builder::new().spawn(run_and_send).map_err(thread_error)?;
        match wait_for_result(&results, &interrupt, true) {
            (_, Some(raised_exception)) => Err(raised_exception),
            (value, None) => value.ok_or_else(panic_error),
        }
    });
    let value = result.map_err(|raised_exception| {
        match raised_exception.is_instance_of::<PyKeyboardInterrupt>(py) {
            true => errors::interrupted_without_result_error(py),
            false => raised_exception,
        }
    })?;
    value
        .map_err(|error| errors::to_exception(py, &error))?
        .ok_or_else(|| errors::interrupted_without_result_error(py))
}

fn thread_error(error: std::io::Error) -> PyErr {
    PyRuntimeError::new_err(format!("cannot start a thread: {error}"))
}

fn panic_error() -> PyErr {
    PyRuntimeError::new_err("the engine panicked: please report this with the plan")
}

/// Runs a computation on another thread while this one checks for signals. A signal whose handler
/// raises an exception, such as Ctrl-C, raises the interrupt; the function waits for the end of the
/// computation.
pub(crate) fn supervise<T: Send>(
    py: Python<'_>,
    options: ComputationOptions,
    computation: impl FnOnce(Execution<'_>) -> Result<T, Error> + Send,
) -> PyResult<Supervised<T>> {
    py.detach(|| {
        let interrupt = Interrupt::new();
        std::thread::scope(|scope| {
            let (sender, results) = channel();
            let interrupt = &interrupt;
            let run_and_send = move || {
                // The receiver exists, because this function waits for the computation.
                let _ = sender.send(computation(options.execution(interrupt)));
            };
            let worker = Builder::new().spawn_scoped(scope, run_and_send).map_err(thread_error)?;
            let (value, raised_exception) = wait_for_result(&results, interrupt, false);
            // Without this join the scope would propagate a panic of the thread.
            let _ = worker.join();
            value.map(|value| Supervised { value, raised_exception }).ok_or_else(panic_error)
        })
    })
}
