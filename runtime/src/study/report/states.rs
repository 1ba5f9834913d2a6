//! Pictures of layouts: which field lives in which word, and who shares it.

use super::html::{element, section, table};
use crate::study::chart::{colour, escape, text};
use crate::study::results::{Results, State};
use kernelgen::report::{FieldReport, Place, TableReport};
use std::collections::BTreeMap;

/// Width of a bit and height of a field, in pixels.
const BIT: f64 = 5.0;
const HEIGHT: f64 = 20.0;
/// Room on the left for the numbers of words, and of a letter.
const LEFT: f64 = 70.0;
const LETTER: f64 = 6.7;
/// Bits of a word.
const WORD: u32 = 32;

/// A field in one word.
struct Part<'a> {
    field: &'a FieldReport,
    word: u32,
    /// Its lowest bit there, and how many bits.
    shift: u32,
    bits: u32,
    /// Its place among those that share bits with it, from the top.
    track: usize,
}

/// The layout of every variant, equal ones once.
pub fn section_of(results: &Results) -> String {
    let mut groups: Vec<(&State, BTreeMap<&str, Vec<&str>>)> = Vec::new();
    for state in &results.states {
        let equal = |(known, _): &&mut (&State, _)| known.tables == state.tables && known.dead == state.dead;
        let index = match groups.iter_mut().position(|group| equal(&group)) {
            Some(index) => index,
            None => {
                groups.push((state, BTreeMap::new()));
                groups.len() - 1
            }
        };
        groups[index].1.entry(state.variant.as_str()).or_default().push(&state.scene);
    }
    if groups.is_empty() {
        return String::new();
    }
    let doc = "Each row is one lane: the words that one access moves; bit 0 of a word is on its left. Fields of one instance have one \
               colour. Fields above each other share their bits, for they are never alive together.";
    let instances = instances(&results.states);
    let figures: String = groups.iter().map(|(state, users)| of_state(state, users, &instances)).collect();
    section("State", &(element("p", "", doc) + &figures))
}

fn of_state(state: &State, users: &BTreeMap<&str, Vec<&str>>, instances: &[&str]) -> String {
    let users: Vec<String> =
        users.iter().map(|(variant, scenes)| format!("{variant} ({})", scenes.join(", "))).collect();
    let rays = match state.ray_bytes_per_path {
        0 => String::new(),
        bytes => format!(", and {bytes} of rays in flight"),
    };
    let title = format!("{}: {} bytes a path{rays}", users.join("; "), state.bytes_per_path);
    let pictures: String = state.tables.iter().map(|table| of_table(table, instances)).collect();
    element("h3", "", &escape(&title)) + &pictures + &fields(state) + &dead(state)
}

/// Names of instances, in the order in which their fields come: what their colours go by on the whole page.
fn instances(states: &[State]) -> Vec<&str> {
    let mut names = Vec::new();
    for field in states.iter().flat_map(|state| &state.tables).flat_map(|table| &table.fields) {
        let name = instance(field);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn instance(field: &FieldReport) -> &str {
    field.name.split('.').next().unwrap_or_default()
}

fn of_table(table: &TableReport, instances: &[&str]) -> String {
    let words = table.bytes / 4;
    let lane = table.lane.max(1);
    let parts = parts(table);
    let title = format!("Table {}: {} bytes, {}, lanes of {} words", table.name, table.bytes, table.order, lane);
    let mut drawing = String::new();
    let mut top = 4.0;
    for first in (0..words).step_by(lane as usize) {
        let row: Vec<&Part> = parts.iter().filter(|part| (first..first + lane).contains(&part.word)).collect();
        let tracks = row.iter().map(|part| part.track + 1).max().unwrap_or(1);
        draw_row(&mut drawing, first, lane.min(words - first), top, tracks as f64 * HEIGHT);
        row.iter().for_each(|part| draw_part(&mut drawing, part, instances, first, top));
        top += tracks as f64 * HEIGHT + 3.0;
    }
    let width = LEFT + f64::from(lane * WORD) * BIT + 4.0;
    let svg = format!(
        "<svg class=\"state\" width=\"{width:.0}\" height=\"{top:.0}\" viewBox=\"0 0 {width:.0} {top:.0}\" role=\"img\"><title>{}</title>{drawing}</svg>",
        escape(&title)
    );
    element("p", "", &escape(&title)) + &svg
}

/// The fields part by part; where fields share bits, each has a track of its own.
fn parts(table: &TableReport) -> Vec<Part<'_>> {
    let mut parts: Vec<Part> = Vec::new();
    for (field, place) in table.fields.iter().flat_map(|field| field.places.iter().map(move |place| (field, place))) {
        let Place { word, shift, bits } = *place;
        let clashes = |track: usize| {
            let same = parts.iter().filter(|part| part.word == word && part.track == track);
            same.into_iter().any(|part| part.shift < shift + bits && shift < part.shift + part.bits)
        };
        let track = (0..).find(|&track| !clashes(track)).unwrap_or_default();
        parts.push(Part { field, word, shift, bits, track });
    }
    parts
}

fn draw_row(out: &mut String, first: u32, words: u32, top: f64, height: f64) {
    let name = if words > 1 { format!("{first}-{}", first + words - 1) } else { first.to_string() };
    text(out, [LEFT - 8.0, top + HEIGHT - 6.0], "text-anchor=\"end\"", &name);
    for word in 0..words {
        let x = LEFT + f64::from(word * WORD) * BIT;
        let width = f64::from(WORD) * BIT;
        out.push_str(&format!(
            "<rect class=\"word\" x=\"{x:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\"/>"
        ));
    }
}

fn draw_part(out: &mut String, part: &Part, instances: &[&str], first: u32, top: f64) {
    let x = LEFT + f64::from((part.word - first) * WORD + part.shift) * BIT;
    let y = top + part.track as f64 * HEIGHT;
    let width = f64::from(part.bits) * BIT;
    let of = instances.iter().position(|name| *name == instance(part.field)).unwrap_or_default();
    let FieldReport { name, codec, bits, shares, .. } = part.field;
    let shared = if shares.is_empty() { String::new() } else { format!("; shares with {}", shares.join(", ")) };
    out.push_str(&format!(
        "<rect class=\"field\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{HEIGHT:.1}\" fill=\"{}\" fill-opacity=\"0.35\"><title>{}</title></rect>",
        colour(of),
        escape(&format!("{name}: {codec}, {bits} bits{shared}"))
    ));
    let room = ((width - 4.0) / LETTER).max(0.0) as usize;
    text(out, [x + 3.0, y + HEIGHT - 6.0], "", &shortened(name, room));
}

/// A name in so many letters, the end of it in any case: that is what tells members apart.
fn shortened(name: &str, room: usize) -> String {
    let letters = name.chars().count();
    if letters <= room {
        return name.to_owned();
    }
    match room {
        0 => String::new(),
        _ => std::iter::once('…').chain(name.chars().skip(letters + 1 - room)).collect(),
    }
}

fn fields(state: &State) -> String {
    let columns = ["table", "codec", "bits", "words", "lowest bit", "shares with"].map(str::to_owned);
    let row = |table: &TableReport, field: &FieldReport| {
        let words: Vec<String> = field.words.iter().map(u32::to_string).collect();
        let cells = [
            table.name.clone(),
            field.codec.clone(),
            field.bits.to_string(),
            words.join(" "),
            field.shift.to_string(),
            field.shares.join(", "),
        ];
        (field.name.clone(), cells.to_vec())
    };
    let rows: Vec<_> =
        state.tables.iter().flat_map(|table| table.fields.iter().map(move |field| row(table, field))).collect();
    let summary = element("summary", "", &format!("{} stored fields", rows.len()));
    element("details", "", &(summary + &table("field", &columns, &rows)))
}

fn dead(state: &State) -> String {
    if state.dead.is_empty() {
        return String::new();
    }
    let rows: Vec<_> = state.dead.iter().map(|dead| (dead.name.clone(), vec![dead.reason.clone()])).collect();
    let summary = element("summary", "", &format!("{} fields are stored nowhere", rows.len()));
    element("details", "", &(summary + &table("field", &["because".to_owned()], &rows)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(name: &str, bits: u32, words: &[u32], shift: u32) -> FieldReport {
        FieldReport {
            name: name.to_owned(),
            codec: "f32".to_owned(),
            bits,
            word: words[0],
            words: words.to_vec(),
            shift,
            places: words.iter().map(|&word| Place { word, shift, bits: bits / words.len() as u32 }).collect(),
            shares: Vec::new(),
        }
    }

    #[test]
    fn fields_that_share_bits_lie_above_each_other() {
        let fields = vec![field("a.x", 96, &[0, 1, 2], 0), field("b.y", 8, &[1], 4), field("b.z", 8, &[1], 12)];
        let table = TableReport { name: "state".to_owned(), bytes: 12, order: "aos".to_owned(), lane: 4, fields };
        let found = parts(&table);
        let places: Vec<_> = found.iter().map(|part| (part.word, part.shift, part.bits, part.track)).collect();
        assert_eq!(places, [(0, 0, 32, 0), (1, 0, 32, 0), (2, 0, 32, 0), (1, 4, 8, 1), (1, 12, 8, 1)]);
    }

    #[test]
    fn long_names_keep_their_ends() {
        assert_eq!(shortened("light.hit.prim", 20), "light.hit.prim");
        assert_eq!(shortened("light.hit.prim", 5), "…prim");
        assert_eq!(shortened("light.hit.prim", 0), "");
    }
}
