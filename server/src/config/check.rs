//! Checks of single values.

use std::{fmt, ops::RangeInclusive, path::PathBuf, time::Duration};

use super::Config;
use crate::{
    listen::{ListenAddress, NEEDED_LISTEN},
    tls::TlsFiles,
};

/// Collects the invalid values. Each method reads a key into a value, which has its default before, and writes it back to the key.
pub(super) struct Check(pub Vec<String>);

impl Check {
    pub(super) fn reject(&mut self, key: &str, value: impl fmt::Display, needed: impl fmt::Display) {
        self.0.push(format!("{key} is {value}; it must be {needed}"));
    }

    pub(super) fn number<T: Copy + TryFrom<usize> + Into<usize>>(
        &mut self,
        key: &str,
        raw: &mut Option<u64>,
        value: &mut T,
        range: RangeInclusive<u64>,
    ) {
        if let Some(number) = *raw {
            if !range.contains(&number) {
                self.reject(key, number, format_args!("{} to {}", range.start(), range.end()));
            } else if let Some(number) = usize::try_from(number)
                .ok()
                .and_then(|number| number.try_into().ok())
            {
                *value = number;
            }
        }
        *raw = Some((*value).into() as u64);
    }

    pub(super) fn time(
        &mut self,
        key: &str,
        raw: &mut Option<u64>,
        value: &mut Duration,
        range: RangeInclusive<u64>,
    ) {
        let mut milliseconds = value.as_millis() as usize;
        self.number(key, raw, &mut milliseconds, range);
        *value = Duration::from_millis(milliseconds as u64);
    }

    /// A text that may be absent.
    pub(super) fn optional<T>(
        &mut self,
        key: &str,
        raw: &mut Option<String>,
        value: &mut Option<T>,
        needed: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) {
        if let Some(text) = raw {
            *value = parse(text);
            if value.is_none() {
                self.reject(key, format_args!("{text:?}"), needed);
            }
        }
    }

    /// A path that is not empty. The file or folder itself is opened later.
    pub(super) fn path(
        &mut self,
        key: &str,
        raw: &mut Option<PathBuf>,
        value: &mut Option<PathBuf>,
        kind: &str,
    ) {
        if raw.as_ref().is_some_and(|path| path.as_os_str().is_empty()) {
            self.reject(key, "\"\"", format_args!("{kind}, or absent"));
        }
        value.clone_from(raw);
    }

    /// The files of TLS, which need one another.
    pub(super) fn tls(
        &mut self,
        certificate: Option<PathBuf>,
        key: Option<PathBuf>,
        client_ca: Option<PathBuf>,
    ) -> Option<TlsFiles> {
        match (certificate, key) {
            (Some(certificate), Some(key)) => {
                return Some(TlsFiles {
                    certificate,
                    key,
                    client_ca,
                });
            }
            (Some(_), None) => self.reject("tls_key", "absent", "the file with the key of tls_certificate"),
            (None, Some(_)) => self.reject(
                "tls_certificate",
                "absent",
                "the file with the certificate of tls_key",
            ),
            (None, None) if client_ca.is_some() => {
                let needed = "a file, with tls_key, because certificates of clients (tls_client_ca) need TLS";
                self.reject("tls_certificate", "absent", needed);
            }
            (None, None) => {}
        }
        None
    }

    /// Addresses that other machines may reach need TLS, and a way to know the clients.
    pub(super) fn reachable(&mut self, config: &Config) {
        let public: Vec<String> = config
            .listen
            .iter()
            .filter(|address| !address.is_private())
            .map(ToString::to_string)
            .collect();
        let knows_clients = config.tokens_file.is_some();
        let missing = match &config.tls {
            None => "TLS",
            Some(tls) if tls.client_ca.is_none() && !knows_clients => "knowing its clients",
            Some(_) => return,
        };
        if public.is_empty() || config.insecure_public {
            return;
        }
        self.0.push(format!(
            "listen is {}, which other machines may reach, without {missing}; there must be tls_certificate and tls_key, and tokens_file \
             or tls_client_ca, or only loopback addresses and unix:/PATH, or insecure_public, with which anyone may call there and read \
             along",
            public.join(", "),
        ));
    }

    pub(super) fn addresses(
        &mut self,
        key: &str,
        raw: &mut Option<Vec<String>>,
        value: &mut Vec<ListenAddress>,
    ) {
        if let Some(texts) = raw {
            *value = Vec::new();
            for text in texts.iter() {
                match text.trim().parse() {
                    Ok(address) => value.push(address),
                    Err(_) => self.reject(key, format_args!("{text:?}"), NEEDED_LISTEN),
                }
            }
            if texts.is_empty() {
                self.reject(key, "[]", NEEDED_LISTEN);
            }
        }
        *raw = Some(value.iter().map(ToString::to_string).collect());
    }

    pub(super) fn text<T: fmt::Display>(
        &mut self,
        key: &str,
        raw: &mut Option<String>,
        value: &mut T,
        needed: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) {
        if let Some(text) = raw {
            match parse(text) {
                Some(parsed) => *value = parsed,
                None => self.reject(key, format_args!("{text:?}"), needed),
            }
        }
        *raw = Some(value.to_string());
    }
}
