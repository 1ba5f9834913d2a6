import package::state::{Path, Walk};
import package::outcome::{ABSORBED, SCATTERED};
import package::stage::extend_light::extend_light;

/// Keeps y_t as the first light vertex of a pair, and sends the light walk on to the second.
fn extend_first(light: ptr<function, Walk>, first: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    first.hit.prim = light.hit.prim;
    first.hit.uv = light.hit.uv;
    first.direction = light.direction;
    first.throughput = light.throughput;
    first.mis_a = light.mis_a;
    first.mis_b = light.mis_b;
    first.mis_c = light.mis_c;
    return extend_light(light, path);
}
