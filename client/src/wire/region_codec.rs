//! Regions of objects.

use grasp_proto::v1::{self, region_shape::Shape};

use super::{
    Malformed, each,
    geometry_codec::{pose_from_wire, pose_to_wire, vector_from_wire, vector_to_wire},
    required,
};
use crate::region::{Region, RegionKind, RegionShape};

pub(super) fn region_to_wire(region: &Region) -> v1::Region {
    v1::Region {
        name: region.name.clone(),
        kind: match region.kind {
            RegionKind::Forbidden => v1::RegionKind::Forbidden,
            RegionKind::Avoid => v1::RegionKind::Avoid,
            RegionKind::Prefer => v1::RegionKind::Prefer,
        }
        .into(),
        weight: region.weight,
        groups: region.groups.clone(),
        triangles: region.triangles.clone(),
        shapes: region.shapes.iter().map(shape_to_wire).collect(),
    }
}

fn shape_to_wire(shape: &RegionShape) -> v1::RegionShape {
    let shape = match shape {
        RegionShape::Sphere { centre, radius } => Shape::Sphere(v1::RegionSphere {
            centre: Some(vector_to_wire(*centre)),
            radius: *radius,
        }),
        RegionShape::Box {
            object_from_box,
            half_extents,
        } => Shape::Box(v1::RegionBox {
            object_from_box: Some(pose_to_wire(*object_from_box)),
            half_extents: Some(vector_to_wire(*half_extents)),
        }),
        RegionShape::HalfSpace { point, normal } => Shape::HalfSpace(v1::RegionHalfSpace {
            point: Some(vector_to_wire(*point)),
            normal: Some(vector_to_wire(*normal)),
        }),
        RegionShape::Tube { points, radius } => Shape::Tube(v1::RegionTube {
            points: points.iter().copied().map(vector_to_wire).collect(),
            radius: *radius,
        }),
    };
    v1::RegionShape { shape: Some(shape) }
}

pub(super) fn region_from_wire(region: v1::Region) -> Result<Region, Malformed> {
    let kind = match v1::RegionKind::try_from(region.kind) {
        Ok(v1::RegionKind::Forbidden) => RegionKind::Forbidden,
        Ok(v1::RegionKind::Avoid) => RegionKind::Avoid,
        Ok(v1::RegionKind::Prefer) => RegionKind::Prefer,
        Ok(v1::RegionKind::Unspecified) | Err(_) => {
            return Err(Malformed::unknown_value("kind", region.kind));
        }
    };
    Ok(Region {
        name: region.name,
        kind,
        weight: region.weight,
        groups: region.groups,
        triangles: region.triangles,
        shapes: each("shapes", region.shapes, shape_from_wire)?,
    })
}

fn shape_from_wire(shape: v1::RegionShape) -> Result<RegionShape, Malformed> {
    Ok(match required("shape", shape.shape)? {
        Shape::Sphere(sphere) => RegionShape::Sphere {
            centre: vector_from_wire(required("sphere.centre", sphere.centre)?),
            radius: sphere.radius,
        },
        Shape::Box(of) => RegionShape::Box {
            object_from_box: pose_from_wire(of.object_from_box),
            half_extents: vector_from_wire(required("box.half_extents", of.half_extents)?),
        },
        Shape::HalfSpace(half) => RegionShape::HalfSpace {
            point: half.point.map(vector_from_wire).unwrap_or_default(),
            normal: vector_from_wire(required("half_space.normal", half.normal)?),
        },
        Shape::Tube(tube) => RegionShape::Tube {
            points: tube.points.into_iter().map(vector_from_wire).collect(),
            radius: tube.radius,
        },
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::pose::Pose;

    #[test]
    fn regions_survive_the_wire() {
        let shapes = vec![
            RegionShape::Sphere {
                centre: Vec3::X,
                radius: 0.1,
            },
            RegionShape::Box {
                object_from_box: Pose::new(Vec3::Y, glam::Quat::IDENTITY),
                half_extents: Vec3::splat(0.2),
            },
            RegionShape::HalfSpace {
                point: Vec3::Z,
                normal: Vec3::NEG_Y,
            },
            RegionShape::Tube {
                points: vec![Vec3::ZERO, Vec3::X],
                radius: 0.3,
            },
        ];
        for kind in [RegionKind::Forbidden, RegionKind::Avoid, RegionKind::Prefer] {
            let region = Region {
                weight: Some(0.5),
                groups: vec!["rim".to_owned()],
                triangles: vec![7],
                ..Region::of_shapes("handle", kind, shapes.clone())
            };
            assert_eq!(region_from_wire(region_to_wire(&region)).as_ref(), Ok(&region));
            let json = serde_json::to_string(&region).unwrap();
            assert_eq!(serde_json::from_str::<Region>(&json).unwrap(), region);
        }
        let unknown = v1::Region::default();
        assert_eq!(region_from_wire(unknown).unwrap_err().path, "kind");
    }
}
