//! Makes the built-in objects, hands and holdouts. A rerun gives identical bytes.

mod hands;
mod objects;

fn main() {
    objects::generate();
    hands::generate();
}
