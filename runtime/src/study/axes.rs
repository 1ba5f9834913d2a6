//! Products of axes: lists of pipelines, layouts, schedules and precisions, every combination of which is a variant.

use super::file::Variant;
use crate::configs::{Axis, is_path, unknown};
use crate::error::Error;
use crate::settings::RenderFile;
use serde::Deserialize;
use std::path::Path;
use toml::Spanned;

/// A list for each axis; one without a list keeps its default.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axes {
    pipeline: Option<Words>,
    layout: Option<Words>,
    schedule: Option<Words>,
    precision: Option<Words>,
}

/// Names or files, and where they stand in the text.
type Words = Spanned<Vec<Spanned<String>>>;
/// A value of an axis.
type Choice<'a> = (Axis, &'a str);

impl Axes {
    /// Every combination, the last axis fastest, named after what differs: `soa x ordered`.
    ///
    /// # Errors
    /// User input, with the line of `text`: an empty list, a value twice, a name that no shipped config has.
    pub fn variants(&self, text: &str) -> Result<Vec<Variant>, Error> {
        let lists = self.lists();
        for (axis, words) in &lists {
            check(*axis, words, text)?;
        }
        let mut product: Vec<Vec<Choice>> = vec![Vec::new()];
        for (axis, words) in &lists {
            product = product.iter().flat_map(|choices| with_each(choices, *axis, words)).collect();
        }
        let differing = |axis: Axis| lists.iter().any(|(of, words)| *of == axis && words.get_ref().len() > 1);
        product.retain(|choices| !choices.is_empty());
        Ok(product.iter().map(|choices| variant(choices, &differing)).collect())
    }

    /// The lists that are there.
    fn lists(&self) -> Vec<(Axis, &Words)> {
        let lists = [&self.pipeline, &self.layout, &self.schedule, &self.precision];
        Axis::VARIANT.into_iter().zip(lists).filter_map(|(axis, words)| Some((axis, words.as_ref()?))).collect()
    }
}

/// The choices with each value of a further axis.
fn with_each<'a>(choices: &[Choice<'a>], axis: Axis, words: &'a Words) -> Vec<Vec<Choice<'a>>> {
    words.get_ref().iter().map(|word| [choices, &[(axis, word.get_ref().as_str())]].concat()).collect()
}

fn check(axis: Axis, words: &Words, text: &str) -> Result<(), Error> {
    let place = |start: usize| format!("line {}, axes.{}", line(text, start), axis.word());
    if words.get_ref().is_empty() {
        return Err(Error::input("the list is empty")
            .at(place(words.span().start))
            .help(format!("name at least one {0}, or leave `{0}` out to take the default", axis.word())));
    }
    for (index, word) in words.get_ref().iter().enumerate() {
        let at = place(word.span().start);
        let value = word.get_ref();
        if words.get_ref()[..index].iter().any(|before| before.get_ref() == value) {
            return Err(Error::input(format!("`{value}` is listed twice")).at(at).help("once is enough"));
        }
        if !is_path(value) && axis.shipped(value).is_none() {
            return Err(unknown(axis, value).at(at));
        }
    }
    Ok(())
}

/// The number of the line that a byte of a text is in, from 1.
fn line(text: &str, at: usize) -> usize {
    text.get(..at).unwrap_or(text).matches('\n').count() + 1
}

fn variant(choices: &[Choice], differing: &dyn Fn(Axis) -> bool) -> Variant {
    let named: Vec<&Choice> = choices.iter().filter(|(axis, _)| differing(*axis)).collect();
    let named = if named.is_empty() { choices.iter().collect() } else { named };
    let names: Vec<String> = named.into_iter().map(|(_, word)| short(word)).collect();
    let word = |wanted: Axis| choices.iter().find(|(axis, _)| *axis == wanted).map(|(_, word)| (*word).to_owned());
    let settings = RenderFile {
        pipeline: word(Axis::Pipeline),
        layout: word(Axis::Layout),
        schedule: word(Axis::Schedule),
        precision: word(Axis::Precision),
        ..RenderFile::default()
    };
    Variant { name: names.join(" x "), seconds: None, settings }
}

/// A name, or the name of a file without folder and extension.
fn short(word: &str) -> String {
    if is_path(word) {
        Path::new(word).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    } else {
        word.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded(text: &str) -> Result<Vec<Variant>, Error> {
        let axes: Axes = toml::from_str(text).map_err(|error| Error::input(error.to_string()))?;
        axes.variants(text)
    }

    #[test]
    fn every_combination_is_a_variant_named_after_what_differs() -> Result<(), Error> {
        let found =
            expanded("layout = [\"aos\", \"soa\"]\nschedule = [\"wavefront\", \"inline\"]\npipeline = [\"pt\"]\n")?;
        let names: Vec<&str> = found.iter().map(|variant| variant.name.as_str()).collect();
        assert_eq!(names, ["aos x wavefront", "aos x inline", "soa x wavefront", "soa x inline"]);
        let words =
            |settings: &RenderFile| [&settings.pipeline, &settings.layout, &settings.schedule].map(Clone::clone);
        assert_eq!(words(&found[2].settings), ["pt", "soa", "wavefront"].map(|word| Some(word.to_owned())));
        assert_eq!(found[2].settings.precision, None, "an axis without a list keeps its default");
        Ok(())
    }

    #[test]
    fn a_single_combination_has_a_name_and_no_list_gives_none() -> Result<(), Error> {
        let found = expanded("layout = [\"./mine/narrow.toml\"]\nprecision = [\"f32\"]\n")?;
        assert_eq!(found.iter().map(|variant| variant.name.as_str()).collect::<Vec<_>>(), ["narrow x f32"]);
        assert!(expanded("")?.is_empty());
        Ok(())
    }

    #[track_caller]
    fn refused(text: &str, words: &[&str]) {
        let error = expanded(text).expect_err("the product is refused");
        assert_eq!(error.exit_code(), 2);
        let said = error.to_string();
        words.iter().for_each(|word| assert!(said.contains(word), "`{word}` is not in: {said}"));
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        refused("layout = [\"aos\"]\nschedule = []\n", &["line 2, axes.schedule", "empty", "at least one schedule"]);
        refused("layout = [\n  \"aos\",\n  \"aos\",\n]\n", &["line 3, axes.layout", "`aos` is listed twice"]);
        refused("layout = [\"aos\", \"sao\"]\n", &["line 1, axes.layout", "no layout named `sao`", "did you mean"]);
        refused("layouts = [\"aos\"]\n", &["unknown field `layouts`", "`layout`"]);
        refused("layout = \"aos\"\n", &["invalid type", "layout = \"aos\""]);
    }
}
