//! The commands `signorini login` and `signorini logout`: keep the token for a service in a file that only its owner can
//! read, so that it stands neither in scripts nor in the history of a shell.

use std::{
    env,
    io::{self, BufRead, IsTerminal, Read},
};

use anyhow::ensure;
use clap::Args;
use serde_json::Value;

use super::{
    exit::Exit,
    kept_tokens::{address, file, kept, write},
    service::Connection,
};

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
    all.insert(address(&url), token);
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
    if all.remove(&address(&url)).is_none() {
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
