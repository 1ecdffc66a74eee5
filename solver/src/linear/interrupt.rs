//! Interruption points in long work, at which the work may be stopped.

/// Calls a function whenever a portion of work is done; the function says whether to stop the work. Work is counted in
/// operations and not in seconds, since the solver has no clock.
pub struct Interrupt<'a> {
    stop: &'a mut dyn FnMut() -> bool,
    done: f64,
}

/// A list of zeros, filled with interruption points in between: the first touch of a GiB takes up to a second. `None`
/// if there is not enough memory.
pub(super) fn zeros(
    count: usize,
    interrupt: &mut Interrupt<'_>,
) -> Result<Option<Vec<f64>>, Stopped> {
    /// The number of values written between two interruption points: 32 MiB.
    const AT_ONCE: usize = 4 << 20;
    let mut values = Vec::new();
    if values.try_reserve_exact(count).is_err() {
        return Ok(None);
    }
    while values.len() < count {
        let more = AT_ONCE.min(count - values.len());
        values.resize(values.len() + more, 0.0);
        // so that every whole piece asks
        interrupt.worked(PORTION * more as f64 / AT_ONCE as f64)?;
    }
    Ok(Some(values))
}

/// A list of zeros that take no memory until they are written, since the system provides each page only then. `None` if
/// there is not enough memory.
pub(super) fn untouched_zeros(count: usize) -> Option<Vec<f64>> {
    bytemuck::allocation::try_zeroed_vec(count).ok()
}

/// The error of work that was stopped on request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stopped;

/// The work between two interruption points, in multiplications: 5 to 50 ms.
pub(super) const PORTION: f64 = 5e7;

impl<'a> Interrupt<'a> {
    /// Interruption points that call `stop`, which returns whether to stop.
    pub fn new(stop: &'a mut dyn FnMut() -> bool) -> Self {
        Interrupt { stop, done: 0.0 }
    }

    /// Counts finished work (multiplications), and calls the function `stop` if a portion is complete.
    pub fn worked(&mut self, work: f64) -> Result<(), Stopped> {
        self.done += work;
        if self.done < PORTION {
            return Ok(());
        }
        self.done = 0.0;
        self.ask()
    }

    /// Calls the function `stop` now; an error if it says to stop.
    pub fn ask(&mut self) -> Result<(), Stopped> {
        match (self.stop)() {
            true => Err(Stopped),
            false => Ok(()),
        }
    }
}
