import package::state::Connection;
import package::params::record_strategies;
import package::film::splat;
import package::trace::accelerator::trace_any;
import package::trace::opacity::opacity_key;
import package::transport::record::record_strategy_at;

/// Adds a connection's contribution to its pixel if nothing stands between its ends.
fn resolve(connection: ptr<function, Connection>) {
    _ = arrives(connection);
}

/// As `resolve`, for pipelines whose connections know their strategy.
fn resolve_strategy(connection: ptr<function, Connection>) {
    let arrived = arrives(connection);
    if record_strategies && arrived {
        record_strategy_at(connection.strategy, connection.pixel, connection.contribution, connection.unweighted);
    }
}

/// Whether a connection's contribution gets to its pixel, to which it is then added.
fn arrives(connection: ptr<function, Connection>) -> bool {
    let key = opacity_key(connection.origin, connection.direction);
    if trace_any(connection.origin, connection.direction, connection.distance, key) {
        return false;
    }
    splat(connection.pixel, connection.contribution);
    return true;
}
