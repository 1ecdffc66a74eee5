//! The REST API as one list: every operation with its route and handler, the corresponding rpc, its input and its
//! answers. The router, `/openapi.json`, `docs/api.md` and the test of parity with gRPC
//! are all made from this list, so that all of them have the same operations.
//!
//! The OpenAPI document is not generated from the handlers by a crate (utoipa, aide): such crates describe what
//! extractors read, while bodies are read here by hand, since all errors of a request are reported together. The parity
//! test and the reference need the list as well.

// An entry, and the bodies and headers that entries name.
mod content;
mod headers;
mod operation;

// The groups: entries, and their handlers.
mod jobs;
mod meshes;
mod problems;
mod results;
mod service;
mod submit;
mod sweeps;
mod tokens;

use axum::Router;

use base::caller::Access;
pub(super) use operation::{Answer, Content, Operation};

use super::call::AppState;

/// The access rule of the description of the API, over either protocol.
pub(super) const DESCRIPTION: Access = operation::READ;

/// The groups in the order in which they are documented: name, subject and operations.
pub(super) const GROUPS: [Group; 7] = [
    ("jobs", "Submit, get, list, watch, cancel", || {
        submit::operations()
            .into_iter()
            .chain(jobs::operations())
            .collect()
    }),
    ("results", "The results of a job", results::operations),
    (
        "sweeps",
        "One problem with many values: solved together, read as one table",
        sweeps::operations,
    ),
    ("meshes", "Stored once, for many jobs", meshes::operations),
    (
        "problems",
        "Checking, drawing and converting a problem without a job; examples",
        problems::operations,
    ),
    ("service", "The service itself", service::operations),
    (
        "tokens",
        "Who may use the service; for administrators",
        tokens::operations,
    ),
];

type Group = (&'static str, &'static str, fn() -> Vec<Operation>);

/// All operations.
pub(super) fn all() -> Vec<Operation> {
    let mut list = vec![];
    for (group, _, operations) in GROUPS {
        for mut operation in operations() {
            operation.group = group;
            list.push(operation);
        }
    }
    list
}

/// The routes of all operations. The service has no other routes over REST.
pub(super) fn routes() -> Router<AppState> {
    all().into_iter().fold(Router::new(), |router, operation| {
        router.route(operation.path, operation.route)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{collections::BTreeSet, fs, path::Path};

    use prost::Message;

    use super::*;
    use ::service::parameters::{Description, Location};
    use rpc::pb;

    /// The rpcs of the contract itself, rather than of the code generated from it.
    fn rpcs() -> BTreeSet<String> {
        let files = prost_types::FileDescriptorSet::decode(pb::DESCRIPTORS)
            .unwrap()
            .file;
        let services = files.into_iter().flat_map(|file| file.service);
        let ours = services.filter(|service| service.name() == "JobService");
        let methods = ours.flat_map(|service| service.method);
        methods.map(|method| method.name().to_owned()).collect()
    }

    #[test]
    fn every_rpc_has_its_operation_and_every_operation_its_rpc() {
        let all = all();
        let named: Vec<&str> = all
            .iter()
            .flat_map(|operation| operation.rpcs)
            .copied()
            .collect();
        let named: BTreeSet<String> = named.into_iter().map(str::to_owned).collect();
        assert_eq!(named, rpcs());
        // plots, the table for programs that read files, pages and documents, and what is asked by HTTP everywhere (probes, metrics), have no rpc
        let rest_only = [
            "/v1/jobs/{id}/plots/{plot}",
            "/v1/jobs/table",
            "/",
            "/v1/session",
            "/v1/session",
            "/docs",
            "/docs/{file}",
            "/openapi.json",
            "/proto/signorini.proto",
            "/v1/schema/problem.json",
            "/v1/errors/{code}",
            "/v1/warnings/{code}",
            "/metrics",
            "/livez",
            "/readyz",
        ];
        let without: Vec<&str> = all
            .iter()
            .filter(|operation| operation.rpcs.is_empty())
            .map(|operation| operation.path)
            .collect();
        for path in &without {
            assert!(rest_only.contains(path), "{path} has no rpc");
        }
        assert_eq!(without.len(), rest_only.len());
    }

    #[test]
    fn every_operation_is_described_once_and_completely() {
        let mut ids = BTreeSet::new();
        let mut routes = BTreeSet::new();
        for operation in all() {
            let Operation {
                method,
                path,
                id,
                summary,
                ..
            } = operation;
            assert!(ids.insert(id), "two operations are called {id:?}");
            assert!(
                routes.insert((method, path)),
                "{method} {path} is listed twice"
            );
            assert!(!id.is_empty() && !summary.is_empty(), "{method} {path}");
            assert!(!summary.ends_with('.'), "{summary}");
            assert!(
                !operation.answers.is_empty(),
                "{method} {path} has no answer"
            );
            for code in operation.errors() {
                assert!(
                    code.kind().status.is_some(),
                    "{method} {path}: {code:?} is no answer"
                );
            }
        }
    }

    /// Every variable of a path is read and every parameter is read once: a handler receives a variable by its name.
    #[test]
    fn every_variable_of_a_path_is_read_and_every_parameter_is_read_once() {
        for Operation {
            path, parameters, ..
        } in all()
        {
            let parts = path.split('/');
            let variables = parts.filter_map(|part| part.strip_prefix('{')?.strip_suffix('}'));
            let taken = parameters
                .iter()
                .filter(|one| one.location == Location::Path);
            assert!(variables.eq(taken.map(|one| one.name)), "{path}");
            let mut names = BTreeSet::new();
            for Description { location, name, .. } in &parameters {
                let location: &str = location.into();
                assert!(names.insert((location, *name)), "{path}: {location} {name}");
            }
        }
    }

    /// The operations that tests claim to cover, by a line `/// Operations: CreateJob, GetJob` above a test, or by such
    /// a line after `#` in a script.
    fn tested() -> BTreeSet<String> {
        let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests");
        let mut found = BTreeSet::new();
        for (folder, ending, mark) in [("service", "rs", "///"), ("", "py", "#")] {
            for file in fs::read_dir(tests.join(folder)).unwrap() {
                let path = file.unwrap().path();
                if path.extension().is_none_or(|other| other != ending) {
                    continue;
                }
                let start = format!("{mark} Operations: ");
                let text = fs::read_to_string(&path).unwrap();
                let mut lines = text.lines().peekable();
                while let Some(line) = lines.next() {
                    let Some(names) = line.strip_prefix(&start) else {
                        continue;
                    };
                    let of_a_test = lines.peek().is_some_and(|next| next.contains("test"));
                    assert!(ending != "rs" || of_a_test, "{}: {line}", path.display());
                    found.extend(names.split(", ").map(str::to_owned));
                }
            }
        }
        found
    }

    #[test]
    fn every_operation_has_a_test_that_names_it() {
        let mut known = BTreeSet::new();
        for operation in all() {
            known.insert(operation.id.to_owned());
            known.extend(operation.rpcs.iter().map(|rpc| rpc.to_string()));
        }
        assert_eq!(tested(), known);
    }
}
