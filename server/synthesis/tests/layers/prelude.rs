//! Imports of nearly every test.

pub(crate) use crate::fixtures::{
    atlases::*,
    hands::*,
    meshes::{self, Parts, cuboid, cylinder_mesh, moved, open_box, sheet, sphere, torus},
    objects::*,
    oracle::{self, distance_to_mesh, winding_number},
    random::{Random, contact, contacts_at, score, touches},
    searches::*,
};
pub(crate) use glam::{DVec3, Quat, Vec3};
pub(crate) use grasp_assets::holdouts::holdouts;
pub(crate) use grasp_cases::cases;
pub(crate) use grasp_synthesis::{
    base::{
        clock::Clock,
        pose::Pose,
        random::AttemptStream,
        rejection::Rejection,
        stop::{Stop, unstopped},
        stopwatch::{Step, Stopwatch},
    },
    geometry::{
        Segment, boxes::OrientedBox, mesh::TriangleMesh, mesh_bvh::MeshBvh, surface_samples::even_samples,
        zone::Zone,
    },
    known::{
        atlas::Atlas,
        atlas::Grips,
        codec::decode,
        entry::Entry,
        growth::{Grown, Growth},
        recheck::GripChecker,
        seeds::SeedSource,
    },
    model::{
        grasp::{Contact, Grasp},
        grasp_type::GraspType,
        hand::{
            Digit, DigitAngles, HandPart, HandPose, Handedness, Phalanx,
            joints::{HandJoints, Joint, index, openxr_from_thesis_frame},
            kinematics::{digit_frames, hand_frames},
            rig::{DigitRig, Rig},
        },
        holdout::{Arm, HandShape, Holdout, Obstacle, PresentingHand, Stance},
        object::GraspObject,
        plain_object::THESIS_FRICTION,
        regions::{Region, Regions, Wish},
        requirements::{ApproachCone, Check, DigitSet, Reach, Requirements, TypeSet, approach_direction},
        score::Term,
        strategy::{BendRatioChoice, Choice, Strategy, Validity},
    },
    physical::{
        barriers::Barriers,
        grip::{GIVER_CLEARANCE, Gripper, MAX_PENETRATION},
        immobility::{BALANCE_TOLERANCE, Buffers, EPSILON_TOLERANCE, Load, SoftContact, TorqueScale},
        presented::{ObjectScene, Presented},
        solids::{
            HandSolids, PreparedHand, SOFT_CONTACT, Spheres, TaperedCapsule, TrackedSolids, clearance,
            self_clearance,
        },
    },
    propose::{
        prepared::{PreparedObject, PreparedRig},
        proposal::{ProposalContext, propose},
    },
    search::{
        GraspSource, SearchEnd, SearchOutcome,
        attempt::{hold, hold_or_refine},
        current::{CurrentGrasp, CurrentGraspStatus, Settlement},
        verdicts::Judgement,
    },
};
pub(crate) use std::{
    collections::HashSet,
    sync::{Arc, LazyLock, atomic::Ordering},
    time::Duration,
};
