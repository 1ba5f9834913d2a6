//! The four axes as TOML: reading, `extends`, `--set`, checking.

mod axis;
mod codec;
mod encode;
mod expression;
mod feature;
mod layout;
mod merge;
pub mod model;
mod name;
mod param;
mod pipeline;
pub mod quantity;
mod schedule;
mod section;
mod set;
mod suggest;
mod tree;
mod wiring;

#[cfg(test)]
mod tests;

pub use axis::load;
pub use expression::{MOST_ROUNDS, evaluate_inner, evaluate_rounds, evaluate_size};
pub use suggest::nearest;
