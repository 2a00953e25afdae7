//! What keeps a search from finding a grasp.

use grasp_synthesis::search::{
    known_limit::known_limit,
    limits::{Limit, limits},
};

use super::{HandSearch, PreparedJob};

impl PreparedJob {
    /// What keeps a hand from holding the object. Of two hands, each has to be limited; both limit mostly the same. Without proof,
    /// known grips say what is in the way; a hand without any is taken to be like the other.
    pub(in crate::search) fn limits(&self) -> Vec<Limit> {
        let hands = || self.hands.iter().enumerate();
        let proven = of_each(hands().map(|(place, search)| limits(self.task(place), &search.settings.query)));
        if !proven.is_empty() {
            return proven;
        }
        let knows = |search: &HandSearch| {
            let atlas = search.settings.known.atlas.as_ref();
            atlas.is_some_and(|atlas| !atlas.entries().is_empty())
        };
        let none_knows = !self.hands.iter().any(knows);
        let judged = hands().filter(|(_, search)| none_knows || knows(search));
        of_each(judged.map(|(place, search)| {
            let limit = known_limit(self.task(place), &search.settings);
            limit.into_iter().collect()
        }))
    }
}

/// The limits of all hands, one of each kind; none if a hand has none.
fn of_each(hands: impl Iterator<Item = Vec<Limit>>) -> Vec<Limit> {
    let mut all: Vec<Limit> = Vec::new();
    for of_hand in hands {
        if of_hand.is_empty() {
            return of_hand;
        }
        let new = |limit: &Limit| all.iter().all(|known| known.kind != limit.kind);
        let new: Vec<Limit> = of_hand.into_iter().filter(new).collect();
        all.extend(new);
    }
    all
}
