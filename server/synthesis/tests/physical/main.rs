//! Tests of physical validity.

mod balance;
mod closure;
mod support;
