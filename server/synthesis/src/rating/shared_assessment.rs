//! Turns two hands that hold an object together into one rated grasp.

use super::assessment::{GraspContext, unscored_grasp};
use crate::{
    base::{rejection::Rejection, stopwatch::Stopwatch},
    model::grasp::Grasp,
    physical::{
        both_hands::{HalfGrip, SharedHold, hold_together},
        immobility::Buffers,
    },
};

/// Checks and rates two hands that hold together: each against its own context, closure and balance for both. The grasp
/// of the second is [`Grasp::other_hand`] of the first.
///
/// # Errors
/// The first failed check.
pub(crate) fn assess_both(
    around: [&GraspContext<'_>; 2],
    halves: [&HalfGrip; 2],
    buffers: &mut Buffers,
    stopwatch: &mut Stopwatch<'_>,
) -> Result<Box<Grasp>, Rejection> {
    let classified = |hand: usize| around[hand].classified(&halves[hand].grip, &halves[hand].contacts, false);
    let classifications = [classified(0)?, classified(1)?];
    let clearance = |hand: usize| around[hand].clearances(&halves[hand].grip, &halves[hand].solids);
    let clearances = [clearance(0)?, clearance(1)?];
    let GraspContext {
        object, presented, ..
    } = around[0];
    let held = hold_together(object, presented.up, halves, buffers, stopwatch)?;
    let SharedHold {
        epsilon,
        relative_closure,
        balances: [first, second],
    } = held;
    let total_force: glam::Vec3 = first.forces.iter().chain(&second.forces).sum();
    let rated = |hand: usize, balance| {
        let HalfGrip {
            grip,
            solids,
            contacts,
        } = halves[hand];
        let unscored = unscored_grasp(
            grip,
            contacts,
            classifications[hand],
            epsilon,
            balance,
            presented,
            clearances[hand],
        );
        let grasp = Grasp {
            wrench_angle: total_force.angle_between(presented.up),
            ..unscored
        };
        around[hand].rated(grasp, relative_closure, solids)
    };
    let first = rated(0, first)?;
    let second = rated(1, second)?;
    Ok(Box::new(Grasp {
        other_hand: Some(Box::new(second)),
        ..first
    }))
}
