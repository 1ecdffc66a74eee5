//! Checks a JSON text against the shape that it should have, walking through both at once.
//!
//! The text is checked while it is read, without a tree of its values: a tree takes 32 bytes and more for a value of
//! two bytes. Only where alternatives must be distinguished, the text of one value is read again. The check ends at the
//! hundredth violation, so that its cost does not grow with the number of violations.

use std::{borrow::Cow, collections::BTreeSet, fmt};

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

use super::alternatives::Outline;
use super::numbers;
use super::shape::{Shape, Type};
use super::words;
use solver::error::{Findings, MOST_LISTED, Reason, Violation, escape};

/// The largest number of entries of a list of objects, and of names of an object whose names are free: an entry of
/// three bytes in the text takes a hundred bytes and more in memory. No problem that can be solved comes close.
const MOST_OBJECTS: usize = 1 << 14;

/// The largest number of values in a list of numbers, such as the lines of a grid or the members of a group. Values
/// take less memory than their text, but a mesh of a million elements takes more than the largest request body.
const MOST_NUMBERS: usize = 1 << 20;

/// The largest number of values in a list inside an object with a `kind`: serde keeps such an object in memory until it
/// knows the kind, with 32 bytes for a number.
const MOST_KEPT_NUMBERS: usize = 1 << 17;

/// The largest number of lists in a list inside an object with a `kind`: serde keeps such an object in memory until it
/// knows the kind, with 200 bytes for a list.
const MOST_KEPT_LISTS: usize = 1 << 16;

/// The state of a walk: the violations so far, and the present place in the text.
pub(super) struct Walk<'f, 'de> {
    /// The list of violations; `None` if it only matters whether there are any.
    found: Option<&'f mut Findings>,
    /// The problems in the text, which are checked by themselves: of each the JSON Pointer to it, and its text.
    pub(super) problems: Vec<(String, &'de str)>,
    /// The names and numbers that lead from the outermost value to the current one.
    place: Vec<Token>,
    /// The number of values around the current one that serde keeps in memory.
    kept: usize,
    /// Whether the check ended before the end of the text, because there were enough violations.
    pub(super) stopped: bool,
    faults: usize,
}

enum Token {
    Name(Cow<'static, str>),
    Index(usize),
}

impl<'f, 'de> Walk<'f, 'de> {
    pub(super) fn new(found: Option<&'f mut Findings>) -> Self {
        Walk {
            found,
            problems: Vec::new(),
            place: Vec::new(),
            kept: 0,
            stopped: false,
            faults: 0,
        }
    }

    /// Checks a text. The error is one of the text's syntax, unless the walk has `stopped`.
    pub(super) fn check(
        &mut self,
        shape: &'static Shape,
        text: &'de str,
    ) -> serde_json::Result<()> {
        let mut reader = serde_json::Deserializer::from_str(text);
        self.at(shape).deserialize(&mut reader)?;
        reader.end()
    }

    /// Checks a value as if its shape had no alternatives.
    fn check_base(
        &mut self,
        shape: &'static Shape,
        value: &'de RawValue,
    ) -> serde_json::Result<()> {
        let mut reader = serde_json::Deserializer::from_str(value.get());
        reader.deserialize_any(self.at(shape))
    }

    /// Whether a value has no violation.
    fn fits(shape: &'static Shape, value: &RawValue) -> serde_json::Result<bool> {
        let mut walk = Walk::new(None);
        match walk.check(shape, value.get()) {
            Err(error) if !walk.stopped => Err(error),
            _ => Ok(walk.faults == 0),
        }
    }

    fn at(&mut self, shape: &'static Shape) -> Value<'_, 'f, 'de> {
        Value { shape, walk: self }
    }

    /// Adds a violation at the current value. An error means that there are enough violations; it ends the reading.
    pub(super) fn report<E: Error>(
        &mut self,
        violation: impl FnOnce(String) -> Violation,
    ) -> Result<(), E> {
        self.faults += 1;
        let full = match &mut self.found {
            None => true,
            Some(found) if found.is_full() => true,
            Some(found) => {
                found.add(violation(pointer(&self.place)));
                false
            }
        };
        self.stopped |= full;
        if full {
            Err(E::custom("enough violations"))
        } else {
            Ok(())
        }
    }

    /// Adds a violation at a member or an item of the current value. An error ends the reading, as in
    /// [`report`](Self::report).
    pub(super) fn report_inside<E: Error>(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        violation: impl FnOnce(String) -> Violation,
    ) -> Result<(), E> {
        self.place.push(Token::Name(name.into()));
        let reported = self.report(violation);
        self.place.pop();
        reported
    }

    /// Checks a value that has several alternatives: finds the alternative that is meant, and whether the value fits
    /// it.
    fn check_alternatives(
        &mut self,
        shape: &'static Shape,
        value: &'de RawValue,
    ) -> serde_json::Result<()> {
        let outline = Outline::of(shape, value)?;
        if !shape.only_alternatives() {
            self.check_base(shape, value)?;
        }
        if !shape.allows(outline.found) {
            return Ok(());
        }
        if let Some(condition) = &shape.condition {
            let chosen = if Walk::fits(condition, value)? {
                &shape.then
            } else {
                &shape.otherwise
            };
            if let Some(chosen) = chosen {
                self.check(chosen, value.get())?;
            }
        }
        if let Some(forms) = &shape.forms {
            return match outline.form(forms) {
                Ok(meant) => self.check(&shape.branches()[meant], value.get()),
                Err(violation) => self.report(violation),
            };
        }
        let branches = shape.branches();
        let meant = branches.iter().filter(|branch| !branch.is_null());
        if let [only] = meant.collect::<Vec<_>>()[..]
            && outline.found != Type::Null
        {
            return self.check(only, value.get());
        }
        let mut alike = branches.iter().filter(|branch| outline.resembles(branch));
        match (alike.next(), alike.next()) {
            (Some(only), None) => self.check(only, value.get()),
            (None, _) if branches.is_empty() => Ok(()),
            (several, _) => {
                for branch in branches.iter().filter(|_| several.is_some()) {
                    if outline.resembles(branch) && Walk::fits(branch, value)? {
                        return Ok(());
                    }
                }
                match outline.no_alternative(branches) {
                    (Some(member), violation) => self.report_inside(member, violation),
                    (None, violation) => self.report(violation),
                }
            }
        }
    }

    /// The largest number of items that a list may have. `items`: the shape of an item.
    fn most_items(&self, items: &Shape) -> usize {
        let list = items.items.is_some();
        let number = !list && items.allows(Type::Number) && !items.has_alternatives();
        match (self.kept, list, number) {
            (0, true, _) => usize::MAX,
            (0, _, true) => MOST_NUMBERS,
            (_, true, _) => MOST_KEPT_LISTS,
            (_, _, true) => MOST_KEPT_NUMBERS,
            _ => MOST_OBJECTS,
        }
    }

    fn too_many<E: Error>(&mut self, count: usize, most: usize, what: &str) -> Result<(), E> {
        let got = format!("{count} {what}");
        let expected = format!("at most {most} {what}");
        let hint = "Give fewer; a large mesh is written `inline` or uploaded.";
        self.report(|at| Violation::new(at, Reason::TooMany, got, expected, hint))
    }
}

fn pointer(place: &[Token]) -> String {
    let token = |token: &Token| match token {
        Token::Name(name) => format!("/{}", escape(&words::beginning(name))),
        Token::Index(index) => format!("/{index}"),
    };
    place.iter().map(token).collect()
}

/// One value of the text with its shape; the value is checked as it is read.
struct Value<'w, 'f, 'de> {
    shape: &'static Shape,
    walk: &'w mut Walk<'f, 'de>,
}

impl Value<'_, '_, '_> {
    fn wrong_type<E: Error>(self, got: impl FnOnce() -> String) -> Result<(), E> {
        let names = self.shape.types().iter().filter(|own| **own != Type::Null);
        let names: Vec<&str> = names.map(|own| own.words()).collect();
        let (expected, hint) = (names.join(" or "), "Write the value in that form.");
        self.walk
            .report(|at| Violation::new(at, Reason::WrongType, got(), expected, hint))
    }

    fn scalar<E: Error>(self, found: Type, got: impl Fn() -> String) -> Result<(), E> {
        if !self.shape.types().is_empty() && !self.shape.types().contains(&found) {
            return self.wrong_type(got);
        }
        if let Some(only) = &self.shape.only
            && found != Type::String
        {
            let hint = "Correct the value.";
            let violation = |at| {
                let expected = format!("{only:?}");
                Violation::new(at, Reason::UnknownAlternative, got(), expected, hint)
            };
            return self.walk.report(violation);
        }
        Ok(())
    }

    /// Checks a number. `integral`: it is written as an integer, since serde does not read 1.0 as one.
    fn number<E: Error>(
        self,
        number: f64,
        integral: bool,
        got: impl Fn() -> String,
    ) -> Result<(), E> {
        let types = self.shape.types();
        let found = if integral && types.contains(&Type::Integer) {
            Type::Integer
        } else {
            Type::Number
        };
        match self.shape.minimum.filter(|least| number < *least) {
            Some(least) if types.is_empty() || types.contains(&found) => {
                let expected = format!("a number of at least {least}");
                let (reason, hint) = (Reason::OutOfRange, "Correct the number.");
                self.walk
                    .report(|at| Violation::new(at, reason, got(), expected, hint))
            }
            _ => self.scalar(found, got),
        }
    }
}

impl<'de> DeserializeSeed<'de> for Value<'_, '_, 'de> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, reader: D) -> Result<(), D::Error> {
        if self.shape.never {
            let value = <&RawValue>::deserialize(reader)?;
            if value.get() == "null" {
                return Ok(());
            }
            let expected =
                "this field to be absent, since it cannot be combined with the other fields";
            let hint = "Remove the field, or choose another form.";
            let got = || words::value(value.get());
            let not_used = |at| Violation::new(at, Reason::NotUsed, got(), expected, hint);
            return self.walk.report(not_used);
        }
        if self.shape.problem {
            let value = <&RawValue>::deserialize(reader)?;
            let place = pointer(&self.walk.place);
            self.walk.problems.push((place, value.get()));
            return Ok(());
        }
        if self.shape.is_anything() {
            <&RawValue>::deserialize(reader)?;
            return Ok(());
        }
        if let Some(items) = &self.shape.items
            && self.shape.is_long_list_of_numbers()
        {
            let value = <&RawValue>::deserialize(reader)?;
            let most = self.walk.most_items(items);
            let count = numbers::count(self.shape, value.get());
            if count.is_some_and(|count| count <= most) {
                return Ok(());
            }
            let checked = self.walk.check_base(self.shape, value);
            return checked.map_err(D::Error::custom);
        }
        if !self.shape.has_alternatives() {
            return reader.deserialize_any(self);
        }
        let value = <&RawValue>::deserialize(reader)?;
        self.walk.kept += usize::from(self.shape.is_kept());
        let checked = self.walk.check_alternatives(self.shape, value);
        self.walk.kept -= usize::from(self.shape.is_kept());
        checked.map_err(D::Error::custom)
    }
}

impl<'de> Visitor<'de> for Value<'_, '_, 'de> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.scalar(Type::Null, || "null".to_owned())
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<(), E> {
        self.scalar(Type::Boolean, || value.to_string())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        self.number(value as f64, true, || value.to_string())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        self.number(value as f64, true, || value.to_string())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        self.number(value, false, || value.to_string())
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<(), E> {
        match &self.shape.only {
            Some(only) if only != text => {
                let (reason, hint) = (Reason::UnknownAlternative, words::meant(text, [only]));
                let hint = hint.unwrap_or_else(|| "Correct the value.".to_owned());
                let got = words::text(text);
                self.walk
                    .report(|at| Violation::new(at, reason, got, format!("{only:?}"), hint))
            }
            _ => self.scalar(Type::String, || words::text(text)),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let Value { shape, walk } = self;
        let items = shape.items.as_deref().filter(|_| shape.allows(Type::Array));
        let most = items.map_or(0, |items| walk.most_items(items));
        let most = shape.at_most.map_or(most, |own| own.min(most));
        let mut count = 0;
        while let Some(items) = items
            && count < most.min(shape.most_items().unwrap_or(most))
        {
            walk.place.push(Token::Index(count));
            let next = list.next_element_seed(walk.at(items));
            walk.place.pop();
            match next? {
                Some(()) => count += 1,
                None => break,
            }
        }
        while list.next_element::<IgnoredAny>()?.is_some() {
            count += 1;
        }
        if !shape.allows(Type::Array) {
            return Value { shape, walk }.wrong_type(|| words::counted(count, "list of", "item"));
        }
        if !shape.has_length(count) {
            let (got, expected) = (format!("{count} item(s)"), shape.lengths() + " items");
            let (reason, hint) = (Reason::WrongLength, "Correct the list.");
            return walk.report(|at| Violation::new(at, reason, got, expected, hint));
        }
        if items.is_some() && count > most {
            walk.too_many(count, most, "entries")
        } else {
            Ok(())
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<(), A::Error> {
        let Value { shape, walk } = self;
        if !shape.allows(Type::Object) {
            let mut count = 0;
            while members.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {
                count += 1;
            }
            let got = || words::counted(count, "object of", "name");
            return Value { shape, walk }.wrong_type(got);
        }
        // whether other names are refused; if not, this shape is one alternative and another reports these
        let free = shape.additional_properties.as_deref();
        let mut seen: BTreeSet<Cow<'de, str>> = BTreeSet::new();
        let mut unknown: Vec<Cow<'de, str>> = Vec::new();
        let mut count = 0;
        while let Some(Name(name)) = members.next_key()? {
            let own = shape.properties.get_key_value(&*name);
            let asked = shape.required.iter().any(|asked| *asked == name);
            let (known, value) = match (own, free) {
                (Some((known, own)), _) => (Cow::Borrowed(known.as_str()), own),
                (None, Some(free)) if free.never => {
                    members.next_value::<IgnoredAny>()?;
                    // one more than is listed, so that the walk ends
                    if unknown.len() <= MOST_LISTED {
                        unknown.push(name);
                    }
                    continue;
                }
                (None, Some(free)) if count < MOST_OBJECTS => {
                    (Cow::Owned(name.clone().into_owned()), free)
                }
                (None, free) => {
                    count += usize::from(free.is_some());
                    // null counts as absent, as many clients write it
                    let value = members.next_value::<Option<IgnoredAny>>()?;
                    if asked && value.is_some() {
                        seen.insert(name);
                    }
                    continue;
                }
            };
            count += 1;
            if seen.insert(name) || free.is_none() {
                walk.place.push(Token::Name(known));
                let checked = members.next_value_seed(walk.at(value));
                walk.place.pop();
                checked?;
            } else {
                members.next_value::<IgnoredAny>()?;
                let hint = "Remove one of the two values; one would be ignored.";
                let (reason, got, expected) =
                    (Reason::DuplicateName, "the name twice", "each name once");
                walk.report_inside(known, |at| Violation::new(at, reason, got, expected, hint))?;
            }
        }
        let missing = |name: &&String| !seen.contains(name.as_str());
        for name in shape.required.iter().filter(missing) {
            if shape.lacks_only(name, &unknown) {
                return walk.report_inside(name.as_str(), |at| words::bare(at, name));
            }
            let expected = format!("a value for `{name}`");
            let (reason, hint) = (Reason::Missing, "The field has no default.");
            walk.report_inside(name.as_str(), |at| {
                Violation::new(at, reason, "nothing", expected, hint)
            })?;
        }
        for name in unknown {
            let place = words::beginning(&name).into_owned();
            let known = || shape.properties.keys();
            walk.report_inside(place, |at| words::unknown_name(at, &name, known()))?;
        }
        if count > MOST_OBJECTS {
            walk.too_many(count, MOST_OBJECTS, "names")
        } else {
            Ok(())
        }
    }
}

/// The name of a member, not copied unless it has escapes.
#[derive(Deserialize)]
struct Name<'a>(#[serde(borrow)] Cow<'a, str>);
