//! Single attempts and searches, alone and over gRPC. `cargo bench -p grasp-tests --bench attempts`; `-- find` measures the
//! benchmarks with this in their name.

mod attempt;
mod round_trip;

criterion::criterion_main!(attempt::benches, round_trip::benches);
