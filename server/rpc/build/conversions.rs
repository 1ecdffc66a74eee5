//! Writes the conversions between the contract's messages and the types that mirror them: every field and
//! every value by its name, so that the compiler finds what only one side has.

use protox::prost_reflect::{DescriptorPool, EnumDescriptor, FieldDescriptor, MessageDescriptor};

use crate::mirrors::{MIRRORS, Mirror, Shape};

const PACKAGE: &str = "signorini.v1";

const HEAD: &str = "\
// Written by server/rpc/build/conversions.rs, from proto/signorini/v1/signorini.proto and the list of types in
// server/rpc/build/mirrors.rs. An error here is a field or a value that only one of the two sides has, or that
// has another type there: add it to the message or to the type that stand above the impl, or enter the
// difference in that list.
";

/// All conversions, as the text of a module.
pub(crate) fn source(pool: &DescriptorPool) -> Result<String, Box<dyn std::error::Error>> {
    let mut text = String::new();
    for mirror in MIRRORS {
        let name = format!("{PACKAGE}.{}", mirror.message);
        let message = pool.get_message_by_name(&name);
        let names = pool.get_enum_by_name(&name);
        text += &match (mirror.shape, message, names) {
            (Shape::Names, None, Some(names)) => names_of(mirror, &names),
            (_, Some(message), None) => message_of(mirror, &message),
            _ => {
                return Err(format!(
                    "server/rpc/build/mirrors.rs: the contract has no message or enum {name}"
                )
                .into());
            }
        };
    }
    Ok(HEAD.to_owned() + &prettyplease::unparse(&syn::parse_file(&text)?))
}

/// The conversions of a message.
fn message_of(mirror: &Mirror, message: &MessageDescriptor) -> String {
    let fields = fields(mirror, message);
    let Bodies { read, write } = match mirror.shape {
        Shape::Fields => by_fields(mirror, &fields),
        Shape::Kinds => by_kinds(mirror, message, &fields),
        Shape::Array => by_places(mirror, &fields),
        Shape::Content | Shape::Names => by_content(mirror, &fields),
    };
    let Mirror { message, rust, .. } = mirror;
    let write = format!(
        "/// `{message}` ↔ `{rust}`
        impl From<{rust}> for pb::{message} {{
            fn from(ours: {rust}) -> Self {{ {write} }}
        }}
        written!({rust} => pb::{message});"
    );
    if !mirror.read {
        return write;
    }
    let absent = match mirror.defaulted {
        true => format!("defaulted!(pb::{message} => {rust});"),
        false => format!("required!(pb::{message} => {rust}, \"the message {message}\");"),
    };
    format!(
        "{write}
        /// `{message}` ↔ `{rust}`
        impl FromMessage<pb::{message}> for {rust} {{
            fn from_message(message: pb::{message}, read: &mut Reader) -> Option<Self> {{ {read} }}
        }}
        {absent}"
    )
}

/// Bodies of the functions that read and write a message.
struct Bodies {
    read: String,
    write: String,
}

/// The bodies for a struct.
fn by_fields(mirror: &Mirror, fields: &[Field]) -> Bodies {
    let Mirror { message, rust, .. } = mirror;
    let names = list(fields, Field::theirs);
    let defaults = match mirror.defaulted {
        true => "let defaults = Self::default();",
        false => "",
    };
    let reads = reads(mirror, fields);
    let values = list(fields, Field::found);
    let read = format!(
        "let pb::{message} {{ {names} }} = message; {defaults} {reads} Some(Self {{ {values} }})"
    );
    let (theirs, ours) = (mirror.theirs.join(", "), mirror.ours.join(", "));
    let is_among = |text: &str, field: &Field| {
        let mut words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.any(|word| word == field.name)
    };
    let of_ours = fields.iter().filter(|field| !is_among(&theirs, field));
    let same = of_ours.clone().filter(|field| !is_among(&ours, field));
    let pattern = list(same, Field::ours);
    let values = list(of_ours, Field::value);
    let write =
        format!("let {rust} {{ {pattern} {ours} }} = ours; pb::{message} {{ {values} {theirs} }}");
    Bodies { read, write }
}

/// The bodies for an enum whose variants are the alternatives of a message.
fn by_kinds(mirror: &Mirror, message: &MessageDescriptor, fields: &[Field]) -> Bodies {
    let (name, rust) = (mirror.message, mirror.rust);
    let shared: Vec<&Field> = fields.iter().filter(|field| field.name != "kind").collect();
    let (mut read_arms, mut write_arms, mut kinds) = (String::new(), String::new(), Vec::new());
    for kind in message.fields().filter(is_kind) {
        let content = kind.kind().as_message().cloned();
        let own = content
            .as_ref()
            .map_or_else(Vec::new, |content| self::fields(mirror, content));
        let content = content.map_or(String::new(), |content| content.name().to_owned());
        let variant = camel(kind.name());
        let path = format!("pb::{}::Kind::{variant}", snake(name));
        let all = || own.iter().chain(shared.iter().copied());
        read_arms += &format!(
            "Some({path}(pb::{content} {{ {} }})) => {{ {} Some(Self::{variant} {{ {} }}) }}",
            list(&own, Field::theirs),
            reads(mirror, &own),
            list(all(), Field::found),
        );
        write_arms += &format!(
            "{rust}::{variant} {{ {} }} => pb::{name} {{ kind: Some({path}(pb::{content} {{ {} }})), {} }},",
            list(all(), Field::ours),
            list(&own, Field::value),
            list(shared.iter().copied(), Field::value),
        );
        kinds.push(kind.name().to_owned());
    }
    let read = format!(
        "let pb::{name} {{ {} }} = message; {} match kind {{ {read_arms} None => read.no_kind(\"{}\") }}",
        list(fields, Field::theirs),
        reads(mirror, shared),
        kinds.join(", "),
    );
    let write = format!("match ours {{ {write_arms} }}");
    Bodies { read, write }
}

fn is_kind(field: &FieldDescriptor) -> bool {
    field
        .containing_oneof()
        .is_some_and(|oneof| oneof.name() == "kind")
}

/// The bodies for an array.
fn by_places(mirror: &Mirror, fields: &[Field]) -> Bodies {
    let name = mirror.message;
    let names = list(fields, Field::theirs);
    let values = list(fields.iter().enumerate(), |(place, field)| {
        format!("read.place({place}, {})", field.theirs())
    });
    let each = list(fields, |field| field.theirs() + "?");
    let read = format!(
        "let pb::{name} {{ {names} }} = message; let ({names}) = ({values}); Some([{each}])"
    );
    let values = list(fields, Field::value);
    let write = format!("let [{names}] = ours; pb::{name} {{ {values} }}");
    Bodies { read, write }
}

/// The bodies of the conversions for a type that holds what the only field of its message holds.
fn by_content(mirror: &Mirror, fields: &[Field]) -> Bodies {
    let name = mirror.message;
    let content = fields.iter().map(Field::theirs).collect::<String>();
    Bodies {
        read: format!(
            "let pb::{name} {{ {content} }} = message; Self::from_message({content}, read)"
        ),
        write: format!("pb::{name} {{ {content}: ours.into_message() }}"),
    }
}

/// The conversions of an enum.
fn names_of(mirror: &Mirror, names: &EnumDescriptor) -> String {
    let Mirror { message, rust, .. } = mirror;
    let path = match message.rsplit_once('.') {
        Some((message, name)) => format!("pb::{}::{name}", snake(message)),
        None => format!("pb::{message}"),
    };
    let values: Vec<String> = names
        .values()
        .map(|value| camel(value.name()).replacen(names.name(), "", 1))
        .filter(|value| value != "Unspecified")
        .collect();
    let arms = list(&values, |value| format!("{rust}::{value} => Self::{value}"));
    let write = format!(
        "/// `{message}` ↔ `{rust}`
        impl From<{rust}> for {path} {{
            fn from(ours: {rust}) -> Self {{ match ours {{ {arms} }} }}
        }}
        impl IntoMessage<i32> for {rust} {{
            fn into_message(self) -> i32 {{ {path}::from(self).into() }}
        }}"
    );
    if !mirror.read {
        return write;
    }
    let arms = list(&values, |value| {
        format!("Ok({path}::{value}) => Some(Self::{value})")
    });
    let unspecified = match mirror.defaulted {
        true => "Some(Self::default())".to_owned(),
        false => format!("read.unknown(number, \"{message}\")"),
    };
    format!(
        "{write}
        /// `{message}` ↔ `{rust}`
        impl FromMessage<i32> for {rust} {{
            fn from_message(number: i32, read: &mut Reader) -> Option<Self> {{
                match {path}::try_from(number) {{
                    {arms}
                    Ok({path}::Unspecified) => {unspecified},
                    Err(_) => read.unknown(number, \"{message}\"),
                }}
            }}
        }}"
    )
}

/// A field of a message, or a group of alternatives.
struct Field {
    /// Its name in the contract, and in JSON.
    name: String,
    /// Its name in our type.
    rust: String,
    /// A number or text that may be absent.
    optional: bool,
}

/// The fields of a message.
fn fields(mirror: &Mirror, message: &MessageDescriptor) -> Vec<Field> {
    let mut found: Vec<Field> = Vec::new();
    for field in message.fields() {
        let alternatives = field
            .containing_oneof()
            .filter(|oneof| !oneof.is_synthetic());
        let name = match &alternatives {
            Some(oneof) => oneof.name(),
            None => field.name(),
        };
        if found.iter().any(|field| field.name == name) {
            continue; // another alternative of the same group
        }
        let renamed = mirror.renamed.filter(|(theirs, _)| *theirs == name);
        found.push(Field {
            name: name.to_owned(),
            rust: renamed.map_or(name, |(_, ours)| ours).to_owned(),
            optional: alternatives.is_none() && field.field_descriptor_proto().proto3_optional(),
        });
    }
    found
}

impl Field {
    /// The field in a pattern of the message; it binds the value to this name.
    fn theirs(&self) -> String {
        ident(&self.name)
    }

    /// The field in a pattern of our type.
    fn ours(&self) -> String {
        match self.rust == self.name {
            true => self.theirs(),
            false => format!("{}: {}", ident(&self.rust), self.theirs()),
        }
    }

    /// The field in a literal of our type, with the value that was read.
    fn found(&self) -> String {
        format!("{}: {}?", ident(&self.rust), self.theirs())
    }

    /// The field in a literal of the message.
    fn value(&self) -> String {
        format!("{0}: {0}.into_message()", self.theirs())
    }
}

/// Statements that read fields; each binds the name of a field to its value, or to `None` if it is not readable.
fn reads<'a>(mirror: &Mirror, fields: impl IntoIterator<Item = &'a Field>) -> String {
    let read = |field: &Field| {
        let (name, value) = (&field.name, field.theirs());
        let otherwise = mirror.otherwise.filter(|(field, _)| field == name);
        match otherwise {
            Some((_, other)) => {
                format!("let {value} = read.optional(\"{name}\", {value}, {other});")
            }
            None if mirror.defaulted && field.optional => {
                format!(
                    "let {value} = read.optional(\"{name}\", {value}, defaults.{});",
                    ident(&field.rust)
                )
            }
            None => format!("let {value} = read.field(\"{name}\", {value});"),
        }
    };
    fields.into_iter().map(read).collect()
}

/// The items, each followed by a comma.
fn list<T>(items: impl IntoIterator<Item = T>, item: impl Fn(T) -> String) -> String {
    items.into_iter().map(|one| item(one) + ", ").collect()
}

/// A name as Rust writes it.
fn ident(name: &str) -> String {
    match name {
        "box" | "type" => format!("r#{name}"),
        _ => name.to_owned(),
    }
}

/// `RoundedFlat` as `rounded_flat`.
fn snake(name: &str) -> String {
    let mut snake = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.extend(letter.to_lowercase());
    }
    snake
}

/// `rounded_flat` and `ROUNDED_FLAT` as `RoundedFlat`.
fn camel(name: &str) -> String {
    let word = |word: &str| match word.split_at_checked(1) {
        Some((first, rest)) => first.to_uppercase() + &rest.to_lowercase(),
        None => String::new(),
    };
    name.split('_').map(word).collect()
}
