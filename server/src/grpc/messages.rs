//! Reading the fields of messages, by the same parameters as over REST; and what fits into a message.

use prost::Message;
use tonic::{Request, Response, metadata::MetadataValue};

use crate::{
    caller::Caller,
    convert::bad,
    error::ApiError,
    parameters::{Parameter, Values},
    pb,
    verbs::{
        key::{IDEMPOTENCY_KEY, Key},
        page::{PAGE_SIZE, Paging},
        profiles::{POINTS, Points},
    },
};

/// Largest message, both ways; the contract's promise.
pub(super) const MAX_MESSAGE_BYTES: usize = 1 << 20;
/// Rows of a history in one answer, some 200 bytes each: it must not be larger either.
pub(super) const MAX_ROWS: usize = 4000;
/// Places of a profile in one answer, some 90 bytes each.
const MAX_PLACES: usize = 10_000;

/// So many of these jobs fit into one message; at least one.
pub(super) fn fitting(jobs: &[pb::Job]) -> usize {
    const AROUND: usize = 16; // tag and length of each, and the page's token
    let mut bytes = 0;
    let fits = |job: &&pb::Job| {
        bytes += job.encoded_len() + AROUND;
        bytes <= MAX_MESSAGE_BYTES
    };
    jobs.iter().take_while(fits).count().max(1)
}

/// The caller and the message of a request.
pub(super) fn asked<T>(mut request: Request<T>) -> Result<(Caller, T), ApiError> {
    let caller = request.extensions_mut().remove::<Caller>();
    let caller =
        caller.ok_or_else(|| ApiError::internal("the caller of a request was not identified"))?;
    Ok((caller, request.into_inner()))
}

/// The value of a field that is empty when it is left out.
pub(super) fn given<V: Values>(
    parameter: &Parameter<V>,
    text: &str,
) -> Result<Option<V::Value>, ApiError> {
    match text {
        "" => Ok(None),
        text => parameter.read(text).map(Some),
    }
}

/// What part of a list is asked for; a size of 0 means the default.
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

/// The key of a request that may be repeated.
pub(super) fn key(request_id: Option<String>) -> Result<Option<Key>, ApiError> {
    let key = request_id.map(|key| IDEMPOTENCY_KEY.read(&key));
    key.transpose()
}

/// Where a profile is wanted, as far as it fits into a message.
pub(super) fn points(text: Option<&str>) -> Result<Points, ApiError> {
    let Some(text) = text else {
        return Ok(Points::default());
    };
    match POINTS.read(text)? {
        Points::Spaced(count) if count > MAX_PLACES => {
            let expected = POINTS.values.expected();
            let expected =
                format!("at most {MAX_PLACES} places in one message; over REST {expected}");
            Err(bad(POINTS.name, text, expected))
        }
        points => Ok(points),
    }
}

/// The same header as over REST, as metadata.
pub(super) fn noting_replay<T>(mut response: Response<T>, replayed: bool) -> Response<T> {
    if replayed {
        let value = MetadataValue::from_static("true");
        response
            .metadata_mut()
            .insert("idempotency-replayed", value);
    }
    response
}

/// An offset behind the end.
pub(super) fn beyond(offset: u64, total: u64) -> Result<(), ApiError> {
    if offset > total {
        Err(ApiError::RangeNotSatisfiable(total))
    } else {
        Ok(())
    }
}
