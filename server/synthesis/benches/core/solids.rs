//! Time per clearance query, in batches of fixed random queries: divide by the batch size, or read the throughput.
//!
//! "Touching" capsules are as close to the surface as those of a closed finger, "near" ones are within 3 cm, and
//! "deep" ones start inside the volume.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_synthesis::{
    geometry::{mesh_bvh::MeshBvh, tapered_capsule::TaperedCapsule},
    physical::solids::clearance,
};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::geometry::bar;

/// Queries per batch: more than a branch predictor can memorise.
const BATCH: usize = 4096;

fn random_capsules(surface: &MeshBvh, gaps: [f32; 2], deep: bool) -> Vec<TaperedCapsule> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let aabb = surface.aabb();
    let mut capsules = Vec::new();
    while capsules.len() < BATCH {
        let mut cube = || Vec3::from_array(std::array::from_fn(|_| random.random::<f32>() * 2.0 - 1.0));
        let start = aabb.centre() + cube() * (0.5 * aabb.extents() + 0.05);
        let direction = cube().normalize_or(Vec3::X);
        let radius = 0.007 + 0.003 * random.random::<f32>();
        let length = 0.015 + 0.03 * random.random::<f32>();
        let capsule = TaperedCapsule::new(start, start + direction * length, radius, radius * 0.85);
        let fits = if deep {
            surface.contains(start)
        } else {
            (gaps[0]..gaps[1]).contains(&clearance(&capsule, surface, 1.0))
        };
        if fits {
            capsules.push(capsule);
        }
    }
    capsules
}

fn clearances(criterion: &mut Criterion) {
    let surface = MeshBvh::build(bar(0.0025));
    let mut group = criterion.benchmark_group("clearance");
    group.throughput(Throughput::Elements(BATCH as u64));
    for (name, gaps, deep, limit) in [
        ("touching", [-0.002, 0.002], false, 1.0),
        ("touching, limit 2 mm", [-0.002, 0.002], false, 0.002),
        ("near", [0.002, 0.03], false, 1.0),
        ("near, limit 2 mm", [0.002, 0.03], false, 0.002),
        ("deep", [0.0, 0.0], true, 1.0),
    ] {
        let capsules = random_capsules(&surface, gaps, deep);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for capsule in &capsules {
                    black_box(clearance(black_box(capsule), &surface, limit));
                }
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(std::time::Duration::from_millis(300)).measurement_time(std::time::Duration::from_secs(1));
    targets = clearances
}
