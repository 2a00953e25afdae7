//! Time per query, in batches of fixed random queries: divide by the batch size, or read the throughput.
//!
//! "Mixed" segments lie anywhere in a box 5 cm larger than the object, like those of a hand being placed; "near" ones
//! start within 15 mm of the surface, like those of a closing finger. Both are as long as a phalanx.

use std::{hint::black_box, time::Duration};

use criterion::{BatchSize, Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_assets::objects::object;
use grasp_synthesis::geometry::{Segment, boxes::OrientedBox, mesh::TriangleMesh, mesh_bvh::MeshBvh};
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

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .sample_size(20);
    targets = bench_queries, bench_building
}
