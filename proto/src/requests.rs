//! Requests: about holdouts, tracks, objects and rigs.

use std::time::Duration;

use glam::Vec3;

use crate::{
    v1::{self, receiver::Body},
    values::{std_duration, wire_duration},
};

/// Methods of requests that have a holdout, a receiver, requirements and output options.
macro_rules! parts {
    ($($request:ident),*) => {$(
        impl v1::$request {
            /// A request about an object at the client's origin, with the server's defaults.
            pub fn new(object: impl Into<String>) -> Self {
                Self {
                    holdout: Some(v1::Holdout::new(object)),
                    ..Self::default()
                }
            }

            /// The holdout, to change it.
            pub fn holdout_mut(&mut self) -> &mut v1::Holdout {
                self.holdout.get_or_insert_default()
            }

            /// Who takes it, to change it.
            pub fn receiver_mut(&mut self) -> &mut v1::Receiver {
                self.receiver.get_or_insert_default()
            }

            /// Constraints on grasps, to change them.
            pub fn requirements_mut(&mut self) -> &mut v1::Requirements {
                self.requirements.get_or_insert_default()
            }

            /// The form of answers, to change it.
            pub fn output_mut(&mut self) -> &mut v1::OutputOptions {
                self.output.get_or_insert_default()
            }

            /// The same request with the object here.
            #[must_use]
            pub fn with_client_from_object(mut self, client_from_object: v1::Pose) -> Self {
                self.holdout_mut().client_from_object = Some(client_from_object);
                self
            }

            /// The same request with this giver's hand.
            #[must_use]
            pub fn with_presenting_hand(mut self, hand: impl Into<v1::PresentingHand>) -> Self {
                self.holdout_mut().presenting_hand = Some(hand.into());
                self
            }

            /// The same request with another hand to keep clear of. The first one is the giver's.
            #[must_use]
            pub fn with_hand(mut self, hand: impl Into<v1::PresentingHand>) -> Self {
                let holdout = self.holdout_mut();
                if holdout.presenting_hand.is_none() {
                    holdout.presenting_hand = Some(hand.into());
                } else {
                    holdout.other_hands.push(hand.into());
                }
                self
            }

            /// The same request with another obstacle.
            #[must_use]
            pub fn with_obstacle(mut self, obstacle: v1::Shape) -> Self {
                self.holdout_mut().obstacles.push(obstacle);
                self
            }

            /// The same request for this hand.
            #[must_use]
            pub fn receiving(mut self, handedness: v1::Handedness) -> Self {
                self.receiver_mut().handedness = handedness.into();
                self
            }

            /// The same request in this convention.
            #[must_use]
            pub fn with_convention(mut self, convention: v1::Convention) -> Self {
                self.output_mut().convention = convention.into();
                self
            }
        }
    )*};
}

parts!(
    FindGraspRequest,
    StreamGraspsRequest,
    Track,
    ValidateGraspRequest,
    EvaluateHoldoutRequest
);

/// Methods of requests that have search options.
macro_rules! searches {
    ($($request:ident),*) => {$(
        impl v1::$request {
            /// How to search, to change it.
            pub fn search_mut(&mut self) -> &mut v1::SearchOptions {
                self.search.get_or_insert_default()
            }

            /// The same request with this time limit of the search.
            #[must_use]
            pub fn with_budget(mut self, budget: Duration) -> Self {
                self.search_mut().budget = Some(wire_duration(budget));
                self
            }

            /// The same request with this seed.
            #[must_use]
            pub fn with_seed(mut self, seed: u64) -> Self {
                self.search_mut().seed = Some(seed);
                self
            }

            /// The time limit of the search, if it has one.
            #[must_use]
            pub fn budget(&self) -> Option<Duration> {
                self.search.as_ref()?.budget.map(std_duration)
            }
        }
    )*};
}

searches!(
    FindGraspRequest,
    StreamGraspsRequest,
    Track,
    EvaluateHoldoutRequest
);

impl v1::Holdout {
    /// An object at the client's origin that nobody holds; `object` is "objects/{object}".
    pub fn new(object: impl Into<String>) -> Self {
        Self {
            object: object.into(),
            ..Self::default()
        }
    }

    /// The object's frame in the client's frame.
    #[must_use]
    pub fn client_from_object(&self) -> v1::Pose {
        self.client_from_object.unwrap_or_default()
    }
}

impl v1::Receiver {
    /// A receiver with this shoulder on the receiving hand's side, in the client's frame, and an adult's arm.
    #[must_use]
    pub fn with_shoulder(client_shoulder: Vec3) -> Self {
        Self {
            body: Some(Body::ClientShoulder(client_shoulder.into())),
            ..Self::default()
        }
    }

    /// A standing receiver, with arms in proportion to the height.
    #[must_use]
    pub fn standing(client_from_root: v1::Pose, height: f32) -> Self {
        Self {
            body: Some(Body::ClientFromRoot(client_from_root)),
            height,
            ..Self::default()
        }
    }
}

impl v1::CurrentGrasp {
    /// A grasp to hold on to while it is valid. Fields that only answers have are left out.
    #[must_use]
    pub fn new(grasp: v1::HandPose) -> Self {
        let grasp = v1::HandPose {
            joints: Vec::new(),
            model: Vec::new(),
            ..grasp
        };
        Self {
            grasp: Some(grasp),
            ..Self::default()
        }
    }
}

impl v1::FindGraspRequest {
    /// The same request with a grasp to hold on to, or without one.
    #[must_use]
    pub fn with_current(self, current: impl Into<Option<v1::CurrentGrasp>>) -> Self {
        Self {
            current: current.into(),
            ..self
        }
    }

    /// The same request with the motion to the grasp.
    #[must_use]
    pub fn with_key_frames(mut self) -> Self {
        self.output_mut().key_frames = true;
        self
    }
}

impl v1::ValidateGraspRequest {
    /// The same request for a posed hand.
    #[must_use]
    pub fn with_pose(self, pose: v1::HandPose) -> Self {
        Self {
            grasp: Some(v1::validate_grasp_request::Grasp::Pose(pose)),
            ..self
        }
    }

    /// How long to search for a valid grasp near it.
    #[must_use]
    pub fn nearest_budget(&self) -> Option<Duration> {
        self.nearest_budget.map(std_duration)
    }
}

/// Requests about the same holdout.
macro_rules! same_holdout {
    ($($request:ident { $($part:ident),* })*) => {$(
        impl From<v1::FindGraspRequest> for v1::$request {
            fn from(request: v1::FindGraspRequest) -> Self {
                Self {
                    $($part: request.$part,)*
                    ..Self::default()
                }
            }
        }

        impl From<v1::$request> for v1::FindGraspRequest {
            fn from(request: v1::$request) -> Self {
                Self {
                    $($part: request.$part,)*
                    ..Self::default()
                }
            }
        }
    )*};
}

same_holdout! {
    StreamGraspsRequest { holdout, receiver, requirements, search, output }
    ValidateGraspRequest { holdout, receiver, requirements, output }
    EvaluateHoldoutRequest { holdout, receiver, requirements, search, output }
}

/// The same holdout and current grasp, without the parts that come with frames.
impl From<v1::FindGraspRequest> for v1::Track {
    fn from(request: v1::FindGraspRequest) -> Self {
        let current = request.current.unwrap_or_default();
        Self {
            holdout: request.holdout.map(|holdout| v1::Holdout {
                client_from_object: None,
                presenting_hand: None,
                other_hands: Vec::new(),
                obstacles: Vec::new(),
                ..holdout
            }),
            receiver: request.receiver,
            requirements: request.requirements,
            search: request.search,
            output: request.output,
            current: current.grasp,
            min_score_gain: current.min_score_gain,
            ..Self::default()
        }
    }
}

impl v1::TrackFrame {
    /// A frame of a holdout, without the parts that the track has.
    #[must_use]
    pub fn of(sequence: u64, holdout: v1::Holdout) -> Self {
        Self {
            sequence,
            holdout: Some(v1::Holdout {
                scale: None,
                mass_kg: None,
                ..holdout
            }),
            ..Self::default()
        }
    }

    /// The same frame captured then, since any moment.
    #[must_use]
    pub fn captured_at(self, time: Duration) -> Self {
        Self {
            capture_time: Some(wire_duration(time)),
            ..self
        }
    }

    /// When it was captured, since any moment.
    #[must_use]
    pub fn capture_time(&self) -> Option<Duration> {
        self.capture_time.map(std_duration)
    }

    /// The object's frame in the client's frame.
    #[must_use]
    pub fn client_from_object(&self) -> v1::Pose {
        self.holdout
            .as_ref()
            .map(v1::Holdout::client_from_object)
            .unwrap_or_default()
    }
}

impl v1::CreateObjectRequest {
    /// An object of a mesh in meters and +Y up, with the server's defaults; `id` is the last part of its name.
    pub fn new(id: impl std::fmt::Display, mesh: impl Into<Vec<u8>>, mass_kg: f32) -> Self {
        Self {
            object: Some(v1::GraspObject {
                name: format!("objects/{id}"),
                mass_kg,
                ..v1::GraspObject::default()
            }),
            mesh: mesh.into(),
            request_id: String::new(),
        }
    }

    /// The object, to change it.
    pub fn object_mut(&mut self) -> &mut v1::GraspObject {
        self.object.get_or_insert_default()
    }
}

impl v1::UpdateObjectRequest {
    /// A change of these fields of an object to its values, whatever its state; `object.etag` restricts that.
    pub fn new<'a>(object: v1::GraspObject, fields: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            object: Some(object),
            update_mask: Some(prost_types::FieldMask {
                paths: fields.into_iter().map(str::to_owned).collect(),
            }),
        }
    }
}

impl v1::Region {
    /// A region of which nothing is marked yet.
    pub fn new(name: impl Into<String>, preference: v1::Preference) -> Self {
        Self {
            name: name.into(),
            preference: preference.into(),
            ..Self::default()
        }
    }
}

impl v1::KnownGrip {
    /// A grip to try first or not to answer.
    pub fn new(name: impl Into<String>, preference: v1::Preference, hand: v1::HandPose) -> Self {
        Self {
            name: name.into(),
            preference: preference.into(),
            hand: Some(hand),
            ..Self::default()
        }
    }
}

impl v1::CreateRigRequest {
    /// A rig of the hands of a model.
    pub fn of_model(rig_id: impl Into<String>, model: Vec<u8>) -> Self {
        Self {
            rig_id: rig_id.into(),
            models: vec![model],
            ..Self::default()
        }
    }
}
