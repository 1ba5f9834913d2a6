//! Which leaves may have the same bits: those that never live together.

use crate::analyze::{Leaf, Liveness};

/// Whether both have to be kept at some kernel boundary. A kernel reads its fields before it writes any, so a field that it reads for
/// the last time may give its bits to one that it writes.
pub(super) fn interfere(a: &Leaf, b: &Leaf, liveness: &Liveness) -> bool {
    liveness.kernels.values().any(|traffic| traffic.live_out.contains(a) && traffic.live_out.contains(b))
}
