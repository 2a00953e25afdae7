//! Where a hand has room at an object, for every giver: drawn once, so that attempts need not.

use std::{
    fmt,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use super::{
    prepared::{PreparedObject, PreparedRig},
    proposal::{Candidate, Place},
    success_prior::ObjectFeatures,
    surface_pairs::SurfacePair,
};
use crate::base::{
    mechanisms::{Mechanism, Mechanisms},
    pose::Pose,
    random::AttemptStream,
};

/// Attempts of a search that choose from the repertoire, each from a row of its own. Most searches end within them; later
/// ones draw anew, so that they are not bound to what is here.
pub const ROWS: u64 = 32;

/// Hands that are drawn for a row, …
const DRAWN: usize = 512;

/// … of which at most this many are kept, as far as they have room. With as many drawn, hands hold half as often again
/// around a mug as those that are drawn anew, around a remote by three eighths; with half as many, a tenth less often and a
/// sixth more. More kept leave more beside a giver, and take longer to choose from.
const KEPT: usize = 24;

/// How much what is likely to hold is preferred here, as a power of the likelihood. What is chosen from a row is preferred
/// once more, beside the giver.
const PREFERENCE: f32 = 1.0;

/// The seed of the draws: any will do, and every object has the same repertoire forever.
const SEED: u64 = 0x5245_5045;

/// Hands of which an object keeps its repertoires at most: right and left ones of the rigs that are there.
const MOST_HANDS: usize = 4;

/// A hand that has room at the object.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Room {
    /// The place of its opposition among the hand's.
    opposition: u16,
    pair: SurfacePair,
    object_from_wrist: Pose,
}

/// Where a hand has room at an object and is likely to hold it, whoever presents it.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacementCache {
    rows: Vec<Vec<Room>>,
}

impl PlacementCache {
    /// Draws it: some five milliseconds.
    pub fn of(object: &PreparedObject, rig: &PreparedRig) -> Self {
        Self::of_with(Mechanisms::ALL, object, rig)
    }

    fn of_with(mechanisms: Mechanisms, object: &PreparedObject, rig: &PreparedRig) -> Self {
        let place = Place {
            object,
            surface: object.surface_pairs(),
            giver: None,
            rig,
            placements: None,
            mechanisms,
        };
        let bulk = ObjectFeatures::of(object);
        let row = |row| {
            let mut stream = AttemptStream::new(SEED, row);
            let drawn = place.drawn(DRAWN, &mut stream);
            let likely = place.by_success_prior(&bulk, PREFERENCE, drawn, &mut stream);
            let fitting = likely.iter().filter(|candidate| place.fits(candidate));
            let rooms = fitting.take(KEPT).map(|candidate| Room {
                opposition: candidate.opposition.place,
                pair: candidate.pair,
                object_from_wrist: candidate.object_from_wrist,
            });
            rooms.collect()
        };
        Self {
            rows: (0..ROWS).map(row).collect(),
        }
    }

    /// What an attempt chooses from; nothing after [`ROWS`] of them. `rig` is the hand that it was drawn for.
    pub fn row<'a>(&'a self, attempt: u64, rig: &'a PreparedRig) -> impl Iterator<Item = Candidate<'a>> {
        let row = usize::try_from(attempt).ok().and_then(|row| self.rows.get(row));
        row.into_iter().flatten().map(|room| Candidate {
            opposition: rig.oppositions().at(room.opposition),
            pair: room.pair,
            object_from_wrist: room.object_from_wrist,
        })
    }
}

/// The repertoires of an object, each drawn when it is first asked for. Copies of an object share them.
#[derive(Clone, Default)]
pub struct PlacementCaches(Arc<Mutex<Vec<Drawn>>>);

/// The mechanisms that cached placements depend on.
const DRAWN_BY: [Mechanism; 2] = [Mechanism::SuccessPrior, Mechanism::RoomScreen];

/// The placements of a hand, by some mechanisms.
type Drawn = (PreparedRig, Mechanisms, Arc<OnceLock<Arc<PlacementCache>>>);

impl PlacementCaches {
    /// Bytes that they take at most.
    pub const MOST_BYTES: usize = MOST_HANDS * ROWS as usize * KEPT * size_of::<Room>();

    /// That of a hand, drawn now if nobody asked for it yet; of more than [`MOST_HANDS`], the first is forgotten.
    pub(super) fn of(
        &self,
        object: &PreparedObject,
        rig: &PreparedRig,
        mechanisms: Mechanisms,
    ) -> Arc<PlacementCache> {
        let mechanisms = mechanisms.restricted_to(&DRAWN_BY);
        let found = {
            let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let found = known
                .iter()
                .find(|(known_rig, by, _)| *by == mechanisms && known_rig.is_same(rig));
            if let Some((_, _, found)) = found {
                Arc::clone(found)
            } else {
                if known.len() == MOST_HANDS {
                    known.remove(0);
                }
                let new = Arc::default();
                known.push((rig.clone(), mechanisms, Arc::clone(&new)));
                new
            }
        };
        // Not under the lock: searches with other hands go on meanwhile.
        Arc::clone(found.get_or_init(|| Arc::new(PlacementCache::of_with(mechanisms, object, rig))))
    }
}

impl fmt::Debug for PlacementCaches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PlacementCaches").finish_non_exhaustive()
    }
}
