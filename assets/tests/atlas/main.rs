//! Atlases of the built-in objects and hands: grown, written, read.

mod codec;
mod exclusion;
mod looking;
mod mechanisms;
mod palm;
mod recent;
mod shortlist;
mod sparing;
mod starts;
mod support;
