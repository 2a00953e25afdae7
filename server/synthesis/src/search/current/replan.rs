//! Known grips that may follow a current grasp: near the present hand, or better.

use std::{cmp::Reverse, collections::BinaryHeap};

use glam::Vec3;

use super::{
    CurrentGrasp, CurrentGraspStatus, CurrentGraspVerdict, FailedCheck, Settlement,
    failed_check::held,
    way::{HandWay, METRES_PER_RADIAN, WristWay, cost_if_free, detour, fingertips},
};
use crate::{
    base::stop::{Stop, Stopped},
    known::{
        atlas::{Atlas, Grips, QUANTA},
        entry::Entry,
        recheck::GripChecker,
    },
    model::{grasp::Grasp, hand::HandPose, requirements::Check, score::Term, strategy::Validity},
    physical::grip::Gripper,
    rating::assessment::GraspContext,
    search::{
        GraspSource, SearchEnd, SearchOutcome, SearchReport, known_grips::grasp_value, reading::Reading,
        scene::Scene, settings::SearchSettings,
    },
};

/// A grip may be so many times as far as the nearest valid one if it costs less.
const NEARLY_NEAREST: f32 = 1.25;

/// Most valid grips compared, at some 10 µs each.
const MAX_COMPARED: usize = 16;

/// Most valid grips compared if all of them lack clearance from the recent hands.
const MAX_UNSTEADY: usize = 64;

/// Way of wrist and fingertips, in metres, up to which two hands are the same but for rounding.
const SAME: f32 = 1e-5;

/// Distance of two forearms' directions up to which hands may be the same: [`SAME`] as an angle, and rounding.
const ALIKE: f32 = 2.0 * SAME / METRES_PER_RADIAN;

/// How much higher than estimated a score may be: gravity is up to 18° from the direction that an entry was rated under.
const ESTIMATE_SLACK: f32 = 0.05;

/// A current grasp that is kept or adjusted, and the verdict on it.
pub(super) type Kept = (Box<Grasp>, CurrentGraspVerdict);

/// A valid known grip.
#[derive(Debug)]
pub(super) struct Known {
    pub(super) source: GraspSource,
    pub(super) grasp: Box<Grasp>,
    /// The clearance that it lacks from other people's recent hands, as a way in metres.
    pub(super) lack: f32,
}

pub(super) struct Replanner<'a> {
    scene: &'a Scene<'a>,
    settings: &'a SearchSettings,
    pub(super) around: &'a GraspContext<'a>,
    pub(super) current: &'a CurrentGrasp,
    checker: GripChecker<'a>,
    atlas: Option<&'a Atlas>,
    learned: Option<&'a Atlas>,
}

impl<'a> Replanner<'a> {
    pub(super) fn new(
        scene: &'a Scene<'a>,
        settings: &'a SearchSettings,
        around: &'a GraspContext<'a>,
        current: &'a CurrentGrasp,
    ) -> Self {
        let atlas = settings.known.atlas.as_deref();
        Self {
            scene,
            settings,
            around,
            current,
            checker: GripChecker::new(*around, atlas),
            atlas,
            learned: settings.learned(),
        }
    }

    /// The valid grip to follow a failed grasp: a preferred one, or else the cheapest of those in the atlas that are about as near
    /// as the nearest, or else such a learned one.
    pub(super) fn nearest(&self, gripper: &mut Gripper, stop: Stop<'_>) -> Result<Option<Known>, Stopped> {
        if let Some(preferred) = self.preferred(gripper, stop)? {
            return Ok(Some(preferred));
        }
        let of_atlas = self
            .atlas
            .map(|atlas| (atlas, GraspSource::Atlas as fn(u16) -> _));
        let of_learned = self
            .learned
            .map(|learned| (learned, GraspSource::Learned as fn(u16) -> _));
        for (atlas, source) in of_atlas.into_iter().chain(of_learned) {
            if let Some(known) = self.nearest_of(atlas.grips(), source, gripper, stop)? {
                return Ok(Some(known));
            }
        }
        Ok(None)
    }

    /// The cheapest of the valid grips that are about as near as the nearest; `None` if none is valid.
    fn nearest_of(
        &self,
        grips: &Grips,
        source: impl Fn(u16) -> GraspSource,
        gripper: &mut Gripper,
        stop: Stop<'_>,
    ) -> Result<Option<Known>, Stopped> {
        let mut by_way: BinaryHeap<Reverse<(u32, u16)>> = (0..)
            .zip(grips.entries())
            // The bits of positive floats have their order.
            .map(|(index, entry)| Reverse((self.way_to(entry).to_bits(), index)))
            .collect();
        let mut farthest = f32::INFINITY;
        let mut valid: Vec<(f32, Known)> = Vec::new();
        let mut unsteady: Vec<(f32, Known)> = Vec::new();
        while let Some(Reverse((way, index))) = by_way.pop() {
            let way = f32::from_bits(way);
            if way > farthest || valid.len() == MAX_COMPARED {
                break;
            }
            stop.check()?;
            let Some((grasp, lack)) = self.check(grips, index, gripper) else {
                continue;
            };
            let value = grasp_value(&grasp);
            let cost = cost_if_free(self.around.rig, &self.current.present, &grasp, value);
            let source = source(index);
            let known = Known { source, grasp, lack };
            if lack > 0.0 {
                if unsteady.len() < MAX_UNSTEADY {
                    unsteady.push((cost + lack, known));
                }
                continue;
            }
            if valid.is_empty() {
                farthest = way * NEARLY_NEAREST;
            }
            valid.push((cost, known));
        }
        let valid = if valid.is_empty() { unsteady } else { valid };
        Ok(self.cheapest(valid))
    }

    fn cheapest(&self, mut valid: Vec<(f32, Known)>) -> Option<Known> {
        valid.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(f32, Known)> = None;
        for (cost, known) in valid {
            if best.as_ref().is_some_and(|(least, _)| cost >= *least) {
                break;
            }
            let cost = cost + detour(self.scene, &self.current.present, &known.grasp.pose);
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, known));
            }
        }
        best.map(|(_, known)| known)
    }

    fn preferred(&self, gripper: &mut Gripper, stop: Stop<'_>) -> Result<Option<Known>, Stopped> {
        let present = self.current.present.frame_from_wrist;
        let mut hands: Vec<_> = self.settings.known.preferred.iter().enumerate().collect();
        hands.sort_by_cached_key(|(_, hand)| {
            WristWay::between(present, hand.frame_from_wrist)
                .length()
                .to_bits()
        });
        for (index, hand) in hands {
            stop.check()?;
            if let Ok(grasp) = self.around.hold_posed(hand, gripper) {
                let source = GraspSource::Preferred(index as u16);
                let lack = 0.0;
                return Ok(Some(Known { source, grasp, lack }));
            }
        }
        Ok(None)
    }

    /// The grasp of a hand that is a known grip, if valid here.
    pub(super) fn of_known_hand(&self, hand: &HandPose, gripper: &mut Gripper) -> Option<Box<Grasp>> {
        let of_atlas = self.atlas.map(Atlas::grips);
        let of_learned = self.learned.map(Atlas::grips);
        let mut grips = of_atlas.into_iter().chain(of_learned);
        let (grips, index) = grips.find_map(|grips| Some((grips, self.place_of(hand, grips)?)))?;
        let (mut grasp, _) = self.check(grips, index, gripper)?;
        grasp.pose = *hand;
        Some(grasp)
    }

    fn place_of(&self, hand: &HandPose, grips: &Grips) -> Option<u16> {
        let is_same = |entry: &Entry| {
            let pose = &entry.grip.pose;
            let (ours, theirs) = (hand.frame_from_wrist, pose.frame_from_wrist);
            ours.position.distance_squared(theirs.position) <= SAME * SAME
                && WristWay::between(ours, theirs).length() <= SAME
                && fingertips(self.around.rig, hand, pose) <= SAME
        };
        // Forearms lie side by side in memory, which entries do not.
        let forearm = hand.frame_from_wrist.transform_vector(Vec3::NEG_Y);
        let mut alike = (0..grips.entries().len())
            .filter(|&place| grips.forearms()[place].distance_squared(forearm) <= ALIKE * ALIKE);
        u16::try_from(alike.find(|&place| is_same(&grips.entries()[place]))?).ok()
    }

    /// The valid grip of the atlas with the highest score, if at least `least`.
    pub(super) fn best(
        &self,
        least: f32,
        gripper: &mut Gripper,
        stop: Stop<'_>,
    ) -> Result<Option<Known>, Stopped> {
        let Some(atlas) = self.atlas else {
            return Ok(None);
        };
        let mut by_value: Vec<(f32, u16)> = (0..)
            .zip(atlas.entries())
            .map(|(index, entry)| (self.score_bound(atlas, index, entry), index))
            .filter(|&(bound, _)| bound >= least)
            .collect();
        by_value.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Option<Known> = None;
        let mut least = least;
        for (bound, index) in by_value {
            if bound < least {
                break;
            }
            stop.check()?;
            if let Some((grasp, lack)) = self.check(atlas.grips(), index, gripper)
                && lack <= 0.0
            {
                let value = grasp_value(&grasp);
                if value > least || (value == least && best.is_none()) {
                    least = value;
                    let source = GraspSource::Atlas(index);
                    best = Some(Known { source, grasp, lack });
                }
            }
        }
        Ok(best)
    }

    /// An upper bound of a grip's score here, by its stored scores.
    fn score_bound(&self, atlas: &Atlas, index: u16, entry: &Entry) -> f32 {
        let (object, presented) = (self.around.object, self.around.presented);
        let own_friction = object.object.friction_under(Validity::Physical);
        if !object.object.regions().is_empty() || object.friction != own_friction {
            return 1.0;
        }
        let rated = f32::from(entry.scores[atlas.direction(presented.up)].saturating_sub(1)) / QUANTA;
        let forearm = atlas.grips().forearms()[usize::from(index)];
        rated
            + Term::Stance.share() * presented.receiver.suits_forearm(forearm)
            + Term::AwayFromGiver.share()
            + Term::GiverClearance.share()
            + ESTIMATE_SLACK
    }

    fn way_to(&self, entry: &Entry) -> f32 {
        let present = self.current.present.frame_from_wrist;
        WristWay::between(present, entry.grip.pose.frame_from_wrist).length()
    }

    /// The grasp of a known grip, if valid here, and the clearance that it lacks from the recent hands.
    fn check(&self, grips: &Grips, index: u16, gripper: &mut Gripper) -> Option<(Box<Grasp>, f32)> {
        let place = usize::from(index);
        let barriers = self.around.presented.barriers();
        let solids = grips.screen(place, self.around.rig, barriers)?;
        let grasp = self.checker.check(&grips.entries()[place], &solids, gripper)?;
        let recent = self.scene.recent_hands();
        Some((grasp, recent.map_or(0.0, |recent| recent.lack(&solids))))
    }

    /// The grasp of an unchanged hand, which may be closer to other people's hands by `grace` metres.
    pub(super) fn hold(
        &self,
        pose: &HandPose,
        grace: f32,
        gripper: &mut Gripper,
    ) -> Result<Box<Grasp>, FailedCheck> {
        let reading = Reading::new(*self.around, self.scene.task.holdout, pose);
        held(&reading, grace, gripper)
    }

    /// The current grasp that failed a check, if a grace keeps it.
    pub(super) fn kept_by(&self, grace: f32, failed: FailedCheck, gripper: &mut Gripper) -> Option<Kept> {
        if failed.check != Check::GiverClearance || grace <= 0.0 {
            return None;
        }
        let grasp = self.hold(&self.current.hand, grace, gripper).ok()?;
        let verdict = CurrentGraspVerdict::new(CurrentGraspStatus::Kept, Some(failed));
        Some((grasp, verdict))
    }

    /// The answer with a grasp of the same hand, its way filled in.
    pub(super) fn settled(&self, known: Known, verdict: CurrentGraspVerdict) -> Settlement {
        let way = HandWay::between(self.scene, &self.current.present, &known.grasp.pose);
        let verdict = CurrentGraspVerdict {
            way: Some(way),
            ..verdict
        };
        Settlement::Settled(Box::new((self.outcome(Some(known)), verdict)))
    }

    /// The outcome of a search that ends with this grasp, or aborted.
    pub(super) fn outcome(&self, known: Option<Known>) -> SearchOutcome {
        let (source, mut grasp) = known.map(|known| (known.source, *known.grasp)).unzip();
        if let Some(grasp) = &mut grasp {
            self.scene.pose_arm(grasp);
        }
        SearchOutcome {
            end: grasp.as_ref().map_or(SearchEnd::Aborted, |_| SearchEnd::Found),
            value: grasp.as_ref().map_or(0.0, grasp_value),
            replaceable_until: None,
            report: SearchReport {
                source,
                candidates: u64::from(source.is_some()),
                ..SearchReport::default()
            },
            grasp,
        }
    }
}
