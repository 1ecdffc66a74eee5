//! Reads the fields of messages, by the same parameters as over REST, and limits answers to the size of a message.

use base::{caller::Caller, values::Values};
use prost::Message;
use service::{
    error::ApiError,
    parameters::Parameter,
    verbs::{
        MAX_MESSAGE_BYTES,
        key::{IDEMPOTENCY_KEY, Key},
        page::{PAGE_SIZE, Paging},
        profiles::{POINTS, Points},
    },
};
use tonic::{Request, Response, Status, metadata::MetadataValue};

use crate::convert::invalid_field;

/// The largest number of rows of a history in one answer, some 200 bytes each, so that the answer fits into a message.
pub(super) const MAX_ROWS: usize = 4000;
/// The largest number of points of a profile in one answer, some 90 bytes each, so that the answer fits into a message.
const MAX_PLACES: usize = 10_000;

/// How many of these messages, from the first on, fit into one message together; at least 1.
pub(super) fn messages_that_fit<M: Message>(messages: &[M]) -> usize {
    const AROUND: usize = 16; // tag and length of each, and the page's token
    let mut bytes = 0;
    let fits = |message: &&M| {
        bytes += message.encoded_len() + AROUND;
        bytes <= MAX_MESSAGE_BYTES
    };
    messages.iter().take_while(fits).count().max(1)
}

/// Answers with a message that cannot be divided into pages; if it is larger than a message may be, with an error that
/// says in `instead` where REST has the same data.
pub(super) fn one_message<M: Message>(
    message: M,
    instead: &'static str,
) -> Result<Response<M>, Status> {
    if message.encoded_len() > MAX_MESSAGE_BYTES {
        return Err(ApiError::AnswerTooLarge { instead }.into());
    }
    Ok(Response::new(message))
}

/// Splits a request into its caller and its message.
pub(super) fn caller_and_message<T>(mut request: Request<T>) -> Result<(Caller, T), ApiError> {
    let caller = request.extensions_mut().remove::<Caller>();
    let caller =
        caller.ok_or_else(|| ApiError::internal("the caller of a request was not identified"))?;
    Ok((caller, request.into_inner()))
}

/// Reads the value of a text field; `None` if the text is empty, which means left out.
pub(super) fn read_if_set<V: Values>(
    parameter: &Parameter<V>,
    text: &str,
) -> Result<Option<V::Value>, ApiError> {
    match text {
        "" => Ok(None),
        text => parameter.read(text).map(Some),
    }
}

/// Reads which part of a list is requested; a size of 0 means the default.
pub(super) fn paging(size: i32, token: String) -> Result<Paging, ApiError> {
    let size = match size {
        0 => None,
        size => Some(PAGE_SIZE.check(size)?),
    };
    Ok(Paging {
        size,
        token: Some(token),
    })
}

/// Reads the idempotency key of a request.
pub(super) fn key(request_id: Option<String>) -> Result<Option<Key>, ApiError> {
    let key = request_id.map(|key| IDEMPOTENCY_KEY.read(&key));
    key.transpose()
}

/// Reads the points at which a profile is requested; an error if they do not fit into a message.
pub(super) fn points(text: Option<&str>) -> Result<Points, ApiError> {
    let Some(text) = text else {
        return Ok(Points::default());
    };
    match POINTS.read(text)? {
        Points::Spaced(count) if count > MAX_PLACES => {
            let expected = POINTS.values.expected();
            let expected =
                format!("at most {MAX_PLACES} places in one message; over REST {expected}");
            Err(invalid_field(POINTS.name, text, expected))
        }
        points => Ok(points),
    }
}

/// Marks the response in its metadata if the request was a repetition, as the header `Idempotency-Replayed` does over
/// REST.
pub(super) fn noting_replay<T>(mut response: Response<T>, replayed: bool) -> Response<T> {
    if replayed {
        let value = MetadataValue::from_static("true");
        response
            .metadata_mut()
            .insert("idempotency-replayed", value);
    }
    response
}

/// Refuses an offset after the end of the data, which has `total` bytes.
pub(super) fn check_offset(offset: u64, total: u64) -> Result<(), ApiError> {
    if offset > total {
        Err(ApiError::RangeNotSatisfiable(total))
    } else {
        Ok(())
    }
}
