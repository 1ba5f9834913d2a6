//! Do the codecs of a layout fit the fields that they are to keep?

use super::model::{Codec, Encode, IDENTITY_CODECS, Variant};
use super::quantity::Quantity;
use super::section::Findings;
use super::suggest;
use super::wiring::find_field;
use crate::diagnostic::Diagnostic;

/// Checks `[layout.encode]`: K0404 no such field, K0107 no such quantity, K0411 no such codec, K0412 one that keeps something else,
/// K0413 codecs beside a placement by hand.
pub(super) fn check(variant: &Variant, findings: &mut Findings) {
    let layout = &variant.layout;
    for (name, encode) in &layout.encode {
        let codec = codec(variant, encode, findings);
        let Some(quantities) = quantities(variant, name, encode, findings) else { continue };
        for quantity in quantities {
            findings.extend(codec.and_then(|codec| unfit(codec, quantity, name, encode)));
        }
    }
    if let (Some(encode), Some(row)) = (layout.encode.values().next(), layout.place.first()) {
        let both = Diagnostic::error("K0413", "a layout with codecs places fields itself")
            .at(encode.key, "encoded here")
            .also(row.span, "placed by hand here")
            .help("leave out `layout.encode` or `layout.place`");
        findings.push(both);
    }
}

fn codec<'a>(variant: &'a Variant, encode: &Encode, findings: &mut Findings) -> Option<&'a Codec> {
    let name = encode.codec.value.as_str();
    let found = variant.codecs.get(name);
    if found.is_none() && !IDENTITY_CODECS.contains(&name) {
        let names = variant.codecs.keys().map(String::as_str).chain(IDENTITY_CODECS);
        let unknown = Diagnostic::error("K0411", format!("there is no codec `{name}`"))
            .at(encode.codec.span, "no such codec")
            .help(suggest::help(name, "codecs", names));
        findings.push(unknown);
    }
    found
}

/// What the name stands for: a quantity, or those of a field's parts.
fn quantities(variant: &Variant, name: &str, encode: &Encode, findings: &mut Findings) -> Option<Vec<&'static str>> {
    let Some((instance, field)) = name.split_once('.') else {
        let known = Quantity::CODED.into_iter().find(|quantity| *quantity == name);
        if known.is_none() {
            let unknown = Diagnostic::error("K0107", format!("`{name}` is neither a quantity with codecs nor a field"))
                .at(encode.key, "nothing of this name can be encoded")
                .help(suggest::help(name, "quantities with codecs", Quantity::CODED))
                .help("a field is named with its instance: `light.throughput`");
            findings.push(unknown);
        }
        return known.map(|quantity| vec![quantity]);
    };
    let pipeline = &variant.pipeline;
    if let Err(diagnostic) = find_field(name, encode.key, pipeline) {
        findings.push(diagnostic);
        return None;
    }
    let record = pipeline.records.get(&pipeline.state.get(instance)?.value)?;
    let (field, member) = field.split_once('.').map_or((field, None), |(field, member)| (field, Some(member)));
    let leaves = record.fields.get(field)?.quantity.leaves();
    let named = leaves.into_iter().filter(|leaf| member.is_none() || leaf.member == member);
    Some(named.map(|leaf| leaf.quantity).collect())
}

fn unfit(codec: &Codec, quantity: &str, name: &str, encode: &Encode) -> Option<Diagnostic> {
    if codec.quantities.iter().any(|kept| kept == quantity) {
        return None;
    }
    let kept = suggest::quoted(codec.quantities.iter().map(String::as_str));
    let is = if name == quantity { format!("a {quantity}") } else { format!("`{name}`, a {quantity}") };
    Some(
        Diagnostic::error("K0412", format!("`{}` cannot keep {is}", codec.name))
            .at(encode.codec.span, format!("keeps {kept}"))
            .also(codec.span, "declared here")
            .help("choose a codec of that quantity, or leave it out: every bit is kept then"),
    )
}
