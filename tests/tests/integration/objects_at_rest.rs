//! Objects at rest: many fit where what searches need of them does not.

use std::time::Duration;

use grasp_proto::v1;
use grasp_tests::TestServer;

use crate::fixtures::{box_request, reproducible, with_object};

/// More objects than there is room for what is derived of them.
const OBJECTS: usize = 12;

/// Room for what is derived of two or three of them.
const CACHE_BYTES: usize = 3 << 19;

#[tokio::test(flavor = "multi_thread")]
async fn objects_stay_and_are_found_alike_while_what_is_derived_makes_room() {
    let server = TestServer::start_with(|config| {
        config.store.bytes = CACHE_BYTES;
    })
    .await;
    let mut objects = server.objects().await;
    for number in 0..OBJECTS {
        // Of different sizes, because equal ones share what is derived.
        let request = with_object(box_request(&format!("box-{number}")), |object| {
            object.meters_per_unit = Some(1.0 + 0.01 * number as f32);
        });
        objects.create_object(request).await.expect("it fits");
    }
    let mut rounds = Vec::new();
    for _ in 0..2 {
        let mut grasps = Vec::new();
        for number in 0..OBJECTS {
            let request = reproducible(v1::FindGraspRequest::new(format!("objects/box-{number}")))
                .receiving(v1::Handedness::Right)
                .with_budget(Duration::from_secs(10))
                .with_seed(3);
            let found = server.grasps().await.find_grasp(request).await;
            let answer = found.expect("the object is there").into_inner();
            assert_eq!(answer.outcome(), v1::Outcome::Found, "box-{number}");
            grasps.push(answer.grasps);
        }
        rounds.push(grasps);
    }
    assert_eq!(rounds[0], rounds[1]);
}
