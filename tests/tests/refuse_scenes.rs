//! Scenes and skies that must be refused: the message names the file, the place in it, the value and what would be valid.

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage,
};
use runtime::picture::write_png;
use runtime::scene::{Accelerator, BuildPreset, LoadOptions, Scene, load};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tests::scene_builder::SceneBuilder;
use tests::sky::Sky;
use tests::small_scene::{buffer, document};

/// A folder with one small scene: a textured triangle with indices, a lamp and a camera. Removed at the end of its test.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("pathloom-refuse-{}-{test}", std::process::id()));
        fs::create_dir_all(&path).expect("the temporary folder is writable");
        let folder = Folder(path);
        folder.write("scene.gltf", document().to_string().as_bytes());
        folder.write("scene.bin", &buffer());
        write_png(&folder.0.join("red.png"), [2, 2], &[200; 12]).expect("the temporary folder is writable");
        folder
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.0.join(name), bytes).expect("the temporary folder is writable");
    }

    fn load(&self, options: &LoadOptions) -> Result<Scene, runtime::error::Error> {
        load(&self.0.join("scene.gltf"), options)
    }

    /// The message about the scene, which must be the user's mistake and name the file.
    #[track_caller]
    fn refusal(&self, options: &LoadOptions, file: &str) -> String {
        let error = self.load(options).err().expect("the scene must be refused");
        assert_eq!(error.exit_code(), 2, "{error}");
        assert_eq!(error.file.as_deref(), Some(self.0.join(file).as_path()), "{error}");
        error.to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays behind in the temporary one does no harm.
        drop(fs::remove_dir_all(&self.0));
    }
}

/// Asserts that the document is refused after a change, in these words.
#[track_caller]
fn assert_refused(test: &str, change: impl FnOnce(&mut Value), words: &[&str]) {
    let folder = Folder::new(test);
    let mut changed = document();
    change(&mut changed);
    assert_ne!(changed, document(), "nothing was changed");
    folder.write("scene.gltf", changed.to_string().as_bytes());
    assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), words);
}

/// Asserts that the scene is refused after bytes of its buffer were replaced.
#[track_caller]
fn assert_bytes_refused(test: &str, at: usize, bytes: &[u8], words: &[&str]) {
    let folder = Folder::new(test);
    let mut changed = buffer();
    changed[at..at + bytes.len()].copy_from_slice(bytes);
    folder.write("scene.bin", &changed);
    assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), words);
}

#[track_caller]
fn assert_words(message: &str, words: &[&str]) {
    words.iter().for_each(|word| assert!(message.contains(word), "`{word}` is not in: {message}"));
}

#[test]
fn the_scene_that_the_cases_change_loads() {
    let folder = Folder::new("good");
    let scene = folder.load(&LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((scene.triangle_count(), scene.warnings.len()), (1, 0), "{:?}", scene.warnings);
}

#[test]
fn required_extension() {
    let extension = "KHR_draco_mesh_compression";
    assert_refused(
        "extension",
        |d| d["extensionsRequired"] = json!([extension]),
        &["extensionsRequired", extension, "help: supported: ", "KHR_texture_transform"],
    );
}

#[test]
fn other_version() {
    assert_refused("version", |d| d["asset"]["version"] = json!("1.0"), &["asset", "`1.0`", "help: version 2.x"]);
}

#[test]
fn missing_buffer_file() {
    assert_refused("buffer", |d| d["buffers"][0]["uri"] = json!("gone.bin"), &["buffer 0", "gone.bin"]);
}

#[test]
fn buffer_shorter_than_promised() {
    assert_refused("short", |d| d["buffers"][0]["byteLength"] = json!(99), &["buffer 0", "99", "80 bytes"]);
}

#[test]
fn buffer_from_the_network() {
    let url = "https://example.org/a.bin";
    assert_refused("url", |d| d["buffers"][0]["uri"] = json!(url), &["buffer 0", url, "help: a relative path"]);
}

#[test]
fn missing_texture_file() {
    assert_refused("texture", |d| d["images"][0]["uri"] = json!("gone.png"), &["image 0", "gone.png"]);
}

#[test]
fn image_without_a_source() {
    assert_refused("source", |d| d["images"][0] = json!({}), &["image 0", "bufferView", "help: one of the two"]);
}

#[test]
fn texture_that_is_no_picture() {
    let folder = Folder::new("text");
    folder.write("red.png", b"this is text");
    assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), &["image 0", "74, 68, 69, 73", "PNG or JPEG"]);
}

#[test]
fn texture_cut_short() {
    let folder = Folder::new("cut");
    let bytes = fs::read(folder.0.join("red.png")).expect("the texture was written");
    folder.write("red.png", &bytes[..40]);
    assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), &["image 0", "cannot decode the image"]);
}

#[test]
fn texture_without_texels() {
    let folder = Folder::new("empty");
    let mut bytes = fs::read(folder.0.join("red.png")).expect("the texture was written");
    bytes[16..20].fill(0);
    folder.write("red.png", &bytes);
    assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), &["image 0", "cannot decode the image"]);
}

/// Walks have 8 bits for the number of the medium that they are in; 0 is none.
#[test]
fn more_media_than_walks_can_tell_apart() {
    let with_media = |count: usize| {
        move |d: &mut Value| {
            let glass = |number: usize| {
                json!({ "name": format!("glass {number}"), "pbrMetallicRoughness": { "metallicFactor": 0.0 }, "extensions": {
                    "KHR_materials_transmission": { "transmissionFactor": 1.0 },
                    "KHR_materials_volume": { "thicknessFactor": 1.0, "attenuationDistance": 0.5, "attenuationColor": [0.9, 0.8, 0.1] },
                } })
            };
            let materials = d["materials"].as_array_mut().expect("the document has materials");
            let first = materials.len();
            materials.extend((1..=count).map(glass));
            let primitives = d["meshes"][0]["primitives"].as_array_mut().expect("the document has a mesh");
            let triangle = primitives[0].clone();
            primitives.extend((first..first + count).map(|material| {
                let mut triangle = triangle.clone();
                triangle["material"] = json!(material);
                triangle
            }));
        }
    };
    let words = ["256 materials absorb light", "material \"glass 256\" is the first too many", "at most 255"];
    assert_refused("media", with_media(256), &words);
    let folder = Folder::new("media-fit");
    let mut fitting = document();
    with_media(255)(&mut fitting);
    folder.write("scene.gltf", fitting.to_string().as_bytes());
    assert!(folder.load(&LoadOptions::default()).is_ok());
}

#[test]
fn accessor_beyond_its_view() {
    assert_refused(
        "accessor",
        |d| d["accessors"][1]["count"] = json!(4),
        &["mesh 0 `flag`, primitive 0, TEXCOORD_0, accessor 1", "4 elements of 8 bytes", "buffer view 1 of 24 bytes"],
    );
}

#[test]
fn accessor_without_data() {
    let change = |d: &mut Value| {
        d["accessors"][0]["count"] = json!(1u32 << 31);
        d["accessors"][0]["bufferView"].take();
    };
    assert_refused("zeros", change, &["accessor 0", "count 2147483648 without a buffer view", "help: at most 4194304"]);
}

#[test]
fn attributes_of_different_lengths() {
    assert_refused(
        "lengths",
        |d| d["accessors"][1]["count"] = json!(2),
        &["TEXCOORD_0, accessor 1", "2 elements, POSITION has 3"],
    );
}

#[test]
fn view_beyond_its_buffer() {
    assert_refused(
        "view",
        |d| d["bufferViews"][0]["byteOffset"] = json!(60),
        &["accessor 0, buffer view 0", "36 bytes from byte 60 on", "buffer 0 of 80 bytes"],
    );
}

#[test]
fn view_of_no_buffer() {
    assert_refused("no_buffer", |d| d["bufferViews"][0]["buffer"] = json!(7), &["bufferViews[0].buffer"]);
}

#[test]
fn position_that_is_no_number() {
    assert_bytes_refused(
        "nan",
        28,
        &f32::NAN.to_le_bytes(),
        &[
            "mesh 0 `flag`, primitive 0, POSITION, accessor 0",
            "vertex 2 is [0.0, NaN, 0.0]",
            "help: finite coordinates",
        ],
    );
}

#[test]
fn index_of_no_vertex() {
    let words = ["mesh 0 `flag`, primitive 0, indices, accessor 2", "index 1 is 9", "3 vertices"];
    assert_bytes_refused("index", 62, &9u16.to_le_bytes(), &words);
}

#[test]
fn indices_of_another_type() {
    assert_refused(
        "floats",
        |d| d["accessors"][2]["componentType"] = json!(5122),
        &["indices, accessor 2", "I16", "help: unsigned byte, short or int"],
    );
}

#[test]
fn positions_of_another_type() {
    assert_refused(
        "vec2",
        |d| d["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(1),
        &["POSITION, accessor 1", "Vec2", "help: Vec3"],
    );
}

#[test]
fn sparse_index_of_no_element() {
    let words = ["POSITION, accessor 0, sparse", "index 300 of an accessor with 3 elements"];
    assert_bytes_refused("sparse", 66, &300u16.to_le_bytes(), &words);
}

#[test]
fn mesh_that_is_not_there() {
    assert_refused("mesh", |d| d["nodes"][0]["mesh"] = json!(9), &["nodes[0].mesh"]);
}

#[test]
fn light_that_is_not_there() {
    let change = |d: &mut Value| d["nodes"][2]["extensions"]["KHR_lights_punctual"]["light"] = json!(4);
    assert_refused("light", change, &["node 2", "light 4 does not exist", "1"]);
}

#[test]
fn node_below_itself() {
    let change = |d: &mut Value| {
        d["nodes"][3]["children"] = json!([0]);
    };
    assert_refused("cycle", change, &["node 0", "its own descendant"]);
}

#[test]
fn node_below_two_nodes() {
    let change = |d: &mut Value| {
        d["nodes"][1]["children"] = json!([3]);
    };
    assert_refused("parents", change, &["node 3 `inner`", "child of node 0 and again of node 1", "one parent at most"]);
}

#[test]
fn factor_outside_its_range() {
    let change = |d: &mut Value| d["materials"][0]["emissiveFactor"] = json!([-1.0, 0.0, 0.0]);
    assert_refused(
        "factor",
        change,
        &["material \"paint\"", "emissiveFactor", "-1.0", "help: finite and not negative"],
    );
}

#[test]
fn orthographic_camera() {
    let change = |d: &mut Value| {
        let orthographic = json!({ "xmag": 1.0, "ymag": 1.0, "zfar": 10.0, "znear": 0.1 });
        d["cameras"][0] = json!({ "type": "orthographic", "orthographic": orthographic });
    };
    assert_refused(
        "orthographic",
        change,
        &["camera `eye`", "orthographic", "help: the file has no perspective camera"],
    );
}

#[test]
fn unknown_camera() {
    let folder = Folder::new("camera");
    let options = LoadOptions { camera: Some("eie".into()), ..LoadOptions::default() };
    let message = folder.refusal(&options, "scene.gltf");
    assert_words(&message, &["there is no camera `eie`", "help: perspective cameras: `eye`"]);
}

#[test]
fn text_that_is_no_gltf() {
    let folder = Folder::new("magic");
    folder.write("scene.gltf", b"PK\x03\x04 and so on");
    let message = folder.refusal(&LoadOptions::default(), "scene.gltf");
    assert_words(&message, &["not a glTF file", "50, 4b, 03, 04", "help: a .glb (magic `glTF`)"]);
}

#[test]
fn json_with_a_misprint() {
    let folder = Folder::new("json");
    folder.write("scene.gltf", b"{\n  \"asset\": { \"version\": \"2.0\" }\n  \"nodes\": []\n}");
    assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), &["not glTF 2.0", "line 3 column 3"]);
}

#[test]
fn glb_cut_short() {
    let folder = Folder::new("glb");
    let mut scene = SceneBuilder::new();
    scene.point_light(glam::DVec3::Y, [1.0; 3]);
    let glb = scene.to_glb();
    for (length, word) in [(glb.len() - 4, "the header promises"), (10, "it ends after 10 bytes")] {
        folder.write("scene.gltf", &glb[..length]);
        assert_words(&folder.refusal(&LoadOptions::default(), "scene.gltf"), &["truncated GLB", word]);
    }
}

#[test]
fn no_such_scene() {
    let folder = Folder::new("none");
    let error = load(&folder.0.join("gone.glb"), &LoadOptions::default()).err().expect("there is no such file");
    assert_words(&error.to_string(), &["gone.glb: no such file", "help: a .glb or .gltf file"]);
}

#[test]
fn folder_without_a_description() {
    let folder = Folder::new("folder");
    let error = load(&folder.0, &LoadOptions::default()).err().expect("the folder describes no scene");
    assert_words(&error.to_string(), &["the folder has no scene.toml", "help: "]);
}

#[test]
fn description_with_mistakes() {
    let folder = Folder::new("description");
    let message = |text: &str| {
        folder.write("scene.toml", text.as_bytes());
        let error = load(&folder.0, &LoadOptions::default()).err().expect("the description is wrong");
        assert_eq!(error.file.as_deref(), Some(folder.0.join("scene.toml").as_path()));
        error.to_string()
    };
    assert_words(&message("file = 7\n"), &["line 1", "file = 7", "expected a string"]);
    assert_words(&message("file = \"gone.glb\"\n"), &["gone.glb, which does not exist"]);
    assert_words(&message("doc = \"\"\n"), &["`file` names no glTF file", "help: file = \"scene.glb\""]);
}

/// The message about a sky, which must be the user's mistake and name the sky's file.
#[track_caller]
fn sky_refusal(test: &str, bytes: &[u8], change: impl FnOnce(&mut LoadOptions)) -> String {
    let folder = Folder::new(test);
    folder.write("sky.exr", bytes);
    let mut options = LoadOptions { env: Some(folder.0.join("sky.exr")), ..LoadOptions::default() };
    change(&mut options);
    let file = options.env.clone().unwrap_or_default();
    folder.refusal(&options, &file.file_name().unwrap_or_default().to_string_lossy())
}

fn exr() -> Vec<u8> {
    Sky::constant([1.0; 3]).to_exr().expect("the sky has texels")
}

#[test]
fn sky_that_is_not_there() {
    let gone = |options: &mut LoadOptions| {
        options.env = options.env.take().map(|path| path.with_file_name("gone.hdr"));
    };
    assert_words(&sky_refusal("sky_gone", &exr(), gone), &["gone.hdr: cannot read the sky"]);
}

#[test]
fn sky_that_is_no_image() {
    let message = sky_refusal("sky_text", b"this is text", |_| {});
    assert_words(&message, &["sky.exr: the sky is neither OpenEXR nor Radiance HDR", "help: an .exr or .hdr file"]);
}

#[test]
fn sky_cut_short() {
    let bytes = exr();
    let message = sky_refusal("sky_cut", &bytes[..bytes.len() - 10], |_| {});
    assert_words(&message, &["sky.exr: cannot read the OpenEXR file"]);
    let message = sky_refusal("hdr_cut", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n\x02\x02", |_| {});
    assert_words(&message, &["sky.exr: cannot read the Radiance HDR file"]);
}

#[test]
fn sky_without_colours() {
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> =
        ["depth", "id"].map(|name| AnyChannel::new(name, FlatSamples::F32(vec![1.0; 2]))).into_iter().collect();
    let layer = Layer::new((2, 1), LayerAttributes::default(), Encoding::UNCOMPRESSED, AnyChannels::sort(channels));
    let mut file = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut file).expect("memory is writable");
    let message = sky_refusal("sky_depth", &file.into_inner(), |_| {});
    assert_words(&message, &["sky.exr: its channels are depth, id", "help: R, G and B, or Y"]);
}

#[test]
fn sky_without_texels_and_with_too_many() {
    for (size, shown) in [("-Y 0 +X 8", "8x0"), ("-Y 65536 +X 65536", "65536x65536")] {
        let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n");
        let message = sky_refusal("sky_size", header.as_bytes(), |_| {});
        assert_words(&message, &[&format!("sky.exr: the sky is {shown}"), "help: 1x1 to 134217728 texels"]);
    }
}

#[test]
fn sky_scaled_by_nonsense() {
    let message = sky_refusal("sky_scale", &exr(), |options| options.env_scale = Some(f64::NAN));
    assert_words(&message, &["sky.exr: scale NaN", "help: a finite scale of 0 or more"]);
}

/// What is no radiance in a sky is replaced, and said: such pictures are common.
#[test]
fn sky_with_nonsense_in_it_is_repaired() {
    let folder = Folder::new("sky_nan");
    let mut sky = Sky::constant([1.0; 3]);
    sky.texels[3] = [f32::NAN, -1.0, f32::INFINITY];
    folder.write("sky.exr", &sky.to_exr().expect("the sky has texels"));
    let options = LoadOptions { env: Some(folder.0.join("sky.exr")), ..LoadOptions::default() };
    let scene = folder.load(&options).unwrap_or_else(|error| panic!("{error}"));
    assert_words(&scene.warnings.join("\n"), &["sky.exr: 3 values are negative or not finite and were replaced"]);
}

/// Triangles that shrink by half from one to the next, into a corner: no hierarchy over them is shallow.
fn shrinking(folder: &Folder, count: i32) {
    let corners = |i: i32| {
        let size = f64::from(60 - i).exp2() as f32;
        [size, size, 0.0, 2.0 * size, size, 0.0, size, 2.0 * size, 0.0]
    };
    let bytes: Vec<u8> = (0..count).flat_map(corners).flat_map(f32::to_le_bytes).collect();
    folder.write("scene.bin", &bytes);
    let document = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "byteLength": bytes.len(), "uri": "scene.bin" }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3 * count, "type": "VEC3" }],
    });
    folder.write("scene.gltf", document.to_string().as_bytes());
}

#[test]
fn hierarchy_deeper_than_the_stack() {
    let folder = Folder::new("deep");
    shrinking(&folder, 85);
    let options = LoadOptions { build: BuildPreset::VeryFast, ..LoadOptions::default() };
    let mut scene = folder.load(&options).unwrap_or_else(|error| panic!("{error}"));
    let error = scene.set_accelerator(Accelerator::Bvh2).expect_err("the hierarchy is too deep");
    assert_eq!(error.exit_code(), 2);
    assert_words(&error.to_string(), &["scene.gltf: the hierarchy", "levels, the kernels traverse 64", "help: "]);
    assert!(scene.resource("bvh2_nodes").is_none());
    assert!(scene.set_accelerator(Accelerator::Cwbvh).is_ok());
    assert!(scene.resource("bvh_nodes").is_some());
}

/// The path of the test's folder is no part of a message that a user could not write himself.
#[test]
fn messages_name_files_as_they_were_given() {
    let error = load(Path::new("no/such/scene.glb"), &LoadOptions::default()).err().expect("there is no such file");
    assert!(error.to_string().starts_with("no/such/scene.glb: "), "{error}");
}
