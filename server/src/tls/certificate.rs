//! Facts in certificates: whom they name, and when they expire.

use std::time::{SystemTime, UNIX_EPOCH};

use rustls::pki_types::CertificateDer;
use x509_cert::{
    Certificate,
    der::Decode as _,
    ext::pkix::{SubjectAltName, name::GeneralName},
};

/// Longest name of a certificate's holder, in bytes.
const MAX_NAME: usize = 128;

/// When a certificate expires. The error is why it cannot be read.
pub(super) fn expiry(certificate: &CertificateDer<'_>) -> Result<SystemTime, String> {
    let parsed = Certificate::from_der(certificate);
    let parsed = parsed.map_err(|error| format!("its first certificate cannot be read: {error}"))?;
    let not_after = parsed.tbs_certificate().validity().not_after;
    Ok(UNIX_EPOCH + not_after.to_unix_duration())
}

/// The name of a certificate's holder: the common name of its subject, or else its first alternative name. `None` without one that is
/// short and printable.
pub(super) fn holder(certificate: &CertificateDer<'_>) -> Option<String> {
    let parsed = Certificate::from_der(certificate).ok()?;
    let certificate = parsed.tbs_certificate();
    let common_name = certificate.subject().common_name().ok().flatten();
    let common_name = common_name.map(String::from);
    let name = common_name.filter(|name| !name.is_empty()).or_else(|| {
        let (_, SubjectAltName(names)) = certificate.get_extension().ok()??;
        names.into_iter().find_map(|name| match name {
            GeneralName::DnsName(name)
            | GeneralName::Rfc822Name(name)
            | GeneralName::UniformResourceIdentifier(name) => Some(name.to_string()),
            _ => None,
        })
    });
    name.filter(|name| name.len() <= MAX_NAME && !name.contains(char::is_control))
}
