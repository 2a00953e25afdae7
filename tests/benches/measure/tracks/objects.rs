//! The objects that are held out: the built-in ones and real meshes, with complete atlases of both hands.

use std::{
    fs,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use grasp_assets::{
    atlas_folder::AtlasFolder,
    atlases::shipped_atlas,
    hands::hand,
    objects::{BuiltInObject, objects},
};
use grasp_proto::v1::{self, grasp_service_client::GraspServiceClient};
use grasp_synthesis::{
    known::{atlas::Atlas, codec::decode},
    model::{hand::Handedness, object::GraspObject},
    propose::prepared::PreparedRig,
};
use grasp_tests::{
    TestServer,
    progress::bar,
    recorded::{data_folder_or_skip, object_of},
};
use tonic::transport::Channel;

/// Real meshes with usual masses in kilograms.
const REAL: [(&str, f32); 11] = [
    ("osim_banana", 0.12),
    ("osim_hammer", 0.5),
    ("osim_knife", 0.1),
    ("osim_mug", 0.3),
    ("osim_phone", 0.18),
    ("osim_scissors", 0.08),
    ("osim_toothbrush", 0.02),
    ("osim_wineglass", 0.15),
    ("xr_google-daydream", 0.1),
    ("xr_logitech-mx-ink", 0.03),
    ("xr_oculus-go", 0.1),
];

/// Both hands.
const HANDS: [Handedness; 2] = [Handedness::Left, Handedness::Right];

/// Longest wait for the atlases of an object, in which others grow too.
const ATLAS_TIMEOUT: Duration = Duration::from_mins(10);

/// Pause between two looks at whether an atlas is complete. Shorter ones cost its builder time.
const LOOK_AFTER: Duration = Duration::from_millis(100);

/// An object and what is known of it.
pub(crate) struct HeldObject {
    /// Its name on the server.
    pub(crate) name: String,
    /// As the server has it.
    pub(crate) object: Arc<GraspObject>,
    /// The atlases of [`HANDS`], those of the server.
    atlases: Vec<Arc<Atlas>>,
}

impl HeldObject {
    /// The atlas of the default hand of a side.
    pub(crate) fn atlas(&self, handedness: Handedness) -> &Atlas {
        let place = HANDS.iter().position(|&hand| hand == handedness);
        &self.atlases[place.expect("there are two sides")]
    }
}

/// The rig of requests that name none.
pub(crate) fn default_rig(handedness: Handedness) -> &'static PreparedRig {
    &hand("adult", handedness).expect("the adult rig is built in").rig
}

/// The names of the real meshes.
pub(crate) fn real_objects() -> Vec<&'static str> {
    REAL.map(|(name, _)| name).to_vec()
}

/// A server with the built-in objects and, where the recorded data is, these real ones, and the objects; without real ones, two. Atlases
/// that are not in cargo's target folder grow first, which takes some seconds each.
pub(crate) async fn serve_objects(real: &[&str]) -> (TestServer, Vec<HeldObject>) {
    let folder = AtlasFolder::new(
        AtlasFolder::in_target()
            .path()
            .with_file_name("atlases-of-tracks"),
    );
    let server = TestServer::start_with(|config| {
        config.builder_threads = 2;
        config.atlas_directory = Some(folder.path().to_owned());
    })
    .await;
    let mut held: Vec<HeldObject> = objects().iter().map(built_in_object).collect();
    if real.is_empty() {
        held.truncate(2);
        return (server, held);
    }
    let data = data_folder_or_skip("the motions of real objects");
    let mut creating = server.objects().await;
    let mut finding = server.grasps().await;
    let wanted = REAL.into_iter().filter(|(name, _)| real.contains(name));
    let real = data
        .iter()
        .flat_map(|data| wanted.clone().map(|known| real_object(data, known)));
    let mut created = Vec::new();
    for (mut create, object) in real {
        let name = create.object_mut().name.clone();
        creating.create_object(create).await.expect("the mesh is sound");
        created.push((name, object));
    }
    let bar = bar(created.len(), "atlases".to_owned());
    for (name, object) in created {
        let mut atlases = Vec::new();
        for handedness in HANDS {
            let grips = wait_for_atlas(&mut finding, &name, handedness).await;
            let file = folder.file(&object, default_rig(handedness));
            atlases.push(saved_atlas(&file, &object, handedness, grips).await);
        }
        held.push(HeldObject {
            name,
            object,
            atlases,
        });
        bar.inc(1);
    }
    (server, held)
}

fn built_in_object(built_in: &BuiltInObject) -> HeldObject {
    let object = Arc::clone(&built_in.object);
    let atlases = HANDS.map(|handedness| {
        let rig = default_rig(handedness);
        let shipped = shipped_atlas(built_in.name, rig).expect("built-in objects have atlases");
        decode(shipped, &object, rig)
            .expect("it is of this hand")
            .completed()
            .atlas
    });
    HeldObject {
        name: format!("objects/{}", built_in.name),
        object,
        atlases: atlases.to_vec(),
    }
}

/// Asks for an object until its atlas for a hand is complete; returns the number of its grips.
async fn wait_for_atlas(client: &mut GraspServiceClient<Channel>, name: &str, handedness: Handedness) -> u32 {
    let side = match handedness {
        Handedness::Left => v1::Handedness::Left,
        Handedness::Right => v1::Handedness::Right,
    };
    let mut request = v1::FindGraspRequest::new(name).receiving(side);
    // Only complete atlases answer these.
    request.search_mut().choice = v1::GraspChoice::Reproducible.into();
    request.search_mut().max_attempts = Some(1);
    let start = Instant::now();
    loop {
        let answer = client.find_grasp(request.clone()).await;
        let origin = answer.expect("the request is right").into_inner().origin;
        let grips = origin.map_or(0, |origin| {
            origin.atlases.iter().map(|atlas| atlas.entry_count).sum()
        });
        if grips > 0 {
            return grips;
        }
        assert!(start.elapsed() < ATLAS_TIMEOUT, "{name} has no atlas");
        tokio::time::sleep(LOOK_AFTER).await;
    }
}

/// The atlas of so many grips that the server saves at about the time when it begins to use it.
async fn saved_atlas(file: &Path, object: &GraspObject, handedness: Handedness, grips: u32) -> Arc<Atlas> {
    let start = Instant::now();
    loop {
        if let Ok(bytes) = fs::read(file)
            && let Ok(grown) = decode(&bytes, object, default_rig(handedness))
            && grown.atlas.entries().len() == grips as usize
        {
            return grown.completed().atlas;
        }
        assert!(start.elapsed() < ATLAS_TIMEOUT, "{} is not saved", file.display());
        tokio::time::sleep(LOOK_AFTER).await;
    }
}

/// The request that creates a real object with its centre of mass in the middle of its volume, and the object.
fn real_object(data: &Path, (file, mass_kg): (&str, f32)) -> (v1::CreateObjectRequest, Arc<GraspObject>) {
    let path = data.join("objects").join(file).with_extension("obj");
    let mesh = fs::read(path).expect("the mesh is there");
    let about_origin = object_of(&mesh, mass_kg);
    let surface = about_origin.surface.mesh();
    let centre = surface.volume_centroid().unwrap_or_default();
    let object = GraspObject::new(surface.clone(), mass_kg, centre, None, &[]).expect("the object is sound");
    let mut create = v1::CreateObjectRequest::new(file.replace('_', "-"), mesh, mass_kg);
    create.object_mut().center_of_mass = Some(centre.into());
    (create, Arc::new(object))
}
