//! Frames of HTTP/2 that carry no data: a client may send some, not a flood of them.
//!
//! Each PING and SETTINGS wants an answer, each PRIORITY, WINDOW_UPDATE and empty DATA frame some work. The h2 library
//! limits streams that are reset and headers that never end, but not these.

use tokio::time::Instant;

/// What every connection over HTTP/2 begins with.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
/// Control frames at once.
const MOST: f64 = 1000.0;
/// Control frames a second that a client may send without asking for anything.
const PER_SECOND: f64 = 100.0;
/// A client that reads answers may send more: it acknowledges what it reads. One frame for so many bytes sent.
const BYTES_PER_FRAME: f64 = 64.0;

const DATA: u8 = 0;
const HEADERS: u8 = 1;
const END_STREAM: u8 = 1;

/// The control frames of one connection.
#[derive(Debug)]
pub(super) struct ControlFrames {
    position: Position,
    /// How many more the client may send now.
    credit: f64,
    counted: Instant,
}

/// What the next byte belongs to.
#[derive(Debug)]
enum Position {
    /// The preface, of which so many bytes have arrived.
    Preface(usize),
    /// The head of a frame: so many of its bytes have arrived.
    Head([u8; 9], usize),
    /// The content of a frame: so many bytes are to come.
    Content(usize),
    /// A connection over HTTP/1.
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

    /// Bytes were sent to the client.
    pub(super) fn sent(&mut self, bytes: usize) {
        self.credit = (self.credit + bytes as f64 / BYTES_PER_FRAME).min(MOST);
    }

    /// Bytes were received from the client; false if they contain too many control frames.
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

    /// How many of these frames, in pieces of any size, are accepted.
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
    async fn who_reads_much_or_waits_may_send_more() {
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
