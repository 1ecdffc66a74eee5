//! The commands `signorini login` and `signorini logout`: keep the token for a service in a file that only its owner can
//! read, so that it stands neither in scripts nor in the history of a shell.

use std::{
    collections::BTreeMap,
    env, fs,
    io::{self, BufRead, IsTerminal, Read, Write},
    os::unix::fs::{DirBuilderExt, PermissionsExt},
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};
use clap::Args;
use serde_json::Value;

use super::{exit::Exit, service::Connection};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini login --url https://lab.example          # asks for the token\n  \
    signorini login --url https://lab.example < token.txt\n\nSIGNORINI_TOKEN takes precedence over what is kept."
)]
pub(super) struct Arguments {
    #[command(flatten)]
    service: Connection,
}

/// The longest token that is read.
const LONGEST: usize = 1000;

/// Reads a token, asks the service whose it is, and keeps it.
pub(super) async fn login(arguments: Arguments) -> anyhow::Result<Exit> {
    let (url, token) = (arguments.service.url(), read()?);
    let me: Value = arguments.service.open_with(&token)?.get("/v1/me").await?;
    let path = file()?;
    let mut all = kept(&path)?;
    all.insert(url.clone(), token);
    write(&path, &all)?;
    let owner = me["owner"].as_str().unwrap_or_default();
    let scopes = me["scopes"].as_array().into_iter().flatten();
    let scopes: Vec<&str> = scopes.filter_map(Value::as_str).collect();
    if env::var_os("SIGNORINI_TOKEN").is_some_and(|token| !token.is_empty()) {
        eprintln!("signorini: SIGNORINI_TOKEN is set, and goes before the token that is kept");
    }
    eprintln!(
        "{url}: the token of {owner}, for {}, is kept in {}",
        scopes.join(","),
        path.display()
    );
    Ok(Exit::Ok)
}

/// Forgets the token for a service.
pub(super) fn logout(arguments: Arguments) -> anyhow::Result<Exit> {
    let (url, path) = (arguments.service.url(), file()?);
    let mut all = kept(&path)?;
    if all.remove(&url).is_none() {
        eprintln!(
            "signorini: no token for {url} is kept in {}",
            path.display()
        );
        return Ok(Exit::NotFound);
    }
    write(&path, &all)?;
    eprintln!("{url}: its token is no longer kept; `signorini token revoke` makes it invalid");
    Ok(Exit::Ok)
}

/// The token that is kept for the service at this address; `None` if there is none.
///
/// # Errors
///
/// The file cannot be read, or others can read it.
pub(super) fn token_for(url: &str) -> anyhow::Result<Option<String>> {
    // without a home, or with a file that cannot be read, there is none; a file that others can read is refused if it has it
    let Ok(path) = file() else { return Ok(None) };
    let Ok(text) = fs::read_to_string(&path) else {
        return Ok(None);
    };
    if !text.contains(&format!("{url:?}")) {
        return Ok(None);
    }
    Ok(kept(&path)?.remove(url))
}

/// Reads a token from the terminal, without showing it, or from standard input.
fn read() -> anyhow::Result<String> {
    let mut text = String::new();
    if io::stdin().is_terminal() {
        eprint!("Token: ");
        text = console::Term::stderr().read_secure_line()?;
    } else {
        let most = LONGEST as u64 + 2;
        io::BufReader::new(io::stdin().take(most)).read_line(&mut text)?;
    }
    let token = text.trim();
    ensure!(!token.is_empty(), "there is no token on standard input");
    ensure!(
        token.len() <= LONGEST && token.bytes().all(|byte| byte.is_ascii_graphic()),
        "this is no token: it is too long, or has characters that no token has; was it copied whole, and nothing else?"
    );
    Ok(token.to_owned())
}

/// The file with the tokens, by the addresses of their services.
fn file() -> anyhow::Result<PathBuf> {
    let given = |name| env::var_os(name).filter(|value| !value.is_empty());
    let folder = match (given("XDG_CONFIG_HOME"), given("HOME")) {
        (Some(folder), _) => PathBuf::from(folder),
        (None, Some(home)) => Path::new(&home).join(".config"),
        (None, None) => bail!("there is no HOME to keep a token in; set SIGNORINI_TOKEN instead"),
    };
    Ok(folder.join("signorini").join("tokens.json"))
}

fn kept(path: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    let mut file = match fs::File::open(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        file => file.with_context(|| path.display().to_string())?,
    };
    // of the file that is read, whatever takes its place meanwhile
    let mode = file.metadata()?.permissions().mode();
    let mut text = String::new();
    file.read_to_string(&mut text)
        .with_context(|| path.display().to_string())?;
    ensure!(
        mode & 0o077 == 0,
        "others can read {}, which has tokens: chmod 600 {0}, and rotate them (`signorini token rotate`)",
        path.display()
    );
    let tokens = serde_json::from_str(&text);
    tokens.with_context(|| format!("{} is not what `signorini login` wrote", path.display()))
}

fn write(path: &Path, tokens: &BTreeMap<String, String>) -> anyhow::Result<()> {
    let folder = path.parent().context("the file of tokens has no folder")?;
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true).mode(0o700);
    builder
        .create(folder)
        .with_context(|| folder.display().to_string())?;
    // a temporary file is its owner's alone, and takes the place of the other in one step
    let mut new = tempfile::NamedTempFile::new_in(folder)?;
    writeln!(new, "{}", serde_json::to_string_pretty(tokens)?)?;
    new.persist(path)
        .with_context(|| path.display().to_string())?;
    Ok(())
}
