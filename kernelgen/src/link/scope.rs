//! Finds the words of a declaration that can name other declarations: not members, not attributes, not what the function itself declares.

use super::module::{Declaration, Kind, Module};
use super::token::TokenKind;
use std::collections::BTreeSet;
use std::ops::Range;

/// Attributes whose arguments are words of the language.
const WORD_ATTRIBUTES: [&str; 3] = ["builtin", "interpolate", "diagnostic"];

/// The token indices of free words outside the cuts, in order.
pub(super) fn free_words(module: &Module<'_>, declaration: &Declaration, cuts: &[Range<usize>]) -> Vec<usize> {
    let mut walk =
        Walk { module, declaration, scopes: Vec::new(), pending: Vec::new(), for_ends: Vec::new(), free: Vec::new() };
    let mut at = declaration.tokens.start;
    while at < declaration.tokens.end {
        at = if is_cut(module, cuts, at) { at + 1 } else { walk.step(at) };
    }
    walk.free
}

/// Every name that a function declares for itself, parameters included.
pub(super) fn local_names<'a>(module: &Module<'a>, declaration: &Declaration) -> BTreeSet<&'a str> {
    let mut names = BTreeSet::new();
    if declaration.kind != Kind::Function {
        return names;
    }
    for at in declaration.keyword + 1..declaration.tokens.end {
        if let Some(name) = local_name(module, at) {
            names.insert(module.word(name));
        }
        if module.word(at + 1) == ":" {
            names.insert(module.word(at));
        }
    }
    names
}

/// Whether a token lies in one of the cuts.
pub(super) fn is_cut(module: &Module<'_>, cuts: &[Range<usize>], token: usize) -> bool {
    let start = module.tokens[token].start;
    cuts.iter().any(|cut| cut.contains(&start))
}

/// The token of the name, if a local declaration begins here.
fn local_name(module: &Module<'_>, at: usize) -> Option<usize> {
    match module.word(at) {
        "let" | "const" => Some(at + 1),
        "var" if module.word(at + 1) == "<" => {
            (at..module.tokens.len()).find(|at| module.word(*at) == ">").map(|at| at + 1)
        }
        "var" => Some(at + 1),
        _ => None,
    }
}

struct Walk<'w, 'm> {
    module: &'w Module<'m>,
    declaration: &'w Declaration,
    /// Names declared by the open blocks.
    scopes: Vec<Vec<&'m str>>,
    /// Names that count from a token on: a declaration's own initializer does not see it.
    pending: Vec<(usize, &'m str)>,
    /// Closing braces of `for` bodies, which end the scope of the loop's variable too.
    for_ends: Vec<usize>,
    free: Vec<usize>,
}

impl Walk<'_, '_> {
    /// Looks at one token and returns the index of the next one to look at.
    fn step(&mut self, at: usize) -> usize {
        self.activate(at);
        let module = self.module;
        match module.word(at) {
            "@" => return self.attribute(at),
            "var" if self.scopes.is_empty() && module.word(at + 1) == "<" => {
                return local_name(module, at).unwrap_or(at + 1);
            }
            "{" if self.declaration.kind == Kind::Function => self.open(),
            "}" if self.declaration.kind == Kind::Function => self.close(at),
            "for" => self.open_for(at),
            "let" | "var" | "const" if !self.scopes.is_empty() => return self.local(at),
            _ if module.tokens[at].kind == TokenKind::Word => self.word(at),
            _ => {}
        }
        at + 1
    }

    fn attribute(&self, at: usize) -> usize {
        let arguments = at + 2;
        if WORD_ATTRIBUTES.contains(&self.module.word(at + 1)) && self.module.word(arguments) == "(" {
            self.module.closing(arguments) + 1
        } else {
            arguments
        }
    }

    fn open(&mut self) {
        let mut names = Vec::new();
        if self.scopes.is_empty() {
            names.extend(self.pending.drain(..).map(|(_, name)| name));
        }
        self.scopes.push(names);
    }

    fn close(&mut self, at: usize) {
        self.scopes.pop();
        if self.for_ends.last() == Some(&at) {
            self.for_ends.pop();
            self.scopes.pop();
        }
    }

    fn open_for(&mut self, at: usize) {
        let body = self.module.closing(at + 1) + 1;
        self.for_ends.push(self.module.closing(body));
        self.scopes.push(Vec::new());
    }

    fn local(&mut self, at: usize) -> usize {
        let Some(name) = local_name(self.module, at) else {
            return at + 1;
        };
        let limit = self.declaration.tokens.end;
        if let Some(end) = self.module.find_outside(name..limit, ";") {
            self.pending.push((end, self.module.word(name)));
        }
        name + 1
    }

    fn activate(&mut self, at: usize) {
        if self.scopes.is_empty() {
            return;
        }
        let scopes = &mut self.scopes;
        self.pending.retain(|(from, name)| {
            if *from == at
                && let Some(scope) = scopes.last_mut()
            {
                scope.push(name);
            }
            *from != at
        });
    }

    fn word(&mut self, at: usize) {
        let module = self.module;
        let word = module.word(at);
        let declares =
            module.tokens[at].start == self.declaration.name_span.start && self.declaration.kind != Kind::Assertion;
        let member = at > 0 && module.word(at - 1) == ".";
        if declares || member {
            return;
        }
        if self.scopes.is_empty() && module.word(at + 1) == ":" {
            // A parameter or a member. Of a value, the name itself stands before the colon.
            if self.declaration.kind == Kind::Function {
                self.pending.push((at, word));
            }
            return;
        }
        if !self.scopes.iter().any(|scope| scope.contains(&word)) {
            self.free.push(at);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::{FileId, FileKind, SourceFile};

    fn free(text: &str) -> Vec<String> {
        let source = SourceFile { kind: FileKind::Module, key: "m".into(), name: "m.wgsl".into(), text: text.into() };
        let module = Module::parse("m", FileId(0), &source).unwrap();
        let tokens = free_words(&module, &module.declarations[0], &[]);
        let keywords = ["fn", "if", "return", "struct", "const", "var", "alias"];
        tokens.iter().map(|token| module.word(*token).to_string()).filter(|word| !keywords.contains(&&**word)).collect()
    }

    #[test]
    fn members_attributes_and_address_spaces_are_no_references() {
        assert_eq!(
            free("@compute @workgroup_size(WG) fn f(@builtin(position) p: vec4f) -> Hit { return a.b.c; }"),
            ["WG", "vec4f", "Hit", "a"]
        );
        assert_eq!(free("struct S { a: T, b: array<U, N> }"), ["T", "array", "U", "N"]);
        assert_eq!(free("var<storage, read> nodes: array<Node>;"), ["array", "Node"]);
        assert_eq!(free("const a: u32 = b + 1u;"), ["u32", "b"]);
    }

    #[test]
    fn locals_hide_only_behind_their_declaration_and_in_their_block() {
        assert_eq!(free("fn f(a: T) { let b = b(a); b; }"), ["T", "b"]);
        assert_eq!(free("fn f() { { let b = 1; b; } b; }"), ["b"]);
        assert_eq!(free("fn f() { for (var i = i0; i < n; i++) { i; } i; }"), ["i0", "n", "i"]);
        assert_eq!(free("fn f() { var<function> x: T = x; x; }"), ["T", "x"]);
    }
}
