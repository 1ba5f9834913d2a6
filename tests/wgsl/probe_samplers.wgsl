//! Probes of the random numbers: tables of what uses draw.

import package::real::vec3r;
import package::outcome::DONE;
import package::film::splat;
import package::pass::{path_pixel, path_sample};
import package::random::{DIMENSION_SCATTER, WALK_EYE, random4};
import package::scene::scene;

/// Pixels whose numbers are written, and uses in each.
const PIXELS: u32 = 2u;
const USES: u32 = 16u;

/// Two rows for each use in each of the first pixels, a column for each sample: x, y, z, and below them w. The bits of a use's number are
/// its walk, its dimension and two of its vertex.
fn tabulate() -> u32 {
    let pixel = path_pixel();
    if pixel >= PIXELS {
        return DONE;
    }
    for (var place = 0u; place < USES; place++) {
        let vertex = 1u + ((place >> 2u) & 1u) + ((place >> 3u) << 8u);
        let random = random4(place & 1u, vertex, (place >> 1u) & 1u);
        let cell = 2u * (pixel * USES + place) * scene.counts.x + path_sample();
        splat(cell, random.xyz);
        splat(cell + scene.counts.x, vec3r(random.w, 0.0, 0.0));
    }
    return DONE;
}

/// The first three numbers of a use in every pixel.
fn scatter_numbers() -> u32 {
    splat(path_pixel(), random4(WALK_EYE, 1u, DIMENSION_SCATTER).xyz);
    return DONE;
}
