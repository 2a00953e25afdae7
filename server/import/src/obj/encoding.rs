//! Encodings of text other than UTF-8.

use std::borrow::Cow;

/// Bytes that are examined for the pattern of UTF-16.
const EXAMINED_BYTES: usize = 512;

/// Text as UTF-8, as far as it is text at all.
#[derive(Debug)]
pub(super) struct Decoded<'a> {
    pub(super) text: Cow<'a, [u8]>,
    pub(super) warning: Option<String>,
}

/// Removes a byte order mark and turns UTF-16 into UTF-8; other bytes stay as they are.
///
/// Without a byte order mark, UTF-16 is recognised by the zeros in every other byte, which no other text has.
pub(super) fn decode(bytes: &[u8]) -> Decoded<'_> {
    if let Some(text) = bytes.strip_prefix(b"\xEF\xBB\xBF") {
        return Decoded {
            text: Cow::Borrowed(text),
            warning: None,
        };
    }
    // UTF-32 starts with the same bytes.
    if let Some(units) = bytes.strip_prefix(b"\xFF\xFE")
        && !units.starts_with(&[0, 0])
    {
        return utf16(units, u16::from_le_bytes, None);
    }
    if let Some(units) = bytes.strip_prefix(b"\xFE\xFF") {
        return utf16(units, u16::from_be_bytes, None);
    }
    let warning = || Some("the text is UTF-16 without a byte order mark".to_owned());
    if is_mostly_ascii(bytes, u16::from_le_bytes) {
        utf16(bytes, u16::from_le_bytes, warning())
    } else if is_mostly_ascii(bytes, u16::from_be_bytes) {
        utf16(bytes, u16::from_be_bytes, warning())
    } else {
        Decoded {
            text: Cow::Borrowed(bytes),
            warning: None,
        }
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16, warning: Option<String>) -> Decoded<'static> {
    let (pairs, odd) = bytes.as_chunks();
    let units = pairs.iter().map(|&pair| unit(pair));
    // Enough for ASCII, of which nearly all OBJ text consists.
    let mut text = String::with_capacity(pairs.len() + 4);
    text.extend(char::decode_utf16(units).map(|decoded| decoded.unwrap_or(char::REPLACEMENT_CHARACTER)));
    if !odd.is_empty() {
        text.push(char::REPLACEMENT_CHARACTER);
    }
    Decoded {
        text: Cow::Owned(text.into_bytes()),
        warning,
    }
}

/// Whether three of four units at the start are printable ASCII or white space.
fn is_mostly_ascii(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> bool {
    let pairs = bytes[..bytes.len().min(EXAMINED_BYTES)].as_chunks().0;
    let ascii = pairs
        .iter()
        .filter(|&&pair| matches!(unit(pair), 0x09..=0x0D | 0x20..=0x7E))
        .count();
    !pairs.is_empty() && 4 * ascii >= 3 * pairs.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# f\u{fc}r 🙂\nv 0 0 0\n";

    fn encoded(unit: fn(u16) -> [u8; 2]) -> Vec<u8> {
        TEXT.encode_utf16().flat_map(unit).collect()
    }

    #[test]
    fn reads_utf16_with_and_without_mark() {
        for unit in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes = encoded(unit);
            let marked = [unit(0xFEFF).to_vec(), bytes.clone()].concat();
            let decoded = decode(&marked);
            assert_eq!(decoded.text, TEXT.as_bytes());
            assert_eq!(decoded.warning, None);
            let decoded = decode(&bytes);
            assert_eq!(decoded.text, TEXT.as_bytes());
            assert!(decoded.warning.is_some());
        }
    }

    #[test]
    fn leaves_other_bytes_alone() {
        for bytes in [
            b"".as_slice(),
            b"v",
            b"v 0 0 0\n",
            b"# caf\xE9\n",
            b"\xFF\xFE\0\0v\0\0\0",
            b"\0\0\xFE\xFF\0\0\0v",
            &[0; 100],
        ] {
            assert_eq!(decode(bytes).text, bytes);
        }
    }

    #[test]
    fn half_a_unit_stays_visible() {
        let mut bytes = encoded(u16::to_le_bytes);
        bytes.push(b'v');
        assert_eq!(decode(&bytes).text, format!("{TEXT}\u{fffd}").as_bytes());
    }
}
