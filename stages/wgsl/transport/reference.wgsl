//! What the reference integrator (next-event estimation alone) counts of the light its walks run into.

import package::state::{FLAGS_SPECULAR, Walk};
import package::features::HAS_DELTA;

/// Light that arrives at the end of the walk's newest edge, the `edges`-th of the path, could not have been sampled at
/// the vertex before: that is the camera, or scattered by a delta lobe.
fn counts_met_light(walk: ptr<function, Walk>, edges: u32) -> bool {
    var counts = edges == 1u;
    if HAS_DELTA {
        counts = counts || (walk.flags & FLAGS_SPECULAR) != 0u;
    }
    return counts;
}
