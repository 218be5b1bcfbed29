//! Which bytes of Rust or WGSL are code, comment or literal: enough of a lexer to search each by itself.

/// What a byte belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Code,
    Comment,
    Literal,
}

/// The text with comments and literals blanked; line breaks stay.
pub(crate) fn code(text: &str) -> String {
    keep(text, |kind| kind == Kind::Code)
}

/// The text with literals blanked; line breaks stay.
pub(crate) fn code_and_comments(text: &str) -> String {
    keep(text, |kind| kind != Kind::Literal)
}

fn keep(text: &str, is_kept: impl Fn(Kind) -> bool) -> String {
    let kinds = kinds(text.as_bytes());
    let kept = text.char_indices().map(|(at, c)| if c == '\n' || is_kept(kinds[at]) { c } else { ' ' });
    kept.collect()
}

fn kinds(text: &[u8]) -> Vec<Kind> {
    let mut kinds = vec![Kind::Code; text.len()];
    let mut at = 0;
    while at < text.len() {
        let (kind, length) = token(&text[at..], at.checked_sub(1).map(|before| text[before]));
        kinds[at..at + length].fill(kind);
        at += length;
    }
    kinds
}

/// The kind and length of the token at the start of `rest`, which is not empty; code comes byte by byte.
fn token(rest: &[u8], before: Option<u8>) -> (Kind, usize) {
    let is_word_start = !before.is_some_and(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    match rest {
        [b'/', b'/', ..] => (Kind::Comment, length_until(rest, b"\n")),
        [b'/', b'*', ..] => (Kind::Comment, block_comment(rest)),
        [b'"', ..] => (Kind::Literal, quoted(rest, b'"')),
        [b'b' | b'c', b'"', ..] if is_word_start => (Kind::Literal, 1 + quoted(&rest[1..], b'"')),
        [b'r' | b'b' | b'c', ..] if is_word_start => match raw_string(rest) {
            Some(length) => (Kind::Literal, length),
            None => (Kind::Code, 1),
        },
        // A lifetime has no closing quote after one character; a character literal has, or an escape.
        [b'\'', b'\\', ..] => (Kind::Literal, quoted(rest, b'\'')),
        [b'\'', first, ..] if *first != b'\'' => {
            let closing = 1 + char_length(*first);
            if rest.get(closing) == Some(&b'\'') { (Kind::Literal, closing + 1) } else { (Kind::Code, 1) }
        }
        _ => (Kind::Code, 1),
    }
}

/// Bytes of the UTF-8 character that starts with this byte.
fn char_length(first: u8) -> usize {
    match first {
        0xf0.. => 4,
        0xe0.. => 3,
        0xc0.. => 2,
        _ => 1,
    }
}

/// Bytes before the first `end`, or all.
fn length_until(rest: &[u8], end: &[u8]) -> usize {
    rest.windows(end.len()).position(|window| window == end).unwrap_or(rest.len())
}

/// Length of a block comment; they nest.
fn block_comment(rest: &[u8]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        match &rest[at..] {
            [b'/', b'*', ..] => (depth, at) = (depth + 1, at + 2),
            [b'*', b'/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at.min(rest.len())
}

/// Length of a literal between two `quote`s, with backslash escapes.
fn quoted(rest: &[u8], quote: u8) -> usize {
    let mut at = 1;
    while at < rest.len() && rest[at] != quote {
        at += if rest[at] == b'\\' { 2 } else { 1 };
    }
    (at + 1).min(rest.len())
}

/// Length of `r"..."`, `br#"..."#` and their kin, if there is one at the start.
fn raw_string(rest: &[u8]) -> Option<usize> {
    let prefix = if rest[0] == b'r' { 1 } else { 2 };
    if rest.get(prefix - 1) != Some(&b'r') {
        return None;
    }
    let hashes = rest[prefix..].iter().take_while(|byte| **byte == b'#').count();
    let open = prefix + hashes;
    if rest.get(open) != Some(&b'"') {
        return None;
    }
    let end = [b"\"".as_slice(), &rest[prefix..open]].concat();
    Some((open + 1 + length_until(&rest[open + 1..], &end) + end.len()).min(rest.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_comments_and_literals_are_told_apart() {
        let text = r##"let a = "x // \" y"; // z "q"
/* b /* c */ d */ let r#e = r#"f"g"#; 'life: loop { f('"', '\'', b'\\', 'ü', "h") }"##;
        let squeezed = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(squeezed(code(text)), "let a = ; let r#e = ; 'life: loop { f( , , b , , ) }",);
        assert_eq!(
            squeezed(code_and_comments(text)),
            r#"let a = ; // z "q" /* b /* c */ d */ let r#e = ; 'life: loop { f( , , b , , ) }"#,
        );
    }

    #[test]
    fn lines_stay_where_they_are_and_nothing_unfinished_panics() {
        let text = "a\n\"b\nc\"\n/* d\n*/ e";
        assert_eq!(code(text).lines().count(), text.lines().count());
        for text in ["\"", "\"\\", "'", "'\\", "r#\"", "r#", "/*", "//", "b", "br", "b'"] {
            assert_eq!(code(text).len(), text.len(), "{text}");
        }
    }
}
