//! Which attempts of `GUIDED` search wrap handles or hook the fingers, instead of placing the hand anywhere.

use crate::model::requirements::Hooks;

/// Mass in kilograms from which a hand wraps what it holds, where it can: pads alone rarely hold more against pushes. Lighter
/// things are mostly held in pads.
const WRAPPED_MASS: f32 = 0.15;

/// Mass in kilograms from which people carry things by a handle above them, where there is one.
const CARRIED_MASS: f32 = 1.0;

/// Mass in kilograms below which handles are never wrapped: a pen is not a tool's handle.
const PINCHED_MASS: f32 = 0.03;

/// What an attempt does first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    /// Places pads or palm anywhere.
    Anywhere,
    /// Wraps a handle.
    Handle,
    /// Hooks the fingers below what the object may hang by.
    Hook,
}

use Turn::{Anywhere, Handle, Hook};

/// Whether hands wrap the handles of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HandleUse {
    /// It has none.
    Impossible,
    /// They may.
    Possible,
    /// They should: a handle is what sets a part of the object apart, and is free.
    Wanted,
}

/// The turns of eight attempts in a row. Attempts on handles take a tenth of the time of others, and succeed more often, but
/// only where there is room; with more of them, objects that giver or obstacles cover are found later.
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
/// The same where nothing but a hook meets the requirements.
const HOOKED: [Turn; 8] = [Hook, Hook, Hook, Hook, Hook, Hook, Hook, Anywhere];

impl Turn {
    /// The turn of an attempt at an object of this mass in kilograms, which may have handles.
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

    fn turns(mass: f32, has_handles: bool, hooks: Hooks) -> Vec<Turn> {
        let handles = if has_handles {
            HandleUse::Possible
        } else {
            HandleUse::Impossible
        };
        (0..8)
            .map(|attempt| Turn::of(attempt, mass, handles, hooks))
            .collect()
    }

    fn count(turns: &[Turn], of: Turn) -> usize {
        turns.iter().filter(|&&turn| turn == of).count()
    }

    #[test]
    fn heavier_things_are_wrapped_more_often() {
        let handles = [0.01, 0.1, 0.5].map(|mass| count(&turns(mass, true, Hooks::Allowed), Handle));
        assert!(handles.is_sorted_by(|a, b| a < b), "{handles:?}");
    }

    #[test]
    fn free_handles_are_wrapped_first_and_most() {
        for mass in [0.05, 0.3] {
            let turns: Vec<Turn> = (0..8)
                .map(|attempt| Turn::of(attempt, mass, HandleUse::Wanted, Hooks::Allowed))
                .collect();
            assert_eq!(turns[0], Handle);
            assert!(
                count(&turns, Handle) > 4 && turns.contains(&Anywhere),
                "{turns:?}"
            );
        }
    }

    #[test]
    fn every_object_is_held_anywhere_and_hooked_in_some_attempts() {
        for mass in [0.001, 0.1, 0.5, 5.0] {
            for has_handles in [false, true] {
                let turns = turns(mass, has_handles, Hooks::Allowed);
                assert!(
                    turns.contains(&Anywhere) && turns.contains(&Hook),
                    "{mass} {turns:?}"
                );
                assert!(has_handles || !turns.contains(&Handle), "{mass} {turns:?}");
            }
        }
    }

    #[test]
    fn hooks_follow_the_requirements() {
        for mass in [0.001, 0.1, 0.5, 5.0] {
            assert_eq!(count(&turns(mass, true, Hooks::RuledOut), Hook), 0);
            assert_eq!(count(&turns(mass, true, Hooks::Demanded), Hook), 7);
        }
    }
}
