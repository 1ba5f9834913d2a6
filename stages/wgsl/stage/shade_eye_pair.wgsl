import package::state::{Path, Walk};
import package::outcome::{ENDED, SCATTERED};
import package::bsdf::bsdf::{bsdf_at, is_connectable};
import package::surface::material::material_at;
import package::stage::shade_eye::{meet_light, scatter_eye};
import package::transport::connect::connect;
import package::transport::strategy::{eye_limit, first_joined, is_joined};
import package::transport::walk::arrive;

/// Vertex x_s of the eye walk that belongs to two light vertices: as `shade_eye`, but joins x_s to both, `first` and, where the light
/// walk got so far, the next, `light`.
fn shade_eye_pair(eye: ptr<function, Walk>, first: ptr<function, Walk>, light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    eye.length += 1u;
    let s = eye.length;
    let last = path.light_length;
    let t = first_joined(last);
    let surface = arrive(eye);
    let sums = meet_light(eye, surface, s, t);
    let joins_first = is_joined(s, t);
    let joins_light = last > t && is_joined(s, last);
    if s >= eye_limit(t) && !joins_first && !joins_light {
        return ENDED;
    }
    let bsdf = bsdf_at(surface, material_at(surface), -eye.direction);
    if is_connectable(bsdf) {
        if joins_first {
            connect(eye, first, surface, bsdf, sums, s, t);
        }
        if joins_light {
            connect(eye, light, surface, bsdf, sums, s, last);
        }
    }
    return scatter_eye(eye, surface, bsdf, sums, s, t);
}
