//! Bytes that are no mesh are named for what they are.

use crate::{Import, ImportError, read_mesh};

use crate::tests::obj::{CUBE, LIMITS};

/// The message for bytes that are rejected.
fn message(bytes: &[u8]) -> String {
    let errors = read_mesh(bytes, Import::METRES, LIMITS).expect_err("must be rejected");
    assert!(
        matches!(errors[..], [ImportError::NotAMesh { .. }]),
        "{errors:?} for {:?}",
        String::from_utf8_lossy(bytes)
    );
    errors[0].to_string()
}

#[test]
fn names_formats_by_their_marks() {
    let cases: [(&[u8], &str); 12] = [
        (b"\n [1, 2, 3]", "JSON"),
        (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF"),
        (b"Kaydara FBX Binary  \0\x1a\0", "FBX"),
        (b"<!DOCTYPE html><html><body>404 Not found</body></html>", "HTML"),
        (b"\xEF\xBB\xBF<HTML>\n<BODY>Sign in</BODY>", "HTML"),
        (
            b"<?xml version=\"1.0\"?>\n<COLLADA version=\"1.4.1\"></COLLADA>",
            "COLLADA",
        ),
        (b"PK\x03\x04\x14\0\0\0\x08\0mesh.obj", "ZIP"),
        (b"\xFF\xFE\0\0v\0\0\0", "UTF-32"),
        (b"newmtl steel\nKd 1 1 1\n", "material library"),
        (b"0 0 0\n1 0 0\n0 1 0\n", "some other text"),
        (b"\0\x01\x02\x03\x04", "binary data"),
        (b"404: Not Found", "some other text"),
    ];
    for (bytes, name) in cases {
        let message = message(bytes);
        assert!(message.contains(name), "{name}: {message}");
    }
}

#[test]
fn says_that_no_line_is_a_statement() {
    assert_eq!(
        message(b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"),
        "none of the 3 lines begins with a word of OBJ (v, f, ...); this looks like a Git LFS pointer: send the file \
         that it stands for (git lfs pull)"
    );
}

#[test]
fn recognises_other_text_in_utf16() {
    let page = "\u{feff}<html><body>404</body></html>";
    let bytes: Vec<u8> = page.encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(message(&bytes).contains("HTML"));
}

#[test]
fn accidental_words_of_obj_do_not_hide_the_format() {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for _ in 0..10 {
        bytes.extend(b"\x01\x02\nIDAT\n\x03");
    }
    bytes.extend(b"\nf \xFF\xFE\x01\nv\n");
    let message = message(&bytes);
    assert!(
        message.starts_with("words of OBJ (v, f, ...) begin only 2 of the "),
        "{message}"
    );
    assert!(message.contains("PNG"), "{message}");
}

#[test]
fn wrong_obj_text_keeps_its_own_errors() {
    // Whatever it begins with, most lines are statements.
    for start in ["OFF\n", "{\n", "<<<<<<< HEAD\n", "solid facet\n"] {
        let text = format!("{start}{CUBE}f 1 2 99\n");
        let errors = read_mesh(text.as_bytes(), Import::METRES, LIMITS).unwrap_err();
        assert!(
            matches!(
                errors[..],
                [ImportError::IndexOutOfRange {
                    line: 16,
                    index: 99,
                    ..
                }]
            ),
            "{errors:?}"
        );
    }
}
