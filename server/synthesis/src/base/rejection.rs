//! Why attempts fail (thesis Table 5.2, and a request's own constraints).

use serde::{Deserialize, Serialize};

/// An attempt's failure. A rejection is data, never an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rejection {
    /// No digit has a contact.
    NoContacts,
    /// The thumb has no contact.
    NoThumb,
    /// The thumb has no contact, and the fingers were not tried.
    NoThumbEarlyStop,
    /// No finger has a contact.
    NoFingers,
    /// The palm collides with the object or the presenting hand.
    PalmCollision,
    /// A finger collides with the object or the presenting hand.
    FingerCollision,
    /// A contact lies on a forbidden surface.
    UnwantedContact,
    /// No force distribution opposes gravity.
    NotImmobilizing,
    /// The wrist, the contacts, the type or the comfort is not what the request's constraints ask for.
    UnmetConstraint,
}

impl Rejection {
    /// All kinds: those of Table 5.2 in its order, which is also the order in which an attempt meets them, then the one
    /// that the thesis does not have.
    pub const ALL: [Self; 9] = [
        Self::NoContacts,
        Self::NoThumb,
        Self::NoThumbEarlyStop,
        Self::NoFingers,
        Self::PalmCollision,
        Self::FingerCollision,
        Self::UnwantedContact,
        Self::NotImmobilizing,
        Self::UnmetConstraint,
    ];

    /// The kinds of Table 5.2, all that a search without constraints can meet: the first of [`Rejection::ALL`].
    pub const OF_THESIS: [Self; 8] = {
        let [of_thesis @ .., _] = Self::ALL;
        of_thesis
    };

    /// Its place in [`Rejection::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_own_place_those_of_the_thesis_first() {
        for (place, kind) in Rejection::ALL.into_iter().enumerate() {
            assert_eq!(kind.index(), place);
        }
        assert!(!Rejection::OF_THESIS.contains(&Rejection::UnmetConstraint));
    }
}
