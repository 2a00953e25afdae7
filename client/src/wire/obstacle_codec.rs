//! Obstacles.

use grasp_proto::v1::{self, obstacle::Shape};

use super::geometry_codec::{pose_to_wire, vector_to_wire};
use crate::obstacle::{Capsule, Obstacle, SolidBox};

pub(super) fn obstacle_to_wire(obstacle: &Obstacle) -> v1::Obstacle {
    let shape = match *obstacle {
        Obstacle::Capsule(Capsule {
            client_start,
            client_end,
            radius,
            end_radius,
        }) => Shape::Capsule(v1::CapsuleShape {
            client_start: Some(vector_to_wire(client_start)),
            client_end: Some(vector_to_wire(client_end)),
            radius,
            end_radius,
        }),
        Obstacle::Box(SolidBox {
            client_from_box,
            half_extents,
        }) => Shape::Box(v1::BoxShape {
            client_from_box: Some(pose_to_wire(client_from_box)),
            half_extents: Some(vector_to_wire(half_extents)),
        }),
    };
    v1::Obstacle { shape: Some(shape) }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::pose::Pose;

    #[test]
    fn converts_every_field_of_both_shapes() {
        let capsule = obstacle_to_wire(&Obstacle::Capsule(Capsule {
            client_start: Vec3::new(1.0, 2.0, 3.0),
            client_end: Vec3::new(4.0, 5.0, 6.0),
            radius: 7.0,
            end_radius: Some(8.0),
        }));
        let Some(Shape::Capsule(capsule)) = capsule.shape else {
            panic!("{capsule:?}");
        };
        assert_eq!(capsule.client_start.map(|start| start.z), Some(3.0));
        assert_eq!(capsule.client_end.map(|end| end.x), Some(4.0));
        assert_eq!((capsule.radius, capsule.end_radius), (7.0, Some(8.0)));

        let pose = Pose::new(Vec3::new(1.0, 2.0, 3.0), Quat::from_xyzw(0.0, 1.0, 0.0, 0.0));
        let solid = obstacle_to_wire(&Obstacle::solid_box(pose, Vec3::new(4.0, 5.0, 6.0)));
        let Some(Shape::Box(solid)) = solid.shape else {
            panic!("{solid:?}");
        };
        assert_eq!(solid.client_from_box, Some(pose_to_wire(pose)));
        assert_eq!(solid.half_extents.map(|half| half.y), Some(5.0));
    }

    #[test]
    fn reads_both_shapes_from_json() {
        let text = r#"[{"box": {"client_from_box": {"position": [0, 0.7, 0]}, "half_extents": [0.6, 0.02, 0.4]}},
            {"capsule": {"client_start": [0, 0, 0], "client_end": [0, 1, 0], "radius": 0.05}}]"#;
        let read: Vec<Obstacle> = serde_json::from_str(text).unwrap();
        let table = Pose::new(Vec3::new(0.0, 0.7, 0.0), Quat::IDENTITY);
        assert_eq!(
            read,
            [
                Obstacle::solid_box(table, Vec3::new(0.6, 0.02, 0.4)),
                Obstacle::capsule(Vec3::ZERO, Vec3::Y, 0.05),
            ]
        );
        let unknown = serde_json::from_str::<Obstacle>(r#"{"box": {"half_extents": [1, 1, 1], "size": 1}}"#);
        assert!(unknown.unwrap_err().to_string().contains("unknown field `size`"));
    }
}
