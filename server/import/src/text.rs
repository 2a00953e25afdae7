//! Lines and words of text, whatever its encoding.

use std::{borrow::Cow, str::FromStr};

use crate::error::ImportError;

/// Bytes that are examined for the pattern of UTF-16.
const EXAMINED_BYTES: usize = 512;

/// Bytes of a word that messages show.
const SHOWN_BYTES: usize = 32;

/// Characters of a name that are read.
const MAX_CHARACTERS: usize = 256;

/// First words of lines that have a meaning in OBJ text with polygons.
const STATEMENTS: [&[u8]; 12] = [
    b"v", b"vt", b"vn", b"vp", b"f", b"p", b"l", b"g", b"o", b"s", b"usemtl", b"mtllib",
];

/// Whether a line that starts with the word is a statement of OBJ.
pub(crate) fn is_statement(word: &[u8]) -> bool {
    STATEMENTS.contains(&word)
}

/// Text without the mark of UTF-8 that some editors put in front of it.
pub(crate) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

/// Text as UTF-8, as far as it is text at all, and a warning.
///
/// Removes a byte order mark and turns UTF-16 into UTF-8; other bytes stay as they are. Without a byte order mark, UTF-16 is
/// recognised by the zeros in every other byte, which no other text has.
pub(crate) fn decode(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<String>) {
    let (units, unit, is_marked): (_, fn([u8; 2]) -> u16, _) = match bytes {
        // UTF-32 starts with the same bytes.
        [0xFF, 0xFE, 0, 0, ..] => return (Cow::Borrowed(bytes), None),
        [0xFF, 0xFE, units @ ..] => (units, u16::from_le_bytes, true),
        [0xFE, 0xFF, units @ ..] => (units, u16::from_be_bytes, true),
        _ if is_mostly_ascii(bytes, u16::from_le_bytes) => (bytes, u16::from_le_bytes, false),
        _ if is_mostly_ascii(bytes, u16::from_be_bytes) => (bytes, u16::from_be_bytes, false),
        _ => return (Cow::Borrowed(without_mark(bytes)), None),
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

/// The lines of OBJ text with their numbers, counted from 1; a backslash at the end of a line continues it on the next.
pub(crate) fn lines(text: &[u8]) -> impl Iterator<Item = (usize, Cow<'_, [u8]>)> {
    let mut plain = (1..).zip(plain_lines(text)).peekable();
    std::iter::from_fn(move || {
        let (number, mut part) = plain.next()?;
        let mut line = Cow::Borrowed(part);
        let mut is_checked = None;
        // Only the new part is examined each time: a line may continue a million times.
        while part.last() == Some(&b'\\') && !has_comment(part) {
            is_checked = is_checked.or_else(|| words(part).next().map(|word| matches!(word, b"v" | b"f")));
            // Where names are not checked, a backslash before a statement belongs to a name, such as a folder of Windows.
            let next_word = plain.peek().and_then(|(_, next)| words(next).next());
            if is_checked != Some(true) && next_word.is_some_and(is_statement) {
                break;
            }
            let joined = line.to_mut();
            joined.pop();
            joined.push(b' ');
            match plain.next() {
                Some((_, next)) => part = next,
                None => break,
            }
            joined.extend_from_slice(part);
        }
        Some((number, line))
    })
}

/// The lines of a text as they are, without their endings.
pub(crate) fn plain_lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = Some(text);
    std::iter::from_fn(move || {
        let (line, after) = cut(rest?);
        rest = after;
        Some(line)
    })
}

/// The first line of a text, and the text after its ending: a line feed, a carriage return, or both in the order of Windows.
pub(crate) fn cut(text: &[u8]) -> (&[u8], Option<&[u8]>) {
    let Some(end) = text.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
        return (text, None);
    };
    let ending = if text[end..].starts_with(b"\r\n") { 2 } else { 1 };
    (&text[..end], Some(&text[end + ending..]))
}

fn has_comment(line: &[u8]) -> bool {
    split_words(line).any(|word| word[0] == b'#')
}

/// The words of a line.
pub(crate) fn split_words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}

/// The words of a line, up to a comment.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    split_words(line).take_while(|word| word[0] != b'#')
}

/// A word for a message: truncated, and with invalid UTF-8 replaced.
pub(crate) fn shown(word: &[u8]) -> String {
    let mut text = String::from_utf8_lossy(&word[..word.len().min(SHOWN_BYTES)]).into_owned();
    if word.len() > SHOWN_BYTES {
        text.push('…');
    }
    text
}

pub(crate) fn parsed<T: FromStr>(word: &[u8]) -> Option<T> {
    str::from_utf8(word).ok()?.parse().ok()
}

/// The finite number that a word on a line stands for.
pub(crate) fn number(line: usize, word: &[u8]) -> Result<f64, ImportError> {
    match parsed::<f64>(word) {
        Some(number) if number.is_finite() => Ok(number),
        Some(_) => Err(not_finite(line, word)),
        None => {
            let what = format!("{:?} is not a number", shown(word));
            Err(ImportError::on_line(line, what))
        }
    }
}

/// The error of a number that is infinite, or makes its vertex so.
pub(crate) fn not_finite(line: usize, word: &[u8]) -> ImportError {
    let what = format!("{:?} is not finite or makes the vertex infinite", shown(word));
    ImportError::on_line(line, what)
}

/// The words of a name in lower case, which end at other characters than letters and digits, and before capitals and numbers.
pub(crate) fn name_words(name: &str) -> Vec<String> {
    let characters: Vec<char> = name.chars().take(MAX_CHARACTERS).collect();
    let mut words: Vec<String> = Vec::new();
    let mut starts_word = true;
    for (place, &character) in characters.iter().enumerate() {
        if !character.is_ascii_alphanumeric() {
            starts_word = true;
            continue;
        }
        if let Some(&before) = place.checked_sub(1).and_then(|before| characters.get(before)) {
            let next_is_lower = characters.get(place + 1).is_some_and(char::is_ascii_lowercase);
            starts_word |= before.is_ascii_digit() != character.is_ascii_digit()
                || before.is_ascii_lowercase() && character.is_ascii_uppercase()
                || before.is_ascii_uppercase() && character.is_ascii_uppercase() && next_is_lower;
        }
        match words.last_mut() {
            Some(word) if !starts_word => word.push(character.to_ascii_lowercase()),
            _ => words.push(character.to_ascii_lowercase().to_string()),
        }
        starts_word = false;
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_numbered_and_continued() {
        let count = 200_000;
        let long = ["\\\n", "1\\\n"].map(|part| format!("f {}v 0 0 0\nend", part.repeat(count)));
        let name = "mtllib C:\\\nv 0 0 0\ng a \\\nb\nvt 0 0\\\n0\nusemtl m\\\nf 1\\\nv 2";
        for (text, expected) in [
            ("a\nb\n\nc".to_owned(), vec![1, 2, 3, 4]),
            ("a\r\nb\r\rc".to_owned(), vec![1, 2, 3, 4]),
            ("f 1\\\r\n2 \\\n3\nnext\\".to_owned(), vec![1, 4]),
            // A backslash in a comment joins nothing.
            (
                "# in C:\\parts\\\nf 1 2 \\\n3 # of C:\\\nv 0 0 0".to_owned(),
                vec![1, 2, 4],
            ),
            // Nor does one of a name before a statement; a face is checked, so that the wrong word will be reported.
            (name.to_owned(), vec![1, 2, 3, 5, 7, 8]),
            (long[0].clone(), vec![1, count + 2]),
            (long[1].clone(), vec![1, count + 2]),
        ] {
            let numbers: Vec<usize> = lines(text.as_bytes()).map(|(number, _)| number).collect();
            assert_eq!(numbers, expected, "{:?}", &text[..text.len().min(80)]);
        }
        let empty = format!("{}v 0", "\\\n".repeat(count));
        let last = lines(empty.as_bytes()).last();
        assert_eq!(last.map(|(number, _)| number), Some(count + 1));
    }
}
