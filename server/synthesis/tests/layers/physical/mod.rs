//! Physical validity: closing digits, hands as solids, force balance and closure.

mod balance;
mod barriers;
mod closing;
mod closure;
mod hand_solids;
