//! Where other people's hands recently were, relative to the object.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use grasp_synthesis::model::hand::joints::HandJoints;

use crate::validate::{FindQuery, GiverHand};

/// How long hands are remembered: some periods of a sway.
const REMEMBERED: Duration = Duration::from_secs(1);

/// Time between two remembered frames: a hand that sways five times a second is seen within a tenth of a millimetre of its turning
/// points.
const APART: Duration = Duration::from_millis(20);

/// The hands of the last second, oldest first.
#[derive(Debug, Default)]
pub(crate) struct RecentHands {
    seen: VecDeque<(Duration, Arc<HandJoints>)>,
}

impl RecentHands {
    /// Adds the hands of a frame, and tells its query where they were. Meshes are not remembered.
    pub(crate) fn add(&mut self, at: Duration, query: &mut FindQuery) {
        // After a restart of the clock, hands seen before are later than this frame.
        let is_recent = |&(seen, _): &(Duration, _)| seen <= at && at.saturating_sub(seen) <= REMEMBERED;
        self.seen.retain(is_recent);
        let object_from_client = query.client_from_object.inverse();
        let hands = query.presenting_hand.iter().chain(&query.other_hands);
        let now: Vec<Arc<HandJoints>> = hands
            .filter_map(|hand| match hand {
                GiverHand::Jointed(hand) => Some(Arc::new(hand.joints.transformed(object_from_client))),
                GiverHand::Meshed(_) => None,
            })
            .collect();
        if now.is_empty() {
            self.seen.clear();
            return;
        }
        let before = self.seen.iter().map(|(_, hand)| hand);
        query.recent_hands = before.chain(&now).cloned().collect();
        if self
            .seen
            .back()
            .is_none_or(|&(last, _)| at.saturating_sub(last) >= APART)
        {
            self.seen.extend(now.into_iter().map(|hand| (at, hand)));
        }
    }
}
