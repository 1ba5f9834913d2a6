//! What a function takes and returns.

use naga::{AddressSpace, Module, Scalar, TypeInner};

/// Parameters and result of a function.
#[derive(Clone, Debug, Default)]
pub(super) struct Signature {
    /// Parameter name, and the record it points to; `None` for anything but a pointer to a struct in function space.
    pub params: Vec<(String, Option<String>)>,
    /// Whether it returns a `u32`.
    pub returns_u32: bool,
    /// Whether it returns nothing.
    pub returns_nothing: bool,
}

/// The signature of a function of the module; empty if there is no such function.
pub(super) fn signature(module: &Module, name: &str) -> Signature {
    let named = |(_, function): &(_, &naga::Function)| function.name.as_deref() == Some(name);
    let Some((_, function)) = module.functions.iter().find(named) else { return Signature::default() };
    let params = function
        .arguments
        .iter()
        .map(|argument| (argument.name.clone().unwrap_or_default(), record_of(module, argument.ty)));
    let result = function.result.as_ref().map(|result| &module.types[result.ty].inner);
    Signature {
        params: params.collect(),
        returns_u32: result == Some(&TypeInner::Scalar(Scalar::U32)),
        returns_nothing: result.is_none(),
    }
}

fn record_of(module: &Module, ty: naga::Handle<naga::Type>) -> Option<String> {
    let TypeInner::Pointer { base, space: AddressSpace::Function } = module.types[ty].inner else {
        return None;
    };
    let record = &module.types[base];
    match record.inner {
        TypeInner::Struct { .. } => record.name.clone(),
        _ => None,
    }
}
