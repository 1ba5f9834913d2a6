//! Partly transparent triangles: leaves and lenses.

use super::Edit;

/// All of this module.
pub const EDITS: &[Edit] = &[SOLID_LEAVES, SOLID_LEAVES_FOR_SHADOWS, HOLES_IMPORTS, HOLES_ARE_VERTICES];

/// Rays meet holes, see HOLES_ARE_VERTICES. Here rays pass holes wherever they are traced, and a hole is no vertex.
const SOLID_LEAVES: Edit = Edit {
    module: "trace/cwbvh",
    old: "            if hit.accepted {
                if HAS_ALPHA {
                    if hit.alpha_tested && !stops_ray(prim, hit.material, hit.barycentric, key) {
                        continue;
                    }
                }
                nearest_prim = prim;
",
    new: "            if hit.accepted {
                nearest_prim = prim;
",
};

/// path.cpp, sample: shadow rays ask for any triangle (scene.ray_test), whatever its opacity.
const SOLID_LEAVES_FOR_SHADOWS: Edit = Edit {
    module: "trace/cwbvh",
    old: "            if hit.accepted {
                if HAS_ALPHA {
                    if hit.alpha_tested && !stops_ray(prim, hit.material, hit.barycentric, key) {
                        continue;
                    }
                }
                return true;
",
    new: "            if hit.accepted {
                return true;
",
};

/// What HOLES_ARE_VERTICES needs.
const HOLES_IMPORTS: Edit = Edit {
    module: "stage/trace",
    old: "import package::real::real;
import package::state::Walk;
import package::outcome::{HIT, MISS};
import package::trace::accelerator::trace_closest;
import package::trace::opacity::opacity_key;
import package::trace::triangle::{NO_PRIM, RAY_INFINITY};
",
    new: "import package::real::{real, vec3r};
import package::state::{Hit, Path, Walk};
import package::outcome::{HIT, MISS};
import package::params::max_edges;
import package::features::HAS_ALPHA;
import package::surface::geometry::load_triangle;
import package::surface::spawn::spawn_origin;
import package::surface::surface::surface_at;
import package::trace::accelerator::trace_closest;
import package::trace::opacity::{opacity_key, stops_ray};
import package::trace::triangle::{NO_PRIM, RAY_INFINITY, TRIANGLE_ALPHA_TESTED};

/// Whether the ray goes through what it has met.
fn is_hole(hit: Hit, key: u32) -> bool {
    if HAS_ALPHA {
        let triangle = load_triangle(hit.prim);
        let tested = (triangle.flags & TRIANGLE_ALPHA_TESTED) != 0u;
        return tested && !stops_ray(hit.prim, triangle.material, vec2f(hit.uv), key);
    }
    return false;
}
",
};

/// mask.cpp and path.cpp: going through a hole is a `Null` scattering. It counts as an edge, and as after a mirror light that is met
/// next counts in full: no shadow ray gets there.
const HOLES_ARE_VERTICES: Edit = Edit {
    module: "stage/trace",
    old: "fn trace(walk: ptr<function, Walk>) -> u32 {
    let key = opacity_key(walk.position, walk.direction);
    walk.hit = trace_closest(walk.position, walk.direction, real(RAY_INFINITY), key);
    if walk.hit.prim == NO_PRIM {
        return MISS;
    }
    return HIT;
",
    new: "fn trace(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    let key = opacity_key(walk.position, walk.direction);
    while path.length < max_edges {
        walk.hit = trace_closest(walk.position, walk.direction, real(RAY_INFINITY), key);
        if walk.hit.prim == NO_PRIM {
            return MISS;
        }
        if !is_hole(walk.hit, key) {
            return HIT;
        }
        path.length += 1u;
        walk.pdf_w = 0.0;
        walk.position = spawn_origin(surface_at(walk.hit, walk.direction), walk.direction);
    }
    walk.throughput = vec3r(0.0);
    return MISS;
",
};
