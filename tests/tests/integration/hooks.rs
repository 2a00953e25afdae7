//! Objects that hang in hooked fingers.

use std::{fmt::Write as _, time::Duration};

use glam::Vec3;
use grasp_proto::v1;
use grasp_tests::TestServer;

/// A case of 20 × 12 × 8 cm with a square handle bar of 16 mm and 40 mm of room under it, as OBJ text.
pub(crate) fn case() -> String {
    let mut obj = String::new();
    let mut vertices = 0;
    let mut cuboid = |centre: Vec3, half: Vec3| {
        for corner in 0..8_u8 {
            let side = |bit: u8| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let at = centre + half * Vec3::new(side(0), side(1), side(2));
            let _ = writeln!(obj, "v {} {} {}", at.x, at.y, at.z);
        }
        for [a, b, c, d] in [
            [1, 3, 4, 2],
            [5, 6, 8, 7],
            [1, 2, 6, 5],
            [3, 7, 8, 4],
            [1, 5, 7, 3],
            [2, 4, 8, 6],
        ] {
            let [a, b, c, d] = [a, b, c, d].map(|corner| vertices + corner);
            let _ = writeln!(obj, "f {a} {b} {c} {d}");
        }
        vertices += 8;
    };
    cuboid(Vec3::ZERO, Vec3::new(0.1, 0.06, 0.04));
    cuboid(Vec3::new(0.0, 0.108, 0.0), Vec3::new(0.06, 0.008, 0.008));
    for x in [-0.06, 0.06] {
        cuboid(Vec3::new(x, 0.087, 0.0), Vec3::new(0.008, 0.029, 0.008));
    }
    obj
}

async fn find(server: &TestServer, up: Vec3, requirements: v1::Requirements) -> v1::FindGraspResponse {
    let mut request = v1::FindGraspRequest::new("objects/case")
        .with_seed(1)
        .with_budget(Duration::from_secs(10));
    request.holdout_mut().up = Some(up.into());
    request.requirements = Some(requirements);
    server
        .grasps()
        .await
        .find_grasp(request)
        .await
        .unwrap()
        .into_inner()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_case_hangs_by_its_handle() {
    let server = TestServer::start().await;
    let create = v1::CreateObjectRequest::new("case", case(), 2.0);
    server.objects().await.create_object(create).await.unwrap();
    let hooks = v1::Requirements {
        allowed_grasp_types: vec![v1::GraspType::FixedHook.into()],
        ..Default::default()
    };
    let without_thumb = v1::Requirements {
        must_not_touch: vec![v1::Digit::Thumb.into()],
        ..Default::default()
    };
    for requirements in [hooks, without_thumb] {
        let answer = find(&server, Vec3::Y, requirements).await;
        assert_eq!(answer.outcome(), v1::Outcome::Found, "{:?}", answer.report);
        let grasp = answer.grasp().unwrap();
        assert!(grasp.hangs);
        assert_eq!(grasp.r#type(), v1::GraspType::FixedHook);
        assert!(
            grasp
                .contacts
                .iter()
                .all(|contact| contact.digit() != v1::Digit::Thumb)
        );
        // The frames of client and object are the same.
        let lift: f32 = grasp.contacts.iter().map(|contact| contact.force().y).sum();
        assert!((lift - 2.0 * 9.81).abs() < 0.05 * 2.0 * 9.81, "{lift}");
    }
    // With the thumb, it is held by closure.
    let with_thumb = v1::Requirements {
        must_touch: vec![v1::Digit::Thumb.into()],
        ..Default::default()
    };
    let answer = find(&server, Vec3::Y, with_thumb).await;
    let grasp = answer.grasp().expect("a grasp");
    assert!(!grasp.hangs);
    assert!(
        grasp
            .margin(v1::Check::Closure)
            .is_some_and(|epsilon| epsilon > 0.0)
    );
    server.stop().await;
}
