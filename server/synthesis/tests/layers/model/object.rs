//! Objects: changed properties, forbidden surfaces, regions.

use crate::prelude::*;
use grasp_synthesis::geometry::mesh::MeshError;
use grasp_synthesis::model::hand::joints::Skin;
use grasp_synthesis::model::holdout::PresentingHandError;
use grasp_synthesis::model::plain_object::{MAX_NAMED_TRIANGLES, ObjectError};

#[test]
fn is_forbidden_within_matches_the_forbidden_triangles() {
    const STEPS: u16 = 12;
    const RADIUS: f32 = 0.002;
    for (name, least_near) in [("remote", 50), ("scalpel", 20), ("scissors", 0)] {
        let object = object(name);
        let mesh = object.surface.mesh();
        let forbidden = (0..mesh.triangles().len()).filter(|&t| object.is_forbidden(t as u32));
        let mut points = Vec::new();
        let mut slack: f32 = 0.0;
        for [a, b, c] in forbidden.map(|triangle| mesh.corners(triangle)) {
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            slack = slack.max(longest / f32::from(STEPS));
            for i in 0..=STEPS {
                for j in 0..=STEPS - i {
                    let [u, v] = [i, j].map(|step| f32::from(step) / f32::from(STEPS));
                    points.push(a + (b - a) * u + (c - a) * v);
                }
            }
        }
        let (mut near, mut far) = (0, 0);
        for triangle in (0..mesh.triangles().len()).step_by(7) {
            for (above, distance) in [(0.003, 0.002), (0.006, 0.006), (0.012, 0.004)] {
                let middle =
                    mesh.corners(triangle).iter().sum::<Vec3>() / 3.0 + mesh.normal(triangle) * above;
                let away = points.iter().map(|point| point.distance(middle));
                let gap = away.fold(f32::INFINITY, f32::min) - RADIUS;
                if (gap - distance).abs() <= slack {
                    continue;
                }
                let ball = TaperedCapsule::new(middle, middle, RADIUS, RADIUS);
                let is_near = object.is_forbidden_within(&ball, distance);
                assert_eq!(is_near, gap < distance, "{name}: {gap} from {middle}");
                *if is_near { &mut near } else { &mut far } += 1;
            }
        }
        assert!(near >= least_near && far >= 20, "{name}: {near} near, {far} far");
    }
}

fn on(triangle: u32, x: f32) -> Contact {
    Contact {
        triangle,
        ..contact(Vec3::X * x, Vec3::Y, HandPart::Palm)
    }
}

fn region(wish: Wish, weight: f32, triangles: &[u32], from_x: Option<f32>) -> Region {
    Region {
        wish,
        weight,
        triangles: triangles.to_vec(),
        zones: from_x
            .map(|x| half_space(Vec3::X * x, Vec3::X))
            .into_iter()
            .collect(),
    }
}

#[test]
fn contacts_earn_the_weight_of_their_region() {
    let regions = Regions::new(
        &[
            region(Wish::Prefer, 0.8, &[1], None),
            region(Wish::Prefer, 0.4, &[1, 2], Some(5.0)),
            region(Wish::Avoid, 0.5, &[], Some(7.0)),
        ],
        10,
    );
    // On 0.8; on 0.4 by its triangle; on 0.4 by its place; on that and on a region to avoid.
    let contacts = [on(1, 0.0), on(2, 0.0), on(3, 6.0), on(4, 8.0)];
    let [preferred, avoided] = regions
        .values(&contacts)
        .map(|value| value.expect("there are regions"));
    assert!((preferred.value - (0.8 + 3.0 * 0.4) / 4.0 / 0.8).abs() < 1e-6);
    assert_eq!((preferred.importance, avoided.importance), (0.8, 0.5));
    assert!((avoided.value - 0.75).abs() < 1e-6);
    let wishes = [(1, 0.0), (2, 0.0), (9, 0.0), (9, 8.0)].map(|(t, x)| regions.wish_at(t, Vec3::X * x));
    for (wish, expected) in wishes.into_iter().zip([1.0, 0.6, 0.2, 0.6 * 0.5]) {
        assert!((wish - expected).abs() < 1e-6, "{wishes:?}");
    }
}

#[test]
fn regions_scale_with_their_object_and_none_wish_nothing() {
    // Triangles that do not exist mark nothing.
    let regions = Regions::new(&[region(Wish::Avoid, 1.0, &[3, 9], Some(2.0))], 4);
    let doubled = regions.scaled(2.0);
    for (triangle, x, wish) in [(0, 1.0, 1.0), (0, 3.0, 0.0), (3, 1.0, 0.0), (9, 1.0, 1.0)] {
        assert_eq!(regions.wish_at(triangle, Vec3::X * x), wish);
        assert_eq!(doubled.wish_at(triangle, Vec3::X * x * 2.0), wish);
    }
    let none = Regions::new(&[], 4);
    assert!(none.is_empty() && none.values(&[on(0, 0.0)]) == [None; 2]);
    assert_eq!(none.wish_at(0, Vec3::ZERO), 1.0);
}

fn joints() -> HandJoints {
    HandJoints {
        handedness: Handedness::Right,
        joints: std::array::from_fn(|i| Joint {
            pose: Pose::from_position(Vec3::X * 0.01 * i as f32),
            radius: 0.008,
        }),
    }
}

fn skin() -> Skin {
    let sphere = sphere(0.04, 8);
    let count = sphere.positions().len();
    Skin {
        positions: sphere.positions().to_vec(),
        triangles: sphere.triangles().to_vec(),
        joint_indices: vec![[index::WRIST as u8, 0, 0, 0]; count],
        weights: vec![[1.0, 0.0, 0.0, 0.0]; count],
        bind: joints(),
    }
}

#[test]
fn presenting_hand_skin_follows_its_joints() {
    let mut random = Random::new(12);
    let object_from_frame = Pose::new(random.in_cube(), random.rotation());
    let hand = PresentingHand::in_frame(&skin(), &joints(), object_from_frame).expect("the hand is sound");
    let posed = hand.surface().expect("it has a skin");
    let surface = posed.mesh();
    assert_eq!(surface.triangles(), skin().triangles);
    for (posed, bound) in surface.positions().iter().zip(skin().positions) {
        assert!(posed.distance(object_from_frame.transform_point(bound)) < 1e-6);
    }
    let palm = object_from_frame.transform_point(Vec3::new(0.0, -0.008, 0.0));
    assert!(hand.palm.distance(palm) < 1e-6, "{} {palm}", hand.palm);
    assert!(posed.contains(object_from_frame.transform_point(Vec3::new(0.01, -0.02, 0.03))));
}

#[test]
fn collapsed_triangles_of_a_skin_are_dropped() {
    let mut skin = skin();
    let [a, b, _] = skin.triangles[20];
    skin.positions[a as usize] = skin.positions[b as usize];
    let hand = PresentingHand::in_frame(&skin, &joints(), Pose::IDENTITY).expect("the hand is sound");
    let posed = hand.surface().expect("it has a skin");
    // The two triangles at the edge collapse.
    assert_eq!(posed.mesh().triangles().len(), skin.triangles.len() - 2);
    assert!(posed.contains(Vec3::new(0.01, -0.02, 0.03)));
}

#[test]
fn rejects_unsound_presenting_hands() {
    let mut collapsed = skin();
    collapsed.positions.fill(Vec3::ZERO);
    let rejection = |skin: &Skin, joints: HandJoints| {
        PresentingHand::in_frame(skin, &joints, Pose::IDENTITY).expect_err("it is unsound")
    };
    assert_eq!(rejection(&collapsed, joints()), PresentingHandError::Collapsed);

    let mut far = joints();
    far.joints[index::WRIST].pose.position = Vec3::splat(f32::INFINITY);
    let not_finite = PresentingHandError::NotFinite { vertex: 0 };
    assert_eq!(rejection(&skin(), far), not_finite);

    let mut broken = skin();
    broken.triangles[3][1] = 9_999;
    let vertices = broken.positions.len();
    assert_eq!(
        rejection(&broken, joints()),
        PresentingHandError::Skin(MeshError::IndexOutOfRange {
            triangle: 3,
            vertex: 9_999,
            vertices
        })
    );
}

#[test]
fn objects_report_every_violation_up_to_a_limit() {
    let mesh = || cuboid(Vec3::splat(0.05), 1);
    let errors = GraspObject::new(mesh(), f32::NAN, Vec3::INFINITY, Some(-1.0), &[3, 12])
        .expect_err("everything is wrong");
    assert!(matches!(
        errors[..],
        [
            ObjectError::Mass(_),
            ObjectError::Friction(_),
            ObjectError::CentreOfMass(_),
            ObjectError::ForbiddenTriangle {
                triangle: 12,
                triangles: 12
            }
        ]
    ));
    let unknown: Vec<u32> = (100..100_000).collect();
    let errors =
        GraspObject::new(mesh(), 1.0, Vec3::ZERO, Some(0.3), &unknown).expect_err("they do not exist");
    assert_eq!(errors.len(), MAX_NAMED_TRIANGLES + 1);
    assert_eq!(
        errors.last(),
        Some(&ObjectError::MoreForbiddenTriangles {
            count: unknown.len() - MAX_NAMED_TRIANGLES,
            triangles: 12
        })
    );

    let object = GraspObject::new(mesh(), 0.2, Vec3::ZERO, Some(0.3), &[3, 3, 5]).expect("it is sound");
    assert_eq!(object.forbidden_count(), 2);
    assert!(object.is_forbidden(3) && object.is_forbidden(5) && !object.is_forbidden(4));
}

#[test]
fn rejects_up_that_is_not_a_unit_vector() {
    let object = Arc::new(bar());
    assert!(Holdout::new(Arc::clone(&object), None, Vec3::Y).is_some());
    for up in [Vec3::ZERO, Vec3::Y * 2.0, Vec3::NAN] {
        assert!(Holdout::new(Arc::clone(&object), None, up).is_none(), "{up}");
    }
}
