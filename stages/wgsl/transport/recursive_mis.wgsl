//! Multiple importance sampling over all strategies of a bidirectional path, by sums that a walk carries along (van Antwerpen 2011;
//! Georgiev et al. 2012 with two sums a side, so that a density may depend on where the walk comes from).
//!
//! The sums hold the ratios of the densities of the strategies on a walk's side of its newest vertex to that of the strategy at hand.
//! `a` is the strategy whose connecting edge ends at this vertex, `b` all before it but for one factor, the density of scattering
//! back; `c`, on light walks, the strategy in which an eye walk hits the light, whose number of samples depends on the path's length.
//! Densities are per m2 at vertices and per sr at lights at infinity.

import package::real::real;
import package::params::{mis, mis_average, mis_none, mis_power};

/// Partial sums of a walk: roots of the heuristic's power, so that their range is that of the densities.
struct MisPartial {
    a: real,
    b: real,
    c: real,
}

/// Sums are kept below 2^100, so that products with zero stay zero.
const LARGEST_SUM: real = 1.2676506e30;
/// Stands in for zero in denominators.
const SMALLEST_SUM: real = 1.0e-36;

/// Two sums as one: x + y, or the square root of x^2 + y^2 for the power heuristic.
fn join(x: real, y: real) -> real {
    if mis == mis_power {
        let larger = max(x, y);
        let ratio = min(x, y) / max(larger, SMALLEST_SUM);
        return larger * sqrt(1.0 + ratio * ratio);
    }
    return x + y;
}

/// A sum times a density or a ratio of densities; equal weights only count the strategies whose density is not zero.
fn scaled(factor: real, sum: real) -> real {
    if mis == mis_average {
        return select(0.0, sum, factor > 0.0);
    }
    return min(factor * sum, LARGEST_SUM);
}

/// A strategy's own term: 1/density, or 1 for equal weights.
fn source(inverse_density: real) -> real {
    if mis == mis_average {
        return 1.0;
    }
    return min(inverse_density, LARGEST_SUM);
}

/// The sums after scattering at a vertex by a non-delta lobe, before the next vertex is known. `pdf` and `reverse_pdf` are per sr,
/// `cosine` that of the new direction; `ended` are the samples of the strategy that joins the vertex before to this one, 0 where it is
/// left out.
fn scattered_sums(sums: MisPartial, pdf: real, reverse_pdf: real, cosine: real, ended: real) -> MisPartial {
    var next: MisPartial;
    next.b = scaled(cosine / pdf, join(scaled(ended, sums.a), scaled(reverse_pdf, sums.b)));
    next.c = scaled(cosine / pdf, scaled(reverse_pdf, sums.c));
    next.a = source(1.0 / pdf);
    return next;
}

/// The sums after a delta lobe, chosen with probability `pdf` (in reverse `reverse_pdf`): no strategy joins a vertex of which all
/// that matters is a delta to either neighbour.
fn specular_sums(sums: MisPartial, pdf: real, reverse_pdf: real, cosine: real) -> MisPartial {
    var next: MisPartial;
    next.b = scaled(cosine * reverse_pdf / pdf, sums.b);
    next.c = scaled(cosine * reverse_pdf / pdf, sums.c);
    return next;
}

/// The sums at the next vertex, which lies `distance_squared` away (1 for what comes from infinity) and is met under `cosine`.
fn arrived_sums(sums: MisPartial, distance_squared: real, cosine: real) -> MisPartial {
    if mis == mis_average {
        return sums;
    }
    let inverse_cosine = 1.0 / max(cosine, SMALLEST_SUM);
    var next: MisPartial;
    next.a = min(sums.a * (distance_squared * inverse_cosine), LARGEST_SUM);
    next.b = min(sums.b * inverse_cosine, LARGEST_SUM);
    next.c = min(sums.c * inverse_cosine, LARGEST_SUM);
    return next;
}

/// Sum of all strategies on this side, for a vertex whose density of scattering back is `reverse_pdf`; `ended` as in
/// `scattered_sums`, `hits` the number of samples of the one that hits the light (0: none).
fn closed_sum(sums: MisPartial, reverse_pdf: real, ended: real, hits: real) -> real {
    let walked = join(scaled(ended, sums.a), scaled(reverse_pdf, sums.b));
    return join(walked, scaled(hits * reverse_pdf, sums.c));
}

/// Weight / own, where `own` belongs to the strategy at hand and the others stand to it as `sum` to `own`: 1/(own + sum), or
/// own/(own^2 + sum^2). No division by a squared distance: it may be zero.
fn weight_over(own: real, sum: real) -> real {
    if mis == mis_none {
        return 1.0 / max(own, SMALLEST_SUM);
    }
    if mis == mis_average {
        return 1.0 / (max(own, SMALLEST_SUM) * (1.0 + sum));
    }
    if mis == mis_power {
        let largest = max(max(own, sum), SMALLEST_SUM);
        let x = own / largest;
        let y = sum / largest;
        return x / max(x * x + y * y, SMALLEST_SUM) / largest;
    }
    return 1.0 / max(own + sum, SMALLEST_SUM);
}
