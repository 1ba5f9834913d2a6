//! The texts the generator is given, and positions in them.

/// One text: a TOML config, a WGSL module, a command-line override or a generated module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FileId(pub u32);

/// A byte range of one text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Span {
    /// The text.
    pub file: FileId,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// A value and the place where it was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Where it stands.
    pub span: Span,
}

/// What a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A TOML file of one of the axes; its key is the path below `configs/` (`pipelines/pt.toml`).
    Config,
    /// A WGSL module; its key is the path below the WGSL root without extension (`bsdf/lambert`).
    Module,
}

/// One text with its names.
#[derive(Clone, Debug)]
pub struct SourceFile {
    /// What it is.
    pub kind: FileKind,
    /// How other texts refer to it.
    pub key: String,
    /// The name printed in diagnostics and above copied declarations.
    pub name: String,
    /// The text.
    pub text: String,
}

/// Every text the generator may read. It reads nothing else: no file system, no clock.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    files: Vec<SourceFile>,
}

impl Sources {
    /// Adds a text and returns its id. A later text with the same kind and key replaces the earlier one for look-ups.
    pub fn add(
        &mut self,
        kind: FileKind,
        key: impl Into<String>,
        name: impl Into<String>,
        text: impl Into<String>,
    ) -> FileId {
        self.files.push(SourceFile { kind, key: key.into(), name: name.into(), text: text.into() });
        FileId(self.files.len() as u32 - 1)
    }

    /// The text behind an id.
    pub fn file(&self, id: FileId) -> &SourceFile {
        &self.files[id.0 as usize]
    }

    /// The text behind an id, if there is one.
    pub fn get(&self, id: FileId) -> Option<&SourceFile> {
        self.files.get(id.0 as usize)
    }

    /// The newest text of this kind and key.
    pub fn find(&self, kind: FileKind, key: &str) -> Option<FileId> {
        let position = self.files.iter().rposition(|file| file.kind == kind && file.key == key)?;
        Some(FileId(position as u32))
    }

    /// All texts of a kind, in the order they were added, replaced ones left out.
    pub fn of_kind(&self, kind: FileKind) -> impl Iterator<Item = (FileId, &SourceFile)> {
        self.files.iter().enumerate().filter_map(move |(index, file)| {
            let id = FileId(index as u32);
            (file.kind == kind && self.find(kind, &file.key) == Some(id)).then_some((id, file))
        })
    }
}
