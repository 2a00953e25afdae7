//! Which valid grasps a person would choose. A search for the first valid grasp that finds another one looks for such a
//! grasp a little longer ([`crate::search::settings::Query::improvement`]).

use crate::{
    model::{grasp::Grasp, object::GraspObject, score::Term},
    physical::{barriers::Barriers, receiver::SUITABLE},
};

/// Least values of terms without which people would take an object otherwise.
const LEAST_VALUES: [(Term, f32); 6] = [
    (Term::Stance, SUITABLE),
    (Term::FromSideOrAbove, 0.2),
    (Term::AcrossLongAxis, 0.5),
    (Term::EnoughDigits, 0.65),
    (Term::WristLoad, 0.3),
    (Term::OffSharp, 1.0),
];

/// Least value of the handle's term, if a handle is free: nearly all contacts are on it.
pub(super) const HELD_BY_HANDLE: f32 = 0.8;

/// Distance of a handle's skin from other hands and obstacles, in metres, from which a hand can take it there.
const ROOM: f32 = 0.012;

/// Least share of a handle that has this room for it to be free.
const FREE_SHARE: f32 = 0.4;

/// What a person would choose in one scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Preference {
    /// True if the object has a handle that is free: it is then to be held there.
    pub(super) wants_handle: bool,
}

impl Preference {
    /// The preference for an object among barriers.
    pub(super) fn of(object: &GraspObject, barriers: Barriers<'_>) -> Self {
        let parts = object.parts();
        let is_free = |distance: f32| {
            let free = parts.handles.main().filter(|handle| {
                let around = handle.radius + distance;
                !barriers.certainly_cover(handle.middle, around, around)
            });
            free.count() as f32 >= FREE_SHARE * parts.handles.main().count() as f32
        };
        Self {
            wants_handle: parts.is_handled && is_free(ROOM),
        }
    }

    /// True if a person would choose such a grasp. Hooks are not asked for closed hands.
    pub(super) fn is_met_by(self, grasp: &Grasp) -> bool {
        let Some(score) = &grasp.score else { return true };
        let reaches = |&(term, least): &(Term, f32)| {
            score.values[term as usize] >= least || (grasp.hangs && term == Term::EnoughDigits)
        };
        grasp.classification.is_clear()
            && LEAST_VALUES.iter().all(reaches)
            && (!self.wants_handle || score.values[Term::OnHandle as usize] >= HELD_BY_HANDLE)
    }
}
