//! Checks the regions of an object, but for what only its file tells.

use grasp_proto::v1;
use grasp_synthesis::{
    geometry::{tapered_capsule::TaperedCapsule, zone::Zone},
    model::regions::Wish,
};

use super::{
    Field, check_count, check_positive,
    names::GivenNames,
    shapes::{Shape, parts, shape},
};
use crate::convention::Convention;

/// Largest number of regions of an object.
const MAX_REGIONS: usize = 32;

/// Largest number of shapes in all of them, where each segment of a tube counts: contacts are compared with each.
const MAX_SHAPES: usize = 64;

/// Largest number of triangles listed in all of them. Descriptions of the object repeat them.
const MAX_TRIANGLES: usize = 20_000;

/// Largest number of groups named in all of them, likewise.
const MAX_GROUPS: usize = 256;

/// A checked region, as a client gave it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RegionFields {
    /// The message.
    pub given: v1::Region,
    /// What hands do with it.
    pub kind: RegionKind,
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

/// The regions; empty if they are more, or mark more, than those of a request may.
pub(super) fn bounded_regions(field: Field<'_>, given: Vec<v1::Region>) -> Vec<v1::Region> {
    let sum = |count: &dyn Fn(&v1::Region) -> usize| given.iter().map(count).sum::<usize>();
    let shapes = sum(&|region| region.shapes.iter().map(parts).sum());
    let marked = [
        (given.len(), MAX_REGIONS, "regions in all"),
        (
            sum(&|region| region.triangles.len()),
            MAX_TRIANGLES,
            "triangles in all",
        ),
        (sum(&|region| region.groups.len()), MAX_GROUPS, "groups in all"),
        (
            shapes,
            MAX_SHAPES,
            "shapes, segments of tubes counted each, in all",
        ),
    ];
    let is_within = |(count, most, what)| check_count(field, count, most, what);
    if marked.into_iter().all(is_within) {
        given
    } else {
        Vec::new()
    }
}

/// The regions, in their places; those that are wrong are forbidden.
pub(super) fn regions(field: Field<'_>, given: Vec<v1::Region>) -> Vec<RegionFields> {
    let mut names = GivenNames::of("region");
    let mut checked = Vec::with_capacity(given.len());
    for (place, given) in given.into_iter().enumerate() {
        let field = field.at(place);
        names.check(field.child("name"), &given.name);
        checked.push(region(field, given));
    }
    checked
}

fn region(field: Field<'_>, given: v1::Region) -> RegionFields {
    let kind = kind(field, &given);
    if given.groups.is_empty() && given.triangles.is_empty() && given.shapes.is_empty() {
        field.add("marks nothing; it must have groups, triangles or shapes");
    }
    let shapes = field.child("shapes");
    let zones = given.shapes.iter().enumerate();
    let zones = zones.filter_map(|(place, shape)| zone(shapes.at(place), shape));
    RegionFields {
        zones: zones.collect(),
        kind: kind.unwrap_or(RegionKind::Forbidden),
        given,
    }
}

fn kind(field: Field<'_>, given: &v1::Region) -> Option<RegionKind> {
    let wish = match v1::Preference::try_from(given.preference) {
        Ok(v1::Preference::Forbidden) => None,
        Ok(v1::Preference::Avoided) => Some(Wish::Avoid),
        Ok(v1::Preference::Preferred) => Some(Wish::Prefer),
        Ok(v1::Preference::Unspecified) | Err(_) => {
            return field.child("preference").reject(format_args!(
                "is {}; it must be PREFERENCE_PREFERRED, PREFERENCE_AVOIDED or PREFERENCE_FORBIDDEN",
                given.preference
            ));
        }
    };
    match (wish, given.weight) {
        (None, None) => Some(RegionKind::Forbidden),
        (None, Some(weight)) => field.child("weight").reject(format_args!(
            "is {weight}; leave it out, because a forbidden region is never touched"
        )),
        (Some(wish), weight) => {
            let weight = weight.unwrap_or(1.0);
            let is_right = check_positive(field.child("weight"), weight, 1.0);
            is_right.then_some(RegionKind::Weighted(wish, weight))
        }
    }
}

fn zone(field: Field<'_>, sent: &v1::Shape) -> Option<Zone> {
    match shape(field, sent, Convention::OpenXr)? {
        Shape::Tube(parts) => tube_zone(parts),
        Shape::Box(solid) => Some(Zone::Box(solid)),
        Shape::HalfSpace { point, normal } => Some(Zone::HalfSpace { point, normal }),
    }
}

/// The zone of a tube; `None` without parts.
fn tube_zone(parts: Vec<TaperedCapsule>) -> Option<Zone> {
    let first = *parts.first()?;
    let radius = first.start_radius;
    let is_even = |part: &TaperedCapsule| part.start_radius == radius && part.end_radius == radius;
    if !parts.iter().all(is_even) {
        return Some(Zone::TaperedTube(parts));
    }
    if parts.len() == 1 && first.start == first.end {
        let centre = first.start;
        return Some(Zone::Ball { centre, radius });
    }
    let starts = std::iter::once(first.start);
    Some(Zone::Tube {
        points: starts.chain(parts.iter().map(|part| part.end)).collect(),
        radius,
    })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use grasp_proto::v1::shape::Kind;

    use super::*;
    use crate::validate::testing::read_at;

    fn shape(kind: Kind) -> v1::Shape {
        v1::Shape { kind: Some(kind) }
    }

    fn tube(points: usize) -> v1::Shape {
        v1::Shape::tube((0..points).map(|x| Vec3::X * x as f32), 0.01)
    }

    fn tapered(points: usize, radii: &[f32]) -> v1::Shape {
        shape(Kind::Tube(v1::TubeShape {
            points: vec![v1::Vector3::default(); points],
            radii: radii.to_vec(),
        }))
    }

    fn preferred(name: &str, shapes: Vec<v1::Shape>) -> v1::Region {
        v1::Region {
            shapes,
            ..v1::Region::new(name, v1::Preference::Preferred)
        }
    }

    fn blamed(given: Vec<v1::Region>) -> Vec<String> {
        read_at("regions", |field| regions(field, bounded_regions(field, given))).1
    }

    #[test]
    fn every_kind_of_shape_becomes_a_zone() {
        let given = preferred(
            "all",
            vec![
                v1::Shape::ball(Vec3::X, 0.5),
                shape(Kind::Box(v1::BoxShape {
                    pose: None,
                    half_extents: Some(Vec3::new(1.0, 2.0, 3.0).into()),
                })),
                shape(Kind::HalfSpace(v1::HalfSpaceShape {
                    point: None,
                    normal: Some((2.0 * Vec3::Z).into()),
                })),
                tube(3),
                tapered(3, &[0.1; 3]),
                tapered(3, &[0.1, 0.2, 0.1]),
            ],
        );
        let (checked, blamed) = read_at("regions", |field| regions(field, vec![given.clone()]));
        assert!(blamed.is_empty());
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
        let [
            Zone::Ball { centre: Vec3::X, .. },
            Zone::Box(_),
            Zone::HalfSpace { normal: Vec3::Z, .. },
            Zone::Tube { points, .. },
            Zone::Tube { .. },
            Zone::TaperedTube(parts),
        ] = zones.as_slice()
        else {
            panic!("{zones:?}");
        };
        assert_eq!(points, &[Vec3::ZERO, Vec3::X, 2.0 * Vec3::X]);
        assert_eq!((parts.len(), parts[0].end_radius), (2, 0.2));
    }

    #[test]
    fn reports_every_violation_by_field() {
        let wrong = vec![
            v1::Region {
                weight: Some(0.5),
                ..v1::Region::new("", v1::Preference::Forbidden)
            },
            v1::Region {
                weight: Some(1.5),
                ..preferred("rim", vec![v1::Shape::default(), tapered(0, &[0.1])])
            },
            v1::Region {
                name: "rim".to_owned(),
                preference: 9,
                triangles: vec![1],
                ..Default::default()
            },
            preferred(
                "bad",
                vec![v1::Shape::half_space(Vec3::splat(f32::NAN), Vec3::ZERO)],
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
                "regions[2].preference",
                "regions[3].shapes[0].half_space.point",
                "regions[3].shapes[0].half_space.normal",
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
        assert!(blamed(named(MAX_REGIONS)).is_empty());
        assert_eq!(blamed(named(MAX_REGIONS + 1)), ["regions"]);
        assert!(blamed(vec![preferred("a", vec![tube(MAX_SHAPES)])]).is_empty());
        assert_eq!(
            blamed(vec![preferred("a", vec![tube(MAX_SHAPES), tube(3)])]),
            ["regions"]
        );
        let listing = |triangles: usize, groups: usize| v1::Region {
            triangles: vec![0; triangles],
            groups: vec![String::new(); groups],
            ..preferred("a", Vec::new())
        };
        assert_eq!(blamed(vec![listing(MAX_TRIANGLES + 1, 0)]), ["regions"]);
        assert_eq!(blamed(vec![listing(0, MAX_GROUPS + 1)]), ["regions"]);
    }
}
