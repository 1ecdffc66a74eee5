//! Writes fields as JSON in pieces, since the whole text of a large solution is three times as long as its numbers.

use std::ops::Deref;

use serde::Serialize;
use solver::solution::Fields;

/// The largest number of numbers that are written at once: their text is 256 KiB at most.
const NUMBERS: usize = 8192;
/// The largest number of elements that are written at once: their text is 256 KiB at most.
const ELEMENTS: usize = 2048;

/// The text that `serde_json` would write for fields, in pieces. `F` holds the fields: a reference, or a shared
/// pointer.
pub struct FieldsJson<F> {
    fields: F,
    column: usize,
    value: usize,
}

/// The columns in the order of the text, each with the text before its values.
#[rustfmt::skip]
const COLUMNS: [(&str, Column); 18] = [
    (r#"{"x":["#,                            |f, from| part(&f.x, from)),
    (r#"],"y":["#,                           |f, from| part(&f.y, from)),
    (r#"],"ux":["#,                          |f, from| part(&f.ux, from)),
    (r#"],"uy":["#,                          |f, from| part(&f.uy, from)),
    (r#"],"stress_xx":["#,                   |f, from| part(&f.stress_xx, from)),
    (r#"],"stress_yy":["#,                   |f, from| part(&f.stress_yy, from)),
    (r#"],"stress_xy":["#,                   |f, from| part(&f.stress_xy, from)),
    (r#"],"stress_zz":["#,                   |f, from| part(&f.stress_zz, from)),
    (r#"],"contact_state":["#,               |f, from| part(&f.contact_state, from)),
    (r#"],"elements":["#,                    |f, from| part(&f.elements, from)),
    (r#"],"element_error":["#,               |f, from| part(&f.element_error, from)),
    (r#"],"gauss":{"order":"#,               |f, from| part(std::slice::from_ref(&f.gauss.order), from)),
    (r#","x":["#,                            |f, from| part(&f.gauss.x, from)),
    (r#"],"y":["#,                           |f, from| part(&f.gauss.y, from)),
    (r#"],"stress_xx":["#,                   |f, from| part(&f.gauss.stress_xx, from)),
    (r#"],"stress_yy":["#,                   |f, from| part(&f.gauss.stress_yy, from)),
    (r#"],"stress_xy":["#,                   |f, from| part(&f.gauss.stress_xy, from)),
    (r#"],"stress_zz":["#,                   |f, from| part(&f.gauss.stress_zz, from)),
];

/// A function that gives the next values of a column, starting from an index.
type Column = fn(&Fields, usize) -> Values<'_>;

/// The end of the JSON text, after the last value.
const END: &str = "]}}";

/// Some values of a column: their number, whether they are the column's last, and how they are written as a list.
type Values<'a> = (usize, bool, Box<WriteList<'a>>);

type WriteList<'a> = dyn FnOnce(&mut Vec<u8>) -> serde_json::Result<()> + 'a;

fn part<T: Serialize>(column: &[T], from: usize) -> Values<'_> {
    let most = if size_of::<T>() > size_of::<f64>() {
        ELEMENTS
    } else {
        NUMBERS
    };
    let values = &column[from.min(column.len())..column.len().min(from + most)];
    let write = move |out: &mut Vec<u8>| serde_json::to_writer(out, values);
    let last = from + values.len() >= column.len();
    (values.len(), last, Box::new(write))
}

impl<F: Deref<Target = Fields>> FieldsJson<F> {
    /// Prepares writing fields, from the beginning of the text.
    pub fn new(fields: F) -> Self {
        FieldsJson {
            fields,
            column: 0,
            value: 0,
        }
    }

    /// Returns the next piece of the text, never empty, and `None` after the last piece.
    ///
    /// # Errors
    ///
    /// A number that is not finite, which JSON cannot write.
    pub fn piece(&mut self) -> serde_json::Result<Option<Vec<u8>>> {
        let Some((before, values)) = COLUMNS.get(self.column) else {
            let last = self.column == COLUMNS.len();
            self.column = COLUMNS.len() + 1;
            return Ok(last.then(|| END.into()));
        };
        let mut out = Vec::new();
        if self.value == 0 {
            out.extend(before.as_bytes());
        }
        let (count, last) = {
            let (count, last, write) = values(&self.fields, self.value);
            if count > 0 {
                // the list has brackets of its own: the first becomes the comma after the values before
                let start = out.len();
                write(&mut out)?;
                out.pop();
                match self.value {
                    0 => drop(out.remove(start)),
                    _ => out[start] = b',',
                }
            }
            (count, last)
        };
        self.value += count;
        if last {
            (self.column, self.value) = (self.column + 1, 0);
        }
        if out.is_empty() {
            // a column that ended with the piece before
            self.piece()
        } else {
            Ok(Some(out))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::tests::mixed;
    use solver::element::Element;

    fn text(fields: &Fields) -> String {
        let mut pieces = FieldsJson::new(fields);
        let mut all = Vec::new();
        while let Some(piece) = pieces.piece().unwrap() {
            assert!(!piece.is_empty() && piece.len() <= 256 << 10);
            all.extend(piece);
        }
        assert!(pieces.piece().unwrap().is_none());
        String::from_utf8(all).unwrap()
    }

    #[test]
    fn the_pieces_are_the_text_of_the_whole() {
        let mut fields = mixed();
        assert_eq!(text(&fields), serde_json::to_string(&fields).unwrap());
        for count in [
            0,
            1,
            NUMBERS - 1,
            NUMBERS,
            NUMBERS + 1,
            2 * NUMBERS,
            2 * NUMBERS + 1,
        ] {
            fields.ux = (0..count).map(|i| i as f64 / 3.0).collect();
            fields.gauss.stress_zz = fields.ux.iter().map(|x| -x).collect();
            fields.contact_state = vec![-1; count];
            assert_eq!(
                text(&fields),
                serde_json::to_string(&fields).unwrap(),
                "{count}"
            );
        }
        let largest = u32::MAX;
        fields = Fields {
            elements: vec![Element::Quad([largest; 8]); 5000],
            ..Fields::default()
        };
        fields.gauss.x = vec![-f64::MIN_POSITIVE * 1.000_000_000_000_000_2; 9000];
        assert_eq!(text(&fields), serde_json::to_string(&fields).unwrap());
    }
}
