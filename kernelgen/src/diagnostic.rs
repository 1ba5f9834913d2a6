//! Errors and warnings that point into the user's texts.

use crate::source::{Sources, Span};
use codespan_reporting::diagnostic as codespan;
use codespan_reporting::files::SimpleFiles;
use codespan_reporting::term;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// Nothing is generated.
    Error,
    /// The generator goes on.
    Warning,
}

/// A place in a text and what is to be said about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// The place.
    pub span: Span,
    /// What is there.
    pub message: String,
    /// Whether this is the place of the error itself, or one that explains it.
    pub primary: bool,
}

/// One finding: code, message, labelled places, help.
///
/// Codes: K01xx config, K02xx wiring, K03xx WGSL, K04xx layout; `docs/diagnostics.md` lists them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// The code, `K0203`.
    pub code: &'static str,
    /// One line that says what is wrong, with the value.
    pub message: String,
    /// The places.
    pub labels: Vec<Label>,
    /// What would be valid.
    pub help: Vec<String>,
}

impl Diagnostic {
    /// An error without places yet.
    pub fn error(code: &'static str, message: impl Into<String>) -> Self {
        Self { severity: Severity::Error, code, message: message.into(), labels: Vec::new(), help: Vec::new() }
    }

    /// A warning without places yet.
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(code, message) }
    }

    /// Adds the place of the error.
    pub fn at(mut self, span: Span, message: impl Into<String>) -> Self {
        self.labels.push(Label { span, message: message.into(), primary: true });
        self
    }

    /// Adds a place that explains the error.
    pub fn also(mut self, span: Span, message: impl Into<String>) -> Self {
        self.labels.push(Label { span, message: message.into(), primary: false });
        self
    }

    /// Adds a line that says what would be valid.
    pub fn help(mut self, message: impl Into<String>) -> Self {
        self.help.push(message.into());
        self
    }
}

/// Renders diagnostics as text, with ANSI colours when asked for.
pub fn render(diagnostics: &[Diagnostic], sources: &Sources, colour: bool) -> String {
    let mut files = SimpleFiles::new();
    let mut index = 0;
    while let Some(file) = sources.get(crate::source::FileId(index)) {
        files.add(file.name.clone(), file.text.clone());
        index += 1;
    }
    let mut out = String::new();
    for diagnostic in diagnostics {
        out.push_str(&render_one(diagnostic, &files, colour));
    }
    out
}

fn render_one(diagnostic: &Diagnostic, files: &SimpleFiles<String, String>, colour: bool) -> String {
    let severity = match diagnostic.severity {
        Severity::Error => codespan::Severity::Error,
        Severity::Warning => codespan::Severity::Warning,
    };
    let labels = diagnostic.labels.iter().map(|label| {
        let style = if label.primary { codespan::LabelStyle::Primary } else { codespan::LabelStyle::Secondary };
        codespan::Label::new(style, label.span.file.0 as usize, label.span.start as usize..label.span.end as usize)
            .with_message(&label.message)
    });
    let notes = diagnostic.help.iter().map(|help| format!("help: {help}"));
    let shown = codespan::Diagnostic::new(severity)
        .with_code(diagnostic.code)
        .with_message(&diagnostic.message)
        .with_labels(labels.collect())
        .with_notes(notes.collect());
    shown_as_text(&shown, files, colour).unwrap_or_else(|_| without_places(diagnostic))
}

fn shown_as_text(
    shown: &codespan::Diagnostic<usize>,
    files: &SimpleFiles<String, String>,
    colour: bool,
) -> Result<String, codespan_reporting::files::Error> {
    let config = term::Config::default();
    if !colour {
        return term::emit_into_string(&config, files, shown);
    }
    let mut writer = term::termcolor::Ansi::new(Vec::new());
    term::emit_to_write_style(&mut writer, &config, files, shown)?;
    Ok(String::from_utf8_lossy(writer.get_ref()).into_owned())
}

/// What is left to say when a label points outside of its text.
fn without_places(diagnostic: &Diagnostic) -> String {
    let severity = match diagnostic.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    let mut text = format!("{severity}[{}]: {}\n", diagnostic.code, diagnostic.message);
    for help in &diagnostic.help {
        text.push_str(&format!("  = help: {help}\n"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{Diagnostic, render};
    use crate::source::{FileId, FileKind, Sources, Span};

    fn rendered(start: u32, end: u32, colour: bool) -> String {
        let mut sources = Sources::default();
        let file = sources.add(FileKind::Config, "a.toml", "a.toml", "lane = 3\n");
        let span = Span { file, start, end };
        render(&[Diagnostic::error("K0107", "wrong").at(span, "this").help("write 4")], &sources, colour)
    }

    #[test]
    fn shows_the_place_and_the_help() {
        let text = rendered(7, 8, false);
        assert!(text.starts_with("error[K0107]: wrong\n"));
        assert!(text.contains("a.toml:1:8") && text.contains("^ this") && text.contains("= help: write 4"), "{text}");
    }

    #[test]
    fn colours_only_when_asked() {
        assert!(rendered(7, 8, true).contains('\x1b'));
        assert!(!rendered(7, 8, false).contains('\x1b'));
    }

    #[test]
    fn a_place_outside_of_its_text_loses_no_message() {
        let nowhere = Span { file: FileId(7), start: 0, end: 1 };
        let lost =
            render(&[Diagnostic::warning("K0207", "odd").at(nowhere, "here").help("look")], &Sources::default(), false);
        assert_eq!(lost, "warning[K0207]: odd\n  = help: look\n");
    }
}
