//! Rigs by name. Created ones stay until they are deleted, and outlast the server if they are saved; beyond their maximum, more
//! are refused.

use std::{
    collections::BTreeMap,
    ops::Bound,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bytes::Bytes;
use grasp_assets::hands::{self, RIG_NAMES};
use grasp_proto::v1;
use grasp_synthesis::model::hand::{Handedness, rig::Rig};
use object_store::Error;
use prost::Message;

use super::{COLLECTION, RigHand, ScaledHands, StoredRig, name_of};
use crate::{
    error::ServiceError,
    saved::{RIGS, Records, SavedFiles, Unreadable, seal, wait_for},
};

/// All rigs.
///
/// If rigs are saved, the methods that add or delete one wait for the disk or network. They are for threads that may block, in
/// the context of the async runtime.
#[derive(Debug)]
pub(crate) struct RigStore {
    built_in: BTreeMap<String, Arc<StoredRig>>,
    created: Mutex<CreatedRigs>,
    /// Held while a rig is added or deleted, so that what is saved and what is in memory agree.
    changing: Mutex<()>,
    maximum: usize,
    /// `None` if rigs are in memory only.
    saved: Option<Records>,
    scaled: ScaledHands,
}

/// The rigs that clients created by id; `None` if the record is damaged or missing.
type CreatedRigs = BTreeMap<String, Option<Arc<StoredRig>>>;

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
        id.is_some_and(|id| self.created().get(id).is_some_and(Option::is_none))
    }

    /// Keeps the name of a rig whose record is damaged or missing.
    pub(crate) fn add_damaged(&self, id: String) {
        self.created().insert(id, None);
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
        if self.built_in.contains_key(id) || self.created().contains_key(id) {
            return Err(ServiceError::RigExists { name: name_of(id) });
        }
        if self.created().len() >= self.maximum {
            return Err(ServiceError::RigsFull {
                maximum: self.maximum,
            });
        }
        Ok(())
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
            let mut names = self.ids();
            names.push(rig.id.clone());
            let created = saved.create(&rig.id, record, names, async { Ok(()) });
            wait_for(created).map_err(|_| ServiceError::StoreFailed)?;
        }
        let rig = Arc::new(rig);
        self.created().insert(rig.id.clone(), Some(Arc::clone(&rig)));
        Ok(rig)
    }

    /// Adds a rig whose record was read. It may have been damaged before; if it was deleted meanwhile, it stays so.
    pub(crate) fn add_saved(&self, rig: StoredRig, was_damaged: bool) -> Arc<StoredRig> {
        let rig = Arc::new(rig);
        let mut created = self.created();
        let is_damaged = created.get(&rig.id).is_some_and(Option::is_none);
        if is_damaged == was_damaged {
            created.insert(rig.id.clone(), Some(Arc::clone(&rig)));
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
        if !self.created().contains_key(id) {
            return Err(ServiceError::RigNotFound { name: name_of(id) });
        }
        if let Some(saved) = &self.saved {
            let mut others = self.ids();
            others.retain(|other| other != id);
            wait_for(saved.delete(id, others))?;
        }
        self.created().remove(id);
        Ok(())
    }

    /// Up to `size` rigs ordered by name, starting after `after`, and whether there are more.
    pub(crate) fn page(&self, after: Option<&str>, size: usize) -> (Vec<Arc<StoredRig>>, bool) {
        let from = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
        let created = self.created();
        let built_in = self.built_in.range::<str, _>(from).map(|(_, rig)| rig);
        let created = created.range::<str, _>(from).filter_map(|(_, rig)| rig.as_ref());
        let rigs = built_in.take(size + 1).chain(created.take(size + 1));
        let mut rigs: Vec<_> = rigs.map(Arc::clone).collect();
        rigs.sort_by(|a, b| a.id.cmp(&b.id));
        let more = rigs.len() > size;
        rigs.truncate(size);
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
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn created(&self) -> MutexGuard<'_, CreatedRigs> {
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

/// Largest record in bytes: a model of the largest size that a server can be configured to take, and what is beside it.
const MAX_RECORD: u64 = 1 << 30;

/// The digits, thumb first.
const DIGITS: [v1::Digit; 5] = [
    v1::Digit::Thumb,
    v1::Digit::Index,
    v1::Digit::Middle,
    v1::Digit::Ring,
    v1::Digit::Little,
];

/// The records of rigs.
pub(crate) fn saved_rigs(files: Arc<SavedFiles>) -> Records {
    Records::new(files, RIGS, MAX_RECORD)
}

/// The request that made a rig.
///
/// # Errors
/// It cannot be read; within, what is wrong with the record.
pub(crate) async fn saved_request(
    rigs: &Records,
    id: &str,
) -> Result<Result<v1::CreateRigRequest, Unreadable>, Error> {
    let parse = |message: &[u8]| {
        let saved = SavedRig::decode(message).map_err(|_| Unreadable::Message)?;
        let request = v1::CreateRigRequest::from(saved);
        if request.rig_id == id {
            Ok(request)
        } else {
            Err(Unreadable::Name)
        }
    };
    rigs.read(id, parse).await
}

/// What a client sent to create a rig. Version 0.1 wrote the fields before the request, which are read, but not written.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct SavedRig {
    #[prost(string, tag = "1")]
    id: String,
    #[prost(bytes = "vec", tag = "2")]
    model: Vec<u8>,
    #[prost(message, optional, tag = "3")]
    joints: Option<HandsAtRest>,
    #[prost(message, repeated, tag = "4")]
    joint_map: Vec<v1::RigNode>,
    #[prost(message, repeated, tag = "5")]
    limits: Vec<Limits>,
    #[prost(enumeration = "v1::Handedness", tag = "6")]
    side: i32,
    #[prost(bytes = "vec", tag = "7")]
    other_model: Vec<u8>,
    /// 0: 1.
    #[prost(float, tag = "8")]
    width_scale: f32,
    #[prost(btree_map = "string, float", tag = "9")]
    radii: BTreeMap<String, f32>,
    #[prost(message, optional, tag = "10")]
    request: Option<v1::CreateRigRequest>,
}

#[derive(Clone, PartialEq, Message)]
struct HandsAtRest {
    #[prost(message, repeated, tag = "1")]
    hands: Vec<HandAtRest>,
}

#[derive(Clone, PartialEq, Message)]
struct HandAtRest {
    #[prost(enumeration = "v1::Handedness", tag = "1")]
    side: i32,
    #[prost(message, repeated, tag = "3")]
    joints: Vec<v1::JointPose>,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Limits {
    #[prost(message, optional, tag = "1")]
    base_yaw: Option<Range>,
    #[prost(message, optional, tag = "2")]
    base_pitch: Option<Range>,
    #[prost(message, optional, tag = "3")]
    second_pitch: Option<Range>,
    #[prost(message, optional, tag = "4")]
    third_pitch: Option<Range>,
    /// 1 is the thumb. 0, in records of version 0.1: its place in the list says it.
    #[prost(uint32, tag = "5")]
    digit: u32,
}

#[derive(Clone, Copy, PartialEq, Message)]
struct Range {
    #[prost(float, tag = "1")]
    min: f32,
    #[prost(float, tag = "2")]
    max: f32,
}

impl From<v1::CreateRigRequest> for SavedRig {
    fn from(request: v1::CreateRigRequest) -> Self {
        Self {
            request: Some(request),
            ..Self::default()
        }
    }
}

impl From<SavedRig> for v1::CreateRigRequest {
    fn from(saved: SavedRig) -> Self {
        if let Some(request) = saved.request {
            return request;
        }
        let models = [saved.model, saved.other_model];
        let hands = saved.joints.into_iter().flat_map(|joints| joints.hands);
        let limits = saved.limits.into_iter().enumerate();
        Self {
            rig_id: saved.id,
            models: models.into_iter().filter(|model| !model.is_empty()).collect(),
            joints: hands
                .map(|hand| v1::HandJoints::new(hand.side(), hand.joints))
                .collect(),
            joint_map: saved.joint_map,
            limits: limits.map(|(place, limits)| limits.of_digit_at(place)).collect(),
            handedness: saved.side,
            width_scale: Some(saved.width_scale).filter(|scale| *scale != 0.0),
            radii: saved.radii,
        }
    }
}

impl Limits {
    /// The limits, which are at this place of a list.
    fn of_digit_at(self, place: usize) -> v1::DigitLimits {
        let place = (self.digit as usize).checked_sub(1).unwrap_or(place);
        let ranges = [
            self.base_yaw,
            self.base_pitch,
            self.second_pitch,
            self.third_pitch,
        ]
        .map(Option::unwrap_or_default);
        v1::DigitLimits {
            digit: DIGITS.get(place).copied().unwrap_or_default().into(),
            min: Some(v1::DigitAngles::new(ranges.map(|range| range.min))),
            max: Some(v1::DigitAngles::new(ranges.map(|range| range.max))),
        }
    }
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
    fn limits_of_version_0_1_are_of_the_digit_of_their_place() {
        let saved = SavedRig {
            limits: vec![Limits::default(); 5],
            ..Default::default()
        };
        let request = v1::CreateRigRequest::from(saved);
        let digits = request.limits.into_iter().map(|limits| limits.digit());
        assert!(digits.eq(DIGITS));
    }
}
