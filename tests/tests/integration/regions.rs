//! Parts of an object that hands take or leave because its owner says so.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_client::GraspClient;
use grasp_everyday::{EverydayObject, everyday_objects};
use grasp_proto::v1;
use grasp_server::config::StorePlace;
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    atlases::state,
    fixtures::{Folder, blamed_fields, box_request, unaided},
    parts::{masked, reproducible, update_of, with, with_object},
};

/// Searches per kind of region.
const SEARCHES: u64 = 24;

/// The mug's side is up to 24 mm from the middle of its box; what is farther out along x is its handle.
const HANDLE_FROM: f32 = 0.0255;

fn mug() -> EverydayObject {
    let mut all = everyday_objects().into_iter();
    all.find(|object| object.name == "mug").expect("there is a mug")
}

/// The mug with a region.
fn mug_with(id: &str, region: Option<v1::Region>) -> v1::CreateObjectRequest {
    let mug = mug();
    let request = v1::CreateObjectRequest::new(id, mug.obj(), mug.mass_kg() as f32);
    with_object(request, |object| {
        object.friction = Some(mug.surface.friction() as f32);
        object.center_of_mass = mug.centre_of_mass().map(|centre| centre.as_vec3().into());
        object.regions = region.into_iter().collect();
    })
}

/// The handle as the group of its triangles.
fn handle_by_group(preference: v1::Preference) -> v1::Region {
    v1::Region {
        groups: vec!["handle".to_owned()],
        ..v1::Region::new("handle", preference)
    }
}

/// The handle as a tube along its middle: an arc of 34 mm.
fn handle_by_tube(preference: v1::Preference) -> v1::Region {
    let points = (-3..=3).map(|step| {
        let angle = step as f32 * 25_f32.to_radians();
        Vec3::new(0.0195 + 0.034 * angle.cos(), 0.0025 + 0.034 * angle.sin(), 0.0)
    });
    v1::Region {
        shapes: vec![v1::Shape::tube(points, 0.012)],
        ..v1::Region::new("handle", preference)
    }
}

/// A request for a grasp of an object, with time enough on any machine.
fn asked(id: &str, seed: u64) -> v1::FindGraspRequest {
    v1::FindGraspRequest::new(format!("objects/{id}"))
        .with_budget(Duration::from_secs(10))
        .with_seed(seed)
}

/// True if a grasp has half its contacts on a preferred region.
fn is_on_preferred(grasp: &v1::Grasp) -> bool {
    let on = grasp.score_terms.iter().find(|term| term.name == "on_preferred");
    on.expect("the mug has a preferred region").value >= 0.5
}

async fn find(client: &GraspClient, request: &v1::FindGraspRequest) -> v1::FindGraspResponse {
    client.find_grasp(request).await.expect("the request is valid")
}

/// How many contacts of some grasps are on the handle, and how many there are.
async fn on_handle(server: &TestServer, id: &str, scale: f32) -> (usize, usize) {
    let (mut on, mut all) = (0, 0);
    for seed in 0..SEARCHES {
        let request = unaided(reproducible(asked(id, seed))).receiving(v1::Handedness::Right);
        let request = with(request, |request| request.holdout_mut().scale = Some(scale));
        let answer = server.grasps().await.find_grasp(request).await;
        let answer = answer.expect("the request is valid").into_inner();
        let contacts = &answer.grasp().expect("a mug can be held").contacts;
        all += contacts.len();
        on += contacts
            .iter()
            .filter(|contact| contact.position().x > HANDLE_FROM * scale)
            .count();
    }
    (on, all)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mug_is_held_where_its_owner_says() {
    let server = TestServer::start().await;
    let client = server.client().await;
    for object in [
        mug_with("plain", None),
        mug_with("preferred", Some(handle_by_group(v1::Preference::Preferred))),
        mug_with("preferred-tube", Some(handle_by_tube(v1::Preference::Preferred))),
        mug_with("avoided", Some(handle_by_group(v1::Preference::Avoided))),
        mug_with("avoided-tube", Some(handle_by_tube(v1::Preference::Avoided))),
        mug_with("forbidden", Some(handle_by_group(v1::Preference::Forbidden))),
        mug_with("forbidden-tube", Some(handle_by_tube(v1::Preference::Forbidden))),
    ] {
        client.create_object(&object).await.expect("the mug is sound");
    }
    for scale in [1.0, 0.8] {
        let mut shares = Vec::new();
        for id in [
            "plain",
            "preferred",
            "preferred-tube",
            "avoided",
            "avoided-tube",
            "forbidden",
            "forbidden-tube",
        ] {
            let (on, all) = on_handle(&server, id, scale).await;
            println!("{id} at {scale}: {on} of {all} contacts on the handle");
            shares.push(on as f32 / all as f32);
        }
        let [plain, preferred @ .., a, b, c, d] = shares.as_slice() else {
            panic!("{shares:?}");
        };
        assert!(preferred.iter().all(|share| share > plain), "{shares:?}");
        assert!([a, b].into_iter().all(|share| share < plain), "{shares:?}");
        assert!([c, d].into_iter().all(|share| *share == 0.0), "{shares:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_answer_takes_a_free_preferred_handle_also_with_an_atlas() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let client = server.client().await;
    let mug = mug_with("mug", Some(handle_by_group(v1::Preference::Preferred)));
    client.create_object(&mug).await.expect("the mug is sound");
    state(&server, "objects/mug", 224).await;
    let (mut slowest, mut taken, mut all) = (Duration::ZERO, 0, 0);
    for handedness in [v1::Handedness::Left, v1::Handedness::Right] {
        for turn in 0..6 {
            let request = v1::FindGraspRequest::new("objects/mug")
                .with_client_from_object(v1::Pose::new(Vec3::Y, Quat::from_rotation_y(turn as f32)))
                .receiving(handedness)
                .with_seed(turn);
            for _ in 0..2 {
                let answer = find(&client, &request).await;
                slowest = slowest.max(answer.search_time());
                taken += usize::from(is_on_preferred(answer.grasp().expect("a mug can be held")));
                all += 1;
            }
        }
    }
    println!("{taken} of {all} by the handle, at most {slowest:?}");
    assert_eq!(taken, all);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_preferred_handle_is_taken_from_givers_who_hold_the_rest() {
    let server = TestServer::start_with(|config| config.builder_threads = 1).await;
    let client = server.client().await;
    let without_handle = mug_with("body", Some(handle_by_group(v1::Preference::Forbidden)));
    client
        .create_object(&without_handle)
        .await
        .expect("the mug is sound");
    let mut givers = Vec::new();
    for seed in 0..12 {
        let answer = find(&client, &unaided(reproducible(asked("body", seed)))).await;
        let hand = answer.hand().expect("a mug can be held by its body");
        givers.push(hand.clone());
    }
    client
        .delete_object("objects/body", None)
        .await
        .expect("it is there");
    let mug = mug_with("mug", Some(handle_by_group(v1::Preference::Preferred)));
    client.create_object(&mug).await.expect("the mug is sound");
    state(&server, "objects/mug", 224).await;
    let mut taken = 0;
    for giver in &givers {
        let request = v1::FindGraspRequest::new("objects/mug")
            .with_presenting_hand(giver.clone())
            .receiving(v1::Handedness::Right);
        let answer = find(&client, &request).await;
        let grasp = answer.grasp().expect("a mug can be taken from one hand");
        taken += usize::from(is_on_preferred(grasp));
    }
    assert!(8 * taken >= 7 * givers.len(), "{taken} of {}", givers.len());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_score_has_terms_for_the_regions_of_its_object_only() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let half = v1::Region {
        weight: Some(0.5),
        ..handle_by_tube(v1::Preference::Avoided)
    };
    client
        .create_object(&mug_with("avoided", Some(half)))
        .await
        .expect("the mug is sound");
    client
        .create_object(&mug_with("plain", None))
        .await
        .expect("the mug is sound");
    let rated = async |id: &str| {
        let answer = find(&client, &asked(id, 1)).await;
        let grasp = answer.grasp().expect("a mug can be held");
        (grasp.score.expect("it is rated"), grasp.score_terms.clone())
    };
    let (score, avoided) = rated("avoided").await;
    let term = avoided.iter().find(|term| term.name == "off_avoided");
    let term = term.expect("the mug has a region to avoid");
    assert_eq!(term.weight, 15.0);
    assert!(avoided.iter().all(|term| term.name != "on_preferred"));
    // The score is the weighted mean of what is listed.
    let weights: f32 = avoided.iter().map(|term| term.weight).sum();
    let mean = avoided.iter().map(|term| term.weight * term.value).sum::<f32>() / weights;
    assert!((mean - score).abs() < 1e-5);
    let (_, plain) = rated("plain").await;
    assert_eq!(plain.len() + 1, avoided.len());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn regions_are_kept_as_given_and_changed_by_name_of_their_field() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let given = vec![
        handle_by_group(v1::Preference::Forbidden),
        v1::Region {
            name: "rim".to_owned(),
            weight: Some(0.25),
            ..handle_by_tube(v1::Preference::Avoided)
        },
    ];
    let mug = with_object(mug_with("mug", None), |object| object.regions.clone_from(&given));
    let created = client.create_object(&mug).await.expect("the mug is sound");
    assert_eq!(created.regions, given);
    let forbidden = created.forbidden_triangle_count;
    assert!(forbidden > 0);
    // Another change leaves them alone.
    let heavier = update_of("objects/mug", |object| object.mass_kg = 0.5);
    let changed = client.update_object(&heavier).await.expect("it is right");
    assert_eq!(
        (&changed.regions, changed.forbidden_triangle_count),
        (&given, forbidden)
    );
    let same = update_of("objects/mug", |object| object.regions.clone_from(&given));
    let unchanged = client.update_object(&same).await.expect("it is right");
    assert_eq!(unchanged.etag, changed.etag);
    let cleared = masked(&["regions"], update_of("objects/mug", |_| {}));
    let cleared = client.update_object(&cleared).await.expect("it is right");
    assert_eq!((cleared.regions.len(), cleared.forbidden_triangle_count), (0, 0));
    assert_ne!(cleared.etag, changed.etag);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_an_owner_knows_outlasts_the_server() {
    let folder = Folder::empty("regions");
    let start =
        || TestServer::start_with(|config| config.place = StorePlace::Folder(folder.path().to_owned()));
    let hand = v1::HandPose::new("rigs/adult", v1::Handedness::Left)
        .with_object_from_wrist(v1::Pose::new(Vec3::ZERO, Quat::IDENTITY));
    let banned = v1::KnownGrip::new("never", v1::Preference::Forbidden, hand);
    let mug = with_object(mug_with("mug", None), |object| {
        object.known_grips = vec![banned];
    });
    let server = start().await;
    let client = server.client().await;
    let created = client.create_object(&mug).await.expect("the mug is sound");
    let avoiding = update_of("objects/mug", |object| {
        object.regions = vec![handle_by_tube(v1::Preference::Avoided)];
    });
    let changed = client.update_object(&avoiding).await.expect("it is right");
    assert_eq!((changed.regions.len(), changed.known_grips.len()), (1, 1));
    server.stop().await;
    let server = start().await;
    let client = server.client().await;
    // At rest, then loaded by a search.
    for _ in 0..2 {
        let kept = client.get_object("objects/mug").await.expect("it was saved");
        assert_eq!(
            (&kept.regions, &kept.known_grips),
            (&changed.regions, &created.known_grips)
        );
        let answer = find(&client, &v1::FindGraspRequest::new("objects/mug")).await;
        let terms = &answer.grasp().expect("a mug can be held").score_terms;
        assert!(terms.iter().any(|term| term.name == "off_avoided"));
    }
    // Lists are short.
    let listed = client
        .list_objects(&v1::ListObjectsRequest::default())
        .await
        .expect("it lists them");
    assert!(
        listed
            .iter()
            .all(|object| object.regions.is_empty() && object.known_grips.is_empty())
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_wrong_region_is_named_together_with_what_else_is_wrong() {
    let server = TestServer::start().await;
    let wrong = with_object(box_request("crate"), |object| {
        object.mass_kg = -1.0;
        object.regions = vec![
            v1::Region {
                weight: Some(2.0),
                groups: vec!["shell".to_owned()],
                ..v1::Region::new("lid", v1::Preference::Preferred)
            },
            v1::Region {
                groups: vec!["rim".to_owned()],
                triangles: vec![3, 12],
                ..v1::Region::new("rim", v1::Preference::Avoided)
            },
        ];
    });
    let refused = server.objects().await.create_object(wrong).await;
    let status = refused.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(
        blamed_fields(&status),
        [
            "object.mass_kg",
            "object.regions[0].weight",
            "object.regions[1].groups[0]",
            "object.regions[1].triangles[1]"
        ]
    );
    server.stop().await;
}
