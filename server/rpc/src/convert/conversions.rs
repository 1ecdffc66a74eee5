//! The generated conversions: the list of types is `server/rpc/build/mirrors.rs`, the generator
//! `server/rpc/build/conversions.rs`.
#![allow(clippy::too_many_lines)] // generated: a line for each member

use std::collections::BTreeMap;

use base::{bodies, job, mesh, run::Summary, sweep, token};
use files::MeshFormat;
use service::{
    config::Isolation,
    queue::{LoadPoint, WorkerState},
    verbs::{bulk, examples, info, jobs, lists, problems, queue, results, tokens, workers},
};
use solver::{accuracy, element::Element, problem, solution};

use super::{FromMessage, IntoMessage, Reader};
use crate::pb;

/// Implements the conversion of a type to a message, by itself and as a field that is always set.
macro_rules! written {
    ($ours:ty => $message:ty) => {
        impl IntoMessage<$message> for $ours {
            fn into_message(self) -> $message {
                self.into()
            }
        }

        impl IntoMessage<Option<$message>> for $ours {
            fn into_message(self) -> Option<$message> {
                Some(self.into())
            }
        }
    };
}

/// Implements reading a type from a message that must be set.
macro_rules! required {
    ($message:ty => $ours:ty, $expected:literal) => {
        impl FromMessage<Option<$message>> for $ours {
            fn from_message(message: Option<$message>, read: &mut Reader) -> Option<Self> {
                match message {
                    Some(message) => Self::from_message(message, read),
                    None => read.missing($expected),
                }
            }
        }
    };
}

/// Implements reading a type from a message that may be absent, which gives the type's default.
macro_rules! defaulted {
    ($message:ty => $ours:ty) => {
        impl FromMessage<Option<$message>> for $ours {
            fn from_message(message: Option<$message>, read: &mut Reader) -> Option<Self> {
                match message {
                    Some(message) => Self::from_message(message, read),
                    None => Some(Self::default()),
                }
            }
        }
    };
}

written!(problem::BoundaryValue => pb::BoundaryValue);
required!(pb::BoundaryValue => problem::BoundaryValue, "a value");
written!(problem::Material => pb::Material);
written!(problem::Load => pb::Load);
written!(problem::MeshInput => pb::Mesh);
required!(pb::Mesh => problem::MeshInput, "a mesh");
written!(Summary => pb::Summary);

include!(concat!(env!("OUT_DIR"), "/conversions.rs"));
