//! Forward kinematics against Equation 4.2, written out with 4×4 matrices in double precision.

use grasp_synthesis::{
    base::pose::Pose,
    model::hand::{DigitAngles, HandPose, Handedness, kinematics::hand_frames, rig::DigitRig},
};

use crate::fixtures::{hands::all_hands, random::Random};

type Matrix = [[f64; 4]; 4];

const IDENTITY: Matrix = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

fn product(a: Matrix, b: Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn translation(x: f64, y: f64, z: f64) -> Matrix {
    let mut m = IDENTITY;
    (m[0][3], m[1][3], m[2][3]) = (x, y, z);
    m
}

fn about_x(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    let mut m = IDENTITY;
    (m[1][1], m[1][2], m[2][1], m[2][2]) = (c, -s, s, c);
    m
}

fn about_z(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    let mut m = IDENTITY;
    (m[0][0], m[0][1], m[1][0], m[1][1]) = (c, -s, s, c);
    m
}

/// A pose as a matrix, by the textbook formula for quaternions.
fn matrix(pose: Pose) -> Matrix {
    let [x, y, z, w] = pose.orientation.to_array().map(f64::from);
    let [px, py, pz] = pose.position.to_array().map(f64::from);
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - z * w),
            2.0 * (x * z + y * w),
            px,
        ],
        [
            2.0 * (x * y + z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - x * w),
            py,
        ],
        [
            2.0 * (x * z - y * w),
            2.0 * (y * z + x * w),
            1.0 - 2.0 * (x * x + y * y),
            pz,
        ],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Equation 4.2 up to each link and the tip: T(p0) R(r0) T(p1) R(r1) …
fn chain(wrist: Pose, digit: &DigitRig, yaw_sign: f64, angles: DigitAngles) -> [Matrix; 4] {
    let [yaw, first, second, third] = [
        angles.base_yaw,
        angles.base_pitch,
        angles.second_pitch,
        angles.third_pitch,
    ]
    .map(f64::from);
    let [l1, l2, l3] = digit.lengths.map(f64::from);
    let base = product(matrix(wrist), matrix(digit.wrist_from_base));
    let one = product(product(base, about_z(yaw_sign * yaw)), about_x(first));
    let two = product(product(one, translation(0.0, l1, 0.0)), about_x(second));
    let three = product(product(two, translation(0.0, l2, 0.0)), about_x(third));
    let tip = product(three, translation(0.0, l3, 0.0));
    [one, two, three, tip]
}

#[test]
fn frames_match_equation_4_2() {
    let mut random = Random::new(1);
    for hand in all_hands() {
        // Fingers yaw toward the little finger's side, the thumb away from the palm: opposite senses about +z.
        let side = if hand.rig.handedness == Handedness::Right {
            1.0
        } else {
            -1.0
        };
        for _ in 0..200 {
            let wrist = random.pose();
            let digits = random.angles(&hand.rig);
            let frames = hand_frames(
                &hand.rig,
                &HandPose {
                    frame_from_wrist: wrist,
                    digits,
                },
            );
            for (i, angles) in digits.into_iter().enumerate() {
                let sign = if i == 0 { -side } else { side };
                let expected = chain(wrist, &hand.rig.digits[i], sign, angles);
                for (link, expected) in frames.digits[i].links.iter().zip(expected) {
                    let found = matrix(*link);
                    for row in 0..3 {
                        for column in 0..4 {
                            let error = (found[row][column] - expected[row][column]).abs();
                            assert!(error < 2e-6, "digit {i}: {found:?} instead of {expected:?}");
                        }
                    }
                }
                let tip = frames.digits[i].tip.to_array().map(f64::from);
                for axis in 0..3 {
                    assert!((tip[axis] - expected[3][axis][3]).abs() < 2e-6);
                }
            }
        }
    }
}

#[test]
fn positive_angles_move_digits_in_the_thesis_directions() {
    for hand in all_hands() {
        let rig = &hand.rig;
        let thumbward = if rig.handedness == Handedness::Right {
            1.0
        } else {
            -1.0
        };
        let tips = |angles: DigitAngles| {
            hand_frames(
                rig,
                &HandPose {
                    frame_from_wrist: Pose::IDENTITY,
                    digits: [angles; 5],
                },
            )
            .digits
            .map(|digit| digit.tip)
        };
        let still = tips(DigitAngles::default());
        let yawed = tips(DigitAngles {
            base_yaw: 0.1,
            ..DigitAngles::default()
        });
        let pitched = tips(DigitAngles {
            base_pitch: 0.1,
            ..DigitAngles::default()
        });
        for finger in 1..5 {
            assert!(
                (yawed[finger].x - still[finger].x) * thumbward < -0.005,
                "yaw moves a finger toward the little finger's side"
            );
            assert!(
                pitched[finger].z - still[finger].z > 0.005,
                "pitch moves a finger toward the palm's front"
            );
        }
        assert!(
            yawed[0].z - still[0].z > 0.008,
            "yaw lifts the thumb off the palm's plane"
        );
        assert!(
            (pitched[0].x - still[0].x) * thumbward < -0.008,
            "pitch moves the thumb across the palm"
        );
        assert!(
            still[0].x * thumbward > 0.05,
            "the thumb lies on its side of the hand"
        );
    }
}
