//! The engine's work under Python's eyes: without the interpreter's lock, stopped by its signals.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use sweep::Interrupt;

use crate::errors;

/// How often signals are looked for.
const LOOK_UP: Duration = Duration::from_millis(50);

/// What came of a work, and what a signal's handler has raised meanwhile.
pub(crate) struct Attended<T> {
    pub(crate) value: T,
    pub(crate) raised: Option<PyErr>,
}

impl<T> Attended<T> {
    /// The value, unless a handler raised: Ctrl-C becomes what `interrupted` makes of the value,
    /// and anything else goes on as it is.
    pub(crate) fn or_raise(
        self,
        py: Python<'_>,
        interrupted: impl FnOnce(T) -> PyErr,
    ) -> PyResult<T> {
        match self.raised {
            None => Ok(self.value),
            Some(raised) if raised.is_instance_of::<PyKeyboardInterrupt>(py) => {
                Err(interrupted(self.value))
            }
            Some(raised) => Err(raised),
        }
    }
}

/// As [`attended`], for a work of which nothing is worth waiting for: Ctrl-C raises the interrupt
/// and leaves the thread to end by itself, and what comes of it is dropped.
pub(crate) fn abandonable<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Interrupt) -> T + Send + 'static,
) -> PyResult<T> {
    let left = py.detach(|| {
        let (done, ended) = channel();
        let interrupt = Interrupt::new();
        let of_work = interrupt.clone();
        let work = move || {
            // Nobody may wait for it any more.
            let _ = done.send(work(&of_work));
        };
        std::thread::Builder::new().spawn(work).map_err(no_thread)?;
        loop {
            let come = ended.recv_timeout(LOOK_UP);
            // Of a work that is done too: a signal since the last look is its own.
            if let Err(raised) = Python::attach(|py| py.check_signals()) {
                // As SIGINT would.
                interrupt.raise(2);
                return Err(raised);
            }
            match come {
                Ok(value) => return Ok(value),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(panicked()),
            }
        }
    });
    left.map_err(|raised| match raised.is_instance_of::<PyKeyboardInterrupt>(py) {
        true => errors::early(py),
        false => raised,
    })
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
    work: impl FnOnce(&Interrupt) -> T + Send,
) -> PyResult<Attended<T>> {
    py.detach(|| {
        let interrupt = Interrupt::new();
        let mut raised = None;
        std::thread::scope(|scope| {
            let (done, ended) = channel();
            let interrupt = &interrupt;
            let work = move || {
                // The receiver waits for it.
                let _ = done.send(work(interrupt));
            };
            let worker =
                std::thread::Builder::new().spawn_scoped(scope, work).map_err(no_thread)?;
            loop {
                let come = ended.recv_timeout(LOOK_UP);
                if raised.is_none() {
                    raised = Python::attach(|py| py.check_signals().err());
                    if raised.is_some() {
                        // As SIGINT would.
                        interrupt.raise(2);
                    }
                }
                match come {
                    Ok(value) => return Ok(Attended { value, raised }),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => {
                        // Joined here, or the scope would pass the panic on.
                        let _ = worker.join();
                        return Err(panicked());
                    }
                }
            }
        })
    })
}
