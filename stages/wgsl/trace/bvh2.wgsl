//! Traversal of a binary BVH: the plain alternative that the compressed one is measured against.

import package::real::{real, vec2r, vec3r};
import package::state::Hit;
import package::features::HAS_ALPHA;
import package::trace::opacity::stops_ray;
import package::trace::slab::{SLAB_TOLERANCE, SlabRay, slab_ray};
import package::trace::triangle::{NO_PRIM, RAY_INFINITY, intersect_triangle};

/// Two vec4 per node: (min, first index) (max, triangle count). Count 0: inner node, children at first index and the next.
var<storage, read> bvh2_nodes: array<vec4f>;

/// The builder makes no deeper trees.
const BVH2_STACK: u32 = 64u;

/// Distance at which the ray enters the box of a node, or RAY_INFINITY if it does not before t_max. The box is widened by the
/// rounding bound of the slab distances, so none is missed.
fn enter_box(node: u32, ray: SlabRay, t_max: f32) -> f32 {
    let low = (bvh2_nodes[2u * node].xyz - ray.origin) * ray.inverse;
    let high = (bvh2_nodes[2u * node + 1u].xyz - ray.origin) * ray.inverse;
    let rounding = SLAB_TOLERANCE * (abs(low) + abs(high));
    let near = min(low, high) - rounding;
    let far = max(low, high) + rounding;
    let t_enter = max(max(near.x, near.y), max(near.z, 0.0));
    let t_leave = min(min(far.x, far.y), min(far.z, t_max));
    return select(RAY_INFINITY, t_enter, t_enter <= t_leave);
}

/// Nearest hit with 0 < t < t_max, t in metres along the unit vector `direction`; prim is NO_PRIM if there is none.
/// `key` decides what partly transparent triangles do.
fn closest_hit_bvh2(origin: vec3r, direction: vec3r, t_max: real, key: u32) -> Hit {
    let ray_origin = vec3f(origin);
    let ray_direction = vec3f(direction);
    let ray = slab_ray(ray_origin, ray_direction);
    var nearest_prim = NO_PRIM;
    var nearest_t = f32(t_max);
    var nearest_barycentric = vec2f(0.0);

    var stack: array<u32, BVH2_STACK>;
    var stacked = 0u;
    var node = 0u;
    loop {
        let first = bitcast<u32>(bvh2_nodes[2u * node].w);
        let count = bitcast<u32>(bvh2_nodes[2u * node + 1u].w);
        var descend = false;
        if count == 0u {
            let enter_first = enter_box(first, ray, nearest_t);
            let enter_second = enter_box(first + 1u, ray, nearest_t);
            let second_is_nearer = enter_second < enter_first;
            descend = min(enter_first, enter_second) < RAY_INFINITY;
            node = select(first, first + 1u, second_is_nearer);
            if max(enter_first, enter_second) < RAY_INFINITY {
                stack[stacked] = select(first + 1u, first, second_is_nearer);
                stacked += 1u;
            }
        }
        for (var prim = first; prim < first + count; prim += 1u) {
            let hit = intersect_triangle(prim, ray_origin, ray_direction, nearest_t);
            if hit.accepted {
                if HAS_ALPHA {
                    if hit.alpha_tested && !stops_ray(prim, hit.material, hit.barycentric, key) {
                        continue;
                    }
                }
                nearest_prim = prim;
                nearest_t = hit.t;
                nearest_barycentric = hit.barycentric;
            }
        }
        if !descend {
            if stacked == 0u {
                break;
            }
            stacked -= 1u;
            node = stack[stacked];
        }
    }

    var nearest: Hit;
    nearest.prim = nearest_prim;
    nearest.t = real(nearest_t);
    nearest.uv = vec2r(nearest_barycentric);
    return nearest;
}

/// Whether anything is hit with 0 < t < t_max. Arguments as for `closest_hit_bvh2`.
fn any_hit_bvh2(origin: vec3r, direction: vec3r, t_max: real, key: u32) -> bool {
    let ray_origin = vec3f(origin);
    let ray_direction = vec3f(direction);
    let ray = slab_ray(ray_origin, ray_direction);
    let farthest = f32(t_max);

    var stack: array<u32, BVH2_STACK>;
    var stacked = 0u;
    var node = 0u;
    loop {
        let first = bitcast<u32>(bvh2_nodes[2u * node].w);
        let count = bitcast<u32>(bvh2_nodes[2u * node + 1u].w);
        var descend = false;
        if count == 0u {
            let meets_first = enter_box(first, ray, farthest) < RAY_INFINITY;
            let meets_second = enter_box(first + 1u, ray, farthest) < RAY_INFINITY;
            descend = meets_first || meets_second;
            node = select(first + 1u, first, meets_first);
            if meets_first && meets_second {
                stack[stacked] = first + 1u;
                stacked += 1u;
            }
        }
        for (var prim = first; prim < first + count; prim += 1u) {
            let hit = intersect_triangle(prim, ray_origin, ray_direction, farthest);
            if hit.accepted {
                if HAS_ALPHA {
                    if hit.alpha_tested && !stops_ray(prim, hit.material, hit.barycentric, key) {
                        continue;
                    }
                }
                return true;
            }
        }
        if !descend {
            if stacked == 0u {
                break;
            }
            stacked -= 1u;
            node = stack[stacked];
        }
    }
    return false;
}
