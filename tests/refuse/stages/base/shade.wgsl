import package::film::splat;
import package::outcome::{ABSORBED, SCATTERED};
import package::params::max_edges;
import package::pass::path_pixel;
import package::state::{Connection, FLAGS_BOUNCED, Path, Walk};
import package::streams::push_connection;

/// Scatters.
fn shade(path: ptr<function, Path>, eye: ptr<function, Walk>) -> u32 {
    eye.position += eye.direction * eye.hit.t;
    var connection: Connection;
    connection.origin = eye.position;
    connection.contribution = eye.throughput * eye.pdf_w;
    connection.pixel = path_pixel();
    push_connection(connection);
    eye.throughput *= 0.5;
    path.length += 1u;
    path.flags |= FLAGS_BOUNCED;
    if path.length >= max_edges || path.sample == 7u {
        return ABSORBED;
    }
    return SCATTERED;
}

/// Adds what a connection carries.
fn resolve(connection: ptr<function, Connection>) {
    splat(connection.pixel, connection.contribution * connection.origin.z);
}
