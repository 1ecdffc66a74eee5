//! The command `signorini token`: for a store that no server uses, or through a running service.

use std::{sync::Arc, time::Duration};

use anyhow::{Context, bail};
use base::{caller::Caller, time::Time, token::Token};
use clap::{ArgMatches, Args, Subcommand, ValueEnum, parser::ValueSource};
use reqwest::Method;
use serde_json::{Value, json};
use service::verbs::tokens::{self, TokenRequest};
use store::{Store, StoreError};

use super::{
    client::Trust,
    exit::Exit,
    output,
    service::{Service, misunderstood},
    settings::Folder,
    table::table,
};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Create a token and print it; it is not stored and cannot be printed again. The first token must have the scope
    /// admin; once there is a token, every request needs one
    Create {
        /// A name for people, such as where the token is used
        #[arg(long)]
        name: String,
        /// Owner of the jobs that are submitted with the token: letters, digits and . _ @ + -
        #[arg(long)]
        owner: String,
        /// read, submit, cancel or admin, which includes the others for the jobs of all owners; can be repeated, or a list
        /// with commas
        #[arg(
            long = "scope",
            value_delimiter = ',',
            default_value = "read,submit,cancel"
        )]
        scopes: Vec<String>,
        /// Time until the token expires, in seconds or with a unit such as 90d, 12h, 30m [default: never]
        #[arg(long, value_name = "TIME", value_parser = duration_s)]
        expires_in: Option<f64>,
        #[command(flatten)]
        at: TokenStore,
    },
    /// List all tokens, without their secrets
    List {
        /// How to print: json is the list as the service answers it
        #[arg(short, long, value_enum, default_value_t = Format::Table)]
        format: Format,
        #[command(flatten)]
        at: TokenStore,
    },
    /// Revoke a token, which is refused from then on
    Revoke {
        /// The token's id, as `list` shows it
        id: String,
        #[command(flatten)]
        at: TokenStore,
    },
    /// Give a token a new secret and print it; the old secret is refused from then on
    Rotate {
        /// The token's id, as `list` shows it
        id: String,
        #[command(flatten)]
        at: TokenStore,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Table,
    Json,
}

/// The options that say where the tokens are: in the folder of a store, or in a running service.
#[derive(Debug, Args)]
struct TokenStore {
    #[command(flatten)]
    folder: Folder,

    /// Address of a running service, such as http://127.0.0.1:8080. Requests carry the token in SIGNORINI_TOKEN.
    /// Without this address, no server may be using the store
    #[arg(long, env = "SIGNORINI_URL", value_name = "URL")]
    url: Option<String>,

    #[command(flatten)]
    trust: Trust,
}

/// Whether the command line names a folder and no address; the folder then takes precedence over an address in the
/// environment.
pub(super) fn names_folder(given: &ArgMatches) -> bool {
    let named = |id: &str| given.value_source(id) == Some(ValueSource::CommandLine);
    named("data") && !named("url")
}

/// Runs the command. `folder`: whether the tokens are in a store, even if the environment has the address of a service.
pub(super) async fn run(arguments: Arguments, folder: bool) -> anyhow::Result<Exit> {
    match arguments.command {
        Command::Create {
            name,
            owner,
            scopes,
            expires_in,
            at,
        } => {
            let request = TokenRequest {
                name,
                owner,
                scopes,
                expires_in_s: expires_in,
            };
            let (token, secret) = match at.open(true, folder).await? {
                Target::Store(store) => {
                    let new = tokens::create(&store, &Caller::local(), request).await;
                    close(store).await;
                    let new = new?;
                    (new.token, new.secret)
                }
                Target::Service(service) => {
                    let TokenRequest {
                        name,
                        owner,
                        scopes,
                        expires_in_s,
                    } = request;
                    let mut body = json!({"name": name, "owner": owner, "scopes": scopes});
                    if let Some(seconds) = expires_in_s {
                        body["expires_in_s"] = json!(seconds);
                    }
                    let request = service.request(Method::POST, "/v1/tokens").json(&body);
                    new_token(service.document(service.send(request).await?).await?)?
                }
            };
            eprintln!("{}", told(&token));
            output::print(&format!("{secret}\n"))?;
        }
        Command::List { format, at } => {
            let all = match at.open(false, folder).await? {
                Target::Store(store) => {
                    let all = tokens::list(&store, &Caller::local());
                    close(store).await;
                    all
                }
                Target::Service(service) => {
                    let mut answer = service.call(Method::GET, "/v1/tokens").await?;
                    serde_json::from_value(answer["tokens"].take()).with_context(not_ours)?
                }
            };
            let text = match format {
                Format::Table => listed(&all),
                Format::Json => format!("{:#}\n", serde_json::to_value(&all)?),
            };
            output::print(&text)?;
        }
        Command::Revoke { id, at } => {
            let token = match at.open(false, folder).await? {
                Target::Store(store) => {
                    let revoked = tokens::revoke(&store, &Caller::local(), &id).await;
                    close(store).await;
                    revoked?
                }
                Target::Service(service) => {
                    let path = format!("/v1/tokens/{id}");
                    let answer = service.call(Method::DELETE, &path).await?;
                    serde_json::from_value(answer).with_context(not_ours)?
                }
            };
            eprintln!("{}", told(&token));
        }
        Command::Rotate { id, at } => {
            let (token, secret) = match at.open(false, folder).await? {
                Target::Store(store) => {
                    let new = tokens::rotate(&store, &Caller::local(), &id).await;
                    close(store).await;
                    let new = new?;
                    (new.token, new.secret)
                }
                Target::Service(service) => {
                    let path = format!("/v1/tokens/{id}/rotate");
                    let request = service.request(Method::POST, &path);
                    new_token(service.document(service.send(request).await?).await?)?
                }
            };
            eprintln!("{}", told(&token));
            output::print(&format!("{secret}\n"))?;
        }
    }
    Ok(Exit::Ok)
}

fn not_ours() -> String {
    misunderstood("the answer")
}

fn new_token(mut answer: Value) -> anyhow::Result<(Token, String)> {
    let token = serde_json::from_value(answer["token"].take()).with_context(not_ours)?;
    let secret = answer["secret"].as_str().with_context(not_ours)?.to_owned();
    Ok((token, secret))
}

/// Where tokens are changed: in a store, or in a running service.
enum Target {
    Store(Arc<Store>),
    Service(Service),
}

impl TokenStore {
    /// Opens the store, or connects to the service. `create`: whether a store may be created; `folder`: whether the
    /// address is ignored.
    async fn open(&self, create: bool, folder: bool) -> anyhow::Result<Target> {
        let Some(url) = self.url.as_ref().filter(|_| !folder) else {
            let folder = self.folder.path();
            if !folder.exists() {
                if create {
                    eprintln!("creating a new store in {}", folder.display())
                } else {
                    bail!(StoreError::Folder(format!(
                        "there is no store in {}",
                        folder.display()
                    )))
                }
            }
            let store = Store::open(folder).await;
            return match store {
                Err(StoreError::Locked(text)) => Err(StoreError::Locked(format!(
                    "{text}; while it runs, give its address with --url"
                ))
                .into()),
                opened => Ok(Target::Store(opened?)),
            };
        };
        Ok(Target::Service(Service::at(url, &self.trust)?))
    }
}

async fn close(store: Arc<Store>) {
    store.close_as_found().await;
}

fn told(token: &Token) -> String {
    let Token {
        id, name, owner, ..
    } = token;
    format!(
        "token {id} ({name}) of {owner}, for {}; {}",
        scopes(token),
        state(token, Time::of_the_machine())
    )
}

fn scopes(token: &Token) -> String {
    let words: Vec<&str> = token.scopes.iter().map(|scope| (*scope).into()).collect();
    words.join(",")
}

fn state(token: &Token, now: Time) -> String {
    match (token.revoked_at, token.expires_at) {
        (Some(time), _) => format!("revoked {time}"),
        (None, Some(end)) if end <= now => format!("expired {end}"),
        (None, Some(end)) => format!("valid until {end}"),
        (None, None) => "valid".into(),
    }
}

/// Writes a table of the tokens, below headings.
fn listed(tokens: &[Token]) -> String {
    let now = Time::of_the_machine();
    let row = |token: &Token| {
        let Token {
            id, owner, name, ..
        } = token;
        [
            id.clone(),
            owner.clone(),
            name.clone(),
            scopes(token),
            state(token, now),
        ]
    };
    let rows: Vec<[String; 5]> = tokens.iter().map(row).collect();
    table(["ID", "OWNER", "NAME", "SCOPES", "STATE"], &rows)
}

/// Reads a duration as [`duration_s`] does.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let seconds = Duration::try_from_secs_f64(duration_s(text)?);
    seconds.map_err(|_| "a time is negative, or too long".into())
}

/// Reads a duration: seconds, or a number with one of the units s, m, h, d.
fn duration_s(text: &str) -> Result<f64, String> {
    let (number, unit) = match text.strip_suffix(['s', 'm', 'h', 'd']) {
        Some(number) => (number, &text[number.len()..]),
        None => (text, "s"),
    };
    let seconds = match unit {
        "d" => 86400.0,
        "h" => 3600.0,
        "m" => 60.0,
        _ => 1.0,
    };
    let number: f64 = number
        .parse()
        .map_err(|_| "expected seconds, or a number with a unit, such as 90d, 12h or 30m")?;
    Ok(number * seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_a_number_of_seconds_or_has_a_unit() {
        for (text, seconds) in [
            ("60", 60.0),
            ("1.5h", 5400.0),
            ("90d", 7_776_000.0),
            ("2m", 120.0),
            ("5s", 5.0),
        ] {
            assert_eq!(duration_s(text), Ok(seconds), "{text}");
        }
        assert!(
            ["", "d", "1w", "1 d"]
                .iter()
                .all(|text| duration_s(text).is_err())
        );
    }
}
