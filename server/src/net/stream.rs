//! A connection's bytes: watches for the preface and counts the frames of HTTP/2.

use std::{
    io,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_util::either::Either;

use super::{frames::FrameCount, reader::Reader};
use crate::{listen::Stream, tls::TlsStream};

/// A stream in the clear, or encrypted.
type PlainOrTls = Either<Stream, TlsStream<Stream>>;

const PREFACE: &[u8; 24] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// A connection's stream. Reading fails once the client has sent more frames than it may.
#[derive(Debug)]
pub(super) struct WatchedStream {
    stream: PlainOrTls,
    reader: Arc<Reader>,
    protocol: Protocol,
}

#[derive(Debug)]
enum Protocol {
    /// Not known yet: as many bytes of the preface have arrived.
    Unknown(usize),
    /// As many bytes are missing of the first ones.
    Http1(usize),
    Http2(FrameCount),
}

impl WatchedStream {
    pub(super) fn new(stream: PlainOrTls, reader: Arc<Reader>) -> Self {
        Self {
            stream,
            reader,
            protocol: Protocol::Unknown(0),
        }
    }

    fn watch(&mut self, mut read: &[u8]) -> io::Result<()> {
        if let Protocol::Unknown(arrived) = self.protocol {
            let expected = &PREFACE[arrived..];
            let compared = expected.len().min(read.len());
            if read[..compared] != expected[..compared] {
                self.protocol = Protocol::Http1(expected.len());
            } else if compared < expected.len() {
                self.protocol = Protocol::Unknown(arrived + compared);
            } else {
                self.reader.greeted();
                self.protocol = Protocol::Http2(FrameCount::default());
                read = &read[compared..];
            }
        }
        match &mut self.protocol {
            Protocol::Http1(missing @ 1..) => {
                *missing = missing.saturating_sub(read.len());
                if *missing == 0 {
                    self.reader.greeted();
                }
            }
            Protocol::Http2(count) => {
                let cost = count.cost(read);
                if !self.reader.spend_frames(cost) {
                    return Err(io::ErrorKind::ConnectionAborted.into());
                }
            }
            Protocol::Unknown(_) | Protocol::Http1(_) => {}
        }
        Ok(())
    }
}

impl AsyncRead for WatchedStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.stream).poll_read(cx, buffer))?;
        Poll::Ready(self.watch(&buffer.filled()[before..]))
    }
}

impl AsyncWrite for WatchedStream {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buffer: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, buffer)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffers: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write_vectored(cx, buffers)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
