//! Sizes and counts as text for people.

/// A number of bytes as text for people.
pub fn size(bytes: u64) -> String {
    match bytes {
        u64::MAX => "more than 10^10 GiB".into(),
        bytes if bytes >> 30 > 0 => format!("{:.1} GiB", bytes as f64 / (1u64 << 30) as f64),
        bytes => format!("{:.1} MiB", bytes as f64 / (1u64 << 20) as f64),
    }
}

/// A number of things, as text for people: "1 job", "2 jobs".
pub fn number_of(count: usize, what: &str) -> String {
    match count {
        1 => format!("1 {what}"),
        count => format!("{count} {what}s"),
    }
}

/// A number of unknowns as text for people; `u64::MAX` stands for any larger number.
pub fn count(unknowns: u64) -> String {
    match unknowns {
        u64::MAX => "more than 10^19".into(),
        unknowns => unknowns.to_string(),
    }
}
