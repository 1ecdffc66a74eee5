//! Settings that can be changed while the service runs, and are kept across restarts; and the memory budget.

use std::sync::{Arc, atomic::Ordering};

use base::memory::Budget;

use super::{changes::Changed, database::Store, error::Result, sql::Sql};

impl Store {
    /// Reads the settings, when the store is opened.
    pub(super) async fn read_settings(self: &Arc<Self>) -> Result<()> {
        self.read(|store, connection| {
            let paused = "select exists (select 1 from setting where name = 'queue_paused')";
            let paused = connection.value(paused, ())?;
            store.paused.store(paused, Ordering::Relaxed);
            Ok(())
        })
        .await
    }

    /// Sets the memory that running jobs share; must be called once, before any job is claimed.
    pub fn set_budget(&self, budget: Arc<Budget>) {
        let _ = self.budget.set(budget); // fails if it is set already, which is kept
    }

    /// The memory that running jobs share.
    pub fn budget(&self) -> &Arc<Budget> {
        self.budget.get_or_init(|| Budget::new(u64::MAX, 1, 0))
    }

    /// Whether the queue is paused.
    pub fn is_paused(&self) -> bool {
        self.paused.load(Ordering::Relaxed)
    }

    /// The memory of the largest worker elsewhere (bytes), as it was stored last; 0 if there was none.
    pub async fn workers_memory(self: &Arc<Self>) -> Result<u64> {
        self.read(|_, connection| {
            let bytes = "select value from setting where name = 'workers_memory'";
            let bytes: Option<String> = connection.optional_value(bytes, ())?;
            Ok(bytes.and_then(|bytes| bytes.parse().ok()).unwrap_or(0))
        })
        .await
    }

    /// Stores the memory of the largest worker elsewhere (bytes).
    pub async fn set_workers_memory(self: &Arc<Self>, bytes: u64) -> Result<()> {
        self.control(move |writer| {
            let tx = writer.begin_control()?;
            let statement = "insert into setting (name, value) values ('workers_memory', ?)
                             on conflict do update set value = excluded.value";
            tx.run(statement, [bytes.to_string()])?;
            tx.commit()?;
            Ok(())
        })
        .await
    }

    /// Pauses or resumes the queue; this is kept across restarts.
    pub async fn set_paused(self: &Arc<Self>, paused: bool) -> Result<()> {
        self.control(move |writer| {
            let tx = writer.begin_control()?;
            let statement = if paused {
                "insert into setting (name, value) values ('queue_paused', 'true') on conflict do nothing"
            } else {
                "delete from setting where name = 'queue_paused'"
            };
            tx.run(statement, ())?;
            tx.commit()?;
            writer.store.paused.store(paused, Ordering::Relaxed);
            writer.store.changes.note([Changed::Queue]);
            Ok(())
        })
        .await
    }
}
