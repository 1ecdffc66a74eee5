//! The faults of the structure of a problem, found with our JSON Schema and described in words.
//!
//! Of draft 2020-12 it supports the keywords that the schema of our types has; a test lists them. Written here
//! rather than left to a library: the existing ones bring regular expressions, URIs and references over the network
//! (a tenth of the build), and answer in terms of the schema ("not valid under any of the schemas") instead of
//! naming the intended alternative and its faults.

use std::{fmt::Display, iter, sync::LazyLock};

use serde_json::{Map, Value};

use solver::error::{Findings, Reason, Violation, either, escape, shortened};
use solver::problem::Problem;

/// The JSON Schema of a problem (draft 2020-12).
pub fn schema() -> Value {
    schemars::schema_for!(Problem).to_value()
}

static SCHEMA: LazyLock<Value> = LazyLock::new(schema);

/// All violations of `value`.
pub(crate) fn violations(value: &Value) -> Vec<Violation> {
    let mut found = Findings::default();
    let mut walk = Walk {
        found: Some(&mut found),
        at: String::new(),
        faults: 0,
    };
    walk.check(&SCHEMA, value);
    found.into_violations()
}

/// Whether `value` has no violation.
fn fits(schema: &Value, value: &Value) -> bool {
    let mut walk = Walk {
        found: None,
        at: String::new(),
        faults: 0,
    };
    walk.check(schema, value);
    walk.faults == 0
}

/// Whether one of the definitions of the schema accepts a value.
#[cfg(test)]
pub(crate) fn accepts(definition: &str, value: &Value) -> bool {
    fits(&SCHEMA["$defs"][definition], value)
}

/// A walk through a value and the schema at once.
struct Walk<'a> {
    /// The list of violations; `None` if only their number is needed.
    found: Option<&'a mut Findings>,
    /// The JSON Pointer of the value.
    at: String,
    faults: usize,
}

impl Walk<'_> {
    fn check(&mut self, schema: &Value, value: &Value) {
        let schema = resolved(schema);
        if *schema == Value::Bool(false) {
            let expected = "no such field: it cannot be combined with the others";
            let hint = "Leave it out, or choose another form.";
            let got = || quoted(value);
            return self.report(|at| Violation::new(at, Reason::NotUsed, got(), expected, hint));
        }
        if !has_type(schema, value) {
            let expected = type_names(schema).join(" or ");
            let hint = "Write the value in that form.";
            let got = || quoted(value);
            return self.report(|at| Violation::new(at, Reason::WrongType, got(), expected, hint));
        }
        if let Some(only) = schema.get("const").filter(|only| *only != value) {
            let (reason, hint) = (Reason::UnknownAlternative, "Correct the value.");
            let got = || quoted(value);
            self.report(|at| Violation::new(at, reason, got(), only.to_string(), hint));
        }
        match value {
            Value::Object(members) => self.check_members(schema, members),
            Value::Array(items) => self.check_items(schema, items),
            Value::Number(number) => self.check_minimum(schema, number.as_f64()),
            _ => {}
        }
        if let Some(condition) = schema.get("if") {
            let then = if fits(condition, value) {
                "then"
            } else {
                "else"
            };
            if let Some(schema) = schema.get(then) {
                self.check(schema, value);
            }
        }
        if let Some(branches) = branches(schema) {
            let exactly_one = schema.get("oneOf").is_some();
            match forms(branches).filter(|_| exactly_one) {
                Some(forms) => self.check_forms(branches, &forms, value),
                None => self.check_alternatives(branches, value),
            }
        }
    }

    fn check_members(&mut self, schema: &Value, members: &Map<String, Value>) {
        let known = schema.get("properties").and_then(Value::as_object);
        for (name, value) in members {
            let own = known.and_then(|known| known.get(name));
            match own.or(schema.get("additionalProperties")) {
                Some(Value::Bool(false)) if own.is_none() => self.inside(escape(name), |walk| {
                    walk.report(|at| unknown_name(at, name, known.into_iter().flat_map(Map::keys)));
                }),
                Some(schema) => self.inside(escape(name), |walk| walk.check(schema, value)),
                None => {}
            }
        }
        for name in required(schema).filter(|name| !members.contains_key(*name)) {
            let expected = format!("a value for `{name}`");
            let (reason, hint) = (Reason::Missing, "It has no default.");
            self.inside(escape(name), |walk| {
                walk.report(|at| Violation::new(at, reason, "nothing", expected, hint));
            });
        }
    }

    fn check_items(&mut self, schema: &Value, items: &[Value]) {
        let limit = |word| schema.get(word).and_then(Value::as_u64);
        let count = items.len() as u64;
        let least = limit("minItems").filter(|least| count < *least);
        if let Some(limit) = least.or(limit("maxItems").filter(|most| count > *most)) {
            let (got, expected) = (format!("{count} item(s)"), format!("{limit} items"));
            let (reason, hint) = (Reason::WrongLength, "Correct the list.");
            self.report(|at| Violation::new(at, reason, got, expected, hint));
        }
        if let Some(schema) = schema.get("items") {
            for (index, item) in items.iter().enumerate() {
                self.inside(index, |walk| walk.check(schema, item));
            }
        }
    }

    fn check_minimum(&mut self, schema: &Value, number: Option<f64>) {
        let least = schema.get("minimum").and_then(Value::as_f64);
        if let (Some(least), Some(number)) = (least, number)
            && number < least
        {
            let expected = format!("a number of at least {least}");
            let (reason, hint) = (Reason::OutOfRange, "Correct the number.");
            self.report(|at| Violation::new(at, reason, number, expected, hint));
        }
    }

    /// Checks against the intended alternative, judged by the value's type and its `kind`; if none or several could
    /// be intended, all are listed.
    fn check_alternatives(&mut self, branches: &[Value], value: &Value) {
        if branches.iter().any(|branch| fits(branch, value)) {
            return;
        }
        let mut meant = branches.iter().filter(|branch| resembles(branch, value));
        if let (Some(only), None) = (meant.next(), meant.next()) {
            return self.check(only, value);
        }
        let reason = Reason::UnknownAlternative;
        let kinds = branches.iter().filter_map(kind).map(Value::to_string);
        let kinds: Vec<_> = kinds.collect();
        let names = kinds.join(", ");
        match (value, kinds.first()) {
            (Value::Object(members), Some(_)) => {
                let got = members.get("kind").map_or("nothing".to_owned(), quoted);
                let (expected, hint) = (format!("one of {names}"), "Choose one of the kinds.");
                self.inside("kind", |walk| {
                    walk.report(|at| Violation::new(at, reason, got, expected, hint));
                });
            }
            (_, Some(first)) => {
                let expected = format!("an object with a `kind`, one of {names}");
                let hint = format!("Write it as {{\"kind\": {first}, …}}.");
                self.report(|at| Violation::new(at, reason, quoted(value), expected, hint));
            }
            (_, None) => {
                let mut offers: Vec<_> = branches.iter().flat_map(offers).collect();
                offers.dedup();
                let hint = "Write the value in one of these forms.";
                let expected = offers.join(" or ");
                self.report(|at| Violation::new(at, reason, quoted(value), expected, hint));
            }
        }
    }

    /// Checks against the intended form, judged by the names that it alone requires: there must be exactly one.
    fn check_forms(&mut self, branches: &[Value], forms: &[Vec<&str>], value: &Value) {
        let given = |name: &str| value.get(name).is_some_and(|value| !value.is_null());
        let mut meant =
            iter::zip(forms, branches).filter(|(form, _)| form.iter().any(|name| given(name)));
        if let (Some((_, only)), None) = (meant.next(), meant.next()) {
            return self.check(only, value);
        }
        let names = forms.iter().flatten();
        let got: Vec<(&str, bool)> = names.map(|name| (*name, given(name))).collect();
        let offers = forms.iter().map(|form| listed(form, " and "));
        let expected = format!("exactly one of {}", offers.collect::<Vec<_>>().join(", "));
        let (reason, hint) = (Reason::WrongCount, "Choose one of the forms.");
        self.report(|at| Violation::new(at, reason, either(&got), expected, hint));
    }

    /// Continues at a member or an item.
    fn inside(&mut self, token: impl Display, check: impl FnOnce(&mut Self)) {
        let before = self.at.len();
        self.at += "/";
        self.at += &token.to_string();
        check(self);
        self.at.truncate(before);
    }

    /// Adds a violation at the current value.
    fn report(&mut self, violation: impl FnOnce(&str) -> Violation) {
        self.faults += 1;
        match &mut self.found {
            Some(found) if found.is_full() => found.count(1),
            Some(found) => found.add(violation(&self.at)),
            None => {}
        }
    }
}

fn unknown_name<'a>(at: &str, name: &str, known: impl Iterator<Item = &'a String>) -> Violation {
    let known: Vec<_> = known.map(String::as_str).collect();
    let expected = match &known[..] {
        [] => "no name at all".to_owned(),
        known => format!("one of {}", listed(known, ", ")),
    };
    let hint = "Check the spelling; unknown names are rejected.";
    let got = format!("`{name:.80}`");
    Violation::new(at, Reason::UnknownName, got, expected, hint)
}

fn listed(names: &[&str], between: &str) -> String {
    let names: Vec<_> = names.iter().map(|name| format!("`{name}`")).collect();
    names.join(between)
}

/// The definition that `$ref` names.
fn resolved(schema: &Value) -> &Value {
    let place = schema.get("$ref").and_then(Value::as_str);
    let place = place.and_then(|place| place.strip_prefix('#'));
    let definition = place.and_then(|place| SCHEMA.pointer(place));
    definition.map_or(schema, resolved)
}

fn branches(schema: &Value) -> Option<&Vec<Value>> {
    schema.get("anyOf").or(schema.get("oneOf"))?.as_array()
}

/// The names that only one form of an object requires, for each form, if they distinguish the forms.
fn forms(branches: &[Value]) -> Option<Vec<Vec<&str>>> {
    if branches.iter().any(|branch| branch.get("type").is_some()) {
        return None;
    }
    let asked: Vec<Vec<&str>> = branches.iter().map(all_required).collect();
    let alone = |name: &str| asked.iter().filter(|form| form.contains(&name)).count() == 1;
    let own = |form: &Vec<&'_ str>| form.iter().filter(|name| alone(name)).count() > 0;
    if !asked.iter().all(own) {
        return None;
    }
    let mut forms = asked.clone();
    forms
        .iter_mut()
        .for_each(|form| form.retain(|name| alone(name)));
    Some(forms)
}

/// The names that a form requires: all of them, or one of several.
fn all_required(form: &Value) -> Vec<&str> {
    let further = branches(form).into_iter().flatten().flat_map(all_required);
    required(form).chain(further).collect()
}

/// Whether `value` has the type and the `kind` of `schema`; alternatives are checked later.
fn resembles(schema: &Value, value: &Value) -> bool {
    let schema = resolved(schema);
    has_type(schema, value)
        && schema.get("const").is_none_or(|only| only == value)
        && kind(schema).is_none_or(|kind| value.get("kind") == Some(kind))
}

/// The value of `kind` that an object of this form has.
fn kind(schema: &Value) -> Option<&Value> {
    schema.pointer("/properties/kind/const")
}

/// The values that `schema` allows, in words; without `null`.
fn offers(schema: &Value) -> Vec<String> {
    let schema = resolved(schema);
    match schema.get("const") {
        Some(only) => vec![only.to_string()],
        None => type_names(schema).into_iter().map(str::to_owned).collect(),
    }
}

fn type_names(schema: &Value) -> Vec<&str> {
    let names = texts(schema, "type");
    names.filter(|name| *name != "null").collect()
}

fn has_type(schema: &Value, value: &Value) -> bool {
    let is = |name: &str| match (name, value) {
        ("integer", Value::Number(n)) => n.as_f64().is_some_and(|n| n.fract() == 0.0),
        ("number", Value::Number(_)) => true,
        ("null", Value::Null) | ("boolean", Value::Bool(_)) | ("string", Value::String(_)) => true,
        ("array", Value::Array(_)) | ("object", Value::Object(_)) => true,
        _ => false,
    };
    schema.get("type").is_none() || texts(schema, "type").any(is)
}

fn required(schema: &Value) -> impl Iterator<Item = &str> {
    texts(schema, "required")
}

/// The text of a keyword of the schema, or each text of a list.
fn texts<'a>(schema: &'a Value, word: &str) -> impl Iterator<Item = &'a str> {
    let value = schema.get(word);
    let list = value.and_then(Value::as_array).into_iter().flatten();
    value.into_iter().chain(list).filter_map(Value::as_str)
}

/// A value as text, shortened.
fn quoted(value: &Value) -> String {
    shortened(&value.to_string(), 80)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The keywords that are checked here, and below them those that are only for readers.
    const WORDS: &str = "$ref additionalProperties anyOf const else if items maxItems minItems minimum oneOf properties required then type \
        $defs $schema default description format title";

    fn words<'a>(schema: &'a Value, found: &mut BTreeSet<&'a str>) {
        for (word, value) in schema.as_object().into_iter().flatten() {
            found.insert(word);
            match (word.as_str(), value) {
                ("const" | "default" | "required" | "type", _) => {}
                ("properties" | "$defs", Value::Object(named)) => {
                    named.values().for_each(|schema| words(schema, found));
                }
                (_, Value::Array(list)) => list.iter().for_each(|schema| words(schema, found)),
                _ => words(value, found),
            }
        }
    }

    #[test]
    fn every_keyword_of_the_schema_is_supported() {
        let mut found = BTreeSet::new();
        words(&SCHEMA, &mut found);
        let unknown: Vec<_> = found
            .iter()
            .filter(|word| !WORDS.split(' ').any(|w| w == **word))
            .collect();
        assert!(unknown.is_empty(), "{unknown:?}");
    }
}
