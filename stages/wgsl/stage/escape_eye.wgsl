import package::real::{real, vec3r};
import package::state::{Path, Walk};
import package::outcome::ENDED;
import package::features::HAS_SKY;
import package::light::directional_light::pdf_disk;
import package::light::sky::{sky_pdf_w, sky_radiance};
import package::transport::advance::eye_sums;
import package::transport::implicit::add_implicit;
import package::transport::recursive_mis::{join, scaled};
import package::transport::strategy::{first_joined, implicit_counts, is_used};

/// Ends an eye walk in the sky: the implicit strategy for the light at infinity, weighted against sampling its direction.
fn escape_eye(eye: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    if HAS_SKY {
        let edges = eye.length + 1u;
        if implicit_counts(edges, first_joined(path.light_length)) {
            var rivals = real(0.0);
            if edges > 1u {
                let pdf_sky = sky_pdf_w(eye.direction);
                let sums = eye_sums(eye);
                let sampled = select(0.0, pdf_sky, is_used(edges - 1u, 1u));
                rivals = join(scaled(sampled, sums.a), scaled(pdf_sky * pdf_disk(), sums.b));
            }
            add_implicit(edges, eye.throughput * sky_radiance(eye.direction), rivals);
        }
    }
    return ENDED;
}
