//! Time per query, in batches of fixed random queries: divide by the batch size, or read the throughput.
//!
//! "Mixed" segments lie anywhere in a box 5 cm larger than the object, like those of a hand being placed; "near" ones
//! start within 15 mm of the surface, like those of a closing finger. Both are as long as a phalanx.

use std::{hint::black_box, time::Duration};

use criterion::{BatchSize, Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_assets::objects::object;
use grasp_synthesis::{
    geometry::{
        Segment, boxes::OrientedBox, mesh::TriangleMesh, mesh_bvh::MeshBvh, tapered_capsule::TaperedCapsule,
    },
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

/// A bar of 5 × 18 × 2.4 cm, like a remote control, whose flat faces are grids of squares with edges of some `cell` metres.
pub(crate) fn bar(cell: f32) -> TriangleMesh {
    let half = Vec3::new(0.025, 0.09, 0.012);
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let [u, v] = [1, 2].map(|k| Vec3::AXES[(axis + k) % 3]);
        let [columns, rows] = [u, v].map(|side| (half.dot(side) / cell).round().max(1.0) as u32);
        for side in [-1.0, 1.0] {
            let first = positions.len() as u32;
            for j in 0..=rows {
                for i in 0..=columns {
                    let share = |k: u32, n: u32| 2.0 * k as f32 / n as f32 - 1.0;
                    positions
                        .push((Vec3::AXES[axis] * side + u * share(i, columns) + v * share(j, rows)) * half);
                }
            }
            for k in 0..rows * columns {
                let a = first + k / columns * (columns + 1) + k % columns;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                triangles.extend(if side > 0.0 {
                    [[a, b, c], [a, c, d]]
                } else {
                    [[a, c, b], [a, d, c]]
                });
            }
        }
    }
    TriangleMesh::new(positions, triangles).expect("the mesh is sound")
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
    let scissors = object("scissors").expect("they are built in");
    let scissors = TriangleMesh::clone(scissors.object.surface.mesh());
    for (name, mesh) in [("scissors", scissors), ("bar", bar(0.0025))] {
        let bvh = MeshBvh::build(mesh.clone());
        let quick = MeshBvh::build_quick(mesh.clone());
        let queries = queries(&mesh);
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
        segments("is_crossed_by/mixed", &bvh, &queries.mixed);
        segments("is_crossed_by/near", &bvh, &queries.near);
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

fn bench_building(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("build");
    for (name, mesh) in [("2400", bar(0.0025)), ("5900", bar(0.0016))] {
        let mut build = |id: &str, build: fn(TriangleMesh) -> MeshBvh| {
            group.bench_function(format!("{id}/{name}"), |bencher| {
                bencher.iter_batched(|| mesh.clone(), build, BatchSize::SmallInput);
            });
        };
        build("thorough", MeshBvh::build);
        build("quick", MeshBvh::build_quick);
        group.bench_function(format!("oriented box/{name}"), |bencher| {
            bencher.iter(|| OrientedBox::around(black_box(&mesh)));
        });
    }
    group.finish();
}

/// Queries per batch: more than a branch predictor can memorise.
const CAPSULES: usize = 4096;

fn random_capsules(surface: &MeshBvh, gaps: [f32; 2], deep: bool) -> Vec<TaperedCapsule> {
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
    group.throughput(Throughput::Elements(CAPSULES as u64));
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
        let closed = |(contacts, load): &&(Vec<SoftContact>, Load)| {
            epsilon(contacts, load, REQUIRED, &mut Buffers::default()) >= REQUIRED
        };
        let firm: Vec<_> = held.iter().filter(closed).cloned().collect();
        println!(
            "{count} contacts: {} of {GRASPS} balance gravity, {} have closure",
            held.len(),
            firm.len()
        );
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
        for (name, grasps, required) in [
            ("held, required", &held, REQUIRED),
            ("firm, required", &firm, REQUIRED),
            ("firm, whole", &firm, 0.0),
        ] {
            if grasps.is_empty() {
                continue;
            }
            group.throughput(Throughput::Elements(grasps.len() as u64));
            group.bench_function(format!("epsilon/{name}"), |bencher| {
                bencher.iter(|| {
                    let epsilons = grasps
                        .iter()
                        .map(|(contacts, load)| epsilon(black_box(contacts), load, required, &mut buffers));
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
    targets = bench_queries, bench_building, clearances, bench_immobility
}
