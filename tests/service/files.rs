//! Data as files: entity tags, digests, ranges; over gRPC chunks from any offset.

use base64::{Engine, engine::general_purpose::STANDARD};
use reqwest::StatusCode;
use rpc::pb;
use sha2::{Digest, Sha256};
use suite::harness::block;
use tonic::Code;

use crate::{grpc::connect, server};

/// Operations: StreamResult
#[tokio::test]
async fn ranges_of_fields_add_up_to_the_whole_file() {
    let server = server().await;
    let id = server.submit(&block(40, 40)).await;
    server.until_done(&id).await;
    let mut grpc = connect(&server).await;
    for (name, format) in [
        ("json", pb::FieldFormat::Json),
        ("vtu", pb::FieldFormat::Vtu),
        ("npz", pb::FieldFormat::Npz),
    ] {
        let path = format!("/v1/jobs/{id}/fields?format={name}");
        let response = server.get(&path).send().await.unwrap();
        let headers = response.headers().clone();
        let whole = response.bytes().await.unwrap();
        let digest = Sha256::digest(&whole);
        let word = format!("sha-256=:{}:", STANDARD.encode(digest));
        for name in ["content-digest", "repr-digest"] {
            assert_eq!(headers[name], word.as_str());
        }
        let tag = headers["etag"].to_str().unwrap();
        let range = async |range: &str, condition: &str| {
            let request = server
                .get(&path)
                .header("Range", range)
                .header("If-Range", condition);
            let response = request.send().await.unwrap();
            let status = response.status();
            let content = response
                .headers()
                .get("content-range")
                .map(|value| value.to_str().unwrap().to_owned());
            (status, content, response.bytes().await.unwrap())
        };
        let (mut joined, length) = (vec![], whole.len());
        assert!(
            length > 300_000 || name != "json",
            "more than one piece: {length}"
        );
        while joined.len() < length {
            let (first, last) = (joined.len(), joined.len() + 100_000);
            let (status, content, bytes) = range(&format!("bytes={first}-{last}"), tag).await;
            assert_eq!(status, StatusCode::PARTIAL_CONTENT);
            let last = last.min(length - 1);
            assert_eq!(content.unwrap(), format!("bytes {first}-{last}/{length}"));
            joined.extend_from_slice(&bytes);
        }
        assert_eq!(joined, whole, "{name}");
        let (status, content, _) = range(&format!("bytes={length}-"), tag).await;
        assert_eq!(status, StatusCode::RANGE_NOT_SATISFIABLE);
        assert_eq!(content.unwrap(), format!("bytes */{length}"));
        let (status, _, bytes) = range("bytes=5-6", "\"another\"").await;
        assert_eq!((status, bytes.len()), (StatusCode::OK, length));
        let known = server
            .get(&path)
            .header("If-None-Match", tag)
            .send()
            .await
            .unwrap();
        assert_eq!(known.status(), StatusCode::NOT_MODIFIED);

        for offset in [0, 1, 262_144, length as u64 - 1, length as u64] {
            let offset = offset.min(length as u64);
            let request = pb::StreamResultRequest {
                id: id.clone(),
                format: format.into(),
                offset,
                ..Default::default()
            };
            let mut pieces = grpc.stream_result(request).await.unwrap().into_inner();
            let mut place = offset;
            while let Some(piece) = pieces.message().await.unwrap() {
                assert!(piece.data.len() <= 256 << 10);
                assert_eq!((piece.offset, piece.total_bytes), (place, length as u64));
                assert_eq!(piece.sha256, digest.to_vec());
                let start = place as usize;
                assert_eq!(piece.data, whole[start..start + piece.data.len()]);
                place += piece.data.len() as u64;
            }
            assert_eq!(place, length as u64, "{name} from {offset}");
        }
        let request = pb::StreamResultRequest {
            id: id.clone(),
            format: format.into(),
            offset: length as u64 + 1,
            ..Default::default()
        };
        assert_eq!(
            grpc.stream_result(request).await.unwrap_err().code(),
            Code::OutOfRange
        );
    }
}

/// Operations: ListIterations, GetProfile
#[tokio::test]
async fn tables_have_tags_and_ranges_too() {
    let server = server().await;
    let id = server.submit(&suite::example_json("sheet")).await;
    server.until_done(&id).await;
    for path in ["profiles/taper?format=csv", "history?format=csv"] {
        let path = format!("/v1/jobs/{id}/{path}");
        let response = server.get(&path).send().await.unwrap();
        let tag = response.headers()["etag"].to_str().unwrap().to_owned();
        let known = server
            .get(&path)
            .header("If-None-Match", tag)
            .send()
            .await
            .unwrap();
        assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
        let part = server
            .get(&path)
            .header("Range", "bytes=0-0")
            .send()
            .await
            .unwrap();
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    }
}
