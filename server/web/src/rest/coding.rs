//! Content codings of bodies, gzip and zstd (RFC 9110, 8.4): a coding is chosen for an answer, and undone for a request
//! within limits.

use std::{
    io,
    pin::Pin,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering::Relaxed},
    },
};

use async_compression::{
    Level,
    tokio::bufread::{GzipDecoder, GzipEncoder, ZstdDecoder, ZstdEncoder},
    zstd::DParameter,
};
use axum::{
    body::{Body, BodyDataStream, Bytes},
    http::{HeaderMap, header},
};
use futures_util::{Stream, StreamExt, TryStreamExt};
use service::{
    error::ApiError,
    transfer::{self, Received, Share},
};
use tokio::io::AsyncRead;
use tokio_util::io::{ReaderStream, StreamReader};

/// A supported coding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    Gzip,
    Zstd,
}

/// The names of the supported codings, for the refusal of a request with another one.
pub(super) const UNDERSTOOD: &str = "gzip, zstd";

/// The number of bytes that are encoded or decoded at once: few, so that one answer of very regular text does not
/// occupy a thread.
const PIECE_BYTES: usize = 8 << 10;
/// The largest window that a frame of zstd may request, as a power of two: the limit of RFC 9659 for HTTP.
const MOST_WINDOW_LOG: u32 = 23;
/// The largest ratio of the decoded size to the encoded size. Encoding makes the text of a mesh 3 to 20 times smaller;
/// a body with a higher ratio, apart from its first bytes, is no mesh, and costs its sender nothing.
const MOST_RATIO: usize = 32;
/// The number of first decoded bytes without a limit on the ratio, for a body that is collected in memory: the text of
/// jobs that differ in few numbers becomes much smaller.
pub(super) const FREE_COLLECTED: usize = 16 << 20;
/// The number of first decoded bytes without a limit on the ratio, for an upload, which goes to the disk.
pub(super) const FREE_UPLOADED: usize = 256 << 10;

/// A decoded body in pieces.
pub(super) type Pieces<'a> = Pin<Box<dyn Stream<Item = Result<Bytes, ApiError>> + Send + 'a>>;

/// The level of gzip for answers: level 1 takes little less time, and leaves half as much again.
const GZIP_LEVEL: Level = Level::Precise(2);

impl Coding {
    fn of(name: &str) -> Option<Coding> {
        let is = |known| name.eq_ignore_ascii_case(known);
        match () {
            () if is("gzip") || is("x-gzip") => Some(Coding::Gzip),
            () if is("zstd") => Some(Coding::Zstd),
            () => None,
        }
    }

    /// The name of the coding in headers.
    pub(super) fn name(self) -> &'static str {
        match self {
            Coding::Gzip => "gzip",
            Coding::Zstd => "zstd",
        }
    }

    /// The memory of an encoder (bytes), as measured for an answer of several MB.
    pub(super) fn encoder_bytes(self) -> usize {
        match self {
            Coding::Gzip => 420 << 10,
            Coding::Zstd => 1 << 20,
        }
    }

    /// The memory of a decoder without its window (bytes), as measured.
    fn decoder_bytes(self) -> usize {
        match self {
            Coding::Gzip => 80 << 10,
            Coding::Zstd => 256 << 10,
        }
    }

    /// The largest window of a decoder (bytes), which takes memory as it fills.
    fn window_bytes(self) -> usize {
        match self {
            Coding::Gzip => 0, // a part of the decoder
            Coding::Zstd => 1 << MOST_WINDOW_LOG,
        }
    }

    /// The coding that the client prefers, zstd if both are equal; `*` is gzip, and the weight 0 refuses a coding (RFC
    /// 9110, 12.5.3). `None`: no coding.
    pub(super) fn accepted(headers: &HeaderMap) -> Option<Coding> {
        let (gzip, zstd) = Coding::weights(headers);
        if zstd >= gzip {
            (zstd > 0.0).then_some(Coding::Zstd)
        } else {
            Some(Coding::Gzip)
        }
    }

    /// The weights that the client gives gzip and zstd.
    fn weights(headers: &HeaderMap) -> (f32, f32) {
        let (mut gzip, mut zstd, mut any) = (None, None, 0.0);
        let values = headers.get_all(header::ACCEPT_ENCODING).iter();
        let items = values.filter_map(|value| value.to_str().ok());
        for item in items.flat_map(|text| text.split(',')) {
            let mut parts = item.split(';').map(str::trim);
            let name = parts.next().unwrap_or_default();
            let weight = parts.find_map(|part| part.strip_prefix("q=").or(part.strip_prefix("Q=")));
            let weight = weight.map_or(1.0, |weight| weight.parse::<f32>().unwrap_or(1.0));
            match Coding::of(name) {
                Some(Coding::Gzip) => gzip = Some(weight),
                Some(Coding::Zstd) => zstd = Some(weight),
                None if name == "*" => any = weight,
                None => {}
            }
        }
        (gzip.unwrap_or(any), zstd.unwrap_or(0.0))
    }

    /// Whether the client accepts gzip.
    pub(super) fn accepts_gzip(headers: &HeaderMap) -> bool {
        Coding::weights(headers).0 > 0.0
    }

    /// Encodes a body in this coding as it is sent. `share` is the memory of the encoder, and is given back with the
    /// encoder.
    pub(super) fn encoded(self, body: Body, share: Share) -> Body {
        let reader = StreamReader::new(body.into_data_stream().map_err(io::Error::other));
        match self {
            Coding::Gzip => from_reader(GzipEncoder::with_quality(reader, GZIP_LEVEL), share),
            Coding::Zstd => from_reader(ZstdEncoder::with_quality(reader, Level::Fastest), share),
        }
    }
}

fn from_reader(reader: impl AsyncRead + Send + 'static, share: Share) -> Body {
    let pieces = ReaderStream::with_capacity(reader, PIECE_BYTES);
    Body::from_stream(pieces.map(move |piece| {
        let _held = &share;
        piece
    }))
}

/// Decodes the body of a request. The caller limits the decoded bytes; in addition, after the first `free` decoded
/// bytes there may be at most `MOST_RATIO` more for each byte that has arrived. The decoder's memory counts for the
/// limit of `received` while it exists. An error if the coding is not supported, or if there are several.
pub(super) fn decoded<'a>(
    headers: &HeaderMap,
    body: &'a mut BodyDataStream,
    received: &Received,
    free: usize,
) -> Result<Pieces<'a>, ApiError> {
    let named = headers.get_all(header::CONTENT_ENCODING).iter();
    let named: Vec<_> = named
        .map(|value| String::from_utf8_lossy(value.as_bytes()))
        .filter(|name| !name.eq_ignore_ascii_case("identity"))
        .collect();
    let Some(name) = named.first() else {
        return Ok(Box::pin(body.map_err(incomplete)));
    };
    let coding = Coding::of(name.trim()).filter(|_| named.len() == 1);
    let coding = coding.ok_or_else(|| ApiError::UnsupportedEncoding(named.join(", ")))?;
    let of_decoder = Received::new(received.limit());
    of_decoder.count(coding.decoder_bytes())?;
    let arrived = Arc::new(AtomicUsize::new(0));
    let counted = arrived.clone();
    let body = body.inspect_ok(move |piece| {
        counted.fetch_add(piece.len(), Relaxed);
    });
    let reader = StreamReader::new(body.map_err(io::Error::other));
    let reader: Pin<Box<dyn AsyncRead + Send>> = match coding {
        Coding::Gzip => {
            let mut decoder = GzipDecoder::new(reader);
            decoder.multiple_members(true);
            Box::pin(decoder)
        }
        Coding::Zstd => {
            let window = DParameter::window_log_max(MOST_WINDOW_LOG);
            let mut decoder = ZstdDecoder::with_params(reader, &[window]);
            decoder.multiple_members(true);
            Box::pin(decoder)
        }
    };
    let mut bytes = 0;
    let pieces = ReaderStream::with_capacity(reader, PIECE_BYTES).map(move |piece| {
        let piece = piece.map_err(|error| match error.downcast::<axum::Error>() {
            Ok(error) => incomplete(error),
            Err(error) => ApiError::MalformedJson(format!(
                "the body cannot be decoded by its Content-Encoding {}: {error}",
                coding.name()
            )),
        })?;
        let window = |bytes: usize| bytes.min(coding.window_bytes());
        of_decoder.count(window(bytes + piece.len()) - window(bytes))?;
        bytes += piece.len();
        if bytes > free + MOST_RATIO * arrived.load(Relaxed) {
            Err(ApiError::EncodedTooLarge { ratio: MOST_RATIO })
        } else {
            Ok(piece)
        }
    });
    Ok(Box::pin(pieces))
}

/// The error for a body that could not be read to its end.
fn incomplete(error: axum::Error) -> ApiError {
    transfer::cause(error)
        .unwrap_or_else(|error| ApiError::MalformedJson(format!("the body is incomplete: {error}")))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use service::transfer::Limit;

    #[test]
    fn an_encoding_is_chosen_as_the_rfc_specifies() {
        let chosen = |text: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::ACCEPT_ENCODING, text.parse().unwrap());
            Coding::accepted(&headers)
        };
        for gzip in [
            "gzip",
            "br, gzip;q=0.5",
            "GZIP",
            "*",
            "identity;q=0, *",
            "br;q=1,*;q=0.1",
            "zstd;q=0.5, gzip",
            "zstd;q=0, *",
        ] {
            assert_eq!(chosen(gzip), Some(Coding::Gzip), "{gzip}");
        }
        for zstd in ["zstd", "gzip, deflate, br, zstd", "gzip;q=0.5, Zstd;q=0.8"] {
            assert_eq!(chosen(zstd), Some(Coding::Zstd), "{zstd}");
        }
        for no in [
            "",
            "br",
            "identity",
            "gzip;q=0",
            "gzip;q=0.0, *",
            "*;q=0",
            "zstd;q=0",
        ] {
            assert_eq!(chosen(no), None, "{no}");
        }
        assert_eq!(Coding::accepted(&HeaderMap::new()), None);
    }

    /// Everything that is decoded, with this many free bytes.
    async fn all_of(body: Body, encoding: &str, free: usize) -> Result<Vec<u8>, ApiError> {
        let mut headers = HeaderMap::new();
        headers.insert(header::CONTENT_ENCODING, encoding.parse().unwrap());
        let mut body = body.into_data_stream();
        let received = Received::new(&Limit::new(64 << 20));
        let mut pieces = decoded(&headers, &mut body, &received, free)?;
        let mut found = vec![];
        while let Some(piece) = pieces.next().await {
            found.extend_from_slice(&piece?);
        }
        Ok(found)
    }

    async fn all(body: Body, encoding: &str) -> Result<Vec<u8>, ApiError> {
        all_of(body, encoding, FREE_COLLECTED).await
    }

    fn encoded(coding: Coding, content: impl Into<Body>) -> Body {
        let share = Limit::new(64 << 20).take(coding.encoder_bytes()).unwrap();
        coding.encoded(content.into(), share)
    }

    async fn bytes(body: Body) -> Vec<u8> {
        axum::body::to_bytes(body, usize::MAX)
            .await
            .unwrap()
            .to_vec()
    }

    #[tokio::test]
    async fn an_encoded_body_is_decoded_also_in_several_members() {
        let text: String = (0..20_000).map(|n| format!("{n},")).collect();
        for coding in [Coding::Gzip, Coding::Zstd] {
            let encoded = bytes(encoded(coding, text.clone())).await;
            assert!(
                encoded.len() < text.len() / 2,
                "{coding:?}: {}",
                encoded.len()
            );
            let twice = [&encoded[..], &encoded[..]].concat();
            let found = all(Body::from(twice), coding.name()).await.unwrap();
            assert_eq!(found, text.repeat(2).as_bytes());
            // cut off, or something else
            for wrong in [&encoded[..encoded.len() - 9], text.as_bytes()] {
                let error = all(Body::from(wrong.to_vec()), coding.name()).await;
                assert!(
                    matches!(error, Err(ApiError::MalformedJson(_))),
                    "{error:?}"
                );
            }
        }
    }

    #[tokio::test]
    async fn a_body_that_decompresses_to_many_times_its_size_is_refused() {
        for coding in [Coding::Gzip, Coding::Zstd] {
            for (kib, free, refused) in [
                (15 << 10, FREE_COLLECTED, false),
                (64 << 10, FREE_COLLECTED, true),
                (200, FREE_UPLOADED, false),
                (1 << 10, FREE_UPLOADED, true),
            ] {
                let body = bytes(encoded(coding, vec![b' '; kib << 10])).await;
                let found = all_of(Body::from(body), coding.name(), free).await;
                assert_eq!(
                    matches!(found, Err(ApiError::EncodedTooLarge { .. })),
                    refused,
                    "{coding:?}, {kib} KiB"
                );
            }
        }
        for unknown in ["br", "gzip, gzip", "deflate"] {
            let error = all(Body::empty(), unknown).await;
            assert!(
                matches!(error, Err(ApiError::UnsupportedEncoding(_))),
                "{error:?}"
            );
        }
    }

    /// The window of a decoder is counted as it fills: a frame that refers to its last 8 MiB, in blocks of four bytes
    /// that each repeat one byte 128 KiB times.
    #[tokio::test]
    async fn the_window_of_a_decoder_is_counted_as_it_fills() {
        let block = [&[0x02, 0, 0x10][..], b" "].concat();
        let frame = [&b"\x28\xb5\x2f\xfd\x00\x68"[..], &block.repeat(32)].concat();
        let mut headers = HeaderMap::new();
        headers.insert(header::CONTENT_ENCODING, "zstd".parse().unwrap());
        let limit = Limit::new(6 << 20);
        let received = Received::new(&limit);
        let open = || {
            // it stays open, as that of a sender who waits
            let sent = Bytes::from(frame.clone());
            let sent = futures_util::stream::iter([Ok::<_, axum::Error>(sent)]);
            Body::from_stream(sent.chain(futures_util::stream::pending())).into_data_stream()
        };
        let (mut first, mut second) = (open(), open());
        let mut pieces = decoded(&headers, &mut first, &received, FREE_COLLECTED).unwrap();
        let mut bytes = 0;
        while bytes < 4 << 20 {
            bytes += pieces.next().await.unwrap().unwrap().len();
        }
        let mut others = decoded(&headers, &mut second, &received, FREE_COLLECTED).unwrap();
        let refused = loop {
            if let Err(error) = others.next().await.unwrap() {
                break error;
            }
        };
        assert!(matches!(refused, ApiError::Overloaded));
        drop((pieces, others));
        assert!(limit.take(6 << 20).is_ok());
    }
}
