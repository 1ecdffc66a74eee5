//! The configuration: one struct, whose doc comments are the help text, in the order of the help. Each option has an
//! environment variable, whose name without `SIGNORINI_` and in small letters is its key in a file (`cli/settings.rs`).

use std::{
    net::{IpAddr, SocketAddr, ToSocketAddrs},
    path::PathBuf,
    sync::OnceLock,
};

use axum::http::{HeaderName, Uri};
use base::caller::{Caller, Scope};
use clap::{Args, ValueEnum};
use ipnet::{IpNet, Ipv4Net, Ipv6Net};
use schemars::JsonSchema;
use serde::Serialize;
use strum::Display;
use tracing_subscriber::filter::{LevelFilter, Targets};

/// The longest time that any job may run, in seconds: a week.
pub const WEEK_S: u32 = 7 * 86_400;

/// The settings of the service. A flag takes precedence over its environment variable, and the variable over the file
/// of settings.
#[derive(Clone, Debug, Args)]
pub struct Config {
    /// Address and port of both REST and gRPC; port 0 chooses a free one
    #[arg(
        long,
        env = "SIGNORINI_LISTEN",
        default_value = "127.0.0.1:8080",
        value_name = "ADDRESS",
        value_parser = address
    )]
    pub listen: SocketAddr,

    #[command(flatten)]
    #[allow(missing_docs)] // a doc comment here would become the help of the command
    pub store: StoreFolder,

    #[command(flatten)]
    #[allow(missing_docs)]
    pub tls: Tls,

    #[command(flatten)]
    #[allow(missing_docs)]
    pub web: Web,

    #[command(flatten)]
    #[allow(missing_docs)]
    pub trust: ProxyTrust,

    /// Listen on an address that other machines can reach, although there is no token and no trusted proxy: anyone who
    /// reaches it may do everything
    #[arg(long, env = "SIGNORINI_ALLOW_UNAUTHENTICATED")]
    pub allow_unauthenticated: bool,

    /// Jobs solved here at the same time, each on one core. 0: only workers elsewhere solve (`signorini worker`)
    #[arg(long, env = "SIGNORINI_WORKERS", default_value_t = 2, value_name = "N",
          value_parser = clap::value_parser!(u16).range(..=256))]
    pub workers: u16,

    /// Seconds after which a worker elsewhere that is not heard of is taken for lost, so that its jobs are requeued
    #[arg(long, env = "SIGNORINI_LEASE_S", default_value_t = 30, value_name = "SECONDS",
          value_parser = clap::value_parser!(u16).range(2..=3600))]
    pub lease_s: u16,

    /// Where jobs are solved: on threads of the service, or in processes, one for each worker and kept from job to job.
    /// In a process, a crash such as a stack overflow costs only the job that the process is solving
    #[arg(long, env = "SIGNORINI_ISOLATION", value_enum, default_value_t = Isolation::Thread)]
    pub isolation: Isolation,

    /// Maximum number of jobs in the queue; further ones are refused
    #[arg(
        long,
        env = "SIGNORINI_MAX_QUEUED",
        default_value_t = 100_000,
        value_name = "N"
    )]
    pub max_queued: u32,

    /// Maximum number of jobs of one owner in the queue, where there are tokens or a trusted proxy; further ones are refused
    #[arg(
        long,
        env = "SIGNORINI_MAX_QUEUED_PER_OWNER",
        default_value_t = 2_000,
        value_name = "N"
    )]
    pub max_queued_per_owner: u32,

    /// Maximum number of jobs of one owner that run at the same time, even if workers are idle [default: as many as there are
    /// workers]
    #[arg(long, env = "SIGNORINI_MAX_RUNNING_PER_OWNER", value_name = "N",
          value_parser = clap::value_parser!(u16).range(1..))]
    pub max_running_per_owner: Option<u16>,

    /// Longest time that a submission may give its job to run (`limits.timeout_s`), in seconds: from 600, the time of a job that
    /// gives none, to a week
    #[arg(long, env = "SIGNORINI_MAX_TIMEOUT_S", default_value_t = WEEK_S, value_name = "SECONDS",
          value_parser = clap::value_parser!(u32).range(600..=i64::from(WEEK_S)))]
    pub max_timeout_s: u32,

    /// Bytes that one owner may store, jobs and meshes together. An owner with more can submit and upload nothing until
    /// they delete some. It applies only where there are tokens or a trusted proxy [default: no limit]
    #[arg(long, env = "SIGNORINI_MAX_BYTES_PER_OWNER", value_name = "BYTES")]
    pub max_bytes_per_owner: Option<u64>,

    /// Jobs that one owner may submit in any minute. It applies only where there are tokens or a trusted proxy [default: no limit]
    #[arg(long, env = "SIGNORINI_MAX_SUBMISSIONS_PER_OWNER_PER_MINUTE", value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub max_submissions_per_owner_per_minute: Option<u32>,

    #[command(flatten)]
    #[allow(missing_docs)] // a doc comment here would become the help of the command
    pub retention: RetentionLimits,

    #[command(flatten)]
    #[allow(missing_docs)] // a doc comment here would become the help of the command
    pub memory: MemoryBudget,

    /// Memory for condensed bodies that are kept for later jobs on the same body. It is part of the memory that running
    /// jobs share: jobs take precedence over bodies that no job uses. 0 keeps none, and so does isolation `process`
    /// [default: a quarter of that memory]
    #[arg(long, env = "SIGNORINI_BODY_CACHE_BYTES", value_name = "BYTES")]
    pub body_cache_bytes: Option<u64>,

    /// Maximum size of a request body over REST
    #[arg(long, env = "SIGNORINI_MAX_BODY_BYTES", default_value_t = 16 << 20, value_name = "BYTES")]
    pub max_body_bytes: usize,

    /// Maximum size of an uploaded mesh file
    #[arg(long, env = "SIGNORINI_MAX_MESH_BYTES", default_value_t = 512 << 20, value_name = "BYTES")]
    pub max_mesh_bytes: usize,

    /// Maximum number of connections; fewer if the limit of open files is lower
    #[arg(long, env = "SIGNORINI_MAX_CONNECTIONS", default_value_t = 8192, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub max_connections: u32,

    /// Maximum size of all request bodies in memory at the same time, including the memory for decompressing them
    #[arg(long, env = "SIGNORINI_MAX_RECEIVED_BYTES", default_value_t = 64 << 20, value_name = "BYTES")]
    pub max_received_bytes: usize,

    /// Maximum size of all answers in memory at the same time, including the memory for compressing them
    #[arg(long, env = "SIGNORINI_MAX_SENT_BYTES", default_value_t = 128 << 20, value_name = "BYTES")]
    pub max_sent_bytes: usize,

    /// Time that open requests get to finish after SIGTERM; running jobs are requeued at once
    #[arg(
        long,
        env = "SIGNORINI_GRACE_S",
        default_value_t = 10,
        value_name = "SECONDS"
    )]
    pub grace_s: u64,

    #[command(flatten)]
    #[allow(missing_docs)] // a doc comment here would become the help of the command
    pub placement: Placement,

    #[command(flatten)]
    #[allow(missing_docs)] // a doc comment here would become the help of the command
    pub telemetry: Telemetry,
}

/// The folder of the store, for the service and for the commands that open a store themselves.
#[derive(Clone, Debug, Args)]
pub struct StoreFolder {
    /// Folder of the store: jobs, results, meshes
    #[arg(
        long,
        env = "SIGNORINI_DATA",
        default_value = "./signorini-data",
        value_name = "FOLDER"
    )]
    pub data: PathBuf,
}

impl Config {
    /// The memory for condensed bodies that are kept for later jobs (bytes). 0 for worker processes: each would hold
    /// bodies that the other processes cannot use.
    pub fn body_cache_bytes(&self) -> u64 {
        match self.isolation {
            Isolation::Thread => {
                let budget = self.memory.bytes();
                let bytes = self.body_cache_bytes.unwrap_or(budget / 4);
                bytes.min(budget)
            }
            Isolation::Process => 0,
        }
    }
}

/// Limits on how many jobs that have ended are kept, and for how long.
#[derive(Clone, Debug, Default, Args)]
pub struct RetentionLimits {
    /// Days that a job is kept after its end, unless it is pinned. 0: no limit
    #[arg(long, env = "SIGNORINI_RETAIN_DAYS", default_value_t = 90.0, value_name = "DAYS", value_parser = days)]
    pub retain_days: f64,

    /// Days that displacements and stresses, which are most of a result, are kept; summary, history and profiles
    /// remain. 0: as long as their job
    #[arg(long, env = "SIGNORINI_RETAIN_FIELDS_DAYS", default_value_t = 0.0, value_name = "DAYS", value_parser = days)]
    pub retain_fields_days: f64,

    /// Maximum bytes of all jobs that have ended and are not pinned; beyond that the oldest jobs of the owners who
    /// store most are removed. 0: no limit
    #[arg(long, env = "SIGNORINI_RETAIN_BYTES", default_value_t = 20 << 30, value_name = "BYTES")]
    pub retain_bytes: u64,

    /// Maximum bytes of the jobs of one owner that have ended; beyond that the owner's oldest jobs that are not pinned
    /// are removed. 0: no limit
    #[arg(
        long,
        env = "SIGNORINI_RETAIN_BYTES_PER_OWNER",
        default_value_t = 0,
        value_name = "BYTES"
    )]
    pub retain_bytes_per_owner: u64,

    /// Maximum number of jobs that have ended; beyond that the oldest jobs that are not pinned are removed. 0: no limit
    #[arg(
        long,
        env = "SIGNORINI_RETAIN_JOBS",
        default_value_t = 0,
        value_name = "N"
    )]
    pub retain_jobs: u64,

    /// Maximum number of jobs of one owner that have ended; beyond that the owner's oldest jobs that are not pinned are
    /// removed. 0: no limit
    #[arg(
        long,
        env = "SIGNORINI_RETAIN_JOBS_PER_OWNER",
        default_value_t = 0,
        value_name = "N"
    )]
    pub retain_jobs_per_owner: u64,
}

/// Reads a number of days.
fn days(text: &str) -> Result<f64, String> {
    const MOST: f64 = 36_500.0;
    match text.parse::<f64>() {
        Ok(days) if (0.0..=MOST).contains(&days) => Ok(days),
        _ => Err(format!("expected a number of days from 0 to {MOST}")),
    }
}

/// The certificate of the service.
#[derive(Clone, Debug, Default, Args)]
pub struct Tls {
    /// PEM file of a certificate, followed by the certificates of its issuers: the service then accepts only TLS.
    /// SIGHUP reads it and the key again
    #[arg(long = "tls-cert", env = "SIGNORINI_TLS_CERT", value_name = "FILE")]
    cert: Option<PathBuf>,

    /// PEM file of the certificate's private key, not encrypted
    #[arg(long = "tls-key", env = "SIGNORINI_TLS_KEY", value_name = "FILE")]
    key: Option<PathBuf>,
}

/// The files of a certificate and its key.
#[derive(Clone, Debug)]
pub struct TlsFiles {
    /// The file of the certificate, followed by the certificates of its issuers.
    pub cert: PathBuf,
    /// The file of the private key.
    pub key: PathBuf,
}

/// The error that only one of the two files is given, so that it is unclear whether the service should use TLS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{given} is set, and {missing} is not: TLS needs both the certificate and its key (on the command line, in the \
     environment, or in the file of settings)"
)]
pub struct HalfOfTls {
    given: &'static str,
    missing: &'static str,
}

impl Tls {
    /// Whether the service uses TLS.
    pub fn is_on(&self) -> bool {
        self.cert.is_some()
    }

    /// The files of the certificate and its key; `None` if neither is set. clap's `requires` is not used, since it does
    /// not see values from the file of settings.
    pub fn files(&self) -> Result<Option<TlsFiles>, HalfOfTls> {
        let half = |given, missing| Err(HalfOfTls { given, missing });
        match (&self.cert, &self.key) {
            (None, None) => Ok(None),
            (Some(_), None) => half("--tls-cert", "--tls-key"),
            (None, Some(_)) => half("--tls-key", "--tls-cert"),
            (Some(cert), Some(key)) => Ok(Some(TlsFiles {
                cert: cert.clone(),
                key: key.clone(),
            })),
        }
    }
}

/// Who places workers elsewhere.
#[derive(Clone, Debug, Default, Args)]
pub struct Placement {
    /// Whether the service itself submits workers to Slurm, as jobs waiting for them need
    #[arg(long, env = "SIGNORINI_SLURM", value_enum, default_value_t = Placing::Off, requires_if("auto", "slurm_server"))]
    pub slurm: Placing,

    /// Address of this service as the nodes of the cluster reach it; required with `--slurm auto`
    #[arg(long, env = "SIGNORINI_SLURM_SERVER", value_name = "URL")]
    pub slurm_server: Option<String>,

    /// Maximum number of workers in Slurm (pilots), one for a node
    #[arg(long, env = "SIGNORINI_SLURM_PILOTS", default_value_t = 4, value_name = "N",
          value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub slurm_pilots: u16,

    /// Jobs that a pilot solves at the same time, each on one processor [default: a pilot takes a whole node]
    #[arg(long, env = "SIGNORINI_SLURM_SLOTS", value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub slurm_slots: Option<u16>,

    /// Time of a pilot, in seconds
    #[arg(long, env = "SIGNORINI_SLURM_TIME_S", default_value_t = 3600, value_name = "SECONDS",
          value_parser = clap::value_parser!(u32).range(60..))]
    pub slurm_time_s: u32,

    /// Seconds without a job after which a pilot ends
    #[arg(
        long,
        env = "SIGNORINI_SLURM_IDLE_EXIT_S",
        default_value_t = 60,
        value_name = "SECONDS"
    )]
    pub slurm_idle_exit_s: u32,

    /// File of the token of pilots, with the scope `work`
    #[arg(long, env = "SIGNORINI_SLURM_TOKEN_FILE", value_name = "FILE")]
    pub slurm_token_file: Option<PathBuf>,

    /// PEM file, on the nodes, of the authority that issued the service's certificate
    #[arg(long, env = "SIGNORINI_SLURM_CA", value_name = "FILE")]
    pub slurm_ca: Option<PathBuf>,

    /// The program on the nodes [default: where it is on this machine]
    #[arg(long, env = "SIGNORINI_SLURM_PROGRAM", value_name = "FILE")]
    pub slurm_program: Option<PathBuf>,

    /// A further option of `sbatch`, such as `--partition=short`; may be repeated
    #[arg(
        long = "slurm-option",
        env = "SIGNORINI_SLURM_OPTIONS",
        value_name = "OPTION",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    pub slurm_options: Vec<String>,
}

/// Whether the service submits workers to Slurm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Display)]
#[strum(serialize_all = "lowercase")]
pub enum Placing {
    /// It does not
    #[default]
    Off,
    /// As many as the queue needs
    Auto,
}

/// Settings for the log and for spans.
#[derive(Clone, Debug, Default, Args)]
pub struct Telemetry {
    /// What is logged: a level (error, warn, info, debug, trace), and levels for parts of the program, such as
    /// info,service::request=warn [default: RUST_LOG, or info]
    #[arg(long, env = "SIGNORINI_LOG", value_name = "FILTER", value_parser = log_filter)]
    pub log: Option<Targets>,

    /// Format of the log: lines of text, or a JSON object on each line
    #[arg(long, env = "SIGNORINI_LOG_FORMAT", value_enum, default_value_t = LogFormat::Text)]
    pub log_format: LogFormat,

    /// Send spans of requests and jobs to a collector at this address by OTLP over gRPC, such as
    /// `http://127.0.0.1:4317` [default: no spans are sent]
    #[arg(long, env = "SIGNORINI_OTLP_ENDPOINT", value_name = "URL", value_parser = endpoint)]
    pub otlp_endpoint: Option<String>,
}

/// The format of the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Display)]
#[strum(serialize_all = "lowercase")]
pub enum LogFormat {
    /// Text for people
    #[default]
    Text,
    /// JSON for programs
    Json,
}

/// Reads a filter of the log: a level, and levels of targets.
pub fn log_filter(text: &str) -> Result<Targets, String> {
    const EXPECTED: &str = "expected a level (off, error, warn, info, debug, trace), or levels of targets, such as \
                            info,service::request=warn";
    // `Targets` takes any other word for a target: `verbose` would be a log without a line
    // or for a level, if it is empty
    let level = |part: &str| !part.is_empty() && part.parse::<LevelFilter>().is_ok();
    let word = |part: &&str| !part.contains('=') && !level(part);
    if let Some(word) = text.split(',').map(str::trim).find(word) {
        return Err(format!("{EXPECTED} ({word:?} is no level)"));
    }
    text.parse()
        .map_err(|error| format!("{EXPECTED} ({error})"))
}

/// Reads the name of a host, with a port if that is not the usual one.
fn host(text: &str) -> Result<String, String> {
    match text.find(['/', '*', '?', '@', ' ']) {
        Some(_) => Err("expected a name without scheme, path or pattern, such as lab.example or lab.example:8443".into()),
        None => Ok(text.to_owned()),
    }
}

/// Settings for requests from browsers.
#[derive(Clone, Debug, Default, Args)]
pub struct Web {
    /// A host name by which clients reach this service, such as lab.example or lab.example:8443; can be repeated, or a
    /// list with commas. Numeric addresses, localhost and the name of this machine are always allowed, other names are
    /// refused: a page on another site could let its own name lead to this service
    #[arg(
        long = "allowed-host",
        env = "SIGNORINI_ALLOWED_HOSTS",
        value_name = "HOST",
        value_delimiter = ',',
        value_parser = host
    )]
    pub allowed_hosts: Vec<String>,

    /// Path below which clients reach this service, such as /signorini, where a proxy puts it below a path: links begin
    /// with this path. The service answers both below this path and without it, for proxies that remove it
    #[arg(long, env = "SIGNORINI_PATH_PREFIX", value_name = "PATH", default_value = "",
          hide_default_value = true, value_parser = path_prefix)]
    pub path_prefix: String,

    /// An origin whose pages may use this service, such as `https://dashboard.example`; can be repeated, or a list with
    /// commas. Requests from pages of other origins are refused, except the service's own
    #[arg(long = "allowed-origin", env = "SIGNORINI_ALLOWED_ORIGINS", value_name = "ORIGIN", value_delimiter = ',',
          value_parser = origin)]
    pub allowed_origins: Vec<String>,
}

/// A proxy in front of the service, and the scopes of the users whom it names, if it identifies users.
#[derive(Clone, Debug, Args)]
pub struct ProxyTrust {
    /// Address of a proxy, or a network such as 10.0.0.0/8: it is believed which host, scheme and address its clients have,
    /// and with --proxy-user-header who they are. Can be repeated, or a list with commas
    #[arg(long = "trusted-proxy", env = "SIGNORINI_TRUSTED_PROXIES", value_name = "ADDRESS", value_delimiter = ',',
          value_parser = network)]
    proxies: Vec<IpNet>,

    /// The header in which a trusted proxy names the user, who then needs no token: every program at the address of the
    /// proxy can be any user. Without it all users need tokens
    #[arg(
        long = "proxy-user-header",
        env = "SIGNORINI_PROXY_USER_HEADER",
        value_name = "NAME"
    )]
    pub user_header: Option<HeaderName>,

    /// The scopes of users whom the proxy names
    #[arg(long = "proxy-scopes", env = "SIGNORINI_PROXY_SCOPES", value_name = "SCOPES", value_delimiter = ',',
          default_value = "read,submit,cancel", value_parser = scope)]
    scopes: Vec<Scope>,

    /// A user named by the proxy who is an administrator; can be repeated, or a list with commas
    #[arg(
        long = "proxy-admin",
        env = "SIGNORINI_PROXY_ADMINS",
        value_name = "USER",
        value_delimiter = ','
    )]
    admins: Vec<String>,
}

impl Default for ProxyTrust {
    /// No trusted proxy.
    fn default() -> Self {
        ProxyTrust {
            proxies: vec![],
            user_header: None,
            scopes: vec![Scope::Read, Scope::Submit, Scope::Cancel],
            admins: vec![],
        }
    }
}

impl ProxyTrust {
    /// Trusts these proxies, which name no users; texts that are not networks are left out.
    pub fn of(proxies: &[&str]) -> ProxyTrust {
        let proxies = proxies.iter().filter_map(|text| network(text).ok());
        ProxyTrust {
            proxies: proxies.collect(),
            ..ProxyTrust::default()
        }
    }

    /// Whether any proxy is trusted.
    pub fn is_on(&self) -> bool {
        !self.proxies.is_empty()
    }

    /// Whether a trusted proxy names users.
    pub fn names_users(&self) -> bool {
        self.is_on() && self.user_header.is_some()
    }

    /// Whether this is the address of a trusted proxy.
    pub fn includes(&self, address: IpAddr) -> bool {
        let address = address.to_canonical();
        self.proxies
            .iter()
            .any(|network| network.contains(&address))
    }

    /// The caller that a request has whose user is named by a trusted proxy.
    pub fn caller(&self, user: &str) -> Caller {
        let admin = self.admins.iter().any(|admin| admin == user);
        let scopes = self.scopes.iter().copied();
        Caller::new(user, scopes.chain(admin.then_some(Scope::Admin)))
    }
}

/// Reads a network; a single address is read as the network of this address alone.
fn network(text: &str) -> Result<IpNet, String> {
    let one = text.parse::<IpAddr>().map(IpNet::from);
    let found = one.or_else(|_| text.parse()).map(|found| match found {
        IpNet::V6(of_v4) => canonical(of_v4),
        v4 => v4,
    });
    found.map_err(|_| "expected an address or a network, such as 127.0.0.1 or 10.0.0.0/8".into())
}

/// Converts an IPv4 network that is written as IPv6, such as ::ffff:10.0.0.0/104, to IPv4, since the addresses of
/// requests are compared as IPv4.
fn canonical(network: Ipv6Net) -> IpNet {
    const BEFORE_V4: u8 = 96;
    let within = network.addr().to_ipv4_mapped();
    let bits = network.prefix_len().checked_sub(BEFORE_V4);
    match within.zip(bits) {
        Some((address, bits)) => Ipv4Net::new(address, bits).map_or(IpNet::V6(network), IpNet::V4),
        None => IpNet::V6(network),
    }
}

fn scope(text: &str) -> Result<Scope, String> {
    text.parse()
        .map_err(|_| "expected read, submit, cancel, work or admin".into())
}

/// Reads a path and removes a slash at its end; the root becomes empty.
fn path_prefix(text: &str) -> Result<String, String> {
    const MOST: usize = 200;
    let path = text.strip_suffix('/').unwrap_or(text);
    let plain = |c: char| c.is_ascii_alphanumeric() || "-._~".contains(c);
    let named = |part: &str| {
        !part.is_empty() && part.chars().all(plain) && !part.trim_matches('.').is_empty()
    };
    match path.strip_prefix('/') {
        _ if path.is_empty() => Ok(String::new()),
        Some(rest) if path.len() <= MOST && rest.split('/').all(named) => Ok(path.to_owned()),
        _ => Err("expected a path of letters, digits and - . _ ~, such as /signorini".into()),
    }
}

/// Reads the address of a collector. Credentials in it are refused: they are secret, and settings are shown.
fn endpoint(text: &str) -> Result<String, String> {
    const EXPECTED: &str = "expected an address as http://127.0.0.1:4317, without a user or a path; a collector on the same \
                            machine or network passes spans on over TLS";
    let found: Result<Uri, _> = text.parse();
    let good = found.is_ok_and(|uri| {
        let host = uri
            .authority()
            .is_some_and(|host| !host.as_str().contains('@'));
        let bare = matches!(uri.path(), "" | "/") && uri.query().is_none();
        host && bare && uri.scheme_str() == Some("http")
    });
    good.then(|| text.to_owned()).ok_or_else(|| EXPECTED.into())
}

/// Reads an origin: scheme, host and port as a browser writes them.
fn origin(text: &str) -> Result<String, String> {
    let host = text
        .strip_prefix("https://")
        .or(text.strip_prefix("http://"));
    match host {
        Some(host) if !host.is_empty() && !host.contains(['/', '*', '?', '#', ' ']) => {
            Ok(text.to_ascii_lowercase())
        }
        _ => Err(
            "expected scheme, host and port without a path, such as https://dashboard.example"
                .into(),
        ),
    }
}

/// Reads an address and a port, by number or by name; of several addresses, the first is taken.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    const EXPECTED: &str =
        "expected an address and a port, such as 127.0.0.1:8080 or localhost:8080";
    let found = text
        .to_socket_addrs()
        .map_err(|error| format!("{EXPECTED} ({error})"))?;
    found.into_iter().next().ok_or_else(|| EXPECTED.into())
}

/// Where jobs are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Display, Serialize, JsonSchema)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "lowercase")]
pub enum Isolation {
    /// On threads of the service
    Thread,
    /// In processes of their own
    Process,
}

/// The memory that running jobs share.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct MemoryBudget {
    /// Memory that running jobs share. A job is refused if it is estimated to need more; it waits until its estimate
    /// fits together with those of the running jobs; and it is ended if it uses more than its estimate plus a margin
    /// (128 MiB divided by the number of workers) [default: half of the machine's memory]
    #[arg(long, env = "SIGNORINI_MEMORY_BUDGET_BYTES", value_name = "BYTES",
          value_parser = clap::value_parser!(u64).range(1 << 20..))]
    memory_budget_bytes: Option<u64>,
}

impl MemoryBudget {
    /// The memory budget in bytes: the setting, or half of the machine's memory.
    pub fn bytes(self) -> u64 {
        self.memory_budget_bytes
            .unwrap_or_else(|| machine_memory() / 2)
    }
}

/// The memory of this machine, or of the container that the process runs in, as it was when this was called first: each
/// submission asks for it.
fn machine_memory() -> u64 {
    static BYTES: OnceLock<u64> = OnceLock::new();
    *BYTES.get_or_init(read_machine_memory)
}

fn read_machine_memory() -> u64 {
    // If the memory is unknown, problems are not refused for it; 8 GiB is a common small machine.
    const UNKNOWN: u64 = 8 << 30;
    let total = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
            Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
        });
    let container = std::fs::read_to_string("/sys/fs/cgroup/memory.max")
        .ok()
        .and_then(|text| text.trim().parse().ok());
    total.unwrap_or(UNKNOWN).min(container.unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_proxy_is_an_address_or_a_network() {
        let trust = ProxyTrust {
            proxies: ["127.0.0.1", "10.1.0.0/16", "fd00::/8"]
                .map(|text| network(text).unwrap())
                .into(),
            scopes: vec![Scope::Read],
            admins: vec!["root".into()],
            ..ProxyTrust::default()
        };
        for (address, inside) in [
            ("127.0.0.1", true),
            ("::ffff:127.0.0.1", true),
            ("127.0.0.2", false),
            ("10.1.255.3", true),
            ("10.2.0.1", false),
            ("fd12::1", true),
            ("::1", false),
        ] {
            assert_eq!(
                trust.includes(address.parse().unwrap()),
                inside,
                "{address}"
            );
        }
        assert!(
            ["", "10.0.0.0/33", "proxy"]
                .iter()
                .all(|text| network(text).is_err())
        );
        assert_eq!(trust.caller("ada"), Caller::new("ada", [Scope::Read]));
        assert!(trust.caller("root").is_admin());
    }

    #[test]
    fn a_prefix_is_a_plain_path() {
        for (text, read) in [
            ("", ""),
            ("/", ""),
            ("/a", "/a"),
            ("/lab/signorini/", "/lab/signorini"),
        ] {
            assert_eq!(path_prefix(text), Ok(read.into()));
        }
        for wrong in [
            "a", "//a", "/a//b", "/..", "/a/../b", "/a b", "/a?b", "http://a",
        ] {
            assert!(path_prefix(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_origin_has_a_scheme_and_a_host_and_nothing_else() {
        assert_eq!(
            origin("https://Lab.example:8443"),
            Ok("https://lab.example:8443".into())
        );
        for wrong in [
            "*",
            "lab.example",
            "https://",
            "https://lab.example/",
            "ftp://lab",
            "null",
            "https://*.lab",
        ] {
            assert!(origin(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn an_address_is_a_number_or_a_name_with_a_port() {
        assert_eq!(address("127.0.0.1:80"), Ok(([127, 0, 0, 1], 80).into()));
        assert!(address("localhost:80").is_ok_and(|found| found.ip().is_loopback()));
        for wrong in ["localhost", "127.0.0.1", "127.0.0.1:99999", ""] {
            let told = address(wrong);
            assert!(
                told.is_err_and(|text| text.contains("127.0.0.1:8080")),
                "{wrong}"
            );
        }
    }
}
