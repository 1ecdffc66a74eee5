//! Bulk operations: cancel or delete all jobs that match a filter.

use std::sync::Arc;

use base::caller::Caller;
use futures_util::future::BoxFuture;
use schemars::JsonSchema;
use store::{Filter, Keys};
use tracing::info;

use super::{
    filters,
    service::{Service, detached},
};
use crate::error::ApiError;

/// How many jobs a bulk operation matched and changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, JsonSchema)]
#[schemars(rename = "Many")] // its published name
pub struct BulkResult {
    /// Jobs that match the filters.
    pub matched: u64,
    /// How many of the matching jobs changed.
    pub changed: u64,
}

/// Asks all jobs that match a filter to stop; jobs submitted later are not affected.
pub fn cancel_many<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    filter: Filter,
) -> BoxFuture<'a, Result<BulkResult, ApiError>> {
    Box::pin(async move { for_each(service, caller, filter, Action::Cancel).await })
}

/// Deletes all jobs that match a filter and have ended.
pub fn delete_many<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    filter: Filter,
) -> BoxFuture<'a, Result<BulkResult, ApiError>> {
    Box::pin(async move { for_each(service, caller, filter, Action::Delete).await })
}

/// The action that a bulk operation applies to each job.
#[derive(Clone, Copy, Debug)]
enum Action {
    Cancel,
    Delete,
}

/// Applies an action to every job that matches a filter, in many short transactions, so that other requests do not wait
/// for all of them. The action continues if the client disconnects.
async fn for_each(
    service: &Arc<Service>,
    caller: &Caller,
    filter: Filter,
    action: Action,
) -> Result<BulkResult, ApiError> {
    const AT_ONCE: i64 = 1000;
    let filter = filters::required(filter)?;
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        let store = &service.store;
        let last = store.last_key().await?;
        let (mut after, mut many) = (None, BulkResult::default());
        loop {
            let found = store.keys(caller.visible_owners(), &filter, after, last, AT_ONCE);
            let Keys { keys, next } = found.await?;
            let mut rest = &keys[..];
            while !rest.is_empty() {
                let (seen, changed) = act(&service, &caller, rest, action).await?;
                many.matched += seen as u64;
                many.changed += changed as u64;
                rest = rest.get(seen..).unwrap_or_default();
            }
            if next.is_none() {
                info!(
                    many.matched,
                    many.changed,
                    owner = caller.owner(),
                    request_id = caller.request_id(),
                    "{action:?} by filter: {} of {} jobs",
                    many.changed,
                    many.matched
                );
                return Ok(many);
            }
            after = next;
        }
    })
    .await
}

/// Applies an action to the jobs at the beginning of `keys`. Returns how many of `keys` were handled, and how many of
/// these jobs changed.
async fn act(
    service: &Service,
    caller: &Caller,
    keys: &[i64],
    action: Action,
) -> Result<(usize, usize), ApiError> {
    match action {
        Action::Cancel => Ok(service.queue.cancel_some(keys).await?),
        Action::Delete => {
            let batch = service
                .store
                .delete_ended(caller.visible_owners(), keys)
                .await?;
            service.queue.announce(&batch.changed);
            Ok((batch.seen, batch.done))
        }
    }
}
