//! Options for the receiver's body.

use clap::{ArgGroup, Args};
use glam::{Quat, Vec3};
use grasp_client::{
    Convention,
    v1::{self, receiver::Body},
};

use crate::{
    Failure,
    values::{Choice, one_of, parse_turned, parse_vector},
};

/// Whether a receiver may stand anywhere.
const STANCES: [Choice<bool>; 2] = [("facing", false, "Opposite the giver"), ("any", true, "Anywhere")];

/// The receiver's body, whose arm has to reach the wrist.
#[derive(Args, Debug)]
#[command(next_help_heading = "The receiver's body")]
#[command(group(ArgGroup::new("body").args(["shoulder", "receiver_shoulder", "receiver_root"])))]
pub(super) struct ReceiverOptions {
    /// Position of the receiver's shoulder; the wrist must be within --reach of it. Without lengths, any arm does.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    #[arg(requires = "reach")]
    shoulder: Option<Vec3>,
    /// Largest distance from shoulder to wrist.
    #[arg(long, value_name = "METRES", requires = "body")]
    reach: Option<f32>,
    /// Position of the shoulder joint of the receiving hand's side; the arm must reach from there.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vector, allow_hyphen_values = true)]
    receiver_shoulder: Option<Vec3>,
    /// Where a body with --receiver-height stands: the ground between its feet, and how far it is turned about +Y in degrees; at 0
    /// it faces -Z. In the openxr convention only.
    #[arg(long, value_name = "X,Y,Z,DEGREES", value_parser = parse_turned, allow_hyphen_values = true)]
    #[arg(requires = "receiver_height")]
    receiver_root: Option<(Vec3, f32)>,
    /// Height of the body at --receiver-root.
    #[arg(long, value_name = "METRES", requires = "receiver_root")]
    receiver_height: Option<f32>,
    /// Length from shoulder to elbow. Default: in proportion to the height, or 0.30.
    #[arg(long, value_name = "METRES")]
    upper_arm: Option<f32>,
    /// Length from elbow to wrist. Default: in proportion to the height, or 0.26.
    #[arg(long, value_name = "METRES")]
    forearm: Option<f32>,
    /// Where a receiver without a body is expected to stand. Default: facing the giver.
    #[arg(long, value_name = "WHERE", value_parser = one_of(STANCES), conflicts_with = "body")]
    receiver_stance: Option<bool>,
}

impl ReceiverOptions {
    /// Overrides the receiver of a request with the options that are given.
    ///
    /// # Errors
    /// A length without a body, or a root in another convention than `OpenXR`.
    pub(super) fn override_in(&self, request: &mut v1::FindGraspRequest) -> Result<(), Failure> {
        let convention = request.output_mut().convention();
        let receiver = request.receiver_mut();
        if let Some(shoulder) = self.shoulder.or(self.receiver_shoulder) {
            receiver.body = Some(Body::ClientShoulder(shoulder.into()));
            receiver.height = 0.0;
        }
        if let (Some((position, degrees)), Some(height)) = (self.receiver_root, self.receiver_height) {
            if !matches!(convention, Convention::Unspecified | Convention::Openxr) {
                return Err(Failure::usage(
                    "--receiver-root requires a request in the openxr convention; write receiver.clientFromRoot in the file",
                ));
            }
            let turn = Quat::from_rotation_y(degrees.to_radians());
            receiver.body = Some(Body::ClientFromRoot(v1::Pose::new(position, turn)));
            receiver.height = height;
        }
        if let Some(anywhere) = self.receiver_stance {
            receiver.body = anywhere.then_some(Body::Anywhere(true));
        }
        let has_body = matches!(
            receiver.body,
            Some(Body::ClientShoulder(_) | Body::ClientFromRoot(_))
        );
        if (self.upper_arm.is_some() || self.forearm.is_some()) && !has_body {
            return Err(Failure::usage(
                "--upper-arm and --forearm require a body: --receiver-shoulder, --receiver-root or the file's",
            ));
        }
        receiver.max_reach = self.reach.or(receiver.max_reach);
        receiver.upper_arm_length = self.upper_arm.or(receiver.upper_arm_length);
        receiver.forearm_length = self.forearm.or(receiver.forearm_length);
        Ok(())
    }
}
