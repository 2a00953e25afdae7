//! What version 0.1 saved is there, as it was.
//!
//! The folder beside this file is one that a server of that version wrote: `objects/bottle` in a file in millimetres whose z points
//! up, with everything that a client can give an object, `objects/plain` with nothing of it, and `rigs/ada` from the joints of
//! `rigs/adult`.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use glam::{Quat, Vec3};
use grasp_proto::v1;
use grasp_server::config::StorePlace;
use grasp_tests::TestServer;
use tonic::Code;

use crate::fixtures::{Folder, assert_status, find, reproducible, update, update_of, with_object};

/// A copy of the folder.
fn copy(test: &str) -> Folder {
    let folder = Folder::absent(test);
    let source: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests", "integration", "saved_by_0_1"]
        .iter()
        .collect();
    copy_folder(&source, folder.path());
    folder
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("the temporary directory can be written to");
    for entry in fs::read_dir(from).expect("it is there") {
        let (path, name) = entry.map(|entry| (entry.path(), entry.file_name())).unwrap();
        if path.is_dir() {
            copy_folder(&path, &to.join(name));
        } else {
            fs::copy(&path, to.join(name)).unwrap();
        }
    }
}

async fn start(folder: &Folder) -> TestServer {
    let place = StorePlace::Folder(folder.path().to_owned());
    TestServer::start_with(|config| config.place = place).await
}

/// The created objects, whole.
async fn objects(server: &TestServer) -> Vec<v1::GraspObject> {
    let request = v1::ListObjectsRequest {
        view: v1::ObjectView::Full.into(),
        ..Default::default()
    };
    let page = server.objects().await.list_objects(request).await.unwrap();
    let mut objects = page.into_inner().objects;
    objects.retain(|object| !object.built_in);
    objects
}

/// Makes the server read an object's mesh.
async fn load(server: &TestServer, name: &str) {
    let request = v1::GetMeshRequest {
        name: name.to_owned(),
    };
    let mut parts = server
        .objects()
        .await
        .get_mesh(request)
        .await
        .unwrap()
        .into_inner();
    while parts.message().await.unwrap().is_some() {}
}

fn digits(angles: [[f32; 4]; 5]) -> [Option<v1::DigitAngles>; 5] {
    angles.map(|angles| Some(v1::DigitAngles::new(angles)))
}

/// The grips that the client gave the bottle.
fn grips() -> Vec<v1::KnownGrip> {
    let around = v1::HandPose {
        scale: Some(0.9),
        convention: v1::Convention::Unity.into(),
        ..v1::HandPose::new("rigs/adult", v1::Handedness::Right)
    }
    .with_object_from_wrist(v1::Pose::new(
        Vec3::new(-0.034_604_11, 0.040_470_712, 0.067_502_856),
        Quat::from_xyzw(0.689_093, 0.494_016_77, 0.158_590_3, 0.505_912_4),
    ))
    .with_digits(digits([
        [1.076_013_7, 0.261_799_4, 0.456_260_06, 0.304_173_38],
        [-0.147_730_66, 0.016_823_623, 0.023_040_483, 0.015_360_322],
        [-0.049_243_54, 0.588_962_3, 0.878_933_5, 0.585_955_6],
        [0.049_243_54, 0.682_331, 0.934_473_9, 0.622_982_56],
        [0.147_730_65, 0.615_463_1, 0.842_896_1, 0.561_930_7],
    ]));
    let above = v1::HandPose {
        convention: v1::Convention::Unity.into(),
        ..v1::HandPose::new("", v1::Handedness::Left)
    }
    .with_object_from_wrist(v1::Pose::new(
        Vec3::new(0.01, 0.15, -0.02),
        Quat::from_xyzw(0.6, 0.0, 0.0, 0.8),
    ));
    let nowhere = v1::HandPose {
        convention: v1::Convention::Openxr.into(),
        ..v1::HandPose::new("", v1::Handedness::Right)
    }
    .with_object_from_wrist(v1::Pose::default());
    vec![
        v1::KnownGrip::new("around", v1::Preference::Preferred, around),
        v1::KnownGrip {
            near_distance: Some(0.05),
            near_angle: Some(0.4),
            ..v1::KnownGrip::new("from above", v1::Preference::Forbidden, above)
        },
        v1::KnownGrip::new("nowhere", v1::Preference::Forbidden, nowhere),
    ]
}

/// The regions that the client gave the bottle; the last was a list of its own.
fn regions() -> Vec<v1::Region> {
    let turned = v1::Pose::new(Vec3::Y * 0.01, Quat::from_xyzw(0.0, 0.6, 0.0, 0.8));
    let bent = [-0.05, 0.0, 0.05].map(|y| Vec3::new(0.0, y, if y > 0.0 { 0.01 } else { 0.0 }));
    vec![
        v1::Region {
            shapes: vec![v1::Shape::half_space(Vec3::Y * -0.0799, Vec3::Y * -2.0)],
            ..v1::Region::new("below", v1::Preference::Forbidden)
        },
        v1::Region {
            weight: Some(0.75),
            groups: vec!["sides".to_owned()],
            triangles: vec![12, 13],
            shapes: vec![
                v1::Shape::ball(Vec3::X * 0.02, 0.03),
                v1::Shape::solid_box(turned, Vec3::new(0.03, 0.04, 0.03)),
                v1::Shape::tube(bent, 0.025),
            ],
            ..v1::Region::new("middle", v1::Preference::Preferred)
        },
        v1::Region {
            shapes: vec![v1::Shape::ball(Vec3::Y * 0.08, 0.02)],
            ..v1::Region::new("neck", v1::Preference::Avoided)
        },
        v1::Region {
            groups: vec!["top".to_owned()],
            triangles: vec![0],
            ..v1::Region::new("forbidden", v1::Preference::Forbidden)
        },
    ]
}

/// A time in 2026, when the folder was written.
fn time(seconds: i64, nanos: i32) -> prost_types::Timestamp {
    prost_types::Timestamp { seconds, nanos }
}

fn bottle() -> v1::GraspObject {
    let labels = [("level", "kitchen"), ("owner", "Ada L.")];
    v1::GraspObject {
        name: "objects/bottle".to_owned(),
        etag: "18ec1d557cbaef14-6".to_owned(),
        labels: labels
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into(),
        mass_kg: 0.3,
        center_of_mass: Some((Vec3::Y * -0.01).into()),
        friction: Some(0.7),
        regions: regions(),
        known_grips: grips(),
        meters_per_unit: Some(0.001),
        z_up: true,
        parts: ["bottom", "top", "sides"].map(str::to_owned).into(),
        triangle_count: 28,
        forbidden_triangle_count: 12,
        bounding_box: Some(v1::BoxShape {
            pose: Some(v1::Pose::default()),
            half_extents: Some(Vec3::new(0.02, 0.08, 0.02).into()),
        }),
        content_hash: "308e14cecd62c45e02a9f38fa7ddfed43727484b90187303ebeb4d34e787cc47".to_owned(),
        create_time: Some(time(1_795_842_616, 684_261_639)),
        update_time: Some(time(1_795_842_616, 684_261_639)),
        ..Default::default()
    }
}

fn plain() -> v1::GraspObject {
    v1::GraspObject {
        name: "objects/plain".to_owned(),
        etag: "18ec1d557cbaef14-4".to_owned(),
        mass_kg: 0.2,
        center_of_mass: Some(v1::Vector3::default()),
        meters_per_unit: Some(1.0),
        triangle_count: 28,
        bounding_box: Some(v1::BoxShape {
            pose: Some(v1::Pose::default()),
            half_extents: Some(Vec3::new(0.02, 0.02, 0.08).into()),
        }),
        content_hash: "c40b70785076b27fdd2ae96f2baddf611cc4c8eb1b0461309627e2544d502782".to_owned(),
        create_time: Some(time(1_795_842_616, 134_980_273)),
        update_time: Some(time(1_795_842_616, 134_980_273)),
        ..Default::default()
    }
}

/// An object whose box and centre of mass, which are computed, are those of the other if they are close to them.
fn settled(object: &v1::GraspObject, to: &v1::GraspObject) -> v1::GraspObject {
    let numbers = |object: &v1::GraspObject| {
        let solid = object.bounding_box.unwrap_or_default();
        let pose = solid.pose.unwrap_or_default();
        let centre = Vec3::from(object.center_of_mass.unwrap_or_default());
        [solid.half_extents(), pose.position(), centre]
    };
    let pairs = numbers(object).into_iter().zip(numbers(to));
    if pairs.into_iter().all(|(a, b)| a.distance(b) < 1e-6) {
        v1::GraspObject {
            bounding_box: to.bounding_box,
            center_of_mass: to.center_of_mass,
            ..object.clone()
        }
    } else {
        object.clone()
    }
}

fn assert_same(found: &[v1::GraspObject], expected: &[v1::GraspObject]) {
    let names = |objects: &[v1::GraspObject]| -> Vec<String> {
        objects.iter().map(|object| object.name.clone()).collect()
    };
    assert_eq!(names(found), names(expected));
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(&settled(found, expected), expected);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn objects_are_as_they_were() {
    let dump: Vec<_> = [bottle(), plain()]
        .iter()
        .map(|o| grasp_client::json::to_json(o).unwrap())
        .collect();
    std::fs::write(
        "/tmp/tstv/objects.json",
        format!("{:#}\n", serde_json::Value::from(dump)),
    )
    .unwrap();
    let folder = copy("saved-by-0-1");
    let server = start(&folder).await;
    let at_rest = objects(&server).await;
    assert_same(&at_rest, &[bottle(), plain()]);
    for object in &at_rest {
        load(&server, &object.name).await;
    }
    assert_same(&objects(&server).await, &at_rest);

    // The id of the request that created it is remembered.
    let reused = v1::CreateObjectRequest {
        request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".to_owned(),
        ..v1::CreateObjectRequest::new("other", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0.1)
    };
    let status = server.objects().await.create_object(reused).await.unwrap_err();
    assert_status(&status, Code::FailedPrecondition, "REQUEST_ID_REUSED");

    // What was preferred is preferred.
    let request = reproducible(v1::FindGraspRequest::new("objects/bottle").with_seed(1))
        .with_budget(Duration::from_secs(10));
    let request = v1::FindGraspRequest {
        receiver: Some(v1::Receiver {
            handedness: v1::Handedness::Right.into(),
            scale: Some(0.9),
            ..Default::default()
        }),
        ..request
    };
    let answer = find(&server, request).await;
    assert_eq!(answer.source(), v1::GraspSource::KnownGrip);

    // A change writes what it does not change as it was.
    let heavier = update_of("objects/bottle", |object| object.mass_kg = 0.4);
    let changed = update(&server, heavier).await.unwrap();
    server.stop().await;
    let server = start(&folder).await;
    let expected = v1::GraspObject {
        mass_kg: 0.4,
        etag: changed.etag,
        update_time: changed.update_time,
        ..bottle()
    };
    assert_same(&objects(&server).await, &[expected.clone(), plain()]);
    // Of the file that is still there, too.
    load(&server, "objects/bottle").await;
    assert_same(&objects(&server).await, &[expected, plain()]);
    let again = with_object(
        v1::CreateObjectRequest::new("plain", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0.1),
        |_| {},
    );
    let status = server.objects().await.create_object(again).await.unwrap_err();
    assert_eq!(status.code(), Code::AlreadyExists);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn rigs_are_as_they_were() {
    let folder = copy("saved-rig-by-0-1");
    let server = start(&folder).await;
    let rig = |name: &str| v1::GetRigRequest {
        name: name.to_owned(),
    };
    let mut client = server.rigs().await;
    let ada = client.get_rig(rig("rigs/ada")).await.unwrap().into_inner();
    let adult = client.get_rig(rig("rigs/adult")).await.unwrap().into_inner();
    assert!(!ada.built_in && ada.hands[0].mirrored && !ada.hands[1].mirrored);
    let [own, model] = [&ada.hands[1], &adult.hands[1]];
    assert_eq!(own.stretched_joints.len(), model.stretched_joints.len());
    for (own, model) in own.stretched_joints.iter().zip(&model.stretched_joints) {
        assert!(
            own.position().distance(model.position()) < 1e-3,
            "{own:?} {model:?}"
        );
    }
    let limits = |hand: &v1::RigHand| -> Vec<(v1::Digit, [f32; 2])> {
        let pitches = hand.limits.iter().map(|limits| {
            let [min, max] = [limits.min, limits.max].map(Option::unwrap_or_default);
            (limits.digit(), [min.base_pitch, max.base_pitch])
        });
        pitches.collect()
    };
    let mut expected = limits(model);
    expected[1].1[1] = 1.2;
    assert_eq!(limits(own), expected);
    let request = v1::FindGraspRequest {
        receiver: Some(v1::Receiver {
            rig: "rigs/ada".to_owned(),
            ..Default::default()
        }),
        ..v1::FindGraspRequest::new("objects/plain").with_budget(Duration::from_secs(10))
    };
    let answer = find(&server, request).await;
    assert_eq!(answer.hand().expect("it is found").rig, "rigs/ada");
    server.stop().await;
}
