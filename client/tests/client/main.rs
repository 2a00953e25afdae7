//! Integration tests of the client, over real gRPC.

#[cfg(feature = "cli")]
mod cli;
mod library;
mod scripted;
