//! Executes a generated plan over a scene: device, buffers, passes, film, files. Knows no stage and no field by name.

pub mod buffers;
pub mod compare;
pub mod configs;
pub mod copy_rate;
pub mod counters;
pub mod device;
pub mod error;
pub mod execute;
pub mod film;
pub mod image_file;
pub mod kernel_profile;
pub mod measurements;
pub mod occupancy;
pub mod output;
pub mod picture;
pub mod profile;
pub mod program;
pub mod pyramid;
pub mod render;
pub mod scene;
pub mod settings;
pub mod spirv;
pub mod study;
pub mod tallies;
