//! Parts of an object that hands take or leave because its owner says so.

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_client::{
    AtlasUse, FindRequest, HandAngles, Handedness, KnownGrip, NewObject, ObjectQuery, ObjectUpdate, Pose,
    PresentingHand, ReceivingHand, Region, RegionKind, RegionShape,
};
use grasp_everyday::{EverydayObject, everyday_objects};
use grasp_proto::v1;
use grasp_server::config::StorePlace;
use grasp_tests::TestServer;
use tonic::Code;

use crate::{
    atlases::state,
    fixtures::{Folder, blamed_fields, box_request, receiving, seconds},
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
fn mug_with(id: &str, region: Option<Region>) -> NewObject {
    let mug = mug();
    NewObject {
        friction: Some(mug.surface.friction() as f32),
        centre_of_mass: mug.centre_of_mass().map(glam::DVec3::as_vec3),
        regions: region.into_iter().collect(),
        ..NewObject::new(id, mug.obj(), mug.mass_kg() as f32)
    }
}

/// The handle as the group of its triangles.
fn handle_by_group(kind: RegionKind) -> Region {
    Region {
        groups: vec!["handle".to_owned()],
        ..Region::of_shapes("handle", kind, Vec::new())
    }
}

/// The handle as a tube along its middle: an arc of 34 mm.
fn handle_by_tube(kind: RegionKind) -> Region {
    let points = (-3..=3).map(|step| {
        let angle = step as f32 * 25_f32.to_radians();
        Vec3::new(0.0195 + 0.034 * angle.cos(), 0.0025 + 0.034 * angle.sin(), 0.0)
    });
    let tube = RegionShape::Tube {
        points: points.collect(),
        radius: 0.012,
    };
    Region::of_shapes("handle", kind, vec![tube])
}

/// How many contacts of some grasps are on the handle, and how many there are.
async fn on_handle(server: &TestServer, id: &str, scale: f32) -> (usize, usize) {
    let (mut on, mut all) = (0, 0);
    for seed in 0..SEARCHES {
        let request = v1::FindGraspRequest {
            object: format!("objects/{id}"),
            seed: Some(seed),
            reproducible: true,
            budget: Some(seconds(10)),
            atlas: v1::AtlasUse::None.into(),
            object_scale: Some(scale),
            receiving_hand: Some(receiving(v1::Handedness::Right)),
            ..Default::default()
        };
        let answer = server.grasps().await.find_grasp(request).await;
        let grasp = answer.expect("the request is valid").into_inner().grasp;
        let contacts = grasp.expect("a mug can be held").contacts;
        all += contacts.len();
        on += contacts
            .iter()
            .filter(|contact| contact.object_position.expect("it has a place").x > HANDLE_FROM * scale)
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
        mug_with("preferred", Some(handle_by_group(RegionKind::Prefer))),
        mug_with("preferred-tube", Some(handle_by_tube(RegionKind::Prefer))),
        mug_with("avoided", Some(handle_by_group(RegionKind::Avoid))),
        mug_with("avoided-tube", Some(handle_by_tube(RegionKind::Avoid))),
        mug_with("forbidden", Some(handle_by_group(RegionKind::Forbidden))),
        mug_with("forbidden-tube", Some(handle_by_tube(RegionKind::Forbidden))),
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
    let mug = mug_with("mug", Some(handle_by_group(RegionKind::Prefer)));
    client.create_object(&mug).await.expect("the mug is sound");
    state(&server, "objects/mug", 224).await;
    let (mut slowest, mut taken, mut all) = (Duration::ZERO, 0, 0);
    for handedness in [Handedness::Left, Handedness::Right] {
        for turn in 0..6 {
            let request = FindRequest {
                client_from_object: Pose::new(Vec3::Y, Quat::from_rotation_y(turn as f32)),
                receiving_hand: ReceivingHand {
                    handedness: Some(handedness),
                    ..ReceivingHand::default()
                },
                seed: Some(turn),
                ..FindRequest::new("objects/mug")
            };
            for _ in 0..2 {
                let answer = client.find_grasp(&request).await.expect("the request is valid");
                let score = answer
                    .grasp
                    .expect("a mug can be held")
                    .score
                    .expect("it is rated");
                let on = score.terms.iter().find(|term| term.name == "on_preferred");
                slowest = slowest.max(answer.report.search_time);
                taken += usize::from(on.expect("the mug has a preferred region").value >= 0.5);
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
    let without_handle = mug_with("body", Some(handle_by_group(RegionKind::Forbidden)));
    client
        .create_object(&without_handle)
        .await
        .expect("the mug is sound");
    let mut givers = Vec::new();
    for seed in 0..12 {
        let request = FindRequest {
            seed: Some(seed),
            reproducible: true,
            atlas: Some(AtlasUse::None),
            budget: Some(Duration::from_secs(10)),
            ..FindRequest::new("objects/body")
        };
        let answer = client.find_grasp(&request).await.expect("the request is valid");
        let grasp = answer.grasp.expect("a mug can be held by its body");
        givers.push(HandAngles {
            rig: "adult".to_owned(),
            handedness: grasp.handedness,
            client_from_wrist: grasp.client_from_wrist,
            digits: grasp.digits,
            hand_scale: None,
        });
    }
    client
        .delete_object("objects/body", None)
        .await
        .expect("it is there");
    let mug = mug_with("mug", Some(handle_by_group(RegionKind::Prefer)));
    client.create_object(&mug).await.expect("the mug is sound");
    state(&server, "objects/mug", 224).await;
    let mut taken = 0;
    for giver in &givers {
        let request = FindRequest {
            presenting_hand: Some(PresentingHand::Angles(giver.clone())),
            receiving_hand: ReceivingHand {
                handedness: Some(Handedness::Right),
                ..ReceivingHand::default()
            },
            ..FindRequest::new("objects/mug")
        };
        let answer = client.find_grasp(&request).await.expect("the request is valid");
        let score = answer.grasp.and_then(|grasp| grasp.score);
        let terms = score.expect("a mug can be taken from one hand").terms;
        let on = terms.iter().find(|term| term.name == "on_preferred");
        taken += usize::from(on.expect("the mug has a preferred region").value >= 0.5);
    }
    assert!(8 * taken >= 7 * givers.len(), "{taken} of {}", givers.len());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_score_has_terms_for_the_regions_of_its_object_only() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let half = Region {
        weight: Some(0.5),
        ..handle_by_tube(RegionKind::Avoid)
    };
    client
        .create_object(&mug_with("avoided", Some(half)))
        .await
        .expect("the mug is sound");
    client
        .create_object(&mug_with("plain", None))
        .await
        .expect("the mug is sound");
    let terms = async |id: &str| {
        let request = v1::FindGraspRequest {
            object: format!("objects/{id}"),
            seed: Some(1),
            budget: Some(seconds(10)),
            ..Default::default()
        };
        let answer = server.grasps().await.find_grasp(request).await;
        let grasp = answer.expect("the request is valid").into_inner().grasp;
        grasp.expect("a mug can be held").score.expect("it is rated")
    };
    let avoided = terms("avoided").await;
    let term = avoided.terms.iter().find(|term| term.name == "off_avoided");
    let term = term.expect("the mug has a region to avoid");
    assert_eq!(term.weight, 15.0);
    assert!(avoided.terms.iter().all(|term| term.name != "on_preferred"));
    // The total is the weighted mean of what is listed.
    let weights: f32 = avoided.terms.iter().map(|term| term.weight).sum();
    let mean = avoided
        .terms
        .iter()
        .map(|term| term.weight * term.value)
        .sum::<f32>()
        / weights;
    assert!((mean - avoided.total).abs() < 1e-5);
    let plain = terms("plain").await;
    assert_eq!(plain.terms.len() + 1, avoided.terms.len());
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn regions_are_kept_as_given_and_changed_by_name_of_their_field() {
    let server = TestServer::start().await;
    let client = server.client().await;
    let given = vec![
        handle_by_group(RegionKind::Forbidden),
        Region {
            name: "rim".to_owned(),
            weight: Some(0.25),
            ..handle_by_tube(RegionKind::Avoid)
        },
    ];
    let mug = NewObject {
        regions: given.clone(),
        ..mug_with("mug", None)
    };
    let created = client.create_object(&mug).await.expect("the mug is sound");
    assert_eq!(created.regions, given);
    let forbidden = created.forbidden_triangle_count;
    assert!(forbidden > 0);
    // Another change leaves them alone.
    let heavier = ObjectUpdate {
        mass_kg: Some(0.5),
        ..ObjectUpdate::default()
    };
    let changed = client
        .update_object("objects/mug", &heavier)
        .await
        .expect("it is right");
    assert_eq!(
        (&changed.regions, changed.forbidden_triangle_count),
        (&given, forbidden)
    );
    let same = ObjectUpdate {
        regions: Some(given.clone()),
        ..ObjectUpdate::default()
    };
    let unchanged = client
        .update_object("objects/mug", &same)
        .await
        .expect("it is right");
    assert_eq!(unchanged.etag, changed.etag);
    let cleared = ObjectUpdate {
        regions: Some(Vec::new()),
        ..ObjectUpdate::default()
    };
    let cleared = client
        .update_object("objects/mug", &cleared)
        .await
        .expect("it is right");
    assert_eq!((cleared.regions.len(), cleared.forbidden_triangle_count), (0, 0));
    assert_ne!(cleared.etag, changed.etag);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_an_owner_knows_outlasts_the_server() {
    let folder = Folder::empty("regions");
    let start =
        || TestServer::start_with(|config| config.place = StorePlace::Folder(folder.path().to_owned()));
    let banned = KnownGrip::banned("never", Handedness::Left, Pose::IDENTITY);
    let mug = NewObject {
        known_grips: vec![banned.clone()],
        ..mug_with("mug", None)
    };
    let server = start().await;
    let client = server.client().await;
    client.create_object(&mug).await.expect("the mug is sound");
    let avoiding = ObjectUpdate {
        regions: Some(vec![handle_by_tube(RegionKind::Avoid)]),
        ..ObjectUpdate::default()
    };
    let changed = client
        .update_object("objects/mug", &avoiding)
        .await
        .expect("it is right");
    server.stop().await;
    let server = start().await;
    let client = server.client().await;
    // At rest, then loaded by a search.
    for _ in 0..2 {
        let kept = client.get_object("objects/mug").await.expect("it was saved");
        assert_eq!(
            (&kept.regions, &kept.known_grips),
            (&changed.regions, &vec![banned.clone()])
        );
        let found = client.find_grasp(&FindRequest::new("objects/mug")).await;
        let grasp = found
            .expect("the request is valid")
            .grasp
            .expect("a mug can be held");
        let terms = grasp.score.expect("it is rated").terms;
        assert!(terms.iter().any(|term| term.name == "off_avoided"));
    }
    // Lists are short.
    let listed = client
        .list_objects(&ObjectQuery::default())
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
    let wrong = v1::CreateObjectRequest {
        mass_kg: -1.0,
        regions: vec![
            v1::Region {
                name: "lid".to_owned(),
                kind: v1::RegionKind::Prefer.into(),
                weight: Some(2.0),
                groups: vec!["shell".to_owned()],
                ..Default::default()
            },
            v1::Region {
                name: "rim".to_owned(),
                kind: v1::RegionKind::Avoid.into(),
                groups: vec!["rim".to_owned()],
                triangles: vec![3, 12],
                ..Default::default()
            },
        ],
        ..box_request("crate")
    };
    let refused = server.objects().await.create_object(wrong).await;
    let status = refused.expect_err("it is wrong");
    assert_eq!(status.code(), Code::InvalidArgument);
    assert_eq!(
        blamed_fields(&status),
        [
            "mass_kg",
            "regions[0].weight",
            "regions[1].groups[0]",
            "regions[1].triangles[1]"
        ]
    );
    server.stop().await;
}
