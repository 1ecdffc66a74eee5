//! Finds NaN and infinity in a value by serializing it: JSON cannot write them, and serde_json silently
//! writes null.

use std::fmt;

use serde::{Serialize, Serializer, ser};

use crate::error::escape;

/// Whether all numbers of a value are finite.
pub fn is_finite<T: Serialize + ?Sized>(value: &T) -> bool {
    let mut walk = Walk::new(Limit::StopAtFirst);
    value.serialize(&mut walk).is_ok()
}

/// JSON Pointers to the numbers of a value that are not finite, at most `most` of them, and the number of further ones.
pub fn not_finite<T: Serialize + ?Sized>(value: &T, most: usize) -> (Vec<String>, usize) {
    let mut walk = Walk::new(Limit::List(most));
    // nothing here fails: only the other limit ends a walk with an error
    let _ = value.serialize(&mut walk);
    (walk.found, walk.more)
}

/// When a search ends.
enum Limit {
    /// At the first number that is not finite, by an error.
    StopAtFirst,
    /// After the whole value; at most this many numbers are listed.
    List(usize),
}

/// A serializer that writes nothing and checks every number.
struct Walk {
    /// The path from the whole value to the current part.
    path: Vec<Step>,
    found: Vec<String>,
    /// The number of non-finite numbers that are not listed.
    more: usize,
    limit: Limit,
    /// Whether the next string is the key of an entry.
    in_key: bool,
}

/// One step from a value to a part of it.
enum Step {
    Field(&'static str),
    Key(String),
    Index(usize),
}

impl Walk {
    fn new(limit: Limit) -> Self {
        Walk {
            path: Vec::new(),
            found: Vec::new(),
            more: 0,
            limit,
            in_key: false,
        }
    }

    fn check_number(&mut self, number: f64) -> fmt::Result {
        if number.is_finite() {
            return Ok(());
        }
        let step = |step: &Step| match step {
            Step::Field(name) => format!("/{}", escape(name)),
            Step::Key(name) => format!("/{}", escape(name)),
            Step::Index(place) => format!("/{place}"),
        };
        match self.limit {
            Limit::StopAtFirst => return Err(fmt::Error),
            Limit::List(most) if self.found.len() < most => {
                self.found.push(self.path.iter().map(step).collect());
            }
            Limit::List(_) => self.more += 1,
        }
        Ok(())
    }

    /// Serializes a part of the value, one step further down.
    fn part<T: Serialize + ?Sized>(&mut self, step: Step, part: &T) -> fmt::Result {
        self.path.push(step);
        part.serialize(&mut *self)?;
        self.path.pop();
        Ok(())
    }
}

/// A list that is being serialized, element by element.
struct List<'a> {
    walk: &'a mut Walk,
    /// Whether the list is the data of an enum variant, below its name.
    named: bool,
}

impl<'a> List<'a> {
    fn new(walk: &'a mut Walk, variant: Option<&'static str>) -> Self {
        walk.path.extend(variant.map(Step::Field));
        walk.path.push(Step::Index(0));
        let named = variant.is_some();
        List { walk, named }
    }

    fn next<T: Serialize + ?Sized>(&mut self, part: &T) -> fmt::Result {
        part.serialize(&mut *self.walk)?;
        if let Some(Step::Index(place)) = self.walk.path.last_mut() {
            *place += 1;
        }
        Ok(())
    }

    fn end(self) -> fmt::Result {
        self.walk.path.pop();
        if self.named {
            self.walk.path.pop();
        }
        Ok(())
    }
}

/// Serializer methods for values that are not numbers and need no check.
macro_rules! passed {
    ($($method:ident: $type:ty),*) => { $(
        fn $method(self, _: $type) -> fmt::Result {
            Ok(())
        }
    )* };
}

impl<'a> Serializer for &'a mut Walk {
    type Ok = ();
    type Error = fmt::Error;
    type SerializeSeq = List<'a>;
    type SerializeTuple = List<'a>;
    type SerializeTupleStruct = List<'a>;
    type SerializeTupleVariant = List<'a>;
    type SerializeMap = &'a mut Walk;
    type SerializeStruct = &'a mut Walk;
    type SerializeStructVariant = Variant<'a>;

    passed!(
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_char: char,
        serialize_bytes: &[u8], serialize_unit_struct: &'static str
    );

    fn serialize_f32(self, value: f32) -> fmt::Result {
        self.check_number(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> fmt::Result {
        self.check_number(value)
    }

    fn serialize_str(self, value: &str) -> fmt::Result {
        if self.in_key {
            self.path.push(Step::Key(value.to_owned()));
        }
        Ok(())
    }

    fn serialize_none(self) -> fmt::Result {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_unit(self) -> fmt::Result {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, name: &'static str) -> fmt::Result {
        self.serialize_str(name)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        value: &T,
    ) -> fmt::Result {
        self.part(Step::Field(name), value)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<List<'a>, fmt::Error> {
        Ok(List::new(self, None))
    }

    fn serialize_tuple(self, _: usize) -> Result<List<'a>, fmt::Error> {
        Ok(List::new(self, None))
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<List<'a>, fmt::Error> {
        Ok(List::new(self, None))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        _: usize,
    ) -> Result<List<'a>, fmt::Error> {
        Ok(List::new(self, Some(name)))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self, fmt::Error> {
        Ok(self)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, fmt::Error> {
        Ok(self)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        _: usize,
    ) -> Result<Variant<'a>, fmt::Error> {
        self.path.push(Step::Field(name));
        Ok(Variant(self))
    }
}

/// The fields of a variant that is being serialized, below its name.
struct Variant<'a>(&'a mut Walk);

macro_rules! lists {
    ($($trait:ident::$method:ident),*) => { $(
        impl ser::$trait for List<'_> {
            type Ok = ();
            type Error = fmt::Error;

            fn $method<T: Serialize + ?Sized>(&mut self, part: &T) -> fmt::Result {
                self.next(part)
            }

            fn end(self) -> fmt::Result {
                List::end(self)
            }
        }
    )* };
}
lists!(
    SerializeSeq::serialize_element,
    SerializeTuple::serialize_element,
    SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field
);

impl ser::SerializeMap for &mut Walk {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> fmt::Result {
        let depth = self.path.len();
        self.in_key = true;
        key.serialize(&mut **self)?;
        self.in_key = false;
        if self.path.len() == depth {
            self.path.push(Step::Field("")); // the key is not a string
        }
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> fmt::Result {
        value.serialize(&mut **self)?;
        self.path.pop();
        Ok(())
    }

    fn end(self) -> fmt::Result {
        Ok(())
    }
}

impl ser::SerializeStruct for &mut Walk {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_field<T: Serialize + ?Sized>(
        &mut self,
        name: &'static str,
        value: &T,
    ) -> fmt::Result {
        self.part(Step::Field(name), value)
    }

    fn end(self) -> fmt::Result {
        Ok(())
    }
}

impl ser::SerializeStructVariant for Variant<'_> {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_field<T: Serialize + ?Sized>(
        &mut self,
        name: &'static str,
        value: &T,
    ) -> fmt::Result {
        self.0.part(Step::Field(name), value)
    }

    fn end(self) -> fmt::Result {
        self.0.path.pop();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[derive(Serialize)]
    struct Whole {
        good: f64,
        bad: Option<f32>,
        lists: Vec<[f64; 2]>,
        by_name: BTreeMap<String, Shape>,
    }

    #[derive(Serialize)]
    #[serde(rename_all = "snake_case")]
    enum Shape {
        Point,
        Circle(f64),
        Ring { inner: f64, outer: f64 },
        Pair(f64, f64),
    }

    fn whole() -> Whole {
        Whole {
            good: 1.0,
            bad: Some(f32::NAN),
            lists: vec![[0.0, 1.0], [2.0, f64::INFINITY]],
            by_name: BTreeMap::from([
                ("a/b".to_owned(), Shape::Circle(f64::NAN)),
                ("c".to_owned(), Shape::Point),
                ("d".to_owned(), Shape::Pair(0.0, f64::NAN)),
                (
                    "e".to_owned(),
                    Shape::Ring {
                        inner: 0.0,
                        outer: f64::NEG_INFINITY,
                    },
                ),
            ]),
        }
    }

    #[test]
    fn nan_and_infinity_are_found_with_their_pointers() {
        let all = [
            "/bad",
            "/lists/1/1",
            "/by_name/a~1b/circle",
            "/by_name/d/pair/1",
            "/by_name/e/ring/outer",
        ];
        let all = all.map(str::to_owned).to_vec();
        assert_eq!(not_finite(&whole(), 2), (all[..2].to_vec(), 3));
        assert_eq!(not_finite(&whole(), 100), (all, 0));
        assert!(!is_finite(&whole()));
        assert!(is_finite(&Whole {
            bad: None,
            lists: vec![],
            by_name: BTreeMap::new(),
            ..whole()
        }));
    }
}
