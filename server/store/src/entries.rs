//! Entries of a list, as many as have room.

use std::{collections::BTreeMap, ops::ControlFlow};

use super::filter::Cursor;

/// Most bytes of labels of the entries of a list that are read at a time: a page of a thousand jobs might have a hundred times
/// as many.
const MOST_LABEL_BYTES: usize = 2 << 20;

/// Entries of a list.
#[derive(Debug)]
pub struct Entries<T> {
    /// In the order of the list.
    pub items: Vec<T>,
    /// There are more, which were not read since the labels of these are large.
    pub cut: bool,
    /// The place up to which the list was checked, if it goes on there: it may then have more, also if there are no items.
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
    /// Adds an entry with labels of so many bytes, if they have room beside those of the others.
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

/// Bytes of labels.
pub(super) fn bytes_of(labels: &BTreeMap<String, String>) -> usize {
    labels
        .iter()
        .map(|(key, value)| key.len() + value.len())
        .sum()
}
