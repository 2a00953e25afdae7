//! Who may call: clients that tokens or certificates name, with their rights and belongings.
//!
//! [`Door`] lets a call in, or refuses it before its message is read. It makes the call's [`Caller`], who is the [`Owner`] of objects
//! and rigs that the call creates. Without tokens and certificates, anyone may do anything, and everything is everybody's.

mod door;
mod tokens;

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Duration,
};

#[cfg(fuzzing)]
pub(crate) use self::tokens::Tokens;
pub use self::tokens::new_token;
pub(crate) use self::{door::Door, tokens::Quotas};
use crate::error::{Quota, ServiceError};

/// When a client at its quota of searches should try again: after about the time of a few.
const RETRY_SEARCH_AFTER: Duration = Duration::from_millis(50);

/// Who makes a call.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caller(Option<Arc<Identity>>);

/// A client with a name.
#[derive(Debug)]
pub(crate) struct Identity {
    pub name: Arc<str>,
    pub scopes: Vec<Scope>,
    /// True if its creations are everybody's.
    pub shared: bool,
    pub quotas: Quotas,
    /// Number of its searches, running and waiting, if it has a quota of them.
    searches: Arc<AtomicUsize>,
}

impl Identity {
    fn new(name: Arc<str>, scopes: Vec<Scope>, shared: bool, quotas: Quotas) -> Self {
        Self {
            name,
            scopes,
            shared,
            quotas,
            searches: Arc::default(),
        }
    }
}

/// A search within its client's quota, until this is dropped.
#[derive(Debug)]
pub(crate) struct QuotaSearch(Arc<AtomicUsize>);

impl Drop for QuotaSearch {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The kind of a call; a client may make calls of some kinds only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Scope {
    /// Finds and checks grasps, and tracks givers.
    Find,
    /// Reads objects, rigs and the contract.
    Read,
    /// Creates, changes and deletes objects and rigs.
    Write,
}

impl Scope {
    pub(crate) const ALL: [Self; 3] = [Self::Find, Self::Read, Self::Write];
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Find => "find",
            Self::Read => "read",
            Self::Write => "write",
        })
    }
}

/// The name of the client that created something; empty if it is everybody's.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Owner(Option<Arc<str>>);

impl Owner {
    /// The owner by its name in a message.
    pub(crate) fn named(name: &str) -> Self {
        Self(Some(name).filter(|name| !name.is_empty()).map(Into::into))
    }

    pub(crate) fn is_everybody(&self) -> bool {
        self.0.is_none()
    }
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.as_deref().unwrap_or_default())
    }
}

impl Caller {
    /// The caller's name, if it has one.
    pub(crate) fn name(&self) -> Option<&Arc<str>> {
        self.0.as_ref().map(|identity| &identity.name)
    }

    /// The owner of the caller's creations.
    pub(crate) fn owner(&self) -> Owner {
        let owner = self.0.as_ref().filter(|identity| !identity.shared);
        Owner(owner.map(|identity| Arc::clone(&identity.name)))
    }

    pub(crate) fn quotas(&self) -> Quotas {
        self.0
            .as_ref()
            .map_or_else(Quotas::default, |identity| identity.quotas)
    }

    /// Takes a search of the caller's quota, if it has one.
    pub(crate) fn take_search(&self) -> Result<Option<QuotaSearch>, ServiceError> {
        let limited = self
            .0
            .as_ref()
            .and_then(|identity| Some((&identity.searches, identity.quotas.searches?)));
        let Some((searches, most)) = limited else {
            return Ok(None);
        };
        let another = |held| (held < most).then_some(held + 1);
        match searches.fetch_update(Ordering::Relaxed, Ordering::Relaxed, another) {
            Ok(_) => Ok(Some(QuotaSearch(Arc::clone(searches)))),
            Err(_) => Err(ServiceError::QuotaExceeded {
                quota: Quota::Searches,
                maximum: most as u64,
                retry_after: Some(RETRY_SEARCH_AFTER),
            }),
        }
    }

    /// Checks that the caller may change or delete something with this name and owner.
    pub(crate) fn check_owns(&self, name: &str, owner: &Owner) -> Result<(), ServiceError> {
        let is_own = self.0.is_none() || owner.0.is_none() || owner.0.as_ref() == self.name();
        if is_own {
            return Ok(());
        }
        Err(ServiceError::NotOwner {
            name: name.to_owned(),
            owner: owner.to_string(),
        })
    }
}

#[cfg(test)]
impl Caller {
    /// A caller with a name, who may do anything.
    pub(crate) fn named(name: &str) -> Self {
        Self::with(name, Quotas::default())
    }

    pub(crate) fn with(name: &str, quotas: Quotas) -> Self {
        let identity = Identity::new(name.into(), Scope::ALL.to_vec(), false, quotas);
        Self(Some(Arc::new(identity)))
    }
}
