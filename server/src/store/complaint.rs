//! Errors of what is tried again and again.

use super::error::{Result, StoreError};

/// An error of what is tried again and again: told in the log once, and not each time.
#[derive(Debug)]
pub struct Complaint {
    what: &'static str,
    told: String,
}

impl Complaint {
    /// About what could not be done.
    pub fn new(what: &'static str) -> Complaint {
        let told = String::new();
        Complaint { what, told }
    }

    /// What was done; `None` if it failed, which the log is told if it is new.
    pub fn note<T>(&mut self, done: Result<T>) -> Option<T> {
        let cause = match done {
            Ok(done) => {
                self.told.clear();
                return Some(done);
            }
            Err(StoreError::Broken(_)) => return None, // it was told that nothing is stored any more
            Err(cause) => cause.to_string(),
        };
        if self.told != cause {
            tracing::error!(cause, "{}: {cause}", self.what);
            self.told = cause;
        }
        None
    }
}
