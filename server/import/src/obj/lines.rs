//! Lines and words of OBJ text.

use std::borrow::Cow;

/// The lines of a text with their numbers; a backslash at the end of a line continues it on the next.
///
/// A line ends with a line feed, a carriage return, or both in this order.
#[derive(Debug)]
pub(super) struct Lines<'a> {
    rest: Option<&'a [u8]>,
    number: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn of(text: &'a [u8]) -> Self {
        const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";
        Self {
            rest: Some(text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text)),
            number: 0,
        }
    }

    fn physical(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest?;
        self.number += 1;
        let Some(end) = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
            self.rest = None;
            return Some(rest);
        };
        let ending = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        self.rest = Some(&rest[end + ending..]);
        Some(&rest[..end])
    }
}

impl<'a> Iterator for Lines<'a> {
    /// The number of the (first) line, counted from 1, and its text.
    type Item = (usize, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut line = Cow::Borrowed(self.physical()?);
        let number = self.number;
        while line.last() == Some(&b'\\') {
            let joined = line.to_mut();
            joined.pop();
            joined.push(b' ');
            match self.physical() {
                Some(next) => joined.extend_from_slice(next),
                None => break,
            }
        }
        Some((number, line))
    }
}

/// The words of a line, up to a comment.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
        .take_while(|word| word[0] != b'#')
}

/// A word for a message: truncated, and with invalid UTF-8 replaced.
pub(super) fn shown(word: &[u8]) -> String {
    const SHOWN_BYTES: usize = 32;
    let cut = &word[..word.len().min(SHOWN_BYTES)];
    let mut text = String::from_utf8_lossy(cut).into_owned();
    if word.len() > SHOWN_BYTES {
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(text: &str) -> Vec<(usize, String)> {
        Lines::of(text.as_bytes())
            .map(|(number, line)| (number, String::from_utf8(line.into_owned()).unwrap()))
            .collect()
    }

    #[test]
    fn each_line_ending_counts_once() {
        let expected = [(1, "a"), (2, "b"), (3, ""), (4, "c")].map(|(n, text)| (n, text.to_owned()));
        assert_eq!(numbered("a\nb\n\nc"), expected);
        assert_eq!(numbered("a\r\nb\r\n\r\nc"), expected);
        assert_eq!(numbered("a\rb\r\rc"), expected);
    }

    #[test]
    fn backslash_joins_lines_under_the_first_number() {
        let joined = numbered("f 1\\\r\n2 \\\n3\nnext\\");
        assert_eq!(joined, [(1, "f 1 2  3".to_owned()), (4, "next ".to_owned())]);
    }

    #[test]
    fn words_end_at_comment() {
        let found: Vec<&[u8]> = words(b"\tv 1  2 # 3 4").collect();
        assert_eq!(found, [b"v".as_slice(), b"1", b"2"]);
        assert_eq!(words(b"#v 1").count(), 0);
    }
}
