//! Thousands of damaged inputs: whatever is in them, they are accepted or refused, never a panic. Seeded, so that every run is the same.
//! `FUZZ_ROUNDS=20` tries twenty times as many.

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
use kernelgen::config::{self, model::Selection};
use kernelgen::diagnostic;
use kernelgen::source::FileKind;
use runtime::configs::{Axis, Library};
use runtime::picture::write_png;
use runtime::scene::{LoadOptions, load};
use runtime::settings::RenderFile;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Once;
use std::time::{Duration, Instant};
use std::{fs, panic};
use tests::glb;
use tests::sky::Sky;
use tests::small_scene::packed;

/// What one of the tests may take, optimized.
const LONGEST: Duration = Duration::from_secs(40);

/// Numbers that break arithmetic.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1",
    "3",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "1e30",
    "-1e-30",
    "0.5",
    "1e400",
];

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

thread_local! {
    /// The message of a panic, where one is looked out for.
    static CAUGHT: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Runs a case for every seed and lists those that panic.
fn run(cases: u64, mut case: impl FnMut(&mut Random)) {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            let expected = CAUGHT.with_borrow_mut(|caught| caught.as_mut().map(|text| *text = panic.to_string()));
            if expected.is_none() {
                usual(panic);
            }
        }));
    });
    let rounds: u64 = std::env::var("FUZZ_ROUNDS").ok().and_then(|count| count.parse().ok()).unwrap_or(1);
    let start = Instant::now();
    let mut failures = String::new();
    for seed in 0..cases * rounds {
        CAUGHT.set(Some(String::new()));
        let ended = catch_unwind(AssertUnwindSafe(|| case(&mut Random(seed))));
        let message = CAUGHT.take().unwrap_or_default();
        if ended.is_err() {
            let _ = writeln!(failures, "seed {seed}: {message}");
        }
    }
    assert!(failures.is_empty(), "{failures}");
    let hurried = rounds == 1 && !cfg!(debug_assertions);
    assert!(!hurried || start.elapsed() < LONGEST, "took {:?}", start.elapsed());
}

/// Changes a text in one to three places.
fn damage_text(text: &str, random: &mut Random) -> String {
    let mut characters: Vec<char> = text.chars().collect();
    for _ in 0..=random.below(3) {
        let at = random.below(characters.len());
        let end = (at + 1 + random.below(12)).min(characters.len());
        match random.below(6) {
            0 => drop(characters.drain(at..end)),
            1 => characters
                .insert(at, random.pick(&['[', ']', '{', '}', '"', '=', '.', ',', '\n', '#', 'é', '\u{0}', '_'])),
            2 => drop(characters.splice(at..at, random.pick(&NUMBERS).chars())),
            3 => {
                let copy: Vec<char> = characters[at..end].to_vec();
                let to = random.below(characters.len());
                drop(characters.splice(to..to, copy));
            }
            4 => exchange_words(&mut characters, random),
            _ => exchange_lines(&mut characters, random),
        }
        if characters.is_empty() {
            break;
        }
    }
    characters.into_iter().collect()
}

/// Puts one word of the text in the place of another.
fn exchange_words(characters: &mut Vec<char>, random: &mut Random) {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let starts: Vec<usize> =
        (0..characters.len()).filter(|&i| is_word(characters[i]) && (i == 0 || !is_word(characters[i - 1]))).collect();
    if starts.is_empty() {
        return;
    }
    let end = |start: usize| (start..characters.len()).find(|&i| !is_word(characters[i])).unwrap_or(characters.len());
    let (from, to) = (random.pick(&starts), random.pick(&starts));
    let word: Vec<char> = characters[from..end(from)].to_vec();
    let replaced = to..end(to);
    drop(characters.splice(replaced, word));
}

/// Moves a line, or takes it away.
fn exchange_lines(characters: &mut Vec<char>, random: &mut Random) {
    let text: String = characters.iter().collect();
    let mut lines: Vec<&str> = text.split_inclusive('\n').collect();
    let line = lines.remove(random.below(lines.len()));
    if random.below(2) == 0 {
        lines.insert(random.below(lines.len() + 1), line);
    }
    *characters = lines.concat().chars().collect();
}

/// Changes one to four bytes, or the length.
fn damage_bytes(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            return;
        }
        let at = random.below(bytes.len());
        match random.below(8) {
            0 => bytes.truncate(at),
            1 => bytes.insert(at, random.next() as u8),
            2 => drop(bytes.remove(at)),
            3 => bytes[at] = random.pick(&[0, 1, 127, 128, 255]),
            4 => bytes[at] ^= 1 << random.below(8),
            _ => bytes[at] = random.next() as u8,
        }
    }
}

/// Changes one to three values of a document, wherever they are.
fn damage_json(document: &mut Value, random: &mut Random) {
    for _ in 0..=random.below(3) {
        let count = count_values(document);
        let mut place = 1 + random.below(count - 1);
        damage_value(document, &mut place, random);
    }
}

fn count_values(value: &Value) -> usize {
    match value {
        Value::Array(list) => 1 + list.iter().map(count_values).sum::<usize>(),
        Value::Object(map) => 1 + map.values().map(count_values).sum::<usize>(),
        _ => 1,
    }
}

/// Walks to the value of a number in depth-first order, and changes it.
fn damage_value(value: &mut Value, place: &mut usize, random: &mut Random) {
    if *place == 0 {
        *value = damaged(value, random);
    }
    *place = place.wrapping_sub(1);
    match value {
        Value::Array(list) if *place < usize::MAX / 2 => {
            list.iter_mut().for_each(|inner| damage_value(inner, place, random));
        }
        Value::Object(map) if *place < usize::MAX / 2 => {
            map.values_mut().for_each(|inner| damage_value(inner, place, random));
        }
        _ => {}
    }
}

fn damaged(value: &Value, random: &mut Random) -> Value {
    let number = |random: &mut Random| serde_json::from_str(random.pick(&NUMBERS)).unwrap_or(json!(7));
    match (random.below(6), value) {
        (0, Value::Array(list)) => Value::Array(list.iter().chain(list.last()).cloned().collect()),
        (1, Value::Array(list)) => Value::Array(list.iter().skip(1).cloned().collect()),
        (0..=2, Value::Object(map)) => {
            let gone = map.keys().nth(random.below(map.len())).cloned().unwrap_or_default();
            map.iter().filter(|(key, _)| **key != gone).map(|(key, inner)| (key.clone(), inner.clone())).collect()
        }
        (0..=4, Value::Number(_)) => number(random),
        (0, _) => Value::Null,
        (1, _) => json!([]),
        (2, _) => json!({}),
        (3, _) => json!("VEC4"),
        _ => number(random),
    }
}

/// A file of this test, removed at its end.
struct File(PathBuf);

impl File {
    fn new(name: &str) -> File {
        File(std::env::temp_dir().join(format!("pathloom-fuzz-{}-{name}", std::process::id())))
    }

    fn write(&self, bytes: &[u8]) -> &PathBuf {
        fs::write(&self.0, bytes).expect("the temporary folder is writable");
        &self.0
    }
}

impl Drop for File {
    fn drop(&mut self) {
        // A file that stays behind in the temporary folder does no harm.
        drop(fs::remove_file(&self.0));
    }
}

#[test]
#[should_panic(expected = "seed 3: ")]
fn a_panic_is_told_with_its_seed() {
    run(5, |random| assert_ne!(random.0, 3));
}

#[test]
fn damaged_configs() {
    let library = Library::default();
    run(3000, |random| {
        let keys = Axis::VARIANT.map(|axis| format!("{}/{}.toml", axis.folder(), random.pick(&axis.names())));
        let damaged = keys[random.below(keys.len())].clone();
        let mut sources = library.sources.clone();
        let found = sources.find(FileKind::Config, &damaged).expect("the config is shipped");
        let text = damage_text(&sources.file(found).text.clone(), random);
        sources.add(FileKind::Config, damaged.clone(), damaged, text);
        let [pipeline, layout, schedule, precision] = keys;
        let selection = Selection { pipeline, layout, schedule, precision, ..Selection::default() };
        if random.below(10) == 0 {
            let generated = kernelgen::generate(&sources, &selection);
            drop(generated.map_err(|refusal| refusal.render(false)));
        } else {
            let loaded = config::load(&mut sources, &selection);
            drop(loaded.map_err(|findings| diagnostic::render(&findings, &sources, false)));
        }
    });
}

#[test]
fn damaged_stages() {
    let library = Library::default();
    let modules = stages::modules();
    run(300, |random| {
        let module = &modules[random.below(modules.len())];
        let mut sources = library.sources.clone();
        sources.add(FileKind::Module, module.path, module.name, damage_text(module.text, random));
        let [pipeline, layout, schedule, precision] =
            [("pipelines", "nee"), ("layouts", "soa"), ("schedules", "wavefront"), ("precisions", "f32")]
                .map(|(folder, name)| format!("{folder}/{name}.toml"));
        let selection = Selection { pipeline, layout, schedule, precision, ..Selection::default() };
        drop(kernelgen::generate(&sources, &selection).map_err(|refusal| refusal.render(false)));
    });
}

#[test]
fn damaged_settings() {
    let text = Axis::Render.shipped("cornell_box").expect("the render file is shipped");
    let set = ["max_edges", "schedule.workgroup", "layout.place", "features.sky", "params", "records.Walk.position"];
    let library = Library::default();
    run(1000, |random| {
        drop(RenderFile::parse(&damage_text(text, random), "settings"));
        let value = damage_text(random.pick(&NUMBERS), random);
        let selection = Selection {
            pipeline: "pipelines/pt.toml".to_owned(),
            layout: "layouts/soa.toml".to_owned(),
            schedule: "schedules/wavefront.toml".to_owned(),
            precision: "precisions/f32.toml".to_owned(),
            set: vec![(damage_text(random.pick(&set), random), value)],
            ..Selection::default()
        };
        let mut sources = library.sources.clone();
        let loaded = config::load(&mut sources, &selection);
        drop(loaded.map_err(|findings| diagnostic::render(&findings, &sources, false)));
    });
}

/// The whole scene: a document, a binary chunk and a texture.
fn scene() -> (Value, Vec<u8>) {
    let file = File::new("texture.png");
    write_png(&file.0, [3, 2], &[90; 18]).expect("the temporary folder is writable");
    packed(&fs::read(&file.0).expect("the texture was written"))
}

/// Loads a file, and packs all that the kernels would read of it.
fn load_all(file: &File, bytes: &[u8], options: &LoadOptions) -> bool {
    load(file.write(bytes), options).map(|scene| scene.stats()).is_ok()
}

#[test]
fn damaged_glb_files() {
    let (document, bytes) = scene();
    let whole = glb::file(&document, &bytes);
    let file = File::new("bytes.glb");
    assert!(load_all(&file, &whole, &LoadOptions::default()), "the undamaged scene must load");
    run(2000, |random| {
        let mut damaged = whole.clone();
        damage_bytes(&mut damaged, random);
        load_all(&file, &damaged, &LoadOptions::default());
    });
}

#[test]
fn damaged_gltf_documents() {
    let (document, bytes) = scene();
    let file = File::new("document.glb");
    let mut accepted = 0;
    run(2000, |random| {
        let mut damaged = document.clone();
        damage_json(&mut damaged, random);
        accepted += u32::from(load_all(&file, &glb::file(&damaged, &bytes), &LoadOptions::default()));
    });
    assert!(accepted > 100, "only {accepted} of the damaged documents got beyond the reader");
}

/// Damaged vertices, indices and texels, in a file that is sound otherwise.
#[test]
fn damaged_buffers() {
    let (document, bytes) = scene();
    let file = File::new("buffers.glb");
    run(1000, |random| {
        let mut damaged = bytes.clone();
        damage_bytes(&mut damaged, random);
        damaged.resize(bytes.len(), 0);
        load_all(&file, &glb::file(&document, &damaged), &LoadOptions::default());
    });
}

/// Small skies in every form that is read.
fn skies() -> Vec<Vec<u8>> {
    let sky = Sky::from_directions(8, 4, |towards| [towards.x.abs(), towards.y.abs(), 0.5]);
    let encodings =
        [Encoding::UNCOMPRESSED, Encoding::FAST_LOSSLESS, Encoding::SMALL_LOSSLESS, Encoding::SMALL_FAST_LOSSLESS];
    let mut files: Vec<Vec<u8>> = encodings
        .into_iter()
        .map(|encoding| {
            let texel = |at: exr::prelude::Vec2<usize>| {
                let [r, g, b] = sky.texels[at.1 * sky.width + at.0];
                (r, g, b)
            };
            let layer =
                Layer::new((sky.width, sky.height), LayerAttributes::default(), encoding, SpecificChannels::rgb(texel));
            let mut file = std::io::Cursor::new(Vec::new());
            Image::from_layer(layer).write().non_parallel().to_buffered(&mut file).expect("memory is writable");
            file.into_inner()
        })
        .collect();
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1.0\n\n-Y 4 +X 8\n".to_vec();
    for _ in 0..4 {
        hdr.extend([2, 2, 0, 8]);
        (0..4u8).for_each(|channel| hdr.extend([136, 100 + channel]));
    }
    files.push(hdr);
    files.push(sky.to_exr().expect("the sky has texels"));
    files
}

#[test]
fn damaged_skies() {
    let (document, bytes) = scene();
    let scene = File::new("under_a_sky.glb");
    let file = File::new("sky");
    let skies = skies();
    let options = LoadOptions { env: Some(file.0.clone()), ..LoadOptions::default() };
    let whole = glb::file(&document, &bytes);
    for sky in &skies {
        file.write(sky);
        assert!(load_all(&scene, &whole, &options), "the undamaged skies must load");
    }
    run(1000, |random| {
        let mut damaged = skies[random.below(skies.len())].clone();
        damage_bytes(&mut damaged, random);
        file.write(&damaged);
        load_all(&scene, &whole, &options);
    });
}
