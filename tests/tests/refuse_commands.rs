//! Command lines that must be refused: exit code, message, and that nothing is left behind.

use runtime::image_file::Image;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};
use tests::program::program;
use tests::sky::Sky;

/// The user's input is wrong.
const INPUT: i32 = 2;
/// The work failed.
const FAILED: i32 = 1;

/// A folder to run the program in. Removed at the end of its test.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("pathloom-command-{}-{test}", std::process::id()));
        fs::create_dir_all(&path).expect("the temporary folder is writable");
        Folder(path)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(program());
        command.current_dir(&self.0).args(arguments).env("NO_COLOR", "1");
        command.output().expect("the program can be run")
    }

    fn files(&self) -> BTreeSet<PathBuf> {
        let entries = fs::read_dir(&self.0).expect("the folder can be read");
        entries.map(|entry| entry.expect("the folder can be read").path()).collect()
    }

    /// Runs the program, which must end with this code, say these words and leave the folder as it was.
    #[track_caller]
    fn refused(&self, code: i32, arguments: &[&str], words: &[&str]) {
        let before = self.files();
        let output = self.run(arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?} said: {said}");
        words.iter().for_each(|word| assert!(said.contains(word), "`{word}` is not in: {said}"));
        assert!(output.stdout.is_empty(), "results were printed");
        assert_eq!(self.files(), before, "files were written or lost");
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.0.join(name), bytes).expect("the temporary folder is writable");
    }

    /// Writes a picture without settings.
    fn picture(&self, name: &str, size: [u32; 2]) {
        let radiance = vec![0.5; 3 * (size[0] * size[1]) as usize];
        let image = Image { size, radiance, standard_error: None, fixed: None, settings: None };
        image.save(&self.0.join(name)).expect("the temporary folder is writable");
    }

    /// Renders a small picture.
    fn rendered(&self, name: &str) {
        let output = self.run(&["render", "pt", "--size", "8x8", "--spp", "2", "-o", name]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays behind in the temporary one does no harm.
        drop(fs::remove_dir_all(&self.0));
    }
}

#[track_caller]
fn refused(test: &str, arguments: &[&str], words: &[&str]) {
    Folder::new(test).refused(INPUT, arguments, words);
}

#[test]
fn unknown_subcommand() {
    refused("subcommand", &["rendr"], &["rendr", "render"]);
}

#[test]
fn unknown_option() {
    refused("option", &["render", "--layuot", "soa"], &["--layuot", "--layout"]);
}

#[test]
fn unknown_pipeline() {
    let words = ["there is no pipeline named `ptt`", "did you mean `pt`?"];
    refused("pipeline", &["render", "ptt", "-o", "a.exr"], &words);
    refused("emit", &["emit", "ptt"], &words);
}

#[test]
fn unknown_layout() {
    refused("layout", &["render", "--layout", "soaa"], &["there is no layout named `soaa`", "did you mean `soa`?"]);
}

#[test]
fn missing_config_file() {
    refused("config", &["explain", "./mine.toml"], &["./mine.toml: cannot read the file"]);
}

#[test]
fn sizes() {
    refused("size", &["render", "--size", "640"], &["640", "--size", "such as 640x360"]);
    refused("size_zero", &["render", "--size", "0x8"], &["0x8", "at least one pixel"]);
    refused("size_large", &["render", "--size", "99999x8"], &["99999x8", "1x1 to 32768x32768"]);
}

#[test]
fn counts() {
    refused("spp", &["render", "--spp", "0"], &["--spp", "0"]);
    refused("time", &["render", "--time", "-3"], &["--time", "-3", "more than 0"]);
    refused("paths", &["render", "--size", "8x8", "--paths", "0"], &["--paths 0", "between 1024 and"]);
    refused("both", &["render", "--spp", "4", "--time", "3"], &["--spp", "--time", "cannot be used with"]);
}

#[test]
fn set_without_a_value() {
    refused("set", &["render", "--set", "max_edges"], &["max_edges", "such as max_edges=8"]);
}

#[test]
fn set_of_an_unknown_key() {
    refused("set_key", &["render", "--set", "max_egdes=4"], &["K0110", "`max_egdes`", "did you mean `max_edges`?"]);
}

#[test]
fn set_to_a_wrong_value() {
    refused("set_value", &["render", "--set", "max_edges=many"], &["max_edges", "many"]);
    refused("set_range", &["render", "--set", "schedule.workgroup=100"], &["schedule.workgroup", "100"]);
}

#[test]
fn missing_scene() {
    let words = ["there is no scene `cornel_box`", "did you mean `cornell_box`?"];
    refused("scene", &["render", "--scene", "cornel_box"], &words);
    refused("info", &["info", "--scene", "gone.glb"], &["there is no scene `gone.glb`"]);
}

#[test]
fn scene_that_is_none() {
    let folder = Folder::new("scene_text");
    folder.write("scene.glb", b"this is text");
    folder.refused(INPUT, &["render", "--scene", "scene.glb"], &["scene.glb: not a glTF file", "help: a .glb"]);
}

#[test]
fn unknown_camera() {
    refused("camera", &["render", "--camera", "eie"], &["there is no camera `eie`", "help: perspective cameras: "]);
}

#[test]
fn lens_and_sky_options() {
    refused("lens", &["render", "--lens-radius", "-1"], &["--lens-radius", "must not be negative"]);
    refused("build", &["render", "--build", "quick"], &["--build", "quick", "very_fast"]);
    refused("env", &["render", "--env", "gone.exr"], &["gone.exr: cannot read the sky"]);
}

#[test]
fn unknown_adapter() {
    let words = ["no adapter's name contains `abacus`; there are "];
    refused("adapter", &["render", "--size", "8x8", "--adapter", "abacus"], &words);
}

#[test]
fn unknown_layer() {
    refused("aov", &["render", "--aov", "normals"], &["--aov normals", "help: ", "`variance`"]);
    let arguments = ["render", "pt", "--aov", "strategies"];
    refused("aov_pipeline", &arguments, &["the pipeline `pt` has no strategies to show"]);
}

#[test]
fn output_of_another_kind() {
    refused("output", &["render", "-o", "a.png"], &["`a.png` is not called .exr"]);
    let folder = Folder::new("output_folder");
    folder.write("taken", b"a file");
    let words = ["`taken/such/a.exr` cannot be put into a file", "`taken` is not a folder"];
    folder.refused(INPUT, &["render", "-o", "taken/such/a.exr"], &words);
}

/// Nobody can write a file where a folder is, whatever his rights.
#[test]
fn output_that_cannot_be_written() {
    let folder = Folder::new("unwritable");
    for taken in ["a.exr", "b.png"] {
        fs::create_dir(folder.0.join(taken)).expect("the temporary folder is writable");
    }
    for (output, taken) in [("a.exr", "`a.exr` is a folder"), ("b.exr", "`b.png` is a folder")] {
        folder.refused(INPUT, &["render", "pt", "--size", "8x8", "--spp", "1", "-o", output], &[taken]);
    }
}

#[test]
fn difference_that_cannot_be_written() {
    let folder = Folder::new("difference");
    folder.picture("a.exr", [4, 2]);
    fs::create_dir(folder.0.join("difference.png")).expect("the temporary folder is writable");
    let arguments = ["compare", "a.exr", "a.exr", "-o", "difference.png"];
    folder.refused(FAILED, &arguments, &["cannot write `difference.png`"]);
}

#[test]
fn emitted_folder_that_is_a_file() {
    let folder = Folder::new("emit_file");
    folder.write("out", b"");
    folder.refused(FAILED, &["emit", "pt", "-o", "out"], &["out"]);
}

#[test]
fn studies() {
    refused("study", &["study", "layuots"], &["there is no study named `layuots`"]);
    refused("study_file", &["study", "seed/darkk"], &["seed/darkk: cannot read the study", "help: ", "seed/dark"]);
    let folder = Folder::new("study_text");
    folder.write(
        "mine.toml",
        b"title = \"Mine\"\n[[variant]]\nname = \"a\"\nsp = 4\n[[scene]]\nname = \"cornell_box\"\n",
    );
    folder.refused(INPUT, &["study", "mine.toml"], &["mine.toml", "line 2", "unknown field `sp`"]);
    folder.write("taken", b"a file");
    folder.refused(INPUT, &["study", "seed/dark", "-o", "taken/out"], &["`taken` is not a folder"]);
}

#[test]
fn tuning() {
    refused("tune_budget", &["study", "--tune", "cornell_box"], &["--budget"]);
    refused("tune_both", &["study", "seed/dark", "--tune", "cornell_box", "--budget", "1"], &["cannot be used with"]);
    refused("tune_nothing", &["study"], &["STUDY.toml|NAME"]);
    let scene = ["study", "--tune", "cornell_bx", "--budget", "1"];
    refused("tune_scene", &scene, &["there is no scene `cornell_bx`", "did you mean `cornell_box`"]);
    let layout = ["study", "--tune", "cornell_box", "--budget", "1", "--layouts", "aos,sao"];
    refused("tune_layout", &layout, &["layout `sao`", "no layout named `sao`", "did you mean `soa`"]);
}

#[test]
fn compared_pictures_of_two_sizes() {
    let folder = Folder::new("sizes");
    folder.picture("a.exr", [4, 2]);
    folder.picture("b.exr", [2, 4]);
    let words = ["`a.exr` is 4x2 pixels, but `b.exr` is 2x4"];
    folder.refused(INPUT, &["compare", "a.exr", "b.exr", "-o", "difference.png"], &words);
}

#[test]
fn compared_pictures_that_are_none() {
    let folder = Folder::new("compare");
    folder.picture("a.exr", [4, 2]);
    folder.write("b.exr", b"this is text");
    folder.refused(INPUT, &["compare", "a.exr", "b.exr"], &["`b.exr`"]);
    folder.refused(INPUT, &["compare", "a.exr", "gone.exr"], &["`gone.exr`"]);
}

#[test]
fn picture_without_settings() {
    let folder = Folder::new("settings");
    folder.picture("a.exr", [4, 2]);
    folder.refused(INPUT, &["render", "a.exr"], &["a.exr: the picture carries no settings"]);
    folder.refused(INPUT, &["render", "--resume", "a.exr"], &["a.exr: the picture carries no settings"]);
}

#[test]
fn resuming_something_else() {
    let folder = Folder::new("resume");
    folder.rendered("a.exr");
    let before = fs::read(folder.0.join("a.exr")).expect("the picture was written");
    let resumed = |more: &[&'static str]| [&["render", "--resume", "a.exr"], more].concat();
    folder.refused(INPUT, &resumed(&["--size", "16x16"]), &["--size", "cannot be used with"]);
    folder.refused(INPUT, &resumed(&["--set", "max_edges=2"]), &["--set", "cannot be used with"]);
    folder.refused(INPUT, &resumed(&["--spp", "2"]), &["already has 2 samples per pixel", "`--spp 4`"]);
    folder.refused(INPUT, &["render", "nee", "--resume", "a.exr"], &["--resume", "cannot be used with"]);
    assert!(fs::read(folder.0.join("a.exr")).is_ok_and(|now| now == before), "the picture was changed");
}

#[test]
fn refused_variants_are_shown_with_their_place() {
    let folder = Folder::new("variant");
    folder.write("mine.toml", b"extends = \"pt.toml\"\nstart = \"emmit\"\n");
    folder.refused(INPUT, &["explain", "./mine.toml"], &["K0202", "mine.toml:2:9", "start = \"emmit\""]);
    let output = folder.run(&["check", "./mine.toml"]);
    assert_eq!(output.status.code(), Some(INPUT));
    assert!(String::from_utf8_lossy(&output.stderr).contains("mine.toml:2:9"));
}

/// 4200 x 2100 texels of 16 bytes are more than Mesa's software driver binds, and fit a graphics card.
#[test]
fn sky_larger_than_a_binding() {
    let folder = Folder::new("large_sky");
    let texels = vec![[0.5; 3]; 4200 * 2100];
    let sky = Sky { width: 4200, height: 2100, texels }.to_exr().expect("the sky has texels");
    folder.write("sky.exr", &sky);
    let arguments =
        ["render", "--size", "8x8", "--spp", "1", "--adapter", "llvmpipe", "--env", "sky.exr", "-o", "a.exr"];
    if folder.run(&["info"]).stdout.windows(8).any(|word| word == b"llvmpipe") {
        let words = ["`sky_texels` takes 134.6 MiB", "llvmpipe", "binds at most 128.0 MiB", "help: a smaller sky"];
        folder.refused(INPUT, &arguments, &words);
    }
}
