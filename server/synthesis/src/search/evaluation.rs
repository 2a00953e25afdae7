//! Rates how well a holdout lets an object be taken: checks all known grips against it.

use glam::Vec3;

use super::{scene::Task, settings::SearchSettings};
use crate::{
    base::stop::Stop,
    known::{
        entry::{Entry, nearest_axis},
        recheck::GripChecker,
    },
    model::{
        grasp::Grasp,
        holdout::{HandShape, Holdout},
        requirements::Check,
        score::Score,
    },
    physical::{
        barriers::Barriers,
        grip::{Gripper, PosedDigits, clear_of_barriers},
        presented::Presented,
    },
};

/// Checks that may keep a hand from an object. A grip that fails several counts for the first. Balance is checked under the actual
/// gravity; a banned grip fails the requirements.
pub const HINDRANCES: [Check; 6] = [
    Check::GiverClearance,
    Check::OtherHandsClearance,
    Check::ObstacleClearance,
    Check::Reach,
    Check::Balance,
    Check::Requirements,
];

/// The directions in the object's frame from which hands come, palm first.
pub const SIDES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

/// The known grips of one side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Side {
    /// Number of grips.
    pub known: u32,
    /// Number of valid grips.
    pub valid: u32,
    /// Best score of the valid grips; 0 if there are none.
    pub best_score: f32,
}

/// How well a holdout lets an object be taken with one hand, or with either.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The sides, in the order of [`SIDES`].
    pub sides: [Side; 6],
    /// Number of grips that fail each of [`HINDRANCES`].
    pub hindered: [u32; 6],
}

impl Evaluation {
    /// Number of known grips that were checked.
    pub fn known(&self) -> u32 {
        self.sides.iter().map(|side| side.known).sum()
    }

    /// Number of valid grips.
    pub fn valid(&self) -> u32 {
        self.sides.iter().map(|side| side.valid).sum()
    }

    /// Best score of the valid grips; 0 if there are none.
    pub fn best_score(&self) -> f32 {
        self.sides.iter().map(|side| side.best_score).fold(0.0, f32::max)
    }

    /// Number of grips that fail a check.
    pub fn hindered_by(&self, what: Check) -> u32 {
        place_of(what).map_or(0, |place| self.hindered[place])
    }

    /// The sum of two evaluations.
    #[must_use]
    pub fn with(mut self, other: &Self) -> Self {
        for (side, other) in self.sides.iter_mut().zip(&other.sides) {
            side.known += other.known;
            side.valid += other.valid;
            side.best_score = side.best_score.max(other.best_score);
        }
        for (count, other) in self.hindered.iter_mut().zip(other.hindered) {
            *count += other;
        }
        self
    }
}

/// Checks the known grips of the settings, preferred ones and then the atlas by falling score, against a holdout under `PHYSICAL`
/// validity. Takes some microseconds per unobstructed grip. Once `stop` ends it, the remaining grips do not count.
pub fn evaluate(task: Task<'_>, settings: &SearchSettings, stop: Stop<'_>) -> Evaluation {
    let Task { holdout, rig, .. } = task;
    let query = &settings.query;
    let presented = Presented::of(holdout);
    let around = query.around(holdout, &presented, rig);
    let checker = GripChecker::new(around, settings.known.atlas.as_deref());
    let barriers = by_kind(holdout, &presented);
    let grips = settings.known.atlas.as_ref().map(|atlas| atlas.grips());
    let mut gripper = Gripper::default();
    let mut evaluation = Evaluation::default();
    let check = |entry: &Entry, place: Option<usize>, gripper: &mut Gripper| {
        let solids = entry.tracked_solids(rig);
        for (barriers, what) in barriers.into_iter().zip(HINDRANCES) {
            let known = grips.zip(place);
            let may_be_clear = || known.is_none_or(|(grips, place)| grips.may_be_clear(place, barriers));
            let is_clear = || may_be_clear() && clear_of_barriers(&solids, barriers).is_some();
            if !barriers.is_empty() && !is_clear() {
                return Err(what);
            }
        }
        if !query.requirements.reaches(entry.grip.pose.frame_from_wrist) || checker.arm(entry).is_err() {
            return Err(Check::Reach);
        }
        let grasp = checker.check_holdout(entry, &solids, gripper)?;
        let is_admitted = entry.meets(&query.requirements) && query.requirements.admits(&grasp);
        is_admitted.then_some(grasp).ok_or(Check::Requirements)
    };
    let mut count = |entry: &Entry, outcome: Result<Grasp, Check>| {
        let side = &mut evaluation.sides[side_of(entry)];
        side.known += 1;
        match outcome {
            Ok(grasp) => {
                side.valid += 1;
                let score = grasp.score.as_ref().map_or(0.0, Score::total);
                side.best_score = side.best_score.max(score);
            }
            Err(what) => {
                if let Some(place) = place_of(what) {
                    evaluation.hindered[place] += 1;
                }
            }
        }
    };
    let alone = presented.without_barriers();
    for pose in &*settings.known.preferred {
        if stop.check().is_err() {
            return evaluation;
        }
        // A hand that does not hold the object at all is no grip.
        let mut hold = |digits| gripper.hold_posed(&around.object, rig, pose, &alone, digits).ok();
        let held = hold(PosedDigits::Settled).or_else(|| hold(PosedDigits::Still));
        // A hooked object hangs under one direction of gravity only.
        if let Some((grip, solids)) = held
            && gripper.hang.is_none()
        {
            let entry = Entry::of_held(&around.object, rig, grip, &solids, &gripper);
            count(&entry, check(&entry, None, &mut gripper));
        }
    }
    for index in settings
        .known
        .atlas
        .iter()
        .flat_map(|atlas| atlas.by_score(presented.up))
    {
        if stop.check().is_err() {
            return evaluation;
        }
        let place = usize::from(index);
        if let Some(entry) = grips.map(|grips| &grips.entries()[place]) {
            count(entry, check(entry, Some(place), &mut gripper));
        }
    }
    evaluation
}

fn by_kind<'a>(holdout: &Holdout, presented: &'a Presented) -> [Barriers<'a>; 3] {
    let all = presented.barriers();
    let giver = holdout.presenting_hand.as_ref();
    let is_meshed = giver.is_some_and(|giver| matches!(giver.shape, HandShape::Mesh(_)));
    let (mesh_of_giver, meshes) = all.meshes.split_at(usize::from(is_meshed));
    let (hand_of_giver, hands) = all.hands.split_at(usize::from(giver.is_some()));
    let presenting = Barriers {
        hands: hand_of_giver,
        meshes: mesh_of_giver,
        ..Barriers::NONE
    };
    let others = Barriers {
        hands,
        meshes,
        ..Barriers::NONE
    };
    let obstacles = Barriers {
        obstacles: all.obstacles,
        ..Barriers::NONE
    };
    [presenting, others, obstacles]
}

fn place_of(check: Check) -> Option<usize> {
    let check = if check == Check::Banned {
        Check::Requirements
    } else {
        check
    };
    HINDRANCES.iter().position(|&other| other == check)
}

/// The place in [`SIDES`] of the direction that a hand comes from.
fn side_of(entry: &Entry) -> usize {
    let from = entry.grip.pose.frame_from_wrist.transform_vector(Vec3::NEG_Z);
    usize::from(nearest_axis(from))
}
