//! Checks the labels of objects, and reads filters on them.

use std::collections::BTreeMap;

use super::{Field, quoted};

/// Labels by key.
pub(crate) type Labels = BTreeMap<String, String>;

/// Largest number of labels of an object.
const MAX_LABELS: usize = 16;

/// Largest number of characters in a key.
const MAX_KEY_LENGTH: usize = 63;

/// Largest number of bytes in a value.
const MAX_VALUE: usize = 63;

/// Largest number of bytes in a filter.
const MAX_FILTER: usize = 4096;

/// Largest number of terms in a filter.
const MAX_TERMS: usize = MAX_LABELS;

/// Checks labels.
pub(super) fn labels(field: Field<'_>, labels: &Labels) {
    if labels.len() > MAX_LABELS {
        field.add(format_args!(
            "has {} labels; the limit is {MAX_LABELS}",
            labels.len()
        ));
    }
    for (key, value) in labels {
        if !(1..=MAX_KEY_LENGTH).contains(&key.len()) || !key.chars().all(is_key_character) {
            field.add(format_args!(
                "has the key {}; it must be 1 to {MAX_KEY_LENGTH} of a-z, 0-9, -, _, . and /",
                quoted(key)
            ));
        }
        if value.len() > MAX_VALUE || value.chars().any(char::is_control) {
            field.add(format_args!(
                "has the value {} of {}; it must be at most {MAX_VALUE} bytes without control characters",
                quoted(value),
                quoted(key)
            ));
        }
    }
}

fn is_key_character(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '-' | '_' | '.' | '/')
}

/// What the labels of listed objects must have; without terms, all objects are listed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LabelFilter(Vec<Term>);

/// One requirement.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Term {
    key: String,
    /// The value; none if any will do.
    value: Option<String>,
}

impl LabelFilter {
    /// True if the labels meet every term.
    pub(crate) fn matches(&self, labels: &Labels) -> bool {
        self.0
            .iter()
            .all(|term| match (labels.get(&term.key), &term.value) {
                (Some(value), Some(required)) => value == required,
                (Some(_), None) => true,
                (None, _) => false,
            })
    }
}

/// Reads a filter: `key` or `key=value`, joined by `AND`.
pub(super) fn label_filter(field: Field<'_>, text: &str) -> LabelFilter {
    if text.len() > MAX_FILTER {
        field.add(format_args!(
            "has {} bytes; the limit is {MAX_FILTER}",
            text.len()
        ));
        return LabelFilter::default();
    }
    let mut parser = Parser { text, rest: text };
    match parser.filter() {
        Ok(terms) => LabelFilter(terms),
        Err(expected) => {
            let character = parser.text.chars().count() - parser.rest.chars().count() + 1;
            let found = match parser.rest {
                "" => "its end".to_owned(),
                rest => quoted(rest),
            };
            field.add(format_args!(
                "has {found} at character {character}, where {expected}"
            ));
            LabelFilter::default()
        }
    }
}

/// Reads a filter from left to right. Errors say what must be at the start of `rest`.
struct Parser<'a> {
    text: &'a str,
    rest: &'a str,
}

impl<'a> Parser<'a> {
    fn filter(&mut self) -> Result<Vec<Term>, String> {
        let mut terms = Vec::new();
        self.skip_spaces();
        if self.rest.is_empty() {
            return Ok(terms);
        }
        loop {
            if terms.len() == MAX_TERMS {
                return Err(format!("it must end: the limit is {MAX_TERMS} terms"));
            }
            terms.push(self.term()?);
            let is_separated = self.skip_spaces();
            if self.rest.is_empty() {
                return Ok(terms);
            }
            match self.rest.strip_prefix("AND") {
                Some(rest) if is_separated && (rest.is_empty() || rest.starts_with(' ')) => self.rest = rest,
                _ => return Err("AND, between spaces, or the end must be".to_owned()),
            }
            self.skip_spaces();
        }
    }

    fn term(&mut self) -> Result<Term, String> {
        let key = self.take_while(is_key_character);
        if !(1..=MAX_KEY_LENGTH).contains(&key.len()) {
            // Points at the key itself.
            self.rest = &self.text[self.text.len() - self.rest.len() - key.len()..];
            return Err(format!(
                "a key of 1 to {MAX_KEY_LENGTH} of a-z, 0-9, -, _, . and / must be"
            ));
        }
        let after_key = self.rest;
        self.skip_spaces();
        let value = if let Some(rest) = self.rest.strip_prefix('=') {
            self.rest = rest;
            self.skip_spaces();
            Some(self.value()?)
        } else {
            self.rest = after_key;
            None
        };
        Ok(Term {
            key: key.to_owned(),
            value,
        })
    }

    fn value(&mut self) -> Result<String, String> {
        if let Some(rest) = self.rest.strip_prefix('"') {
            return self.quoted_value(rest);
        }
        let word =
            self.take_while(|c| !c.is_whitespace() && !c.is_control() && !matches!(c, '"' | '=' | '\\'));
        if word.is_empty() {
            return Err("a value must be, in quotes unless it is one word".to_owned());
        }
        Ok(word.to_owned())
    }

    fn quoted_value(&mut self, after_quote: &'a str) -> Result<String, String> {
        let mut value = String::new();
        let mut characters = after_quote.chars();
        loop {
            match characters.next() {
                Some('"') => break,
                Some('\\') => match characters.next() {
                    Some(escaped @ ('"' | '\\')) => value.push(escaped),
                    _ => return Err("a value must be in whose quotes \\ is followed by \\ or \"".to_owned()),
                },
                Some(c) => value.push(c),
                None => return Err("a value must be that ends with a quote".to_owned()),
            }
        }
        self.rest = characters.as_str();
        Ok(value)
    }

    fn take_while(&mut self, is_part: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(|c| !is_part(c)).unwrap_or(self.rest.len());
        let (part, rest) = self.rest.split_at(end);
        self.rest = rest;
        part
    }

    /// True if there were any.
    fn skip_spaces(&mut self) -> bool {
        !self.take_while(|c| c == ' ').is_empty()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::validate::{Violations, testing::read_at};

    fn of(pairs: &[(&str, &str)]) -> Labels {
        let owned = pairs
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
        owned.collect()
    }

    fn read(text: &str) -> Result<LabelFilter, String> {
        let violations = Violations::default();
        let filter = label_filter(violations.field("filter"), text);
        match violations.into_listed().pop() {
            None => Ok(filter),
            Some(violation) => Err(violation.description),
        }
    }

    #[test]
    fn accepts_labels_within_the_bounds_and_names_others() {
        let check = |checked: &Labels| read_at("labels", |field| labels(field, checked)).1.len();
        let longest = ("k".repeat(63), "v".repeat(63));
        assert_eq!(
            check(&of(&[
                (&longest.0, &longest.1),
                ("a/b_c.d-9", ""),
                ("owner", "Ada Ł.")
            ])),
            0
        );
        for (key, value) in [
            ("", "v"),
            ("Key", "v"),
            ("k y", "v"),
            ("k", "a\nb"),
            (&"k".repeat(64), "v"),
            ("k", &"é".repeat(32)),
        ] {
            assert_eq!(check(&of(&[(key, value)])), 1, "{key}={value}");
        }
        let many: Labels = (0..17).map(|n| (format!("k{n}"), String::new())).collect();
        assert_eq!(check(&many), 1);
    }

    #[test]
    fn every_term_must_match() {
        let kitchen = of(&[("level", "kitchen"), ("owner", "Ada \"A\" L."), ("fragile", "")]);
        for (text, matches) in [
            ("", true),
            ("  ", true),
            ("fragile", true),
            ("level=kitchen", true),
            ("level = kitchen AND  fragile", true),
            ("owner=\"Ada \\\"A\\\" L.\"", true),
            ("fragile=\"\"", true),
            ("level=cellar", false),
            ("level=kitchen AND broken", false),
            ("broken", false),
        ] {
            assert_eq!(read(text).unwrap().matches(&kitchen), matches, "{text}");
        }
    }

    #[test]
    fn errors_name_the_place_and_what_must_be_there() {
        for (text, start) in [
            ("Level=a", "has \"Level=a\" at character 1, where a key"),
            ("a=", "has its end at character 3, where a value"),
            ("a b", "has \"b\" at character 3, where AND"),
            ("a AND", "has its end at character 6, where a key"),
            ("a ANDb", "has \"ANDb\" at character 3, where AND"),
            ("é", "has \"é\" at character 1, where a key"),
            ("a=b=c", "has \"=c\" at character 4, where AND"),
            ("a=\"b", "has \"\\\"b\" at character 3, where a value"),
            ("a OR b", "has \"OR b\" at character 3, where AND"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.starts_with(start), "{text}: {error}");
        }
        assert!(read(&"k AND ".repeat(17)).unwrap_err().contains("16 terms"));
        assert!(read(&" ".repeat(5000)).unwrap_err().contains("4096"));
    }

    proptest! {
        /// A filter made of an object's own labels matches it; one with another value does not.
        #[test]
        fn own_labels_match_however_they_are_written(
            own in proptest::collection::btree_map("[a-z0-9_./-]{1,8}", "[ -~é]{0,12}", 1..6),
        ) {
            let quote = |value: &str| format!("\"{}\"", value.replace('\\', "\\\\").replace('"', "\\\""));
            let terms: Vec<String> = own.iter().map(|(key, value)| format!("{key}={}", quote(value))).collect();
            let filter = read(&terms.join(" AND ")).unwrap();
            prop_assert!(filter.matches(&own));
            let mut other = own.clone();
            other.values_mut().next().unwrap().push('x');
            prop_assert!(!filter.matches(&other));
        }

        #[test]
        fn no_text_panics(text in "[ -~é\\n]{0,40}") {
            let _ = read(&text);
        }
    }
}
