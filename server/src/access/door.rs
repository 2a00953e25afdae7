//! Lets calls in by their tokens or certificates, and refuses others before their messages are read.

use std::{
    collections::HashMap,
    num::NonZeroU32,
    path::{Path, PathBuf},
    sync::{Arc, PoisonError, RwLock},
    time::{Duration, Instant},
};

use http::{HeaderMap, header};

use super::{
    Caller, Identity, Quotas, Scope,
    tokens::{CERTIFICATE, Tokens},
};
use crate::{
    error::{Quota, ServiceError},
    reload::Reloadable,
    sync::{Mutex, locked},
};

/// Decides about calls.
#[derive(Debug)]
pub(crate) struct Door {
    /// `None` if no tokens are known.
    file: Option<PathBuf>,
    tokens: RwLock<Arc<Tokens>>,
    /// Whether certificates name clients.
    takes_certificates: bool,
    /// Of the clients with a quota of calls, by name.
    rates: Mutex<HashMap<Arc<str>, Rate>>,
}

/// The scope that a method needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Need {
    /// Nothing: probes know no secrets.
    Nothing,
    Scope(Scope),
}

fn need(path: &str) -> Need {
    let mut parts = path.trim_start_matches('/').split('/');
    let (service, method) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    Need::Scope(match service {
        "grpc.health.v1.Health" => return Need::Nothing,
        "grasp.v1.GraspService" => Scope::Find,
        "grpc.reflection.v1.ServerReflection" | "grpc.reflection.v1alpha.ServerReflection" => Scope::Read,
        _ if ["Get", "List", "Watch"]
            .iter()
            .any(|verb| method.starts_with(verb)) =>
        {
            Scope::Read
        }
        _ => Scope::Write,
    })
}

impl Door {
    /// Reads the file of tokens, if there is one; the error lists everything that is wrong with it.
    pub(crate) fn open(file: Option<PathBuf>, takes_certificates: bool) -> Result<Self, Vec<String>> {
        let tokens = match &file {
            Some(file) => Tokens::read(file, &Tokens::default())?,
            None => Tokens::default(),
        };
        Ok(Self {
            file,
            tokens: RwLock::new(Arc::new(tokens)),
            takes_certificates,
            rates: Mutex::default(),
        })
    }

    /// The caller of a method, whose certificate has the name `peer` if there is one.
    pub(crate) fn admit(
        &self,
        path: &str,
        headers: &HeaderMap,
        peer: Option<&Arc<str>>,
    ) -> Result<Caller, ServiceError> {
        if self.file.is_none() && !self.takes_certificates {
            return Ok(Caller::default());
        }
        let Need::Scope(scope) = need(path) else {
            return Ok(Caller::default());
        };
        let identity = self.identity(headers, peer)?;
        let name = &identity.name;
        if !identity.scopes.contains(&scope) {
            return Err(ServiceError::TokenLacksScope {
                client: name.to_string(),
                scope: scope.to_string(),
            });
        }
        if let Some(most) = identity.quotas.calls_per_second {
            let mut rates = locked(&self.rates);
            let rate = rates.entry(Arc::clone(name)).or_insert_with(|| Rate::new(most));
            rate.take(most, Instant::now())?;
        }
        Ok(Caller(Some(identity)))
    }

    fn tokens(&self) -> Arc<Tokens> {
        // No code panics while it holds the lock.
        Arc::clone(&self.tokens.read().unwrap_or_else(PoisonError::into_inner))
    }

    fn identity(&self, headers: &HeaderMap, peer: Option<&Arc<str>>) -> Result<Arc<Identity>, ServiceError> {
        let tokens = self.tokens();
        if let Some(secret) = bearer(headers) {
            return tokens
                .of_secret(secret)
                .cloned()
                .ok_or(ServiceError::TokenUnknown);
        }
        let peer = peer.filter(|_| self.takes_certificates);
        let name = peer
            .map(|peer| format!("{CERTIFICATE}{peer}"))
            .ok_or(ServiceError::TokenMissing)?;
        Ok(tokens.named(&name).cloned().unwrap_or_else(|| {
            let quotas = Quotas::default();
            Arc::new(Identity::new(name.into(), Scope::ALL.to_vec(), false, quotas))
        }))
    }
}

/// The secret in a header of the scheme Bearer (RFC 6750).
fn bearer(headers: &HeaderMap) -> Option<&[u8]> {
    const SCHEME: &[u8] = b"bearer ";
    let value = headers.get(header::AUTHORIZATION)?.as_bytes();
    let (scheme, secret) = value.split_at_checked(SCHEME.len())?;
    scheme.eq_ignore_ascii_case(SCHEME).then(|| secret.trim_ascii())
}

impl Reloadable for Door {
    fn subject(&self) -> &'static str {
        "tokens"
    }

    fn files(&self) -> Vec<&Path> {
        self.file.as_deref().into_iter().collect()
    }

    /// Calls from now on are judged by the new tokens; running ones go on.
    fn reload(&self) -> Result<(), Vec<String>> {
        if let Some(file) = &self.file {
            let tokens = Arc::new(Tokens::read(file, &self.tokens())?);
            *self.tokens.write().unwrap_or_else(PoisonError::into_inner) = tokens;
        }
        Ok(())
    }
}

/// A client's calls per second: a bucket that holds as many as one second allows.
#[derive(Debug)]
struct Rate {
    left: f64,
    at: Instant,
}

impl Rate {
    fn new(most: NonZeroU32) -> Self {
        Self {
            left: most.get().into(),
            at: Instant::now(),
        }
    }

    /// Takes a call.
    fn take(&mut self, most: NonZeroU32, now: Instant) -> Result<(), ServiceError> {
        let per_second = f64::from(most.get());
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + passed * per_second).min(per_second);
        self.at = now;
        if self.left < 1.0 {
            return Err(ServiceError::QuotaExceeded {
                quota: Quota::CallsPerSecond,
                maximum: most.get().into(),
                retry_after: Some(Duration::from_secs_f64((1.0 - self.left) / per_second)),
            });
        }
        self.left -= 1.0;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_allows_a_second_s_worth_at_once_and_then_one_after_the_other() {
        let most = NonZeroU32::new(4).unwrap();
        let mut rate = Rate::new(most);
        let start = rate.at;
        let after = |milliseconds| start + Duration::from_millis(milliseconds);
        assert!((0..4).all(|_| rate.take(most, start).is_ok()));
        let Err(ServiceError::QuotaExceeded { retry_after, .. }) = rate.take(most, after(50)) else {
            panic!("the fifth call is one too many");
        };
        assert_eq!(retry_after, Some(Duration::from_millis(200)));
        assert!(rate.take(most, after(251)).is_ok() && rate.take(most, after(252)).is_err());
        // A long pause gives no more than a second's worth.
        assert_eq!(
            (0..9).filter(|_| rate.take(most, after(60_000)).is_ok()).count(),
            4
        );
    }

    #[test]
    fn secrets_come_with_the_scheme_bearer() {
        for (value, secret) in [
            ("Bearer abc", Some("abc")),
            ("bearer  abc ", Some("abc")),
            ("Basic abc", None),
            ("Bearer", None),
            ("abc", None),
        ] {
            let headers = HeaderMap::from_iter([(header::AUTHORIZATION, value.parse().unwrap())]);
            assert_eq!(bearer(&headers), secret.map(str::as_bytes), "{value}");
        }
        assert_eq!(bearer(&HeaderMap::new()), None);
    }
}
