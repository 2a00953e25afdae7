//! Tests of the client library and its examples, over real gRPC.

mod examples;
mod library;
mod messages;
mod scripted;
