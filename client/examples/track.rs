//! Keeps a character's grasp valid while the giver moves, and writes an animation.
//!
//! The giver walks and turns, opens and closes the fingers, and slides the hand along the object until it is in the way of the
//! grasp, so that another one is needed. Frames are sent 90 times a second without waiting for answers. Each change of the grasp is
//! printed. The motion is written as a binary glTF file with an animation, for Blender, three.js and other viewers.
//!
//! Start a server, then run the example; all arguments are optional:
//!
//! ```sh
//! cargo run --release --package grasp-server
//! cargo run --package grasp-client --example track -- http://[::1]:50051 target/track.glb
//! ```

use std::{error::Error, f32::consts::TAU, fs, path::Path, time::Duration};

use glam::{Quat, Vec3};
use grasp_client::{
    ClientError, CurrentGraspStatus, GraspClient, Handedness, TrackStream,
    v1::{DigitAngles, HandPose, Holdout, Pose, Track, TrackAnswer, TrackFrame},
};
use grasp_scene::{Part, TrackRecording};

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
    // Requests an approach path clear of giver and object. Without it, the hand would draw back along its own arm.
    let mut track = Track::new(OBJECT).receiving(Handedness::Right);
    track.output_mut().key_frames = true;
    let mut stream = client.track(&track).await?;
    let recording = play(&mut stream, TrackRecording::new(&track)).await?;

    let object = Part::built_in_object(OBJECT).ok_or("the object is not built in")?;
    if let Some(folder) = Path::new(&glb).parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(&glb, recording.to_glb(object)?)?;
    println!("written: {glb}");
    Ok(())
}

/// Sends the frames at their times, takes answers as they come, and prints changes.
async fn play(track: &mut TrackStream, mut recording: TrackRecording) -> Result<TrackRecording, ClientError> {
    let count = LENGTH.div_duration_f32(FRAME) as u64;
    let end = tokio::time::Instant::now() + LENGTH + LAST_ANSWER;
    let mut clock = tokio::time::interval(FRAME);
    let (mut sent, mut answered) = (0, 0);
    let mut status = CurrentGraspStatus::Unspecified;
    loop {
        tokio::select! {
            _ = clock.tick(), if sent < count => {
                let frame = frame(sent);
                track.send(&frame);
                recording.sent(&frame);
                sent += 1;
            }
            () = tokio::time::sleep_until(end) => break,
            answer = track.answer() => {
                let Some(answer) = answer? else { break };
                recording.answered(&answer);
                answered += 1;
                let before = std::mem::replace(&mut status, answer.status());
                if before != status || status == CurrentGraspStatus::Replanned {
                    print(&answer);
                }
                if answer.sequence + 1 == count {
                    break;
                }
            }
        }
    }
    println!("{count} frames, {answered} answered");
    Ok(recording)
}

/// Prints the status of the grasp, and the reason.
fn print(answer: &TrackAnswer) {
    let current = answer.current.as_ref();
    let failed = current.and_then(|current| current.failed_check.as_ref());
    let why = failed.map_or_else(String::new, |failed| format!(": {}", failed.description));
    println!(
        "{:.2} s: {:?} after {:.1} ms at the server{why}",
        FRAME.as_secs_f32() * answer.sequence as f32,
        answer.status(),
        1e3 * answer.server_time().as_secs_f32(),
    );
}

/// Frame number `sequence`; a game takes giver and object from its scene.
fn frame(sequence: u64) -> TrackFrame {
    let time = FRAME * sequence as u32;
    let seconds = time.as_secs_f32();
    // A sway lasts three seconds, and begins and ends at rest.
    let sway = |start: f32| {
        let phase = ((seconds - start) / 3.0).clamp(0.0, 1.0);
        (TAU * phase).sin() * (0.5 * TAU * phase).sin()
    };
    let walk = Vec3::new(0.25 * sway(0.0), 0.0, 0.05 * sway(0.0));
    let turn = Quat::from_rotation_y(0.4 * sway(0.0));
    let moved = Pose::new(walk, turn);

    let at_start = Pose::new(
        Vec3::new(-0.0009, -0.0011, -0.0001),
        Quat::from_xyzw(-0.0850, -0.7020, -0.5741, -0.4128),
    );
    let client_from_object = moved * at_start;
    let along_object = client_from_object.orientation() * Vec3::X;
    let slide = Pose::new(0.05 * sway(6.0) * along_object, Quat::IDENTITY);
    let holdout = Holdout {
        client_from_object: Some(client_from_object),
        presenting_hand: Some(giver(slide * moved, sway(3.0).abs()).into()),
        ..Holdout::default()
    };
    TrackFrame::of(sequence, holdout).captured_at(time)
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
