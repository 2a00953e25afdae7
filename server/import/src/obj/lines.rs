//! Lines and words of OBJ text.

use std::borrow::Cow;

/// First words of lines that have a meaning in OBJ text with polygons.
const STATEMENTS: [&[u8]; 12] = [
    b"v", b"vt", b"vn", b"vp", b"f", b"p", b"l", b"g", b"o", b"s", b"usemtl", b"mtllib",
];

/// Whether a line that starts with the word is a statement of OBJ.
pub(crate) fn is_statement(word: &[u8]) -> bool {
    STATEMENTS.contains(&word)
}

/// The lines of a text with their numbers; a backslash at the end of a line continues it on the next.
///
/// A line ends with a line feed, a carriage return, or both in this order.
#[derive(Debug)]
pub(crate) struct Lines<'a> {
    rest: Option<&'a [u8]>,
    number: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn of(text: &'a [u8]) -> Self {
        Self {
            rest: Some(text),
            number: 0,
        }
    }

    fn physical(&mut self) -> Option<&'a [u8]> {
        let (line, rest) = cut(self.rest?);
        self.number += 1;
        self.rest = rest;
        Some(line)
    }
}

impl<'a> Iterator for Lines<'a> {
    /// The number of the (first) line, counted from 1, and its text.
    type Item = (usize, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut part = self.physical()?;
        let number = self.number;
        let mut line = Cow::Borrowed(part);
        let mut is_checked = None;
        // Only the new part is examined each time: a line may continue a million times.
        while part.last() == Some(&b'\\') && !has_comment(part) {
            is_checked = is_checked.or_else(|| words(part).next().map(|word| matches!(word, b"v" | b"f")));
            let following = self.rest.map(|rest| cut(rest).0);
            if !continues(is_checked.unwrap_or(false), following) {
                break;
            }
            let joined = line.to_mut();
            joined.pop();
            joined.push(b' ');
            match self.physical() {
                Some(next) => part = next,
                None => break,
            }
            joined.extend_from_slice(part);
        }
        Some((number, line))
    }
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

/// The first line of a text, and the text after its ending.
pub(crate) fn cut(text: &[u8]) -> (&[u8], Option<&[u8]>) {
    let Some(end) = text.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
        return (text, None);
    };
    let ending = if text[end..].starts_with(b"\r\n") { 2 } else { 1 };
    (&text[..end], Some(&text[end + ending..]))
}

/// Whether a backslash at the end of a line continues it. It does not in a comment.
///
/// Nor does it where names and values are not checked and the next line is a statement of its own: the backslash then
/// belongs to a name, such as a folder of Windows, and continuing would drop the statement.
fn continues(is_checked: bool, following: Option<&[u8]>) -> bool {
    is_checked || !following.is_some_and(|next| words(next).next().is_some_and(is_statement))
}

fn has_comment(line: &[u8]) -> bool {
    line.split(u8::is_ascii_whitespace)
        .any(|word| word.first() == Some(&b'#'))
}

/// The words of a line, up to a comment.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
        .take_while(|word| word[0] != b'#')
}

/// A word for a message: truncated, and with invalid UTF-8 replaced.
pub(crate) fn shown(word: &[u8]) -> String {
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
    fn backslash_in_comment_joins_nothing() {
        for ending in ["\n", "\r", "\r\n"] {
            let text = ["# in C:\\parts\\", "f 1 2 \\", "3 # of C:\\", "v 0 0 0"].join(ending);
            let lines = numbered(&text);
            let expected = [(1, "# in C:\\parts\\"), (2, "f 1 2  3 # of C:\\"), (4, "v 0 0 0")];
            assert_eq!(lines, expected.map(|(n, text)| (n, text.to_owned())));
        }
    }

    #[test]
    fn backslash_of_name_does_not_swallow_next_statement() {
        let lines = numbered("mtllib C:\\\nv 0 0 0\ng a \\\nb\nvt 0 0\\\n0\nusemtl m\\\nf 1\\\nv 2");
        let expected = [
            (1, "mtllib C:\\"),
            (2, "v 0 0 0"),
            (3, "g a  b"),
            (5, "vt 0 0 0"),
            (7, "usemtl m\\"),
            // A face is checked: the wrong word will be reported.
            (8, "f 1 v 2"),
        ];
        assert_eq!(lines, expected.map(|(n, text)| (n, text.to_owned())));
    }

    #[test]
    fn line_may_continue_many_times() {
        let count = 200_000;
        for part in ["\\\n", "1\\\n"] {
            let lines = numbered(&format!("f {}v 0 0 0", part.repeat(count)));
            assert_eq!(lines.len(), 1);
            let empty = numbered(&format!("{}v 0 0 0", part.repeat(count)));
            assert_eq!(empty.last(), Some(&(count + 1, "v 0 0 0".to_owned())));
        }
    }

    #[test]
    fn words_end_at_comment() {
        let found: Vec<&[u8]> = words(b"\tv 1  2 # 3 4").collect();
        assert_eq!(found, [b"v".as_slice(), b"1", b"2"]);
        assert_eq!(words(b"#v 1").count(), 0);
    }
}
