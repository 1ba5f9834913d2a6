//! Multiple importance sampling of the seed: one number d a side (van Antwerpen 2011; Lu 2020, equations 14 to 18). With the densities
//! per m2, `->` drawn from the side of the walk and `<-` from the other,
//!
//!     d_s = (1 + p<-_(s-1) d_(s-1)) / p->_s,     weight = 1 / (1 + p<- d_E + p-> d_L)
//!
//! p<-_(s-1) holds the density with which vertex s scatters back, which depends on the partner that the path has there.

import package::real::{real, vec3r};
import package::state::{FLAGS_SPECULAR, Walk};
import package::features::{HAS_DELTA, HAS_TRANSMISSION};
import package::params::{clamp_contribution, counting, counting_first, frozen_reverse_pdfs, last_ray, last_ray_none, max_edges, n_kk};
import package::math::vector::max_component;
import package::surface::surface::Surface;
import package::bsdf::bsdf::{Bsdf, BsdfSample, reverse_pdf_bsdf};
import package::transport::advance::surface_cosine;
import package::transport::recursive_mis::{LARGEST_SUM, SMALLEST_SUM};

/// d of a vertex while the density of scattering back is open: d = nearest + density * farther.
struct PartialSum {
    /// The strategy whose connecting edge ends at the vertex: 1 / density of the vertex, m2.
    nearest: real,
    /// All strategies before that one, without the density of scattering back, m2 sr.
    farther: real,
}

/// Eye walks that are taken to look for the light at the end of a path: the samples of strategy (k, 0).
fn implicit_samples() -> real {
    if counting == counting_first {
        return 1.0;
    }
    return n_kk;
}

/// Whether what the eye walk of light vertex y_t meets by itself counts.
fn implicit_counts(t: u32) -> bool {
    return counting != counting_first || t == 1u;
}

/// Rays of the eye walk of y_t at most. What the one from the last vertex meets cannot be joined to y_t any more.
fn eye_rays(t: u32) -> u32 {
    return max_edges - t + select(0u, 1u, last_ray != last_ray_none && implicit_counts(t));
}

/// 1/x within bounds; 0 for 0, which stands for a strategy that cannot be.
fn inverse(x: real) -> real {
    return select(0.0, min(1.0 / max(x, SMALLEST_SUM), LARGEST_SUM), x > 0.0);
}

/// The sum at the vertex that the walk has just met, and `pdf_area` of that vertex. `left` is d of the vertex before, closed;
/// `parallel`: the ray came from infinity.
fn met_sum(walk: ptr<function, Walk>, surface: Surface, left: real, parallel: bool) -> PartialSum {
    let distance = select(walk.hit.t, 1.0, parallel);
    let cosine = max(surface_cosine(surface, walk.direction), SMALLEST_SUM);
    var known = left;
    walk.pdf_area = walk.pdf_w * cosine / (distance * distance);
    if HAS_DELTA {
        if (walk.flags & FLAGS_SPECULAR) != 0u {
            walk.pdf_area = 0.0;
            // Whichever partner was assumed, the mirror does not reflect it: in the seed all strategies before it are lost.
            known = select(left, 0.0, frozen_reverse_pdfs);
        }
    }
    var sum: PartialSum;
    sum.nearest = inverse(walk.pdf_area);
    sum.farther = min(known * abs(dot(walk.normal, walk.direction)) / (walk.pdf_w * cosine), LARGEST_SUM);
    return sum;
}

/// d of a vertex whose density of scattering back is `reverse_pdf`, 1/sr.
fn closed(sum: PartialSum, reverse_pdf: real) -> real {
    return min(sum.nearest + reverse_pdf * sum.farther, LARGEST_SUM);
}

/// d of a vertex from which the path goes on by a sampled event of density `reverse_pdf` in reverse. A delta lobe joins nothing.
fn closed_by_event(sum: PartialSum, reverse_pdf: real, event: BsdfSample) -> real {
    var nearest = sum.nearest;
    if HAS_DELTA {
        nearest = select(nearest, 0.0, event.delta);
    }
    return min(nearest + reverse_pdf * sum.farther, LARGEST_SUM);
}

/// Density, 1/sr, of scattering to `outgoing` what comes from the assumed partner in the direction `partner`. On an opaque surface a
/// partner behind it counts as one in front, as in the seed's absolute cosines: a diffuse lobe's density depends on `outgoing` alone.
fn assumed_reverse_pdf(bsdf: Bsdf, outgoing: vec3r, partner: vec3r) -> real {
    var incoming = partner;
    var opaque = true;
    if HAS_TRANSMISSION {
        opaque = bsdf.glass == 0.0;
    }
    let height = dot(partner, bsdf.frame.normal);
    if opaque && height < 0.0 {
        incoming -= 2.0 * height * bsdf.frame.normal;
    }
    return reverse_pdf_bsdf(bsdf, outgoing, incoming);
}

/// A weighted contribution, scaled down to `clamp_contribution`.
fn limited(contribution: vec3r) -> vec3r {
    if clamp_contribution > 0.0 {
        return contribution * min(clamp_contribution / max(max_component(contribution), SMALLEST_SUM), 1.0);
    }
    return contribution;
}
