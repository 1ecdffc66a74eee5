//! The stored form of a result: named parts after an index of them, and the fields apart.
//!
//! The parts are one content ([`name::RESULT`]), so that a job whose input has a result gets all of it by one row. This
//! content begins with a version and the length and checksum of the index; the index and the parts follow, one after
//! the other. The fields, which can be deleted alone, are another content ([`name::FIELDS`]); the index tells how they
//! are encoded.
//!
//! [`name::RESULT`]: super::content::name::RESULT
//! [`name::FIELDS`]: super::content::name::FIELDS

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

use base::run::{Document, Step};
use files::columns;
use serde::{Deserialize, Serialize};
use solver::{
    error::shortened,
    solution::{ContactProfile, Fields},
};

use super::{
    content::{Fingerprint, NewContent, name},
    encoding::{
        Decoded, Encoding, PartInfo, decoded, deflated, deflated_json, info_if_json,
        info_of_fields, info_of_json,
    },
};

/// The version of the stored form.
const VERSION: u8 = 1;
/// The number of bytes before the index: a version, the length of the index, and its CRC-32.
pub(super) const HEADER_BYTES: usize = 9;

/// A result in its stored form.
#[derive(Debug)]
pub struct Parts {
    parts: Vec<Part>,
    /// The bytes that are stored before the parts: header and index.
    index: Vec<u8>,
    /// The fingerprint of the content with index and parts.
    result: Fingerprint,
    /// The fingerprint of the fields, if the result has fields.
    fields: Option<Fingerprint>,
}

/// A part of a result.
#[derive(Debug, Serialize, Deserialize)]
pub struct Part {
    pub(super) name: String,
    /// How the bytes in `body` are encoded.
    pub(super) encoding: Encoding,
    /// The bytes that are stored. They are not part of a message between processes, but follow it.
    #[serde(skip)]
    pub body: Vec<u8>,
    pub(super) info: PartInfo,
}

/// The entry of a part in the index.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) encoding: Encoding,
    pub(super) info: PartInfo,
    /// The number of bytes of the part; those of fields are stored apart.
    pub(super) bytes: usize,
}

impl Part {
    /// The name of the part: `summary`, `fields`, …
    pub fn name(&self) -> &str {
        &self.name
    }

    /// A part with the JSON of `value`.
    fn of_value(name: String, value: &impl Serialize) -> serde_json::Result<Part> {
        let (info, body) = deflated_json(value)?;
        Ok(Part {
            name,
            encoding: Encoding::Deflated,
            info,
            body,
        })
    }

    /// A part from its JSON.
    pub(super) fn new(name: String, json: &[u8]) -> Part {
        Part {
            name,
            encoding: Encoding::Deflated,
            info: info_of_json(json),
            body: deflated(json),
        }
    }

    /// The part `fields`, whose JSON is never in memory as a whole.
    pub(super) fn of_fields(fields: &Fields, law: &columns::Law) -> serde_json::Result<Part> {
        let info = info_of_fields(fields)?;
        let body = columns::encode(fields, law)
            .map_err(<serde_json::Error as serde::ser::Error>::custom)?;
        Ok(Part {
            name: name::FIELDS.into(),
            encoding: Encoding::Columns,
            body,
            info,
        })
    }

    fn is_fields(&self) -> bool {
        self.name == name::FIELDS
    }
}

/// The entry of a load step in the part `steps`.
#[derive(Serialize)]
struct StepPart<'a> {
    name: &'a str,
    summary: &'a solver::solution::Summary,
}

impl Parts {
    /// Divides a document into the parts that can be requested. Each piece of the document is freed as soon as it is
    /// encoded, since both forms together take twice the memory. `go_on` is called before every load step; `None` if it
    /// returns false.
    pub fn of(
        document: Document,
        go_on: &mut dyn FnMut() -> bool,
    ) -> serde_json::Result<Option<Parts>> {
        let mut parts = vec![];
        parts.push(Part::of_value("summary".into(), &document.summary)?);
        if !go_on() {
            return Ok(None);
        }
        // a partial result has none: its events go on after it
        if !document.history.is_empty() {
            parts.push(Part::of_value("history".into(), &document.history)?);
        }
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
        Ok(Some(Parts::new(parts)))
    }

    /// A result with these parts, which may come from another process.
    pub fn new(parts: Vec<Part>) -> Parts {
        let entries = parts.iter().map(|part| Entry {
            name: part.name.clone(),
            encoding: part.encoding,
            info: part.info.clone(),
            bytes: if part.is_fields() { 0 } else { part.body.len() },
        });
        let index = write_index(&entries.collect::<Vec<_>>());
        let in_result = parts.iter().filter(|part| !part.is_fields());
        let chunks = in_result.map(|part| &*part.body);
        let result = Fingerprint::of([&*index].into_iter().chain(chunks));
        let fields = parts.iter().find(|part| part.is_fields());
        Parts {
            result,
            fields: fields.map(|part| Fingerprint::of([&*part.body])),
            parts,
            index,
        }
    }

    /// The parts in their order, to be sent to another process.
    pub fn into_parts(self) -> impl Iterator<Item = Part> {
        self.parts.into_iter()
    }

    /// The stored size of all parts together (bytes).
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(|part| part.body.len()).sum()
    }

    /// The content that is stored, with the names under which it is attached to the job.
    pub(super) fn contents(&self) -> Vec<(&'static str, NewContent<'_>)> {
        let bodies = |fields| {
            let parts = self
                .parts
                .iter()
                .filter(move |part| part.is_fields() == fields);
            parts.map(|part| &*part.body)
        };
        let result = NewContent {
            fingerprint: Cow::Borrowed(&self.result),
            chunks: [&*self.index].into_iter().chain(bodies(false)).collect(),
        };
        let fields = self.fields.iter().map(|fields| NewContent {
            fingerprint: Cow::Borrowed(fields),
            chunks: bodies(true).collect(),
        });
        let fields = fields.map(|content| (name::FIELDS, content));
        [(name::RESULT, result)].into_iter().chain(fields).collect()
    }

    /// The fingerprints of the content that is stored.
    pub(super) fn fingerprints(&self) -> Vec<&Fingerprint> {
        [&self.result].into_iter().chain(&self.fields).collect()
    }
}

/// The header and the index of these entries, as they are stored.
pub(super) fn write_index(entries: &[Entry]) -> Vec<u8> {
    // writing to memory does not fail
    let index = postcard::to_stdvec(entries).unwrap_or_default();
    let mut stored = vec![VERSION];
    stored.extend((index.len() as u32).to_le_bytes());
    stored.extend(crc32fast::hash(&index).to_le_bytes());
    stored.extend(index);
    stored
}

/// The length of the index after this header. `Err`: what is wrong with the header.
pub(super) fn index_bytes(stored: &[u8]) -> std::result::Result<usize, String> {
    match stored.first_chunk::<5>() {
        Some([VERSION, length @ ..]) => Ok(u32::from_le_bytes(*length) as usize),
        Some(_) => Err("it is stored in a form that this program does not know".into()),
        None => Err("it is too short".into()),
    }
}

/// The entries of the index in bytes that begin with a header. `Err`: what is wrong with the bytes.
pub(super) fn read_index(stored: &[u8]) -> std::result::Result<Vec<Entry>, String> {
    let end = HEADER_BYTES + index_bytes(stored)?;
    let index = stored
        .get(HEADER_BYTES..end)
        .ok_or("its index is cut off")?;
    if stored[HEADER_BYTES - 4..HEADER_BYTES] != crc32fast::hash(index).to_le_bytes() {
        return Err("the checksum of its index does not match its content".into());
    }
    postcard::from_bytes(index).map_err(|error| error.to_string())
}

/// Checks that parts which come from another machine can be served: a summary is there, no name twice, and the content of
/// each part is JSON of the size and hash that it says, or fields of finite numbers. At most `most` bytes of memory are taken.
/// `Err`: what is wrong.
pub fn check_parts(parts: &[Part], most: u64) -> std::result::Result<(), String> {
    let mut names = BTreeSet::new();
    for part in parts {
        let named = |why: String| format!("its part {:?}: {why}", shortened(&part.name, 100));
        if !names.insert(&*part.name) {
            return Err(named("there are two of this name".into()));
        }
        check_part(part, most).map_err(named)?;
    }
    match names.contains("summary") {
        true => Ok(()),
        false => Err("it has no summary".into()),
    }
}

fn check_part(part: &Part, most: u64) -> std::result::Result<(), String> {
    let info = match (part.encoding, part.is_fields()) {
        (Encoding::Deflated, false) => {
            info_if_json(&part.body).map_err(|error| error.to_string())?
        }
        (Encoding::Columns, true) => {
            let memory = columns::memory_to_decode(&part.body)? as u64;
            if memory > most {
                return Err(format!("{memory} bytes of memory are needed to read it"));
            }
            let (info, fields) = decoded(part.body.clone(), part.encoding, &part.info)?;
            if let Decoded::Fields(fields) = fields
                && !fields.is_finite()
            {
                return Err("a number is not finite".into());
            }
            info
        }
        (encoding, _) => return Err(format!("it is encoded as {encoding:?}")),
    };
    match info == part.info {
        true => Ok(()),
        false => Err("its content is not what its size and hash say".into()),
    }
}

/// The points at which a stored profile has its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProfilePoints {
    /// The nodes, the friction points and the places of the peaks.
    All,
    /// The nodes of the boundary.
    Nodes,
    /// The points where friction acts.
    Friction,
}

/// The name of the part with the profile of a boundary, at the end of the problem or of a load step (from 0).
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
