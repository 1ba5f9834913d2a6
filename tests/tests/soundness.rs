//! What a kernel does not load it does not need, and what shares words never meets: shipped pipelines and random programs with garbage
//! in all that is not loaded, against programs whose every field has words of its own.

use kernelgen::report::Report;
use kernelgen::source::FileKind;
use runtime::configs::Library;
use std::fmt::Write;
use tests::rendering::{Job, shipped};

/// Every layout that keeps all bits has been held to be equal without garbage; compact is the one with the least slack.
#[test]
fn garbage_in_what_is_not_loaded_changes_nothing() {
    for pipeline in ["nee", "pt", "lt", "sbdpt", "sbdpt_seed", "sbdpt_pairs"] {
        let job = Job::of_file(shipped("light_kinds")).pipeline(pipeline).layout("compact").size(24, 16).samples(2);
        let clean = job.clone().fixed_point().render();
        assert!(clean.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
        let poisoned = job.fixed_point().poisoned().render();
        assert!(
            poisoned.sums == clean.sums && poisoned.rejected == 0,
            "{pipeline}: a kernel uses what it did not load"
        );
    }
}

/// The test above would see it if a kernel did not load a field that it uses.
#[test]
fn a_load_that_is_missing_is_noticed() {
    let job =
        Job::of_file(shipped("cornell_box")).pipeline("pt").layout("compact").size(24, 16).samples(2).fixed_point();
    let clean = job.render();
    for load in ["eye.throughput = bitcast", "eye.pdf_w = bitcast", "eye.hit.uv = bitcast"] {
        let forgetting = job.clone().poisoned().forgetting(load).render();
        assert!(forgetting.sums != clean.sums || forgetting.rejected > 0, "nobody missed `{load}`");
    }
}

/// Programs of random reads, writes and ways between stages, in random tables, orders, lanes and codecs.
#[test]
fn random_programs_do_the_same_in_shared_words() {
    let mut in_place = 0;
    for seed in 1..=8 {
        let mut library = Library::default();
        let text = Program::new(seed).library(&mut library);
        let job = program_job(library);
        let apart = job.clone().layout("aos").set("dead", "keep").render();
        assert!(apart.sums.iter().any(|&sum| sum != 0), "program {seed}: a black image proves nothing");
        for layout in ["compact", "split"] {
            let shared = job.clone().layout(layout).poisoned().render();
            assert!(shared.sums == apart.sums, "program {seed} in {layout} does something else:\n{text}");
            in_place += copies_in_place(&job.clone().layout(layout).report());
        }
    }
    assert!(in_place > 8, "only {in_place} fields are copied in place");
}

/// Fields that some kernel need not copy.
fn copies_in_place(report: &Report) -> usize {
    let explained = report.field_names().into_iter().filter_map(|name| report.field(&name));
    explained.filter(|text| text.contains("copied in place")).count()
}

fn program_job(library: Library) -> Job {
    let job = Job::of_file(shipped("cornell_box")).library(library).pipeline("program");
    job.size(32, 8).samples(2).fixed_point()
}

/// Name, quantity, and the type in the text.
type Field = (&'static str, &'static str, Type);

/// Parameters of a stage.
const CELLS: &str = "x: ptr<function, Cell>, y: ptr<function, Cell>, z: ptr<function, Cell>";

/// Fields of the record.
const FIELDS: [Field; 10] = [
    ("u0", "\"index\"", Type::Word),
    ("u1", "\"index\"", Type::Word),
    ("u2", "\"index\"", Type::Word),
    ("c0", "{ quantity = \"counter\", bits = 7 }", Type::Bits),
    ("c1", "{ quantity = \"counter\", bits = 7 }", Type::Bits),
    ("c2", "{ quantity = \"counter\", bits = 7 }", Type::Bits),
    ("v0", "\"spectrum\"", Type::Vector),
    ("v1", "\"spectrum\"", Type::Vector),
    ("w0", "\"weight\"", Type::Real),
    ("h0", "\"hit\"", Type::Hit),
];

#[derive(Clone, Copy, PartialEq)]
enum Type {
    Word,
    /// Seven bits.
    Bits,
    Real,
    Vector,
    Hit,
}

/// A random pipeline over two instances of one record, and a third by which stages hand something to relays, which copy it.
struct Program {
    /// State of the generator (Marsaglia 2003, xorshift64).
    random: u64,
    seed: u64,
    stages: usize,
}

impl Program {
    fn new(seed: u64) -> Program {
        let mut program = Program { random: seed.wrapping_mul(0x9e37_79b9_7f4a_7c15), seed, stages: 0 };
        program.stages = 3 + program.below(3);
        program
    }

    fn below(&mut self, count: usize) -> usize {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 33) as usize % count
    }

    /// Adds the pipeline, its stages and a layout of two tables; returns the text of the stages.
    fn library(mut self, library: &mut Library) -> String {
        let (stages, wiring) = self.stages();
        let mut pipeline = format!(
            "extends = \"base.toml\"\nname = \"program\"\ndoc = \"Random program {}.\"\nstart = \"first\"\nrounds = \"24\"\n\n\
             [records.Cell]\nsteps = {{ quantity = \"counter\", bits = 4 }}\n",
            self.seed
        );
        for (name, quantity, _) in FIELDS {
            writeln!(pipeline, "{name} = {quantity}").expect("strings can be written to");
        }
        write!(pipeline, "\n[state]\nx = \"Cell\"\ny = \"Cell\"\nz = \"Cell\"\n\n[stages]\n{wiring}")
            .expect("strings can be written to");
        library.sources.add(FileKind::Config, "pipelines/program.toml", "program.toml", pipeline);
        library.sources.add(FileKind::Module, "stage/program", "program.wgsl", stages.as_str());
        // Spectra are small whole numbers here, which these codecs keep as they are.
        let codec = ["rgbe", "rgb9e5", "rgb13e9", "f16x3"][self.below(4)];
        let (order, lane) = (["aos", "soa", "aosoa8"][self.below(3)], [1, 2, 4][self.below(3)]);
        let split = format!(
            "extends = \"compact.toml\"\n\n[layout]\norder = \"{order}\"\nlane = {lane}\n\n[layout.encode]\n\
             spectrum = \"{codec}\"\n\n[layout.tables]\none = [\"path\", \"x\"]\ntwo = [\"y\", \"z\"]\n"
        );
        library.sources.add(FileKind::Config, "layouts/split.toml", "split.toml", split);
        stages
    }

    fn stages(&mut self) -> (String, String) {
        let mut text = String::from(
            "import package::real::{real, vec2r, vec3r};\nimport package::state::Cell;\n\
             import package::outcome::{DONE, LEFT, RIGHT};\nimport package::film::splat;\n\
             import package::pass::{path_number, path_pixel, path_sample};\n\n\
             fn mixed(a: u32, b: u32) -> u32 {\n    let m = (a ^ (b * 2654435769u)) * 2246822519u;\n    return m ^ (m >> 15u);\n}\n",
        );
        let mut wiring = String::from("first = { on.left = \"s0\" }\n");
        text.push_str("\nfn first(x: ptr<function, Cell>, y: ptr<function, Cell>) -> u32 {\n");
        for cell in ["x", "y"] {
            writeln!(text, "    {cell}.steps = 0u;").expect("strings can be written to");
            for (index, (name, _, ty)) in FIELDS.into_iter().enumerate() {
                let word = format!("mixed(path_number() * 64u + path_sample(), {index}u)");
                writeln!(text, "    {}", assigned(cell, name, ty, &word)).expect("strings can be written to");
            }
        }
        text.push_str("    return LEFT;\n}\n");
        for stage in 0..self.stages {
            let [left, right] = [self.other(stage), self.other(stage)];
            let ways = format!("on.left = \"s{left}\", on.right = \"s{right}\"");
            let handed: Vec<Field> = if self.below(3) == 0 { Vec::new() } else { self.handed() };
            self.push_stage(&mut text, stage, &handed);
            if handed.is_empty() {
                writeln!(wiring, "s{stage} = {{ {ways}, on.done = \"end\" }}")
            } else {
                self.push_relay(&mut text, stage, &handed);
                let on = format!("on.left = \"r{stage}\", on.right = \"r{stage}\", on.done = \"end\"");
                writeln!(wiring, "s{stage} = {{ {on} }}\nr{stage} = {{ {ways} }}")
            }
            .expect("strings can be written to");
        }
        (text, wiring)
    }

    /// A stage that this one may lead to: no stage leads to itself.
    fn other(&mut self, stage: usize) -> usize {
        (stage + 1 + self.below(self.stages - 1)) % self.stages
    }

    /// What a stage hands over to its relay.
    fn handed(&mut self) -> Vec<Field> {
        (0..1 + self.below(4)).map(|_| FIELDS[self.below(FIELDS.len())]).collect()
    }

    /// A stage that copies what it is handed.
    fn push_relay(&mut self, text: &mut String, stage: usize, handed: &[Field]) {
        let mut body = String::new();
        for field in handed {
            let copied = self.copied(*field);
            writeln!(body, "    {copied}").expect("strings can be written to");
        }
        let condition = self.expression();
        write!(
            text,
            "\nfn r{stage}({CELLS}) -> u32 {{\n{body}    return select(LEFT, RIGHT, ({condition} & 4u) == 0u);\n}}\n"
        )
        .expect("strings can be written to");
    }

    /// A copy of what was handed over: on all ways or not, before or after it or its source changes, or of what is also used otherwise.
    fn copied(&mut self, (name, _, ty): Field) -> String {
        let (cell, other) = self.field_of(ty);
        let copy = format!("{cell}.{other} = z.{name};");
        let [condition, word] = [self.expression(), self.expression()];
        match self.below(8) {
            0 => format!("if ({condition} & 1u) == 0u {{ {copy} }}"),
            1 => format!("{copy} {}", assigned("z", name, ty, &word)),
            2 => format!("{} {copy}", assigned("z", name, ty, &word)),
            3 => format!("{copy} if ({condition} & 1u) == 0u {{ {} }}", assigned(cell, other, ty, &word)),
            4 => format!("{copy} y.u0 = mixed({}, {word});", read("z", name, ty)),
            5 => format!("{copy} {}", self.assignment()),
            _ => copy,
        }
    }

    fn push_stage(&mut self, text: &mut String, stage: usize, handed: &[Field]) {
        let end = self.expression();
        write!(
            text,
            "\nfn s{stage}({CELLS}) -> u32 {{\n    x.steps += 1u;\n    \
             if x.steps > 9u {{\n        splat(path_pixel(), vec3r(real({end} & 0xffffu)));\n        return DONE;\n    }}\n"
        )
        .expect("strings can be written to");
        for &(name, _, ty) in handed {
            let word = self.expression();
            writeln!(text, "    {}", assigned("z", name, ty, &word)).expect("strings can be written to");
        }
        for _ in 0..1 + self.below(4) {
            let statement = self.assignment();
            if self.below(3) == 0 {
                let (condition, outcome) = (self.expression(), ["LEFT", "RIGHT"][self.below(2)]);
                let leave = if self.below(2) == 0 { format!("\n        return {outcome};") } else { String::new() };
                writeln!(text, "    if ({condition} & 1u) == 0u {{\n        {statement}{leave}\n    }}")
            } else {
                writeln!(text, "    {statement}")
            }
            .expect("strings can be written to");
        }
        let condition = self.expression();
        let last = match self.below(3) {
            0 => "LEFT".to_owned(),
            1 => "RIGHT".to_owned(),
            _ => format!("select(LEFT, RIGHT, ({condition} & 4u) == 0u)"),
        };
        writeln!(text, "    return {last};\n}}").expect("strings can be written to");
    }

    /// A field of this type.
    fn field_of(&mut self, ty: Type) -> (&'static str, &'static str) {
        let fields: Vec<&str> = FIELDS.iter().filter(|field| field.2 == ty).map(|field| field.0).collect();
        (["x", "y"][self.below(2)], fields[self.below(fields.len())])
    }

    fn field(&mut self) -> (&'static str, &'static str, Type) {
        let (name, _, ty) = FIELDS[self.below(FIELDS.len())];
        (["x", "y"][self.below(2)], name, ty)
    }

    fn assignment(&mut self) -> String {
        let (cell, name, ty) = self.field();
        if self.below(4) == 0 {
            let (to, other) = self.field_of(ty);
            return format!("{to}.{other} = {cell}.{name};");
        }
        let value = self.expression();
        assigned(cell, name, ty, &value)
    }

    /// A word made of two fields.
    fn expression(&mut self) -> String {
        let [a, b] = [self.field(), self.field()].map(|(cell, name, ty)| read(cell, name, ty));
        format!("mixed({a}, {b} + {}u)", self.below(100))
    }
}

/// A field as a word.
fn read(cell: &str, name: &str, ty: Type) -> String {
    match ty {
        Type::Word | Type::Bits => format!("{cell}.{name}"),
        Type::Real => format!("u32({cell}.{name})"),
        Type::Vector => format!("u32({cell}.{name}.x + 256.0 * {cell}.{name}.z)"),
        Type::Hit => format!("({cell}.{name}.prim + u32({cell}.{name}.uv.y))"),
    }
}

/// A field that gets what of a word fits.
fn assigned(cell: &str, name: &str, ty: Type, word: &str) -> String {
    match ty {
        Type::Word => format!("{cell}.{name} = {word};"),
        Type::Bits => format!("{cell}.{name} = {word} & 127u;"),
        Type::Real => format!("{cell}.{name} = real({word} & 0xffffu);"),
        Type::Vector => format!("{cell}.{name} = vec3r(vec3u({word}) >> vec3u(0u, 8u, 16u) & vec3u(255u));"),
        Type::Hit => format!(
            "{cell}.{name}.prim = {word}; {cell}.{name}.t = 0.0; {cell}.{name}.uv = vec2r(real({word} & 255u));"
        ),
    }
}
