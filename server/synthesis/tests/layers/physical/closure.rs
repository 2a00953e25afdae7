//! Epsilon against closed forms and dense sampling, and its invariances.

use glam::Vec3;
use grasp_synthesis::{
    model::object::GraspObject,
    physical::immobility::{
        Buffers, EPSILON_TOLERANCE, HAND_LENGTHS, Load, SoftContact, TorqueScale, epsilon,
        epsilon_upper_bound,
    },
};

use crate::fixtures::{
    contacts::{contacts_at, load, moved, pyramid_wrenches, sampled_reach, scaled, unit},
    meshes::Parts,
    proposals::object_scene,
    random::Random,
};

fn whole(contacts: &[SoftContact], load: &Load) -> f32 {
    epsilon(contacts, load, 0.0, &mut Buffers::default())
}

fn bound(contacts: &[SoftContact], load: &Load) -> f32 {
    epsilon_upper_bound(contacts, load, &mut Buffers::default())
}

/// A lower bound of the truth that is within the tolerance.
fn assert_near(epsilon: f32, truth: f64, what: &str) {
    let truth = truth as f32;
    assert!(
        epsilon <= truth * 1.0001 + 1e-6 && epsilon >= truth * (1.0 - EPSILON_TOLERANCE) - 1e-6,
        "{what}: {epsilon} is not within tolerance below {truth}"
    );
}

/// Two soft contacts on a line through the centre of mass, r from it over the length that torques are divided by. The hull of their
/// unit wrenches is least thick about the line, σ, or across: with force and torque about a perpendicular, contact one
/// spans the segment ±μ (1, -r) at x = -1, contact two ±μ (1, r) at x = 1, together a tetrahedron whose faces are
/// μ r / √(1 + r² + μ² r²) from its centre.
#[test]
fn opposed_soft_contacts_have_the_epsilon_of_their_weakest_direction() {
    let pair = |radius: f32| [(Vec3::X * radius, Vec3::X), (Vec3::NEG_X * radius, Vec3::NEG_X)];
    for (radius, friction, torsion_radius, length) in [
        (0.03, 0.5, 0.004, 0.03),
        (0.03, 0.8, 0.02, 0.03),
        (0.05, 0.6, 0.005, 0.02),
        (0.02, 0.34, 0.01, 0.05),
    ] {
        let contacts = contacts_at(&pair(radius), friction, torsion_radius);
        let load = load(0.2, Vec3::Y, length);
        let (mu, sigma, arm) = (
            f64::from(friction),
            f64::from(torsion_radius / length),
            f64::from(radius / length),
        );
        let face = mu * arm / (1.0 + arm * arm + mu * mu * arm * arm).sqrt();
        let truth = sigma.min(face);
        assert_near(
            whole(&contacts, &load),
            truth,
            &format!("radius {radius}, friction {friction}"),
        );
    }
}

/// Two point contacts cannot resist twist about their line, whatever their friction; one contact or contacts that all
/// push one way have no closure either.
#[test]
fn grasps_without_closure_have_epsilon_zero() {
    let load = load(0.2, Vec3::Y, 0.04);
    let line = [(Vec3::X * 0.03, Vec3::X), (Vec3::NEG_X * 0.03, Vec3::NEG_X)];
    assert_eq!(whole(&contacts_at(&line, 2.0, 0.0), &load), 0.0);
    assert!(whole(&contacts_at(&line, 2.0, 0.001), &load) > 0.0);
    assert_eq!(whole(&contacts_at(&line[..1], 2.0, 0.01), &load), 0.0);
    assert_eq!(whole(&[], &load), 0.0);
    let table = [
        (Vec3::new(0.03, -0.02, 0.0), Vec3::NEG_Y),
        (Vec3::new(-0.03, -0.02, 0.01), Vec3::NEG_Y),
        (Vec3::new(0.0, -0.02, -0.03), Vec3::NEG_Y),
    ];
    assert_eq!(whole(&contacts_at(&table, 0.9, 0.01), &load), 0.0);
    for what in [&table[..], &line[..1], &[]] {
        assert_eq!(bound(&contacts_at(what, 0.9, 0.01), &load), 0.0);
    }
}

/// Six pairs of frictionless point contacts, each pair for a force and its torque alone: the hull of ±eₓ ± a·eₜ, whose
/// ball has a closed form.
#[test]
fn a_frictionless_cage_matches_its_closed_form() {
    let arm = 0.03;
    let mut places = Vec::new();
    for k in 0..3 {
        let (along, across) = (Vec3::AXES[k], Vec3::AXES[(k + 1) % 3]);
        for (side, shift) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            places.push((along * (side * 0.05) + across * (shift * arm), along * side));
        }
    }
    for length in [0.03, 0.06, 0.02] {
        let contacts = contacts_at(&places, 1e-9, 0.0);
        let a = f64::from(arm / length);
        // Each axis pair is a rectangle with corners (±1, ±a) in a plane of its own. The reach along (p, q) there is
        // |p| + a |q|; the largest over three planes is least where it is shared by all: the rectangle's least reach
        // is min(1, a) over a unit direction, and by Pythagoras over three planes that over the root of three.
        let truth = a.min(1.0) / 3.0_f64.sqrt();
        assert_near(
            whole(&contacts, &load(0.2, Vec3::Y, length)),
            truth,
            &format!("length {length}"),
        );
    }
}

/// Frictionless point contacts have one unit wrench each, so the hull is that of a few points: its facets are those of
/// all sets of six whose plane has the other points on one side.
#[test]
fn matches_all_facets_of_frictionless_contacts() {
    let mut random = Random::new(6);
    let mut closed = 0;
    for case in 0..300 {
        let contacts: Vec<SoftContact> = (0..8 + case % 6)
            .map(|_| SoftContact {
                position: random.direction() * 0.05,
                normal: random.direction(),
                digit: None,
                friction: 1e-9,
                torsion_radius: 0.0,
            })
            .collect();
        let load = load(0.3, Vec3::Y, 0.04);
        let wrenches: Vec<[f64; 6]> = contacts
            .iter()
            .map(|contact| {
                let torque = contact.position.as_dvec3().cross(-contact.normal.as_dvec3()) / 0.04;
                let [a, b, c] = (-contact.normal).as_dvec3().to_array();
                [a, b, c, torque.x, torque.y, torque.z]
            })
            .collect();
        let truth = nearest_facet(&wrenches);
        assert_near(whole(&contacts, &load), truth, &format!("case {case}"));
        let bound = f64::from(bound(&contacts, &load));
        assert!(
            bound >= truth * 0.9999,
            "case {case}: {bound} is no bound of {truth}"
        );
        closed += u32::from(truth > 0.0);
    }
    assert!(closed > 30, "only {closed} cases have closure");
}

/// On a coarse grid of a box, very many wrenches lie in common planes.
#[test]
fn matches_all_facets_of_contacts_on_a_grid() {
    let mut random = Random::new(12);
    let mut closed = 0;
    for case in 0..300 {
        let contacts: Vec<SoftContact> = (0..7 + case % 7)
            .map(|k| {
                let normal = Vec3::AXES[k % 3] * if k / 3 % 2 == 0 { 1.0 } else { -1.0 };
                let step = |random: &mut Random| random.index(3) as f32 * 0.03 - 0.03;
                let grid_point = Vec3::new(step(&mut random), step(&mut random), step(&mut random));
                SoftContact {
                    position: grid_point.reject_from_normalized(normal) + normal * 0.03,
                    normal,
                    digit: None,
                    friction: 1e-9,
                    torsion_radius: 0.0,
                }
            })
            .collect();
        let load = load(0.3, Vec3::Y, 0.03);
        let truth = nearest_facet(&pyramid_wrenches(&contacts, &load, 0));
        assert_near(whole(&contacts, &load), truth, &format!("case {case}"));
        let bound = f64::from(bound(&contacts, &load));
        assert!(
            bound >= truth * 0.9999,
            "case {case}: {bound} is no bound of {truth}"
        );
        closed += u32::from(truth > 0.0);
    }
    assert!(closed > 10, "only {closed} cases have closure");
}

#[test]
fn repeated_contacts_change_nothing() {
    let mut random = Random::new(13);
    let mut closed = 0;
    for case in 0..100 {
        let contacts = random.contacts(3 + case % 4);
        let load = load(0.3, Vec3::Y, 0.04);
        let once = whole(&contacts, &load);
        let twice = whole(&[contacts.as_slice(), &contacts].concat(), &load);
        assert!(
            (once - twice).abs() <= 1.01 * EPSILON_TOLERANCE * once.max(twice) + 1e-6,
            "case {case}"
        );
        closed += u32::from(once > 0.0);
    }
    assert!(closed > 10, "only {closed} cases have closure");
}

/// The smallest distance of a facet of the hull from the origin, 0 if the origin is outside.
fn nearest_facet(points: &[[f64; 6]]) -> f64 {
    let mut nearest = f64::INFINITY;
    for set in sets_of_six(points.len()) {
        let of_plane: Vec<[f64; 6]> = (0..points.len())
            .filter(|k| set >> k & 1 == 1)
            .map(|k| points[k])
            .collect();
        let Some(normal) = normal_of_plane(&of_plane) else {
            continue;
        };
        let height = |point: &[f64; 6]| point.iter().zip(normal).map(|(a, b)| a * b).sum::<f64>();
        let offset = height(&of_plane[0]);
        let above = points.iter().any(|point| height(point) > offset + 1e-9);
        let below = points.iter().any(|point| height(point) < offset - 1e-9);
        match (above, below) {
            (false, true) => nearest = nearest.min(offset),
            (true, false) => nearest = nearest.min(-offset),
            _ => {}
        }
    }
    // A flat hull has no facets.
    if nearest.is_finite() {
        nearest.max(0.0)
    } else {
        0.0
    }
}

/// All sets of six below `count`, as bits, in rising order: Gosper's way from each to the next.
fn sets_of_six(count: usize) -> impl Iterator<Item = u32> {
    std::iter::successors(Some(0b11_1111_u32), |&set| {
        let lowest = set & set.wrapping_neg();
        let carried = set + lowest;
        Some((((carried ^ set) >> 2) / lowest) | carried)
    })
    .take_while(move |&set| set < 1 << count)
}

/// Unit normal of the plane through six points, perpendicular to their five edges, by elimination with full pivoting;
/// none if they span no plane.
fn normal_of_plane(points: &[[f64; 6]]) -> Option<[f64; 6]> {
    let mut rows: [[f64; 6]; 5] =
        std::array::from_fn(|k| std::array::from_fn(|i| points[k + 1][i] - points[0][i]));
    let mut order = [0, 1, 2, 3, 4, 5];
    for step in 0..5 {
        let (mut pivot_row, mut pivot_column) = (step, step);
        for row in step..5 {
            for column in step..6 {
                if rows[row][order[column]].abs() > rows[pivot_row][order[pivot_column]].abs() {
                    (pivot_row, pivot_column) = (row, column);
                }
            }
        }
        rows.swap(step, pivot_row);
        order.swap(step, pivot_column);
        let pivot = rows[step];
        if pivot[order[step]].abs() < 1e-9 {
            return None;
        }
        for row in &mut rows[step + 1..] {
            let factor = row[order[step]] / pivot[order[step]];
            for (x, p) in row.iter_mut().zip(pivot) {
                *x -= factor * p;
            }
        }
    }
    let mut normal = [0.0; 6];
    normal[order[5]] = 1.0;
    for step in (0..5).rev() {
        let known: f64 = (step + 1..6)
            .map(|k| rows[step][order[k]] * normal[order[k]])
            .sum();
        normal[order[step]] = -known / rows[step][order[step]];
    }
    Some(unit(normal))
}

/// From below, all facets of a pyramid of a few pushes inside each contact's curved limits; from above, the reach of
/// any direction, where the least resisted of many are followed downhill.
#[test]
fn lies_between_an_inner_pyramid_and_the_reach_of_any_direction() {
    let mut random = Random::new(7);
    let mut closed = 0;
    for case in 0..30 {
        let count = 2 + case % 3;
        let mut contacts = random.contacts(count);
        if case % 2 == 0 {
            // Oppose two contacts, or few cases would have closure.
            contacts[0].position = -contacts[1].position;
            contacts[0].normal = -contacts[1].normal;
        }
        let load = load(0.3, Vec3::Y, 0.04);
        let found = f64::from(whole(&contacts, &load));
        let pyramid = nearest_facet(&pyramid_wrenches(&contacts, &load, [0, 0, 6, 4, 3][count]));
        assert!(
            found >= pyramid * (1.0 - f64::from(EPSILON_TOLERANCE)) - 1e-6,
            "case {case}: {found} below {pyramid}"
        );
        let reach = |direction: &[f64; 6]| sampled_reach(&contacts, &load, direction);
        let mut seeds: Vec<(f64, [f64; 6])> = (0..100)
            .map(|_| {
                let direction = random.wrench_direction();
                (reach(&direction), direction)
            })
            .collect();
        seeds.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (mut value, mut direction) in seeds.into_iter().take(3) {
            let mut step = 0.5;
            for _ in 0..200 {
                let by = random.wrench_direction();
                let nearby = unit(std::array::from_fn(|k| direction[k] + step * by[k]));
                let there = reach(&nearby);
                if there < value {
                    (value, direction) = (there, nearby);
                    step *= 1.5;
                } else {
                    step *= 0.93;
                }
            }
            // Sampled pushes fall short of the farthest by up to 1 %.
            assert!(
                found <= value.max(0.0) * 1.01 + 1e-6,
                "case {case}: {found} above {value}"
            );
        }
        closed += u32::from(pyramid > 0.0);
    }
    assert!(closed >= 8, "only {closed} pyramids have closure");
}

#[test]
fn is_invariant_to_rotation_scale_and_order() {
    let mut random = Random::new(8);
    let mut closed = 0;
    for case in 0..200 {
        let contacts = random.contacts(3 + case % 6);
        let load = load(0.3, random.direction(), 0.04);
        let found = whole(&contacts, &load);
        let (turned, turned_load) = moved(&contacts, &load, random.rotation(), random.direction());
        let (larger, larger_load) = scaled(&contacts, &load, 3.0);
        let mut permuted = contacts.clone();
        permuted.rotate_left(1 + case % 2);
        permuted.swap(0, 1);
        for (what, other) in [
            ("turned", whole(&turned, &turned_load)),
            ("larger", whole(&larger, &larger_load)),
            ("permuted", whole(&permuted, &load)),
        ] {
            assert!(
                (found - other).abs() <= 1.01 * EPSILON_TOLERANCE * found.max(other) + 1e-5,
                "case {case}, {what}: {other}, not {found}"
            );
        }
        closed += u32::from(found > 0.0);
    }
    assert!(closed > 40, "only {closed} cases have closure");
}

/// And a required value only shortens the search.
#[test]
fn more_contacts_never_reduce_epsilon() {
    let mut random = Random::new(9);
    let mut buffers = Buffers::default();
    for case in 0..200 {
        let contacts = random.contacts(4 + case % 6);
        let load = load(0.3, Vec3::Y, 0.04);
        let found = epsilon(&contacts, &load, 0.0, &mut buffers);
        let fewer = epsilon(&contacts[1..], &load, 0.0, &mut buffers);
        assert!(
            fewer <= found * 1.06 + 1e-6,
            "case {case}: {fewer} with fewer contacts, {found} with all"
        );
        for required in [0.01, 0.05, 0.1] {
            let decided = epsilon(&contacts, &load, required, &mut buffers);
            if found >= required {
                assert!(decided >= required, "case {case}: {decided}, not {found}");
            }
            if decided >= required {
                assert!(
                    found >= required * (1.0 - EPSILON_TOLERANCE),
                    "case {case}: {decided}, not {found}"
                );
            }
        }
    }
}

#[test]
fn torques_are_scaled_by_half_the_span_of_the_contacts_within_a_hands_lengths() {
    let pair = |half: f32| {
        let place = Vec3::new(0.3, -0.2, 0.1);
        contacts_at(
            &[
                (place + Vec3::X * half, Vec3::X),
                (place - Vec3::X * half, Vec3::NEG_X),
            ],
            0.6,
            0.002,
        )
    };
    let [shortest, longest] = HAND_LENGTHS;
    for (half, length) in [(0.001, shortest), (0.04, 0.04), (0.3, longest)] {
        let scale = TorqueScale::of(&pair(half));
        assert!((scale.centre - Vec3::new(0.3, -0.2, 0.1)).length() < 1e-6);
        assert!((scale.length - length).abs() < 1e-6, "{half}: {}", scale.length);
    }
}

/// What holds a stick holds it with a bar across its far end too.
#[test]
fn what_is_far_from_the_hand_changes_neither_closure_nor_its_requirement() {
    let stick = Parts::default().cuboid(Vec3::ZERO, Vec3::new(0.012, 0.65, 0.012), 1);
    let barred = stick
        .clone()
        .cuboid(Vec3::new(0.0, 0.64, 0.0), Vec3::new(0.15, 0.01, 0.01), 1);
    let contacts = contacts_at(
        &[
            (Vec3::new(0.012, 0.0, 0.0), Vec3::X),
            (Vec3::new(-0.012, 0.03, 0.0), Vec3::NEG_X),
            (Vec3::new(-0.012, -0.03, 0.004), Vec3::NEG_X),
            (Vec3::new(0.0, 0.01, 0.012), Vec3::Z),
        ],
        0.6,
        0.002,
    );
    let [bare, barred] = [stick, barred].map(|parts| {
        let object = GraspObject::new(parts.mesh(), 0.8, Vec3::ZERO, None, &[]).expect("the object is sound");
        let scene = object_scene(&object);
        let load = scene.load(&contacts, Vec3::Y);
        (
            whole(&contacts, &load),
            scene.required_epsilon(&load.torque_scale),
        )
    });
    assert_eq!(bare.0, barred.0);
    assert!((bare.1 / barred.1 - 1.0).abs() < 0.1, "{bare:?}, {barred:?}");
    assert!(bare.0 > bare.1, "{bare:?}");
}
