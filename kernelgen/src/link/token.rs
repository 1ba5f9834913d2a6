//! Splits WGSL text into tokens and comments; positions are bytes.

use crate::diagnostic::Diagnostic;
use crate::source::{FileId, Span};
use std::ops::Range;

/// What a token is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    /// A word: identifier or keyword.
    Word,
    /// A number with its suffix.
    Number,
    /// An operator or bracket. `<` and `>` are always single, so that nested templates close one by one.
    Punct,
}

/// A token.
#[derive(Clone, Copy, Debug)]
pub(super) struct Token {
    pub kind: TokenKind,
    pub start: usize,
    pub end: usize,
}

/// A text in parts.
#[derive(Debug, Default)]
pub(super) struct Lexed {
    pub tokens: Vec<Token>,
    pub comments: Vec<Range<usize>>,
}

/// Operators of more than one character that the linker has to see whole.
const LONG_OPERATORS: [&str; 8] = ["&&", "||", "==", "!=", "<=", ">=", "->", "::"];
const SHORT_OPERATORS: &str = "(){}[]<>;:,.@=+-*/%&|^!~_";

/// Splits a text.
///
/// # Errors
/// K0301: a character that WGSL does not have, an unterminated block comment, unbalanced brackets.
pub(super) fn lex(file: FileId, text: &str) -> Result<Lexed, Diagnostic> {
    let mut lexed = Lexed::default();
    let mut at = 0;
    while let Some(next) = text[at..].chars().next() {
        let rest = &text[at..];
        if next.is_whitespace() {
            at += next.len_utf8();
        } else if rest.starts_with("//") {
            let end = at + rest.find('\n').unwrap_or(rest.len());
            lexed.comments.push(at..end);
            at = end;
        } else if rest.starts_with("/*") {
            let end = block_comment_end(file, text, at)?;
            lexed.comments.push(at..end);
            at = end;
        } else {
            let token = token_at(file, text, at)?;
            at = token.end;
            lexed.tokens.push(token);
        }
    }
    check_brackets(file, text, &lexed.tokens)?;
    Ok(lexed)
}

/// The end of the block comment that starts at `start`; block comments nest.
fn block_comment_end(file: FileId, text: &str, start: usize) -> Result<usize, Diagnostic> {
    let mut depth = 0;
    let mut at = start;
    while at < text.len() {
        let rest = &text.as_bytes()[at..];
        if rest.starts_with(b"/*") {
            depth += 1;
            at += 2;
        } else if rest.starts_with(b"*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                return Ok(at);
            }
        } else {
            at += 1;
        }
    }
    Err(Diagnostic::error("K0301", "a block comment is not closed")
        .at(span(file, start, start + 2), "opened here")
        .help("close it with `*/`; block comments nest"))
}

fn token_at(file: FileId, text: &str, start: usize) -> Result<Token, Diagnostic> {
    let rest = &text[start..];
    let first = rest.chars().next().unwrap_or(' ');
    let (kind, length) = if first.is_ascii_digit() || starts_with_fraction(rest) {
        (TokenKind::Number, number_length(rest))
    } else if first.is_alphabetic() || (first == '_' && word_length(rest) > 1) {
        (TokenKind::Word, word_length(rest))
    } else if LONG_OPERATORS.iter().any(|operator| rest.starts_with(operator)) {
        (TokenKind::Punct, 2)
    } else if SHORT_OPERATORS.contains(first) {
        (TokenKind::Punct, 1)
    } else {
        let message = format!("`{first}` is not part of WGSL");
        return Err(Diagnostic::error("K0301", message)
            .at(span(file, start, start + first.len_utf8()), "this character")
            .help("take it away; comments begin with `//`"));
    };
    Ok(Token { kind, start, end: start + length })
}

fn starts_with_fraction(rest: &str) -> bool {
    let bytes = rest.as_bytes();
    bytes[0] == b'.' && bytes.get(1).is_some_and(u8::is_ascii_digit)
}

fn word_length(rest: &str) -> usize {
    rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len())
}

/// Digits, letters, one-character fraction points, and the sign of an exponent.
fn number_length(rest: &str) -> usize {
    let bytes = rest.as_bytes();
    let hex = rest.starts_with("0x") || rest.starts_with("0X");
    let mut length = 0;
    while let Some(byte) = bytes.get(length) {
        let exponent = match bytes[..length].last() {
            Some(b'e' | b'E') => !hex,
            Some(b'p' | b'P') => hex,
            _ => false,
        };
        let sign = matches!(byte, b'+' | b'-') && exponent;
        if byte.is_ascii_alphanumeric() || *byte == b'.' || sign {
            length += 1;
        } else {
            break;
        }
    }
    length
}

fn check_brackets(file: FileId, text: &str, tokens: &[Token]) -> Result<(), Diagnostic> {
    let mut open: Vec<Token> = Vec::new();
    for token in tokens {
        let closes = match &text[token.start..token.end] {
            "(" | "[" | "{" => {
                open.push(*token);
                continue;
            }
            ")" => "(",
            "]" => "[",
            "}" => "{",
            _ => continue,
        };
        match open.pop() {
            Some(opened) if &text[opened.start..opened.end] == closes => {}
            opened => return Err(unbalanced(file, text, *token, opened)),
        }
    }
    match open.pop() {
        None => Ok(()),
        Some(token) => {
            let message = format!("`{}` is never closed", &text[token.start..token.end]);
            Err(Diagnostic::error("K0301", message)
                .at(span(file, token.start, token.end), "opened here")
                .help("every `(`, `[` and `{` has its partner in the same module"))
        }
    }
}

fn unbalanced(file: FileId, text: &str, token: Token, opened: Option<Token>) -> Diagnostic {
    let message = format!("`{}` closes nothing", &text[token.start..token.end]);
    let diagnostic = Diagnostic::error("K0301", message)
        .at(span(file, token.start, token.end), "no bracket of this kind is open here")
        .help("every `)`, `]` and `}` closes the bracket of its kind that was opened last");
    match opened {
        Some(opened) => diagnostic.also(span(file, opened.start, opened.end), "this one was opened last"),
        None => diagnostic,
    }
}

/// A span of a text from byte positions.
pub(super) fn span(file: FileId, start: usize, end: usize) -> Span {
    Span { file, start: start as u32, end: end as u32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<&str> {
        let lexed = lex(FileId(0), text).unwrap();
        lexed.tokens.iter().map(|token| &text[token.start..token.end]).collect()
    }

    #[test]
    fn operators_and_templates_are_told_apart() {
        assert_eq!(
            words("array<vec4<f32>>(a)&&b<=1.5e-3f"),
            ["array", "<", "vec4", "<", "f32", ">", ">", "(", "a", ")", "&&", "b", "<=", "1.5e-3f"]
        );
        assert_eq!(words("a.x-.5+0x1fu"), ["a", ".", "x", "-", ".5", "+", "0x1fu"]);
        assert_eq!(words("_ = f(); _x"), ["_", "=", "f", "(", ")", ";", "_x"]);
    }

    #[test]
    fn comments_nest_and_are_no_tokens() {
        let text = "a /* b /* c */ d */ e // f {\ng";
        assert_eq!(words(text), ["a", "e", "g"]);
        assert_eq!(lex(FileId(0), text).unwrap().comments, [2..19, 22..28]);
    }

    #[test]
    fn errors_point_at_the_character() {
        let at = |text: &str| {
            let diagnostic = lex(FileId(0), text).unwrap_err();
            assert_eq!(diagnostic.code, "K0301");
            diagnostic.labels[0].span.start
        };
        assert_eq!(at("fn f() { # }"), 9);
        assert_eq!(at("fn f() { (] }"), 10);
        assert_eq!(at("x {"), 2);
        assert_eq!(at("a /* b"), 2);
    }
}
