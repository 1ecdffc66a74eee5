//! The page for people, at `/`: its files, which `server/web/page` has and the build collects. They are the same for
//! everybody; all data come by the API. The address of a file has the digest of all files, so that browsers may keep it
//! for ever, and a page never mixes the files of two versions.

use axum::{
    Router,
    extract::Path,
    http::{HeaderMap, HeaderName, header},
    response::{IntoResponse, Response},
    routing::get,
};
use service::error::ApiError;

use super::{
    call::{AppState, Call},
    coding::Coding,
    headers::Tags,
};

/// A file of the page.
struct PageFile {
    /// Its path in the folder of the page.
    path: &'static str,
    media: &'static str,
    content: &'static [u8],
    /// The content, compressed by gzip.
    gzip: &'static [u8],
}

// the files, their digest, and the page itself
include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// The route of the files.
pub(super) const FILES: &str = "/web/{digest}/{*path}";

/// The page loads files from this service and sends requests to it, and to no other.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
                      connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'";

/// The route of the files, which is no operation of the API.
pub(super) fn routes() -> Router<AppState> {
    Router::new().route(FILES, get(file))
}

/// The page itself, which names its files.
pub(super) async fn page(call: Call, _: Option<()>) -> Result<Response, ApiError> {
    let headers = [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-cache"),
        // with `no-referrer` a browser sends the log-in as one of no origin at all
        (header::REFERRER_POLICY, "same-origin"),
        (header::ETAG, PAGE_TAG),
    ];
    let known = Tags::of(&call.headers, "if-none-match");
    if known.is_some_and(|tags| tags.contain(PAGE_TAG)) {
        return Ok((axum::http::StatusCode::NOT_MODIFIED, headers).into_response());
    }
    let html = [(header::CONTENT_TYPE, "text/html; charset=utf-8")];
    Ok((headers, html, PAGE).into_response())
}

/// A file of the page; files of another version are not found, and the page then says that it is to be loaded again.
async fn file(
    Path((digest, path)): Path<(String, String)>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let mut all = CONTENT.iter().filter(|_| digest == DIGEST);
    let Some(file) = all.find(|file| file.path == path) else {
        return Err(ApiError::NotFound(format!(
            "the page has no file {path:?} in this version"
        )));
    };
    let known: [(HeaderName, &str); 3] = [
        (header::CONTENT_TYPE, file.media),
        (header::CACHE_CONTROL, "public, max-age=31536000, immutable"),
        (header::VARY, "Accept-Encoding"),
    ];
    if Coding::accepts_gzip(&headers) && file.gzip.len() < file.content.len() {
        let coded = [(header::CONTENT_ENCODING, "gzip")];
        return Ok((known, coded, file.gzip).into_response());
    }
    Ok((known, file.content).into_response())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::{collections::BTreeMap, fs, path::Path};

    use serde::Deserialize;
    use sha2::{Digest, Sha256};

    use super::*;

    /// A package of others in `server/web/page/vendor`, as `vendor.json` lists it.
    #[derive(Deserialize)]
    struct Package {
        version: String,
        licence: String,
        /// The digest of the package in its registry.
        integrity: String,
        /// The SHA-256 of each file that is kept, by its path in the package.
        files: BTreeMap<String, String>,
    }

    #[test]
    fn files_of_others_are_unmodified_and_have_their_licence() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("page/vendor");
        let list = fs::read_to_string(folder.join("vendor.json")).unwrap();
        let list: BTreeMap<String, Package> = serde_json::from_str(&list).unwrap();
        let mut listed = vec!["vendor.json".to_owned()];
        for (name, package) in &list {
            assert!(package.integrity.starts_with("sha512-") && !package.licence.is_empty());
            assert!(package.files.contains_key("LICENSE"), "{name}");
            for (file, digest) in &package.files {
                let path = format!("{name}-{}/{file}", package.version);
                let content = fs::read(folder.join(&path)).unwrap();
                let found = base::digest::hex(&Sha256::digest(&content));
                assert_eq!(found, *digest, "{path} differs from that of its package");
                listed.push(path);
            }
        }
        let mut found = vec![];
        collect(&folder, "", &mut found);
        listed.sort();
        found.sort();
        assert_eq!(found, listed);
    }

    fn collect(folder: &Path, path: &str, found: &mut Vec<String>) {
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{path}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                collect(&entry.path(), &format!("{name}/"), found);
            } else {
                found.push(name);
            }
        }
    }

    /// The first view loads the modules that the page names, and a new problem its editor.
    #[test]
    fn the_page_is_small() {
        let size = |path: &str| {
            let file = CONTENT.iter().find(|file| file.path == path);
            file.map_or(0, |file| file.gzip.len())
        };
        let (mut first, mut requests) = (PAGE.len(), 1);
        for part in PAGE.split("web/").skip(1) {
            let address = part.split('"').next().unwrap();
            let path = address.split_once('/').unwrap().1;
            assert!(size(path) > 0, "the page has no {path}");
            (first, requests) = (first + size(path), requests + 1);
        }
        assert!(first <= 120_000, "{first} bytes");
        assert!(requests <= 25, "{requests} requests");
        let editor = CONTENT.iter().filter(|file| file.path.contains("prism"));
        let editor: usize = editor.map(|file| file.gzip.len()).sum();
        assert!(editor <= 30_000, "{editor} bytes");
    }
}
