//! Which leaf gets which codec.

use super::StateLeaf;
use crate::analyze::Liveness;
use crate::config::model::{Codec, Encode, Layout};
use indexmap::IndexMap;

/// Gives leaves the codecs that the layout asks for.
///
/// A name in `[layout.encode]` is, from the weakest to the strongest, a quantity (`spectrum`), a field (`light.throughput`) or a member
/// of a hit (`light.hit.uv`). Quantities leave rays alone where these are kept apart: what is traced is traced as it was computed.
pub(super) fn choose(leaves: &mut [StateLeaf], layout: &Layout, liveness: &Liveness, codecs: &IndexMap<String, Codec>) {
    for leaf in leaves {
        let apart = layout.rays_apart && liveness.in_flight.contains(&leaf.leaf);
        let chosen = chosen(leaf, layout, apart);
        leaf.codec = chosen.and_then(|encode| codecs.get(&encode.codec.value)).cloned();
    }
}

fn chosen<'a>(leaf: &StateLeaf, layout: &'a Layout, apart: bool) -> Option<&'a Encode> {
    let field = format!("{}.{}", leaf.leaf.instance, leaf.leaf.field);
    let named = |name: &str| layout.encode.get(name);
    let by_quantity = || if apart { None } else { named(leaf.quantity) };
    named(&leaf.leaf.to_string()).or_else(|| named(&field)).or_else(by_quantity)
}
