//! Fixtures: requests and their parts, and ways to send them, to wait for answers and to check these.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    future::Future,
    path::{Path, PathBuf},
    time::Duration,
};

use glam::{Quat, Vec3};
use grasp_assets::holdouts::BuiltInHoldout;
use grasp_client::built_in::request_for;
use grasp_proto::v1;
use grasp_tests::TestServer;
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

/// Longest wait in a test, reached only if something hangs.
const HANGS_AFTER: Duration = Duration::from_mins(1);

/// A closed box of 4 cm by 3 cm by 2 cm, as OBJ text with one group.
pub(crate) const BOX_OBJ: &str = "\
g shell
v -0.02 -0.015 -0.01
v 0.02 -0.015 -0.01
v 0.02 0.015 -0.01
v -0.02 0.015 -0.01
v -0.02 -0.015 0.01
v 0.02 -0.015 0.01
v 0.02 0.015 0.01
v -0.02 0.015 0.01
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
";

/// A request to create the box under an id.
pub(crate) fn box_request(id: &str) -> v1::CreateObjectRequest {
    v1::CreateObjectRequest::new(id, BOX_OBJ, 0.1)
}

/// A request for the built-in remote, floating freely.
pub(crate) fn floating_remote() -> v1::FindGraspRequest {
    v1::FindGraspRequest::new("objects/remote")
        .with_seed(7)
        .with_budget(Duration::from_secs(10))
}

/// Creates a box whose whole surface is forbidden, and returns a request that no attempt can satisfy.
pub(crate) async fn impossible(server: &TestServer) -> v1::FindGraspRequest {
    let create = with_object(box_request("untouchable"), |object| {
        object.regions = vec![forbidden(&["shell"], &[])];
    });
    server
        .objects()
        .await
        .create_object(create)
        .await
        .expect("the box can be created");
    v1::FindGraspRequest::new("objects/untouchable").with_seed(7)
}

/// A request that no attempt can satisfy, for an object whose preparation takes none of the deadline.
pub(crate) async fn impossible_at_once(server: &TestServer) -> v1::FindGraspRequest {
    let request = impossible(server).await;
    until("the preparation of the object", || {
        server.gauges().prepared_objects() == 1
    })
    .await;
    request
}

/// The built-in remote 5 cm above the open hand of a giver, palm up.
pub(crate) fn held_remote() -> v1::FindGraspRequest {
    let bent = v1::DigitAngles {
        base_yaw: 0.0,
        base_pitch: 0.1,
        second_pitch: 0.1,
        third_pitch: None,
    };
    // Half a turn about x points the fingers from -z to +z, and the back of the hand from up to down.
    let wrist = v1::Pose::new(
        Vec3::new(0.3, 1.15, -0.12),
        Quat::from_rotation_x(std::f32::consts::PI),
    );
    let giver = v1::HandPose::new("rigs/thesis", v1::Handedness::Left)
        .with_client_from_wrist(wrist)
        .with_digits([Some(bent); 5]);
    floating_remote()
        .with_client_from_object(v1::Pose::new(
            Vec3::new(0.3, 1.2, 0.0),
            Quat::from_rotation_y(0.4),
        ))
        .with_presenting_hand(giver)
}

/// A built-in holdout as a request with a seed, with the giver's hand by its angles.
pub(crate) fn built_in_request(built_in: &BuiltInHoldout) -> v1::FindGraspRequest {
    request_for(built_in)
        .with_seed(7)
        .with_budget(Duration::from_secs(10))
}

/// A receiver whose hand of the default rig is posed.
pub(crate) fn receiving(handedness: v1::Handedness) -> v1::Receiver {
    v1::Receiver {
        handedness: handedness.into(),
        ..Default::default()
    }
}

/// The same request without known grips.
pub(crate) fn unaided(request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    with(request, |request| request.search_mut().ignore_atlas = true)
}

pub(crate) fn seconds(seconds: i64) -> prost_types::Duration {
    prost_types::Duration { seconds, nanos: 0 }
}

pub(crate) fn milliseconds(milliseconds: i32) -> prost_types::Duration {
    prost_types::Duration {
        seconds: 0,
        nanos: milliseconds * 1_000_000,
    }
}

/// The fields that a status blames, in order.
pub(crate) fn blamed_fields(status: &Status) -> Vec<String> {
    let details = status.get_error_details();
    details
        .bad_request()
        .map(|bad| bad.field_violations.iter().map(|v| v.field.clone()).collect())
        .unwrap_or_default()
}

/// Labels of an object.
pub(crate) fn labels(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
    let owned = pairs
        .iter()
        .map(|&(key, value)| (key.to_owned(), value.to_owned()));
    owned.collect()
}

/// SHA-256 in hexadecimal.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}

/// The reason in a status' `ErrorInfo`.
pub(crate) fn reason(status: &Status) -> String {
    let details = status.get_error_details();
    details
        .error_info()
        .expect("every status has an ErrorInfo")
        .reason
        .clone()
}

/// Waits until `condition` holds.
pub(crate) async fn until(what: &str, condition: impl Fn() -> bool) {
    bounded(what, async {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    })
    .await;
}

/// Waits for `future` up to a limit.
pub(crate) fn bounded<T>(what: &str, future: impl Future<Output = T>) -> impl Future<Output = T> {
    // Boxed, as those of calls are large.
    let future = tokio::time::timeout(HANGS_AFTER, Box::pin(future));
    async move {
        let within = future.await;
        within.unwrap_or_else(|_| panic!("{what} did not happen within {HANGS_AFTER:?}"))
    }
}

/// A test's own folder, removed at its end.
pub(crate) struct Folder(PathBuf);

impl Folder {
    /// A folder that does not exist yet.
    pub(crate) fn absent(test: &str) -> Self {
        Self(std::env::temp_dir().join(format!("grasp-{test}-{}", std::process::id())))
    }

    /// An empty folder.
    pub(crate) fn empty(test: &str) -> Self {
        let folder = Self::absent(test);
        fs::create_dir_all(folder.path()).expect("the temporary directory can be written to");
        folder
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder left in the temporary directory does no harm.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// A value after a change.
pub(crate) fn with<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

/// A request whose answer is the same for any number of workers.
pub(crate) fn reproducible(request: v1::FindGraspRequest) -> v1::FindGraspRequest {
    with(request, |request| {
        request.search_mut().choice = v1::GraspChoice::Reproducible.into();
    })
}

/// A request to create an object that `change` has changed.
pub(crate) fn with_object(
    request: v1::CreateObjectRequest,
    change: impl FnOnce(&mut v1::GraspObject),
) -> v1::CreateObjectRequest {
    with(request, |request| change(request.object_mut()))
}

/// A change of the object of this name by `change`.
pub(crate) fn update_of(name: &str, change: impl FnOnce(&mut v1::GraspObject)) -> v1::UpdateObjectRequest {
    let object = v1::GraspObject {
        name: name.to_owned(),
        ..Default::default()
    };
    v1::UpdateObjectRequest {
        object: Some(with(object, change)),
        update_mask: None,
    }
}

/// The same with a mask.
pub(crate) fn masked(paths: &[&str], request: v1::UpdateObjectRequest) -> v1::UpdateObjectRequest {
    let paths = paths.iter().map(|&path| path.to_owned()).collect();
    v1::UpdateObjectRequest {
        update_mask: Some(prost_types::FieldMask { paths }),
        ..request
    }
}

/// A region of which hands keep off.
pub(crate) fn forbidden(groups: &[&str], triangles: &[u32]) -> v1::Region {
    v1::Region {
        groups: groups.iter().map(|&group| group.to_owned()).collect(),
        triangles: triangles.to_vec(),
        ..v1::Region::new("forbidden", v1::Preference::Forbidden)
    }
}

/// The budget of a search that was in force.
pub(crate) fn budget_of(answer: &v1::FindGraspResponse) -> Duration {
    let budget = answer.report.as_ref().and_then(|report| report.budget);
    let budget = budget.expect("it is always reported");
    budget.try_into().expect("it is not negative")
}

/// The hand of a grasp.
pub(crate) fn hand(grasp: &v1::Grasp) -> &v1::HandPose {
    grasp.hand.as_ref().expect("a grasp has a hand")
}

/// A vector that is there.
pub(crate) fn vec3(vector: Option<v1::Vector3>) -> Vec3 {
    vector.expect("there is a vector").into()
}

/// The answer to a request that is right.
pub(crate) async fn find(server: &TestServer, request: v1::FindGraspRequest) -> v1::FindGraspResponse {
    let answer = server.grasps().await.find_grasp(request).await;
    answer.expect("the request is valid").into_inner()
}

/// Fails unless a status has this code and reason.
pub(crate) fn assert_status(status: &Status, code: Code, expected: &str) {
    assert_eq!(
        (status.code(), reason(status).as_str()),
        (code, expected),
        "{status:?}"
    );
}

/// Creates an object.
pub(crate) async fn create(
    server: &TestServer,
    request: v1::CreateObjectRequest,
) -> Result<v1::GraspObject, Status> {
    let answer = server.objects().await.create_object(request).await?;
    Ok(answer.into_inner())
}

/// Changes an object.
pub(crate) async fn update(
    server: &TestServer,
    request: v1::UpdateObjectRequest,
) -> Result<v1::GraspObject, Status> {
    let answer = server.objects().await.update_object(request).await?;
    Ok(answer.into_inner())
}

/// The object of this name.
pub(crate) async fn get(server: &TestServer, name: &str) -> Result<v1::GraspObject, Status> {
    let name = name.to_owned();
    let answer = server
        .objects()
        .await
        .get_object(v1::GetObjectRequest { name })
        .await?;
    Ok(answer.into_inner())
}

/// Deletes the object of this name.
pub(crate) async fn delete(server: &TestServer, name: &str) -> Result<(), Status> {
    let request = v1::DeleteObjectRequest {
        name: name.to_owned(),
        ..Default::default()
    };
    server.objects().await.delete_object(request).await.map(drop)
}

/// All objects of a list, page by page.
pub(crate) async fn list(server: &TestServer, mut request: v1::ListObjectsRequest) -> Vec<v1::GraspObject> {
    let mut client = server.objects().await;
    let mut objects = Vec::new();
    loop {
        let page = client.list_objects(request.clone()).await.unwrap().into_inner();
        let page_size = usize::try_from(request.page_size).unwrap();
        assert!(page_size == 0 || page.objects.len() <= page_size);
        objects.extend(page.objects);
        request.page_token = page.next_page_token;
        if request.page_token.is_empty() {
            return objects;
        }
    }
}

/// The etag of the state that an object's mesh belongs to, and its GLB.
pub(crate) async fn mesh(server: &TestServer, name: &str) -> Result<(String, Vec<u8>), Status> {
    let name = name.to_owned();
    let mut parts = server
        .objects()
        .await
        .get_mesh(v1::GetMeshRequest { name })
        .await?
        .into_inner();
    let (mut etag, mut file) = (None, Vec::new());
    while let Some(v1::GetMeshResponse { piece, etag: state }) = parts.message().await? {
        assert!(!piece.is_empty() && piece.len() <= 128 << 10);
        assert_eq!(state.is_empty(), etag.is_some(), "only the first message has it");
        etag.get_or_insert(state);
        file.extend(piece);
    }
    // The header of a GLB has its length.
    assert_eq!(
        u32::from_le_bytes(file[8..12].try_into().unwrap()) as usize,
        file.len()
    );
    Ok((etag.expect("there is a message"), file))
}

/// An answer's bytes without the time it took, which differs from run to run.
pub(crate) fn unchanging(mut answer: v1::FindGraspResponse) -> Vec<u8> {
    answer
        .report
        .as_mut()
        .expect("every answer has a report")
        .search_time = None;
    answer.encode_to_vec()
}
