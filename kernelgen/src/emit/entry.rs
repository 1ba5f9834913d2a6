//! Finds stage functions by name, and the places to point at in them.

use crate::config::nearest;
use crate::diagnostic::Diagnostic;
use crate::link::Modules;
use crate::source::{FileId, Sources, Span, Spanned};
use std::collections::BTreeMap;

/// A function in a module below `stage::`.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    /// Module path, `stage::trace`.
    pub module: String,
    /// The function's name.
    pub name: String,
    /// Where the name stands.
    pub span: Span,
    /// Parameter names and where they stand.
    pub params: BTreeMap<String, Span>,
}

/// All functions below `stage::`, by name.
pub(super) struct Entries {
    functions: BTreeMap<String, Vec<Entry>>,
}

impl Entries {
    /// Scans the modules below `stage::`.
    pub(super) fn scan(sources: &Sources, modules: &Modules) -> Self {
        let mut functions: BTreeMap<String, Vec<Entry>> = BTreeMap::new();
        for (path, &file) in modules.iter().filter(|(path, _)| path.starts_with("stage::")) {
            for entry in functions_of(path, file, &sources.file(file).text) {
                functions.entry(entry.name.clone()).or_default().push(entry);
            }
        }
        Self { functions }
    }

    /// The function of this name.
    ///
    /// # Errors
    /// K0208 when there is none, or more than one.
    pub(super) fn find(&self, name: &Spanned<String>) -> Result<&Entry, Diagnostic> {
        match self.functions.get(&name.value).map(Vec::as_slice) {
            Some([entry]) => Ok(entry),
            Some([first, second, ..]) => {
                Err(Diagnostic::error("K0208", format!("there are two stage functions `{}`", name.value))
                    .at(name.span, "which of them?")
                    .also(first.span, "one here")
                    .also(second.span, "one here")
                    .help("rename one of them"))
            }
            _ => {
                let help = match nearest(&name.value, self.functions.keys().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => "write it in a module below stage/, or name another with `entry`".to_owned(),
                };
                let message = format!("there is no stage function `{}`", name.value);
                Err(Diagnostic::error("K0208", message)
                    .at(name.span, "no function of this name in the modules below stage/")
                    .help(help))
            }
        }
    }
}

fn functions_of(path: &str, file: FileId, text: &str) -> Vec<Entry> {
    let bare = without_comments(text);
    let words = words(&bare);
    let mut functions = Vec::new();
    for pair in words.windows(2) {
        let ((keyword, _), (name, start)) = (pair[0], pair[1]);
        if keyword != "fn" {
            continue;
        }
        functions.push(Entry {
            module: path.to_owned(),
            name: name.to_owned(),
            span: span(file, start, name),
            params: params_of(file, &bare, start + name.len()),
        });
    }
    functions
}

/// Names before a colon at the depth of the parameter list that opens behind `from`.
fn params_of(file: FileId, bare: &str, from: usize) -> BTreeMap<String, Span> {
    let Some(open) = bare[from..].find('(').map(|at| from + at) else { return BTreeMap::new() };
    let mut depth = 0;
    let mut params = BTreeMap::new();
    let mut word = None;
    for (at, c) in bare[open..].char_indices().map(|(at, c)| (open + at, c)) {
        match c {
            '(' | '<' => depth += 1,
            ')' | '>' => depth -= 1,
            ':' if depth == 1 => {
                if let Some((start, end)) = word {
                    let name = &bare[start..end];
                    params.insert(name.to_owned(), span(file, start, name));
                }
            }
            _ => {}
        }
        if c.is_alphanumeric() || c == '_' {
            word = match word {
                Some((start, end)) if end == at => Some((start, at + c.len_utf8())),
                _ => Some((at, at + c.len_utf8())),
            };
        }
        if depth == 0 {
            break;
        }
    }
    params
}

/// Upper-case names that a module imports from `package::outcome`.
pub(super) fn imported_outcomes(text: &str) -> Vec<String> {
    let bare = without_comments(text);
    let mut names = Vec::new();
    for (at, prefix) in bare.match_indices("package::outcome::") {
        let rest = &bare[at + prefix.len()..];
        let list = rest.split(';').next().unwrap_or("");
        names.extend(words(list).into_iter().map(|(word, _)| word.to_owned()));
    }
    names
}

fn span(file: FileId, start: usize, word: &str) -> Span {
    Span { file, start: start as u32, end: (start + word.len()) as u32 }
}

/// The words of a text with their places.
fn words(text: &str) -> Vec<(&str, usize)> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut words = Vec::new();
    let mut at = 0;
    while let Some(start) = text[at..].find(is_word).map(|found| at + found) {
        let end = text[start..].find(|c| !is_word(c)).map_or(text.len(), |found| start + found);
        words.push((&text[start..end], start));
        at = end;
    }
    words
}

/// The text with blanks in place of comments, so that all places stay.
fn without_comments(text: &str) -> String {
    let mut bare = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment_length(rest)
        } else {
            bare.push(next);
            rest = &rest[next.len_utf8()..];
            continue;
        };
        bare.extend(std::iter::repeat_n(' ', length));
        rest = &rest[length..];
    }
    bare
}

fn block_comment_length(text: &str) -> usize {
    let mut depth = 0;
    let mut at = 0;
    let bytes = text.as_bytes();
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    bytes.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_found_with_their_parameters_and_comments_are_not() {
        let text = "// fn no() {}\n/* fn /* nor */ this() {} */ fn yes(a: ptr<function, A>, b: u32) -> u32 { let c: u32 = b; }";
        let found = functions_of("stage::x", FileId(3), text);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].name, "yes");
        assert_eq!(&text[found[0].span.start as usize..found[0].span.end as usize], "yes");
        let params: Vec<&str> = found[0].params.keys().map(String::as_str).collect();
        assert_eq!(params, ["a", "b"]);
        let b = found[0].params["b"];
        assert_eq!(&text[b.start as usize..b.end as usize + 5], "b: u32");
    }

    #[test]
    fn imported_outcomes_are_found_in_both_forms() {
        let text = "import package::outcome::{HIT, MISS};\nimport package::outcome::DONE; // package::outcome::NOT\n";
        assert_eq!(imported_outcomes(text), ["HIT", "MISS", "DONE"]);
    }
}
