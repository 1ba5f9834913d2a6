//! Three-valued evaluation of a condition over constants known when text is linked.

use super::Constant;
use super::module::Module;
use super::token::TokenKind;
use std::ops::Range;

const COMPARISONS: [&str; 6] = ["==", "!=", "<=", ">=", "<", ">"];

/// The value of the expression in these tokens of a module; `None` where it depends on anything that `lookup` does not know.
/// Operands that cannot change the result any more are not looked up.
pub(super) fn evaluate(
    module: &Module<'_>,
    tokens: Range<usize>,
    lookup: &mut dyn FnMut(&str) -> Option<Constant>,
) -> Option<Constant> {
    Evaluator { module, lookup }.value(tokens)
}

/// The value of the expression if it is a known bool.
pub(super) fn truth(
    module: &Module<'_>,
    tokens: Range<usize>,
    lookup: &mut dyn FnMut(&str) -> Option<Constant>,
) -> Option<bool> {
    as_bool(evaluate(module, tokens, lookup))
}

fn as_bool(value: Option<Constant>) -> Option<bool> {
    match value {
        Some(Constant::Bool(value)) => Some(value),
        _ => None,
    }
}

struct Evaluator<'e, 'm> {
    module: &'e Module<'m>,
    lookup: &'e mut dyn FnMut(&str) -> Option<Constant>,
}

impl Evaluator<'_, '_> {
    fn value(&mut self, tokens: Range<usize>) -> Option<Constant> {
        if let Some(value) = self.logical(&tokens, "||", true) {
            return value.map(Constant::Bool);
        }
        if let Some(value) = self.logical(&tokens, "&&", false) {
            return value.map(Constant::Bool);
        }
        let comparisons = self.positions(&tokens, &COMPARISONS);
        match comparisons[..] {
            [] => self.unary(tokens),
            [at] => {
                let left = self.value(tokens.start..at)?;
                let right = self.value(at + 1..tokens.end)?;
                compare(self.module.word(at), left, right).map(Constant::Bool)
            }
            _ => None,
        }
    }

    /// A chain of one logical operator, if the expression is one; `decisive` is the operand that decides alone.
    fn logical(&mut self, tokens: &Range<usize>, operator: &str, decisive: bool) -> Option<Option<bool>> {
        let mut ends = self.positions(tokens, &[operator]);
        if ends.is_empty() {
            return None;
        }
        ends.push(tokens.end);
        let mut start = tokens.start;
        let mut result = Some(!decisive);
        for end in ends {
            match as_bool(self.value(start..end)) {
                Some(value) if value == decisive => return Some(Some(decisive)),
                Some(_) => {}
                None => result = None,
            }
            start = end + 1;
        }
        Some(result)
    }

    fn unary(&mut self, tokens: Range<usize>) -> Option<Constant> {
        if tokens.is_empty() {
            return None;
        }
        let first = self.module.word(tokens.start);
        if first == "!" {
            let operand = as_bool(self.unary(tokens.start + 1..tokens.end))?;
            return Some(Constant::Bool(!operand));
        }
        if first == "(" && self.module.closing(tokens.start) + 1 == tokens.end {
            return self.value(tokens.start + 1..tokens.end - 1);
        }
        if tokens.len() != 1 {
            return None;
        }
        match (first, self.module.tokens[tokens.start].kind) {
            ("true", _) => Some(Constant::Bool(true)),
            ("false", _) => Some(Constant::Bool(false)),
            (number, TokenKind::Number) => literal(number),
            (name, TokenKind::Word) => (self.lookup)(name),
            _ => None,
        }
    }

    /// Where one of the operators stands outside brackets.
    fn positions(&self, tokens: &Range<usize>, operators: &[&str]) -> Vec<usize> {
        let mut found = Vec::new();
        let mut at = tokens.start;
        while at < tokens.end {
            match self.module.word(at) {
                "(" | "[" => at = self.module.closing(at),
                word if operators.contains(&word) => found.push(at),
                _ => {}
            }
            at += 1;
        }
        found
    }
}

fn literal(text: &str) -> Option<Constant> {
    if let Some(hex) = text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        return u32::from_str_radix(hex.trim_end_matches('u'), 16).ok().map(Constant::U32);
    }
    if let Ok(whole) = text.trim_end_matches('u').parse() {
        return Some(Constant::U32(whole));
    }
    let digits = text.strip_suffix("lf").unwrap_or(text.trim_end_matches(['f', 'h']));
    digits.parse().ok().map(Constant::Real)
}

fn compare(operator: &str, left: Constant, right: Constant) -> Option<bool> {
    let ordering = match (left, right) {
        (Constant::Bool(left), Constant::Bool(right)) => {
            return match operator {
                "==" => Some(left == right),
                "!=" => Some(left != right),
                _ => None,
            };
        }
        (left, right) => number(left)?.partial_cmp(&number(right)?)?,
    };
    match operator {
        "==" => Some(ordering.is_eq()),
        "!=" => Some(ordering.is_ne()),
        "<" => Some(ordering.is_lt()),
        "<=" => Some(ordering.is_le()),
        ">" => Some(ordering.is_gt()),
        ">=" => Some(ordering.is_ge()),
        _ => None,
    }
}

fn number(constant: Constant) -> Option<f64> {
    match constant {
        Constant::Bool(_) => None,
        Constant::U32(value) => Some(f64::from(value)),
        Constant::Real(value) => Some(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::{FileId, FileKind, SourceFile};

    fn truth_of(condition: &str) -> Option<bool> {
        let source = SourceFile {
            kind: FileKind::Module,
            key: "m".into(),
            name: "m.wgsl".into(),
            text: format!("const_assert {condition};"),
        };
        let module = Module::parse("m", FileId(0), &source).unwrap();
        let mut lookup = |name: &str| match name {
            "T" => Some(Constant::Bool(true)),
            "F" => Some(Constant::Bool(false)),
            "three" => Some(Constant::U32(3)),
            "half" => Some(Constant::Real(0.5)),
            _ => None,
        };
        truth(&module, 1..module.tokens.len() - 1, &mut lookup)
    }

    #[test]
    fn known_operands_decide_and_unknown_ones_do_not() {
        for (condition, expected) in [
            ("T", Some(true)),
            ("!T", Some(false)),
            ("!!T", Some(true)),
            ("x", None),
            ("F && x", Some(false)),
            ("x && F", Some(false)),
            ("T && x", None),
            ("x || T", Some(true)),
            ("F || x", None),
            ("!(x && F)", Some(true)),
            ("(T || x) && (F || T)", Some(true)),
            ("three == 3u", Some(true)),
            ("three != 0x3", Some(false)),
            ("three < 4", Some(true)),
            ("three >= 4u && x", Some(false)),
            ("half > 0.25", Some(true)),
            ("half <= 1.0f", Some(true)),
            ("T == F", Some(false)),
            ("T != !T", Some(true)),
            ("T < F", None),
            ("three + 1u == 4u", None),
            ("f(T)", None),
            ("T & F", None),
            ("s.T", None),
            ("vec2<bool>(T, F).x", None),
        ] {
            assert_eq!(truth_of(condition), expected, "{condition}");
        }
    }
}
