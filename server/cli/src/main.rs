//! Starts the command line.

use std::process::ExitCode;

/// Counts the memory that each job holds (`base::memory`).
#[global_allocator]
static ALLOCATOR: allocator::Counting = allocator::Counting;

fn main() -> ExitCode {
    allocator::give_back_large_memory();
    cli::main()
}
