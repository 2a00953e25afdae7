//! Asks for a grasp on a built-in object that a person holds out, and prints the pose of the character's hand.
//!
//! Start a server, then run the example; the server's URL is optional:
//!
//! ```sh
//! cargo run --release --package grasp-server
//! cargo run --package grasp-client --example find_grasp -- http://[::1]:50051
//! ```

use std::time::Duration;

use glam::{Quat, Vec3};
use grasp_client::{
    ClientError, GraspClient, Handedness,
    v1::{DigitAngles, FindGraspRequest, Grasp, HandPose, Pose},
};

#[tokio::main]
async fn main() -> Result<(), ClientError> {
    let url = std::env::args().nth(1);
    let url = url.unwrap_or("http://[::1]:50051".to_owned());
    let client = GraspClient::connect(url).await?;
    let request = FindGraspRequest::new("objects/remote")
        // The object and the giver's hand in the game; any frame will do if both use it.
        .with_client_from_object(Pose::new(
            Vec3::new(-0.0009, -0.0011, -0.0001),
            Quat::from_xyzw(-0.0850, -0.7020, -0.5741, -0.4128),
        ))
        .with_presenting_hand(giver())
        .with_budget(Duration::from_secs(2));
    let answer = client.find_grasp(&request).await?;
    match answer.grasp() {
        Some(grasp) => print_grasp(grasp),
        // Not an error: the giver may leave no room, or the budget is too short.
        None => println!("no grasp in {} attempts", answer.attempts()),
    }
    println!("the search took {:?}", answer.search_time());
    Ok(())
}

/// The giver's hand as joint angles of a built-in rig. See the example `register_object` for a hand that a headset
/// tracks.
fn giver() -> HandPose {
    // Radians, thumb first: yaw and pitch of the base joint, pitch of the others.
    let digits = [
        [0.0000, 0.0656, -0.0710, -0.0473],
        [0.0873, 0.0932, 0.5731, 0.3820],
        [-0.0402, 0.3431, 1.4154, 0.9436],
        [-0.0873, 0.5210, 1.4671, 0.9781],
        [-0.0873, 0.6217, 1.1477, 0.7651],
    ];
    HandPose::new("rigs/thesis", Handedness::Right)
        .with_client_from_wrist(Pose::new(
            Vec3::new(-0.0480, 0.0144, -0.1119),
            Quat::from_xyzw(0.8809, -0.4197, -0.1982, -0.0927),
        ))
        .with_digits(digits.map(|angles| Some(DigitAngles::new(angles))))
}

fn print_grasp(grasp: &Grasp) {
    let Some(hand) = &grasp.hand else { return };
    let (side, rig) = (hand.handedness(), &hand.rig);
    println!("{side:?} hand, {rig}, type {:?}", grasp.r#type());
    if let Some(wrist) = &hand.client_from_wrist {
        println!("wrist: {}", shown(wrist.position(), wrist.orientation()));
    }
    // Pose the character's skeleton with these, in the order of XR_EXT_hand_tracking. Rigs with few fingers lack some.
    for (place, joint) in hand.posed_joints().into_iter().enumerate() {
        if let Some(joint) = joint {
            let shown = shown(joint.position(), joint.orientation());
            println!("joint {place}: {shown}, radius {:.1} mm", 1000.0 * joint.radius);
        }
    }
    println!("contacts: {}", grasp.contacts.len());
}

fn shown(p: Vec3, q: Quat) -> String {
    format!(
        "at {:.3} {:.3} {:.3} m, quaternion {:.3} {:.3} {:.3} {:.3}",
        p.x, p.y, p.z, q.x, q.y, q.z, q.w
    )
}
