//! Objects that are saved outlast the server, however it ends, and their time in memory.

use std::{fs, path::Path, time::Duration};

use grasp_proto::v1::{self, object_service_client::ObjectServiceClient};
use grasp_server::{Config, ServeError, Server, config::StorePlace};
use grasp_tests::TestServer;
use tonic::{Code, Status, transport::Channel};

use crate::{
    fixtures::{BOX_OBJ, Folder, bounded, box_request, reason},
    parts::{forbidden, reproducible, update_of, with_object},
};

fn save_in(folder: &Path) -> impl FnOnce(&mut Config) {
    let place = StorePlace::Folder(folder.to_owned());
    move |config| config.place = place
}

async fn start(folder: &Folder, in_memory: usize) -> TestServer {
    TestServer::start_with(|config| {
        save_in(folder.path())(config);
        config.store.objects = in_memory;
    })
    .await
}

async fn create(server: &TestServer, request: v1::CreateObjectRequest) -> Result<v1::GraspObject, Status> {
    let answer = server.objects().await.create_object(request).await?;
    Ok(answer.into_inner())
}

async fn get(server: &TestServer, name: &str) -> Result<v1::GraspObject, Status> {
    let name = name.to_owned();
    let answer = server
        .objects()
        .await
        .get_object(v1::GetObjectRequest { name })
        .await?;
    Ok(answer.into_inner())
}

async fn all(server: &TestServer) -> Vec<v1::GraspObject> {
    let request = v1::ListObjectsRequest {
        page_size: 1000,
        view: v1::ObjectView::Full.into(),
        ..Default::default()
    };
    let page = server.objects().await.list_objects(request).await.unwrap();
    page.into_inner().objects
}

/// The mesh of an object, as long as its header says.
async fn mesh(client: &mut ObjectServiceClient<Channel>, name: &str) -> Result<Vec<u8>, Status> {
    let name = name.to_owned();
    let mut parts = client.get_mesh(v1::GetMeshRequest { name }).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(answer) = parts.message().await? {
        bytes.extend(answer.piece);
    }
    let length = u32::from_le_bytes(bytes[8..12].try_into().unwrap());
    assert_eq!(length as usize, bytes.len());
    Ok(bytes)
}

fn find(name: &str) -> v1::FindGraspRequest {
    reproducible(v1::FindGraspRequest::new(name))
        .with_budget(Duration::from_secs(10))
        .with_seed(7)
}

#[tokio::test(flavor = "multi_thread")]
async fn another_unit_makes_the_object_that_creation_with_it_makes() {
    let folder = Folder::absent("saved-unit");
    let server = start(&folder, 10).await;
    let request = |id, unit| with_object(box_request(id), |object| object.meters_per_unit = unit);
    // In the file's units, its centre is 40 m from the origin, which is too far, and 40 cm.
    let far: String = BOX_OBJ
        .lines()
        .map(|line| {
            match line
                .strip_prefix("v ")
                .map(|at| at.split(' ').collect::<Vec<_>>())
            {
                Some(at) => {
                    let x: f32 = at[0].parse().unwrap();
                    format!("v {} {} {}\n", x + 40.0, at[1], at[2])
                }
                None => format!("{line}\n"),
            }
        })
        .collect();
    let far = |id, unit| v1::CreateObjectRequest {
        mesh: far.clone().into_bytes(),
        ..request(id, unit)
    };
    let unit_of = |id: &str, unit| {
        update_of(&format!("objects/{id}"), |object| {
            object.meters_per_unit = Some(unit);
        })
    };
    for (wrong, right, is_far) in [("a", "b", false), ("c", "d", true)] {
        let new = |id, unit| if is_far { far(id, unit) } else { request(id, unit) };
        let before = create(&server, new(wrong, None)).await.unwrap();
        let expected = create(&server, new(right, Some(0.01))).await.unwrap();
        assert_eq!(before.origin_in_file.len(), if is_far { 3 } else { 0 });
        let mut objects = server.objects().await;
        let changed = objects.update_object(unit_of(wrong, 0.01)).await.unwrap();
        let changed = changed.into_inner();
        assert_eq!(changed.content_hash, expected.content_hash);
        assert_eq!(changed.center_of_mass, expected.center_of_mass);
        assert_eq!(changed.meters_per_unit, Some(0.01));
        assert_eq!((changed.mass_kg, &changed.warnings), (0.1, &expected.warnings));
        assert!(changed.origin_in_file.is_empty());
        assert_ne!(changed.etag, before.etag);
        let again = objects.update_object(unit_of(wrong, 0.01)).await.unwrap();
        assert_eq!(again.into_inner().etag, changed.etag);
        let error = objects.update_object(unit_of(wrong, 1e-6)).await.unwrap_err();
        assert_eq!(error.code(), Code::InvalidArgument);
    }
    let before = all(&server).await;
    let mesh_before = mesh(&mut server.objects().await, "objects/a").await.unwrap();
    server.stop().await;
    let server = start(&folder, 10).await;
    // Loaded from its file, it is the same.
    let mesh = mesh(&mut server.objects().await, "objects/a").await.unwrap();
    assert!(mesh == mesh_before);
    let hashes = |objects: &[v1::GraspObject]| -> Vec<String> {
        objects.iter().map(|object| object.content_hash.clone()).collect()
    };
    assert_eq!(hashes(&all(&server).await), hashes(&before));
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_keeps_objects_labels_etags_and_request_ids() {
    let folder = Folder::absent("saved-restart");
    let server = start(&folder, 10).await;
    let request = v1::CreateObjectRequest {
        request_id: "3f2a9c1e-8d57-4b06-9e1b-5a70c4d2f683".to_owned(),
        ..with_object(box_request("crate"), |object| {
            object.labels = [("level".to_owned(), "kitchen".to_owned())].into();
        })
    };
    create(&server, request.clone()).await.unwrap();
    create(&server, box_request("gone")).await.unwrap();
    let update = update_of("objects/crate", |object| {
        object.mass_kg = 0.4;
        object.regions = vec![forbidden(&[], &[0, 1])];
    });
    server.objects().await.update_object(update).await.unwrap();
    let name = "objects/gone".to_owned();
    let delete = v1::DeleteObjectRequest {
        name,
        ..Default::default()
    };
    server.objects().await.delete_object(delete).await.unwrap();
    let before = all(&server).await;
    let grasp_before = server.grasps().await.find_grasp(find("objects/crate")).await;
    server.stop().await;

    let server = start(&folder, 10).await;
    let after = all(&server).await;
    let created = |objects: &[v1::GraspObject]| -> Vec<v1::GraspObject> {
        let created = objects.iter().filter(|object| !object.built_in);
        created.cloned().collect()
    };
    assert_eq!(created(&after), created(&before));
    assert_eq!(
        create(&server, request.clone()).await.unwrap(),
        created(&before)[0]
    );
    let other = with_object(request, |object| object.mass_kg = 3.0);
    let status = create(&server, other).await.unwrap_err();
    assert_eq!(reason(&status), "REQUEST_ID_REUSED");
    // The object built again is the object that was saved: the same grasp, and the same mesh.
    let grasp_after = server.grasps().await.find_grasp(find("objects/crate")).await;
    let [before, after] = [grasp_before, grasp_after].map(|answer| answer.unwrap().into_inner());
    assert!(before.grasp().is_some());
    assert_eq!(before.grasps, after.grasps);
    let stale = update_of("objects/crate", |object| {
        "stale".clone_into(&mut object.etag);
        object.mass_kg = 1.0;
    });
    let status = server.objects().await.update_object(stale).await.unwrap_err();
    assert_eq!(status.code(), Code::Aborted);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_out_of_memory_is_found_again_by_its_name() {
    let folder = Folder::absent("saved-rest");
    // Two in memory, because the call before may not have ended everywhere when its answer is here.
    let server = start(&folder, 2).await;
    let names = ["a", "b", "c", "d"].map(|id| format!("objects/{id}"));
    let mut created = Vec::new();
    for id in ["a", "b", "c", "d"] {
        created.push(create(&server, box_request(id)).await.unwrap());
    }
    let mut changes = server
        .objects()
        .await
        .watch_objects(v1::WatchObjectsRequest::default())
        .await
        .unwrap()
        .into_inner();
    for (name, created) in names.iter().zip(&created) {
        assert_eq!(&get(&server, name).await.unwrap(), created);
        let answer = server.grasps().await.find_grasp(find(name)).await.unwrap();
        assert!(answer.into_inner().grasp().is_some(), "{name}");
    }
    for name in &names {
        mesh(&mut server.objects().await, name).await.unwrap();
    }
    // Calls at the same time do not get into each other's way.
    let calls = [(); 8].map(|()| {
        let (mut client, name) = (server.objects_lazily(), names[0].clone());
        tokio::spawn(async move { mesh(&mut client, &name).await.map(|bytes| bytes.len()) })
    });
    for call in calls {
        assert!(call.await.unwrap().unwrap() > 0);
    }
    let label = update_of(&names[1], |object| {
        object.labels = [("level".to_owned(), "hall".to_owned())].into();
    });
    server.objects().await.update_object(label).await.unwrap();
    let heavier = update_of(&names[2], |object| object.mass_kg = 0.4);
    server.objects().await.update_object(heavier).await.unwrap();
    assert_eq!(get(&server, &names[2]).await.unwrap().mass_kg, 0.4);
    // Of all this, watchers hear of the changes only.
    for expected in [&names[1], &names[2]] {
        let report = bounded("a report", changes.message()).await.unwrap().unwrap();
        assert_eq!(report.changes, [i32::from(v1::ObjectChange::Updated)]);
        assert_eq!(&report.object.unwrap().name, expected);
    }
    let silence = tokio::time::timeout(Duration::from_millis(50), changes.message()).await;
    assert!(silence.is_err(), "{silence:?}");
    server.stop().await;
}

/// The code and reason of an error.
fn kind<T: std::fmt::Debug>(result: Result<T, Status>) -> (Code, String) {
    let status = result.expect_err("it is damaged");
    (status.code(), reason(&status))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_object_is_data_loss_by_name_until_its_file_is_back() {
    let folder = Folder::absent("saved-damage");
    let server = start(&folder, 10).await;
    create(&server, box_request("crate")).await.unwrap();
    let other = v1::CreateObjectRequest {
        mesh: BOX_OBJ.replace("0.015", "0.025").into_bytes(),
        ..box_request("other")
    };
    create(&server, other).await.unwrap();
    let before = get(&server, "objects/crate").await.unwrap();
    server.stop().await;
    let name = "objects/crate";
    let of_record = folder.path().join(name);
    let meshes = fs::read_dir(folder.path().join("meshes")).unwrap();
    let of_mesh = meshes
        .map(|file| file.unwrap().path())
        .find(|path| fs::read(path).unwrap() == BOX_OBJ.as_bytes())
        .unwrap();
    let damage = (Code::DataLoss, "OBJECT_DAMAGED".to_owned());
    for (path, is_record) in [(of_record, true), (of_mesh, false)] {
        let whole = fs::read(&path).unwrap();
        for length in [Some(whole.len() / 2), None] {
            match length {
                Some(length) => fs::write(&path, &whole[..length]).unwrap(),
                None => fs::remove_file(&path).unwrap(),
            }
            let server = start(&folder, 10).await;
            assert_eq!(kind(server.grasps().await.find_grasp(find(name)).await), damage);
            assert_eq!(kind(mesh(&mut server.objects().await, name).await), damage);
            let heavier = update_of(name, |object| object.mass_kg = 0.4);
            assert_eq!(kind(server.objects().await.update_object(heavier).await), damage);
            if is_record {
                assert_eq!(kind(get(&server, name).await), damage);
            }
            assert!(all(&server).await.iter().any(|object| object.name == name));
            get(&server, "objects/other").await.unwrap();
            // Put back, it is found again, by the same server and by the next.
            fs::write(&path, &whole).unwrap();
            assert_eq!(get(&server, name).await.unwrap(), before);
            mesh(&mut server.objects().await, name).await.unwrap();
            server.stop().await;
        }
    }
    let server = start(&folder, 10).await;
    assert_eq!(get(&server, name).await.unwrap(), before);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_store_refuses_new_objects() {
    let folder = Folder::absent("saved-full");
    let server = TestServer::start_with(|config| {
        save_in(folder.path())(config);
        config.maximum_saved_objects = 1.try_into().unwrap();
    })
    .await;
    create(&server, box_request("a")).await.unwrap();
    let status = create(&server, box_request("b")).await.unwrap_err();
    assert_eq!(
        (status.code(), reason(&status)),
        (Code::ResourceExhausted, "TOO_MANY_OBJECTS".to_owned())
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_server_does_not_start_on_the_same_folder() {
    let folder = Folder::absent("saved-twice");
    let server = start(&folder, 10).await;
    let mut config = Config {
        builder_threads: 0,
        ..Config::default()
    };
    save_in(folder.path())(&mut config);
    let second = tokio::task::spawn_blocking(|| Server::new(config)).await.unwrap();
    let Err(ServeError::Store(error)) = second else {
        panic!("two servers would overwrite each other's objects");
    };
    assert!(error.to_string().contains("another server"), "{error}");
    server.stop().await;
}
