import package::state::Walk;
import package::outcome::DONE;
import package::features::HAS_SKY;
import package::film::splat;
import package::pass::path_pixel;
import package::light::sky::sky_radiance;

/// The light tracer's paths of one edge into the sky.
fn escape_lt(walk: ptr<function, Walk>) -> u32 {
    if HAS_SKY {
        splat(path_pixel(), walk.throughput * sky_radiance(walk.direction));
    }
    return DONE;
}
