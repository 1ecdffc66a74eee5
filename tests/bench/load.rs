//! Sends one request over and over, on several connections that stay open, and measures the answers.
//!
//! ```text
//! load ADDRESS CONNECTIONS ANSWERS < request
//! ```
//!
//! The request comes as the bytes of HTTP/1.1 on standard input; what was measured goes to standard
//! output as a line of JSON. A generator that is written in Python would need more of the machine than
//! the service that it measures.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::{
    collections::BTreeMap,
    io::Read,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Instant,
};

use serde_json::json;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::TcpStream,
    task::JoinSet,
};

#[tokio::main(flavor = "current_thread")]
async fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [address, connections, answers] = &arguments[..] else {
        panic!("load ADDRESS CONNECTIONS ANSWERS < request");
    };
    let mut request = vec![];
    std::io::stdin().read_to_end(&mut request).unwrap();
    let request: Arc<[u8]> = request.into();
    let left = Arc::new(AtomicI64::new(answers.parse().unwrap()));

    let start = Instant::now();
    let mut clients = JoinSet::new();
    for _ in 0..connections.parse().unwrap() {
        clients.spawn(ask(address.clone(), request.clone(), left.clone()));
    }
    let (mut spans_ms, mut statuses) = (vec![], BTreeMap::<String, u64>::new());
    while let Some(client) = clients.join_next().await {
        for (status, span_ms) in client.unwrap() {
            *statuses.entry(status).or_default() += 1;
            spans_ms.push(span_ms);
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    spans_ms.sort_by(f64::total_cmp);
    let share = |q: f64| spans_ms[((spans_ms.len() as f64 * q).ceil() as usize).max(1) - 1];
    println!(
        "{}",
        json!({ "answers": spans_ms.len(), "seconds": seconds, "statuses": statuses,
                "p50_ms": share(0.5), "p99_ms": share(0.99), "max_ms": share(1.0) })
    );
}

/// One client: the status of each answer, and the milliseconds that it took.
async fn ask(address: String, request: Arc<[u8]>, left: Arc<AtomicI64>) -> Vec<(String, f64)> {
    let mut connection = TcpStream::connect(address).await.unwrap();
    connection.set_nodelay(true).unwrap();
    let (mut found, mut buffer) = (vec![], vec![]);
    while left.fetch_sub(1, Ordering::Relaxed) > 0 {
        let start = Instant::now();
        connection.write_all(&request).await.unwrap();
        buffer.clear();
        let length = loop {
            assert!(
                connection.read_buf(&mut buffer).await.unwrap() > 0,
                "the connection was closed"
            );
            if let Some(length) = length(&buffer) {
                break length;
            }
        };
        while buffer.len() < length {
            assert!(
                connection.read_buf(&mut buffer).await.unwrap() > 0,
                "the answer broke off"
            );
        }
        let status = String::from_utf8_lossy(&buffer[9..12]).into_owned();
        found.push((status, start.elapsed().as_secs_f64() * 1e3));
    }
    found
}

/// Bytes of the answer that begins here, head included, once its head is complete.
fn length(answer: &[u8]) -> Option<usize> {
    let end = answer.windows(4).position(|bytes| bytes == b"\r\n\r\n")?;
    let head = String::from_utf8_lossy(&answer[..end]).to_ascii_lowercase();
    let body = head
        .lines()
        .find_map(|line| line.strip_prefix("content-length:"));
    let body: usize = body
        .expect("an answer with its length")
        .trim()
        .parse()
        .unwrap();
    Some(end + 4 + body)
}
