//! Studies: every variant on every scene, what each costs and how far off it is, as numbers and as one page.

pub mod axes;
pub mod chart;
pub mod file;
pub mod halving;
pub mod interval;
pub mod lines;
pub mod report;
pub mod results;
pub mod run;
pub mod tune;

pub use file::Study;
pub use results::Results;
pub use run::{Observer, Outcome, run};
