//! Preferences among valid grasps: the natural ones, which a person would use, and the attempts of `GUIDED` search that wrap
//! handles or hook the fingers. After a valid grasp that is not natural, a search goes on a little
//! ([`crate::search::settings::Query::refinement`]).

use Turn::{Anywhere, Handle, Hook};

use crate::{
    model::{
        grasp::Grasp,
        grasp_type::Classification,
        regions::{MAX_MISSED, suits_owner},
        requirements::Hooks,
        score::{Term, Values},
    },
    physical::{barriers::Barriers, receiver::SUITABLE},
    propose::prepared::PreparedObject,
    rating::scoring::HELD_BY_HANDLE,
};

/// Least values of terms of a natural grasp.
const MIN_OF_FIRM_HAND: [(Term, f32); 1] = [(Term::Steadiness, 0.3)];
const MIN_OF_CLOSED_HAND: [(Term, f32); 1] = [(Term::EnoughDigits, 0.65)];
const MIN_OF_FIRM_GRIP: [(Term, f32); 1] = [(Term::OffSharp, 1.0)];
const MIN_OF_GRIP: [(Term, f32); 1] = [(Term::AcrossLongAxis, 0.5)];
const MIN_AS_PRESENTED: [(Term, f32); 3] = [
    (Term::Stance, SUITABLE),
    (Term::FromSideOrAbove, 0.2),
    (Term::WristLoad, 0.3),
];

/// Distance of a handle's skin from other hands and obstacles, in metres, from which a hand can take it there.
const ROOM: f32 = 0.012;

/// Distance in metres within which the skin of a handle is found from its middle: thicker ones cannot be wrapped.
const HANDLE_REACH: f32 = 0.06;

/// Least share of a handle that has this room for it to be free.
const FREE_SHARE: f32 = 0.4;

/// Pairs of opposed points of a preferred region that are looked at, at most, evenly spread over it.
const PAIRS_COMPARED: usize = 64;

/// The natural grasps of one scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Preference {
    /// True if a free handle is to be held.
    pub(super) wants_handle: bool,
    /// True if the object's owner prefers a free region so much that grasps elsewhere are not natural.
    pub(super) wants_region: bool,
}

impl Preference {
    /// The preference for an object among barriers. Ignores handles where the owner does not want hands.
    pub(super) fn of(object: &PreparedObject, barriers: Barriers<'_>) -> Self {
        let parts = object.parts();
        let is_free = |distance: f32| {
            let free = parts.handles.main().filter(|handle| {
                let around = handle.radius + distance;
                !barriers.certainly_cover(handle.middle, around, around)
                    && object.wish_near(handle.middle, HANDLE_REACH) >= MAX_MISSED
            });
            free.count() as f32 >= FREE_SHARE * parts.handles.main().count() as f32
        };
        Self {
            wants_handle: parts.is_handled && is_free(ROOM),
            wants_region: is_preferred_region_free(object, barriers),
        }
    }

    /// True unless the contacts are outside a free region that the object's owner prefers.
    pub(super) fn is_where_wanted(self, grasp: &Grasp) -> bool {
        let score = grasp.score.as_ref();
        !self.wants_region || score.is_none_or(|score| suits_owner(&score.regions))
    }

    /// True if the grasp is natural. Hooks need neither closed hands nor resistance to pushes.
    pub(super) fn is_met_by(self, grasp: &Grasp) -> bool {
        grasp.score.as_ref().is_none_or(|score| {
            reach(&score.values, &MIN_AS_PRESENTED)
                && self.is_met_by_grip(&score.values, grasp.classification, grasp.hangs)
                && suits_owner(&score.regions)
        })
    }

    /// True if the grip is natural, as far as hand and object alone tell.
    pub(super) fn is_met_by_grip(self, values: &Values, classification: Classification, hangs: bool) -> bool {
        classification.is_clear()
            && self.is_firm(values, hangs)
            && reach(values, &MIN_OF_GRIP)
            && (hangs || reach(values, &MIN_OF_CLOSED_HAND))
    }

    /// True if the grip is firm and on the handle, if one is free.
    pub(super) fn is_firm(self, values: &Values, hangs: bool) -> bool {
        reach(values, &MIN_OF_FIRM_GRIP)
            && (hangs || reach(values, &MIN_OF_FIRM_HAND))
            && self.has_handle(values)
    }

    /// True unless a handle is free and the contacts are off it.
    fn has_handle(self, values: &Values) -> bool {
        !self.wants_handle || values[Term::OnHandle as usize] >= HELD_BY_HANDLE
    }
}

/// True if hands have room in a region that the owner prefers so much that contacts elsewhere do not suit.
fn is_preferred_region_free(object: &PreparedObject, barriers: Barriers<'_>) -> bool {
    let wanted = &object.wanted_pairs.pairs;
    let compared = wanted
        .iter()
        .step_by(wanted.len().div_ceil(PAIRS_COMPARED).max(1));
    let free = compared.clone().filter(|pair| pair.is_free_of(barriers));
    !wanted.is_empty() && free.count() as f32 >= FREE_SHARE * compared.len() as f32
}

fn reach(values: &Values, least: &[(Term, f32)]) -> bool {
    least.iter().all(|&(term, least)| values[term as usize] >= least)
}

/// Mass in kilograms from which hands wrap objects where they can: pads alone rarely resist stronger pushes.
const WRAPPED_MASS: f32 = 0.15;

/// Mass in kilograms from which people carry things by a handle above them, where there is one.
const CARRIED_MASS: f32 = 1.0;

/// Mass in kilograms below which handles are never wrapped: a pen is not a tool's handle.
const PINCHED_MASS: f32 = 0.03;

/// Kind of the first hand of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Places pads or palm anywhere.
    Anywhere,
    /// Wraps a handle.
    Handle,
    /// Hooks the fingers below a part that the object may hang by.
    Hook,
}

/// Whether hands wrap the handles of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HandleUse {
    /// The object has no handle.
    Impossible,
    /// Hands may wrap one.
    Possible,
    /// Hands should wrap one: the object has a distinct handle, and that is free.
    Wanted,
}

/// The turns of eight attempts in a row.
const LIGHT: [Turn; 8] = [
    Anywhere, Anywhere, Anywhere, Anywhere, Anywhere, Anywhere, Anywhere, Hook,
];
const MEDIUM: [Turn; 8] = [
    Anywhere, Anywhere, Anywhere, Handle, Anywhere, Anywhere, Anywhere, Hook,
];
const HANDLED: [Turn; 8] = [Handle, Handle, Anywhere, Handle, Handle, Handle, Handle, Hook];
const WRAPPED: [Turn; 8] = [Handle, Anywhere, Handle, Handle, Anywhere, Handle, Handle, Hook];
const CARRIED: [Turn; 8] = [Handle, Hook, Handle, Anywhere, Handle, Hook, Handle, Anywhere];
const CARRIED_BY_STRAPS: [Turn; 8] = [Hook, Anywhere, Hook, Hook, Hook, Anywhere, Hook, Hook];
/// The turns if only a hook meets the requirements.
const HOOKED: [Turn; 8] = [Hook, Hook, Hook, Hook, Hook, Hook, Hook, Anywhere];

impl Turn {
    /// The turn of an attempt at an object of this mass in kilograms.
    pub(super) fn of(attempt: u64, mass: f32, handles: HandleUse, hooks: Hooks) -> Self {
        let has_handles = handles != HandleUse::Impossible;
        let turns = if hooks == Hooks::Demanded {
            HOOKED
        } else if mass >= CARRIED_MASS && has_handles {
            CARRIED
        } else if mass >= CARRIED_MASS {
            CARRIED_BY_STRAPS
        } else if handles == HandleUse::Wanted {
            HANDLED
        } else if mass >= WRAPPED_MASS {
            WRAPPED
        } else if mass >= PINCHED_MASS {
            MEDIUM
        } else {
            LIGHT
        };
        match turns[(attempt % turns.len() as u64) as usize] {
            Hook if hooks == Hooks::RuledOut => Anywhere,
            Handle if !has_handles => Anywhere,
            turn => turn,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(mass: f32, handles: HandleUse, hooks: Hooks, of: Turn) -> usize {
        let turns = (0..8).map(|attempt| Turn::of(attempt, mass, handles, hooks));
        turns.filter(|&turn| turn == of).count()
    }

    #[test]
    fn turns_follow_mass_handles_and_requirements() {
        use HandleUse::{Impossible, Possible, Wanted};
        for mass in [0.001, 0.1, 0.5, 5.0] {
            for handles in [Impossible, Possible, Wanted] {
                assert!(
                    count(mass, handles, Hooks::Allowed, Anywhere) > 0,
                    "{mass} {handles:?}"
                );
                assert!(
                    count(mass, handles, Hooks::Allowed, Hook) > 0,
                    "{mass} {handles:?}"
                );
                assert_eq!(count(mass, handles, Hooks::RuledOut, Hook), 0);
                assert_eq!(count(mass, handles, Hooks::Demanded, Hook), 7);
            }
            assert_eq!(count(mass, Impossible, Hooks::Allowed, Handle), 0);
        }
        let wrapped = [0.01, 0.1, 0.5].map(|mass| count(mass, Possible, Hooks::Allowed, Handle));
        assert!(wrapped.is_sorted_by(|a, b| a < b), "{wrapped:?}");
        for mass in [0.05, 0.3] {
            assert_eq!(Turn::of(0, mass, Wanted, Hooks::Allowed), Handle);
            assert!(count(mass, Wanted, Hooks::Allowed, Handle) > 4);
        }
    }
}
