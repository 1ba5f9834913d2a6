import package::state::Connection;
import package::film::splat;
import package::trace::accelerator::trace_any;
import package::trace::opacity::opacity_key;

/// Adds a connection's contribution to its pixel if nothing stands between its ends.
fn resolve(connection: ptr<function, Connection>) {
    let key = opacity_key(connection.origin, connection.direction);
    if !trace_any(connection.origin, connection.direction, connection.distance, key) {
        splat(connection.pixel, connection.contribution);
    }
}
