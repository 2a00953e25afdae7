//! The origins of pages that may call.

use std::fmt;

pub(crate) const NEEDED_ORIGINS: &str =
    "none, *, or a list of loopback and origins such as https://game.example, separated by commas";

const LOOPBACK_HOSTS: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];

/// The origins of pages that may call; without any, browsers are not served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WebOrigins {
    /// Every page.
    Any,
    /// Some pages.
    Some {
        /// Pages of the reader's own machine, with any port.
        loopback: bool,
        /// Further origins, in lower case.
        others: Vec<String>,
    },
}

impl WebOrigins {
    /// No page.
    pub const NONE: Self = Self::Some {
        loopback: false,
        others: Vec::new(),
    };

    /// Pages of the reader's own machine.
    pub const LOOPBACK: Self = Self::Some {
        loopback: true,
        others: Vec::new(),
    };

    /// True if a page of this origin, in the form of the header `Origin`, may call.
    pub fn allow(&self, origin: &str) -> bool {
        match self {
            Self::Any => true,
            Self::Some { loopback, others } => {
                let origin = origin.to_ascii_lowercase();
                (*loopback && is_loopback(&origin)) || others.contains(&origin)
            }
        }
    }
}

impl fmt::Display for WebOrigins {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => f.write_str("*"),
            Self::Some { loopback, others } => {
                let mut all: Vec<&str> = others.iter().map(String::as_str).collect();
                if *loopback {
                    all.insert(0, "loopback");
                }
                f.write_str(if all.is_empty() { "none" } else { "" })?;
                f.write_str(&all.join(","))
            }
        }
    }
}

pub(crate) fn parse_origins(text: &str) -> Option<WebOrigins> {
    match text.trim() {
        "none" => return Some(WebOrigins::NONE),
        "*" => return Some(WebOrigins::Any),
        _ => {}
    }
    let (mut loopback, mut others) = (false, Vec::new());
    for entry in text.split(',').map(|entry| entry.trim().to_ascii_lowercase()) {
        if entry == "loopback" {
            loopback = true;
        } else if is_origin(&entry) {
            others.push(entry);
        } else {
            return None;
        }
    }
    Some(WebOrigins::Some { loopback, others })
}

/// True for `scheme://host` and `scheme://host:port` in lower case, as browsers send them (RFC 6454, 6.2), with any scheme.
fn is_origin(text: &str) -> bool {
    let Some((scheme, authority)) = text.split_once("://") else {
        return false;
    };
    let of_scheme = |c: char| c.is_ascii_alphanumeric() || "+-.".contains(c);
    let of_authority = |c: char| c.is_ascii_alphanumeric() || "-._[]:".contains(c);
    scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(of_scheme)
        && !host(authority).is_empty()
        && authority.chars().all(of_authority)
}

fn is_loopback(origin: &str) -> bool {
    origin.split_once("://").is_some_and(|(scheme, authority)| {
        ["http", "https"].contains(&scheme) && LOOPBACK_HOSTS.contains(&host(authority))
    })
}

/// The host of an authority, without its port.
fn host(authority: &str) -> &str {
    match authority.rsplit_once(':') {
        Some((host, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => host,
        _ => authority,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pages_of_the_listed_origins_may_call() {
        let loopback: &[&str] = &[
            "http://localhost",
            "http://localhost:5173",
            "https://LOCALHOST:8443",
            "http://127.0.0.1:80",
            "https://[::1]",
            "http://[::1]:3000",
        ];
        let listed: &[&str] = &["https://game.example", "http://10.0.0.7:8080"];
        let foreign: &[&str] = &[
            "null",
            "",
            "localhost",
            "http://localhost.evil.example",
            "http://localhost:80:evil",
            "http://localhost:80@evil.example",
            "http://[::1].evil.example",
            "ftp://localhost",
            "http://127.0.0.2",
            "http://game.example",
            "https://game.example:444",
            "https://a.game.example",
        ];
        let given = "https://Game.example, http://10.0.0.7:8080";
        for (setting, allowed) in [
            ("none", [false; 3]),
            ("*", [true; 3]),
            ("loopback", [true, false, false]),
            (given, [false, true, false]),
            (&format!("loopback,{given}"), [true, true, false]),
        ] {
            let origins = parse_origins(setting).unwrap();
            for (pages, allowed) in [loopback, listed, foreign].into_iter().zip(allowed) {
                for page in pages {
                    assert_eq!(origins.allow(page), allowed, "{page} by {setting}");
                }
            }
        }
    }

    #[test]
    fn settings_can_be_printed_and_read_again_and_others_are_rejected() {
        for text in [
            "none",
            "*",
            "loopback",
            "loopback,https://a.example,moz-extension://0a-b",
        ] {
            assert_eq!(parse_origins(text).unwrap().to_string(), text);
        }
        for wrong in [
            "",
            "game.example",
            "https://",
            "https://:80",
            "https://a.example/",
            "https://a.example,",
            "*,https://a.example",
            "none,loopback",
            "https://a b",
            "https://*.example",
            "://a",
        ] {
            assert_eq!(parse_origins(wrong), None, "{wrong}");
        }
    }
}
