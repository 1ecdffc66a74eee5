//! Pauses in long work, in which it asks whether to go on.

use std::ops::ControlFlow;

/// Asks whether to go on whenever another portion of work has been done. Work is counted in operations and not in
/// seconds, since the solver has no clock.
pub struct Breaks<'a> {
    ask: &'a mut dyn FnMut() -> ControlFlow<()>,
    done: f64,
}

/// Zeros for a matrix, with questions: the first touch of a GiB takes up to a second. `None` if there is not so much
/// memory.
pub(super) fn zeros(count: usize, breaks: &mut Breaks<'_>) -> Result<Option<Vec<f64>>, Stopped> {
    /// Numbers written between two questions: 32 MiB.
    const AT_ONCE: usize = 4 << 20;
    let mut values = Vec::new();
    if values.try_reserve_exact(count).is_err() {
        return Ok(None);
    }
    while values.len() < count {
        let more = AT_ONCE.min(count - values.len());
        values.resize(values.len() + more, 0.0);
        // so that every whole piece asks
        breaks.after(PORTION * more as f64 / AT_ONCE as f64)?;
    }
    Ok(Some(values))
}

/// Zeros that take no memory until they are written: the system hands out each page then. `None` if there is not so much
/// memory.
pub(super) fn untouched_zeros(count: usize) -> Option<Vec<f64>> {
    bytemuck::allocation::try_zeroed_vec(count).ok()
}

/// The work was stopped on request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

/// Multiplications between two questions: 5 to 50 ms.
pub(super) const PORTION: f64 = 5e7;

impl<'a> Breaks<'a> {
    /// Pauses in which `ask` is called; it answers whether to go on.
    pub fn new(ask: &'a mut dyn FnMut() -> ControlFlow<()>) -> Self {
        Breaks { ask, done: 0.0 }
    }

    /// Notes work that has been done (multiplications), and asks if it is time to.
    pub fn after(&mut self, work: f64) -> Result<(), Stopped> {
        self.done += work;
        if self.done < PORTION {
            return Ok(());
        }
        self.done = 0.0;
        self.ask()
    }

    /// Asks now.
    pub fn ask(&mut self) -> Result<(), Stopped> {
        match (self.ask)() {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Stopped),
        }
    }
}
