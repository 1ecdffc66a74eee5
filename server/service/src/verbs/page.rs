//! Lists in pages, and page tokens: the place where the next page begins. A token is opaque to clients, and valid for
//! one list only.

use base::{
    digest::hex,
    job::Job,
    time::Time,
    values::{Integers, Text},
};
use sha2::{Digest, Sha256};
use store::{Cursor, Entries, Filter, Order, OrderBy};

use crate::{error::ApiError, parameters::Parameter};

/// The parameter of the size of a page.
pub const PAGE_SIZE: Parameter<Integers> = Parameter {
    name: "page_size",
    meaning: "Maximum number of entries on a page; default 50",
    values: Integers(1..=MAX_PAGE_SIZE),
};
/// The largest number of entries on a page.
pub const MAX_PAGE_SIZE: i64 = 1000;
/// The default size of a page; a unit test compares it with the text of `PAGE_SIZE`.
const DEFAULT_PAGE_SIZE: i64 = 50;

/// The parameter of the token of the page to return.
pub const PAGE_TOKEN: Parameter<Text> = Parameter {
    name: "page_token",
    meaning: "The next_page_token of the previous page",
    values: Text,
};

/// The requested part of a list.
#[derive(Clone, Debug, Default)]
pub struct Paging {
    /// The maximum number of entries on the page.
    pub size: Option<i64>,
    /// The token of the requested page; absent or empty: the first page.
    pub token: Option<String>,
}

/// A part of a list.
#[derive(Debug)]
pub struct Page<T> {
    /// The entries of the page.
    pub items: Vec<T>,
    /// The token of the next page; `None` on the last page.
    pub next: Option<String>,
}

/// The entries that the store has found for a page.
pub(super) struct Found<T> {
    items: Vec<T>,
    /// Whether the list has more entries, even if the found ones fit on the page.
    cut: bool,
    /// The place up to which the list was searched; `None` if it was searched to its end.
    checked_to: Option<Cursor>,
}

impl<T> From<Vec<T>> for Found<T> {
    fn from(items: Vec<T>) -> Self {
        Found {
            items,
            cut: false,
            checked_to: None,
        }
    }
}

impl<T> From<Entries<T>> for Found<T> {
    fn from(entries: Entries<T>) -> Self {
        let Entries {
            items,
            cut,
            checked_to,
            ..
        } = entries;
        Found {
            items,
            cut,
            checked_to,
        }
    }
}

impl Paging {
    /// The place in the list named `list` where the requested page begins; `None`: the beginning.
    pub(super) fn cursor(&self, list: &str) -> Result<Option<Cursor>, ApiError> {
        let token = self.token.as_deref().filter(|token| !token.is_empty());
        token
            .map(|token| cursor(token, list).ok_or(ApiError::BadPageToken))
            .transpose()
    }

    /// The number of entries to read from the store: one more than the page holds, to show whether there is another
    /// page.
    pub(super) fn limit(&self) -> i64 {
        self.size() + 1
    }

    /// Makes a page of the list named `list` from the entries that were found. `at` returns the place of an entry in
    /// the list.
    pub(super) fn page<T>(
        &self,
        list: &str,
        found: impl Into<Found<T>>,
        at: impl Fn(&T) -> Cursor,
    ) -> Page<T> {
        let Found {
            items: mut found,
            cut,
            checked_to,
        } = found.into();
        let more = cut || found.len() as i64 > self.size();
        found.truncate(self.size() as usize);
        let last = found.last().filter(|_| more);
        let next = last.map(at).or(checked_to);
        let next = next.map(|place| token(place, list));
        Page { items: found, next }
    }

    fn size(&self) -> i64 {
        self.size.unwrap_or(DEFAULT_PAGE_SIZE)
    }
}

/// The name of a list of jobs, made of its filters and its order. The order of statuses and labels in the filters does
/// not matter.
pub(super) fn list_of_jobs(filter: &Filter, order: Order) -> String {
    let filter = filter.clone().tidied();
    format!("jobs {filter:?} {order:?}")
}

/// The place directly after a job in a list with this order.
pub(super) fn after(job: &Job, order: Order) -> Cursor {
    let finished = job.finished_at.map_or(0, Time::micros);
    let micros = match order.by {
        OrderBy::CreatedAt => job.created_at.micros(),
        OrderBy::FinishedAt => finished,
        OrderBy::RunS => finished - job.started_at.map_or(0, Time::micros),
    };
    Cursor {
        micros,
        key: job.key,
    }
}

/// The token of the page that begins after the cursor in the list named `list`.
fn token(cursor: Cursor, list: &str) -> String {
    let Cursor { micros, key } = cursor;
    format!("{micros:016x}{key:016x}{}", checksum(cursor, list))
}

/// Reads a page token of the list named `list`; `None` if the text is not such a token.
fn cursor(token: &str, list: &str) -> Option<Cursor> {
    let (micros, rest) = token.split_at_checked(16)?;
    let (key, _) = rest.split_at_checked(16)?;
    let cursor = Cursor {
        micros: i64::from_str_radix(micros, 16).ok()?,
        key: i64::from_str_radix(key, 16).ok()?,
    };
    (self::token(cursor, list) == token).then_some(cursor)
}

/// The checksum that ties a token to its list. It is no secret: a forged token shows only what the list would show
/// anyway.
fn checksum(Cursor { micros, key }: Cursor, list: &str) -> String {
    let hash = Sha256::digest(format!("{micros} {key} {list}"));
    hex(&hash[..4])
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::job::Status;

    fn filter(statuses: &[Status]) -> Filter {
        Filter {
            statuses: statuses.to_vec(),
            ..Filter::default()
        }
    }

    #[test]
    fn the_meaning_of_page_size_names_the_default() {
        let default = format!("default {DEFAULT_PAGE_SIZE}");
        assert!(PAGE_SIZE.meaning.ends_with(&default));
    }

    #[test]
    fn changed_tokens_are_read_or_refused() {
        let order = Order::NEWEST_FIRST;
        let list = list_of_jobs(&filter(&[Status::Queued]), order);
        let places = [(7, 42), (-1, i64::MAX), (i64::MIN, 0)];
        let seeds = places.map(|(micros, key)| token(Cursor { micros, key }, &list).into_bytes());
        let target = suite::fuzzing::Target {
            name: "tokens",
            seeds: seeds.into(),
            words: &[
                "ffffffffffffffff",
                "-8000000000000000",
                "+",
                "é",
                "0000000000000007",
            ],
            cases: 50_000,
        };
        target.attack(|input| {
            let text = String::from_utf8_lossy(input).into_owned();
            let paging = Paging {
                size: None,
                token: Some(text.clone()),
            };
            match paging.cursor(&list) {
                // what is read is written the same way
                Ok(Some(place)) => {
                    assert_eq!(token(place, &list), text);
                    "read".to_owned()
                }
                Ok(None) => "empty".to_owned(),
                Err(_) => format!("refused {}", text.len().min(60)),
            }
        });
    }

    #[test]
    fn a_token_is_read_back_for_its_own_list_only() {
        let order = Order::NEWEST_FIRST;
        let list = |statuses: &[Status]| list_of_jobs(&filter(statuses), order);
        let both = list(&[Status::Queued, Status::Running]);
        let place = Cursor { micros: 7, key: 42 };
        let token = token(place, &both);
        assert_eq!(cursor(&token, &both), Some(place));
        let same = list(&[Status::Running, Status::Queued, Status::Queued]);
        assert_eq!(cursor(&token, &same), Some(place));
        assert_eq!(cursor(&token, &list(&[Status::Queued])), None);
        assert_eq!(cursor(&token, &list(&[])), None);
        let oldest_first = Order {
            descending: false,
            ..order
        };
        let other = list_of_jobs(&filter(&[Status::Queued, Status::Running]), oldest_first);
        assert_eq!(cursor(&token, &other), None);
    }

    #[test]
    fn anything_else_is_not_a_token() {
        for text in [
            "",
            "7",
            "zzzzzzzzzzzzzzzz0000000000000000",
            "000000000000002a000000000000002a00000000",
            "00000000000000ä2a0000000",
        ] {
            assert_eq!(cursor(text, "jobs"), None, "{text}");
        }
    }
}
