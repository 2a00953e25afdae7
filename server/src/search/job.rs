//! One search: a checked request with everything it needs, and its preparation.

use std::{
    sync::{Arc, OnceLock},
    time::{Duration, Instant},
};

use grasp_assets::hands::Hand;
use grasp_import::mesh_of_triangles;
use grasp_synthesis::{
    base::{clock::Clock, pose::Pose},
    known::seeds::{ResizedGrips, SeedSource},
    model::{
        holdout::{HandMesh, HandShape, Holdout, PresentingHand, Stance},
        object::GraspObject,
        requirements::Requirements,
        strategy::{Choice, Validity},
    },
    search::settings::{Known, Query, Run, SearchSettings},
};

use super::prepared::{HandSearch, PreparedJob};
use crate::{
    atlases::KnownGrips,
    error::ServiceError,
    executor::OVERDUE_AFTER,
    objects::{Derived, StoredObject},
    rigs::RigHand,
    validate::{FindQuery, GiverHand, MeshedHand},
};

/// Most edges of holes: a wrist has a hundred. Tests for points inside take time in proportion to them.
const MAX_RIM_EDGES: usize = 2000;

#[derive(Clone, Debug)]
pub(crate) struct FindJob {
    pub query: FindQuery,
    /// Keeps the object from being evicted.
    pub _held: Arc<()>,
    /// The object in the form that searches use.
    pub derived: Arc<Derived>,
    pub stored: Arc<StoredObject>,
    /// Scale of the object relative to that of `known`, if size or mass differ: known grips are only starts then.
    pub resized: Option<f32>,
    pub seed: u64,
    /// When the call arrived; times count from here.
    pub arrived: Instant,
    pub budget: Duration,
    /// How long the search continues for a first grasp if it finds none within the budget; at least the budget.
    pub patience: Duration,
    /// Whether the call has a deadline, so that its answer must not wait for a search that ends late.
    pub has_deadline: bool,
    pub workers: usize,
    /// How much longer the search goes on after a first valid grasp that is not natural.
    pub refinement: Duration,
    /// Known grips of the receiving hand, and of the alternative one.
    pub known: [KnownGrips; 2],
}

/// Time since the call's arrival.
impl Clock for FindJob {
    fn now(&self) -> Duration {
        self.arrived.elapsed()
    }
}

impl FindJob {
    /// True if preparation, look-up and response are quick enough for the call's own thread, unlike key frames and meshes of hands.
    /// A current grasp is checked in either case.
    pub(super) fn is_quick_if_known(&self) -> bool {
        let query = &self.query;
        self.known.iter().any(|known| !known.is_empty())
            && (self.looks_up() || query.current.is_some())
            && !query.plan_key_frames
            && !query.has_hand_mesh()
    }

    /// True if the first valid known grip is the answer.
    pub(super) fn looks_up(&self) -> bool {
        let query = &self.query;
        self.resized.is_none()
            && !query.is_replay
            && query.search.choice == Choice::FirstValid
            && !query.run.reproducible
    }

    /// True if grips that attempts find are to be learned.
    pub(super) fn learns(&self) -> bool {
        self.query.uses_atlas() && self.resized.is_none()
    }

    /// When the search has to end, with or without a grasp.
    pub(crate) fn due(&self) -> Instant {
        self.arrived + self.patience
    }

    /// When the call is answered before its work ends, if ever.
    pub(crate) fn overdue(&self) -> Option<Instant> {
        self.has_deadline.then(|| self.due() + OVERDUE_AFTER)
    }

    /// Places hands and obstacles around the object and makes the settings.
    pub(super) fn prepare(self) -> Result<PreparedJob, ServiceError> {
        let start = Instant::now();
        let first = self.query.receiving_hand.clone();
        let stance = |hand: &RigHand| self.query.stances.of(hand.hand.rig.handedness);
        let of_first = holdout(&self.query, self.derived.object.object(), stance(&first))?;
        let object_from_client = self.query.client_from_object.inverse();
        let of_other = |hand: &RigHand| Holdout {
            stance: stance(hand).transformed(object_from_client),
            ..of_first.clone()
        };
        let alternative = self.query.alternative_hand.clone().map(|hand| {
            let holdout = of_other(&hand);
            (hand, holdout)
        });
        let hands = [(first, of_first)].into_iter().chain(alternative);
        let hands = hands.zip(&self.known).map(|((hand, holdout), known)| {
            let mut settings = self.settings(&hand.hand, known);
            let (preferred, poses): (Vec<_>, Vec<_>) = self.stored.given.preferred(&hand).into_iter().unzip();
            if !self.query.is_replay {
                settings.known.preferred = poses.into();
            }
            HandSearch {
                hand,
                holdout,
                settings,
                preferred,
            }
        });
        Ok(PreparedJob {
            hands: hands.collect(),
            failed: OnceLock::new(),
            find: self,
            start,
        })
    }

    fn settings(&self, hand: &Hand, known: &KnownGrips) -> SearchSettings {
        let query = &self.query;
        let object_from_client = query.client_from_object.inverse();
        // Reproducible answers need a complete atlas: a growing one would change them.
        let atlas = known.atlas.as_ref();
        let atlas = atlas.filter(|atlas| !query.run.reproducible || atlas.is_complete());
        let seeds = match (atlas, self.resized) {
            (Some(atlas), None) => SeedSource::Atlas(Arc::clone(atlas)),
            (Some(atlas), Some(scale)) => SeedSource::Resized(ResizedGrips {
                atlas: Arc::clone(atlas),
                scale,
            }),
            (None, _) if query.search.uses_known_grips() => {
                let transferred = self.derived.transferred_grips(hand);
                transferred.map_or(SeedSource::Nothing, SeedSource::Transferred)
            }
            (None, _) => SeedSource::Nothing,
        };
        let requirements = Requirements {
            reach: query.stances.reach(hand.rig.handedness),
            ..query.search.requirements
        };
        // A replay runs one attempt and tries no known grips.
        let is_answered_by_known = !query.is_replay && self.resized.is_none();
        SearchSettings {
            query: Query {
                requirements: requirements.transformed(object_from_client),
                refinement: self.refinement,
                current: query
                    .current
                    .as_ref()
                    .filter(|current| current.handedness == hand.rig.handedness)
                    .map(|current| current.grasp),
                ..query.search.clone()
            },
            known: Known {
                atlas: atlas.filter(|_| is_answered_by_known).cloned(),
                learned: is_answered_by_known.then(|| Arc::clone(&known.learned)),
                seeds,
                preferred: Arc::default(),
                tried: 0,
            },
            run: Run {
                seed: self.seed,
                deadline: Some(self.budget),
                workers: self.workers,
                ..query.run.clone()
            },
        }
    }
}

/// Poses the giver's hand and places everything else around the object. The receiver's arm is that of one hand, from a
/// `stance` in the client's frame.
fn holdout(query: &FindQuery, object: &Arc<GraspObject>, stance: Stance) -> Result<Holdout, ServiceError> {
    let object_from_client = query.client_from_object.inverse();
    let presenting_hand = match &query.presenting_hand {
        None => None,
        Some(GiverHand::Meshed(giver)) => {
            Some(PresentingHand::of_mesh(hand_mesh(giver, object_from_client)?))
        }
        Some(GiverHand::Jointed(giver)) if query.search.validity == Validity::Physical => Some(
            PresentingHand::of_joints(giver.joints.transformed(object_from_client)),
        ),
        Some(GiverHand::Jointed(giver)) => Some(
            PresentingHand::in_frame(&giver.skin, &giver.joints, object_from_client)
                .map_err(|error| ServiceError::invalid(giver.field, error.to_string()))?,
        ),
    };
    let shape = |hand: &GiverHand| match hand {
        GiverHand::Jointed(hand) => Ok(HandShape::Joints(Box::new(
            hand.joints.transformed(object_from_client),
        ))),
        GiverHand::Meshed(hand) => hand_mesh(hand, object_from_client).map(HandShape::Mesh),
    };
    let other_hands: Result<Vec<HandShape>, ServiceError> = query.other_hands.iter().map(shape).collect();
    let obstacles = query.obstacles.iter();
    Ok(Holdout {
        object: Arc::clone(object),
        presenting_hand,
        other_hands: other_hands?,
        obstacles: obstacles
            .map(|obstacle| obstacle.transformed(object_from_client))
            .collect(),
        stance: stance.transformed(object_from_client),
        up: object_from_client.transform_vector(query.up),
    })
}

/// Prepares a hand given as a mesh only, in the object's frame.
fn hand_mesh(hand: &MeshedHand, object_from_client: Pose) -> Result<Arc<HandMesh>, ServiceError> {
    let invalid = |wrong: String| ServiceError::invalid(hand.field.as_str(), wrong);
    let positions = hand
        .positions
        .iter()
        .map(|&position| object_from_client.transform_point(position));
    let read = mesh_of_triangles(positions, &hand.triangles).map_err(|errors| {
        let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
        invalid(errors.join("; "))
    })?;
    let wrist = hand.client_from_wrist.map(|wrist| object_from_client * wrist);
    let mesh = HandMesh::new(read.mesh, wrist);
    let rim = mesh.surface.rim_edges();
    if rim > MAX_RIM_EDGES {
        return Err(invalid(format!(
            "has {rim} edges with a triangle on one side only; it may have {MAX_RIM_EDGES}, around the wrist: it must be \
             one surface, not loose triangles"
        )));
    }
    Ok(Arc::new(mesh))
}
