//! Checks the regions of an object, but for what only its file tells.

use glam::Vec3;
use grasp_proto::v1;
use grasp_synthesis::{
    geometry::{oriented_box::OrientedBox, zone::Zone},
    model::regions::Wish,
};

use super::{
    FARTHEST, Field, Violations, direction, finite, given_names::GivenNames, obstacles::required, point, pose,
};

/// Largest number of regions of an object.
const MOST_REGIONS: usize = 32;

/// Largest number of shapes in all of them, where each segment of a tube counts: contacts are compared with each, at some
/// nanoseconds.
const MOST_SHAPES: usize = 64;

/// Largest number of triangles listed in all of them. Descriptions of the object repeat them.
const MOST_TRIANGLES: usize = 20_000;

/// Largest number of groups named in all of them, likewise.
const MOST_GROUPS: usize = 256;

/// A checked region, as a client gave it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RegionFields {
    /// The message.
    pub given: v1::Region,
    /// What hands do with it.
    pub kind: RegionKind,
    /// Its shapes.
    pub zones: Vec<Zone>,
}

/// What hands do with a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RegionKind {
    /// They do not touch it.
    Forbidden,
    /// They take or leave it, by a weight of more than 0 and at most 1.
    Weighted(Wish, f32),
}

/// The regions, in their places; those that are wrong are forbidden.
pub(super) fn regions(
    field: Field<'_>,
    given: Vec<v1::Region>,
    violations: &mut Violations,
) -> Vec<RegionFields> {
    let sum = |count: &dyn Fn(&v1::Region) -> usize| given.iter().map(count).sum::<usize>();
    for (count, most, what) in [
        (given.len(), MOST_REGIONS, "regions"),
        (sum(&|region| region.triangles.len()), MOST_TRIANGLES, "triangles"),
        (sum(&|region| region.groups.len()), MOST_GROUPS, "groups"),
        (
            sum(&|region| region.shapes.iter().map(parts).sum()),
            MOST_SHAPES,
            "shapes, segments of tubes counted each,",
        ),
    ] {
        if count > most {
            violations.add(
                field,
                format_args!("has {count} {what} in all; it may have up to {most}"),
            );
            return Vec::new();
        }
    }
    let mut names = GivenNames::of("region");
    let mut checked = Vec::with_capacity(given.len());
    for (place, given) in given.into_iter().enumerate() {
        let field = field.at(place);
        names.check(field.child("name"), &given.name, violations);
        checked.push(region(field, given, violations));
    }
    checked
}

/// Number of shapes as which one counts.
fn parts(shape: &v1::RegionShape) -> usize {
    match &shape.shape {
        Some(v1::region_shape::Shape::Tube(tube)) => tube.points.len().saturating_sub(1).max(1),
        _ => 1,
    }
}

fn region(field: Field<'_>, given: v1::Region, violations: &mut Violations) -> RegionFields {
    let kind = kind(field, &given, violations);
    if given.groups.is_empty() && given.triangles.is_empty() && given.shapes.is_empty() {
        violations.add(field, "marks nothing; it must have groups, triangles or shapes");
    }
    let shapes = field.child("shapes");
    let zones = given.shapes.iter().enumerate();
    let zones = zones.filter_map(|(place, shape)| zone(shapes.at(place), shape, violations));
    RegionFields {
        zones: zones.collect(),
        kind: kind.unwrap_or(RegionKind::Forbidden),
        given,
    }
}

fn kind(field: Field<'_>, given: &v1::Region, violations: &mut Violations) -> Option<RegionKind> {
    let wish = match v1::RegionKind::try_from(given.kind) {
        Ok(v1::RegionKind::Forbidden) => None,
        Ok(v1::RegionKind::Avoid) => Some(Wish::Avoid),
        Ok(v1::RegionKind::Prefer) => Some(Wish::Prefer),
        Ok(v1::RegionKind::Unspecified) | Err(_) => {
            violations.add(
                field.child("kind"),
                format_args!(
                    "is {}; it must be REGION_KIND_FORBIDDEN, REGION_KIND_AVOID or REGION_KIND_PREFER",
                    given.kind
                ),
            );
            return None;
        }
    };
    match (wish, given.weight) {
        (None, None) => Some(RegionKind::Forbidden),
        (None, Some(weight)) => {
            violations.add(
                field.child("weight"),
                format_args!("is {weight}; leave it out, because a forbidden region is never touched"),
            );
            None
        }
        (Some(wish), weight) => {
            let weight = weight.unwrap_or(1.0);
            if weight > 0.0 && weight <= 1.0 {
                return Some(RegionKind::Weighted(wish, weight));
            }
            violations.add(
                field.child("weight"),
                format_args!("is {weight}; it must be more than 0 and at most 1"),
            );
            None
        }
    }
}

fn zone(field: Field<'_>, shape: &v1::RegionShape, violations: &mut Violations) -> Option<Zone> {
    use v1::region_shape::Shape;
    match &shape.shape {
        None => {
            violations.add(
                field,
                "is empty; it must have a sphere, a box, a half_space or a tube",
            );
            None
        }
        Some(Shape::Sphere(sphere)) => {
            let field = field.child("sphere");
            let centre = required(field.child("centre"), sphere.centre, violations);
            let centre = centre.map(|centre| point(field.child("centre"), centre, 1.0, violations));
            let radius = radius(field.child("radius"), sphere.radius, violations);
            Some(Zone::Ball {
                centre: centre?,
                radius: radius?,
            })
        }
        Some(Shape::Box(given)) => solid_box(field.child("box"), given, violations),
        Some(Shape::HalfSpace(half)) => {
            let field = field.child("half_space");
            let on = half
                .point
                .map_or(Vec3::ZERO, |on| point(field.child("point"), on, 1.0, violations));
            let normal = required(field.child("normal"), half.normal, violations)?;
            Some(Zone::HalfSpace {
                point: on,
                normal: direction(field.child("normal"), normal, violations)?,
            })
        }
        Some(Shape::Tube(tube)) => {
            let field = field.child("tube");
            let (count, points) = (tube.points.len(), field.child("points"));
            if !(2..=MOST_SHAPES).contains(&count) {
                violations.add(
                    points,
                    format_args!("has {count} points; it must have 2 to {MOST_SHAPES}"),
                );
            }
            let radius = radius(field.child("radius"), tube.radius, violations);
            let given = tube.points.iter().enumerate();
            let points = given
                .map(|(place, &on)| point(points.at(place), on, 1.0, violations))
                .collect();
            Some(Zone::Tube {
                points,
                radius: radius?,
            })
        }
    }
}

fn solid_box(field: Field<'_>, given: &v1::RegionBox, violations: &mut Violations) -> Option<Zone> {
    let object_from_box = pose(
        field.child("object_from_box"),
        given.object_from_box,
        1.0,
        violations,
    );
    let field = field.child("half_extents");
    let half_extents = required(field, given.half_extents, violations)?;
    let half_extents = finite(field, half_extents, violations);
    if !(half_extents.min_element() > 0.0 && half_extents.max_element() <= FARTHEST) {
        violations.add(
            field,
            format_args!("is {half_extents}; each must be more than 0 and at most {FARTHEST}"),
        );
        return None;
    }
    Some(Zone::Box(OrientedBox {
        object_from_box,
        half_extents,
    }))
}

fn radius(field: Field<'_>, radius: f32, violations: &mut Violations) -> Option<f32> {
    let is_right = radius > 0.0 && radius <= FARTHEST;
    if !is_right {
        violations.add(
            field,
            format_args!("is {radius}; it must be more than 0 and at most {FARTHEST}"),
        );
    }
    is_right.then_some(radius)
}

#[cfg(test)]
mod tests {
    use v1::region_shape::Shape;

    use super::*;
    use crate::error::ServiceError;

    fn vector(x: f32, y: f32, z: f32) -> v1::Vector3 {
        v1::Vector3 { x, y, z }
    }

    fn shape(shape: Shape) -> v1::RegionShape {
        v1::RegionShape { shape: Some(shape) }
    }

    fn tube(points: usize) -> v1::RegionShape {
        shape(Shape::Tube(v1::RegionTube {
            points: vec![v1::Vector3::default(); points],
            radius: 0.01,
        }))
    }

    fn preferred(name: &str, shapes: Vec<v1::RegionShape>) -> v1::Region {
        v1::Region {
            name: name.to_owned(),
            kind: v1::RegionKind::Prefer.into(),
            shapes,
            ..Default::default()
        }
    }

    fn blamed(given: Vec<v1::Region>) -> Vec<String> {
        let mut violations = Violations::default();
        regions(Field::root("regions"), given, &mut violations);
        match violations.finish(()) {
            Ok(()) => Vec::new(),
            Err(ServiceError::Invalid(violations)) => violations.into_iter().map(|v| v.field).collect(),
            Err(other) => panic!("{other}"),
        }
    }

    #[test]
    fn every_kind_of_shape_becomes_a_zone() {
        let given = preferred(
            "all",
            vec![
                shape(Shape::Sphere(v1::RegionSphere {
                    centre: Some(vector(1.0, 0.0, 0.0)),
                    radius: 0.5,
                })),
                shape(Shape::Box(v1::RegionBox {
                    object_from_box: None,
                    half_extents: Some(vector(1.0, 2.0, 3.0)),
                })),
                shape(Shape::HalfSpace(v1::RegionHalfSpace {
                    point: None,
                    normal: Some(vector(0.0, 0.0, 2.0)),
                })),
                tube(2),
            ],
        );
        let mut violations = Violations::default();
        let checked = regions(Field::root("regions"), vec![given.clone()], &mut violations);
        assert!(violations.is_empty());
        let [
            RegionFields {
                given: kept,
                kind,
                zones,
            },
        ] = checked.as_slice()
        else {
            panic!("{checked:?}");
        };
        assert_eq!((kept, *kind), (&given, RegionKind::Weighted(Wish::Prefer, 1.0)));
        assert!(matches!(
            zones.as_slice(),
            [
                Zone::Ball { .. },
                Zone::Box(_),
                Zone::HalfSpace { normal: Vec3::Z, .. },
                Zone::Tube { .. }
            ]
        ));
    }

    #[test]
    fn reports_every_violation_by_field() {
        let wrong = vec![
            v1::Region {
                name: String::new(),
                weight: Some(0.5),
                kind: v1::RegionKind::Forbidden.into(),
                ..Default::default()
            },
            v1::Region {
                name: "rim".to_owned(),
                weight: Some(1.5),
                ..preferred("", vec![v1::RegionShape::default(), tube(1)])
            },
            v1::Region {
                name: "rim".to_owned(),
                kind: 9,
                triangles: vec![1],
                ..Default::default()
            },
            preferred(
                "bad",
                vec![
                    shape(Shape::Sphere(v1::RegionSphere {
                        centre: None,
                        radius: f32::NAN,
                    })),
                    shape(Shape::Box(v1::RegionBox {
                        object_from_box: None,
                        half_extents: Some(vector(1.0, 0.0, 1.0)),
                    })),
                    shape(Shape::HalfSpace(v1::RegionHalfSpace {
                        point: Some(vector(f32::NAN, 0.0, 0.0)),
                        normal: Some(vector(0.0, 0.0, 0.0)),
                    })),
                ],
            ),
        ];
        assert_eq!(
            blamed(wrong),
            [
                "regions[0].name",
                "regions[0].weight",
                "regions[0]",
                "regions[1].weight",
                "regions[1].shapes[0]",
                "regions[1].shapes[1].tube.points",
                "regions[2].name",
                "regions[2].kind",
                "regions[3].shapes[0].sphere.centre",
                "regions[3].shapes[0].sphere.radius",
                "regions[3].shapes[1].box.half_extents",
                "regions[3].shapes[2].half_space.point",
                "regions[3].shapes[2].half_space.normal",
            ]
        );
    }

    #[test]
    fn counts_are_bounded() {
        let named = |count: usize| -> Vec<v1::Region> {
            (0..count)
                .map(|n| preferred(&n.to_string(), vec![tube(2)]))
                .collect()
        };
        assert!(blamed(named(MOST_REGIONS)).is_empty());
        assert_eq!(blamed(named(MOST_REGIONS + 1)), ["regions"]);
        assert!(blamed(vec![preferred("a", vec![tube(MOST_SHAPES)])]).is_empty());
        assert_eq!(
            blamed(vec![preferred("a", vec![tube(MOST_SHAPES), tube(3)])]),
            ["regions"]
        );
        let listing = |triangles: usize, groups: usize| v1::Region {
            triangles: vec![0; triangles],
            groups: vec![String::new(); groups],
            ..preferred("a", Vec::new())
        };
        assert_eq!(blamed(vec![listing(MOST_TRIANGLES + 1, 0)]), ["regions"]);
        assert_eq!(blamed(vec![listing(0, MOST_GROUPS + 1)]), ["regions"]);
    }
}
