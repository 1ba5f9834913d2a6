import package::real::real;
import package::state::Walk;
import package::outcome::DONE;
import package::features::HAS_SKY;
import package::film::splat;
import package::pass::path_pixel;
import package::light::sky::{sky_pdf_w, sky_radiance};
import package::transport::mis::hit_weight;

/// Ends a path tracer's eye walk in the sky, weighted against sampling it at the vertex before.
fn escape_mis(walk: ptr<function, Walk>) -> u32 {
    if HAS_SKY {
        var weight = real(1.0);
        if walk.pdf_w > 0.0 {
            weight = hit_weight(walk.pdf_w, sky_pdf_w(walk.direction));
        }
        splat(path_pixel(), walk.throughput * sky_radiance(walk.direction) * weight);
    }
    return DONE;
}
