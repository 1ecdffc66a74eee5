//! The REST API as one list: every operation with its route and handler, the rpc that does the same,
//! what it takes, what it answers, and the tests that hold it to that. The router, `/openapi.json`,
//! `docs/api.md` and the test of parity with gRPC are all made from this list, so none of them can
//! know an operation that another does not.
//!
//! Why no crate writes the document from the handlers (utoipa, aide): they describe what extractors
//! read, and ours read by hand, since all that is wrong with a request is told at once. And the table
//! must feed the parity test and the reference as well.

mod jobs;
mod meshes;
mod results;
mod service;
mod shapes;

use axum::{
    Router,
    handler::Handler,
    routing::{MethodFilter, MethodRouter, on},
};
use schemars::{Schema, SchemaGenerator};
use serde_json::Value;

pub(super) use shapes::variable;

use super::Rest;
use crate::catalog::Code;

/// Name and subject of the groups, and what belongs to each, in the order in which they are documented.
pub(super) const GROUPS: [Group; 4] = [
    ("jobs", "Hand in, look, watch, cancel", jobs::operations),
    ("results", "What a job has found", results::operations),
    ("meshes", "Stored once, for many jobs", meshes::operations),
    (
        "service",
        "The problem on its own, and the service itself",
        service::operations,
    ),
];

type Group = (&'static str, &'static str, fn() -> Vec<Operation>);

/// What can be asked of the service.
pub(super) fn all() -> Vec<Operation> {
    let mut list = vec![];
    for (group, _, operations) in GROUPS {
        list.extend(
            operations()
                .into_iter()
                .map(|operation| Operation { group, ..operation }),
        );
    }
    list
}

/// The routes: there are no others.
pub(super) fn routes() -> Router<Rest> {
    all().into_iter().fold(Router::new(), |router, operation| {
        router.route(operation.path, operation.route)
    })
}

/// One thing that can be asked of the service.
pub(super) struct Operation {
    /// In capitals.
    pub(super) method: &'static str,
    /// With its variables in braces.
    pub(super) path: &'static str,
    route: MethodRouter<Rest>,
    /// Name of its group.
    pub(super) group: &'static str,
    /// The rpcs that do the same, the nearest one first; none: over REST only.
    pub(super) rpcs: &'static [&'static str],
    /// Name of the operation: that of the first rpc, if there is one.
    pub(super) id: &'static str,
    /// One line.
    pub(super) summary: &'static str,
    /// Beside those in the path.
    pub(super) parameters: Vec<Parameter>,
    /// What is sent.
    pub(super) body: Option<Content>,
    pub(super) needs_body: bool,
    /// Such a body.
    pub(super) example: Option<Value>,
    /// What comes back when all is well.
    pub(super) answers: Vec<Answer>,
    /// It refuses parameters that it does not know.
    strict: bool,
    errors: Vec<Code>,
    /// `service::file::function` in `tests`, or a script there.
    pub(super) tests: &'static [&'static str],
}

/// Of a query or a header.
pub(super) struct Parameter {
    /// `query` or `header`.
    pub(super) place: &'static str,
    pub(super) name: &'static str,
    pub(super) schema: Value,
    pub(super) meaning: &'static str,
}

/// A good end.
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) meaning: &'static str,
    pub(super) content: Content,
    /// Each with whether it is always there.
    pub(super) headers: Vec<(Parameter, bool)>,
}

/// A body: its schema by media type.
pub(super) type Content = Vec<(&'static str, SchemaOf)>;

/// The schema of a type, by way of the generator that collects the parts.
pub(super) type SchemaOf = fn(&mut SchemaGenerator) -> Schema;

fn operation<H, T>(
    (method, filter): (&'static str, MethodFilter),
    path: &'static str,
    handler: H,
) -> Operation
where
    H: Handler<T, Rest>,
    T: 'static,
{
    Operation {
        method,
        path,
        route: on(filter, handler),
        group: "",
        rpcs: &[],
        id: "",
        summary: "",
        parameters: vec![],
        body: None,
        needs_body: true,
        example: None,
        answers: vec![],
        strict: true,
        errors: vec![],
        tests: &[],
    }
}

macro_rules! methods {
    ($($name:ident $word:literal $filter:ident),*) => {
        $(fn $name<H: Handler<T, Rest>, T: 'static>(path: &'static str, handler: H) -> Operation {
            operation(($word, MethodFilter::$filter), path, handler)
        })*
    };
}
methods!(get "GET" GET, post "POST" POST, put "PUT" PUT, patch "PATCH" PATCH, delete "DELETE" DELETE);

impl Operation {
    /// The rpcs that do the same.
    fn rpcs(mut self, rpcs: &'static [&'static str]) -> Self {
        self.rpcs = rpcs;
        self.id = rpcs.first().copied().unwrap_or_default();
        self
    }

    /// There is no such rpc; a name of its own.
    fn rest_only(mut self, id: &'static str) -> Self {
        self.id = id;
        self
    }

    /// Another route of an rpc, with a name of its own.
    fn named(mut self, id: &'static str) -> Self {
        self.id = id;
        self
    }

    fn says(mut self, summary: &'static str) -> Self {
        self.summary = summary;
        self
    }

    fn takes(mut self, body: Content) -> Self {
        self.body = Some(body);
        self
    }

    /// A body that may also be left out.
    fn may_take(self, body: Content) -> Self {
        Operation {
            needs_body: false,
            ..self.takes(body)
        }
    }

    fn for_example(mut self, body: Value) -> Self {
        self.example = Some(body);
        self
    }

    fn with(mut self, parameters: impl IntoIterator<Item = Parameter>) -> Self {
        self.parameters.extend(parameters);
        self
    }

    fn answers(mut self, status: u16, meaning: &'static str, content: Content) -> Self {
        self.answers.push(Answer {
            status,
            meaning,
            content,
            headers: vec![],
        });
        self
    }

    /// Headers that the answer before always has.
    fn headed(mut self, headers: impl IntoIterator<Item = Parameter>) -> Self {
        if let Some(answer) = self.answers.last_mut() {
            answer
                .headers
                .extend(headers.into_iter().map(|header| (header, true)));
        }
        self
    }

    /// A header that it has sometimes.
    fn maybe(mut self, header: Parameter) -> Self {
        if let Some(answer) = self.answers.last_mut() {
            answer.headers.push((header, false));
        }
        self
    }

    /// Codes beside those that the shape of the operation implies.
    fn fails(mut self, codes: &[Code]) -> Self {
        self.errors.extend(codes);
        self
    }

    /// For probes: whatever asks them may add what it likes.
    fn lenient(mut self) -> Self {
        self.strict = false;
        self
    }

    fn tested(mut self, tests: &'static [&'static str]) -> Self {
        self.tests = tests;
        self
    }

    /// The variables of its path.
    pub(super) fn variables(&self) -> impl Iterator<Item = &'static str> {
        self.path
            .split('/')
            .filter_map(|part| part.strip_prefix('{')?.strip_suffix('}'))
    }

    /// The codes of the errors that it can answer, each once.
    pub(super) fn errors(&self) -> Vec<Code> {
        let mut codes = vec![Code::Internal, Code::RateLimited];
        if self.strict {
            codes.push(Code::UnknownParameter);
        }
        if !self.parameters.is_empty() {
            codes.push(Code::BadParameter);
        }
        if self.path.contains('{') {
            codes.push(Code::NotFound);
        }
        if self.path.starts_with("/v1/jobs/{id}") {
            codes.push(Code::Deleted);
        }
        let takes = |media| self.body.iter().flatten().any(|(name, _)| *name == media);
        if takes("application/json") {
            codes.extend([
                Code::MalformedJson,
                Code::UnsupportedMedia,
                Code::PayloadTooLarge,
            ]);
        }
        codes.extend(&self.errors);
        // in the order of the catalogue, each once
        Code::ALL
            .into_iter()
            .filter(|code| codes.contains(code))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use std::{collections::BTreeSet, fs, path::Path};

    use prost::Message;

    use super::*;
    use crate::pb;

    /// The contract itself, not what was generated from it.
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
        // API.md: plots, docs, openapi, proto, schema, error pages, probes
        let rest_only = [
            "/v1/jobs/{id}/plots/{plot}",
            "/docs",
            "/docs/{file}",
            "/openapi.json",
            "/proto/signorini.proto",
            "/v1/schema/problem.json",
            "/v1/errors/{code}",
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
    fn every_operation_is_described_once_and_whole() {
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
                "{method} {path} stands twice"
            );
            assert!(!id.is_empty() && !summary.is_empty(), "{method} {path}");
            assert!(!summary.ends_with('.'), "{summary}");
            assert!(
                !operation.answers.is_empty(),
                "{method} {path} answers nothing"
            );
            assert!(!operation.tests.is_empty(), "{method} {path} has no test");
            for code in operation.errors() {
                assert!(
                    code.kind().status.is_some(),
                    "{method} {path}: {code:?} is no answer"
                );
            }
        }
    }

    #[test]
    fn the_tests_that_are_named_exist() {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        for operation in all() {
            for test in operation.tests {
                let text = |path: &str| {
                    let path = top.join("tests").join(path);
                    fs::read_to_string(&path)
                        .unwrap_or_else(|error| panic!("{test}: {}: {error}", path.display()))
                };
                match test.split("::").collect::<Vec<_>>()[..] {
                    [suite, file, function] => {
                        let found = text(&format!("{suite}/{file}.rs"));
                        assert!(
                            found.contains(&format!("fn {function}(")),
                            "there is no {test}"
                        );
                    }
                    _ => drop(text(test.strip_prefix("tests/").unwrap())),
                }
            }
        }
    }
}
