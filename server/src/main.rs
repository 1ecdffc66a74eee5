//! Arguments, logging, hand over.

use std::process::ExitCode;

fn main() -> ExitCode {
    service::cli::main()
}
