//! REST. The whole API is one list, `operations`. Handlers only translate; see `verbs`.

// Requests: parameters and headers, bodies, the caller.
mod accept;
mod authenticate;
mod bodies;
mod body;
mod call;
mod coding;
mod filters;
mod forwarded;
mod headers;
mod input;
mod limits;
mod object;
mod origin;

// Answers.
mod asked;
mod compressed;
mod data;
mod observe;
mod refused;
mod reply;
mod while_valid;

// Handlers, by subject.
mod docs;
mod events;
mod jobs;
mod meshes;
mod plots;
mod results;
mod service;
mod submit;
mod sweeps;
mod tokens;

// The list of operations, and what is made from it.
mod openapi;
mod operations;
mod reference;
mod router;

#[cfg(test)]
mod fuzz;

pub use openapi::openapi;
pub use reference::reference;
pub use reply::refuse;
pub use router::router;
pub use service::is_probe;
