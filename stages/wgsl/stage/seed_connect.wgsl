import package::real::real;
import package::state::{FLAGS_SPECULAR, Path, Walk};
import package::outcome::{DEAD, EYE, LIGHT};
import package::params::{last_ray, last_ray_light, max_edges, sky_strategy, sky_strategy_implicit, sky_strategy_sampled};
import package::features::{HAS_DELTA, HAS_SKY};
import package::film::splat;
import package::pass::path_pixel;
import package::trace::triangle::NO_PRIM;
import package::light::directional_light::pdf_disk;
import package::light::sky::{sky_pdf_w, sky_radiance};
import package::transport::seed_mis::{PartialSum, closed, implicit_counts, implicit_samples, inverse, limited};

/// The seed's logic: adds the sky where the eye ray has met nothing, and decides which of its two walks the path extends.
fn seed_connect(eye: ptr<function, Walk>, light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    let s = path.eye_length;
    let t = path.light_length;
    let sent = eye.pdf_w > 0.0;
    let met = eye.hit.prim != NO_PRIM;
    if HAS_SKY {
        if sent && !met && implicit_counts(t) {
            splat(path_pixel(), limited(eye.beta * sky_radiance(eye.direction) * sky_weight(eye, s, t)));
        }
    }
    // The hit of a ray from the last vertex is of use only if emitters answer it.
    if sent && met && (s + t < max_edges || last_ray == last_ray_light) {
        return EYE;
    }
    return next_light_vertex(light);
}

/// What a path goes on with when its eye walk is over: the light walk, if the ray from its newest vertex has met a surface.
fn next_light_vertex(light: ptr<function, Walk>) -> u32 {
    if light.pdf_w > 0.0 && light.hit.prim != NO_PRIM {
        return LIGHT;
    }
    return DEAD;
}

/// Weight of the sky met by the ray from x_s (path of s + 1 edges).
fn sky_weight(eye: ptr<function, Walk>, s: u32, t: u32) -> real {
    if sky_strategy == sky_strategy_implicit {
        return 1.0 / implicit_samples();
    }
    if sky_strategy == sky_strategy_sampled {
        return 1.0 / (implicit_samples() + sampled_sky_rivals(eye, s));
    }
    // The first eye walk alone looks at the background.
    if s == 0u {
        return select(0.0, 1.0, t == 1u);
    }
    return 1.0 / (implicit_samples() + eye.mis * pdf_disk());
}

/// The strategies that start in the sky, against meeting its direction.
fn sampled_sky_rivals(eye: ptr<function, Walk>, s: u32) -> real {
    if s == 0u {
        return 0.0;
    }
    var specular = false;
    if HAS_DELTA {
        specular = (eye.flags & FLAGS_SPECULAR) != 0u;
    }
    let inverse_pdf = inverse(eye.pdf_w);
    let cosine = abs(dot(eye.normal, eye.direction));
    let sum = PartialSum(select(inverse_pdf, 0.0, specular), eye.mis * cosine * inverse_pdf);
    return sky_pdf_w(eye.direction) * closed(sum, pdf_disk());
}
