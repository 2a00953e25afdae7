//! The file of tokens: each client's name, the hashes of its secrets, and its rights.

use std::{collections::BTreeMap, fs, num::NonZeroU32, path::Path, sync::Arc};

use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use subtle::ConstantTimeEq as _;

use super::{Identity, Scope};
use crate::{tls::random_bytes, wire::hex};

/// Most clients in a file. Each call compares its secret with all of them, which takes microseconds.
const MAX_CLIENTS: usize = 1000;

/// Longest name of a client, in bytes.
const MAX_NAME: usize = 64;

/// Largest quota of searches: as many as a server can be configured to admit.
const MAX_SEARCHES: usize = 256;

/// Start of every secret, by which scanners of leaked secrets know it.
const SECRET_START: &str = "grasp_";

/// Random bytes of a secret.
const SECRET_BYTES: usize = 32;

/// Start of the name of a client with a certificate.
pub(super) const CERTIFICATE: &str = "cert:";

type Hash = [u8; 32];

/// Bounds on a client's use of the server; absent ones are the server's own limits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Quotas {
    /// Calls per second, over a second.
    pub calls_per_second: Option<NonZeroU32>,
    /// Searches, running and waiting.
    pub searches: Option<usize>,
    /// Objects that it owns.
    pub objects: Option<usize>,
    /// Bytes of their mesh files.
    pub bytes: Option<u64>,
}

/// A client as the file has it.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// SHA-256 of its secret, or of several while one replaces another. Absent for a client with a certificate.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    sha256: Vec<String>,
    scopes: Vec<Scope>,
    #[serde(default, skip_serializing_if = "is_false")]
    shared: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    calls_per_second: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    searches: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    objects: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes: Option<u64>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes the field itself")]
fn is_false(value: &bool) -> bool {
    !value
}

/// The clients of a file.
#[derive(Debug, Default)]
pub(crate) struct Tokens {
    by_hash: Vec<(Hash, Arc<Identity>)>,
    by_name: BTreeMap<Arc<str>, Arc<Identity>>,
}

impl Tokens {
    /// Reads a file, whose clients keep the searches that they have in those `before`; the error lists everything that is wrong.
    pub(super) fn read(path: &Path, before: &Self) -> Result<Self, Vec<String>> {
        let wrong = |reason: &dyn std::fmt::Display| format!("tokens_file is {}; {reason}", path.display());
        let text = fs::read_to_string(path)
            .map_err(|error| vec![wrong(&format_args!("it must be a file of tokens: {error}"))])?;
        Self::parse(&text, before).map_err(|problems| problems.iter().map(|problem| wrong(problem)).collect())
    }

    pub(crate) fn parse(text: &str, before: &Self) -> Result<Self, Vec<String>> {
        let entries: BTreeMap<String, Entry> = toml::from_str(text).map_err(|error| {
            // Not the whole error, which quotes a line that may have a secret.
            let before = text
                .get(..error.span().unwrap_or_default().start)
                .unwrap_or_default();
            let line = 1 + before.matches('\n').count();
            vec![format!("line {line}: {}", error.message())]
        })?;
        let mut problems = Vec::new();
        let mut tokens = Self::default();
        if entries.len() > MAX_CLIENTS {
            problems.push(format!(
                "it has {} clients; it must have at most {MAX_CLIENTS}",
                entries.len()
            ));
        }
        for (name, entry) in entries {
            let start = problems.len();
            let (mut identity, hashes) = checked(&name, entry, &mut problems);
            for problem in &mut problems[start..] {
                *problem = format!("[{name:?}] {problem}");
            }
            if let Some(known) = before.by_name.get(&*name) {
                identity.searches = Arc::clone(&known.searches);
            }
            let identity = Arc::new(identity);
            // A certificate with hashes is a problem of its own.
            for hash in hashes.into_iter().filter(|_| !name.starts_with(CERTIFICATE)) {
                if tokens.by_hash.iter().any(|(other, _)| *other == hash) {
                    problems.push(format!(
                        "[{name:?}] sha256 has {}; no other client may have it",
                        hex(&hash)
                    ));
                }
                tokens.by_hash.push((hash, Arc::clone(&identity)));
            }
            tokens.by_name.insert(Arc::clone(&identity.name), identity);
        }
        if problems.is_empty() {
            Ok(tokens)
        } else {
            Err(problems)
        }
    }

    /// The client with this secret. The time that it takes says nothing about the hashes.
    pub(super) fn of_secret(&self, secret: &[u8]) -> Option<&Arc<Identity>> {
        let hash: Hash = Sha256::digest(secret).into();
        let mut found = None;
        for (known, identity) in &self.by_hash {
            if bool::from(known.ct_eq(&hash)) {
                found = Some(identity);
            }
        }
        found
    }

    /// The client with this name, with its prefix if it has a certificate.
    pub(super) fn named(&self, name: &str) -> Option<&Arc<Identity>> {
        self.by_name.get(name)
    }
}

/// A client and its hashes; adds what is wrong with them.
fn checked(name: &str, entry: Entry, problems: &mut Vec<String>) -> (Identity, Vec<Hash>) {
    let is_plain = |text: &str| {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.@".contains(&byte);
        (1..=MAX_NAME).contains(&text.len()) && text.bytes().all(is_plain)
    };
    match (name.strip_prefix(CERTIFICATE), entry.sha256.is_empty()) {
        (None, _) if !is_plain(name) => problems.push(format!(
            "is no name; it must be 1 to {MAX_NAME} ASCII letters, digits, -, _, . and @, or {CERTIFICATE} and the name in a certificate"
        )),
        (None, true) => problems.push("sha256 is absent; it must be a list with the hash of the secret".to_owned()),
        (Some(_), false) => {
            problems.push("sha256 is present; a client with a certificate must have none".to_owned());
        }
        _ => {}
    }
    if entry.scopes.is_empty() {
        problems.push("scopes is []; it must have one or more of find, read and write".to_owned());
    }
    let mut hashes = Vec::new();
    for text in &entry.sha256 {
        match parse_hash(text) {
            Some(hash) => hashes.push(hash),
            // Not the text, which may be a secret.
            None => problems.push(format!(
                "sha256 has a text of {} characters; each must be 64 hexadecimal digits",
                text.chars().count()
            )),
        }
    }
    if entry.calls_per_second == Some(0) {
        problems.push("calls_per_second is 0; it must be more, or absent".to_owned());
    }
    if let Some(searches) = entry
        .searches
        .filter(|searches| !(1..=MAX_SEARCHES).contains(searches))
    {
        problems.push(format!(
            "searches is {searches}; it must be 1 to {MAX_SEARCHES}, or absent"
        ));
    }
    if entry.shared && (entry.objects.is_some() || entry.bytes.is_some()) {
        let needed = "it must be false with a quota of objects or bytes, which counts what the client owns";
        problems.push(format!("shared is true; {needed}"));
    }
    let quotas = Quotas {
        calls_per_second: entry.calls_per_second.and_then(NonZeroU32::new),
        searches: entry.searches,
        objects: entry.objects,
        bytes: entry.bytes,
    };
    let identity = Identity::new(name.into(), entry.scopes, entry.shared, quotas);
    (identity, hashes)
}

fn parse_hash(text: &str) -> Option<Hash> {
    let mut hash = Hash::default();
    let digits = text.as_bytes();
    if digits.len() != 2 * hash.len() || !digits.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    for (byte, digits) in hash.iter_mut().zip(digits.chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    }
    Some(hash)
}

/// A new secret, and the entry for it in the file of tokens, which does not tell the secret.
///
/// # Errors
/// Says in words why the name is none, or that the system has no randomness.
pub fn new_token(name: &str) -> Result<(String, String), String> {
    let random = random_bytes::<SECRET_BYTES>().ok_or("the system has no randomness")?;
    let secret = format!("{SECRET_START}{}", URL_SAFE_NO_PAD.encode(random));
    let entry = Entry {
        sha256: vec![hex(&Sha256::digest(&secret))],
        scopes: Scope::ALL.to_vec(),
        shared: false,
        calls_per_second: None,
        searches: None,
        objects: None,
        bytes: None,
    };
    let text = toml::to_string(&BTreeMap::from([(name, entry)])).map_err(|error| error.to_string())?;
    Tokens::parse(&text, &Tokens::default()).map_err(|problems| problems.join("\n"))?;
    Ok((secret, text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Caller;

    fn parse(text: &str) -> Result<Tokens, Vec<String>> {
        Tokens::parse(text, &Tokens::default())
    }

    #[test]
    fn searches_count_for_the_quota_after_the_file_was_read_again() {
        let tokens = |most: usize, before: &Tokens| {
            let hash = "0a".repeat(32);
            let text = format!("[a]\nsha256 = ['{hash}']\nscopes = ['find']\nsearches = {most}");
            Tokens::parse(&text, before).unwrap()
        };
        let caller = |of: &Tokens| Caller(of.named("a").cloned());
        let before = tokens(2, &Tokens::default());
        let running = [caller(&before).take_search(), caller(&before).take_search()];
        assert!(running.iter().all(Result::is_ok) && caller(&before).take_search().is_err());
        let after = tokens(3, &before);
        let third = caller(&after).take_search().unwrap();
        assert!(caller(&after).take_search().is_err());
        drop((running, third));
        assert!(
            (0..3)
                .map(|_| caller(&after).take_search())
                .collect::<Vec<_>>()
                .iter()
                .all(Result::is_ok)
        );
    }

    #[test]
    fn a_new_token_is_known_by_its_secret_and_by_no_other() {
        let (secret, entry) = new_token("studio.7").unwrap();
        assert!(!entry.contains(&secret), "{entry}");
        let (other, _) = new_token("studio.7").unwrap();
        let tokens = parse(&entry).unwrap();
        let found = tokens.of_secret(secret.as_bytes()).unwrap();
        assert_eq!((&*found.name, &*found.scopes), ("studio.7", &Scope::ALL[..]));
        for wrong in [&*other, "", &secret[..secret.len() - 1], &format!("{secret} ")] {
            assert!(tokens.of_secret(wrong.as_bytes()).is_none(), "{wrong:?}");
        }
        assert!(new_token("a b").unwrap_err().contains("is no name"));
    }

    #[test]
    fn everything_wrong_with_the_file_is_listed_at_once() {
        let hash = "0a".repeat(32);
        let text = format!(
            "[a]\nsha256 = ['{hash}']\nscopes = ['find']\nsearches = 0\n\
             ['b c']\nsha256 = ['12']\nscopes = []\n\
             ['cert:d']\nsha256 = ['{hash}']\nscopes = ['read']\n\
             [e]\nscopes = ['read']\nshared = true\nobjects = 5\n\
             [f]\nsha256 = ['{hash}']\nscopes = ['write']"
        );
        let problems = parse(&text).unwrap_err();
        let parts = [
            "[\"a\"] searches is 0",
            "[\"b c\"] is no name",
            "[\"b c\"] scopes is []",
            "[\"b c\"] sha256 has a text of 2 characters",
            "[\"cert:d\"] sha256 is present",
            "[\"e\"] sha256 is absent",
            "[\"e\"] shared is true",
            "[\"f\"] sha256 has 0a0a",
        ];
        for part in parts {
            assert!(
                problems.iter().any(|problem| problem.starts_with(part)),
                "{part}: {problems:?}"
            );
        }
        assert_eq!(problems.len(), parts.len(), "{problems:?}");
        for wrong in [
            "[a]\nscopes = ['all']",
            "[a]\nsecret = 'abc'",
            "[a]\nsecret = 'abc",
            "[a]\nscopes = []\n[a]",
        ] {
            let [problem] = &parse(wrong).unwrap_err()[..] else {
                panic!("{wrong} has one problem");
            };
            assert!(
                problem.starts_with("line ") && !problem.contains("abc"),
                "{problem}"
            );
        }
    }
}
