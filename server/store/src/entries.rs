//! The entries of a page of a list, limited by the size of their labels.

use std::{collections::BTreeMap, ops::ControlFlow};

use super::filter::Cursor;

/// The largest size of the labels (bytes) of all entries of a page: the labels of a thousand jobs might have a hundred
/// times as many.
const MOST_LABEL_BYTES: usize = 2 << 20;

/// The entries of a page of a list.
#[derive(Debug)]
pub struct Entries<T> {
    /// The entries, in the order of the list.
    pub items: Vec<T>,
    /// Whether the page ends early, because the labels of its entries are large: more entries follow.
    pub cut: bool,
    /// The place up to which the list was checked; `None` if it was checked to its end. The list may go on there even
    /// if this page has no entries.
    pub checked_to: Option<Cursor>,
    bytes: usize,
}

impl<T> Default for Entries<T> {
    fn default() -> Self {
        Entries {
            items: vec![],
            cut: false,
            checked_to: None,
            bytes: 0,
        }
    }
}

impl<T> Entries<T> {
    /// Adds an entry, whose labels have `bytes` bytes, unless the labels of all entries would become too large.
    pub(super) fn add(&mut self, entry: T, bytes: usize) -> ControlFlow<()> {
        self.bytes = self.bytes.saturating_add(bytes);
        if self.bytes > MOST_LABEL_BYTES && !self.items.is_empty() {
            self.cut = true;
            return ControlFlow::Break(());
        }
        self.items.push(entry);
        ControlFlow::Continue(())
    }
}

/// The size of labels (bytes).
pub(super) fn bytes_of(labels: &BTreeMap<String, String>) -> usize {
    labels
        .iter()
        .map(|(key, value)| key.len() + value.len())
        .sum()
}
