//! Constraints.

use grasp_proto::v1;

use super::{geometry_codec::vector_to_wire, hand_codec::digit_to_wire};
use crate::{
    constraints::{ApproachCone, Constraints, Reach},
    grasp_type::GraspType,
};

/// None without constraints.
pub(super) fn constraints_to_wire(constraints: &Constraints) -> Option<v1::Constraints> {
    if *constraints == Constraints::default() {
        return None;
    }
    // The contract uses the taxonomy's numbers.
    let types = |types: &[GraspType]| types.iter().map(|&one| one as i32).collect();
    let digits = |digits: &[_]| digits.iter().map(|&digit| digit_to_wire(digit).into()).collect();
    Some(v1::Constraints {
        receiver_reach: constraints.receiver_reach.map(reach_to_wire),
        approach: constraints.approach.map(approach_to_wire),
        allowed_grasp_types: types(&constraints.allowed_grasp_types),
        excluded_grasp_types: types(&constraints.excluded_grasp_types),
        must_touch: digits(&constraints.must_touch),
        must_not_touch: digits(&constraints.must_not_touch),
        max_comfort_e: constraints.max_comfort_e,
    })
}

fn reach_to_wire(reach: Reach) -> v1::Reach {
    v1::Reach {
        client_shoulder: Some(vector_to_wire(reach.client_shoulder)),
        reach: reach.reach,
    }
}

fn approach_to_wire(approach: ApproachCone) -> v1::ApproachCone {
    v1::ApproachCone {
        client_direction: Some(vector_to_wire(approach.client_direction)),
        half_angle: approach.half_angle,
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::hand::Digit;

    #[test]
    fn converts_every_constraint() {
        let constraints = Constraints {
            receiver_reach: Some(Reach {
                client_shoulder: Vec3::new(1.0, 2.0, 3.0),
                reach: 4.0,
            }),
            approach: Some(ApproachCone {
                client_direction: Vec3::new(5.0, 6.0, 7.0),
                half_angle: 0.8,
            }),
            allowed_grasp_types: vec![GraspType::Tripod, GraspType::LargeDiameter],
            excluded_grasp_types: vec![GraspType::InferiorPincer],
            must_touch: vec![Digit::Thumb, Digit::Index],
            must_not_touch: vec![Digit::Middle, Digit::Ring, Digit::Little],
            max_comfort_e: Some(0.9),
        };
        let vector = |x, y, z| Some(v1::Vector3 { x, y, z });
        let expected = v1::Constraints {
            receiver_reach: Some(v1::Reach {
                client_shoulder: vector(1.0, 2.0, 3.0),
                reach: 4.0,
            }),
            approach: Some(v1::ApproachCone {
                client_direction: vector(5.0, 6.0, 7.0),
                half_angle: 0.8,
            }),
            allowed_grasp_types: vec![v1::GraspType::Tripod.into(), v1::GraspType::LargeDiameter.into()],
            excluded_grasp_types: vec![v1::GraspType::InferiorPincer.into()],
            must_touch: vec![1, 2],
            must_not_touch: vec![3, 4, 5],
            max_comfort_e: Some(0.9),
        };
        assert_eq!(constraints_to_wire(&constraints), Some(expected));
    }

    #[test]
    fn no_constraints_send_nothing() {
        assert_eq!(constraints_to_wire(&Constraints::default()), None);
        let only_comfort = Constraints {
            max_comfort_e: Some(0.0),
            ..Constraints::default()
        };
        assert!(constraints_to_wire(&only_comfort).is_some());
    }
}
