//! Small functions of vectors.

import package::real::{real, vec3r};

/// Largest component.
fn max_component(v: vec3r) -> real {
    return max(v.x, max(v.y, v.z));
}

/// Relative luminance of a linear sRGB colour (ITU-R BT.709 primaries).
fn luminance(color: vec3r) -> real {
    return dot(color, vec3r(0.2126, 0.7152, 0.0722));
}

/// `v` scaled so that its largest component is 1 in magnitude; safe from overflow and underflow when squared. Zero stays zero.
fn unit_scale(v: vec3r) -> vec3r {
    let largest = max_component(abs(v));
    return v / select(real(1.0), largest, largest > 0.0);
}

/// Unit vector along `v`, whatever its length; `fallback` if `v` is zero or not a number.
fn safe_normalize(v: vec3r, fallback: vec3r) -> vec3r {
    let scaled = unit_scale(v);
    let square = dot(scaled, scaled);
    // At least 1 but for the rounding of the division, which devices need not do correctly; 0 or not a number else.
    if square > 0.5 {
        return scaled * inverseSqrt(square);
    }
    return fallback;
}

/// a*b - c*d with one rounding error instead of a cancellation (Kahan; Jeannerod et al. 2013).
fn difference_of_products(a: real, b: real, c: real, d: real) -> real {
    let cd = c * d;
    let rounding = fma(-c, d, cd);
    return fma(a, b, -cd) + rounding;
}

/// Cross product that keeps its direction for nearly parallel vectors.
fn accurate_cross(a: vec3r, b: vec3r) -> vec3r {
    return vec3r(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    );
}
