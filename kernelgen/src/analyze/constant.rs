//! What is known about scalar values when a stage is analysed: the few constants that they can be.

use naga::{BinaryOperator, Expression, Handle, Literal, Module, ScalarKind, Type, TypeInner, UnaryOperator};
use std::collections::BTreeSet;
use std::fmt;

/// More alternatives than this are not followed.
const MOST_ALTERNATIVES: usize = 64;

/// A scalar that decides branches or is an outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Scalar {
    Bool(bool),
    U32(u32),
    I32(i32),
}

impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Scalar::Bool(value) => write!(f, "{value}"),
            Scalar::U32(value) => write!(f, "{value}"),
            Scalar::I32(value) => write!(f, "{value}"),
        }
    }
}

/// The values that an expression can have.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Values {
    /// One of these.
    Known(BTreeSet<Scalar>),
    /// Anything.
    Unknown,
}

impl Values {
    /// No value yet: neutral under `join`.
    pub(super) fn none() -> Self {
        Values::Known(BTreeSet::new())
    }

    pub(super) fn one(scalar: Scalar) -> Self {
        Values::Known(BTreeSet::from([scalar]))
    }

    /// The value of a literal.
    pub(super) fn literal(literal: Literal) -> Self {
        match literal {
            Literal::Bool(value) => Values::one(Scalar::Bool(value)),
            Literal::U32(value) => Values::one(Scalar::U32(value)),
            Literal::I32(value) => Values::one(Scalar::I32(value)),
            _ => Values::Unknown,
        }
    }

    /// The zero of a type.
    pub(super) fn zero(module: &Module, ty: Handle<Type>) -> Self {
        match module.types[ty].inner {
            TypeInner::Scalar(scalar) => match (scalar.kind, scalar.width) {
                (ScalarKind::Bool, _) => Values::one(Scalar::Bool(false)),
                (ScalarKind::Uint, 4) => Values::one(Scalar::U32(0)),
                (ScalarKind::Sint, 4) => Values::one(Scalar::I32(0)),
                _ => Values::Unknown,
            },
            _ => Values::Unknown,
        }
    }

    /// The value of an expression at module scope.
    pub(super) fn global(module: &Module, expression: Handle<Expression>) -> Self {
        match module.global_expressions[expression] {
            Expression::Literal(literal) => Values::literal(literal),
            Expression::Constant(constant) => Values::global(module, module.constants[constant].init),
            Expression::ZeroValue(ty) => Values::zero(module, ty),
            _ => Values::Unknown,
        }
    }

    /// The values on either of two ways.
    pub(super) fn join(self, other: Values) -> Self {
        match (self, other) {
            (Values::Known(mut left), Values::Known(right)) => {
                left.extend(right);
                if left.len() > MOST_ALTERNATIVES { Values::Unknown } else { Values::Known(left) }
            }
            _ => Values::Unknown,
        }
    }

    /// The truth value, if there is only one.
    pub(super) fn truth(&self) -> Option<bool> {
        match self.single() {
            Some(Scalar::Bool(value)) => Some(value),
            _ => None,
        }
    }

    fn single(&self) -> Option<Scalar> {
        match self {
            Values::Known(values) if values.len() == 1 => values.first().copied(),
            _ => None,
        }
    }

    /// The result of a unary operator.
    pub(super) fn unary(self, operator: UnaryOperator) -> Self {
        match (operator, self) {
            (UnaryOperator::LogicalNot, Values::Known(values)) => Values::Known(
                values
                    .into_iter()
                    .map(|value| match value {
                        Scalar::Bool(value) => Scalar::Bool(!value),
                        other => other,
                    })
                    .collect(),
            ),
            _ => Values::Unknown,
        }
    }

    /// The result of a comparison or a logical operator; arithmetic is not followed.
    pub(super) fn binary(self, operator: BinaryOperator, right: Values) -> Self {
        let decisive = |wanted: bool| (self.truth() == Some(wanted) || right.truth() == Some(wanted)).then_some(wanted);
        let result = match operator {
            BinaryOperator::LogicalAnd | BinaryOperator::And => decisive(false),
            BinaryOperator::LogicalOr | BinaryOperator::InclusiveOr => decisive(true),
            _ => None,
        };
        let result = result.or_else(|| compare(operator, self.single()?, right.single()?));
        result.map_or(Values::Unknown, |value| Values::one(Scalar::Bool(value)))
    }
}

fn compare(operator: BinaryOperator, left: Scalar, right: Scalar) -> Option<bool> {
    if std::mem::discriminant(&left) != std::mem::discriminant(&right) {
        return None;
    }
    if let (Scalar::Bool(left), Scalar::Bool(right)) = (left, right) {
        return match operator {
            BinaryOperator::Equal => Some(left == right),
            BinaryOperator::NotEqual => Some(left != right),
            BinaryOperator::LogicalAnd | BinaryOperator::And => Some(left && right),
            BinaryOperator::LogicalOr | BinaryOperator::InclusiveOr => Some(left || right),
            _ => None,
        };
    }
    match operator {
        BinaryOperator::Equal => Some(left == right),
        BinaryOperator::NotEqual => Some(left != right),
        BinaryOperator::Less => Some(left < right),
        BinaryOperator::LessEqual => Some(left <= right),
        BinaryOperator::Greater => Some(left > right),
        BinaryOperator::GreaterEqual => Some(left >= right),
        _ => None,
    }
}
