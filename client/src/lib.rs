//! Client of the grasp service: finds hand poses with which a virtual character takes an object that a person holds
//! out.
//!
//! ```no_run
//! use std::time::Duration;
//!
//! use grasp_client::{GraspClient, Handedness, v1};
//!
//! #[tokio::main]
//! async fn main() -> Result<(), grasp_client::ClientError> {
//!     let client = GraspClient::connect("http://[::1]:50051").await?;
//!     let request = v1::FindGraspRequest::new("objects/remote")
//!         .receiving(Handedness::Left)
//!         .with_budget(Duration::from_millis(500));
//!     let answer = client.find_grasp(&request).await?;
//!     println!("{:?} after {} attempts", answer.outcome(), answer.attempts());
//!     for joint in answer.hand().map(v1::HandPose::posed_joints).iter().flatten().flatten() {
//!         println!("{} {}", joint.position(), joint.orientation());
//!     }
//!     Ok(())
//! }
//! ```
//!
//! - [`GraspClient`] connects and calls, with deadlines and retries; it is cheap to clone.
//! - [`v1`] has the contract's messages as they are sent, with builders of common requests, such as
//!   [`v1::FindGraspRequest::new`] and [`v1::Shape::capsule`], and methods for common uses of answers, such as
//!   [`v1::Grasp::client_contacts`]. Vectors and rotations convert from and to glam's.
//! - [`GraspStream`] has every better grasp as it is found, or the best that differ.
//! - [`TrackStream`] holds on to a grasp while giver and object move, frame by frame.
//! - [`ObjectWatch`] reports changes of objects.
//! - [`ClientError`] has the code of a failed call and the standard details that the server attached.
//!
//! All poses are in one frame of the client's choice; a field named `a_from_b` maps points of frame b to frame a. Metres,
//! kilograms, newtons, radians and unit quaternions, in the axes of the request's [`Convention`].
//!
//! The folder `examples` has complete programs: one search, a custom object with a tracked hand, and a moving giver drawn as an
//! animation. Feature `built-in` adds the built-in holdouts as requests, `json` protobuf's JSON of messages.

#[cfg(feature = "built-in")]
pub mod built_in;
mod client;
mod error;
mod objects;
mod retry;
mod streams;

pub use client::{GraspClient, GraspClientBuilder, Health};
pub use error::{BoxError, CallError, ClientError};
#[cfg(feature = "json")]
pub use grasp_proto::json;
pub use grasp_proto::{
    JOINT_COUNT, code_name, std_duration,
    v1::{
        self, Check, Convention, CurrentGraspStatus, Digit, GraspChoice, GraspSource, GraspType, Handedness,
        Outcome, Preference, Strategy,
    },
    wire_duration,
};
pub use objects::ObjectMesh;
pub use retry::RetryPolicy;
pub use streams::{GraspStream, MessageStream, ObjectWatch, TrackStream};
pub use tonic::Code;
pub use tonic_types::{ErrorDetails, FieldViolation};

/// The README's Rust example compiles.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
