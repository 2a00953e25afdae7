//! Rigs by name. Created ones stay until they are deleted; beyond their maximum, more are refused.

use std::{
    collections::BTreeMap,
    ops::Bound,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use grasp_assets::hands::{self, RIG_NAMES};
use grasp_synthesis::model::hand::Handedness;

use super::{COLLECTION, RigHand, StoredRig, name_of, scaled::ScaledHands};
use crate::error::ServiceError;

/// All rigs.
#[derive(Debug)]
pub(crate) struct RigStore {
    built_in: BTreeMap<String, Arc<StoredRig>>,
    created: Mutex<BTreeMap<String, Arc<StoredRig>>>,
    maximum: usize,
    scaled: ScaledHands,
}

impl RigStore {
    /// A store of the built-in rigs that keeps up to `maximum` created ones.
    pub(crate) fn new(maximum: usize) -> Self {
        Self {
            built_in: RIG_NAMES
                .into_iter()
                .filter_map(|name| Some((name.to_owned(), Arc::new(built_in(name)?))))
                .collect(),
            created: Mutex::default(),
            maximum,
            scaled: ScaledHands::default(),
        }
    }

    /// The rig that a request names: "rigs/{rig}", or "{rig}" for a built-in one.
    pub(crate) fn named(&self, name: &str) -> Option<Arc<StoredRig>> {
        match name.strip_prefix(COLLECTION) {
            Some(id) => self.find(id),
            None => self.built_in.get(name).cloned(),
        }
    }

    /// The rig with this id.
    ///
    /// # Errors
    /// [`ServiceError::RigNotFound`].
    pub(crate) fn get(&self, id: &str) -> Result<Arc<StoredRig>, ServiceError> {
        self.find(id)
            .ok_or_else(|| ServiceError::RigNotFound { name: name_of(id) })
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

    /// Adds a rig.
    ///
    /// # Errors
    /// [`ServiceError::RigExists`], [`ServiceError::RigsFull`].
    pub(crate) fn insert(&self, rig: StoredRig) -> Result<Arc<StoredRig>, ServiceError> {
        let mut created = self.created();
        self.check(&created, &rig.id)?;
        let rig = Arc::new(rig);
        created.insert(rig.id.clone(), Arc::clone(&rig));
        Ok(rig)
    }

    /// Removes a created rig.
    ///
    /// # Errors
    /// [`ServiceError::RigNotFound`], [`ServiceError::RigBuiltIn`].
    pub(crate) fn delete(&self, id: &str) -> Result<(), ServiceError> {
        if self.built_in.contains_key(id) {
            return Err(ServiceError::RigBuiltIn { name: name_of(id) });
        }
        match self.created().remove(id) {
            Some(_) => Ok(()),
            None => Err(ServiceError::RigNotFound { name: name_of(id) }),
        }
    }

    /// Up to `size` rigs ordered by name, starting after `after`, and whether there are more.
    pub(crate) fn page(&self, after: Option<&str>, size: usize) -> (Vec<Arc<StoredRig>>, bool) {
        let from = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
        let created = self.created();
        let built_in = self.built_in.range::<str, _>(from).take(size + 1);
        let created = created.range::<str, _>(from).take(size + 1);
        let mut rigs: Vec<_> = built_in.chain(created).map(|(_, rig)| Arc::clone(rig)).collect();
        rigs.sort_by(|a, b| a.id.cmp(&b.id));
        let more = rigs.len() > size;
        rigs.truncate(size);
        (rigs, more)
    }

    fn find(&self, id: &str) -> Option<Arc<StoredRig>> {
        let built_in = self.built_in.get(id).cloned();
        built_in.or_else(|| self.created().get(id).cloned())
    }

    fn check(&self, created: &BTreeMap<String, Arc<StoredRig>>, id: &str) -> Result<(), ServiceError> {
        if self.built_in.contains_key(id) || created.contains_key(id) {
            return Err(ServiceError::RigExists { name: name_of(id) });
        }
        if created.len() >= self.maximum {
            return Err(ServiceError::RigsFull {
                maximum: self.maximum,
            });
        }
        Ok(())
    }

    fn created(&self) -> MutexGuard<'_, BTreeMap<String, Arc<StoredRig>>> {
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
        let store = RigStore::new(2);
        store.insert(rig("a")).unwrap();
        store.insert(rig("b")).unwrap();
        let full = ServiceError::RigsFull { maximum: 2 };
        assert_eq!(store.check_room("c"), Err(full.clone()));
        assert_eq!(store.insert(rig("c")).unwrap_err(), full);
        store.delete("a").unwrap();
        store.insert(rig("c")).unwrap();
        let listed: Vec<String> = store.page(None, 10).0.iter().map(|rig| rig.id.clone()).collect();
        assert_eq!(listed, ["adult", "b", "c", "thesis"]);
    }

    #[test]
    fn built_in_rigs_have_two_names_and_stay() {
        let store = RigStore::new(1);
        for name in ["adult", "rigs/adult"] {
            assert_eq!(store.named(name).expect("it is built in").id, "adult");
        }
        store.insert(rig("own")).unwrap();
        assert!(store.named("rigs/own").is_some() && store.named("own").is_none());
        let name = "rigs/adult".to_owned();
        assert_eq!(
            store.delete("adult"),
            Err(ServiceError::RigBuiltIn { name: name.clone() })
        );
        assert_eq!(
            store.insert(rig("adult")).unwrap_err(),
            ServiceError::RigExists { name }
        );
        let name = "rigs/none".to_owned();
        assert_eq!(store.delete("none"), Err(ServiceError::RigNotFound { name }));
    }
}
