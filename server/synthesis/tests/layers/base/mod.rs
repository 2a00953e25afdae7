//! The random streams of attempts.

mod attempt_streams;
