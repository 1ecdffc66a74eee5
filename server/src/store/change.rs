//! One transaction of the single writer, and what follows from it once it is on the disk: moves in the
//! line of waiting jobs, and events that watchers may be told of.

use sqlx::{Sqlite, SqliteConnection, Transaction};
use tokio::sync::MutexGuard;

use super::{database::Store, error::Result, line::Move};

/// An open transaction.
pub(super) struct Change<'a> {
    store: &'a Store,
    tx: Transaction<'static, Sqlite>,
    moves: Vec<Move>,
    /// Jobs that watchers may look at again.
    changed: Vec<i64>,
    /// Until the line has moved nobody else begins: moves are made in the order of their commits.
    _turn: MutexGuard<'a, ()>,
}

/// How far a transaction had come, to go back to.
#[derive(Clone, Copy)]
pub(super) struct Mark {
    moves: usize,
    changed: usize,
}

impl Store {
    pub(super) async fn change(&self) -> Result<Change<'_>> {
        let turn = self.turn.lock().await;
        Ok(Change {
            _turn: turn,
            store: self,
            tx: self.begin().await?,
            moves: vec![],
            changed: vec![],
        })
    }
}

impl Change<'_> {
    pub(super) fn sql(&mut self) -> &mut SqliteConnection {
        &mut self.tx
    }

    pub(super) fn moves(&mut self, step: Move) {
        self.moves.push(step);
    }

    pub(super) fn changed(&mut self, key: i64) {
        self.changed.push(key);
    }

    /// Jobs that this part has changed.
    pub(super) fn changed_since(&self, mark: Mark) -> Vec<i64> {
        self.changed
            .get(mark.changed..)
            .unwrap_or_default()
            .to_vec()
    }

    /// Jobs that wait, those of this transaction among them.
    pub(super) fn waiting(&self) -> usize {
        let entered = |step: &Move| match step {
            Move::Enter { .. } | Move::Join => 1,
            Move::Leave { .. } | Move::Part => -1,
        };
        let change: isize = self.moves.iter().map(entered).sum();
        self.store
            .line()
            .len()
            .checked_add_signed(change)
            .unwrap_or(0)
    }

    /// Begins a part that can be undone alone.
    pub(super) async fn mark(&mut self) -> Result<Mark> {
        sqlx::query("savepoint part").execute(self.sql()).await?;
        Ok(Mark {
            moves: self.moves.len(),
            changed: self.changed.len(),
        })
    }

    /// Keeps the part that began last.
    pub(super) async fn keep(&mut self) -> Result<()> {
        sqlx::query("release part").execute(self.sql()).await?;
        Ok(())
    }

    /// Undoes the part that began at this mark.
    pub(super) async fn undo(&mut self, mark: Mark) -> Result<()> {
        sqlx::query("rollback to part").execute(self.sql()).await?;
        self.keep().await?;
        self.moves.truncate(mark.moves);
        self.changed.truncate(mark.changed);
        Ok(())
    }

    /// On the disk when this returns. Only then the line moves. Gives the jobs that have changed.
    pub(super) async fn commit(self) -> Result<Vec<i64>> {
        self.tx.commit().await?;
        let mut line = self.store.line();
        self.moves.into_iter().for_each(|step| line.make(step));
        Ok(self.changed)
    }
}
