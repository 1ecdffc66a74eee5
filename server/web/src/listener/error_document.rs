//! Adds the usual error document to errors that hyper answers by itself because the request cannot be read.

use axum::body::Bytes;
use service::error::ApiError;

/// hyper's answer `head` with an error document added; `None` if `head` is not an error without content, and so not
/// hyper's own answer.
pub(super) fn with_document(head: &[u8]) -> Option<Bytes> {
    let status = head.strip_prefix(b"HTTP/1.1 ")?.get(..3)?;
    let head = std::str::from_utf8(head).ok()?.to_ascii_lowercase();
    if !head.ends_with("\r\n\r\n") || head.contains("\r\ncontent-type:") {
        return None;
    }
    let error = [
        ApiError::BadRequest("the request cannot be read as HTTP".into()),
        ApiError::UriTooLong,
        ApiError::HeaderTooLarge,
    ]
    .into_iter()
    .find(|error| error.http_status().as_str().as_bytes() == status)?;
    let (status, document) = (error.http_status(), error.document("").to_string());
    let length = document.len();
    Some(Bytes::from(format!(
        "HTTP/1.1 {status}\r\ncontent-type: application/problem+json\r\ncontent-length: {length}\r\n\
         connection: close\r\n\r\n{document}"
    )))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn an_error_without_content_gets_its_document() {
        let bare = b"HTTP/1.1 431 Request Header Fields Too Large\r\ncontent-length: 0\r\nconnection: close\r\n\r\n";
        let text = String::from_utf8(with_document(bare).unwrap().to_vec()).unwrap();
        let (head, document) = text.split_once("\r\n\r\n").unwrap();
        assert!(head.starts_with("HTTP/1.1 431 Request Header Fields Too Large\r\n"));
        let length = format!("content-length: {}\r\n", document.len());
        assert!(head.contains(&length) && document.contains("header-too-large"));
    }

    #[test]
    fn other_answers_stay() {
        for other in [
            "HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n",
            "HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n",
            "HTTP/1.1 400 Bad Request\r\ncontent-type: application/problem+json\r\n\r\n",
            "HTTP/1.1 400 Bad Request\r\n",
            "data: 400",
        ] {
            assert_eq!(with_document(other.as_bytes()), None, "{other}");
        }
    }
}
