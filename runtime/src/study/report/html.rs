//! Elements of a page, as text.

use crate::study::chart::escape;

/// An element with its contents, which are HTML already.
pub fn element(tag: &str, attributes: &str, inner: &str) -> String {
    let space = if attributes.is_empty() { "" } else { " " };
    format!("<{tag}{space}{attributes}>{inner}</{tag}>\n")
}

/// A part of the page under a heading.
pub fn section(title: &str, inner: &str) -> String {
    element("section", "", &(element("h2", "", &escape(title)) + inner))
}

/// A table whose first row and first column are headings.
pub fn table(corner: &str, columns: &[String], rows: &[(String, Vec<String>)]) -> String {
    let heading = |text: &String| element("th", "", &escape(text));
    let head: String = std::iter::once(&corner.to_owned()).chain(columns).map(heading).collect();
    let row = |(name, cells): &(String, Vec<String>)| {
        let cells: String = cells.iter().map(|cell| element("td", "", &escape(cell))).collect();
        element("tr", "", &(heading(name) + &cells))
    };
    let rows: String = rows.iter().map(row).collect();
    element("table", "", &(element("thead", "", &element("tr", "", &head)) + &element("tbody", "", &rows)))
}

/// A picture with a line below it; `id` is its name in the page, if not empty.
pub fn figure(id: &str, caption: &str, png: &[u8]) -> String {
    let caption = escape(caption);
    let id = if id.is_empty() { String::new() } else { format!("id=\"{}\" ", escape(id)) };
    let image = format!("<img {id}src=\"data:image/png;base64,{}\" alt=\"{caption}\">", base64(png));
    element("figure", "", &(image + &element("figcaption", "", &caption)))
}

/// Bytes in the alphabet of data URIs (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().enumerate().fold(0, |word, (at, &byte)| word | u32::from(byte) << (16 - 8 * at));
        for digit in 0..4 {
            let letter = ALPHABET[(word >> (18 - 6 * digit)) as usize & 63];
            text.push(if digit <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        let found = ["", "f", "fo", "foo", "foobar"].map(|text| base64(text.as_bytes()));
        assert_eq!(found, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYmFy"]);
    }
}
