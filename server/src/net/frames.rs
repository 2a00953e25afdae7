//! Bounds frames of HTTP/2 that lead to nothing: pings, settings, resets, windows, headers of calls that are reset, empty data. Each
//! costs the server more than its sender. A client has a budget of them, over all its connections, that grows with time and with
//! its answers; a connection that exceeds it is closed.

use std::time::{Duration, Instant};

use crate::sync::{Mutex, locked};

/// Frames that a client may send at once; a thousand new connections send some thousands.
const MAX_SAVED: u64 = 10_000;

/// Frames per second that a client may send without an answer: those of hundreds of calls that it cancels.
const PER_SECOND: u64 = 2_000;

/// Frames that an answered call is worth: headers, data, reset, and updates of windows.
pub(super) const PER_CALL: u64 = 8;

/// Frames that a part of an answer is worth: updates of windows, and the next message of a stream.
pub(super) const PER_PART: u64 = 4;

/// How long a call without an answer has to last to be worth as much as one with it.
pub(super) const CALL_TIME: Duration = Duration::from_millis(10);

/// Frames that a new connection costs.
pub(super) const PER_CONNECTION: u64 = 4;

/// Bytes of headers that cost as much as a frame.
const HEADER_BYTES: usize = 256;

/// Smallest data frame, or chunk of HTTP/1, that is free: others are of messages in small pieces.
pub(super) const MIN_DATA: usize = 256;

const FRAME_HEADER: usize = 9;
const DATA: u8 = 0;
const HEADERS: u8 = 1;
const CONTINUATION: u8 = 9;

/// The frames that a client may still send.
#[derive(Debug)]
pub(super) struct FrameBudget(Mutex<SavedFrames>);

#[derive(Debug)]
struct SavedFrames {
    frames: u64,
    /// When time was last counted.
    at: Instant,
}

impl FrameBudget {
    pub(super) fn new() -> Self {
        Self(Mutex::new(SavedFrames {
            frames: MAX_SAVED,
            at: Instant::now(),
        }))
    }

    /// Takes frames off the budget; false if it is exceeded.
    pub(super) fn spend(&self, frames: u64) -> bool {
        if frames == 0 {
            return true;
        }
        let mut saved = locked(&self.0);
        saved.grow(Instant::now());
        let rest = saved.frames.checked_sub(frames);
        saved.frames = rest.unwrap_or(0);
        rest.is_some()
    }

    /// Adds frames for an answer.
    pub(super) fn earn(&self, frames: u64) {
        let mut saved = locked(&self.0);
        saved.frames = (saved.frames + frames).min(MAX_SAVED);
    }

    /// True if nothing would be lost by starting anew.
    pub(super) fn is_full(&self) -> bool {
        let mut saved = locked(&self.0);
        saved.grow(Instant::now());
        saved.frames == MAX_SAVED
    }
}

impl SavedFrames {
    fn grow(&mut self, now: Instant) {
        const FRAME: Duration = Duration::from_micros(1_000_000 / PER_SECOND);
        let grown = now.saturating_duration_since(self.at).as_micros() / FRAME.as_micros();
        if grown >= u128::from(MAX_SAVED) {
            (self.frames, self.at) = (MAX_SAVED, now);
        } else {
            self.frames = (self.frames + grown as u64).min(MAX_SAVED);
            self.at += FRAME * grown as u32;
        }
    }
}

/// Follows the frames of a connection, whose bytes arrive in pieces of any size.
#[derive(Debug, Default)]
pub(super) struct FrameCount {
    /// The bytes of a frame's header that have arrived.
    header: [u8; FRAME_HEADER],
    arrived: usize,
    /// Bytes that are missing of the frame after its header.
    missing: usize,
}

impl FrameCount {
    /// The cost of the frames that begin in these bytes.
    pub(super) fn cost(&mut self, mut bytes: &[u8]) -> u64 {
        let mut cost = 0;
        while !bytes.is_empty() {
            let skipped = self.missing.min(bytes.len());
            self.missing -= skipped;
            bytes = &bytes[skipped..];
            let taken = bytes.len().min(FRAME_HEADER - self.arrived);
            self.header[self.arrived..self.arrived + taken].copy_from_slice(&bytes[..taken]);
            self.arrived += taken;
            bytes = &bytes[taken..];
            if self.arrived == FRAME_HEADER {
                let [a, b, c, kind, ..] = self.header;
                let length = u32::from_be_bytes([0, a, b, c]) as usize;
                cost += match kind {
                    DATA if length >= MIN_DATA => 0,
                    HEADERS | CONTINUATION => 1 + (length / HEADER_BYTES) as u64,
                    _ => 1,
                };
                (self.arrived, self.missing) = (0, length);
            }
        }
        cost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(kind: u8, length: usize) -> Vec<u8> {
        let [_, a, b, c] = u32::try_from(length).unwrap().to_be_bytes();
        let mut frame = vec![a, b, c, kind, 0, 0, 0, 0, 1];
        // Bytes that would be the header of another frame.
        frame.resize(FRAME_HEADER + length, 0);
        frame
    }

    #[test]
    fn frames_are_counted_in_pieces_of_any_size_and_full_data_is_free() {
        const PING: u8 = 6;
        let bytes = [
            frame(PING, 8),
            frame(DATA, MIN_DATA),
            frame(DATA, 0),
            frame(HEADERS, 2 * HEADER_BYTES),
            frame(CONTINUATION, 0),
            frame(77, 16 << 10),
            frame(PING, 8),
        ]
        .concat();
        for size in (1..=40).chain([bytes.len()]) {
            let mut count = FrameCount::default();
            let cost: u64 = bytes.chunks(size).map(|piece| count.cost(piece)).sum();
            assert_eq!(cost, 8, "pieces of {size}");
        }
    }

    #[test]
    fn a_budget_is_finite_and_grows_with_answers_and_time() {
        let budget = FrameBudget::new();
        assert!(budget.is_full());
        assert!(budget.spend(MAX_SAVED));
        assert!(!budget.is_full());
        assert!(!budget.spend(MAX_SAVED / 10));
        budget.earn(PER_CALL);
        assert!(budget.spend(PER_CALL));
        std::thread::sleep(Duration::from_millis(20));
        assert!(budget.spend(20 * PER_SECOND / 1000));
        budget.earn(2 * MAX_SAVED);
        assert!(budget.is_full());
    }
}
