//! The stored form of a result: named parts, each in pieces.

use std::collections::BTreeMap;

use files::columns;
use serde::{Deserialize, Serialize};
use solver::solution::{ContactProfile, Fields};

use super::encoding::{
    Encoding, PartInfo, deflated, deflated_json, digest, info_of_fields, info_of_json,
};
use crate::run::{Document, Step};

/// Bytes of one piece of a stored result or mesh: larger rows make SQLite chain pages, and readers need more memory.
pub const PIECE_BYTES: usize = 256 << 10;
/// Pieces per transaction: 1 MiB occupies the single writer for some ten milliseconds, so that a
/// cancel or a submission during the write of a large result is still answered at once.
pub const PIECES_PER_COMMIT: usize = 4;

/// The stored form of a document.
#[derive(Debug, Serialize, Deserialize)]
pub struct Parts(pub(super) Vec<Part>);

/// A part of a result.
#[derive(Debug, Serialize, Deserialize)]
pub struct Part {
    pub(super) name: String,
    /// How `body` holds it.
    pub(super) encoding: Encoding,
    /// The bytes that are stored. Between processes they follow the message.
    #[serde(skip)]
    pub body: Vec<u8>,
    /// Their SHA-256.
    pub(super) stored_digest: Vec<u8>,
    pub(super) info: PartInfo,
}

impl Part {
    /// Its name: `summary`, `fields`, …
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its JSON, for tests.
    #[cfg(test)]
    pub(crate) fn json(self) -> Vec<u8> {
        match super::encoding::decoded(self.body, self.encoding, &self.info) {
            Ok((_, super::encoding::Content::Json(json))) => json,
            other => panic!("{other:?}"),
        }
    }

    /// A part from what its JSON says.
    fn of_value(name: String, value: &impl Serialize) -> serde_json::Result<Part> {
        let (info, body) = deflated_json(value)?;
        Ok(Part {
            name,
            encoding: Encoding::Deflated,
            info,
            stored_digest: digest(&body),
            body,
        })
    }

    /// A part from its JSON.
    pub(super) fn new(name: String, json: &[u8]) -> Part {
        let body = deflated(json);
        Part {
            name,
            encoding: Encoding::Deflated,
            info: info_of_json(json),
            stored_digest: digest(&body),
            body,
        }
    }

    /// Fields, whose JSON is never in memory as a whole.
    pub(super) fn of_fields(fields: &Fields, law: &columns::Law) -> serde_json::Result<Part> {
        let info = info_of_fields(fields)?;
        let body = columns::encode(fields, law)
            .map_err(<serde_json::Error as serde::ser::Error>::custom)?;
        Ok(Part {
            name: "fields".into(),
            encoding: Encoding::Columns,
            stored_digest: digest(&body),
            body,
            info,
        })
    }
}

/// What is stored of a step in the part `steps`.
#[derive(Serialize)]
struct StepPart<'a> {
    name: &'a str,
    summary: &'a solver::solution::Summary,
}

impl Parts {
    /// Divides a document into the parts that can be requested. What was divided is freed at once: both would take twice
    /// as much. `go_on` is asked after every load step; `None` if it says no.
    pub fn of(
        document: Document,
        go_on: &mut dyn FnMut() -> bool,
    ) -> serde_json::Result<Option<Parts>> {
        let mut parts = vec![];
        parts.push(Part::of_value("summary".into(), &document.summary)?);
        if !go_on() {
            return Ok(None);
        }
        parts.push(Part::of_value("history".into(), &document.history)?);
        drop(document.history);
        // the iterations of a step are part of the history; its profiles are requested one by one
        let steps = document.steps.iter();
        let steps: Vec<StepPart<'_>> = steps
            .map(|Step { name, summary, .. }| StepPart { name, summary })
            .collect();
        parts.push(Part::of_value("steps".into(), &steps)?);
        let mut add_all = |points, step, profiles: BTreeMap<String, ContactProfile>| {
            profiles.into_iter().try_for_each(|(boundary, profile)| {
                let name = profile_part(&boundary, points, step);
                parts.push(Part::of_value(name, &profile)?);
                Ok::<_, serde_json::Error>(())
            })
        };
        for (number, step) in document.steps.into_iter().enumerate() {
            if !go_on() {
                return Ok(None);
            }
            let step_number = Some(number);
            add_all(ProfilePoints::All, step_number, step.profiles)?;
            add_all(ProfilePoints::Nodes, step_number, step.node_profiles)?;
            add_all(ProfilePoints::Friction, step_number, step.friction_profiles)?;
        }
        add_all(ProfilePoints::All, None, document.profiles)?;
        add_all(ProfilePoints::Nodes, None, document.node_profiles)?;
        add_all(ProfilePoints::Friction, None, document.friction_profiles)?;
        if !document.fields.x.is_empty() {
            parts.push(Part::of_fields(&document.fields, &document.law)?);
        }
        Ok(Some(Parts(parts)))
    }

    /// One after the other, for another process.
    pub fn into_parts(self) -> impl Iterator<Item = Part> {
        self.0.into_iter()
    }

    /// From those of another process.
    pub fn from_parts(parts: Vec<Part>) -> Parts {
        Parts(parts)
    }

    /// The stored size of all parts together.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|part| part.body.len()).sum()
    }

    /// All pieces, in groups that are written together.
    pub(super) fn groups(&self) -> Vec<Vec<Piece<'_>>> {
        let mut groups: Vec<Vec<Piece<'_>>> = vec![vec![]];
        let mut bytes = 0;
        for part in &self.0 {
            for (number, body) in (0..).zip(part.body.chunks(PIECE_BYTES)) {
                if bytes + body.len() > PIECES_PER_COMMIT * PIECE_BYTES {
                    groups.push(vec![]);
                    bytes = 0;
                }
                bytes += body.len();
                if let Some(group) = groups.last_mut() {
                    group.push(Piece {
                        name: &part.name,
                        number,
                        body,
                    });
                }
            }
        }
        groups
    }
}

pub(super) struct Piece<'a> {
    pub(super) name: &'a str,
    pub(super) number: i64,
    pub(super) body: &'a [u8],
}

/// The points at which a stored profile has its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProfilePoints {
    /// At nodes and friction points and the places of the peaks.
    All,
    /// At the nodes of the boundary.
    Nodes,
    /// Where friction acts.
    Friction,
}

/// The part that holds the profile of a boundary, at the end or at the end of a load step.
pub(super) fn profile_part(boundary: &str, points: ProfilePoints, step: Option<usize>) -> String {
    let kind = match points {
        ProfilePoints::All => "all",
        ProfilePoints::Nodes => "profile",
        ProfilePoints::Friction => "friction",
    };
    match step {
        None => format!("{kind}/{boundary}"),
        Some(number) => format!("step/{number}/{kind}/{boundary}"),
    }
}
