//! What nearly every test uses.

pub(crate) use crate::fixtures::{
    atlases::{
        complete_atlas, every, grown, grown_to, growth, learned, scissors_held_by, shipped_atlas,
        tight_givers, valid_grips,
    },
    hands::{
        adult, adult_with, all_hands, angles, arm, built_in_hand, hand_pose, pair_distance, pose_between,
        right, sampled_distance, simple_rig, thumb_side, tracked,
    },
    meshes::{self, Parts, cuboid, cylinder_mesh, moved, open_box, sheet, sphere, torus},
    objects::{
        OBJECT_NAMES, UP, bar, bar_mesh, box_at, changed, data_folder, floating, giver_solids, half_space,
        held, held_by, lunch_box, name_of, object, object_of, oriented_box, plate, prepared, real_objects,
        resized, rod, tracked_holdouts, triangles_where, upright_bar_with_forbidden_ends,
    },
    oracle::{self, distance_to_mesh, winding_number},
    random::{Random, contact, contacts_at, score, touches},
    searches::{
        FakeClock, NO_GIVER, Search, guided, holds, object_scene, place, pool, surroundings, thesis, verdict,
        within_reach, without_thumb,
    },
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
        attempt::hold_or_refine,
        current::{CurrentGrasp, CurrentGraspStatus, Settlement},
        verdicts::Judgement,
    },
};
pub(crate) use std::{
    collections::HashSet,
    sync::{Arc, LazyLock, atomic::Ordering},
    time::Duration,
};
