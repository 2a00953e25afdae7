//! Why attempts fail: the kinds of thesis Table 5.2, and a request's own requirements.

use serde::{Deserialize, Serialize};

use super::stop::Stopped;

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
    /// The wrist, the contacts, the grasp type or the comfort violates a requirement of the request, or two hands do not suit one
    /// body.
    UnmetRequirement,
}

impl Rejection {
    /// All kinds: those of Table 5.2 in its order, which is also the order of an attempt's checks, then `UnmetRequirement`.
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

    /// The kinds of Table 5.2, the only ones that a search without requirements reports: the first of [`Rejection::ALL`].
    pub const THESIS: [Self; 8] = {
        let [thesis @ .., _] = Self::ALL;
        thesis
    };

    /// The index in [`Rejection::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Why an attempt found no grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// A check failed.
    Rejected {
        /// The check.
        rejection: Rejection,
        /// For `NotImmobilizing` under `THESIS` validity: the smallest angle of Eq. 4.5, in radians.
        wrench_angle: Option<f32>,
    },
    /// The search was stopped during the attempt.
    Stopped,
}

impl From<Rejection> for Failure {
    fn from(rejection: Rejection) -> Self {
        Self::Rejected {
            rejection,
            wrench_angle: None,
        }
    }
}

impl From<Stopped> for Failure {
    fn from(Stopped: Stopped) -> Self {
        Self::Stopped
    }
}
