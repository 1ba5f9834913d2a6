//! Splits a module into imports and top-level declarations, each with its comments.

use super::token::{Lexed, Token, TokenKind, lex, span};
use crate::diagnostic::Diagnostic;
use crate::source::{FileId, SourceFile, Span};
use std::collections::BTreeMap;
use std::ops::Range;

/// What a declaration declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Function,
    Struct,
    Variable,
    /// `const`, `override`, `alias`.
    Value,
    /// `const_assert`, which has no name.
    Assertion,
}

/// A top-level declaration.
#[derive(Clone, Debug)]
pub(super) struct Declaration {
    pub kind: Kind,
    /// Its name; empty for assertions.
    pub name: String,
    /// Where the name stands.
    pub name_span: Range<usize>,
    /// Its text, comments directly above it and behind it included.
    pub text: Range<usize>,
    /// Its tokens, attributes included: indices into `Module::tokens`.
    pub tokens: Range<usize>,
    /// The index of its keyword, behind the attributes.
    pub keyword: usize,
}

/// An imported name.
#[derive(Clone, Debug)]
pub(super) struct Import {
    /// Module path without `package::`.
    pub module: String,
    /// Where the name stands.
    pub span: Span,
}

/// A module in parts.
#[derive(Debug)]
pub(super) struct Module<'a> {
    pub path: String,
    pub file: FileId,
    /// The file's name, printed above copied declarations.
    pub name: &'a str,
    pub text: &'a str,
    pub tokens: Vec<Token>,
    /// `enable ..;` and the like.
    pub directives: Vec<Range<usize>>,
    /// Imported names; an item keeps its name.
    pub imports: BTreeMap<String, Import>,
    pub declarations: Vec<Declaration>,
    by_name: BTreeMap<String, usize>,
}

impl<'a> Module<'a> {
    /// Splits the text of a module.
    ///
    /// # Errors
    /// K0301 for text that is no sequence of declarations, K0302 for two of one name.
    pub(super) fn parse(path: &str, file: FileId, source: &'a SourceFile) -> Result<Self, Vec<Diagnostic>> {
        let lexed = lex(file, &source.text).map_err(|diagnostic| vec![diagnostic])?;
        let module = Module {
            path: path.to_string(),
            file,
            name: &source.name,
            text: &source.text,
            tokens: Vec::new(),
            directives: Vec::new(),
            imports: BTreeMap::new(),
            declarations: Vec::new(),
            by_name: BTreeMap::new(),
        };
        Splitter { module, comments: lexed.comments.clone(), at: 0 }.run(lexed)
    }

    /// The declaration of a name.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// The text of a token.
    pub(super) fn word(&self, token: usize) -> &'a str {
        self.tokens.get(token).map_or("", |token| &self.text[token.start..token.end])
    }

    /// The place of a stretch of the text.
    pub(super) fn span(&self, range: &Range<usize>) -> Span {
        span(self.file, range.start, range.end)
    }

    /// The index of the bracket that closes the one at `open`.
    pub(super) fn closing(&self, open: usize) -> usize {
        let mut depth = 0usize;
        for index in open..self.tokens.len() {
            match self.word(index) {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth == 0 {
                return index;
            }
        }
        self.tokens.len() - 1
    }

    /// The index of the first token in `range` outside brackets that reads `wanted`.
    pub(super) fn find_outside(&self, range: Range<usize>, wanted: &str) -> Option<usize> {
        let mut at = range.start;
        while at < range.end {
            match self.word(at) {
                word if word == wanted => return Some(at),
                "(" | "[" | "{" => at = self.closing(at),
                _ => {}
            }
            at += 1;
        }
        None
    }

    /// The line of a byte, from 1.
    pub(super) fn line(&self, offset: usize) -> usize {
        self.text[..offset].matches('\n').count() + 1
    }
}

/// Walks over the top level of a module.
struct Splitter<'a> {
    module: Module<'a>,
    comments: Vec<Range<usize>>,
    at: usize,
}

impl<'a> Splitter<'a> {
    fn run(mut self, lexed: Lexed) -> Result<Module<'a>, Vec<Diagnostic>> {
        self.module.tokens = lexed.tokens;
        while self.at < self.module.tokens.len() {
            self.item().map_err(|diagnostic| vec![diagnostic])?;
        }
        let clashes = self.clashes();
        if clashes.is_empty() { Ok(self.module) } else { Err(clashes) }
    }

    fn item(&mut self) -> Result<(), Diagnostic> {
        match self.module.word(self.at) {
            ";" => self.at += 1,
            "import" => self.import()?,
            "enable" | "requires" | "diagnostic" => {
                let end = self.semicolon()?;
                let range = self.module.tokens[self.at].start..self.module.tokens[end].end;
                self.module.directives.push(range);
                self.at = end + 1;
            }
            _ => self.declaration()?,
        }
        Ok(())
    }

    fn declaration(&mut self) -> Result<(), Diagnostic> {
        let first = self.at;
        let keyword = self.skip_attributes();
        let kind = match self.module.word(keyword) {
            "fn" => Kind::Function,
            "struct" => Kind::Struct,
            "var" => Kind::Variable,
            "const" | "override" | "alias" => Kind::Value,
            "const_assert" => Kind::Assertion,
            other => {
                let message = format!("a declaration cannot begin with `{other}`");
                let help =
                    "at the top of a module stand import, fn, struct, const, override, alias, var and const_assert";
                return Err(self.error(keyword.min(self.module.tokens.len() - 1), message).help(help));
            }
        };
        let last = match kind {
            Kind::Function | Kind::Struct => self.body_end(keyword)?,
            _ => self.semicolon()?,
        };
        let name = self.name_of(kind, keyword)?;
        let name_span = self.module.tokens[name].start..self.module.tokens[name].end;
        let text = self.start_with_comments(first)..self.end_with_comment(last);
        self.module.declarations.push(Declaration {
            kind,
            name: if kind == Kind::Assertion { String::new() } else { self.module.word(name).to_string() },
            name_span,
            text,
            tokens: first..last + 1,
            keyword,
        });
        self.at = last + 1;
        Ok(())
    }

    /// The index behind `@name` and `@name(..)`.
    fn skip_attributes(&self) -> usize {
        let mut at = self.at;
        while self.module.word(at) == "@" {
            at += 2;
            if self.module.word(at) == "(" {
                at = self.module.closing(at) + 1;
            }
        }
        at
    }

    fn name_of(&self, kind: Kind, keyword: usize) -> Result<usize, Diagnostic> {
        let mut at = keyword + 1;
        if kind == Kind::Assertion {
            return Ok(keyword);
        }
        if kind == Kind::Variable && self.module.word(at) == "<" {
            while self.module.word(at) != ">" && at < self.module.tokens.len() {
                at += 1;
            }
            at += 1;
        }
        match self.module.tokens.get(at) {
            Some(token) if token.kind == TokenKind::Word => Ok(at),
            _ => {
                let message = format!("`{}` without a name", self.module.word(keyword));
                Err(self.error(keyword, message))
            }
        }
    }

    fn body_end(&self, keyword: usize) -> Result<usize, Diagnostic> {
        match self.module.find_outside(keyword..self.module.tokens.len(), "{") {
            Some(open) => Ok(self.module.closing(open)),
            None => Err(self.error(keyword, format!("`{}` without a body", self.module.word(keyword)))),
        }
    }

    fn semicolon(&self) -> Result<usize, Diagnostic> {
        match self.module.find_outside(self.at..self.module.tokens.len(), ";") {
            Some(end) => Ok(end),
            None => Err(self.error(self.at, "a `;` is missing behind this declaration")),
        }
    }

    /// `import package::a::{b::X, c::{Y, Z}};`
    fn import(&mut self) -> Result<(), Diagnostic> {
        let end = self.semicolon()?;
        if self.module.word(self.at + 1) != "package" || self.module.word(self.at + 2) != "::" {
            return Err(self
                .error(self.at + 1, "an import begins with `package::`")
                .help("import package::folder::module::{item, other_item};"));
        }
        self.import_tree(self.at + 3..end, Vec::new())?;
        self.at = end + 1;
        Ok(())
    }

    fn import_tree(&mut self, range: Range<usize>, mut path: Vec<String>) -> Result<(), Diagnostic> {
        let mut at = range.start;
        while at + 1 < range.end && self.module.word(at + 1) == "::" {
            path.push(self.module.word(at).to_string());
            at += 2;
        }
        if self.module.word(at) == "{" && self.module.closing(at) + 1 == range.end {
            return self.import_list(at + 1..range.end - 1, &path);
        }
        let is_name = self.module.tokens.get(at).is_some_and(|token| token.kind == TokenKind::Word);
        if !is_name || at + 1 != range.end {
            return Err(self.error(at.min(range.end), "this is not an import").help(
                "names are imported as they are (`as` is not available): import package::module::{item, other_item};",
            ));
        }
        self.add_import(at, &path)
    }

    fn import_list(&mut self, range: Range<usize>, path: &[String]) -> Result<(), Diagnostic> {
        let mut start = range.start;
        while start < range.end {
            let end = self.module.find_outside(start..range.end, ",").unwrap_or(range.end);
            self.import_tree(start..end, path.to_vec())?;
            start = end + 1;
        }
        Ok(())
    }

    fn add_import(&mut self, token: usize, path: &[String]) -> Result<(), Diagnostic> {
        let name = self.module.word(token).to_string();
        let span = span(self.module.file, self.module.tokens[token].start, self.module.tokens[token].end);
        let module = path.join("::");
        if let Some(earlier) = self.module.imports.get(&name).filter(|earlier| earlier.module != module) {
            let message = format!("`{name}` is imported from two modules");
            return Err(Diagnostic::error("K0302", message)
                .at(span, format!("here from `package::{module}`"))
                .also(earlier.span, format!("here from `package::{}`", earlier.module))
                .help("names are printed as they are written: import it from one of the two"));
        }
        self.module.imports.insert(name, Import { module, span });
        Ok(())
    }

    /// The start of a declaration with the comments that stand on the lines directly above it.
    fn start_with_comments(&self, first: usize) -> usize {
        let floor = if first == 0 { 0 } else { self.module.tokens[first - 1].end };
        let mut start = self.module.tokens[first].start;
        let before = self.comments.partition_point(|comment| comment.end <= start);
        for comment in self.comments[..before].iter().rev() {
            let gap = &self.module.text[comment.end..start];
            if comment.start < floor || !gap.trim().is_empty() || gap.matches('\n').count() > 1 {
                break;
            }
            if floor > 0 && !self.module.text[floor..comment.start].contains('\n') {
                break;
            }
            start = comment.start;
        }
        start
    }

    /// The end of a declaration with a comment behind it on its last line.
    fn end_with_comment(&self, last: usize) -> usize {
        let end = self.module.tokens[last].end;
        let comment = self.comments.iter().find(|comment| comment.start >= end);
        match comment {
            Some(comment) if self.module.text[end..comment.start].chars().all(|c| c == ' ' || c == '\t') => {
                let behind = self.module.text[comment.end..].trim_start_matches([' ', '\t', '\r']);
                if behind.is_empty() || behind.starts_with('\n') { comment.end } else { end }
            }
            _ => end,
        }
    }

    fn clashes(&mut self) -> Vec<Diagnostic> {
        let mut diagnostics = Vec::new();
        let module = &mut self.module;
        for (index, declaration) in module.declarations.iter().enumerate() {
            if declaration.kind == Kind::Assertion {
                continue;
            }
            let here = span(module.file, declaration.name_span.start, declaration.name_span.end);
            let earlier = match module.by_name.get(&declaration.name) {
                Some(earlier) => {
                    let range = &module.declarations[*earlier].name_span;
                    Some(span(module.file, range.start, range.end))
                }
                None => module.imports.get(&declaration.name).map(|import| import.span),
            };
            match earlier {
                Some(earlier) => diagnostics.push(clash(&declaration.name, here, earlier)),
                None => {
                    module.by_name.insert(declaration.name.clone(), index);
                }
            }
        }
        diagnostics
    }

    fn error(&self, token: usize, message: impl Into<String>) -> Diagnostic {
        let place = &self.module.tokens[token.min(self.module.tokens.len() - 1)];
        Diagnostic::error("K0301", message).at(span(self.module.file, place.start, place.end), "here")
    }
}

/// Two things of one name.
pub(super) fn clash(name: &str, here: Span, earlier: Span) -> Diagnostic {
    Diagnostic::error("K0302", format!("two declarations of `{name}`"))
        .at(here, "declared here")
        .also(earlier, "and here")
        .help("names are printed as they are written: rename one of them")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(text: &str) -> SourceFile {
        SourceFile { kind: crate::source::FileKind::Module, key: "m".into(), name: "m.wgsl".into(), text: text.into() }
    }

    #[test]
    fn a_module_splits_into_declarations_with_their_comments() {
        let source = source(concat!(
            "// About the file.\n\nenable f16;\nimport package::a::{b::X, c::{Y, Z,}};\n\n",
            "/// Doc.\n/// More.\n@compute @workgroup_size(64)\nfn main() { if true {} }\n",
            "const A: u32 = 1u; // one\n// of B\nvar<storage, read> b: array<vec4<u32>>;\n",
            "struct S { a: u32, }\nconst_assert A == 1u;\n",
        ));
        let module = Module::parse("m", FileId(0), &source).unwrap();
        let texts: Vec<&str> =
            module.declarations.iter().map(|declaration| &source.text[declaration.text.clone()]).collect();
        assert_eq!(
            texts,
            [
                "/// Doc.\n/// More.\n@compute @workgroup_size(64)\nfn main() { if true {} }",
                "const A: u32 = 1u; // one",
                "// of B\nvar<storage, read> b: array<vec4<u32>>;",
                "struct S { a: u32, }",
                "const_assert A == 1u;",
            ]
        );
        let names: Vec<&str> = module.declarations.iter().map(|declaration| &*declaration.name).collect();
        assert_eq!(names, ["main", "A", "b", "S", ""]);
        assert_eq!(&source.text[module.directives[0].clone()], "enable f16;");
        let imports: Vec<(&str, &str)> =
            module.imports.iter().map(|(name, import)| (&**name, &*import.module)).collect();
        assert_eq!(imports, [("X", "a::b"), ("Y", "a::c"), ("Z", "a::c")]);
    }

    #[test]
    fn wrong_modules_are_refused() {
        let code = |text: &str| Module::parse("m", FileId(0), &source(text)).unwrap_err()[0].code;
        assert_eq!(code("import package::a::b as c;"), "K0301");
        assert_eq!(code("import super::a;"), "K0301");
        assert_eq!(code("let a = 1;"), "K0301");
        assert_eq!(code("const a = 1"), "K0301");
        assert_eq!(code("@compute"), "K0301");
        assert_eq!(code("const a = 1; fn a() {}"), "K0302");
        assert_eq!(code("import package::a::b; import package::c::b;"), "K0302");
    }
}
