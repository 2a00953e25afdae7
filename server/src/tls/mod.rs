//! TLS: certificates from files, which are read again when they change, and streams whose handshake blocks nobody.

mod certificate;
mod stream;
mod unverified;

use std::{
    path::{Path, PathBuf},
    sync::{Arc, PoisonError, RwLock},
    time::{Duration, SystemTime},
};

use rustls::{
    Error as RustlsError, InconsistentKeys, RootCertStore, ServerConfig,
    crypto::{CryptoProvider, ring},
    pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject as _},
    server::{WebPkiClientVerifier, danger::ClientCertVerifier},
};
use uuid::Uuid;

use self::certificate::expiry;
pub(crate) use self::{
    stream::{PeerName, TlsStream},
    unverified::unverified_server,
};
use crate::reload::Reloadable;

/// Protocols that a client chooses from in its handshake.
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// A certificate that expires sooner than this is worth a warning.
const RENEWAL_TIME: Duration = Duration::from_hours(30 * 24);

const DAY: Duration = Duration::from_hours(24);

/// The files that TLS needs, in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The server's certificate, followed by those between it and its authority.
    pub certificate: PathBuf,
    /// The key of the server's certificate.
    pub key: PathBuf,
    /// Certificates of the authorities whose clients are known by their certificates. `None` if no client has one.
    pub client_ca: Option<PathBuf>,
}

/// The certificates in force.
#[derive(Debug)]
pub(crate) struct Tls {
    files: TlsFiles,
    current: RwLock<Current>,
}

#[derive(Clone, Debug)]
struct Current {
    config: Arc<ServerConfig>,
    /// When the server's certificate expires.
    expires: SystemTime,
}

impl Tls {
    /// Reads the files; the error lists everything that is wrong with them.
    pub(crate) fn open(files: TlsFiles) -> Result<Self, Vec<String>> {
        Ok(Self {
            current: RwLock::new(load(&files)?),
            files,
        })
    }

    /// The settings of a new connection.
    pub(crate) fn config(&self) -> Arc<ServerConfig> {
        self.current().config
    }

    fn current(&self) -> Current {
        // No code panics while it holds the lock.
        self.current
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Reloadable for Tls {
    fn subject(&self) -> &'static str {
        "certificates"
    }

    fn files(&self) -> Vec<&Path> {
        let files = &self.files;
        let required = [&*files.certificate, &*files.key];
        required.into_iter().chain(files.client_ca.as_deref()).collect()
    }

    /// Connections from now on use the new certificates.
    fn reload(&self) -> Result<(), Vec<String>> {
        let loaded = load(&self.files)?;
        *self.current.write().unwrap_or_else(PoisonError::into_inner) = loaded;
        Ok(())
    }

    /// Warns if the certificate has expired, or will soon.
    fn remind(&self) {
        let certificate = self.files.certificate.display();
        match self.current().expires.duration_since(SystemTime::now()) {
            Err(_) => tracing::warn!(%certificate, "the certificate has expired: clients will refuse it"),
            Ok(left) if left < RENEWAL_TIME => {
                let days_left = left.as_secs() / DAY.as_secs();
                tracing::warn!(%certificate, days_left, "the certificate expires soon");
            }
            Ok(_) => {}
        }
    }
}

/// The cryptography of every connection, whatever else the program links.
pub(crate) fn provider() -> Arc<CryptoProvider> {
    Arc::new(ring::default_provider())
}

/// Bytes that nobody can guess. `None` if the system has no randomness.
pub(crate) fn random_bytes<const N: usize>() -> Option<[u8; N]> {
    let mut bytes = [0; N];
    provider().secure_random.fill(&mut bytes).ok()?;
    Some(bytes)
}

/// An id that nobody can guess, and that no other server has.
///
/// # Panics
/// The system has no randomness.
pub(crate) fn random_id() -> Uuid {
    let bytes = random_bytes().expect("the system has randomness");
    uuid::Builder::from_random_bytes(bytes).into_uuid()
}

fn load(files: &TlsFiles) -> Result<Current, Vec<String>> {
    let mut problems = Vec::new();
    let chain = certificates("tls_certificate", &files.certificate, &mut problems);
    let leaf = chain.first().map(|leaf| expiry(leaf));
    if let Some(Err(reason)) = &leaf {
        problems.push(wrong("tls_certificate", &files.certificate, reason));
    }
    let key = PrivateKeyDer::from_pem_file(&files.key).map_err(|reason| {
        let needed = format!("it must be a file with a private key in PEM: {reason}");
        problems.push(wrong("tls_key", &files.key, needed));
    });
    let clients = files.client_ca.as_ref().map(|path| {
        let authorities = certificates("tls_client_ca", path, &mut problems);
        if authorities.is_empty() {
            return Err(());
        }
        let verifier = client_verifier(authorities);
        verifier.map_err(|reason| problems.push(wrong("tls_client_ca", path, reason)))
    });
    let builder = ServerConfig::builder_with_provider(provider())
        .with_safe_default_protocol_versions()
        .map_err(|error| vec![format!("TLS is not available: {error}")])?;
    let (Ok(key), Ok(clients), Some(Ok(expires)), []) = (key, clients.transpose(), leaf, &*problems) else {
        return Err(problems);
    };
    let builder = match clients {
        Some(verifier) => builder.with_client_cert_verifier(verifier),
        None => builder.with_no_client_auth(),
    };
    let mut config = builder.with_single_cert(chain, key).map_err(|error| {
        vec![match error {
            RustlsError::InconsistentKeys(InconsistentKeys::KeyMismatch) => {
                let certificate = files.certificate.display();
                wrong(
                    "tls_key",
                    &files.key,
                    format!("it must be the key of tls_certificate, {certificate}"),
                )
            }
            error => wrong(
                "tls_certificate",
                &files.certificate,
                format!("it cannot be used: {error}"),
            ),
        }]
    })?;
    config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).to_vec();
    Ok(Current {
        config: Arc::new(config),
        expires,
    })
}

fn wrong(key: &str, path: &Path, reason: impl std::fmt::Display) -> String {
    format!("{key} is {}; {reason}", path.display())
}

/// The certificates in a file, at least one unless there is a problem.
fn certificates(key: &str, path: &Path, problems: &mut Vec<String>) -> Vec<CertificateDer<'static>> {
    let read = CertificateDer::pem_file_iter(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let reason = match read {
        Ok(read) if !read.is_empty() => return read,
        Ok(_) => "it has none".to_owned(),
        Err(reason) => reason.to_string(),
    };
    let needed = format!("it must be a file with one or more certificates in PEM: {reason}");
    problems.push(wrong(key, path, needed));
    Vec::new()
}

/// Verifies certificates of clients that send one. Calls of those that send none are judged by their tokens.
fn client_verifier(authorities: Vec<CertificateDer<'static>>) -> Result<Arc<dyn ClientCertVerifier>, String> {
    let mut roots = RootCertStore::empty();
    for authority in authorities {
        roots
            .add(authority)
            .map_err(|error| format!("one of its certificates is wrong: {error}"))?;
    }
    let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider());
    let verifier = verifier.allow_unauthenticated().build();
    verifier.map_err(|error| format!("it cannot be used: {error}"))
}
