//! The stored form of a result: named parts, each in pieces.

use std::collections::BTreeMap;

use serde_json::json;
use sha2::{Digest, Sha256};
use solver::solution::ContactProfile;

use crate::run::Document;

/// Bytes of one piece of a stored result or mesh: larger rows make SQLite chain pages, and readers need more memory.
pub const PIECE_BYTES: usize = 256 << 10;
/// Pieces per transaction: 1 MiB occupies the single writer for some ten milliseconds, so that a
/// cancel or a submission during the write of a large result is still answered at once.
pub const PIECES_PER_COMMIT: usize = 4;

/// The stored form of a document: name, JSON and SHA-256 of each part.
#[derive(Debug)]
pub struct Parts(pub(super) Vec<Part>);

#[derive(Debug)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) body: Vec<u8>,
    pub(super) digest: Vec<u8>,
}

impl Part {
    pub(super) fn new(name: String, body: Vec<u8>) -> Part {
        let digest = Sha256::digest(&body).to_vec();
        Part { name, body, digest }
    }
}

impl Parts {
    /// Divides a document into the parts that can be requested.
    pub fn of(document: &Document) -> serde_json::Result<Parts> {
        let mut parts = vec![
            (
                "summary".to_string(),
                serde_json::to_vec(&document.summary)?,
            ),
            (
                "history".to_string(),
                serde_json::to_vec(&document.history)?,
            ),
        ];
        // the iterations of a step are part of the history; its profiles are requested one by one
        let steps: Vec<_> = document
            .steps
            .iter()
            .map(|step| json!({"name": step.name, "summary": step.summary}))
            .collect();
        parts.push(("steps".to_string(), serde_json::to_vec(&steps)?));
        let mut add = |points, step, profiles: &BTreeMap<String, ContactProfile>| {
            for (boundary, profile) in profiles {
                let name = profile_part(boundary, points, step);
                parts.push((name, serde_json::to_vec(profile)?));
            }
            Ok::<_, serde_json::Error>(())
        };
        for (number, step) in document.steps.iter().enumerate() {
            add(ProfilePoints::All, Some(number), &step.profiles)?;
            add(ProfilePoints::Nodes, Some(number), &step.node_profiles)?;
            add(
                ProfilePoints::Friction,
                Some(number),
                &step.friction_profiles,
            )?;
        }
        add(ProfilePoints::All, None, &document.profiles)?;
        add(ProfilePoints::Nodes, None, &document.node_profiles)?;
        add(ProfilePoints::Friction, None, &document.friction_profiles)?;
        if !document.fields.x.is_empty() {
            parts.push(("fields".to_string(), serde_json::to_vec(&document.fields)?));
        }
        let hashed = |(name, body)| Part::new(name, body);
        Ok(Parts(parts.into_iter().map(hashed).collect()))
    }

    /// Name, JSON and SHA-256 of each part.
    pub fn into_parts(self) -> impl Iterator<Item = (String, Vec<u8>, Vec<u8>)> {
        let part = |Part { name, body, digest }| (name, body, digest);
        self.0.into_iter().map(part)
    }

    /// From name, JSON and SHA-256 of each part.
    pub fn from_parts(parts: Vec<(String, Vec<u8>, Vec<u8>)>) -> Parts {
        let part = |(name, body, digest)| Part { name, body, digest };
        Parts(parts.into_iter().map(part).collect())
    }

    /// The size of all parts together.
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
