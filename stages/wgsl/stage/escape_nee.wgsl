import package::state::{Path, Walk};
import package::outcome::DONE;
import package::features::HAS_SKY;
import package::film::splat;
import package::pass::path_pixel;
import package::light::sky::sky_radiance;
import package::transport::reference::counts_met_light;

/// Ends the reference's eye walk in the sky, which counts where it could not have been sampled (path of
/// `path.length` + 1 edges).
fn escape_nee(walk: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    if HAS_SKY {
        if counts_met_light(walk, path.length + 1u) {
            splat(path_pixel(), walk.throughput * sky_radiance(walk.direction));
        }
    }
    return DONE;
}
