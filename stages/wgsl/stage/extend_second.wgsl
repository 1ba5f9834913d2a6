import package::state::{Path, Walk};
import package::outcome::{ABSORBED, SCATTERED};
import package::stage::extend_light::extend_light;
import package::transport::strategy::first_joined;

/// Sends the light walk on from the second light vertex of a pair when their eye walk is over. Without a second one it is over, too.
fn extend_second(light: ptr<function, Walk>, path: ptr<function, Path>) -> u32 {
    if first_joined(path.light_length) == path.light_length {
        return ABSORBED;
    }
    return extend_light(light, path);
}
