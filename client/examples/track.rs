//! A character that holds on to its grasp while the giver moves, and what that looks like.
//!
//! The giver walks and turns, opens and closes the fingers, and slides the hand along the object until it is in the way of the
//! grasp, so that another one is needed. Frames are sent 90 times a second, and nobody waits for answers. A line per change says
//! what became of the grasp. The motion is written as a binary glTF file with an animation, for Blender, three.js and other
//! viewers.
//!
//! Start a server, then run the example; all arguments are optional:
//!
//! ```sh
//! cargo run --release --package grasp-server
//! cargo run --package grasp-client --example track -- http://[::1]:50051 target/track.glb
//! ```

use std::{
    error::Error,
    f32::consts::TAU,
    fs,
    path::Path,
    time::{Duration, Instant},
};

use glam::{Quat, Vec3};
use grasp_client::{
    ClientError, CurrentGraspStatus, GraspClient, Handedness, TrackStream,
    v1::{DigitAngles, HandPose, Holdout, Pose, Track, TrackAnswer, TrackFrame},
};
use grasp_scene::{
    client::{ObjectLook, TrackRecording},
    to_moving_glb,
};

/// The object that is held out.
const OBJECT: &str = "objects/remote";

/// One frame at 90 Hz, as of a headset.
const FRAME: Duration = Duration::from_micros(11_111);

/// Length of the motion.
const LENGTH: Duration = Duration::from_secs(10);

/// How long to wait for the answer to the last frame.
const LAST_ANSWER: Duration = Duration::from_secs(2);

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |default: &str| arguments.next().unwrap_or_else(|| default.to_owned());
    let url = next("http://[::1]:50051");
    let glb = next("target/track.glb");

    let client = GraspClient::connect(url).await?;
    // With the way to the grasp, clear of giver and object. Without it, the hand would draw back along its own arm.
    let mut track = Track::new(OBJECT).receiving(Handedness::Right);
    track.output_mut().key_frames = true;
    let mut stream = client.track(&track).await?;
    let recording = play(&mut stream, TrackRecording::new(&track)).await?;

    let look = ObjectLook::built_in(OBJECT).ok_or("the object is not built in")?;
    let handover = recording.handover(&look)?;
    write(&glb, &to_moving_glb(&handover))?;
    println!("written: {glb}");
    Ok(())
}

/// Sends the frames at their times, and takes answers as they come.
async fn play(track: &mut TrackStream, mut recording: TrackRecording) -> Result<TrackRecording, ClientError> {
    let count = LENGTH.div_duration_f32(FRAME) as u64;
    let mut changes = Changes::default();
    // When each frame was sent.
    let mut sent = Vec::new();
    let mut clock = tokio::time::interval(FRAME);
    while sent.len() < count as usize {
        tokio::select! {
            _ = clock.tick() => {
                let frame = frame(sent.len() as u64);
                track.send(&frame);
                recording.sent(&frame);
                sent.push(Instant::now());
            }
            answer = track.answer() => {
                let Some(answer) = answer? else { return Ok(recording) };
                changes.print(&answer, &sent);
                recording.answered(&answer);
            }
        }
    }
    while changes.last_answered < Some(count - 1)
        && let Ok(answer) = tokio::time::timeout(LAST_ANSWER, track.answer()).await
    {
        let Some(answer) = answer? else { break };
        changes.print(&answer, &sent);
        recording.answered(&answer);
    }
    println!("{count} frames, {} answered", changes.answered);
    Ok(recording)
}

/// Prints what changes.
#[derive(Default)]
struct Changes {
    answered: usize,
    last_answered: Option<u64>,
    status: Option<CurrentGraspStatus>,
}

impl Changes {
    fn print(&mut self, answer: &TrackAnswer, sent: &[Instant]) {
        self.answered += 1;
        self.last_answered = Some(answer.sequence);
        let status = answer.status();
        let before = self.status.replace(status);
        if before == Some(status) && status != CurrentGraspStatus::Replanned {
            return;
        }
        let Some(sent) = sent.get(answer.sequence as usize) else {
            return;
        };
        let failed = answer
            .current
            .as_ref()
            .and_then(|current| current.failed_check.as_ref());
        let why = failed.map_or_else(String::new, |failed| format!(": {}", failed.description));
        println!(
            "{:.2} s: {:?} after {:.1} ms{why}",
            FRAME.as_secs_f32() * answer.sequence as f32,
            status,
            1e3 * sent.elapsed().as_secs_f32(),
        );
    }
}

/// The frame of this number: where the game has giver and object.
fn frame(sequence: u64) -> TrackFrame {
    let time = FRAME * sequence as u32;
    let seconds = time.as_secs_f32();
    // For three seconds each: a sway of a height that begins and ends at rest.
    let sway = |start: f32| {
        let phase = ((seconds - start) / 3.0).clamp(0.0, 1.0);
        (TAU * phase).sin() * (0.5 * TAU * phase).sin()
    };
    let walk = Vec3::new(0.25 * sway(0.0), 0.0, 0.05 * sway(0.0));
    let turn = Quat::from_rotation_y(0.4 * sway(0.0));
    let moved = Pose::new(walk, turn);

    let client_from_object = moved * client_from_object();
    let along_object = client_from_object.orientation() * Vec3::X;
    let slide = Pose::new(0.05 * sway(6.0) * along_object, Quat::IDENTITY);
    let holdout = Holdout {
        client_from_object: Some(client_from_object),
        presenting_hand: Some(giver(slide * moved, sway(3.0).abs()).into()),
        ..Holdout::default()
    };
    TrackFrame::of(sequence, holdout).captured_at(time)
}

/// The object at the start.
fn client_from_object() -> Pose {
    Pose::new(
        Vec3::new(-0.0009, -0.0011, -0.0001),
        Quat::from_xyzw(-0.0850, -0.7020, -0.5741, -0.4128),
    )
}

/// The giver's hand, moved and opened by a share, as joint angles of a built-in rig.
fn giver(moved: Pose, opened: f32) -> HandPose {
    // Radians, thumb first: yaw and pitch of the base joint, pitch of the others.
    let digits = [
        [0.0000, 0.0656, -0.0710, -0.0473],
        [0.0873, 0.0932, 0.5731, 0.3820],
        [-0.0402, 0.3431, 1.4154, 0.9436],
        [-0.0873, 0.5210, 1.4671, 0.9781],
        [-0.0873, 0.6217, 1.1477, 0.7651],
    ];
    let bent = 1.0 - 0.6 * opened;
    let digits = digits.map(|[yaw, base, second, third]| {
        Some(DigitAngles::new([yaw, bent * base, bent * second, bent * third]))
    });
    let wrist = Pose::new(
        Vec3::new(-0.0480, 0.0144, -0.1119),
        Quat::from_xyzw(0.8809, -0.4197, -0.1982, -0.0927),
    );
    HandPose::new("rigs/thesis", Handedness::Right)
        .with_client_from_wrist(moved * wrist)
        .with_digits(digits)
}

/// Writes a file, creating its folder if necessary.
fn write(path: &str, bytes: &[u8]) -> std::io::Result<()> {
    if let Some(folder) = Path::new(path).parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(path, bytes)
}
