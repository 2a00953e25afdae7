//! Reading meshes and rigs from the bytes of clients.

mod formats;
mod obj;
mod repair;
mod rigs;
