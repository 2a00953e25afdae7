//! Compliance of a held object: how far it moves when pushed, to first order, with the digits as springs.
//!
//! Balance and closure show that a grasp can hold, but not how far the digits yield until it does. Here each digit joint is a
//! spring, the flesh at each contact another, and the palm is rigid. Eliminating the joints one digit at a time (Schur
//! complement) leaves the object's 6 × 6 stiffness matrix (M. Cutkosky and I. Kao, "Computing and controlling the compliance of a
//! robotic hand", 1989).

use glam::{DVec3, Vec3};

use crate::{
    model::{
        grasp::Contact,
        hand::{Digit, HandPart, HandPose, kinematics::hand_frames, rig::Rig},
    },
    physical::contacts::TORSION_LEVER,
};

/// Stiffness of a digit at its tip in newtons per metre, with equal compliance from its three joints. Pressing index fingers have
/// 200 to 800 (A. Hajian and R. Howe, "Identification of the mechanical impedance at the human finger tip", 1997).
const TIP_STIFFNESS: f64 = 500.0;

/// Stiffness of flesh, normal and tangential, in newtons per metre: 5 N displace it by a third of a millimetre.
const FLESH_STIFFNESS: f64 = 15_000.0;

/// Pitch joints of a digit.
const JOINTS: usize = 3;

/// Rows: the object's translation, then its rotation about the centre of mass.
type Matrix6 = [[f64; 6]; 6];

/// Compliance of a held object in metres per newton: the Frobenius norm of its translational compliance for pushes at `centre`,
/// its centre of mass. Infinite if the contacts leave it free to move.
///
/// Contacts are assumed to stick. Pose, contacts and centre are in the same frame, in metres.
pub fn compliance(rig: &Rig, pose: &HandPose, contacts: &[Contact], centre: Vec3) -> f32 {
    let mut stiffness = [[0.0; 6]; 6];
    for contact in contacts.iter().filter(|contact| contact.part == HandPart::Palm) {
        for (row, weight) in springs(contact, centre) {
            add_square(&mut stiffness, &row, weight);
        }
    }
    for digit in Digit::ALL {
        add_digit(&mut stiffness, rig, pose, contacts, centre, digit);
    }
    translational_compliance(&stiffness).map_or(f32::INFINITY, |norm| norm as f32)
}

/// A contact's four springs (three directions and the twist about its normal): the stretch per unit of each of the object's six
/// motions, and the stiffness.
fn springs(contact: &Contact, centre: Vec3) -> [([f64; 6], f64); 4] {
    let arm = (contact.position - centre).as_dvec3();
    let direction = |along: DVec3| {
        let turn = arm.cross(along);
        (
            [along.x, along.y, along.z, turn.x, turn.y, turn.z],
            FLESH_STIFFNESS,
        )
    };
    let normal = contact.normal.as_dvec3();
    let lever = f64::from(TORSION_LEVER);
    let twist = [0.0, 0.0, 0.0, normal.x, normal.y, normal.z];
    [
        direction(DVec3::X),
        direction(DVec3::Y),
        direction(DVec3::Z),
        (twist, FLESH_STIFFNESS * lever * lever),
    ]
}

/// Adds the stiffness of a digit's contacts, reduced by the compliance of its joints.
fn add_digit(
    stiffness: &mut Matrix6,
    rig: &Rig,
    pose: &HandPose,
    contacts: &[Contact],
    centre: Vec3,
    digit: Digit,
) {
    let frames = hand_frames(rig, pose).digits[digit.index()];
    let lengths = rig.digit(digit).lengths;
    let axes = frames.links.map(|link| link.transform_vector(Vec3::X).as_dvec3());
    let mut joints = [[0.0; JOINTS]; JOINTS];
    for (joint, row) in joints.iter_mut().enumerate() {
        let lever = f64::from(lengths[joint..].iter().sum::<f32>());
        row[joint] = JOINTS as f64 * TIP_STIFFNESS * lever * lever;
    }
    let mut mixed = [[0.0; 6]; JOINTS];
    let mut touches = false;
    for contact in contacts {
        let HandPart::Phalanx(of, phalanx) = contact.part else {
            continue;
        };
        if of != digit {
            continue;
        }
        touches = true;
        for (row, weight) in springs(contact, centre) {
            add_square(stiffness, &row, weight);
            // The joints that carry the contact stretch the same spring with the opposite sign.
            let along = DVec3::new(row[0], row[1], row[2]);
            let twist = if along == DVec3::ZERO {
                contact.normal.as_dvec3()
            } else {
                DVec3::ZERO
            };
            let mut joint_stretch = [0.0; JOINTS];
            for joint in 0..=phalanx.index() {
                let arm = (contact.position - frames.links[joint].position).as_dvec3();
                joint_stretch[joint] = -(axes[joint].cross(arm).dot(along) + axes[joint].dot(twist));
            }
            for (joint, &of_joint) in joint_stretch.iter().enumerate() {
                for (other, &of_other) in joint_stretch.iter().enumerate() {
                    joints[joint][other] += weight * of_joint * of_other;
                }
                for (entry, &of_object) in mixed[joint].iter_mut().zip(&row) {
                    *entry += weight * of_joint * of_object;
                }
            }
        }
    }
    if touches {
        eliminate_joints(stiffness, joints, mixed);
    }
}

/// Adds a spring: the outer product of its stretches times its stiffness.
fn add_square(stiffness: &mut Matrix6, stretch: &[f64; 6], weight: f64) {
    for (row, &a) in stiffness.iter_mut().zip(stretch) {
        for (entry, &b) in row.iter_mut().zip(stretch) {
            *entry += weight * a * b;
        }
    }
}

/// Schur complement: eliminates the joints, which settle where no net torque acts on them.
fn eliminate_joints(
    stiffness: &mut Matrix6,
    mut joints: [[f64; JOINTS]; JOINTS],
    mut mixed: [[f64; 6]; JOINTS],
) {
    // Gaussian elimination, joint by joint; the joints' springs keep every pivot positive.
    for joint in 0..JOINTS {
        let (pivot_joints, pivot_mixed) = (joints[joint], mixed[joint]);
        let pivot = pivot_joints[joint];
        for (row, &a) in stiffness.iter_mut().zip(&pivot_mixed) {
            for (entry, &b) in row.iter_mut().zip(&pivot_mixed) {
                *entry -= a * b / pivot;
            }
        }
        for other in joint + 1..JOINTS {
            let factor = joints[other][joint] / pivot;
            for (entry, &of_pivot) in joints[other].iter_mut().zip(&pivot_joints) {
                *entry -= factor * of_pivot;
            }
            for (entry, &of_pivot) in mixed[other].iter_mut().zip(&pivot_mixed) {
                *entry -= factor * of_pivot;
            }
        }
    }
}

/// Norm of the block of the inverse that maps forces to translations; `None` if the matrix is not positive definite.
fn translational_compliance(stiffness: &Matrix6) -> Option<f64> {
    // Eliminating the rotations first leaves a 3 × 3 matrix to invert.
    let mut left = *stiffness;
    let scale = left
        .iter()
        .enumerate()
        .fold(0.0, |scale: f64, (k, row)| scale.max(row[k]));
    for turn in (3..6).rev() {
        let of_pivot = left[turn];
        let pivot = of_pivot[turn];
        // A pivot this small means that the object turns freely.
        if pivot.is_nan() || pivot <= 1e-12 * scale {
            return None;
        }
        for row in &mut left[..turn] {
            let factor = row[turn] / pivot;
            for (entry, &of_pivot) in row[..turn].iter_mut().zip(&of_pivot) {
                *entry -= factor * of_pivot;
            }
        }
    }
    let rows = [0, 1, 2].map(|k| DVec3::new(left[k][0], left[k][1], left[k][2]));
    let matrix = glam::DMat3::from_cols(rows[0], rows[1], rows[2]);
    let is_definite = matrix.determinant() > 1e-12 * scale.powi(3) && matrix.x_axis.x > 0.0;
    is_definite.then(|| {
        let inverse = matrix.inverse();
        [inverse.x_axis, inverse.y_axis, inverse.z_axis]
            .map(DVec3::length_squared)
            .iter()
            .sum::<f64>()
            .sqrt()
    })
}
