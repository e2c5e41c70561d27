//! A kernel with a state, in a class that several Python threads may use at once.

use std::sync::{Mutex, PoisonError};

/// The state of a frozen class. `PyO3` refuses to lend a class mutably while another thread looks at it, and raises
/// there; a frozen class with this inside has the other thread wait instead.
pub(crate) struct Shared<T>(Mutex<T>);

impl<T> Shared<T> {
    pub(crate) fn new(state: T) -> Self {
        Self(Mutex::new(state))
    }

    /// Work on the state, alone. `work` touches no Python object: a thread that holds the state and waits for the
    /// interpreter would wait for one that holds the interpreter and waits for the state.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
