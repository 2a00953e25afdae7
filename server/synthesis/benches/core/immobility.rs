//! Time of force balance and closure, over random grasps of a hand-sized body.

use std::{hint::black_box, time::Duration};

use criterion::{Criterion, Throughput, criterion_group};
use glam::Vec3;
use grasp_synthesis::{
    model::hand::Digit,
    physical::immobility::{Buffers, Load, SoftContact, TorqueScale, balance, epsilon},
};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Grasps per batch: more than a branch predictor can memorise.
const BATCH: usize = 512;

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
    (0..BATCH).map(|_| grasp()).collect()
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
            "{count} contacts: {} of {BATCH} balance gravity, {} have closure",
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
    targets = bench_immobility
}
