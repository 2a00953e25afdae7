//! Integration tests of the client, over real gRPC.

#[cfg(feature = "cli")]
mod cli;
#[cfg(feature = "cli")]
mod experiments;
mod library;
#[cfg(feature = "cli")]
mod real_server;
mod scripted;
