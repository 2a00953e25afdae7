//! Rigs by name. Created ones stay until they are deleted, and outlast the server if they are saved; beyond their maximum, more
//! are refused.

use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Bound,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bytes::Bytes;
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::v1;
use grasp_synthesis::model::hand::{Handedness, rig::Rig};

use super::{COLLECTION, RigHand, ScaledHands, StoredRig, name_of, saved::SavedRig};
use crate::{
    error::ServiceError,
    saved::{Records, seal, wait_for},
};

/// All rigs.
///
/// If rigs are saved, the methods that add or delete one wait for the disk or network. They are for threads that may block, in
/// the context of the async runtime.
#[derive(Debug)]
pub(crate) struct RigStore {
    built_in: BTreeMap<String, Arc<StoredRig>>,
    created: Mutex<Created>,
    /// Held while a rig is added or deleted, so that what is saved and what is in memory agree.
    changing: Mutex<()>,
    maximum: usize,
    /// `None` if rigs are in memory only.
    saved: Option<Records>,
    scaled: ScaledHands,
}

/// The created rigs.
#[derive(Debug, Default)]
struct Created {
    rigs: BTreeMap<String, Arc<StoredRig>>,
    /// Ids of those whose records are damaged or missing.
    damaged: BTreeSet<String>,
}

impl Created {
    /// Their ids.
    fn ids(&self) -> Vec<String> {
        self.rigs.keys().chain(&self.damaged).cloned().collect()
    }

    fn has(&self, id: &str) -> bool {
        self.rigs.contains_key(id) || self.damaged.contains(id)
    }
}

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
            scaled: ScaledHands::default(),
        }
    }

    /// The rig that a request names: "rigs/{rig}".
    pub(crate) fn named(&self, name: &str) -> Option<Arc<StoredRig>> {
        self.find(name.strip_prefix(COLLECTION)?)
    }

    /// A hand of a rig of which a request has the name, without its skin.
    pub(crate) fn rig(&self, name: &str, handedness: Handedness) -> Option<Rig> {
        let stored = self.named(name)?;
        Some((*stored.hand(handedness).hand.rig).clone())
    }

    /// The rig with this id.
    ///
    /// # Errors
    /// [`ServiceError::RigNotFound`], [`ServiceError::RigDamaged`].
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

    /// True if the record of the rig that a request names is damaged or missing.
    pub(crate) fn is_damaged(&self, name: &str) -> bool {
        let id = name.strip_prefix(COLLECTION);
        id.is_some_and(|id| self.created().damaged.contains(id))
    }

    /// Keeps the name of a rig whose record is damaged or missing.
    pub(crate) fn add_damaged(&self, id: String) {
        self.created().damaged.insert(id);
    }

    /// A hand that is `hundredths` / 100 times as large as a rig's. The last few are kept, so that what searches derive from
    /// them is not derived for each call.
    pub(crate) fn scaled(&self, hand: &RigHand, hundredths: u16) -> RigHand {
        self.scaled.get(hand, hundredths)
    }

    /// Checks that a rig can be added: called before a rig is made, so that none is made in vain.
    ///
    /// # Errors
    /// [`ServiceError::RigExists`], [`ServiceError::RigsFull`].
    pub(crate) fn check_room(&self, id: &str) -> Result<(), ServiceError> {
        self.check(&self.created(), id)
    }

    /// The records; `None` if rigs are in memory only.
    pub(crate) fn saved(&self) -> Option<&Records> {
        self.saved.as_ref()
    }

    /// What is saved of a rig that this request makes; nothing if rigs are in memory only.
    pub(crate) fn record(&self, request: &v1::CreateRigRequest) -> Option<Bytes> {
        let saved = self.saved.as_ref();
        saved.map(|_| seal(&SavedRig::from(request.clone())))
    }

    /// Adds a rig, and saves its record if there is one.
    ///
    /// # Errors
    /// [`ServiceError::RigExists`], [`ServiceError::RigsFull`], and [`ServiceError::StoreFailed`] if it cannot be saved.
    pub(crate) fn insert(
        &self,
        rig: StoredRig,
        record: Option<Bytes>,
    ) -> Result<Arc<StoredRig>, ServiceError> {
        let _changing = self.changing();
        self.check_room(&rig.id)?;
        if let Some((saved, record)) = self.saved.as_ref().zip(record) {
            let mut names = self.created().ids();
            names.push(rig.id.clone());
            let created = saved.create(&rig.id, record, names, async { Ok(()) });
            wait_for(created).map_err(|_| ServiceError::StoreFailed)?;
        }
        let rig = Arc::new(rig);
        self.created().rigs.insert(rig.id.clone(), Arc::clone(&rig));
        Ok(rig)
    }

    /// Adds a rig whose record was read. It may have been damaged before; if it was deleted meanwhile, it stays so.
    pub(crate) fn add_saved(&self, rig: StoredRig, was_damaged: bool) -> Arc<StoredRig> {
        let rig = Arc::new(rig);
        let mut created = self.created();
        if created.damaged.remove(&rig.id) == was_damaged {
            created.rigs.insert(rig.id.clone(), Arc::clone(&rig));
        }
        rig
    }

    /// Removes a created rig.
    ///
    /// # Errors
    /// [`ServiceError::RigNotFound`], [`ServiceError::RigBuiltIn`], and [`ServiceError::StoreFailed`] if what was saved cannot be
    /// deleted.
    pub(crate) fn delete(&self, id: &str) -> Result<(), ServiceError> {
        if self.built_in.contains_key(id) {
            return Err(ServiceError::RigBuiltIn { name: name_of(id) });
        }
        let _changing = self.changing();
        if !self.created().has(id) {
            return Err(ServiceError::RigNotFound { name: name_of(id) });
        }
        if let Some(saved) = &self.saved {
            let mut others = self.created().ids();
            others.retain(|other| other != id);
            wait_for(saved.delete(id, others))?;
        }
        let mut created = self.created();
        created.damaged.remove(id);
        created.rigs.remove(id);
        Ok(())
    }

    /// Up to `size` rigs ordered by name, starting after `after`, and whether there are more.
    pub(crate) fn page(&self, after: Option<&str>, size: usize) -> (Vec<Arc<StoredRig>>, bool) {
        let from = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
        let created = self.created();
        let built_in = self.built_in.range::<str, _>(from).take(size + 1);
        let created = created.rigs.range::<str, _>(from).take(size + 1);
        let mut rigs: Vec<_> = built_in.chain(created).map(|(_, rig)| Arc::clone(rig)).collect();
        rigs.sort_by(|a, b| a.id.cmp(&b.id));
        let more = rigs.len() > size;
        rigs.truncate(size);
        (rigs, more)
    }

    fn find(&self, id: &str) -> Option<Arc<StoredRig>> {
        let built_in = self.built_in.get(id).cloned();
        built_in.or_else(|| self.created().rigs.get(id).cloned())
    }

    fn check(&self, created: &Created, id: &str) -> Result<(), ServiceError> {
        if self.built_in.contains_key(id) || created.has(id) {
            return Err(ServiceError::RigExists { name: name_of(id) });
        }
        if created.rigs.len() + created.damaged.len() >= self.maximum {
            return Err(ServiceError::RigsFull {
                maximum: self.maximum,
            });
        }
        Ok(())
    }

    fn changing(&self) -> MutexGuard<'_, ()> {
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn created(&self) -> MutexGuard<'_, Created> {
        // No code panics while it holds the lock; if some did, the map would still be consistent.
        self.created.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn built_in(name: &str) -> Option<StoredRig> {
    let hand = |side| hands::hand(name, side).map(RigHand::without_model);
    Some(StoredRig {
        id: name.to_owned(),
        built_in: true,
        hands: [hand(Handedness::Left)?, hand(Handedness::Right)?],
        mirrored: [true, false],
        warnings: Vec::new(),
    })
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
        store.delete("a").unwrap();
        store.insert(rig("c"), None).unwrap();
        let listed: Vec<String> = store.page(None, 10).0.iter().map(|rig| rig.id.clone()).collect();
        assert_eq!(listed, ["adult", "b", "c", "thesis"]);
    }

    #[test]
    fn built_in_rigs_have_one_name_and_stay() {
        let store = RigStore::new(1, None);
        assert_eq!(store.named("rigs/adult").expect("it is built in").id, "adult");
        assert!(store.named("adult").is_none());
        store.insert(rig("own"), None).unwrap();
        assert!(store.named("rigs/own").is_some() && store.named("own").is_none());
        let name = "rigs/adult".to_owned();
        assert_eq!(
            store.delete("adult"),
            Err(ServiceError::RigBuiltIn { name: name.clone() })
        );
        assert_eq!(
            store.insert(rig("adult"), None).unwrap_err(),
            ServiceError::RigExists { name }
        );
        let name = "rigs/none".to_owned();
        assert_eq!(store.delete("none"), Err(ServiceError::RigNotFound { name }));
    }
}
