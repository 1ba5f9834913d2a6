//! `package::stored`: values as they come back from the state.

use super::text::Imports;
use crate::analyze::Leaf;
use crate::config::model::{Codec, Pipeline};
use crate::config::quantity::Quantity;
use crate::layout::StateLeaf;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A function for each name in `[stored]`: there and back through the codec of its field, or the value itself.
pub(super) fn module(pipeline: &Pipeline, leaves: &BTreeMap<Leaf, StateLeaf>) -> String {
    let mut imports = Imports::default();
    let mut body = String::new();
    for (name, field) in &pipeline.stored {
        let Some(quantity) = quantity(pipeline, &field.value) else { continue };
        let ty = quantity.wgsl();
        imports.add("real", [ty]);
        let value = match codec(leaves, &field.value) {
            Some(Codec { name, .. }) => {
                let (encode, decode) = (format!("encode_{name}"), format!("decode_{name}"));
                imports.add(&format!("codec::{name}"), [encode.as_str(), decode.as_str()]);
                format!("{decode}({encode}(value))")
            }
            None => "value".to_owned(),
        };
        let _ = write!(
            body,
            "\n/// A value as `{}` holds it.\nfn stored_{name}(value: {ty}) -> {ty} {{\n    return {value};\n}}\n",
            field.value
        );
    }
    format!("{imports}{body}")
}

/// What a field `instance.field` is; where the state has no such instance, what a field of that name is.
pub(crate) fn quantity<'a>(pipeline: &'a Pipeline, field: &str) -> Option<&'a Quantity> {
    let (instance, name) = field.split_once('.')?;
    let own = pipeline.state.get(instance).and_then(|record| pipeline.records.get(&record.value));
    let records = own.into_iter().chain(pipeline.records.values());
    records.filter_map(|record| record.fields.get(name)).map(|field| &field.quantity).next()
}

fn codec<'a>(leaves: &'a BTreeMap<Leaf, StateLeaf>, field: &str) -> Option<&'a Codec> {
    let (instance, field) = field.split_once('.')?;
    let leaf = Leaf { instance: instance.to_owned(), field: field.to_owned(), member: None };
    leaves.get(&leaf)?.codec.as_ref()
}
