import package::state::Connection;
import package::params::record_strategies;
import package::film::splat;
import package::trace::accelerator::trace_any;
import package::trace::opacity::opacity_key;
import package::transport::record::record_strategy_at;

/// Adds a connection's contribution to its pixel if nothing stands between its ends.
fn resolve(connection: ptr<function, Connection>) {
    let key = opacity_key(connection.origin, connection.direction);
    if !trace_any(connection.origin, connection.direction, connection.distance, key) {
        splat(connection.pixel, connection.contribution);
        if record_strategies {
            record_strategy_at(connection.strategy, connection.pixel, connection.contribution, connection.unweighted);
        }
    }
}
