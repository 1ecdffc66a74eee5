//! Writes `docs/api.md`: the list of operations for people.

use std::fmt::Write;

use base::{
    caller::Access,
    catalog::{Code, grpc_code_name},
};
use service::parameters::{Description, Location};
use strum::VariantArray;

use super::operations::{self, Operation};

/// The text of `docs/api.md`.
pub fn reference() -> String {
    let mut out = String::from(INTRODUCTION);
    let all = operations::all();
    out += "| operation | over gRPC | answers |\n|---|---|---|\n";
    for operation in &all {
        let _ = writeln!(
            out,
            "| [`{} {}`](#{}) | {} | {} |",
            operation.method,
            operation.path,
            anchor(operation),
            rpcs(operation),
            statuses(operation),
        );
    }
    for (group, meaning, _) in operations::GROUPS {
        let _ = write!(out, "\n## {}\n\n{meaning}.\n", capital(group));
        for operation in all.iter().filter(|operation| operation.group == group) {
            section(&mut out, operation);
        }
    }
    errors(&mut out);
    out
}

const INTRODUCTION: &str = "# The API

Generated from the list of operations (`server/web/src/rest/operations`) by `signorini openapi --reference`; the same
list makes the routes, `/openapi.json` and the test that every rpc has its route. Bodies are described there, a
problem by `signorini schema`; `/docs` shows all of it and can try it out. Unknown names are refused, in bodies
and in queries. Every error is a document of RFC 9457 with one of the codes below.

";

fn section(out: &mut String, operation: &Operation) {
    let _ = write!(
        out,
        "\n### `{} {}`\n\n{}.\n\n",
        operation.method, operation.path, operation.summary
    );
    if !operation.rpcs.is_empty() {
        let _ = writeln!(out, "- gRPC: {}", rpcs(operation));
    }
    let who = match operation.access {
        Access::Open => "everyone, without a token".to_owned(),
        Access::Identified => "every token".to_owned(),
        Access::Needs(scope) => format!("tokens with the scope `{}`", <&str>::from(scope)),
    };
    let _ = writeln!(out, "- for {who}");
    let named = |parameter: &&Description| parameter.location != Location::Path;
    for Description {
        location,
        name,
        meaning,
        ..
    } in operation.parameters.iter().filter(named)
    {
        let location: &str = location.into();
        let _ = writeln!(out, "- {location} `{name}`: {meaning}");
    }
    for answer in &operation.answers {
        let media: Vec<String> = answer
            .content
            .iter()
            .map(|(media, _)| format!("`{media}`"))
            .collect();
        let _ = write!(out, "- {}: {}", answer.status, answer.meaning);
        if !media.is_empty() {
            let _ = write!(out, " ({})", media.join(", "));
        }
        out.push('\n');
    }
    let codes: Vec<String> = operation
        .errors()
        .iter()
        .map(|code| code.kind())
        .map(|kind| format!("{} `{}`", kind.status.unwrap_or_default(), kind.code))
        .collect();
    let _ = writeln!(out, "- errors: {}", codes.join(", "));
}

fn errors(out: &mut String) {
    *out += "\n## Errors\n\n`signorini explain CODE` and `GET /v1/errors/{code}` explain each. Those without a status \
             are reasons why jobs fail.\n\n| code | HTTP | gRPC | title |\n|---|---|---|---|\n";
    for kind in Code::VARIANTS.iter().map(|code| code.kind()) {
        let status = kind
            .status
            .map_or(String::new(), |status| status.to_string());
        let grpc = kind.grpc.map_or("", grpc_code_name);
        let _ = writeln!(
            out,
            "| `{}` | {status} | {grpc} | {} |",
            kind.code, kind.title
        );
    }
}

fn rpcs(operation: &Operation) -> String {
    match operation.rpcs {
        [] => "–".into(),
        rpcs => rpcs.join(", "),
    }
}

fn statuses(operation: &Operation) -> String {
    let good = operation.answers.iter().map(|answer| answer.status);
    let errors = operation.errors();
    let bad = errors.iter().filter_map(|code| code.kind().status);
    let mut all: Vec<u16> = good.chain(bad).collect();
    all.sort_unstable();
    all.dedup();
    let words: Vec<String> = all.iter().map(u16::to_string).collect();
    words.join(" ")
}

/// The anchor that GitHub makes from an operation's heading: lower case, spaces to hyphens, punctuation dropped.
fn anchor(operation: &Operation) -> String {
    let heading = format!("{} {}", operation.method, operation.path);
    heading
        .to_lowercase()
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

fn capital(name: &str) -> String {
    let (first, rest) = name.split_at(1);
    first.to_uppercase() + rest
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_published_page_is_the_one_that_is_written_here() {
        let published = include_str!("../../../../docs/api.md");
        let same = published == super::reference();
        assert!(
            same,
            "write it anew: signorini openapi --reference > docs/api.md"
        );
    }
}
