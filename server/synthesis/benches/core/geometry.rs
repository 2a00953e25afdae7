//! Time per query, in batches of fixed random queries: divide by the batch size, or read the throughput.
//!
//! "Mixed" segments lie anywhere in a box 5 cm larger than the object, like those of a hand being placed; "near" ones
//! start within 15 mm of the surface, like those of a closing finger. Both are as long as a phalanx.

use std::{hint::black_box, time::Duration};

use criterion::{Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_assets::objects::object;
use grasp_synthesis::{
    geometry::{Segment, mesh::TriangleMesh, mesh_bvh::MeshBvh, tapered_capsule::TaperedCapsule},
    model::hand::Digit,
    physical::{
        immobility::{Buffers, Load, SoftContact, TorqueScale, balance, epsilon},
        solids::clearance,
    },
};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Queries per batch: more than a branch predictor can memorise.
const BATCH: usize = 8192;

/// Built-in objects: a light, thin one and a box.
const OBJECTS: [&str; 2] = ["scissors", "remote"];

/// The surface of a built-in object.
fn surface(name: &str) -> &'static MeshBvh {
    &object(name).expect("the object is built in").object.surface
}

struct Queries {
    mixed: Vec<Segment>,
    near: Vec<Segment>,
    /// Within about 8 cm of the surface.
    points: Vec<Vec3>,
    /// In the object's box.
    points_in_box: Vec<Vec3>,
}

fn queries(mesh: &TriangleMesh) -> Queries {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut between = |low: f32, high: f32| low + (high - low) * random.random::<f32>();
    let mut in_cube = || Vec3::new(between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0));
    let aabb = mesh.aabb();
    let half = aabb.extents() * 0.5;
    let mut queries = Queries {
        mixed: Vec::new(),
        near: Vec::new(),
        points: Vec::new(),
        points_in_box: Vec::new(),
    };
    for i in 0..BATCH {
        let along = in_cube().normalize_or(Vec3::X) * 0.03;
        let start = aabb.centre() + in_cube() * (half + 0.05);
        queries.mixed.push(Segment::new(start, start + along));
        let triangle = (i * 7919) % mesh.triangles().len();
        let start = mesh.corners(triangle)[0] + in_cube() * 0.015;
        queries.near.push(Segment::new(start, start + along));
        queries.points.push(aabb.centre() + in_cube() * (half + 0.06));
        queries.points_in_box.push(aabb.centre() + in_cube() * half);
    }
    queries
}

fn bench_queries(criterion: &mut Criterion) {
    for name in OBJECTS {
        let bvh = surface(name);
        let quick = MeshBvh::build_quick(bvh.mesh().clone());
        let queries = queries(bvh.mesh());
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(BATCH as u64));
        let mut segments = |id: &str, bvh: &MeshBvh, segments: &[Segment]| {
            group.bench_function(id, |bencher| {
                bencher.iter(|| {
                    segments
                        .iter()
                        .filter(|&&s| bvh.is_crossed_by(black_box(s)))
                        .count()
                });
            });
        };
        segments("is_crossed_by/mixed", bvh, &queries.mixed);
        segments("is_crossed_by/near", bvh, &queries.near);
        segments("is_crossed_by/near/quick", &quick, &queries.near);
        group.bench_function("first_hit/near", |bencher| {
            bencher.iter(|| {
                let hits = queries.near.iter().filter_map(|&s| bvh.first_hit(black_box(s)));
                hits.map(|hit| hit.distance).sum::<f32>()
            });
        });
        for (id, limit) in [
            ("closest_point_within/8 cm", 0.08),
            ("closest_point_within/1 cm", 0.01),
        ] {
            group.bench_function(id, |bencher| {
                bencher.iter(|| {
                    let points = queries.points.iter();
                    points
                        .filter_map(|&p| bvh.closest_point_within(black_box(p), limit))
                        .map(|closest| closest.distance)
                        .sum::<f32>()
                });
            });
        }
        group.bench_function("contains/in box", |bencher| {
            bencher.iter(|| {
                queries
                    .points_in_box
                    .iter()
                    .filter(|&&p| bvh.contains(black_box(p)))
                    .count()
            });
        });
        group.finish();
    }
}

/// Queries per batch: more than a branch predictor can memorise.
const CAPSULES: usize = 4096;

fn random_capsules(surface: &MeshBvh, gaps: [f32; 2]) -> Vec<TaperedCapsule> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(5);
    let aabb = surface.aabb();
    let mut capsules = Vec::new();
    while capsules.len() < CAPSULES {
        let mut cube = || Vec3::from_array(std::array::from_fn(|_| random.random::<f32>() * 2.0 - 1.0));
        let start = aabb.centre() + cube() * (0.5 * aabb.extents() + 0.05);
        let direction = cube().normalize_or(Vec3::X);
        let radius = 0.007 + 0.003 * random.random::<f32>();
        let length = 0.015 + 0.03 * random.random::<f32>();
        let capsule = TaperedCapsule::new(start, start + direction * length, radius, radius * 0.85);
        if (gaps[0]..gaps[1]).contains(&clearance(&capsule, surface, 1.0)) {
            capsules.push(capsule);
        }
    }
    capsules
}

fn clearances(criterion: &mut Criterion) {
    let surface = surface("remote");
    let mut group = criterion.benchmark_group("clearance");
    group.throughput(Throughput::Elements(CAPSULES as u64));
    for (name, gaps, limit) in [
        ("touching", [-0.002, 0.002], 1.0),
        ("near", [0.002, 0.03], 1.0),
        ("near, limit 2 mm", [0.002, 0.03], 0.002),
    ] {
        let capsules = random_capsules(surface, gaps);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for capsule in &capsules {
                    black_box(clearance(black_box(capsule), surface, limit));
                }
            });
        });
    }
    group.finish();
}

/// Grasps per batch: more than a branch predictor can memorise.
const GRASPS: usize = 512;

/// Required epsilon.
const REQUIRED: f32 = 0.03;

/// Contacts of a thumb opposed to fingers and palm on a bottle-like ellipsoid, scattered like those of posed hands.
fn grasps(count: usize) -> Vec<(Vec<SoftContact>, Load)> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(count as u64);
    let half = Vec3::new(0.03, 0.03, 0.09);
    let mut grasp = || {
        let mut around = || {
            Vec3::from_array([(); 3].map(|()| random.random::<f32>() * 2.0 - 1.0))
                .try_normalize()
                .unwrap_or(Vec3::X)
        };
        let up = around();
        let contacts: Vec<SoftContact> = (0..count)
            .map(|k| {
                let side = if k % 3 == 0 { Vec3::X } else { Vec3::NEG_X };
                let on_sphere = (side + around() * 0.7).normalize_or(Vec3::X);
                SoftContact {
                    position: on_sphere * half,
                    normal: (on_sphere / half).normalize_or(Vec3::X),
                    digit: Digit::ALL.get(k).copied(),
                    friction: 0.6,
                    torsion_radius: 0.004,
                }
            })
            .collect();
        let torque_scale = TorqueScale::of(&contacts);
        let load = Load {
            mass: 0.3,
            centre_of_mass: Vec3::ZERO,
            up,
            torque_scale,
        };
        (contacts, load)
    };
    (0..GRASPS).map(|_| grasp()).collect()
}

fn bench_immobility(criterion: &mut Criterion) {
    for count in [3, 5, 8] {
        let all = grasps(count);
        let mut buffers = Buffers::default();
        let (held, lost): (Vec<_>, Vec<_>) = all
            .iter()
            .cloned()
            .partition(|(contacts, load)| balance(contacts, load, &mut buffers).is_some());
        let mut group = criterion.benchmark_group(format!("immobility/{count} contacts"));
        for (name, grasps) in [("held", &held), ("lost", &lost)] {
            if grasps.is_empty() {
                continue;
            }
            group.throughput(Throughput::Elements(grasps.len() as u64));
            group.bench_function(format!("balance/{name}"), |bencher| {
                bencher.iter(|| {
                    let found = grasps.iter().filter(|(contacts, load)| {
                        balance(black_box(contacts), black_box(load), &mut buffers).is_some()
                    });
                    found.count()
                });
            });
        }
        if !held.is_empty() {
            group.throughput(Throughput::Elements(held.len() as u64));
            group.bench_function("epsilon/held, required", |bencher| {
                bencher.iter(|| {
                    let epsilons = held
                        .iter()
                        .map(|(contacts, load)| epsilon(black_box(contacts), load, REQUIRED, &mut buffers));
                    epsilons.sum::<f32>()
                });
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .sample_size(10);
    targets = bench_queries, clearances, bench_immobility
}
