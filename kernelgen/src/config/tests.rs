//! Loading whole variants from small texts.

use super::load;
use super::model::{Accumulate, Effect, Order, ParamValue, Selection, Variant};
use super::quantity::Quantity;
use crate::source::{FileKind, Sources};

const BASE: &str = r#"
doc = "shared"
start = "emit"
rounds = "2 * (max_edges - 1) / 2"

[params]
max_edges = { type = "u32", value = 5, doc = "edges" }
heuristic = { type = "choice", of = ["balance", "power"], value = "balance" }

[records.Walk]
position = "position"
length = { quantity = "counter", bits = 8 }

[state]
eye = "Walk"

[stages]
emit = { with.walk = "eye", on.emitted = "trace" }

[stages.trace]
entry = "trace_ray"
on.hit = "end"
rays = "walk"
"#;

/// The base pipeline and three other axes, with further texts.
fn sources(texts: &[(&str, &str)]) -> Sources {
    let mut sources = Sources::default();
    let shipped = [
        ("pipelines/base.toml", BASE),
        ("layouts/soa.toml", "[layout]\norder = \"soa\"\nlane = 1\n"),
        (
            "schedules/wavefront.toml",
            "[schedule]\nqueue = \"atomic\"\nworkgroup = 64\naccumulate = \"racy\"\ncapacity = 4\n",
        ),
        ("precisions/f32.toml", "[precision]\nreal = \"f32\"\n"),
    ];
    for (key, text) in shipped.iter().chain(texts) {
        sources.add(FileKind::Config, *key, *key, *text);
    }
    sources
}

fn selection(pipeline: &str, set: &[(&str, &str)]) -> Selection {
    let effect = Effect { present: false, reason: "no environment".to_owned() };
    Selection {
        pipeline: pipeline.to_owned(),
        layout: "layouts/soa.toml".to_owned(),
        schedule: "schedules/wavefront.toml".to_owned(),
        precision: "precisions/f32.toml".to_owned(),
        set: set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect(),
        effects: [("sky".to_owned(), effect)].into(),
    }
}

fn accepted(sources: &mut Sources, selection: &Selection) -> Variant {
    match load(sources, selection) {
        Ok((variant, _)) => variant,
        Err(findings) => panic!("{}", crate::diagnostic::render(&findings, sources, false)),
    }
}

fn with_set(set: &[(&str, &str)]) -> Variant {
    accepted(&mut sources(&[]), &selection("pipelines/base.toml", set))
}

fn codes(texts: &[(&str, &str)], pipeline: &str, set: &[(&str, &str)]) -> Vec<&'static str> {
    match load(&mut sources(texts), &selection(pipeline, set)) {
        Ok(_) => Vec::new(),
        Err(findings) => findings.iter().map(|finding| finding.code).collect(),
    }
}

#[test]
fn a_file_becomes_the_model() {
    let pipeline = with_set(&[]).pipeline;
    assert_eq!((pipeline.name.as_str(), pipeline.doc.as_str()), ("base", "shared"));
    assert_eq!(pipeline.stages["emit"].entry.value, "emit");
    assert_eq!(pipeline.stages["emit"].with["walk"].value, "eye");
    assert_eq!(pipeline.stages["trace"].entry.value, "trace_ray");
    assert_eq!(pipeline.stages["trace"].on["hit"].value, "end");
    assert_eq!(pipeline.records["Walk"].fields["length"].quantity, Quantity::Counter { bits: 8 });
    assert_eq!(pipeline.params["max_edges"].doc, "edges");
    assert_eq!(super::evaluate_rounds(&pipeline), Ok(4));
}

#[test]
fn the_extending_file_wins_key_by_key() {
    let pt = "extends = \"base.toml\"\nparams.max_edges = 9\n[stages]\ntrace.entry = \"other\"\n[records.Walk]\npdf_w = \"pdf\"\n";
    let mut sources = sources(&[("pipelines/pt.toml", pt)]);
    let pipeline = accepted(&mut sources, &selection("pipelines/pt.toml", &[])).pipeline;
    assert_eq!((pipeline.name.as_str(), pipeline.doc.as_str()), ("pt", ""), "name and doc are a file's own");
    assert_eq!(pipeline.params["max_edges"].value, ParamValue::U32(9));
    assert_eq!(pipeline.params["max_edges"].doc, "edges");
    assert_eq!(pipeline.stages["trace"].entry.value, "other");
    assert_eq!(pipeline.stages["trace"].on["hit"].value, "end");
    let fields: Vec<&String> = pipeline.records["Walk"].fields.keys().collect();
    assert_eq!(fields, ["position", "length", "pdf_w"]);
}

#[test]
fn of_two_bases_the_later_wins_and_a_shared_one_counts_once() {
    let texts = [
        ("pipelines/a.toml", "extends = \"base.toml\"\nparams.max_edges = 7\nparams.heuristic = \"power\"\n"),
        ("pipelines/b.toml", "extends = \"base.toml\"\nparams.heuristic = \"balance\"\n"),
        ("pipelines/c.toml", "extends = [\"a.toml\", \"./b.toml\"]\n"),
    ];
    let pipeline = accepted(&mut sources(&texts), &selection("pipelines/c.toml", &[])).pipeline;
    assert_eq!(pipeline.params["max_edges"].value, ParamValue::U32(7), "b does not bring base's value back");
    let ParamValue::Choice { index, .. } = pipeline.params["heuristic"].value else { panic!("a choice") };
    assert_eq!(index, 0);
}

#[test]
fn a_file_that_extends_itself_is_refused() {
    let texts = [("pipelines/a.toml", "extends = \"../pipelines/a.toml\"\n")];
    assert_eq!(codes(&texts, "pipelines/a.toml", &[]), ["K0105"]);
}

#[test]
fn set_takes_parameters_dotted_keys_and_short_names() {
    let variant = with_set(&[
        ("max_edges", "3"),
        ("max_edges", "8"),
        ("heuristic", "power"),
        ("schedule.workgroup", "128"),
        ("accumulate", "fixed_i64"),
        ("layout.order", "aosoa64"),
        ("entry", "faster"),
        ("records.Walk.tint", "spectrum"),
        ("sky", "true"),
    ]);
    let pipeline = &variant.pipeline;
    assert_eq!(pipeline.params["max_edges"].value, ParamValue::U32(8));
    let ParamValue::Choice { index, .. } = pipeline.params["heuristic"].value else { panic!("a choice") };
    assert_eq!(index, 1);
    assert_eq!(variant.schedule.workgroup.value, 128);
    assert_eq!(variant.schedule.accumulate, Accumulate::FixedI64);
    assert_eq!(variant.layout.order, Order::Aosoa(64));
    assert_eq!(pipeline.stages["trace"].entry.value, "faster", "the only `entry` there is");
    assert_eq!(pipeline.records["Walk"].fields["tint"].quantity, Quantity::Spectrum);
    assert!(variant.effects["sky"].present);
    assert_eq!(variant.effects["sky"].reason, "pinned on in --set");
}

#[test]
fn set_points_into_its_own_text() {
    let mut sources = sources(&[]);
    let selection = selection("pipelines/base.toml", &[("schedule.workgroup", "50")]);
    let findings = load(&mut sources, &selection).expect_err("50 is no workgroup");
    let span = findings[0].labels[0].span;
    let file = sources.file(span.file);
    assert_eq!(file.name, "--set");
    assert_eq!(&file.text[span.start as usize..span.end as usize], "50");
}

#[test]
fn a_capacity_is_a_positive_number() {
    assert_eq!(with_set(&[("capacity", "0.25")]).schedule.capacity.value, 0.25);
    assert_eq!(with_set(&[("schedule.capacity", "14")]).schedule.capacity.value, 14.0);
    for refused in ["0", "-1", "1000.5", "inf", "nan"] {
        let found = codes(&[], "pipelines/base.toml", &[("schedule.capacity", refused)]);
        assert!(found == ["K0107"] || found == ["K0106"], "{refused}: {found:?}");
    }
    assert_eq!(codes(&[], "pipelines/base.toml", &[("schedule.capacity", "[]")]), ["K0106"]);
}

#[test]
fn set_refuses_what_it_cannot_find() {
    assert_eq!(codes(&[], "pipelines/base.toml", &[("max_egdes", "3")]), ["K0110"]);
    assert_eq!(codes(&[], "pipelines/base.toml", &[("", "3")]), ["K0110"]);
    assert_eq!(codes(&[], "pipelines/base.toml", &[("layout.", "3")]), ["K0110"]);
    let order = "extends = \"base.toml\"\nparams.order = { type = \"u32\", value = 1 }\n";
    assert_eq!(codes(&[("pipelines/o.toml", order)], "pipelines/o.toml", &[("order", "aos")]), ["K0111"]);
}

#[test]
fn every_axis_is_reported_at_once() {
    let mut selection = selection("pipelines/none.toml", &[]);
    selection.layout = "layouts/none.toml".to_owned();
    selection.precision = String::new();
    let findings = load(&mut sources(&[]), &selection).expect_err("three files are missing");
    assert_eq!(findings.len(), 3);
    assert!(findings.iter().all(|finding| finding.code == "K0103" && !finding.labels.is_empty()));
}

#[test]
fn equal_input_gives_equal_output() {
    let once = || format!("{:?}", with_set(&[("max_edges", "8")]));
    assert_eq!(once(), once());
}
