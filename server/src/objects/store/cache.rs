//! The cache: created objects, their derived data, and their atlases, within one bound.
//!
//! When something does not fit, data that can be made again goes first: derived data and objects at other sizes, the least recently
//! used first, and then atlases, those in least demand first. After them go created objects, the least recently used first.
//! Nothing that a call uses goes.

use std::sync::{Arc, OnceLock, Weak};

use grasp_assets::hands::Hand;
use grasp_synthesis::base::stop::Stop;

use super::{Created, ObjectStore, RETRY_AFTER};
use crate::{
    atlas_slots::{Demand, Slot},
    error::{Limit, ServiceError},
    objects::{Derived, StoredObject, derived::ObjectSize, name_of},
};

/// Largest number of kept sizes of an object. With more in turn, each call prepares the object again.
pub(super) const SIZES_PER_OBJECT: usize = 8;

/// Largest number of objects whose derived data is kept although no call requested it: the newest, needed soon.
pub(super) const KEPT_AHEAD: usize = 32;

/// Where an object at another size is kept once it is prepared.
pub(crate) type SizeSlot = Arc<OnceLock<Arc<StoredObject>>>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    Call,
    /// A call may ask for it soon, or an atlas grows from it.
    Ahead,
}

#[derive(Clone, Debug)]
pub(super) enum Product {
    Derived,
    Size(ObjectSize, SizeSlot),
    /// The atlas for a hand, and the learned grips.
    Atlas(Arc<Hand>),
}

impl Product {
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Derived, Self::Derived) => true,
            (Self::Size(size, _), Self::Size(other, _)) => size == other,
            (Self::Atlas(hand), Self::Atlas(other)) => hand == other,
            _ => false,
        }
    }
}

#[derive(Debug)]
pub(super) struct Item {
    of: Weak<StoredObject>,
    pub product: Product,
    pub bytes: usize,
    /// When a call last requested it, by the clock of [`Created::uses`]; 0 if none did. Atlases have demands instead.
    last_used: u64,
}

impl Item {
    pub(super) fn is_of(&self, object: &StoredObject) -> bool {
        std::ptr::eq(self.of.as_ptr(), object)
    }

    /// False if the object is gone, or other hands took the place of the atlas' hand.
    pub(super) fn is_there(&self) -> bool {
        self.of.upgrade().is_some_and(|object| match &self.product {
            Product::Atlas(hand) => object.atlas_slots.get(hand).is_some_and(|slot| slot.bytes() > 0),
            Product::Derived | Product::Size(..) => true,
        })
    }

    /// True if a call uses it: dropping it would free nothing.
    fn is_in_use(&self) -> bool {
        match &self.product {
            Product::Derived => self.of.upgrade().is_some_and(|object| object.is_in_use()),
            Product::Size(_, slot) => {
                Arc::strong_count(slot) > 1 || slot.get().is_some_and(|object| object.is_in_use())
            }
            Product::Atlas(_) => false,
        }
    }

    /// The demand for an atlas; nothing else is compared by that.
    fn demand(&self) -> Demand {
        match (&self.product, self.of.upgrade()) {
            (Product::Atlas(hand), Some(object)) => object.atlas_slots.demand(hand).unwrap_or_default(),
            _ => Demand::NONE,
        }
    }

    fn yields_to(&self, demand: Demand) -> bool {
        match self.product {
            Product::Atlas(_) => self.demand().cmp(demand).is_lt(),
            Product::Derived | Product::Size(..) => true,
        }
    }

    /// Its place in the order in which items are dropped.
    fn order(&self) -> (bool, u64, Demand) {
        let is_atlas = matches!(self.product, Product::Atlas(_));
        (is_atlas, self.last_used, self.demand())
    }
}

/// Data that can be made again, in the order in which it was added.
#[derive(Debug, Default)]
pub(super) struct Cache {
    pub items: Vec<Item>,
}

impl Cache {
    fn find(&mut self, object: &StoredObject, product: &Product) -> Option<&mut Item> {
        let is_it = |item: &&mut Item| item.is_of(object) && item.product.is_same(product);
        self.items.iter_mut().find(is_it)
    }

    fn add(&mut self, object: &Arc<StoredObject>, product: Product, bytes: usize, last_used: u64) {
        self.items.push(Item {
            of: Arc::downgrade(object),
            product,
            bytes,
            last_used,
        });
    }

    fn take(&mut self, object: &StoredObject, product: &Product) -> Option<Item> {
        let is_it = |item: &Item| item.is_of(object) && item.product.is_same(product);
        let place = self.items.iter().position(is_it)?;
        Some(self.items.remove(place))
    }

    pub(super) fn retain(&mut self, stays: impl Fn(&Item) -> bool) {
        self.items.retain(stays);
    }

    /// Forgets the items of an object that is gone.
    pub(super) fn forget(&mut self, object: &StoredObject) {
        self.retain(|item| !item.is_of(object));
    }

    /// Gives a changed object the known grips of the object that it replaces, if they hold it.
    pub(super) fn hand_over(&mut self, before: &StoredObject, after: &Arc<StoredObject>) {
        if !after.has_grips_of(before) {
            return;
        }
        after.atlas_slots.take_over(&before.atlas_slots);
        for (hand, slot) in after.atlas_slots.all() {
            if slot.bytes() > 0 {
                self.add(after, Product::Atlas(hand), slot.bytes(), 0);
            }
        }
    }

    /// Drops the first item that may go and is not in use. False if there is none.
    pub(super) fn evict(&mut self, may_go: impl Fn(&Item) -> bool) -> bool {
        let unused = self.items.iter().enumerate();
        let unused = unused.filter(|(_, item)| may_go(item) && !item.is_in_use());
        let ordered = unused.map(|(place, item)| (item.order(), place));
        let first = ordered.min_by(|((a_atlas, a_used, a), _), ((b_atlas, b_used, b), _)| {
            (a_atlas, a_used).cmp(&(b_atlas, b_used)).then(a.cmp(*b))
        });
        let Some((_, place)) = first else { return false };
        let item = self.items.remove(place);
        if let Some(object) = item.of.upgrade() {
            match item.product {
                Product::Derived => object.derived.forget(),
                Product::Size(..) => {}
                Product::Atlas(hand) => {
                    tracing::debug!(object = object.name(), rig = hand.rig.name, "evicted an atlas");
                    object.atlas_slots.evict(&hand);
                }
            }
        }
        true
    }

    /// Drops the oldest derived data that no call requested if there is too much of it.
    fn drop_oldest_ahead(&mut self) {
        let is_ahead = |item: &Item| matches!(item.product, Product::Derived) && item.last_used == 0;
        let ahead = self.items.iter().filter(|item| is_ahead(item)).count();
        if ahead > KEPT_AHEAD {
            self.evict(is_ahead);
        }
    }
}

/// Room in the cache for an object that is about to be added.
#[must_use = "reserved room is lost until it is released"]
pub(super) struct Reserved {
    bytes: usize,
    objects: usize,
}

impl Reserved {
    /// Gives the room back, so that the added object can be counted.
    pub(super) fn release(self, created: &mut Created) {
        created.bytes -= self.bytes;
        created.loaded -= self.objects;
    }
}

impl ObjectStore {
    /// Makes room for a new object or for more bytes of the object `grows`, and keeps it until it is released.
    pub(super) fn reserve(
        &self,
        created: &mut Created,
        grows: Option<&str>,
        bytes: usize,
        objects: usize,
    ) -> Result<Reserved, ServiceError> {
        let kept = grows.and_then(|id| created.objects.get(id));
        let whole = bytes + kept.map_or(0, |entry| entry.state.bytes());
        if whole > self.limits.bytes {
            let field = if grows.is_some() { "forbidden" } else { "mesh" };
            return Err(ServiceError::invalid(field, self.too_large(whole)));
        }
        self.make_room(created, grows, bytes, objects)?;
        created.bytes += bytes;
        created.loaded += objects;
        Ok(Reserved { bytes, objects })
    }

    /// Makes room for more bytes and objects of a call: anything may go that is not in use but the object with the id `kept`.
    fn make_room(
        &self,
        created: &mut Created,
        kept: Option<&str>,
        bytes: usize,
        objects: usize,
    ) -> Result<(), ServiceError> {
        created.cache.retain(Item::is_there);
        loop {
            let lacks_bytes = created.taken() + bytes > self.limits.bytes;
            if !lacks_bytes && created.loaded + objects <= self.limits.objects {
                return Ok(());
            }
            let freed = lacks_bytes && created.cache.evict(|_| true) || created.evict_one(kept);
            if !freed {
                return Err(self.full());
            }
        }
    }

    /// Makes room for an atlas in this demand by dropping data that can be made again. False if that is not enough.
    fn make_room_ahead(&self, created: &mut Created, demand: Demand, bytes: usize) -> bool {
        created.cache.retain(Item::is_there);
        if !self.has_room(created, demand, bytes) {
            return false;
        }
        while created.taken() + bytes > self.limits.bytes {
            // Something may have come into use meanwhile.
            if !created.cache.evict(|item| item.yields_to(demand)) {
                return false;
            }
        }
        true
    }

    /// True if so many more bytes fit once everything has made room that yields to this demand.
    fn has_room(&self, created: &Created, demand: Demand, bytes: usize) -> bool {
        let yielding = created.cache.items.iter();
        let yielding = yielding.filter(|item| item.yields_to(demand) && !item.is_in_use());
        let freed: usize = yielding.map(|item| item.bytes).sum();
        created.taken() + bytes <= self.limits.bytes + freed
    }

    fn full(&self) -> ServiceError {
        ServiceError::Overloaded {
            limit: Limit::ObjectCache,
            maximum: self.limits.objects,
            retry_after: RETRY_AFTER,
        }
    }

    fn too_large(&self, bytes: usize) -> String {
        let most = self.limits.bytes;
        format!("takes about {bytes} bytes with the object's search structures; the cache holds {most}")
    }

    /// Checks that a new object fits in the cache with its derived data.
    pub(crate) fn check_size(&self, object: &StoredObject) -> Result<(), ServiceError> {
        let whole = object.derived_and_own_bytes();
        if whole > self.limits.bytes {
            return Err(ServiceError::invalid("mesh", self.too_large(whole)));
        }
        Ok(())
    }

    /// The derived data of an object, if it is kept.
    pub(crate) fn kept(&self, object: &Arc<StoredObject>, need: Need) -> Option<Arc<Derived>> {
        // Locked first, so that the data is not dropped before it is seen to be in use.
        let mut created = self.created();
        let kept = object.derived.get()?;
        let now = created.tick();
        let is_current = created.is_current(object);
        match created.cache.find(object, &Product::Derived) {
            Some(item) if need == Need::Call => item.last_used = now,
            // Whoever built it has yet to find room for it.
            None if is_current => return None,
            _ => {}
        }
        Some(kept)
    }

    /// The derived data of an object, built if necessary, in which case less needed data makes room. Built ahead, it is kept only
    /// if there is room. An object that the server started with keeps it outside of the cache.
    ///
    /// # Errors
    /// [`ServiceError::ObjectUnloadable`] if it takes more than the whole cache, [`ServiceError::Overloaded`] if everything that
    /// could make room is in use, [`ServiceError::Cancelled`].
    pub(crate) fn derived(
        &self,
        object: &Arc<StoredObject>,
        need: Need,
        stop: Stop<'_>,
    ) -> Result<Arc<Derived>, ServiceError> {
        if let Some(kept) = self.kept(object, need) {
            return Ok(kept);
        }
        let twin = self.created().derived_of_twin(object);
        let derived = match twin {
            Some(twin) => object
                .derived
                .get_or_build(|| Ok(Arc::new(Derived::clone(&twin))))?,
            None => object.derived_until(stop)?,
        };
        let mut created = self.created();
        if !created.is_current(object) {
            return Ok(derived);
        }
        // A call that found no room may have dropped it, and another one has built it since.
        let derived = object.derived.keep(derived);
        if created.cache.find(object, &Product::Derived).is_none() {
            let kept = self.keep_derived(&mut created, object, derived.bytes(), need);
            kept.inspect_err(|_| object.derived.forget())?;
        }
        Ok(derived)
    }

    fn keep_derived(
        &self,
        created: &mut Created,
        object: &Arc<StoredObject>,
        bytes: usize,
        need: Need,
    ) -> Result<(), ServiceError> {
        let whole = object.bytes() + bytes;
        if whole > self.limits.bytes {
            let most = self.limits.bytes;
            return Err(ServiceError::ObjectUnloadable {
                name: name_of(&object.id),
                reason: format!(
                    "it takes about {whole} bytes with its search structures; the cache holds {most}"
                ),
            });
        }
        let last_used = match need {
            Need::Call => {
                self.make_room(created, Some(&object.id), bytes, 0)?;
                created.tick()
            }
            Need::Ahead if self.make_room_ahead(created, Demand::NONE, bytes) => 0,
            Need::Ahead => {
                object.derived.forget();
                return Ok(());
            }
        };
        created.cache.add(object, Product::Derived, bytes, last_used);
        created.cache.drop_oldest_ahead();
        Ok(())
    }

    /// Number of created objects whose derived data is kept.
    pub(crate) fn prepared(&self) -> usize {
        let created = self.created();
        let items = created.cache.items.iter();
        let derived = items.filter(|item| matches!(item.product, Product::Derived));
        derived.count()
    }

    /// The place of an object at another size, which the caller fills if it is empty. It counts as that of the object itself.
    pub(crate) fn resized(
        &self,
        stored: &Arc<StoredObject>,
        size: ObjectSize,
    ) -> Result<SizeSlot, ServiceError> {
        let mut created = self.created();
        let now = created.tick();
        let new = SizeSlot::default();
        let product = Product::Size(size, Arc::clone(&new));
        if let Some(item) = created.cache.find(stored, &product)
            && let Product::Size(_, slot) = &item.product
        {
            item.last_used = now;
            return Ok(Arc::clone(slot));
        }
        let is_size = |item: &Item| item.is_of(stored) && matches!(item.product, Product::Size(..));
        let sizes = created.cache.items.iter().filter(|item| is_size(item)).count();
        if sizes >= SIZES_PER_OBJECT && !created.cache.evict(is_size) {
            return Err(self.full());
        }
        let bytes = stored.derived_and_own_bytes();
        let is_created = created.objects.contains_key(&stored.id);
        let own = if is_created { bytes } else { 0 };
        if own + bytes > self.limits.bytes {
            return Err(ServiceError::invalid(
                "holdout.scale",
                format!(
                    "takes about {bytes} bytes beside the object at its own size; the cache holds {}",
                    self.limits.bytes
                ),
            ));
        }
        self.make_room(&mut created, Some(&stored.id), bytes, 0)?;
        created.cache.add(stored, product, bytes, now);
        Ok(new)
    }

    /// Changes the known grips of an object and a hand if there is room, and other hands have not taken its place. Otherwise returns
    /// false, and changes and evicts nothing.
    pub(crate) fn change_atlas(
        &self,
        object: &Arc<StoredObject>,
        hand: &Arc<Hand>,
        change: impl FnOnce(&mut Slot),
    ) -> bool {
        let mut created = self.created();
        let Some(mut slot) = object.atlas_slots.get(hand) else {
            return false;
        };
        let demand = slot.demand;
        change(&mut slot);
        let after = slot.bytes();
        let product = Product::Atlas(Arc::clone(hand));
        // Not what it has: an object that is gone no longer counts.
        let before = created.cache.take(object, &product).map_or(0, |item| item.bytes);
        let fits = self.make_room_ahead(&mut created, demand, after);
        if fits {
            object.atlas_slots.set_grips(hand, slot);
        }
        let bytes = if fits { after } else { before };
        if bytes > 0 {
            created.cache.add(object, product, bytes, 0);
        }
        fits
    }

    /// True if an atlas of so many bytes would fit, after evicting others in less demand.
    pub(crate) fn has_room_for_atlas(&self, object: &StoredObject, hand: &Arc<Hand>, bytes: usize) -> bool {
        let created = self.created();
        let slot = object.atlas_slots.get(hand).unwrap_or_default();
        self.has_room(&created, slot.demand, bytes.saturating_sub(slot.bytes()))
    }
}

impl Created {
    pub(super) fn taken(&self) -> usize {
        self.bytes + self.cache.items.iter().map(|item| item.bytes).sum::<usize>()
    }

    fn derived_of_twin(&self, object: &StoredObject) -> Option<Arc<Derived>> {
        let derived = self.cache.items.iter();
        let derived = derived.filter(|item| matches!(item.product, Product::Derived));
        let mut objects = derived.filter_map(|item| item.of.upgrade());
        objects.find(|other| other.derives_as(object))?.derived.get()
    }
}
