//! A character's hand takes the remote control: asks the service without holding up a frame, poses the skeleton of a glTF model by
//! the names of its nodes, and says how far the model's joints are from the answer's.
//!
//!     grasp-bevy [URL of the server]

use std::{path::Path, process::ExitCode, time::Duration};

use bevy::{
    app::ScheduleRunnerPlugin,
    gltf::{GltfAssetLabel, GltfPlugin},
    image::ImagePlugin,
    mesh::MeshPlugin,
    prelude::*,
    world_serialization::{WorldAssetRoot, WorldSerializationPlugin},
};
use grasp_client::{ClientError, Code, GraspClient, Handedness, v1};
use tokio::sync::oneshot::{self, error::TryRecvError};

const SERVER: &str = "http://[::1]:50051";
/// The folder of the model, which is the character's hand.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/hands");
const MODEL: &str = "adult_right.glb";
/// The time of a frame.
const FRAME: Duration = Duration::from_millis(10);
const RIG: &str = "bevy-hand";
/// Largest distance in metres between the model's joints and the answer's.
const TOLERANCE: f32 = 1e-3;
/// The start of the names of a digit's nodes, and its first joint as OpenXR numbers them.
const DIGITS: [(&str, usize); 5] = [
    ("thumb-", 2),
    ("index-finger-", 6),
    ("middle-finger-", 11),
    ("ring-finger-", 16),
    ("pinky-finger-", 21),
];

/// A joint of the answer, as OpenXR numbers them.
#[derive(Component)]
struct Joint(usize);

/// The grasp, when it has come.
#[derive(Resource)]
struct Asked(oneshot::Receiver<Result<v1::Grasp, String>>);

/// The grasp to show.
#[derive(Resource)]
struct Answer(v1::Grasp);

/// The hand was posed in the frame before.
#[derive(Resource)]
struct Posed;

fn main() -> ExitCode {
    let server = std::env::args().nth(1).unwrap_or_else(|| SERVER.to_owned());
    // The client runs on a runtime of its own, beside Bevy's schedules.
    let runtime = tokio::runtime::Runtime::new().expect("threads can be started");
    let (sender, asked) = oneshot::channel();
    runtime.spawn(async move { sender.send(ask(server).await.map_err(|error| error.to_string())) });

    let mut app = App::new();
    let assets = AssetPlugin {
        file_path: FOLDER.to_owned(),
        ..AssetPlugin::default()
    };
    // Without a window. A game has DefaultPlugins, and the rest stays.
    app.add_plugins((
        MinimalPlugins.set(ScheduleRunnerPlugin::run_loop(FRAME)),
        TransformPlugin,
        assets,
        ImagePlugin::default(),
        MeshPlugin,
        WorldSerializationPlugin,
        GltfPlugin::default(),
    ));
    app.insert_resource(Asked(asked))
        .add_systems(Startup, load)
        .add_systems(Update, (receive, pose.run_if(not(resource_exists::<Posed>))))
        .add_systems(Last, measure.run_if(resource_added::<Posed>));
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

/// Makes a rig of the model and asks for a grasp by it.
async fn ask(server: String) -> Result<v1::Grasp, ClientError> {
    let client = GraspClient::connect(server).await?;
    let model = std::fs::read(Path::new(FOLDER).join(MODEL)).unwrap_or_default();
    let rig = v1::CreateRigRequest {
        handedness: Handedness::Right.into(),
        ..v1::CreateRigRequest::of_model(RIG, model)
    };
    match client.create_rig(&rig).await {
        // From an earlier run.
        Err(error) if error.code() == Some(Code::AlreadyExists) => {}
        created => drop(created?),
    }
    let held_out = v1::Pose::new([0.0, 1.2, -0.4].into(), glam::Quat::IDENTITY);
    let mut request = v1::FindGraspRequest::new("objects/remote")
        .with_client_from_object(held_out)
        .receiving(Handedness::Right);
    request.receiver_mut().rig = format!("rigs/{RIG}");
    let answer = client.find_grasp(&request).await?;
    Ok(answer.grasp().cloned().unwrap_or_default())
}

fn load(mut commands: Commands, assets: Res<AssetServer>) {
    let scene = GltfAssetLabel::Scene(0).from_asset(MODEL);
    commands.spawn(WorldAssetRoot(assets.load(scene)));
}

/// Takes the answer when it has come.
fn receive(mut commands: Commands, asked: Option<ResMut<Asked>>, mut exit: MessageWriter<AppExit>) {
    let Some(mut asked) = asked else { return };
    match asked.0.try_recv() {
        Err(TryRecvError::Empty) => return,
        Ok(Ok(grasp)) if grasp.hand.is_some() => commands.insert_resource(Answer(grasp)),
        Ok(Ok(_)) => fail(&mut exit, "no grasp was found in time"),
        Ok(Err(error)) => fail(&mut exit, &error),
        Err(TryRecvError::Closed) => fail(&mut exit, "the client panicked"),
    }
    commands.remove_resource::<Asked>();
}

fn fail(exit: &mut MessageWriter<AppExit>, why: &str) {
    eprintln!("error: {why}");
    exit.write(AppExit::error());
}

/// Poses the model's nodes once it is loaded, and spawns the answer's joints.
fn pose(mut commands: Commands, answer: Option<Res<Answer>>, mut nodes: Query<(&Name, &mut Transform)>) {
    let Some(hand) = answer.as_ref().and_then(|answer| answer.0.hand.as_ref()) else {
        return;
    };
    if nodes.is_empty() {
        return;
    }
    // The hand's root is in the client's frame, which is the world; nodes below it are in their parents.
    for posed in &hand.model {
        let pose = posed.pose.unwrap_or_default();
        for (name, mut transform) in &mut nodes {
            if name.as_str() == posed.node {
                transform.rotation = Quat::from_array(pose.orientation().to_array());
                if pose.position.is_some() {
                    transform.translation = Vec3::from_array(pose.position().to_array());
                }
            }
        }
    }
    for (number, joint) in hand.joints.iter().enumerate() {
        let place = Transform::from_translation(Vec3::from_array(joint.position().to_array()));
        let rotation = Quat::from_array(joint.orientation().to_array());
        commands.spawn((Joint(number), place.with_rotation(rotation)));
    }
    commands.insert_resource(Posed);
}

/// The number of the joint that a node is; none of the tips, which lie on the skin.
fn joint_of(node: &str) -> Option<usize> {
    let (joint, first) = DIGITS
        .iter()
        .find_map(|(digit, first)| Some((node.strip_prefix(digit)?, first)))?;
    let place = match joint {
        "metacarpal" => 0,
        "phalanx-proximal" => 1,
        "phalanx-intermediate" => 2,
        "phalanx-distal" if *first == DIGITS[0].1 => 2,
        "phalanx-distal" => 3,
        _ => return None,
    };
    Some(first + place)
}

/// Compares the model's joints with the answer's, and says how far the skin at the contacts is from the joints before them.
fn measure(
    answer: Res<Answer>,
    nodes: Query<(&Name, &GlobalTransform)>,
    joints: Query<(&Joint, &Transform)>,
    mut exit: MessageWriter<AppExit>,
) {
    let mut compared = 0;
    let mut farthest: f32 = 0.0;
    for (name, node) in &nodes {
        let joint = joint_of(name).and_then(|number| joints.iter().find(|(joint, _)| joint.0 == number));
        if let Some((_, joint)) = joint {
            let distance = node.translation().distance(joint.translation);
            println!("{name}: {:.3} mm from the answer's joint", 1000.0 * distance);
            farthest = farthest.max(distance);
            compared += 1;
        }
    }
    for contact in answer.0.client_contacts() {
        let place = Vec3::from_array(contact.position().to_array());
        let near = nodes
            .iter()
            .map(|(name, node)| (name, node.translation().distance(place)));
        if let Some((name, distance)) = near.min_by(|(_, a), (_, b)| a.total_cmp(b)) {
            let digit = contact.digit();
            println!(
                "{digit:?} touches the object {:.1} mm from {name}",
                1000.0 * distance
            );
        }
    }
    if compared < 15 || farthest > TOLERANCE {
        fail(&mut exit, "the model's joints are not where the answer's are");
    } else {
        exit.write(AppExit::Success);
    }
}
