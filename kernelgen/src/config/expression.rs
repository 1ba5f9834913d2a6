//! `rounds` and sizes: integer arithmetic over parameters.

use super::model::{Inner, Param, ParamValue, Pipeline};
use super::suggest;
use crate::diagnostic::Diagnostic;
use crate::source::{Span, Spanned};
use indexmap::IndexMap;

/// Evaluates `rounds`: integers, names of u32 parameters, `+ - * /` (rounding down) and parentheses.
///
/// # Errors
/// K0116 with the place inside the expression: syntax, an unknown or unfit parameter, a result outside of 1 to 10,000.
pub fn evaluate_rounds(pipeline: &Pipeline) -> Result<u32, Diagnostic> {
    evaluate("rounds", &pipeline.rounds, &pipeline.params, MOST_TURNS)
}

/// Evaluates what a pipeline declares of its inner loop: its turns in every round, as many numbers as there are rounds then. In `turns`
/// the number of the round is named `round`, the first 0.
///
/// # Errors
/// K0116, as `evaluate_rounds`; there are 1000 rounds at most, and 10,000 turns in all.
pub fn evaluate_inner(pipeline: &Pipeline, inner: &Inner) -> Result<Vec<u32>, Diagnostic> {
    let rounds = evaluate("rounds", &inner.rounds, &pipeline.params, MOST_ROUNDS)?;
    let turns = |round| {
        let mut reader = Reader { round: Some(round), ..Reader::new("turns", &inner.turns, &pipeline.params) };
        reader.value(MOST_ROUNDS)
    };
    let turns = (0..rounds).map(turns).collect::<Result<Vec<u32>, _>>()?;
    let all: u32 = turns.iter().sum();
    if all > MOST_TURNS {
        return Err(Diagnostic::error("K0116", format!("`turns` come to {all} in {rounds} rounds"))
            .at(inner.turns.span, "the turns of a round")
            .also(inner.rounds.span, "how many rounds there are")
            .help(format!("they must come to {MOST_TURNS} at most: every one is recorded")));
    }
    Ok(turns)
}

/// Evaluates the `size` of something that the pipeline declares, written as `rounds`.
///
/// # Errors
/// K0116, as `evaluate_rounds`; the result is 1 to 2^17.
pub fn evaluate_size(pipeline: &Pipeline, size: &Spanned<String>) -> Result<u32, Diagnostic> {
    evaluate("size", size, &pipeline.params, MAX_SIZE)
}

/// Evaluates the `max` of a counter, written as `rounds`.
///
/// # Errors
/// K0116, as `evaluate_rounds`.
pub(super) fn evaluate_max(params: &IndexMap<String, Param>, max: &Spanned<String>) -> Result<u32, Diagnostic> {
    evaluate("max", max, params, u32::MAX)
}

/// A larger size is a mistake: there are indices for every pair of ends of the longest paths.
const MAX_SIZE: u32 = 1 << 17;

fn evaluate(
    key: &'static str,
    text: &Spanned<String>,
    params: &IndexMap<String, Param>,
    most: u32,
) -> Result<u32, Diagnostic> {
    Reader::new(key, text, params).value(most)
}

/// Rounds with an inner loop, and turns in one of them, at most; also those of all paths of a slot.
pub const MOST_ROUNDS: u32 = 1000;

/// Rounds, or turns in all rounds, at most: every dispatch of theirs is recorded.
const MOST_TURNS: u32 = 10_000;

/// Nesting beyond this is no round count but an attack on the stack.
const MAX_DEPTH: u32 = 64;

struct Reader<'a> {
    /// What the expression is the value of.
    key: &'static str,
    text: &'a Spanned<String>,
    rest: &'a str,
    params: &'a IndexMap<String, Param>,
    /// Places of the parameters met, and what they are.
    used: Vec<(Span, String)>,
    depth: u32,
    /// The value of `round`, where that is a name.
    round: Option<u32>,
}

impl<'a> Reader<'a> {
    fn new(key: &'static str, text: &'a Spanned<String>, params: &'a IndexMap<String, Param>) -> Self {
        Reader { key, text, rest: &text.value, params, used: Vec::new(), depth: 0, round: None }
    }

    /// The whole expression, from 1 to `most`.
    fn value(&mut self, most: u32) -> Result<u32, Diagnostic> {
        let value = self.sum()?;
        if self.peek().is_some() {
            return Err(self.error("an operator or the end is missing here"));
        }
        let fitting = u32::try_from(value).ok().filter(|value| (1..=most).contains(value));
        fitting.ok_or_else(|| self.outside(value, most))
    }

    fn outside(&self, value: i64, most: u32) -> Diagnostic {
        let message = format!("`{}` comes to {value}", self.key);
        let mut diagnostic = Diagnostic::error("K0116", message).at(self.text.span, format!("this is {value}"));
        for (span, what) in &self.used {
            diagnostic = diagnostic.also(*span, what);
        }
        diagnostic.help(format!("it must come to 1 to {most}"))
    }

    fn grammar(&self) -> String {
        format!("`{}` is built of integers, u32 parameters, `+ - * /` and parentheses", self.key)
    }

    fn sum(&mut self) -> Result<i64, Diagnostic> {
        let mut value = self.product()?;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.skip(1);
            let right = self.product()?;
            let result = if sign == '+' { value.checked_add(right) } else { value.checked_sub(right) };
            value = result.ok_or_else(|| self.error("too large a number"))?;
        }
        Ok(value)
    }

    fn product(&mut self) -> Result<i64, Diagnostic> {
        let mut value = self.operand()?;
        while let Some(sign @ ('*' | '/')) = self.peek() {
            self.skip(1);
            let right = self.operand()?;
            if sign == '/' && right == 0 {
                return Err(self.error("a division by 0 ends here"));
            }
            let result = if sign == '*' { value.checked_mul(right) } else { value.checked_div(right) };
            value = result.ok_or_else(|| self.error("too large a number"))?;
        }
        Ok(value)
    }

    fn operand(&mut self) -> Result<i64, Diagnostic> {
        match self.peek() {
            Some('(') => self.group(),
            Some(first) if first.is_ascii_digit() => self.number(),
            Some(first) if first.is_ascii_alphabetic() || first == '_' => self.parameter(),
            Some(_) => Err(self.error("no part of an expression")),
            None => Err(self.error("a number or a parameter is missing here")),
        }
    }

    fn group(&mut self) -> Result<i64, Diagnostic> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(self.error("too many parentheses"));
        }
        self.skip(1);
        let value = self.sum()?;
        if self.peek() != Some(')') {
            return Err(self.error("a `)` is missing here"));
        }
        self.skip(1);
        self.depth -= 1;
        Ok(value)
    }

    fn number(&mut self) -> Result<i64, Diagnostic> {
        let digits = self.word(|c| c.is_ascii_digit());
        let value =
            digits.parse::<u32>().map_err(|_| self.error_at(digits, "too large a number").help(self.grammar()))?;
        Ok(i64::from(value))
    }

    fn parameter(&mut self) -> Result<i64, Diagnostic> {
        let name = self.word(|c| c.is_ascii_alphanumeric() || c == '_');
        if let Some(round) = self.round.filter(|_| name == "round") {
            return Ok(i64::from(round));
        }
        match self.params.get(name) {
            Some(Param { value: ParamValue::U32(value), span, .. }) => {
                self.used.push((*span, format!("`{name}` is {value} in this variant")));
                Ok(i64::from(*value))
            }
            Some(param) => {
                let unfit = self.error_at(name, "not a whole number").also(param.span, "its type is not u32");
                Err(unfit.help(format!("`{}` is built of integers and u32 parameters", self.key)))
            }
            None => {
                let whole = |(name, param): (&'a String, &Param)| {
                    matches!(param.value, ParamValue::U32(_)).then_some(name.as_str())
                };
                let candidates = self.params.iter().filter_map(whole);
                let help = suggest::help(name, "u32 parameters", candidates);
                Err(self.error_at(name, "no such parameter").help(help))
            }
        }
    }

    fn word(&mut self, belongs: impl Fn(char) -> bool) -> &'a str {
        let end = self.rest.find(|c| !belongs(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word
    }

    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn skip(&mut self, bytes: usize) {
        self.rest = &self.rest[bytes..];
    }

    /// An error at the next character.
    fn error(&self, label: &str) -> Diagnostic {
        let length = self.rest.chars().next().map_or(0, char::len_utf8);
        self.error_at(&self.rest[..length], label).help(self.grammar())
    }

    /// An error at a part of the text.
    fn error_at(&self, part: &str, label: &str) -> Diagnostic {
        let offset = part.as_ptr() as usize - self.text.value.as_ptr() as usize;
        Diagnostic::error("K0116", format!("`{} = \"{}\"` cannot be evaluated", self.key, self.text.value))
            .at(self.span(offset, part.len()), label)
    }

    /// Where a part of the value stands: the value begins after its quote, unless escapes make the lengths differ.
    fn span(&self, offset: usize, length: usize) -> Span {
        let whole = self.text.span;
        let quotes = (whole.end - whole.start) as usize - self.text.value.len();
        if quotes != 0 && quotes != 2 {
            return whole;
        }
        let start = whole.start + (quotes / 2 + offset) as u32;
        Span { file: whole.file, start, end: start + length as u32 }
    }
}
