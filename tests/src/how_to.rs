//! Reads the how-tos of `docs/`: their code blocks as changes to the project's texts.
//!
//! A block that opens with ```` ```wgsl file=PATH ```` (or toml) is a new file; one that opens with ```` ```diff file=PATH ```` changes a
//! file: lines that begin with a space stay, with `-` go, with `+` come. Other blocks are for reading.

use std::collections::BTreeMap;

/// Texts by path from the root of the project.
pub type Texts = BTreeMap<String, String>;

/// A code block with a file name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The file that it makes or changes.
    pub path: String,
    /// Whether it changes a file that is there.
    pub is_diff: bool,
    /// Its lines, each with its end.
    pub text: String,
}

/// The blocks of a document that name a file, in order.
pub fn blocks(document: &str) -> Vec<Block> {
    let mut found = Vec::new();
    let mut lines = document.lines();
    while let Some(line) = lines.next() {
        let Some(opening) = line.strip_prefix("```") else {
            continue;
        };
        let body: String = lines.by_ref().take_while(|line| *line != "```").map(|line| format!("{line}\n")).collect();
        if let Some((language, path)) = opening.split_once(" file=") {
            found.push(Block { path: path.to_owned(), is_diff: language == "diff", text: body });
        }
    }
    found
}

/// Applies the blocks to the texts.
///
/// # Errors
/// What does not fit: a new file that is already there, a changed file that is not, lines to change that do not stand in it exactly once.
pub fn apply(blocks: &[Block], texts: &mut Texts) -> Result<(), String> {
    for block in blocks {
        let path = &block.path;
        if !block.is_diff {
            if texts.insert(path.clone(), block.text.clone()).is_some() {
                return Err(format!("{path} is there already"));
            }
            continue;
        }
        let text = texts.get_mut(path).ok_or_else(|| format!("there is no {path} to change"))?;
        let (old, new) = sides(&block.text);
        match text.matches(old.as_str()).count() {
            1 => *text = text.replacen(old.as_str(), &new, 1),
            count => {
                return Err(format!("{path} has these lines {count} times, not once:\n{old}"));
            }
        }
    }
    Ok(())
}

/// The text before and after a difference.
fn sides(difference: &str) -> (String, String) {
    let mut old = String::new();
    let mut new = String::new();
    for line in difference.lines() {
        let (mark, rest) = line.split_at(line.len().min(1));
        if mark != "+" {
            old += rest;
            old.push('\n');
        }
        if mark != "-" {
            new += rest;
            new.push('\n');
        }
    }
    (old, new)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOCUMENT: &str =
        "Text.\n```wgsl file=a.wgsl\nfn a() {}\n```\n```sh\nls\n```\n```diff file=b.toml\n [x]\n-y = 1\n+y = 2\n```\n";

    #[test]
    fn blocks_with_a_file_name_are_found() {
        let found = blocks(DOCUMENT);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].path.as_str(), found[0].is_diff), ("a.wgsl", false));
        assert_eq!(found[0].text, "fn a() {}\n");
        assert!(found[1].is_diff);
    }

    #[test]
    fn differences_change_what_stands_once() {
        let mut texts = Texts::from([("b.toml".into(), "[x]\ny = 1\nz = 3\n".into())]);
        assert_eq!(apply(&blocks(DOCUMENT), &mut texts), Ok(()));
        assert_eq!(texts["b.toml"], "[x]\ny = 2\nz = 3\n");
        assert_eq!(texts["a.wgsl"], "fn a() {}\n");
    }

    #[test]
    fn differences_that_do_not_fit_are_refused() {
        let mut texts = Texts::from([("b.toml".into(), "[x]\ny = 5\n".into())]);
        let refused = apply(&blocks(DOCUMENT)[1..], &mut texts);
        assert!(refused.is_err_and(|message| message.contains("0 times")));
    }
}
