//! Makes HTTP clients for a running service.

use std::{
    ffi::OsString,
    fmt::{self, Display, Formatter},
    net::IpAddr,
    path::Path,
    time::Duration,
};

use anyhow::{Context, ensure};
use axum::http::Uri;
use clap::{Args, builder::OsStringValueParser};
use hyper_util::client::proxy::matcher::Matcher;
use reqwest::Client;
use rustls::{
    ClientConfig,
    pki_types::{CertificateDer, pem::PemObject},
};
use rustls_platform_verifier::ConfigVerifierExt;

use super::pinned;

/// The longest time for making a connection.
const CONNECT: Duration = Duration::from_secs(10);
/// The name and version of this program, which requests send to the service.
const PROGRAM: &str = concat!("signorini/", env!("CARGO_PKG_VERSION"));
/// The longest silence of a service that waits for the end of a job or streams its events: such a service sends
/// something at least every 30 s.
const SILENCE: Duration = Duration::from_secs(90);

/// The certificates that a client command trusts.
#[derive(Debug, Args)]
pub(super) struct Trust {
    /// PEM file of the certificates of the authority that issued the service's certificate, or of the service's own
    /// certificate; with https:// [default: the certificates that this machine trusts]
    #[arg(long, env = "SIGNORINI_CA", value_name = "FILE", value_parser = OsStringValueParser::new())]
    ca: Option<OsString>,
}

/// A client, and the proxy from the environment through which it reaches the service.
#[derive(Debug)]
pub(super) struct Way {
    pub(super) client: Client,
    pub(super) proxy: Option<Proxy>,
}

/// The address of a proxy that an environment variable names, without user name and password.
#[derive(Clone, Debug)]
pub(super) struct Proxy(String);

impl Display for Proxy {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Proxy(address) = self;
        write!(
            f,
            "the proxy {address} (of http_proxy, https_proxy or all_proxy; no_proxy names what is reached without it)"
        )
    }
}

impl Trust {
    /// Makes a TLS configuration for connections of HTTP/2 to the service.
    pub(super) fn http2(&self) -> anyhow::Result<ClientConfig> {
        provide();
        let mut config = match self.ca.as_deref() {
            Some(file) => pinned::trusting(authorities(file.as_ref())?)?,
            None => ClientConfig::with_platform_verifier()
                .context("TLS cannot be set up; --ca names the authority to trust")?,
        };
        config.alpn_protocols = vec![b"h2".to_vec()];
        Ok(config)
    }

    /// Makes a client for the service at this address.
    pub(super) fn client(&self, url: &str) -> anyhow::Result<Way> {
        provide();
        let scheme = url.get(..8).map(str::to_ascii_lowercase);
        let builder = match (self.ca.as_deref(), scheme.as_deref()) {
            (Some(file), _) => Client::builder()
                .tls_backend_preconfigured(pinned::trusting(authorities(file.as_ref())?)?),
            // the machine's, which it need not have
            (None, Some("https://")) => Client::builder(),
            (None, _) => Client::builder().tls_certs_only([]),
        };
        let proxy = proxy_to(url);
        // what is on this machine a proxy could not reach, and it would be told the token
        let builder = match proxy {
            Some(_) => builder,
            None => builder.no_proxy(),
        };
        let client = builder
            .user_agent(PROGRAM)
            .connect_timeout(CONNECT)
            .read_timeout(SILENCE)
            .build()
            .context("TLS cannot be set up; --ca names the authority to trust")?;
        Ok(Way { client, proxy })
    }
}

/// The proxy that the environment names for this address; `None` if it names none, or the address is on this machine.
fn proxy_to(url: &str) -> Option<Proxy> {
    let url: Uri = url.parse().ok()?;
    if url.host().is_none_or(is_this_machine) {
        return None;
    }
    let through = Matcher::from_env().intercept(&url)?;
    let (scheme, authority) = (through.uri().scheme_str()?, through.uri().authority()?);
    let host = authority.as_str().rsplit('@').next()?;
    Some(Proxy(format!("{scheme}://{host}")))
}

fn is_this_machine(host: &str) -> bool {
    let host = host.trim_end_matches('.').to_ascii_lowercase();
    let number = host
        .strip_prefix('[')
        .and_then(|host| host.strip_suffix(']'));
    let number = number.unwrap_or(&host).parse::<IpAddr>();
    host == "localhost"
        || host.ends_with(".localhost")
        || number.is_ok_and(|ip| ip.to_canonical().is_loopback())
}

/// Makes a client for the service on this machine that accepts any certificate: only for data that are not secret.
pub(super) fn local() -> anyhow::Result<Client> {
    provide();
    // a local address, which a proxy from the environment could not reach
    let builder = Client::builder().no_proxy().tls_certs_only([]);
    Ok(builder.tls_danger_accept_invalid_certs(true).build()?)
}

/// Installs the process's provider of cryptography, which `reqwest` requires with or without TLS.
fn provide() {
    // an error says that there is one already
    let _ = rustls::crypto::ring::default_provider().install_default();
}

fn authorities(file: &Path) -> anyhow::Result<Vec<CertificateDer<'static>>> {
    let shown = file.display();
    let text = std::fs::read(file).with_context(|| format!("--ca {shown} cannot be read"))?;
    let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&text).collect();
    let found = found.with_context(|| format!("--ca {shown}: expected certificates as PEM"))?;
    ensure!(
        !found.is_empty(),
        "--ca {shown}: found no certificate; expected PEM, with a line -----BEGIN CERTIFICATE-----"
    );
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_is_reached_without_a_proxy() {
        for own in [
            "localhost",
            "LOCALHOST.",
            "a.localhost",
            "127.0.0.1",
            "127.1.2.3",
            "[::1]",
            "[::ffff:127.0.0.1]",
        ] {
            assert!(is_this_machine(own), "{own}");
        }
        for other in [
            "lab.example",
            "10.0.0.1",
            "[::2]",
            "localhost.example",
            "127.0.0.1.example",
        ] {
            assert!(!is_this_machine(other), "{other}");
        }
    }
}
