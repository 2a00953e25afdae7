//! Prepared hands against the distances of all pairs of solids.

use glam::{Quat, Vec3};
use grasp_synthesis::{
    base::pose::Pose,
    physical::solids::{
        HandSolids, PALM_SOLIDS, PreparedHand, SPHERES, Spheres, TRACKED_SOLIDS, TaperedCapsule,
        TrackedSolids,
    },
};

use crate::fixtures::random::Random;

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

fn least_of_all_pairs<'a>(ours: impl Iterator<Item = &'a TaperedCapsule>, theirs: &TrackedSolids) -> f32 {
    ours.map(|our| {
        let distances = theirs.iter().map(|their| our.distance(their));
        distances.fold(f32::INFINITY, f32::min)
    })
    .fold(f32::INFINITY, f32::min)
}

#[test]
fn distances_and_verdicts_match_all_pairs() {
    let mut random = Random::new(31);
    let (mut near, mut far, mut sure) = (0, 0, 0);
    for case in 0..3000 {
        let giver = tracked_hand(&mut random, Vec3::ZERO);
        let middle = random.direction() * random.between(0.0, 0.7);
        let receiver = tracked_hand(&mut random, middle);
        let prepared = PreparedHand::new(&giver);
        let required = random.between(-0.002, 0.01);

        let least = least_of_all_pairs(receiver.iter(), &giver);
        let clearance = prepared.clearance(&receiver, required);
        // At the limit, rounding decides.
        let is_edge = (least - required).abs() < 1e-5;
        match clearance {
            Some(found) => assert!((found - least).abs() < 1e-6, "case {case}: {found}, not {least}"),
            None => assert!(least < required || is_edge, "case {case}: {least} is enough"),
        }
        assert!(
            clearance.is_some() == (least >= required) || is_edge,
            "case {case}"
        );

        let palm = || receiver.palm.iter();
        let least = least_of_all_pairs(palm(), &giver);
        if (least - required).abs() >= 1e-5 {
            assert_eq!(
                prepared.comes_within(palm(), required),
                least < required,
                "case {case}"
            );
            if least < required { near += 1 } else { far += 1 }
        }

        let (middle, radius) = (receiver.palm[0].start, receiver.palm[0].start_radius);
        if prepared.certainly_within(middle, radius, required) {
            let distances = giver.iter().map(|solid| solid.signed_distance(middle) - radius);
            let least = distances.fold(f32::INFINITY, f32::min);
            assert!(least < required, "case {case}: the ball is {least} m off");
            sure += 1;
        }
    }
    assert!(
        near > 500 && far > 500 && sure > 300,
        "{near} near, {far} far, {sure} sure"
    );
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
            assert!(
                bound >= least - 1e-6,
                "case {case}, {ball}: bound {bound}, distance {least}"
            );
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
