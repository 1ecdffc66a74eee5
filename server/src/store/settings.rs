//! Settings that can be changed while the service runs, and are kept across restarts.

use std::sync::{Arc, atomic::Ordering};

use super::{database::Store, error::Result};
use crate::memory::Budget;

impl Store {
    /// Reads the settings, when the store is opened.
    pub(super) async fn read_settings(&self) -> Result<()> {
        let paused: bool =
            sqlx::query_scalar("select exists (select 1 from setting where name = 'queue_paused')")
                .fetch_one(&self.reader)
                .await?;
        self.paused.store(paused, Ordering::Relaxed);
        Ok(())
    }

    /// Sets the memory that running jobs share; once and before any is claimed.
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

    /// Pauses or resumes the queue; kept across restarts.
    pub async fn set_paused(&self, paused: bool) -> Result<()> {
        self.control(|| self.write_paused(paused)).await?;
        self.paused.store(paused, Ordering::Relaxed);
        Ok(())
    }

    async fn write_paused(&self, paused: bool) -> Result<()> {
        let mut tx = self.begin_control().await?;
        let statement = if paused {
            "insert into setting (name, value) values ('queue_paused', 'true') on conflict do nothing"
        } else {
            "delete from setting where name = 'queue_paused'"
        };
        sqlx::query(statement).execute(&mut *tx).await?;
        tx.commit().await
    }
}
