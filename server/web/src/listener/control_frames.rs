//! Limits the control frames of HTTP/2, which carry no data, so that a client cannot flood the service with them.
//!
//! Each PING and SETTINGS requires an answer, each PRIORITY, WINDOW_UPDATE and empty DATA frame some work. The h2
//! library limits streams that are reset and headers that never end, but not these.

use tokio::time::Instant;

/// The bytes with which every connection over HTTP/2 begins.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// The largest number of control frames that a client may send at once.
const MOST: f64 = 1000.0;
/// The number of control frames per second that a client may send without requesting anything.
const PER_SECOND: f64 = 100.0;
/// The number of bytes sent to the client that allow one more control frame: a client acknowledges the answers that it
/// reads.
const BYTES_PER_FRAME: f64 = 64.0;

const DATA: u8 = 0;
const HEADERS: u8 = 1;
const END_STREAM: u8 = 1;

/// The limit of control frames for one connection.
#[derive(Debug)]
pub(super) struct ControlFrames {
    position: Position,
    /// How many more control frames the client may send now.
    credit: f64,
    counted: Instant,
}

/// The place in the protocol of the next byte that arrives.
#[derive(Debug)]
enum Position {
    /// Inside the preface, after this many bytes.
    Preface(usize),
    /// Inside the head of a frame, after this many bytes.
    Head([u8; 9], usize),
    /// Inside the content of a frame, with this many bytes left.
    Content(usize),
    /// The connection uses HTTP/1.
    NotHttp2,
}

impl ControlFrames {
    pub(super) fn new() -> Self {
        ControlFrames {
            position: Position::Preface(0),
            credit: MOST,
            counted: Instant::now(),
        }
    }

    /// Records that bytes were sent to the client.
    pub(super) fn sent(&mut self, bytes: usize) {
        self.credit = (self.credit + bytes as f64 / BYTES_PER_FRAME).min(MOST);
    }

    /// Records that bytes were received; false if they contain too many control frames.
    pub(super) fn received(&mut self, mut bytes: &[u8]) -> bool {
        let now = Instant::now();
        let time = now.duration_since(self.counted).as_secs_f64();
        self.credit = (self.credit + time * PER_SECOND).min(MOST);
        self.counted = now;
        while let Some((&first, rest)) = bytes.split_first() {
            match &mut self.position {
                Position::NotHttp2 => return true,
                Position::Preface(seen) => {
                    self.position = match PREFACE.get(*seen) {
                        Some(expected) if *expected != first => Position::NotHttp2,
                        _ if *seen + 1 == PREFACE.len() => Position::Head([0; 9], 0),
                        _ => Position::Preface(*seen + 1),
                    };
                    bytes = rest;
                }
                Position::Head(head, seen) => {
                    head[*seen] = first;
                    *seen += 1;
                    bytes = rest;
                    if *seen == head.len() {
                        let [a, b, c, kind, flags, ..] = *head;
                        let length = u32::from_be_bytes([0, a, b, c]) as usize;
                        let empty = length == 0 && flags & END_STREAM == 0;
                        if !matches!(kind, DATA | HEADERS) || (kind == DATA && empty) {
                            self.credit -= 1.0;
                        }
                        self.position = Position::Content(length);
                    }
                }
                Position::Content(left) => {
                    let here = bytes.len().min(*left);
                    *left -= here;
                    bytes = bytes.split_at(here).1;
                }
            }
            if let Position::Content(0) = self.position {
                self.position = Position::Head([0; 9], 0);
            }
        }
        self.credit >= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(kind: u8, flags: u8, content: &[u8]) -> Vec<u8> {
        let length = (content.len() as u32).to_be_bytes();
        let mut frame = length[1..].to_vec();
        frame.extend([kind, flags, 0, 0, 0, 1]);
        frame.extend(content);
        frame
    }

    fn connection() -> ControlFrames {
        let mut frames = ControlFrames::new();
        // in pieces, as a network may deliver it
        assert!(PREFACE.chunks(5).all(|piece| frames.received(piece)));
        frames
    }

    /// How many of these frames are accepted, in pieces of any size.
    fn accepted(frame: &[u8]) -> usize {
        let mut frames = connection();
        (0..5000)
            .take_while(|_| frame.chunks(7).all(|piece| frames.received(piece)))
            .count()
    }

    #[tokio::test(start_paused = true)]
    async fn a_flood_of_any_control_frame_is_refused() {
        for kind in [2, 3, 4, 6, 7, 8, 9, 77] {
            assert_eq!(accepted(&frame(kind, 0, &[0; 8])), 1000, "kind {kind}");
        }
        assert_eq!(accepted(&frame(DATA, 0, &[])), 1000);
    }

    #[tokio::test(start_paused = true)]
    async fn data_and_requests_are_no_flood() {
        for frame in [
            frame(DATA, 0, &[6; 100]),
            frame(DATA, END_STREAM, &[]),
            frame(HEADERS, 4, &[1; 20]),
        ] {
            assert_eq!(accepted(&frame), 5000);
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_client_that_reads_much_or_waits_may_send_more_frames() {
        let ping = frame(6, 0, &[0; 8]);
        let mut frames = connection();
        for _ in 0..5000 {
            frames.sent(64);
            assert!(frames.received(&ping));
        }
        for _ in 0..5000 {
            tokio::time::advance(tokio::time::Duration::from_millis(11)).await;
            assert!(frames.received(&ping));
        }
    }

    #[tokio::test]
    async fn http_1_has_no_frames() {
        let mut frames = ControlFrames::new();
        assert!(frames.received(b"PRINT / HTTP/1.1\r\n"));
        assert!(frames.received(&frame(6, 0, &[0; 8]).repeat(2000)));
    }
}
