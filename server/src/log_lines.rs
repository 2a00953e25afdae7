//! Keeps every event of the log on one line, whatever clients send.

use std::{
    fmt::Write as _,
    io::{self, Write},
};

/// A writer that escapes the control characters within each event: a client's text, a panic's message or a name that reached the log as
/// it is cannot look like another event, nor control a terminal.
#[derive(Debug)]
pub struct LogLines<W> {
    inner: W,
    has_colours: bool,
}

impl<W: Write> LogLines<W> {
    /// With `has_colours`, escape sequences pass: those of clients are escaped where events are formatted.
    pub fn new(inner: W, has_colours: bool) -> Self {
        Self { inner, has_colours }
    }
}

/// Each call of `write` is an event, with the line's end.
impl<W: Write> Write for LogLines<W> {
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(event);
        let line = text.strip_suffix('\n').unwrap_or(&text);
        let is_escaped = |c: char| c.is_control() && !(self.has_colours && c == '\u{1b}');
        if line.contains(is_escaped) {
            let mut escaped = String::with_capacity(text.len() + 64);
            for c in line.chars() {
                match c {
                    '\n' => escaped.push_str("\\n"),
                    // As JSON has it.
                    c if is_escaped(c) => {
                        let _ = write!(escaped, "\\u{:04x}", u32::from(c));
                    }
                    c => escaped.push(c),
                }
            }
            escaped.push('\n');
            self.inner.write_all(escaped.as_bytes())?;
        } else {
            self.inner.write_all(event)?;
        }
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use tracing_subscriber::{fmt, layer::SubscriberExt as _};

    use super::*;

    #[derive(Clone, Default)]
    struct Log(Arc<Mutex<Vec<u8>>>);

    impl Write for Log {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().extend(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn hostile_texts_stay_on_the_line_of_their_event() {
        let hostile = "a\r\n2026-01-01 ERROR forged\u{1b}[2J\u{9b}31m\u{7}\u{0}\u{7f}é\t\u{2028}\"}\\";
        for is_json in [false, true] {
            let log = Log::default();
            let written = log.clone();
            let layer = fmt::layer()
                .with_ansi(false)
                .with_writer(move || LogLines::new(written.clone(), false));
            let layer: Box<dyn tracing_subscriber::Layer<_> + Send + Sync> = if is_json {
                Box::new(layer.json().flatten_event(true))
            } else {
                Box::new(layer)
            };
            tracing::subscriber::with_default(tracing_subscriber::registry().with(layer), || {
                tracing::warn!(shown = %hostile, text = hostile, debugged = ?hostile, "{hostile}");
                tracing::warn!("the next");
            });
            let text = String::from_utf8(log.0.lock().unwrap().clone()).unwrap();
            assert_eq!(text.lines().count(), 2, "{text}");
            assert!(
                text.contains('é') && !text.replace('\n', "").contains(char::is_control),
                "{text:?}"
            );
            if is_json {
                for line in text.lines() {
                    serde_json::from_str::<serde_json::Value>(line).unwrap();
                }
            }
        }
    }

    #[test]
    fn colours_pass_to_a_terminal() {
        let mut lines = LogLines::new(Vec::new(), true);
        lines.write_all(b"\x1b[32m INFO\x1b[0m a\nb\x07\n").unwrap();
        assert_eq!(lines.inner, b"\x1b[32m INFO\x1b[0m a\\nb\\u0007\n");
    }
}
