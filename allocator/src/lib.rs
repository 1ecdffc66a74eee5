//! The system's allocator, which counts for each thread how many bytes it has taken and not given back, and asks for
//! huge pages.
//!
//! A job is solved on one thread (a second one that helps it works in the memory that the first has taken), so the
//! count of its thread is what the job holds; the server ends a job that outgrows its share. Published crates count
//! allocations for the whole process, or only within a closure for a test: none tells, in the middle of a job, what its
//! thread holds. The counting is therefore written here, in a crate that does nothing else: `GlobalAlloc` can only be
//! implemented with `unsafe`, which the other crates forbid.
//!
//! Large allocations ask for huge pages. A factor of a million unknowns is half a million pages of 4 KiB, and handing
//! out each of them takes the system as long as the arithmetic on it.
//!
//! Counting is two additions to a thread-local number, about a nanosecond. Bytes that another thread gives back are
//! subtracted from that thread's count: memory that a thread has taken and hands over to another stays in its own
//! count.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    // both constant and without a destructor: using them allocates nothing
    static HELD: Cell<i64> = const { Cell::new(0) };
    static HIGHEST: Cell<i64> = const { Cell::new(0) };
}

/// The system's allocator with a count for each thread, for `#[global_allocator]`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counting;

/// Makes memory of 128 KiB and more go back to the system as soon as it is freed, from now on. Otherwise glibc raises
/// this limit by itself, up to 32 MiB, when an allocation of that size is freed: the memory of a hundred responses or a
/// large mesh then stays with the process, in pieces. It costs no measurable time in a solution.
pub fn give_back_large_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: it only sets a parameter of malloc, whatever the other threads do
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, 128 << 10);
    }
}

/// Lets the process keep up to 2 MiB of freed memory at the end of each arena, from now on. Otherwise glibc gives it back
/// to the system from 128 KiB on: in a service, memory then goes back and forth with every few requests, which costs a
/// fifth of the submissions that it takes in a second. A command that runs once has no use for it.
pub fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: it only sets parameters of malloc, whatever the other threads do
    unsafe {
        libc::mallopt(libc::M_TRIM_THRESHOLD, 2 << 20);
        libc::mallopt(libc::M_TOP_PAD, 512 << 10);
    }
}

/// The size (bytes) from which an allocation asks for huge pages: four pages of the usual 2 MiB, since an allocation
/// that uses its last page in part takes up to one page too much. Most responses of a server are smaller.
const LARGE: usize = 8 << 20;

/// Asks for huge pages for this memory, where the system leaves that to programs; elsewhere does nothing.
fn ask_for_huge_pages(memory: *mut u8, size: usize) {
    #[cfg(target_os = "linux")]
    if size >= LARGE && !memory.is_null() {
        const PAGE: usize = 4096;
        let skipped = memory.align_offset(PAGE);
        let whole = (size - skipped) / PAGE * PAGE;
        // SAFETY: the pages lie within an allocation that has just been made, and the advice changes no content; where
        // it is not taken, for instance since pages are larger, there is nothing to do
        unsafe {
            libc::madvise(memory.add(skipped).cast(), whole, libc::MADV_HUGEPAGE);
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (memory, size);
}

/// The number of bytes that this thread has taken and not given back; negative if it has given back what other threads
/// took. 0 in a program that does not use [`Counting`].
pub fn held() -> i64 {
    HELD.get()
}

/// The highest value of [`held`] on this thread since [`forget_highest`].
pub fn highest() -> i64 {
    HIGHEST.get()
}

/// Sets the highest count of this thread to its present count.
pub fn forget_highest() {
    HIGHEST.set(HELD.get());
}

/// Adds to the count of this thread; `bytes` is negative for memory that is given back. Sizes are below `isize::MAX`.
fn count(bytes: i64) {
    let held = HELD.get().wrapping_add(bytes);
    HELD.set(held);
    if held > HIGHEST.get() {
        HIGHEST.set(held);
    }
}

// SAFETY: every call is passed to the system's allocator as it is, and its answer returned as it is; counting and asking
// for huge pages neither allocate nor unwind.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those that `System` asks for
        let memory = unsafe { System.alloc(layout) };
        if !memory.is_null() {
            count(layout.size() as i64);
            ask_for_huge_pages(memory, layout.size());
        }
        memory
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above
        let memory = unsafe { System.alloc_zeroed(layout) };
        if !memory.is_null() {
            count(layout.size() as i64);
            ask_for_huge_pages(memory, layout.size());
        }
        memory
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above; the memory is from `System`, since all of it is
        unsafe { System.dealloc(memory, layout) };
        count(-(layout.size() as i64));
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        // SAFETY: as above
        let moved = unsafe { System.realloc(memory, layout, new_size) };
        if !moved.is_null() {
            count(new_size as i64 - layout.size() as i64);
            ask_for_huge_pages(moved, new_size);
        }
        moved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[global_allocator]
    static COUNTING: Counting = Counting;

    #[test]
    fn what_a_thread_takes_is_counted_until_it_gives_it_back() {
        let before = held();
        forget_highest();
        let mut bytes: Vec<u8> = Vec::with_capacity(1000);
        assert_eq!(held() - before, 1000);
        bytes.reserve_exact(3000);
        assert_eq!(held() - before, 3000);
        let zeros = std::hint::black_box(vec![0u64; 500]);
        assert_eq!(held() - before, 7000);
        drop((bytes, zeros));
        assert_eq!(held() - before, 0);
        assert_eq!(highest() - before, 7000);
    }

    #[test]
    fn every_thread_has_its_own_count() {
        let bytes = vec![1u8; 100_000];
        let before = held();
        let there = std::thread::spawn(move || {
            let start = held();
            drop(bytes);
            held() - start
        });
        assert_eq!(there.join().ok(), Some(-100_000));
        assert!((held() - before).abs() < 10_000, "only the thread itself");
    }

    #[test]
    fn an_allocation_that_fails_counts_nothing() {
        let before = held();
        let mut bytes: Vec<u8> = Vec::new();
        assert!(bytes.try_reserve_exact(isize::MAX as usize - 8).is_err());
        assert_eq!(held(), before);
    }
}
