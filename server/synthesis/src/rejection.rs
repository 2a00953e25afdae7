//! Why attempts fail (thesis Table 5.2).

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
}

impl Rejection {
    /// All kinds in the order of Table 5.2, which is also the order in which an attempt meets them.
    pub const ALL: [Self; 8] = [
        Self::NoContacts,
        Self::NoThumb,
        Self::NoThumbEarlyStop,
        Self::NoFingers,
        Self::PalmCollision,
        Self::FingerCollision,
        Self::UnwantedContact,
        Self::NotImmobilizing,
    ];

    /// Its place in [`Rejection::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }
}
