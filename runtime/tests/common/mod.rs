//! Renders of small pipelines of one's own, on whatever adapter there is.

use kernelgen::config::model::Selection;
use kernelgen::plan::Plan;
use kernelgen::source::{FileKind, Sources};
use runtime::device::{DeviceOptions, Gpu};
use runtime::render::{Rendered, Session, Settings, Until};

/// Width and height of every picture.
pub const SIZE: [u32; 2] = [70, 30];

/// A hash for the stages.
const HASH: &str = "
fn hash(x: u32) -> u32 {
    let h = x * 747796405u + 2891336453u;
    let word = ((h >> ((h >> 28u) + 4u)) ^ h) * 277803737u;
    return (word >> 22u) ^ word;
}
";

/// A pipeline with its stages, and how they are compiled.
#[derive(Clone, Copy)]
pub struct Small {
    pub pipeline: &'static str,
    pub stages: &'static str,
    pub order: &'static str,
    pub queue: &'static str,
    pub accumulate: &'static str,
}

impl Small {
    pub fn plan(&self) -> Plan {
        let layout = format!("[layout]\norder = \"{}\"\nlane = 1\n", self.order);
        let (queue, accumulate) = (self.queue, self.accumulate);
        let schedule =
            format!("[schedule]\nqueue = \"{queue}\"\nworkgroup = 64\ncapacity = 4\naccumulate = \"{accumulate}\"\n");
        let configs = [
            ("pipelines/p.toml", self.pipeline),
            ("layouts/l.toml", layout.as_str()),
            ("schedules/s.toml", schedule.as_str()),
            ("precisions/f.toml", "[precision]\nreal = \"f32\"\n"),
        ];
        let mut sources = Sources::default();
        for (key, text) in configs {
            sources.add(FileKind::Config, key, key, text);
        }
        let stages = format!("{}{HASH}", self.stages);
        sources.add(FileKind::Module, "stage/small", "stage/small.wgsl", stages);
        let [pipeline, layout, schedule, precision] = configs.map(|(key, _)| key.to_owned());
        let selection = Selection { pipeline, layout, schedule, precision, ..Selection::default() };
        let generated = kernelgen::generate(&sources, &selection);
        generated.unwrap_or_else(|refusal| panic!("{}", refusal.render(false))).plan
    }
}

pub fn gpu() -> Gpu {
    Gpu::open(&DeviceOptions::default()).expect("an adapter")
}

pub fn session(gpu: &Gpu, plan: &Plan, paths: u32) -> Session {
    let settings = Settings { size: SIZE, seed: 7, paths: Some(paths) };
    Session::new(gpu, plan, &|_| None, settings, None).expect("a session")
}

pub fn rendered(gpu: &Gpu, plan: &Plan, paths: u32, samples: u32) -> Rendered {
    let mut session = session(gpu, plan, paths);
    session.run(Until::Samples(samples), &mut |_| true).expect("a render");
    session.picture().expect("a picture")
}
