//! Force distributions over contacts: Algorithm 10 (`FORCEDISTRIBUTIONSOVERCONTACTS`).

use super::wrenches::Wrench;
use crate::{
    base::random::AttemptStream,
    model::{forces::COMFORTABLE_SHARES, grasp::Contact, hand::Digit},
};

/// Range of the uniform factor on each share (Algorithm 10 says only "random noise"). A wider range covers more
/// distributions, but fewer tries land near the comfortable one.
pub(crate) const SHARE_NOISE: [f32; 2] = [0.5, 1.5];

/// Force magnitudes for the four unit wrenches of each contact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceDistribution {
    /// λ: for each contact, a non-negative factor per unit wrench.
    pub magnitudes: Vec<[f32; 4]>,
}

impl ForceDistribution {
    /// `FORCEDISTRIBUTIONSOVERCONTACTS`, into this buffer: the comfortable shares with noise, split evenly among a digit's
    /// contacts and at random among a contact's four wrenches.
    pub fn sample(&mut self, contacts: &[Contact], contact_counts: [u32; 5], stream: &mut AttemptStream) {
        let noisy = COMFORTABLE_SHARES.map(|share| share * stream.between(SHARE_NOISE[0], SHARE_NOISE[1]));
        self.magnitudes.clear();
        self.magnitudes.extend(contacts.iter().map(|contact| {
            let size = contact.part.digit().map_or(0.0, |digit| {
                noisy[digit.index()] / contact_counts[digit.index()] as f32
            });
            stream.four_shares().map(|share| size * share)
        }));
    }

    /// Sum of the contact wrenches.
    pub fn summed_wrench(&self, unit_wrenches: &[[Wrench; 4]]) -> Wrench {
        let mut sum = Wrench::default();
        for (magnitudes, wrenches) in self.magnitudes.iter().zip(unit_wrenches) {
            for (&magnitude, &wrench) in magnitudes.iter().zip(wrenches) {
                sum += wrench * magnitude;
            }
        }
        sum
    }

    /// Total force magnitude of each digit, thumb first.
    pub fn digit_totals(&self, contacts: &[Contact]) -> [f32; 5] {
        let mut totals = [0.0; 5];
        for (contact, magnitudes) in contacts.iter().zip(&self.magnitudes) {
            if let Some(digit) = contact.part.digit() {
                totals[digit.index()] += magnitudes.iter().sum::<f32>();
            }
        }
        totals
    }
}

/// Number of contacts of each digit, thumb first.
pub fn contact_counts(contacts: &[Contact]) -> [u32; 5] {
    Digit::ALL.map(|digit| {
        let of_digit = contacts
            .iter()
            .filter(|contact| contact.part.digit() == Some(digit));
        of_digit.count() as u32
    })
}
