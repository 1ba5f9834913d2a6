//! Ray against triangle. Geometry is f32, and so is all tracing, whatever `real` is.

/// Three vec4 per triangle: (v0, flags) (e1 = v1 - v0, material index) (e2 = v2 - v0, light index).
var<storage, read> bvh_triangles: array<vec4f>;

const NO_PRIM: u32 = 0xffffffffu;
const RAY_INFINITY: f32 = 3.0e38;
const TRIANGLE_ALPHA_TESTED: u32 = 1u;

/// Rounding bound of the edge functions relative to (|(v0 - origin) x direction| + |e1| + |e2|) |e| in 1-norms: 2^-23. It does not
/// grow with the distance, so silhouettes keep their place.
const EDGE_TOLERANCE: f32 = 1.1920928955078125e-7;
/// Rounding bound of the determinant relative to the 1-norm of the triangle's normal: 2^-22.
const DETERMINANT_TOLERANCE: f32 = 2.384185791015625e-7;
/// Rounding bound of distances relative to them, 2^-22: back faces count as so much farther, front faces as so much nearer. Of a plate
/// that is thinner than rounding at the ray's length, the ray meets the side that faces it, and light that leaves there gets away.
const DISTANCE_TOLERANCE: f32 = 2.384185791015625e-7;

/// Where a ray meets a triangle, if it does.
struct TriangleHit {
    accepted: bool,
    alpha_tested: bool,
    material: u32,
    /// Distance along the ray, m.
    t: f32,
    /// Weights of the second and third vertex, within the triangle.
    barycentric: vec2f,
}

/// a x b with one rounding error per component instead of a cancellation, so that slivers keep their plane (Kahan; Jeannerod et al. 2013).
fn triangle_cross(a: vec3f, b: vec3f) -> vec3f {
    let product = a.zxy * b.yzx;
    let rounding = fma(-a.zxy, b.yzx, product);
    return fma(a.yzx, b.zxy, -product) + rounding;
}

/// What the subtraction a - b = `difference` lost by rounding (Knuth, TAOCP volume 2, section 4.2.2).
fn difference_rounding(a: vec3f, b: vec3f, difference: vec3f) -> vec3f {
    let minus_b = difference - a;
    return (a - (difference - minus_b)) - (b + minus_b);
}

/// Sum of the magnitudes of the components.
fn one_norm(v: vec3f) -> f32 {
    return abs(v.x) + abs(v.y) + abs(v.z);
}

/// Intersection of the ray with triangle `prim` at 0 < t < t_max (Moeller and Trumbore 1997, with the plane normal computed first).
///
/// The two triangles at a shared edge see it from different vertices, so their edge functions differ by rounding. They are computed
/// so that the distance of the ray's origin cancels exactly, and each triangle accepts what lies outside by less than the rounding
/// bound that is left: no crack can open, at any scale or distance, and no fixed length is involved.
fn intersect_triangle(prim: u32, origin: vec3f, direction: vec3f, t_max: f32) -> TriangleHit {
    let first = bvh_triangles[3u * prim];
    let second = bvh_triangles[3u * prim + 1u];
    let third = bvh_triangles[3u * prim + 2u];
    let e1 = second.xyz;
    let e2 = third.xyz;
    let to_vertex = first.xyz - origin;
    let rounded_off = difference_rounding(first.xyz, origin, to_vertex);

    let normal = triangle_cross(e1, e2);
    let moment = triangle_cross(to_vertex, direction) + cross(rounded_off, direction);
    let determinant = dot(normal, direction);
    let side = select(-1.0, 1.0, determinant >= 0.0);
    let scale = abs(determinant);
    let u = side * dot(e2, moment);
    let v = -side * dot(e1, moment);
    let distance = (side + DISTANCE_TOLERANCE) * dot(normal, to_vertex);

    let reach = EDGE_TOLERANCE * (one_norm(moment) + one_norm(e1) + one_norm(e2));
    let slack_u = reach * one_norm(e2);
    let slack_v = reach * one_norm(e1);
    let inside = u >= -slack_u && v >= -slack_v && scale - u - v >= -(slack_u + slack_v);
    let ahead = distance > 0.0 && distance < t_max * scale;

    var hit: TriangleHit;
    hit.accepted = inside && ahead && scale > DETERMINANT_TOLERANCE * one_norm(normal);
    hit.alpha_tested = (bitcast<u32>(first.w) & TRIANGLE_ALPHA_TESTED) != 0u;
    hit.material = bitcast<u32>(second.w);
    if hit.accepted {
        hit.t = distance / scale;
        hit.barycentric = clamp_barycentric(vec2f(u, v) / scale);
    }
    return hit;
}

/// The point of the triangle for weights that rounding may have carried just outside of it.
fn clamp_barycentric(weights: vec2f) -> vec2f {
    let positive = clamp(weights, vec2f(0.0), vec2f(1.0));
    return positive / max(positive.x + positive.y, 1.0);
}
