//! Cuts text of absent effects: branches whose condition is a known constant, and struct members that nothing mentions.

use super::Constant;
use super::condition::truth;
use super::module::{Declaration, Module};
use std::ops::Range;

/// An `if` with its `else if`s.
struct Chain {
    arms: Vec<Arm>,
    /// The braces of the last `else`.
    otherwise: Option<Body>,
}

/// `if CONDITION {..}` of a chain.
struct Arm {
    keyword: usize,
    condition: Range<usize>,
    body: Body,
}

/// The token indices of a pair of braces.
#[derive(Clone, Copy)]
struct Body {
    open: usize,
    close: usize,
}

/// The byte ranges of a function's text that constants cut away, sorted and disjoint.
pub(super) fn dead_branches(
    module: &Module<'_>,
    declaration: &Declaration,
    lookup: &mut dyn FnMut(&str) -> Option<Constant>,
) -> Vec<Range<usize>> {
    let mut pruner = Pruner { module, lookup, cuts: Vec::new() };
    pruner.block(declaration.tokens.clone());
    tidy(module.text, pruner.cuts)
}

/// The byte ranges of the members of a struct that are not kept, sorted and disjoint; the first member stays if no other does.
pub(super) fn dead_members(
    module: &Module<'_>,
    declaration: &Declaration,
    keep: &dyn Fn(&str) -> bool,
) -> Vec<Range<usize>> {
    let members = members(module, declaration);
    let mut dead: Vec<&Member> = members.iter().filter(|member| !keep(member.name)).collect();
    if dead.len() == members.len() && !dead.is_empty() {
        dead.remove(0);
    }
    tidy(module.text, dead.into_iter().map(|member| member.text.clone()).collect())
}

/// Whether a member of the struct has an attribute: its place or meaning is then fixed from outside.
pub(super) fn has_attributes(module: &Module<'_>, declaration: &Declaration) -> bool {
    declaration.tokens.clone().any(|token| module.word(token) == "@")
}

struct Member<'a> {
    name: &'a str,
    /// From its name to the comma.
    text: Range<usize>,
}

fn members<'a>(module: &Module<'a>, declaration: &Declaration) -> Vec<Member<'a>> {
    let Some(open) = module.find_outside(declaration.tokens.clone(), "{") else {
        return Vec::new();
    };
    let close = module.closing(open);
    let mut members = Vec::new();
    let mut start = open + 1;
    while start < close {
        let comma = member_end(module, start..close);
        let last = comma.min(close - 1);
        let text = module.tokens[start].start..module.tokens[last].end;
        members.push(Member { name: module.word(start), text });
        start = comma + 1;
    }
    members
}

/// The index of the comma outside brackets and templates, or the end.
fn member_end(module: &Module<'_>, range: Range<usize>) -> usize {
    let mut depth = 0i32;
    for at in range.clone() {
        match module.word(at) {
            "<" | "(" | "[" => depth += 1,
            ">" | ")" | "]" => depth -= 1,
            "," if depth == 0 => return at,
            _ => {}
        }
    }
    range.end
}

struct Pruner<'p, 'm> {
    module: &'p Module<'m>,
    lookup: &'p mut dyn FnMut(&str) -> Option<Constant>,
    cuts: Vec<Range<usize>>,
}

impl Pruner<'_, '_> {
    fn block(&mut self, tokens: Range<usize>) {
        let mut at = tokens.start;
        while at < tokens.end {
            match self.module.word(at) {
                "if" => match self.chain(at, tokens.end) {
                    Some((chain, end)) => {
                        self.prune(&chain);
                        at = end;
                    }
                    None => at += 1,
                },
                _ => at += 1,
            }
        }
    }

    /// The chain that begins at an `if`, and the index behind it; `None` for text that is no WGSL.
    fn chain(&self, first: usize, limit: usize) -> Option<(Chain, usize)> {
        let mut chain = Chain { arms: Vec::new(), otherwise: None };
        let mut keyword = first;
        loop {
            let body = self.body(keyword + 1..limit)?;
            chain.arms.push(Arm { keyword, condition: keyword + 1..body.open, body });
            let end = body.close + 1;
            if self.module.word(end) != "else" {
                return Some((chain, end));
            }
            if self.module.word(end + 1) == "if" {
                keyword = end + 1;
                continue;
            }
            let body = self.body(end + 1..limit)?;
            chain.otherwise = Some(body);
            return Some((chain, body.close + 1));
        }
    }

    fn body(&self, tokens: Range<usize>) -> Option<Body> {
        let open = self.module.find_outside(tokens, "{")?;
        Some(Body { open, close: self.module.closing(open) })
    }

    fn prune(&mut self, chain: &Chain) {
        let end = chain.otherwise.or(chain.arms.last().map(|arm| arm.body)).map_or(0, |body| body.close);
        let start = chain.arms[0].keyword;
        let mut kept = Vec::new();
        let mut last = chain.otherwise;
        for arm in &chain.arms {
            match truth(self.module, arm.condition.clone(), self.lookup) {
                None => kept.push(arm),
                Some(false) => {}
                Some(true) if kept.is_empty() && arm.body.close == end && arm.keyword == start => kept.push(arm),
                Some(true) => {
                    last = Some(arm.body);
                    break;
                }
            }
        }
        self.cut_between(start, end, &kept, last);
        for arm in kept {
            self.block(arm.body.open + 1..arm.body.close);
        }
        if let Some(body) = last {
            self.block(body.open + 1..body.close);
        }
    }

    /// Cuts what lies between the kept arms and the body that is left for the rest.
    fn cut_between(&mut self, start: usize, end: usize, kept: &[&Arm], last: Option<Body>) {
        let Some(first) = kept.first() else {
            return match last {
                None => self.cut(start..end + 1),
                Some(body) => {
                    self.cut(start..body.open);
                    self.cut_behind(body.close, end);
                }
            };
        };
        self.cut(start..first.keyword);
        let mut close = first.body.close;
        for arm in &kept[1..] {
            // `arm.keyword - 1` is its `else`.
            self.cut_behind(close, arm.keyword - 2);
            close = arm.body.close;
        }
        if let Some(body) = last {
            let else_token = (0..body.open).rev().find(|token| self.module.word(*token) == "else");
            let else_token = else_token.unwrap_or(body.open);
            self.cut_behind(close, else_token - 1);
            self.cut(else_token + 1..body.open);
            close = body.close;
        }
        self.cut_behind(close, end);
    }

    /// Cuts from one token up to another, which stays.
    fn cut(&mut self, tokens: Range<usize>) {
        if tokens.is_empty() {
            return;
        }
        let tokens_text = &self.module.tokens;
        let whole = self.module.word(tokens.end - 1) == "}" && self.module.word(tokens.start) == "if";
        let end = match whole {
            true => tokens_text[tokens.end - 1].end,
            false => tokens_text[tokens.end].start,
        };
        self.cuts.push(tokens_text[tokens.start].start..end);
    }

    /// Cuts everything behind one token up to and with another.
    fn cut_behind(&mut self, kept: usize, last: usize) {
        let tokens = &self.module.tokens;
        if last > kept {
            self.cuts.push(tokens[kept].end..tokens[last].end);
        }
    }
}

/// Widens cuts so that no empty lines, orphaned comments or trailing spaces stay behind; sorts and merges them.
fn tidy(text: &str, mut cuts: Vec<Range<usize>>) -> Vec<Range<usize>> {
    cuts.sort_by_key(|cut| cut.start);
    let mut merged: Vec<Range<usize>> = Vec::new();
    for cut in cuts {
        let cut = widen(text, cut);
        match merged.last_mut() {
            Some(last) if cut.start <= last.end => last.end = last.end.max(cut.end),
            Some(last) if is_whole_lines(text, last) && text[last.end..cut.start].trim().is_empty() => {
                last.end = cut.end;
            }
            _ => merged.push(cut),
        }
    }
    merged.into_iter().map(|cut| close_gap(text, cut)).collect()
}

/// A cut that leaves nothing on its lines takes them, the comment behind it and the comment lines directly above.
fn widen(text: &str, cut: Range<usize>) -> Range<usize> {
    let line = line_start(text, cut.start);
    let behind = text[cut.end..].find('\n').map_or(text.len(), |at| cut.end + at + 1);
    let rest = text[cut.end..behind].trim();
    if !text[line..cut.start].trim().is_empty() || !(rest.is_empty() || rest.starts_with("//")) {
        let spaces = text[cut.end..].len() - text[cut.end..].trim_start_matches(' ').len();
        let spaced = text[..cut.start].ends_with(' ');
        return cut.start..if spaced { cut.end + spaces } else { cut.end };
    }
    let mut start = line;
    while start > 0 {
        let above = line_start(text, start - 1);
        if !text[above..start].trim_start().starts_with("//") {
            break;
        }
        start = above;
    }
    start..behind
}

/// Of the empty lines before and behind a cut of whole lines only one stays, and none next to a brace.
fn close_gap(text: &str, cut: Range<usize>) -> Range<usize> {
    if !is_whole_lines(text, &cut) {
        return cut;
    }
    let before = text[..cut.start].trim_end();
    let behind = text[cut.end..].trim_start();
    let empty_behind = text[cut.end..text.len() - behind.len()].contains('\n');
    let lines_before = text[before.len()..cut.start].matches('\n').count();
    if behind.starts_with('}') {
        let start = before.len() + text[before.len()..].find('\n').map_or(0, |at| at + 1);
        return start..line_start(text, text.len() - behind.len());
    }
    if empty_behind && (lines_before > 1 || before.ends_with('{')) {
        return cut.start..line_start(text, text.len() - behind.len());
    }
    cut
}

fn is_whole_lines(text: &str, cut: &Range<usize>) -> bool {
    line_start(text, cut.start) == cut.start && text[..cut.end].ends_with('\n')
}

fn line_start(text: &str, offset: usize) -> usize {
    text[..offset].rfind('\n').map_or(0, |at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::{FileId, FileKind, SourceFile};

    fn left(text: &str) -> String {
        let source = SourceFile { kind: FileKind::Module, key: "m".into(), name: "m.wgsl".into(), text: text.into() };
        let module = Module::parse("m", FileId(0), &source).unwrap();
        let mut lookup = |name: &str| match name {
            "T" => Some(Constant::Bool(true)),
            "F" => Some(Constant::Bool(false)),
            _ => None,
        };
        remove(text, &dead_branches(&module, &module.declarations[0], &mut lookup))
    }

    fn remove(text: &str, cuts: &[Range<usize>]) -> String {
        let mut out = text.to_string();
        for cut in cuts.iter().rev() {
            out.replace_range(cut.clone(), "");
        }
        out
    }

    #[test]
    fn whole_ifs_vanish_with_their_comments_and_lines() {
        assert_eq!(
            left("fn f() {\n    a();\n\n    // Why.\n    if F {\n        b();\n    } // end\n\n    c();\n}"),
            "fn f() {\n    a();\n\n    c();\n}"
        );
        assert_eq!(left("fn f() {\n    if F { b(); }\n\n    c();\n}"), "fn f() {\n    c();\n}");
        assert_eq!(left("fn f() {\n    a();\n\n    if F { b(); }\n\n    if F { c(); }\n}"), "fn f() {\n    a();\n}");
        assert_eq!(left("fn f() { a(); if F { b(); } c(); }"), "fn f() { a(); c(); }");
    }

    #[test]
    fn a_true_if_stays_as_it_is() {
        let text = "fn f() {\n    if T && T { /* b */ b(); }\n}";
        assert_eq!(left(text), text);
    }

    #[test]
    fn the_branch_taken_stays_as_a_block() {
        assert_eq!(left("fn f() { if F { a(); } else { b(); } }"), "fn f() { { b(); } }");
        assert_eq!(left("fn f() { if T { return a; } else { return b; } }"), "fn f() { { return a; } }");
    }

    #[test]
    fn chains_lose_their_dead_arms() {
        for (chain, expected) in [
            ("if F {a} else if x {b} else {c}", "if x {b} else {c}"),
            ("if x {a} else if F {b} else {c}", "if x {a} else {c}"),
            ("if x {a} else if F {b}", "if x {a}"),
            ("if x {a} else if F {b} else if y {c}", "if x {a} else if y {c}"),
            ("if x {a} else if T {b} else {c}", "if x {a} else {b}"),
            ("if x {a} else if T {b}", "if x {a} else {b}"),
            ("if F {a} else if T {b} else {c}", "{b}"),
            ("if F {a} else if F {b} else {c}", "{c}"),
            ("if T {a} else if x {b}", "{a}"),
            ("if x {a} else if y {b} else {c}", "if x {a} else if y {b} else {c}"),
            ("if x && F {a} else if F {b} else if x {c} else if F {d} else {e}", "if x {c} else {e}"),
        ] {
            assert_eq!(left(&format!("fn f() {{ {chain} }}")), format!("fn f() {{ {expected} }}"), "{chain}");
        }
    }

    #[test]
    fn pruning_reaches_into_kept_blocks() {
        assert_eq!(
            left("fn f() { if x { for (;;) { if F {a} b } } else { if T {c} else {d} } }"),
            "fn f() { if x { for (;;) { b } } else { {c} } }"
        );
        assert_eq!(left("fn f() { if T { if F {a} } }"), "fn f() { if T { } }");
    }

    #[test]
    fn members_go_with_their_comments() {
        let text = "struct S {\n    /// A.\n    a: array<vec4<u32>, 2>,\n    /// B.\n    b: u32, // b\n    c: f32\n}";
        let source = SourceFile { kind: FileKind::Module, key: "m".into(), name: "m.wgsl".into(), text: text.into() };
        let module = Module::parse("m", FileId(0), &source).unwrap();
        let without =
            |kept: &[&str]| remove(text, &dead_members(&module, &module.declarations[0], &|name| kept.contains(&name)));
        assert_eq!(without(&["b"]), "struct S {\n    /// B.\n    b: u32, // b\n}");
        assert_eq!(without(&["a", "c"]), "struct S {\n    /// A.\n    a: array<vec4<u32>, 2>,\n    c: f32\n}");
        assert_eq!(without(&[]), "struct S {\n    /// A.\n    a: array<vec4<u32>, 2>,\n}");
    }
}
