//! Independent tasks on one thread or on several, with the same result.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::sync_channel;
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread;

use super::interrupt::{Interrupt, Stopped};

/// Runs all tasks, on as many threads as there are workspaces. Each thread takes the next task as soon as it is free,
/// so the result of a task must not depend on the earlier use of its workspace.
///
/// The error is the one that a single thread would find first. Only the calling thread asks its `interrupt` whether to
/// continue; while it waits, it asks whenever another thread has done a portion of work.
pub(super) fn for_each<T: Send, W: Send, E: From<Stopped> + PartialEq + Send>(
    tasks: impl Iterator<Item = T> + Send,
    workspaces: &mut [W],
    work: impl Fn(&mut W, T, &mut Interrupt<'_>) -> Result<(), E> + Sync,
    interrupt: &mut Interrupt<'_>,
) -> Result<(), E> {
    let [own, others @ ..] = workspaces else {
        return Ok(());
    };
    if others.is_empty() {
        return tasks
            .into_iter()
            .try_for_each(|task| work(own, task, interrupt));
    }
    let (tasks, stopped) = (Mutex::new(tasks.enumerate()), AtomicBool::new(false));
    let failed = AtomicBool::new(false);
    // tasks are begun in their order, so all before one that fails are done as well
    let work_on = |workspace: &mut W, interrupt: &mut Interrupt<'_>| {
        let _stops = StopOnPanic([&failed, &stopped]);
        while !failed.load(Relaxed) {
            let next = tasks.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((number, task)) = next else { break };
            if let Err(error) = work(workspace, task, interrupt) {
                failed.store(true, Relaxed);
                return Some((number, error));
            }
        }
        None
    };
    let mut errors = Vec::new();
    thread::scope(|scope| {
        // a question that is waiting already stands for all
        let (ask, questions) = sync_channel::<()>(1);
        let start = |workspace| {
            // dropped when the thread ends, however it does
            let (ask, stopped, work_on) = (ask.clone(), &stopped, &work_on);
            let run = move || {
                let mut stop = || {
                    let _ = ask.try_send(());
                    stopped.load(Relaxed)
                };
                work_on(workspace, &mut Interrupt::new(&mut stop))
            };
            // where the system has no more threads, fewer do the work
            thread::Builder::new().spawn_scoped(scope, run).ok()
        };
        let threads: Vec<_> = others.iter_mut().filter_map(start).collect();
        drop(ask);
        let own_error = work_on(own, interrupt);
        if let Some((_, error)) = &own_error
            && *error == Stopped.into()
        {
            stopped.store(true, Relaxed);
        }
        errors.extend(own_error);
        // until all have ended
        for () in questions {
            if !stopped.load(Relaxed) && interrupt.ask().is_err() {
                stopped.store(true, Relaxed);
                failed.store(true, Relaxed);
            }
        }
        for thread in threads {
            errors.extend(thread.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
    });
    if stopped.into_inner() {
        return Err(Stopped.into());
    }
    match errors.into_iter().min_by_key(|(number, _)| *number) {
        Some((_, error)) => Err(error),
        None => Ok(()),
    }
}

/// Runs all tasks, on as many threads as there are workspaces, at least one, and adds up what they find: `add` gets each workspace after
/// its task, in the order of the tasks, and one at a time. Sums have the same bits on any number of threads.
///
/// What `work` finds is therefore in its workspace. A thread waits for the tasks before its own until they are added: tasks
/// should be alike, and the work on them longer than adding. `size`: the work on a task, in multiplications.
pub fn for_each_in_order<T: Send, W: Send>(
    (tasks, size): (impl Iterator<Item = T> + Send, f64),
    workspaces: &mut [W],
    work: impl Fn(&mut W, &T) + Sync,
    add: impl FnMut(&mut W, T) + Send,
    interrupt: &mut Interrupt<'_>,
) -> Result<(), Stopped> {
    let (turn, changed) = (Mutex::new((0, add)), Condvar::new());
    let work = |workspace: &mut W, (number, task), interrupt: &mut Interrupt<'_>| {
        let _passes = PassesOnPanic(|| {
            turn.lock().unwrap_or_else(PoisonError::into_inner).0 = usize::MAX;
            changed.notify_all();
        });
        work(workspace, &task);
        // of the tasks that are begun, the first one never waits: it is not stopped before it has added
        let next = turn.lock().unwrap_or_else(PoisonError::into_inner);
        let next = changed.wait_while(next, |(next, _)| *next < number);
        let mut next = next.unwrap_or_else(PoisonError::into_inner);
        if next.0 != number {
            return Err(Stopped);
        }
        (next.1)(workspace, task);
        next.0 += 1;
        drop(next);
        changed.notify_all();
        interrupt.worked(size)
    };
    for_each(tasks.enumerate(), workspaces, work, interrupt)
}

/// Lets the other threads pass, and stop, if the thread that holds it panics.
struct PassesOnPanic<F: Fn()>(F);

impl<F: Fn()> Drop for PassesOnPanic<F> {
    fn drop(&mut self) {
        if thread::panicking() {
            (self.0)();
        }
    }
}

/// Stops the other threads if the thread that holds it panics.
struct StopOnPanic<'a>([&'a AtomicBool; 2]);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.iter().for_each(|flag| flag.store(true, Relaxed));
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::sync::Barrier;

    use super::super::interrupt::PORTION;
    use super::*;

    #[derive(Debug, PartialEq)]
    enum Error {
        Stopped,
        Bad(usize),
    }

    impl From<Stopped> for Error {
        fn from(_: Stopped) -> Self {
            Error::Stopped
        }
    }

    fn never() -> bool {
        false
    }

    #[test]
    fn every_task_is_done_once_and_all_threads_take_part() {
        for threads in [1, 2, 3] {
            let mut results = vec![0; 100];
            let mut counts = vec![0; threads];
            // each thread waits in its first task until all have one
            let all = Barrier::new(threads);
            let work =
                |count: &mut i32, (i, result): (usize, &mut usize), _: &mut Interrupt<'_>| {
                    if *count == 0 {
                        all.wait();
                    }
                    *count += 1;
                    *result += i + 1;
                    Ok::<(), Error>(())
                };
            let tasks = results.iter_mut().enumerate();
            for_each(tasks, &mut counts, work, &mut Interrupt::new(&mut never)).unwrap();
            assert!(results.into_iter().eq(1..=100));
            assert!(counts.iter().all(|count| *count > 0) && counts.iter().sum::<i32>() == 100);
        }
    }

    #[test]
    fn the_error_is_that_of_the_first_task_that_fails() {
        for threads in [1, 2] {
            // of two that are begun, the later one fails first
            let failed = AtomicBool::new(threads == 1);
            let work = |(): &mut (), task: usize, _: &mut Interrupt<'_>| {
                if task == 1 {
                    failed.store(true, Relaxed);
                }
                while !failed.load(Relaxed) {
                    thread::yield_now();
                }
                Err(Error::Bad(task))
            };
            let mut workspaces = vec![(); threads];
            let failed = for_each(0..9, &mut workspaces, work, &mut Interrupt::new(&mut never));
            assert_eq!(failed, Err(Error::Bad(0)));
        }
    }

    #[test]
    fn all_threads_stop_with_the_first_and_it_asks_while_it_waits() {
        let both = Barrier::new(2);
        // one task each: the first one's is short, the other's goes on until it is stopped
        let work =
            |first: &mut bool, _: usize, interrupt: &mut Interrupt<'_>| -> Result<(), Error> {
                both.wait();
                if *first {
                    Ok(())
                } else {
                    loop {
                        interrupt.ask()?;
                    }
                }
            };
        let mut asked = 0;
        let mut stop_at_third = || {
            asked += 1;
            asked == 3
        };
        let mut interrupt = Interrupt::new(&mut stop_at_third);
        let stopped = for_each(0..2, &mut [true, false], work, &mut interrupt);
        assert_eq!((stopped, asked), (Err(Error::Stopped), 3));
    }

    #[test]
    fn what_tasks_find_is_added_in_their_order() {
        for threads in [1, 2, 3] {
            let mut sum = vec![];
            let all = Barrier::new(threads);
            let work = |(found, begun): &mut (usize, bool), task: &usize| {
                if !std::mem::replace(begun, true) {
                    all.wait();
                }
                // later tasks are done first
                (0..100 - task).for_each(|_| thread::yield_now());
                *found = 2 * task;
            };
            let add = |(found, _): &mut (usize, bool), task: usize| {
                assert_eq!(*found, 2 * task);
                sum.push(task);
            };
            let (tasks, workspaces) = ((0..100, 1.0), &mut vec![(0, false); threads]);
            let mut on = never;
            let interrupt = &mut Interrupt::new(&mut on);
            for_each_in_order(tasks, workspaces, work, add, interrupt).unwrap();
            assert!(sum.into_iter().eq(0..100));
        }
        // without an end, but for the stop
        let (work, add) = (|(): &mut (), _: &u64| (), |(): &mut (), _: u64| ());
        let mut stop = || true;
        let stop = &mut Interrupt::new(&mut stop);
        assert!(for_each_in_order((0.., PORTION), &mut [(), ()], work, add, stop).is_err());
    }

    /// Whichever task the thread that panics has, the other thread ends.
    #[test]
    fn a_panic_ends_the_wait_for_the_tasks_before() {
        for first in [true, false] {
            let both = Barrier::new(2);
            let work = |own: &mut bool, _: &i32| {
                both.wait();
                assert!(*own != first, "of one thread");
            };
            let add = |_: &mut bool, _: i32| ();
            let mut on = never;
            let interrupt = &mut Interrupt::new(&mut on);
            let tasks = (0..2, 1.0);
            let run = || for_each_in_order(tasks, &mut [true, false], work, add, interrupt);
            let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(run));
            assert_eq!(
                *panic.unwrap_err().downcast::<&str>().unwrap(),
                "of one thread"
            );
        }
    }

    #[test]
    #[should_panic(expected = "of the second thread")]
    fn a_panic_of_another_thread_is_passed_on() {
        let both = Barrier::new(2);
        let work = |first: &mut bool, _: usize, _: &mut Interrupt<'_>| {
            both.wait();
            assert!(*first, "of the second thread");
            Ok::<(), Error>(())
        };
        let _ = for_each(
            0..2,
            &mut [true, false],
            work,
            &mut Interrupt::new(&mut never),
        );
    }
}
