//! Why attempts fail: the kinds of thesis Table 5.2, and a request's own requirements.

use serde::{Deserialize, Serialize};

/// Why an attempt failed. A rejection is data, never an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rejection {
    /// No digit has a contact.
    NoContacts,
    /// The thumb has no contact.
    NoThumb,
    /// The thumb has no contact, so the fingers were not tried.
    NoThumbEarlyStop,
    /// No finger has a contact.
    NoFingers,
    /// The palm or the forearm collides with the object, another hand or an obstacle.
    PalmCollision,
    /// A finger collides with the object, another hand or an obstacle.
    FingerCollision,
    /// A contact lies on a forbidden surface.
    UnwantedContact,
    /// No force distribution opposes gravity.
    NotImmobilizing,
    /// The wrist, the contacts, the grasp type or the comfort violates a requirement of the request, or two hands do not
    /// suit one body.
    UnmetRequirement,
}

impl Rejection {
    /// All kinds: those of Table 5.2 in its order, which is also the order of an attempt's checks, then the one that
    /// the thesis lacks.
    pub const ALL: [Self; 9] = [
        Self::NoContacts,
        Self::NoThumb,
        Self::NoThumbEarlyStop,
        Self::NoFingers,
        Self::PalmCollision,
        Self::FingerCollision,
        Self::UnwantedContact,
        Self::NotImmobilizing,
        Self::UnmetRequirement,
    ];

    /// The kinds of Table 5.2, the only ones that a search without requirements reports: the first of
    /// [`Rejection::ALL`].
    pub const THESIS: [Self; 8] = {
        let [thesis @ .., _] = Self::ALL;
        thesis
    };

    /// The index in [`Rejection::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_follow_all_with_thesis_kinds_first() {
        for (index, kind) in Rejection::ALL.into_iter().enumerate() {
            assert_eq!(kind.index(), index);
        }
        assert!(!Rejection::THESIS.contains(&Rejection::UnmetRequirement));
    }
}
