//! How known grips suit what people choose.

use glam::Vec3;

use crate::{
    known::entry::Entry,
    model::{
        grasp::Contact,
        hand::rig::Rig,
        regions::{Regions, suits_owner},
    },
    physical::receiver::{Receiver, SUITABLE},
    search::preference::Preference,
};

/// The first grades of known grips, which hold the object where its owner would.
pub(super) const CHOSEN_GRADES: usize = 2;

/// How a known grip suits where the receiver stands and what people choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grade {
    /// Its forearm comes from there, people would take the object so, and its owner would have it taken there.
    Chosen,
    /// Its forearm comes from there, and it holds what people would hold, firmly, where the owner would have it.
    Firm,
    /// Its forearm comes from there.
    Suitable,
    /// Its forearm comes roughly from there.
    Possible,
    /// It holds.
    Valid,
}

/// What grips are graded by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grading<'a> {
    pub(super) receiver: &'a Receiver,
    pub(super) rig: &'a Rig,
    pub(super) preference: Preference,
    pub(super) regions: &'a Regions,
}

/// Whether a grip has a grade, as far as tells what is quickly looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fit {
    No,
    Yes,
    /// If the receiver's arm reaches the wrist.
    IfReached,
    /// Unless it does.
    UnlessReached,
}

impl Grading<'_> {
    /// True if the object's owner prefers a region that is free, and the contacts of a grip are elsewhere.
    pub(super) fn is_beside_region(&self, contacts: &[Contact]) -> bool {
        self.preference.wants_region && !suits_owner(&self.regions.values(contacts))
    }

    /// Whether a grip with this forearm has a grade.
    pub(super) fn fit(&self, grade: Grade, forearm: Vec3, entry: &Entry) -> Fit {
        let suits = self.receiver.suits_forearm(forearm);
        if suits < SUITABLE {
            let only = if suits <= 0.0 {
                Grade::Valid
            } else {
                Grade::Possible
            };
            return if grade == only { Fit::Yes } else { Fit::No };
        }
        let preference = self.preference;
        let values = &entry.grip_values;
        let suits_owner = || self.regions.is_empty() || suits_owner(&self.regions.values(&entry.contacts));
        let is_chosen = || preference.is_met_by_grip(values, entry.classification, false) && suits_owner();
        let is_firm = || preference.is_firm(values, false) && suits_owner();
        let fits = match grade {
            Grade::Chosen => is_chosen(),
            Grade::Firm => is_firm() && !is_chosen(),
            Grade::Suitable => !is_firm(),
            Grade::Possible => return Fit::UnlessReached,
            Grade::Valid => false,
        };
        if fits { Fit::IfReached } else { Fit::No }
    }

    /// True if a grip that may have a grade has it. Takes about a microsecond unless the fit tells.
    pub(super) fn has(&self, fit: Fit, entry: &Entry) -> bool {
        let is_reached = || self.receiver.suits(self.rig, entry.grip.pose.frame_from_wrist) >= SUITABLE;
        match fit {
            Fit::No => false,
            Fit::Yes => true,
            Fit::IfReached => is_reached(),
            Fit::UnlessReached => !is_reached(),
        }
    }

    /// The grades that there are, best first: all grips are passed once for each.
    pub(super) fn grades(&self) -> &'static [Grade] {
        if self.receiver.is_expected() {
            &[
                Grade::Chosen,
                Grade::Firm,
                Grade::Suitable,
                Grade::Possible,
                Grade::Valid,
            ]
        } else {
            &[Grade::Chosen, Grade::Firm, Grade::Suitable]
        }
    }
}
