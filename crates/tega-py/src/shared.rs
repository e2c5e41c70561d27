//! Share a kernel among Python threads: its state behind a lock, and when others may run while it works.

use std::sync::{Mutex, PoisonError, TryLockError};

use pyo3::prelude::*;

/// What is done with more samples, pixels or bytes than this takes long, unless measured to be quicker.
pub(crate) const KEEP_UP_TO: usize = 4096;

/// Work without the interpreter lock if that takes `long`. In a busy interpreter, getting the lock back takes longer than
/// short work.
pub(crate) fn released<T: Send>(py: Python<'_>, long: bool, work: impl FnOnce() -> T + Send) -> T {
    if long { py.detach(work) } else { work() }
}

/// The state of a frozen class. `PyO3` refuses to lend a class mutably while another thread looks at it, and raises
/// there; a frozen class with this inside has the other thread wait instead.
pub(crate) struct Shared<T>(Mutex<T>);

impl<T: Send> Shared<T> {
    pub(crate) fn new(state: T) -> Self {
        Self(Mutex::new(state))
    }

    /// Work on the state, alone. `work` touches no Python object: a thread that holds the state and waits for the
    /// interpreter would wait for one that holds the interpreter and waits for the state.
    ///
    /// While another thread works on the state, this one waits without the interpreter lock, so that all others go on.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        loop {
            match self.0.try_lock() {
                Ok(mut state) => return work(&mut state),
                Err(TryLockError::Poisoned(poisoned)) => return work(&mut poisoned.into_inner()),
                Err(TryLockError::WouldBlock) => {
                    Python::attach(|py| {
                        py.detach(|| drop(self.0.lock().unwrap_or_else(PoisonError::into_inner)));
                    });
                }
            }
        }
    }
}
