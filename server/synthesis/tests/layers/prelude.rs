//! What nearly every test uses.

pub(crate) use crate::fixtures::{
    atlases::{
        complete_atlas, every, grown, grown_to, growth, learned, scissors_held_by, shipped_atlas,
        tight_givers, valid_grips,
    },
    clocks::FakeClock,
    contacts::{contact, contacts_at, score, touches},
    data::{self, real_objects},
    hands::{
        adult, adult_with, all_hands, angles, arm, built_in_hand, hand_pose, pair_distance, pose_between,
        right, sampled_distance, simple_rig, thumb_side, tracked,
    },
    holdouts::{
        UP, box_at, floating, giver_solids, held, held_by, tracked_holdouts, upright_bar_with_forbidden_ends,
    },
    meshes::{self, Parts, cuboid, cylinder_mesh, moved, open_box, sheet, sphere, torus},
    objects::{
        OBJECT_NAMES, bar, bar_mesh, half_space, lunch_box, name_of, object, object_of, oriented_box, plate,
        prepared, resized, rod, triangles_where,
    },
    oracle::{self, distance_to_mesh, winding_number},
    proposals::{NO_GIVER, holds, object_scene, place, surroundings},
    random::Random,
    searches::{Search, guided, pool, thesis, verdict, within_reach, without_thumb},
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
        Segment, mesh::TriangleMesh, mesh_bvh::MeshBvh, oriented_box::OrientedBox,
        surface_samples::even_samples, zone::Zone,
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
        bend_ratios::BendRatioChoice,
        check::Check,
        grasp::{Contact, Grasp},
        grasp_type::GraspType,
        hand::{
            Digit, DigitAngles, HandPart, HandPose, Handedness, Phalanx,
            joints::{HandJoints, Joint, index, openxr_from_thesis_frame},
            kinematics::{digit_frames, hand_frames},
            rig::{DigitRig, Rig},
        },
        holdout::{HandShape, Holdout, PresentingHand},
        object::GraspObject,
        obstacle::Obstacle,
        plain_object::THESIS_FRICTION,
        receiver::{Arm, Stance},
        regions::{Region, Regions, Wish},
        requirements::{ApproachCone, DigitSet, Reach, Requirements, TypeSet, approach_direction},
        score::Term,
        strategy::{Choice, Strategy, Validity},
    },
    physical::{
        barriers::Barriers,
        grip::{GIVER_CLEARANCE, Gripper, MAX_PENETRATION},
        immobility::{BALANCE_TOLERANCE, Buffers, EPSILON_TOLERANCE, Load, SoftContact, TorqueScale},
        scene::{ObjectScene, Presented},
        shape::Proposal,
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
        attempt::PhysicalAttempt,
        current::{CurrentGrasp, CurrentGraspStatus, Settlement},
        verdicts::Judgement,
    },
};
pub(crate) use std::{
    collections::HashSet,
    sync::{Arc, LazyLock, atomic::Ordering},
    time::Duration,
};
