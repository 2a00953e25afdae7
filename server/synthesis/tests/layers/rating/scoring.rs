//! How far a held object gives way, against one system of all joints and springs, with kinematics differentiated
//! numerically.

use grasp_synthesis::rating::stiffness::compliance;

use crate::prelude::*;

/// Unknowns: the object's shift and turn, and three joints of each digit.
const UNKNOWNS: usize = 6 + 15;

/// Stiffness of a digit at its tip, in N/m.
const TIP: f64 = 500.0;
/// Stiffness of flesh, in N/m.
const FLESH: f64 = 15_000.0;
const LEVER: f64 = 0.0033;

fn bent(pose: &HandPose, digit: Digit, joint: usize, angle: f32) -> HandPose {
    let mut bent = *pose;
    let angles = &mut bent.digits[digit.index()];
    *[
        &mut angles.base_pitch,
        &mut angles.second_pitch,
        &mut angles.third_pitch,
    ][joint] += angle;
    bent
}

/// Stretch of the springs at a contact per unit of each unknown, in metres, or radians about the normal, with their
/// stiffness.
fn stretches(rig: &Rig, pose: &HandPose, contact: &Contact, centre: Vec3) -> [([f64; UNKNOWNS], f64); 4] {
    let normal = contact.normal;
    let moved = |unknown: usize, step: f32| -> (Vec3, f32) {
        if unknown < 3 {
            let mut shift = Vec3::ZERO;
            shift[unknown] = step;
            return (shift, 0.0);
        }
        if unknown < 6 {
            let mut axis = Vec3::ZERO;
            axis[unknown - 3] = 1.0;
            let arm = contact.position - centre;
            return (
                Quat::from_axis_angle(axis, step) * arm - arm,
                normal[unknown - 3] * step,
            );
        }
        let (digit, joint) = (Digit::ALL[(unknown - 6) / 3], (unknown - 6) % 3);
        let HandPart::Phalanx(of, phalanx) = contact.part else {
            return (Vec3::ZERO, 0.0);
        };
        if of != digit {
            return (Vec3::ZERO, 0.0);
        }
        let link = |pose: &HandPose| hand_frames(rig, pose).digits[digit.index()].links[phalanx.index()];
        let (before, after) = (link(pose), link(&bent(pose, digit, joint, step)));
        let carried = after.transform_point(before.inverse().transform_point(contact.position));
        let (axis, angle) = (after.orientation * before.orientation.inverse()).to_axis_angle();
        // Here the hand moves and the object does not: the sign changes.
        (contact.position - carried, -axis.dot(normal) * angle)
    };
    let step = 2e-3_f32;
    let slope = |unknown: usize| {
        let (ahead, behind) = (moved(unknown, step), moved(unknown, -step));
        let across = f64::from(2.0 * step);
        let shift = (ahead.0 - behind.0).as_dvec3() / across;
        (shift, f64::from(ahead.1 - behind.1) / across)
    };
    let slopes: [_; UNKNOWNS] = std::array::from_fn(slope);
    [
        (slopes.map(|(shift, _)| shift.x), FLESH),
        (slopes.map(|(shift, _)| shift.y), FLESH),
        (slopes.map(|(shift, _)| shift.z), FLESH),
        (slopes.map(|(_, twist)| twist), FLESH * LEVER * LEVER),
    ]
}

fn solve(mut rows: Vec<[f64; UNKNOWNS + 1]>) -> [f64; UNKNOWNS] {
    for column in 0..UNKNOWNS {
        let pivot = (column..UNKNOWNS)
            .max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))
            .expect("there are rows");
        rows.swap(column, pivot);
        let of_pivot = rows[column];
        for (place, row) in rows.iter_mut().enumerate() {
            if place != column {
                let factor = row[column] / of_pivot[column];
                for (entry, of_pivot) in row.iter_mut().zip(of_pivot) {
                    *entry -= factor * of_pivot;
                }
            }
        }
    }
    std::array::from_fn(|k| rows[k][UNKNOWNS] / rows[k][k])
}

/// Norm of the shifts by unit pushes along the axes, from the whole system.
fn compliance_of_system(rig: &Rig, pose: &HandPose, contacts: &[Contact], centre: Vec3) -> f64 {
    let mut stiffness = vec![[0.0; UNKNOWNS + 1]; UNKNOWNS];
    for digit in Digit::ALL {
        for joint in 0..3 {
            let lever: f32 = rig.digit(digit).lengths[joint..].iter().sum();
            let place = 6 + 3 * digit.index() + joint;
            stiffness[place][place] = 3.0 * TIP * f64::from(lever * lever);
        }
    }
    for contact in contacts {
        for (stretch, weight) in stretches(rig, pose, contact, centre) {
            for (row, a) in stiffness.iter_mut().zip(stretch) {
                for (entry, b) in row.iter_mut().zip(stretch) {
                    *entry += weight * a * b;
                }
            }
        }
    }
    let shifts = [0, 1, 2].map(|axis| {
        let mut system = stiffness.clone();
        system[axis][UNKNOWNS] = 1.0;
        solve(system)[..3].iter().map(|shift| shift * shift).sum::<f64>()
    });
    shifts.iter().sum::<f64>().sqrt()
}

#[test]
fn compliance_matches_the_system_of_all_springs() {
    let rig = right();
    for name in ["remote", "scissors"] {
        let object = object(name);
        for entry in grown_to(object, rig, 40).atlas().entries() {
            let pose = &entry.grip.pose;
            let found = f64::from(compliance(rig, pose, &entry.contacts, object.centre_of_mass));
            let expected = compliance_of_system(rig, pose, &entry.contacts, object.centre_of_mass);
            assert!((found / expected - 1.0).abs() < 0.01, "{name} {found} {expected}");
        }
    }
}
