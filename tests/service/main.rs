//! Tests of the service's promises with the real binary, on a free port with its own store.
//! Tests do not sleep to wait: they follow events.
#![allow(clippy::unwrap_used, clippy::panic, clippy::too_many_lines)]

mod answers;
mod auth;
mod bodies;
mod by_name;
mod cache;
mod cancel;
mod client_commands;
mod configuration;
mod control;
mod demo;
mod description;
mod errors;
mod every_field;
mod files;
mod filters;
mod grpc;
mod hostile_worker;
mod keys;
mod limits;
mod list;
mod logs;
mod meshes;
mod owners;
mod page;
mod plots;
mod rest_and_grpc_agree;
mod restart;
mod results;
mod same_errors;
mod session;
mod shares;
mod solve_command;
mod submit;
mod sweeps;
mod validate;
mod verify;
mod views;
mod waiting;
mod watch;
mod watch_list;
mod workers;

/// The binary under test.
const SIGNORINI: &str = env!("CARGO_BIN_EXE_signorini");

use suite::harness::Server;

async fn server() -> Server {
    Server::start(SIGNORINI, &[]).await
}
