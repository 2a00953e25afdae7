//! Encodings of text other than UTF-8.

use std::borrow::Cow;

/// Bytes that are examined for the pattern of UTF-16.
const EXAMINED_BYTES: usize = 512;

/// Text as UTF-8, as far as it is text at all, and a warning.
///
/// Removes a byte order mark and turns UTF-16 into UTF-8; other bytes stay as they are. Without a byte order mark, UTF-16 is
/// recognised by the zeros in every other byte, which no other text has.
pub(super) fn decode(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<String>) {
    let (units, unit, is_marked): (_, fn([u8; 2]) -> u16, _) = match bytes {
        [0xEF, 0xBB, 0xBF, text @ ..] => return (Cow::Borrowed(text), None),
        // UTF-32 starts with the same bytes.
        [0xFF, 0xFE, 0, 0, ..] => return (Cow::Borrowed(bytes), None),
        [0xFF, 0xFE, units @ ..] => (units, u16::from_le_bytes, true),
        [0xFE, 0xFF, units @ ..] => (units, u16::from_be_bytes, true),
        _ if is_mostly_ascii(bytes, u16::from_le_bytes) => (bytes, u16::from_le_bytes, false),
        _ if is_mostly_ascii(bytes, u16::from_be_bytes) => (bytes, u16::from_be_bytes, false),
        _ => return (Cow::Borrowed(bytes), None),
    };
    let (pairs, odd) = units.as_chunks();
    // Enough for ASCII, of which nearly all OBJ text consists.
    let mut text = String::with_capacity(pairs.len() + 4);
    let decoded = char::decode_utf16(pairs.iter().map(|&pair| unit(pair)));
    text.extend(decoded.map(|character| character.unwrap_or(char::REPLACEMENT_CHARACTER)));
    if !odd.is_empty() {
        text.push(char::REPLACEMENT_CHARACTER);
    }
    let warning = (!is_marked).then(|| "the text is UTF-16 without a byte order mark".to_owned());
    (Cow::Owned(text.into_bytes()), warning)
}

/// Whether three of four units at the start are printable ASCII or white space.
fn is_mostly_ascii(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> bool {
    let pairs = bytes[..bytes.len().min(EXAMINED_BYTES)].as_chunks().0;
    let is_ascii = |&&pair: &&[u8; 2]| matches!(unit(pair), 0x09..=0x0D | 0x20..=0x7E);
    !pairs.is_empty() && 4 * pairs.iter().filter(is_ascii).count() >= 3 * pairs.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# f\u{fc}r 🙂\nv 0 0 0\n";

    #[test]
    fn reads_utf16_with_and_without_mark() {
        for unit in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = TEXT.encode_utf16().flat_map(unit).collect();
            let marked = [unit(0xFEFF).to_vec(), bytes.clone()].concat();
            assert_eq!(decode(&marked), (Cow::Borrowed(TEXT.as_bytes()), None));
            let (text, warning) = decode(&bytes);
            assert_eq!(text, TEXT.as_bytes());
            assert!(warning.is_some());
            let half = [&bytes[..], &[0]].concat();
            assert_eq!(decode(&half).0, format!("{TEXT}\u{fffd}").as_bytes());
        }
    }

    #[test]
    fn leaves_other_bytes_alone() {
        let others: [&[u8]; 6] = [
            b"",
            b"v",
            b"v 0 0 0\n",
            b"# caf\xE9\n",
            b"\xFF\xFE\0\0v\0\0\0",
            &[0; 100],
        ];
        for bytes in others {
            assert_eq!(decode(bytes).0, bytes);
        }
    }
}
