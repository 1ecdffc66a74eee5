//! An entry of the list of operations: an operation, its route and its description.

use axum::routing::{MethodFilter, MethodRouter};
use base::{
    caller::{Access, Scope},
    catalog::Code,
};
use schemars::{Schema, SchemaGenerator};
use serde_json::Value;
use service::parameters::{Description, Location};
use strum::VariantArray;

use crate::rest::{
    call::{AppState, Handler, route},
    input::Input,
};

// Who may use an operation; an entry begins with it, so that none is without.
pub(super) const OPEN: Access = Access::Open;
pub(super) const IDENTIFIED: Access = Access::Identified;
pub(super) const READ: Access = Access::Needs(Scope::Read);
pub(super) const SUBMIT: Access = Access::Needs(Scope::Submit);
pub(super) const CANCEL: Access = Access::Needs(Scope::Cancel);
pub(super) const ADMIN: Access = Access::Needs(Scope::Admin);

/// An operation of the API.
pub(in crate::rest) struct Operation {
    /// The HTTP method, in capitals.
    pub(in crate::rest) method: &'static str,
    /// The path, with its variables in braces.
    pub(in crate::rest) path: &'static str,
    /// Who may use the operation.
    pub(in crate::rest) access: Access,
    pub(super) route: MethodRouter<AppState>,
    /// The name of the group that the operation belongs to.
    pub(in crate::rest) group: &'static str,
    /// The corresponding rpcs, the closest one first; empty for an operation over REST only.
    pub(in crate::rest) rpcs: &'static [&'static str],
    /// The name of the operation: the name of its first rpc, if it has one.
    pub(in crate::rest) id: &'static str,
    /// The summary: one line, without a full stop.
    pub(in crate::rest) summary: &'static str,
    /// The parameters of the operation, as its input describes them.
    pub(in crate::rest) parameters: Vec<Description>,
    /// The body of a request.
    pub(in crate::rest) body: Option<Content>,
    pub(in crate::rest) needs_body: bool,
    /// An example of the body.
    pub(in crate::rest) example: Option<Value>,
    /// The successful answers.
    pub(in crate::rest) answers: Vec<Answer>,
    /// Whether the operation refuses unknown parameters.
    strict: bool,
    errors: Vec<Code>,
}

/// A successful answer.
pub(in crate::rest) struct Answer {
    pub(in crate::rest) status: u16,
    pub(in crate::rest) meaning: &'static str,
    pub(in crate::rest) content: Content,
    /// The headers of the answer, and whether each of them is always sent.
    pub(in crate::rest) headers: Vec<(Description, bool)>,
}

/// A kind of body: its schema by media type.
pub(in crate::rest) type Content = Vec<(&'static str, SchemaOf)>;

/// Makes the schema of a type with a generator, which collects the schemas that it refers to.
pub(in crate::rest) type SchemaOf = fn(&mut SchemaGenerator) -> Schema;

/// Makes an operation. The handler receives the values of `input`, so that it cannot use a parameter that is not
/// listed.
fn operation<T, H>(
    access: Access,
    (method, filter): (&'static str, MethodFilter),
    path: &'static str,
    input: T,
    strict: bool,
    handler: H,
) -> Operation
where
    T: Input<Value: Send> + Send + Sync + 'static,
    H: Handler<T::Value>,
{
    Operation {
        access,
        method,
        path,
        parameters: input.descriptions(),
        route: route(filter, input, strict, handler),
        group: "",
        rpcs: &[],
        id: "",
        summary: "",
        body: None,
        needs_body: true,
        example: None,
        answers: vec![],
        strict,
        errors: vec![],
    }
}

macro_rules! methods {
    ($($name:ident $word:literal $filter:ident),*) => {
        $(pub(super) fn $name<T, H>(access: Access, path: &'static str, input: T, handler: H) -> Operation
        where
            T: Input<Value: Send> + Send + Sync + 'static,
            H: Handler<T::Value>,
        {
            operation(access, ($word, MethodFilter::$filter), path, input, true, handler)
        })*
    };
}
methods!(get "GET" GET, post "POST" POST, put "PUT" PUT, patch "PATCH" PATCH, delete "DELETE" DELETE);

/// Makes a probe, an operation that is open to everyone; clients may add parameters of their own.
pub(super) fn probe<H: Handler<()>>(path: &'static str, handler: H) -> Operation {
    operation(
        Access::Open,
        ("GET", MethodFilter::GET),
        path,
        (),
        false,
        handler,
    )
}

impl Operation {
    /// Sets the corresponding rpcs.
    pub(super) fn rpcs(mut self, rpcs: &'static [&'static str]) -> Self {
        self.rpcs = rpcs;
        self.id = rpcs.first().copied().unwrap_or_default();
        self
    }

    /// Makes the operation one over REST only, with the name `id`.
    pub(super) fn rest_only(mut self, id: &'static str) -> Self {
        self.id = id;
        self
    }

    /// Sets the name of the operation if another operation has the same rpc.
    pub(super) fn named(mut self, id: &'static str) -> Self {
        self.id = id;
        self
    }

    /// Sets the summary: one line, without a full stop.
    pub(super) fn summary(mut self, summary: &'static str) -> Self {
        self.summary = summary;
        self
    }

    /// Sets the kind of body that requests have.
    pub(super) fn body(mut self, body: Content) -> Self {
        self.body = Some(body);
        self
    }

    /// Sets the kind of body that requests may have.
    pub(super) fn optional_body(self, body: Content) -> Self {
        Operation {
            needs_body: false,
            ..self.body(body)
        }
    }

    /// Sets an example of the body.
    pub(super) fn example(mut self, body: Value) -> Self {
        self.example = Some(body);
        self
    }

    /// Adds a successful answer.
    pub(super) fn answers(mut self, status: u16, meaning: &'static str, content: Content) -> Self {
        self.answers.push(Answer {
            status,
            meaning,
            content,
            headers: vec![],
        });
        self
    }

    /// Adds headers that the previous answer always has.
    pub(super) fn with(mut self, headers: impl IntoIterator<Item = Description>) -> Self {
        if let Some(answer) = self.answers.last_mut() {
            answer
                .headers
                .extend(headers.into_iter().map(|header| (header, true)));
        }
        self
    }

    /// Adds a header that the previous answer may have.
    pub(super) fn sometimes_with(mut self, header: Description) -> Self {
        if let Some(answer) = self.answers.last_mut() {
            answer.headers.push((header, false));
        }
        self
    }

    /// Adds errors other than those that follow from the input and the body.
    pub(super) fn fails(mut self, codes: &[Code]) -> Self {
        self.errors.extend(codes);
        self
    }

    /// The errors that the operation may answer with, each once.
    pub(in crate::rest) fn errors(&self) -> Vec<Code> {
        let mut codes = vec![
            Code::BadRequest,
            Code::UriTooLong,
            Code::HeaderTooLarge,
            Code::RateLimited,
            Code::Internal,
            Code::Overloaded,
            Code::Forbidden, // its Host or Origin, too
        ];
        if self.access != Access::Open {
            codes.push(Code::Unauthenticated);
        }
        if self.body.is_some() {
            codes.push(Code::RequestTimeout);
        }
        // what is stored may be damaged, tokens and the queue, too
        if matches!(self.access, Access::Needs(_)) {
            codes.push(Code::CorruptData);
        }
        if self.errors.contains(&Code::StorageFull) {
            codes.push(Code::StorageLost);
        }
        if self.strict {
            codes.push(Code::UnknownParameter);
        }
        let in_path = |parameter: &Description| parameter.location == Location::Path;
        if !self.parameters.iter().all(in_path) {
            codes.push(Code::BadParameter);
        }
        if self.parameters.iter().any(in_path) {
            codes.push(Code::NotFound);
        }
        // their ids are kept for a while after their deletion
        let is_deletable = |parameter: &Description| ["job", "sweep"].contains(&parameter.kind);
        if self.parameters.iter().any(is_deletable) {
            codes.push(Code::Deleted);
        }
        let accepts = |media| self.body.iter().flatten().any(|(name, _)| *name == media);
        if accepts("application/json") {
            codes.extend([
                Code::MalformedJson,
                Code::UnsupportedMedia,
                Code::PayloadTooLarge,
            ]);
        }
        codes.extend(&self.errors);
        // in the order of the catalog, each once
        Code::VARIANTS
            .iter()
            .copied()
            .filter(|code| codes.contains(code))
            .collect()
    }
}
