//! Tests of physical validity.

mod balance;
mod closing;
mod closure;
mod support;
