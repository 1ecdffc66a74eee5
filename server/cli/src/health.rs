//! The command `signorini health`.

use std::{
    net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr},
    path::PathBuf,
    time::Duration,
};

use anyhow::{Context, bail};
use clap::Args;
use service::config::address;

use super::{
    client::{self, Trust, Way},
    exit::Exit,
    output,
    settings::File,
};

/// The longest time to wait for the answer; the service itself takes two seconds at most.
const PATIENCE: Duration = Duration::from_secs(5);
/// The largest number of characters of the answer; an answer that is longer does not come from this program.
const MOST_CHARS: usize = 2000;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Address of the service, such as http://127.0.0.1:8080 [default: where `serve` listens on this machine]
    #[arg(long, env = "SIGNORINI_URL", value_name = "URL")]
    url: Option<String>,

    /// The address that `serve` listens on, if no --url is given
    #[arg(
        long,
        env = "SIGNORINI_LISTEN",
        default_value = "127.0.0.1:8080",
        value_name = "ADDRESS",
        value_parser = address
    )]
    listen: SocketAddr,

    /// The certificate of `serve`, if no --url is given: with it TLS is used. The certificate is not checked, since it
    /// need not name this machine, and nothing secret is sent
    #[arg(long, env = "SIGNORINI_TLS_CERT", value_name = "FILE")]
    tls_cert: Option<PathBuf>,

    #[command(flatten)]
    file: File,

    #[command(flatten)]
    trust: Trust,
}

/// Runs the command: prints the answer of `/readyz`.
pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let (way, url) = match arguments.url {
        Some(url) => (arguments.trust.client(&url)?, url),
        None => {
            let address = reachable(arguments.listen);
            let scheme = match arguments.tls_cert {
                Some(_) => "https",
                None => "http",
            };
            let proxy = None;
            let client = client::local()?;
            (Way { client, proxy }, format!("{scheme}://{address}"))
        }
    };
    let Way { client, proxy } = way;
    let url = format!("{}/readyz", url.trim_end_matches('/'));
    let unanswered = || match &proxy {
        Some(proxy) => format!("{url} does not answer through {proxy}"),
        None => format!("{url} does not answer"),
    };
    let request = client.get(&url).timeout(PATIENCE);
    let answer = request.send().await.with_context(unanswered)?;
    let status = answer.status();
    let text = answer.text().await.with_context(unanswered)?;
    let text: String = text.chars().take(MOST_CHARS).collect();
    if status.is_success() {
        output::print(&text)?
    } else {
        bail!("{url}: {status}: {}", text.trim_end())
    }
    Ok(Exit::Ok)
}

/// The address at which a service that listens on `address` is reached from its own machine.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => address.set_ip(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(ip) if ip.is_unspecified() => address.set_ip(Ipv6Addr::LOCALHOST.into()),
        _ => {}
    }
    address
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn all_interfaces_are_reached_by_the_own_one() {
        for (listen, reached) in [
            ("0.0.0.0:80", "127.0.0.1:80"),
            ("[::]:80", "[::1]:80"),
            ("10.0.0.1:80", "10.0.0.1:80"),
        ] {
            assert_eq!(reachable(listen.parse().unwrap()).to_string(), reached);
        }
    }
}
