//! What a glTF `uri` refers to: a file beside the document, or data written into the document.

use crate::error::{Error, Result};
use std::path::Path;

/// Reads the bytes a `uri` refers to; relative paths start at `base`.
///
/// # Errors
/// A scheme other than `data:` and `file:`, malformed base64 or percent-encoding, a file that cannot be read.
pub fn read(uri: &str, base: &Path) -> Result<Vec<u8>> {
    if let Some(rest) = uri.strip_prefix("data:") {
        return data(rest);
    }
    if let Some(path) = uri.strip_prefix("file://").or_else(|| uri.strip_prefix("file:")) {
        return file(&base.join(percent_decoded(path)?));
    }
    if has_scheme(uri) {
        return Err(Error::input(format!("URI scheme of `{}` is not supported", shortened(uri)))
            .help("a relative path, a file: URI or a data: URI"));
    }
    let decoded = base.join(percent_decoded(uri)?);
    let literal = base.join(uri);
    // Exporters that forget to escape leave a literal `%` or space in the name.
    file(if !decoded.exists() && literal.exists() { &literal } else { &decoded })
}

fn file(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|error| Error::input(format!("cannot read {}: {error}", path.display())))
}

fn has_scheme(uri: &str) -> bool {
    let Some((scheme, _)) = uri.split_once(':') else { return false };
    scheme.len() > 1 && scheme.bytes().all(|c| c.is_ascii_alphanumeric() || b"+-.".contains(&c))
}

/// The part of a URI that is worth printing.
pub fn shortened(uri: &str) -> String {
    const LONGEST: usize = 60;
    if uri.chars().count() <= LONGEST { uri.to_owned() } else { uri.chars().take(LONGEST).chain(['…']).collect() }
}

fn data(rest: &str) -> Result<Vec<u8>> {
    let Some((header, body)) = rest.split_once(',') else {
        return Err(Error::input("data URI has no comma").help("data:[type];base64,..."));
    };
    if header.ends_with(";base64") { base64(body) } else { percent_decoded_bytes(body) }
}

fn percent_decoded(text: &str) -> Result<String> {
    String::from_utf8(percent_decoded_bytes(text)?)
        .map_err(|_| Error::input(format!("URI `{}` is not UTF-8 once its %XX are decoded", shortened(text))))
}

fn percent_decoded_bytes(text: &str) -> Result<Vec<u8>> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let hex = (bytes[at] == b'%').then(|| bytes.get(at + 1..at + 3).and_then(hex_byte)).flatten();
        out.push(hex.unwrap_or(bytes[at]));
        at += if hex.is_some() { 3 } else { 1 };
    }
    Ok(out)
}

fn hex_byte(digits: &[u8]) -> Option<u8> {
    let digit = |c: u8| char::from(c).to_digit(16);
    Some((digit(digits[0])? * 16 + digit(digits[1])?) as u8)
}

fn base64(text: &str) -> Result<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut held) = (0u32, 0);
    for c in text.bytes().filter(|c| !c.is_ascii_whitespace() && *c != b'=') {
        let Some(value) = base64_digit(c) else {
            return Err(Error::input(format!(
                "data URI has the character `{}` in its base64",
                char::from(c).escape_default()
            )));
        };
        bits = (bits << 6) | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Ok(out)
}

fn base64_digit(c: u8) -> Option<u8> {
    match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' | b'-' => Some(62),
        b'/' | b'_' => Some(63),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decodes_base64_and_percent() {
        assert_eq!(read("data:text/plain;base64,aGVsbG8=", Path::new("")).unwrap(), b"hello");
        assert_eq!(read("data:text/plain,a%20b", Path::new("")).unwrap(), b"a b");
        assert_eq!(percent_decoded("Box%20With%20Spaces.bin").unwrap(), "Box With Spaces.bin");
        assert_eq!(percent_decoded("100%.bin").unwrap(), "100%.bin");
        assert!(read("data:;base64,a*b", Path::new("")).is_err());
        assert!(read("http://example.org/a.bin", Path::new("")).is_err());
    }
}
