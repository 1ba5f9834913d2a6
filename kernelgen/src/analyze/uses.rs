//! Which members of a loaded struct are used: `let hit = walk.hit; hit.t` needs `t` alone.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Expression, Function, Handle, Module, TypeInner};

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
