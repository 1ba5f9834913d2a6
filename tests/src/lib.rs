//! What the whole-system tests share: scenes built in memory, skies, and statistics; and the scenes that the repository ships.

pub mod agreement;
pub mod browser;
pub mod closed_form;
pub mod compared;
pub mod following;
pub mod glb;
pub mod how_to;
pub mod mask;
pub mod material;
pub mod mutation;
pub mod poison;
pub mod probe;
pub mod program;
pub mod references;
pub mod refuse;
pub mod rendering;
pub mod scene_builder;
pub mod shape;
pub mod shipped_scenes;
pub mod sky;
pub mod small_scene;
pub mod statistics;
