//! Integration tests of the client, over real gRPC.

mod library;
mod scripted;
