//! Traversal of the compressed eight-wide BVH (Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs").

import package::real::{real, vec2r, vec3r};
import package::state::Hit;
import package::features::HAS_ALPHA;
import package::trace::opacity::stops_ray;
import package::trace::slab::{SLAB_TOLERANCE, SlabRay, slab_ray};
import package::trace::triangle::{NO_PRIM, intersect_triangle};

/// Five vec4u per node of 80 bytes: origin, exponents and inner mask; bases and metadata; quantised bounds of eight children.
var<storage, read> bvh_nodes: array<vec4u>;

/// Each level of the tree leaves at most one entry; the builder makes no deeper trees.
const CWBVH_STACK: u32 = 32u;
/// High byte of a node group: children of the group still to visit.
const CWBVH_CHILDREN: u32 = 0xff000000u;

/// Bits of those of four children that the ray meets before t_max: inner children set a bit of the high byte in visiting order,
/// leaves set one of the low 24 bits for each of their triangles. `enter` and `leave` hold one byte per child and axis.
fn children_hit(meta4: u32, order: u32, enter: vec3u, leave: vec3u, scale: vec3f, near: vec3f, far: vec3f, t_max: f32) -> u32 {
    let enter_x = fma(vec4f(unpack4xU8(enter.x)), vec4f(scale.x), vec4f(near.x));
    let enter_y = fma(vec4f(unpack4xU8(enter.y)), vec4f(scale.y), vec4f(near.y));
    let enter_z = fma(vec4f(unpack4xU8(enter.z)), vec4f(scale.z), vec4f(near.z));
    let leave_x = fma(vec4f(unpack4xU8(leave.x)), vec4f(scale.x), vec4f(far.x));
    let leave_y = fma(vec4f(unpack4xU8(leave.y)), vec4f(scale.y), vec4f(far.y));
    let leave_z = fma(vec4f(unpack4xU8(leave.z)), vec4f(scale.z), vec4f(far.z));
    let t_enter = max(max(enter_x, enter_y), max(enter_z, vec4f(0.0)));
    let t_leave = min(min(leave_x, leave_y), min(leave_z, vec4f(t_max)));

    // inner children carry 24 + slot, which alone sets both bits 3 and 4
    let inner = ((meta4 & (meta4 << 1u) & 0x10101010u) >> 4u) * 0xffu;
    let bit_index = unpack4xU8((meta4 ^ (order & inner)) & 0x1f1f1f1fu);
    let child_bits = unpack4xU8((meta4 >> 5u) & 0x07070707u);
    let hits = select(vec4u(0u), child_bits << bit_index, t_enter <= t_leave);
    return (hits.x | hits.y) | (hits.z | hits.w);
}

/// Tests all eight children of a node against the ray. Returns the node group (x: index of the first inner child, y: children
/// to visit in the high byte, inner mask in the low byte) and the triangle group (z: first triangle, w: triangles to test).
fn visit_node(node: u32, ray: SlabRay, t_max: f32) -> vec4u {
    let head = bvh_nodes[5u * node];
    let base = bvh_nodes[5u * node + 1u];
    let bounds_x = bvh_nodes[5u * node + 2u];
    let bounds_y = bvh_nodes[5u * node + 3u];
    let bounds_z = bvh_nodes[5u * node + 4u];

    // Planes lie at origin + byte * 2^e. Every plane is moved outwards by the rounding bound of its distance, so no box is missed.
    let exponents = vec3u((head.w << 23u) & 0x7f800000u, (head.w << 15u) & 0x7f800000u, (head.w << 7u) & 0x7f800000u);
    let scale = bitcast<vec3f>(exponents) * ray.inverse;
    let offset = (bitcast<vec3f>(head.xyz) - ray.origin) * ray.inverse;
    let rounding = SLAB_TOLERANCE * fma(vec3f(255.0), abs(scale), abs(offset));
    let near = offset - rounding;
    let far = offset + rounding;

    let min_low = vec3u(bounds_x.x, bounds_y.x, bounds_z.x);
    let min_high = vec3u(bounds_x.y, bounds_y.y, bounds_z.y);
    let max_low = vec3u(bounds_x.z, bounds_y.z, bounds_z.z);
    let max_high = vec3u(bounds_x.w, bounds_y.w, bounds_z.w);
    let hits = children_hit(base.z, ray.order, select(min_low, max_low, ray.negative), select(max_low, min_low, ray.negative), scale, near, far, t_max)
        | children_hit(base.w, ray.order, select(min_high, max_high, ray.negative), select(max_high, min_high, ray.negative), scale, near, far, t_max);
    return vec4u(base.x, (hits & CWBVH_CHILDREN) | (head.w >> 24u), base.y, hits & ~CWBVH_CHILDREN);
}

/// Index of the inner child that bit `bit` of the node group stands for: children are stored in slot order, gaps closed.
fn child_node(group: vec2u, bit: u32, order: u32) -> u32 {
    let slot = (bit - 24u) ^ (order & 7u);
    return group.x + countOneBits(group.y & ((1u << slot) - 1u));
}

/// Nearest hit with 0 < t < t_max, t in metres along the unit vector `direction`; prim is NO_PRIM if there is none.
/// `key` decides what partly transparent triangles do.
fn closest_hit(origin: vec3r, direction: vec3r, t_max: real, key: u32) -> Hit {
    let ray_origin = vec3f(origin);
    let ray_direction = vec3f(direction);
    let ray = slab_ray(ray_origin, ray_direction);
    var nearest_prim = NO_PRIM;
    var nearest_t = f32(t_max);
    var nearest_barycentric = vec2f(0.0);

    var stack: array<vec2u, CWBVH_STACK>;
    var stacked = 0u;
    var group = vec2u(0u, 0x80000000u);
    loop {
        let bit = firstLeadingBit(group.y);
        let node = child_node(group, bit, ray.order);
        group.y &= ~(1u << bit);
        if group.y >= 0x01000000u {
            stack[stacked] = group;
            stacked += 1u;
        }
        let visit = visit_node(node, ray, nearest_t);
        group = visit.xy;
        var triangles = visit.w;
        while triangles != 0u {
            let triangle = firstLeadingBit(triangles);
            triangles &= ~(1u << triangle);
            let prim = visit.z + triangle;
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
        if group.y < 0x01000000u {
            if stacked == 0u {
                break;
            }
            stacked -= 1u;
            group = stack[stacked];
        }
    }

    var nearest: Hit;
    nearest.prim = nearest_prim;
    nearest.t = real(nearest_t);
    nearest.uv = vec2r(nearest_barycentric);
    return nearest;
}

/// Whether anything is hit with 0 < t < t_max. Arguments as for `closest_hit`.
fn any_hit(origin: vec3r, direction: vec3r, t_max: real, key: u32) -> bool {
    let ray_origin = vec3f(origin);
    let ray_direction = vec3f(direction);
    let ray = slab_ray(ray_origin, ray_direction);
    let farthest = f32(t_max);

    var stack: array<vec2u, CWBVH_STACK>;
    var stacked = 0u;
    var group = vec2u(0u, 0x80000000u);
    loop {
        let bit = firstLeadingBit(group.y);
        let node = child_node(group, bit, ray.order);
        group.y &= ~(1u << bit);
        if group.y >= 0x01000000u {
            stack[stacked] = group;
            stacked += 1u;
        }
        let visit = visit_node(node, ray, farthest);
        group = visit.xy;
        var triangles = visit.w;
        while triangles != 0u {
            let triangle = firstLeadingBit(triangles);
            triangles &= ~(1u << triangle);
            let prim = visit.z + triangle;
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
        if group.y < 0x01000000u {
            if stacked == 0u {
                break;
            }
            stacked -= 1u;
            group = stack[stacked];
        }
    }
    return false;
}
