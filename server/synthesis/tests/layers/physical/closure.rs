//! Epsilon against closed forms and dense sampling, and its invariances.

use grasp_synthesis::physical::immobility::{HAND_LENGTHS, epsilon, epsilon_upper_bound};

use crate::fixtures::random::{load, unit, wrench_of_push};
use crate::prelude::*;

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
        let what = format!("radius {radius}, friction {friction}");
        assert_near(whole(&contacts, &load), sigma.min(face), &what);
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

/// Frictionless point contacts have one unit wrench each, so the hull is that of a few points: its facets are those of
/// all sets of six whose plane has the other points on one side. On a coarse grid of a box, very many wrenches lie in common
/// planes.
#[test]
fn matches_all_facets_of_frictionless_contacts() {
    let mut random = Random::new(6);
    let mut closed = [0; 2];
    for case in 0..600 {
        let is_on_grid = case % 2 == 1;
        let places: Vec<(Vec3, Vec3)> = (0..7 + case / 2 % 7)
            .map(|k| {
                let mut step = || random.index(3) as f32 * 0.03 - 0.03;
                let grid_point = Vec3::new(step(), step(), step());
                let side = Vec3::AXES[k % 3] * if k / 3 % 2 == 0 { 1.0 } else { -1.0 };
                if is_on_grid {
                    (grid_point.reject_from_normalized(side) + side * 0.03, side)
                } else {
                    (random.direction() * 0.05, random.direction())
                }
            })
            .collect();
        let contacts = contacts_at(&places, 1e-9, 0.0);
        let load = load(0.3, Vec3::Y, 0.03);
        let wrenches: Vec<[f64; 6]> = contacts
            .iter()
            .map(|contact| wrench_of_push(contact, &load))
            .collect();
        let truth = nearest_facet(&wrenches);
        assert_near(whole(&contacts, &load), truth, &format!("case {case}"));
        let bound = f64::from(bound(&contacts, &load));
        assert!(bound >= truth * 0.9999, "case {case}: {bound} bounds {truth}");
        closed[usize::from(is_on_grid)] += u32::from(truth > 0.0);
    }
    assert!(closed[0] > 20 && closed[1] > 10, "{closed:?} have closure");
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
/// `None` if they span no plane.
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

#[test]
fn more_contacts_never_reduce_epsilon() {
    let mut random = Random::new(9);
    let mut buffers = Buffers::default();
    for case in 0..200 {
        let contacts = random.contacts(4 + case % 6);
        let load = load(0.3, Vec3::Y, 0.04);
        let found = epsilon(&contacts, &load, 0.0, &mut buffers);
        let fewer = epsilon(&contacts[1..], &load, 0.0, &mut buffers);
        assert!(fewer <= found * 1.06 + 1e-6, "{case} {fewer} {found}");
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
    let place = Vec3::new(0.3, -0.2, 0.1);
    let pair = |half: f32| {
        [
            (place + Vec3::X * half, Vec3::X),
            (place - Vec3::X * half, Vec3::NEG_X),
        ]
    };
    let [shortest, longest] = HAND_LENGTHS;
    for (half, length) in [(0.001, shortest), (0.04, 0.04), (0.3, longest)] {
        let scale = TorqueScale::of(&contacts_at(&pair(half), 0.6, 0.002));
        assert!(scale.centre.distance(place) < 1e-6);
        assert!((scale.length - length).abs() < 1e-6, "{half}: {}", scale.length);
    }
}
