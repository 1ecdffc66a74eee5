//! Page tokens: where a list goes on. Opaque to clients, and of no use for another list.

use sha2::{Digest, Sha256};

use crate::job::Status;

/// The token for the jobs before the one numbered `key`, in a list of these statuses.
pub fn token(key: i64, statuses: &[Status]) -> String {
    format!("{key:016x}{}", seal(key, statuses))
}

/// Reads a token for a list of these statuses; none if it is not one.
pub fn before(token: &str, statuses: &[Status]) -> Option<i64> {
    let (key, _) = token.split_at_checked(16)?;
    let key = i64::from_str_radix(key, 16).ok()?;
    (self::token(key, statuses) == token).then_some(key)
}

/// Ties a token to its list, whatever the order in which the statuses were named. No secret: who
/// forges one sees what the list would have shown anyway.
fn seal(key: i64, statuses: &[Status]) -> String {
    let mut words: Vec<&str> = statuses.iter().map(|status| status.as_str()).collect();
    words.sort_unstable();
    words.dedup();
    let hash = Sha256::digest(format!("{key} {}", words.join(",")));
    hash.iter()
        .take(4)
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_read_back_for_its_own_list_only() {
        let list = [Status::Queued, Status::Running];
        let token = token(42, &list);
        assert_eq!(before(&token, &list), Some(42));
        assert_eq!(
            before(&token, &[Status::Running, Status::Queued, Status::Queued]),
            Some(42)
        );
        assert_eq!(before(&token, &[Status::Queued]), None);
        assert_eq!(before(&token, &[]), None);
    }

    #[test]
    fn anything_else_is_not_a_token() {
        for text in [
            "",
            "7",
            "zzzzzzzzzzzzzzzz00000000",
            "000000000000002a00000000",
            "00000000000000ä2a0000000",
        ] {
            assert_eq!(before(text, &[]), None, "{text}");
        }
    }
}
