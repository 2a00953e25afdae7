//! Client of the grasp service: finds hand poses with which a virtual character takes an object that a person holds
//! out.
//!
//! ```no_run
//! use grasp_client::{FindRequest, GraspClient};
//!
//! #[tokio::main]
//! async fn main() -> Result<(), grasp_client::ClientError> {
//!     let client = GraspClient::connect("http://[::1]:50051").await?;
//!     let request = FindRequest::new("objects/remote");
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
//! - [`FindRequest`] describes the holdout and the search, [`FindAnswer`] the result. [`PresentingHand`] is the giver's
//!   hand; [`Obstacle`]s are kept clear of like it; [`Receiver`] is the body whose arm has to reach; [`Constraints`] are
//!   requirements on the grasp.
//! - [`ValidateRequest`] checks a grasp of the client's own, [`EvaluateRequest`] rates whether and from where an object can be taken.
//! - [`Track`] holds on to a grasp while giver and object move, frame by frame.
//! - [`GraspStream`] has every better grasp as it is found, or the best that differ.
//! - [`NewObject`] describes an object to create, [`ObjectUpdate`] a change, [`ObjectQuery`] a list, and [`ObjectWatch`] tells what
//!   happens to objects.
//! - [`ClientError`] distinguishes failures and carries the standard details that the server attached.
//!
//! All poses are in one frame of the client's choice; a field named `a_from_b` maps points of frame b to frame a. Metres,
//! kilograms, newtons, radians and unit quaternions, in the axes of the request's [`Convention`]. No generated type is
//! part of this interface, unless feature `messages` adds what tools need that read requests from elsewhere.
//!
//! The folder `examples` has complete programs: one search, an own object with a tracked hand, a game loop, and a moving
//! giver drawn as an animation. Feature `built-in` adds the built-in holdouts as requests.

#[cfg(feature = "built-in")]
pub mod built_in;
mod client;
mod constraints;
mod error;
mod evaluation;
mod grasp_type;
mod hand;
mod json;
mod key_frame;
mod known_grip;
mod object;
mod object_streams;
mod objects;
mod obstacle;
mod pose;
mod query;
mod receiver;
mod region;
mod report;
mod retry;
mod rig;
mod rigs;
mod score;
mod search;
mod standing;
mod stream;
mod track;
mod tracks;
mod verdict;
mod wire;

pub use client::{GraspClient, GraspClientBuilder};
pub use constraints::{ApproachCone, Constraints, Reach};
pub use error::{BoxError, CallError, ClientError, ErrorDetails, FieldViolation, Resource, code_name};
pub use evaluation::{EvaluateAnswer, EvaluateRequest, Hindrance, HoldoutRating, InTheWay, Side};
pub use grasp_type::GraspType;
pub use hand::{
    Digit, DigitAngles, HandAngles, HandAtObject, HandJoints, HandMesh, Handedness, JOINT_COUNT, JointPose,
    JointSet, Phalanx, PresentingHand, ReceivingHand,
};
pub use json::rfc3339;
pub use key_frame::{KeyFrame, KeyFrameKind};
pub use known_grip::{KnownGrip, KnownGripUse};
pub use object::{
    AtlasGrowth, AtlasState, ForbiddenSurfaces, Health, NewObject, Object, ObjectChange, ObjectMesh,
    ObjectNews, ObjectPage, ObjectQuery, ObjectUpdate, Reset, UpAxis,
};
pub use object_streams::ObjectWatch;
pub use obstacle::{Capsule, Obstacle, SolidBox};
pub use pose::Pose;
pub use query::{AtlasUse, BendRatios, Choice, Convention, Hands, Strategy, Validity};
pub use receiver::{Arm, Receiver, ReceiverBody, ReceiverStance, StandingBody};
pub use region::{Region, RegionKind, RegionShape};
pub use report::{
    GraspSource, Limit, LimitKind, NearestMiss, PassedOverGrip, Rejection, RejectionCount, SearchReport,
    Step, StepTime,
};
pub use retry::RetryPolicy;
pub use rig::{AngleRange, DigitLimits, NewRig, NodePose, PosedModel, Rig, RigHand, RigNode, RigSource};
pub use score::{Score, ScoreTerm};
pub use search::{Contact, FindAnswer, FindRequest, Grasp, Outcome, PhysicalMargins};
pub use standing::{Fall, FallReason, HandWay, NoGraspReason, StandingGrasp, StandingReport, StandingStatus};
pub use stream::{DifferBy, GraspStream, StreamEvent, StreamSummary, Streamed, StreamedGrasp};
pub use track::{PredictionError, TrackAnswer, TrackFrame, TrackPolicy, TrackSetup};
pub use tracks::{Track, TrackFrames};
pub use verdict::{Check, GraspToValidate, ValidateAnswer, ValidateRequest, Verdict};

/// The README's Rust example compiles.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
