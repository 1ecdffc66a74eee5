//! Runs work on other threads and in separate tasks.
//!
//! An async or generic function is compiled in every crate that calls it, and the code that tokio adds to a task is long.
//! Here work of every type is put into one type of box, so that this code is compiled once.

use std::{pin::Pin, sync::Arc};

use parking_lot::Mutex;
use tokio::task::{JoinError, JoinHandle};

/// The place where work leaves its result when it has ended.
struct Slot<T>(Arc<Mutex<Option<T>>>);

impl<T> Slot<T> {
    fn new() -> Slot<T> {
        Slot(Arc::default())
    }

    fn another(&self) -> Slot<T> {
        Slot(self.0.clone())
    }

    fn fill(&self, result: T) {
        *self.0.lock() = Some(result);
    }

    fn take(&self) -> T {
        let result = self.0.lock().take();
        result.unwrap_or_else(|| unreachable!("the work has ended without a panic"))
    }
}

/// Runs work that may block, on a thread for such work. It is completed even if nobody waits for it any more.
///
/// # Errors
///
/// The work has panicked, or tokio stops.
pub async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, JoinError> {
    let slot = Slot::new();
    let result = slot.another();
    on_a_thread(Box::new(move || slot.fill(work()))).await?;
    Ok(result.take())
}

/// Runs a task, which is completed even if nobody waits for it any more.
///
/// # Errors
///
/// The task has panicked, or tokio stops.
pub async fn detached<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> Result<T, JoinError> {
    let slot = Slot::new();
    let result = slot.another();
    in_a_task(Box::pin(async move { slot.fill(work.await) })).await?;
    Ok(result.take())
}

fn on_a_thread(work: Box<dyn FnOnce() + Send>) -> JoinHandle<()> {
    tokio::task::spawn_blocking(work)
}

fn in_a_task(work: Pin<Box<dyn Future<Output = ()> + Send>>) -> JoinHandle<()> {
    tokio::spawn(work)
}
