//! What loaded values are used for: of a struct, which members (`let hit = walk.hit; hit.t` needs `t` alone); and whether a value is
//! only stored elsewhere.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Block, Expression, Function, Handle, Module, Statement, TypeInner};

/// naga's count of the uses of every expression.
pub(super) struct Uses<'m> {
    module: &'m Module,
    /// Nothing for an invalid module: every load then counts as a whole.
    info: Option<ModuleInfo>,
}

impl<'m> Uses<'m> {
    pub(super) fn new(module: &'m Module) -> Self {
        let mut counter = Validator::new(ValidationFlags::empty(), Capabilities::all());
        Uses { module, info: counter.validate(module).ok() }
    }

    /// Member paths into the value of an expression that cover everything used of it; the empty path is all of it.
    pub(super) fn paths(&self, function: Handle<Function>, expression: Handle<Expression>) -> Vec<Vec<u32>> {
        let Some(info) = self.info.as_ref().map(|info| &info[function]) else {
            return vec![Vec::new()];
        };
        if !matches!(info[expression].ty.inner_with(&self.module.types), TypeInner::Struct { .. }) {
            return vec![Vec::new()];
        }
        let members: Vec<(Handle<Expression>, u32)> = self.members(function, expression).collect();
        if members.len() != info[expression].ref_count {
            return vec![Vec::new()];
        }
        let inner = members.into_iter().flat_map(|(member, index)| {
            let paths = self.paths(function, member).into_iter();
            paths.map(move |path| [vec![index], path].concat())
        });
        inner.collect()
    }

    /// Whether nothing is done with the value of an expression but to store it.
    pub(super) fn is_only_stored(&self, function: Handle<Function>, expression: Handle<Expression>) -> bool {
        let uses = self.info.as_ref().map(|info| info[function][expression].ref_count);
        uses == Some(stores(&self.module.functions[function].body, expression))
    }

    /// The expressions that take one member of a value.
    fn members(
        &self,
        function: Handle<Function>,
        value: Handle<Expression>,
    ) -> impl Iterator<Item = (Handle<Expression>, u32)> + '_ {
        self.module.functions[function].expressions.iter().filter_map(move |(handle, expression)| match expression {
            Expression::AccessIndex { base, index } if *base == value => Some((handle, *index)),
            _ => None,
        })
    }
}

/// How often a block stores a value.
fn stores(block: &Block, stored: Handle<Expression>) -> usize {
    let count = |statement: &Statement| match statement {
        Statement::Store { value, .. } => usize::from(*value == stored),
        Statement::Block(block) => stores(block, stored),
        Statement::If { accept, reject, .. } => stores(accept, stored) + stores(reject, stored),
        Statement::Switch { cases, .. } => cases.iter().map(|case| stores(&case.body, stored)).sum(),
        Statement::Loop { body, continuing, .. } => stores(body, stored) + stores(continuing, stored),
        _ => 0,
    };
    block.iter().map(count).sum()
}
