//! The built-in assets: they agree with one another and with the thesis, and are sound.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;
use grasp_assets::{
    atlases::{grips, held_primitives},
    hands::{Hand, RIG_NAMES, hand},
    holdouts::{BuiltInHoldout, Origin, holdout, holdouts},
    objects::{BuiltInObject, Manifest, object, objects},
};
use grasp_synthesis::{
    base::pose::Pose,
    geometry::{mesh::TriangleMesh, mesh_bvh::MeshBvh, topology::Topology},
    known::primitives::Primitive,
    model::{
        hand::{
            HandPose, Handedness,
            joints::{HandJoints, index},
            kinematics::hand_frames,
        },
        strategy::Validity,
    },
};

/// All built-in hands.
fn all() -> impl Iterator<Item = &'static Hand> {
    RIG_NAMES
        .into_iter()
        .flat_map(|rig| [Handedness::Left, Handedness::Right].map(|side| built_in(rig, side)))
}

fn built_in(rig: &str, handedness: Handedness) -> &'static Hand {
    hand(rig, handedness).expect("the rig is built in")
}

#[test]
fn thesis_limits_match_table_4_1() {
    for side in [Handedness::Left, Handedness::Right] {
        let rig = &built_in("thesis", side).rig;
        for (i, digit) in rig.digits.iter().enumerate() {
            let expected = if i == 0 {
                [[0.0, 45.0], [0.0, 60.0], [-45.0, 45.0]]
            } else {
                [[-5.0, 5.0], [0.0, 90.0], [0.0, 90.0]]
            };
            let limits = digit.limits;
            for (range, [min, max]) in [limits.base_yaw, limits.base_pitch, limits.second_pitch]
                .into_iter()
                .zip(expected)
            {
                assert!((range.min.to_degrees() - min).abs() < 1e-4, "digit {i}");
                assert!((range.max.to_degrees() - max).abs() < 1e-4, "digit {i}");
            }
            // The third joint follows the second by two thirds.
            for (third, second) in [
                (limits.third_pitch.min, limits.second_pitch.min),
                (limits.third_pitch.max, limits.second_pitch.max),
            ] {
                assert!((third - second * 2.0 / 3.0).abs() < 1e-6, "digit {i}");
            }
        }
    }
}

#[test]
fn the_stretched_middle_finger_has_the_rigs_reach() {
    for (name, reach) in [("thesis", 0.22), ("adult", 0.19)] {
        for side in [Handedness::Left, Handedness::Right] {
            let rig = &built_in(name, side).rig;
            let frames = hand_frames(
                rig,
                &HandPose {
                    frame_from_wrist: Pose::IDENTITY,
                    digits: rig.stretched(),
                },
            );
            // The middle finger's limits contain zero, so it is straight.
            let tip = frames.digits[2].tip;
            assert!((tip.length() - rig.reach).abs() < 1e-6);
            let tolerance = if name == "thesis" { 1e-6 } else { 1e-3 };
            assert!(
                (rig.reach - reach).abs() < tolerance,
                "{name} reaches {}",
                rig.reach
            );
            assert!(tip.y > 0.999 * tip.length(), "the fingers stretch along +y");
        }
    }
}

#[test]
fn skins_are_closed_and_face_outward() {
    for hand in all() {
        let skin = &hand.skin;
        let mut edges = BTreeMap::new();
        for &[a, b, c] in &skin.triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for (&(a, b), &count) in &edges {
            assert_eq!(count, 1, "edge {a}-{b} is used twice in one direction");
            assert!(edges.contains_key(&(b, a)), "edge {a}-{b} is open");
        }
        // Euler's formula for a sphere.
        let (v, e, f) = (skin.positions.len(), edges.len() / 2, skin.triangles.len());
        assert_eq!(v + f, e + 2, "the skin has no handles and no holes");
        let volumes = skin.triangles.iter().map(|&triangle| {
            let [a, b, c] = triangle.map(|v| skin.positions[v as usize]);
            a.dot(b.cross(c)) / 6.0
        });
        let litres = 1e3 * volumes.sum::<f32>();
        let size = (hand.rig.reach / 0.19).powi(3);
        // About 0.4 litres for an adult's hand with part of the forearm.
        assert!(
            (0.35..0.55).contains(&(litres / size)),
            "{} holds {litres} litres",
            hand.rig.name
        );
    }
}

/// Names and types in the captions of the thesis' Figures 5.2 to 5.4.
const THESIS: [(&str, &str); 15] = [
    ("remote-genhold1", "Prismatic 4 Finger"),
    ("remote-genhold2", "Medium Wrap"),
    ("remote-genhold3", "Ring"),
    ("remote-hold1", "Light Tool"),
    ("remote-hold2", "Index Finger Extension"),
    ("scalpel-genhold1", "Ring"),
    ("scalpel-genhold2", "Small Diameter"),
    ("scalpel-genhold3", "Palmar Pinch"),
    ("scalpel-hold1", "Prismatic 2 Finger"),
    ("scalpel-hold2", "Adduction Grip"),
    ("scissors-genhold1", "Palmar Pinch"),
    ("scissors-genhold2", "Prismatic 2 Finger"),
    ("scissors-genhold3", "Writing Tripod"),
    ("scissors-hold1", "Lateral"),
    ("scissors-hold2", "Adducted Thumb"),
];

fn giver(holdout: &BuiltInHoldout) -> &'static Hand {
    hand(&holdout.giver_rig, holdout.giver_handedness).expect("the giver's rig is built in")
}

/// The giver's hand in the object's frame.
fn giver_in_object(holdout: &BuiltInHoldout) -> HandPose {
    HandPose {
        frame_from_wrist: holdout.world_from_object.inverse() * holdout.world_from_giver_wrist,
        digits: holdout.giver_digits,
    }
}

fn surface(holdout: &BuiltInHoldout) -> &'static MeshBvh {
    &object(&holdout.object)
        .expect("the object is built in")
        .object
        .surface
}

/// Depth of a point below a surface, in metres; 0 outside.
fn depth(surface: &MeshBvh, point: Vec3) -> f32 {
    if surface.contains(point) {
        surface
            .closest_point_within(point, 1.0)
            .map_or(0.0, |closest| closest.distance)
    } else {
        0.0
    }
}

#[test]
fn holdouts_are_the_fifteen_of_the_thesis() {
    let named: Vec<_> = holdouts()
        .iter()
        .map(|h| (h.name.as_str(), h.grasp_type.as_str()))
        .collect();
    assert_eq!(named, THESIS);
    for built_in in holdouts() {
        assert!(
            built_in.name.starts_with(&format!("{}-", built_in.object)),
            "{}",
            built_in.name
        );
        assert_eq!(holdout(&built_in.name), Some(built_in));
        let synthesized = matches!(built_in.origin, Origin::Synthesized { .. });
        assert_eq!(
            synthesized,
            built_in.name.contains("-genhold"),
            "{}",
            built_in.name
        );
    }
    assert_eq!(holdout("remote-hold3"), None);
}

#[test]
fn givers_touch_with_two_digits_without_sinking_in() {
    for built_in in holdouts() {
        let name = &built_in.name;
        let (hand, pose, surface) = (giver(built_in), giver_in_object(built_in), surface(built_in));

        // The skin touches, and is not pressed in deeper than flesh gives way.
        let skin = hand.skin.posed(&HandJoints::of_pose(&hand.rig, &pose));
        let mut touching = BTreeSet::new();
        for (vertex, &point) in skin.iter().enumerate() {
            let deep = depth(surface, point);
            assert!(deep < 0.005, "{name}: skin is {deep} m deep");
            let near = surface.closest_point_within(point, 0.003).is_some() || deep > 0.0;
            let (&joint, _) = hand.skin.joint_indices[vertex]
                .iter()
                .zip(hand.skin.weights[vertex])
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .expect("a vertex has four weights");
            let digit = (0..5).find(|&d| {
                (index::FIRST_OF_DIGIT[d] + usize::from(d > 0)..=index::TIP_OF_DIGIT[d])
                    .contains(&usize::from(joint))
            });
            if near {
                touching.extend(digit);
            }
        }
        assert!(touching.len() >= 2, "{name}: only digits {touching:?} touch");
    }
}

/// Known data of an object: name, mass in kg and triangles in Table 5.1 of the thesis; least and greatest size along x, y, z in
/// mm; least and greatest volume in cm³. Steel has 7.9 g/cm³, so 50 g of scissors are 6.3 cm³ and 20 g of scalpel 2.5 cm³; a remote
/// of 130 g is mostly air and plastic of about 1 g/cm³ on the whole.
struct About {
    name: &'static str,
    mass: f32,
    triangles: usize,
    sizes: [[f32; 3]; 2],
    volumes: [f64; 2],
}

const ALL: [About; 3] = [
    About {
        name: "remote",
        mass: 0.130,
        triangles: 2203,
        sizes: [[45.0, 165.0, 19.0], [52.0, 175.0, 23.0]],
        volumes: [110.0, 150.0],
    },
    About {
        name: "scalpel",
        mass: 0.020,
        triangles: 1453,
        sizes: [[8.0, 140.0, 2.5], [12.0, 160.0, 4.5]],
        volumes: [2.2, 3.4],
    },
    About {
        name: "scissors",
        mass: 0.050,
        triangles: 572,
        sizes: [[55.0, 150.0, 3.0], [75.0, 170.0, 7.0]],
        volumes: [5.5, 7.5],
    },
];

fn mesh(object: &BuiltInObject) -> &TriangleMesh {
    object.object.surface.mesh()
}

#[test]
fn objects_are_closed_and_as_the_thesis_describes_them() {
    let names: Vec<_> = objects().iter().map(|object| object.name).collect();
    assert_eq!(names, ALL.map(|about| about.name));
    assert!(object("Scissors").is_none());
    for about in ALL {
        let name = about.name;
        let object = object(name).expect("it is built in");
        let mesh = mesh(object);
        let topology = Topology::of(mesh);
        assert!(topology.is_closed() && topology.is_consistently_wound(), "{name}");
        let triangles = mesh.triangles().len();
        assert!(
            triangles.abs_diff(about.triangles) * 50 <= about.triangles,
            "{name}: {triangles}"
        );
        assert_eq!(object.object.mass, about.mass);
        assert_eq!(object.object.friction_under(Validity::Thesis), 0.34);
        let volume = mesh.signed_volume() * 1e6;
        assert!(
            (about.volumes[0]..about.volumes[1]).contains(&volume),
            "{name}: {volume} cm³"
        );
        let [least, greatest] = about.sizes.map(Vec3::from);
        let size = mesh.aabb().extents() * 1000.0;
        assert!(
            size.cmpge(least).all() && size.cmple(greatest).all(),
            "{name}: {size} mm"
        );
        assert!(
            mesh.aabb().centre().abs().max_element() < 1e-6,
            "{name} is not centred"
        );
        assert!(mesh.aabb().contains(object.object.centre_of_mass), "{name}");
    }
}

#[test]
fn forbidden_surfaces_are_buttons_and_the_blade() {
    assert_eq!(object("scissors").unwrap().object.forbidden_count(), 0);

    let remote = object("remote").unwrap();
    assert!(remote.object.forbidden_count() > 500);
    for triangle in forbidden(remote) {
        let centre = centroid(mesh(remote), triangle);
        let faces_up = mesh(remote).normal(triangle).z > -0.01;
        assert!(
            centre.z > 0.008 && centre.y > -0.07 && faces_up,
            "no button is at {centre}"
        );
    }

    let scalpel = object("scalpel").unwrap();
    assert!(scalpel.object.forbidden_count() > 50);
    let high = mesh(scalpel).aabb().max;
    for triangle in forbidden(scalpel) {
        let centre = centroid(mesh(scalpel), triangle);
        let is_thin = centre.z.abs() < 0.0004;
        assert!(centre.y > high.y - 0.035 && is_thin, "not on the blade: {centre}");
    }
}

fn forbidden(object: &BuiltInObject) -> impl Iterator<Item = usize> {
    (0..mesh(object).triangles().len()).filter(|&t| object.object.is_forbidden(t as u32))
}

fn centroid(mesh: &TriangleMesh, triangle: usize) -> Vec3 {
    mesh.corners(triangle).into_iter().sum::<Vec3>() / 3.0
}

#[test]
fn manifests_agree_with_the_meshes() {
    for object in objects() {
        let manifest = Manifest::parse(object.manifest).unwrap();
        assert_eq!(manifest.name, object.name);
        assert_eq!(manifest.triangles, mesh(object).triangles().len());
        assert_eq!(manifest.vertices, mesh(object).positions().len());
        assert_eq!(manifest.mass_kg, object.object.mass);
        assert_eq!(manifest.centre_of_mass_m, object.object.centre_of_mass);
        let stated = manifest.oriented_box;
        let fitted = object.object.bounding_box;
        let difference = (stated.centre_m - fitted.object_from_box.position)
            .abs()
            .max((stated.half_extents_m - fitted.half_extents).abs());
        assert!(difference.max_element() < 2e-6, "{}: {stated:?}", object.name);
        assert!(stated.orientation.is_normalized());
        assert!(
            stated
                .orientation
                .angle_between(fitted.object_from_box.orientation)
                < 1e-3
        );
    }
}

/// Distance of a point from the surface of a centred box.
fn from_box(half: Vec3, point: Vec3) -> f32 {
    let beyond = point.abs() - half;
    let outside = beyond.max(Vec3::ZERO).length();
    (outside + beyond.max_element().min(0.0)).abs()
}

#[test]
fn both_hands_have_many_touching_grips_of_every_primitive() {
    assert_eq!(held_primitives().len(), 2);
    for (hand, held) in held_primitives() {
        let primitives: Vec<Primitive> = held.iter().map(|held| held.primitive).collect();
        assert_eq!(primitives, Primitive::ALL);
        for held in held.iter() {
            let name = held.primitive.name();
            assert!(grips(held.primitive, &hand.rig).is_some());
            let entries = held.grips.entries();
            assert!((50..1000).contains(&entries.len()), "{name}: {}", entries.len());
            for contact in entries.iter().flat_map(|entry| &entry.contacts) {
                let off = from_box(held.primitive.half_extents, contact.position);
                assert!(off < 1e-5, "{name}: a contact is {off} m off the surface");
            }
        }
    }
}
