//! All members of a sweep: the paths of the values in which they differ, and these values.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use solver::error::{Reason, Violation, escape};
use solver::problem::{MeshInput, Problem};

use super::template::Template;
use crate::json::parse;

/// The largest number of members of a sweep.
pub const MOST_MEMBERS: usize = 10_000;
/// The largest number of paths, that is of values in which members may differ.
pub const MOST_PATHS: usize = 16;
/// The largest number of bytes of the problems of all members together, as text: checking the members reads all of it.
pub const MOST_BYTES: u64 = 64 << 20;

/// The largest number of bytes of the values of all members together, as text: a table of all members contains all
/// values.
pub const MOST_VALUE_BYTES: u64 = 8 << 20;

/// How the values of several axes are combined.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema, strum::IntoStaticStr,
)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "SweepMode")]
#[strum(serialize_all = "snake_case")]
pub enum Mode {
    /// Every value of each axis with every value of the others; the last axis changes fastest.
    #[default]
    Grid,
    /// The first values of all axes for the first member, the second values for the second member, and so on.
    Zip,
    /// The points that are listed in `points`.
    List,
}

/// All members of a sweep, in the form that is stored and that a worker receives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    pub(super) template: Template,
    /// Whether the mesh is part of the template, because the sweep changes it.
    pub(super) with_mesh: bool,
    pub(super) paths: Vec<String>,
    pub(super) values: Values,
    /// The groups of members that share a body and were divided into pieces, each in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) divided: Vec<Vec<usize>>,
}

/// The values of all members as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Values {
    Grid(Vec<Vec<String>>),
    Zip(Vec<Vec<String>>),
    /// The values by member and path; `None` where a member keeps the value of the base problem.
    List(Vec<Vec<Option<String>>>),
}

impl Plan {
    /// The number of members, which are numbered from 0.
    pub fn count(&self) -> usize {
        match &self.values {
            Values::Grid(axes) => axes
                .iter()
                .fold(1, |count: usize, values| count.saturating_mul(values.len())),
            Values::Zip(axes) => axes.first().map_or(0, Vec::len),
            Values::List(points) => points.len(),
        }
    }

    /// JSON Pointers to the values in which members may differ.
    pub fn paths(&self) -> &[String] {
        &self.paths
    }

    /// Whether the sweep changes the mesh, so that each member has its own mesh.
    pub fn changes_mesh(&self) -> bool {
        self.with_mesh
    }

    /// The values of a member as JSON, in the order of the paths; `None` where it keeps the value of the base problem.
    pub fn values(&self, number: usize) -> Vec<Option<&str>> {
        match &self.values {
            Values::Grid(axes) => {
                let mut rest = number;
                let mut found: Vec<Option<&str>> = axes
                    .iter()
                    .rev()
                    .map(|values| {
                        let value = values.get(rest % values.len().max(1));
                        rest /= values.len().max(1);
                        value.map(String::as_str)
                    })
                    .collect();
                found.reverse();
                found
            }
            Values::Zip(axes) => axes
                .iter()
                .map(|values| values.get(number).map(String::as_str))
                .collect(),
            Values::List(points) => points
                .get(number)
                .map(|point| point.iter().map(Option::as_deref).collect())
                .unwrap_or_default(),
        }
    }

    /// The values of a member by path, without those of the base problem. They are JSON texts without spaces, since the
    /// values of many members are held at a time, and a tree of values takes twenty times as much memory.
    pub fn parameters(&self, number: usize) -> BTreeMap<String, Box<RawValue>> {
        let values = self.paths.iter().zip(self.values(number));
        let read = |(path, value): (&String, Option<&str>)| {
            let text = RawValue::from_string(without_spaces(value?));
            Some((path.clone(), text.ok()?)) // it was read before
        };
        values.filter_map(read).collect()
    }

    /// The number of bytes of the values of a member, as text.
    pub fn bytes_of(&self, number: usize) -> usize {
        self.values(number)
            .into_iter()
            .flatten()
            .map(str::len)
            .sum()
    }

    /// Returns the problem of a member. Its mesh is empty unless the sweep changes the mesh.
    ///
    /// # Errors
    ///
    /// The violations of the member, with pointers relative to its problem.
    pub fn problem(&self, number: usize) -> Result<Problem, Vec<Violation>> {
        parse(&self.template.filled(&self.values(number)))
    }

    /// Returns the problem of a member with its mesh: that of the base problem, unless the sweep changes the mesh.
    ///
    /// # Errors
    ///
    /// The errors of [`Plan::problem`].
    pub fn whole_problem(
        &self,
        number: usize,
        base: &MeshInput,
    ) -> Result<Problem, Vec<Violation>> {
        let mut problem = self.problem(number)?;
        if !self.with_mesh {
            problem.mesh = base.clone();
        }
        Ok(problem)
    }

    /// The JSON Pointer to the place in the definition of the sweep that causes a violation of a member.
    pub(super) fn place(&self, number: usize, violation: &Violation) -> String {
        let pointer = violation.pointer.as_str();
        let inside = |path: &String| {
            let rest = pointer.strip_prefix(path.as_str())?;
            (rest.is_empty() || rest.starts_with('/')).then_some(rest)
        };
        let mut found = self.paths.iter().enumerate();
        let found = found.find_map(|(k, path)| Some((k, path, inside(path)?)));
        let Some((k, path, rest)) = found else {
            // such as two values that exclude each other
            return self.origin(number);
        };
        if violation.reason == Reason::UnknownName && rest.is_empty() {
            return match &self.values {
                Values::List(_) => format!("/points/{number}"),
                Values::Grid(_) | Values::Zip(_) => format!("/axes/{k}/path"),
            };
        }
        match &self.values {
            Values::List(_) => format!("/points/{number}/{}{rest}", escape(path)),
            Values::Zip(_) => format!("/axes/{k}/values/{number}{rest}"),
            Values::Grid(axes) => {
                let faster: usize = axes[k + 1..].iter().map(Vec::len).product();
                let place = number / faster.max(1) % axes[k].len().max(1);
                format!("/axes/{k}/values/{place}{rest}")
            }
        }
    }

    /// The JSON Pointer to the place in the definition of the sweep that determines a member: its point, or the axes.
    pub fn origin(&self, number: usize) -> String {
        match &self.values {
            Values::List(_) => format!("/points/{number}"),
            Values::Grid(_) | Values::Zip(_) => "/axes".to_owned(),
        }
    }

    /// The number of bytes of the problems of all members, as text.
    pub(super) fn bytes(&self) -> u64 {
        let text = self.template.bytes() as u64;
        text.saturating_mul(self.count() as u64)
            .saturating_add(self.value_bytes())
    }

    /// The number of bytes of the values of all members, as text.
    pub(super) fn value_bytes(&self) -> u64 {
        let count = self.count() as u64;
        let length = |values: &[String]| values.iter().map(|value| value.len() as u64).sum();
        match &self.values {
            Values::Grid(axes) => axes
                .iter()
                .map(|values| {
                    let length: u64 = length(values);
                    length.saturating_mul(count / (values.len() as u64).max(1))
                })
                .fold(0, u64::saturating_add),
            Values::Zip(axes) => axes.iter().map(|values| -> u64 { length(values) }).sum(),
            Values::List(points) => {
                let values = points.iter().flatten().flatten();
                values.map(|value| value.len() as u64).sum()
            }
        }
    }
}

/// A JSON text without the white space between its parts.
fn without_spaces(json: &str) -> String {
    let (mut inside, mut escaped) = (false, false);
    let keeps = |c: &char| {
        let kept = inside || !c.is_ascii_whitespace();
        match c {
            '"' if !escaped => inside = !inside,
            _ => {}
        }
        escaped = inside && *c == '\\' && !escaped;
        kept
    };
    json.chars().filter(keeps).collect()
}

#[cfg(test)]
mod spaces {
    #[test]
    fn only_white_space_outside_of_strings_is_left_out() {
        for (text, expected) in [
            ("[1, 2,\n 3]", "[1,2,3]"),
            (
                r#"{"a b" : "c \" d\\" , "e":1}"#,
                r#"{"a b":"c \" d\\","e":1}"#,
            ),
            (r#" "\\" "#, r#""\\""#),
            ("1e3", "1e3"),
        ] {
            assert_eq!(super::without_spaces(text), expected);
        }
    }
}
