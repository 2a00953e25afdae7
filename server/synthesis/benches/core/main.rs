//! Steps of a search, each alone. `cargo bench -p grasp-synthesis`; `-- current` measures the benchmarks with this in their name.

mod geometry;
mod grips;

criterion::criterion_main!(geometry::benches, grips::benches);
