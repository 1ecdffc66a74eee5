//! REST. The whole API is one list, `operations`. Handlers only translate; the operations themselves are in `verbs`.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | every operation: route, access, input, handler, rpc, answers, errors; which tests cover it | `operations`, a file for each subject |
//! | made from that list: routes | `router` |
//! | made from that list: `/openapi.json` | `openapi`, in the dialect of `openapi_dialect` |
//! | made from that list: docs/api.md | `reference` |
//! | the input of a request: the order in which it is read and checked | `call` |
//! | the input of a request: path, query and headers | `input`, `headers` |
//! | the input of a request: filters | `filters` |
//! | the input of a request: formats | `accept` |
//! | bodies as bytes, as JSON with all violations | `body`, `bodies` |
//! | content codings | `coding`, `compressed` |
//! | the caller and what they may do | `authenticate` |
//! | a token that is revoked while it is used | `revocation` |
//! | hosts and origins | `origin` |
//! | proxies | `forwarded` |
//! | limits that hold for every request | `limits` |
//! | answers: errors | `reply` |
//! | answers: entity tags, digests, ranges | `data` |
//! | log line, metrics and span of a request | `request_report`, `request_target` |
//! | refused requests in the log | `refused` |
//! | streams of events; figures | `events`, `plots` |
//! | the page at /docs | `docs` |
//! | the page for people: its files, which are in `server/web/page`; sessions of browsers | `page`, `session` |
//! | what browsers are told | `browser` |

// Requests: parameters and headers, bodies, the caller.
mod accept;
mod authenticate;
mod bodies;
mod body;
mod browser;
mod call;
mod coding;
mod filters;
mod forwarded;
mod headers;
mod input;
mod limits;
mod origin;

// Answers.
mod compressed;
mod data;
mod job_row;
mod refused;
mod reply;
mod request_report;
mod request_target;
mod revocation;

// Answers that are more than a translation.
mod docs;
mod events;
mod page;
mod plots;
mod session;

// The list of operations, and what is made from it.
mod openapi;
mod openapi_dialect;
mod operations;
mod reference;
mod router;

#[cfg(test)]
mod fuzz;

pub use openapi::openapi;
pub use reference::reference;
pub use reply::refuse;
pub use request_target::is_probe;
pub use router::router;
