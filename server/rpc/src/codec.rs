//! The gRPC codec, which limits the memory that messages take when they are decoded.
//!
//! A limit on the bytes of a message is not enough: two bytes make an empty submessage, which takes a kilobyte when it
//! is decoded. The parts of a message are therefore counted first, by the contract, without decoding the message. The
//! build makes the generated services use this codec.

use std::{collections::HashMap, marker::PhantomData, sync::LazyLock};

use prost::{
    Message, Name,
    bytes::{Buf, Bytes},
    encoding::{WireType, decode_key, decode_varint},
};
use prost_types::{
    DescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};
use service::error::ApiError;
use tonic::{
    Status,
    codec::{DecodeBuf, Decoder},
};
use tonic_prost::ProstEncoder;

use crate::pb;

/// The largest size of a decoded message (bytes). A message of the largest size (1 MiB) that describes a real problem
/// takes a few MiB.
const MOST_BYTES: usize = 32 << 20;

/// The codec of the generated services and clients, with a limit on the memory of decoded messages.
#[derive(Debug, Default)]
pub struct Codec<T, U>(PhantomData<(T, U)>);

/// A decoder of messages whose memory is at most `MOST_BYTES`.
#[derive(Debug, Default)]
pub struct LimitedDecoder<U>(PhantomData<U>);

impl<T, U> tonic::codec::Codec for Codec<T, U>
where
    T: Message + Send + 'static,
    U: Message + Default + Name + Send + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = ProstEncoder<T>;
    type Decoder = LimitedDecoder<U>;

    fn encoder(&mut self) -> ProstEncoder<T> {
        ProstEncoder::default()
    }

    fn decoder(&mut self) -> LimitedDecoder<U> {
        LimitedDecoder(PhantomData)
    }
}

impl<U: Message + Default + Name> Decoder for LimitedDecoder<U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        let bytes = buffer.copy_to_bytes(buffer.remaining());
        Ok(Some(decode(bytes)?))
    }
}

fn decode<U: Message + Default + Name>(bytes: Bytes) -> Result<U, ApiError> {
    let contract = &*CONTRACT;
    if let Some(kind) = contract.numbers.get(&U::full_name()) {
        let mut left = MOST_BYTES;
        contract.count(*kind, bytes.clone(), &mut left)?;
    }
    U::decode(bytes).map_err(malformed)
}

fn malformed(error: prost::DecodeError) -> ApiError {
    ApiError::BadRequest(format!("the message does not follow the contract: {error}"))
}

static CONTRACT: LazyLock<Contract> = LazyLock::new(Contract::read);

/// The memory that the messages of the contract take when they are decoded.
struct Contract {
    kinds: Vec<Kind>,
    /// The indices in `kinds` of the types of messages, by their full names.
    numbers: HashMap<String, usize>,
}

/// A type of message of the contract.
struct Kind {
    name: String,
    fields: HashMap<u32, Field>,
    /// The memory of an empty message of this type (bytes).
    bytes: usize,
}

/// The kind of content of a field.
#[derive(Clone, Copy)]
enum Field {
    /// A message, by its index in `Contract::kinds`, or an entry of a map.
    Message(usize),
    /// Text or bytes.
    Text,
    /// A number, or many numbers packed into one field.
    Number,
}

/// The memory of an empty `String`, `Vec` or map (bytes).
const CONTAINER: usize = 24;
/// The memory of a number, present or absent (bytes).
const NUMBER: usize = 16;

impl Contract {
    fn read() -> Contract {
        let set = FileDescriptorSet::decode(pb::DESCRIPTORS).unwrap_or_default();
        let mut descriptors = vec![];
        for file in &set.file {
            for message in &file.message_type {
                collect(file.package(), message, &mut descriptors);
            }
        }
        let numbers: HashMap<String, usize> = descriptors
            .iter()
            .enumerate()
            .map(|(number, (name, _))| (name.clone(), number))
            .collect();
        let field = |kind: Type, type_name: &str| match kind {
            Type::Message | Type::Group => numbers
                .get(type_name.trim_start_matches('.'))
                .map_or(Field::Text, |number| Field::Message(*number)),
            Type::String | Type::Bytes => Field::Text,
            _ => Field::Number,
        };
        let kinds = descriptors
            .iter()
            .enumerate()
            .map(|(number, (name, message))| {
                let fields = message.field.iter();
                let fields = fields.map(|f| (f.number() as u32, field(f.r#type(), f.type_name())));
                Kind {
                    name: name.clone(),
                    fields: fields.collect(),
                    bytes: size(number, &descriptors, &numbers, 0),
                }
            });
        Contract {
            kinds: kinds.collect(),
            numbers,
        }
    }

    /// Subtracts the memory of a message's fields from `left`, and fails when `left` is used up.
    fn count(&self, kind: usize, mut bytes: Bytes, left: &mut usize) -> Result<(), ApiError> {
        let Some(kind) = self.kinds.get(kind) else {
            return Ok(());
        };
        while bytes.has_remaining() {
            let (number, wire) = decode_key(&mut bytes).map_err(malformed)?;
            let field = kind.fields.get(&number).copied();
            // to pass over it would be to answer something else than was asked
            let field = field.ok_or_else(|| unknown_field(number, &kind.name))?;
            let taken = match wire {
                WireType::Varint => {
                    decode_varint(&mut bytes).map_err(malformed)?;
                    NUMBER
                }
                WireType::LengthDelimited => {
                    let length = decode_varint(&mut bytes).map_err(malformed)? as usize;
                    if length > bytes.remaining() {
                        return Err(cut_off());
                    }
                    let content = bytes.split_to(length);
                    match field {
                        Field::Message(child) => {
                            self.count(child, content, left)?;
                            CONTAINER + self.kinds.get(child).map_or(0, |child| child.bytes)
                        }
                        Field::Text => CONTAINER + length,
                        // many numbers in one field: each takes at least a byte
                        Field::Number => length.saturating_mul(8),
                    }
                }
                WireType::ThirtyTwoBit | WireType::SixtyFourBit => {
                    let length = if wire == WireType::SixtyFourBit { 8 } else { 4 };
                    if bytes.remaining() < length {
                        return Err(cut_off());
                    }
                    bytes.advance(length);
                    NUMBER
                }
                // no message of the contract has groups
                WireType::StartGroup | WireType::EndGroup => {
                    return Err(ApiError::BadRequest("the message contains a group".into()));
                }
            };
            *left = left.checked_sub(taken).ok_or(ApiError::MessageTooLarge {
                limit_bytes: MOST_BYTES,
            })?;
        }
        Ok(())
    }
}

fn cut_off() -> ApiError {
    ApiError::BadRequest("the message ends in the middle of a field".into())
}

fn unknown_field(number: u32, message: &str) -> ApiError {
    ApiError::BadRequest(format!(
        "the message {message} has a field {number}, which this service (version {}) does not know: the client was built with \
         the contract of another version; the contract of this version is at /proto/signorini.proto",
        env!("CARGO_PKG_VERSION")
    ))
}

/// Collects a message type and the types that are defined inside it, with their full names.
fn collect<'a>(
    scope: &str,
    message: &'a DescriptorProto,
    all: &mut Vec<(String, &'a DescriptorProto)>,
) {
    let name = format!("{scope}.{}", message.name());
    for inner in &message.nested_type {
        collect(&name, inner, all);
    }
    all.push((name, message));
}

/// The memory of an empty message of a type (bytes): it contains the memory of its single messages, but not of its
/// repeated ones.
fn size(
    number: usize,
    all: &[(String, &DescriptorProto)],
    numbers: &HashMap<String, usize>,
    depth: usize,
) -> usize {
    // a message that contains itself is behind a pointer
    const DEEPEST: usize = 16;
    let Some((_, message)) = all.get(number) else {
        return 0;
    };
    let fields = message.field.iter().map(|field| {
        let inner = numbers.get(field.type_name().trim_start_matches('.'));
        match (field.label(), field.r#type(), inner) {
            (Label::Repeated, ..) | (_, Type::String | Type::Bytes, _) => CONTAINER,
            (_, Type::Message, Some(inner)) if depth < DEEPEST => {
                8 + size(*inner, all, numbers, depth + 1)
            }
            _ => NUMBER,
        }
    });
    fields.sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn kind<U: Name>() -> usize {
        CONTRACT.numbers[&U::full_name()]
    }

    #[test]
    fn a_message_is_not_underestimated() {
        assert!(
            CONTRACT.kinds[kind::<pb::CreateJobRequest>()].bytes
                >= size_of::<pb::CreateJobRequest>()
        );
        assert!(CONTRACT.kinds[kind::<pb::Contact>()].bytes >= size_of::<pb::Contact>());
        assert!(CONTRACT.kinds[kind::<pb::Problem>()].bytes >= size_of::<pb::Problem>());
    }

    #[test]
    fn many_empty_parts_are_refused_before_they_are_made() {
        let empty_jobs: Vec<u8> = [0x0a, 0].repeat(1 << 19);
        let refused = decode::<pb::BatchCreateJobsRequest>(empty_jobs.into());
        assert!(matches!(refused, Err(ApiError::MessageTooLarge { .. })));
        let few: Vec<u8> = [0x0a, 0].repeat(1000);
        let jobs = decode::<pb::BatchCreateJobsRequest>(few.into()).unwrap();
        assert_eq!(jobs.jobs.len(), 1000);
    }

    #[test]
    fn an_invalid_message_is_refused() {
        for bytes in [
            &[0xff; 20][..],
            &[0x0a, 0x7f],
            &[0x0a],
            &[0x09, 1],
            &[0x0b],
            &[0x0a, 2, 0x0a, 9],
        ] {
            let refused = decode::<pb::BatchCreateJobsRequest>(Bytes::copy_from_slice(bytes));
            assert!(matches!(refused, Err(ApiError::BadRequest(_))), "{bytes:?}");
        }
        // fields that only a later contract has: of the request, and of a job in it
        for bytes in [
            &[0xf8, 0x3f, 1][..],
            &[0x0a, 3, 0xf8, 0x3f, 1],
            &[0x0a, 4, 0xfa, 0x3f, 1, b'a'],
        ] {
            let refused = decode::<pb::BatchCreateJobsRequest>(Bytes::copy_from_slice(bytes));
            let Err(ApiError::BadRequest(why)) = refused else {
                panic!("{bytes:?}");
            };
            assert!(why.contains("has a field 1023, which"), "{why}");
        }
        // text that is not UTF-8, which only decoding finds
        let refused = decode::<pb::GetJobRequest>(Bytes::from_static(&[0x0a, 1, 0xff]));
        assert!(matches!(refused, Err(ApiError::BadRequest(_))));
    }
}
