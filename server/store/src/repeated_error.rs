//! Errors of operations that are retried periodically.

use super::error::{Result, StoreError};

/// The last error of an operation that is retried periodically, which is logged only when it changes.
#[derive(Debug)]
pub struct RepeatedError {
    what: &'static str,
    logged: String,
}

impl RepeatedError {
    /// No error yet; the lines of the log about errors begin with `what`.
    pub fn new(what: &'static str) -> RepeatedError {
        let logged = String::new();
        RepeatedError { what, logged }
    }

    /// The result of an attempt; `None` if it failed. An error is logged if it differs from the last one.
    pub fn note<T>(&mut self, done: Result<T>) -> Option<T> {
        let cause = match done {
            Ok(done) => {
                self.logged.clear();
                return Some(done);
            }
            Err(StoreError::Broken(_)) => return None, // logged already: nothing is stored any more
            Err(cause) => cause.to_string(),
        };
        if self.logged != cause {
            tracing::error!(cause, "{}: {cause}", self.what);
            self.logged = cause;
        }
        None
    }
}
