//! Reaches declarations from a root and prints them.

use super::condition::evaluate;
use super::module::{Declaration, Kind, Module, clash};
use super::prune::{dead_branches, dead_members, has_attributes};
use super::scope::{free_words, is_cut, local_names};
use super::{Constant, Constants, Linked, LinkedBinding, Modules, Root, SourceMap};
use crate::config::nearest;
use crate::diagnostic::Diagnostic;
use crate::plan::Access;
use crate::source::{Sources, Span};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::rc::Rc;

/// A declaration: module and index in it.
type Key = (usize, usize);

/// Constants that refer to constants that refer to constants: no further than this.
const CONSTANT_DEPTH: u32 = 16;

/// What is left of a declaration.
#[derive(Clone, Default)]
struct Remainder {
    cuts: Vec<Range<usize>>,
    /// Items of `features` that its conditions asked for.
    asked: BTreeSet<String>,
}

/// Links one root.
pub(super) struct Linker<'a> {
    sources: &'a Sources,
    modules: &'a Modules,
    constants: &'a Constants,
    parsed: Vec<Rc<Module<'a>>>,
    by_path: BTreeMap<String, usize>,
    remainders: BTreeMap<Key, Remainder>,
}

/// Everything reached, in order of first use.
#[derive(Default)]
struct Reached {
    order: Vec<Key>,
    known: BTreeSet<Key>,
    /// What each refers to: target and the token that says so.
    references: BTreeMap<Key, Vec<(Key, usize)>>,
    diagnostics: Vec<Diagnostic>,
}

impl<'a> Linker<'a> {
    pub(super) fn new(sources: &'a Sources, modules: &'a Modules, constants: &'a Constants) -> Self {
        Self { sources, modules, constants, parsed: Vec::new(), by_path: BTreeMap::new(), remainders: BTreeMap::new() }
    }

    pub(super) fn link(mut self, root: Root<'_>) -> Result<Linked, Vec<Diagnostic>> {
        let root = self.target(root.module, root.item, None)?;
        let reached = loop {
            let reached = self.reach(root)?;
            if !self.is_entry_point(root) || !self.cut_members(&reached) {
                break reached;
            }
        };
        let clashes = self.clashes(&reached);
        if !clashes.is_empty() {
            return Err(clashes);
        }
        self.print(&reached)
    }

    /// Whether the root makes a complete program. Only then nothing outside can see the members of its structs: the callers of a mere
    /// function may look at members that it only copies along.
    fn is_entry_point(&self, root: Key) -> bool {
        let declaration = &self.parsed[root.0].declarations[root.1];
        declaration.kind == Kind::Function && declaration.keyword != declaration.tokens.start
    }

    fn module(&mut self, path: &str, from: Option<Span>) -> Result<usize, Vec<Diagnostic>> {
        if let Some(index) = self.by_path.get(path) {
            return Ok(*index);
        }
        let Some(file) = self.modules.get(path) else {
            let hint = nearest(path, self.modules.keys().map(String::as_str));
            return Err(vec![missing(format!("there is no module `package::{path}`"), from, hint)]);
        };
        let module = Module::parse(path, *file, self.sources.file(*file))?;
        self.parsed.push(Rc::new(module));
        self.by_path.insert(path.to_string(), self.parsed.len() - 1);
        Ok(self.parsed.len() - 1)
    }

    /// A declaration by module path and name; `from` is the import that names it.
    fn target(&mut self, path: &str, item: &str, from: Option<Span>) -> Result<Key, Vec<Diagnostic>> {
        let index = self.module(path, from)?;
        let module = &self.parsed[index];
        match module.find(item) {
            Some(declaration) => Ok((index, declaration)),
            None => {
                let names = module.declarations.iter().map(|declaration| &*declaration.name);
                let message = format!("module `package::{path}` declares no `{item}`");
                Err(vec![missing(message, from, nearest(item, names))])
            }
        }
    }

    /// What a name means in a module; `None` for names that are neither declared there nor imported.
    fn resolve(&mut self, module: usize, name: &str) -> Result<Option<Key>, Vec<Diagnostic>> {
        let from = Rc::clone(&self.parsed[module]);
        if let Some(declaration) = from.find(name) {
            return Ok(Some((module, declaration)));
        }
        match from.imports.get(name) {
            Some(import) => self.target(&import.module, name, Some(import.span)).map(Some),
            None => Ok(None),
        }
    }

    fn reach(&mut self, root: Key) -> Result<Reached, Vec<Diagnostic>> {
        let mut reached = Reached::default();
        self.visit(root, &mut reached);
        let touched: BTreeSet<usize> = reached.order.iter().map(|key| key.0).collect();
        for module in touched {
            let declarations = self.parsed[module].declarations.iter().enumerate();
            let assertions: Vec<usize> =
                declarations.filter(|(_, d)| d.kind == Kind::Assertion).map(|(index, _)| index).collect();
            for assertion in assertions {
                self.visit((module, assertion), &mut reached);
            }
        }
        if reached.diagnostics.is_empty() { Ok(reached) } else { Err(reached.diagnostics) }
    }

    fn visit(&mut self, key: Key, reached: &mut Reached) {
        if !reached.known.insert(key) {
            return;
        }
        reached.order.push(key);
        let module = Rc::clone(&self.parsed[key.0]);
        let declaration = &module.declarations[key.1];
        let cuts = self.remainder(key).cuts.clone();
        let mut references = Vec::new();
        for token in free_words(&module, declaration, &cuts) {
            if module.word(token) == "package" && module.word(token + 1) == "::" {
                reached
                    .diagnostics
                    .push(inline_path(module.span(&(module.tokens[token].start..module.tokens[token].end))));
            }
            match self.resolve(key.0, module.word(token)) {
                Ok(None) => {}
                Ok(Some(target)) => {
                    references.push((target, token));
                    self.visit(target, reached);
                }
                Err(diagnostics) => {
                    let new = diagnostics.into_iter().filter(|found| !reached.diagnostics.contains(found));
                    let new: Vec<Diagnostic> = new.collect();
                    reached.diagnostics.extend(new);
                }
            }
        }
        reached.references.insert(key, references);
    }

    /// What known constants leave of a declaration.
    fn remainder(&mut self, key: Key) -> &Remainder {
        if !self.remainders.contains_key(&key) {
            let module = Rc::clone(&self.parsed[key.0]);
            let declaration = &module.declarations[key.1];
            let mut remainder = Remainder::default();
            if declaration.kind == Kind::Function {
                let locals = local_names(&module, declaration);
                let mut lookup = |name: &str| match locals.contains(name) {
                    true => None,
                    false => self.constant(key.0, name, &mut remainder.asked, 0),
                };
                remainder.cuts = dead_branches(&module, declaration, &mut lookup);
            }
            self.remainders.insert(key, remainder);
        }
        &self.remainders[&key]
    }

    /// The value of a constant by the name it has in a module: one that was given, or a `const` made of such.
    fn constant(&mut self, module: usize, name: &str, asked: &mut BTreeSet<String>, depth: u32) -> Option<Constant> {
        let from = Rc::clone(&self.parsed[module]);
        let path = from.imports.get(name).map_or(&from.path, |import| &import.module);
        if let Some(constant) = self.constants.get(&(path.clone(), name.to_string())) {
            if path == "features" {
                asked.insert(name.to_string());
            }
            return Some(*constant);
        }
        if depth == CONSTANT_DEPTH {
            return None;
        }
        // A missing import is reported where text that stays refers to it.
        let (home, index) = self.resolve(module, name).ok()??;
        let declared = Rc::clone(&self.parsed[home]);
        let declaration = &declared.declarations[index];
        if declared.word(declaration.keyword) != "const" {
            return None;
        }
        let equals = declared.find_outside(declaration.tokens.clone(), "=")?;
        evaluate(&declared, equals + 1..declaration.tokens.end - 1, &mut |name| {
            self.constant(home, name, asked, depth + 1)
        })
    }

    /// Cuts struct members that the reached text does not mention; whether anything new was cut.
    fn cut_members(&mut self, reached: &Reached) -> bool {
        let mentioned = self.mentioned_members(reached);
        let fixed = self.fixed_structs(reached);
        let mut changed = false;
        for key in &reached.order {
            let module = Rc::clone(&self.parsed[key.0]);
            let declaration = &module.declarations[key.1];
            if declaration.kind != Kind::Struct || fixed.contains(key) || has_attributes(&module, declaration) {
                continue;
            }
            let cuts = dead_members(&module, declaration, &|name| mentioned.contains(name));
            let remainder = self.remainders.entry(*key).or_default();
            changed |= remainder.cuts != cuts;
            remainder.cuts = cuts;
        }
        changed
    }

    fn mentioned_members(&self, reached: &Reached) -> BTreeSet<&'a str> {
        let mut mentioned = BTreeSet::new();
        for key in &reached.order {
            let module = &self.parsed[key.0];
            let cuts = &self.remainders[key].cuts;
            for token in module.declarations[key.1].tokens.clone().skip(1) {
                if module.word(token - 1) == "." && !is_cut(module, cuts, token) {
                    mentioned.insert(module.word(token));
                }
            }
        }
        mentioned
    }

    /// Structs whose members cannot be cut: those in buffers and those built member by member.
    fn fixed_structs(&self, reached: &Reached) -> BTreeSet<Key> {
        let mut fixed = BTreeSet::new();
        for key in &reached.order {
            let module = &self.parsed[key.0];
            let in_buffer = buffer_access(module, &module.declarations[key.1]).is_some();
            for (target, token) in &reached.references[key] {
                if in_buffer || module.word(token + 1) == "(" {
                    self.fix_type(*target, reached, &mut fixed);
                }
            }
        }
        fixed
    }

    /// Marks a type and the types in it.
    fn fix_type(&self, key: Key, reached: &Reached, fixed: &mut BTreeSet<Key>) {
        let module = &self.parsed[key.0];
        let declaration = &module.declarations[key.1];
        let alias = module.word(declaration.keyword) == "alias";
        if (declaration.kind == Kind::Struct || alias) && fixed.insert(key) {
            for (inner, _) in &reached.references[&key] {
                self.fix_type(*inner, reached, fixed);
            }
        }
    }

    fn clashes(&self, reached: &Reached) -> Vec<Diagnostic> {
        let mut first: BTreeMap<&str, Key> = BTreeMap::new();
        let mut diagnostics = Vec::new();
        for key in &reached.order {
            let module = &self.parsed[key.0];
            let declaration = &module.declarations[key.1];
            if declaration.kind == Kind::Assertion {
                continue;
            }
            match first.get(&*declaration.name) {
                Some(earlier) => {
                    let other = &self.parsed[earlier.0];
                    let earlier = other.span(&other.declarations[earlier.1].name_span);
                    diagnostics.push(clash(&declaration.name, module.span(&declaration.name_span), earlier));
                }
                None => {
                    first.insert(&declaration.name, *key);
                }
            }
        }
        diagnostics
    }

    fn print(&self, reached: &Reached) -> Result<Linked, Vec<Diagnostic>> {
        let mut printer = Printer::default();
        let mut seen: BTreeSet<String> = BTreeSet::new();
        printer.directives(reached.order.iter().map(|key| &*self.parsed[key.0]));
        for key in &reached.order {
            let module = &self.parsed[key.0];
            let declaration = &module.declarations[key.1];
            printer.declaration(module, declaration, &self.remainders[key].cuts);
            seen.extend(self.remainders[key].asked.iter().cloned());
            if module.path == "features" && declaration.kind != Kind::Assertion {
                seen.insert(declaration.name.clone());
            }
        }
        if !printer.diagnostics.is_empty() {
            return Err(printer.diagnostics);
        }
        let names = reached.order.iter().map(|key| {
            let module = &self.parsed[key.0];
            (module.path.clone(), module.declarations[key.1].name.clone())
        });
        Ok(Linked {
            text: printer.text,
            map: printer.map,
            bindings: printer.bindings,
            items: names.filter(|(_, item)| !item.is_empty()).collect(),
            constants_seen: seen.into_iter().collect(),
            mentioned: self.mentioned_imports(reached),
        })
    }

    fn mentioned_imports(&self, reached: &Reached) -> BTreeSet<(String, String)> {
        let of_declaration = |key: &Key| {
            let module = Rc::clone(&self.parsed[key.0]);
            let tokens = module.declarations[key.1].tokens.clone();
            let imported = tokens.filter_map(move |token| {
                let name = module.word(token);
                Some((module.imports.get(name)?.module.clone(), name.to_owned()))
            });
            imported.collect::<Vec<_>>()
        };
        reached.order.iter().flat_map(of_declaration).collect()
    }
}

/// Writes the linked text.
#[derive(Default)]
struct Printer {
    text: String,
    map: SourceMap,
    bindings: Vec<LinkedBinding>,
    diagnostics: Vec<Diagnostic>,
}

impl Printer {
    /// The directives of the touched modules, each once, in front of everything.
    fn directives<'m>(&mut self, modules: impl Iterator<Item = &'m Module<'m>>) {
        let mut printed = BTreeSet::new();
        for module in modules {
            for directive in &module.directives {
                if printed.insert(&module.text[directive.clone()]) {
                    self.copy(module, directive.clone());
                    self.text.push('\n');
                }
            }
        }
    }

    fn declaration(&mut self, module: &Module<'_>, declaration: &Declaration, cuts: &[Range<usize>]) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
        let first = module.tokens[declaration.tokens.start].start;
        self.text.push_str(&format!("// {}:{}\n", module.name, module.line(first)));
        let keyword = module.tokens[declaration.keyword].start;
        let mut at = declaration.text.start;
        if let Some(access) = buffer_access(module, declaration) {
            self.copy(module, at..keyword);
            self.number(module, declaration, access);
            at = keyword;
        }
        for cut in cuts {
            self.copy(module, at..cut.start);
            at = cut.end;
        }
        self.copy(module, at..declaration.text.end);
        self.text.push('\n');
    }

    fn number(&mut self, module: &Module<'_>, declaration: &Declaration, access: Access) {
        let span = module.span(&declaration.name_span);
        if declaration.keyword != declaration.tokens.start {
            let message = format!("resource `{}` brings attributes of its own", declaration.name);
            let help = "write `var<storage, read> name: type;`: the linker puts @group and @binding in front";
            self.diagnostics.push(Diagnostic::error("K0305", message).at(span, "declared here").help(help));
        }
        let binding = self.bindings.len() as u32;
        self.text.push_str(&format!("@group(0) @binding({binding}) "));
        self.bindings.push(LinkedBinding { name: declaration.name.clone(), binding, access, span });
    }

    fn copy(&mut self, module: &Module<'_>, range: Range<usize>) {
        self.map.push(self.text.len(), range.len(), module.file, range.start);
        self.text.push_str(&module.text[range]);
    }
}

/// How a kernel uses the resource that this declares, if it declares a buffer.
fn buffer_access(module: &Module<'_>, declaration: &Declaration) -> Option<Access> {
    if declaration.kind != Kind::Variable || module.word(declaration.keyword + 1) != "<" {
        return None;
    }
    let word = |offset| module.word(declaration.keyword + offset);
    match (word(2), word(4)) {
        ("uniform", _) => Some(Access::Uniform),
        ("storage", "read_write") => Some(Access::ReadWrite),
        ("storage", _) => Some(Access::Read),
        _ => None,
    }
}

fn missing(message: String, from: Option<Span>, hint: Option<&str>) -> Diagnostic {
    let mut diagnostic = Diagnostic::error("K0303", message);
    if let Some(span) = from {
        diagnostic = diagnostic.at(span, "imported here");
    }
    match hint {
        Some(name) => diagnostic.help(format!("did you mean `{name}`?")),
        None => diagnostic,
    }
}

fn inline_path(span: Span) -> Diagnostic {
    Diagnostic::error("K0306", "a path inside a declaration")
        .at(span, "this path")
        .help("import the name at the top of the module and use it alone")
}
