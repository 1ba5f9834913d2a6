//! The layout never changes the image: bit for bit with the fixed-point film, for every layout in `configs/layouts`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use tests::rendering::{Job, shipped};

fn layouts() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/layouts");
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("configs/layouts is there")
        .filter_map(|entry| entry.expect("the folder can be read").path().file_stem()?.to_str().map(str::to_owned))
        .collect();
    names.sort();
    names
}

fn job(pipeline: &str) -> Job {
    Job::of_file(shipped("cornell_box")).pipeline(pipeline).size(40, 24).samples(4).edges(6).fixed_point()
}

#[test]
fn aos_soa_and_aosoa_are_shipped() {
    let layouts = layouts();
    for name in ["aos", "soa", "aosoa32"] {
        assert!(layouts.iter().any(|layout| layout == name), "configs/layouts/{name}.toml is missing");
    }
}

/// A layout that places fields by name fits the pipelines that have these fields; every layout fits one of them.
#[test]
fn every_layout_gives_the_same_bits() {
    let mut fitting = BTreeSet::new();
    for pipeline in ["nee", "pt", "lt", "sbdpt", "sbdpt_seed"] {
        let expected = job(pipeline).layout("aos").render();
        assert!(expected.sums.iter().any(|&sum| sum != 0), "{pipeline}: a black image proves nothing");
        for layout in layouts() {
            let job = job(pipeline).layout(&layout);
            if let Err(refusal) = job.check() {
                let of_another = ["no such field", "is placed nowhere"].iter().any(|reason| refusal.contains(reason));
                assert!(of_another, "{pipeline} with {layout}: {refusal}");
                eprintln!("SKIPPED: the layout {layout} does not fit {pipeline}");
                continue;
            }
            assert!(job.render().sums == expected.sums, "{pipeline}: the image of {layout} is not that of aos");
            fitting.insert(layout);
        }
    }
    assert_eq!(fitting.into_iter().collect::<Vec<_>>(), layouts(), "each fits a pipeline");
}

/// Both acceleration structures find the same hits.
#[test]
fn both_accelerators_give_the_same_bits() {
    for scene in ["cornell_box", "outdoor"] {
        let job = Job::of_file(shipped(scene)).pipeline("pt").size(40, 24).samples(16).edges(6).fixed_point();
        let images = ["cwbvh", "bvh2"].map(|accelerator| job.clone().set("accelerator", accelerator).render());
        assert!(images[0].sums.iter().any(|&sum| sum != 0), "{scene}: a black image proves nothing");
        assert!(images[0].sums == images[1].sums, "{scene}: bvh2 gives another image than cwbvh");
    }
}

#[test]
fn the_seed_decides_the_image() {
    let first = job("pt").seed(7).render();
    assert!(first.sums == job("pt").seed(7).render().sums, "the same seed gives another image");
    assert!(first.sums != job("pt").seed(8).render().sums, "another seed gives the same image");
}
