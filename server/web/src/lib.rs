//! The service over HTTP: connections within limits (`listener`), and REST (`rest`).
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | routes, bodies and headers of requests | `rest` |
//! | connections and TLS | `listener` |

// The protocol, which only translates.
pub mod rest;

// Accepts connections, and ends those that are idle, stalled or abusive.
pub mod listener;
