//! Rigs by name. Created ones stay until they are deleted, and outlast the server if they are saved; beyond their maximum, more
//! are refused.

use std::{
    collections::BTreeMap,
    ops::Bound,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use bytes::Bytes;
use grasp_admission::may_hold_another;
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::{is_too_large_decoded, v1};
use grasp_synthesis::model::hand::{Handedness, rig::Rig};
use object_store::Error;
use prost::Message;

use super::{COLLECTION, RigHand, ScaledHands, StoredRig, name_of};
use crate::{
    access::{Caller, Owner},
    error::ServiceError,
    limits::BYTES_BESIDES_MESH,
    saved::{
        FieldMove, RIGS, Records, SavedFiles, Unreadable, field, is_decodable, message, move_fields, seal,
    },
    sync::{Mutex, MutexGuard, locked, wait_for},
};

/// All rigs.
///
/// If rigs are saved, the methods that add or delete one wait for the disk or network. They are for threads that may block, in
/// the context of the async runtime.
#[derive(Debug)]
pub(crate) struct RigStore {
    built_in: BTreeMap<String, Arc<StoredRig>>,
    created: Mutex<CreatedRigs>,
    /// Held while a rig is added or deleted, so that saved rigs and those in memory agree.
    changing: Mutex<()>,
    maximum: usize,
    /// `None` if rigs are in memory only.
    saved: Option<Records>,
    /// True once a call has met a damaged rig since they were last read.
    is_damage_met: AtomicBool,
    scaled: ScaledHands,
}

/// The rigs that clients created by id; `None` if the record is damaged or missing.
type CreatedRigs = BTreeMap<String, Option<Arc<StoredRig>>>;

/// The id and the rig; `None` if its record is damaged or missing.
pub(crate) type ListedRig = (String, Option<Arc<StoredRig>>);

impl RigStore {
    /// A store of the built-in rigs that keeps up to `maximum` created ones, which outlast it if they are saved.
    pub(crate) fn new(maximum: usize, saved: Option<Records>) -> Self {
        Self {
            built_in: RIG_NAMES
                .into_iter()
                .filter_map(|name| Some((name.to_owned(), Arc::new(built_in(name)?))))
                .collect(),
            created: Mutex::default(),
            changing: Mutex::default(),
            maximum,
            saved,
            is_damage_met: AtomicBool::new(false),
            scaled: ScaledHands::default(),
        }
    }

    pub(crate) fn named(&self, name: &str) -> Option<Arc<StoredRig>> {
        self.find(name.strip_prefix(COLLECTION)?)
    }

    /// A hand of the rig that a request names, without its skin.
    pub(crate) fn rig(&self, name: &str, handedness: Handedness) -> Option<Rig> {
        let stored = self.named(name)?;
        Some((*stored.hand(handedness).hand.rig).clone())
    }

    pub(crate) fn get(&self, id: &str) -> Result<Arc<StoredRig>, ServiceError> {
        self.find(id).ok_or_else(|| {
            let name = name_of(id);
            if self.is_damaged(&name) {
                ServiceError::RigDamaged { name }
            } else {
                ServiceError::RigNotFound { name }
            }
        })
    }

    /// True if the record of the rig that a request names is damaged or missing. It is read again soon.
    pub(crate) fn is_damaged(&self, name: &str) -> bool {
        let is_damaged = name
            .strip_prefix(COLLECTION)
            .is_some_and(|id| self.has_damaged(id));
        self.is_damage_met.fetch_or(is_damaged, Ordering::Relaxed);
        is_damaged
    }

    pub(crate) fn has_damaged(&self, id: &str) -> bool {
        self.created().get(id).is_some_and(Option::is_none)
    }

    /// True if a call has met a damaged rig since the last time.
    pub(crate) fn take_damage_met(&self) -> bool {
        self.is_damage_met.swap(false, Ordering::Relaxed)
    }

    pub(crate) fn is_built_in(&self, id: &str) -> bool {
        self.built_in.contains_key(id)
    }

    /// Keeps the name of a rig whose record is damaged or missing.
    pub(crate) fn add_damaged(&self, id: String) {
        self.created().insert(id, None);
    }

    /// A hand that is `hundredths` / 100 times as large as a rig's. The last few are kept, with the data that searches
    /// derive from them.
    pub(crate) fn scaled(&self, hand: &RigHand, hundredths: u16) -> RigHand {
        self.scaled.get(hand, hundredths)
    }

    /// Number of created rigs, with damaged ones.
    pub(crate) fn count(&self) -> usize {
        self.created().len()
    }

    /// Checks that a rig can be added: called before a rig is made, so that none is made in vain.
    pub(crate) fn check_room(&self, id: &str) -> Result<(), ServiceError> {
        if self.is_built_in(id) || self.created().contains_key(id) {
            return Err(ServiceError::RigExists { name: name_of(id) });
        }
        if self.created().len() >= self.maximum {
            return Err(ServiceError::RigsFull {
                maximum: self.maximum,
            });
        }
        Ok(())
    }

    /// Checks that an owner may have another rig, beside those of others. Everybody's rigs are limited only together.
    pub(crate) fn check_share(&self, owner: &Owner) -> Result<(), ServiceError> {
        let created = self.created();
        let own = created.values().flatten().filter(|rig| rig.owner == *owner);
        let (held, free) = (own.count(), self.maximum.saturating_sub(created.len()));
        if owner.is_everybody() || may_hold_another(held, free) {
            return Ok(());
        }
        Err(ServiceError::RigShareFull {
            held,
            maximum: self.maximum,
        })
    }

    /// The records; `None` if rigs are in memory only.
    pub(crate) fn saved(&self) -> Option<&Records> {
        self.saved.as_ref()
    }

    /// The record of the rig that this request of its owner makes. `None` if rigs are in memory only.
    pub(crate) fn record(&self, request: &v1::CreateRigRequest, owner: &Owner) -> Option<Bytes> {
        let record = |_: &Records| {
            seal(&SavedRig {
                request: Some(request.clone()),
                owner: owner.to_string(),
            })
        };
        self.saved.as_ref().map(record)
    }

    /// Adds a rig, and saves its record if there is one.
    pub(crate) fn insert(
        &self,
        rig: StoredRig,
        record: Option<Bytes>,
    ) -> Result<Arc<StoredRig>, ServiceError> {
        let _changing = self.changing();
        self.check_room(&rig.id)?;
        self.check_share(&rig.owner)?;
        if let Some((saved, record)) = self.saved.as_ref().zip(record) {
            let mut names = self.ids();
            names.push(rig.id.clone());
            let created = wait_for(saved.create(&rig.id, record, names));
            created.map_err(|_| ServiceError::StoreFailed)?;
        }
        let rig = Arc::new(rig);
        self.created().insert(rig.id.clone(), Some(Arc::clone(&rig)));
        Ok(rig)
    }

    /// Adds a rig whose record was read. It may have been damaged before; if it was deleted meanwhile, it stays so.
    pub(crate) fn add_saved(&self, rig: StoredRig, was_damaged: bool) -> Arc<StoredRig> {
        let rig = Arc::new(rig);
        let mut created = self.created();
        if created.get(&rig.id).is_some_and(Option::is_none) == was_damaged {
            created.insert(rig.id.clone(), Some(Arc::clone(&rig)));
        }
        rig
    }

    /// Removes a created rig of the caller or of everybody. The owner of a damaged one is not known.
    pub(crate) fn delete(&self, id: &str, caller: &Caller) -> Result<(), ServiceError> {
        if self.is_built_in(id) {
            return Err(ServiceError::RigBuiltIn { name: name_of(id) });
        }
        let _changing = self.changing();
        match self.created().get(id) {
            None => return Err(ServiceError::RigNotFound { name: name_of(id) }),
            Some(rig) => rig
                .iter()
                .try_for_each(|rig| caller.check_owns(&rig.name(), &rig.owner))?,
        }
        if let Some(saved) = &self.saved {
            let mut others = self.ids();
            others.retain(|other| other != id);
            wait_for(saved.delete(id, others))?;
        }
        self.created().remove(id);
        Ok(())
    }

    /// Up to `size` rigs ordered by name, starting after `after`, and whether there are more. Of a damaged one, only the id is known.
    pub(crate) fn page(&self, after: Option<&str>, size: usize) -> (Vec<ListedRig>, bool) {
        let from = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
        let created = self.created();
        let built_in = self.built_in.range::<str, _>(from);
        let built_in = built_in.map(|(id, rig)| (id.clone(), Some(Arc::clone(rig))));
        let created = created.range::<str, _>(from);
        let created = created.map(|(id, rig)| (id.clone(), rig.clone()));
        let mut rigs: Vec<_> = built_in.take(size + 1).chain(created.take(size + 1)).collect();
        rigs.sort_by(|(a, _), (b, _)| a.cmp(b));
        let more = rigs.len() > size;
        rigs.truncate(size);
        let is_damaged = rigs.iter().any(|(_, rig)| rig.is_none());
        self.is_damage_met.fetch_or(is_damaged, Ordering::Relaxed);
        (rigs, more)
    }

    fn find(&self, id: &str) -> Option<Arc<StoredRig>> {
        let built_in = self.built_in.get(id).cloned();
        built_in.or_else(|| self.created().get(id)?.clone())
    }

    /// The ids of the created rigs.
    fn ids(&self) -> Vec<String> {
        self.created().keys().cloned().collect()
    }

    fn changing(&self) -> MutexGuard<'_, ()> {
        locked(&self.changing)
    }

    fn created(&self) -> MutexGuard<'_, CreatedRigs> {
        locked(&self.created)
    }
}

fn built_in(name: &str) -> Option<StoredRig> {
    let hand = |side| hands::hand(name, side).map(RigHand::without_model);
    Some(StoredRig {
        id: name.to_owned(),
        built_in: true,
        owner: Owner::default(),
        hands: [hand(Handedness::Left)?, hand(Handedness::Right)?],
        mirrored: [true, false],
        warnings: Vec::new(),
    })
}

/// The records of rigs whose models have up to so many bytes together.
pub(crate) fn saved_rigs(files: Arc<SavedFiles>, models: usize) -> Records {
    Records::new(files, RIGS, (models + 2 * BYTES_BESIDES_MESH) as u64)
}

/// The request that made a rig, and its owner. The inner error is why its record cannot be read.
pub(crate) async fn saved_request(
    rigs: &Records,
    id: &str,
) -> Result<Result<(v1::CreateRigRequest, Owner), Unreadable>, Error> {
    let parse = |message: &[u8]| {
        let request = request_of(message).ok_or(Unreadable::Message)?;
        if request.rig_id == id {
            let owner = SavedRig::decode(message).map(|saved| Owner::named(&saved.owner));
            Ok((request, owner.unwrap_or_default()))
        } else {
            Err(Unreadable::Name)
        }
    };
    rigs.read(id, parse).await
}

/// The record of a rig: the request that created it.
#[derive(Clone, PartialEq, Message)]
struct SavedRig {
    /// `None` in records of version 0.1.
    #[prost(message, optional, tag = "10")]
    request: Option<v1::CreateRigRequest>,
    /// The name of the client that created it; empty if it is everybody's.
    #[prost(string, tag = "11")]
    owner: String,
}

/// The number of the request in a record.
const NOW: usize = 10;

/// The places of a version 0.1 record's fields in a request.
const REQUEST: &[FieldMove] = &[
    field(1, &[1]),
    field(2, &[2]),
    message(3, &[], &[message(1, &[3], &[field(1, &[1]), field(3, &[2])])]),
    field(4, &[4]),
    message(5, &[5], LIMITS),
    field(6, &[6]),
    field(7, &[2]),
    field(8, &[7]),
    field(9, &[8]),
];

/// The range of each joint, and the digit if it has a number.
const LIMITS: &[FieldMove] = &[
    message(1, &[], &[field(1, &[2, 1]), field(2, &[3, 1])]),
    message(2, &[], &[field(1, &[2, 2]), field(2, &[3, 2])]),
    message(3, &[], &[field(1, &[2, 3]), field(2, &[3, 3])]),
    message(4, &[], &[field(1, &[2, 4]), field(2, &[3, 4])]),
    field(5, &[1]),
];

/// The request in a record of this or the last version.
pub(crate) fn request_of(record: &[u8]) -> Option<v1::CreateRigRequest> {
    if !is_decodable::<v1::CreateRigRequest>(record, NOW) {
        return None;
    }
    if let Some(request) = SavedRig::decode(record).ok()?.request {
        return Some(request);
    }
    let request = move_fields(record, REQUEST)
        .filter(|request| !is_too_large_decoded::<v1::CreateRigRequest>(request))?;
    let mut request = v1::CreateRigRequest::decode(&*request).ok()?;
    for (place, limits) in (1..).zip(&mut request.limits) {
        if limits.digit == 0 {
            limits.digit = place;
        }
        for angles in [&mut limits.min, &mut limits.max] {
            angles.get_or_insert_default().third_pitch.get_or_insert_default();
        }
    }
    Some(request)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rig(id: &str) -> StoredRig {
        StoredRig {
            id: id.to_owned(),
            built_in: false,
            ..built_in("adult").expect("it is built in")
        }
    }

    #[test]
    fn refuses_more_than_the_maximum_until_one_is_deleted() {
        let store = RigStore::new(2, None);
        store.insert(rig("a"), None).unwrap();
        store.insert(rig("b"), None).unwrap();
        let full = ServiceError::RigsFull { maximum: 2 };
        assert_eq!(store.check_room("c"), Err(full.clone()));
        assert_eq!(store.insert(rig("c"), None).unwrap_err(), full);
        store.delete("a", &Caller::default()).unwrap();
        store.insert(rig("c"), None).unwrap();
        let listed: Vec<String> = store.page(None, 10).0.into_iter().map(|(id, _)| id).collect();
        assert_eq!(listed, ["adult", "b", "c", "thesis"]);
    }

    #[test]
    fn an_owner_leaves_room_for_others_and_others_leave_its_rigs_alone() {
        let store = RigStore::new(16, None);
        let one = Caller::named("one");
        let own = |id: String, caller: &Caller| StoredRig {
            owner: caller.owner(),
            ..rig(&id)
        };
        let fill = |caller: &Caller, name: &str| {
            let added = |number: &u32| store.insert(own(format!("{name}{number}"), caller), None).is_ok();
            (0..20).take_while(added).count()
        };
        assert_eq!(fill(&one, "one"), 12);
        assert_eq!(fill(&Caller::named("two"), "two"), 3);
        let theirs = ServiceError::NotOwner {
            name: name_of("one0"),
            owner: "one".to_owned(),
        };
        assert_eq!(store.delete("one0", &Caller::named("two")), Err(theirs));
        store.delete("one0", &one).unwrap();
        // Without tokens, everything is everybody's, and nothing is kept for others.
        store.delete("one1", &Caller::default()).unwrap();
        assert_eq!(fill(&Caller::default(), "all"), 3);
    }

    #[test]
    fn limits_of_version_0_1_are_of_the_digit_of_their_place() {
        let request = request_of(&[0x2a, 0].repeat(5)).unwrap();
        assert!(request.limits.iter().map(|limits| limits.digit).eq(1..=5));
    }
}
