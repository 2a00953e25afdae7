//! Input for parsers that end early when nobody waits for the mesh any more.

use std::io::{self, BufRead, Read};

use grasp_synthesis::base::stop::{Stop, Stopped};

use crate::error::ImportError;

/// Bytes that a parser gets between two checks: less than a millisecond of work.
const BYTES_PER_CHECK: usize = 1 << 14;

/// Bytes that fail to be read once they are to be no more.
pub(crate) struct Stoppable<'a> {
    bytes: &'a [u8],
    stop: Stop<'a>,
}

impl<'a> Stoppable<'a> {
    pub(crate) fn new(bytes: &'a [u8], stop: Stop<'a>) -> Self {
        Self { bytes, stop }
    }
}

impl Read for Stoppable<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Stoppable<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.stop.check().map_err(io::Error::other)?;
        Ok(&self.bytes[..self.bytes.len().min(BYTES_PER_CHECK)])
    }

    fn consume(&mut self, count: usize) {
        self.bytes = &self.bytes[count.min(self.bytes.len())..];
    }
}

/// The only error of a reader that was stopped.
pub(crate) fn stopped(_: Stopped) -> Vec<ImportError> {
    vec![ImportError::Stopped]
}
