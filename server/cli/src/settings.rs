//! The settings of `serve`, from the command line, the environment and a file, in this order of precedence. Other
//! commands that need some settings, such as the folder of the store, read these in the same way.
//!
//! The struct `Config` is the only list of the settings: the flag, variable, type and values of a setting are taken
//! from clap's description of it. Values of the file become defaults of the command line, so that clap decides the
//! precedence. No crate that merges sources is used: it would need a second, serializable form of that struct, and its
//! messages would differ from those of flags.

use std::{
    any::TypeId,
    collections::BTreeMap,
    env,
    ffi::{OsStr, OsString},
    fmt, fs,
    io::Read,
    path::{Path, PathBuf},
};

use clap::{
    Arg, ArgAction, ArgMatches, Args, Command,
    builder::Resettable,
    error::{ContextKind, ContextValue, ErrorKind},
};
use service::config::{Config, StoreFolder};
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// The settings, and the file that they are read from.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    file: File,

    #[command(flatten)]
    pub(super) settings: Config,
}

/// The option for the file that a command reads its settings from. Other arguments of such a command also take their
/// values from the file if they have the environment variable of a setting.
#[derive(Debug, Args)]
pub(super) struct File {
    /// File of settings, in TOML; each key is the name of an environment variable of `signorini serve --help` without
    /// SIGNORINI_ and in small letters. Flags and environment variables take precedence over the file
    #[arg(id = FILE, long = "config", env = "SIGNORINI_CONFIG", value_name = "FILE")]
    path: Option<PathBuf>,
}

/// The option for the folder of the store, which is read like the service's setting.
#[derive(Debug, Args)]
pub(super) struct Folder {
    #[command(flatten)]
    file: File,

    #[command(flatten)]
    store: StoreFolder,
}

impl Folder {
    pub(super) fn path(&self) -> &Path {
        &self.store.data
    }
}

/// The id of the argument that names the file; it is not itself a setting.
const FILE: &str = "settings_file";
/// The beginning of the names of all environment variables of settings.
const PREFIX: &str = "SIGNORINI_";
/// The largest size of a file of settings (bytes).
const LARGEST_FILE: u64 = 1 << 20;
/// The least similarity with an unknown name that a known name must have to be proposed in its place.
const SIMILAR: f64 = 0.85;

/// An invalid setting: its place, and what is wrong.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Wrong {
    place: String,
    what: String,
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.what)
    }
}

/// The place `file:line` of each value of the file, by the key of its setting.
pub(super) type Lines = BTreeMap<String, String>;

/// Makes the values of the file the defaults of the command, and returns the command with the places of these values;
/// or all errors in the file and in the environment variables that the command takes. The command is unchanged if its
/// command line is invalid, or it reads no file.
pub(super) fn with_file(
    command: Command,
    line: &[OsString],
) -> Result<(Command, Lines), Vec<Wrong>> {
    let settings = settings();
    let command = without_empty_variables(command);
    let is_setting = |arg: &Arg| {
        let variable = arg.get_env();
        variable.is_some() && settings.iter().any(|known| known.get_env() == variable)
    };
    // the environment is checked below, together with the file
    let bare = change(command.clone(), &|arg| {
        if is_setting(&arg) {
            arg.env(Resettable::Reset)
        } else {
            arg
        }
    });
    let Ok(matches) = bare.try_get_matches_from(line) else {
        return Ok((command, Lines::new()));
    };
    let (innermost, matches) = innermost(&command, &matches);
    if !reads_file(innermost) {
        return Ok((command, Lines::new()));
    }
    let taken = innermost.get_arguments().filter(|arg| is_setting(arg));
    let mut wrong = wrong_variables(taken);
    let mut values = BTreeMap::new();
    if let Some(path) = matches.get_one::<PathBuf>(FILE) {
        match read(path) {
            Ok(text) => values = values_of(&text, path, &settings, &mut wrong),
            Err(what) => wrong.push(Wrong {
                place: path.display().to_string(),
                what,
            }),
        }
    }
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let command = change(command, &|arg| match values.get(&key(&arg)) {
        Some(Value { texts, .. }) if is_setting(&arg) => arg.default_values(texts),
        _ => arg,
    });
    let lines = values.into_iter().map(|(key, value)| (key, value.place));
    Ok((command, lines.collect()))
}

/// The innermost subcommand of a command line, and its arguments.
pub(super) fn innermost<'a>(
    command: &'a Command,
    matches: &'a ArgMatches,
) -> (&'a Command, &'a ArgMatches) {
    let Some((name, inner)) = matches.subcommand() else {
        return (command, matches);
    };
    match command.find_subcommand(name) {
        Some(subcommand) => innermost(subcommand, inner),
        None => (command, matches),
    }
}

/// All settings, as clap describes them, in the order of the help.
pub(super) fn settings() -> Vec<Arg> {
    let all = Config::augment_args(Command::new("serve"));
    all.get_arguments().cloned().collect()
}

/// The command, and all its subcommands, whose arguments take no empty environment variables.
fn without_empty_variables(command: Command) -> Command {
    let command = command.mut_args(|arg| {
        if is_empty_variable(&arg) {
            arg.env(Resettable::Reset)
        } else {
            arg
        }
    });
    command.mut_subcommands(without_empty_variables)
}

/// Changes the arguments of all commands that read a file of settings.
fn change(command: Command, with: &dyn Fn(Arg) -> Arg) -> Command {
    let command = if reads_file(&command) {
        command.mut_args(with)
    } else {
        command
    };
    command.mut_subcommands(|subcommand| change(subcommand, with))
}

fn reads_file(command: &Command) -> bool {
    command.get_arguments().any(|arg| arg.get_id() == FILE)
}

/// The key of a setting in a file.
pub(super) fn key(arg: &Arg) -> String {
    let name = arg.get_env().unwrap_or_default().to_string_lossy();
    name.trim_start_matches(PREFIX).to_ascii_lowercase()
}

/// Whether the environment variable of an argument is empty, which counts as not set, since many programs that start
/// services write empty variables.
fn is_empty_variable(arg: &Arg) -> bool {
    let value = arg.get_env().and_then(env::var_os);
    value.is_some_and(|value| value.is_empty())
}

fn wrong_variables<'a>(settings: impl Iterator<Item = &'a Arg>) -> Vec<Wrong> {
    let mut wrong = vec![];
    for arg in settings {
        let Some(name) = arg.get_env() else { continue };
        let Some(value) = env::var_os(name).filter(|value| !value.is_empty()) else {
            continue;
        };
        if let Err(expected) = check(arg, &value) {
            wrong.push(Wrong {
                place: name.to_string_lossy().into_owned(),
                what: format!("found {:?}, {expected}", value.to_string_lossy()),
            });
        }
    }
    wrong
}

/// Environment variables that look like settings but are none, each with the most similar setting.
pub(super) fn unknown_variables() -> Vec<(String, String)> {
    const OTHERS: [&str; 3] = ["SIGNORINI_CONFIG", "SIGNORINI_URL", "SIGNORINI_TOKEN"];
    let settings = settings();
    let known: Vec<&str> = settings
        .iter()
        .filter_map(|arg| arg.get_env()?.to_str())
        .chain(OTHERS)
        .collect();
    let set = env::vars_os().filter_map(|(name, _)| name.into_string().ok());
    set.filter(|name| name.starts_with(PREFIX) && !known.contains(&name.as_str()))
        .filter_map(|name| {
            let similar = most_similar(name.trim_start_matches(PREFIX), &known, |known| {
                known.trim_start_matches(PREFIX)
            })?;
            Some((name, similar.to_string()))
        })
        .collect()
}

fn most_similar<'a, T>(name: &str, known: &'a [T], text: impl Fn(&T) -> &str) -> Option<&'a T> {
    let alike = |one: &T| strsim::jaro_winkler(text(one), name);
    let known = known.iter().map(|one| (alike(one), one));
    let best = known.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= SIMILAR).then_some(best.1)
}

/// The kind of value that a setting has in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Text,
    Integer,
    /// A number with or without a decimal point.
    Number,
    Flag,
    List,
}

impl Kind {
    pub(super) fn of(arg: &Arg) -> Kind {
        let integers = [
            TypeId::of::<u16>(),
            TypeId::of::<u32>(),
            TypeId::of::<u64>(),
            TypeId::of::<usize>(),
        ];
        let found = arg.get_value_parser().type_id();
        match arg.get_action() {
            ArgAction::SetTrue => Kind::Flag,
            _ if arg.get_value_delimiter().is_some() => Kind::List,
            _ if integers.iter().any(|integer| found == *integer) => Kind::Integer,
            _ if found == TypeId::of::<f64>() => Kind::Number,
            _ => Kind::Text,
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Kind::Text => "expected a text in quotation marks",
            Kind::Integer => "expected an integer",
            Kind::Number => "expected a number",
            Kind::Flag => "expected true or false",
            Kind::List => "expected a list of texts, such as [\"one\", \"another\"]",
        }
    }
}

/// Checks a value as clap would on the command line; the error is the expected value.
fn check(arg: &Arg, value: &OsStr) -> Result<(), String> {
    let kind = Kind::of(arg);
    if kind == Kind::Flag {
        let known = ["true", "false"].iter().any(|text| value == *text);
        return known.then_some(()).ok_or_else(|| kind.expected().into());
    }
    let mut given = OsString::from(format!("--{}=", arg.get_long().unwrap_or_default()));
    given.push(value);
    let alone = Command::new("")
        .no_binary_name(true)
        .disable_help_flag(true);
    let alone = alone.arg(arg.clone().env(Resettable::Reset).required(false));
    let Err(error) = alone.try_get_matches_from([given]) else {
        return Ok(());
    };
    let source = std::error::Error::source(&error).map(ToString::to_string);
    let choices = error.get(ContextKind::ValidValue);
    Err(match (error.kind(), choices, source) {
        (_, Some(ContextValue::Strings(choices)), _) if !choices.is_empty() => {
            format!("expected {}", choices.join(" or "))
        }
        (_, _, Some(source)) if source.starts_with("expected") => source,
        (_, _, Some(source)) => format!("{} ({source})", kind.expected()),
        (ErrorKind::InvalidUtf8, ..) => "expected UTF-8".into(),
        _ => kind.expected().into(),
    })
}

/// The value of a setting in a file.
#[derive(Debug)]
struct Value {
    /// The text of the value, or the texts of a list.
    texts: Vec<String>,
    place: String,
}

fn read(path: &Path) -> Result<String, String> {
    let unread = |error: std::io::Error| format!("cannot be read: {error}");
    // opening a pipe would wait for its writer
    if !fs::metadata(path).map_err(unread)?.is_file() {
        return Err("expected a file of settings, but this is not a file".into());
    }
    let mut text = String::new();
    let file = fs::File::open(path).map_err(unread)?;
    let read = file.take(LARGEST_FILE + 1).read_to_string(&mut text);
    if read.map_err(unread)? as u64 > LARGEST_FILE {
        return Err("expected a file of settings, but this has more than 1 MiB".into());
    }
    Ok(text)
}

/// Reads the values of a file, by the keys of their settings; adds errors to `wrong`.
fn values_of(
    text: &str,
    path: &Path,
    settings: &[Arg],
    wrong: &mut Vec<Wrong>,
) -> BTreeMap<String, Value> {
    let place = |start: usize| {
        let before = text.as_bytes().get(..start).unwrap_or_default();
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        format!("{}:{line}", path.display())
    };
    let (table, mut errors) = DeTable::parse_recoverable(text);
    errors.sort_by_key(|error| error.span().map_or(0, |span| span.start));
    for error in &errors {
        wrong.push(Wrong {
            place: place(error.span().map_or(0, |span| span.start)),
            what: format!("not valid TOML: {}", error.message()),
        });
    }
    if !errors.is_empty() {
        // what was made of the rest may be something else than what was meant
        return BTreeMap::new();
    }
    let keys: Vec<(String, &Arg)> = settings.iter().map(|arg| (key(arg), arg)).collect();
    let mut values = BTreeMap::new();
    let mut entries: Vec<_> = table.get_ref().iter().collect();
    entries.sort_by_key(|(name, _)| name.span().start);
    for (name, value) in entries {
        let (place, name) = (place(name.span().start), name.get_ref());
        let Some((_, arg)) = keys.iter().find(|(key, _)| key == name) else {
            let similar = most_similar(&name.replace('-', "_"), &keys, |(key, _)| key);
            let hint = match similar {
                Some((key, _)) => format!("did you mean {key}?"),
                None => "`signorini config show` prints all settings".into(),
            };
            let what = format!("{name:?} is not a setting; {hint}");
            wrong.push(Wrong { place, what });
            continue;
        };
        match texts(arg, value.get_ref()) {
            Ok(texts) => {
                values.insert(key(arg), Value { texts, place });
            }
            Err(what) => wrong.push(Wrong {
                place,
                what: format!("{name}: {what}"),
            }),
        }
    }
    values
}

/// Reads the texts of a value, and checks them; the error says what was found and expected.
fn texts(arg: &Arg, value: &DeValue<'_>) -> Result<Vec<String>, String> {
    let kind = Kind::of(arg);
    let mismatch = |found: &DeValue<'_>| format!("found {}, {}", shown(found), kind.expected());
    let texts: Vec<String> = match (kind, value) {
        (Kind::Text, DeValue::String(text)) => vec![text.to_string()],
        (Kind::Flag, DeValue::Boolean(flag)) => vec![flag.to_string()],
        (Kind::Number, DeValue::Float(number)) => vec![number.as_str().to_owned()],
        // as `config show` printed it once
        (Kind::Number, DeValue::String(text)) => vec![text.to_string()],
        (Kind::Integer | Kind::Number, DeValue::Integer(integer)) => {
            let parsed = i128::from_str_radix(integer.as_str(), integer.radix());
            vec![parsed.map_err(|_| mismatch(value))?.to_string()]
        }
        (Kind::List, DeValue::Array(list)) => {
            let text = |item: &Spanned<DeValue<'_>>| match item.get_ref() {
                DeValue::String(text) => Ok(text.to_string()),
                other => Err(mismatch(other)),
            };
            list.iter().map(text).collect::<Result<_, _>>()?
        }
        _ => return Err(mismatch(value)),
    };
    for text in &texts {
        if kind == Kind::List && text.contains(',') {
            return Err(format!(
                "found {text:?}, expected each as an element of its own"
            ));
        }
        check(arg, OsStr::new(text)).map_err(|expected| {
            let found = match kind {
                Kind::Integer | Kind::Number => text.clone(),
                _ => format!("{text:?}"),
            };
            format!("found {found}, {expected}")
        })?;
    }
    Ok(texts)
}

/// Writes a value for a message: the value itself if it is short, otherwise its type.
fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) if text.len() <= 60 => format!("{text:?}"),
        DeValue::Integer(integer) => integer.as_str().to_owned(),
        DeValue::Boolean(flag) => flag.to_string(),
        other => format!("a value of the type {}", other.type_str()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn read(text: &str) -> (BTreeMap<String, Value>, Vec<String>) {
        let mut wrong = vec![];
        let values = values_of(text, Path::new("a.toml"), &settings(), &mut wrong);
        (values, wrong.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn every_setting_has_a_flag_a_variable_and_a_key_of_its_own() {
        let mut keys = std::collections::BTreeSet::new();
        for arg in settings() {
            assert!(arg.get_long().is_some(), "{arg}");
            let name = arg.get_env().unwrap().to_str().unwrap();
            assert!(name.starts_with(PREFIX), "{name}");
            assert!(keys.insert(key(&arg)), "{name}");
        }
        assert!(keys.contains("max_queued") && !keys.contains("config"));
    }

    #[test]
    fn values_of_every_kind_are_read() {
        let (values, wrong) = read(
            "workers = 0x10\ndata = '/srv'\nallow_unauthenticated = true\ntrusted_proxies = ['::1', '10.0.0.0/8']\n\
             proxy_scopes = []\nlog = 'debug,hyper=warn'\n",
        );
        assert!(wrong.is_empty(), "{wrong:?}");
        let texts = |id| values[id].texts.join(" ");
        assert_eq!(texts("workers"), "16");
        assert_eq!(texts("allow_unauthenticated"), "true");
        assert_eq!(texts("trusted_proxies"), "::1 10.0.0.0/8");
        assert_eq!(texts("proxy_scopes"), "");
        assert_eq!(values["data"].place, "a.toml:2");
    }

    #[test]
    fn every_error_has_its_line_the_value_found_and_the_expected_one() {
        let (_, wrong) = read(
            "wokers = 2\nworkers = 'many'\n\nisolation = 'proces'\nmax_queued = -1\nallowed_hosts = 'lab'\n\
             allowed_origins = ['https://a', 'lab/']\nproxy_admins = ['a,b']\nallow_unauthenticated = 1\nlisten = 80\n\
             retain_days = true\n[tls]\nkey = 1\n",
        );
        let expected = [
            "a.toml:1: \"wokers\" is not a setting; did you mean workers?",
            "a.toml:2: workers: found \"many\", expected an integer",
            "a.toml:4: isolation: found \"proces\", expected thread or process",
            "a.toml:5: max_queued: found -1, expected an integer (-1 is not in 0..=4294967295)",
            "a.toml:6: allowed_hosts: found \"lab\", expected a list of texts, such as [\"one\", \"another\"]",
            "a.toml:7: allowed_origins: found \"lab/\", expected scheme, host and port without a path, such as \
             https://dashboard.example",
            "a.toml:8: proxy_admins: found \"a,b\", expected each as an element of its own",
            "a.toml:9: allow_unauthenticated: found 1, expected true or false",
            "a.toml:10: listen: found 80, expected a text in quotation marks",
            "a.toml:11: retain_days: found true, expected a number",
            "a.toml:12: \"tls\" is not a setting; did you mean tls_key?",
        ];
        assert_eq!(wrong, expected);
    }

    #[test]
    fn invalid_toml_is_reported_with_line_numbers() {
        let (values, wrong) = read("workers = \nlisten 80\nworkers = 3\n");
        assert!(values.is_empty());
        assert!(wrong.len() >= 2, "{wrong:?}");
        assert!(
            wrong[0].starts_with("a.toml:1: not valid TOML: "),
            "{wrong:?}"
        );
        assert!(wrong[1].starts_with("a.toml:2: "), "{wrong:?}");
    }
}
