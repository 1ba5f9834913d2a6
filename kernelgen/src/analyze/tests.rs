//! Tests of stage analysis on small stages.

use super::*;
use crate::diagnostic::{Diagnostic, render};
use crate::link::{Constants, Modules, Root, link};
use crate::source::{FileKind, Sources};

const PRELUDE: &str = "
struct Hit { prim: u32, t: f32, uv: vec2f }
struct Walk { position: vec3f, throughput: vec3f, pdf: f32, depth: u32, hit: Hit, old: Hit }
struct Connection { value: vec3f }
const HIT: u32 = 1u;
const MISS: u32 = 2u;
const HAS: bool = true;
const LACKS: bool = false;
var<storage, read> data: array<f32>;
var<storage, read> other: array<f32>;
fn push_connection(c: Connection) { let x = data[0]; }
";

fn sources(stage: &str) -> (Sources, Result<Linked, Vec<Diagnostic>>) {
    let mut sources = Sources::default();
    let text = format!("{stage}{PRELUDE}");
    let id = sources.add(FileKind::Module, "stage", "stage.wgsl", text);
    let modules = Modules::from([("stage".to_string(), id)]);
    let linked = link(&sources, &modules, &Constants::new(), Root { module: "stage", item: "f" });
    (sources, linked)
}

fn analyse(stage: &str) -> (Sources, Result<StageFacts, Vec<Diagnostic>>) {
    let (sources, linked) = sources(stage);
    let facts = linked.and_then(|linked| {
        let module = parse(&linked)?;
        validate(&module, &linked)?;
        let outcomes = BTreeMap::from([(1, "hit".to_string()), (2, "miss".to_string())]);
        let bind = |name: &str| Some(if name == "walk" { "eye".to_string() } else { name.to_string() });
        stage_facts(&module, &linked, "f", &bind, Some(&outcomes))
    });
    (sources, facts)
}

fn facts(stage: &str) -> StageFacts {
    let (sources, facts) = analyse(stage);
    facts.unwrap_or_else(|found| panic!("{}", render(&found, &sources, false)))
}

fn names(leaves: &BTreeMap<Leaf, Span>) -> String {
    let names: Vec<String> = leaves.keys().map(Leaf::to_string).collect();
    names.join(" ")
}

/// Reads, sure writes and possible writes of a stage over one `walk` with this body.
fn of(body: &str) -> [String; 3] {
    let facts = facts(&format!("fn f(walk: ptr<function, Walk>) {{ {body} }}"));
    [names(&facts.reads), names(&facts.writes), names(&facts.maybe)]
}

fn outcomes_of(body: &str) -> String {
    let facts = facts(&format!("fn f(walk: ptr<function, Walk>) -> u32 {{ {body} }}"));
    facts.outcomes.keys().cloned().collect::<Vec<_>>().join(" ")
}

#[test]
fn reads_count_until_the_leaf_is_written() {
    assert_eq!(of("walk.pdf = 1.0; let a = walk.pdf;"), ["", "eye.pdf", ""]);
    assert_eq!(of("let a = walk.pdf; walk.pdf = 1.0;"), ["eye.pdf", "eye.pdf", ""]);
    assert_eq!(of("walk.pdf += 1.0;"), ["eye.pdf", "eye.pdf", ""]);
    assert_eq!(of("let a = walk.position.x;"), ["eye.position", "", ""]);
}

#[test]
fn what_is_written_depends_on_the_outcome() {
    let facts = facts(
        "fn f(walk: ptr<function, Walk>) -> u32 { walk.pdf = 1.0; if data[0] > 0.0 { return MISS; } walk.depth = 1u; \
         if data[1] > 0.0 { walk.hit.t = 1.0; return HIT; } return select(HIT, MISS, data[2] > 0.0); }",
    );
    let written = |outcomes: &[&str]| {
        let leaves = facts.written_with(outcomes.iter().map(|outcome| outcome.to_string()));
        leaves.iter().map(Leaf::to_string).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(written(&["hit"]), "eye.depth eye.pdf");
    assert_eq!(written(&["miss"]), "eye.pdf");
    assert_eq!(written(&["hit", "miss"]), "eye.pdf");
    assert_eq!(names(&facts.maybe), "eye.depth eye.hit.t");
}

#[test]
fn branches_make_writes_possible_or_sure() {
    assert_eq!(of("if walk.pdf > 0.0 { walk.depth = 1u; }"), ["eye.pdf", "", "eye.depth"]);
    assert_eq!(of("if data[0] > 0.0 { walk.depth = 1u; } else { walk.depth = 2u; }"), ["", "eye.depth", ""]);
    assert_eq!(of("if data[0] > 0.0 { walk.depth = 1u; } let a = walk.depth;"), ["eye.depth", "", "eye.depth"]);
    assert_eq!(of("if data[0] > 0.0 { return; } walk.depth = 1u;"), ["", "", "eye.depth"]);
    assert_eq!(of("if data[0] > 0.0 { walk.depth = 0u; return; } walk.depth = 1u;"), ["", "eye.depth", ""]);
    assert_eq!(
        of(
            "switch u32(data[0]) { case 1u: { walk.depth = 0u; } case 2u: { walk.depth = 1u; walk.pdf = 0.0; } default: { walk.depth = 2u; } }"
        ),
        ["", "eye.depth", "eye.pdf"]
    );
}

#[test]
fn loops_may_run_not_at_all() {
    assert_eq!(of("for (var i = 0; i < i32(data[0]); i++) { walk.depth = 1u; }"), ["", "", "eye.depth"]);
    assert_eq!(
        of("loop { walk.depth = 1u; if data[0] > 0.0 { break; } walk.pdf = 0.0; }"),
        ["", "eye.depth", "eye.pdf"]
    );
    assert_eq!(
        of("loop { walk.depth = 1u; continuing { walk.pdf = 1.0; break if data[0] > 0.0; } }"),
        ["", "eye.depth eye.pdf", ""]
    );
    assert_eq!(
        of("loop { if data[1] > 0.0 { continue; } walk.depth = 1u; if data[0] > 0.0 { return; } }"),
        ["", "eye.depth", ""]
    );
    assert_eq!(of("while data[0] > 0.0 { let a = walk.pdf; walk.pdf = 1.0; }"), ["eye.pdf", "", "eye.pdf"]);
}

#[test]
fn structs_are_leaves_member_by_member() {
    assert_eq!(of("walk.hit.t = 1.0;"), ["", "eye.hit.t", ""]);
    assert_eq!(of("walk.hit = Hit(1u, 2.0, vec2f());"), ["", "eye.hit.prim eye.hit.t eye.hit.uv", ""]);
    assert_eq!(
        of("walk.old = walk.hit;"),
        ["eye.hit.prim eye.hit.t eye.hit.uv", "eye.old.prim eye.old.t eye.old.uv", ""]
    );
    assert_eq!(
        of("*walk = Walk();"),
        ["", "eye.position eye.throughput eye.pdf eye.depth eye.hit.prim eye.hit.t eye.hit.uv eye.old.prim eye.old.t eye.old.uv", ""]
            .map(sorted)
    );
}

#[test]
fn of_a_loaded_struct_only_what_is_used_is_read() {
    assert_eq!(of("let hit = walk.hit; walk.pdf = hit.t;"), ["eye.hit.t", "eye.pdf", ""]);
    assert_eq!(
        of("let all = *walk; walk.pdf = all.hit.uv.x + all.position.y;"),
        ["eye.hit.uv eye.position", "eye.pdf", ""]
    );
    assert_eq!(of("let hit = walk.hit; walk.pdf = hit.t; walk.old = hit;")[0], "eye.hit.prim eye.hit.t eye.hit.uv");
}

fn sorted(names: &str) -> String {
    let mut names: Vec<&str> = names.split_whitespace().collect();
    names.sort_unstable();
    names.join(" ")
}

#[test]
fn part_of_a_vector_is_read_and_written() {
    assert_eq!(of("walk.position.x = 1.0;"), ["eye.position", "eye.position", ""]);
    assert_eq!(of("walk.hit.uv[u32(data[0])] = 1.0;"), ["eye.hit.uv", "eye.hit.uv", ""]);
    assert_eq!(of("walk.position = vec3f(); walk.position.x = 1.0;"), ["", "eye.position", ""]);
}

/// Copies of a stage over two walks, and the sources that nothing else needs.
fn copies_of(body: &str) -> [String; 2] {
    let facts = facts(&format!(
        "fn f(a: ptr<function, Walk>, b: ptr<function, Walk>) {{ {body} }}
         fn give(source: ptr<function, Walk>, copy: ptr<function, Walk>) {{ copy.pdf = source.pdf; }}
         fn clear(walk: ptr<function, Walk>) {{ if data[1] > 0.0 {{ walk.pdf = 0.0; }} }}
         fn own(walk: ptr<function, Walk>) -> f32 {{ return walk.pdf; }}"
    ));
    let copies = facts.copies.iter().map(|(copy, source)| format!("{copy}={source}"));
    let only_copied = facts.only_copied.iter().map(Leaf::to_string);
    [copies.collect::<Vec<_>>().join(" "), only_copied.collect::<Vec<_>>().join(" ")]
}

#[track_caller]
fn copies(body: &str, expected: &str) {
    assert_eq!(copies_of(body)[0], expected, "{body}");
}

#[test]
fn copies_hold_on_every_return() {
    copies("b.pdf = a.pdf;", "b.pdf=a.pdf");
    copies("let pdf = (*a).pdf; b.pdf = pdf;", "b.pdf=a.pdf");
    copies("if data[0] > 0.0 { b.pdf = a.pdf; }", "");
    copies("if data[0] > 0.0 { b.pdf = a.pdf; } else { b.pdf = 1.0; }", "");
    copies("if data[0] > 0.0 { b.pdf = a.pdf; } else { b.pdf = a.pdf; }", "b.pdf=a.pdf");
    copies("if data[0] > 0.0 { b.position = a.position; } else { b.position = a.throughput; }", "");
    copies("if data[0] > 0.0 { return; } b.pdf = a.pdf;", "");
    copies("if data[0] > 0.0 { b.pdf = a.pdf; return; } b.depth = 1u; b.pdf = a.pdf;", "b.pdf=a.pdf");
    copies("if LACKS { return; } b.pdf = a.pdf;", "b.pdf=a.pdf");
    copies("for (var i = 0; i < i32(data[0]); i++) { b.pdf = a.pdf; }", "");
    copies("loop { b.pdf = a.pdf; if data[0] > 0.0 { break; } }", "b.pdf=a.pdf");
    copies("loop { b.pdf = a.pdf; if data[0] > 0.0 { break; } a.pdf = 1.0; }", "");
    copies("switch u32(data[0]) { case 1u: { b.pdf = a.pdf; } default: { b.pdf = a.pdf; } }", "b.pdf=a.pdf");
}

#[test]
fn copies_are_of_values_on_entry() {
    copies("a.pdf = 1.0; b.pdf = a.pdf;", "");
    copies("if data[0] > 0.0 { a.pdf = 1.0; } b.pdf = a.pdf;", "");
    copies("a.position.x = 1.0; b.position = a.position;", "");
    copies("b.pdf = a.pdf; a.pdf = 1.0;", "b.pdf=a.pdf");
    // What counts is when the source was loaded.
    copies("let pdf = a.pdf; a.pdf = 1.0; b.pdf = pdf;", "b.pdf=a.pdf");
    copies("let pdf = a.pdf; a.pdf = b.pdf; b.pdf = pdf;", "a.pdf=b.pdf b.pdf=a.pdf");
    copies("b.position = a.position; b.throughput = b.position;", "b.position=a.position b.throughput=a.position");
    copies("b.pdf = a.pdf; a.pdf = b.pdf;", "b.pdf=a.pdf");
}

#[test]
fn copies_end_where_something_else_is_stored() {
    copies("b.pdf = a.pdf; b.pdf = 1.0;", "");
    copies("b.pdf = a.pdf; b.pdf += 0.0;", "");
    copies("b.pdf = a.pdf; if data[0] > 0.0 { b.pdf = 1.0; }", "");
    copies("b.pdf = 1.0; b.pdf = a.pdf;", "b.pdf=a.pdf");
    copies("b.position = a.position; b.position = a.throughput;", "b.position=a.throughput");
    copies("b.position = a.position; b.position.y = 1.0;", "");
    copies("b.position = a.position; b.position[u32(data[0])] = 1.0;", "");
    copies("b.position.x = a.position.x;", "");
    copies("b.pdf = a.pdf; *b = Walk();", "");
    copies("b.pdf = a.pdf * 1.0;", "");
}

#[test]
fn structs_are_copied_member_by_member() {
    copies("b.hit = a.hit;", "b.hit.prim=a.hit.prim b.hit.t=a.hit.t b.hit.uv=a.hit.uv");
    copies("b.hit = a.old; b.hit.t = 1.0;", "b.hit.prim=a.old.prim b.hit.uv=a.old.uv");
    copies("a.hit.t = 1.0; b.hit = a.hit;", "b.hit.prim=a.hit.prim b.hit.uv=a.hit.uv");
    copies("b.hit.uv = a.hit.uv;", "b.hit.uv=a.hit.uv");
    let [all, only] = copies_of("*b = *a;");
    assert_eq!(all.split(' ').count(), 10, "{all}");
    assert_eq!(only.split(' ').count(), 10, "{only}");
}

#[test]
fn copies_are_followed_into_helpers() {
    copies("give(a, b);", "b.pdf=a.pdf");
    copies("give(a, b); clear(b);", "");
    copies("clear(a); give(a, b);", "");
    copies("give(a, b); clear(a);", "b.pdf=a.pdf");
    copies("b.pdf = own(a);", "");
}

#[test]
fn what_is_needed_for_copies_alone_need_not_be_loaded() {
    let only = |body: &str, expected: &str| assert_eq!(copies_of(body)[1], expected, "{body}");
    only("b.pdf = a.pdf;", "a.pdf");
    only("give(a, b);", "a.pdf");
    only("b.pdf = a.pdf; a.pdf = 1.0;", "a.pdf");
    only("b.hit = a.hit;", "a.hit.prim a.hit.t a.hit.uv");
    // The stage uses the source itself, before or after, or what it is stored with.
    only("if a.pdf > 0.0 { b.depth = 1u; } b.pdf = a.pdf;", "");
    only("b.pdf = a.pdf; b.depth = u32(a.pdf);", "");
    only("let pdf = a.pdf; b.pdf = pdf; b.depth = u32(pdf);", "");
    only("b.position = a.position; b.throughput.x = a.position.x;", "");
    only("a.position.x = 1.0; b.throughput = a.throughput; b.position = a.position;", "a.throughput");
    only("var pdf = a.pdf; b.pdf = a.pdf;", "");
    only("b.pdf = a.pdf; b.position.x = own(a);", "");
    // The copy is read again.
    only("b.pdf = a.pdf; b.depth = u32(b.pdf);", "");
    only("b.position = a.position; b.throughput = b.position;", "");
    only("b.position = a.position; b.position.x = 1.0;", "");
    // Another copy does not hold on every return.
    only("b.position = a.position; if data[0] > 0.0 { b.throughput = a.position; }", "");
    only("b.position = a.position; b.throughput = a.position; b.throughput = vec3f();", "");
    only("b.position = a.position; b.throughput = a.position;", "a.position");
}

#[test]
fn helpers_are_followed_for_each_binding() {
    let facts = facts(
        "fn f(eye: ptr<function, Walk>, light: ptr<function, Walk>) { swap(light, eye); }
         fn swap(a: ptr<function, Walk>, b: ptr<function, Walk>) { a.pdf = b.pdf; deep(b); }
         fn deep(c: ptr<function, Walk>) { if c.depth > 1u { c.position = vec3f(); return; } c.throughput = vec3f(); }",
    );
    assert_eq!(names(&facts.reads), "eye.depth eye.pdf");
    assert_eq!(names(&facts.writes), "light.pdf");
    assert_eq!(names(&facts.maybe), "eye.position eye.throughput");
    let params: Vec<(&str, &str)> = facts.params.iter().map(|(name, record)| (&**name, &**record)).collect();
    assert_eq!(params, [("eye", "Walk"), ("light", "Walk")]);
}

#[test]
fn constants_prune_branches_in_all_their_forms() {
    for condition in
        ["LACKS", "LACKS && x", "x && LACKS", "!(HAS || x)", "!HAS", "known", "LACKS && x && x", "decide(1u)"]
    {
        let stage = format!(
            "fn f(walk: ptr<function, Walk>) {{ let x = data[0] > 0.0; var known = LACKS; if {condition} {{ walk.pdf = other[0]; }} }}
             fn decide(a: u32) -> bool {{ return a == 2u; }}"
        );
        let facts = facts(&stage);
        assert!(facts.maybe.is_empty(), "{condition}");
        assert!(!facts.globals.contains("other"), "{condition}");
    }
    assert_eq!(of("if HAS { walk.pdf = 1.0; }"), ["", "eye.pdf", ""]);
    assert_eq!(of("if HAS || walk.depth > 1u { walk.pdf = 1.0; }"), ["", "eye.pdf", ""]);
    assert_eq!(of("switch 2u { case 1u: { walk.pdf = 1.0; } default: { walk.depth = 1u; } }"), ["", "eye.depth", ""]);
}

#[test]
fn outcomes_are_the_constants_that_reach_a_return() {
    assert_eq!(outcomes_of("return HIT;"), "hit");
    assert_eq!(outcomes_of("return select(HIT, MISS, data[0] > 0.0);"), "hit miss");
    assert_eq!(outcomes_of("return select(HIT, MISS, HAS);"), "miss");
    assert_eq!(outcomes_of("if data[0] > 0.0 { return 0u; } return MISS;"), "end miss");
    assert_eq!(outcomes_of("var o = MISS; if data[0] > 0.0 { o = HIT; } return o;"), "hit miss");
    assert_eq!(outcomes_of("var o = MISS; o = HIT; return o;"), "hit");
    assert_eq!(outcomes_of("if LACKS { return MISS; } return HIT;"), "hit");
    assert_eq!(
        outcomes_of("var o = MISS; for (var i = 0; i < 4; i++) { if data[i] > 0.0 { o = HIT; break; } } return o;"),
        "hit miss"
    );
    let facts = facts(
        "fn f(walk: ptr<function, Walk>) -> u32 { return g(walk); } fn g(w: ptr<function, Walk>) -> u32 { if w.pdf > 0.0 { return HIT; } return MISS; }",
    );
    assert_eq!(facts.outcomes.keys().cloned().collect::<Vec<_>>(), ["hit", "miss"]);
}

#[test]
fn what_is_no_outcome_is_refused_at_its_place() {
    for (body, wrong) in
        [("return walk.depth;", "walk.depth"), ("return 7u;", "7u"), ("return HIT + walk.depth;", "HIT + walk.depth")]
    {
        let (sources, facts) = analyse(&format!("fn f(walk: ptr<function, Walk>) -> u32 {{ {body} }}"));
        let found = facts.unwrap_err();
        assert_eq!(found[0].code, "K0320");
        let span = found[0].labels[0].span;
        assert_eq!(&sources.file(span.file).text[span.start as usize..span.end as usize], wrong);
    }
}

#[test]
fn pushes_are_counted_along_the_longest_way() {
    let count = |body: &str| {
        let facts = facts(&format!(
            "fn f(walk: ptr<function, Walk>) {{ var c: Connection; {body} }} fn twice(c: Connection) {{ push_connection(c); push_connection(c); }}"
        ));
        facts.pushes.get("connection").copied()
    };
    assert_eq!(count(""), None);
    assert_eq!(count("push_connection(c);"), Some(Some(1)));
    assert_eq!(count("if data[0] > 0.0 { push_connection(c); } else { twice(c); }"), Some(Some(2)));
    assert_eq!(count("if data[0] > 0.0 { push_connection(c); return; } twice(c); push_connection(c);"), Some(Some(3)));
    assert_eq!(count("for (var i = 0; i < 4; i++) { push_connection(c); }"), Some(None));
    assert_eq!(count("loop { if data[0] > 0.0 { push_connection(c); break; } }"), Some(Some(1)));
}

#[test]
fn globals_are_those_of_live_code() {
    let facts = facts(
        "fn f(walk: ptr<function, Walk>) { walk.pdf = g(); } fn g() -> f32 { return other[1]; } fn h() { let a = data[0]; }",
    );
    assert_eq!(facts.globals.into_iter().collect::<Vec<_>>(), ["other"]);
}

#[test]
fn places_are_the_authors() {
    let stage = "fn f(walk: ptr<function, Walk>) {\n    g(walk);\n}\nfn g(w: ptr<function, Walk>) {\n    w.pdf = w.position.x;\n}\n";
    let facts = facts(stage);
    let text = |span: &Span| &stage[span.start as usize..span.end as usize];
    assert_eq!(facts.reads.values().map(text).collect::<Vec<_>>(), ["w.position.x"]);
    assert_eq!(facts.writes.values().map(text).collect::<Vec<_>>(), ["w.pdf = w.position.x"]);
}

fn refused(stage: &str) -> (Diagnostic, String) {
    let (sources, facts) = analyse(stage);
    let found = facts.unwrap_err();
    (found[0].clone(), render(&found, &sources, false))
}

#[test]
fn wrong_wgsl_is_shown_in_the_authors_file() {
    let (found, text) = refused("\n\nfn f(walk: ptr<function, Walk>) {\n    data[0] = 1.0;\n}\n");
    assert_eq!(found.code, "K0311", "{text}");
    assert!(text.contains("stage.wgsl:4:5"), "{text}");
    assert!(text.contains("Function 'f' is invalid: The pointer doesn't relate"), "{text}");
    assert_eq!(found.labels.len(), 1, "{text}");
    let (found, text) = refused("\nfn f(walk: ptr<function, Walk>) {\n    walk.pdf = missing;\n}\n");
    assert_eq!(found.code, "K0304", "{text}");
    assert!(text.contains("stage.wgsl:3:16"), "{text}");
    let (found, text) = refused("\nfn f(walk: ptr<function, Walk>) {\n    let = 1;\n}\n");
    assert_eq!(found.code, "K0310", "{text}");
    assert!(text.contains("stage.wgsl:3:9"), "{text}");
}

#[test]
fn stages_take_pointers_to_records() {
    let (found, _) = refused("fn f(walk: Walk) {}");
    assert_eq!(found.code, "K0322");
}
