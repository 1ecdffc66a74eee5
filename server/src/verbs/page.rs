//! Page tokens: where a list goes on. Opaque to clients, and of no use for another list.

use sha2::{Digest, Sha256};

use crate::{
    digest::hex,
    job::Job,
    store::{Cursor, Filter, Order, OrderBy},
};

/// What tells a list of jobs from others: its filters and its order, whatever the order of statuses and labels.
pub fn list_of_jobs(filter: &Filter, order: Order) -> String {
    let filter = filter.clone().tidied();
    format!("jobs {filter:?} {order:?}")
}

/// The place right after a job in a list of that order.
pub fn after(job: &Job, order: Order) -> Cursor {
    let time = match order.by {
        OrderBy::CreatedAt => Some(job.created_at),
        OrderBy::FinishedAt => job.finished_at,
    };
    Cursor {
        micros: time.map_or(0, |time| time.micros()),
        key: job.key,
    }
}

/// The token for what comes after the cursor in this list.
pub fn token(cursor: Cursor, list: &str) -> String {
    let Cursor { micros, key } = cursor;
    format!("{micros:016x}{key:016x}{}", seal(cursor, list))
}

/// Reads a token for this list; none if it is not one.
pub fn cursor(token: &str, list: &str) -> Option<Cursor> {
    let (micros, rest) = token.split_at_checked(16)?;
    let (key, _) = rest.split_at_checked(16)?;
    let cursor = Cursor {
        micros: i64::from_str_radix(micros, 16).ok()?,
        key: i64::from_str_radix(key, 16).ok()?,
    };
    (self::token(cursor, list) == token).then_some(cursor)
}

/// Ties a token to its list. No secret: who forges one sees what the list would have shown anyway.
fn seal(Cursor { micros, key }: Cursor, list: &str) -> String {
    let hash = Sha256::digest(format!("{micros} {key} {list}"));
    hex(&hash[..4])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Status;

    fn filter(statuses: &[Status]) -> Filter {
        Filter {
            statuses: statuses.to_vec(),
            ..Filter::default()
        }
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
