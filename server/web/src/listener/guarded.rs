//! The stream of a connection with checks: it records arriving data, limits HTTP/2 control frames, and adds error
//! documents to hyper's own answers.

use std::{
    io::{self, IoSlice},
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
};

use axum::body::Bytes;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use super::{activity::Activity, control_frames::ControlFrames, error_document, tls::Stream};

/// The stream of a connection, with checks.
pub(super) struct Guarded {
    stream: Stream,
    activity: Arc<Activity>,
    frames: ControlFrames,
    /// The rest of an answer with an error document, written in place of hyper's own answer.
    instead: Bytes,
}

impl Guarded {
    pub(super) fn new(stream: Stream, activity: Arc<Activity>) -> Guarded {
        Guarded {
            stream,
            activity,
            frames: ControlFrames::new(),
            instead: Bytes::new(),
        }
    }

    /// Writes the bytes of `instead`.
    fn poll_instead(&mut self, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        while !self.instead.is_empty() {
            let stream = Pin::new(&mut self.stream);
            match ready!(stream.poll_write(context, &self.instead))? {
                0 => return Poll::Ready(Err(io::ErrorKind::WriteZero.into())),
                written => drop(self.instead.split_to(written)),
            }
        }
        Poll::Ready(Ok(()))
    }

    /// hyper's answer `head` with an error document added, if hyper gave it by itself. Such an answer is the last one
    /// on its connection.
    fn document(&self, head: &[u8]) -> Option<Bytes> {
        // while a request is under way, this is a piece of its answer, whatever it looks like
        self.activity.idle_since()?;
        error_document::with_document(head)
    }
}

impl AsyncRead for Guarded {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(context, buffer))?;
        let received = buffer.filled().get(before..).unwrap_or_default();
        if !received.is_empty() {
            self.activity.received();
        }
        if self.frames.received(received) {
            Poll::Ready(Ok(()))
        } else {
            Poll::Ready(Err(io::Error::other("too many control frames")))
        }
    }
}

impl AsyncWrite for Guarded {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_instead(context))?;
        if let Some(document) = self.document(bytes) {
            self.instead = document;
            return Poll::Ready(Ok(bytes.len()));
        }
        let written = ready!(Pin::new(&mut self.stream).poll_write(context, bytes))?;
        self.frames.sent(written);
        Poll::Ready(Ok(written))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        pieces: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        ready!(self.poll_instead(context))?;
        if let [only] = pieces
            && let Some(document) = self.document(only)
        {
            self.instead = document;
            return Poll::Ready(Ok(only.len()));
        }
        let written = ready!(Pin::new(&mut self.stream).poll_write_vectored(context, pieces))?;
        self.frames.sent(written);
        Poll::Ready(Ok(written))
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_instead(context))?;
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.poll_instead(context))?;
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
