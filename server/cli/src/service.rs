//! Calls a running service for client commands.

use std::{
    error::Error as _,
    fmt::{self, Display, Formatter},
    path::Path,
    sync::OnceLock,
    time::Duration,
};

use anyhow::{Context, bail};
use clap::Args;
use reqwest::{Client, Method, RequestBuilder, Response, StatusCode, header};
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;
use solver::error::Violation;
use thiserror::Error;
use uuid::Uuid;

use super::{
    client::{self, Proxy, Trust, Way},
    kept_tokens,
};

/// The header by which a repeated submission finds the job that the first submission created.
const IDEMPOTENCY_KEY: &str = "Idempotency-Key";
/// The number of times that a repeatable request is sent if its answer does not arrive.
const TRIES: u32 = 4;
/// The pause before a request is sent a second time; it is doubled before each further time.
const FIRST_PAUSE: Duration = Duration::from_millis(250);

/// The options for reaching the service.
#[derive(Debug, Args)]
#[command(next_help_heading = "Service")]
pub(super) struct Connection {
    /// Address of the service; requests carry the token in SIGNORINI_TOKEN, if that is set [default:
    /// http://127.0.0.1:8080]
    #[arg(long, env = "SIGNORINI_URL", value_name = "URL")]
    url: Option<String>,

    #[command(flatten)]
    trust: Trust,
}

impl Connection {
    pub(super) fn open(&self) -> anyhow::Result<Service> {
        Service::at(&self.url(), &self.trust)
    }

    /// Prepares calls with this token.
    pub(super) fn open_with(&self, token: &str) -> anyhow::Result<Service> {
        let token = Some(token.to_owned());
        Service::with_token(&self.url(), &self.trust, token)
    }

    /// The address of the service, without a slash at its end.
    pub(super) fn url(&self) -> String {
        let url = self.url.as_deref().unwrap_or("http://127.0.0.1:8080");
        url.trim_end_matches('/').to_owned()
    }
}

/// A running service.
#[derive(Debug)]
pub(super) struct Service {
    client: Client,
    proxy: Option<Proxy>,
    url: String,
    token: Option<String>,
}

/// Why a call has no usable answer.
#[derive(Debug, Error)]
pub(super) enum CallError {
    /// The service did not answer, or not completely.
    #[error("cannot reach {way}: {cause}. {advice}")]
    Unreachable {
        /// The address of the service, and the proxy on the way to the service.
        way: String,
        /// The innermost cause of the error.
        cause: String,
        /// Advice on what to do.
        advice: &'static str,
        /// Whether there was a connection, which broke: then the address is or was that of some server.
        connected: bool,
    },
    /// The service has refused the request.
    #[error("{0}")]
    Refused(Box<Refusal>),
}

/// The document by which the service refuses a request (RFC 9457).
#[derive(Debug, Deserialize)]
pub(super) struct Refusal {
    /// The HTTP status of the answer.
    pub(super) status: u16,
    /// Whether the service says that the same request may succeed later; absent if the answer does not come from this
    /// service.
    #[serde(default)]
    retryable: Option<bool>,
    /// The kind of error; empty if the answer does not come from this service.
    pub(super) code: String,
    title: String,
    #[serde(default)]
    detail: Option<String>,
    /// All violations of the problem or of the request.
    #[serde(default, rename = "errors")]
    pub(super) violations: Vec<Violation>,
}

impl Display for Refusal {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let code = &self.code;
        f.write_str(self.detail.as_deref().unwrap_or(&self.title))?;
        if !code.is_empty() {
            write!(f, " ({code}; `signorini explain {code}` says more)")?;
        }
        let others = OTHER_ADDRESSES.get().map_or("", |text| text);
        if self.status == 401 && !others.is_empty() {
            write!(
                f,
                ". No token is kept for this address; `signorini login` has kept one for {others}"
            )?;
        }
        match OTHER_VERSION.get() {
            // only one of the two may know it; everything else both do
            Some(other) if matches!(self.status, 400 | 404..=406 | 415 | 422) => {
                write!(f, ". Note that {other}")
            }
            _ => Ok(()),
        }
    }
}

impl std::error::Error for Refusal {}

/// The token in a file, if one is given, or else that of [`token_for`].
pub(super) fn token_in(file: Option<&Path>, url: &str) -> anyhow::Result<Option<String>> {
    let Some(file) = file else {
        return token_for(url);
    };
    let text = std::fs::read_to_string(file);
    let text = text.with_context(|| format!("{} cannot be read", file.display()))?;
    Ok(Some(text.trim().to_owned()))
}

/// The token of the environment, or else the one that `login` has kept for this address.
fn token_for(url: &str) -> anyhow::Result<Option<String>> {
    let given = std::env::var("SIGNORINI_TOKEN").unwrap_or_default();
    match given.trim() {
        "" => {
            let kept = kept_tokens::token_for(url)?;
            if kept.is_none() {
                let _ = OTHER_ADDRESSES.set(kept_tokens::addresses());
            }
            Ok(kept)
        }
        // no header can carry it
        token if !token.bytes().all(|byte| byte.is_ascii_graphic()) => {
            bail!(
                "SIGNORINI_TOKEN is not a token: it has a space, a line break or a character that no token has"
            );
        }
        token => Ok(Some(token.to_owned())),
    }
}

impl Service {
    /// Prepares calls to the service at this address, with the token of the environment, or else the one that `login` has
    /// kept.
    pub(super) fn at(url: &str, trust: &Trust) -> anyhow::Result<Service> {
        Service::with_token(url, trust, token_for(url)?)
    }

    fn with_token(url: &str, trust: &Trust, token: Option<String>) -> anyhow::Result<Service> {
        if !url.contains("://") {
            bail!("the address {url} has no scheme: write http://{url}, or https://");
        }
        let Way { client, proxy } = trust.client(url)?;
        let url = url.trim_end_matches('/').to_owned();
        Ok(Service {
            client,
            proxy,
            url,
            token,
        })
    }

    /// Prepares calls to a service of this process, without a token.
    pub(super) fn local(url: &str) -> anyhow::Result<Service> {
        Ok(Service {
            client: client::local()?,
            proxy: None,
            url: url.to_owned(),
            token: None,
        })
    }

    /// Makes a request for this path, which begins with a slash.
    pub(super) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.client.request(method, format!("{}{path}", self.url));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    /// Sends a request once. If the service refuses it, the error is a [`CallError`].
    pub(super) async fn send(&self, request: RequestBuilder) -> anyhow::Result<Response> {
        let answer = request.send().await;
        let answer = answer.map_err(|error| self.unreachable(&error))?;
        note_version(&answer);
        if !answer.status().is_client_error() && !answer.status().is_server_error() {
            return Ok(answer);
        }
        let status = answer.status();
        let text = answer.text().await.unwrap_or_default();
        match serde_json::from_str::<Refusal>(&text) {
            Ok(refusal) => bail!(CallError::Refused(Box::new(refusal))),
            Err(_) => bail!(CallError::Refused(Box::new(foreign(&self.way(), status)))),
        }
    }

    /// The address of the service, and the proxy on the way to the service, in words.
    fn way(&self) -> String {
        match &self.proxy {
            Some(proxy) => format!("{} through {proxy}", self.url),
            None => self.url.clone(),
        }
    }

    /// Sends a request that is safe to repeat, and sends it again if its answer does not arrive, or the service is
    /// temporarily unable to answer. If there is no connection to the service the error is returned at once.
    pub(super) async fn send_surely(&self, request: RequestBuilder) -> anyhow::Result<Response> {
        let mut pause = FIRST_PAUSE;
        for _ in 1..TRIES {
            let Some(copy) = request.try_clone() else {
                break;
            };
            let error = match self.send(copy).await {
                Ok(answer) => return Ok(answer),
                Err(error) => error,
            };
            match error.downcast_ref() {
                Some(CallError::Refused(refusal)) if refusal.is_passing() => {}
                Some(CallError::Unreachable {
                    connected: true, ..
                }) => {}
                _ => return Err(error),
            }
            tokio::time::sleep(pause).await;
            pause *= 2;
        }
        self.send(request).await
    }

    /// Sends a GET request for this path; returns the answer.
    pub(super) async fn fetch(&self, path: &str) -> anyhow::Result<Response> {
        self.send_surely(self.request(Method::GET, path)).await
    }

    /// Sends a GET request for this path; returns the document in the answer.
    pub(super) async fn get<T: DeserializeOwned>(&self, path: &str) -> anyhow::Result<T> {
        let answer = self.fetch(path).await?;
        self.document(answer).await
    }

    /// Sends a submission. If it is sent again, the service returns what the first request has created.
    pub(super) async fn submit(
        &self,
        path: &str,
        body: Option<String>,
        key: &str,
    ) -> anyhow::Result<Value> {
        let mut request = self.request(Method::POST, path);
        request = request.header(IDEMPOTENCY_KEY, key);
        if let Some(json) = body {
            request = request.header(header::CONTENT_TYPE, "application/json");
            request = request.body(json);
        }
        let answer = self.send_surely(request).await?;
        self.document(answer).await
    }

    /// Calls an operation that is safe to repeat; returns the document in the answer.
    pub(super) async fn call(&self, method: Method, path: &str) -> anyhow::Result<Value> {
        let answer = self.send_surely(self.request(method, path)).await?;
        match answer.status() {
            StatusCode::NO_CONTENT => Ok(Value::Null),
            _ => self.document(answer).await,
        }
    }

    /// Reads the document in an answer.
    pub(super) async fn document<T: DeserializeOwned>(
        &self,
        answer: Response,
    ) -> anyhow::Result<T> {
        let text = answer.bytes().await;
        let text = text.map_err(|error| self.unreachable(&error))?;
        let misunderstood = || misunderstood(&format!("what {} answers", self.way()));
        serde_json::from_slice(&text).with_context(misunderstood)
    }

    /// The error that no answer arrived, or no complete one.
    pub(super) fn unreachable(&self, error: &reqwest::Error) -> CallError {
        let mut cause: &dyn std::error::Error = error;
        while let Some(inner) = cause.source() {
            cause = inner;
        }
        let cause = match (error.is_timeout(), error.source()) {
            (true, _) => "there was no answer for too long".to_owned(),
            _ => cause.to_string(),
        };
        let advice = match &self.proxy {
            _ if cause.contains("UnknownIssuer") || cause.contains("CaUsedAsEndEntity") => {
                "--ca or SIGNORINI_CA must name a file with the certificate of the service, or of the authority that issued it"
            }
            Some(_) => {
                "Check that the proxy reaches the service; --url or SIGNORINI_URL gives another address"
            }
            None => {
                "Check that the service is running there; --url or SIGNORINI_URL gives another address"
            }
        };
        CallError::Unreachable {
            way: self.way(),
            cause,
            advice,
            connected: !error.is_connect(),
        }
    }
}

impl Refusal {
    /// Whether waiting may help: the service says so, or a proxy in front of it cannot reach it.
    pub(super) fn may_pass(&self) -> bool {
        let of_proxy = matches!(self.status, 429 | 502..=504);
        self.retryable.unwrap_or(of_proxy)
    }

    /// Whether the same request may succeed in a moment.
    fn is_passing(&self) -> bool {
        matches!(
            self.code.as_str(),
            "draining" | "overloaded" | "rate-limited"
        )
    }
}

/// Makes an idempotency key for one submission.
pub(super) fn new_key() -> String {
    format!("command-line-{}", Uuid::now_v7())
}

/// Escapes a name as a segment of a path.
pub(super) fn segment(name: &str) -> String {
    let escaped: String = form_urlencoded::byte_serialize(name.as_bytes()).collect();
    // a plus is a space in a query only
    escaped.replace('+', "%20")
}

/// The addresses for which tokens are kept, if there is none for the address that was asked.
static OTHER_ADDRESSES: OnceLock<String> = OnceLock::new();

/// The remark that the service has another version than this program, once a service of another version has answered.
static OTHER_VERSION: OnceLock<String> = OnceLock::new();

fn note_version(answer: &Response) {
    const OWN: &str = env!("CARGO_PKG_VERSION");
    let named = answer.headers().get("signorini-version");
    if let Some(of_service) = named.and_then(|value| value.to_str().ok())
        && of_service != OWN
    {
        let shown = solver::error::shortened(of_service, 40);
        // fails if it is known already
        let _ = OTHER_VERSION.set(format!(
            "the service is of version {shown}, and this program of version {OWN}"
        ));
    }
}

/// The message that `what`, which came from the service, cannot be read.
pub(super) fn misunderstood(what: &str) -> String {
    match OTHER_VERSION.get() {
        Some(other) => format!("{what} is not understood: {other}"),
        None => format!("{what} cannot be read by this version of signorini"),
    }
}

/// The refusal for an answer that does not come from this service, but from another server at its address or in front
/// of it.
fn foreign(way: &str, status: StatusCode) -> Refusal {
    Refusal {
        status: status.as_u16(),
        retryable: None,
        code: String::new(),
        title: String::new(),
        detail: Some(format!(
            "{way} answers {status}, but not like a signorini service: check the address"
        )),
        violations: vec![],
    }
}
