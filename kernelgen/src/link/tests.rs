//! Tests of linking as a whole.

use super::*;
use crate::source::FileKind;

struct Project {
    sources: Sources,
    modules: Modules,
    constants: Constants,
}

impl Project {
    fn new(files: &[(&str, &str)]) -> Self {
        let mut sources = Sources::default();
        let mut modules = Modules::new();
        for (path, text) in files {
            let file = path.replace("::", "/");
            let id = sources.add(FileKind::Module, file.clone(), format!("{file}.wgsl"), *text);
            modules.insert(path.to_string(), id);
        }
        Project { sources, modules, constants: Constants::new() }
    }

    fn with(mut self, module: &str, item: &str, constant: Constant) -> Self {
        self.constants.insert((module.into(), item.into()), constant);
        self
    }

    fn try_link(&self, module: &str, item: &str) -> Result<Linked, Vec<Diagnostic>> {
        link(&self.sources, &self.modules, &self.constants, Root { module, item })
    }

    fn link(&self, module: &str, item: &str) -> Linked {
        match self.try_link(module, item) {
            Ok(linked) => linked,
            Err(found) => panic!("{}", crate::diagnostic::render(&found, &self.sources, false)),
        }
    }

    fn refusal(&self, module: &str, item: &str) -> Diagnostic {
        let mut found = self.try_link(module, item).unwrap_err();
        assert_eq!(found.len(), 1, "{found:?}");
        found.remove(0)
    }

    fn text_at(&self, span: Span) -> &str {
        &self.sources.file(span.file).text[span.start as usize..span.end as usize]
    }
}

#[test]
fn reached_declarations_are_copied_verbatim_in_order_of_first_use() {
    let project = Project::new(&[
        (
            "stage::a",
            "import package::math::{half, Pair};\n\n/// Unused.\nfn other() { missing(); }\n\n/// Root.\nfn root() -> f32 {\n    // keep  me\n    return half(twice(1.0));\n}\n\nfn twice(x: f32) -> f32 { return Pair(x, x).sum; }\n",
        ),
        (
            "math",
            "const TWO = 2.0; // two\nfn half(x: f32) -> f32 { return x / TWO; }\nstruct Pair { sum: f32, rest: f32 }\n",
        ),
    ]);
    let linked = project.link("stage::a", "root");
    assert_eq!(
        linked.text,
        "// stage/a.wgsl:7\n/// Root.\nfn root() -> f32 {\n    // keep  me\n    return half(twice(1.0));\n}\n\n\
         // math.wgsl:2\nfn half(x: f32) -> f32 { return x / TWO; }\n\n\
         // math.wgsl:1\nconst TWO = 2.0; // two\n\n\
         // stage/a.wgsl:12\nfn twice(x: f32) -> f32 { return Pair(x, x).sum; }\n\n\
         // math.wgsl:3\nstruct Pair { sum: f32, rest: f32 }\n"
    );
    let items: Vec<&str> = linked.items.iter().map(|(_, item)| &**item).collect();
    assert_eq!(items, ["root", "half", "TWO", "twice", "Pair"]);
}

#[test]
fn every_copied_byte_is_mapped_to_its_origin() {
    let project = Project::new(&[
        ("a", "import package::b::g;\nfn root() {\n    if F {\n        x();\n    } else { g(); }\n    g();\n}\n"),
        ("b", "enable f16;\nvar<storage, read> data: array<u32>;\nfn g() { data[0]; }\n"),
    ])
    .with("a", "F", Constant::Bool(false));
    let linked = project.link("a", "root");
    let mut copied = 0;
    for (offset, byte) in linked.text.bytes().enumerate() {
        if let Some(span) = linked.map.locate(offset) {
            assert_eq!(project.text_at(span).as_bytes(), [byte], "at {offset}");
            copied += 1;
        }
    }
    let made = "\n\n// a.wgsl:2\n\n\n// b.wgsl:3\n\n\n// b.wgsl:2\n@group(0) @binding(0) \n";
    assert_eq!(copied + made.len(), linked.text.len(), "{}", linked.text);
    let call = linked.text.rfind("g();").unwrap();
    assert_eq!(linked.map.span(call, call + 3), Span { file: crate::source::FileId(0), start: 82, end: 85 });
}

#[test]
fn resources_are_numbered_by_first_use() {
    let project = Project::new(&[(
        "a",
        "var<uniform> u: vec4f;\nvar<private> p: u32;\n/// Rays.\nvar<storage, read_write> w: array<u32>;\nvar<storage> r: array<u32>;\n\
         var<workgroup> shared_words: array<u32, 64>;\nfn root() { w[0] = r[0]; p = shared_words[0]; u.x; }",
    )]);
    let linked = project.link("a", "root");
    let bindings: Vec<(&str, u32, Access)> =
        linked.bindings.iter().map(|binding| (&*binding.name, binding.binding, binding.access)).collect();
    assert_eq!(bindings, [("w", 0, Access::ReadWrite), ("r", 1, Access::Read), ("u", 2, Access::Uniform)]);
    assert!(linked.text.contains("/// Rays.\n@group(0) @binding(0) var<storage, read_write> w: array<u32>;"));
    assert!(linked.text.contains("\nvar<private> p: u32;"));
    assert!(linked.text.contains("\nvar<workgroup> shared_words"));
    assert_eq!(project.text_at(linked.bindings[1].span), "r");
}

#[test]
fn code_of_absent_effects_vanishes_with_what_only_it_reaches() {
    let project = Project::new(&[
        (
            "stage",
            "import package::features::{HAS_SKY, HAS_GLASS};\nimport package::sky::sky_radiance;\nimport package::state::Walk;\n\
             const HAS_ESCAPE: bool = HAS_SKY || HAS_GLASS;\n\
             @compute @workgroup_size(1)\nfn root() {\n    var walk: Walk;\n    if HAS_ESCAPE && walk.t > 0.0 {\n        walk.sky = sky_radiance();\n    }\n    walk.t = 1.0;\n}\n",
        ),
        ("sky", "var<storage, read> sky: array<f32>;\nfn sky_radiance() -> f32 { return sky[0]; }"),
        ("state", "struct Walk {\n    t: f32,\n    /// Of the sky.\n    sky: f32,\n}"),
        ("features", "const HAS_SKY: bool = false;\nconst HAS_GLASS: bool = false;"),
    ])
    .with("features", "HAS_SKY", Constant::Bool(false))
    .with("features", "HAS_GLASS", Constant::Bool(false));
    let linked = project.link("stage", "root");
    assert_eq!(
        linked.text,
        "// stage.wgsl:5\n@compute @workgroup_size(1)\nfn root() {\n    var walk: Walk;\n    walk.t = 1.0;\n}\n\n\
         // state.wgsl:1\nstruct Walk {\n    t: f32,\n}\n"
    );
    assert_eq!(linked.constants_seen, ["HAS_GLASS", "HAS_SKY"]);
    assert!(linked.bindings.is_empty());
}

#[test]
fn members_stay_where_something_else_can_see_them() {
    let structs = "struct Row { a: u32, b: Inner }\nstruct Inner { c: u32, d: u32 }\nstruct Built { e: u32, f: u32 }\n\
                   struct Placed { @location(0) g: u32, h: u32 }\nstruct Plain { i: u32, j: Gone }\nstruct Gone { k: u32 }\n";
    let body = "root() {\n    var row = rows[0];\n    var built = Built(1u, 2u);\n    var placed: Placed;\n    var plain: Plain;\n    plain.i = 1u;\n}\n";
    let text = format!(
        "{structs}var<storage, read> rows: Rows;\nalias Rows = array<Row>;\n@compute @workgroup_size(1)\nfn {body}\nfn not_an_entry_{body}"
    );
    let project = Project::new(&[("a", &text)]);
    let program = project.link("a", "root").text;
    for kept in ["struct Row { a: u32, b: Inner }", "c: u32, d: u32", "e: u32, f: u32", "g: u32, h: u32"] {
        assert!(program.contains(kept), "{kept} in {program}");
    }
    assert!(program.contains("struct Plain { i: u32, }"), "{program}");
    assert!(!program.contains("Gone"), "{program}");
    let part = project.link("a", "not_an_entry_root").text;
    assert!(part.contains("struct Plain { i: u32, j: Gone }"), "{part}");
}

#[test]
fn names_clash_only_when_reached_together() {
    let project = Project::new(&[
        ("a", "import package::b::g;\nfn helper() {}\nfn root() { helper(); g(); }\nfn lone() { g(); }"),
        ("b", "fn g() { helper(); }\nfn helper() {}"),
    ]);
    project.link("a", "lone");
    let found = project.refusal("a", "root");
    assert_eq!(found.code, "K0302");
    let files: Vec<u32> = found.labels.iter().map(|label| label.span.file.0).collect();
    assert_eq!(files, [1, 0]);
}

#[test]
fn missing_imports_matter_only_where_they_are_used() {
    let project = Project::new(&[
        (
            "a",
            "import package::b::{there, theree};\nimport package::bb::x;\nfn fine() { there(); }\nfn item() { theree(); }\nfn module() { x(); }",
        ),
        ("b", "fn there() {}"),
    ]);
    project.link("a", "fine");
    let item = project.refusal("a", "item");
    assert_eq!((item.code, item.help[0].as_str()), ("K0303", "did you mean `there`?"));
    assert_eq!(project.text_at(item.labels[0].span), "theree");
    let module = project.refusal("a", "module");
    assert_eq!((module.code, module.help[0].as_str()), ("K0303", "did you mean `b`?"));
    assert_eq!(project.refusal("a", "nowhere").code, "K0303");
}

#[test]
fn locals_do_not_pull_declarations() {
    let project = Project::new(&[(
        "a",
        "fn hit() -> u32 { return 0u; }\nfn t() {}\nfn root(t: u32) { let hit = hit(); hit + t; }\nfn other(hit: u32) { hit; }",
    )]);
    let names = |item| project.link("a", item).items.into_iter().map(|(_, item)| item).collect::<Vec<_>>();
    assert_eq!(names("root"), ["root", "hit"]);
    assert_eq!(names("other"), ["other"]);
}

#[test]
fn directives_come_first_and_once() {
    let project = Project::new(&[
        ("a", "enable f16;\nimport package::b::g;\nfn root() { g(); }"),
        ("b", "enable f16;\nrequires readonly_and_readwrite_storage_textures;\nfn g() {}"),
    ]);
    let text = project.link("a", "root").text;
    assert!(
        text.starts_with("enable f16;\nrequires readonly_and_readwrite_storage_textures;\n\n// a.wgsl:3\nfn root()"),
        "{text}"
    );
    assert_eq!(text.matches("enable").count(), 1);
}

#[test]
fn assertions_come_with_their_module() {
    let project = Project::new(&[("a", "const N = 2u;\nconst M = 3u;\nconst_assert M > 2u;\nfn root() { N; }")]);
    let items: Vec<String> = project.link("a", "root").items.into_iter().map(|(_, item)| item).collect();
    assert_eq!(items, ["root", "N", "M"]);
    assert!(project.link("a", "root").text.contains("const_assert M > 2u;"));
}

#[test]
fn numbered_resources_and_paths_are_refused() {
    let project = Project::new(&[(
        "a",
        "@group(0) @binding(1) var<uniform> u: u32;\nfn root() { u; }\nfn path() { package::b::g(); }",
    )]);
    assert_eq!(project.refusal("a", "root").code, "K0305");
    assert_eq!(project.refusal("a", "path").code, "K0306");
}
