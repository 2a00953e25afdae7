//! Steps of a search, each alone. `cargo bench -p grasp-synthesis`; `-- current` measures the benchmarks with this in their name.

mod current;
mod geometry;
mod grips;
mod immobility;
mod solids;

criterion::criterion_main!(
    geometry::benches,
    grips::benches,
    immobility::benches,
    solids::benches,
    current::benches
);
