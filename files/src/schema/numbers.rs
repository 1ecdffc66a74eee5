//! Checks lists of numbers, which are most of a large problem, by their characters: serde converts the numbers
//! afterwards, and converting them twice takes longer than everything else together.

use super::shape::{Shape, Type};

/// The number of items of a JSON text if it fits the shape, which is a list of numbers or of lists of numbers; `None`
/// if it does not fit, or if that cannot be decided from its characters.
pub(super) fn count(shape: &Shape, text: &str) -> Option<usize> {
    list(shape, text.as_bytes(), &mut 0)
}

fn list(shape: &Shape, text: &[u8], at: &mut usize) -> Option<usize> {
    let items = shape.items.as_deref()?;
    if text.get(*at) != Some(&b'[') {
        return None;
    }
    *at += 1;
    let mut count = 0;
    loop {
        match text.get(*at)? {
            b']' => break,
            b',' | b' ' | b'\n' | b'\r' | b'\t' => *at += 1,
            _ => {
                match items.items {
                    Some(_) => list(items, text, at).map(|_| ())?,
                    None => number(items, text, at)?,
                }
                count += 1;
            }
        }
    }
    *at += 1;
    shape.has_length(count).then_some(count)
}

fn number(shape: &Shape, text: &[u8], at: &mut usize) -> Option<()> {
    let fraction = match (shape.types(), shape.minimum) {
        ([Type::Number], None) => true,
        ([Type::Integer], Some(0.0)) => false,
        _ => return None,
    };
    loop {
        match text.get(*at)? {
            b'0'..=b'9' => {}
            b'-' | b'+' | b'.' | b'e' | b'E' if fraction => {}
            b',' | b']' | b' ' | b'\n' | b'\r' | b'\t' => return Some(()),
            _ => return None,
        }
        *at += 1;
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::shape::shape;

    #[test]
    fn lists_of_numbers_are_distinguished_from_other_lists() {
        let count = |schema: &serde_json::Value, text: &str| {
            assert!(text.is_empty() || serde_json::from_str::<serde_json::Value>(text).is_ok());
            super::count(&shape(schema, schema).unwrap(), text)
        };
        let list = |items| json!({"type": "array", "items": items});
        let (real, whole) = (
            json!({"type": "number"}),
            json!({"type": "integer", "minimum": 0}),
        );
        let pair = json!({"type": "array", "items": real, "minItems": 2, "maxItems": 2});
        for (schema, text, expected) in [
            (list(real.clone()), "[]", Some(0)),
            (list(real.clone()), "[ 1, -2.5e-3 ,\n0 ]", Some(3)),
            (list(real.clone()), "[1, null]", None),
            (list(real.clone()), "[1, [2]]", None),
            (list(real.clone()), "[\"1\"]", None),
            (list(real.clone()), "{}", None),
            (list(real), "", None),
            (list(whole.clone()), "[0, 17]", Some(2)),
            (list(whole.clone()), "[-1]", None),
            (list(whole), "[1.5]", None),
            (list(pair.clone()), "[[0,1],[2,3] , [ 4 , 5 ]]", Some(3)),
            (list(pair.clone()), "[[0,1],[2]]", None),
            (list(pair.clone()), "[[0,1],2]", None),
            (list(pair), "[[0,1],[2,[3]]]", None),
        ] {
            assert_eq!(count(&schema, text), expected, "{text} as {schema}");
        }
    }
}
