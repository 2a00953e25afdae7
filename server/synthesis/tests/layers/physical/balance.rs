//! Force balance against closed forms, and its limits over many random grasps.

use grasp_synthesis::physical::immobility::{Balance, FrictionUse, MAX_CONTACT_FORCE, balance, balance_with};

use crate::fixtures::random::load;
use crate::prelude::*;

fn solve(contacts: &[SoftContact], load: &Load) -> Option<Balance> {
    balance(contacts, load, &mut Buffers::default())
}

/// The unbalanced share of the weight, computed from the answer alone.
fn residual(contacts: &[SoftContact], load: &Load, balance: &Balance) -> f32 {
    let weight = load.mass * 9.81;
    let TorqueScale { centre, length } = load.torque_scale;
    let mut force = load.up * -weight;
    let mut torque = (load.centre_of_mass - centre).cross(force);
    for ((contact, &push), &torsion) in contacts.iter().zip(&balance.forces).zip(&balance.torsions) {
        force += push;
        torque += (contact.position - centre).cross(push) - contact.normal * torsion;
    }
    (force.length_squared() + (torque / length).length_squared()).sqrt() / weight
}

/// Checks forces; returns the sum of the normal ones in newtons, and the largest share of friction that one uses.
fn assert_sound(contacts: &[SoftContact], load: &Load, balance: &Balance, what: &str) -> (f32, f32) {
    let left = residual(contacts, load, balance);
    assert!(left <= BALANCE_TOLERANCE * 1.001, "{what} {left}");
    assert!(
        (left - balance.residual).abs() < 1e-4,
        "{what}: {left}, not {}",
        balance.residual
    );
    let (mut sum, mut share) = (0.0, 0.0_f32);
    for ((contact, &force), &torsion) in contacts.iter().zip(&balance.forces).zip(&balance.torsions) {
        assert!(force.length() <= MAX_CONTACT_FORCE, "{what} {}", force.length());
        let normal = -force.dot(contact.normal);
        let across = (force + contact.normal * normal).length();
        assert!(normal >= -1e-5, "{what}: a contact pulls with {normal} N");
        let slipping = across / contact.friction;
        let twisting = if torsion == 0.0 {
            0.0
        } else {
            torsion / contact.torsion_radius
        };
        let used = (slipping * slipping + twisting * twisting).sqrt();
        assert!(used <= normal * 1.000_001 + 1e-5, "{what} {used} {normal}");
        sum += normal;
        if normal > 0.01 {
            share = share.max(used / normal);
        }
    }
    (sum, share)
}

/// Two opposed contacts carry a weight if and only if each can push with half of it along the edge of its cone.
#[test]
fn a_pinch_holds_exactly_the_weight_that_friction_carries() {
    let places = [(Vec3::X * 0.03, Vec3::X), (Vec3::NEG_X * 0.03, Vec3::NEG_X)];
    for friction in [0.34_f32, 0.5, 1.0] {
        let contacts = contacts_at(&places, friction, 0.004);
        // Half the weight across, half the weight over friction along the normal.
        let greatest = 2.0 * MAX_CONTACT_FORCE / (1.0 + 1.0 / (friction * friction)).sqrt() / 9.81;
        for share in [0.01, 0.2, 0.5, 0.9, 0.99] {
            let load = load(share * greatest, Vec3::Y, 0.04);
            let found =
                solve(&contacts, &load).unwrap_or_else(|| panic!("friction {friction}, share {share}"));
            assert_sound(&contacts, &load, &found, "pinch");
            for force in &found.forces {
                let half = load.mass * 9.81 / 2.0;
                assert!(force.x.abs() >= half / friction * 0.95, "{friction}: {force}");
                assert!((force.y - half).abs() <= half * 0.05, "{friction}: {force}");
            }
        }
        for share in [1.05, 2.0, 20.0] {
            let load = load(share * greatest, Vec3::Y, 0.04);
            assert_eq!(solve(&contacts, &load), None, "share {share}");
        }
        assert_eq!(solve(&[], &load(0.1, Vec3::Y, 0.04)), None);
    }
}

/// Of 45 %, 70 % and all of friction, the least that allows a firm hold. Fingertips on a wedge need the tangent of half
/// its angle.
#[test]
fn uses_no_more_friction_than_a_firm_hold_needs() {
    for (degrees, least, most) in [(5.0_f32, 0.0, 0.45), (19.0, 0.45, 0.7), (27.0, 0.7, 1.0)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let places = [
            (Vec3::X * 0.01, Vec3::new(cos, 0.0, sin)),
            (Vec3::NEG_X * 0.01, Vec3::new(-cos, 0.0, sin)),
        ];
        let contacts = contacts_at(&places, 0.6, 0.0033);
        let load = load(0.02, Vec3::Y, 0.05);
        let found = solve(&contacts, &load).expect("friction is enough");
        let (sum, used) = assert_sound(&contacts, &load, &found, "wedge");
        assert!(sum > 0.5 * (8.0 + 5.0 * 0.02 * 9.81 / 0.6), "{sum} {degrees}");
        assert!((least..most + 1e-3).contains(&used), "{used} {degrees}");
    }
}

#[test]
fn forces_take_the_comfortable_shares_of_touching_digits() {
    // Five contacts below a tray, all at the same place: any distribution balances.
    let below = (Vec3::new(0.0, -0.02, 0.0), Vec3::NEG_Y);
    let load = load(0.5, Vec3::Y, 0.04);
    // A thumb against two fingers carries as much as both, and they share evenly.
    let against = [
        (Vec3::X * 0.03, Vec3::X),
        (Vec3::new(-0.03, 0.0, 0.02), Vec3::NEG_X),
        (Vec3::new(-0.03, 0.0, -0.02), Vec3::NEG_X),
    ];
    let tray = contacts_at(&[below; 5], 0.5, 0.004);
    let thumb_and_two = contacts_at(&against, 0.6, 0.004);
    for (contacts, shares, tolerance) in [
        (tray, &[0.25, 0.25, 0.25, 0.125, 0.125][..], 0.02),
        (thumb_and_two, &[0.5, 0.25, 0.25], 0.03),
    ] {
        let found = solve(&contacts, &load).expect("they hold it");
        assert_sound(&contacts, &load, &found, "shares");
        let total: f32 = found.forces.iter().map(|force| force.length()).sum();
        for (force, share) in found.forces.iter().zip(shares) {
            let off = force.length() / total - share;
            assert!(off.abs() < tolerance, "{force} of {total}");
        }
    }
}

/// A search that starts at or below the friction use of the answer finds the same forces, and sound ones above it.
#[test]
fn forces_of_random_grasps_keep_every_limit_wherever_the_friction_use_starts() {
    let mut random = Random::new(12);
    let mut buffers = Buffers::default();
    let (mut counts, mut limited) = ([0; 3], 0);
    for case in 0..4000 {
        let contacts = random.contacts(1 + case % 10);
        let load = load(random.between(0.02, 4.0), random.direction(), 0.04);
        let found = balance(&contacts, &load, &mut buffers);
        for least_use in FrictionUse::ALL {
            let again = balance_with(&contacts, &load, least_use, &mut buffers);
            assert_eq!(again.is_some(), found.is_some(), "case {case}, {least_use:?}");
            let (Some(found), Some(again)) = (&found, again) else {
                continue;
            };
            if least_use <= found.friction_use {
                assert_eq!(&again, found, "case {case}, {least_use:?}");
            } else {
                assert!(again.friction_use >= least_use, "case {case}, {least_use:?}");
                assert_sound(&contacts, &load, &again, &format!("case {case}, {least_use:?}"));
            }
        }
        if let Some(found) = found {
            assert_sound(&contacts, &load, &found, &format!("case {case}"));
            counts[found.friction_use as usize] += 1;
            let strong = |force: &Vec3| force.length() > 0.99 * MAX_CONTACT_FORCE;
            limited += u32::from(found.forces.iter().any(strong));
        }
    }
    assert!(counts.iter().all(|&count| count > 30), "{counts:?}");
    assert!(limited > 20, "only {limited} grasps come to a limit");
}

/// Contacts push at random inside their limits, and gravity balances their sum.
#[test]
fn finds_a_balance_where_one_exists_by_construction() {
    let mut random = Random::new(4);
    let mut constructed = 0;
    for case in 0..40_000 {
        let contacts = random.contacts(2 + case % 7);
        let mut force = Vec3::ZERO;
        let mut torque = Vec3::ZERO;
        for contact in &contacts {
            let size = random.between(0.0, 5.0);
            let across = random.direction().reject_from_normalized(contact.normal);
            let push = (across * contact.friction * random.between(0.0, 0.95) - contact.normal) * size;
            force += push;
            torque += contact.position.cross(push);
        }
        let weight = force.length();
        if weight < 0.5 {
            continue;
        }
        // Only a force without torque along it can act through a centre of mass.
        let up = force / weight;
        let lever = 0.04;
        if torque.dot(up).abs() / lever > 0.005 * weight {
            continue;
        }
        let load = Load {
            centre_of_mass: force.cross(torque) / (weight * weight),
            ..load(weight / 9.81, up, lever)
        };
        constructed += 1;
        assert!(solve(&contacts, &load).is_some(), "case {case}: {weight} N");
    }
    assert!(constructed > 200, "only {constructed} balances");
}
