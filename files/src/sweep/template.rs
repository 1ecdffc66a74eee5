//! A JSON text with gaps that are filled with values.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::pointer::Place;

/// A JSON text with gaps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Template {
    text: String,
    /// The gaps in the order of the sweep's paths.
    gaps: Vec<Gap>,
    /// The indices of the gaps in the order of their places in the text.
    order: Vec<usize>,
}

/// A gap in a text, for a value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Gap {
    /// The range of the text that the value replaces; empty for a new member of an object.
    place: Range<usize>,
    /// The text to write before the value: the name of a new member, else empty.
    before: String,
    /// The text to write after the value: a comma after a new member, where one is needed.
    after: String,
}

impl Template {
    /// A text with a gap at each of `places`, none of which may be inside another.
    pub(super) fn new(text: &str, places: Vec<Place>) -> Template {
        let mut gaps: Vec<Gap> = Vec::with_capacity(places.len());
        for place in places {
            gaps.push(match place {
                Place::Value(place) => Gap {
                    place,
                    before: String::new(),
                    after: String::new(),
                },
                Place::Absent {
                    inside,
                    empty,
                    name,
                } => {
                    let here = |gap: &Gap| gap.place == (inside..inside);
                    let first = !gaps.iter().any(here);
                    let name = serde_json::Value::String(name);
                    Gap {
                        place: inside..inside,
                        before: if empty && !first {
                            format!(",{name}:")
                        } else {
                            format!("{name}:")
                        },
                        after: (if empty { "" } else { "," }).to_owned(),
                    }
                }
            });
        }
        let mut order: Vec<usize> = (0..gaps.len()).collect();
        // stable: members of one object in the order of the paths
        order.sort_by_key(|k| (gaps[*k].place.start, gaps[*k].place.end));
        Template {
            text: text.to_owned(),
            gaps,
            order,
        }
    }

    /// The text with a value in each gap. Where the value is `None`, the text remains as it is.
    pub(super) fn filled(&self, values: &[Option<&str>]) -> String {
        let mut filled = String::with_capacity(self.text.len() + 64);
        let mut at = 0;
        for k in &self.order {
            let (Some(gap), Some(Some(value))) = (self.gaps.get(*k), values.get(*k)) else {
                continue;
            };
            filled.push_str(self.text.get(at..gap.place.start).unwrap_or_default());
            filled.push_str(&gap.before);
            filled.push_str(value);
            filled.push_str(&gap.after);
            at = gap.place.end;
        }
        filled.push_str(self.text.get(at..).unwrap_or_default());
        filled
    }

    pub(super) fn bytes(&self) -> usize {
        let more = |gap: &Gap| gap.before.len() + gap.after.len();
        self.text.len() + self.gaps.iter().map(more).sum::<usize>()
    }
}
