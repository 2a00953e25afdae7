//! Prepared hands against the distances of all pairs of solids.

use grasp_synthesis::physical::solids::{PALM_SOLIDS, SPHERES, TRACKED_SOLIDS};

use crate::prelude::*;

/// A solid near `middle`, up to so long and so thick.
fn solid(random: &mut Random, middle: Vec3, length: f32, thick: f32) -> TaperedCapsule {
    let start = middle + random.direction() * random.between(0.0, 0.1);
    let way = random.direction() * random.between(0.0, length);
    let radii = [0.3 * thick, thick].map(|least| random.between(least, thick));
    TaperedCapsule::new(start, start + way, radii[0], radii[1])
}

/// [`hand`] as tracked hand solids, which are thicker.
fn tracked_hand(random: &mut Random, middle: Vec3) -> TrackedSolids {
    TrackedSolids {
        hand: hand(random, middle),
        palm: [(); PALM_SOLIDS].map(|()| solid(random, middle, 0.07, 0.019)),
        tracked: [(); TRACKED_SOLIDS].map(|()| solid(random, middle, 0.07, 0.017)),
    }
}

/// Random solids near `middle`, as long and as thick as a person's.
fn hand(random: &mut Random, middle: Vec3) -> HandSolids {
    let mut solid = |length: f32, thick: f32| solid(random, middle, length, thick);
    HandSolids {
        phalanges: [[(); 3]; 5].map(|links| links.map(|()| solid(0.05, 0.01))),
        palm: [(); PALM_SOLIDS].map(|()| solid(0.07, 0.017)),
        thenar: [(); 4].map(|()| solid(0.05, 0.017)),
        forearm: [(); 2].map(|()| solid(0.3, 0.06)),
    }
}

/// Eight balls moved together are near a hand exactly where one of them, moved by itself, is.
#[test]
fn moved_balls_are_near_where_any_one_of_them_is() {
    let mut random = Random::new(32);
    let (mut near, mut far, mut close) = (0, 0, 0);
    for case in 0..2000 {
        let solids = tracked_hand(&mut random, Vec3::ZERO);
        let giver = PreparedHand::new(&solids);
        let middles: [Vec3; SPHERES] =
            std::array::from_fn(|_| random.direction() * random.between(0.1, 0.2) + Vec3::X * 0.1);
        let radii: [f32; SPHERES] = std::array::from_fn(|_| random.between(0.004, 0.012));
        let turn = Quat::from_axis_angle(random.direction(), random.between(-3.0, 3.0));
        let way = Pose::new(random.direction() * random.between(0.0, 0.1), turn);
        let balls = Spheres::new(|i| (middles[i], radii[i])).transformed(way);
        let nears = |distance: f32| {
            let mut each = middles.iter().zip(radii);
            each.any(|(middle, radius)| {
                giver.certainly_within(way.transform_point(*middle), radius, distance)
            })
        };
        // Where rounding decides, either answer is right.
        let (surely, perhaps) = (nears(0.001 - 1e-6), nears(0.001 + 1e-6));
        let found = giver.any_certainly_within(&balls, 0.001);
        assert!(found || !surely, "case {case}: one of them is near");
        assert!(!found || perhaps, "case {case}: none of them is near");
        if found {
            near += 1;
        } else {
            far += 1;
        }

        // Each ball's upper bound holds.
        let bounds = giver.distance_upper_bounds(&balls);
        for (ball, (middle, radius)) in middles.into_iter().zip(radii).enumerate() {
            let middle = way.transform_point(middle);
            let distances = solids.iter().map(|solid| solid.signed_distance(middle) - radius);
            let least = distances.fold(f32::INFINITY, f32::min);
            let bound = bounds[ball];
            assert!(bound >= least - 1e-6, "{case} {ball} {bound} {least}");
            close += usize::from(bound < least + 1e-3);
        }
    }
    assert!(near > 300 && far > 300, "{near} near, {far} far");
    assert!(close > 4_000, "{close} bounds are within a millimetre");
}

#[test]
fn upper_bounds_of_point_distances_hold_and_are_tight() {
    let mut random = Random::new(37);
    let mut excess = Vec::new();
    for _ in 0..2000 {
        let giver = tracked_hand(&mut random, Vec3::ZERO);
        let point = random.direction() * random.between(0.0, 0.3);
        let bound = PreparedHand::new(&giver).point_distance_upper_bound(point);
        let least = giver.iter().map(|solid| solid.signed_distance(point));
        let least = least.fold(f32::INFINITY, f32::min);
        assert!(bound >= least - 1e-5, "{bound} is less than {least}");
        excess.push(bound - least);
    }
    excess.sort_by(f32::total_cmp);
    assert!(
        excess[1000] < 1e-4 && excess[1800] < 2e-3,
        "{} and {}",
        excess[1000],
        excess[1800]
    );
}
