//! An HTTP client for a running service.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Context, ensure};
use clap::Args;
use reqwest::{Certificate, Client};

/// A connection is made in this time, or not at all.
const CONNECT: Duration = Duration::from_secs(10);
/// A service that waits for the end of a job, or streams its events, says something at least every 30 s.
const SILENCE: Duration = Duration::from_secs(90);

/// Whom a client command trusts.
#[derive(Debug, Args)]
pub(super) struct Trust {
    /// File of the certificates, as PEM, of the authority that issued the service's; with https:// [default: those that this
    /// machine trusts]
    #[arg(long, env = "SIGNORINI_CA", value_name = "FILE")]
    ca: Option<PathBuf>,
}

impl Trust {
    /// A client for the service at this address.
    pub(super) fn client(&self, url: &str) -> anyhow::Result<Client> {
        let scheme = url.get(..8).map(str::to_ascii_lowercase);
        match (&self.ca, scheme.as_deref()) {
            (Some(file), _) => build(Some(authorities(file)?)),
            // the machine's, which it need not have
            (None, Some("https://")) => build(None),
            (None, _) => build(Some(vec![])),
        }
    }
}

/// A client for the service on this machine, whatever certificate it shows: only for what is no secret.
pub(super) fn local() -> anyhow::Result<Client> {
    provide();
    // a local address, which a proxy from the environment could not reach
    let builder = Client::builder().no_proxy().tls_certs_only([]);
    Ok(builder.tls_danger_accept_invalid_certs(true).build()?)
}

fn build(authorities: Option<Vec<Certificate>>) -> anyhow::Result<Client> {
    provide();
    let builder = match authorities {
        Some(only) => Client::builder().tls_certs_only(only),
        None => Client::builder(),
    };
    builder
        .connect_timeout(CONNECT)
        .read_timeout(SILENCE)
        .build()
        .context("a client with TLS cannot be made; --ca names the authority to trust")
}

/// `reqwest` asks for the process's provider of cryptography, whether it speaks TLS or not.
fn provide() {
    // an error says that there is one already
    let _ = rustls::crypto::ring::default_provider().install_default();
}

fn authorities(file: &Path) -> anyhow::Result<Vec<Certificate>> {
    let shown = file.display();
    let text = std::fs::read(file).with_context(|| format!("--ca {shown} cannot be read"))?;
    let found = Certificate::from_pem_bundle(&text)
        .with_context(|| format!("--ca {shown}: expected certificates as PEM"))?;
    ensure!(
        !found.is_empty(),
        "--ca {shown}: there is no certificate; expected PEM, with a line -----BEGIN CERTIFICATE-----"
    );
    Ok(found)
}
