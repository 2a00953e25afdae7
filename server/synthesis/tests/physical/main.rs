//! Tests of physical validity.

mod balance;
mod closing;
mod closure;
mod prepared_hand;
mod support;
