//! TLS for connections: the handshake, and the certificate and its key, which can be read again while the service runs.

use parking_lot::RwLock;
use std::{
    fmt,
    fs::File,
    io::{self, IoSlice, Read},
    path::Path,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};

use base::time::Time;
use rustls::{
    ServerConfig,
    crypto::ring,
    pki_types::{CertificateDer, PrivateKeyDer, UnixTime, pem, pem::PemObject},
    sign::{CertifiedKey, SingleCertAndKey},
};
use service::{config::TlsFiles, error::ApiError};
use tokio::{
    io::{AsyncRead, AsyncWrite, AsyncWriteExt, ReadBuf},
    net::TcpStream,
};
use tokio_rustls::{TlsAcceptor, server::TlsStream};
use tracing::{info, warn};
use webpki::{EndEntityCert, KeyUsage};

/// The largest size of a file of certificates (bytes): such files have some kilobytes, but another file may have no
/// end.
const MOST_BYTES: u64 = 1 << 20;
/// How long before the end of a certificate's validity a warning about it is logged.
const SOON: Duration = Duration::from_secs(14 * 86400);
/// How often the expiry of the certificate is checked.
const DAY: Duration = Duration::from_secs(86400);

/// The certificate of the listener.
pub struct Tls {
    files: TlsFiles,
    in_use: RwLock<Arc<CertificateInUse>>,
}

/// A certificate, and the TLS configuration that uses it.
struct CertificateInUse {
    acceptor: TlsAcceptor,
    certificate: CertificateDer<'static>,
}

/// The error that the certificate or its key cannot be used, with the reason.
#[derive(Clone, Debug, thiserror::Error)]
#[error("--tls-cert, --tls-key: {0}")]
pub struct BadCertificate(String);

impl Tls {
    /// Reads the files of the certificate and its key. A certificate that has expired is used, with a warning: jobs
    /// continue, and clients notice that it has expired.
    pub fn read(files: TlsFiles) -> Result<Arc<Tls>, BadCertificate> {
        let read = CertificateInUse::read(&files)?;
        if let Err(bad) = read.check_time(UnixTime::now()) {
            warn!(error = %bad, "clients will refuse this service: {bad}");
        }
        Ok(Arc::new(Tls {
            files,
            in_use: RwLock::new(Arc::new(read)),
        }))
    }

    /// Reads the files of the certificate and its key again, for new connections; after an error the present
    /// certificate remains in use.
    pub fn reload(&self) -> Result<(), BadCertificate> {
        let read = CertificateInUse::read(&self.files)?;
        read.check_time(UnixTime::now())?;
        let mut current = self.in_use.write();
        *current = Arc::new(read);
        Ok(())
    }

    /// Logs a warning each day while the certificate has expired, or will expire soon. Never returns.
    pub async fn watch_expiry(&self) {
        loop {
            let (in_use, now) = (self.in_use(), UnixTime::now());
            let then = UnixTime::since_unix_epoch(Duration::from_secs(now.as_secs()) + SOON);
            let of = in_use
                .check_time(now)
                .and_then(|()| in_use.check_time(then));
            if let Err(bad) = of {
                warn!(error = %bad, "renew the certificate, then send SIGHUP: {bad}");
            }
            tokio::time::sleep(DAY).await;
        }
    }

    fn in_use(&self) -> Arc<CertificateInUse> {
        let current = self.in_use.read();
        current.clone()
    }

    /// Performs the TLS handshake; an error if the client does not complete it.
    pub(super) async fn accept(&self, mut stream: TcpStream) -> io::Result<Stream> {
        const HANDSHAKE: u8 = 22;
        let mut first = [0];
        if stream.peek(&mut first).await? > 0 && first[0] != HANDSHAKE {
            refuse_plain(&mut stream).await?;
            return Err(io::Error::other("the client does not speak TLS"));
        }
        let stream = self.in_use().acceptor.accept(stream).await?;
        Ok(Stream::Tls(Box::new(stream)))
    }
}

/// Answers a client that speaks plain HTTP with a readable error.
async fn refuse_plain(stream: &mut TcpStream) -> io::Result<()> {
    let error = ApiError::BadRequest("this port speaks TLS: use https:// in its address".into());
    let document = error.document("").to_string();
    let head = format!(
        "HTTP/1.1 400 Bad Request\r\ncontent-type: application/problem+json\r\ncontent-length: {}\r\n\
         connection: close\r\n\r\n",
        document.len()
    );
    stream.write_all((head + &document).as_bytes()).await?;
    // What was not read would make the system reset the connection, and discard the answer. One read is enough for a
    // request without a body.
    let mut rest = [0; 4096];
    let _ = stream.try_read(&mut rest)?;
    stream.shutdown().await
}

impl CertificateInUse {
    fn read(files: &TlsFiles) -> Result<CertificateInUse, BadCertificate> {
        let (chain, key) = (certificates(&files.cert)?, private_key(&files.key)?);
        let (cert, key_file) = (files.cert.display(), files.key.display());
        let certificate = chain[0].clone();
        if let Err(error) = EndEntityCert::try_from(&certificate) {
            return Err(BadCertificate(format!(
                "the first certificate of {cert} cannot be used: {error}"
            )));
        }
        let provider = ring::default_provider();
        let pair = CertifiedKey::from_der(chain, key, &provider).map_err(|error| {
            let told = match error {
                rustls::Error::InconsistentKeys(_) => format!(
                    "the key in {key_file} is not that of the first certificate in {cert}; the certificate of the service \
                     comes first, those of its issuers after it"
                ),
                other => format!("the key in {key_file} cannot be used: {other}"),
            };
            BadCertificate(told)
        })?;
        let config = ServerConfig::builder_with_provider(Arc::new(provider))
            .with_safe_default_protocol_versions()
            .map_err(|error| BadCertificate(error.to_string()))?;
        let mut config = config
            .with_no_client_auth()
            .with_cert_resolver(Arc::new(SingleCertAndKey::from(pair)));
        config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
        Ok(CertificateInUse {
            acceptor: TlsAcceptor::from(Arc::new(config)),
            certificate,
        })
    }

    /// An error if the certificate is not valid at this time.
    fn check_time(&self, time: UnixTime) -> Result<(), BadCertificate> {
        let shown = |time: UnixTime| {
            let micros = time.as_secs().saturating_mul(1_000_000);
            Time::from_micros(i64::try_from(micros).unwrap_or(i64::MAX))
        };
        let Ok(certificate) = EndEntityCert::try_from(&self.certificate) else {
            return Ok(());
        };
        // Nobody is trusted here, so that the path never ends well; but the time is looked at first.
        let usage = KeyUsage::server_auth();
        let algorithms = webpki::ALL_VERIFICATION_ALGS;
        match certificate.verify_for_usage(algorithms, &[], &[], time, usage, None, None) {
            Err(webpki::Error::CertExpired { not_after, .. }) => Err(BadCertificate(format!(
                "the certificate expires {}",
                shown(not_after)
            ))),
            Err(webpki::Error::CertNotValidYet { not_before, .. }) => Err(BadCertificate(format!(
                "the certificate is not valid before {}",
                shown(not_before)
            ))),
            Err(webpki::Error::InvalidCertValidity) => Err(BadCertificate(
                "the certificate ends before it begins".to_owned(),
            )),
            _ => Ok(()),
        }
    }
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, BadCertificate> {
    let text = read(path)?;
    let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&text).collect();
    let found = found.map_err(|error| bad_pem(path, &error))?;
    if found.is_empty() {
        Err(BadCertificate(format!(
            "found no certificate in {}; expected PEM, with a line -----BEGIN CERTIFICATE-----",
            path.display()
        )))
    } else {
        Ok(found)
    }
}

fn private_key(path: &Path) -> Result<PrivateKeyDer<'static>, BadCertificate> {
    let text = read(path)?;
    let shown = path.display();
    match PrivateKeyDer::from_pem_slice(&text) {
        Ok(key) => Ok(key),
        Err(pem::Error::NoItemsFound) if text.windows(9).any(|bytes| bytes == b"ENCRYPTED") => {
            Err(BadCertificate(format!(
                "the key in {shown} is encrypted, and the service cannot ask for its password; decrypt it \
                 with openssl pkey -in {shown} -out plain.pem, readable for the service only"
            )))
        }
        Err(pem::Error::NoItemsFound) => Err(BadCertificate(format!(
            "found no private key in {shown}; expected PEM, with a line -----BEGIN PRIVATE KEY-----"
        ))),
        Err(error) => Err(bad_pem(path, &error)),
    }
}

fn bad_pem(path: &Path, error: &pem::Error) -> BadCertificate {
    BadCertificate(format!("{} is not PEM: {error}", path.display()))
}

fn read(path: &Path) -> Result<Vec<u8>, BadCertificate> {
    let mut text = vec![];
    let read = File::open(path).and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut text));
    let shown = path.display();
    match read {
        Ok(_) if text.len() as u64 > MOST_BYTES => Err(BadCertificate(format!(
            "{shown} has more than 1 MiB; expected certificates or a key as PEM"
        ))),
        Ok(_) => Ok(text),
        Err(error) => Err(BadCertificate(format!("{shown} cannot be read: {error}"))),
    }
}

/// Reads the files of the certificate again at every signal.
pub async fn reload_on(mut signals: tokio::signal::unix::Signal, tls: Arc<Tls>) {
    while signals.recv().await.is_some() {
        match tls.reload() {
            Ok(()) => info!("SIGHUP: the certificate was read again"),
            Err(bad) => {
                warn!(error = %bad, "SIGHUP: the previous certificate remains in use: {bad}")
            }
        }
    }
}

impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tls").field("files", &self.files).finish()
    }
}

/// The stream of a connection, encrypted or not. `tokio_util::either` is not used, since it writes the pieces of a
/// vectored write one by one.
pub(super) enum Stream {
    Plain(TcpStream),
    Tls(Box<TlsStream<TcpStream>>),
}

impl Stream {
    fn writer(self: Pin<&mut Self>) -> Pin<&mut (dyn AsyncWrite + Send + Unpin)> {
        match self.get_mut() {
            Stream::Plain(stream) => Pin::new(stream),
            Stream::Tls(stream) => Pin::new(stream.as_mut()),
        }
    }
}

impl AsyncRead for Stream {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match self.get_mut() {
            Stream::Plain(stream) => Pin::new(stream).poll_read(context, buffer),
            Stream::Tls(stream) => Pin::new(stream.as_mut()).poll_read(context, buffer),
        }
    }
}

impl AsyncWrite for Stream {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.writer().poll_write(context, bytes)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.writer().poll_write_vectored(context, pieces)
    }

    fn is_write_vectored(&self) -> bool {
        match self {
            Stream::Plain(stream) => stream.is_write_vectored(),
            Stream::Tls(stream) => stream.is_write_vectored(),
        }
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.writer().poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.writer().poll_shutdown(context)
    }
}
