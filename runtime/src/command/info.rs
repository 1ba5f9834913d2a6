//! `pathloom info`.

use super::input::{self, SceneArguments};
use super::{Failure, print, print_json};
use clap::Args;
use runtime::configs::{Axis, scene_names};
use runtime::device::adapters;
use runtime::error::Error;
use runtime::scene::Stats;
use runtime::settings::RenderFile;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use wgpu::Features;

/// Without `--scene`: adapters, and the configs and scenes that come with the program.
#[derive(Clone, Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Features that decide which variants run, and the words for them.
const FEATURES: [(&str, Features); 4] = [
    ("float32_atomics", Features::SHADER_FLOAT32_ATOMIC),
    ("int64_atomics", Features::SHADER_INT64_ATOMIC_ALL_OPS),
    ("subgroups", Features::SUBGROUP),
    ("timestamps", Features::TIMESTAMP_QUERY_INSIDE_PASSES),
];

/// Lists.
///
/// # Errors
/// User input, when the scene cannot be read.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.scene.scene.is_some() {
        return scene(arguments);
    }
    let found: Vec<Value> = adapters(false).iter().map(adapter).collect();
    let shipped: Vec<(&str, Vec<&str>)> =
        Axis::VARIANT.iter().chain([&Axis::Render]).map(|axis| (axis.folder(), axis.names())).collect();
    if arguments.json {
        let mut object = json!({ "adapters": found, "scenes": scene_names() });
        for (folder, names) in &shipped {
            object[*folder] = json!(names);
        }
        return Ok(print_json(&object)?);
    }
    let mut text = String::new();
    if found.is_empty() {
        text.push_str("no Vulkan adapter; a software one comes with Mesa (lavapipe)\n");
    }
    for adapter in &found {
        text.push_str(&adapter_text(adapter));
    }
    for (folder, names) in shipped.iter().chain([&("scenes", scene_names())]) {
        text.push_str(&format!("{folder:<12} {}\n", names.join(" ")));
    }
    Ok(print(&text)?)
}

fn adapter(adapter: &wgpu::Adapter) -> Value {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    let has: serde_json::Map<_, _> =
        FEATURES.iter().map(|(name, feature)| ((*name).to_owned(), json!(features.contains(*feature)))).collect();
    json!({
        "name": info.name,
        "kind": format!("{:?}", info.device_type),
        "driver": format!("{} {}", info.driver, info.driver_info),
        "features": has,
        "subgroup_size": [info.subgroup_min_size, info.subgroup_max_size],
        "limits": {
            "storage_buffer_binding_bytes": limits.max_storage_buffer_binding_size,
            "buffer_bytes": limits.max_buffer_size,
            "storage_buffers_per_kernel": limits.max_storage_buffers_per_shader_stage,
            "workgroup_threads": limits.max_compute_invocations_per_workgroup,
        },
    })
}

fn adapter_text(adapter: &Value) -> String {
    let limits = &adapter["limits"];
    let features: Vec<String> = FEATURES
        .iter()
        .map(|(name, _)| format!("{name} {}", if adapter["features"][*name] == true { "yes" } else { "no" }))
        .collect();
    let mib = limits["storage_buffer_binding_bytes"].as_u64().unwrap_or(0) >> 20;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    format!(
        "{} ({}, {})\n  {}, {} to {} lanes a subgroup\n  {mib} MiB a binding, {} storage buffers a kernel, {} threads a workgroup\n",
        text(&adapter["name"]),
        text(&adapter["kind"]),
        text(&adapter["driver"]),
        features.join(", "),
        adapter["subgroup_size"][0],
        adapter["subgroup_size"][1],
        limits["storage_buffers_per_kernel"],
        limits["workgroup_threads"],
    )
}

fn scene(arguments: &Arguments) -> Result<(), Failure> {
    let settings = arguments.scene.over(RenderFile::default());
    let mut stats = input::load_scene(&settings)?.stats();
    if let Some(name) = settings.scene.filter(|word| !Path::new(word).exists()) {
        stats.file = shipped(&name, &stats.file);
        stats.sky = stats.sky.map(|sky| shipped(&name, &sky));
    }
    if arguments.json {
        let failed = |error: serde_json::Error| Error::failed(format!("cannot write the numbers as JSON: {error}"));
        print_json(&serde_json::to_value(&stats).map_err(failed)?)?;
    } else {
        print(&scene_text(&stats))?;
    }
    Ok(())
}

/// Where a file of a shipped scene comes from; it was unpacked to a place that is gone by now.
fn shipped(name: &str, file: &Path) -> PathBuf {
    Path::new("configs/scenes").join(name).join(file.file_name().unwrap_or_default())
}

fn scene_text(stats: &Stats) -> String {
    let lights = &stats.lights;
    let [x, y, z] = stats.centre;
    let rows = [
        ("file", stats.file.display().to_string()),
        ("sky", stats.sky.as_ref().map_or("none".to_owned(), |sky| sky.display().to_string())),
        ("triangles", format!("{}, {} without area left out", stats.triangles, stats.dropped)),
        ("extent", format!("radius {:.4} m about {x:.4}, {y:.4}, {z:.4}", stats.radius)),
        ("materials", format!("{}, {} images of {} texels", stats.materials, stats.images, stats.texels)),
        (
            "lights",
            format!(
                "{} triangles, {} point, {} spot, {} directional, {} sky",
                lights.triangles, lights.point, lights.spot, lights.directional, lights.sky
            ),
        ),
        ("cameras", stats.cameras.join(", ")),
        ("camera", format!("{}, {}x{}, {:.2} degrees high", stats.camera, stats.size.0, stats.size.1, stats.yfov_deg)),
        ("hierarchy", format!("{:?}, {} nodes, {} deep", stats.bvh.accelerator, stats.bvh.nodes, stats.bvh.depth)),
        ("tables", format!("{:.2} MiB", stats.bytes as f64 / f64::from(1 << 20))),
    ];
    let mut text: String = rows.iter().map(|(name, value)| format!("{name:<12} {value}\n")).collect();
    text.push_str("effects\n");
    for (name, effect) in &stats.effects {
        let word = if effect.present { "yes" } else { "no" };
        text.push_str(&format!("  {name:<28} {word:<4} {}\n", effect.reason));
    }
    text
}
