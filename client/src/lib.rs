//! Asks a grasp server how a virtual character's hand takes an object that a person holds out.
//!
//! ```no_run
//! use grasp_client::{FindRequest, GraspClient, Strategy};
//!
//! #[tokio::main]
//! async fn main() -> Result<(), grasp_client::ClientError> {
//!     let client = GraspClient::connect("http://[::1]:50051").await?;
//!     let request = FindRequest { strategy: Some(Strategy::F), ..FindRequest::new("objects/remote") };
//!     let answer = client.find_grasp(&request).await?;
//!     println!("{:?} after {} attempts", answer.outcome, answer.report.attempts);
//!     for joint in answer.grasp.iter().flat_map(|grasp| &grasp.joints) {
//!         println!("{} {}", joint.client_from_joint.position, joint.client_from_joint.orientation);
//!     }
//!     Ok(())
//! }
//! ```
//!
//! - [`GraspClient`] connects and calls, with deadlines and retries; it is cheap to clone.
//! - [`FindRequest`] and [`FindAnswer`] are the question and the answer; [`PresentingHand`] is the giver's hand,
//!   [`Constraints`] say which grasps will do.
//! - [`ClientError`] tells failures apart and carries the standard details that the server attached.
//!
//! Poses are in one frame of the client's choice; a field named `a_from_b` takes points of frame b to frame a. Metres,
//! kilograms, newtons, radians, unit quaternions, in the axes of the request's [`Convention`]. No type of the wire's
//! generated code shows here.
//!
//! The command line `grasp` (feature `cli`, on by default) is built on this library; games build it with
//! `default-features = false`.

#[cfg(feature = "built-in")]
pub mod built_in;
mod client;
mod constraints;
mod error;
mod grasp_type;
mod hand;
mod json;
mod key_frame;
mod object;
mod pose;
mod retry;
mod score;
mod search;
mod wire;

pub use client::{GraspClient, GraspClientBuilder};
pub use constraints::{ApproachCone, Constraints, Reach};
pub use error::{BoxError, CallError, ClientError, ErrorDetails, FieldViolation, Resource, code_name};
pub use grasp_type::GraspType;
pub use hand::{
    Digit, DigitAngles, HandAngles, HandJoints, Handedness, JOINT_COUNT, JointPose, JointSet, Phalanx,
    PresentingHand, ReceivingHand,
};
pub use key_frame::{KeyFrame, KeyFrameKind};
pub use object::{AtlasState, ForbiddenSurfaces, Health, NewObject, Object, ObjectPage};
pub use pose::Pose;
pub use retry::RetryPolicy;
pub use score::{Score, ScoreTerm};
pub use search::{
    AtlasUse, BendRatios, Choice, Contact, Convention, FindAnswer, FindRequest, Grasp, GraspSource,
    NearestMiss, Outcome, PhysicalMargins, Rejection, RejectionCount, SearchReport, Step, StepTime, Strategy,
    Validity,
};

/// The README's Rust example compiles.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
